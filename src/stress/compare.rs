//! How far a picture is from the exact one, and how much of that rounding explains.
//!
//! # What f32 explains
//!
//! The shaders work in f32, whose roundings are of `u = 2^-24`. Three things follow for a pixel, and [`excess`] allows for
//! their sum and no more:
//!
//! - *Direction.* Some eight roundings of ray and plane turn one against the other by at most `8 u = 5e-7` radians: the exact
//!   picture may be moved by so much in any direction, and twice its change covers kinks within that distance.
//! - *Distance.* An entry or exit at distance `z` is off by four roundings of it, which is `4 u z sigma` of optical depth; two
//!   ends, seen at 60 degrees from the normal at most: `16 u z sigma`. At steeper angles the first term is the larger one.
//! - *Arithmetic.* Some 16 roundings from the length to the opacity of a segment, and one a blend: `(16 + n) u`, for the `n`
//!   tetrahedra on a ray; 64 stand for all.

use glam::DVec2;
use rayon::prelude::*;

use crate::frame::Image;
use crate::reference::Reference;
use crate::scene::{Scene, View};

/// Half of what f32 represents next to 1: one rounding.
pub const ROUNDING: f64 = 1.0 / (1 << 24) as f64;

/// By how many radians rounding turns a ray: see the head of this file.
const TURN: f64 = 8.0 * ROUNDING;

/// An error of transmittance that no rounding explains: a tetrahedron was left out, or counted twice. It is four times the
/// worst that rounding was seen to make of the media compared here.
pub const LOST: f64 = 2e-3;

/// What one picture of a constant medium showed.
#[derive(Debug, Clone, Default)]
pub struct Transmittance {
    /// Absolute errors, one a pixel.
    pub errors: Vec<f64>,
    /// Pixels whose ray passes more than a rounding of medium, but which stayed clear, or the other way round.
    pub missed: usize,
    /// Pixels off by more than [`LOST`].
    pub miscounted: usize,
}

/// Compares the `alpha` of every pixel with the exact path length through `scene`, whose medium is constant.
pub fn transmittance(scene: &Scene, view: &View, alpha: &[f64]) -> Transmittance {
    let reference = Reference::new(scene, view);
    let per_length = extinction(scene);
    let exact: Vec<f64> = (0..alpha.len())
        .into_par_iter()
        .map(|i| (-per_length * reference.path_length(centre(view, i))).exp())
        .collect();
    let errors: Vec<f64> =
        exact.iter().zip(alpha).map(|(exact, alpha)| (exact - (1.0 - alpha)).abs()).collect();
    // A pixel is missed, or covered for nothing, when its error is that of its whole opacity, and that is more than `LOST`.
    let missed = exact.iter().zip(alpha).filter(|(exact, alpha)| {
        (**alpha == 0.0 && **exact < 1.0 - LOST) || (**alpha > LOST && **exact == 1.0)
    });
    Transmittance {
        missed: missed.count(),
        miscounted: errors.iter().filter(|error| **error > LOST).count(),
        errors,
    }
}

/// The largest error of a channel of a pixel of `image` against the reference, as a multiple of what f32 explains: up to 1
/// all is rounding.
pub fn excess(scene: &Scene, view: &View, image: &Image) -> f64 {
    let reference = Reference::new(scene, view);
    let reach =
        scene.shell.vertices.iter().map(|vertex| vertex.distance(view.camera.eye)).fold(0.0, f64::max);
    let rounding = ROUNDING * (16.0 + 64.0 + 16.0 * reach * extinction(scene));
    let of_pixel = |i: usize| {
        let exact = reference.integrate_ray(centre(view, i)).rgba;
        let error = distance(exact, image.rgba[i].map(f64::from));
        if error <= rounding {
            return error / rounding;
        }
        // Away from the middle of the picture an angle takes up more of it.
        let ray = view.ray_at_unit_depth(centre(view, i));
        let shift = TURN * ray.length_squared() / view.pixel_at_unit_depth();
        let change = AROUND.map(|direction| {
            distance(reference.integrate_ray(centre(view, i) + shift * direction).rgba, exact)
        });
        error / (rounding + 2.0 * change.into_iter().fold(0.0, f64::max))
    };
    (0..image.rgba.len()).into_par_iter().map(of_pixel).reduce(|| 0.0, f64::max)
}

/// Eight directions in pixels.
pub const AROUND: [DVec2; 8] = [
    DVec2::X,
    DVec2::NEG_X,
    DVec2::Y,
    DVec2::NEG_Y,
    DVec2::ONE,
    DVec2::NEG_ONE,
    DVec2::new(1.0, -1.0),
    DVec2::new(-1.0, 1.0),
];

/// The largest of any texel, per world unit; that of a wall does not count, since no distance in it does.
pub fn extinction(scene: &Scene) -> f64 {
    let texels = &scene.volume.levels[0].texels;
    let alpha = texels.iter().map(|texel| f64::from(texel[3])).filter(|alpha| *alpha < 1.0);
    -(-alpha.fold(0.0, f64::max)).ln_1p() / scene.medium.opacity_distance
}

/// The centre of the pixel stored at `index`.
pub fn centre(view: &View, index: usize) -> DVec2 {
    let width = view.width as usize;
    DVec2::new((index % width) as f64, (index / width) as f64) + 0.5
}

/// The largest difference of a channel; infinite where one is no number.
fn distance(a: [f64; 4], b: [f64; 4]) -> f64 {
    let differences = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    differences
        .map(|difference| if difference.is_nan() { f64::INFINITY } else { difference })
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::{Interrupt, Silent};
    use crate::reference;
    use crate::stress::scenes::{PAINTS, painted, ring, view};
    use glam::DVec3;

    #[test]
    fn the_reference_has_no_excess_and_one_wrong_pixel_has() {
        let view = view(DVec3::new(0.0, 0.0, 8.0), DVec3::ZERO, 24.0, 0.01, 48);
        let scene = painted(ring(3), &PAINTS, 0.1, view);
        let mut image = reference::render(&scene, &view, &Silent, &Interrupt::default()).unwrap().image;
        // Rounded to f32 once, of the 80 that are allowed for.
        assert!(excess(&scene, &view, &image) < 0.1);
        // Nothing is near the first pixel, so no turn of the ray explains colour there; in so dense a medium, a distance of 9
        // explains 2e-4.
        for wrong in [1e-3, f32::NAN] {
            image.rgba[0][1] += wrong;
            assert!(excess(&scene, &view, &image) > 1.0);
        }
    }
}
