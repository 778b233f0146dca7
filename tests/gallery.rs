//! A gallery from scene files to page: what is written, what is told, and what a broken scene does to the others.

mod common;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::Arc;

use common::keys;
use mesoshell::Error;
use mesoshell::bench::gallery::{self, Options};
use mesoshell::gpu::DeviceChoice;
use mesoshell::method::Setup;
use mesoshell::progress::{Interrupt, Progress};
use serde_json::Value;
use tempfile::TempDir;

const SCENE: &str = "\
# A ball <of> fog. It is
# thin.

mesh = { generator = 'sphere', segments = 8, rings = 4 }
shell = { thickness = 0.2 }
volume = { recipe = 'fog.toml' }
image = { size = [48, 32] }
";

/// A folder `scenes` of a scene and its recipe, and in it a folder `far` of one.
fn desk() -> TempDir {
    let desk = tempfile::tempdir().unwrap();
    fs::create_dir_all(desk.path().join("scenes/far")).unwrap();
    let fog = "recipe = 'fog'\nsize = [8, 8, 4]\n";
    let far = SCENE.replace("'fog.toml'", "'../fog.toml'").replace("0.2", "0.3");
    for (name, text) in [("fog.toml", fog), ("near.toml", SCENE), ("far/far.toml", &far)] {
        fs::write(desk.path().join("scenes").join(name), text).unwrap();
    }
    desk
}

fn gallery(desk: &TempDir, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_mesoshell"));
    command.args([&["gallery"], arguments].concat());
    command.current_dir(desk.path()).env("NO_COLOR", "1").stdin(Stdio::null()).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

#[track_caller]
fn code(output: &Output, expected: i32) {
    assert_eq!(output.status.code(), Some(expected), "{}", text(&output.stderr));
}

#[test]
fn a_folder_becomes_a_page() {
    let desk = desk();
    let output = gallery(&desk, &["scenes", "-o", "out", "--reference-size", "24x24", "--json"]);
    code(&output, 0);
    let results: Value = serde_json::from_slice(&output.stdout).unwrap();
    let scenes = results["scenes"].as_array().unwrap();
    let told: Vec<_> = scenes.iter().map(|scene| (&scene["scene"], &scene["picture"])).collect();
    let files = ["scenes/near.toml", "scenes/far/far.toml"].map(Value::from);
    let pictures = ["scenes/near.png", "far/far.png"].map(Value::from);
    assert_eq!(told, [(&files[0], &pictures[0]), (&files[1], &pictures[1])]);
    for scene in scenes {
        assert_eq!(
            (&scene["title"], &scene["description"]),
            (&"A ball <of> fog".into(), &"It is thin.".into())
        );
        assert_eq!((&scene["verdict"], &scene["bound"]), (&"passed".into(), &5e-3.into()));
        let error = &scene["error"];
        assert_eq!(
            (&error["width"], &error["height"], &error["pixels"]),
            (&24.into(), &16.into(), &384.into())
        );
        assert!(error["rmse"].as_f64().unwrap() > 0.0 && error["reference_reused"] == false);
        let stages = scene["report"]["stages"].as_array().unwrap().iter();
        let whole = stages.filter(|stage| !stage["name"].as_str().unwrap().contains('.'));
        let of_stages: f64 = whole.map(|stage| stage["milliseconds"].as_f64().unwrap()).sum();
        assert!(of_stages > 0.0 && of_stages <= scene["frame_milliseconds"].as_f64().unwrap());
        let picture = desk.path().join("out").join(scene["picture"].as_str().unwrap());
        assert_eq!(image::image_dimensions(picture).unwrap(), (48, 32));
    }
    let (width, height) = image::image_dimensions(desk.path().join("out/contact-sheet.png")).unwrap();
    assert!(width <= 1600 && height > 2 * 32, "{width} x {height}");
    let page = fs::read_to_string(desk.path().join("out/index.html")).unwrap();
    let parts = [
        "<h2>scenes</h2>",
        "<h2>scenes/far</h2>",
        "src=\"far/far.png\"",
        "A ball &lt;of&gt; fog",
        "of at most 5e-3",
    ];
    for part in parts.into_iter().chain(["tetrahedra drawn", "thickness = 0.3", "march.device"]) {
        assert!(page.contains(part), "{part}");
    }

    let documentation =
        fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/gallery.md")).unwrap();
    let mut undated = results.clone();
    for scene in undated["scenes"].as_array_mut().unwrap() {
        // Their names are the method's own.
        scene["report"]["counts"] = Value::Null;
    }
    let mut found = BTreeSet::new();
    keys(&undated, &mut found);
    assert!(found.len() > 30, "{found:?}");
    for key in found {
        assert!(documentation.contains(&format!("`{key}`")), "`{key}` is not documented");
    }

    // The second run computes no reference; a size of one's own counts.
    let again = gallery(&desk, &["scenes/near.toml", "-o", "out", "--reference-size", "24x24"]);
    code(&again, 0);
    let said = text(&again.stdout);
    assert!(said.starts_with("scenes\n\n| scene |") && said.ends_with("out/index.html\n"), "{said}");
    assert!(said.contains("| near | 144 | 48x32 | ") && said.contains(" | 5e-3 | pass |"), "{said}");
    assert_eq!(fs::read_dir(desk.path().join("out/cache")).unwrap().count(), 2);
    let small = gallery(&desk, &["scenes", "-o", "small", "--size", "16x16", "--no-reference", "--json"]);
    code(&small, 0);
    let results: Value = serde_json::from_slice(&small.stdout).unwrap();
    assert_eq!(
        (&results["scenes"][1]["verdict"], &results["scenes"][1]["error"]),
        (&"unmeasured".into(), &Value::Null)
    );
    assert_eq!(image::image_dimensions(desk.path().join("small/scenes/near.png")).unwrap(), (16, 16));
    assert!(!desk.path().join("small/cache").exists());
}

#[test]
fn a_scene_above_its_bound_fails() {
    let desk = desk();
    // One sample where the fog is dense.
    let coarse = SCENE.to_owned() + "march = { plan = 'paper', samples = 1 }\n";
    let coarse = coarse.replace("'fog.toml'", "'fog.toml', opacity_distance = 0.01");
    fs::write(desk.path().join("scenes/coarse.toml"), coarse).unwrap();
    let output = gallery(&desk, &["scenes", "-o", "out", "--reference-size", "32x32"]);
    code(&output, 1);
    let said = text(&output.stdout);
    let line = said.lines().find(|line| line.starts_with("| coarse |")).unwrap();
    assert!(line.ends_with(" | 5e-3 | FAIL |"), "{line}");
    assert!(said.contains(" | 5e-3 | pass |"), "{said}");
    let shadows = "[shading]\n[[light]]\ndirection = [0, -1, 0]\nshadow = ";
    for (shadow, bound) in [("true", "| 1e-2 |"), ("false", "| 5e-3 |")] {
        fs::write(desk.path().join("scenes/lit.toml"), format!("{SCENE}{shadows}{shadow}\n")).unwrap();
        let output = gallery(&desk, &["scenes/lit.toml", "-o", "out", "--reference-size", "8x8"]);
        assert!(text(&output.stdout).contains(bound), "{}", text(&output.stdout));
    }
}

#[test]
fn a_broken_scene_is_named_and_the_others_are_rendered() {
    let desk = desk();
    fs::write(desk.path().join("scenes/bad.toml"), SCENE.replace("thickness", "thicknes")).unwrap();
    fs::write(desk.path().join("scenes/blind.toml"), SCENE.replace("size", "background = 'none.jpg', size"))
        .unwrap();
    let output = gallery(&desk, &["scenes", "nowhere.toml", "-o", "out", "--no-reference"]);
    code(&output, 3);
    let errors = text(&output.stderr);
    for part in [
        "scenes/bad.toml cannot be rendered:",
        "bad.toml:5:11",
        "none.jpg",
        "nowhere.toml cannot be rendered:",
    ] {
        assert!(errors.contains(part), "{part}: {errors}");
    }
    let said = text(&output.stdout);
    assert_eq!(
        (said.matches("| BROKEN |").count(), said.matches("| not compared |").count()),
        (3, 2),
        "{said}"
    );
    let page = fs::read_to_string(desk.path().join("out/index.html")).unwrap();
    assert!(page.contains("unknown key `thicknes`") && page.contains("thicknes = 0.2"), "its text is there");
    assert!(
        desk.path().join("out/far/far.png").is_file() && !desk.path().join("out/scenes/bad.png").exists()
    );
}

#[test]
fn mistakes_are_told() {
    let desk = desk();
    fs::create_dir(desk.path().join("empty")).unwrap();
    fs::write(desk.path().join("file"), "").unwrap();
    let mistakes: [(&[&str], i32, &str); 5] = [
        (&[], 2, "<SCENE|FOLDER>"),
        (&["empty"], 3, "no scene in this folder"),
        (&["scenes", "--size", "0x2"], 2, "1 to 32768"),
        (&["scenes", "--no-reference", "--reference-size", "8x8"], 2, "--no-reference"),
        (&["scenes", "-o", "file/out"], 6, "file/out"),
    ];
    for (arguments, expected, part) in mistakes {
        let output = gallery(&desk, &[&["--quiet"], arguments].concat());
        code(&output, expected);
        assert!(text(&output.stderr).contains(part), "{}", text(&output.stderr));
    }
    assert!(!desk.path().join("out").exists());
}

/// Interrupts the run when the second scene is compared.
struct Stop(Interrupt);

impl Progress for Stop {
    fn stage(&self, name: &str) {
        if name.ends_with("far.toml (2 of 2): comparing") {
            self.0.set();
        }
    }

    fn fraction(&self, _: f64) {}
}

#[test]
fn an_interrupt_leaves_the_earlier_gallery() {
    let desk = desk();
    let scenes: Vec<PathBuf> =
        ["scenes/near.toml", "scenes/far/far.toml"].map(|name| desk.path().join(name)).into();
    let out = desk.path().join("out");
    let run = |scenes: &[PathBuf], interrupt: &Interrupt, progress: Arc<dyn Progress>| {
        let setup = Setup { device: &DeviceChoice::Any, validation: None, progress: &progress, interrupt };
        let cache = desk.path().join("cache");
        let options = Options { out: &out, cache: &cache, size: None, reference_size: Some([16, 16]) };
        gallery::run(scenes, &options, &setup)
    };
    let interrupt = Interrupt::default();
    let page = run(&scenes[..1], &interrupt, Arc::new(mesoshell::progress::Silent)).unwrap().page;
    let before = fs::read(&page).unwrap();
    let stop = Arc::new(Stop(interrupt.clone()));
    let stopped = run(&scenes, &interrupt, stop);
    assert!(matches!(stopped, Err(Error::Interrupted)), "{stopped:?}");
    assert!(fs::read(&page).unwrap() == before && !out.join("far").exists());
    assert_eq!(fs::read_dir(desk.path().join("cache")).unwrap().count(), 1);
}
