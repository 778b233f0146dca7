//! SPIR-V of the shaders in `glsl/`, compiled by the build script: `STEM_STAGE`, as in `SHELL_FRAG`.

/// SPIR-V as glslang wrote it; there is none but the constants of this module.
#[derive(Debug, Clone, Copy)]
pub struct Spirv(&'static [u32]);

impl Spirv {
    /// All of it, header included.
    pub fn words(self) -> &'static [u32] {
        self.0
    }
}

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));
