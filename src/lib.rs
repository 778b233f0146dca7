//! mesoshell renders semi-transparent 3D textures mapped into a shell around a triangle mesh.
//!
//! The base mesh is extruded into prisms, the prisms are split into tetrahedra ([`shell`]), the
//! tetrahedra are put into visibility order ([`order`]), and a [`method`] turns a loaded
//! [`scene`] into a [`frame`]. Modules depend on one another in one direction only:
//! `cli -> method -> gpu`, and all of them on the modules that know no device.
#![forbid(rustdoc::broken_intra_doc_links)]

pub mod bench;
pub mod error;
pub mod frame;
pub mod gpu;
pub mod mesh;
pub mod method;
pub mod metric;
pub mod order;
pub mod progress;
pub mod reference;
pub mod scene;
pub mod shell;
pub mod volume;

pub use error::{Error, Result};
