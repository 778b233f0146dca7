//! Stretch and shear of the texture map: how the material in a tetrahedron is deformed since the frame at rest.
//!
//! Let `J` be the Jacobian of the map from texture to world in a tetrahedron, at rest and now. A small piece of the texture that
//! lay along `dx` at rest lies along `F dx` now, `F = J_now J_rest^-1`: the deformation gradient. Its singular values
//! `s1 >= s2 >= s3` are the factors by which the piece is stretched along three directions at right angles. As P. Sander, J.
//! Snyder, S. Gortler and H. Hoppe measure a parameterisation (*Texture Mapping Progressive Meshes*, SIGGRAPH 2001), `s1` is
//! the stretch in the `L inf` norm, and the root of the mean of `(s1^2 + s2^2 + s3^2) / 3`, weighted by the volume at rest, that
//! in the `L2` norm. Here there are three dimensions, and the map is measured against the one at rest: what moves as a rigid
//! body has 1 everywhere.
//!
//! Of all directions that were at right angles, those half way between the first and the last principal direction depart the
//! most from it, by `asin((s1^2 - s3^2) / (s1^2 + s3^2))`: that is the shear.
//!
//! Where the texture coordinates of a tetrahedron have not changed, but for a shift, `F` is found from the vertices alone,
//! however flat the texture is in it.

use glam::{DMat3, DVec3};
use rayon::prelude::*;
use serde::Serialize;

use crate::shell::{Cell, Shell};

/// Of a frame, against the frame at rest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Stretch {
    /// The least singular value; 1 is no stretch, less is compression.
    pub least: f64,
    /// The tetrahedron where it is.
    pub least_at: u32,
    /// The greatest singular value: Sander's `L inf`.
    pub greatest: f64,
    /// The tetrahedron where it is.
    pub greatest_at: u32,
    /// Root mean square over the volume at rest: Sander's `L2`.
    pub rms: f64,
    /// The greatest departure from a right angle, in degrees.
    pub shear_degrees: f64,
    /// The tetrahedron where it is.
    pub shear_at: u32,
    /// Tetrahedra without volume at rest, or in whose texture there is none while it changes: they tell nothing.
    pub unmeasured: u64,
}

/// The singular values of the deformation gradient of each tetrahedron, descending; `None` where there is no such gradient.
/// The shells have one topology.
pub fn deformations(rest: &Shell, now: &Shell) -> Vec<Option<[f64; 3]>> {
    let maps = rest.cells();
    let of_one = |(t, maps): (usize, &Cell)| gradient(rest, maps, now, t).map(singular_values);
    maps.par_iter().enumerate().map(of_one).collect()
}

impl Stretch {
    /// Of what [`deformations`] tells.
    pub fn of(rest: &Shell, deformations: &[Option<[f64; 3]>]) -> Self {
        let mut stretch = Self {
            least: f64::INFINITY,
            least_at: 0,
            greatest: 0.0,
            greatest_at: 0,
            rms: 0.0,
            shear_degrees: 0.0,
            shear_at: 0,
            unmeasured: 0,
        };
        let (mut squares, mut volume) = (0.0, 0.0);
        for (t, deformation) in deformations.iter().enumerate() {
            let &Some(values @ [first, _, last]) = deformation else {
                stretch.unmeasured += 1;
                continue;
            };
            let id = t as u32;
            if last < stretch.least {
                (stretch.least, stretch.least_at) = (last, id);
            }
            if first > stretch.greatest {
                (stretch.greatest, stretch.greatest_at) = (first, id);
            }
            let shear = shear(values).to_degrees();
            if shear > stretch.shear_degrees {
                (stretch.shear_degrees, stretch.shear_at) = (shear, id);
            }
            let weight = rest.determinant(t).abs();
            squares += weight * values.iter().map(|value| value * value).sum::<f64>() / 3.0;
            volume += weight;
        }
        if volume > 0.0 {
            stretch.rms = (squares / volume).sqrt();
        } else {
            // Nothing was measured.
            (stretch.least, stretch.greatest, stretch.rms) = (1.0, 1.0, 1.0);
        }
        stretch
    }
}

/// Radians.
fn shear([first, _, last]: [f64; 3]) -> f64 {
    let (a, b) = (first * first, last * last);
    if a > 0.0 { ((a - b) / (a + b)).asin() } else { 0.0 }
}

fn gradient(rest: &Shell, maps: &Cell, now: &Shell, t: usize) -> Option<DMat3> {
    if !rest.has_maps(t) {
        return None;
    }
    let edges = edges(now.vertices_of(t));
    let [before, after] = [rest, now].map(|shell| self::edges(shell.texture[t]));
    // Coordinates are told to some 1e-16 of their size, which is that of the texture's whole turns.
    let size = 1.0 + after.to_cols_array().into_iter().map(f64::abs).fold(0.0, f64::max);
    let barycentric_from_world = DMat3::from_cols_array_2d(&[1, 2, 3].map(|k| maps.gradients[k].to_array()));
    let material = if before.abs_diff_eq(after, 1e-12 * size) {
        barycentric_from_world.transpose()
    } else {
        after.inverse() * maps.texture_from_world
    };
    let gradient = edges * material;
    gradient.is_finite().then_some(gradient)
}

/// From the first vertex to the others.
fn edges([a, b, c, d]: [DVec3; 4]) -> DMat3 {
    DMat3::from_cols(b - a, c - a, d - a)
}

/// In descending order, by one-sided Jacobi rotations (M. Hestenes, 1958): small values keep their digits.
fn singular_values(matrix: DMat3) -> [f64; 3] {
    // Convergence is quadratic: six sweeps are more than was ever seen to be needed.
    const SWEEPS: usize = 16;
    let mut columns = [matrix.x_axis, matrix.y_axis, matrix.z_axis];
    for _ in 0..SWEEPS {
        let mut is_done = true;
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let (a, b) = (columns[p], columns[q]);
            let (aa, bb, ab) = (a.length_squared(), b.length_squared(), a.dot(b));
            if ab.abs() <= f64::EPSILON * (aa * bb).sqrt() {
                continue;
            }
            is_done = false;
            let zeta = (bb - aa) / (2.0 * ab);
            let tangent = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
            let cosine = tangent.hypot(1.0).recip();
            let sine = cosine * tangent;
            (columns[p], columns[q]) = (cosine * a - sine * b, sine * a + cosine * b);
        }
        if is_done {
            break;
        }
    }
    let mut values = columns.map(DVec3::length);
    values.sort_unstable_by(|a, b| b.total_cmp(a));
    values
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::DQuat;

    use super::*;
    use crate::instrument::tests::{moved, torus};

    fn of(rest: &Shell, now: &Shell) -> Stretch {
        Stretch::of(rest, &deformations(rest, now))
    }

    #[test]
    fn singular_values_of_products_of_rotations_and_a_diagonal() {
        for expected in [[3.0, 2.0, 0.5], [1.0, 1.0, 1.0], [2.0, 1e-9, 0.0], [5.0, 5.0, 1e-3], [0.0; 3]] {
            let turn =
                |x: f64, y: f64, z: f64| DMat3::from_quat(DQuat::from_scaled_axis(DVec3::new(x, y, z)));
            let matrix = turn(1.0, 2.0, 0.3) * DMat3::from_diagonal(expected.into()) * turn(-0.4, 0.2, 1.7);
            let found = singular_values(matrix);
            // Some ten roundings of numbers as large as the largest.
            assert!((0..3).all(|i| (found[i] - expected[i]).abs() < 1e-14 * 5.0), "{found:?} {expected:?}");
        }
    }

    #[test]
    fn a_rigid_motion_has_none() {
        let rest = torus(0.1);
        let turn = DQuat::from_scaled_axis(DVec3::new(0.3, -1.0, 2.0));
        let Stretch { least, greatest, rms, shear_degrees, unmeasured, .. } =
            of(&rest, &moved(&rest, |p| turn * p + DVec3::new(10.0, -7.0, 3.0)));
        assert_eq!(unmeasured, 0);
        assert!([least, greatest, rms].iter().all(|value| (value - 1.0).abs() < 1e-10));
        assert!(shear_degrees < 1e-8);
    }

    #[test]
    fn a_stretch_and_a_shear_are_told_as_they_are() {
        let rest = torus(0.1);
        let stretch = of(&rest, &moved(&rest, |p| p * DVec3::new(2.0, 1.0, 0.5)));
        assert!((stretch.greatest - 2.0).abs() < 1e-9 && (stretch.least - 0.5).abs() < 1e-9, "{stretch:?}");
        // asin of (4 - 1/4) / (4 + 1/4)
        assert!((stretch.shear_degrees - (3.75f64 / 4.25).asin().to_degrees()).abs() < 1e-6);
        assert!((stretch.rms - (5.25f64 / 3.0).sqrt()).abs() < 1e-9);
        // A simple shear by the tangent g: s1 = 1 / s3 = (g + sqrt(g^2 + 4)) / 2.
        let sheared = of(&rest, &moved(&rest, |p| p + DVec3::X * 0.5 * p.y));
        let first = 0.5 * (0.5 + 4.25f64.sqrt());
        assert!((sheared.greatest - first).abs() < 1e-9 && (sheared.least * first - 1.0).abs() < 1e-9);
    }

    #[test]
    fn one_tetrahedron_alone_is_named() {
        let rest = torus(0.1);
        let mut now = rest.clone();
        let vertex = rest.topology.tetrahedra[30][3] as usize;
        Arc::make_mut(&mut now.vertices)[vertex] *= 1.01;
        let touched = |t: u32| rest.topology.tetrahedra[t as usize].contains(&(vertex as u32));
        let stretch = of(&rest, &now);
        assert!(touched(stretch.greatest_at) && touched(stretch.shear_at) && stretch.greatest > 1.001);
    }

    #[test]
    fn a_texture_drawn_out_is_a_stretch_and_one_that_slides_is_none() {
        let rest = torus(0.1);
        let mut now = rest.clone();
        for corners in Arc::make_mut(&mut now.texture) {
            *corners = corners.map(|t| t * DVec3::new(0.5, 1.0, 1.0) + DVec3::new(0.2, 0.1, 0.0));
        }
        let stretch = of(&rest, &now);
        assert!(stretch.greatest >= 2.0 - 1e-9, "half the texture on the same surface: {stretch:?}");
        let mut now = rest.clone();
        for corners in Arc::make_mut(&mut now.texture) {
            *corners = corners.map(|t| t + DVec3::new(0.25, 0.1, 0.0));
        }
        let stretch = of(&rest, &now);
        assert!((stretch.greatest - 1.0).abs() < 1e-10 && (stretch.least - 1.0).abs() < 1e-10);
    }
}
