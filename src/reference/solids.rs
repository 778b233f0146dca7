//! Opaque triangles: which of them a path meets first, and what colour it has, as [`scene::solid`](crate::scene::solid) defines it.
//!
//! The test is that of S. Woop, C. Benthin, I. Wald, *Watertight ray/triangle intersection*, 2013: the triangle is sheared so that
//! the path runs along an axis, and the signs of three edge functions tell whether it passes within. Two triangles compute
//! the function of an edge that they share from the same two vertices, by the same products, so that its value in one is exactly
//! the negative of that in the other: no path passes between the two. On the edge itself both are met.

use glam::{DVec2, DVec3};

use super::Reference;
use super::hierarchy::{Hierarchy, Path};
use super::shade::arriving;
use super::texture::Lattice;
use super::umbra::{Beacon, Umbra};
use crate::scene::{Scene, Shading, Solid};

/// All triangles of all solids of a scene.
pub struct Solids<'a> {
    solids: &'a [Solid],
    triangles: Vec<Triangle>,
    hierarchy: Hierarchy,
}

struct Triangle {
    solid: u32,
    /// In its solid.
    index: u32,
    /// Relative to the eye.
    corners: [DVec3; 3],
}

/// Where a path meets a triangle.
#[derive(Debug, Clone, Copy)]
pub struct Hit {
    /// In the path's own measure.
    pub place: f64,
    /// Number of the triangle among all of the scene.
    pub triangle: usize,
    barycentric: [f64; 3],
}

impl<'a> Solids<'a> {
    /// Prepares the solids of a scene for paths that are measured from this eye.
    pub fn new(scene: &'a Scene, eye: DVec3) -> Self {
        let solids = &scene.solids[..];
        let of_all = solids.iter().enumerate().flat_map(|(solid, of)| {
            (0..of.mesh.triangles.len()).map(move |index| Triangle {
                solid: solid as u32,
                index: index as u32,
                corners: of.corners(index).map(|corner| corner - eye),
            })
        });
        let triangles: Vec<Triangle> = of_all.collect();
        let hierarchy = Hierarchy::new(triangles.iter().map(|triangle| triangle.corners).enumerate());
        Self { solids, triangles, hierarchy }
    }

    /// The first triangle on the path, and where several are met at one place the first of these.
    pub fn first(&self, path: &Path) -> Option<Hit> {
        let shear = Shear::new(path);
        let mut first: Option<Hit> = None;
        self.hierarchy.visit(path, |triangle, end| {
            if let Some((place, barycentric)) = shear.meet(&self.triangles[triangle].corners)
                && place > path.from
                && place <= *end
                && first.is_none_or(|first| place < first.place || triangle < first.triangle)
            {
                first = Some(Hit { place, triangle, barycentric });
                *end = place;
            }
        });
        first
    }

    /// Whether there is any on the path but `own`.
    pub fn hide(&self, path: &Path, own: Option<usize>) -> bool {
        let shear = Shear::new(path);
        let mut is_hidden = false;
        self.hierarchy.visit(path, |triangle, end| {
            if own != Some(triangle)
                && let Some((place, _)) = shear.meet(&self.triangles[triangle].corners)
                && place > path.from
                && place < path.to
            {
                is_hidden = true;
                *end = f64::NEG_INFINITY;
            }
        });
        is_hidden
    }

    /// The shadow that they cast on a part of the eye's ray: see [`Umbra::new`].
    pub fn umbra(&self, direction: DVec3, beacon: Beacon, range: [f64; 2], extent: f64) -> Umbra {
        let corners = |triangle: usize| &self.triangles[triangle].corners;
        Umbra::new(&self.hierarchy, corners, direction, beacon, range, extent)
    }

    /// What the eye sees of a triangle that it meets at the depth of `hit` along `direction`, where `reaching` says which part of a
    /// light reaches the point, relative to the eye.
    pub fn colour(
        &self,
        reference: &Reference<'_>,
        direction: DVec3,
        hit: &Hit,
        mut reaching: impl FnMut(usize, DVec3) -> f64,
    ) -> DVec3 {
        let triangle = &self.triangles[hit.triangle];
        let solid = &self.solids[triangle.solid as usize];
        let index = triangle.index as usize;
        let detail = reference.lod_footprint * hit.place * reference.view.pixel_at_unit_depth();
        let colour = solid.colour * texture(solid, index, hit, detail);
        let Some(shading) = &reference.scene.shading else { return colour };
        let Shading { ambient, diffuse, specular, shininess, lights, .. } = shading;
        let to_eye = -direction.normalize();
        let [a, b, c] = triangle.corners;
        let face = (b - a).cross(c - a);
        let side = face.dot(to_eye);
        let normals = solid.mesh.triangles[index].map(|id| solid.mesh.normals[id as usize]);
        let normal: DVec3 = normals.into_iter().zip(hit.barycentric).map(|(n, weight)| n * weight).sum();
        let normal = if side < 0.0 { -normal } else { normal }.normalize_or_zero();
        let point = hit.place * direction;
        let (mut scattered, mut mirrored) = (*ambient, DVec3::ZERO);
        for (number, light) in lights.iter().enumerate() {
            let (light_colour, to_light) = arriving(light, reference.view.camera.eye + point);
            let facing = normal.dot(to_light).max(0.0);
            if facing == 0.0 || face.dot(to_light) * side <= 0.0 {
                continue;
            }
            let half = (to_light + to_eye).normalize_or_zero();
            let lobe = facing * normal.dot(half).max(0.0).powf(*shininess);
            let left = if light.shadow { reaching(number, point) } else { 1.0 };
            scattered += light_colour * (left * diffuse * facing);
            mirrored += light_colour * (left * specular * lobe);
        }
        colour * scattered + mirrored
    }
}

/// What the texture has where a triangle is met; `detail` as in [`Layer`](super::layer::Layer), for one texel a world unit.
fn texture(solid: &Solid, triangle: usize, hit: &Hit, detail: f64) -> DVec3 {
    let Some(texture) = &solid.texture else { return DVec3::ONE };
    let corners = solid.mesh.uvs[triangle].into_iter().zip(hit.barycentric);
    let uv: DVec2 = corners.map(|(uv, weight)| uv * weight).sum();
    let last = texture.levels.len() - 1;
    let level_of_detail = (detail * solid.texels_per_unit(triangle)).log2().clamp(0.0, last as f64);
    let level = (level_of_detail as usize).min(last);
    let at = |level: usize| {
        // Of a ray that stands still.
        let mut lattice: Lattice<'_> = Lattice::new(&texture.levels[level], uv.extend(0.5), DVec3::ZERO);
        let [r, g, b, ..] = lattice.cubic(0.0, 0.0).map_or([0.0; 5], |cubic| cubic.at(0.0));
        DVec3::new(r, g, b)
    };
    at(level).lerp(at((level + 1).min(last)), level_of_detail - level as f64)
}

/// The largest of red, green and blue of any solid, unlit.
pub fn brightness(solids: &[Solid]) -> f64 {
    let of_texture = |solid: &Solid| {
        let levels = solid.texture.iter().flat_map(|texture| &texture.levels);
        let texels = levels.flat_map(|level| &level.texels);
        texels.map(|[r, g, b, _]| f64::from(r.max(*g).max(*b))).reduce(f64::max).unwrap_or(1.0)
    };
    solids.iter().map(|solid| solid.colour.max_element() * of_texture(solid)).fold(0.0, f64::max)
}

/// Takes a path to the positive direction of the third axis.
struct Shear {
    start: DVec3,
    axes: [usize; 3],
    /// Of the first two axes per unit of the third, and the place on the path per unit of the third.
    slopes: DVec3,
}

impl Shear {
    fn new(path: &Path) -> Self {
        let along = path.direction.abs().max_position();
        let axes = [(along + 1) % 3, (along + 2) % 3, along];
        let [x, y, z] = axes.map(|axis| path.direction[axis]);
        Self { start: path.start, axes, slopes: DVec3::new(x / z, y / z, 1.0 / z) }
    }

    /// The place on the path at which it meets the triangle, whatever the path's ends, and the barycentric coordinates there.
    fn meet(&self, corners: &[DVec3; 3]) -> Option<(f64, [f64; 3])> {
        let [a, b, c] = corners.map(|corner| {
            let [x, y, z] = self.axes.map(|axis| (corner - self.start)[axis]);
            DVec3::new(x - self.slopes.x * z, y - self.slopes.y * z, self.slopes.z * z)
        });
        let edges = [c.x * b.y - c.y * b.x, a.x * c.y - a.y * c.x, b.x * a.y - b.y * a.x];
        let sum: f64 = edges.iter().sum();
        let is_outside = edges.iter().any(|&edge| edge < 0.0) && edges.iter().any(|&edge| edge > 0.0);
        if is_outside || sum == 0.0 {
            return None;
        }
        let barycentric = edges.map(|edge| edge / sum);
        let place = barycentric[0] * a.z + barycentric[1] * b.z + barycentric[2] * c.z;
        Some((place, barycentric))
    }
}
