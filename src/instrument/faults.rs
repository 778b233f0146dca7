//! Which tetrahedra are inverted, and which are slivers, and where.

use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;

use super::LISTED;
use crate::shell::{SLIVER_QUALITY, Shell};

/// A tetrahedron, with its place.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Place {
    /// Its id in [`Topology::tetrahedra`](crate::shell::Topology::tetrahedra).
    pub tetrahedron: u32,
    /// The triangle of the base mesh that it stands on.
    pub triangle: u32,
    /// World space.
    pub centroid: [f64; 3],
}

/// Some tetrahedra.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Places {
    /// All of them.
    pub count: u64,
    /// The first of them by id, at most [`LISTED`].
    pub first: Vec<Place>,
}

/// What is wrong with single tetrahedra.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Faults {
    /// Negative volume, by an exact sign.
    pub inverted: Places,
    /// Quality below [`SLIVER_QUALITY`], though not without volume.
    pub slivers: Places,
    /// Without volume: nothing is drawn of them.
    pub zero_volume: u64,
}

impl Place {
    /// Of tetrahedron `t`.
    pub fn of(shell: &Shell, t: u32) -> Self {
        Self { tetrahedron: t, triangle: t / 3, centroid: centroid(shell, t).to_array() }
    }
}

impl Places {
    fn of(shell: &Shell, ids: impl Iterator<Item = u32>) -> Self {
        let mut places = Self::default();
        for id in ids {
            places.count += 1;
            if places.first.len() < LISTED {
                places.first.push(Place::of(shell, id));
            }
        }
        places
    }
}

/// World space.
pub fn centroid(shell: &Shell, t: u32) -> DVec3 {
    0.25 * shell.vertices_of(t as usize).into_iter().sum::<DVec3>()
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Sound,
    Sliver,
    Inverted,
    /// Inverted, and a sliver.
    Both,
    Flat,
}

/// The faults of a shell as it stands.
pub fn faults(shell: &Shell) -> Faults {
    let kind = |t: usize| {
        if !shell.has_maps(t) {
            return Kind::Flat;
        }
        match (shell.determinant(t) < 0.0, shell.quality(t) < SLIVER_QUALITY) {
            (false, false) => Kind::Sound,
            (false, true) => Kind::Sliver,
            (true, false) => Kind::Inverted,
            (true, true) => Kind::Both,
        }
    };
    let kinds: Vec<Kind> = (0..shell.topology.tetrahedra.len()).into_par_iter().map(kind).collect();
    let of = |of: &[Kind]| (0..).zip(&kinds).filter(|(_, kind)| of.contains(kind)).map(|(t, _)| t).collect();
    let [inverted, slivers]: [Vec<u32>; 2] =
        [&[Kind::Inverted, Kind::Both], &[Kind::Sliver, Kind::Both]].map(|k| of(k));
    Faults {
        inverted: Places::of(shell, inverted.into_iter()),
        slivers: Places::of(shell, slivers.into_iter()),
        zero_volume: kinds.iter().filter(|&&kind| kind == Kind::Flat).count() as u64,
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::instrument::tests::torus;

    #[test]
    fn a_sound_shell_has_none() {
        assert_eq!(faults(&torus(0.1)), Faults::default());
    }

    /// The outer vertex above a corner is pushed through the base: all that the health counts is told by name.
    #[test]
    fn an_inverted_tetrahedron_is_named_with_its_place() {
        let mut shell = torus(0.1);
        let base = shell.topology.tetrahedra[30][0] as usize;
        let outer = base + shell.topology.base_vertices as usize;
        let pushed = 2.0 * shell.vertices[base] - shell.vertices[outer];
        Arc::make_mut(&mut shell.vertices)[outer] = pushed;
        let found = faults(&shell).inverted;
        let expected: Vec<u32> = (0..)
            .take(shell.topology.tetrahedra.len())
            .filter(|&t| shell.determinant(t as usize) < 0.0)
            .collect();
        assert!(!expected.is_empty() && expected.len() <= LISTED);
        assert_eq!(found.first.iter().map(|place| place.tetrahedron).collect::<Vec<_>>(), expected);
        assert!(expected.iter().all(|&t| shell.topology.tetrahedra[t as usize].contains(&(outer as u32))));
        let place = found.first[0];
        assert_eq!(place.triangle, place.tetrahedron / 3);
        let vertices = shell.vertices_of(place.tetrahedron as usize);
        let mean = (vertices[0] + vertices[1] + vertices[2] + vertices[3]) / 4.0;
        assert!(mean.distance(DVec3::from_array(place.centroid)) < 1e-12);
    }
}
