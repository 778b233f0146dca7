//! `mesoshell render --frames`: what is kept, what is drawn again, and what is left by runs that end early.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

const SCENE: &str = r#"
mesh = { generator = "torus", segments = 12, rings = 6 }
shell = { thickness = 0.3 }
volume = { recipe = "fog.toml" }
camera = { eye = [0, 3.0, 4.4], target = [0, 0, 0] }
image = { size = [32, 32] }
timeline = { frames = 40, rate = 20 }
track = [{ key = "camera.orbit", at = [0, 2], values = [0, 90] }]
"#;

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        std::fs::write(folder.path("scene.toml"), SCENE).unwrap();
        folder.write_recipe(0.5);
        folder
    }

    fn write_recipe(&self, alpha: f64) {
        let text = format!("recipe = \"uniform\"\nsize = [2, 2, 2]\nalpha = {alpha}\n");
        std::fs::write(self.path("fog.toml"), text).unwrap();
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn command(&self, output: &str, more: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_mesoshell"));
        command.current_dir(self.0.path()).args(["render", "scene.toml", "--quiet", "-o", output]).args(more);
        command
    }

    fn run(&self, output: &str, more: &[&str]) -> Output {
        let output = self.command(output, more).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        output
    }

    /// How many frames a run rendered, and how many were up to date.
    fn counts(&self, output: &str, more: &[&str]) -> [u64; 2] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_mesoshell"));
        command.current_dir(self.0.path()).args(["render", "scene.toml", "--json", "-o", output]).args(more);
        let output = command.output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let result: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        ["rendered", "up_to_date"].map(|key| result[key].as_u64().unwrap())
    }
}

/// The files of a folder that are pictures, with their bytes.
fn pictures(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let pictures = entries.filter(|path| path.extension().is_some_and(|ending| ending == "png"));
    pictures
        .map(|path| (path.file_name().unwrap().to_str().unwrap().to_owned(), std::fs::read(&path).unwrap()))
        .filter(|(name, _)| !name.starts_with(".mesoshell-"))
        .collect()
}

fn folder_of(folder: &Folder, name: &str) -> PathBuf {
    let path = folder.path(name);
    std::fs::create_dir(&path).unwrap();
    path
}

#[test]
fn one_process_or_several_write_the_same_bytes() {
    let folder = Folder::new();
    let [whole, parts] = ["whole", "parts"].map(|name| folder_of(&folder, name));
    folder.run("whole/####.png", &["--frames", "all"]);
    for part in ["1-8x2", "2-8x2", "30-40", "9-29", "5"] {
        folder.run("parts/{frame:04}.png", &["--frames", part]);
    }
    let (whole, parts) = (pictures(&whole), pictures(&parts));
    assert_eq!(whole.len(), 40);
    assert_eq!(whole, parts);
    assert_ne!(whole["0001.png"], whole["0002.png"]);
    // Alone, without a mark, a frame is the same picture in another file.
    folder.run("first.png", &[]);
    let read = |path: &Path| mesoshell::frame::file::read(path).unwrap();
    assert_eq!(read(&folder.path("first.png")), read(&folder.path("whole/0001.png")));
    assert_ne!(read(&folder.path("first.png")), read(&folder.path("whole/0002.png")));
}

#[test]
fn what_is_up_to_date_is_left_alone_and_what_is_not_is_drawn() {
    let folder = Folder::new();
    for output in ["####.png", "####.exr"] {
        folder.write_recipe(0.5);
        let counts = |more: &[&str]| folder.counts(output, &[&["--frames", "1-4"], more].concat());
        assert_eq!(counts(&[]), [4, 0]);
        assert_eq!(counts(&[]), [0, 4]);
        assert_eq!(counts(&["--overwrite"]), [4, 0]);
        std::fs::remove_file(folder.path(&output.replace("####", "0003"))).unwrap();
        assert_eq!(counts(&[]), [1, 3]);
        let torn = folder.path(&output.replace("####", "0002"));
        let whole = std::fs::read(&torn).unwrap();
        for left in [&b"no picture"[..], &whole[..whole.len() - 1], &whole[..2 * whole.len() / 3]] {
            std::fs::write(&torn, left).unwrap();
            assert_eq!(counts(&[]), [1, 3]);
        }
        // Another value, another size, another method, another file.
        assert_eq!(counts(&["-D", "march.step=0.25"]), [4, 0]);
        assert_eq!(counts(&["-D", "march.step=0.25", "--size", "16x16"]), [4, 0]);
        assert_eq!(counts(&["-D", "march.step=0.25", "--size", "16x16", "--method", "reference"]), [4, 0]);
        assert_eq!(counts(&[]), [4, 0]);
        folder.write_recipe(0.6);
        assert_eq!(counts(&[]), [4, 0]);
        assert_eq!(counts(&[]), [0, 4]);
    }
}

/// By SIGKILL, which nothing can prepare for, at 20 moments; each run goes on where the one before was killed.
#[test]
fn a_killed_run_is_resumed() {
    let folder = Folder::new();
    let [undisturbed, killed] = ["undisturbed", "killed"].map(|name| folder_of(&folder, name));
    let start = std::time::Instant::now();
    folder.run("undisturbed/##.png", &["--frames", "all"]);
    let usual = start.elapsed();
    let expected = pictures(&undisturbed);
    let mut random = Pcg64Mcg::seed_from_u64(7);
    let mut early = 0;
    for round in 0..20 {
        // Pictures of the rounds before are found up to date; so that there is always something left to do, some are taken away.
        for name in pictures(&killed).keys().filter(|_| random.random_bool(0.5)).collect::<Vec<_>>() {
            std::fs::remove_file(killed.join(name)).unwrap();
        }
        let mut child = folder
            .command("killed/##.png", &["--frames", "all"])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_secs_f64(usual.as_secs_f64() * random.random_range(0.05..0.45)));
        child.kill().unwrap();
        early += u32::from(!child.wait().unwrap().success());
        for (name, bytes) in pictures(&killed) {
            assert!(bytes == expected[&name], "round {round}: {name} is not the frame, whole");
        }
    }
    assert!(early > 5, "only {early} of 20 runs were killed before their end");
    folder.run("killed/##.png", &["--frames", "all"]);
    assert_eq!(pictures(&killed), expected);
}

#[cfg(unix)]
#[test]
fn a_run_that_is_ended_says_so_and_leaves_nothing_half_done() {
    for (signal, code) in [("TERM", 143), ("INT", 130)] {
        let folder = Folder::new();
        let child = folder
            .command("##.png", &["--frames", "all", "--size", "640x640", "-D", "march.step=0.01"])
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_millis(600));
        // The shell's own `kill`: a bare system has no other.
        let killed = Command::new("sh").args(["-c", &format!("kill -{signal} {}", child.id())]).status();
        assert!(killed.unwrap().success());
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(code), "{}", String::from_utf8_lossy(&output.stderr));
        let left = std::fs::read_dir(folder.0.path()).unwrap();
        let passing = left
            .filter(|entry| entry.as_ref().unwrap().file_name().to_string_lossy().starts_with(".mesoshell-"));
        assert_eq!(passing.count(), 0);
        for path in pictures(folder.0.path()).keys() {
            mesoshell::frame::file::read(folder.path(path)).unwrap();
        }
    }
}

#[test]
fn requests_that_make_no_sense_end_before_the_first_frame() {
    let folder = Folder::new();
    let requests: [(&str, &[&str], &str); 8] = [
        ("##.png", &[], "a place for the number of a frame, but one picture is asked for"),
        ("##.png", &["--frames", "1-41"], "there is no frame 41"),
        ("##.png", &["--frames", "9-3"], "write 3-9"),
        ("##.png", &["--frames", "a"], "`a` is no number of a frame"),
        ("one.png", &["--frames", "1-2"], "2 frames cannot have one name"),
        ("##-##.png", &["--frames", "1-2"], "two places"),
        ("##.jpg", &["--frames", "1-2"], "written and read as .png or .exr"),
        ("##.png", &["--frames", "1", "--max-error", "1e-3"], "--max-error chooses the march of one picture"),
    ];
    for (output, more, part) in requests {
        let output = folder.command(output, more).output().unwrap();
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{more:?}: {told}");
        assert!(told.contains(part), "{more:?}: {told}");
    }
    assert!(pictures(folder.0.path()).is_empty());
}

#[test]
fn films_have_all_frames() {
    let folder = Folder::new();
    folder.run("film.gif", &[]);
    folder.run("film.apng", &["--frames", "1-10"]);
    let y4m = folder.run("-", &["--frames", "1-40x10"]).stdout;
    let read = |name: &str| std::fs::read(folder.path(name)).unwrap();
    let frames = image::codecs::png::PngDecoder::new(std::io::Cursor::new(read("film.apng"))).unwrap();
    assert_eq!(image::AnimationDecoder::into_frames(frames.apng().unwrap()).count(), 10);
    let gif = read("film.gif");
    assert!(gif.starts_with(b"GIF89a"));
    let header = b"YUV4MPEG2 W32 H32 F20:1 Ip A1:1 C444 XCOLORRANGE=LIMITED\n";
    assert!(y4m.starts_with(header));
    assert_eq!(y4m.len(), header.len() + 4 * (6 + 3 * 32 * 32));
}

/// Nothing but the camera moves, and that in the first half alone.
#[test]
fn equal_frames_are_drawn_once() {
    let folder = Folder::new();
    let scene =
        SCENE.replace("at = [0, 2]", "at = [0, 1]").replace("frames = 40", "frames = 40, loop = false");
    std::fs::write(folder.path("scene.toml"), scene).unwrap();
    let skipped = |more: &[&str]| -> Vec<bool> {
        let mut command = Command::new(env!("CARGO_BIN_EXE_mesoshell"));
        let arguments =
            ["render", "scene.toml", "--json", "--overwrite", "-o", "####.png", "--frames", "18-24"];
        let output = command.current_dir(folder.0.path()).args(arguments).args(more).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let result: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let frames = result["frames"].as_array().unwrap();
        let is_kept = |frame: &serde_json::Value| {
            let skipped = frame["report"]["skipped"].as_array().unwrap();
            let stages = frame["report"]["stages"].as_array().unwrap();
            let is_drawn = stages.iter().any(|stage| stage["name"] == "march");
            let is_kept = skipped.iter().any(|one| one.as_str().unwrap().starts_with("the picture is kept"));
            assert_ne!(is_drawn, is_kept);
            is_kept
        };
        frames.iter().map(is_kept).collect()
    };
    // Frame 21 is at one second: those after it are equal to it.
    let kept = skipped(&[]);
    assert_eq!(kept, [false, false, false, false, true, true, true]);
    let with = pictures(folder.0.path());
    assert_eq!(skipped(&["--no-skip", "kept"]), [false; 7]);
    let without = pictures(folder.0.path());
    // Marks in the files tell of what was allowed; pixels are the same.
    let pixels = |files: &BTreeMap<String, Vec<u8>>| -> Vec<image::RgbaImage> {
        files.values().map(|bytes| image::load_from_memory(bytes).unwrap().to_rgba8()).collect()
    };
    assert!(pixels(&with) == pixels(&without));
    assert_ne!(pixels(&with)[0], pixels(&with)[3]);
}
