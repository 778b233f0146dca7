//! Animated scenes: frames are what the same scene is when it is loaded alone, and share what does not move.

mod common;

use std::path::Path;
use std::sync::Arc;

use common::Watched;
use mesoshell::frame::Report;
use mesoshell::progress::Silent;
use mesoshell::scene::{Loaded, Scene, Sequence};
use mesoshell::volume::{self, Volume};

const STILL: &str = r#"
mesh = { generator = "torus", segments = 16, rings = 8 }
shell = { thickness = 0.3, uv_scale = [4, 2], wind = { direction = [1, 0, 0], strength = 0.2 } }
volume = { recipe = "clouds.toml" }
camera = { eye = [0, 3.0, 4.4], target = [0, 0, 0] }
image = { size = [48, 48] }

[base]
colour = [0.2, 0.1, 0.05]

[shading]
shadow_size = 64

[[light]]
name = "sun"
direction = [-1, -1, -0.5]
shadow = true

[[deform]]
name = "twist"
kind = "twist"
axis = [1, 0, 0]
range = [-1, 1]
angle = 0

[timeline]
frames = 6
rate = 3
loop = true
"#;

/// A key, and its values at the start and after a second, of two.
const MOVES: [(&str, &str, &str); 11] = [
    ("camera.orbit", "0", "90"),
    ("shell.thickness", "0.3", "0.2"),
    ("shell.uv_offset", "[0, 0]", "[0.5, 0.25]"),
    ("shell.uv_rotation", "0", "90"),
    ("mesh.minor_radius", "0.3", "0.4"),
    ("light.sun.direction", "[-1, -1, -0.5]", "[0.5, -1, -0.5]"),
    ("volume.vary.coverage", "0.6", "0.3"),
    ("shading.diffuse", "1", "0.5"),
    ("deform.twist.angle", "0", "60"),
    ("mesh.transform.rotate", "[0, 0, 0]", "[30, 10, 0]"),
    ("shell.wind.strength", "0.2", "0.6"),
];

struct Animation(tempfile::TempDir);

impl Animation {
    fn new(tracks: &[(&str, &str, &str)]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let recipe = "recipe = \"clouds\"\nsize = [16, 16, 8]\n";
        std::fs::write(folder.path().join("clouds.toml"), recipe).unwrap();
        let mut text = STILL.to_owned();
        for (key, from, to) in tracks {
            text += &format!("[[track]]\nkey = \"{key}\"\nat = [0, 1, 2]\nvalues = [{from}, {to}, {from}]\n");
        }
        std::fs::write(folder.path().join("scene.toml"), text).unwrap();
        Self(folder)
    }

    fn path(&self) -> std::path::PathBuf {
        self.0.path().join("scene.toml")
    }

    fn open(&self) -> Sequence {
        Sequence::open(&self.path(), &[], &Silent).unwrap_or_else(|error| panic!("{error}"))
    }
}

fn at(sequence: &mut Sequence, frame: u32) -> Arc<Scene> {
    let Loaded { scene, .. } =
        sequence.at(frame, &Silent, &|_| Ok(())).unwrap_or_else(|error| panic!("{error}"));
    Arc::new(scene)
}

/// The names of the parts that differ in value.
fn differences(a: &Scene, b: &Scene) -> Vec<&'static str> {
    let parts = [
        ("topology", a.shell.topology == b.shell.topology),
        ("vertices", a.shell.vertices == b.shell.vertices),
        ("texture", a.shell.texture == b.shell.texture && a.shell.cells() == b.shell.cells()),
        ("volume", a.volume == b.volume),
        ("shading", a.shading == b.shading),
        ("solids", a.solids == b.solids),
        ("medium", a.medium == b.medium && a.march == b.march),
        ("view", a.view == b.view),
    ];
    parts.into_iter().filter_map(|(name, same)| (!same).then_some(name)).collect()
}

#[test]
fn a_frame_is_the_same_whatever_was_asked_for_before() {
    for moves in MOVES.iter().map(std::slice::from_ref).chain([&MOVES[..]]) {
        let animation = Animation::new(moves);
        let mut sequence = animation.open();
        let first = at(&mut sequence, 1);
        for frame in [4, 2, 6, 3, 4, 1, 5] {
            let alone = at(&mut animation.open(), frame);
            let found = at(&mut sequence, frame);
            assert_eq!(differences(&found, &alone), [""; 0], "frame {frame} of {moves:?}");
            assert_eq!(frame == 1, differences(&found, &first).is_empty(), "frame {frame} of {moves:?}");
        }
    }
}

#[test]
fn what_does_not_move_is_shared() {
    let shared = |key: &str| {
        let moves = MOVES.iter().find(|(moved, ..)| *moved == key).unwrap();
        let animation = Animation::new(&[*moves]);
        let mut sequence = animation.open();
        let (a, b) = (at(&mut sequence, 2), at(&mut sequence, 3));
        let directions = |scene: &Scene| scene.shading.as_ref().unwrap().directions.clone();
        [
            ("topology", Arc::ptr_eq(&a.shell.topology, &b.shell.topology)),
            ("vertices", Arc::ptr_eq(&a.shell.vertices, &b.shell.vertices)),
            ("shell", Arc::ptr_eq(&a.shell, &b.shell)),
            ("volume", Arc::ptr_eq(&a.volume, &b.volume)),
            ("directions", Arc::ptr_eq(&directions(&a), &directions(&b))),
            ("solids", Arc::ptr_eq(&a.solids, &b.solids)),
        ]
        .into_iter()
        .filter_map(|(name, same)| same.then_some(name))
        .collect::<Vec<_>>()
    };
    let all = ["topology", "vertices", "shell", "volume", "directions", "solids"];
    assert_eq!(shared("camera.orbit"), all);
    assert_eq!(shared("light.sun.direction"), all);
    assert_eq!(shared("shell.uv_offset"), ["topology", "vertices", "volume", "directions", "solids"]);
    assert_eq!(shared("shell.thickness"), ["topology", "volume", "directions", "solids"]);
    assert_eq!(shared("shell.wind.strength"), ["topology", "volume", "directions", "solids"]);
    assert_eq!(shared("mesh.minor_radius"), ["topology", "volume", "directions"]);
    assert_eq!(shared("deform.twist.angle"), ["topology", "volume", "directions"]);
    assert_eq!(shared("volume.vary.coverage"), ["topology", "vertices", "shell", "solids"]);
}

fn stages(report: &Report) -> Vec<&str> {
    report.stages.iter().map(|stage| stage.name.as_str()).collect()
}

#[test]
fn an_updated_method_draws_what_a_new_one_does() {
    for moves in MOVES.iter().map(std::slice::from_ref).chain([&MOVES[..]]) {
        let animation = Animation::new(moves);
        let mut sequence = animation.open();
        let scene = at(&mut sequence, 1);
        let mut updated = Watched::prepare("shell", &scene);
        let first = updated.render(&scene.view).image;
        for frame in [2, 4, 4, 1] {
            let scene = at(&mut sequence, frame);
            updated.update(&scene);
            let drawn = updated.render(&scene.view).image;
            let anew = Watched::prepare("shell", &scene).render(&scene.view).image;
            assert_eq!(drawn, anew, "frame {frame} of {moves:?}");
            assert_eq!(drawn == first, frame == 1, "frame {frame} of {moves:?}");
        }
    }
}

#[test]
fn a_texture_that_moves_on_a_mesh_that_stands_costs_no_geometry_and_no_order() {
    let costs = |moves: usize| {
        let animation = Animation::new(&MOVES[moves..=moves]);
        let mut sequence = animation.open();
        let scene = at(&mut sequence, 1);
        let mut method = Watched::prepare("shell", &scene);
        method.render(&scene.view);
        let Loaded { scene, stages: load, .. } = sequence.at(2, &Silent, &|_| Ok(())).unwrap();
        let scene = Arc::new(scene);
        method.update(&scene);
        let report = method.render(&scene.view).report;
        let names = load.iter().map(|stage| stage.name.clone());
        (names.chain(stages(&report).into_iter().map(str::to_owned)).collect::<Vec<_>>(), report.skipped)
    };
    let has = |names: &[String], stage: &str| names.iter().any(|name| name == stage);
    // A volume of other texels.
    let (names, skipped) = costs(6);
    assert!(has(&names, "load.volume") && has(&names, "march"), "{names:?}");
    assert!(["load.mesh", "load.shell", "order", "see"].iter().all(|stage| !has(&names, stage)), "{names:?}");
    assert!(skipped.iter().any(|reason| reason.starts_with("the order is kept")), "{skipped:?}");
    assert!(skipped.iter().any(|reason| reason.starts_with("the shell is kept")), "{skipped:?}");
    // The same texels elsewhere.
    let (names, skipped) = costs(2);
    assert!(has(&names, "load.shell") && has(&names, "see"), "{names:?}");
    assert!(["load.mesh", "load.volume", "order"].iter().all(|stage| !has(&names, stage)), "{names:?}");
    assert!(skipped.iter().any(|reason| reason.starts_with("the volume is kept")), "{skipped:?}");
    // A light.
    let (names, _) = costs(5);
    assert!(has(&names, "shadows") && !has(&names, "order") && !has(&names, "see"), "{names:?}");
    // The mesh itself: all of it, but the volume.
    let (names, skipped) = costs(4);
    assert!(
        ["load.mesh", "load.shell", "order", "see", "shadows"].iter().all(|stage| has(&names, stage)),
        "{names:?}"
    );
    assert!(skipped.iter().any(|reason| reason.starts_with("the shell's topology is kept")), "{skipped:?}");
}

#[test]
fn mistakes_are_told_before_the_first_frame() {
    let animation = Animation::new(&[]);
    let scene = std::fs::read_to_string(animation.path()).unwrap();
    let track = |key: &str, at: &str, values: &str| {
        format!("[[track]]\nkey = \"{key}\"\nat = {at}\nvalues = {values}\n")
    };
    let mistakes = [
        (track("shell.thickness", "[1, 0]", "[1, 2]"), "1 is followed by 0"),
        (track("shell.thickness", "[0, 1]", "[1]"), "1 values for 2 times"),
        (track("shell.thickness", "[]", "[]"), "0 values for 0 times"),
        (track("shell.thicknes", "[0]", "[1]"), "unknown key `thicknes`"),
        (track("shell.thickness", "[0, 2]", "[1, -1]"), "track of `shell.thickness`"),
        (track("shell.thickness", "[0, 1]", "[1, [1, 2]]"), "nothing between these values"),
        (track("light.moon.colour", "[0]", "[[1, 1, 1]]"), "no [[light]] has the name \"moon\""),
        (track("timeline.frames", "[0]", "[2]"), "cannot change in time"),
        (track("volume.recipe", "[0]", "[\"a\"]"), "nothing between these values"),
        (track("volume.vary.cover", "[0]", "[1]"), "cover"),
        (
            track("shell.thickness_map", "[0, 1]", "[\"none.png\", \"none.png\"]") + "ease = \"step\"\n",
            "none.png",
        ),
        (
            track("camera", "[0]", "[1]") + &track("camera.fov", "[0]", "[1]"),
            "`camera.fov` has a track already, that of `camera`",
        ),
    ];
    for (added, part) in mistakes {
        std::fs::write(animation.path(), format!("{scene}{added}")).unwrap();
        let error = Sequence::open(&animation.path(), &[], &Silent).map(drop).unwrap_err();
        let told = error.to_string();
        assert!(told.contains(part), "{added}: {told}");
    }
    let animation = Animation::new(&MOVES);
    let mut sequence = animation.open();
    let error = sequence.at(7, &Silent, &|_| Ok(())).map(drop).unwrap_err();
    assert!(error.to_string().contains("no frame 7: the scene has those from 1 to 6"), "{error}");
}

#[test]
fn volumes_follow_one_another() {
    let animation = Animation::new(&[]);
    let file = |number: u32| animation.0.path().join(format!("v.{number:02}.ktx2"));
    let write = |number: u32, size: [u32; 3]| {
        let texels = vec![[0.1, 0.0, 0.0, 0.1 * number as f32]; size.iter().product::<u32>() as usize];
        volume::write_volume(&file(number), &Volume::new(size, texels).unwrap()).unwrap();
    };
    (2..=4).for_each(|number| write(number, [2, 2, 2]));
    let scene = STILL.replace("recipe = \"clouds.toml\"", "file = \"v.##.ktx2\", rate = 1.5");
    std::fs::write(animation.path(), &scene).unwrap();
    let mut sequence = animation.open();
    // Three frames a second, two of each file.
    for (frame, number) in (1..=6).zip([2.0, 2.0, 3.0, 3.0, 4.0, 4.0]) {
        let scene = at(&mut sequence, frame);
        assert!((scene.volume.levels[0].texels[0][3] - 0.1 * number as f32).abs() < 1e-6, "frame {frame}");
        assert_eq!(differences(&scene, &at(&mut animation.open(), frame)), [""; 0]);
    }
    assert_eq!(sequence.inputs(1).unwrap().files, [2, 3, 4].map(file));
    let with = |key: &str| {
        let mut sequence = Sequence::open(&animation.path(), &[key.to_owned()], &Silent).unwrap();
        at(&mut sequence, 6).volume.levels[0].texels[0][3]
    };
    // After three files the first comes again; a time of its own stands.
    assert!((with("volume.rate=3") - 0.4).abs() < 1e-6 && (with("volume.rate=2.4") - 0.3).abs() < 1e-6);
    assert!((with("volume.time=0") - 0.2).abs() < 1e-6);
    let told = || animation_error(&animation);
    write(3, [2, 2, 1]);
    assert!(told().contains("v.03.ktx2: has [2, 2, 1] texels, but"), "{}", told());
    std::fs::remove_file(file(3)).unwrap();
    assert!(told().contains("number 3 is missing, between 2 and 4"), "{}", told());
}

/// A square that is higher in each of three files.
#[test]
fn meshes_follow_one_another() {
    let animation = Animation::new(&[]);
    let file = |number: u32| animation.0.path().join(format!("m.{number:02}.obj"));
    let write = |number: u32, height: f64, uv: f64, face: &str| {
        let text = format!(
            "v 0 {height} 0\nv 0 {height} 1\nv 1 {height} 1\nv 1 {height} 0\nvt 0 0\nvt {uv} 0\nvt 1 1\nvt 0 1\n\
             f 1/1 2/2 3/3\n{face}\n"
        );
        std::fs::write(file(number), text).unwrap();
    };
    let face = "f 1/1 3/3 4/4";
    [(8, 0.0), (9, 1.0), (10, 3.0)].iter().for_each(|&(number, height)| write(number, height, 1.0, face));
    let scene = STILL
        .replace("generator = \"torus\", segments = 16, rings = 8", "file = \"m.##.obj\", rate = 1.5")
        .replace("thickness = 0.3", "thickness = 0.25");
    std::fs::write(animation.path(), &scene).unwrap();
    let height = |scene: &Scene| {
        let heights = scene.shell.vertices.iter().map(|vertex| vertex.y);
        heights.fold(f64::INFINITY, f64::min)
    };
    let mut sequence = animation.open();
    // Three frames a second, two for each file; after the last the first comes again.
    for (frame, expected) in (1..=6).zip([0.0, 0.5, 1.0, 2.0, 3.0, 1.5]) {
        let scene = at(&mut sequence, frame);
        // A few roundings.
        assert!((height(&scene) - expected).abs() < 1e-12, "frame {frame}: {}", height(&scene));
        assert_eq!(differences(&scene, &at(&mut animation.open(), frame)), [""; 0], "frame {frame}");
    }
    assert_eq!(sequence.inputs(1).unwrap().files[1..], [8, 9, 10].map(file));
    let with = |keys: &[&str]| {
        let keys: Vec<String> = keys.iter().map(|&key| key.to_owned()).collect();
        at(&mut Sequence::open(&animation.path(), &keys, &Silent).unwrap(), 6)
    };
    assert_eq!(height(&with(&["mesh.time=0"])), 0.0, "a time of its own stands");
    assert_eq!(height(&with(&["timeline.loop=false"])), 3.0, "it stands still at its end");
    // A projection along Z would change with the height: it is that of the first file.
    let projected = with(&["mesh.projection=planar-z", "mesh.time=1"]);
    let first = with(&["mesh.projection=planar-z", "mesh.time=0"]);
    assert_eq!(projected.shell.texture, first.shell.texture);

    let told = || animation_error(&animation);
    write(9, 1.0, 0.5, face);
    assert!(told().contains("m.09.obj: triangle 1 has other texture coordinates than in"), "{}", told());
    write(9, 1.0, 1.0, "f 3/3 4/4 1/1");
    assert!(told().contains("m.09.obj: triangle 2 joins other vertices than in"), "{}", told());
    write(9, 1.0, 1.0, "");
    assert!(told().contains("m.09.obj: has 1 triangles, but"), "{}", told());
    std::fs::remove_file(file(9)).unwrap();
    assert!(told().contains("number 9 is missing, between 8 and 10"), "{}", told());
    let alone = scene.replace("m.##.obj", "m.08.obj");
    std::fs::write(animation.path(), alone).unwrap();
    assert!(told().contains("`rate` and `time` are for a sequence"), "{}", told());
}

fn animation_error(animation: &Animation) -> String {
    Sequence::open(&animation.path(), &[], &Silent).map(drop).unwrap_err().to_string()
}

#[test]
fn inputs_change_with_all_that_makes_a_frame() {
    let animation = Animation::new(&MOVES[..1]);
    let sequence = animation.open();
    let inputs = sequence.inputs(2).unwrap();
    assert_eq!(inputs, animation.open().inputs(2).unwrap());
    assert_eq!(inputs.files, [animation.0.path().join("clouds.toml")]);
    assert_ne!(inputs.text, sequence.inputs(3).unwrap().text);
    let other = |overrides: &[&str]| {
        let overrides: Vec<String> = overrides.iter().map(|&one| one.to_owned()).collect();
        Sequence::open(&animation.path(), &overrides, &Silent).unwrap().inputs(2).unwrap()
    };
    assert_ne!(inputs.text, other(&["march.step=0.25"]).text);
    assert_eq!(inputs.text, other(&["timeline.frames=5"]).text, "how many follow makes no difference");
    assert!(Path::new(&inputs.files[0]).is_file());
}
