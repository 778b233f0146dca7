//! The sweep file of a benchmark of antialiasing: one with a section `[antialiasing]`. `docs/bench.md` lists its keys.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use toml::Spanned;

use crate::bench::sweep::read;
use crate::scene::text::Text;
use crate::value::{PictureSize, Positive, Samples, Step};
use crate::volume::Filter;
use crate::{Result, input};

/// What is measured.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Sweep {
    /// The sweep file.
    pub name: String,
    /// Scene files, relative to the working directory.
    pub scenes: Vec<PathBuf>,
    /// Laid over every scene, each `section.key=value`.
    pub define: Vec<String>,
    /// Width and height at distance 1 instead of the scenes' own, in pixels.
    pub size: Option<[u32; 2]>,
    /// How many times as far from its target the eye is as in the scene; at least 1.
    pub distances: Vec<f64>,
    /// Of each pixel of the reference; a square number.
    pub rays: u32,
    /// The filters that are compared.
    pub filters: Vec<Filter>,
    /// Of the march, in texels.
    pub step: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SweepFile {
    scenes: Spanned<Vec<PathBuf>>,
    size: Option<PictureSize>,
    #[serde(default)]
    define: Vec<String>,
    antialiasing: Antialiasing,
}

/// `[antialiasing]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Antialiasing {
    distances: Spanned<Vec<Spanned<Positive>>>,
    #[serde(default)]
    rays: Option<Spanned<Samples>>,
    filters: Option<Spanned<Vec<Filter>>>,
    #[serde(default = "an_eighth")]
    step: Step,
}

fn an_eighth() -> Step {
    Step(0.125)
}

/// Rays of a pixel where nothing else is said.
const RAYS: u32 = 64;

impl Sweep {
    /// Reads a sweep file.
    ///
    /// # Errors
    /// [`Error::Input`](crate::Error::Input) for a file that cannot be read, else as [`parse`](Self::parse).
    pub fn load(path: &Path) -> Result<Self> {
        read(path, Self::parse)
    }

    /// Reads a sweep from a text: `name` is what errors call it, `base_dir` where its paths start.
    ///
    /// # Errors
    /// [`Error::Text`](crate::Error::Text), with the spot.
    pub fn parse(name: &str, text: String, base_dir: &Path) -> Result<Self> {
        let plans = span_of_section(&text, "plans");
        let text = Text::new(name, text, &[])?;
        if let Some(span) = plans {
            let message = "[plans] is another benchmark's, expected [antialiasing] alone";
            return Err(text.error(span, message));
        }
        let SweepFile { scenes, size, define, antialiasing } = text.parse_plain()?;
        let Antialiasing { distances, rays, filters, step } = antialiasing;
        let empty = |span, what: &str| {
            Err(text.error(span, format!("there is nothing to measure, expected at least one {what}")))
        };
        if scenes.get_ref().is_empty() {
            return empty(scenes.span(), "scene");
        }
        if distances.get_ref().is_empty() {
            return empty(distances.span(), "distance");
        }
        if let Some(filters) = filters.as_ref().filter(|filters| filters.get_ref().is_empty()) {
            return empty(filters.span(), "filter");
        }
        if let Some(near) = distances.get_ref().iter().find(|distance| distance.get_ref().0 < 1.0) {
            let message = "the eye comes nearer than in the scene, expected a distance of at least 1";
            return Err(text.error(near.span(), message));
        }
        if let Some(rays) = rays.as_ref().filter(|rays| rays.get_ref().0.isqrt().pow(2) != rays.get_ref().0) {
            let message = format!("{} rays make no square, expected 1, 4, 9, 16, ...", rays.get_ref().0);
            return Err(text.error(rays.span(), message));
        }
        Ok(Self {
            name: name.to_owned(),
            scenes: scenes.get_ref().iter().map(|scene| base_dir.join(scene)).collect(),
            define,
            size: size.map(|size| size.0.map(|side| side.0)),
            distances: distances.get_ref().iter().map(|distance| distance.get_ref().0).collect(),
            rays: rays.map_or(RAYS, |rays| rays.get_ref().0),
            filters: filters.map_or(Filter::ALL.to_vec(), Spanned::into_inner),
            step: step.0,
        })
    }
}

/// Whether a file is a sweep of this kind.
pub fn is_antialiasing(path: &Path) -> bool {
    input::text(path).is_ok_and(|text| looks_like_antialiasing(&text))
}

fn looks_like_antialiasing(text: &str) -> bool {
    span_of_section(text, "antialiasing").is_some()
}

fn span_of_section(text: &str, section: &str) -> Option<std::ops::Range<usize>> {
    Some(toml::de::DeTable::parse(text).ok()?.get_ref().get(section)?.span())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::text::tests::assert_underlined;

    const SWEEP: &str = "\
scenes = ['a.toml']
size = [64, 32]
define = ['shell.thickness=0.1']

[antialiasing]
distances = [1, 2.5]
rays = 16
filters = ['paper', 'directional']
step = 0.25
";

    fn parse(text: &str) -> Result<Sweep> {
        Sweep::parse("sweep.toml", text.to_owned(), Path::new("benches"))
    }

    #[test]
    fn a_sweep_is_read() {
        let expected = Sweep {
            name: "sweep.toml".to_owned(),
            scenes: vec!["benches/a.toml".into()],
            define: vec!["shell.thickness=0.1".to_owned()],
            size: Some([64, 32]),
            distances: vec![1.0, 2.5],
            rays: 16,
            filters: vec![Filter::Paper, Filter::Directional],
            step: 0.25,
        };
        assert_eq!(parse(SWEEP).unwrap(), expected);
        let least = parse("scenes = ['a.toml']\nantialiasing = { distances = [1] }").unwrap();
        assert_eq!((least.rays, least.step, least.filters.as_slice()), (64, 0.125, Filter::ALL.as_slice()));
        assert!(
            looks_like_antialiasing(SWEEP)
                && !looks_like_antialiasing("scenes = ['a.toml']\n[plans]\ndefault = [1]")
        );
    }

    /// What is replaced in [`SWEEP`] by what, the spot that must be underlined, a part of the message.
    const MISTAKES: &[[&str; 4]] = &[
        ["scenes", "scnes", "scnes", "unknown key `scnes`"],
        ["['a.toml']", "[]", "[]", "at least one scene"],
        ["[64, 32]", "[64, 0]", "0", "from 1 to 32768"],
        ["rays", "ryas", "ryas", "unknown key `ryas`"],
        ["rays = 16", "rays = 17", "17", "no square"],
        ["rays = 16", "rays = 0", "0", "from 1 to 4096"],
        ["[1, 2.5]", "[]", "[]", "at least one distance"],
        ["2.5", "0.5", "0.5", "at least 1"],
        ["distances = [1, 2.5]", "", "[antialiasing]", "missing key `distances`"],
        ["['paper', 'directional']", "[]", "[]", "at least one filter"],
        ["'paper'", "'papre'", "'papre'", "unknown name `papre`"],
        ["0.25", "0", "0", "from 0.001"],
        ["step = 0.25\n", "[plans]\ndefault = [1]", "[plans]", "another benchmark's"],
    ];

    #[test]
    fn every_mistake_is_underlined() {
        for [from, to, spot, part] in MISTAKES {
            let text = SWEEP.replacen(from, to, 1);
            assert_ne!(text, SWEEP, "{from}");
            assert_underlined(parse(&text).unwrap_err(), spot, part);
        }
    }

    #[test]
    fn the_sweep_of_the_readme_is_one() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches");
        let text = std::fs::read_to_string(folder.join("antialiasing.toml")).unwrap();
        let sweep = Sweep::parse("antialiasing.toml", text, &folder).unwrap();
        assert_eq!((sweep.distances.len(), sweep.rays), (5, 64));
        assert!(sweep.filters == Filter::ALL && sweep.scenes.iter().all(|scene| scene.is_file()));
    }
}
