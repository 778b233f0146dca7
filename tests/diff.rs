//! `mesoshell diff` from outside: what it measures, the maps that it writes, and what it refuses.

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use mesoshell::frame::{Backdrop, Image, file};
use serde_json::Value;
use tempfile::TempDir;

/// A folder with images, in which the command runs.
struct Desk(TempDir);

impl Desk {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    /// Writes an opaque image, one row of linear colours.
    fn image(&self, name: &str, colors: &[[f32; 3]]) {
        self.row(name, colors.iter().map(|&[r, g, b]| [r, g, b, 1.0]).collect());
    }

    fn row(&self, name: &str, rgba: Vec<[f32; 4]>) {
        let image = Image { width: rgba.len() as u32, height: 1, rgba };
        file::write(self.path().join(name), &image, &Backdrop::default()).unwrap();
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    fn diff(&self, arguments: &str) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_mesoshell"));
        command.arg("diff").args(arguments.split_whitespace()).env("NO_COLOR", "1").stdin(Stdio::null());
        command.current_dir(self.path()).output().unwrap()
    }

    /// What it prints as JSON.
    #[track_caller]
    fn json(&self, arguments: &str) -> Value {
        let output = self.diff(&format!("{arguments} --json"));
        assert!(output.status.success(), "{arguments}: {}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice(&output.stdout).unwrap()
    }

    /// The bytes of a picture that must be opaque.
    fn bytes(&self, name: &str) -> Vec<[u8; 3]> {
        let image::DynamicImage::ImageRgb8(picture) = image::open(self.path().join(name)).unwrap() else {
            panic!("{name} is not opaque, of 8 bits");
        };
        picture.pixels().map(|pixel| pixel.0).collect()
    }

    /// Runs what must fail with `code` and one error that has all `parts`, and leave nothing behind.
    #[track_caller]
    fn refuses(&self, arguments: &str, code: i32, parts: &[&str]) {
        let files = || fs::read_dir(self.path()).unwrap().count();
        let before = files();
        let output = self.diff(arguments);
        let errors = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{arguments}: {errors}");
        assert!(output.stdout.is_empty(), "{arguments}");
        for part in parts {
            assert!(errors.contains(part), "{arguments} does not tell {part:?}:\n{errors}");
        }
        assert!(errors.matches('×').count() + errors.matches("error: ").count() == 1, "{errors}");
        assert_eq!(files(), before, "{arguments}");
    }
}

const GREY: [f32; 3] = [0.5; 3];

#[test]
fn every_metric_has_its_threshold() {
    let desk = Desk::new();
    desk.image("a.exr", &[GREY; 4]);
    desk.image("b.exr", &[GREY, GREY, [0.5, 0.25, 0.5], GREY]);
    let metrics = desk.json("a.exr b.exr");
    // One channel of sixteen, by a quarter.
    assert_eq!(metrics["rmse"], 0.0625);
    assert_eq!((&metrics["max"], &metrics["p999"]), (&0.25.into(), &0.25.into()));
    assert!(metrics["flip"].as_f64().is_some_and(|flip| flip > 0.01 && flip < 1.0));
    let code = |arguments: &str| desk.diff(&format!("a.exr b.exr {arguments}")).status.code();
    for (metric, larger_is_better) in
        [("rmse", false), ("max", false), ("p999", false), ("psnr", true), ("flip", false)]
    {
        let value = metrics[metric].as_f64().unwrap();
        let at = |threshold: f64| code(&format!("--metric {metric} --threshold {threshold}"));
        assert_eq!(at(value), Some(0), "{metric} at its threshold");
        assert_eq!(at(1.001 * value), Some(i32::from(larger_is_better)), "{metric}");
        assert_eq!(at(0.999 * value), Some(i32::from(!larger_is_better)), "{metric}");
        assert_eq!(at(f64::NAN), Some(2), "{metric}");
    }
    assert_eq!(code("--threshold 0.0625"), Some(0), "rmse is the default");
    assert_eq!(code("--threshold 0.0624"), Some(1), "rmse is the default");
    assert_eq!(desk.diff("a.exr a.exr --metric psnr --threshold 300").status.code(), Some(0));
}

#[test]
fn the_map_has_signs_and_a_range() {
    let desk = Desk::new();
    desk.image("a.exr", &[GREY, [0.55; 3], [0.26; 3], [0.9; 3]]);
    desk.image("b.exr", &[GREY; 4]);
    assert_eq!(desk.json("a.exr b.exr --map given.png --range 0.2")["map_range"], 0.2_f32);
    assert_eq!(desk.bytes("given.png"), [[255; 3], [255, 191, 191], [0, 0, 255], [255, 0, 0]]);
    let range = desk.json("a.exr b.exr --map natural.png")["map_range"].as_f64().unwrap();
    assert!((range - 0.4).abs() < 1e-6, "{range}");
    assert_eq!(desk.bytes("natural.png"), [[255; 3], [255, 223, 223], [102, 102, 255], [255, 0, 0]]);
    // The other way round the colours change places.
    desk.json("b.exr a.exr --map back.png");
    assert_eq!(desk.bytes("back.png"), [[255; 3], [223, 223, 255], [255, 102, 102], [0, 0, 255]]);
    desk.json("a.exr a.exr --map none.png");
    assert_eq!(desk.bytes("none.png"), [[255; 3]; 4]);
    let text = String::from_utf8(desk.diff("a.exr b.exr --map given.png --range 0.2").stdout).unwrap();
    assert!(text.contains("-2.000e-1 to 2.000e-1") && text.contains("FLIP"), "{text}");
}

#[test]
fn the_flip_map_is_magma() {
    let desk = Desk::new();
    desk.image("green.png", &[[0.0, 1.0, 0.0]; 3]);
    desk.image("blue.png", &[[0.0, 0.0, 1.0]; 3]);
    // No two colours are farther apart.
    assert!(
        (desk.json("green.png blue.png --flip-map most.png")["flip"].as_f64().unwrap() - 1.0).abs() < 1e-5
    );
    assert_eq!(desk.bytes("most.png"), [[0xfc, 0xfd, 0xbf]; 3]);
    assert_eq!(desk.json("green.png green.png --flip-map none.png")["flip"], 0.0);
    assert_eq!(desk.bytes("none.png"), [[0, 0, 4]; 3]);
}

#[test]
fn what_lies_behind_shows() {
    let desk = Desk::new();
    desk.row("a.exr", vec![[0.0; 4]; 2]);
    desk.row("b.exr", vec![[0.0, 0.0, 0.0, 1.0]; 2]);
    assert_eq!(desk.json("a.exr b.exr")["flip"], 0.0, "black over black");
    let over_white = desk.json("a.exr b.exr --background 1,1,1 --map map.png --range 1");
    assert!(over_white["flip"].as_f64().unwrap() > 0.9, "white against black");
    assert_eq!(desk.bytes("map.png"), [[255, 0, 0]; 2]);
}

#[test]
fn bad_requests_are_told() {
    let desk = Desk::new();
    desk.image("a.exr", &[GREY; 4]);
    desk.image("wide.exr", &[GREY; 5]);
    desk.row("nan.exr", vec![[0.0; 4], [0.0; 4], [0.0, f32::NAN, 0.0, 1.0], [0.0; 4]]);
    fs::write(desk.path().join("text.png"), "no picture").unwrap();

    desk.refuses("a.exr wide.exr --map map.png --flip-map flip.png", 2, &["4x1", "5x1"]);
    desk.refuses("a.exr text.png", 3, &["text.png"]);
    for arguments in ["a.exr nan.exr --map map.png", "nan.exr a.exr --flip-map map.png"] {
        desk.refuses(arguments, 3, &["nan.exr", "(2, 0)", "not finite"]);
    }
    // What is not finite differs from everything, and by every metric.
    for metric in ["rmse", "max", "p999", "psnr", "flip"] {
        let arguments = format!("nan.exr nan.exr --metric {metric} --threshold 0");
        assert_eq!(desk.diff(&arguments).status.code(), Some(1), "{metric}");
    }

    desk.refuses("a.exr a.exr --map map.exr", 2, &["map.exr", ".png"]);
    desk.refuses("a.exr nowhere.exr --map nowhere/map.png", 6, &["nowhere/map.png"]);
    desk.refuses("a.exr text.png --flip-map text.png", 2, &["text.png", "two things"]);
    desk.refuses("a.exr a.exr --map m.png --flip-map m.png", 2, &["m.png", "two things"]);
    // However it is written, and through links.
    fs::create_dir(desk.path().join("sub")).unwrap();
    desk.image("a.png", &[GREY; 4]);
    desk.refuses("a.png a.exr --map ./sub/../a.png", 2, &["a.png", "two things"]);
    desk.refuses("a.exr a.exr --map m.png --flip-map sub/../m.png", 2, &["m.png", "two things"]);
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("a.png", desk.path().join("link.png")).unwrap();
        desk.refuses("link.png a.exr --flip-map a.png", 2, &["a.png", "two things"]);
        std::os::unix::fs::symlink("sub", desk.path().join("same")).unwrap();
        desk.refuses("a.exr a.exr --map sub/m.png --flip-map same/m.png", 2, &["m.png", "two things"]);
    }
    desk.refuses("a.exr a.exr --range 1", 2, &["--map"]);
    for range in ["0", "nan", "inf", "wide"] {
        desk.refuses(&format!("a.exr a.exr --map m.png --range {range}"), 2, &["above 0"]);
    }
    for background in ["1,1", "1,1,2", "black", "1,1,1,1"] {
        desk.refuses(&format!("a.exr a.exr --background {background}"), 2, &["three numbers"]);
    }
    desk.refuses("a.exr a.exr --metric flip", 2, &["--threshold"]);
    desk.refuses("a.exr a.exr --metric ssim --threshold 1", 2, &["ssim", "flip", "psnr"]);
}
