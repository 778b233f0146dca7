//! Progress on standard error: one line that is drawn over on a terminal, else one line a finished stage.

use std::io::{IsTerminal, stderr};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use mesoshell::Error;
use mesoshell::progress::{Interrupt, Progress};
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

use super::{Talk, output};

/// Shows stages and their times. The line is wiped when it goes.
pub struct Line {
    bar: ProgressBar,
    prints_stages: bool,
    current: Mutex<Option<(String, Instant)>>,
}

impl Line {
    /// Draws on a terminal, prints elsewhere, and does neither where the user wants quiet.
    pub fn new(talk: Talk) -> Self {
        let is_terminal = stderr().is_terminal();
        let target = match talk.quiet || !is_terminal {
            true => ProgressDrawTarget::hidden(),
            false => ProgressDrawTarget::stderr(),
        };
        let bar = ProgressBar::with_draw_target(None, target);
        bar.set_style(
            ProgressStyle::with_template("{prefix:.dim}{msg} {elapsed}").expect("a valid template"),
        );
        bar.enable_steady_tick(Duration::from_millis(100));
        Self { bar, prints_stages: !is_terminal && !talk.quiet, current: Mutex::new(None) }
    }

    /// Lets something be said between two drawings of the line.
    pub fn aside(&self, say: impl FnOnce()) {
        self.bar.suspend(say);
    }

    /// Ends the current stage, if there is one, and begins the next.
    fn turn_to(&self, next: Option<&str>) {
        let now = Instant::now();
        let mut current = self.current.lock().unwrap_or_else(PoisonError::into_inner);
        let next = next.map(|name| (name.to_owned(), now));
        let Some((name, start)) = std::mem::replace(&mut *current, next) else { return };
        let finished = format!("{name}: {:.1} ms", 1e3 * (now - start).as_secs_f64());
        self.bar.set_prefix(format!("{finished}, "));
        if self.prints_stages {
            output::complain(&finished);
        }
    }
}

impl Progress for Line {
    fn stage(&self, name: &str) {
        self.turn_to(Some(name));
        self.bar.reset_elapsed();
        self.bar.set_message(name.to_owned());
    }

    fn fraction(&self, done: f64) {
        let current = self.current.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((name, _)) = &*current {
            self.bar.set_message(format!("{name} {:.0} %", 100.0 * done.clamp(0.0, 1.0)));
        }
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        self.turn_to(None);
        self.bar.finish_and_clear();
    }
}

/// Which of the two ended the run.
static TERMINATED: AtomicBool = AtomicBool::new(false);

/// The exit code of a run that was ended from outside: 128 and the number of the signal, as shells have it.
pub fn exit_code_of_interrupt() -> u8 {
    if TERMINATED.load(Ordering::Relaxed) { 143 } else { Error::Interrupted.exit_code() }
}

/// Lets the first Ctrl-C or SIGTERM end the run at its next check, and the second one at once.
pub fn listen(interrupt: &Interrupt) {
    let interrupt = interrupt.clone();
    // Without a handler the system's own ends the process, which will do.
    let Ok(mut signals) = Signals::new([SIGINT, SIGTERM]) else { return };
    std::thread::spawn(move || {
        for signal in signals.forever() {
            if interrupt.is_set() {
                std::process::exit(exit_code_of_interrupt().into());
            }
            TERMINATED.store(signal == SIGTERM, Ordering::Relaxed);
            interrupt.set();
        }
    });
}
