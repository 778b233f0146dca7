//! SPIR-V of the shaders in `glsl/`, compiled by the build script: `STEM_STAGE`, as in [`SHELL_FRAG`].

/// SPIR-V as glslang wrote it; there is none but in the families of this module.
#[derive(Debug, Clone, Copy)]
pub struct Spirv(&'static [u32]);

impl Spirv {
    /// All of it, header included.
    pub fn words(self) -> &'static [u32] {
        self.0
    }
}

/// A shader in all of its variants: what a scene does not need is not compiled in.
#[derive(Debug, Clone, Copy)]
pub struct Family {
    /// What can be compiled in or left out.
    pub switches: &'static [&'static str],
    /// By set of switches, the first of them in the lowest bit.
    variants: &'static [Option<Spirv>],
}

impl Family {
    /// Every variant.
    pub fn all(&self) -> impl Iterator<Item = Spirv> {
        self.variants.iter().flatten().copied()
    }

    /// The variant with those of its switches that are `on`; others may be named, and do not count.
    ///
    /// # Panics
    /// Where one is on without another that it needs.
    pub fn with(&self, on: &[&str]) -> Spirv {
        let set =
            self.switches.iter().rev().fold(0, |set, switch| set << 1 | usize::from(on.contains(switch)));
        self.variants[set].expect("a switch is on with what it needs")
    }
}

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));
