//! The shell as its users see it.
#![allow(missing_docs, reason = "tests")]
use glam::{DVec2, DVec3};
use mesoshell::mesh::Mesh;
use mesoshell::shell::*;

#[test]
fn one_prism() {
    let mesh = Mesh {
        positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
        normals: vec![DVec3::Z; 3],
        triangles: vec![[0, 1, 2]],
        uvs: vec![[DVec2::ZERO, DVec2::X, DVec2::Y]],
    };
    let shell = Shell::build(&mesh, &ShellOptions::new(0.5)).unwrap();
    assert_eq!(shell.health.inverted, 0);
}
