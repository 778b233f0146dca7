//! Wavefront OBJ files: Wavefront, "Advanced Visualizer" manual, appendix B1, polygonal part; parsed by
//! `tobj`.
//!
//! All objects and groups become one mesh. A face with more than three corners is cut into a fan from its
//! first corner, which is right where the face is convex (or at least visible whole from that corner): concave
//! faces must be triangulated by the program that exports them. Materials matter to models alone; smoothing groups,
//! points, lines and free-form surfaces are not read.
//!
//! `tobj` names no line in its errors, fills gaps in the texture coordinates with those of the corner
//! before, takes a polyline for a face, and panics at some indices. So every line is checked first, and
//! `tobj` sees those that matter.

mod check;
mod materials;
mod write;

use std::io::Cursor;
use std::path::Path;

use glam::{DVec2, DVec3, Vec3};

pub use write::write_model;

use super::model::{Material, Model};
use super::weld::{Welded, weld};
use super::{Mesh, Projection, normals};
use crate::{Error, Result, input};

/// In bytes: some twenty million triangles, far more than a device draws.
const LONGEST_FILE: u64 = 1 << 31;

/// A mesh as it came from a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Loaded {
    /// The mesh.
    pub mesh: Mesh,
    /// Triangles that were left out because fewer than three different positions were left to them.
    pub dropped_triangles: u64,
    /// Whether the normals come from the file; else they were computed from the triangles.
    pub normals_from_file: bool,
}

/// Reads a mesh. A projection replaces the texture coordinates of the file.
///
/// Normals of the file are averaged by corner angle at each position; if a corner has none, all are computed.
///
/// # Errors
/// [`Error::Input`] with the line, when the file cannot be read or is damaged, has no faces, has no
/// texture coordinates where no projection is given, or has a position without a normal.
pub fn load(path: impl AsRef<Path>, projection: Option<&Projection>) -> Result<Mesh> {
    Ok(load_counted(path, projection)?.mesh)
}

/// As [`load`], and tells what was done to the mesh.
///
/// # Errors
/// As [`load`].
pub fn load_counted(path: impl AsRef<Path>, projection: Option<&Projection>) -> Result<Loaded> {
    let path = path.as_ref();
    parse(path, &text(path)?, projection)
}

fn text(path: &Path) -> Result<String> {
    let bytes = input::bytes(path, LONGEST_FILE)
        .map_err(|error| Error::input(path, format!("cannot be read: {error}")))?;
    // Only names and comments hold anything but ASCII.
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// What an OBJ file holds, checked, parsed and welded.
struct Parsed {
    checked: check::Checked,
    file: tobj::Mesh,
    welded: Welded,
}

impl Parsed {
    /// Parses the text of an OBJ file; `path` is for errors.
    fn new(path: &Path, text: &str) -> Result<Self> {
        let checked = check::check(path, text)?;
        let options = tobj::LoadOptions { triangulate: true, ..Default::default() };
        // No line that names materials is left.
        let no_material = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
        let (models, _) = tobj::load_obj_buf(&mut Cursor::new(&checked.text), &options, no_material)
            .map_err(|error| Error::input(path, format!("is not a readable OBJ file: {error}")))?;
        let Ok([tobj::Model { mesh: file, .. }]) = <[_; 1]>::try_from(models) else {
            return Err(Error::input(path, "is not a readable OBJ file"));
        };
        let positions: Vec<DVec3> = file.positions.chunks_exact(3).map(DVec3::from_slice).collect();
        let welded = weld(&positions, as_triangles(&file.indices));
        if welded.triangles.is_empty() {
            return Err(Error::input(path, "no face has three different positions")
                .with_help("export the mesh again: all of its faces have collapsed"));
        }
        Ok(Self { checked, file, welded })
    }

    /// The file's texture coordinates for each triangle.
    fn uvs(&self) -> Vec<[DVec2; 3]> {
        let corners = as_triangles(&self.file.texcoord_indices);
        let uv = |index: u32| DVec2::from_slice(&self.file.texcoords[2 * index as usize..]);
        self.welded.triangle_sources.iter().map(|&source| corners[source as usize].map(uv)).collect()
    }
}

/// Reads a model with its materials; or, where there is a `colour`, linear red, green and blue, in that one colour.
///
/// # Errors
/// [`Error::Input`] when the file, a material file or a texture cannot be read or is damaged, when there are no faces, when a
/// material is nowhere defined, and when a face with a texture has no texture coordinates.
pub fn load_model(path: impl AsRef<Path>, colour: Option<Vec3>) -> Result<Model> {
    let path = path.as_ref();
    let parsed = Parsed::new(path, &text(path)?)?;
    let checked = &parsed.checked;
    let uvs = match checked.require_uvs(path) {
        Ok(()) => parsed.uvs(),
        Err(_) => vec![[DVec2::ZERO; 3]; parsed.welded.triangles.len()],
    };
    let Welded { positions, triangles, triangle_sources, .. } = parsed.welded;
    let mut model = Model {
        path: path.to_owned(),
        positions,
        triangle_materials: vec![0; triangles.len()],
        triangles,
        uvs,
        // Where nothing says otherwise.
        materials: vec![Material { colour: colour.unwrap_or(Vec3::ONE), texture: None }],
    };
    if colour.is_some() {
        return Ok(model);
    }
    let mut known = materials::load(path, &checked.material_files)?;
    for (name, line) in &checked.materials {
        let material = known.remove(name).ok_or_else(|| {
            Error::input(
                path,
                format!("line {line}: the material `{name}` is in none of the files that `mtllib` names"),
            )
            .with_help("export the materials too, or give one colour for all by --colour")
        })?;
        if material.texture.is_some() {
            checked.require_uvs(path).map_err(|error| {
                error.with_help(
                    "export the model with texture coordinates, or give one colour for all by --colour",
                )
            })?;
        }
        model.materials.push(material);
    }
    let material = |&source: &u32| checked.triangle_materials[source as usize].map_or(0, |index| index + 1);
    model.triangle_materials = triangle_sources.iter().map(material).collect();
    Ok(model)
}

/// Parses the text of an OBJ file; `path` is for errors.
fn parse(path: &Path, text: &str, projection: Option<&Projection>) -> Result<Loaded> {
    let parsed = Parsed::new(path, text)?;
    let Parsed { checked, file, welded } = &parsed;
    if projection.is_none() {
        checked.require_uvs(path)?;
    }
    let file_normals = checked.has_normals.then(|| {
        let corners = as_triangles(&file.normal_indices);
        let normal = |index: u32| DVec3::from_slice(&file.normals[3 * index as usize..]);
        welded.triangle_sources.iter().map(|&source| corners[source as usize].map(normal)).collect::<Vec<_>>()
    });
    let normals = normals::per_position(&welded.positions, &welded.triangles, file_normals.as_deref())
        .map_err(|id| {
            Error::input(path, normals::missing(welded.positions[id])).with_help(normals::ADVICE)
        })?;

    let uvs = match projection {
        Some(projection) => projection.uvs(&welded.positions, &welded.triangles),
        None => parsed.uvs(),
    };
    let Parsed { checked, file, welded } = parsed;
    let mesh = Mesh { positions: welded.positions, normals, triangles: welded.triangles, uvs };
    mesh.validate().map_err(|message| Error::input(path, message))?;
    let dropped_triangles = (file.indices.len() / 3 - mesh.triangles.len()) as u64;
    Ok(Loaded { mesh, dropped_triangles, normals_from_file: checked.has_normals })
}

fn as_triangles(indices: &[u32]) -> &[[u32; 3]] {
    indices.as_chunks().0
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;
    use std::fmt::Write;
    use std::path::PathBuf;

    use super::*;
    use crate::mesh::generate::{Generator, Plane, Sphere, Teapot, Torus};
    use crate::mesh::info;

    fn committed(name: &str) -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("meshes").join(name)
    }

    fn parse_good(text: &str) -> Loaded {
        parse(Path::new("test.obj"), text, None).unwrap()
    }

    /// A mesh as an OBJ file, with the shortest digits that give back every bit.
    fn text(mesh: &Mesh) -> String {
        let mut text = String::new();
        for p in &mesh.positions {
            writeln!(text, "v {} {} {}", p.x, p.y, p.z).unwrap();
        }
        let mut uvs = HashMap::new();
        for uv in mesh.uvs.iter().flatten() {
            let next = uvs.len() + 1;
            uvs.entry(uv.to_array().map(f64::to_bits)).or_insert_with(|| {
                writeln!(text, "vt {} {}", uv.x, uv.y).unwrap();
                next
            });
        }
        for n in &mesh.normals {
            writeln!(text, "vn {} {} {}", n.x, n.y, n.z).unwrap();
        }
        for (ids, corners) in mesh.triangles.iter().zip(&mesh.uvs) {
            let corner = |k: usize| {
                let (id, uv) = (ids[k] + 1, uvs[&corners[k].to_array().map(f64::to_bits)]);
                format!("{id}/{uv}/{id}")
            };
            writeln!(text, "f {} {} {}", corner(0), corner(1), corner(2)).unwrap();
        }
        text
    }

    #[test]
    fn generated_meshes_come_back() {
        for generator in [
            Generator::Plane(Plane::default()),
            Generator::Sphere(Sphere::default()),
            Generator::Torus(Torus::default()),
            Generator::Teapot(Teapot::default()),
        ] {
            let mesh = generator.build().unwrap();
            let loaded = parse_good(&text(&mesh));
            assert_eq!((loaded.dropped_triangles, loaded.normals_from_file), (0, true));
            assert_eq!(loaded.mesh.uvs, mesh.uvs);
            // Positions are numbered as the triangles use them.
            for (ours, theirs) in loaded.mesh.triangles.iter().flatten().zip(mesh.triangles.iter().flatten())
            {
                let (ours, theirs) = (*ours as usize, *theirs as usize);
                assert_eq!(loaded.mesh.positions[ours], mesh.positions[theirs]);
                // The average of equal unit normals, renormalised: a few roundings.
                assert!((loaded.mesh.normals[ours] - mesh.normals[theirs]).length() < 1e-15);
            }
        }
    }

    #[test]
    fn computed_normals_approach_the_analytic() {
        let mesh = Generator::Sphere(Sphere::default()).build().unwrap();
        let without: String =
            text(&mesh).lines().filter(|line| !line.starts_with("vn")).fold(String::new(), |all, line| {
                let line = if line.starts_with('f') {
                    let corners = line.split_whitespace().skip(1).map(|c| c.rsplit_once('/').unwrap().0);
                    corners.fold("f".to_owned(), |face, corner| face + " " + corner)
                } else {
                    line.to_owned()
                };
                all + &line + "\n"
            });
        let loaded = parse_good(&without);
        assert!(!loaded.normals_from_file);
        for (normal, position) in loaded.mesh.normals.iter().zip(&loaded.mesh.positions) {
            // Facets are off by half an edge, 2 pi / 96; the average by its square at most.
            assert!((*normal - position.normalize()).length() < (std::f64::consts::PI / 48.0).powi(2));
        }
    }

    #[test]
    fn the_cube_is_closed_and_its_normals_are_diagonals() {
        let loaded = load_counted(committed("cube.obj"), None).unwrap();
        let info = info(&loaded.mesh);
        assert_eq!((info.positions, info.triangles, info.boundary_edges), (8, 12, 0));
        assert!(info.consistently_oriented && info.triangles_against_normals == 0);
        // Every edge but the 6 diagonals joins two faces that both have the whole unit square.
        assert_eq!((info.area, info.uv_seam_edges), (24.0, 12));
        for (normal, position) in loaded.mesh.normals.iter().zip(&loaded.mesh.positions) {
            assert!((*normal - position.normalize()).length() < 1e-15, "{normal} at {position}");
        }
    }

    #[test]
    fn polygons_objects_and_face_normals_are_merged() {
        let loaded = load_counted(committed("hexagonal-prism.obj"), None).unwrap();
        assert!(loaded.normals_from_file);
        let info = info(&loaded.mesh);
        assert_eq!((info.positions, info.triangles, info.boundary_edges), (12, 2 * 4 + 6 * 2, 0));
        assert!(info.consistently_oriented && info.triangles_against_normals == 0);
        for (normal, position) in loaded.mesh.normals.iter().zip(&loaded.mesh.positions) {
            // At each corner: 120 degrees of the cap, 90 degrees of each of two sides 60 degrees apart.
            let outward = DVec3::new(position.x, 0.0, position.z).normalize();
            let along = 2.0 * 90.0 * 30_f64.to_radians().cos();
            let expected = (along * outward + 120.0 * position.y.signum() * DVec3::Y).normalize();
            // The file gives its coordinates to six digits.
            assert!((*normal - expected).length() < 2e-6, "{normal} instead of {expected}");
        }
    }

    /// A unit icosphere with 80 triangles, two poles and spherical texture coordinates.
    fn icosphere() -> Mesh {
        let golden = 0.5 * (1.0 + 5_f64.sqrt());
        let corners = [[0.0, 1.0, golden], [1.0, golden, 0.0], [golden, 0.0, 1.0]];
        let mut positions = Vec::new();
        for [x, y, z] in corners {
            for signs in 0..4 {
                let mut signs = [signs & 1, signs >> 1].into_iter();
                let mut signed = |c: f64| if c != 0.0 && signs.next() == Some(1) { -c } else { c };
                positions.push(DVec3::new(signed(x), signed(y), signed(z)).normalize());
            }
        }
        let mut triangles = Vec::new();
        let edge = positions.iter().skip(1).map(|p| p.distance(positions[0])).fold(f64::INFINITY, f64::min);
        let adjacent = |a: usize, b: usize| (positions[a].distance(positions[b]) - edge).abs() < 1e-9;
        for a in 0..12 {
            for b in a + 1..12 {
                for c in b + 1..12 {
                    if adjacent(a, b) && adjacent(b, c) && adjacent(c, a) {
                        let outward = positions[a].dot(positions[b].cross(positions[c])) > 0.0;
                        triangles.push(if outward { [a, b, c] } else { [a, c, b] });
                    }
                }
            }
        }
        let mut middles = HashMap::new();
        let mut fine = Vec::new();
        for [a, b, c] in triangles {
            let [ab, bc, ca] = [[a, b], [b, c], [c, a]].map(|[from, to]| {
                *middles.entry([from.min(to), from.max(to)]).or_insert_with(|| {
                    positions.push(positions[from].midpoint(positions[to]).normalize());
                    positions.len() - 1
                })
            });
            fine.extend(
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]].map(|ids| ids.map(|id| id as u32)),
            );
        }
        // Nine digits are plenty, and the same on every machine.
        let round = |x: f64| (x * 1e9).round() / 1e9;
        for position in &mut positions {
            *position = DVec3::from_array(position.to_array().map(round));
        }
        let mut uvs = Projection::Spherical.uvs(&positions, &fine);
        for uv in uvs.iter_mut().flatten() {
            *uv = DVec2::from_array(uv.to_array().map(round));
        }
        let normals = positions.clone();
        Mesh { positions, normals, triangles: fine, uvs }
    }

    #[test]
    fn the_icosphere_is_what_its_construction_gives() {
        let path = committed("icosphere.obj");
        let expected = text(&icosphere());
        if std::env::var_os("MESOSHELL_WRITE_MESHES").is_some() {
            std::fs::write(&path, &expected).unwrap();
        }
        let advice = "run this test with MESOSHELL_WRITE_MESHES=1 to write it again";
        assert!(std::fs::read_to_string(&path).unwrap() == expected, "{}: {advice}", path.display());

        let mesh = load(&path, None).unwrap();
        let info = info(&mesh);
        assert_eq!((info.positions, info.triangles, info.boundary_edges), (42, 80, 0));
        assert!(info.consistently_oriented && info.triangles_against_normals == 0);
        assert!(info.uv_seam_edges > 0);
    }

    #[test]
    fn collapsed_faces_are_dropped_and_counted() {
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 0 0\nvt 0 0\nf 1/1 2/1 3/1\nf 2/1 4/1 3/1\n";
        let loaded = parse_good(text);
        assert_eq!((loaded.mesh.triangles.len(), loaded.dropped_triangles), (1, 1));
        let error = parse(Path::new("a.obj"), &text.replace("f 1/1", "f 4/1"), None).unwrap_err();
        assert!(error.to_string().contains("no face has three different positions"), "{error}");
    }

    #[test]
    fn a_sheet_with_two_sides_is_refused() {
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\nf 1/1 3/1 2/1\n";
        let error = parse(Path::new("leaf.obj"), text, None).unwrap_err();
        assert!(error.to_string().contains("no normal"), "{error}");
    }

    #[test]
    fn a_projection_serves_where_texture_coordinates_lack() {
        let text = "v -1 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
        let projection = "planar-z".parse().unwrap();
        let loaded = parse(Path::new("a.obj"), text, Some(&projection)).unwrap();
        assert_eq!(loaded.mesh.uvs, [[DVec2::ZERO, DVec2::X, DVec2::new(0.5, 0.5)]]);
    }

    #[test]
    fn a_missing_file_is_named() {
        let error = load("no-such.obj", None).unwrap_err();
        assert_eq!(error.exit_code(), 3);
        assert!(error.to_string().starts_with("no-such.obj: cannot be read"), "{error}");
        assert!(load(env!("CARGO_MANIFEST_DIR"), None).is_err(), "a folder is no mesh");
    }

    #[test]
    fn every_truncation_is_an_error_or_a_mesh() {
        let whole = std::fs::read_to_string(committed("hexagonal-prism.obj")).unwrap();
        for end in 0..whole.len() {
            match parse(Path::new("cut.obj"), &whole[..end], None) {
                Ok(loaded) => loaded.mesh.validate().unwrap(),
                Err(error) => assert!(matches!(error, Error::Input { .. }), "{error:?}"),
            }
        }
    }
}
