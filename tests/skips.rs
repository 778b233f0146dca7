//! What is left out because a picture does not need it: the picture is the same without.

mod common;

use std::path::Path;
use std::sync::Arc;

use common::Watched;
use glam::DVec3;
use mesoshell::frame::Frame;
use mesoshell::method::Choice;
use mesoshell::metric;
use mesoshell::progress::Silent;
use mesoshell::scene::{self, Light, March, Scene, Shading, Skip, Skips, Traversal};
use mesoshell::volume::{Directions, Pyramid, Volume};

fn load(name: &str, overrides: &[&str]) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).with_extension("toml");
    let overrides = overrides.iter().map(|text| (*text).to_owned());
    let overrides: Vec<String> = ["image.size=[96, 96]".to_owned()].into_iter().chain(overrides).collect();
    let mut scene = scene::load(&path, &overrides, &Silent).unwrap_or_else(|error| panic!("{error:?}")).scene;
    scene.view.depth = true;
    scene
}

/// With it, and with it switched off; and what was chosen about it.
fn with_and_without(skip: Skip, scene: &Scene) -> [(Frame, Choice); 2] {
    with_and_without_of(skip, scene, &[])
}

/// The same with others switched off, too.
fn with_and_without_of(skip: Skip, scene: &Scene, off: &[Skip]) -> [(Frame, Choice); 2] {
    [off.to_vec(), [off, &[skip]].concat()].map(|off| {
        let scene = Arc::new(Scene { skips: Skips::without(&off), ..scene.clone() });
        let mut method = Watched::prepare("shell", &scene);
        let choice = method.plan().into_iter().find(|choice| choice.about == skip.name()).unwrap();
        (method.render(&scene.view), choice)
    })
}

/// The largest difference of a channel, or of a depth where alpha is not next to nothing.
fn difference([a, b]: [&Frame; 2]) -> f64 {
    let of_depth = |((a, b), rgba): ((&f32, &f32), &[f32; 4])| {
        if rgba[3] > 1e-3 { f64::from((a - b).abs()) } else { 0.0 }
    };
    let depths = a.depth.as_ref().unwrap().iter().zip(b.depth.as_ref().unwrap()).zip(&a.image.rgba);
    depths.map(of_depth).fold(metric::compare(&a.image, &b.image).unwrap().max, f64::max)
}

#[test]
fn leaps_change_nothing() {
    let leap = |scene: &Scene| with_and_without(Skip::EmptySpace, scene);
    let plans =
        [(March::Default { step: 0.5 }, Traversal::Walk), (March::Default { step: 0.3 }, Traversal::Sort)];
    // From ever farther away: coarser levels are read, and several in one tetrahedron.
    for eye in ["camera.fov=34", "camera.fov=120", "camera.eye=[0.2, 7, 16]"] {
        let scene = load("lit-rocks", &[eye]);
        for (march, traversal) in plans {
            let scene = Scene { march, traversal, ..scene.clone() };
            let [with, without] = leap(&scene);
            assert_eq!((with.1.chosen, without.1.chosen), ("on", "off"), "{with:?}");
            let covered = with.0.report.counts["pixels_covered"];
            assert!(covered > 80, "{eye}: {covered}");
            assert_eq!(difference([&with.0, &without.0]), 0.0, "{eye}, {march}, {traversal:?}");
        }
    }
    // Neighbouring pixels read different levels.
    let [with, without] = leap(&load("animation/flag", &["image.size=[384, 256]"]));
    assert_eq!(with.1.chosen, "on");
    assert_eq!(difference([&with.0, &without.0]), 0.0);
    // Rays of lights, which are parallel or come from a point.
    for light in ["direction = [-0.8, -0.5, 0.45]", "position = [1, 2, -1]"] {
        let of_shadows = ["shading.shadow_size=128", &format!("light=[{{ {light}, shadow = true }}]")];
        let [with, without] = leap(&load("effects/shadow", &of_shadows));
        assert_eq!(with.1.chosen, "on");
        assert_eq!(difference([&with.0, &without.0]), 0.0, "{light}");
    }
    let papers = Scene { march: March::Paper { samples: 10 }, ..load("lit-rocks", &[]) };
    assert_eq!(leap(&papers)[0].1.chosen, "off", "the yardstick is the paper's");
}

#[test]
fn what_is_even_is_passed_in_long_steps() {
    let haze = load("table1/vase-dragons", &["image.size=[128, 96]", "shading.shadow_size=128"]);
    let shading = haze.shading.clone().unwrap();
    let shadowless = Shading {
        lights: shading.lights.iter().map(|light| Light { shadow: false, ..*light }).collect(),
        ..shading.clone()
    };
    let both = |scene: &Scene| {
        // Whether a ray ends is asked after every sample, and of these there are fewer.
        let [with, without] = with_and_without_of(Skip::EvenSpace, scene, &[Skip::Saturation]);
        assert_eq!((with.1.chosen, without.1.chosen), ("on", "off"), "{with:?}");
        [with.0, without.0]
    };
    let images = |[a, b]: &[Frame; 2]| metric::compare(&a.image, &b.image).unwrap();
    // An opacity is off by 2^-20 of itself, for the exponential, and opacities times what is let through add up to 1 at most, in either
    // picture; texels of coarser levels are off by 9 * 2^-23; colours in this light are below 2. Depths of steps are those of their
    // middles, from which the mean of what they send out is a twelfth of their optical depth, 0.12, times their length, 0.003.
    let agree = |frames: &[Frame; 2], what: &str| {
        let [a, b] = frames;
        assert!(images(frames).max <= 1e-5, "{what}: {:?}", images(frames));
        assert!(difference([a, b]) <= 1e-4, "{what}: {}", difference([a, b]));
    };
    for traversal in [Traversal::Walk, Traversal::Sort] {
        for shading in [None, Some(shadowless.clone())] {
            let is_lit = shading.is_some();
            let frames = both(&Scene { shading, traversal, ..haze.clone() });
            agree(&frames, &format!("{traversal:?}, lit {is_lit}"));
        }
        // Not derived: twice what it was when it was measured, with more pixels.
        let metrics = images(&both(&Scene { traversal, ..haze.clone() }));
        assert!(metrics.rmse > 0.0 && metrics.rmse <= 2e-4, "{traversal:?}: {metrics:?}");
    }
    // Several parts of the shell at once.
    let together = load("table1/teapot-bust", &["shading.shadow_size=128"]);
    agree(&both(&Scene { shading: None, ..together }), "several parts");
}

#[test]
fn a_volume_that_is_hardly_empty_is_not_looked_through() {
    let [with, _] = with_and_without(Skip::EmptySpace, &load("fur-sphere", &[]));
    assert_eq!(with.1.chosen, "off");
    assert!(with.1.why.contains("would pay from 50 %"), "{}", with.1.why);
}

#[test]
fn what_is_behind_the_opaque_does_not_count() {
    let [with, without] = with_and_without(Skip::Saturation, &load("lit-rocks", &[]));
    assert_eq!((with.1.chosen, without.1.chosen), ("on", "off"));
    // 2^-20 of a light of at most 2, and of a depth below 10.
    let difference = difference([&with.0, &without.0]);
    assert!(difference <= 1e-5, "{difference}");
    assert!(metric::compare(&with.0.image, &without.0.image).unwrap().max <= 2e-6);
}

/// A volume of one colour and one opacity, a half.
fn uniform([red, green, blue]: [f32; 3]) -> Volume {
    Volume::new([4; 3], vec![[0.5 * red, 0.5 * green, 0.5 * blue, 0.5]; 64]).unwrap()
}

/// Whose rays end where a tenth is let through, and which go on.
fn early_and_full(scene: &Scene) -> [Frame; 2] {
    [0.1, 0.0].map(|end_below| {
        let scene = Arc::new(Scene { end_below, ..scene.clone() });
        Watched::prepare("shell", &scene).render(&scene.view)
    })
}

/// The largest difference of a channel.
fn off(early: &[f32; 4], full: &[f32; 4]) -> f32 {
    (0..4).map(|i| (early[i] - full[i]).abs()).fold(0.0, f32::max)
}

#[test]
fn what_is_behind_is_taken_for_what_is_in_front() {
    let volume = uniform([0.8, 0.4, 0.2]);
    // Lit by what comes from everywhere, so that all of it is as bright.
    let lit = Shading {
        ambient: DVec3::ONE,
        lights: Vec::new(),
        directions: Arc::new(Directions::normals(&volume)),
        ..load("lit-fur", &[]).shading.unwrap()
    };
    let volume = Arc::new(Pyramid::build(volume));
    // Rays that are alone, and in several parts of the shell at once.
    for (name, overlaps) in [("fog-torus", false), ("table1/teapot-bust", true)] {
        for shading in [None, Some(lit.clone())] {
            let what = format!("{name}, lit {}", shading.is_some());
            let scene = Scene {
                volume: volume.clone(),
                shading,
                solids: [].into(),
                skips: Skips::without(&[Skip::EvenSpace]),
                ..load(name, &["volume.opacity_distance=0.03"])
            };
            let [early, full] = early_and_full(&scene);
            assert_eq!(early.report.counts["pixels_overlapping"] > 300, overlaps, "{what}");
            let mut opaque = 0;
            for (early, full) in early.image.rgba.iter().zip(&full.image.rgba) {
                // The colour is at most 1.
                assert!(off(early, full) <= 0.1, "{what}: {early:?} {full:?}");
                if full[3] > 1.0 - 1e-5 {
                    opaque += 1;
                    // Of one colour nothing is missed but the 1e-5 that is let through. Sums of up to a thousand steps of one sign, each
                    // off by 2^-20 of itself for its texel, differ by that at most, as do the quotients of sums above 2^-10 which are
                    // off by units of 2^-24: some 2^-13, of a tenth.
                    assert!(off(early, full) <= 4e-5, "{what}: {early:?} {full:?}");
                }
            }
            assert!(opaque > 300, "{what}: {opaque}");
        }
    }
}

#[test]
fn a_ray_that_has_seen_all_is_not_filled_up() {
    // Straight down through a layer that lets 0.0995 through, so that less than a tenth is left in the last five thousandths alone:
    // 0.1 (ln 2) / opacity_distance = -ln 0.0995.
    let base = "base = { colour = [0, 1, 0] }";
    for (base, behind) in [("", [0.0; 4]), (base, [0.0, 1.0, 0.0, 1.0])] {
        let text = format!(
            "{base}
            mesh = {{ generator = 'plane', segments = 3 }}
            shell = {{ thickness = 0.1 }}
            volume = {{ recipe = 'volumes/fog.toml', opacity_distance = 0.030037 }}
            camera = {{ eye = [0.1, 20, 0.1], target = [0.1, 0, 0.1], up = [0, 0, -1], fov = 2 }}
            image = {{ size = [64, 64] }}"
        );
        let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
        let scene = scene::parse("layer", &text, folder).unwrap_or_else(|error| panic!("{error:?}")).scene;
        for colour in [[1.0, 0.0, 0.0], [0.2, 0.0, 0.9]] {
            let volume = Arc::new(Pyramid::build(uniform(colour)));
            let [early, full] = early_and_full(&Scene { volume, ..scene.clone() });
            let mut same = 0;
            for (early, full) in early.image.rgba.iter().zip(&full.image.rgba) {
                // The path is longer away from the middle, by 2e-4.
                for i in 0..4 {
                    let in_front = [colour[0], colour[1], colour[2], 1.0][i];
                    let expected = 0.9005 * in_front + 0.0995 * behind[i];
                    assert!((full[i] - expected).abs() <= 1e-4, "{behind:?}: {full:?}");
                }
                assert!(off(early, full) <= 0.1, "{behind:?}: {early:?} {full:?}");
                same += u32::from(off(early, full) <= 1e-6);
            }
            // Of those whose last tetrahedron is thinner than that what is behind is not known.
            assert!(same >= 64 * 64 * 9 / 10, "{behind:?}: {same}");
        }
    }
}

#[test]
fn nor_does_it_where_tetrahedra_are_sorted() {
    let lights = [&[][..], &["light=[]", "shading.ambient=[1, 1, 1]"]];
    for (name, lights) in ["lit-rocks", "table1/tube-rocks"].into_iter().zip(lights) {
        let scene = Scene { traversal: Traversal::Sort, ..load(name, lights) };
        let exact = Scene { end_below: scene::END_BELOW, ..scene.clone() };
        let [with, without] = with_and_without(Skip::Saturation, &exact);
        assert_eq!((with.1.chosen, without.1.chosen), ("on", "off"));
        // As above.
        let difference = difference([&with.0, &without.0]);
        assert!(difference <= 1e-5, "{name}: {difference}");
        // Pixels are left out: where a tenth is let through, what is behind is missed, but no more than that of what is as bright as 2.
        let [early, _] = with_and_without(Skip::Saturation, &Scene { end_below: 0.1, ..scene });
        let missed = metric::compare(&early.0.image, &without.0.image).unwrap().max;
        assert!((1e-3..0.2).contains(&missed), "{name}: {missed}");
    }
    let papers = Scene { march: March::Paper { samples: 10 }, ..load("lit-rocks", &[]) };
    assert_eq!(
        with_and_without(Skip::Saturation, &papers)[0].1.chosen,
        "off",
        "the yardstick is the paper's"
    );
}

#[test]
fn levels_that_nothing_reads_do_not_count() {
    let near = ["camera.fov=0.5"];
    let [with, without] = with_and_without(Skip::Levels, &load("fur-sphere", &near));
    let told = "all is magnified: no level of detail but 0 is compiled in";
    assert!(with.0.report.skipped.iter().any(|skipped| skipped == told), "{:?}", with.0.report.skipped);
    assert_eq!(difference([&with.0, &without.0]), 0.0);
    // Near the poles texels are ever smaller, elsewhere none is smaller than a pixel.
    for name in ["fur-sphere", "lit-fur"] {
        let [with, without] = with_and_without(Skip::Levels, &load(name, &["image.size=[400, 330]"]));
        let told = |skipped: &String| skipped.starts_with("in ") && skipped.contains(" of 42 squares");
        assert!(with.0.report.skipped.iter().any(told), "{:?}", with.0.report.skipped);
        assert!(!without.0.report.skipped.iter().any(told));
        assert_eq!(difference([&with.0, &without.0]), 0.0, "{name}");
    }
}

#[test]
fn what_is_kept_is_what_would_be_made_again() {
    let scene = Arc::new(load("effects/shadow", &["shading.shadow_size=64"]));
    let frames = [Skips::default(), Skips::without(&[Skip::Kept])].map(|skips| {
        let scene = Arc::new(Scene { skips, ..(*scene).clone() });
        let mut method = Watched::prepare("shell", &scene);
        method.render(&scene.view);
        method.render(&scene.view)
    });
    let stages = |frame: &Frame| -> Vec<String> {
        frame.report.stages.iter().map(|stage| stage.name.clone()).collect()
    };
    for stage in ["order", "see", "shadows"] {
        assert!(!stages(&frames[0]).contains(&stage.to_owned()), "{stage} is kept");
        assert!(stages(&frames[1]).contains(&stage.to_owned()), "{stage} is made again");
    }
    assert_eq!(difference([&frames[0], &frames[1]]), 0.0);
}

#[test]
fn another_picture_is_found_out() {
    let frames = [&[][..], &["shell.thickness=0.301"]].map(|overrides| {
        let scene = Arc::new(load("lit-rocks", overrides));
        Watched::prepare("shell", &scene).render(&scene.view)
    });
    assert!(difference([&frames[0], &frames[1]]) > 1e-4);
}
