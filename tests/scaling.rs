//! Benchmarks of scaling: what is written, and that all of it is documented.

use std::process::{Command, Output};

use serde_json::Value;

const SCENE: &str = r#"
mesh = { generator = "torus", segments = 12, rings = 6 }
shell = { thickness = 0.3 }
volume = { recipe = "fog.toml" }
camera = { eye = [0, 3.0, 4.4], target = [0, 0, 0] }
image = { size = [16, 16] }
"#;

const SWEEP: &str = r#"
runs = 2

[[series]]
name = "finer"
of = "tetrahedra"
scene = "scene.toml"
sizes = [["mesh.segments=6"], ["mesh.segments=12"], ["mesh.segments=24"]]

[[series]]
name = "larger"
of = "pixels"
scene = "scene.toml"
sizes = [["image.size=[16, 16]"], ["image.size=[32, 32]"]]
"#;

fn bench(more: &[&str]) -> (tempfile::TempDir, Output) {
    let desk = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(desk.path().join(name), text).unwrap();
    write("scene.toml", SCENE);
    write("sweep.toml", SWEEP);
    write("fog.toml", "recipe = \"uniform\"\nsize = [2, 2, 2]\nalpha = 0.5\n");
    let mut command = Command::new(env!("CARGO_BIN_EXE_mesoshell"));
    let output =
        command.current_dir(desk.path()).args(["bench", "sweep.toml", "-o", "out"]).args(more).output();
    (desk, output.unwrap())
}

/// Names of keys, at any depth.
fn keys(value: &Value, found: &mut Vec<String>) {
    match value {
        Value::Object(object) => object.iter().for_each(|(key, value)| {
            found.push(key.clone());
            keys(value, found);
        }),
        Value::Array(array) => array.iter().for_each(|value| keys(value, found)),
        _ => {}
    }
}

#[test]
fn a_sweep_is_measured_written_and_documented() {
    let (desk, output) = bench(&[]);
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success() && said.contains("| finer | tetrahedra | 432 |"), "{said}");
    assert!(said.contains("| larger | frame |"), "{said}");
    let read = |name: &str| std::fs::read_to_string(desk.path().join("out").join(name)).unwrap();
    let json: Value = serde_json::from_str(&read("scaling.json")).unwrap();
    let series = json["series"].as_array().unwrap();
    let sizes = |index: usize| -> Vec<u64> {
        series[index]["points"]
            .as_array()
            .unwrap()
            .iter()
            .map(|point| point["size"].as_u64().unwrap())
            .collect()
    };
    assert_eq!((sizes(0), sizes(1)), (vec![216, 432, 864], vec![256, 1024]));
    let stages: Vec<&str> = series[0]["growth"]
        .as_array()
        .unwrap()
        .iter()
        .map(|growth| growth["stage"].as_str().unwrap())
        .collect();
    for stage in ["frame", "load.shell", "order", "see", "march"] {
        assert!(stages.contains(&stage), "{stage}: {stages:?}");
    }
    for point in series[0]["points"].as_array().unwrap() {
        assert_eq!(point["frame"]["runs"].as_array().unwrap().len(), 2);
        assert!(point["memory"].as_u64().is_some() || !cfg!(target_os = "linux"));
    }
    assert!(
        read("scaling.csv")
            .starts_with("series,of,size,stage,median_ms,p95_ms,memory_bytes\r\nfiner,tetrahedra,216,frame,")
    );
    assert!(read("scaling.html").matches("<polyline").count() >= 6);

    let documented = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/bench.md")).unwrap();
    let mut found = Vec::new();
    keys(&json, &mut found);
    assert!(found.len() > 40);
    for key in found {
        assert!(documented.contains(&format!("`{key}`")), "{key} is not documented");
    }
}

#[test]
fn mistakes_are_told() {
    for (more, part) in [
        (&["--steps", "1"][..], "compares with no reference"),
        (&["--resume"], "compares with no reference"),
        (&["-D", "mesh.rings=0"], "finer, mesh.segments=6"),
    ] {
        let (desk, output) = bench(more);
        let told = String::from_utf8(output.stderr).unwrap();
        assert!(!output.status.success() && told.contains(part), "{more:?}: {told}");
        assert!(!desk.path().join("out/scaling.html").exists());
    }
}
