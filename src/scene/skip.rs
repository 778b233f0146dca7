//! What may be left out of a frame because its picture does not need it.

use serde::{Deserialize, Serialize};

/// One thing that may be left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Skip {
    /// Samples where nothing of the volume is.
    EmptySpace,
    /// Samples where the volume is the same all around.
    EvenSpace,
    /// What lies behind where next to nothing is let through.
    Saturation,
    /// Levels of detail that nothing is far enough away for.
    Levels,
    /// The order, what is seen, and the shadows, where they are as they were in the frame before.
    Kept,
}

impl Skip {
    /// All of them.
    pub const ALL: [Self; 5] =
        [Self::EmptySpace, Self::EvenSpace, Self::Saturation, Self::Levels, Self::Kept];

    /// As scene files and the command line have it.
    pub fn name(self) -> &'static str {
        match self {
            Self::EmptySpace => "empty-space",
            Self::EvenSpace => "even-space",
            Self::Saturation => "saturation",
            Self::Levels => "levels",
            Self::Kept => "kept",
        }
    }

    /// What it leaves out, for people.
    pub fn summary(self) -> &'static str {
        match self {
            Self::EmptySpace => "rays leap over places where nothing of the volume is",
            Self::EvenSpace => "where the volume is one medium, the same all around, several steps are one",
            Self::Saturation => "rays end where next to nothing is let through, march.end_below",
            Self::Levels => "where all is magnified, no coarser level of detail is compiled in",
            Self::Kept => {
                "order, what is seen, and shadows are kept where they are as they were in the frame before"
            }
        }
    }
}

/// What may be left out: by default all of it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Skips {
    /// Those that are switched off, by place in [`Skip::ALL`].
    off: [bool; Skip::ALL.len()],
}

impl Skips {
    /// All but these.
    pub fn without(off: &[Skip]) -> Self {
        Self { off: Skip::ALL.map(|skip| off.contains(&skip)) }
    }

    /// Whether this may be left out.
    pub fn allow(self, skip: Skip) -> bool {
        !self.off[skip as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_is_switched_off_alone() {
        for (place, skip) in Skip::ALL.into_iter().enumerate() {
            assert_eq!(skip as usize, place);
            let skips = Skips::without(&[skip]);
            assert!(Skip::ALL.into_iter().all(|other| skips.allow(other) == (other != skip)));
            assert_eq!(serde_json::to_value(skip).unwrap(), skip.name());
        }
    }
}
