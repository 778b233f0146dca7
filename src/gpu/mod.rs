//! The device layer: the only place with `ash` and `unsafe`.
//!
//! Everything here is safe to call, so long as a [`PipelineInfo`] and the indices that a [`Batch`] draws are those that
//! the shaders expect: that alone is not checked. Objects hold the [`Gpu`] that made them, so that nothing outlives its
//! device. Work is recorded, submitted and waited for one call at a time: there is one queue, and the
//! one barrier policy is that a submission sees all that the host wrote before it, and the host sees all that a
//! submission wrote once the call returns. Within a submission there are barriers only around what reads the target that
//! is drawn ([`Keeps::MarksByPicture`]).
#![allow(unsafe_code, reason = "Vulkan is called here, and nowhere else")]

pub mod buffer;
pub mod device;
pub mod draw;
mod format;
mod image;
pub mod instance;
mod levels;
mod memory;
pub mod pipeline;
pub mod shaders;
mod submit;
pub mod target;
pub mod texture;

pub use buffer::Buffer;
pub use device::{DeviceChoice, Gpu};
pub use draw::{Batch, Draw, DrawTimes, Sampled, draw};
pub use instance::{DeviceInfo, Messages, devices};
pub use pipeline::{Keeps, PICTURE, Pipeline, PipelineInfo};
pub use target::{Marked, Target};
pub use texture::Texture3d;
