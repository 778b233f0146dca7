//! The command line from outside: exit codes, one clear error each, nothing left behind.

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use tempfile::TempDir;

const SCENE: &str = r#"[mesh]
generator = "sphere"
segments = 8
rings = 4

[shell]
thickness = 0.2

[volume]
recipe = "fog.toml"
"#;

/// A folder with a small scene, in which the command runs.
struct Desk(TempDir);

impl Desk {
    fn new() -> Self {
        let desk = Self(tempfile::tempdir().unwrap());
        desk.write("scene.toml", SCENE);
        desk.write("fog.toml", "recipe = \"fog\"\nsize = [8, 8, 4]\n");
        desk
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path().join(name), content).unwrap();
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_mesoshell"));
        command.args(arguments).current_dir(self.path()).env("NO_COLOR", "1").stdin(Stdio::null());
        command
    }

    fn run(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().unwrap()
    }

    /// Names of the files there.
    fn files(&self) -> Vec<String> {
        let entries = fs::read_dir(self.path()).unwrap();
        let mut names: Vec<_> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// Runs what must fail with `code` and one error that has all `parts`, and leave nothing behind.
    #[track_caller]
    fn refuses(&self, arguments: &[&str], code: i32, parts: &[&str]) {
        let before = self.files();
        let output = self.run(arguments);
        let errors = text(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {errors}");
        assert_eq!(text(&output.stdout), "", "{arguments:?}");
        for part in parts {
            assert!(errors.contains(part), "{arguments:?} does not tell {part:?}:\n{errors}");
        }
        assert!(!errors.contains("panicked"), "{errors}");
        assert!(errors.matches('×').count() + errors.matches("error: ").count() == 1, "{errors}");
        assert_eq!(self.files(), before, "{arguments:?}");
    }

    /// As [`refuses`](Self::refuses), for a scene that a change turned bad.
    #[track_caller]
    fn refuses_scene(&self, from: &str, to: &str, parts: &[&str]) {
        let bad = SCENE.replacen(from, to, 1);
        assert_ne!(bad, SCENE);
        self.write("bad.toml", bad);
        self.refuses(&["render", "bad.toml", "-o", "picture.png"], 3, parts);
    }
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// What draws [`SCENE`] without a device.
const RENDER: &[&str] = &["render", "scene.toml", "--method", "reference", "-D", "image.size=[16, 16]"];

#[test]
fn a_scene_becomes_a_picture() {
    let desk = Desk::new();
    let output = desk.run(RENDER);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let said = text(&output.stdout);
    assert_eq!(said.lines().next(), Some("scene.png"));
    for stage in ["load.mesh", "load.volume", "prepare", "write"] {
        assert!(said.contains(stage), "{said}");
    }
    // Standard error is no terminal here: one plain line a stage.
    let progress = text(&output.stderr);
    assert!(progress.lines().any(|line| line.starts_with("building the shell: ")), "{progress}");
    assert!(progress.lines().all(|line| line.ends_with(" ms")), "{progress}");
    assert_eq!(desk.files(), ["fog.toml", "scene.png", "scene.toml"]);
    let picture = image::open(desk.path().join("scene.png")).unwrap().into_rgba8();
    assert_eq!(picture.dimensions(), (16, 16));
    assert!(picture.get_pixel(8, 8).0[3] > 0);
    assert_eq!(picture.get_pixel(0, 0).0, [0; 4]);
}

#[test]
fn quiet_is_silent_and_json_is_json() {
    let desk = Desk::new();
    let quiet = desk.run(&[RENDER, &["-o", "a.exr", "--quiet"]].concat());
    assert_eq!(
        (quiet.status.code(), text(&quiet.stdout), text(&quiet.stderr)),
        (Some(0), String::new(), String::new())
    );
    let json = desk.run(&[RENDER, &["-o", "b.exr", "--json"]].concat());
    let value: serde_json::Value = serde_json::from_slice(&json.stdout).unwrap();
    assert_eq!((&value["output"], &value["width"]), (&"b.exr".into(), &16.into()));
    assert_eq!(value["report"]["method"], "reference");
    assert!(value["report"]["stages"].as_array().unwrap().len() > 5);
    // Twice the same scene: the same bytes.
    assert!(fs::read(desk.path().join("a.exr")).unwrap() == fs::read(desk.path().join("b.exr")).unwrap());
}

#[test]
fn what_was_chosen_is_explained_and_can_be_switched_off() {
    let desk = Desk::new();
    let render = ["render", "scene.toml", "--size", "16x16", "--explain"];
    let said = text(&desk.run(&render).stdout);
    let parts = [
        "chosen:",
        "  traversal ",
        "walk",
        "scene.png\n",
        "left out:",
        "  - ",
        "saved",
        "differs by",
        "counted:",
        "took:",
        "march",
    ];
    assert!(said.find("chosen:") < said.find("scene.png"), "what is chosen is told before: {said}");
    for part in parts {
        assert!(said.contains(part), "{part}: {said}");
    }
    let chosen = |more: &[&str], about: &str| {
        let output = desk.run(&[&render[..], &["--json"], more].concat());
        let value: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let plan = value["plan"].as_array().unwrap().clone();
        plan.into_iter().find(|choice| choice["about"] == about).unwrap()["chosen"].clone()
    };
    assert_eq!(chosen(&[], "kept"), "on");
    let saved = |more: &[&str]| -> Vec<String> {
        let output = desk.run(&[&render[..], &["--json"], more].concat());
        let value: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let savings = value["savings"].as_array().unwrap().clone();
        for saving in &savings {
            assert!(["with", "without"].iter().all(|key| saving[key].as_f64().unwrap() > 0.0), "{saving}");
            assert!(saving["difference"].as_f64().unwrap() <= 1e-6, "{saving}");
        }
        savings.iter().map(|saving| saving["skip"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(saved(&[]), ["saturation", "levels", "kept"]);
    assert_eq!(saved(&["--no-skip", "kept", "--no-skip", "saturation"]), ["levels"]);
    assert_eq!(saved(&["--method", "reference"]), [""; 0]);
    assert_eq!(chosen(&["--no-skip", "kept", "--no-skip", "saturation"], "kept"), "off");
    assert_eq!(chosen(&["--no-skip", "kept,saturation"], "saturation"), "off");
    assert_eq!(chosen(&["-D", "march.no_skip=[\"levels\"]"], "levels"), "off");
    assert_eq!(chosen(&["-D", "march.traversal=sort"], "traversal"), "sort");
    desk.refuses(&["render", "scene.toml", "--no-skip", "corners"], 2, &["corners", "empty-space"]);
    desk.refuses(&[RENDER, &["-D", "march.no_skip=[\"corners\"]"]].concat(), 2, &["corners", "empty-space"]);
    let frames = [&render[..], &["--frames", "all"]].concat();
    desk.refuses(&frames, 2, &["--explain tells of one picture"]);
}

#[test]
fn a_loss_of_speed_is_told() {
    let desk = Desk::new();
    let bench = [
        "bench",
        "scene.toml",
        "-D",
        "image.size=[16, 16]",
        "--steps",
        "0.5",
        "--samples",
        "1",
        "--runs",
        "1",
    ];
    let output = desk.run(&bench);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(text(&output.stdout).contains("| scene | paper's samples | as accurate | times as fast |"));
    let path = desk.path().join("out/bench/results.json");
    let mut results: serde_json::Value = serde_json::from_slice(&fs::read(path).unwrap()).unwrap();
    // A machine on which the paper's plan took a minute.
    let paper = results["scenes"][0]["points"].as_array_mut().unwrap();
    let paper = paper.iter_mut().find(|point| point["plan"] == "paper").unwrap();
    paper["time"]["median"] = 60_000.0.into();
    desk.write("fast.json", results.to_string());
    let told = desk.run(&[&bench[..], &["--baseline", "fast.json"]].concat());
    assert_eq!(told.status.code(), Some(1));
    let told = text(&told.stderr);
    assert!(told.contains("slower than the baseline: scene, 1 samples"), "{told}");
    paper_is_gone(&mut results);
    desk.write("none.json", results.to_string());
    let refused = [&bench[..], &["--baseline", "none.json"]].concat();
    desk.refuses(&refused, 3, &["none.json", "no speed-ups"]);
    desk.refuses(&["bench", "--suite", "slow"], 2, &["slow", "gate"]);
    desk.refuses(&["bench", "--suite", "gate"], 3, &["gate.toml"]);
}

fn paper_is_gone(results: &mut serde_json::Value) {
    let points = results["scenes"][0]["points"].as_array_mut().unwrap();
    points.retain(|point| point["plan"] != "paper");
}

#[test]
fn a_size_on_the_command_line_counts() {
    let desk = Desk::new();
    let output = desk.run(&[RENDER, &["--size", "12x7", "--json"]].concat());
    let value: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&value["width"], &value["height"]), (&12.into(), &7.into()));
    assert_eq!(image::image_dimensions(desk.path().join("scene.png")).unwrap(), (12, 7));
}

#[test]
fn overrides_and_backgrounds_show() {
    let desk = Desk::new();
    let output = desk.run(&[RENDER, &["-o", "picture.png", "-D", "image.background=[0, 0, 1]"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let picture = image::open(desk.path().join("picture.png")).unwrap().into_rgba8();
    assert_eq!(picture.get_pixel(0, 0).0, [0, 0, 255, 255]);
}

#[test]
fn a_picture_lies_behind_and_all_is_exposed() {
    let desk = Desk::new();
    let sky = image::RgbImage::from_fn(64, 32, |x, _| {
        // The outer quarters are cut off; a tent of two pixels sees a little of them.
        image::Rgb(if (16..48).contains(&x) { [0, 64, 128] } else { [255, 0, 0] })
    });
    sky.save(desk.path().join("sky.png")).unwrap();
    let background = "image.background=sky.png";
    let render = |name: &str, overrides: &[&str]| {
        let output = desk.run(&[RENDER, &["-q", "-o", name, "-D", background], overrides].concat());
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        desk.path().join(name)
    };
    let plain = image::open(render("plain.png", &[])).unwrap().into_rgba8();
    for x in 1..5 {
        assert_eq!(plain.get_pixel(x, 0).0, [0, 64, 128, 255], "column {x}");
    }
    assert_ne!(plain.get_pixel(8, 8), plain.get_pixel(1, 0), "the scene is in front");
    let bright = image::open(render("bright.png", &["-D", "image.exposure=1"])).unwrap().into_rgba8();
    assert_eq!(bright.get_pixel(1, 0).0, [0, 90, 176, 255]);
    let exr = |name: &str, overrides: &[&str]| fs::read(render(name, overrides)).unwrap();
    assert!(exr("a.exr", &["-D", "image.exposure=1"]) == exr("b.exr", &["-D", "image.background=#000000"]));
    desk.refuses(
        &[RENDER, &["-D", "image.background=nowhere.jpg"]].concat(),
        3,
        &["nowhere.jpg", "background"],
    );
    desk.write("torn.jpg", "not a picture");
    desk.refuses(&[RENDER, &["-D", "image.background=torn.jpg"]].concat(), 3, &["torn.jpg", "decoded"]);
}

#[test]
fn diff_tells_images_apart() {
    let desk = Desk::new();
    for (name, thickness) in [("a.exr", "shell.thickness=0.2"), ("b.exr", "shell.thickness=0.4")] {
        assert!(desk.run(&[RENDER, &["-q", "-o", name, "-D", thickness]].concat()).status.success());
    }
    let code = |arguments: &[&str]| desk.run(arguments).status.code();
    assert_eq!(code(&["diff", "a.exr", "a.exr", "--threshold", "0"]), Some(0));
    assert_eq!(code(&["diff", "a.exr", "b.exr"]), Some(0));
    assert_eq!(code(&["diff", "a.exr", "b.exr", "--threshold", "1e-3"]), Some(1));
    assert_eq!(code(&["diff", "a.exr", "b.exr", "--threshold", "nan"]), Some(2));
    let output = desk.run(&["diff", "a.exr", "b.exr", "--json"]);
    let value: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(value["pixels"], 256);
    assert!(value["rmse"].as_f64().unwrap() > 1e-3);
    desk.refuses(&["diff", "a.exr", "nowhere.exr"], 3, &["nowhere.exr"]);
    assert!(desk.run(&[RENDER, &["-q", "-o", "c.exr", "-D", "image.size=[8, 8]"]].concat()).status.success());
    desk.refuses(&["diff", "a.exr", "c.exr"], 2, &["16x16", "8x8"]);
}

#[test]
fn info_counts() {
    let desk = Desk::new();
    desk.write(
        "square.obj",
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n",
    );
    let output = desk.run(&["mesh", "info", "square.obj", "--json"]);
    let value: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&value["triangles"], &value["boundary_edges"]), (&2.into(), &4.into()));
    assert!(text(&desk.run(&["mesh", "info", "square.obj"]).stdout).contains("boundary edges"));
    desk.write("fog.nrrd", NRRD.to_owned() + "12345678");
    let output = desk.run(&["volume", "info", "fog.nrrd"]);
    assert!(text(&output.stdout).contains("2 x 2 x 2"), "{}", text(&output.stderr));
    let output = desk.run(&["volume", "info", "fog.toml", "--json"]);
    let value: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&value["format"], &value["size"]), (&"recipe \"fog\"".into(), &serde_json::json!([8, 8, 4])));
    assert_eq!(value["ranges"].as_array().unwrap().len(), 4);
    desk.refuses(&["volume", "info", "scene.toml"], 3, &["scene.toml", "not a recipe"]);
}

/// The header of 2 x 2 x 2 bytes.
const NRRD: &str = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nencoding: raw\n\n";

#[test]
fn bad_scenes_are_underlined() {
    let desk = Desk::new();
    let spot = |line: &str, at: &str| format!("bad.toml:{line}:{at}");
    desk.refuses_scene(
        "thickness",
        "thicknes",
        &[&spot("7", "1"), "thicknes = 0.2", "unknown key", "`thickness`"],
    );
    desk.refuses_scene("0.2", "\"thick\"", &[&spot("7", "13"), "thickness = \"thick\"", "greater than 0"]);
    desk.refuses_scene("0.2", "-0.2", &[&spot("7", "13"), "greater than 0"]);
    desk.refuses_scene("0.2", "nan", &[&spot("7", "13"), "greater than 0"]);
    desk.refuses_scene("0.2", "inf", &[&spot("7", "13"), "greater than 0"]);
    desk.refuses_scene("[shell]", "[shell", &[&spot("6", "7")]);
    desk.refuses_scene("segments = 8", "segments = 2", &[&spot("3", "12"), "`segments` is 2"]);
}

#[test]
fn bad_requests_are_told() {
    let desk = Desk::new();
    desk.refuses(&["render", "nowhere.toml"], 3, &["nowhere.toml"]);
    desk.refuses(&["render", "."], 3, &["."]);
    desk.refuses(&["render"], 2, &["<SCENE>"]);
    desk.refuses(&["render", "scene.toml", "--method", "magic"], 2, &["magic", "shell", "reference"]);
    desk.refuses(&["render", "scene.toml", "--size", "16"], 2, &["640x480"]);
    desk.refuses(&["render", "scene.toml", "--size", "0x16"], 2, &["--size", "1 to 32768"]);
    desk.refuses(&["render", "scene.toml", "--size", "32768x32768"], 2, &["--size", "2^28 pixels"]);
    desk.refuses(&["render", "scene.toml", "-D", "shell.thickness"], 2, &["-D shell.thickness", "`=`"]);
    desk.refuses(&["render", "scene.toml", "-D", "shell.thickness=0"], 2, &["-D shell.thickness=0"]);
    desk.refuses(&["render", "scene.toml", "-D", "shel.thickness=1"], 2, &["unknown key `shel`"]);
    desk.write("binary.toml", [0xff, 0xfe, 0x00]);
    desk.refuses(&["render", "binary.toml"], 3, &["binary.toml"]);
    desk.write("empty.toml", "");
    desk.refuses(&["render", "empty.toml"], 3, &["missing key `mesh`"]);
}

#[test]
fn an_output_that_cannot_be_is_told_before_anything_is_loaded() {
    let desk = Desk::new();
    // The scene does not even exist: had it been looked at first, the code would be another.
    desk.refuses(&["render", "nowhere.toml", "-o", "nowhere/picture.png"], 6, &["nowhere/picture.png"]);
    desk.refuses(&["render", "nowhere.toml", "-o", "picture.bmp"], 2, &["picture.bmp"]);
    fs::create_dir(desk.path().join("folder.png")).unwrap();
    desk.refuses(&["render", "nowhere.toml", "-o", "folder.png"], 6, &["folder.png"]);
}

#[test]
fn files_that_a_scene_names_are_told() {
    let desk = Desk::new();
    let generator = "generator = \"sphere\"\nsegments = 8\nrings = 4\n";
    let recipe = "recipe = \"fog.toml\"";
    desk.refuses_scene(generator, "file = \"nowhere.obj\"\n", &["nowhere.obj"]);
    desk.refuses_scene(recipe, "recipe = \"nowhere.toml\"", &["nowhere.toml"]);
    desk.refuses_scene(recipe, "file = \"nowhere.nrrd\"", &["nowhere.nrrd"]);
    desk.write("torn.nrrd", NRRD.to_owned() + "1234567");
    desk.refuses_scene(recipe, "file = \"torn.nrrd\"", &["torn.nrrd"]);
    desk.refuses(&["volume", "info", "torn.nrrd"], 3, &["torn.nrrd"]);
    desk.write("greedy.nrrd", NRRD.replace("2 2 2", "65535 65535 65535"));
    desk.refuses_scene(recipe, "file = \"greedy.nrrd\"", &["greedy.nrrd"]);
    desk.write("scalar.nrrd", NRRD.to_owned() + "12345678");
    desk.refuses_scene(recipe, "file = \"scalar.nrrd\"", &["scalar.nrrd", "[volume.transfer]"]);
    desk.write("torn.obj", "v 0 0 0\nv 1 0\nf 1 2 3\n");
    desk.refuses_scene(generator, "file = \"torn.obj\"\n", &["torn.obj", "line 2"]);
    desk.refuses(&["mesh", "info", "torn.obj"], 3, &["torn.obj", "line 2"]);
    desk.write("bad-recipe.toml", "recipe = \"fog\"\nsise = 3\n");
    desk.refuses_scene(recipe, "recipe = \"bad-recipe.toml\"", &["bad-recipe.toml:2:1", "sise = 3"]);
}

#[test]
fn a_volume_that_the_device_cannot_hold_is_told_before_it_is_computed() {
    let desk = Desk::new();
    // No device takes a side of 2^24 texels; the mesh, which would be loaded first, is not even there.
    desk.write("fog.toml", "recipe = \"fog\"\nsize = [16777216, 1, 1]\n");
    let generator = "generator = \"sphere\"\nsegments = 8\nrings = 4\n";
    desk.write("large.toml", SCENE.replace(generator, "file = \"nowhere.obj\"\n"));
    desk.refuses(&["render", "large.toml", "--quiet"], 4, &["16777216 x 1 x 1 texels"]);
}

#[test]
fn an_unknown_device_is_told() {
    let desk = Desk::new();
    desk.refuses(&["render", "scene.toml", "--quiet", "--device", "no such device"], 4, &["no such device"]);
}

#[test]
fn without_a_driver_the_way_to_one_is_told() {
    let desk = Desk::new();
    let mut command = desk.command(&["render", "scene.toml", "--quiet"]);
    let output = command
        .env("VK_DRIVER_FILES", "nowhere.json")
        .env("VK_ICD_FILENAMES", "nowhere.json")
        .output()
        .unwrap();
    let errors = text(&output.stderr);
    assert_eq!(output.status.code(), Some(4), "{errors}");
    assert!(errors.contains("mesa-vulkan-drivers"), "{errors}");
}

/// What becomes of a reader that goes after the first line, such as `head -1`.
#[test]
fn a_closed_pipe_is_no_error() {
    let desk = Desk::new();
    let mut command = desk.command(&[RENDER, &["--json"]].concat());
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert!(!text(&output.stderr).contains("panicked"));
}

#[test]
fn a_full_disk_under_standard_output_is_an_error() {
    let desk = Desk::new();
    let full = fs::File::options().write(true).open("/dev/full").unwrap();
    let mut command = desk.command(RENDER);
    let output = command.stdout(full).output().unwrap();
    assert_eq!(output.status.code(), Some(6));
    assert!(text(&output.stderr).contains("standard output"));
}

#[test]
fn an_interrupted_run_leaves_nothing_behind() {
    let desk = Desk::new();
    let before = desk.files();
    // Hours of work, of which the first second is let pass.
    let arguments = ["render", "scene.toml", "--method", "reference", "--size", "8192x8192"];
    let mut child = desk.command(&arguments).stderr(Stdio::piped()).spawn().unwrap();
    let mut progress = std::io::BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    while !line.starts_with("filtering the volume") {
        line.clear();
        assert!(std::io::BufRead::read_line(&mut progress, &mut line).unwrap() > 0, "ended early");
    }
    // The shell's own `kill`: a bare system has no other.
    let killed = Command::new("sh").args(["-c", &format!("kill -TERM {}", child.id())]).status();
    if !killed.is_ok_and(|status| status.success()) {
        child.kill().unwrap();
        panic!("the run could not be told to stop");
    }
    assert_eq!(child.wait().unwrap().code(), Some(143));
    assert_eq!(desk.files(), before);
}

#[test]
fn exit_codes_are_in_the_help() {
    let help = text(&Desk::new().run(&["--help"]).stdout);
    for code in ["0 ", "1 ", "2 ", "3 ", "4 ", "5 ", "6 ", "130 ", "143 "] {
        assert!(help.lines().any(|line| line.trim_start().starts_with(code)), "{code}: {help}");
    }
}

#[test]
fn stress_cases_are_chosen_by_name_and_told_as_json() {
    let desk = Desk::new();
    let output = desk.run(&["stress", "--quick", "--filter", "texels", "--filter", "thick", "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let outcomes: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let names: Vec<_> = outcomes.as_array().unwrap().iter().map(|outcome| &outcome["case"]).collect();
    assert_eq!(names, ["thickness", "texels"]);
    assert_eq!(outcomes[0]["passed"], true);
    desk.refuses(&["stress", "--filter", "nothing"], 2, &["`nothing`", "zero-volume"]);
}

#[test]
fn a_model_becomes_a_volume_and_a_picture() {
    let desk = Desk::new();
    let good = |arguments: &[&str]| {
        let output = desk.run(arguments);
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", text(&output.stderr));
        serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap()
    };
    let made = good(&["mesh", "make", "chain", "-o", "chain.obj", "--json"]);
    let size = ["--size", "16x12x8"];
    let options = ["volume", "voxelize", "chain.obj", "-o", "chain.ktx2", "--normals", "n.ktx2", "--json"];
    let voxelized = good(&[&options[..], &size[..]].concat());
    assert_eq!(voxelized["triangles"], made["triangles"]);
    assert_eq!(voxelized["loss"]["changed"], 0);
    let info = good(&["volume", "info", "chain.ktx2", "--json"]);
    assert_eq!(info["size"], serde_json::json!([16, 12, 8]));
    let alpha = &info["ranges"][3];
    assert!(alpha["min"] == 0.0 && alpha["max"].as_f64().unwrap() > 0.5, "{alpha}");
    let normals = good(&["volume", "info", "n.ktx2", "--json"]);
    assert!(normals["channels"] == 3 && normals["ranges"][2]["min"].as_f64().unwrap() < -0.5, "{normals}");

    let bytes = good(&["volume", "convert", "chain.ktx2", "-o", "bytes.ktx2", "--format", "u8", "--json"]);
    // Half a step, and the rounding of f32.
    let lost = bytes["loss"]["largest"].as_f64().unwrap();
    assert!(lost > 1e-4 && lost <= 0.5 / 255.0 + 1e-7, "{lost}");
    let made = good(&["volume", "make", "fog.toml", "--size", "4x4x2", "-o", "fog.ktx2", "--json"]);
    assert_eq!((&made["size"], &made["loss"]["changed"]), (&serde_json::json!([4, 4, 2]), &0.into()));
    for volume in ["fog.toml", "bytes.ktx2"] {
        good(&["volume", "preview", volume, "-o", "sheet.png", "--json"]);
        let sheet = image::open(desk.path().join("sheet.png")).unwrap().into_rgb8();
        assert!(sheet.width() > 900 && sheet.pixels().any(|pixel| pixel.0.iter().any(|&x| x > 140)));
    }
}

#[test]
fn bad_models_are_refused() {
    let desk = Desk::new();
    desk.write("empty.obj", "# nothing\n");
    desk.write("open.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    desk.write("lost.obj", "mtllib none.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    desk.write("plain.obj", "usemtl red\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let voxelize = |mesh| ["volume", "voxelize", mesh, "--size", "8x8x4", "-o", "v.ktx2"];
    desk.refuses(&voxelize("empty.obj"), 3, &["empty.obj", "no faces"]);
    desk.refuses(&voxelize("open.obj"), 3, &["open.obj", "3 of its 3 edges", "--surface"]);
    desk.refuses(&voxelize("lost.obj"), 3, &["lost.obj", "line 1", "none.mtl", "--colour"]);
    desk.refuses(&voxelize("plain.obj"), 3, &["plain.obj", "line 1", "`red`", "--colour"]);
    let wrong = ["volume", "voxelize", "open.obj", "--size", "8x8", "-o", "v.ktx2"];
    desk.refuses(&wrong, 2, &["8x8", "128x128x32"]);
    desk.refuses(&["volume", "convert", "fog.toml", "-o", "v.png"], 2, &["v.png", ".ktx2"]);
    let sheet =
        [&voxelize("plain.obj")[..], &["--surface", "1.5", "--colour", "#ff8000", "--quiet"]].concat();
    assert_eq!(desk.run(&sheet).status.code(), Some(0));
}
