//! `mesoshell animate-check`: planted faults are found at their frame and by name, and a clean rigid motion has none.

use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

/// Frames of each sequence.
const FRAMES: u32 = 6;

/// Quads along a side of a sheet.
const SIDE: u32 = 8;

/// Tetrahedra above one sheet: six a quad.
const OF_A_SHEET: u64 = 6 * (SIDE * SIDE) as u64;

/// The height between the sheets, of a shell of 0.2.
const APART: f64 = 0.6;

const SCENE: &str = r#"
mesh = { file = "1.obj" }
shell = { thickness = 0.2 }
volume = { recipe = "fog.toml", opacity_distance = 0.03 }
camera = { eye = [0.5, 2.4, 3.0], target = [0, 0.3, 0] }
image = { size = [96, 96] }
timeline = { frames = 6, rate = 1 }
"#;

const MESHES: &str = r#"
[[track]]
key = "mesh.file"
ease = "step"
at = [0, 1, 2, 3, 4, 5]
values = ["1.obj", "2.obj", "3.obj", "4.obj", "5.obj", "6.obj"]
"#;

/// Two wavy sheets, one above the other by `apart`, turned by `turn` degrees about an axis that is askew, and moved.
fn sheets(apart: f64, turn: f64) -> String {
    let axis = glam::DVec3::new(0.2, 1.0, 0.1).normalize();
    let rotation = glam::DQuat::from_axis_angle(axis, turn.to_radians());
    let mut text = String::new();
    for height in [0.0, apart] {
        for (i, j) in (0..=SIDE).flat_map(|i| (0..=SIDE).map(move |j| (i, j))) {
            let [u, v] = [i, j].map(|at| f64::from(at) / f64::from(SIDE));
            let wave = 0.1 * (6.0 * u).sin();
            let place = glam::DVec3::new(2.0 * u - 1.0, height + wave, 2.0 * v - 1.0);
            let normal = glam::DVec3::new(-0.3 * (6.0 * u).cos(), 1.0, 0.0).normalize();
            let place = rotation * place + glam::DVec3::X * 0.001 * turn;
            let normal = rotation * normal;
            writeln!(
                text,
                "v {} {} {}\nvn {} {} {}\nvt {u} {v}",
                place.x, place.y, place.z, normal.x, normal.y, normal.z
            )
            .unwrap();
        }
    }
    for sheet in 0..2 {
        for (i, j) in (0..SIDE).flat_map(|i| (0..SIDE).map(move |j| (i, j))) {
            let at = |i: u32, j: u32| 1 + sheet * (SIDE + 1) * (SIDE + 1) + i * (SIDE + 1) + j;
            let [a, b, c, d] = [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)];
            writeln!(text, "f {a}/{a}/{a} {b}/{b}/{b} {c}/{c}/{c}\nf {a}/{a}/{a} {c}/{c}/{c} {d}/{d}/{d}")
                .unwrap();
        }
    }
    text
}

struct Folder(tempfile::TempDir);

impl Folder {
    /// The sheets turn by 4 degrees a frame; `apart` is their distance in each.
    fn new(tracks: &str, apart: impl Fn(u32) -> f64) -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        folder.write("scene.toml", &format!("{SCENE}{tracks}"));
        folder.write("fog.toml", "recipe = 'fog'\nsize = [32, 32, 8]\n");
        folder.write("other.toml", "recipe = 'uniform'\nsize = [2, 2, 2]\nalpha = 0.9\ncolour = '#c02010'\n");
        for frame in 1..=FRAMES {
            folder.write(&format!("{frame}.obj"), &sheets(apart(frame), 4.0 * f64::from(frame - 1)));
        }
        folder
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.path().join(name), text).unwrap();
    }

    fn run(&self, more: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_mesoshell"));
        command
            .current_dir(self.path())
            .args(["animate-check", "scene.toml", "--json"])
            .args(more)
            .output()
            .unwrap()
    }

    /// The frames of the results, and whether none has a fault.
    fn frames(&self, more: &[&str]) -> (Vec<Value>, bool) {
        let output = self.run(more);
        let code = output.status.code();
        assert!(matches!(code, Some(0 | 1)), "{}", String::from_utf8_lossy(&output.stderr));
        let results: Value = serde_json::from_slice(&output.stdout).unwrap();
        (results["frames"].as_array().unwrap().clone(), code == Some(0))
    }
}

/// The frames, from 1, where a count is not 0.
fn with(frames: &[Value], pointer: &str) -> Vec<u64> {
    let counted =
        frames.iter().filter(|frame| frame.pointer(pointer).is_some_and(|count| count.as_u64() != Some(0)));
    counted.map(|frame| frame["frame"].as_u64().unwrap()).collect()
}

const COUNTS: [&str; 4] = ["/inverted/count", "/overlaps/pairs", "/order/violations", "/pops/pixels"];

#[test]
fn a_clean_rigid_motion_has_no_fault() {
    let folder = Folder::new(MESHES, |_| APART);
    let (frames, is_clean) = folder.frames(&[]);
    assert!(is_clean && frames.len() == FRAMES as usize);
    for frame in &frames {
        for key in ["least", "greatest", "rms"] {
            let stretch = frame["stretch"][key].as_f64().unwrap();
            assert!((stretch - 1.0).abs() < 1e-6, "{frame}");
        }
        assert!(frame["stretch"]["shear_degrees"].as_f64().unwrap() < 1e-6);
        assert!(frame["order"]["pairs"].as_u64().unwrap() > 1000);
        assert!(frame["fold"]["factor"].as_f64().unwrap() > 1.0);
        // Without pictures that change nothing could pop.
        let judged = frame.pointer("/pops/judged").map_or(u64::MAX, |judged| judged.as_u64().unwrap());
        assert!(judged > 96 * 96 / 3, "{frame}");
    }
}

#[test]
fn an_inverted_tetrahedron_is_found_at_its_frame_with_the_thickness_that_would_do() {
    let track =
        "[[track]]\nkey = 'shell.thickness'\nease = 'step'\nat = [0, 3, 4]\nvalues = [0.2, 1.6, 0.2]\n";
    let folder = Folder::new(&format!("{MESHES}{track}"), |_| 8.0);
    let (frames, is_clean) = folder.frames(&["--size", "32x32"]);
    assert!(!is_clean);
    assert_eq!(with(&frames, "/inverted/count"), [4]);
    let count = frames[3]["inverted"]["count"].as_u64().unwrap();
    let first = frames[3]["inverted"]["first"].as_array().unwrap();
    assert_eq!(first.len() as u64, count.min(16));
    let (id, triangle) = (&first[0]["tetrahedron"], &first[0]["triangle"]);
    assert_eq!(id.as_u64().unwrap() / 3, triangle.as_u64().unwrap());

    let factor = frames[3]["fold"]["factor"].as_f64().unwrap();
    assert!(factor > 0.0 && factor < 1.0);
    let inverted_at = |factor: f64| {
        let thickness = format!("shell.thickness={}", 1.6 * factor);
        folder.write("scene.toml", &format!("{SCENE}{MESHES}"));
        let (frames, _) = folder.frames(&["--size", "32x32", "-D", &thickness]);
        with(&frames, "/inverted/count")
    };
    assert_eq!(inverted_at(factor * (1.0 - 1e-9)), [0u64; 0]);
    // The sheets are the same in every frame, up to rounding.
    assert_eq!(inverted_at(factor * (1.0 + 1e-6)), [1, 2, 3, 4, 5, 6]);
}

#[test]
fn an_intersecting_pair_is_found_at_its_frame_and_by_id() {
    // The shell is 0.2 thick: the second sheet comes down on it.
    let folder = Folder::new(MESHES, |frame| if frame == 3 { 0.19 } else { APART });
    let (frames, is_clean) = folder.frames(&["--size", "32x32"]);
    assert!(!is_clean);
    assert_eq!(with(&frames, "/overlaps/pairs"), [3]);
    assert_eq!(with(&frames, "/inverted/count"), [0u64; 0]);
    for pair in frames[2]["overlaps"]["first"].as_array().unwrap() {
        let [a, b] = [0, 1].map(|i| pair["tetrahedra"][i].as_u64().unwrap());
        assert!(a < OF_A_SHEET && (OF_A_SHEET..2 * OF_A_SHEET).contains(&b), "one of each sheet: {pair}");
    }
}

#[test]
fn a_popping_texture_is_found_at_its_frame() {
    let track =
        "[[track]]\nkey = 'volume.recipe'\nease = 'step'\nat = [0, 3]\nvalues = ['fog.toml', 'other.toml']\n";
    let folder = Folder::new(&format!("{MESHES}{track}"), |_| APART);
    let (frames, is_clean) = folder.frames(&[]);
    assert!(!is_clean);
    for pointer in COUNTS {
        let expected: &[u64] = if pointer == "/pops/pixels" { &[4] } else { &[] };
        assert_eq!(with(&frames, pointer), expected, "{pointer}");
    }
    assert_eq!(frames[3]["pops"]["since"], 3);
    assert!(frames[3]["pops"]["pixels"].as_u64().unwrap() > 100);
}

#[test]
fn a_timeline_that_loops_is_compared_across_its_seam() {
    let tracks = format!(
        "{MESHES}[[track]]\nkey = 'volume.recipe'\nease = 'step'\nat = [0, 3]\nvalues = ['fog.toml', 'other.toml']\n"
    );
    let folder = Folder::new(&tracks, |_| APART);
    let looping = SCENE.replace("rate = 1", "rate = 1, loop = true").replace("1.obj", "3.obj");
    folder.write("scene.toml", &format!("{looping}{}", tracks.replace(MESHES, "")));
    let (frames, _) = folder.frames(&[]);
    assert_eq!(with(&frames, "/pops/pixels"), [1, 4]);
    assert_eq!(frames[0]["pops"]["since"], 6);
}

#[test]
fn the_page_holds_all_and_the_heat_map_is_written() {
    let folder = Folder::new(MESHES, |frame| if frame == 3 { 0.19 } else { APART });
    let output = folder.run(&["--size", "48x32", "--frames", "2-4", "-o", "out", "--heatmap", "stretch.png"]);
    assert_eq!(output.status.code(), Some(1), "{}", String::from_utf8_lossy(&output.stderr));
    let page = fs::read_to_string(folder.path().join("out/index.html")).unwrap();
    assert!(page.contains("frame 3: most pairs that intersect") && page.contains("data:image/png;base64,"));
    assert!(!page.contains("NaN") && !page.contains("src=\"http") && !page.contains("<script"));
    let written: Value =
        serde_json::from_str(&fs::read_to_string(folder.path().join("out/results.json")).unwrap()).unwrap();
    assert_eq!(written, serde_json::from_slice::<Value>(&output.stdout).unwrap());
    let numbers: Vec<_> =
        written["frames"].as_array().unwrap().iter().map(|frame| frame["frame"].as_u64()).collect();
    assert_eq!(numbers, [Some(2), Some(3), Some(4)]);
    let heatmap = image::open(folder.path().join("stretch.png")).unwrap();
    assert_eq!(heatmap.width(), 48);
}

#[test]
fn what_cannot_be_is_refused_before_the_first_frame() {
    let folder = Folder::new(MESHES, |_| APART);
    let refused = |more: &[&str], code, words: &str| {
        let output = folder.run(more);
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{told}");
        assert!(told.contains(words), "{told}");
    };
    refused(&["--frames", "3-9"], 2, "there is no frame 9");
    refused(&["--heatmap", "nowhere/map.png"], 6, "nowhere");
    refused(&["-D", "shell.thickness=-1"], 2, "thickness");
}
