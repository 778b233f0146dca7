//! The volume on the device: its texture, and the distances by which rays leap over what most of it is.

use std::cell::OnceCell;
use std::sync::Arc;

use super::constants::Levels;
use super::plan::enough_to_leap;
use crate::gpu::{Gpu, Sampled, Texture3d};
use crate::scene::Scene;
use crate::volume::{Proximity, Pyramid, commonest, part_like};
use crate::{Error, Result};

/// The volume's texture, and what tells rays where in it nothing is, or a medium that is the same everywhere.
pub struct DeviceVolume {
    /// Of the volume itself.
    texture: Texture3d,
    /// Of its opacity alone, once a light has looked through it; `None` where the device cannot hold it besides.
    alpha: OnceCell<Option<Texture3d>>,
    /// Where enough of it is nothing, or that medium.
    leap: Option<Leap>,
    emptiness: f64,
    evenness: f64,
}

/// What rays leap over, and how far it goes.
struct Leap {
    over: [f32; 4],
    proximity: Texture3d,
}

/// The parts of a volume that must be nothing, or one medium, for rays to leap over it; `None` where they never do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Enough {
    /// Nothing.
    pub empty: Option<f64>,
    /// A medium.
    pub even: Option<f64>,
}

impl DeviceVolume {
    /// Uploads a scene's volume; and where enough of it is nothing, or one medium in which there are no directions, the distances by
    /// which rays leap over the more frequent of the two.
    ///
    /// # Errors
    /// As [`Texture3d::upload`].
    pub fn new(gpu: &Arc<Gpu>, scene: &Scene) -> Result<Self> {
        let volume = &*scene.volume;
        let enough = enough_to_leap(scene);
        let texture = Texture3d::upload(gpu, "the volume", volume)?;
        let full = &volume.levels[0];
        let nothing = [0.0; 4];
        let mut device = Self { texture, alpha: OnceCell::new(), leap: None, emptiness: 0.0, evenness: 0.0 };
        device.emptiness = part_like(full, nothing);
        let medium = enough.even.and_then(|_| commonest(full)).unwrap_or(nothing);
        device.evenness = if medium == nothing { 0.0 } else { part_like(full, medium) };
        // Around what is unlike it less is so: where these texels are too few, distances need not be known.
        let directions = scene.shading.as_ref().map(|shading| &*shading.directions);
        let is_enough = |part: f64, enough: Option<f64>| enough.is_some_and(|enough| part >= enough);
        let mut longest = 0.0;
        for (over, directions, part, enough) in [
            (nothing, None, &mut device.emptiness, enough.empty),
            (medium, directions, &mut device.evenness, enough.even),
        ] {
            if !is_enough(*part, enough) || *part <= longest {
                continue;
            }
            let proximity = Proximity::new(volume, directions, over);
            *part = proximity.part();
            if is_enough(*part, enough) && *part > longest {
                longest = *part;
                let proximity = Texture3d::upload_proximity(gpu, "the volume's distances", &proximity)?;
                device.leap = Some(Leap { over, proximity });
            }
        }
        Ok(device)
    }

    /// Whether rays leap over what is empty.
    pub fn is_sparse(&self) -> bool {
        self.leap.as_ref().is_some_and(|leap| leap.over[3] == 0.0)
    }

    /// The medium over which rays leap.
    pub fn even(&self) -> Option<[f32; 4]> {
        self.leap.as_ref().map(|leap| leap.over).filter(|over| over[3] > 0.0)
    }

    /// What is compiled into shaders that leap.
    pub(super) fn switches(&self) -> &'static [&'static str] {
        match (self.is_sparse(), self.even()) {
            (true, _) => &["SPARSE"],
            (_, Some(_)) => &["SPARSE", "EVEN"],
            _ => &[],
        }
    }

    /// The part, 0..1, of the full volume in which nothing is seen; at most that, where it is too little to leap.
    pub fn emptiness(&self) -> f64 {
        self.emptiness
    }

    /// The part, 0..1, of the full volume that is the most frequent medium, without directions; at most that, where it is too little to
    /// leap, and 0 where rays never do.
    pub fn evenness(&self) -> f64 {
        self.evenness
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
        let textures = [(8, Some(texture)), (22, self.leap.as_ref().map(|leap| &leap.proximity))];
        textures
            .into_iter()
            .filter_map(|(binding, texture)| Some((binding, Sampled::Texture(texture?))))
            .collect()
    }
}
