//! Ways of turning a scene into a picture. All share scene, camera and medium, so that comparing them compares
//! the method alone. A new method is a file here, its shaders, and a line in [`METHODS`].

pub mod reference;
mod savings;
pub mod shell;

pub use savings::{Saving, savings};

use std::sync::Arc;

use crate::Result;
use crate::frame::Frame;
use crate::gpu::{DeviceChoice, Messages};
use crate::progress::{Interrupt, Progress, Silent};
use crate::scene::{Scene, Sizes, View};

/// What a method may use while it prepares and renders.
#[derive(Clone, Copy)]
pub struct Setup<'a> {
    /// The device, for methods that need one.
    pub device: &'a DeviceChoice,
    /// Where the Vulkan validation layers report, if they are to watch.
    pub validation: Option<&'a Messages>,
    /// Hears of the stages.
    pub progress: &'a Arc<dyn Progress>,
    /// Stops the run.
    pub interrupt: &'a Interrupt,
}

/// A method that holds a prepared scene.
pub trait Method {
    /// What was chosen for the scene before any of it is drawn, and why.
    fn plan(&self) -> Vec<Choice> {
        Vec::new()
    }

    /// Renders one view. The scene's own is `scene.view`.
    ///
    /// # Errors
    /// [`Error::Device`](crate::Error::Device), [`Error::OutOfMemory`](crate::Error::OutOfMemory), or
    /// [`Error::Interrupted`](crate::Error::Interrupted).
    fn render(&mut self, view: &View) -> Result<Frame>;

    /// Takes another scene in place of the one that there is, and keeps what was made of the parts that the two share
    /// ([`Arc::ptr_eq`]): the next frame of an animation. The next report says what was kept. On an error the method is as before.
    ///
    /// # Errors
    /// As [`Opened::prepare`].
    fn update(&mut self, scene: Arc<Scene>) -> Result<()>;

    /// Forgets what the last frame has left for one from the same eye, so that the next is timed whole.
    fn forget(&mut self);
}

/// One thing that a method has chosen.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Choice {
    /// What it is about.
    pub about: &'static str,
    /// What was chosen.
    pub chosen: &'static str,
    /// Why, a sentence without its full stop.
    pub why: String,
}

/// A method that has no scene yet, with its device where it needs one.
pub trait Opened: Send {
    /// Refuses what the device could not hold: to be asked before the volume is computed, which may take long.
    ///
    /// # Errors
    /// [`Error::Device`](crate::Error::Device) and [`Error::OutOfMemory`](crate::Error::OutOfMemory).
    fn admit(&self, sizes: &Sizes) -> Result<()>;

    /// The device's name and its driver's; `"cpu"` where there is none.
    fn device(&self) -> String;

    /// Takes a scene to the method: uploads it, builds what does not depend on the view.
    ///
    /// # Errors
    /// As [`Opened::admit`].
    fn prepare(self: Box<Self>, scene: Arc<Scene>) -> Result<Box<dyn Method>>;
}

/// Opens what a method runs on.
pub type Open = fn(&Setup<'_>) -> Result<Box<dyn Opened>>;

/// A line of the table of methods.
pub struct Entry {
    /// As given to `--method`.
    pub name: &'static str,
    /// One line for the help text.
    pub summary: &'static str,
    /// See [`Open`].
    pub open: Open,
}

impl Entry {
    /// Opens the method and takes a scene to it.
    ///
    /// # Errors
    /// [`Error::Device`](crate::Error::Device) and [`Error::OutOfMemory`](crate::Error::OutOfMemory).
    pub fn prepare(&self, scene: Arc<Scene>, setup: &Setup<'_>) -> Result<Box<dyn Method>> {
        (self.open)(setup)?.prepare(scene)
    }
}

/// All methods; the first is the default.
pub const METHODS: &[Entry] = &[
    Entry {
        name: "shell",
        summary: "tetrahedra in visibility order, marched on the device",
        open: shell::open,
    },
    Entry {
        name: "reference",
        summary: "the integral itself in f64, on the CPU; slow and exact",
        open: reference::open,
    },
];

/// The method of that name.
pub fn by_name(name: &str) -> Option<&'static Entry> {
    METHODS.iter().find(|entry| entry.name == name)
}

/// Renders the scene's own view with the `shell` method on the best device, silently: the shortest way to a picture.
///
/// # Errors
/// As [`Method::render`].
pub fn render(scene: Scene) -> Result<Frame> {
    let view = scene.view;
    let progress: Arc<dyn Progress> = Arc::new(Silent);
    let setup = Setup {
        device: &DeviceChoice::Any,
        validation: None,
        progress: &progress,
        interrupt: &Interrupt::default(),
    };
    shell::open(&setup)?.prepare(Arc::new(scene))?.render(&view)
}
