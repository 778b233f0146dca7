//! The volume on the device.

use std::sync::Arc;

use crate::Result;
use crate::gpu::{Gpu, Sampled, Texture3d};
use crate::volume::{Proximity, Pyramid};

/// The part of the volume that must be empty for rays to look how far they may leap.
const SPARSE: f64 = 0.1;

/// The volume's texture, and what tells rays where in it nothing is.
pub struct DeviceVolume {
    /// Of the volume itself.
    pub texture: Texture3d,
    proximity: Option<Texture3d>,
    /// The part, 0..1, of the full volume in which nothing is seen.
    pub emptiness: f64,
}

impl DeviceVolume {
    /// Uploads a volume.
    ///
    /// # Errors
    /// As [`Texture3d::upload`].
    pub fn new(gpu: &Arc<Gpu>, volume: &Pyramid) -> Result<Self> {
        let texture = Texture3d::upload(gpu, "the volume", volume)?;
        let proximity = Proximity::new(volume);
        let emptiness = proximity.emptiness();
        let upload = || Texture3d::upload_proximity(gpu, "the volume's distances", &proximity);
        Ok(Self { texture, proximity: (emptiness >= SPARSE).then(upload).transpose()?, emptiness })
    }

    /// Whether there is enough of nothing in it for rays to leap.
    pub fn is_sparse(&self) -> bool {
        self.proximity.is_some()
    }

    /// By the binding that shaders name.
    pub fn textures(&self) -> Vec<(u32, Sampled<'_>)> {
        let textures = [(8, Some(&self.texture)), (22, self.proximity.as_ref())];
        textures.into_iter().filter_map(|(binding, texture)| Some((binding, Sampled::Texture(texture?)))).collect()
    }
}
