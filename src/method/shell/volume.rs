//! The volume on the device: its texture, and the distances by which rays leap over what is empty in it.

use std::cell::OnceCell;
use std::sync::Arc;

use rayon::prelude::*;

use super::constants::Levels;
use crate::gpu::{Gpu, Sampled, Texture3d};
use crate::volume::{Proximity, Pyramid};
use crate::{Error, Result};

/// The volume's texture, and what tells rays where in it nothing is.
pub struct DeviceVolume {
    /// Of the volume itself.
    texture: Texture3d,
    /// Of its opacity alone, once a light has looked through it; `None` where the device cannot hold it besides.
    alpha: OnceCell<Option<Texture3d>>,
    /// Where enough of it is empty.
    proximity: Option<Texture3d>,
    emptiness: f64,
}

impl DeviceVolume {
    /// Uploads a volume; and where at least the part `enough` of it is empty, the distances by which rays leap, unless `enough` is
    /// `None`.
    ///
    /// # Errors
    /// As [`Texture3d::upload`].
    pub fn new(gpu: &Arc<Gpu>, volume: &Pyramid, enough: Option<f64>) -> Result<Self> {
        let texture = Texture3d::upload(gpu, "the volume", volume)?;
        let full = &volume.levels[0].texels;
        let mut emptiness =
            full.par_iter().filter(|texel| texel[3] == 0.0).count() as f64 / full.len() as f64;
        let mut proximity = None;
        // Around what is seen less is empty: where these texels are too few, distances need not be known.
        if enough.is_some_and(|enough| emptiness >= enough) {
            let distances = Proximity::new(volume);
            emptiness = distances.emptiness();
            if enough.is_some_and(|enough| emptiness >= enough) {
                proximity = Some(Texture3d::upload_proximity(gpu, "the volume's distances", &distances)?);
            }
        }
        Ok(Self { texture, alpha: OnceCell::new(), proximity, emptiness })
    }

    /// Whether there are distances by which rays can leap.
    pub fn is_sparse(&self) -> bool {
        self.proximity.is_some()
    }

    /// The part, 0..1, of the full volume in which nothing is seen; at most that, where it is too little to leap.
    pub fn emptiness(&self) -> f64 {
        self.emptiness
    }

    /// Of its levels of detail, what shaders read.
    pub(super) fn levels(&self, minified: bool) -> Levels {
        match (minified, self.texture.blends_levels()) {
            (false, _) => Levels::First,
            (true, false) => Levels::BlendedByShader,
            (true, true) => Levels::BlendedByDevice,
        }
    }

    /// By the binding that shaders name.
    pub fn textures(&self) -> Vec<(u32, Sampled<'_>)> {
        self.with(&self.texture)
    }

    /// The same for shaders that see no colours: of `volume`, which was uploaded. The first time its opacity is, too.
    ///
    /// # Errors
    /// As [`Texture3d::upload`], but for want of memory.
    pub fn textures_of_lights(&self, gpu: &Arc<Gpu>, volume: &Pyramid) -> Result<Vec<(u32, Sampled<'_>)>> {
        let alpha = match self.alpha.get() {
            Some(alpha) => alpha,
            None => {
                let uploaded = match Texture3d::upload_alpha(gpu, "the volume's opacity", volume) {
                    // It can be read from the volume itself.
                    Err(Error::OutOfMemory { .. }) => None,
                    result => result?,
                };
                self.alpha.get_or_init(|| uploaded)
            }
        };
        Ok(self.with(alpha.as_ref().unwrap_or(&self.texture)))
    }

    fn with<'a>(&'a self, texture: &'a Texture3d) -> Vec<(u32, Sampled<'a>)> {
        let textures = [(8, Some(texture)), (22, self.proximity.as_ref())];
        textures
            .into_iter()
            .filter_map(|(binding, texture)| Some((binding, Sampled::Texture(texture?))))
            .collect()
    }
}
