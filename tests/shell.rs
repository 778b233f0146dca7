//! The shell as a whole, on closed, open, seamed, folded and broken meshes.
//!
//! Each comparison is a function that says what differs, and each is shown to object to a shell that has been
//! tampered with.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DVec2, DVec3, DVec4};
use mesoshell::mesh::Mesh;
use mesoshell::mesh::generate::{Generator, Plane, Sphere, Teapot, Torus, Tube};
use mesoshell::progress::Silent;
use mesoshell::scene;
use mesoshell::shell::{Cell, EXTERIOR, Shell, ShellOptions, Topology};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

// ---- meshes and shells ----

fn generate(generator: Generator) -> Mesh {
    generator.build().expect("sound parameters")
}

fn plane() -> Mesh {
    generate(Generator::Plane(Plane { size: 2.0, segments: 4 }))
}

/// Closed around its axis, where its UVs have a seam; open above and below.
fn tube() -> Mesh {
    generate(Generator::Tube(Tube { segments: 12, ..Tube::default() }))
}

fn sphere() -> Mesh {
    generate(Generator::Sphere(Sphere { radius: 1.0, segments: 14, rings: 9 }))
}

/// With vertices exactly on its inner equator, where its radius is 0.75.
fn torus() -> Mesh {
    generate(Generator::Torus(Torus { major_radius: 1.0, minor_radius: 0.25, segments: 16, rings: 16 }))
}

fn teapot() -> Mesh {
    generate(Generator::Teapot(Teapot::default()))
}

fn all() -> [(&'static str, Mesh); 6] {
    [
        ("triangle", Mesh::triangle()),
        ("plane", plane()),
        ("tube", tube()),
        ("sphere", sphere()),
        ("torus", torus()),
        ("teapot", teapot()),
    ]
}

fn moved(mut mesh: Mesh, place: impl Fn(DVec3) -> DVec3) -> Mesh {
    mesh.positions.iter_mut().for_each(|x| *x = place(*x));
    mesh
}

fn build(mesh: &Mesh, thickness: f64) -> Shell {
    Shell::build(mesh, &ShellOptions::new(thickness)).expect("a sound mesh")
}

// ---- topology ----

fn sorted<const N: usize>(mut ids: [u32; N]) -> [u32; N] {
    ids.sort_unstable();
    ids
}

/// What is wrong with the adjacency of a manifold mesh's shell, if anything.
fn adjacency_fault(topology: &Topology) -> Option<String> {
    let mut owners: BTreeMap<[u32; 3], Vec<(usize, usize)>> = BTreeMap::new();
    let faces = || (0..topology.tetrahedra.len()).flat_map(|t| (0..4).map(move |k| (t, k)));
    for (t, k) in faces() {
        owners.entry(sorted(topology.face(t, k))).or_default().push((t, k));
    }
    for (t, k) in faces() {
        let face = topology.face(t, k);
        if face[0] != sorted(face)[0] {
            return Some(format!("face {k} of {t} does not start at its smallest id"));
        }
        let beyond = owners[&sorted(face)].iter().find(|&&other| other != (t, k));
        let expected = beyond.map_or(EXTERIOR, |&(other, _)| other as u32);
        if topology.neighbours[t][k] != expected {
            return Some(format!("face {k} of {t} leads to {}, not {expected}", topology.neighbours[t][k]));
        }
        if let Some(&(other, j)) = beyond {
            let [a, b, c] = topology.face(other, j);
            if face != [a, c, b] {
                return Some(format!("face {k} of {t} and face {j} of {other} run the same way"));
            }
        }
    }
    None
}

#[test]
fn neighbours_share_exactly_one_face_from_both_sides() {
    for (name, mesh) in all() {
        let shell = build(&mesh, 0.1);
        let topology = &shell.topology;
        assert_eq!(adjacency_fault(topology), None, "{name}");
        let exterior = topology.neighbours.iter().flatten().filter(|&&t| t == EXTERIOR).count();
        let boundary = topology.boundary_edges as usize;
        assert_eq!(exterior, 2 * mesh.triangles.len() + 2 * boundary, "{name}: base, top and rims");
    }
    let mut torn = Topology::clone(&build(&sphere(), 0.1).topology);
    let side = torn.neighbours[5].iter().position(|&t| t != EXTERIOR).expect("a neighbour");
    torn.neighbours[5][side] = EXTERIOR;
    assert!(adjacency_fault(&torn).is_some());
    let mut turned = Topology::clone(&build(&sphere(), 0.1).topology);
    turned.neighbours[5].rotate_left(1);
    assert!(adjacency_fault(&turned).is_some());
    let mut wound = Topology::clone(&build(&sphere(), 0.1).topology);
    wound.tetrahedra[5].swap(0, 1);
    wound.neighbours[5].swap(0, 1);
    assert!(adjacency_fault(&wound).is_some());
}

#[test]
fn prisms_join_across_a_uv_seam() {
    let mesh = tube();
    let topology = &build(&mesh, 0.1).topology;
    let mut sides: BTreeMap<[u32; 2], Vec<(usize, [DVec2; 2])>> = BTreeMap::new();
    for (i, (ids, uvs)) in mesh.triangles.iter().zip(&mesh.uvs).enumerate() {
        for (x, y) in [(0, 1), (1, 2), (2, 0)] {
            let (x, y) = if ids[x] < ids[y] { (x, y) } else { (y, x) };
            sides.entry([ids[x], ids[y]]).or_default().push((i, [uvs[x], uvs[y]]));
        }
    }
    let mut seams = 0;
    for side in sides.values() {
        if let [(i, one), (j, other)] = side[..]
            && one != other
        {
            seams += 1;
            let links = (3 * i..3 * i + 3).flat_map(|t| topology.neighbours[t]);
            assert_eq!(links.filter(|&t| t != EXTERIOR && t as usize / 3 == j).count(), 2);
        }
    }
    assert!(seams >= 1);
}

/// Every tetrahedron as its ids, each with its texture coordinates.
fn tetrahedra(shell: &Shell) -> BTreeSet<[(u32, [u64; 3]); 4]> {
    let bits = |uvw: DVec3| uvw.to_array().map(f64::to_bits);
    let tetrahedron = |(ids, texture): (&[u32; 4], &[DVec3; 4])| {
        let mut corners: [_; 4] = std::array::from_fn(|k| (ids[k], bits(texture[k])));
        corners.sort_unstable();
        corners
    };
    shell.topology.tetrahedra.iter().zip(&*shell.texture).map(tetrahedron).collect()
}

#[test]
fn the_order_of_triangles_and_of_their_corners_does_not_matter() {
    for (name, mesh) in all() {
        let mut shuffled = mesh.clone();
        shuffled.triangles.reverse();
        shuffled.uvs.reverse();
        for (i, (ids, uvs)) in shuffled.triangles.iter_mut().zip(&mut shuffled.uvs).enumerate() {
            ids.rotate_left(i % 3);
            uvs.rotate_left(i % 3);
        }
        let (one, other) = (build(&mesh, 0.1), build(&shuffled, 0.1));
        assert_eq!(tetrahedra(&one), tetrahedra(&other), "{name}");
        assert_eq!((&one.vertices, one.health), (&other.vertices, other.health), "{name}");

        shuffled.uvs[0].rotate_left(1);
        assert_ne!(tetrahedra(&one), tetrahedra(&build(&shuffled, 0.1)), "{name}: UVs of other corners");
    }
}

// ---- geometry ----

/// Six times the volume below oriented triangles, seen from the origin, and the sum of its terms' magnitudes.
fn six_volumes_below(triangles: impl Iterator<Item = [DVec3; 3]>) -> (f64, f64) {
    triangles.map(|[a, b, c]| a.dot(b.cross(c))).fold((0.0, 0.0), |(sum, size), x| (sum + x, size + x.abs()))
}

fn six_volumes(shell: &Shell) -> f64 {
    let six_volume = |t| {
        let [v0, v1, v2, v3] = shell.vertices_of(t);
        (v1 - v0).cross(v2 - v0).dot(v3 - v0)
    };
    (0..shell.topology.tetrahedra.len()).map(six_volume).sum()
}

/// Whether two sums of a few thousand terms, whose magnitudes add up to `size`, agree: an f64 sum errs by
/// at most `terms * epsilon * size`.
fn same_sum(x: f64, y: f64, size: f64) -> bool {
    (x - y).abs() <= 1e4 * f64::EPSILON * size
}

/// Gauss's theorem: the volume is the flux through the exterior faces.
#[test]
fn tetrahedra_fill_what_the_exterior_faces_enclose() {
    for (name, mesh) in all() {
        let mut shell = build(&mesh, 0.1);
        let exterior = (0..shell.topology.tetrahedra.len()).flat_map(|t| (0..4).map(move |k| (t, k)));
        let exterior = exterior.filter(|&(t, k)| shell.topology.neighbours[t][k] == EXTERIOR);
        let corners = |(t, k)| shell.face(t, k).map(|id| shell.vertices[id as usize]);
        let (enclosed, size) = six_volumes_below(exterior.map(corners));
        assert!(same_sum(six_volumes(&shell), enclosed, size), "{name}");

        Arc::make_mut(&mut shell.vertices)[0] += 1e-6;
        assert!(!same_sum(six_volumes(&shell), enclosed, size), "{name}: a vertex has moved");
    }
}

#[test]
fn tetrahedra_of_a_closed_mesh_fill_the_space_between_its_surfaces() {
    for (name, mesh) in [("sphere", sphere()), ("torus", torus())] {
        let shell = build(&mesh, 0.1);
        let surface = |layer: usize| {
            let vertices = &shell.vertices[layer * mesh.positions.len()..];
            six_volumes_below(mesh.triangles.iter().map(|ids| ids.map(|id| vertices[id as usize])))
        };
        let ((base, _), (outer, size)) = (surface(0), surface(1));
        assert!(same_sum(six_volumes(&shell), outer - base, size), "{name}");
        assert!(!same_sum(six_volumes(&shell), outer - base * (1.0 + 1e-9), size), "{name}");
    }
}

#[test]
fn a_flat_layer_has_area_times_thickness() {
    assert!(same_sum(six_volumes(&build(&plane(), 0.3)), 6.0 * 4.0 * 0.3, 24.0));
    assert!(same_sum(six_volumes(&build(&Mesh::triangle(), 0.3)), 6.0 * 0.5 * 0.3, 1.0));
}

/// The largest error of the texture maps, in units of what rounding may do to them.
///
/// A gradient has a relative error of some 10 epsilon of the product of two edges that it comes from, and is
/// multiplied by an edge and by texture coordinates.
fn worst_map_error(shell: &Shell) -> f64 {
    let error = |t: usize| {
        let (vertices, texture) = (shell.vertices_of(t), shell.texture[t]);
        let Cell { gradients, texture_from_world } = shell.cells()[t];
        let longest = |vectors: [DVec3; 4]| vectors.map(DVec3::length).into_iter().fold(0.0, f64::max);
        let condition = longest(vertices.map(|v| v - vertices[0])) * longest(gradients) * longest(texture);
        let miss: [DVec3; 4] = std::array::from_fn(|k| {
            texture_from_world * (vertices[k] - vertices[0]) - (texture[k] - texture[0])
        });
        longest(miss) / (f64::EPSILON * condition)
    };
    (0..shell.topology.tetrahedra.len()).map(error).fold(0.0, f64::max)
}

/// Three gradients with errors of some 10 epsilon each, doubled for the products: see [`worst_map_error`].
const MAP_ERROR: f64 = 60.0;

#[test]
fn texture_maps_take_vertices_to_their_texture_coordinates_wherever_and_however_large() {
    for (name, mesh) in all() {
        for (offset, scale, thickness) in [
            (0.0, 1.0, 0.1),
            (0.0, 1.0, 1e-3),
            (0.0, 1.0, 1e-9),
            (1e6, 1.0, 0.1),
            (-1e6, 1.0, 1e-3),
            (0.0, 1e-6, 0.1),
            (0.0, 1e6, 0.1),
            (1e6, 1e6, 1e-3),
        ] {
            let placed = moved(mesh.clone(), |x| scale * x + DVec3::new(offset, -offset, 0.5 * offset));
            let mut shell = build(&placed, thickness * scale);
            let error = worst_map_error(&shell);
            assert!(error < MAP_ERROR, "{name} * {scale} + {offset}, {thickness} thick: {error}");

            Arc::make_mut(&mut shell.texture)[0][1].y += 1e-11 / thickness;
            assert!(worst_map_error(&shell) > MAP_ERROR, "{name}: a texture coordinate has moved");
        }
    }
}

#[test]
fn texture_maps_are_affine() {
    let mut random = Pcg64Mcg::seed_from_u64(3);
    let shell = build(&torus(), 0.1);
    for t in 0..shell.topology.tetrahedra.len() {
        let weights = [(); 4].map(|()| random.random_range(-1.0..1.0));
        let weights = weights.map(|weight| weight / weights.iter().sum::<f64>().max(0.1));
        let rest = 1.0 - weights[1..].iter().sum::<f64>();
        let weights = [rest, weights[1], weights[2], weights[3]];
        let blend = |corners: [DVec3; 4]| (0..4).map(|k| weights[k] * corners[k]).sum::<DVec3>();
        let point = blend(shell.vertices_of(t));
        // Weights to 30, gradients to 100 and coordinates to 2 magnify some tens of epsilons.
        let mapped = shell.texture_from_world(t).transform_point3(point);
        assert!(mapped.distance(blend(shell.texture[t])) < 1e-9);
        let found = shell.barycentric(t, point);
        assert!((0..4).all(|k| (found[k] - weights[k]).abs() < 1e-9));
        assert!(mapped.distance(blend(shell.texture[(t + 3) % shell.topology.tetrahedra.len()])) > 1e-9);
    }
}

/// Rounded so that moving it by a million, and extruding it by an eighth there, is exact.
fn dyadic(mesh: Mesh) -> Mesh {
    let round = |v: &mut DVec3| *v = (*v * 2f64.powi(24)).round() / 2f64.powi(24);
    let mut mesh = mesh;
    mesh.positions.iter_mut().for_each(round);
    mesh.normals.iter_mut().for_each(round);
    mesh
}

#[test]
fn a_world_offset_costs_not_one_bit() {
    for (name, mesh) in all() {
        let mesh = dyadic(mesh);
        let offset = 2f64.powi(20) * DVec3::new(1.0, -1.0, 1.0);
        let (here, there) = (build(&mesh, 0.125), build(&moved(mesh, |x| x + offset), 0.125));
        assert_eq!(here.cells(), there.cells(), "{name}");
        assert_eq!(here.health, there.health, "{name}");
        assert_ne!(here.vertices, there.vertices, "{name}");
    }
}

#[test]
fn a_power_of_two_scales_the_maps_to_the_bit() {
    for (name, mesh) in all() {
        for scale in [20, -20].map(|exponent| 2f64.powi(exponent)) {
            let (small, large) = (build(&mesh, 0.1), build(&moved(mesh.clone(), |x| scale * x), 0.1 * scale));
            let scaled = |cell: &Cell| Cell {
                gradients: cell.gradients.map(|gradient| scale * gradient),
                texture_from_world: scale * cell.texture_from_world,
            };
            assert!(
                small.cells().iter().eq(large.cells().iter().map(scaled).collect::<Vec<_>>().iter()),
                "{name}"
            );
            assert_eq!((&small.texture, small.health), (&large.texture, large.health), "{name}");
            assert_ne!(small.cells(), large.cells(), "{name}");
        }
    }
}

#[test]
fn planes_face_inward_and_are_shared() {
    let shell = build(&teapot(), 0.02);
    let mut shared = 0;
    for t in 0..shell.topology.tetrahedra.len() {
        let vertices = shell.vertices_of(t);
        for (k, plane) in shell.planes(t).into_iter().enumerate() {
            assert!((plane.truncate().length() - 1.0).abs() < 4.0 * f64::EPSILON);
            assert!(plane.dot(vertices[k].extend(1.0)) > 0.0, "vertex {k} is inside its plane");
            for corner in shell.face(t, k) {
                // Vertices are within 4 units of the origin: a few products of that size are rounded.
                let distance = plane.dot(shell.vertices[corner as usize].extend(1.0)).abs();
                assert!(distance < 32.0 * f64::EPSILON, "{distance}");
            }
            let beyond = shell.topology.neighbours[t][k];
            if beyond != EXTERIOR {
                let planes = shell.planes(beyond as usize);
                shared += usize::from(planes.contains(&-plane) || planes.contains(&plane));
            }
        }
    }
    let interior = shell.topology.neighbours.iter().flatten().filter(|&&t| t != EXTERIOR).count();
    assert_eq!(shared, interior);
}

#[test]
fn a_cell_without_volume_has_neither_planes_nor_coordinates() {
    let options = ShellOptions { thickness_scale: vec![0.0; 3], ..ShellOptions::new(1.0) };
    let shell = Shell::build(&Mesh::triangle(), &options).expect("a sound mesh");
    for t in 0..3 {
        assert_eq!(shell.planes(t), [DVec4::ZERO; 4]);
        assert_eq!(shell.barycentric(t, DVec3::ONE), [0.0; 4]);
    }
}

// ---- rebuilding ----

#[test]
fn rebuilding_places_vertices_anew_and_leaves_the_topology_alone() {
    let mut shell = build(&torus(), 0.1);
    let topology = Arc::clone(&shell.topology);
    let before = Topology::clone(&topology);
    let twisted = moved(torus(), |x| DVec3::new(x.x, x.y + 0.3 * x.x * x.z, 1.2 * x.z));
    let options = ShellOptions { smoothing_rounds: 2, ..ShellOptions::new(0.2) };
    let built = Shell::build(&twisted, &options).expect("a sound mesh");
    assert_ne!(shell, built);
    shell.rebuild(&twisted, &options).expect("the same triangles");
    assert_eq!(shell, built);
    assert!(Arc::ptr_eq(&shell.topology, &topology));
    assert_eq!(*topology, before);
}

#[test]
fn rebuilding_for_another_mesh_is_refused_and_changes_nothing() {
    let built = build(&torus(), 0.1);
    let mut shell = built.clone();
    let mut fewer = torus();
    fewer.triangles.pop();
    fewer.uvs.pop();
    let mut more = torus();
    more.positions.push(DVec3::ZERO);
    more.normals.push(DVec3::Z);
    let mut rewired = torus();
    rewired.triangles[7].rotate_left(1);
    for other in [fewer, more, rewired] {
        let error = shell.rebuild(&other, &ShellOptions::new(0.1)).expect_err("another mesh").to_string();
        assert!(error.contains("not those that the shell was built from"), "{error}");
    }
    shell.rebuild(&torus(), &ShellOptions::new(f64::NAN)).expect_err("no thickness");
    assert_eq!(shell, built);
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let options = ShellOptions { smoothing_rounds: 2, ..ShellOptions::new(0.05) };
    let built = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a thread pool");
        pool.install(|| Shell::build(&teapot(), &options).expect("a sound mesh"))
    });
    assert_eq!(built[0], built[1]);
}

// ---- any prism ----

/// A prism whose outer triangle is shifted, tilted and twisted against its base.
fn any_prism() -> impl Strategy<Value = Shell> {
    let jitter = || prop::array::uniform3(prop::array::uniform3(-0.4..0.4f64));
    let order = Just([0u32, 1, 2]).prop_shuffle();
    (jitter(), jitter(), order).prop_filter_map("folded", |(base, outer, order)| {
        let mut mesh = Mesh::triangle();
        for i in 0..3 {
            mesh.positions[i] += DVec3::from_array(base[i]);
            mesh.normals[i] += DVec3::from_array(outer[i]);
        }
        // Any winding, with normals on the side from which it is counter-clockwise.
        let clockwise = [[0, 2, 1], [2, 1, 0], [1, 0, 2]].contains(&order);
        if clockwise {
            mesh.positions.iter_mut().chain(&mut mesh.normals).for_each(|v| v.z = -v.z);
        }
        mesh.triangles = vec![order];
        let shell = build(&mesh, 1.0);
        (shell.health.inverted + shell.health.zero_volume == 0).then_some(shell)
    })
}

/// How often the exterior faces wind around a point: the sum of their solid angles (Van Oosterom and Strackee,
/// "The solid angle of a plane triangle", 1983) over that of the sphere.
fn winding_number(shell: &Shell, point: DVec3) -> f64 {
    let solid_angle = |face: [u32; 3]| {
        let [a, b, c] = face.map(|id| (shell.vertices[id as usize] - point).normalize());
        2.0 * a.dot(b.cross(c)).atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
    };
    let faces = (0..3).flat_map(|t| (0..4).map(move |k| (t, k)));
    let exterior = faces.filter(|&(t, k)| shell.topology.neighbours[t][k] == EXTERIOR);
    exterior.map(|(t, k)| solid_angle(shell.face(t, k))).sum::<f64>() / (4.0 * PI)
}

/// The tetrahedra that a point lies in, or nothing if it lies on a face of one, near enough.
fn containing(shell: &Shell, point: DVec3) -> Option<Vec<usize>> {
    let coordinates = [0, 1, 2].map(|t| shell.barycentric(t, point));
    let clear = coordinates.iter().flatten().all(|b| b.abs() > 1e-6);
    let inside = |&t: &usize| coordinates[t].iter().all(|&b| b > 0.0);
    clear.then(|| (0..3).filter(inside).collect())
}

proptest! {
    #[test]
    fn a_point_inside_a_prism_lies_in_exactly_one_tetrahedron(
        shell in any_prism(), t in 0..3usize, weights in prop::array::uniform4(0.01..1.0f64)
    ) {
        let corners = shell.vertices_of(t);
        let point = (0..4).map(|k| weights[k] * corners[k]).sum::<DVec3>() / weights.iter().sum::<f64>();
        if let Some(found) = containing(&shell, point) {
            prop_assert!(found.contains(&t));
            let expected = winding_number(&shell, point);
            prop_assert!((expected - found.len() as f64).abs() < 1e-6, "{} and {:?}", expected, found);
        }
    }

    #[test]
    fn a_point_anywhere_lies_in_as_many_tetrahedra_as_the_boundary_winds_around_it(
        shell in any_prism(), point in prop::array::uniform3(-1.0..2.0f64)
    ) {
        let point = DVec3::from_array(point);
        if let Some(found) = containing(&shell, point) {
            let expected = winding_number(&shell, point);
            prop_assert!((expected - found.len() as f64).abs() < 1e-6, "{} and {:?}", expected, found);
        }
    }
}

#[test]
fn the_scenes_to_look_at_first_have_sound_shells() {
    for name in ["fog-torus", "fur-sphere", "weave-teapot"] {
        let path = format!("{}/scenes/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        let health = scene::load(path.as_ref(), &[], &Silent).unwrap().scene.shell.health;
        assert_eq!((health.inverted, health.zero_volume), (0, 0), "{name}: {health:?}");
    }
}
