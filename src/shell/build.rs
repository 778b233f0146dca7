//! Builds a shell from a mesh, and places it anew when the mesh's vertices have moved.

use std::sync::{Arc, OnceLock};

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::{Health, Shell, ShellOptions, Topology, cell, extrude, health, limit};
use crate::mesh::Mesh;
use crate::{Error, Result};

/// Tetrahedra that one task of the thread pool takes at least: some 0.1 ms of work.
const TASK: usize = 512;

impl Shell {
    /// Extrudes a mesh, splits the prisms and computes every map.
    ///
    /// # Errors
    /// [`Error::Usage`] that names the option (`shell.thickness`, ...) or the part of the mesh that makes no
    /// sense: a thickness that is not positive, finite and normal, a list of the wrong length, a number that is
    /// not finite, a triangle that names a position twice.
    pub fn build(mesh: &Mesh, options: &ShellOptions) -> Result<Self> {
        validate(mesh, options)?;
        let mut shell = Self {
            topology: Arc::new(Topology::of(mesh)?),
            vertices: Arc::default(),
            texture: Arc::default(),
            determinants: Vec::new(),
            maps: OnceLock::new(),
            uvs: Arc::default(),
            health: Health::default(),
            limit: None,
        };
        shell.place(mesh, options);
        Ok(shell)
    }

    /// A shell of any tetrahedra, whose faces start at their smallest id as in a shell that is [built](Shell::build).
    pub fn assemble(topology: Topology, vertices: Vec<DVec3>, texture: Vec<[DVec3; 4]>) -> Self {
        let mut shell = Self {
            topology: Arc::new(topology),
            vertices: Arc::new(vertices),
            texture: Arc::new(texture),
            determinants: Vec::new(),
            maps: OnceLock::new(),
            uvs: Arc::default(),
            health: Health::default(),
            limit: None,
        };
        shell.measure();
        shell
    }

    /// A shell for the same triangles with other positions, normals, UVs or options, which shares the topology with this one, and
    /// the vertices and the texture coordinates where none has moved. `spare`, a shell that is no longer needed, may lend its memory.
    ///
    /// # Errors
    /// As [`Shell::rebuild`].
    pub fn moved(&self, mesh: &Mesh, options: &ShellOptions, spare: Option<Self>) -> Result<Self> {
        let mut moved = Self {
            topology: self.topology.clone(),
            vertices: self.vertices.clone(),
            texture: self.texture.clone(),
            determinants: spare.map_or_else(Vec::new, |spare| spare.determinants),
            maps: OnceLock::new(),
            uvs: self.uvs.clone(),
            health: Health::default(),
            limit: None,
        };
        moved.rebuild(mesh, options)?;
        Ok(moved)
    }

    /// Builds the shell again for the same triangles with other positions, normals, UVs or options, and
    /// keeps its topology, and its vertices and texture coordinates where none has moved. On an error the shell is as before.
    ///
    /// # Errors
    /// As [`Shell::build`], and [`Error::Usage`] where the number of positions or the triangles differ from
    /// those that the shell was built from.
    pub fn rebuild(&mut self, mesh: &Mesh, options: &ShellOptions) -> Result<()> {
        validate(mesh, options)?;
        if !self.topology.is_of(mesh) {
            let message = format!(
                "the mesh's {} positions and {} triangles are not those that the shell was built from ({} and {})",
                mesh.positions.len(),
                mesh.triangles.len(),
                self.topology.base_vertices,
                self.topology.tetrahedra.len() / 3,
            );
            return Err(Error::Usage { message, help: Some("build a new shell for a new mesh".into()) });
        }
        self.place(mesh, options);
        Ok(())
    }

    fn place(&mut self, mesh: &Mesh, options: &ShellOptions) {
        let directions = extrude::directions(mesh, options);
        let limited = options.limited.then(|| limit::factors(mesh, &self.topology, options, &directions));
        let (factors, limit) = limited.flatten().unzip();
        self.limit = limit;
        let limited = factors.map(|factors| {
            let scaled = |(id, factor)| factor * extrude::thickness_at(options, id) / options.thickness;
            let thickness_scale = factors.into_iter().enumerate().map(scaled).collect();
            ShellOptions { thickness_scale, ..options.clone() }
        });
        let options = limited.as_ref().unwrap_or(options);
        let outer = mesh.positions.iter().zip(&directions).enumerate();
        let outer = outer.map(|(id, (&x, &n))| x + extrude::thickness_at(options, id) * n);
        let vertices: Vec<DVec3> = mesh.positions.iter().copied().chain(outer).collect();
        if vertices != *self.vertices {
            self.vertices = Arc::new(vertices);
        }

        let topology = &*self.topology;
        let texture_map = options.texture_map();
        let uvs: Vec<_> = mesh.uvs.iter().map(|corners| corners.map(&texture_map)).collect();
        if uvs != *self.uvs {
            let corners = topology.tetrahedra.par_iter().zip(&topology.corners).enumerate();
            let coordinates = corners.with_min_len(TASK).map(|(t, (ids, corners))| {
                texture_coordinates(uvs[t / 3], ids.map(|id| id >= topology.base_vertices), *corners)
            });
            self.texture = Arc::new(coordinates.collect());
            self.uvs = Arc::new(uvs);
        }

        let faults = self.faults();
        let overlap = health::overlap_risk_vertices(mesh, options, &directions);
        self.health = health::health(&self.topology, faults, overlap);
    }

    /// Finds the volume of every tetrahedron after vertices or texture coordinates were changed; what maps there were are forgotten.
    pub fn measure(&mut self) {
        let faults = self.faults();
        self.health = health::health(&self.topology, faults, self.health.overlap_risk_vertices);
    }

    /// As [`Shell::measure`].
    fn faults(&mut self) -> health::Faults {
        self.maps = OnceLock::new();
        let (topology, vertices) = (&*self.topology, &*self.vertices);
        self.determinants.resize(topology.tetrahedra.len(), 0.0);
        let tetrahedra = topology.tetrahedra.par_iter().zip(&*self.texture).with_min_len(TASK);
        let faults = tetrahedra.zip(&mut self.determinants).map(|((ids, texture), determinant)| {
            let corners = ids.map(|id| vertices[id as usize]);
            let squared_edges = health::squared_edges(corners);
            let largest = texture.iter().fold(0.0, |largest: f64, at| largest.max(at.abs().max_element()));
            let exact = cell::determinant(corners);
            *determinant = if cell::are_finite(exact, squared_edges, largest) { exact } else { 0.0 };
            health::Faults::of(*determinant, squared_edges)
        });
        faults.reduce(health::Faults::default, |x, y| x + y)
    }
}

impl ShellOptions {
    /// From the mesh's texture coordinates to the texture's.
    fn texture_map(&self) -> impl Fn(DVec2) -> DVec2 + Sync + use<> {
        // Whole turns of the offset change nothing, but would take digits from what is added.
        let offset = self.uv_offset - self.uv_offset.floor();
        let (scale, rotation) = (self.uv_scale, DVec2::from_angle(self.uv_rotation));
        move |uv| rotation.rotate(scale * uv) + offset
    }
}

impl Topology {
    /// Whether the mesh has the triangles that this was built from, corner by corner.
    pub fn is_of(&self, mesh: &Mesh) -> bool {
        let split_from = |ids: &[u32; 4], corners: &[u8; 4], triangle: &[u32; 3]| {
            ids.iter().zip(corners).all(|(id, &corner)| id % self.base_vertices == triangle[corner as usize])
        };
        mesh.positions.len() == self.base_vertices as usize
            && 3 * mesh.triangles.len() == self.tetrahedra.len()
            && (self.tetrahedra.par_iter().zip(&self.corners).enumerate().with_min_len(TASK))
                .all(|(t, (ids, corners))| split_from(ids, corners, &mesh.triangles[t / 3]))
    }
}

/// (u, v, w) of the four vertices of a tetrahedron, from its triangle's transformed UVs.
fn texture_coordinates(uvs: [DVec2; 3], outer: [bool; 4], corners: [u8; 4]) -> [DVec3; 4] {
    let whole = uvs[0].min(uvs[1]).min(uvs[2]).floor();
    std::array::from_fn(|k| (uvs[corners[k] as usize] - whole).extend(if outer[k] { 1.0 } else { 0.0 }))
}

/// Refuses options and meshes that make no sense, before anything is computed from them.
fn validate(mesh: &Mesh, options: &ShellOptions) -> Result<()> {
    let usage = |message: String, help: &str| Err(Error::Usage { message, help: Some(help.into()) });
    let positions = mesh.positions.len();
    // A denormal thickness has lost its digits, and so would every map.
    if !(options.thickness > 0.0 && options.thickness.is_normal()) {
        let message = format!("shell.thickness is {}", options.thickness);
        return usage(message, "give a positive, finite length in world units");
    }
    if !options.thickness_scale.is_empty() && options.thickness_scale.len() != positions {
        let message = format!(
            "shell.thickness_scale has {} entries for {positions} mesh positions",
            options.thickness_scale.len()
        );
        return usage(message, "give one factor a position, or none");
    }
    let sound = |&scale: &f64| scale >= 0.0 && (options.thickness * scale).is_finite();
    if let Some(id) = options.thickness_scale.iter().position(|scale| !sound(scale)) {
        let message = format!("shell.thickness_scale[{id}] is {}", options.thickness_scale[id]);
        return usage(message, "give a finite factor that is not negative");
    }
    let rotation = DVec2::splat(options.uv_rotation);
    for (key, value) in
        [("uv_scale", options.uv_scale), ("uv_rotation", rotation), ("uv_offset", options.uv_offset)]
    {
        if !value.is_finite() {
            return usage(format!("shell.{key} is {value}"), "give two finite numbers");
        }
    }
    if mesh.normals.len() != positions || mesh.uvs.len() != mesh.triangles.len() {
        let message = format!(
            "the mesh has {} normals for {positions} positions, and UVs for {} of {} triangles",
            mesh.normals.len(),
            mesh.uvs.len(),
            mesh.triangles.len()
        );
        return usage(message, "a shell needs one normal a position and one UV a triangle corner");
    }
    for (what, list) in [("position", &mesh.positions), ("normal", &mesh.normals)] {
        if let Some(id) = list.iter().position(|value| !value.is_finite()) {
            return usage(format!("mesh {what} {id} is {}", list[id]), "repair the mesh or its deformation");
        }
    }
    let texture_map = options.texture_map();
    let unmapped = |corners: &[DVec2; 3]| corners.iter().any(|&uv| !texture_map(uv).is_finite());
    if let Some(index) = mesh.uvs.iter().position(unmapped) {
        let message =
            format!("the UVs of mesh triangle {index} are not finite once shell.uv_scale is applied");
        return usage(message, "repair the mesh, or make shell.uv_scale and shell.uv_offset smaller");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Asserts that the options and the mesh, once spoiled, are refused as usage, in these words.
    fn assert_refused(words: &str, spoil: impl Fn(&mut ShellOptions, &mut Mesh)) {
        let (mut options, mut mesh) = (ShellOptions::new(1.0), Mesh::triangle());
        Shell::build(&mesh, &options).expect("sound before it is spoiled");
        spoil(&mut options, &mut mesh);
        let error = Shell::build(&mesh, &options).expect_err(words);
        assert!(matches!(error, Error::Usage { help: Some(_), .. }), "{error:?}");
        assert!(error.to_string().contains(words), "{error} does not say: {words}");
    }

    #[test]
    fn a_senseless_thickness_is_refused() {
        for thickness in [0.0, -0.0, 1e-310, -1.0, f64::NAN, f64::INFINITY] {
            assert_refused("shell.thickness is", |options, _| options.thickness = thickness);
        }
    }

    #[test]
    fn a_senseless_scale_is_refused() {
        for scale in [-1.0, f64::NAN, f64::INFINITY] {
            assert_refused("shell.thickness_scale[1] is", |options, _| {
                options.thickness_scale = vec![0.0, scale, 1.0];
            });
        }
        assert_refused("shell.thickness_scale has 2 entries for 3", |options, _| {
            options.thickness_scale = vec![1.0; 2];
        });
    }

    #[test]
    fn numbers_that_are_not_finite_are_refused() {
        assert_refused("shell.uv_scale is", |options, _| options.uv_scale.x = f64::NAN);
        assert_refused("shell.uv_offset is", |options, _| options.uv_offset.y = f64::INFINITY);
        assert_refused("mesh position 2 is", |_, mesh| mesh.positions[2].z = f64::NAN);
        assert_refused("mesh normal 0 is", |_, mesh| mesh.normals[0].x = f64::NEG_INFINITY);
        assert_refused("UVs of mesh triangle 0", |_, mesh| mesh.uvs[0][1].x = f64::NAN);
        assert_refused("UVs of mesh triangle 0", |options, mesh| {
            options.uv_scale.x = 1e300;
            mesh.uvs[0][1].x = 1e300;
        });
    }

    #[test]
    fn lists_of_the_wrong_length_are_refused() {
        assert_refused("2 normals for 3 positions", |_, mesh| mesh.normals.truncate(2));
        assert_refused("UVs for 0 of 1 triangles", |_, mesh| mesh.uvs.clear());
    }

    #[test]
    fn whole_turns_of_u_and_v_are_taken_off_together() {
        let uvs = [DVec2::new(7.25, -3.5), DVec2::new(9.0, -3.75), DVec2::new(7.5, -1.0)];
        let texture = texture_coordinates(uvs, [false, false, true, true], [0, 1, 2, 1]);
        let expected = [
            DVec3::new(0.25, 0.5, 0.0),
            DVec3::new(2.0, 0.25, 0.0),
            DVec3::new(0.5, 3.0, 1.0),
            DVec3::new(2.0, 0.25, 1.0),
        ];
        assert_eq!(texture, expected);
    }

    #[test]
    fn options_move_the_texture() {
        let options = ShellOptions {
            uv_scale: DVec2::new(2.0, 4.0),
            uv_offset: DVec2::splat(0.25),
            ..ShellOptions::new(1.0)
        };
        let shell = Shell::build(&Mesh::triangle(), &options).unwrap();
        let corner = |u, v| DVec3::new(u, v, 0.0);
        let expected = [corner(0.25, 0.25), corner(2.25, 0.25), corner(0.25, 4.25)];
        assert_eq!(shell.texture[0][..3], expected);
    }

    #[test]
    fn a_far_offset_moves_the_texture_as_a_near_one() {
        let texture = |offset: f64| {
            let options = ShellOptions { uv_offset: DVec2::splat(offset), ..ShellOptions::new(1.0) };
            Shell::build(&Mesh::triangle(), &options).unwrap().texture
        };
        assert_eq!(texture(1e9 + 0.25), texture(0.25));
        assert_eq!(texture(-1e9 + 0.25), texture(0.25));
        assert_eq!(texture(1e30), texture(0.0), "at 1e30 every number is whole");
    }

    #[test]
    fn the_scale_is_per_position() {
        let options = ShellOptions { thickness_scale: vec![0.0, 1.0, 2.0], ..ShellOptions::new(0.5) };
        let shell = Shell::build(&Mesh::triangle(), &options).unwrap();
        assert_eq!([3, 4, 5].map(|id| shell.vertices[id].z), [0.0, 0.5, 1.0]);
    }
}
