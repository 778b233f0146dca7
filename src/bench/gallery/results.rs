//! What a gallery found: what `--json` prints, which `docs/gallery.md` describes key by key.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::about::About;
use crate::bench::Environment;
use crate::frame::Report;
use crate::metric::Metrics;
use crate::scene::Scene;

/// Of [`Results::schema`].
pub const SCHEMA: u32 = 1;

/// The largest RMSE at which a scene passes.
const BOUND: f64 = 5e-3;
/// The same of a scene in which a light casts shadows: they are read from pictures of finite size.
const BOUND_WITH_SHADOWS: f64 = 1e-2;

/// All scenes.
#[derive(Debug, Clone, Serialize)]
pub struct Results {
    /// 1; another number where keys have another meaning.
    pub schema: u32,
    /// On what it was measured.
    pub environment: Environment,
    /// In the order in which they were named.
    pub scenes: Vec<SceneResults>,
}

/// One scene.
#[derive(Debug, Clone, Serialize)]
pub struct SceneResults {
    /// The scene file.
    pub scene: PathBuf,
    /// The first sentence of its leading comment, else its name.
    pub title: String,
    /// The rest of that comment.
    pub description: String,
    /// How it stands.
    pub verdict: Verdict,
    /// Why it could not be rendered.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
    /// What came of it, if it was rendered.
    #[serde(flatten)]
    pub drawn: Option<Drawn>,
}

/// How a scene stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Its error is within its bound.
    Passed,
    /// Its error is above its bound.
    Failed,
    /// It was not compared.
    Unmeasured,
    /// It could not be rendered.
    Broken,
}

/// A scene that was rendered.
#[derive(Debug, Clone, Serialize)]
pub struct Drawn {
    /// The PNG, within the gallery's folder.
    pub picture: PathBuf,
    /// In pixels.
    pub width: u32,
    /// In pixels.
    pub height: u32,
    /// Of the shell.
    pub tetrahedra: u64,
    /// Wall time from the scene file to a method that is ready to render.
    pub load_milliseconds: f64,
    /// Wall time of the second frame, readback included.
    pub frame_milliseconds: f64,
    /// Of the second frame.
    pub report: Report,
    /// The largest RMSE at which it passes.
    pub bound: f64,
    /// How far it is from the reference, if it was compared.
    pub error: Option<Measured>,
}

/// The error of a scene.
#[derive(Debug, Clone, Serialize)]
pub struct Measured {
    /// Of both pictures, in pixels.
    pub width: u32,
    /// Of both pictures, in pixels.
    pub height: u32,
    /// Against the reference.
    #[serde(flatten)]
    pub metrics: Metrics,
    /// What the reference took to compute, whenever that was.
    pub reference_milliseconds: f64,
    /// Whether it came from the cache.
    pub reference_reused: bool,
}

impl SceneResults {
    /// A scene that could not be rendered.
    pub(super) fn broken(scene: &Path, about: About, failure: String) -> Self {
        let failure = Some(failure);
        Self { verdict: Verdict::Broken, failure, drawn: None, ..Self::of(scene, about) }
    }

    /// A scene that was.
    pub(super) fn drawn(scene: &Path, about: About, drawn: Drawn) -> Self {
        let verdict = match &drawn.error {
            None => Verdict::Unmeasured,
            // So that what is not a number does not pass.
            Some(error) if error.metrics.rmse <= drawn.bound => Verdict::Passed,
            Some(_) => Verdict::Failed,
        };
        Self { verdict, drawn: Some(drawn), ..Self::of(scene, about) }
    }

    fn of(scene: &Path, About { title, description }: About) -> Self {
        let title = title.unwrap_or_else(|| name(scene));
        Self {
            scene: scene.to_owned(),
            title,
            description,
            verdict: Verdict::Broken,
            failure: None,
            drawn: None,
        }
    }

    /// The scene's name for people: its file's, without the extension.
    pub fn name(&self) -> String {
        name(&self.scene)
    }

    /// The folder that it is in, by which scenes are grouped.
    pub fn group(&self) -> String {
        let folder = self.scene.parent().map(|folder| folder.display().to_string()).unwrap_or_default();
        if folder.is_empty() { ".".to_owned() } else { folder }
    }
}

impl Results {
    /// Scenes of one folder that follow one another, with that folder.
    pub fn groups(&self) -> impl Iterator<Item = (String, &[SceneResults])> {
        let groups = self.scenes.chunk_by(|a, b| a.scene.parent() == b.scene.parent());
        groups.map(|scenes| (scenes[0].group(), scenes))
    }
}

impl Verdict {
    /// For people.
    pub fn told(self) -> &'static str {
        match self {
            Self::Passed => "pass",
            Self::Failed => "FAIL",
            Self::Unmeasured => "not compared",
            Self::Broken => "BROKEN",
        }
    }
}

/// The largest RMSE at which a scene passes.
pub(super) fn bound(scene: &Scene) -> f64 {
    if scene.casts_shadows() { BOUND_WITH_SHADOWS } else { BOUND }
}

fn name(scene: &Path) -> String {
    scene.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::bench::results::tests::results as of_bench;
    use crate::frame::Stage;

    /// One scene of each verdict, in two folders.
    pub(crate) fn results() -> Results {
        let metrics = |rmse| Metrics { rmse, max: 0.25, p999: 0.125, psnr: 40.0, flip: 0.01, pixels: 64 };
        let error = |rmse| Measured {
            width: 8,
            height: 8,
            metrics: metrics(rmse),
            reference_milliseconds: 1234.0,
            reference_reused: false,
        };
        let drawn = |error: Option<Measured>| Drawn {
            picture: "a/fog & fur.png".into(),
            width: 16,
            height: 12,
            tetrahedra: 6912,
            load_milliseconds: 150.0,
            frame_milliseconds: 20.25,
            report: Report {
                stages: vec![
                    Stage { name: "march".into(), milliseconds: 18.5 },
                    Stage { name: "march.device".into(), milliseconds: 17.5 },
                ],
                counts: [("tetrahedra_drawn".to_owned(), 6900)].into(),
                skipped: vec!["12 tetrahedra lie <beside> the picture".to_owned()],
                ..Report::default()
            },
            bound: 5e-3,
            error,
        };
        let about = || About { title: Some("Fog & fur".into()), description: "Thin <b>.".into() };
        let scene = |path: &str, error| SceneResults::drawn(path.as_ref(), about(), drawn(error));
        let broken =
            SceneResults::broken("b/torn.toml".as_ref(), About::default(), "unknown key `shel`".to_owned());
        let scenes = vec![
            scene("a/fog & fur.toml", Some(error(1e-3))),
            scene("a/far.toml", Some(error(2e-2))),
            scene("a/lone.toml", None),
            broken,
        ];
        Results { schema: SCHEMA, environment: of_bench().environment, scenes }
    }

    #[test]
    fn verdicts_follow_from_errors() {
        let results = results();
        let verdicts: Vec<Verdict> = results.scenes.iter().map(|scene| scene.verdict).collect();
        assert_eq!(verdicts, [Verdict::Passed, Verdict::Failed, Verdict::Unmeasured, Verdict::Broken]);
        let groups: Vec<(String, usize)> =
            results.groups().map(|(group, scenes)| (group, scenes.len())).collect();
        assert_eq!(groups, [("a".to_owned(), 3), ("b".to_owned(), 1)]);
        let Some(mut drawn) = results.scenes[0].drawn.clone() else { panic!("drawn") };
        drawn.error.as_mut().unwrap().metrics.rmse = f64::NAN;
        let scene = SceneResults::drawn("s.toml".as_ref(), About::default(), drawn);
        assert_eq!((scene.verdict, scene.group(), scene.title), (Verdict::Failed, ".".into(), "s".into()));
    }
}
