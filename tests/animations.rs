//! The animations that are shipped: every frame is in a right order, and looks as the reference does.

mod common;

use std::path::{Path, PathBuf};

use common::Watched;
use mesoshell::metric;
use mesoshell::order::{self, Check, Sorter};
use mesoshell::progress::{Interrupt, Silent};
use mesoshell::reference;
use mesoshell::scene::{Scene, Sequence};
use std::sync::Arc;

fn paths() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/animation");
    let mut paths: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    assert!(paths.len() >= 6, "{paths:?}");
    paths
}

fn open(path: &Path, overrides: &[&str]) -> Sequence {
    let overrides: Vec<_> = overrides.iter().map(|&text| text.to_owned()).collect();
    Sequence::open(path, &overrides, &Silent).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn scene(sequence: &mut Sequence, frame: u32) -> Arc<Scene> {
    let loaded = sequence.at(frame, &Silent, &|_| Ok(()));
    Arc::new(loaded.unwrap_or_else(|error| panic!("frame {frame}: {error}")).scene)
}

/// The override that puts the scene's recipe, of a few texels, in place of itself: no order depends on the volume.
fn coarse_recipe(path: &Path, folder: &Path) -> String {
    let read = |path: &Path| -> toml::Table { std::fs::read_to_string(path).unwrap().parse().unwrap() };
    let recipe = read(path)["volume"]["recipe"].as_str().expect("a recipe").to_owned();
    let mut coarse = read(&path.parent().unwrap().join(recipe));
    coarse["size"] = toml::Value::from(vec![8, 8, 4]);
    let file = folder.join(path.file_name().unwrap());
    std::fs::write(&file, coarse.to_string()).unwrap();
    format!("volume.recipe={}", file.display())
}

/// Along the rays of all pixels of a small picture.
#[test]
fn no_frame_has_a_violation_of_its_order() {
    let folder = tempfile::tempdir().unwrap();
    for path in paths() {
        let mut sequence = open(&path, &["image.size=[48, 36]", &coarse_recipe(&path, folder.path())]);
        let mut found = Check::default();
        let mut sorter = None;
        let mut reversed = 0;
        for frame in 1..=sequence.timeline().frames {
            let scene = scene(&mut sequence, frame);
            let sorter = sorter.get_or_insert_with(|| Sorter::new(&scene.shell.topology));
            let mut sorted = sorter.sort(&scene.shell, &scene.view);
            let check = order::check_pixels(&scene.shell, &sorted.order, &scene.view);
            assert_eq!(check.violations, 0, "{} frame {frame}: {check:?}", path.display());
            found = found.and(check);
            if frame == 1 {
                sorted.order.sequence.reverse();
                sorted.order.cycles.clear();
                reversed = order::check_pixels(&scene.shell, &sorted.order, &scene.view).violations;
            }
        }
        println!("{}: {found:?}", path.display());
        assert!(found.pairs > 100_000 && reversed > 1_000, "{}: {found:?}, {reversed}", path.display());
    }
}

/// Of one pixel in so many, both ways, the reference is asked: some 25,000 of a frame.
const EVERY: u32 = 2;

/// At the scene's own size and quality, within the bounds of still scenes (`tests/accuracy.rs`).
#[test]
fn frames_look_as_the_reference_does() {
    for path in paths() {
        let mut sequence = open(&path, &[]);
        let mut shell: Option<Watched> = None;
        let mut last = None;
        for frame in [1, 30, 60] {
            let scene = scene(&mut sequence, frame);
            let view = scene.view;
            let method = match &mut shell {
                Some(method) => {
                    method.update(&scene);
                    method
                }
                None => shell.insert(Watched::prepare("shell", &scene)),
            };
            let drawn = method.render(&view).image.thinned(EVERY);
            let reference = reference::render_thinned(&scene, &view, EVERY, &Silent, &Interrupt::default())
                .unwrap()
                .image;
            let metrics = metric::compare(&drawn, &reference).unwrap();
            println!("{} frame {frame}: {metrics:?}", path.display());
            assert!(metrics.rmse <= 1e-3 && metrics.p999 <= 1e-2, "{} {frame}: {metrics:?}", path.display());
            if let Some(last) = last.replace(drawn) {
                let moved = metric::compare(&last, &reference).unwrap();
                assert!(
                    moved.rmse > 1e-2,
                    "{} {frame}: the frame before looks like this: {moved:?}",
                    path.display()
                );
            }
        }
    }
}
