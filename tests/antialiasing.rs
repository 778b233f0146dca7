//! Filters against many rays a pixel, from the sweep file to the report.

mod common;

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use common::keys;
use serde_json::Value;
use tempfile::TempDir;

const SCENE: &str = "\
mesh = { generator = 'torus', segments = 16, rings = 8 }
shell = { thickness = 0.2, uv_scale = [6, 3] }
volume = { recipe = 'rocks.toml' }
";

const SWEEP: &str = "\
scenes = ['stones.toml']
size = [40, 32]

[antialiasing]
distances = [1, 2]
rays = 16
filters = ['paper', 'directional']
";

/// A folder with a sweep of one small scene.
fn desk() -> TempDir {
    let desk = tempfile::tempdir().unwrap();
    let rocks = "recipe = 'rocks'\nsize = [32, 32, 16]\n";
    for (name, text) in [("sweep.toml", SWEEP), ("stones.toml", SCENE), ("rocks.toml", rocks)] {
        fs::write(desk.path().join(name), text).unwrap();
    }
    desk
}

fn bench(desk: &TempDir, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_mesoshell"));
    command.arg("bench").args(arguments).current_dir(desk.path()).env("NO_COLOR", "1").stdin(Stdio::null());
    command.output().unwrap()
}

#[test]
fn filters_are_compared_written_and_documented() {
    let desk = desk();
    let output = bench(&desk, &["sweep.toml", "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let value: Value = serde_json::from_slice(&output.stdout).unwrap();
    let pictures = value["scenes"][0]["pictures"].as_array().unwrap();
    let sizes: Vec<_> = pictures.iter().map(|picture| [&picture["width"], &picture["height"]]).collect();
    assert_eq!(sizes, [[40, 32], [20, 16]]);
    for picture in pictures {
        let points = picture["points"].as_array().unwrap();
        let [paper, directional] = [0, 1].map(|i| points[i]["rmse"].as_f64().unwrap());
        assert_eq!([&points[0]["filter"], &points[1]["filter"]], ["paper", "directional"]);
        // Stones of a few texels with gaps between them: what averages at one opacity distance closes these.
        assert!(directional > 1e-3 && directional < 0.9 * paper, "{directional} {paper}");
        assert_eq!(picture["reference_reused"], false);
    }
    assert!(pictures[1]["level"].as_f64().unwrap() > pictures[0]["level"].as_f64().unwrap());

    let folder = desk.path().join("out/bench");
    let documentation = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/bench.md");
    let documentation = fs::read_to_string(documentation).unwrap();
    let mut found = BTreeSet::new();
    keys(&serde_json::from_slice(&fs::read(folder.join("antialiasing.json")).unwrap()).unwrap(), &mut found);
    let csv = fs::read_to_string(folder.join("antialiasing.csv")).unwrap();
    assert_eq!(csv.lines().count(), 1 + 2 * 2);
    found.extend(csv.lines().next().unwrap().split(',').map(str::to_owned));
    assert!(found.len() > 30, "{found:?}");
    let (_, documentation) = documentation.split_once("# Antialiasing").unwrap();
    for key in found {
        let inherited =
            ["date", "version", "commit", "device", "driver", "vulkan", "processor", "cores", "os"];
        assert!(
            inherited.contains(&key.as_str()) || documentation.contains(&format!("`{key}`")),
            "`{key}` is not documented"
        );
    }
    let page = fs::read_to_string(folder.join("antialiasing.html")).unwrap();
    assert_eq!(page.matches("<img ").count(), 2 * 3);
    assert!(!page.contains("<script") && !page.contains("http"));
    for tag in ["section", "figure", "table", "tr", "div"] {
        let opened = page.matches(&format!("<{tag}>")).count() + page.matches(&format!("<{tag} ")).count();
        assert_eq!(opened, page.matches(&format!("</{tag}>")).count(), "{tag}");
    }

    // References do not depend on the filter, and are kept.
    let again = bench(&desk, &["sweep.toml", "-D", "volume.filter=paper"]);
    let table = String::from_utf8(again.stdout).unwrap();
    assert!(table.contains("| stones | 2 |") && table.contains("| filter | 1 | 2 | all |"), "{table}");
    let json = fs::read_to_string(folder.join("antialiasing.json")).unwrap();
    assert_eq!(json.matches("\"reference_reused\": true").count(), 2);
}

#[test]
fn mistakes_are_told() {
    let desk = desk();
    fs::write(desk.path().join("bad.toml"), SWEEP.replace("rays", "ryas")).unwrap();
    fs::write(desk.path().join("two.toml"), format!("{SWEEP}\n[plans]\ndefault = [1]\n")).unwrap();
    let mistakes: [(&[&str], i32, &str); 5] = [
        (&["bad.toml"], 3, "bad.toml:6:1"),
        (&["two.toml"], 3, "another benchmark"),
        (&["sweep.toml", "stones.toml"], 2, "stands alone"),
        (&["sweep.toml", "--steps", "1"], 2, "leave out"),
        (&["sweep.toml", "--resume"], 2, "leave out"),
    ];
    for (arguments, code, part) in mistakes {
        let output = bench(&desk, &[&["--quiet"], arguments].concat());
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {errors}");
        assert!(errors.contains(part), "{arguments:?}: {errors}");
    }
}
