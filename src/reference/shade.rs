//! The colour of a point in a lit scene, as [`scene::shading`](crate::scene::shading) defines it.

use std::f64::consts::FRAC_PI_4;

use glam::{DMat3, DVec3};

use super::layer::{Layer, Ray};
use super::texture::{ALPHA, Cubic, Lattice, Texel};
use crate::scene::{Light, Model, Scene, Shading, Source};
use crate::shell::{Frames, Shell};

/// A lit scene.
pub struct Lit<'a> {
    shading: &'a Shading,
    shell: &'a Shell,
    frames: Frames,
}

/// What one tetrahedron adds to the texture along a ray: its directions, and the frame that they are in.
pub struct Surroundings<'a> {
    fine_lattice: Lattice<'a>,
    coarse_lattice: Option<Lattice<'a>>,
    /// Of the current piece.
    pub fine: Cubic,
    /// The same in the next level.
    pub coarse: Cubic,
    /// World space from texture space, at depth 0.
    frame_at_eye: DMat3,
    frame_per_depth: DMat3,
    eye: DVec3,
    /// Of the ray, at unit depth.
    direction: DVec3,
}

impl<'a> Lit<'a> {
    /// `None` where the scene is unlit.
    pub fn of(scene: &'a Scene) -> Option<Self> {
        let shading = scene.shading.as_ref()?;
        let frames = scene.shell.frames(shading.model.frame_kind());
        Some(Self { shading, shell: &scene.shell, frames })
    }

    /// Along the span of a layer, in its tetrahedron.
    pub fn surroundings(&self, tetrahedron: usize, ray: &Ray, layer: &Layer<'_>) -> Surroundings<'a> {
        let at_eye = self.shell.barycentric(tetrahedron, ray.eye);
        let per_depth = self.shell.cells()[tetrahedron].gradients.map(|gradient| gradient.dot(ray.direction));
        let levels = &self.shading.directions.levels;
        let lattice = |level: usize| Lattice::new(&levels[level], layer.texture, layer.texture_slope);
        Surroundings {
            fine_lattice: lattice(layer.level),
            coarse_lattice: layer.is_between().then(|| lattice(layer.level + 1)),
            fine: Cubic::EMPTY,
            coarse: Cubic::EMPTY,
            frame_at_eye: self.frames.at(tetrahedron, at_eye),
            frame_per_depth: self.frames.at(tetrahedron, per_depth),
            eye: ray.eye,
            direction: ray.direction,
        }
    }

    /// The texel as it is lit: its alpha, and the premultiplied colour that it sends to the eye, where `reaching` says which part
    /// of a light that casts shadows reaches it; it is told by how much the colour would be brighter for all of it.
    pub fn shade(
        &self,
        texel: &Texel,
        vector: &Texel,
        surroundings: &Surroundings<'_>,
        depth: f64,
        mut reaching: impl FnMut(usize, f64) -> f64,
    ) -> Texel {
        let Shading { model, ambient, diffuse, specular, shininess, emission, lights, .. } = self.shading;
        let point = surroundings.eye + depth * surroundings.direction;
        let to_eye = -surroundings.direction.normalize();
        let [x, y, z, weight, _] = *vector;
        let in_texture = DVec3::new(x, y, z);
        let frame = surroundings.frame_at_eye + depth * surroundings.frame_per_depth;
        let direction = (frame * in_texture).normalize_or_zero();
        let agreement = if direction == DVec3::ZERO { 0.0 } else { (in_texture.length() / weight).min(1.0) };
        let alpha = texel[ALPHA];
        let colour = DVec3::new(texel[0], texel[1], texel[2]) / alpha;
        let (mut scattered, mut mirrored) = (*ambient, DVec3::ZERO);
        for (number, light) in lights.iter().enumerate() {
            let (mut arriving, to_light) = arriving(light, point);
            let (aligned, lobe, mean) = match model {
                Model::Surface => {
                    let facing = direction.dot(to_light).max(0.0);
                    let half = (to_light + to_eye).normalize_or_zero();
                    (facing, facing * direction.dot(half).max(0.0).powf(*shininess), 0.25)
                }
                Model::Fibre => {
                    let (along, along_eye) = (direction.dot(to_light), direction.dot(to_eye));
                    let [across, across_eye] =
                        [along, along_eye].map(|cosine: f64| (1.0 - cosine * cosine).max(0.0).sqrt());
                    let off_cone = across * across_eye - along * along_eye;
                    (across, off_cone.max(0.0).powf(*shininess), FRAC_PI_4)
                }
            };
            let scatter = diffuse * (agreement * aligned + (1.0 - agreement) * mean);
            let mirror = specular * agreement * lobe;
            if light.shadow {
                let brightness = (arriving * (colour * scatter + mirror)).max_element();
                if brightness > 0.0 {
                    arriving *= reaching(number, brightness);
                }
            }
            scattered += arriving * scatter;
            mirrored += arriving * mirror;
        }
        let brightest = colour.max_element();
        scattered += emission.glow * ((brightest - emission.from) / (1.0 - emission.from)).clamp(0.0, 1.0);
        let mut lit = *texel;
        for channel in 0..3 {
            lit[channel] = texel[channel] * scattered[channel] + alpha * mirrored[channel];
        }
        lit
    }
}

/// The light that reaches a point where nothing stands between the two, and the unit vector towards it.
pub fn arriving(light: &Light, point: DVec3) -> (DVec3, DVec3) {
    match light.source {
        Source::Directional { towards } => (light.colour, towards),
        Source::Point { position, falloff } => {
            let way = position - point;
            let left =
                falloff.map_or(1.0, |falloff| 1.0 / (1.0 + way.length_squared() / (falloff * falloff)));
            (left * light.colour, way.normalize_or_zero())
        }
    }
}

impl Surroundings<'_> {
    /// Loads the cubics of a piece.
    pub fn load(&mut self, from: f64, to: f64) {
        self.fine = self.fine_lattice.cubic(from, to).unwrap_or(Cubic::EMPTY);
        self.coarse =
            self.coarse_lattice.as_mut().and_then(|lattice| lattice.cubic(from, to)).unwrap_or(Cubic::EMPTY);
    }
}
