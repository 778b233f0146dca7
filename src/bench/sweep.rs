//! The sweep: which scenes are measured, with which methods, at which levels of quality. It is a small TOML file, whose
//! keys `docs/bench.md` lists, or is put together by hand.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use toml::Spanned;

use crate::fingerprint::Fingerprint;
use crate::method::{self, METHODS};
use crate::scene::March;
use crate::scene::text::Text;
use crate::value::{ErrorEvery, PictureSize, Runs, Samples, Step};
use crate::{Error, Result, input};

/// What is measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Sweep {
    /// The sweep file, or `"scenes"` where there is none.
    pub name: String,
    /// Scene files, relative to the working directory.
    pub scenes: Vec<PathBuf>,
    /// Laid over every scene, each `section.key=value`.
    pub define: Vec<String>,
    /// Width and height instead of the scenes' own, in pixels.
    pub size: Option<[u32; 2]>,
    /// Errors are those of one pixel of every square of so many by so many: the reference takes as much less time.
    #[serde(default = "all_pixels", skip_serializing_if = "is_all_pixels")]
    pub error_every: u32,
    /// What is measured of each scene: every method at every level of quality.
    pub settings: Vec<Setting>,
    /// And every method by the paper's plan with as many samples as each scene's `march.samples` says.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub paper_of_scene: bool,
    /// Timed frames of each point, at least 1; one more comes first and does not count.
    pub runs: u32,
}

/// A method at one level of quality.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Setting {
    /// A name of [`METHODS`].
    pub method: String,
    /// The plan and its level.
    #[serde(flatten)]
    pub march: March,
}

/// The levels of quality of each plan.
#[derive(Debug, Clone, PartialEq)]
pub struct Levels {
    /// [`March::Default`]: steps in texels.
    pub steps: Vec<f64>,
    /// [`March::Paper`]: samples in each tetrahedron.
    pub samples: Vec<u32>,
    /// Whether [`March::Paper`] is measured with as many as each scene says, too.
    pub paper_of_scene: bool,
    /// Whether [`March::Exact`], which has no levels, is measured too.
    pub exact: bool,
}

impl Default for Levels {
    /// Five steps, each half of the one before; the other plans are left out.
    fn default() -> Self {
        let steps = vec![2.0, 1.0, 0.5, 0.25, 0.125];
        Self { steps, samples: Vec::new(), paper_of_scene: false, exact: false }
    }
}

impl Levels {
    /// Whether they are within the ranges of a scene file, and there is one.
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub fn check(&self) -> Result<()> {
        let usage = |message: String| Err(Error::Usage { message, help: None });
        if let Some(step) = self.steps.iter().find(|step| !(0.001..=1000.0).contains(*step)) {
            return usage(format!("a step of {step} is none, expected a number from 0.001 to 1000"));
        }
        if let Some(samples) = self.samples.iter().find(|samples| !(1..=4096).contains(*samples)) {
            return usage(format!(
                "{samples} samples are impossible, expected a whole number from 1 to 4096"
            ));
        }
        if self.steps.is_empty() && self.samples.is_empty() && !self.exact {
            return usage("there is nothing to measure: no level of any plan is given".to_owned());
        }
        Ok(())
    }
}

impl Setting {
    /// The plan's name in a scene file.
    pub fn plan(&self) -> &'static str {
        match self.march {
            March::Default { .. } => "default",
            March::Paper { .. } => "paper",
            March::Exact => "exact",
        }
    }

    /// The level within the plan, for people: `"step 0.5"`.
    pub fn level(&self) -> String {
        match self.march {
            March::Default { step } => format!("step {step}"),
            March::Paper { samples: 1 } => "1 sample".to_owned(),
            March::Paper { samples } => format!("{samples} samples"),
            March::Exact => "exact".to_owned(),
        }
    }

    /// The distance between samples in the plan's own unit, a texel or a ray's part in a tetrahedron: the error falls
    /// with a power of it. It is 1 for a plan without levels.
    pub fn spacing(&self) -> f64 {
        match self.march {
            March::Default { step } => step,
            March::Paper { samples } => 1.0 / f64::from(samples),
            March::Exact => 1.0,
        }
    }

    /// Whether both are points of one curve: the same method with the same plan.
    pub fn shares_curve(&self, other: &Self) -> bool {
        self.method == other.method && self.plan() == other.plan()
    }
}

/// A sweep file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SweepFile {
    scenes: Spanned<Vec<PathBuf>>,
    methods: Option<Spanned<Vec<Spanned<String>>>>,
    plans: Spanned<Plans>,
    size: Option<PictureSize>,
    #[serde(default = "of_all_pixels")]
    error_every: ErrorEvery,
    #[serde(default = "five_runs")]
    runs: Runs,
    #[serde(default)]
    define: Vec<String>,
}

/// `[plans]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Plans {
    #[serde(default)]
    default: Vec<Step>,
    #[serde(default)]
    paper: Vec<Samples>,
    #[serde(default)]
    paper_of_scene: bool,
    #[serde(default)]
    exact: bool,
}

fn all_pixels() -> u32 {
    1
}

fn of_all_pixels() -> ErrorEvery {
    ErrorEvery(all_pixels())
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for it")]
fn is_all_pixels(every: &u32) -> bool {
    *every == all_pixels()
}

fn five_runs() -> Runs {
    Runs(5)
}

impl Sweep {
    /// Those scenes as they are, each method at each of the levels, three timed frames.
    pub fn of_scenes(scenes: &[PathBuf], methods: &[&str], levels: &Levels) -> Self {
        Self {
            name: "scenes".to_owned(),
            scenes: scenes.to_owned(),
            define: Vec::new(),
            size: None,
            error_every: all_pixels(),
            settings: settings(methods, levels),
            paper_of_scene: levels.paper_of_scene,
            runs: 3,
        }
    }

    /// Reads a sweep file.
    ///
    /// # Errors
    /// [`Error::Input`] for a file that cannot be read, else as [`parse`](Self::parse).
    pub fn load(path: &Path) -> Result<Self> {
        read(path, Self::parse)
    }

    /// Reads a sweep from a text: `name` is what errors call it, `base_dir` where its scenes' paths start.
    ///
    /// # Errors
    /// [`Error::Text`] with the spot.
    pub fn parse(name: &str, text: String, base_dir: &Path) -> Result<Self> {
        let text = Text::new(name, text, &[])?;
        let file: SweepFile = text.parse_plain()?;
        if file.scenes.get_ref().is_empty() {
            return Err(text.error(file.scenes.span(), "`scenes` is empty, expected at least one scene file"));
        }
        let levels = Levels {
            steps: file.plans.get_ref().default.iter().map(|step| step.0).collect(),
            samples: file.plans.get_ref().paper.iter().map(|samples| samples.0).collect(),
            paper_of_scene: file.plans.get_ref().paper_of_scene,
            exact: file.plans.get_ref().exact,
        };
        if levels.steps.is_empty() && levels.samples.is_empty() && !levels.exact {
            let message = "[plans] has no level, expected steps under `default`, samples under `paper`, or `exact = true`";
            return Err(text.error(file.plans.span(), message));
        }
        let methods: Vec<&str> = match &file.methods {
            None => vec![METHODS[0].name],
            Some(methods) if methods.get_ref().is_empty() => {
                return Err(text.error(methods.span(), "`methods` is empty, expected at least one method"));
            }
            Some(methods) => methods
                .get_ref()
                .iter()
                .map(|method| match measurable(method.get_ref()) {
                    Ok(()) => Ok(method.get_ref().as_str()),
                    Err(message) => Err(text.error(method.span(), message)),
                })
                .collect::<Result<_>>()?,
        };
        Ok(Self {
            name: name.to_owned(),
            scenes: file.scenes.get_ref().iter().map(|scene| base_dir.join(scene)).collect(),
            define: file.define,
            size: file.size.map(|size| size.0.map(|side| side.0)),
            error_every: file.error_every.0,
            settings: settings(&methods, &levels),
            paper_of_scene: levels.paper_of_scene,
            runs: file.runs.0,
        })
    }

    /// What is measured of a scene that says so many samples for the paper's plan.
    pub fn settings_of(&self, samples: u32) -> Vec<Setting> {
        let mut settings = self.settings.clone();
        if self.paper_of_scene {
            let march = March::Paper { samples };
            for setting in &self.settings {
                let own = Setting { method: setting.method.clone(), march };
                if !settings.contains(&own) {
                    settings.push(own);
                }
            }
        }
        settings
    }

    /// Of all that makes two sweeps' results comparable point by point: that they are one sweep.
    pub fn fingerprint(&self) -> Fingerprint {
        let json = serde_json::to_vec(self).expect("numbers, strings and lists");
        Fingerprint::builder("sweep").bytes(&json).finish()
    }
}

/// Reads a sweep file of any kind: `parse` is told its name, its text, and where its paths start.
pub(super) fn read<T>(path: &Path, parse: impl FnOnce(&str, String, &Path) -> Result<T>) -> Result<T> {
    let text = input::text(path).map_err(|error| {
        Error::input(path, format!("the sweep file cannot be read: {error}"))
            .with_help("check the path, or write the sweep that docs/bench.md describes")
    })?;
    parse(&path.display().to_string(), text, path.parent().unwrap_or(Path::new("")))
}

/// Whether a file is meant to be a sweep, not a scene.
pub fn is_sweep(path: &Path) -> bool {
    input::text(path).is_ok_and(|text| looks_like_sweep(&text))
}

/// By the keys that only a sweep has.
fn looks_like_sweep(text: &str) -> bool {
    toml::de::DeTable::parse(text).is_ok_and(|table| {
        ["scenes", "plans", "series"].iter().any(|&key| table.get_ref().get(key).is_some())
    })
}

/// What is laid over every scene of a sweep: its size, then its own values.
pub(super) fn overrides(size: Option<[u32; 2]>, define: &[String]) -> Vec<String> {
    let size = size.map(|[width, height]| format!("image.size=[{width}, {height}]"));
    size.into_iter().chain(define.iter().cloned()).collect()
}

/// Every method at every level, plan by plan.
fn settings(methods: &[&str], levels: &Levels) -> Vec<Setting> {
    let steps = levels.steps.iter().map(|&step| March::Default { step });
    let samples = levels.samples.iter().map(|&samples| March::Paper { samples });
    let marches: Vec<March> = steps.chain(samples).chain(levels.exact.then_some(March::Exact)).collect();
    let of_method = |method| marches.iter().map(move |&march| (method, march));
    let pairs = methods.iter().flat_map(of_method);
    pairs.map(|(&method, march)| Setting { method: method.to_owned(), march }).collect()
}

/// Every method has an error but the one that errors are measured against.
fn measurable(name: &str) -> Result<(), String> {
    let names: Vec<&str> =
        METHODS.iter().map(|entry| entry.name).filter(|&name| name != "reference").collect();
    let expected = names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(" or ");
    match method::by_name(name) {
        Some(_) if names.contains(&name) => Ok(()),
        Some(_) => Err(format!("`{name}` is what the others are compared with, expected {expected}")),
        None => Err(format!("unknown method `{name}`, expected {expected}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::text::tests::assert_underlined;

    const SWEEP: &str = "\
scenes = ['a.toml', '../b.toml']
methods = ['shell']
size = [64, 32]
error_every = 2
runs = 2
define = ['shell.thickness=0.1']

[plans]
default = [1, 0.5]
paper = [4]
exact = true
";

    fn parse(text: &str) -> Result<Sweep> {
        Sweep::parse("sweep.toml", text.to_owned(), Path::new("benches"))
    }

    #[test]
    fn a_sweep_is_read() {
        let sweep = parse(SWEEP).unwrap();
        assert_eq!(sweep.scenes, [Path::new("benches/a.toml"), Path::new("benches/../b.toml")]);
        assert_eq!((sweep.size, sweep.runs, sweep.error_every), (Some([64, 32]), 2, 2));
        let marches = [
            March::Default { step: 1.0 },
            March::Default { step: 0.5 },
            March::Paper { samples: 4 },
            March::Exact,
        ];
        let expected = marches.map(|march| Setting { method: "shell".to_owned(), march });
        assert_eq!(sweep.settings, expected);
    }

    #[test]
    fn each_scene_may_say_the_papers_samples() {
        let sweep = parse(&SWEEP.replace("paper = [4]", "paper = [4]\npaper_of_scene = true")).unwrap();
        let of_paper = |samples| {
            let settings = sweep.settings_of(samples);
            let samples = |setting: &Setting| match setting.march {
                March::Paper { samples } => Some(samples),
                _ => None,
            };
            (settings.len(), settings.iter().filter_map(samples).collect::<Vec<_>>())
        };
        assert_eq!(of_paper(4), (4, vec![4]));
        assert_eq!(of_paper(15), (5, vec![4, 15]));
        assert_eq!(parse(SWEEP).unwrap().settings_of(15).len(), 4);
    }

    #[test]
    fn what_is_left_out_has_its_default() {
        let sweep = parse("scenes = ['a.toml']\nplans = { default = [1] }").unwrap();
        assert_eq!((sweep.size, sweep.runs, sweep.error_every, sweep.define.len()), (None, 5, 1, 0));
        assert_eq!(
            sweep.settings,
            [Setting { method: "shell".to_owned(), march: March::Default { step: 1.0 } }]
        );
    }

    /// What is replaced in [`SWEEP`] by what, the spot that must be underlined, a part of the message.
    const MISTAKES: &[[&str; 4]] = &[
        ["scenes", "scnes", "scnes", "unknown key `scnes`"],
        ["scenes = ['a.toml', '../b.toml']", "", "", "missing key `scenes`"],
        ["['a.toml', '../b.toml']", "[]", "[]", "at least one scene"],
        ["['shell']", "[]", "[]", "at least one method"],
        ["'shell'", "'shall'", "'shall'", "unknown method `shall`"],
        ["'shell'", "'reference'", "'reference'", "compared with"],
        ["[64, 32]", "[64]", "[64]", "a list of 2"],
        ["[64, 32]", "[64, 0]", "0", "from 1 to 32768"],
        ["every = 2", "every = 0", "0", "from 1 to 64"],
        ["runs = 2", "runs = 0", "0", "from 1 to 1000"],
        ["paper = [4]", "papers = [4]", "papers", "unknown key `papers`"],
        ["paper = [4]", "paper_of_scene = 4", "4", "true or false"],
        ["[4]", "[4, 0]", "0", "from 1 to 4096"],
        ["0.5]", "-0.5]", "-0.5", "from 0.001"],
        ["default = [1, 0.5]\npaper = [4]\nexact = true", "exact = false", "[plans]", "steps under"],
        ["[plans]", "[plans", "", "unclosed table"],
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
    fn every_change_changes_the_fingerprint() {
        let print = |text: &str| parse(text).unwrap().fingerprint();
        assert_eq!(print(SWEEP), print(&format!("# The same.\n{SWEEP}")));
        for (from, to) in [
            ("a.toml", "c.toml"),
            ("64", "65"),
            ("every = 2", "every = 1"),
            ("runs = 2", "runs = 3"),
            ("0.5", "0.51"),
            ("0.1", "0.2"),
        ] {
            assert_ne!(print(SWEEP), print(&SWEEP.replacen(from, to, 1)), "{to}");
        }
    }

    #[test]
    fn scenes_and_sweeps_are_told_apart() {
        assert!(looks_like_sweep(SWEEP));
        assert!(looks_like_sweep(&SWEEP.replace("scenes", "scnes")));
        assert!(!looks_like_sweep("[mesh]\ngenerator = 'torus'"));
        assert!(!looks_like_sweep("[mesh"));
    }

    #[test]
    fn the_default_sweep_is_one() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/default.toml");
        let sweep = Sweep::load(&path).unwrap();
        assert_eq!((sweep.scenes.len(), sweep.settings.len()), (3, 11));
        assert!(sweep.scenes.iter().all(|scene| scene.is_file()));
    }
}
