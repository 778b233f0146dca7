//! A scene in time: its frames, each a scene, that share all that does not change between them.

use std::path::{Path, PathBuf};

use super::file::SceneFile;
use super::load::Loaded;
use super::parts::{Parts, Rest};
use super::text::Text;
use super::timeline::{Moment, Timeline, Track};
use super::{Sizes, files, load, meshes, source};
use crate::progress::Progress;
use crate::{Error, Result};

/// An animated scene.
pub struct Sequence {
    text: Text,
    base_dir: PathBuf,
    timeline: Timeline,
    tracks: Vec<Track>,
    parts: Parts,
    /// Once it was needed.
    rest: Option<Rest>,
}

/// All that makes a frame, beside the program.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FrameInputs {
    /// The scene as it is in that frame, and in the first, whose shell is the one at rest; in TOML.
    pub text: String,
    /// Every file that is read; sorted, none twice.
    pub files: Vec<PathBuf>,
}

/// The sections that make an animation, and no frame.
const OF_TIME: [&str; 2] = ["timeline", "track"];

impl Sequence {
    /// Reads a scene file with overrides laid over it, as [`load`](super::load()) does. What the text says is checked at every
    /// frame.
    ///
    /// # Errors
    /// As [`load`](super::load()); an error in a frame names the tracks that make it.
    pub fn open(path: &Path, overrides: &[String], progress: &dyn Progress) -> Result<Self> {
        let mut sequence = Self::of(load::text(path, overrides)?, path.parent().unwrap_or(Path::new("")))?;
        sequence.check_frames(progress)?;
        Ok(sequence)
    }

    /// Of a text whose paths start in `base_dir`; its frames are checked when they are asked for.
    pub(super) fn of(text: Text, base_dir: &Path) -> Result<Self> {
        let file: SceneFile = load::read(&text)?;
        let timeline = Timeline::of(file.timeline.as_ref());
        let tracks = Track::all(&text, &file, &timeline)?;
        let base_dir = base_dir.to_owned();
        Ok(Self { text, base_dir, timeline, tracks, parts: Parts::default(), rest: None })
    }

    /// All that can be wrong in a frame, but for what its files hold; glTF files are read, since they name their animations, and
    /// sequences of files, to see that they fit together.
    fn check_frames(&mut self, progress: &dyn Progress) -> Result<()> {
        for frame in 1..=if self.tracks.is_empty() { 1 } else { self.timeline.frames } {
            let text = self.text_at(frame)?;
            self.parts.check(&text, &load::read(&text)?, &self.base_dir, self.moment(frame), progress)?;
        }
        let file = load::read(&self.text)?;
        meshes::check_all(file.mesh.get_ref(), &self.base_dir)?;
        source::check_volumes(file.volume.get_ref(), &self.base_dir)
    }

    /// How long it lasts.
    pub fn timeline(&self) -> &Timeline {
        &self.timeline
    }

    /// The scene as it is in a frame. What is the same as in the frame that was asked for last is shared with it, and its loading
    /// has no stage.
    ///
    /// Coarser levels of the volume are made for the shell of the first frame.
    ///
    /// # Errors
    /// As [`load_if`](super::load_if); [`Error::Usage`] for a frame that is not in the timeline.
    pub fn at(
        &mut self,
        frame: u32,
        progress: &dyn Progress,
        admit: &dyn Fn(&Sizes) -> Result<()>,
    ) -> Result<Loaded> {
        self.check(frame)?;
        if self.rest.is_none() && self.timeline.frames > 1 {
            let text = self.text_at(1)?;
            let file = load::read(&text)?;
            let checked = self.parts.check(&text, &file, &self.base_dir, self.moment(1), progress)?;
            self.rest = Some(self.parts.rest(&checked, progress)?);
        }
        let text = self.text_at(frame)?;
        let file = load::read(&text)?;
        let checked = self.parts.check(&text, &file, &self.base_dir, self.moment(frame), progress)?;
        self.parts.build(&checked, self.rest.as_ref(), progress, admit)
    }

    /// All that makes a frame, for those who keep its picture.
    ///
    /// # Errors
    /// As [`Sequence::at`].
    pub fn inputs(&self, frame: u32) -> Result<FrameInputs> {
        self.check(frame)?;
        let text = self.text_at(frame)?;
        let files = files::of(&text.plain(&OF_TIME)?, &self.base_dir);
        let Moment { time, loops } = self.moment(frame);
        let text = format!(
            "{}\n# At {time} s, loops: {loops}. At rest:\n{}",
            text.plain(&OF_TIME)?,
            self.text_at(1)?.plain(&OF_TIME)?
        );
        Ok(FrameInputs { text, files })
    }

    fn check(&self, frame: u32) -> Result<()> {
        let frames = self.timeline.frames;
        if (1..=frames).contains(&frame) {
            return Ok(());
        }
        Err(Error::Usage {
            message: format!("there is no frame {frame}: the scene has those from 1 to {frames}"),
            help: Some("the section [timeline] says how many `frames` there are".into()),
        })
    }

    fn moment(&self, frame: u32) -> Moment {
        Moment { time: self.timeline.time(frame), loops: self.timeline.loops }
    }

    fn text_at(&self, frame: u32) -> Result<Text> {
        let time = self.timeline.time(frame);
        let layers = self.tracks.iter().map(|track| track.at(time)).collect::<Result<_>>()?;
        Ok(self.text.with(layers))
    }
}
