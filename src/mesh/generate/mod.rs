//! Meshes made from a few numbers: what a scene's `[mesh]` table with a `generator` key asks for.
//!
//! All are centred on, or stand on, the origin with Y up. Texture coordinates run 0..1 over each
//! surface, u to the right and v up as seen from outside, so that (u, v, outward) is right-handed
//! everywhere. Where a surface closes on itself the last column of triangles runs to u = 1 (or v = 1)
//! while its positions are those of the first: no strip is textured backwards. A pole is one position
//! and one triangle a segment.

mod bezier;
mod grid;
mod primitives;
mod teapot;
mod vase;

use serde::Deserialize;

pub use primitives::{Plane, Sphere, Torus, Tube};
pub use teapot::Teapot;
pub use vase::Vase;

use super::Mesh;
use crate::{Error, Result};

/// A mesh generator and its parameters, as a TOML table in a table: `[sphere]`, `radius = 1.0`, ...
///
/// Every parameter may be left out; a key that the generator does not have is an error.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Generator {
    /// A square in the XZ plane that faces up.
    Plane(Plane),
    /// An open cylinder around the Y axis.
    Tube(Tube),
    /// A sphere of meridians and parallels.
    Sphere(Sphere),
    /// A ring around the Y axis.
    Torus(Torus),
    /// A surface of revolution with a foot, a belly, a neck and an open lip.
    Vase(Vase),
    /// The Utah teapot.
    Teapot(Teapot),
}

/// A parameter out of its range.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BadParameter {
    /// The key, as written in the scene file.
    pub key: &'static str,
    /// Its value, its range and its default, in a sentence without the key.
    pub message: String,
}

impl From<BadParameter> for Error {
    fn from(bad: BadParameter) -> Self {
        Self::Usage { message: format!("mesh parameter `{}` {}", bad.key, bad.message), help: None }
    }
}

/// What a check of parameters yields.
pub type Checked = std::result::Result<(), BadParameter>;

impl Generator {
    /// Checks every parameter against its range, the first offender first.
    ///
    /// # Errors
    /// The [`BadParameter`], so that a scene file can underline its key.
    pub fn check(&self) -> Checked {
        match self {
            Self::Plane(plane) => plane.check(),
            Self::Tube(tube) => tube.check(),
            Self::Sphere(sphere) => sphere.check(),
            Self::Torus(torus) => torus.check(),
            Self::Vase(vase) => vase.check(),
            Self::Teapot(teapot) => teapot.check(),
        }
    }

    /// The mesh.
    ///
    /// # Errors
    /// [`Error::Usage`] when [`Generator::check`] objects, or should the mesh not be valid.
    pub fn build(&self) -> Result<Mesh> {
        self.check()?;
        let mesh = match self {
            Self::Plane(plane) => plane.mesh(),
            Self::Tube(tube) => tube.mesh(),
            Self::Sphere(sphere) => sphere.mesh(),
            Self::Torus(torus) => torus.mesh(),
            Self::Vase(vase) => vase.mesh(),
            Self::Teapot(teapot) => teapot.mesh(),
        };
        mesh.validate().map_err(|message| Error::Usage { message, help: None })?;
        Ok(mesh)
    }
}

/// The most subdivisions in one direction: two directions of 2048 are 8.4 million triangles.
const MOST_SUBDIVISIONS: u32 = 2048;

/// Lengths: far enough from the limits of f64 that areas and volumes stay finite and normal.
const LENGTHS: std::ops::RangeInclusive<f64> = 1e-30..=1e30;

fn check_length(key: &'static str, value: f64, default: f64) -> Checked {
    if LENGTHS.contains(&value) {
        return Ok(());
    }
    let (low, high) = (LENGTHS.start(), LENGTHS.end());
    let message = format!("is {value}, but must be a length from {low:e} to {high:e} (default {default})");
    Err(BadParameter { key, message })
}

fn check_count(key: &'static str, value: u32, least: u32, default: u32) -> Checked {
    if (least..=MOST_SUBDIVISIONS).contains(&value) {
        return Ok(());
    }
    let message = format!("is {value}, but must be from {least} to {MOST_SUBDIVISIONS} (default {default})");
    Err(BadParameter { key, message })
}

#[cfg(test)]
mod tests {
    use std::collections::{HashMap, HashSet};
    use std::f64::consts::PI;

    use glam::DVec3;

    use super::*;

    fn all() -> Vec<Generator> {
        vec![
            Generator::Plane(Plane::default()),
            Generator::Tube(Tube::default()),
            Generator::Sphere(Sphere::default()),
            Generator::Torus(Torus::default()),
            Generator::Vase(Vase::default()),
            Generator::Teapot(Teapot::default()),
        ]
    }

    fn corners(mesh: &Mesh, ids: [u32; 3]) -> [DVec3; 3] {
        ids.map(|id| mesh.positions[id as usize])
    }

    fn area(mesh: &Mesh) -> f64 {
        mesh.triangles.iter().map(|&ids| double_area(corners(mesh, ids)).length() / 2.0).sum()
    }

    fn double_area([a, b, c]: [DVec3; 3]) -> DVec3 {
        (b - a).cross(c - a)
    }

    fn volume(mesh: &Mesh) -> f64 {
        let six_volumes = |[a, b, c]: [DVec3; 3]| a.dot(b.cross(c));
        mesh.triangles.iter().map(|&ids| six_volumes(corners(mesh, ids)) / 6.0).sum()
    }

    /// Edges with one triangle; panics at an edge with three, or with two that run the same way.
    fn boundary_edges(mesh: &Mesh) -> usize {
        let mut directed = HashMap::new();
        for &[a, b, c] in &mesh.triangles {
            for edge in [(a, b), (b, c), (c, a)] {
                assert!(directed.insert(edge, ()).is_none(), "edge {edge:?} runs twice the same way");
            }
        }
        directed.keys().filter(|&&(a, b)| !directed.contains_key(&(b, a))).count()
    }

    #[test]
    fn triangle_counts_are_those_of_the_2005_paper() {
        assert_eq!(Vase::default().mesh().triangles.len() * 12, 103_680);
        assert_eq!(Teapot::default().mesh().triangles.len() * 12, 25_704);
    }

    #[test]
    fn boundaries_are_where_they_should_be() {
        // The teapot's: two rims of body and lid (34 each), two ends of handle and of spout (12, 13 each).
        let expected = [4 * 16, 2 * 48, 0, 0, 64, 2 * 34 + 2 * 12 + 2 * 13];
        for (generator, expected) in all().iter().zip(expected) {
            assert_eq!(boundary_edges(&generator.build().unwrap()), expected, "{generator:?}");
        }
    }

    #[test]
    fn normals_and_texture_coordinates_agree_with_the_triangles() {
        for generator in all() {
            let mesh = generator.build().unwrap();
            assert_eq!(mesh.uvs.len(), mesh.triangles.len());
            assert_eq!(mesh.normals.len(), mesh.positions.len());
            for (&ids, uvs) in mesh.triangles.iter().zip(&mesh.uvs) {
                let facet = double_area(corners(&mesh, ids));
                assert!(facet.length() > 1e-9, "{generator:?}: degenerate triangle {ids:?}");
                for id in ids {
                    let normal = mesh.normals[id as usize];
                    assert!((normal.length() - 1.0).abs() < 1e-14, "{generator:?}: {normal} at {id}");
                }
                let mean: DVec3 = ids.iter().map(|&id| mesh.normals[id as usize]).sum();
                assert!(mean.dot(facet) > 0.0, "{generator:?}: inside out at {ids:?}");
                let [a, b, c] = *uvs;
                assert!((b - a).perp_dot(c - a) > 0.0, "{generator:?}: texture mirrored at {ids:?}");
                assert!(uvs.iter().all(|uv| uv.min_element() >= 0.0 && uv.max_element() <= 1.0));
            }
        }
    }

    #[test]
    fn areas_and_volumes_converge_in_second_order() {
        let sphere = |n| Sphere { segments: 2 * n, rings: n, ..Sphere::default() }.mesh();
        let torus = |n| Torus { segments: 2 * n, rings: n, ..Torus::default() }.mesh();
        let tube = |n| Tube { segments: n, ..Tube::default() }.mesh();
        type Measure = (&'static str, Box<dyn Fn(u32) -> f64>, f64);
        let measures: [Measure; 5] = [
            ("sphere area", Box::new(move |n| area(&sphere(n))), 4.0 * PI),
            ("sphere volume", Box::new(move |n| volume(&sphere(n))), 4.0 / 3.0 * PI),
            ("torus area", Box::new(move |n| area(&torus(n))), 4.0 * PI * PI * 0.4),
            ("torus volume", Box::new(move |n| volume(&torus(n))), 2.0 * PI * PI * 0.4 * 0.4),
            ("tube area", Box::new(move |n| area(&tube(n))), 4.0 * PI),
        ];
        for (name, measure, exact) in measures {
            let [coarse, fine] = [32, 64].map(|n| (measure(n) - exact).abs());
            // Chords err by h^2: halving h quarters the error, up to the next term, about (pi / 32)^2 = 1 %.
            let ratio = coarse / fine;
            assert!((3.9..4.1).contains(&ratio), "{name}: error {coarse:e}, then {fine:e}");
        }
        assert_eq!(area(&Plane::default().mesh()), 4.0);
    }

    #[test]
    fn analytic_normals_are_the_limit_of_the_facets() {
        // The facet's normal differs from the surface's at its corners by about curvature times edge.
        for (generator, bound) in [
            (Generator::Vase(Vase { segments: 512, rings: 512, ..Vase::default() }), 0.06),
            (Generator::Sphere(Sphere { segments: 512, rings: 256, ..Sphere::default() }), 0.03),
            (Generator::Torus(Torus { segments: 256, rings: 256, ..Torus::default() }), 0.04),
        ] {
            let mesh = generator.build().unwrap();
            let worst = mesh.triangles.iter().flat_map(|&ids| {
                let facet = double_area(corners(&mesh, ids)).normalize();
                let mesh = &mesh;
                ids.map(|id| (mesh.normals[id as usize] - facet).length())
            });
            let worst = worst.fold(0.0, f64::max);
            assert!(worst < bound, "{generator:?}: normals differ by {worst}");
        }
    }

    #[test]
    fn no_two_positions_are_equal() {
        for generator in all() {
            let mesh = generator.build().unwrap();
            let distinct: HashSet<_> =
                mesh.positions.iter().map(|p| p.to_array().map(|x| (x + 0.0).to_bits())).collect();
            assert_eq!(distinct.len(), mesh.positions.len(), "{generator:?}");
        }
    }

    #[test]
    fn teapot_has_newells_size() {
        // Control points bound the surface; those that it touches are the ends of curves.
        let mesh = Teapot { body_rings: 32, handle_rings: 64, ..Teapot::default() }.mesh();
        let low = mesh.positions.iter().copied().reduce(DVec3::min).unwrap();
        let high = mesh.positions.iter().copied().reduce(DVec3::max).unwrap();
        assert_eq!(low.x, -3.0);
        assert_eq!((low.y, high.y), (0.0, 3.15));
        assert!(high.x > 3.4 && high.x < 3.525, "{high}");
        assert!((high.z - 2.0).abs() < 0.01 && (low.z + 2.0).abs() < 0.01, "{low} {high}");
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let bad = [
            ("radius", Generator::Sphere(Sphere { radius: -1.0, ..Sphere::default() })),
            ("radius", Generator::Tube(Tube { radius: f64::NAN, ..Tube::default() })),
            ("minor_radius", Generator::Torus(Torus { minor_radius: 1.0, ..Torus::default() })),
            ("segments", Generator::Plane(Plane { segments: 0, ..Plane::default() })),
            ("rings", Generator::Vase(Vase { rings: 1, ..Vase::default() })),
            ("spout_rings", Generator::Teapot(Teapot { spout_rings: 4096, ..Teapot::default() })),
        ];
        for (key, generator) in bad {
            assert_eq!(generator.check().unwrap_err().key, key);
            let message = generator.build().unwrap_err().to_string();
            assert!(message.contains(&format!("`{key}`")), "{message}");
        }
    }

    #[test]
    fn reads_from_toml() {
        let sphere: Generator = toml::from_str("[sphere]\nradius = 2.5").unwrap();
        assert_eq!(sphere, Generator::Sphere(Sphere { radius: 2.5, ..Sphere::default() }));
        let error = toml::from_str::<Generator>("[sphere]\nradus = 2.5").unwrap_err();
        assert!(error.to_string().contains("radus"), "{error}");
    }
}
