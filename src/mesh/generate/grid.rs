//! A rectangular grid over a parametric surface, closed or open in u and v, with or without poles.

use glam::{DVec2, DVec3};

use crate::mesh::Mesh;

/// ```text
///   v = 1   d---c     quad (i, j) has the corners a = (i, j), b = (i + 1, j), c = (i + 1, j + 1),
///           | / |     d = (i, j + 1) and the triangles (a, b, c) and (a, c, d): counter-clockwise
///   v = 0   a---b     where du x dv points outward. At a pole a quad has the one triangle that is left.
/// ```
pub(super) struct Grid {
    /// Quads along u, at least 1; 3 where closed.
    pub segments: u32,
    /// Quads along v, at least 1; 2 between two poles.
    pub rings: u32,
    /// Whether u = 1 is u = 0.
    pub closed_u: bool,
    /// Whether v = 1 is v = 0.
    pub closed_v: bool,
    /// Whether the first row, v = 0, is a single point.
    pub first_pole: bool,
    /// Whether the last row, v = 1, is a single point.
    pub last_pole: bool,
}

impl Grid {
    /// One quad with four open sides.
    pub const OPEN: Self =
        Self { segments: 1, rings: 1, closed_u: false, closed_v: false, first_pole: false, last_pole: false };

    /// Samples `surface`, which maps (u, v) to a position and its unit normal, once a position.
    pub fn mesh(&self, surface: impl Fn(f64, f64) -> (DVec3, DVec3)) -> Mesh {
        let columns = if self.closed_u { self.segments } else { self.segments + 1 };
        let rows = if self.closed_v { self.rings } else { self.rings + 1 };
        let is_pole = |j: u32| (j == 0 && self.first_pole) || (j == self.rings && self.last_pole);

        let mut mesh = Mesh::default();
        let mut row_starts = Vec::with_capacity(rows as usize);
        for j in 0..rows {
            row_starts.push(mesh.positions.len() as u32);
            for i in 0..if is_pole(j) { 1 } else { columns } {
                let (position, normal) = surface(self.u(f64::from(i)), self.v(j));
                mesh.positions.push(position);
                mesh.normals.push(normal);
            }
        }

        let id = |i: u32, j: u32| row_starts[(j % rows) as usize] + if is_pole(j) { 0 } else { i % columns };
        for j in 0..self.rings {
            for i in 0..self.segments {
                let ids = [id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)];
                let uv = |i: u32, j: u32| DVec2::new(self.u(f64::from(i)), self.v(j));
                let uvs = [uv(i, j), uv(i + 1, j), uv(i + 1, j + 1), uv(i, j + 1)];
                // A pole has no u of its own: each of its triangles reads the middle of its segment.
                let pole = |j: u32| DVec2::new(self.u(f64::from(i) + 0.5), self.v(j));
                if is_pole(j) {
                    mesh.triangles.push([ids[0], ids[2], ids[3]]);
                    mesh.uvs.push([pole(j), uvs[2], uvs[3]]);
                } else if is_pole(j + 1) {
                    mesh.triangles.push([ids[0], ids[1], ids[2]]);
                    mesh.uvs.push([uvs[0], uvs[1], pole(j + 1)]);
                } else {
                    mesh.triangles.extend([[ids[0], ids[1], ids[2]], [ids[0], ids[2], ids[3]]]);
                    mesh.uvs.extend([[uvs[0], uvs[1], uvs[2]], [uvs[0], uvs[2], uvs[3]]]);
                }
            }
        }
        mesh
    }

    fn u(&self, column: f64) -> f64 {
        column / f64::from(self.segments)
    }

    fn v(&self, row: u32) -> f64 {
        f64::from(row) / f64::from(self.rings)
    }
}
