//! mesoshell renders semi-transparent 3D textures mapped into a shell around a triangle mesh: fur, fog, stones, cloth.
//!
//! The base [`mesh`] is extruded into prisms, the prisms are split into tetrahedra ([`shell`]), the tetrahedra are put
//! into visibility [`order`], and a [`method`] marches the viewing rays through the [`volume`] that fills them. A loaded
//! [`scene`] goes in, a [`frame`] comes out: linear premultiplied RGBA, depth, and a report of what it cost.
//!
//! ```
//! use mesoshell::{frame, method, progress::Silent, scene};
//!
//! # let folder = tempfile::tempdir()?;
//! let overrides = ["image.size=[64, 64]".to_owned()];
//! let loaded = scene::load("scenes/fur-sphere.toml".as_ref(), &overrides, &Silent)?;
//! let frame = method::render(loaded.scene)?;
//! let covered = frame.image.rgba.iter().filter(|[.., alpha]| *alpha > 0.5).count();
//! assert!(covered > 2000, "the ball fills more than half of the 4096 pixels");
//! frame::file::write(folder.path().join("fur.png"), &frame.image, &loaded.backdrop)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The module [`scene`] shows a scene put together by hand, without a file. Other methods than the default one, another
//! device, many views of one scene and the validation layers go through the table [`method::METHODS`].
//!
//! # The dependency rule
//!
//! Modules depend on one another in one direction only: the command line on [`bench`](mod@bench), [`stress`] and [`method`], these on
//! [`gpu`], and all of them on the modules that know no device. What a shader computes is also computed without one:
//! [`reference`](mod@reference) evaluates the same integral in f64 on the CPU, and [`metric`] tells how far the two are
//! apart. `ash`, and all code that the compiler cannot check, is in [`gpu`] alone.
#![forbid(rustdoc::broken_intra_doc_links)]

pub mod bench;
pub mod error;
pub mod film;
pub mod fingerprint;
pub mod frame;
pub mod gpu;
mod input;
pub mod instrument;
pub mod mesh;
pub mod method;
pub mod metric;
pub mod order;
mod output;
pub mod progress;
pub mod reference;
pub mod scene;
pub mod shell;
pub mod stress;
pub mod value;
pub mod volume;

pub use error::{Error, Result};
