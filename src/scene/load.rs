//! From the text of a scene file to the [`Scene`] that it describes.

use std::path::Path;

use super::file::SceneFile;
use super::text::Text;
use super::{Scene, Sequence, Sizes};
use crate::frame::{Backdrop, Stage};
use crate::progress::{Progress, Silent};
use crate::{Error, Result, input};

/// A scene, with what its file says beyond it.
#[derive(Debug, Clone)]
pub struct Loaded {
    /// What a method renders.
    pub scene: Scene,
    /// Samples that the paper's plan takes in a tetrahedron, [`March::Paper`](super::March::Paper), whether the scene is to be rendered by it
    /// or not.
    pub samples: u32,
    /// What a picture for people is laid on.
    pub backdrop: Backdrop,
    /// What loading cost.
    pub stages: Vec<Stage>,
}

/// Loads a scene file with overrides laid over it, each `dotted.key=value`: the first frame, where there are several.
///
/// # Errors
/// [`Error::Input`] for a file that cannot be read, [`Error::Text`] for a scene that cannot be, with the spot,
/// [`Error::Usage`] for an override that is to blame.
pub fn load(path: &Path, overrides: &[String], progress: &dyn Progress) -> Result<Loaded> {
    load_if(path, overrides, progress, &|_| Ok(()))
}

/// Loads a scene as [`load`] does, if `admit` lets it: it is asked once, as soon as the sizes are known, which for a recipe
/// is before anything is computed, and for a volume file once that is read.
///
/// # Errors
/// As [`load`], and that of `admit`.
pub fn load_if(
    path: &Path,
    overrides: &[String],
    progress: &dyn Progress,
    admit: &dyn Fn(&Sizes) -> Result<()>,
) -> Result<Loaded> {
    build(text(path, overrides)?, path.parent().unwrap_or(Path::new("")), progress, admit)
}

/// The text of a scene file.
pub(super) fn text(path: &Path, overrides: &[String]) -> Result<Text> {
    let unreadable = |error: std::io::Error| {
        Error::input(path, format!("the scene file cannot be read: {error}"))
            .with_help("check the path, or write the scene that docs/scene.md describes")
    };
    let text = input::text(path).map_err(unreadable)?;
    Text::new(&path.display().to_string(), text, overrides)
}

/// What a scene's text says.
pub(super) fn read(text: &Text) -> Result<SceneFile> {
    text.parse(("mesh", "generator"))
}

/// Loads a scene from a text: `name` is what errors call it, `base_dir` where its paths start.
///
/// # Errors
/// As [`load`].
pub fn parse(name: &str, text: &str, base_dir: &Path) -> Result<Loaded> {
    build(Text::new(name, text.to_owned(), &[])?, base_dir, &Silent, &|_| Ok(()))
}

fn build(
    text: Text,
    base_dir: &Path,
    progress: &dyn Progress,
    admit: &dyn Fn(&Sizes) -> Result<()>,
) -> Result<Loaded> {
    Sequence::of(text, base_dir)?.at(1, progress, admit)
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use glam::DVec3;

    use super::*;
    use crate::scene::text::tests::assert_underlined;
    use crate::scene::{Light, March, Model, Source};
    use crate::shell::Shell;
    use crate::volume::{self, AlphaMode, Pyramid, RawVolume, Sample, Volume};

    const SCENE: &str = r#"
[mesh]
generator = "torus"
segments = 8
rings = 4

[shell]
thickness = 0.1

[volume]
recipe = "fog.toml"
"#;

    /// A folder with the recipe that [`SCENE`] names, of 4 x 4 x 4 texels.
    fn folder() -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("fog.toml"), "recipe = \"fog\"\nsize = [4, 4, 4]\n").unwrap();
        folder
    }

    fn loaded(overrides: &[&str]) -> Result<Loaded> {
        let overrides: Vec<_> = overrides.iter().map(|&text| text.to_owned()).collect();
        build(Text::new("scene.toml", SCENE.to_owned(), &overrides)?, folder().path(), &Silent, &|_| Ok(()))
    }

    #[test]
    fn what_is_left_out_has_its_default() {
        let Loaded { scene, backdrop, .. } = parse("scene.toml", SCENE, folder().path()).unwrap();
        let expected = Scene::new(Shell::clone(&scene.shell), Pyramid::clone(&scene.volume), 0.1 / 4.0);
        assert_eq!((scene.view, scene.medium, scene.march), (expected.view, expected.medium, expected.march));
        assert_eq!(backdrop, Backdrop::default());
    }

    #[test]
    fn overrides_replace_and_add_values() {
        let overrides = [
            "mesh.rings=5",
            "shell.uv_scale=[2, 3.5]",
            "volume.opacity_distance=1",
            "march.plan=paper",
            "march={samples=3}",
            "image.background=[0, 0.5, 1]",
            "camera={eye=[0,0,9],target=[0,0,0],fov=90}",
            "camera.near = 2",
        ];
        let Loaded { scene, backdrop, .. } = loaded(&overrides).unwrap();
        assert_eq!(scene.shell.topology.tetrahedra.len(), 3 * 2 * 8 * 5);
        assert_eq!(scene.medium.opacity_distance, 1.0);
        assert_eq!(scene.march, March::Paper { samples: 3 });
        assert_eq!(backdrop, Backdrop::colour([0.0, 0.5, 1.0]));
        let backdrop = loaded(&["image.background=#ff0000", "image.exposure=1"]).unwrap().backdrop;
        assert_eq!(backdrop, Backdrop { exposure: 1.0, ..Backdrop::colour([1.0, 0.0, 0.0]) });
        assert_eq!((scene.view.camera.eye.z, scene.view.camera.near), (9.0, 2.0));
        assert_eq!(scene.view.camera.fov_y, std::f64::consts::FRAC_PI_2);
        // A row of the five spans a fifth of the texture's 3.5 repeats.
        let mut v = scene.shell.texture[0].map(|uvw| uvw.y);
        v.sort_by(f64::total_cmp);
        assert!((v[3] - v[0] - 3.5 / 5.0).abs() < 1e-12);
    }

    #[test]
    fn haze_has_the_opacity_that_is_asked_for_across_the_shell() {
        let recipe = "recipe = \"uniform\"\nsize = [2, 2, 8]\nalpha = 0\n";
        let folder = folder();
        std::fs::write(folder.path().join("fog.toml"), recipe).unwrap();
        for distance in ["", "opacity_distance = 0.7\n"] {
            let text = format!("{SCENE}{distance}haze = {{ alpha = 0.6, colour = [0.5, 0, 0] }}\n");
            let scene = parse("scene.toml", &text, folder.path()).unwrap().scene;
            let [red, .., alpha] = scene.volume.levels[0].texels[0].map(f64::from);
            let across = 1.0 - (1.0 - alpha).powf(0.1 / scene.medium.opacity_distance);
            assert!((across - 0.6).abs() < 1e-6, "{across}");
            assert!((red - 0.5 * alpha).abs() < 1e-6);
        }
    }

    /// What is replaced in [`SCENE`] by what, the spot that must be underlined, a part of the message.
    const CHANGES: &[[&str; 4]] = &[
        ["segments", "segmens", "segmens", "unknown key `segmens`"],
        ["\"torus\"", "\"tours\"", "\"tours\"", "unknown name `tours`"],
        ["= 8", "= 2", "2", "`segments` is 2"],
        ["= 8", "= \"x\"", "\"x\"", "expected a whole number"],
        ["generator = \"torus\"\nsegments = 8\nrings = 4", "", "[mesh]", "either `generator`"],
        ["segments", "file = 'x'\nsegments", "file", "unknown key `file`"],
        ["= 0.1", "= nan", "nan", "greater than 0"],
        ["= 0.1", "= -inf", "-inf", "greater than 0"],
        ["= 0.1", "= -1", "-1", "greater than 0"],
        ["= 0.1", "= 'thick'", "'thick'", "greater than 0"],
        ["thickness = 0.1", "", "[shell]", "missing key `thickness`"],
        ["[shell]\nthickness = 0.1", "", "", "missing key `shell`"],
        ["0.1", "0.1\nuv_scale = [1, nan]", "nan", "a finite number"],
        ["0.1", "0.1\nuv_scale = [1, 1, 1]", "[1, 1, 1]", "a list of 2"],
        ["0.1", "0.1\nsmoothing = 1.5", "1.5", "a whole number from 0"],
        ["recipe =", "file = 'x'\nrecipe =", "[volume]", "either `recipe`"],
        ["recipe =", "opacity_distance = 0\nrecipe =", "0", "greater than 0"],
        ["recipe =", "lod_footprint = -0.1\nrecipe =", "-0.1", "at least 0"],
        ["[volume]", "[volume", "", "unclosed table"],
        [
            "\"fog.toml\"",
            "\"fog.toml\"\ntransfer.points = [{ value = 0, colour = 'red', alpha = 1 }]",
            "'red'",
            "a colour",
        ],
    ];

    /// What is laid before [`SCENE`], the spot that must be underlined, a part of the message.
    const ADDITIONS: &[[&str; 3]] = &[
        ["[image]\nsize = [0, 9]", "0", "from 1 to 32768"],
        ["[image]\nsize = [9, 32769]", "32769", "from 1 to 32768"],
        ["[image]\nsize = [32768, 32768]", "[32768, 32768]", "2^28 pixels"],
        ["[image]\nbackground = [0, -1, 0]", "-1", "at least 0"],
        ["[image]\nbackground = '#12345'", "'#12345'", "a colour such as"],
        ["[image]\nbackground = [0, 1, 0, 1]", "[0, 1, 0, 1]", "a list of 3"],
        ["[march]\nplan = 'papr'", "'papr'", "`default`, `paper`, `exact`"],
        ["[march]\nsamples = 0", "0", "from 1 to 4096"],
        ["[march]\nno_skip = 'levels'", "'levels'", "expected a list, written [...]"],
        ["[light.sun]\ndirection = [0, -1, 0]", "light", "of tables, each headed [[...]]"],
        ["[march]\nstep = 0", "0", "from 0.001"],
        ["[camera]\neye = [0, 0, 1]", "[camera]", "missing key `target`"],
        ["[camera]\neye = [1, 2, 3]\ntarget = [1, 2, 3.0]", "[1, 2, 3.0]", "other than the eye"],
        ["[camera]\neye = [0, 2, 1]\ntarget = [0, 1, 1]", "[0, 1, 1]", "line of sight"],
        ["[camera]\neye = [0, 0, 1]\ntarget = [0, 0, 0]\nup = [0, 0, 9]", "[0, 0, 9]", "line of sight"],
        ["[camera]\neye = [0, 0, 1]\ntarget = [0, 0, 0]\nfov = 180", "180", "between 0 and 180"],
        ["[camera]\neye = [0, 0, 1]\ntarget = [0, 0, 0]\nnear = 0", "0", "greater than 0"],
        ["[shading]\nmodel = 'metal'", "'metal'", "`surface` or `fibre`"],
        ["[shading]\nambient = [0, -1, 0]", "-1", "at least 0"],
        ["[shading]\nspecular = -0.5", "-0.5", "at least 0"],
        ["[shading]\nshininess = 0.5", "0.5", "from 1 to 1000"],
        ["[shading]\nshine = 2", "shine", "unknown key `shine`"],
        ["[shading]\ntangents = 'x.ktx2'", "'x.ktx2'", "for the model \"fibre\""],
        ["[shading]\nmodel = 'fibre'\nnormals = 'x.ktx2'", "'x.ktx2'", "for the model \"surface\""],
        ["[shading]\nambient = [0, 0, 2e6]", "[shading]", "at most 1e6"],
        ["[[light]]\ndirection = [0, -1, 0]", "[[light]]", "needs a section [shading]"],
        ["[shading]\n[[light]]", "[[light]]", "either `direction`, or `position`"],
        ["[shading]\n[[light]]\ndirection = [0, 0, 0]", "[0, 0, 0]", "not be zero"],
        ["[shading]\n[[light]]\nposition = [0, 9, 0]\nfalloff = 0", "0", "greater than 0"],
        [
            "[shading]\n[[light]]\nposition = [0, 9, 0]\ndirection = [1, 0, 0]",
            "[[light]]",
            "either `direction`",
        ],
        ["[shading]\n[[light]]\ndirection = [0, 9, 0]\nfalloff = 1", "[[light]]", "without `falloff`"],
        ["[shading]\n[[light]]\ndirection = [0, 9, 0]\ncolor = 'white'", "color", "unknown key `color`"],
        [
            "[camera]\neye = [0, 0, 5]\ntarget = [0, 0, 0]\nnear = 0.5\n[shading]\n[[light]]\nposition = [0, 0.1, 5]",
            "[[light]]",
            "inside the camera",
        ],
    ];

    #[test]
    fn every_mistake_is_underlined() {
        let changes = CHANGES.iter().map(|[from, to, spot, part]| (SCENE.replacen(from, to, 1), spot, part));
        let additions = ADDITIONS.iter().map(|[added, spot, part]| (format!("{added}{SCENE}"), spot, part));
        for (text, spot, part) in changes.chain(additions) {
            assert_ne!(text, SCENE, "{part}");
            let error = parse("scene.toml", &text, folder().path()).map(drop).unwrap_err();
            assert_underlined(error, spot, part);
        }
    }

    #[test]
    fn lights_are_read() {
        let lit = "[shading]\nmodel = \"fibre\"\n[[light]]\ndirection = [0, -1e20, 0]\n[[light]]\nposition = [1, 2, 3]\n\
                   colour = [1, 0, 4]\nfalloff = 0.5\n";
        let folder = folder();
        let Loaded { scene, .. } = parse("scene.toml", &format!("{SCENE}{lit}"), folder.path()).unwrap();
        let shading = scene.shading.unwrap();
        assert_eq!(shading.model, Model::Fibre);
        assert_eq!((shading.diffuse, shading.specular, shading.shininess), (1.0, 0.2, 32.0));
        let position = DVec3::new(1.0, 2.0, 3.0);
        let expected = [
            Light { source: Source::Directional { towards: DVec3::Y }, colour: DVec3::ONE, shadow: false },
            Light {
                shadow: false,
                source: Source::Point { position, falloff: Some(0.5) },
                colour: DVec3::new(1.0, 0.0, 4.0),
            },
        ];
        assert_eq!(shading.lights, expected);
        let sizes = shading.directions.levels.iter().map(|level| level.size);
        assert!(sizes.eq(scene.volume.levels.iter().map(|level| level.size)));
        let light = "[[light]]\ndirection = [0, -1, 0]\n";
        let text = format!("{SCENE}[shading]\n{}", light.repeat(65));
        let error = parse("scene.toml", &text, folder.path()).map(drop).unwrap_err();
        assert!(error.to_string().contains("65 lights, expected at most 64"), "{error}");
        assert!(parse("scene.toml", &text.replacen(light, "", 1), folder.path()).is_ok());
        assert!(parse("scene.toml", SCENE, folder.path()).unwrap().scene.shading.is_none());
    }

    #[test]
    fn stored_normals_take_the_place_of_derived_ones() {
        let folder = folder();
        let lit = format!("{SCENE}[shading]\n");
        let directions = |text: &str| {
            parse("scene.toml", text, folder.path()).unwrap().scene.shading.unwrap().directions.levels.clone()
        };
        let derived = directions(&lit);
        let unweighted = derived[0].texels.iter().flat_map(|[x, y, z, w]| [x / w, y / w, z / w]);
        let raw = RawVolume {
            path: PathBuf::new(),
            format: String::new(),
            size: [4; 3],
            channels: 3,
            values: unweighted.map(|x| if x.is_finite() { -2.0 * x } else { 0.0 }).collect(),
            full_scale: 1.0,
            alpha_mode: AlphaMode::Straight,
        };
        volume::write_raw(&folder.path().join("n.ktx2"), &raw, Sample::Float32).unwrap();
        let stored = directions(&format!("{lit}normals = 'n.ktx2'"));
        // Turned about, so that it is known who they are; rounded to f32 once more.
        for (stored, derived) in stored.iter().zip(&derived) {
            for ([a, b, c, d], [x, y, z, w]) in stored.texels.iter().zip(&derived.texels) {
                let apart = [a + x, b + y, c + z, d - w];
                assert!(apart.iter().all(|apart| apart.abs() < 1e-6), "{apart:?}");
            }
        }
        assert!(derived[0].texels.iter().any(|texel| texel[3] > 0.1));
    }

    #[test]
    fn stored_normals_must_fit_the_volume() {
        let folder = folder();
        let volume = Volume::new([4, 4, 2], vec![[0.5; 4]; 32]).unwrap();
        volume::write_volume(&folder.path().join("n.ktx2"), &volume).unwrap();
        let text = format!("{SCENE}[shading]\nnormals = 'n.ktx2'");
        let error = parse("scene.toml", &text, folder.path()).map(drop).unwrap_err();
        assert_eq!(error.exit_code(), 3);
        let message = error.to_string();
        assert!(message.contains("n.ktx2: holds 4 x 4 x 2 directions"), "{message}");
        assert!(message.contains("the volume has 4 x 4 x 4 texels"), "{message}");
    }

    #[test]
    fn a_bad_override_is_blamed_itself() {
        let mistakes = [
            ("shell.thickness=-1", "greater than 0"),
            ("shell.thickness=thick", "greater than 0"),
            ("shel.thickness=1", "unknown key `shel`"),
            ("mesh.segments=2", "`segments` is 2"),
            ("mesh.generator=tours", "unknown name `tours`"),
            ("shell.thickness", "no `=`"),
            ("shell=1", "is a section"),
            ("shell.thickness.x=1", "is a value"),
            ("image.size=[1, 2", "unclosed array"),
            ("mesh.file=", "value"),
            ("[shell]\nthickness=1", "not a dotted key"),
            ("camera.eye=[0,0,1]", "missing key `target`"),
            ("image.background=#12345", "a colour such as"),
            ("march.no_skip=1", "expected a list"),
        ];
        for (text, part) in mistakes {
            // One that is right stands before, so that blame must find its way.
            let error = loaded(&["march.step=0.25", text, "image.size=[9, 9]"]).map(drop).unwrap_err();
            let message = error.to_string();
            assert!(matches!(error, Error::Usage { .. }), "{text}: {message}");
            assert!(message.starts_with(&format!("-D {text}: ")) && message.contains(part), "{message}");
        }
    }

    #[test]
    fn sizes_are_admitted_before_anything_is_built() {
        let folder = folder();
        // A recipe that would be computed for minutes, beside a mesh that is not even there.
        std::fs::write(folder.path().join("fog.toml"), "recipe = \"fog\"\nsize = [2048, 512, 128]\n")
            .unwrap();
        let mesh = "generator = \"torus\"\nsegments = 8\nrings = 4";
        let text = Text::new("scene.toml", SCENE.replace(mesh, "file = 'nowhere.obj'"), &[]).unwrap();
        let refuse = |sizes: &Sizes| {
            assert_eq!(*sizes, Sizes { picture: [512, 512], volume: [2048, 512, 128] });
            Err(Error::Interrupted)
        };
        assert!(matches!(build(text, folder.path(), &Silent, &refuse), Err(Error::Interrupted)));
    }

    #[test]
    fn a_texture_too_fine_to_resolve_is_blamed_on_who_made_it() {
        let folder = folder();
        let told = |text: &str, overrides: &[String], parts: &[&str]| {
            let text = Text::new("scene.toml", text.to_owned(), overrides).unwrap();
            let error = build(text, folder.path(), &Silent, &|_| Ok(())).map(drop).unwrap_err();
            let report = format!("{:?}", miette::Report::new_boxed(Box::new(error)));
            for part in parts.iter().chain(&["texels along u", "shell.uv_scale", "texture coordinates"]) {
                assert!(report.contains(part), "{report}");
            }
        };
        let scaled = SCENE.replace("0.1", "0.1\nuv_scale = [1e30, 1]");
        told(&scaled, &[], &["[1e30, 1]", "1048576"]);
        told(SCENE, &["shell.uv_scale=[1e30, 1]".to_owned()], &["-D shell.uv_scale", "1048576"]);
        let mesh = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1e9 0\nvt 0 1\nf 1/1 2/2 3/3\n";
        std::fs::write(folder.path().join("wild.obj"), mesh).unwrap();
        let generator = "generator = \"torus\"\nsegments = 8\nrings = 4";
        told(&SCENE.replace(generator, "file = 'wild.obj'"), &[], &["wild.obj", "triangle 0", "1048576"]);
    }

    #[test]
    fn a_mistake_in_the_file_is_not_blamed_on_an_override() {
        let text = Text::new("scene.toml", SCENE.replace("0.1", "0"), &["mesh.rings=9".to_owned()]).unwrap();
        assert!(matches!(build(text, folder().path(), &Silent, &|_| Ok(())), Err(Error::Text { .. })));
    }

    #[test]
    fn files_that_a_scene_names_are_named_in_errors() {
        let generator = "generator = \"torus\"\nsegments = 8\nrings = 4";
        let scenes = [
            (SCENE.replace("fog.toml", "nowhere.toml"), "nowhere.toml"),
            (SCENE.replace("recipe = \"fog.toml\"", "file = \"nowhere.nrrd\""), "nowhere.nrrd"),
            (SCENE.replace(generator, "file = \"nowhere.obj\""), "nowhere.obj"),
        ];
        for (scene, file) in scenes {
            let error = parse("scene.toml", &scene, folder().path()).map(drop).unwrap_err();
            assert_eq!(error.exit_code(), 3);
            assert!(error.to_string().contains(file), "{error}");
        }
    }
}
