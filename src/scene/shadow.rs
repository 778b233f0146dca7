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

use glam::{DVec2, DVec3};
use rayon::prelude::*;

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
    /// The pictures of a light, each of `size` times `size` pixels, that together show all of the scene: one of parallel rays, about as
    /// small a square as they see it in; one from a point outside, six from a point in the midst, along the axes, of a sphere around it.
    pub fn of(light: &Light, extent: &Extent, size: u32) -> Vec<Self> {
        let Extent { centre, radius, .. } = *extent;
        let size = f64::from(size);
        let widen = size / (size - 2.0 * BORDER);
        match light.source {
            Source::Directional { towards } => {
                let Square { frame, middle, side } = extent.square_along(-towards);
                vec![Self {
                    origin: middle + radius * towards,
                    frame,
                    is_parallel: true,
                    pixel: side * widen / size,
                    far: 2.0 * radius,
                }]
            }
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

/// All that a light may shine on.
#[derive(Debug, Clone, PartialEq)]
pub struct Extent {
    /// Of a sphere around it, in world space.
    pub centre: DVec3,
    /// In world units; positive.
    pub radius: f64,
    /// What it is spanned by.
    points: Vec<DVec3>,
}

/// A square around all, across a direction.
struct Square {
    /// Its sides are along `right` and `up`.
    frame: CameraFrame,
    /// In the plane of the extent's centre.
    middle: DVec3,
    side: f64,
}

/// How many directions of a square's sides are tried, over a quarter of a turn: the best of all is at most a degree from one of them, so
/// that the square is at most 1.8 % too large.
const TURNS: usize = 45;

/// By how much more it may be too large for the first of several directions to be taken: neither rounding nor a shape that moves a little
/// should turn it.
const SLACK: f64 = 0.01;

impl Extent {
    /// Of all that lies between these points, in world space.
    pub fn of(points: Vec<DVec3>) -> Self {
        let points = if points.is_empty() { vec![DVec3::ZERO] } else { points };
        let first = points[0];
        let (low, high) = points.iter().fold((first, first), |(low, high), &p| (low.min(p), high.max(p)));
        let centre = 0.5 * (low + high);
        let radius = points.iter().map(|p| p.distance(centre)).fold(0.0, f64::max);
        Self { centre, radius: if radius > 0.0 { radius } else { 1.0 }, points }
    }

    /// The smallest square, of those that are tried, in which all is seen along a unit vector.
    fn square_along(&self, forward: DVec3) -> Square {
        let CameraFrame { right, up, .. } = looking_along(forward);
        let seen = |point: &DVec3| {
            let way = *point - self.centre;
            DVec2::new(way.dot(right), way.dot(up))
        };
        let seen: Vec<DVec2> = self.points.par_iter().map(seen).collect();
        // From where to where it reaches along each direction of half a turn.
        let reach = |turn: usize| {
            let axis = DVec2::from_angle(std::f64::consts::FRAC_PI_2 * turn as f64 / TURNS as f64);
            let places = seen.iter().map(|point| point.dot(axis));
            let [low, high] = places.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], place| {
                [low.min(place), high.max(place)]
            });
            (axis, low, high)
        };
        let reaches: Vec<(DVec2, f64, f64)> = (0..2 * TURNS).into_par_iter().map(reach).collect();
        let length = |(_, low, high): (DVec2, f64, f64)| high - low;
        let side = |turn: usize| length(reaches[turn]).max(length(reaches[turn + TURNS]));
        let least = (0..TURNS).map(side).fold(f64::INFINITY, f64::min);
        let is_good = |&turn: &usize| side(turn) <= (1.0 + SLACK) * least;
        let turn = (0..TURNS).find(is_good).expect("the least is");
        let along = |axis: DVec2| axis.x * right + axis.y * up;
        let [across, upwards] = [turn, turn + TURNS].map(|turn| reaches[turn]);
        let middle = |(axis, low, high): (DVec2, f64, f64)| 0.5 * (low + high) * along(axis);
        Square {
            frame: CameraFrame { right: along(across.0), up: along(upwards.0), forward },
            middle: self.centre + middle(across) + middle(upwards),
            // Of what is seen end-on there is next to nothing.
            side: side(turn).max(1e-6 * self.radius),
        }
    }
}

impl Scene {
    /// All that a light may shine on.
    pub fn extent(&self) -> Extent {
        let solids = self.solids.iter().flat_map(|solid| &solid.mesh.positions);
        Extent::of(self.shell.vertices.iter().chain(solids).copied().collect())
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;

    const CENTRE: DVec3 = DVec3::new(1.0, 2.0, 3.0);

    /// A spiral over a sphere.
    fn sphere() -> Extent {
        let point = |i: u32| {
            let height = 1.0 - f64::from(i) / 249.5;
            let (sine, cosine) = (2.4 * f64::from(i)).sin_cos();
            let around = DVec3::new(cosine, sine, 0.0) * (1.0 - height * height).max(0.0).sqrt();
            CENTRE + 2.0 * (around + height * DVec3::Z)
        };
        Extent::of((0..500).map(point).collect())
    }

    /// The corners of a box around `CENTRE`, turned about z.
    fn turned_box(half: DVec3, degrees: f64) -> Extent {
        let turn = DQuat::from_rotation_z(degrees.to_radians());
        let corner = |i: u32| {
            CENTRE + turn * (half * DVec3::from([0, 1, 2].map(|k| f64::from(i >> k & 1) * 2.0 - 1.0)))
        };
        Extent::of((0..8).map(corner).collect())
    }

    fn views(source: Source, extent: &Extent) -> Vec<LightView> {
        LightView::of(&Light { source, colour: DVec3::ONE, shadow: true }, extent, 100)
    }

    #[test]
    fn a_light_outside_takes_one_picture_and_one_within_six() {
        let views = |source| views(source, &sphere());
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
        let boxes = [0.0, 17.0, 45.0, 80.0].map(|degrees| turned_box(DVec3::new(1.5, 0.4, 0.1), degrees));
        for (source, extent) in sources.iter().flat_map(|&source| {
            [sphere()].into_iter().chain(boxes.clone()).map(move |extent| (source, extent))
        }) {
            let views = views(source, &extent);
            for &point in &extent.points {
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

    #[test]
    fn a_scene_that_is_moved_or_scaled_is_seen_alike() {
        let towards = DVec3::new(0.3, 0.5, 0.8).normalize();
        // Of these the square is the same whichever of many ways it is turned.
        for extent in [sphere(), turned_box(DVec3::ONE, 0.0), turned_box(DVec3::new(1.0, 1.0, 0.0), 30.0)] {
            let view = views(Source::Directional { towards }, &extent)[0];
            for (scale, by) in [(1.0, DVec3::splat(1e6)), (1e-6, DVec3::ZERO), (1e6, DVec3::X)] {
                let points = extent.points.iter().map(|&point| scale * point + by).collect();
                let moved = views(Source::Directional { towards }, &Extent::of(points))[0];
                assert_eq!(moved.frame.right, view.frame.right, "{scale} {by}");
                assert!((moved.pixel / scale / view.pixel - 1.0).abs() < 1e-8, "{scale} {by}");
            }
        }
    }

    #[test]
    fn a_picture_of_parallel_rays_is_as_small_a_square_as_what_it_shows() {
        let along_z = Source::Directional { towards: DVec3::Z };
        for degrees in [0.0, 17.0, 45.0, 80.0] {
            let square = turned_box(DVec3::new(1.0, 1.0, 0.3), degrees);
            let side = views(along_z, &square)[0].pixel * 96.0;
            // By one degree, half of what two directions are apart, it is larger by the sine.
            let most = (1.0 + 0.0175) * (1.0 + SLACK);
            assert!((2.0 - 1e-12..=2.0 * most).contains(&side), "{side} at {degrees}");
            // Of a rod the sides are along its diagonals.
            let rod = turned_box(DVec3::new(1.0, 0.0, 0.0), degrees);
            let side = views(along_z, &rod)[0].pixel * 96.0;
            let least = 2.0 * 0.5_f64.sqrt();
            assert!((least - 1e-12..=least * most).contains(&side), "{side} at {degrees}");
        }
        // What is seen end-on has no extent: the picture has.
        let towards = DVec3::new(0.3, 0.5, 0.8).normalize();
        let rod = Extent::of(vec![CENTRE, CENTRE + towards]);
        assert!(views(Source::Directional { towards }, &rod)[0].pixel > 1e-9);
        assert!(views(along_z, &Extent::of(vec![CENTRE]))[0].pixel > 0.0);
        assert!(views(along_z, &Extent::of(Vec::new()))[0].pixel > 0.0);
    }
}
