//! The bust: a head with a face and hair, on a neck and shoulders, on a turned foot.

use glam::DVec3;

use super::Sculpture;
use super::sculpture::Shape;

const MARBLE: u32 = 0xe9e2d6;
const HAIR: u32 = 0xcdbfa8;
const STONE: u32 = 0x8b8f96;

pub(super) fn bust() -> Sculpture {
    let mut bust = Sculpture::new(0.02);
    bust.shade = 0.9;
    let v = DVec3::new;
    let ball = |centre: DVec3, radii: DVec3| Shape::Ellipsoid { centre, radii };
    let cone = |a: DVec3, b: DVec3, m: f64, n: f64| Shape::Cone { ends: [a, b], radii: [m, n] };

    // Shoulders and chest, cut off below as busts are.
    bust.add_both(ball(v(0.36, 0.62, -0.04), v(0.3, 0.2, 0.22)), MARBLE, 0.12);
    bust.add(ball(v(0.0, 0.56, 0.02), v(0.46, 0.3, 0.26)), MARBLE, 0.15);
    bust.add_both(ball(v(0.18, 0.5, 0.16), v(0.2, 0.16, 0.12)), MARBLE, 0.1);
    bust.carve(ball(v(0.0, 0.02, 0.0), v(1.2, 0.33, 1.0)), MARBLE, 0.05);
    bust.add_both(cone(v(0.03, 0.78, 0.16), v(0.3, 0.8, 0.06), 0.03, 0.035), MARBLE, 0.06);
    // The neck, leaning forward, with its two cords.
    bust.add(cone(v(0.0, 0.66, -0.04), v(0.0, 1.08, 0.0), 0.17, 0.145), MARBLE, 0.14);
    bust.add_both(cone(v(0.04, 0.8, 0.14), v(0.15, 1.08, -0.02), 0.025, 0.03), MARBLE, 0.06);

    // Skull, jaw and chin.
    bust.add(ball(v(0.0, 1.42, -0.04), v(0.265, 0.31, 0.32)), MARBLE, 0.08);
    bust.add(ball(v(0.0, 1.26, 0.08), v(0.19, 0.24, 0.2)), MARBLE, 0.1);
    bust.add(ball(v(0.0, 1.09, 0.2), v(0.08, 0.06, 0.07)), MARBLE, 0.08);
    bust.add_both(ball(v(0.14, 1.29, 0.17), v(0.08, 0.07, 0.07)), MARBLE, 0.08);
    // Sockets, brow, eyes.
    bust.carve_both(ball(v(0.1, 1.385, 0.3), v(0.075, 0.045, 0.08)), MARBLE, 0.05);
    bust.add_both(cone(v(0.03, 1.445, 0.255), v(0.17, 1.45, 0.19), 0.028, 0.02), MARBLE, 0.05);
    bust.add_both(ball(v(0.1, 1.38, 0.205), v(0.055, 0.035, 0.045)), MARBLE, 0.012);
    // Nose.
    bust.add(cone(v(0.0, 1.41, 0.255), v(0.0, 1.27, 0.335), 0.028, 0.042), MARBLE, 0.05);
    bust.add_both(ball(v(0.035, 1.255, 0.29), v(0.03, 0.026, 0.035)), MARBLE, 0.03);
    // Mouth.
    bust.add(ball(v(0.0, 1.195, 0.255), v(0.08, 0.022, 0.05)), MARBLE, 0.03);
    bust.add(ball(v(0.0, 1.155, 0.25), v(0.065, 0.024, 0.05)), MARBLE, 0.03);
    bust.carve(cone(v(-0.075, 1.176, 0.29), v(0.075, 1.176, 0.29), 0.012, 0.012), MARBLE, 0.02);
    // Ears.
    bust.add_both(ball(v(0.265, 1.36, -0.03), v(0.03, 0.085, 0.06)), MARBLE, 0.03);
    bust.carve_both(ball(v(0.3, 1.365, -0.01), v(0.022, 0.05, 0.03)), MARBLE, 0.02);

    // Hair: a cap of locks, swept back from a parting, and a bun.
    for lock in 0..9 {
        let across = f64::from(lock) / 8.0 - 0.5;
        let front = v(0.5 * across, 1.6 - 0.28 * across * across, 0.2 - 0.5 * across * across);
        let top = v(0.62 * across, 1.72 - 0.5 * across * across, -0.1);
        let back = v(0.5 * across, 1.42 - 0.1 * across.abs(), -0.36 + 0.3 * across * across);
        bust.tube(&[(front, 0.045), (top, 0.07), (back, 0.055)], HAIR, 0.02);
    }
    for side in 0..4 {
        let y = 1.56 - 0.09 * f64::from(side);
        let z = 0.1 - 0.075 * f64::from(side);
        bust.add_both(cone(v(0.2, y + 0.05, z + 0.03), v(0.25, y - 0.05, z - 0.2), 0.05, 0.055), HAIR, 0.02);
    }
    bust.add(ball(v(0.0, 1.4, -0.42), v(0.14, 0.14, 0.11)), HAIR, 0.03);
    bust.add(ball(v(0.0, 1.4, -0.35), v(0.2, 0.2, 0.06)), HAIR, 0.03);

    // The foot.
    bust.add(cone(v(0.0, 0.12, 0.0), v(0.0, 0.36, 0.0), 0.13, 0.1), STONE, 0.06);
    bust.add(ball(v(0.0, 0.3, 0.0), v(0.16, 0.035, 0.16)), STONE, 0.015);
    bust.add(ball(v(0.0, 0.02, 0.0), v(0.34, 0.12, 0.34)), STONE, 0.03);
    bust
}
