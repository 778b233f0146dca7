//! Voxelisation against closed forms, and what it refuses.

use glam::{DVec2, DVec3, Vec3};
use mesoshell::mesh::figure::Figure;
use mesoshell::mesh::generate::{Generator, Sphere};
use mesoshell::mesh::model::{Material, Model, Texture};
use mesoshell::volume::voxelize::{Options, Scaling, Voxels, voxelize};

const CUBE: Options = Options { size: [32; 3], scaling: Scaling::Fit, margin: 0.0, tile: false, sheet: None };

fn model(positions: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Model {
    Model {
        path: "test.obj".into(),
        uvs: vec![[DVec2::ZERO; 3]; triangles.len()],
        triangle_materials: vec![0; triangles.len()],
        positions,
        triangles,
        materials: vec![Material { colour: Vec3::new(0.8, 0.4, 0.2), texture: None }],
    }
}

/// The convex solid between two quadrilaterals, each counter-clockwise as seen from above.
fn prism(below: [DVec3; 4], above: [DVec3; 4]) -> Model {
    let quads = [[3, 2, 1, 0], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
    model([below, above].concat(), triangles.collect())
}

fn cuboid(low: DVec3, high: DVec3) -> Model {
    let floor = [[low.x, high.z], [high.x, high.z], [high.x, low.z], [low.x, low.z]];
    let at = |y: f64| floor.map(|[x, z]| DVec3::new(x, y, z));
    prism(at(low.y), at(high.y))
}

/// Both, whether or not they overlap.
fn union(mut one: Model, other: &Model) -> Model {
    let first = one.positions.len() as u32;
    one.positions.extend(&other.positions);
    one.triangles.extend(other.triangles.iter().map(|ids| ids.map(|id| id + first)));
    one.uvs.extend(&other.uvs);
    one.triangle_materials.extend(&other.triangle_materials);
    one
}

fn ball(segments: u32) -> Model {
    let mesh =
        Generator::Sphere(Sphere { segments, rings: segments / 2, ..Sphere::default() }).build().unwrap();
    model(mesh.positions, mesh.triangles)
}

fn volume_of(model: &Model) -> f64 {
    let six = |ids: &[u32; 3]| {
        let [a, b, c] = ids.map(|id| model.positions[id as usize]);
        a.dot(b.cross(c))
    };
    model.triangles.iter().map(six).sum::<f64>() / 6.0
}

fn alpha(voxels: &Voxels, u: u32, v: u32, w: u32) -> f32 {
    voxels.volume.texel([u, v, w])[3]
}

#[test]
fn a_box_covers_what_it_covers() {
    let voxels = voxelize(&cuboid(DVec3::ZERO, DVec3::ONE), &Options { margin: 2.25, ..CUBE }).unwrap();
    // It spans 2.25 to 29.75 in u and v, 0 to 27.5 in w.
    let part = |i: u32| match i {
        0..2 | 30.. => 0.0,
        2 | 29 => 0.75,
        _ => 1.0,
    };
    let above = |w: u32| match w {
        0..27 => 1.0,
        27 => 0.5,
        _ => 0.0,
    };
    for (u, v, w) in (0..32 * 32 * 32).map(|i| (i % 32, i / 32 % 32, i / 1024)) {
        let (expected, found) = (part(u) * part(v) * above(w), alpha(&voxels, u, v, w));
        if [0.0, 1.0].contains(&expected) {
            assert_eq!(found, expected, "({u}, {v}, {w})");
        } else {
            // Across u, or v, 89 rays are 1/89 apart; at an edge along w both count.
            assert!(
                (found - expected).abs() <= 1.0 / 89.0 + 1e-6,
                "({u}, {v}, {w}): {found}, not {expected}"
            );
        }
    }
    let [r, g, b, a] = voxels.volume.texel([2, 2, 27]);
    assert_eq!([r, g, b], [0.8 * a, 0.4 * a, 0.2 * a], "premultiplied");
}

#[test]
fn normals_point_away_from_the_faces() {
    let voxels = voxelize(&cuboid(DVec3::ZERO, DVec3::ONE), &Options { margin: 2.25, ..CUBE }).unwrap();
    let normal = |u: usize, v: usize, w: usize| Vec3::from(voxels.normals[(w * 32 + v) * 32 + u]);
    assert_eq!(normal(16, 16, 27), Vec3::Z);
    assert_eq!(normal(2, 16, 16), Vec3::NEG_X);
    assert_eq!(normal(16, 29, 16), Vec3::Y);
    assert_eq!(normal(16, 16, 16), Vec3::ZERO, "inside");
    assert_eq!(normal(16, 16, 31), Vec3::ZERO, "outside");
    // Three quarters of the texel's two walls: the areas are equal.
    assert!(normal(2, 2, 10).distance(Vec3::new(-1.0, -1.0, 0.0).normalize()) < 1e-6);

    let voxels = voxelize(&ball(64), &CUBE).unwrap();
    let mut compared = 0;
    for (index, normal) in voxels.normals.iter().enumerate().filter(|(_, normal)| **normal != [0.0; 3]) {
        let place = Vec3::new((index % 32) as f32, (index / 32 % 32) as f32, (index / 1024) as f32);
        let radial = (place + 0.5 - 16.0).normalize();
        let normal = Vec3::from(*normal);
        assert!((normal.length() - 1.0).abs() < 1e-6);
        // The surface in a texel is at most 3^(1/2) / 2 from its centre, and 16 from that of the ball; facets turn by 2 pi / 64.
        assert!(normal.angle_between(radial) < 0.866 / 14.0 + 0.1, "{normal} at {place}");
        compared += 1;
    }
    assert!(compared > 2000, "{compared}");
}

#[test]
fn a_slope_is_covered_exactly() {
    // The top falls by 1/2 along X and rises by 1/4 along Z, which is -v; each is 32 texels long.
    let floor = [[0.0, 32.0], [32.0, 32.0], [32.0, 0.0], [0.0, 0.0]];
    let top = |x: f64, z: f64| 20.0 - 0.5 * x + 0.25 * z;
    let at = |y: fn(f64, f64) -> f64| floor.map(|[x, z]| DVec3::new(x, y(x, z), z));
    let height = |voxels: &Voxels, u, v| (0..32).map(|w| f64::from(alpha(voxels, u, v, w))).sum::<f64>();
    for (bias, is_right) in [(0.0, true), (0.01, false)] {
        let voxels = voxelize(&prism(at(|_, _| 0.0), at(|x, z| 20.0 - 0.5 * x + 0.25 * z)), &CUBE).unwrap();
        assert_eq!(voxels.scale, [1.0; 3]);
        let worst = (0..32 * 32).map(|i| (i % 32, i / 32)).map(|(u, v)| {
            // The mean of a linear function over the rays is its value at their mean, the middle of the texel.
            let expected = top(f64::from(u) + 0.5, 31.5 - f64::from(v)) + bias;
            (height(&voxels, u, v) - expected).abs()
        });
        // 20 opacities, each rounded to 2^-24.
        assert_eq!(worst.fold(0.0, f64::max) < 2e-6, is_right);
    }
}

#[test]
fn a_ball_has_the_volume_of_its_mesh() {
    let ball = ball(48);
    let options = Options { size: [64; 3], ..CUBE };
    let voxels = voxelize(&ball, &options).unwrap();
    let sum: f64 = voxels.volume.texels.iter().map(|texel| f64::from(texel[3])).sum();
    let expected = volume_of(&ball) * voxels.scale.iter().product::<f64>();
    // Columns at the silhouette, 2 pi 32 = 200, rise by up to (2 x 32)^(1/2) x 2 = 16; the rays err by less than 0.03 of that
    // (their discrepancy); those inside are all but linear. Together 100 of 137,000.
    assert!((sum / expected - 1.0).abs() < 1e-3, "{sum} {expected}");
    let full = voxels.volume.texels.iter().filter(|texel| texel[3] == 1.0).count() as f64;
    assert!(full > 0.85 * expected && full < expected, "{full} of {expected}");
}

#[test]
fn parts_may_overlap_and_touch() {
    let one = cuboid(DVec3::ZERO, DVec3::new(2.0, 1.0, 1.0));
    let overlapping =
        union(cuboid(DVec3::ZERO, DVec3::new(1.3, 1.0, 1.0)), &cuboid(DVec3::X, DVec3::new(2.0, 1.0, 1.0)));
    let touching = union(cuboid(DVec3::ZERO, DVec3::ONE), &cuboid(DVec3::X, DVec3::new(2.0, 1.0, 1.0)));
    let turned = {
        let mut inside_out = one.clone();
        inside_out.triangles.iter_mut().for_each(|ids| ids.swap(0, 1));
        inside_out
    };
    let options = Options { margin: 1.3, ..CUBE };
    let expected = voxelize(&one, &options).unwrap().volume;
    for other in [&overlapping, &touching, &turned] {
        let found = voxelize(other, &options).unwrap().volume;
        for (a, b) in found.texels.iter().zip(&expected.texels) {
            assert!((a[3] - b[3]).abs() < 1e-6, "{a:?} {b:?}");
        }
    }
}

#[test]
fn what_sticks_out_is_cut_or_comes_in_again() {
    // It leans along X, so that what comes in again is not where it was already.
    let at = |x: f64, y: f64, z: f64| {
        [[0.0, 2.0 - z], [1.0, 2.0 - z], [1.0, z], [0.0, z]].map(|[u, z]| DVec3::new(x + u, y, z))
    };
    let leaning = prism(at(0.0, 0.0, 0.0), at(1.0, 2.0, 0.5));
    let whole = voxelize(&leaning, &Options { size: [24; 3], ..CUBE }).unwrap();
    let small = Options { size: [16, 16, 24], margin: -4.0, ..CUBE };
    let cut = voxelize(&leaning, &small).unwrap();
    let tiled = voxelize(&leaning, &Options { tile: true, ..small }).unwrap();
    assert_eq!(cut.scale, whole.scale);
    let mut wrapped = 0;
    for (u, v, w) in (0..16 * 16 * 24).map(|i| (i % 16, i / 16 % 16, i / 256)) {
        assert_eq!(alpha(&cut, u, v, w), alpha(&whole, u + 4, v + 4, w), "({u}, {v}, {w})");
        // The texels of the whole that fall here.
        let places = |i: u32| [i + 4, (i + 20) % 32].into_iter().filter(|&i| i < 24);
        let copies: Vec<f32> = places(u)
            .flat_map(|u| places(v).map(move |v| (u, v)))
            .map(|(u, v)| alpha(&whole, u, v, w))
            .collect();
        let most = copies.iter().copied().fold(0.0, f32::max);
        let found = alpha(&tiled, u, v, w);
        if copies.iter().filter(|&&alpha| alpha > 0.0).count() <= 1 || most == 1.0 {
            assert_eq!(found, most, "({u}, {v}, {w})");
        } else {
            assert!(found >= most && found <= copies.iter().sum::<f32>() + 1e-6);
        }
        wrapped += usize::from(found > alpha(&cut, u, v, w));
    }
    assert!(wrapped > 300, "{wrapped}");
}

#[test]
fn an_open_sheet_gets_its_thickness() {
    let floor = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]].map(|[x, z]| DVec3::new(x, 0.0, z));
    let mut sheet = model(floor.to_vec(), vec![[0, 1, 2], [0, 2, 3]]);
    // Red to the left, blue to the right.
    let texture = Texture::new(2, 1, vec![Vec3::X, Vec3::Z]);
    sheet.materials[0] = Material { colour: Vec3::ONE, texture: Some(texture) };
    sheet.uvs = sheet
        .triangles
        .iter()
        .map(|ids| ids.map(|id| floor[id as usize]).map(|p| DVec2::new(p.x, p.z)))
        .collect();
    let voxels = voxelize(&sheet, &Options { sheet: Some(2.5), margin: 1.0, ..CUBE }).unwrap();
    for (u, v) in (4..28).flat_map(|u| (4..28).map(move |v| (u, v))) {
        let column: Vec<f32> = (0..32).map(|w| alpha(&voxels, u, v, w)).collect();
        assert_eq!(column[..4], [1.0, 1.0, 0.5, 0.0], "({u}, {v})");
    }
    let [left, right] = [9, 22].map(|u| voxels.volume.texel([u, 16, 0]));
    assert!(left[0] > 0.95 && left[2] < 0.05, "{left:?}");
    assert!(right[2] > 0.95 && right[0] < 0.05, "{right:?}");
    let refusal = voxelize(&sheet, &CUBE).unwrap_err();
    assert!(refusal.to_string().contains("4 of its 5 edges have one triangle"), "{refusal}");
}

#[test]
fn what_encloses_nothing_is_refused() {
    type Spoil = fn(&mut Model);
    let defects: [(Spoil, &str, &str); 6] = [
        (|model| model.triangles.clear(), "no triangle", ""),
        (
            |model| model.triangles.truncate(11),
            "not closed: 3 of its 18 edges have one triangle",
            "--surface",
        ),
        (
            |model| model.triangles[3].swap(0, 1),
            "triangles at 3 of the 18 edges disagree",
            "normals consistent",
        ),
        (
            |model| model.triangles.push([1, 2, 6]),
            "not manifold: 3 of its 18 edges have three triangles",
            "inner faces",
        ),
        (
            |model| model.triangles.push([0, 1, 6]),
            "not closed: 1 of its 19 edges have one triangle, and 2 edges with three",
            "--surface",
        ),
        (|model| model.triangles = vec![[0, 1, 2], [0, 2, 1]], "fills no part", "--surface"),
    ];
    for (spoil, words, advice) in defects {
        let mut model = cuboid(DVec3::ZERO, DVec3::ONE);
        assert!(voxelize(&model, &CUBE).is_ok());
        spoil(&mut model);
        model.uvs.resize(model.triangles.len(), [DVec2::ZERO; 3]);
        model.triangle_materials.resize(model.triangles.len(), 0);
        let error = voxelize(&model, &CUBE).unwrap_err();
        let mesoshell::Error::Input { message, help, .. } = &error else { panic!("{error:?}") };
        assert!(message.contains(words), "{message:?} should say {words:?}");
        assert!(help.as_deref().unwrap_or_default().contains(advice), "{help:?}");
    }
    let model = cuboid(DVec3::ZERO, DVec3::ONE);
    for bad in [
        Options { size: [0, 4, 4], ..CUBE },
        Options { margin: 16.0, ..CUBE },
        Options { margin: -17.0, ..CUBE },
        Options { margin: f64::NAN, ..CUBE },
        Options { sheet: Some(0.0), ..CUBE },
        Options { sheet: Some(f64::NAN), ..CUBE },
    ] {
        assert_eq!(voxelize(&model, &bad).unwrap_err().exit_code(), 2, "{bad:?}");
    }
    let huge = Options { size: [1 << 16; 3], ..CUBE };
    assert_eq!(voxelize(&model, &huge).unwrap_err().exit_code(), 5);
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let chain = Figure::Chain.model();
    let options = Options { size: [64, 32, 24], margin: -11.36, tile: true, ..CUBE };
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| voxelize(&chain, &options).unwrap())
    };
    assert!(with(1) == with(3));
}

#[test]
fn figures_are_closed_and_stand_up() {
    for (name, figure) in Figure::ALL {
        let model = figure.model();
        let voxels = voxelize(&model, &Options { size: [48; 3], margin: 0.5, ..CUBE }).unwrap();
        let filled = voxels.volume.texels.iter().filter(|texel| texel[3] > 0.0).count();
        assert!(filled > 2000, "{name}: {filled}");
        assert!(volume_of(&model) > 0.05, "{name} faces outward");
        assert_eq!(Figure::ALL.iter().find(|(_, other)| *other == figure).unwrap().0, figure.name());
    }
}
