//! The tree: a trunk with roots, branches that fork three times, and a tuft of leaves at the end of each.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};
use rand::RngExt;
use rand_pcg::Pcg32;

use super::Sculpture;
use super::sculpture::Shape;

const BARK: u32 = 0x8a6b4a;
const LEAVES: [u32; 4] = [0x4f8a2e, 0x6fa63a, 0x8fbb45, 0x3f7a34];

pub(super) fn tree() -> Sculpture {
    let mut tree = Sculpture::new(0.024);
    tree.shade = 0.85;
    let mut random = Pcg32::new(7, 7);
    let trunk = [
        (DVec3::new(0.02, -0.05, 0.0), 0.17),
        (DVec3::new(0.0, 0.25, 0.01), 0.115),
        (DVec3::new(-0.05, 0.55, 0.02), 0.095),
        (DVec3::new(0.0, 0.85, 0.0), 0.085),
    ];
    tree.tube(&trunk, BARK, 0.05);
    for root in 0..6 {
        let outward =
            DQuat::from_rotation_y(TAU * (f64::from(root) + 0.4 * random.random::<f64>()) / 6.0) * DVec3::X;
        let ends = [outward * 0.06 + 0.16 * DVec3::Y, outward * 0.36 - 0.02 * DVec3::Y];
        tree.add(Shape::Cone { ends, radii: [0.06, 0.02] }, BARK, 0.06);
    }
    for limb in 0..6 {
        let around = DQuat::from_rotation_y(TAU * (f64::from(limb) + 0.5 * random.random::<f64>()) / 6.0);
        let tilt = if limb % 2 == 0 { 1.05 } else { 0.65 };
        let direction = around * DQuat::from_rotation_z(-tilt) * DVec3::Y;
        let start = DVec3::new(-0.02, 0.62 + 0.04 * f64::from(limb), 0.0);
        grow(&mut tree, &mut random, start, direction, [0.42, 0.06], 2);
    }
    grow(&mut tree, &mut random, DVec3::new(0.0, 0.85, 0.0), DVec3::Y, [0.42, 0.07], 2);
    tree
}

/// A branch of a length and a radius, which forks so many times, then ends in leaves.
fn grow(
    tree: &mut Sculpture,
    random: &mut Pcg32,
    start: DVec3,
    direction: DVec3,
    size: [f64; 2],
    forks: u32,
) {
    let [length, radius] = size;
    let end = start + length * direction;
    // Branches sag, and turn up again.
    let middle = start.lerp(end, 0.5) + 0.08 * length * (direction.y - 0.6) * DVec3::Y;
    tree.add(Shape::Cone { ends: [start, middle], radii: [radius, 0.8 * radius] }, BARK, 0.02);
    tree.add(Shape::Cone { ends: [middle, end], radii: [0.8 * radius, 0.6 * radius] }, BARK, 0.02);
    if forks == 0 {
        tuft(tree, random, end);
        return;
    }
    let turn = TAU * random.random::<f64>();
    for fork in 0..3 {
        let aside = DQuat::from_axis_angle(direction, turn + TAU * f64::from(fork) / 3.0)
            * direction.any_orthonormal_vector();
        let next = (direction + 0.75 * aside + 0.25 * DVec3::Y).normalize();
        grow(tree, random, end, next, [0.58 * length, 0.6 * radius], forks - 1);
    }
    tuft(tree, random, end);
}

fn tuft(tree: &mut Sculpture, random: &mut Pcg32, centre: DVec3) {
    let colour = LEAVES[random.random_range(0..LEAVES.len())];
    for _ in 0..3 {
        let mut around = || random.random::<f64>() - 0.5;
        let place = centre + 0.14 * DVec3::new(around(), 0.6 * around() + 0.15, around());
        let size = 0.055 + 0.03 * (around() + 0.5);
        tree.add(Shape::Ellipsoid { centre: place, radii: size * DVec3::new(1.2, 0.75, 1.2) }, colour, 0.012);
    }
}
