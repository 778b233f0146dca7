//! How thick the shell may be before it folds.
//!
//! Where all outer vertices move along their directions, `x(s) = b + s d`, six times the volume of a tetrahedron is a cubic in
//! the factor `s`. At `s = 0` each is flat, since at least two of its vertices stand on one corner: the cubic is `s q(s)`,
//! and the first positive root of the quadratic `q`, where `q(0)` is positive, is where it turns over.

use glam::{DMat3, DVec3};
use rayon::prelude::*;
use serde::Serialize;

use crate::shell::Shell;

/// The thickness at which a shell folds, by what the thickness in force is to be multiplied with everywhere.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Fold {
    /// Up to this factor no tetrahedron is inverted, by exact signs at the factor itself; below 1 the shell is folded as it is,
    /// 0 where no thickness is small enough. `None` where no thickness is too large.
    pub factor: Option<f64>,
    /// The tetrahedron that turns over there.
    pub tetrahedron: Option<u32>,
    /// Tetrahedra that are inverted at any thickness: their direction points to the other side of the base.
    pub flipped: u64,
}

/// Length of the shell's edges from base to outer surface, in world units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Thickness {
    /// The least.
    pub least: f64,
    /// The mean over vertices.
    pub mean: f64,
    /// The greatest.
    pub greatest: f64,
}

/// In force.
pub fn thickness(shell: &Shell) -> Thickness {
    let (base, outer) = shell.vertices.split_at(shell.topology.base_vertices as usize);
    let lengths = base.iter().zip(outer).map(|(b, o)| b.distance(*o));
    let (least, sum, greatest) = lengths
        .fold((f64::INFINITY, 0.0, 0.0_f64), |(least, sum, greatest), length| {
            (least.min(length), sum + length, greatest.max(length))
        });
    Thickness { least, mean: sum / base.len() as f64, greatest }
}

/// What a tetrahedron does as the shell grows from nothing.
#[derive(Clone, Copy, PartialEq)]
enum Growth {
    /// The base triangle has no area, or the direction lies in it: it says nothing.
    Flat,
    Flipped,
    /// Until this factor.
    Upright(f64),
}

/// The factor of a shell as it stands.
pub fn fold(shell: &Shell) -> Fold {
    let growths: Vec<Growth> =
        (0..shell.topology.tetrahedra.len()).into_par_iter().map(|t| growth(shell, t)).collect();
    let flipped = growths.iter().filter(|growth| **growth == Growth::Flipped).count() as u64;
    let upright = (0..).zip(&growths).filter_map(|(t, growth)| match growth {
        Growth::Upright(until) => Some((t, *until)),
        _ => None,
    });
    let (tetrahedron, root) =
        upright.fold((0, f64::INFINITY), |least, one| if one.1 < least.1 { one } else { least });
    if flipped > 0 {
        let first = growths.iter().position(|growth| *growth == Growth::Flipped);
        return Fold { factor: Some(0.0), tetrahedron: first.map(|t| t as u32), flipped };
    }
    if root == f64::INFINITY {
        return Fold { factor: None, tetrahedron: None, flipped };
    }
    // The root is rounded, and so are the vertices there: it is taken down until all signs are right.
    let mut step = 4.0 * f64::EPSILON;
    let mut factor = root;
    while step < 1.0 && !is_upright(shell, &growths, factor) {
        factor = root * (1.0 - step);
        step *= 2.0;
    }
    Fold { factor: Some(factor), tetrahedron: Some(tetrahedron), flipped }
}

/// The shell's vertex with all thickness multiplied.
fn vertex_at(shell: &Shell, factor: f64, id: u32) -> DVec3 {
    let base = shell.vertices[(id % shell.topology.base_vertices) as usize];
    base + factor * (shell.vertices[id as usize] - base)
}

/// Whether none of those that grow upright is inverted or flat, by exact signs.
fn is_upright(shell: &Shell, growths: &[Growth], factor: f64) -> bool {
    (0..shell.topology.tetrahedra.len()).into_par_iter().all(|t| {
        let corners = shell.topology.tetrahedra[t].map(|id| vertex_at(shell, factor, id));
        growths[t] == Growth::Flat || crate::shell::determinant(corners) > 0.0
    })
}

fn growth(shell: &Shell, t: usize) -> Growth {
    let ids = shell.topology.tetrahedra[t];
    let base = ids.map(|id| shell.vertices[(id % shell.topology.base_vertices) as usize]);
    let outward: [DVec3; 4] = std::array::from_fn(|k| shell.vertices[ids[k] as usize] - base[k]);
    let [e, f] = [base, outward].map(|of| [1, 2, 3].map(|k| of[k] - of[0]));
    let det = |a: DVec3, b: DVec3, c: DVec3| DMat3::from_cols(a, b, c).determinant();
    let first = det(f[0], e[1], e[2]) + det(e[0], f[1], e[2]) + det(e[0], e[1], f[2]);
    let second = det(f[0], f[1], e[2]) + det(f[0], e[1], f[2]) + det(e[0], f[1], f[2]);
    let third = det(f[0], f[1], f[2]);
    // Each determinant is off by some ten roundings of the product of its lengths.
    let length = |of: [DVec3; 3]| of.into_iter().map(DVec3::length).fold(0.0, f64::max);
    let rounding = 64.0 * f64::EPSILON * length(e) * length(e) * length(f);
    if first.abs() <= rounding {
        Growth::Flat
    } else if first < 0.0 {
        Growth::Flipped
    } else {
        Growth::Upright(first_positive_root(first, second, third))
    }
}

/// Of `a + b s + c s^2` with positive `a`; infinite where there is none.
fn first_positive_root(a: f64, b: f64, c: f64) -> f64 {
    let discriminant = b * b - 4.0 * a * c;
    if discriminant < 0.0 {
        return f64::INFINITY;
    }
    // Without cancellation: the two roots are half / c and a / half.
    let half = -0.5 * (b + discriminant.sqrt().copysign(b));
    let roots = [half / c, a / half];
    roots.into_iter().filter(|root| *root > 0.0).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::instrument::tests::{torus, torus_with};

    #[test]
    fn roots_in_closed_form() {
        assert_eq!(first_positive_root(2.0, -3.0, 1.0), 1.0);
        assert_eq!(first_positive_root(2.0, 3.0, 1.0), f64::INFINITY, "both are negative");
        assert_eq!(first_positive_root(1.0, 0.0, 1.0), f64::INFINITY, "none is real");
        assert_eq!(first_positive_root(1.0, -2.0, 0.0), 0.5);
        assert_eq!(first_positive_root(1.0, 0.0, 0.0), f64::INFINITY);
        assert_eq!(first_positive_root(4.0, 0.0, -1.0), 2.0);
    }

    /// Around its hole the torus of radii 1 and 0.25 folds where the outer ring has shrunk to nothing: normals point to the
    /// axis there, and the inner equator's radius is 0.75.
    #[test]
    fn a_torus_folds_at_its_axis() {
        for thickness in [0.1, 0.5, 1.5] {
            let shell = torus(thickness);
            let fold = fold(&shell);
            let factor = fold.factor.expect("it folds");
            assert!((factor * thickness - 0.75).abs() < 1e-9, "{fold:?}");
            assert_eq!(shell.health.inverted > 0, factor < 1.0);
            // Exact signs on both sides, in shells that are built so.
            assert_eq!(torus(thickness * factor * (1.0 - 1e-12)).health.inverted, 0);
            assert!(torus(thickness * factor * (1.0 + 1e-9)).health.inverted > 0);
        }
    }

    #[test]
    fn what_points_inward_is_flipped_and_what_never_folds_has_no_factor() {
        let inward = torus_with(0.1, |normal| -normal);
        let found = fold(&inward);
        assert_eq!((found.factor, found.flipped), (Some(0.0), inward.topology.tetrahedra.len() as u64));
        let flat = Shell::build(&crate::mesh::Mesh::triangle(), &crate::shell::ShellOptions::new(1.0));
        assert_eq!(fold(&flat.unwrap()).factor, None);
    }

    #[test]
    fn thickness_is_that_in_force() {
        let Thickness { least, mean, greatest } = thickness(&torus(0.1));
        assert!([least, mean, greatest].iter().all(|length| (length - 0.1).abs() < 1e-12));
    }
}
