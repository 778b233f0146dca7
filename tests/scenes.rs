//! The scenes that are shipped: all can be loaded, and those of the 2005 paper's Table 1 have its counts.

use std::path::{Path, PathBuf};

use mesoshell::progress::Silent;
use mesoshell::scene::{self, Loaded, March};

/// Every scene file in a folder and those below it, in the order of their names.
fn scenes(folder: &Path) -> Vec<PathBuf> {
    let mut paths: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    let (folders, files): (Vec<_>, Vec<_>) = paths.into_iter().partition(|path| path.is_dir());
    let is_scene = |path: &PathBuf| path.extension().is_some_and(|ending| ending == "toml");
    let below = folders.iter().flat_map(|folder| scenes(folder));
    files.into_iter().filter(is_scene).chain(below.collect::<Vec<_>>()).collect()
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes")
}

fn load(path: &Path, overrides: &[&str]) -> Loaded {
    let overrides: Vec<_> = overrides.iter().map(|&text| text.to_owned()).collect();
    scene::load(path, &overrides, &Silent).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

#[test]
fn every_scene_loads_and_says_what_it_shows() {
    let paths = scenes(&folder());
    assert!(paths.len() >= 20, "{paths:?}");
    for path in paths {
        load(&path, &[]);
        let text = std::fs::read_to_string(&path).unwrap();
        let comments = text.lines().take_while(|line| line.starts_with("# ")).count();
        assert!((1..=3).contains(&comments), "{}: {comments} lines of comment", path.display());
    }
}

#[test]
fn table_1_has_the_counts_of_the_paper() {
    // Name, triangles (four for each of three tetrahedra of a prism), texture, samples.
    for (name, triangles, texture, samples) in [
        ("teapot-bust", 25_704, [128, 128, 32], 10),
        ("teapot-weave", 25_704, [64, 64, 32], 20),
        ("vase-trees", 103_680, [128, 128, 32], 10),
        ("vase-dragons", 103_680, [128, 128, 32], 10),
        ("plane-trees", 384, [128, 128, 32], 15),
        ("tube-rocks", 1_440, [512, 512, 32], 10),
    ] {
        let path = folder().join("table1").join(name).with_extension("toml");
        let Loaded { scene, .. } = load(&path, &["march.plan=paper"]);
        assert_eq!(4 * scene.shell.topology.tetrahedra.len(), triangles, "{name}");
        assert_eq!(scene.volume.levels[0].size, texture, "{name}");
        assert_eq!(scene.march, March::Paper { samples }, "{name}");
        assert_eq!((scene.view.width, scene.view.height), (512, 512), "{name}");
    }
}
