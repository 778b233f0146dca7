//! Barr's deformations along an axis: twist, taper, bend.

use glam::{DMat3, DQuat, DVec3};

use super::outer;

/// Turns every cross-section about the axis: by 0 before the range, by `angle` behind it, in proportion within.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Twist {
    /// Unit length.
    pub axis: DVec3,
    /// A point on the axis, from which `range` is measured.
    pub centre: DVec3,
    /// From and to, in world units along the axis, ascending.
    pub range: [f64; 2],
    /// Degrees.
    pub angle: f64,
}

/// Scales every cross-section about the axis: by 1 before the range, by `factor` behind it, linearly within.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Taper {
    /// Unit length.
    pub axis: DVec3,
    /// A point on the axis, from which `range` is measured.
    pub centre: DVec3,
    /// From and to, in world units along the axis, ascending.
    pub range: [f64; 2],
    /// Above 0.
    pub factor: f64,
}

/// Bends the axis into an arc of its own length: what lies within the range is bent by `angle` in all, what lies
/// without goes on straight. The point of the range that is nearest to `centre` stays, and the axis its tangent there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bend {
    /// Unit length.
    pub axis: DVec3,
    /// A point on the axis, from which `range` is measured.
    pub centre: DVec3,
    /// Unit length, perpendicular to the axis: to where the axis bends, when the angle is positive.
    pub towards: DVec3,
    /// From and to, in world units along the axis, ascending.
    pub range: [f64; 2],
    /// Degrees.
    pub angle: f64,
}

/// The part of the range that lies before `s`, 0..1, and its derivative.
fn ramp(s: f64, [from, to]: [f64; 2]) -> (f64, f64) {
    let part = (s - from) / (to - from);
    if part <= 0.0 {
        (0.0, 0.0)
    } else if part >= 1.0 {
        (1.0, 0.0)
    } else {
        (part, 1.0 / (to - from))
    }
}

impl Twist {
    pub(super) fn at(&self, point: DVec3) -> (DVec3, DMat3) {
        let from_centre = point - self.centre;
        let (part, change) = ramp(from_centre.dot(self.axis), self.range);
        let angle = self.angle.to_radians();
        let rotation = DMat3::from_quat(DQuat::from_axis_angle(self.axis, angle * part));
        let turned = rotation * from_centre;
        // What is farther along is turned more.
        let jacobian = rotation + outer(angle * change * self.axis.cross(turned), self.axis);
        (self.centre + turned, jacobian)
    }
}

impl Taper {
    pub(super) fn at(&self, point: DVec3) -> (DVec3, DMat3) {
        let from_centre = point - self.centre;
        let along = from_centre.dot(self.axis);
        let across = from_centre - along * self.axis;
        let (part, change) = ramp(along, self.range);
        let scale = 1.0 + (self.factor - 1.0) * part;
        let along_axis = outer(self.axis, self.axis);
        let jacobian = along_axis
            + (DMat3::IDENTITY - along_axis) * scale
            + outer((self.factor - 1.0) * change * across, self.axis);
        (self.centre + along * self.axis + scale * across, jacobian)
    }
}

impl Bend {
    pub(super) fn at(&self, point: DVec3) -> (DVec3, DMat3) {
        let [from, to] = self.range;
        let from_centre = point - self.centre;
        let (along, towards) = (from_centre.dot(self.axis), from_centre.dot(self.towards));
        let rate = self.angle.to_radians() / (to - from);
        let start = 0.0f64.clamp(from, to);
        let bent = along.clamp(from, to);
        let theta = rate * (bent - start);
        let (sine, cosine) = theta.sin_cos();
        // Barr's radius 1 / rate is infinite where the angle is 0, sin(theta) / rate is not.
        let (sinc, cosc) = if theta.abs() < 1e-4 {
            (1.0 - theta * theta / 6.0, theta / 2.0)
        } else {
            (sine / theta, (1.0 - cosine) / theta)
        };
        let beyond = along - bent;
        let moved_along = start + (bent - start) * sinc - towards * sine + beyond * cosine;
        let moved_towards = (bent - start) * cosc + towards * cosine + beyond * sine;
        // Fibres nearer to the centre of curvature are shorter.
        let stretch = if beyond == 0.0 { 1.0 - rate * towards } else { 1.0 };
        let third = outer(self.axis.cross(self.towards), self.axis.cross(self.towards));
        let jacobian = third
            + outer(stretch * (cosine * self.axis + sine * self.towards), self.axis)
            + outer(cosine * self.towards - sine * self.axis, self.towards);
        let moved = point + (moved_along - along) * self.axis + (moved_towards - towards) * self.towards;
        (moved, jacobian)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    const UP: Twist = Twist { axis: DVec3::Y, centre: DVec3::ZERO, range: [0.0, 2.0], angle: 90.0 };

    fn near(a: DVec3, b: DVec3) -> bool {
        // Sines and a few products.
        a.distance(b) < 1e-14
    }

    #[test]
    fn a_twist_turns_counter_clockwise_as_far_as_it_has_come() {
        let at = |x, y, z| UP.at(DVec3::new(x, y, z)).0;
        assert!(near(at(1.0, -3.0, 0.0), DVec3::new(1.0, -3.0, 0.0)));
        let half = PI / 4.0;
        assert!(near(at(1.0, 1.0, 0.0), DVec3::new(half.cos(), 1.0, -half.sin())));
        assert!(near(at(1.0, 5.0, 0.0), DVec3::new(0.0, 5.0, -1.0)));
    }

    #[test]
    fn a_taper_scales_across() {
        let taper = Taper { axis: DVec3::Y, centre: DVec3::X, range: [0.0, 1.0], factor: 0.5 };
        assert!(near(taper.at(DVec3::new(3.0, 0.5, 4.0)).0, DVec3::new(2.5, 0.5, 3.0)));
        assert!(near(taper.at(DVec3::new(3.0, 9.0, 4.0)).0, DVec3::new(2.0, 9.0, 2.0)));
    }

    /// A half circle of the length 2, radius 2 / pi: its ends, a point beyond, and one inside the arc.
    #[test]
    fn a_bend_lays_the_axis_on_a_circle() {
        let bend =
            Bend { axis: DVec3::Y, centre: DVec3::ZERO, towards: DVec3::X, range: [0.0, 2.0], angle: 180.0 };
        let radius = 2.0 / PI;
        let at = |x, y, z| bend.at(DVec3::new(x, y, z)).0;
        assert!(near(at(0.0, 1.0, 0.0), DVec3::new(radius, radius, 0.0)));
        assert!(near(at(0.0, 2.0, 7.0), DVec3::new(2.0 * radius, 0.0, 7.0)));
        assert!(near(at(0.0, 2.5, 0.0), DVec3::new(2.0 * radius, -0.5, 0.0)));
        assert!(near(at(0.1, 1.0, 0.0), DVec3::new(radius, radius - 0.1, 0.0)));
        assert!(near(at(0.0, -1.0, 0.0), DVec3::new(0.0, -1.0, 0.0)));
        let straight = Bend { angle: 0.0, ..bend };
        assert!(near(straight.at(DVec3::new(0.3, 1.2, 0.4)).0, DVec3::new(0.3, 1.2, 0.4)));
    }
}
