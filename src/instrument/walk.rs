//! Through the frames of a sequence, one after another.

use std::path::Path;
use std::sync::Arc;

use super::faults::faults;
use super::fold::{fold, thickness};
use super::heatmap;
use super::overlap::overlaps;
use super::pops::{Pops, Seen, pops};
use super::results::{FrameResults, OrderResults, Results};
use super::stretch::{Stretch, deformations};
use crate::bench::report::picture::{data_uri, thumbnail};
use crate::frame::{Backdrop, Frame, Image};
use crate::method::{Setup, shell};
use crate::order::{Sorter, check_pixels};
use crate::scene::{Scene, Sequence, Sizes};
use crate::shell::Shell;
use crate::{Error, Result};

/// What is to be checked.
pub struct Options<'a> {
    /// The scene file, as the results are to call it.
    pub scene: &'a Path,
    /// Numbers of frames, ascending, at least one, all in the timeline.
    pub frames: &'a [u32],
    /// Width and height in pixels, instead of the scene's.
    pub size: Option<[u32; 2]>,
}

/// What came of it.
pub struct Outcome {
    /// All that was found.
    pub results: Results,
    /// The frames to be looked at.
    pub worst: Vec<Worst>,
    /// The stretch in the frame that is [most deformed](Results::most_deformed).
    pub heatmap: Image,
}

/// The frame that is the worst in something.
pub struct Worst {
    /// What it is the worst in, in words.
    pub what: &'static str,
    /// Its number.
    pub frame: u32,
    /// How bad it is.
    severity: f64,
    /// Its picture, as a `data:` URI.
    pub picture: String,
}

/// What a frame can be the worst in, and how bad it is; 0 where there is nothing to be seen.
type Severity = (&'static str, fn(&FrameResults) -> f64);

const SEVERITIES: [Severity; 5] = [
    ("most inverted tetrahedra", |frame| frame.faults.inverted.count as f64),
    ("most pairs that intersect", |frame| frame.overlaps.pairs as f64),
    ("most pairs in the wrong order", |frame| frame.order.violations as f64),
    ("most pixels that pop", |frame| frame.pops.as_ref().map_or(0, |pops| pops.pixels) as f64),
    // Up to the rounding of a rigid motion.
    ("most stretched or compressed", |frame| {
        Some(frame.deformation()).filter(|factor| *factor > 1.0 + 1e-6).unwrap_or(0.0)
    }),
];

/// A frame that the next is compared with.
#[derive(Clone)]
struct Past {
    frame: u32,
    scene: Arc<Scene>,
    image: Arc<Image>,
    depth: Arc<[f32]>,
}

impl Past {
    fn seen(&self) -> Seen<'_> {
        Seen {
            shell: &self.scene.shell,
            view: &self.scene.view,
            image: &self.image,
            depth: &self.depth,
            has_solids: !self.scene.solids.is_empty(),
        }
    }
}

/// What is gathered on the way.
struct Walk<'a> {
    options: &'a Options<'a>,
    rest: Arc<Shell>,
    sorter: Sorter,
    worst: Vec<Worst>,
    /// The greatest deformation so far, and where it was.
    most: Option<(f64, u32, Image)>,
}

/// Renders the frames and takes all measures.
///
/// # Errors
/// Those of [`Sequence::at`] and of the `shell` method; [`Error::Usage`] for a mesh whose topology is not that of the first frame.
pub fn walk(sequence: &mut Sequence, options: &Options<'_>, setup: &Setup<'_>) -> Result<Outcome> {
    let timeline = *sequence.timeline();
    // The device has admitted the first.
    let admit_all = |_: &Sizes| Ok(());
    let opened = shell::open(setup)?;
    let admit =
        |sizes: &Sizes| opened.admit(&Sizes { picture: options.size.unwrap_or(sizes.picture), ..*sizes });
    let rest = sequence.at(1, setup.progress.as_ref(), &admit)?;
    let tetrahedra = rest.scene.shell.topology.tetrahedra.len() as u64;
    let mut walk = Walk {
        options,
        sorter: Sorter::new(&rest.scene.shell.topology),
        rest: rest.scene.shell.clone(),
        worst: Vec::new(),
        most: None,
    };
    let start = options.frames[0];
    let mut loaded = match start {
        1 => rest,
        _ => sequence.at(start, setup.progress.as_ref(), &admit)?,
    };
    let mut scene = Arc::new(walk.sized(loaded.scene));
    let mut method = opened.prepare(scene.clone())?;
    let mut device = String::new();
    let mut results: Vec<FrameResults> = Vec::new();
    let (mut first, mut before): (Option<Past>, Option<Past>) = (None, None);
    for &frame in options.frames {
        setup.interrupt.check()?;
        if frame != start {
            loaded = sequence.at(frame, setup.progress.as_ref(), &admit_all)?;
            scene = Arc::new(walk.sized(loaded.scene));
            walk.check_topology(frame, &scene)?;
            method.update(scene.clone())?;
        }
        setup.progress.stage(&format!("rendering frame {frame}"));
        let rendered = method.render(&scene.view)?;
        device = rendered.report.device.clone();
        setup.progress.stage(&format!("measuring frame {frame}"));
        let (past, mut found) = walk.frame(frame, &scene, rendered, &loaded.backdrop, before.as_ref())?;
        found.stages.splice(..0, std::mem::take(&mut loaded.stages));
        results.push(found);
        if frame == 1 && timeline.loops {
            first = Some(past.clone());
        }
        before = Some(past);
    }
    if let (Some(first), Some(last)) = (&first, &before)
        && last.frame == timeline.frames
        && last.frame != 1
    {
        results[0].pops = Some(compare(last, first)?);
    }
    let (_, most_deformed, heatmap) = walk.most.expect("there is a frame");
    let [width, height] = before.map_or([0, 0], |last| [last.image.width, last.image.height]);
    let results = Results {
        scene: options.scene.to_owned(),
        device,
        width,
        height,
        tetrahedra,
        rate: timeline.rate,
        most_deformed,
        frames: results,
    };
    Ok(Outcome { results, worst: walk.worst, heatmap })
}

fn compare(before: &Past, now: &Past) -> Result<Pops> {
    let size = |past: &Past| [past.image.width, past.image.height];
    if size(before) != size(now) {
        return Err(Error::Usage {
            message: format!("frame {} has another size than frame {}", now.frame, before.frame),
            help: Some("take the track of image.size out of the scene, or give one --size".into()),
        });
    }
    Ok(pops(before.frame, before.seen(), now.seen()))
}

impl Walk<'_> {
    fn sized(&self, mut scene: Scene) -> Scene {
        let own = [scene.view.width, scene.view.height];
        [scene.view.width, scene.view.height] = self.options.size.unwrap_or(own);
        scene.view.depth = true;
        scene
    }

    fn check_topology(&self, frame: u32, scene: &Scene) -> Result<()> {
        let (topology, rest) = (&scene.shell.topology, &self.rest.topology);
        if Arc::ptr_eq(topology, rest) || **topology == **rest {
            return Ok(());
        }
        Err(Error::Usage {
            message: format!("frame {frame} has a mesh of other triangles than frame 1"),
            help: Some("an animation can be checked where all its frames share their topology".into()),
        })
    }

    /// All measures of a rendered frame.
    fn frame(
        &mut self,
        frame: u32,
        scene: &Arc<Scene>,
        Frame { image, depth, report }: Frame,
        backdrop: &Backdrop,
        before: Option<&Past>,
    ) -> Result<(Past, FrameResults)> {
        let shell = &scene.shell;
        let deformations = deformations(&self.rest, shell);
        let sorted = self.sorter.sort(shell, &scene.view);
        let check = check_pixels(shell, &sorted.order, &scene.view);
        let depth = depth.expect("the view asks for it").into();
        let past = Past { frame, scene: scene.clone(), image: Arc::new(image), depth };
        let successor = before.filter(|before| before.frame + 1 == frame);
        let found = FrameResults {
            frame,
            faults: faults(shell),
            stretch: Stretch::of(&self.rest, &deformations),
            thickness: thickness(shell),
            fold: fold(shell),
            overlaps: overlaps(shell),
            order: OrderResults {
                pairs: check.pairs,
                violations: check.violations,
                overlapping: check.overlapping,
                cycles: sorted.order.cycles.len() as u64,
                cycle_members: sorted.cycle_members,
            },
            pops: successor.map(|before| compare(before, &past)).transpose()?,
            stages: report.stages,
            skipped: report.skipped,
        };
        self.look(&found, &past, &deformations, backdrop);
        Ok((past, found))
    }

    /// Keeps the pictures of frames that are worse than all before.
    fn look(
        &mut self,
        found: &FrameResults,
        past: &Past,
        deformations: &[Option<[f64; 3]>],
        backdrop: &Backdrop,
    ) {
        for (what, severity) in SEVERITIES {
            let severity = severity(found);
            let index = self.worst.iter().position(|worst| worst.what == what);
            if severity <= index.map_or(0.0, |index| self.worst[index].severity) {
                continue;
            }
            let picture = data_uri(&thumbnail(&past.image), backdrop);
            let worst = Worst { what, frame: found.frame, severity, picture };
            match index {
                Some(index) => self.worst[index] = worst,
                None => self.worst.push(worst),
            }
        }
        let deformation = found.deformation();
        if self.most.as_ref().is_none_or(|(most, ..)| deformation > *most) {
            let picture = heatmap::paint(&past.scene, deformations, found.frame);
            self.most = Some((deformation, found.frame, picture));
        }
    }
}
