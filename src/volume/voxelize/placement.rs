//! Where a model lies in its volume: a scale and a shift along each axis.

use glam::DVec3;

use super::{Options, Scaling};
use crate::mesh::model::Model;
use crate::{Error, Result};

/// The map from the model to texel space.
pub(super) struct Placement {
    /// Texels a unit of the model along u, v, w; positive.
    pub scale: DVec3,
    offset: DVec3,
}

impl Placement {
    /// # Errors
    /// [`Error::Usage`] where the margin leaves no room, or lets the model go around more than once.
    pub fn new(model: &Model, options: &Options) -> Result<Self> {
        let turned = || model.positions.iter().map(|&position| turned(position));
        let (low, high) =
            (turned().fold(DVec3::INFINITY, DVec3::min), turned().fold(DVec3::NEG_INFINITY, DVec3::max));
        let size = DVec3::from_array(options.size.map(f64::from));
        let Options { margin, sheet, .. } = *options;
        // A sheet is as thick outside the mesh.
        let radius = 0.5 * sheet.unwrap_or(0.0);
        let free = DVec3::new(2.0 * margin, 2.0 * margin, margin.max(0.0)) + 2.0 * radius;
        let room = size - free;
        // False for NaN too.
        let has_room = room.cmpgt(DVec3::ZERO).all() && room.cmple(2.0 * size).all();
        if !has_room {
            let [width, height, depth] = options.size;
            let message = format!(
                "a margin of {margin} texels does not fit a volume of {width} x {height} x {depth} texels: \
                 it leaves {} x {} x {} for the model",
                room.x, room.y, room.z
            );
            let help = "the model needs some room, and at most twice the size of the volume";
            return Err(Error::Usage { message, help: Some(help.into()) });
        }
        // Infinite where the model is flat; three different positions are not flat along all.
        let most = room / (high - low);
        let fitting = most.min_element();
        let scale = match options.scaling {
            Scaling::Fit => DVec3::splat(fitting),
            Scaling::Stretch => DVec3::select(most.is_finite_mask(), most, DVec3::splat(fitting)),
        };
        if !scale.is_finite() || scale.cmple(DVec3::ZERO).any() {
            return Err(Error::input(
                &model.path,
                "the model is too small or too large to be scaled to texels",
            )
            .with_help("export it at a common scale"));
        }
        let middle = 0.5 * size - scale * 0.5 * (low + high);
        Ok(Self { scale, offset: middle.with_z(radius - scale.z * low.z) })
    }

    /// From the model's space to texel space.
    pub fn texel_from_model(&self, position: DVec3) -> DVec3 {
        self.scale * turned(position) + self.offset
    }
}

/// The axes of the model in the order of (u, v, w); orientation is kept.
fn turned(position: DVec3) -> DVec3 {
    DVec3::new(position.x, -position.z, position.y)
}
