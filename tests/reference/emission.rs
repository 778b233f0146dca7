//! What texels send out of themselves.

use glam::DVec3;
use mesoshell::reference::{Reference, TOLERANCE};
use mesoshell::scene::Emission;

use super::{
    OPACITY_DISTANCE, THICKNESS, error, flat_shell, layers, level_zero, lit, rays, scene, slant, slanted_view,
};

#[test]
fn bright_colours_glow() {
    let (alpha, view) = (0.5_f32, slanted_view());
    let sigma = 2.0_f64.ln() / OPACITY_DISTANCE;
    // Straight colours, and the part of the glow that each has above a brightness of 1/4.
    for (colour, part) in
        [([0.5, 0.25, 0.125], 1.0 / 3.0), ([0.25, 0.0, 0.125], 0.0), ([0.5, 0.25, 2.0], 1.0)]
    {
        let [r, g, b] = colour.map(|channel: f32| channel * alpha);
        let mut scene = scene(flat_shell(), level_zero(layers(&[[r, g, b, alpha]])), view);
        let mut shading = lit(&scene, Vec::new());
        shading.ambient = DVec3::new(0.1, 0.2, 0.3);
        shading.emission = Emission { glow: 0.75, from: 0.25 };
        scene.shading = Some(shading);
        let reference = Reference::new(&scene, &view);
        for (point, direction) in rays(&view) {
            let total = 1.0 - (-sigma * THICKNESS * slant(direction)).exp();
            let expected = |part: f64| {
                let light = [0.1, 0.2, 0.3].map(|ambient| ambient + 0.75 * part);
                let [r, g, b] = std::array::from_fn(|c| f64::from(colour[c]) * light[c] * total);
                [r, g, b, total]
            };
            let found = reference.integrate_ray(point).rgba;
            assert!(error(&found, &expected(part)) <= TOLERANCE, "{found:?}");
            assert!(error(&found, &expected(part + 0.01)) > 1e-4);
        }
    }
}
