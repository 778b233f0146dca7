//! The device is opened while the scene is loaded: drivers take tens of milliseconds on one processor.

use std::cell::{Cell, OnceCell};
use std::panic::resume_unwind;
use std::path::Path;
use std::thread::{self, ScopedJoinHandle};

use mesoshell::frame::{Stage, Stopwatch};
use mesoshell::method::{Entry, Opened, Setup};
use mesoshell::scene::{self, Loaded, Sizes};
use mesoshell::{Error, Result};

/// A volume of no more texels is computed in a fraction of a second: whether the device admits it may be asked after that.
const QUICKLY_COMPUTED: u64 = 1 << 22;

/// A method that is opened on another thread.
struct Opening<'scope> {
    thread: Cell<Option<ScopedJoinHandle<'scope, Result<Box<dyn Opened>>>>>,
    opened: OnceCell<Result<Box<dyn Opened>>>,
}

impl Opening<'_> {
    /// Waits for it.
    fn opened(&self) -> &Result<Box<dyn Opened>> {
        self.opened.get_or_init(|| {
            let thread = self.thread.take().expect("asked for once");
            thread.join().unwrap_or_else(|panic| resume_unwind(panic))
        })
    }
}

/// Opens the method, and loads the scene as [`scene::load_if`] does, for pictures of `size`, or of the scene's own. Where several
/// things are wrong, that of the device is told. The stage is how long the device took after that.
///
/// # Errors
/// Those of [`Entry::open`], [`scene::load_if`] and [`Opened::admit`].
pub fn open_and_load(
    entry: &Entry,
    setup: &Setup<'_>,
    path: &Path,
    overrides: &[String],
    size: Option<[u32; 2]>,
) -> Result<(Box<dyn Opened>, Loaded, Stage)> {
    thread::scope(|scope| {
        let opening =
            Opening { thread: Cell::new(Some(scope.spawn(|| (entry.open)(setup)))), opened: OnceCell::new() };
        let asked = Cell::new(None);
        let admit = |sizes: &Sizes| {
            let sizes = Sizes { picture: size.unwrap_or(sizes.picture), ..*sizes };
            asked.set(Some(sizes));
            if sizes.volume.map(u64::from).iter().product::<u64>() <= QUICKLY_COMPUTED {
                return Ok(());
            }
            // What keeps it from being opened is told below.
            opening.opened().as_ref().map_or(Err(Error::Interrupted), |opened| opened.admit(&sizes))
        };
        let loaded = scene::load_if(path, overrides, setup.progress.as_ref(), &admit);
        setup.progress.stage("opening the device");
        let mut watch = Stopwatch::start();
        opening.opened();
        watch.lap("open");
        let opened = opening.opened.into_inner().expect("opened just now")?;
        if let Some(sizes) = asked.get() {
            opened.admit(&sizes)?;
        }
        let waited = watch.finish().remove(0);
        Ok((opened, loaded?, waited))
    })
}
