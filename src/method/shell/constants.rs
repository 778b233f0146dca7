//! What the shaders of the shell are told beside what they draw: push constants and specialisation constants.

use bytemuck::{Pod, Zeroable};

use crate::scene::shading::{Light, Source};
use crate::scene::{March, Scene, View};
use crate::volume::{Pyramid, Quantity};

/// The push constants of `glsl/include/shell.glsl`: see there for each member.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "documented at the one declaration in glsl")]
pub struct ViewConstants {
    pub centre: [f32; 2],
    pub pixel: f32,
    pub near: f32,
    pub texels: [f32; 3],
    pub last_level: f32,
    pub lod_scale: f32,
    pub per_opacity_distance: f32,
    pub step: f32,
    pub samples: u32,
    pub even: [f32; 4],
    pub even_steps: u32,
}

/// Passes through loops that a ray makes in one tetrahedron at most: a bound of `sample_count` and `march_exactly` in
/// `glsl/include`, and of lavapipe, which ends all loops of a pixel there.
pub(super) const MOST_SAMPLES: f64 = 65535.0;

/// How many samples the plan wants along a ray that passes so many texels of the full volume in a tetrahedron, at most.
pub(super) fn wanted_samples(march: March, texels: f64) -> f64 {
    match march {
        March::Default { step } => texels / step,
        March::Paper { samples } => f64::from(samples),
        // A ray passes planes of texels on three axes, of two levels, and each piece may be cut in 16.
        March::Exact => 3.0 * (1.0 + 0.5) * 17.0 * texels,
    }
}

/// Texels a sample in cycles under the exact plan.
const CYCLE_STEP: f64 = 0.125;

/// The specialisation constant `PLAN` of `glsl/include/march.glsl`.
fn plan(march: March) -> u32 {
    match march {
        March::Default { .. } => 0,
        March::Paper { .. } => 1,
        March::Exact => 2,
    }
}

/// `LEVELS` of `glsl/include/sample.glsl`: of a texture's levels of detail, what is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Levels {
    First = 0,
    BlendedByShader = 1,
    BlendedByDevice = 2,
}

/// The specialisation constants of `glsl/include/sample.glsl`.
pub(super) fn constants_of_volume(march: March, levels: Levels, volume: &Pyramid) -> [u32; 3] {
    let is_extinction = volume.levels[0].quantity == Quantity::Extinction;
    [plan(march), levels as u32, u32::from(is_extinction)]
}

/// How many steps through a medium that is the same everywhere are one, at most: whether anything more is let through must be asked
/// now and then.
const EVEN_STEPS: u32 = 64;

/// The same where the light differs along them: by a shadow, or by the distance from where it is. By those of eight vase-dragons is off
/// by 9.4e-5 (step 1.19), a seventh of what it is off by anyway.
const EVEN_STEPS_IN_CHANGING_LIGHT: u32 = 8;

impl ViewConstants {
    /// What is known of a volume, much of which is the medium `even`, and nothing else.
    pub(super) fn of_volume(volume: &Pyramid, even: Option<[f32; 4]>) -> Self {
        Self {
            texels: volume.levels[0].size.map(|side| side as f32),
            last_level: (volume.levels.len() - 1) as f32,
            even: even.unwrap_or_default(),
            even_steps: EVEN_STEPS,
            ..Self::zeroed()
        }
    }

    /// Of an eye's view; `unit`: see [`Seen::unit`](super::seen::Seen::unit).
    pub(super) fn of_eye(scene: &Scene, view: &View, unit: f64, even: Option<[f32; 4]>) -> Self {
        let pixel = view.pixel_at_unit_depth();
        let (step, samples) = match scene.march {
            March::Paper { samples } => (1.0, samples),
            March::Default { step } => (step, 1),
            // Of cycles alone, which are always marched by midpoints.
            March::Exact => (CYCLE_STEP, 1),
        };
        let of_volume = Self::of_volume(&scene.volume, even);
        let mut lights = scene.shading.iter().flat_map(|shading| &shading.lights);
        let changes =
            |light: &Light| light.shadow || matches!(light.source, Source::Point { falloff: Some(_), .. });
        Self {
            centre: [0.5 * view.width as f32, 0.5 * view.height as f32],
            pixel: pixel as f32,
            near: (view.camera.near / unit) as f32,
            lod_scale: (scene.medium.lod_footprint * pixel) as f32,
            per_opacity_distance: (unit / scene.medium.opacity_distance) as f32,
            step: step as f32,
            samples,
            even_steps: if lights.any(changes) { EVEN_STEPS_IN_CHANGING_LIGHT } else { EVEN_STEPS },
            ..of_volume
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plans_and_levels_have_the_numbers_of_the_shader() {
        let shader = include_str!("../../../glsl/include/sample.glsl");
        for (name, march) in
            [("DEFAULT", March::default()), ("PAPER", March::Paper { samples: 1 }), ("EXACT", March::Exact)]
        {
            assert!(shader.contains(&format!("const uint PLAN_{name} = {};", plan(march))), "{name}");
        }
        for (name, levels) in [
            ("FIRST", Levels::First),
            ("BLENDED_BY_SHADER", Levels::BlendedByShader),
            ("BLENDED_BY_DEVICE", Levels::BlendedByDevice),
        ] {
            assert!(shader.contains(&format!("const uint LEVELS_{name} = {};", levels as u32)), "{name}");
        }
    }

    #[test]
    fn host_and_shader_agree_on_the_most_samples() {
        let shader = include_str!("../../../glsl/include/sample.glsl");
        assert!(shader.contains(&format!("clamp(ceil(texels / view.step), 1.0, {MOST_SAMPLES:.1})")));
    }
}
