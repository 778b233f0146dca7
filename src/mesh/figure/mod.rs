//! Figures to voxelise: a tree, a chain, a bust and a dragon, sculpted from smoothly joined parts.
//!
//! A `sculpture` is a field, negative inside; `tetrahedra` makes a closed mesh of it. Nothing lights a volume unless it is asked to,
//! so sky light is painted into the colours.

mod bust;
mod chain;
mod dragon;
mod sculpture;
mod tetrahedra;
mod tree;

use super::model::Model;
use sculpture::Sculpture;

/// A figure; all stand on the XZ plane, look along +Z and are some two units high.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Figure {
    /// A broad tree: trunk, roots, branches, and tufts of leaves.
    Tree,
    /// A chain along X: two whole links, of which each goes through the next, and through the first again two units on.
    Chain,
    /// Head and shoulders on a foot.
    Bust,
    /// A winged dragon with its tail around it.
    Dragon,
}

impl Figure {
    /// Every figure, by the name that the command line calls it.
    pub const ALL: [(&'static str, Self); 4] =
        [("tree", Self::Tree), ("chain", Self::Chain), ("bust", Self::Bust), ("dragon", Self::Dragon)];

    /// A closed mesh, whose finest parts are some thousandths of a unit.
    pub fn model(self) -> Model {
        let sculpture = match self {
            Self::Tree => tree::tree(),
            Self::Chain => chain::chain(),
            Self::Bust => bust::bust(),
            Self::Dragon => dragon::dragon(),
        };
        sculpture.model()
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        let entry = Self::ALL.iter().find(|(_, figure)| *figure == self);
        entry.expect("the table has every figure").0
    }
}
