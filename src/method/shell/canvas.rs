//! What a frame of one size and kind needs on the device beside the scene: its target, pipelines and the buffers of what is seen.

use super::constants::{Levels, ViewConstants, constants_of_volume};
use super::lit::{self, LitView, Sight as LitSight};
use super::seen::{Run, Seen};
use super::solids::SolidView;
use super::squares;
use super::walk::{RayBuffers, Ways};
use super::{Shell, Sight};
use crate::gpu::{Batch, Buffer, Keeps, Marked, Pipeline, PipelineInfo, Target, shaders};
use crate::scene::{Model, Skip, View};
use crate::{Error, Result};

/// Where tetrahedra are sorted, the parts of them after which pixels are looked for in which no more is seen: docs/speed.md has what
/// more of them, or fewer, take.
const LOOKS: &[f64] = &[0.25, 0.5, 0.75];

/// The target of a picture and the pipeline that draws into it.
pub(super) struct Canvas {
    kind: CanvasKind,
    pub(super) target: Target,
    cells: Buffer,
    medium: Medium,
    /// In a lit scene.
    pub(super) lit: Option<LitView>,
    /// Where there are solids: their picture, and what lays it behind the medium.
    pub(super) solids: Option<(SolidView, Pipeline)>,
}

/// What draws the medium, with what each way needs beside the cells.
enum Medium {
    Sorted {
        pipeline: Pipeline,
        /// For cycles, where there are any.
        cycle: Option<Pipeline>,
        /// Marks pixels in which no more is seen, if that is looked for.
        saturated: Option<Pipeline>,
        tiles: Buffer,
        list: Buffer,
    },
    Walked {
        /// Marks pixels by what their rays meet.
        mark: Pipeline,
        pipeline: Pipeline,
        /// For squares in which all is magnified, where others are not.
        magnified: Option<Pipeline>,
        /// For rays that are in several parts of the shell at once, where there are any.
        together: Option<Pipeline>,
        rays: RayBuffers,
    },
}

impl Canvas {
    /// By the binding that shaders name.
    pub(super) fn buffers<'a>(&'a self, ways: Option<&'a Ways>) -> Vec<(u32, &'a Buffer)> {
        let mut buffers = Vec::new();
        match &self.medium {
            Medium::Sorted { tiles, list, .. } => buffers.extend([(0, &self.cells), (1, tiles), (2, list)]),
            Medium::Walked { rays, .. } => {
                buffers.push((18, &self.cells));
                buffers.extend(rays.buffers());
                buffers.extend(ways.map(|ways| (19, ways.beyond())));
            }
        }
        if let Some(view) = &self.lit {
            buffers.push((3, &view.frames));
            buffers.extend(view.lights());
        }
        buffers
    }

    /// Whether squares in which all is magnified are drawn by themselves.
    pub(super) fn is_parted(&self) -> bool {
        self.kind.partly_magnified
    }

    /// What is drawn of the medium, in order.
    pub(super) fn batches(&self, seen: &Seen) -> Vec<Batch<'_>> {
        match &self.medium {
            Medium::Sorted { pipeline, cycle, saturated, .. } => {
                let batch = |run: &Run| {
                    let (pipeline, quads) = match run {
                        Run::Sorted(cells) => (pipeline, cells),
                        Run::Cycle(tiles) => (cycle.as_ref().expect("built where there are cycles"), tiles),
                    };
                    Batch { pipeline, vertices: 6 * quads.start..6 * quads.end }
                };
                let Some(saturated) = saturated else { return seen.runs.iter().map(batch).collect() };
                let mut batches = Vec::new();
                for (index, part) in seen.parts(LOOKS).iter().enumerate() {
                    if index > 0 {
                        batches.push(Batch { pipeline: saturated, vertices: 0..3 });
                    }
                    batches.extend(part.iter().map(batch));
                }
                batches
            }
            Medium::Walked { mark, pipeline, magnified, together, .. } => {
                let end = 6 * seen.minified_squares.len() as u32;
                let mut batches = match magnified {
                    None => vec![Batch { pipeline, vertices: 0..end }],
                    Some(magnified) => {
                        let batch = |(&minified, vertices): (&bool, _)| Batch {
                            pipeline: if minified { pipeline } else { magnified },
                            vertices,
                        };
                        squares::vertices(&seen.minified_squares).map(batch).collect()
                    }
                };
                // Squares do not overlap: those of one pipeline are drawn together.
                batches.sort_by_key(|batch| std::ptr::eq(batch.pipeline, pipeline));
                batches.insert(0, Batch { pipeline: mark, vertices: 0..3 });
                batches.extend(together.iter().map(|pipeline| Batch { pipeline, vertices: 0..end }));
                batches
            }
        }
    }
}

/// What a canvas depends on.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CanvasKind {
    width: u32,
    height: u32,
    depth: bool,
    /// Whether anything is resolved pixel by pixel.
    cycles: bool,
    /// By what pixels are marked: where rays walk by what these meet; where tetrahedra are sorted by what was drawn, if pixels are looked for
    /// in which no more is seen.
    marked: Marked,
    /// Whether there are squares in which all is magnified, and others.
    partly_magnified: bool,
    /// What is compiled into the shaders: what the scene has, and what is asked for.
    switches: Vec<&'static str>,
    /// Their specialisation constants.
    constants: Vec<u32>,
}

impl Shell {
    /// The canvas for this frame, with what was seen in its buffers: the one of the frame before, where it is of that kind.
    /// `is_uploaded`: that has been seen in the frame before, too.
    pub(super) fn canvas(
        &self,
        kept: Option<Canvas>,
        kind: CanvasKind,
        sight: &Sight,
        seen: &Seen,
        view: &View,
        is_uploaded: bool,
    ) -> Result<Canvas> {
        let Some(mut canvas) = kept.filter(|canvas| canvas.kind == kind) else {
            return self.new_canvas(kind, sight, seen, view);
        };
        if !is_uploaded {
            canvas.cells.refill(&seen.cells)?;
            match (&mut canvas.medium, sight) {
                (Medium::Sorted { tiles, list, .. }, _) => {
                    tiles.refill(&seen.tiles)?;
                    list.refill(&seen.list)?;
                }
                (Medium::Walked { rays, .. }, Sight::Walked(crossings)) => rays.refill(crossings)?,
                (Medium::Walked { .. }, Sight::Sorted(_)) => unreachable!("a canvas of another kind"),
            }
        }
        if let (Some(lit), Some(kept), Some(sight)) = (&self.lit, &mut canvas.lit, self.lit_sight(seen, view))
        {
            kept.refill(lit, sight, !is_uploaded)?;
        }
        Ok(canvas)
    }

    /// In a lit scene.
    fn lit_sight<'a>(&'a self, seen: &'a Seen, view: &'a View) -> Option<LitSight<'a>> {
        let shading = self.scene.shading.as_ref()?;
        Some(LitSight { shading, shadows: self.shadows.as_ref(), shell: &self.scene.shell, seen, view })
    }

    pub(super) fn kind(&self, sight: &Sight, seen: &Seen, view: &View) -> CanvasKind {
        let switches = [
            ("DEPTH", view.depth),
            ("SOLIDS", self.solids.is_some()),
            ("LIT", self.lit.is_some()),
            ("SHADOWS", self.shadows.is_some()),
        ];
        let skips = self.scene.skips;
        let minified = seen.minified || !skips.allow(Skip::Levels);
        let mut constants =
            constants_of_volume(self.scene.march, self.volume.levels(minified), &self.scene.volume).to_vec();
        let shading = self.scene.shading.as_ref();
        let fibre = shading.is_some_and(|shading| shading.model == Model::Fibre);
        let glow = shading.is_some_and(|shading| shading.emission.glow > 0.0);
        let inside = matches!(sight, Sight::Walked(crossings) if crossings.begun_inside > 0);
        constants.extend([fibre, glow, inside].map(u32::from));
        constants.push(if skips.allow(Skip::Saturation) {
            (self.scene.end_below as f32).to_bits()
        } else {
            0
        });
        let lights = self.scene.shading.iter().flat_map(|shading| &shading.lights);
        constants.extend(lit::constants(lights, self.shadows.as_ref()));
        CanvasKind {
            width: view.width,
            height: view.height,
            depth: view.depth,
            cycles: match sight {
                Sight::Sorted(_) => !seen.tiles.is_empty(),
                Sight::Walked(crossings) => crossings.overlapping > 0,
            },
            marked: match sight {
                Sight::Walked(_) => Marked::Apart,
                Sight::Sorted(_) if self.ends_where_saturated() => Marked::ByPicture,
                Sight::Sorted(_) => Marked::Never,
            },
            partly_magnified: match sight {
                Sight::Walked(crossings) if skips.allow(Skip::Levels) => {
                    seen.is_worth_parting(crossings, view)
                }
                _ => false,
            },
            switches: switches
                .into_iter()
                .filter_map(|(name, is_on)| is_on.then_some(name))
                .chain(self.volume.switches().iter().copied())
                .collect(),
            constants,
        }
    }

    fn new_canvas(&self, kind: CanvasKind, sight: &Sight, seen: &Seen, view: &View) -> Result<Canvas> {
        let attachments = if kind.depth { 2 } else { 1 };
        let target = Target::new(&self.gpu, [kind.width, kind.height], attachments, kind.marked)?;
        let walks = matches!(sight, Sight::Walked(_));
        let looks = kind.marked == Marked::ByPicture;
        let on = &kind.switches;
        let mut uniform_buffers = Vec::new();
        let buffers = if walks { Vec::new() } else { vec![0, 1, 2] };
        let mut texel_buffers = if walks { vec![18, 19, 20, 21] } else { Vec::new() };
        let mut textures = vec![8];
        for &switch in on {
            let (more_uniform_buffers, more_texel_buffers, more_textures): (&[u32], &[u32], &[u32]) =
                match switch {
                    "LIT" => (&[5], &[3], &[9]),
                    "SHADOWS" => (&[6], &[], &[10]),
                    "SOLIDS" => (&[], &[], &[15]),
                    "SPARSE" => (&[], &[], &[22]),
                    _ => (&[], &[], &[]),
                };
            uniform_buffers.extend(more_uniform_buffers);
            texel_buffers.extend(more_texel_buffers);
            textures.extend(more_textures);
        }
        if on.contains(&"SHADOWS") && on.contains(&"SOLIDS") {
            textures.push(14);
        }
        let info = PipelineInfo {
            vertex: shaders::SHELL_VERT.with(on),
            fragment: shaders::SHELL_FRAG.with(on),
            constants: &kind.constants,
            storage_buffers: &buffers,
            uniform_buffers: &uniform_buffers,
            texel_buffers: &texel_buffers,
            textures: &textures,
            minified: kind.constants[1] != Levels::First as u32,
            push_constant_bytes: size_of::<ViewConstants>() as u32,
            keeps: Keeps::Blend,
        };
        let (cells, medium) = match sight {
            Sight::Sorted(_) => {
                let keeps = if looks { Keeps::BlendAbove } else { Keeps::Blend };
                let info = PipelineInfo { keeps, ..info };
                let of_cycles = PipelineInfo {
                    vertex: shaders::TILE_VERT.with(on),
                    fragment: shaders::CYCLE_FRAG.with(on),
                    ..info
                };
                let saturated = PipelineInfo {
                    vertex: shaders::LAYER_VERT.with(&[]),
                    fragment: shaders::SATURATED_FRAG.with(&[]),
                    storage_buffers: &[],
                    uniform_buffers: &[],
                    texel_buffers: &[],
                    textures: &[],
                    keeps: Keeps::MarksByPicture,
                    ..info
                };
                let infos = [Some(info), kind.cycles.then_some(of_cycles), looks.then_some(saturated)];
                let [pipeline, cycle, saturated] = Pipeline::all(&self.gpu, &target, infos)?;
                let medium = Medium::Sorted {
                    pipeline: pipeline.expect("asked for"),
                    cycle,
                    saturated,
                    tiles: Buffer::storage(&self.gpu, "the tiles of cycles", &seen.tiles)?,
                    list: Buffer::storage(&self.gpu, "the tetrahedra in order", &seen.list)?,
                };
                (Buffer::storage(&self.gpu, "the tetrahedra", &seen.cells)?, medium)
            }
            Sight::Walked(crossings) => {
                let mark = PipelineInfo {
                    vertex: shaders::LAYER_VERT.with(&[]),
                    fragment: shaders::MARK_FRAG.with(&[]),
                    uniform_buffers: &[],
                    texel_buffers: &[20],
                    textures: &[],
                    keeps: Keeps::Marks,
                    ..info
                };
                let walked = PipelineInfo {
                    vertex: shaders::WALK_VERT.with(&[]),
                    fragment: shaders::WALK_FRAG.with(on),
                    keeps: Keeps::BlendAbove,
                    ..info
                };
                let mut constants = kind.constants.clone();
                constants[..3].copy_from_slice(&constants_of_volume(
                    self.scene.march,
                    Levels::First,
                    &self.scene.volume,
                ));
                let magnified = PipelineInfo { constants: &constants, minified: false, ..walked };
                let of_several = PipelineInfo {
                    vertex: shaders::WALK_VERT.with(&["TOGETHER"]),
                    fragment: shaders::TOGETHER_FRAG.with(on),
                    keeps: Keeps::BlendBelow,
                    ..walked
                };
                let infos = [
                    Some(mark),
                    Some(walked),
                    kind.partly_magnified.then_some(magnified),
                    kind.cycles.then_some(of_several),
                ];
                let [mark, pipeline, magnified, together] = Pipeline::all(&self.gpu, &target, infos)?;
                let [mark, pipeline] = [mark, pipeline].map(|pipeline| pipeline.expect("asked for"));
                let rays = RayBuffers::new(&self.gpu, crossings)?;
                let cells = Buffer::floats(&self.gpu, "the tetrahedra", &seen.cells)?;
                (cells, Medium::Walked { mark, pipeline, magnified, together, rays })
            }
        };
        let solids = self.solids.as_ref().map(|_| {
            let layer = PipelineInfo {
                vertex: shaders::LAYER_VERT.with(on),
                fragment: shaders::LAYER_FRAG.with(on),
                constants: &[],
                storage_buffers: &[],
                uniform_buffers: &[],
                texel_buffers: &[],
                textures: &[15, 16],
                ..info
            };
            Ok::<_, Error>((
                SolidView::new(&self.gpu, view, on, &kind.constants)?,
                Pipeline::new(&self.gpu, &target, &layer)?,
            ))
        });
        let lit = match (&self.lit, self.lit_sight(seen, view)) {
            (Some(lit), Some(sight)) => Some(LitView::new(&self.gpu, lit, sight)?),
            _ => None,
        };
        Ok(Canvas { kind, cells, medium, lit, solids: solids.transpose()?, target })
    }
}
