//! The volume on the device.

use std::sync::Arc;

use crate::Result;
use crate::gpu::{Gpu, Sampled, Texture3d};
use crate::volume::{Proximity, Pyramid};

/// The volume's texture, and what tells rays where in it nothing is.
pub struct DeviceVolume {
    /// Of the volume itself.
    pub texture: Texture3d,
    /// Where anything of it is empty.
    proximity: Option<Texture3d>,
    emptiness: f64,
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
        Ok(Self { texture, proximity: (emptiness > 0.0).then(upload).transpose()?, emptiness })
    }

    /// The part, 0..1, of the full volume in which nothing is seen.
    pub fn emptiness(&self) -> f64 {
        self.emptiness
    }

    /// By the binding that shaders name.
    pub fn textures(&self) -> Vec<(u32, Sampled<'_>)> {
        let textures = [(8, Some(&self.texture)), (22, self.proximity.as_ref())];
        textures.into_iter().filter_map(|(binding, texture)| Some((binding, Sampled::Texture(texture?)))).collect()
    }
}
