//! What the tests that draw share: a watched device, and scenes without a file.
#![allow(dead_code, reason = "each test binary uses its own part")]

use std::sync::Arc;

use glam::{DMat3, DVec3};
use mesoshell::frame::Frame;
use mesoshell::gpu::{DeviceChoice, Messages};
use mesoshell::mesh::Mesh;
use mesoshell::method::{self, Method, Setup};
use mesoshell::progress::{Interrupt, Progress, Silent};
use mesoshell::scene::{Camera, March, Medium, Scene, View};
use mesoshell::shell::{Cell, EXTERIOR, Health, Shell, ShellOptions, Topology};
use mesoshell::volume::{Pyramid, Quantity, Volume};

/// A method under the eyes of the validation layers, synchronization validation included: any message, the device's
/// end included, fails the test. A test without a Vulkan driver or without the layers fails too, and says what to install.
pub struct Watched {
    method: Option<Box<dyn Method>>,
    messages: Messages,
}

impl Watched {
    pub fn prepare(name: &str, scene: &Arc<Scene>) -> Self {
        let messages = Messages::default();
        let progress: Arc<dyn Progress> = Arc::new(Silent);
        let setup = Setup {
            device: &DeviceChoice::Any,
            validation: Some(&messages),
            progress: &progress,
            interrupt: &Interrupt::default(),
        };
        let entry = method::by_name(name).expect("a known method");
        let method =
            entry.prepare(scene.clone(), &setup).unwrap_or_else(|error| panic!("{error}\n{error:?}"));
        Self { method: Some(method), messages }
    }

    pub fn render(&mut self, view: &View) -> Frame {
        let method = self.method.as_mut().expect("present until dropped");
        method.render(view).unwrap_or_else(|error| panic!("{error}"))
    }
}

impl Drop for Watched {
    fn drop(&mut self) {
        self.method = None;
        let messages = self.messages.all();
        if !std::thread::panicking() {
            assert!(messages.is_empty(), "the validation layers said:\n{}", messages.join("\n"));
        }
    }
}

/// A scene in a one-texel medium: `alpha` over `opacity_distance`, grey of the brightness `colour`.
pub fn constant_scene(mesh: &Mesh, thickness: f64, alpha: f32, colour: f32, view: View) -> Scene {
    let shell = Shell::build(mesh, &ShellOptions::new(thickness)).expect("a shell");
    let texel = [colour * alpha, colour * alpha, colour * alpha, alpha];
    Scene {
        shell,
        volume: Pyramid::build(Volume { size: [1, 1, 1], texels: vec![texel], quantity: Quantity::Opacity }),
        medium: Medium { opacity_distance: thickness, lod_footprint: 1.0 },
        view,
        march: March::Default { step: 0.5 },
    }
}

/// A square view of `pixels` a side.
pub fn view(eye: DVec3, target: DVec3, fov_degrees: f64, near: f64, pixels: u32) -> View {
    let up = if (target - eye).normalize().y.abs() > 0.99 { DVec3::X } else { DVec3::Y };
    View {
        camera: Camera { eye, target, up, fov_y: fov_degrees.to_radians(), near },
        width: pixels,
        height: pixels,
        depth: false,
    }
}

/// A shell of tetrahedra that share no vertex, each at one point of the texture.
pub fn loose(corners: &[[DVec3; 4]], texture: &[DVec3]) -> Shell {
    let count = corners.len();
    let topology = Topology {
        tetrahedra: (0..count as u32).map(|t| [4 * t, 4 * t + 1, 4 * t + 2, 4 * t + 3]).collect(),
        neighbours: vec![[EXTERIOR; 4]; count],
        ..Topology::default()
    };
    let cell = |&[a, b, c, d]: &[DVec3; 4]| {
        // Rows of the inverse of the edges are the gradients of the coordinates of b, c and d.
        let inverse = DMat3::from_cols(b - a, c - a, d - a).inverse();
        let [b, c, d] = [0, 1, 2].map(|i| inverse.row(i));
        Cell { gradients: [-(b + c + d), b, c, d], texture_from_world: DMat3::ZERO }
    };
    Shell {
        topology: Arc::new(topology),
        vertices: corners.as_flattened().to_vec(),
        texture: texture.iter().map(|point| [*point; 4]).collect(),
        cells: corners.iter().map(cell).collect(),
        health: Health { tetrahedra: count as u64, ..Health::default() },
    }
}

/// A bar whose high end lies over the low end of the next, a third of a turn further.
pub fn interlocking_bar(turn: f64, height: f64) -> [DVec3; 4] {
    let (sin, cos) = turn.sin_cos();
    let along = DVec3::new(-sin, cos, 0.0);
    let across = 0.05 * DVec3::new(cos, sin, 0.0);
    let middle = DVec3::new(0.3 * cos, 0.3 * sin, height);
    let (low, high) = (middle - along - 0.4 * DVec3::Z, middle + along + 0.4 * DVec3::Z);
    [low - across, low + across, high - 0.05 * DVec3::Z, high + 0.05 * DVec3::Z]
}
