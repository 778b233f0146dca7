//! How a light sees the scene: as a camera does, through one lens or six. A light that casts shadows reaches a point with what
//! the medium and the solids between the two let through,
//!
//! ```text
//!   E = light * V exp(-integral of sigma from the light to the point)      V: 0 behind a solid, else 1
//! ```
//!
//! where `sigma` is read at the level of detail that the *light's* pixels ask for, by the medium's own rule: a point at distance
//! `r` from a light is read at `log2(lod_footprint * r * pixel * rho)`, and one that a directional light shines on at
//! `log2(lod_footprint * pixel * rho)`, `rho` being [`texels_across`](super::Scene::texels_across) the ray. This belongs to the
//! medium, as the eye's level of detail does. It does not depend on the eye, so that shadows stand still while the camera moves,
//! and are drawn once.
//!
//! T. Lokovic, E. Veach, *Deep shadow maps*, 2000, is where such pictures of a light come from.

use glam::DVec3;

use super::camera::CameraFrame;
use super::{Light, Scene, Source};

/// The picture that a light takes, or one of six.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightView {
    /// World space: where rays start, or, of parallel rays, the one in the middle.
    pub origin: DVec3,
    /// Forward is where the light shines.
    pub frame: CameraFrame,
    /// Whether rays are parallel; else they start at the origin.
    pub is_parallel: bool,
    /// Distance of pixel centres: in world units where rays are parallel, else at depth 1.
    pub pixel: f64,
    /// Depth, in world units, beyond which there is nothing.
    pub far: f64,
}

/// By how much pictures of a point light's six sides overlap, and those of others are too large, in pixels a side: what is
/// read between pixels is there.
const BORDER: f64 = 2.0;

impl LightView {
    /// The pictures of a light, each of `size` times `size` pixels, that together show all of the scene: one of parallel rays, one
    /// from a point outside, six from a point in the midst, along the axes. The scene is a sphere around it.
    pub fn of(light: &Light, centre: DVec3, radius: f64, size: u32) -> Vec<Self> {
        let size = f64::from(size);
        let widen = size / (size - 2.0 * BORDER);
        match light.source {
            Source::Directional { towards } => vec![Self {
                origin: centre + radius * towards,
                frame: looking_along(-towards),
                is_parallel: true,
                pixel: 2.0 * radius * widen / size,
                far: 2.0 * radius,
            }],
            Source::Point { position, .. } => {
                let way = centre - position;
                let distance = way.length();
                let sine = radius / distance;
                let view = |forward: DVec3, tangent: f64| Self {
                    origin: position,
                    frame: looking_along(forward),
                    is_parallel: false,
                    pixel: 2.0 * tangent * widen / size,
                    far: distance + radius,
                };
                // Within 45 degrees of the middle, as each of six.
                if sine < std::f64::consts::FRAC_1_SQRT_2 {
                    vec![view(way / distance, sine / (1.0 - sine * sine).sqrt())]
                } else {
                    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
                    axes.into_iter().flat_map(|axis| [view(axis, 1.0), view(-axis, 1.0)]).collect()
                }
            }
        }
    }

    /// Distance of pixel centres in parts of `far`: of parallel rays, else at depth 1.
    pub fn pixel_of_far(&self) -> f64 {
        if self.is_parallel { self.pixel / self.far } else { self.pixel }
    }

    /// A point of world space relative to the origin, in parts of `far`: to the right, upwards, and forward.
    pub fn place(&self, point: DVec3) -> DVec3 {
        self.frame.view_from_world() * (point - self.origin) / self.far
    }
}

/// Any axes with this forward, a unit vector.
fn looking_along(forward: DVec3) -> CameraFrame {
    let up = forward.any_orthonormal_vector();
    CameraFrame { right: forward.cross(up), up, forward }
}

impl Scene {
    /// A sphere around all that a light may shine on: centre and radius, in world units.
    pub fn bounds(&self) -> (DVec3, f64) {
        let points = || {
            let solids = self.solids.iter().flat_map(|solid| &solid.mesh.positions);
            self.shell.vertices.iter().chain(solids).copied()
        };
        let Some(first) = points().next() else { return (DVec3::ZERO, 1.0) };
        let (low, high) = points().fold((first, first), |(low, high), p| (low.min(p), high.max(p)));
        let centre = 0.5 * (low + high);
        let radius = points().map(|p| p.distance(centre)).fold(0.0, f64::max);
        (centre, if radius > 0.0 { radius } else { 1.0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn views(source: Source) -> Vec<LightView> {
        let light = Light { source, colour: DVec3::ONE, shadow: true };
        LightView::of(&light, DVec3::new(1.0, 2.0, 3.0), 2.0, 100)
    }

    #[test]
    fn a_light_outside_takes_one_picture_and_one_within_six() {
        assert_eq!(views(Source::Directional { towards: DVec3::Y }).len(), 1);
        let from = |position| views(Source::Point { position, falloff: None });
        assert_eq!(from(DVec3::new(1.0, 2.0, 9.0)).len(), 1);
        assert_eq!(from(DVec3::new(1.0, 2.0, 5.5)).len(), 6);
        assert_eq!(from(DVec3::new(1.0, 2.0, 3.0)).len(), 6);
    }

    #[test]
    fn every_point_of_the_scene_is_in_a_picture_with_a_pixel_beside() {
        let sources = [
            Source::Directional { towards: DVec3::new(0.6, 0.0, 0.8) },
            Source::Point { position: DVec3::new(4.0, 4.0, 4.0), falloff: None },
            Source::Point { position: DVec3::new(1.5, 2.0, 3.0), falloff: None },
        ];
        for source in sources {
            let views = views(source);
            for i in 0..500 {
                // A spiral over the sphere.
                let height = 1.0 - f64::from(i) / 249.5;
                let (sine, cosine) = (2.4 * f64::from(i)).sin_cos();
                let around = DVec3::new(cosine, sine, 0.0) * (1.0 - height * height).max(0.0).sqrt();
                let point = DVec3::new(1.0, 2.0, 3.0) + 2.0 * (around + height * DVec3::Z);
                let is_seen = |view: &LightView| {
                    let way = point - view.origin;
                    let depth = way.dot(view.frame.forward);
                    let scale = view.pixel * if view.is_parallel { 1.0 } else { depth };
                    let [x, y] = [view.frame.right, view.frame.up].map(|axis| way.dot(axis) / scale);
                    depth >= -1e-12 && depth <= view.far + 1e-12 && x.abs().max(y.abs()) <= 48.0 + 1e-9
                };
                assert!(views.iter().any(is_seen), "{point} from {source:?}");
            }
        }
    }
}
