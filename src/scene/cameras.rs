//! From the sections `[camera]` and `[cameras.NAME]` of a scene file to the camera that sees it.

use glam::{DQuat, DVec3};

use super::Camera;
use super::camera::DEFAULT_NEAR;
use super::file::{CameraSection, SceneFile};
use super::text::Text;
use crate::Result;
use crate::value::{Exactly, Finite};

/// The camera that the text asks for, if it does: the one that `view` names, else that of `[camera]`.
///
/// # Errors
/// [`Error`](crate::Error) with the spot.
pub(super) fn camera(text: &Text, file: &SceneFile) -> Result<Option<Camera>> {
    let Some(view) = &file.view else {
        return file.camera.as_ref().map(|section| of(text, section)).transpose();
    };
    let Some(section) = file.cameras.get(view.get_ref()) else {
        let names = file.cameras.keys().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
        let known = if names.is_empty() { "a section [cameras.NAME]".to_owned() } else { names };
        let message = format!("there is no camera `{}`, expected {known}", view.get_ref());
        return Err(text.error(view.span(), message));
    };
    of(text, section).map(Some)
}

/// A camera, whose axes are checked to exist.
fn of(text: &Text, section: &CameraSection) -> Result<Camera> {
    let vector = |v: &Exactly<3, Finite>| DVec3::from_array(v.0.map(|x| x.0));
    let (eye, target) = (vector(&section.eye), vector(section.target.get_ref()));
    let distance = eye.distance(target);
    if !distance.is_normal() {
        return Err(text.error(section.target.span(), "the target must be a point other than the eye"));
    }
    let up = section.up.as_ref().map_or(DVec3::Y, |up| vector(up.get_ref()));
    // Below this sine rounding alone would decide which way is up.
    let sine = (target - eye).normalize().cross(up.normalize_or_zero()).length();
    if sine < 1e-9 {
        return Err(text.error(
            section.up.as_ref().unwrap_or(&section.target).span(),
            "`up` must not be zero, nor point along the line of sight",
        ));
    }
    // A turntable: whoever goes round the scene has it turn before their eyes.
    let turn = DQuat::from_axis_angle(up.normalize(), section.orbit.0.to_radians());
    let eye = if section.orbit.0 == 0.0 { eye } else { target + turn * (eye - target) };
    let near = section.near.map_or(DEFAULT_NEAR * distance, |near| near.0);
    Ok(Camera { eye, target, up, fov_y: section.fov.0.to_radians(), near })
}
