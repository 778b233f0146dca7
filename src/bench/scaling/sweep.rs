//! The sweep file of a benchmark of scaling: one with `[[series]]`. `docs/bench.md` lists its keys.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use toml::Spanned;

use crate::bench::sweep::read;
use crate::scene::text::Text;
use crate::value::Runs;
use crate::{Result, input};

/// What is measured.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Sweep {
    /// The sweep file.
    pub name: String,
    /// Timed frames of each size; one more comes first and does not count.
    pub runs: u32,
    /// Laid over every scene, each `section.key=value`.
    pub define: Vec<String>,
    /// At least one.
    pub series: Vec<Series>,
}

/// One scene at several sizes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Series {
    /// For people.
    pub name: String,
    /// What is called its size.
    pub of: Measure,
    /// The scene file, relative to the working directory.
    pub scene: PathBuf,
    /// Laid over the scene at each size, each `section.key=value`; at least two sizes.
    pub sizes: Vec<Vec<String>>,
}

/// What a scene has more or less of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Measure {
    /// Of the shell.
    Tetrahedra,
    /// Of the picture.
    Pixels,
    /// Of the full volume.
    Texels,
}

impl Measure {
    /// As the sweep file has it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tetrahedra => "tetrahedra",
            Self::Pixels => "pixels",
            Self::Texels => "texels",
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SweepFile {
    #[serde(default = "three_runs")]
    runs: Runs,
    #[serde(default)]
    define: Vec<String>,
    series: Spanned<Vec<SeriesSection>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SeriesSection {
    name: String,
    of: Measure,
    scene: PathBuf,
    #[serde(default)]
    define: Vec<String>,
    sizes: Spanned<Vec<Vec<String>>>,
}

fn three_runs() -> Runs {
    Runs(3)
}

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
        let text = Text::new(name, text, &[])?;
        let SweepFile { runs, define, series } = text.parse_plain()?;
        if series.get_ref().is_empty() {
            return Err(
                text.error(series.span(), "there is nothing to measure, expected at least one [[series]]")
            );
        }
        let series = series.into_inner().into_iter().map(|SeriesSection { name, of, scene, define, sizes }| {
            if sizes.get_ref().len() < 2 {
                let message = "nothing grows in less than two `sizes`, expected a list of lists of \"section.key=value\"";
                return Err(text.error(sizes.span(), message));
            }
            let with = |size: Vec<String>| define.iter().cloned().chain(size).collect();
            let sizes = sizes.into_inner().into_iter().map(with).collect();
            Ok(Series { name, of, scene: base_dir.join(scene), sizes })
        });
        Ok(Self { name: name.to_owned(), runs: runs.0, define, series: series.collect::<Result<_>>()? })
    }
}

/// Whether a file is meant to be such a sweep.
pub fn is_scaling(path: &Path) -> bool {
    input::text(path).is_ok_and(|text| looks_like_scaling(&text))
}

fn looks_like_scaling(text: &str) -> bool {
    toml::de::DeTable::parse(text).is_ok_and(|table| table.get_ref().get("series").is_some())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::text::tests::assert_underlined;

    const SWEEP: &str = "\
runs = 2
define = ['image.size=[8, 8]']

[[series]]
name = 'finer'
of = 'tetrahedra'
scene = '../a.toml'
define = ['march.step=2']
sizes = [['mesh.segments=8'], ['mesh.segments=16']]
";

    fn parse(text: &str) -> Result<Sweep> {
        Sweep::parse("sweep.toml", text.to_owned(), Path::new("benches"))
    }

    #[test]
    fn a_sweep_is_read() {
        let sweep = parse(SWEEP).unwrap();
        assert_eq!((sweep.runs, sweep.define.len()), (2, 1));
        let [series] = sweep.series.as_slice() else { panic!("{sweep:?}") };
        assert_eq!(
            (series.of, series.scene.as_path()),
            (Measure::Tetrahedra, Path::new("benches/../a.toml"))
        );
        assert_eq!(series.sizes[1], ["march.step=2", "mesh.segments=16"]);
        assert!(looks_like_scaling(SWEEP) && !looks_like_scaling("[plans]"));
    }

    #[test]
    fn every_mistake_is_underlined() {
        for [from, to, spot, part] in [
            ["runs", "rums", "rums", "unknown key `rums`"],
            ["runs = 2", "runs = 0", "0", "from 1 to 1000"],
            ["'tetrahedra'", "'triangles'", "'triangles'", "texels"],
            ["of =", "off =", "off", "unknown key `off`"],
            [
                "[['mesh.segments=8'], ['mesh.segments=16']]",
                "[['mesh.segments=8']]",
                "[['mesh.segments=8']]",
                "two",
            ],
        ] {
            let text = SWEEP.replacen(from, to, 1);
            assert_ne!(text, SWEEP, "{from}");
            assert_underlined(parse(&text).unwrap_err(), spot, part);
        }
    }

    #[test]
    fn without_series_there_is_nothing_to_measure() {
        assert_underlined(parse("series = []").unwrap_err(), "[]", "at least one [[series]]");
    }

    #[test]
    fn the_suite_is_one() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let sweep = Sweep::load(&root.join("benches/scaling.toml")).unwrap();
        assert!(sweep.series.iter().all(|series| series.scene.is_file() && series.sizes.len() >= 5));
        for measure in [Measure::Tetrahedra, Measure::Pixels, Measure::Texels] {
            assert!(sweep.series.iter().any(|series| series.of == measure), "{}", measure.name());
        }
    }
}
