//! Visibility orders, checked along every pixel's ray of many views.

use std::f64::consts::TAU;
use std::sync::Arc;

use glam::DVec3;
use mesoshell::mesh::Mesh;
use mesoshell::mesh::generate::{Generator, Plane, Sphere, Torus, Tube, Vase};
use mesoshell::order::relations::FaceTable;
use mesoshell::order::search::InFront;
use mesoshell::order::{self, Check, Order, Sorter};
use mesoshell::scene::{Camera, View};
use mesoshell::shell::{Shell, ShellOptions};
use mesoshell::stress::scenes::{interlocking_bar, loose};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

fn shell(mesh: &Mesh, thickness: f64) -> Shell {
    Shell::build(mesh, &ShellOptions::new(thickness)).unwrap()
}

fn generated(generator: Generator, thickness: f64) -> Shell {
    shell(&generator.build().unwrap(), thickness)
}

/// The mesh with its positions moved; normals are kept.
fn moved(generator: Generator, place: impl Fn(DVec3) -> DVec3) -> Mesh {
    let mut mesh = generator.build().unwrap();
    mesh.positions.iter_mut().for_each(|position| *position = place(*position));
    mesh
}

fn joined(mut first: Mesh, second: Mesh) -> Mesh {
    let offset = first.positions.len() as u32;
    first.positions.extend(second.positions);
    first.normals.extend(second.normals);
    first.triangles.extend(second.triangles.into_iter().map(|t| t.map(|v| v + offset)));
    first.uvs.extend(second.uvs);
    first
}

fn torus(segments: u32, rings: u32) -> Generator {
    Generator::Torus(Torus { segments, rings, ..Torus::default() })
}

fn sphere(radius: f64, segments: u32, rings: u32) -> Generator {
    Generator::Sphere(Sphere { radius, segments, rings })
}

/// Ten shells, none of which overlaps itself, each with its name.
fn shells() -> Vec<(&'static str, Shell)> {
    let plane = || Generator::Plane(Plane { size: 2.0, segments: 10 });
    let tube = Generator::Tube(Tube { radius: 0.7, height: 2.0, segments: 14, rings: 5 });
    let vase = Generator::Vase(Vase { segments: 14, rings: 12, ..Vase::default() });
    let wavy = moved(plane(), |p| DVec3::new(p.x, 0.25 * (5.0 * p.x).sin() * (4.0 * p.z).cos(), p.z));
    let skewed = moved(sphere(1.0, 14, 7), |p| DVec3::new(1.4 * p.x + 0.5 * p.y, 0.6 * p.y, p.z));
    let nested =
        joined(sphere(0.4, 10, 5).build().unwrap(), moved(sphere(1.0, 12, 6), |p| p + 0.1 * DVec3::Y));
    let ring = |segments, rings| {
        Generator::Torus(Torus { minor_radius: 0.25, segments, rings, ..Torus::default() }).build().unwrap()
    };
    let mut link = ring(14, 6);
    let quarter_turn = |p: DVec3| DVec3::new(p.x, p.z, -p.y);
    link.positions.iter_mut().for_each(|p| *p = quarter_turn(*p) + DVec3::X);
    link.normals.iter_mut().for_each(|n| *n = quarter_turn(*n));
    let links = joined(ring(16, 6), link);
    vec![
        ("plane", generated(plane(), 0.3)),
        ("wavy plane", shell(&wavy, 0.2)),
        ("tube", generated(tube, 0.2)),
        ("sphere", generated(sphere(1.0, 16, 8), 0.15)),
        ("thick sphere", generated(sphere(0.5, 12, 6), 0.6)),
        ("skewed sphere", shell(&skewed, 0.1)),
        ("torus", generated(torus(20, 8), 0.15)),
        ("vase", generated(vase, 0.05)),
        ("nested spheres", shell(&nested, 0.15)),
        ("linked rings", shell(&links, 0.1)),
    ]
}

fn random_direction(random: &mut Pcg64) -> DVec3 {
    let y: f64 = random.random_range(-1.0..1.0);
    let (sin, cos) = random.random_range(0.0..TAU).sin_cos();
    let r = (1.0 - y * y).sqrt();
    DVec3::new(r * cos, y, r * sin)
}

/// A view of one of four kinds: from outside; from just off the surface along it; from inside a
/// tetrahedron; from anywhere to anywhere near the shell.
fn random_view(shell: &Shell, kind: usize, random: &mut Pcg64) -> View {
    let size = shell.vertices.iter().map(|v| v.length()).fold(0.0, f64::max);
    let vertices = shell.vertices.len();
    let base = shell.topology.base_vertices as usize;
    let any = random_direction(random);
    let near = random.random_range(0..base);
    let (inner, outer) = (shell.vertices[near], shell.vertices[near + base]);
    let other = shell.vertices[random.random_range(0..vertices)];
    let (eye, target) = match kind {
        0 => (any * size * random.random_range(1.2..4.0), 0.2 * size * random_direction(random)),
        1 => (outer + random.random_range(0.01..0.3) * (outer - inner), other),
        2 => {
            let t = random.random_range(0..shell.topology.tetrahedra.len());
            let weights: [f64; 4] = std::array::from_fn(|_| random.random_range(0.01..1.0));
            let corners = shell.vertices_of(t);
            let eye: DVec3 = (0..4).map(|k| corners[k] * weights[k]).sum();
            (eye / weights.iter().sum::<f64>(), other)
        }
        _ => (any * size * random.random_range(0.0..1.2), other + 0.1 * size * random_direction(random)),
    };
    let camera = Camera {
        eye,
        target,
        up: random_direction(random),
        fov_y: random.random_range(0.3..1.8),
        near: 0.01,
    };
    View { camera, width: 96, height: 80, depth: false }
}

fn sum(checks: impl IntoIterator<Item = Check>) -> Check {
    checks.into_iter().fold(Check::default(), Check::and)
}

#[test]
fn no_ray_of_a_thousand_views_meets_a_wrong_pair() {
    let mut random = Pcg64::seed_from_u64(1);
    let mut total = Check::default();
    for (name, shell) in shells() {
        let sorter = Sorter::new(&shell.topology);
        let mut cycles = 0;
        let found = sum((0..100).map(|i| {
            let view = random_view(&shell, i % 4, &mut random);
            let sorted = sorter.sort(&shell, &view);
            cycles += sorted.order.cycles.len();
            order::check_pixels(&shell, &sorted.order, &view)
        }));
        println!("{name:16} {} tetrahedra, {cycles} cycles: {found:?}", shell.topology.tetrahedra.len());
        total = total.and(found);
    }
    println!("all: {total:?}");
    assert_eq!(total.violations, 0, "{:?}", total.first);
    assert_eq!(total.rays, 1000 * 96 * 80);
    assert!(total.pairs > 10 * total.rays, "too few pairs to prove anything");
}

/// Views along the axes of symmetric shells, with a pixel in the very middle: rays run through vertices, along
/// edges and inside faces, and the eye lies in the planes of many faces.
#[test]
fn symmetric_views_with_exact_ties_are_in_order() {
    let plane = Generator::Plane(Plane { size: 2.0, segments: 6 });
    let shells = [
        generated(plane, 0.25),
        generated(sphere(1.0, 12, 6), 0.25),
        generated(torus(16, 8), 0.125),
        generated(Generator::Tube(Tube { radius: 1.0, height: 2.0, segments: 8, rings: 4 }), 0.25),
    ];
    let mut total = Check::default();
    for shell in &shells {
        for axis in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE, DVec3::new(1.0, 0.0, -1.0)] {
            for distance in [-3.0, 0.0, 0.25, 1.0, 1.125, 4.0] {
                let eye = axis * distance;
                let up = if axis == DVec3::Y { DVec3::X } else { DVec3::Y };
                let camera = Camera { eye, target: eye - axis, up, fov_y: 0.5 * TAU / 2.0, near: 0.01 };
                let view = View { camera, width: 65, height: 65, depth: false };
                let order = order::sort(shell, &view).order;
                let found = order::check_pixels(shell, &order, &view);
                assert_eq!(found.violations, 0, "{view:?}: {:?}", found.first);
                // No such shell has a cycle; samples in the very middle of the pixels would make some.
                assert!(order.cycles.is_empty(), "{view:?}");
                total = total.and(found);
            }
        }
    }
    println!("{total:?}");
    assert!(total.touched > 0, "no ray met an edge: the test shows nothing");
    assert!(total.pairs > total.rays);
}

/// The order by distance of centroids.
fn by_centroid(shell: &Shell, view: &View) -> Order {
    let distance = |&t: &u32| {
        let centroid = shell.vertices_of(t as usize).into_iter().sum::<DVec3>() / 4.0;
        centroid.distance(view.camera.eye)
    };
    let mut sequence: Vec<u32> = (0..shell.topology.tetrahedra.len() as u32).collect();
    sequence.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
    Order { sequence, cycles: vec![] }
}

/// The order by relations between neighbours alone.
fn by_faces(shell: &Shell, view: &View) -> Order {
    let relations =
        FaceTable::new(&shell.topology).relate(&shell.determinants, &shell.vertices, view.camera.eye);
    let in_front = InFront::new(shell.topology.tetrahedra.len(), &[&relations.pairs]);
    let (sequence, cycles) = in_front.components();
    Order { sequence, cycles }
}

#[test]
fn the_check_sees_that_lesser_orders_are_wrong() {
    let shell = generated(torus(24, 12), 0.15);
    let mut random = Pcg64::seed_from_u64(2);
    let views: Vec<View> = (0..20).map(|_| random_view(&shell, 0, &mut random)).collect();
    let wrong_share = |name: &str, order_of: &dyn Fn(&View) -> Order| {
        let found = sum(views.iter().map(|view| order::check_pixels(&shell, &order_of(view), view)));
        let meeting = found.rays as f64;
        println!("{name}: {:.2} % of rays have a wrong pair", 100.0 * found.wrong_rays as f64 / meeting);
        found.wrong_rays
    };
    assert!(wrong_share("centroids", &|view| by_centroid(&shell, view)) > 1000);
    assert!(wrong_share("faces alone", &|view| by_faces(&shell, view)) > 100);
    assert_eq!(wrong_share("SXMPVO", &|view| order::sort(&shell, view).order), 0);
}

#[test]
fn one_swapped_pair_is_found() {
    let shell = generated(torus(16, 8), 0.2);
    let camera =
        Camera { eye: DVec3::new(1.0, 2.0, 3.0), target: DVec3::ZERO, up: DVec3::Y, fov_y: 0.8, near: 0.01 };
    let view = View { camera, width: 64, height: 64, depth: false };
    let right = order::sort(&shell, &view).order;
    assert_eq!(order::check_pixels(&shell, &right, &view).violations, 0);

    // The front tetrahedron of a violation in the reversed order overlaps its partner on a ray.
    let reversed = Order { sequence: right.sequence.iter().rev().copied().collect(), cycles: vec![] };
    let found = order::check_pixels(&shell, &reversed, &view);
    assert_eq!(found.violations, found.pairs - found.undecided - found.overlapping);
    let pair = found.first[0];

    let mut swapped = right.clone();
    let place = |id: u32| right.sequence.iter().position(|&t| t == id).unwrap();
    swapped.sequence.swap(place(pair.front), place(pair.back));
    let found = order::check(&shell, &swapped, camera.eye, &[pair.ray]);
    assert!(found.violations > 0);
    assert!(found.first.iter().any(|v| (v.front, v.back) == (pair.front, pair.back)));
    assert_eq!(found.wrong_rays, 1);

    // Members of one cycle are excepted from each other only.
    let everything = Order { cycles: std::iter::once(0..swapped.sequence.len()).collect(), ..swapped };
    let found = order::check(&shell, &everything, camera.eye, &[pair.ray]);
    assert_eq!((found.violations, found.cyclic), (0, found.pairs));
}

#[test]
fn three_interlocking_tetrahedra_are_a_cycle() {
    let third = TAU / 3.0;
    let mut bars = vec![interlocking_bar(0.0, 2.0)];
    bars.extend((0..3).map(|i| interlocking_bar(f64::from(i) * third, 0.0)));
    bars.push(interlocking_bar(0.1, -2.0));
    let shell = loose(&bars, &[DVec3::ZERO; 5]);
    let camera =
        Camera { eye: DVec3::new(0.0, 0.0, 8.0), target: DVec3::ZERO, up: DVec3::Y, fov_y: 0.4, near: 0.01 };
    let view = View { camera, width: 96, height: 96, depth: false };
    let sorted = order::sort(&shell, &view);
    assert!(sorted.order.cycles.iter().eq([&(1..4)]));
    assert_eq!(sorted.cycle_members, 3);
    assert_eq!((sorted.order.sequence[0], sorted.order.sequence[4]), (0, 4));

    let found = order::check_pixels(&shell, &sorted.order, &view);
    assert_eq!(found.violations, 0);
    assert!(found.cyclic > 0 && found.pairs > found.cyclic);
    // The cycle is real: each of its six orders is wrong somewhere.
    let [a, b, c] = [1, 2, 3];
    for [x, y, z] in [[a, b, c], [a, c, b], [b, a, c], [b, c, a], [c, a, b], [c, b, a]] {
        let forced = Order { sequence: vec![0, x, y, z, 4], cycles: vec![] };
        assert!(order::check_pixels(&shell, &forced, &view).violations > 0);
    }
}

#[test]
fn the_order_of_triangles_in_the_mesh_does_not_matter() {
    let mut random = Pcg64::seed_from_u64(3);
    let mut mesh = torus(20, 10).build().unwrap();
    let count = mesh.triangles.len();
    for i in (1..count).rev() {
        let j = random.random_range(0..=i);
        mesh.triangles.swap(i, j);
        mesh.uvs.swap(i, j);
    }
    let shell = shell(&mesh, 0.15);
    for i in 0..40 {
        let view = random_view(&shell, i % 4, &mut random);
        let found = order::check_pixels(&shell, &order::sort(&shell, &view).order, &view);
        assert_eq!(found.violations, 0, "{view:?}: {:?}", found.first);
    }
}

#[test]
fn far_tiny_and_huge_shells_are_in_order() {
    let mut random = Pcg64::seed_from_u64(4);
    for (scale, offset) in [(1.0, 1e6), (1e-6, 0.0), (1e6, 0.0), (1e12, -1e13)] {
        let mut mesh = torus(16, 8).build().unwrap();
        mesh.positions.iter_mut().for_each(|p| *p *= scale);
        let shell = shell(&mesh, 0.15 * scale);
        let offset = DVec3::new(1.0, -0.7, 0.3) * offset;
        let mut placed = shell.clone();
        Arc::make_mut(&mut placed.vertices).iter_mut().for_each(|v| *v += offset);
        for i in 0..8 {
            let mut view = random_view(&shell, i % 4, &mut random);
            view.camera.eye += offset;
            view.camera.target += offset;
            let found = order::check_pixels(&placed, &order::sort(&placed, &view).order, &view);
            assert_eq!(found.violations, 0, "{view:?}: {:?}", found.first);
            assert!(found.pairs > 0);
        }
    }
}

#[test]
fn prisms_on_one_edge_and_prisms_without_volume_are_in_order() {
    // Two flaps that both run from 0 to 1 on their common edge: the mesh is not orientable there, so their sides
    // are exterior faces, though they are in one place.
    let mut random = Pcg64::seed_from_u64(5);
    let (up, down) = (DVec3::new(0.5, 0.5, 0.8), DVec3::new(0.5, 0.5, -0.8));
    let mesh = Mesh {
        positions: vec![DVec3::ZERO, DVec3::Y, up, down],
        normals: vec![DVec3::X; 4],
        triangles: vec![[0, 1, 2], [0, 1, 3]],
        uvs: vec![Default::default(); 2],
    };
    let flaps = shell(&mesh, 0.3);
    assert_eq!(flaps.health.non_manifold_edges, 1);

    // A shell pinched to nothing at a third of its vertices.
    let mesh = torus(18, 9).build().unwrap();
    let mut options = ShellOptions::new(0.2);
    options.thickness_scale = (0..mesh.positions.len()).map(|i| f64::from(u8::from(i % 3 != 0))).collect();
    let pinched = Shell::build(&mesh, &options).unwrap();
    assert!(pinched.health.zero_volume > 0);

    for shell in [flaps, pinched] {
        let mut total = Check::default();
        for i in 0..100 {
            let view = random_view(&shell, [0, 1, 3][i % 3], &mut random);
            let sorted = order::sort(&shell, &view);
            total = total.and(order::check_pixels(&shell, &sorted.order, &view));
        }
        println!("{total:?}");
        assert_eq!(total.violations, 0, "{:?}", total.first);
        assert!(total.pairs > 50_000);
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let shell = generated(torus(40, 20), 0.15);
    let mut random = Pcg64::seed_from_u64(6);
    for kind in 0..4 {
        let view = random_view(&shell, kind, &mut random);
        let with_threads = |count: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build().unwrap();
            let sorted = pool.install(|| order::sort(&shell, &view));
            (sorted.order, sorted.exit_faces, sorted.face_relations, sorted.image_relations)
        };
        let one = with_threads(1);
        assert_eq!(one, with_threads(2));
        assert_eq!(one, with_threads(4));
    }
}

#[test]
fn exit_faces_are_those_with_the_eye_inside() {
    let shell = generated(torus(16, 8), 0.15);
    let camera =
        Camera { eye: DVec3::new(0.9, 1.7, 2.2), target: DVec3::ZERO, up: DVec3::Y, fov_y: 0.8, near: 0.01 };
    let view = View { camera, width: 16, height: 16, depth: false };
    let sorted = order::sort(&shell, &view);
    for (t, &mask) in sorted.exit_faces.iter().enumerate() {
        let inside = shell.barycentric(t, camera.eye).map(|weight| weight > 0.0);
        assert_eq!(std::array::from_fn(|k| mask >> k & 1 == 1), inside);
        assert!((1..15).contains(&mask), "the eye is outside, and every tetrahedron has a far side");
    }
}
