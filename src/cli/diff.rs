//! `mesoshell diff`: how far two images are apart.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use mesoshell::frame::file;
use mesoshell::{Result, metric};

use super::{Talk, table};

/// The images differ by more than they may.
const DIFFERENT: u8 = 1;

/// Compare two images, PNG or EXR, in linear premultiplied RGBA
#[derive(Args)]
pub struct Arguments {
    /// An image
    a: PathBuf,
    /// The image that it is compared with
    b: PathBuf,
    /// End with exit code 1 where the root mean square error is above this
    #[arg(long, value_name = "X")]
    max_rmse: Option<f64>,
}

/// # Errors
/// An image cannot be read, or their sizes differ.
pub fn run(arguments: Arguments, talk: Talk) -> Result<ExitCode> {
    let Arguments { a, b, max_rmse } = arguments;
    let metrics = metric::compare(&file::read(&a)?, &file::read(&b)?)?;
    talk.result(&metrics, || {
        let rows = [
            ("RMSE", format!("{:.6e}", metrics.rmse)),
            ("maximum", format!("{:.6e}", metrics.max)),
            ("99.9th percentile", format!("{:.6e}", metrics.p999)),
            ("PSNR", format!("{:.2} dB", metrics.psnr)),
            ("pixels", metrics.pixels.to_string()),
        ];
        format!("{} against {}\n{}", a.display(), b.display(), table(rows))
    })?;
    // Written so that a threshold that is not a number lets nothing pass.
    let passes = max_rmse.is_none_or(|threshold| metrics.rmse <= threshold);
    Ok(if passes { ExitCode::SUCCESS } else { DIFFERENT.into() })
}
