//! The camera: a pinhole that looks along a direction, and the grid of rays that it sends.
//!
//! ```text
//!   pixel (0,0) --> x         the ray of pixel (x, y) passes through its centre (x + 1/2, y + 1/2);
//!     |                       image rows run down, world Y runs up
//!     v y
//! ```

use glam::{DVec2, DVec3};

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
