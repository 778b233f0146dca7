//! The next scene in place of the last: what the two share stays on the device.

use std::sync::Arc;

use super::lit::Lit;
use super::plan::enough_to_leap;
use super::solids::{self, Solids};
use super::volume::DeviceVolume;
use super::{Shell, longest_span};
use crate::Result;
use crate::scene::Scene;

impl Shell {
    /// See [`Method::update`](crate::method::Method::update).
    pub(super) fn take(&mut self, scene: Arc<Scene>) -> Result<()> {
        let before = &self.scene;
        let same_shell = Arc::ptr_eq(&before.shell, &scene.shell);
        let same_volume = Arc::ptr_eq(&before.volume, &scene.volume);
        let same_solids = Arc::ptr_eq(&before.solids, &scene.solids);
        let model = |scene: &Scene| scene.shading.as_ref().map(|shading| shading.model);
        let size = scene.volume.levels[0].size;
        let mut kept = Vec::new();
        let same_texture = Arc::ptr_eq(&before.shell.texture, &scene.shell.texture);
        let texels = if same_texture && size == before.volume.levels[0].size {
            self.texels
        } else {
            longest_span(&scene)?
        };

        let same_directions = match (&before.shading, &scene.shading) {
            (Some(a), Some(b)) => Arc::ptr_eq(&a.directions, &b.directions) && a.model == b.model,
            (None, None) => true,
            _ => false,
        };
        let enough = enough_to_leap(&scene);
        let same_leaps = enough == enough_to_leap(before) && (same_directions || enough.even.is_none());
        let volume = if same_volume && same_leaps {
            kept.push("the volume is kept on the device: it is the same".to_owned());
            None
        } else {
            self.progress.stage("uploading the volume");
            Some(DeviceVolume::new(&self.gpu, &scene)?)
        };
        let lit = match &scene.shading {
            Some(shading) if !same_directions => Some(Lit::new(&self.gpu, &scene.shell, shading)?),
            _ => None,
        };
        let solids = if solids::have_same_textures(&before.solids, &scene.solids) {
            None
        } else {
            Some(Solids::new(&self.gpu, &scene.solids)?)
        };
        if let (Some(lit), Some(shading), true, false) =
            (&mut self.lit, &scene.shading, same_directions, same_shell)
        {
            lit.place(&scene.shell, shading);
        }

        // Nothing fails from here on.
        if same_directions {
            if scene.shading.is_some() {
                kept.push("the volume's directions are kept on the device: they are the same".to_owned());
            }
        } else {
            self.lit = lit;
        }
        if let Some(volume) = volume {
            self.volume = volume;
        }
        if let Some(solids) = solids {
            self.solids = solids;
        }
        if !(same_shell && same_volume && same_solids && has_same_shadows(before, &scene)) {
            self.shadows = None;
        }
        let same_topology = Arc::ptr_eq(&before.shell.topology, &scene.shell.topology);
        if !same_topology {
            self.last = None;
        }
        if same_shell {
            kept.push("the shell is kept: nothing of it has moved".to_owned());
        } else if same_topology {
            kept.push("the shell's topology is kept: the triangles are the same".to_owned());
        }
        if let Some(last) = &mut self.last
            && (model(before) != model(&scene)
                || before.medium.lod_footprint != scene.medium.lod_footprint
                || size != before.volume.levels[0].size
                || scene.volume.levels.len() != before.volume.levels.len())
        {
            last.seen = None;
        }
        (self.texels, self.kept, self.scene) = (texels, kept, scene);
        Ok(())
    }
}

/// Whether all that lights see of two scenes is alike, if shell, volume and solids are.
fn has_same_shadows(a: &Scene, b: &Scene) -> bool {
    let lights =
        |scene: &Scene| scene.shading.as_ref().map(|shading| (shading.lights.clone(), shading.shadow_size));
    lights(a) == lights(b) && a.medium == b.medium && a.march == b.march
}
