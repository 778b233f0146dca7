//! The chain: links in turn flat and upright. Their pattern repeats every two units along X.

use std::ops::Range;

use glam::DVec3;

use super::Sculpture;
use super::sculpture::Shape;

/// Half of a link's straight part, the radius of its bends, that of its wire.
const STRAIGHT: f64 = 0.44;
const RING: f64 = 0.3;
const WIRE: f64 = 0.115;

/// After how many units the pattern repeats.
pub(super) const PERIOD: f64 = 2.0;

pub(super) fn chain(links: Range<i32>) -> Sculpture {
    let mut chain = Sculpture::new(0.02);
    for link in links {
        let (axis, colour) = match link.rem_euclid(2) {
            0 => (DVec3::new(0.0, 1.0, -1.0), 0xd0a54a),
            _ => (DVec3::new(0.0, 1.0, 1.0), 0xc2c6cc),
        };
        let centre = DVec3::new(f64::from(link), RING + WIRE, 0.0);
        let shape =
            Shape::Link { centre, axis: axis.normalize(), straight: STRAIGHT, ring: RING, radius: WIRE };
        chain.add(shape, colour, 0.0);
    }
    chain
}
