//! Results for people and for spreadsheets.

pub mod csv;
pub mod html;
pub(crate) mod picture;
pub(crate) mod plot;

/// Names of errors in the order in which they are shown, and what people call them. Others follow by their own name.
const ERRORS: [(&str, &str); 5] =
    [("rmse", "RMSE"), ("p999", "99.9 %"), ("max", "max"), ("psnr", "PSNR (dB)"), ("flip", "FLIP")];

/// The names of all errors of a point, those of [`ERRORS`] first. The number of pixels is none.
fn error_names(point: &super::Point) -> Vec<String> {
    let known = ERRORS.iter().map(|(name, _)| *name).filter(|name| point.error.contains_key(*name));
    let others = point.error.keys().map(String::as_str);
    let others = others.filter(|name| *name != "pixels" && ERRORS.iter().all(|(known, _)| known != name));
    known.chain(others).map(str::to_owned).collect()
}

/// What people call an error.
fn error_title(name: &str) -> &str {
    ERRORS.iter().find(|(known, _)| *known == name).map_or(name, |(_, title)| title)
}
