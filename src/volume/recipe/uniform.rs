//! A medium of one colour, as dense everywhere.

use super::Pattern;
use super::grid::{Grid, premultiplied};
use super::keys::keys;
use crate::value::Colour;

keys! {
    /// The keys of `recipe = "uniform"`.
    Uniform {
        /// Opacity of a path as long as the shell is thick; 1 is solid.
        alpha: f32 = 0.5, 0.0..=1.0;
        /// Colour of the medium.
        colour: Colour = Colour::srgb(0x3fae5a);
    }
}

impl Pattern for Uniform {
    fn draw(&self, grid: &Grid, _seed: u32, texels: &mut [[f32; 4]]) {
        texels.fill(premultiplied(self.colour.0, grid.opacity(-(-self.alpha).ln_1p())));
    }
}
