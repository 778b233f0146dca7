//! SPIR-V of the shaders in `glsl/`, compiled by the build script: `STEM_STAGE`, as in `SHELL_FRAG`.

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));
