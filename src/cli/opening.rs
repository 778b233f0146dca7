//! The device is opened while the scene is loaded: drivers take tens of milliseconds on one processor.

use std::cell::{Cell, OnceCell};
use std::panic::resume_unwind;
use std::path::Path;
use std::thread::{self, ScopedJoinHandle};

use mesoshell::Result;
use mesoshell::frame::{Stage, Stopwatch};
use mesoshell::method::{Entry, Opened, Setup};
use mesoshell::scene::{self, Loaded, Sizes};

/// A volume of no more texels is computed in a fraction of a second: whether the device admits it may be asked after that.
const QUICKLY_COMPUTED: u64 = 1 << 22;

/// What comes of opening a method on another thread.
type Thread<'scope> = ScopedJoinHandle<'scope, Result<Box<dyn Opened>>>;

/// A method that is opened on another thread.
struct Opening<'scope> {
    thread: Cell<Option<Thread<'scope>>>,
    opened: OnceCell<Box<dyn Opened>>,
}

impl Opening<'_> {
    /// Waits for it; `None` where that has failed before.
    fn opened(&self) -> Result<Option<&dyn Opened>> {
        if let Some(thread) = self.thread.take() {
            let opened = thread.join().unwrap_or_else(|panic| resume_unwind(panic))?;
            self.opened.get_or_init(|| opened);
        }
        Ok(self.opened.get().map(|opened| &**opened))
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
        let put_off = Cell::new(None);
        let admit = |sizes: &Sizes| {
            let sizes = Sizes { picture: size.unwrap_or(sizes.picture), ..*sizes };
            if sizes.volume.map(u64::from).iter().product::<u64>() <= QUICKLY_COMPUTED {
                put_off.set(Some(sizes));
                return Ok(());
            }
            opening.opened()?.map_or(Ok(()), |opened| opened.admit(&sizes))
        };
        let loaded = scene::load_if(path, overrides, setup.progress.as_ref(), &admit);
        if loaded.is_ok() {
            setup.progress.stage("opening the device");
        }
        let mut watch = Stopwatch::start();
        if let (Some(opened), Some(sizes)) = (opening.opened()?, put_off.get()) {
            opened.admit(&sizes)?;
        }
        watch.lap("open");
        let waited = watch.finish().remove(0);
        let loaded = loaded?;
        Ok((opening.opened.into_inner().expect("else the scene was not let through"), loaded, waited))
    })
}
