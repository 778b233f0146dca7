//! The dragon: a body along a spline with a crest of spikes, four legs, wings of plates between their fingers, and a head.

use glam::DVec3;

use super::Sculpture;
use super::sculpture::{Shape, spline};

const SCALES: u32 = 0x3f8f5c;
const BELLY: u32 = 0xc9b56a;
const WING: u32 = 0xb5553a;
const BONE: u32 = 0x4f7a4a;
const HORN: u32 = 0xe6dcc0;

pub(super) fn dragon() -> Sculpture {
    let mut dragon = Sculpture::new(0.02);
    dragon.shade = 0.85;
    let v = DVec3::new;
    let cone = |a: DVec3, b: DVec3, m: f64, n: f64| Shape::Cone { ends: [a, b], radii: [m, n] };
    let ball = |centre: DVec3, radii: DVec3| Shape::Ellipsoid { centre, radii };

    // From the tip of the tail, around and forward, to the head.
    let spine = [
        (v(0.95, 0.06, 0.62), 0.015),
        (v(1.1, 0.08, 0.1), 0.04),
        (v(0.85, 0.1, -0.55), 0.075),
        (v(0.3, 0.22, -0.85), 0.12),
        (v(0.0, 0.48, -0.5), 0.22),
        (v(0.0, 0.62, -0.1), 0.27),
        (v(0.0, 0.78, 0.25), 0.22),
        (v(0.0, 1.08, 0.42), 0.14),
        (v(0.0, 1.4, 0.36), 0.105),
        (v(0.0, 1.62, 0.48), 0.1),
    ];
    dragon.tube(&spine, SCALES, 0.06);
    dragon.tube(
        &[
            (v(0.0, 0.42, -0.36), 0.18),
            (v(0.0, 0.55, 0.02), 0.22),
            (v(0.0, 0.74, 0.36), 0.15),
            (v(0.0, 1.06, 0.5), 0.085),
        ],
        BELLY,
        0.03,
    );

    // The crest.
    let fine = spline(&spine);
    for (index, pair) in fine.windows(2).enumerate().filter(|(index, _)| index % 2 == 0) {
        let (here, next) = (pair[0], pair[1]);
        let forward = (next.0 - here.0).normalize();
        let up = (DVec3::Y - forward * forward.y - 0.35 * forward).normalize();
        let height = (0.05 + 0.55 * here.1) * if index > 6 { 1.0 } else { 0.7 };
        let foot = here.0 + 0.8 * here.1 * up;
        dragon.add(
            cone(foot, foot + (0.2 * here.1 + height) * up, 0.32 * here.1 + 0.012, 0.008),
            HORN,
            0.015,
        );
    }
    dragon.add(
        Shape::Plate {
            corners: [v(0.92, 0.08, 0.58), v(0.8, 0.06, 0.82), v(1.06, 0.06, 0.84)],
            radius: 0.025,
        },
        WING,
        0.02,
    );

    // The head: skull, muzzle, jaw, horns, eyes.
    dragon.add(ball(v(0.0, 1.68, 0.54), v(0.135, 0.12, 0.16)), SCALES, 0.05);
    dragon.add(cone(v(0.0, 1.66, 0.62), v(0.0, 1.6, 0.92), 0.1, 0.06), SCALES, 0.04);
    dragon.add(cone(v(0.0, 1.57, 0.6), v(0.0, 1.47, 0.86), 0.06, 0.035), BELLY, 0.02);
    dragon.add_both(ball(v(0.04, 1.66, 0.93), v(0.025, 0.03, 0.035)), SCALES, 0.02);
    dragon.add_both(cone(v(0.05, 1.75, 0.66), v(0.1, 1.75, 0.52), 0.035, 0.03), SCALES, 0.02);
    dragon.add_both(ball(v(0.1, 1.69, 0.64), v(0.03, 0.03, 0.035)), 0xf2c230, 0.003);
    dragon.add_both(cone(v(0.07, 1.76, 0.5), v(0.14, 1.92, 0.34), 0.04, 0.028), HORN, 0.02);
    dragon.add_both(cone(v(0.14, 1.92, 0.34), v(0.13, 2.02, 0.16), 0.028, 0.01), HORN, 0.01);
    dragon.add_both(cone(v(0.12, 1.6, 0.5), v(0.22, 1.6, 0.36), 0.03, 0.01), HORN, 0.02);

    // Legs: thigh, shin, foot, claws.
    for (hip, knee, ankle, thick) in [
        (v(0.17, 0.5, -0.42), v(0.36, 0.34, -0.2), v(0.34, 0.07, -0.42), 0.17),
        (v(0.15, 0.66, 0.26), v(0.3, 0.4, 0.14), v(0.27, 0.07, 0.36), 0.11),
    ] {
        dragon.add_both(cone(hip, knee, thick, 0.6 * thick), SCALES, 0.06);
        dragon.add_both(cone(knee, ankle, 0.55 * thick, 0.05), SCALES, 0.03);
        let foot = ankle.with_y(0.05) + 0.12 * DVec3::Z;
        dragon.add_both(cone(ankle, foot, 0.055, 0.05), SCALES, 0.02);
        for toe in [-1.0, 0.0, 1.0] {
            let tip = foot + v(0.06 * toe, -0.02, 0.12 - 0.03 * toe.abs());
            dragon.add_both(cone(foot, tip, 0.035, 0.012), HORN, 0.01);
        }
    }

    // Wings: an arm, four fingers, skin between them.
    let (shoulder, elbow, wrist) = (v(0.14, 0.86, 0.02), v(0.46, 1.22, -0.22), v(0.7, 1.62, 0.0));
    let tips = [v(1.28, 1.86, -0.3), v(1.34, 1.34, -0.66), v(1.02, 0.92, -0.86), v(0.6, 0.78, -0.78)];
    dragon.add_both(cone(shoulder, elbow, 0.075, 0.05), BONE, 0.04);
    dragon.add_both(cone(elbow, wrist, 0.05, 0.042), BONE, 0.02);
    for tip in tips {
        dragon.add_both(cone(wrist, tip, 0.034, 0.014), BONE, 0.01);
    }
    dragon.add_both(cone(wrist, wrist + v(0.0, 0.14, 0.07), 0.03, 0.008), HORN, 0.01);
    let hollow = |a: DVec3, b: DVec3| 0.5 * (a + b) + 0.14 * (wrist - 0.5 * (a + b));
    let root = v(0.08, 0.62, -0.46);
    let mut skin = |corners| dragon.add_both(Shape::Plate { corners, radius: 0.016 }, WING, 0.01);
    for pair in tips.windows(2) {
        let edge = hollow(pair[0], pair[1]);
        skin([wrist, pair[0], edge]);
        skin([wrist, edge, pair[1]]);
    }
    skin([wrist, tips[3], elbow]);
    skin([elbow, tips[3], root]);
    skin([elbow, root, shoulder]);
    dragon
}
