//! The camera: a pinhole that looks along a direction, and the grid of rays that it sends.
//!
//! ```text
//!   pixel (0,0) --> x         the ray of pixel (x, y) passes through its centre (x + 1/2, y + 1/2);
//!     |                       image rows run down, world Y runs up
//!     v y
//! ```

use glam::{DMat3, DVec2, DVec3};

/// The vertical field of view where nothing else is said, in degrees.
pub const DEFAULT_FOV_DEGREES: f64 = 40.0;

/// [`Camera::near`] where nothing else is said, as a part of the distance between eye and target.
pub const DEFAULT_NEAR: f64 = 1e-3;

/// A pinhole camera in world space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// The eye.
    pub eye: DVec3,
    /// The point in the middle of the picture.
    pub target: DVec3,
    /// Any direction that is up in the picture; not parallel to the line of sight.
    pub up: DVec3,
    /// Vertical field of view, in radians.
    pub fov_y: f64,
    /// Depth, in world units along the line of sight, before which nothing is seen; positive.
    pub near: f64,
}

/// An orthonormal camera frame in world space: `right x up = backward`, `forward = -backward`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraFrame {
    /// To the right in the picture.
    pub right: DVec3,
    /// Up in the picture.
    pub up: DVec3,
    /// Into the picture.
    pub forward: DVec3,
}

impl CameraFrame {
    /// View space, whose axes are right, up and forward, from world space: the frame's vectors as rows.
    pub fn view_from_world(&self) -> DMat3 {
        DMat3::from_cols(self.right, self.up, self.forward).transpose()
    }
}

/// A camera with the picture that it takes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Where from.
    pub camera: Camera,
    /// In pixels, at least 1.
    pub width: u32,
    /// In pixels, at least 1.
    pub height: u32,
    /// Whether [`Frame::depth`](crate::frame::Frame::depth) is wanted.
    pub depth: bool,
}

impl Camera {
    /// A camera with a field of view of 40 degrees that sees all of `points` (world space), from the
    /// front, a little to the right and above.
    pub fn framing(points: &[DVec3]) -> Self {
        let (low, high) = points
            .iter()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &p| (low.min(p), high.max(p)));
        let target = if points.is_empty() { DVec3::ZERO } else { 0.5 * (low + high) };
        let radius = points.iter().map(|p| p.distance(target)).fold(0.0, f64::max);
        let radius = if radius > 0.0 { radius } else { 1.0 };
        let fov_y = DEFAULT_FOV_DEGREES.to_radians();
        // The sphere around the points touches the picture's upper and lower edge.
        let distance = radius / (0.5 * fov_y).sin();
        let eye = target + distance * DVec3::new(0.4, 0.5, 1.0).normalize();
        Self { eye, target, up: DVec3::Y, fov_y, near: DEFAULT_NEAR * distance }
    }

    /// The camera's axes.
    pub fn frame(&self) -> CameraFrame {
        let forward = (self.target - self.eye).normalize();
        let right = forward.cross(self.up).normalize();
        CameraFrame { right, up: right.cross(forward), forward }
    }
}

impl View {
    /// The distance between neighbouring pixel centres on the plane at depth 1, in world units.
    /// Pixels are square.
    pub fn pixel_at_unit_depth(&self) -> f64 {
        2.0 * (0.5 * self.camera.fov_y).tan() / f64::from(self.height)
    }

    /// World-space direction, scaled to unit *depth* (not unit length), of the ray from the eye
    /// through a point of the picture in pixels: `(x + 0.5, y + 0.5)` is the centre of pixel `(x, y)`.
    pub fn ray_at_unit_depth(&self, point: DVec2) -> DVec3 {
        let frame = self.camera.frame();
        let half = 0.5 * DVec2::new(f64::from(self.width), f64::from(self.height));
        let offset = (point - half) * self.pixel_at_unit_depth();
        frame.forward + offset.x * frame.right - offset.y * frame.up
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn framing_takes_in_every_point() {
        let points: Vec<_> = (0..8)
            .map(|i| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1) * 5.0, f64::from(i >> 2)) + 100.0)
            .collect();
        let camera = Camera::framing(&points);
        let frame = camera.frame();
        let seen = |p: DVec3, tangent: f64| {
            let p = p - camera.eye;
            let depth = p.dot(frame.forward);
            depth > camera.near && p.dot(frame.up).hypot(p.dot(frame.right)) <= depth * tangent
        };
        let tangent = (0.5 * camera.fov_y).tan();
        assert!(points.iter().all(|&p| seen(p, tangent * (1.0 + 1e-12))));
        assert!(!points.iter().all(|&p| seen(p, 0.5 * tangent)), "a narrower picture cuts the points");
    }

    #[test]
    fn the_ray_through_the_middle_goes_forward() {
        let camera = Camera::framing(&[DVec3::ZERO, DVec3::ONE]);
        let view = View { camera, width: 7, height: 4, depth: false };
        assert_eq!(view.ray_at_unit_depth(DVec2::new(3.5, 2.0)), camera.frame().forward);
        let up_left = view.ray_at_unit_depth(DVec2::ZERO) - camera.frame().forward;
        assert!(up_left.dot(camera.frame().up) > 0.0 && up_left.dot(camera.frame().right) < 0.0);
    }
}
