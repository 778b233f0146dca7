//! A bounding volume hierarchy over tetrahedra or triangles, all measured from the eye.

use bvh::aabb::{Aabb, Bounded};
use bvh::bounding_hierarchy::BHShape;
use bvh::bvh::{Bvh, BvhNode};
use glam::DVec3;

use crate::scene::View;

/// A part of a straight line: `start + t direction` for `t` from `from` to `to`.
#[derive(Debug, Clone, Copy)]
pub struct Path {
    /// Relative to the eye.
    pub start: DVec3,
    /// World units per unit of `t`.
    pub direction: DVec3,
    /// At least 0.
    pub from: f64,
    /// May be infinite.
    pub to: f64,
    /// Where a path that lies in a face is thought to be shifted; in general position to such faces.
    pub aside: DVec3,
}

impl Path {
    /// The ray of an eye, whose `direction` is scaled to unit depth, beyond the near plane.
    pub fn of_eye(view: &View, direction: DVec3) -> Self {
        let frame = view.camera.frame();
        let aside = 0.618 * frame.right + 0.786 * frame.up;
        Self { start: DVec3::ZERO, direction, from: view.camera.near, to: f64::INFINITY, aside }
    }
}

/// Finds what may lie on a path.
pub struct Hierarchy {
    boxes: Vec<PaddedBox>,
    tree: Bvh<f64, 3>,
    /// The tree compares areas and extents with absolute limits: it is built at unit scale. This is the scale, in world units.
    unit: f64,
}

/// Boxes grow by this part of the largest coordinate, so that rounding loses nothing.
const BOX_PADDING: f64 = 1e-9;

/// Stands for the inverse of zero, so that no product of it is undefined.
const LARGEST_INVERSE: f64 = 1e300;

/// A path as boxes are met with: at unit scale.
struct Slabs {
    start: DVec3,
    inverse: DVec3,
    from: f64,
}

impl Slabs {
    fn meet(&self, bounds: &Aabb<f64, 3>, to: f64) -> bool {
        let [low, high] = [bounds.min, bounds.max].map(|corner| {
            let corner = DVec3::new(corner.x, corner.y, corner.z);
            (corner - self.start) * self.inverse
        });
        low.min(high).max_element().max(self.from) <= low.max(high).min_element().min(to)
    }
}

impl Hierarchy {
    /// Over the hulls of points relative to the eye, each with the index that it is known by.
    pub fn new<const N: usize>(hulls: impl Iterator<Item = (usize, [DVec3; N])>) -> Self {
        let mut boxes: Vec<PaddedBox> =
            hulls.map(|(index, points)| PaddedBox::around(&points, index)).collect();
        let unit = boxes.iter().map(PaddedBox::reach).fold(f64::MIN_POSITIVE, f64::max);
        boxes.iter_mut().for_each(|bounds| bounds.finish(unit));
        let tree = Bvh::build(&mut boxes);
        Self { boxes, tree, unit }
    }

    /// Calls `found` with the index of all that may lie on the path, in any order, and with its end, which `found` may draw
    /// nearer: below the path's beginning where enough is known.
    pub fn visit(&self, path: &Path, mut found: impl FnMut(usize, &mut f64)) {
        if self.boxes.is_empty() {
            return;
        }
        let limit = DVec3::splat(LARGEST_INVERSE);
        let slabs = Slabs {
            start: path.start / self.unit,
            inverse: (self.unit / path.direction).clamp(-limit, limit),
            from: path.from,
        };
        let mut to = path.to;
        self.descend(0, &slabs, &mut to, &mut found);
    }

    /// Calls `found` with the index of all that may meet a plane through the eye near the hull of some points in it, in any order.
    pub fn visit_plane(&self, normal: DVec3, hull: &[DVec3], mut found: impl FnMut(usize)) {
        if self.boxes.is_empty() {
            return;
        }
        let [low, high] = [DVec3::min, DVec3::max].map(|pick| hull.iter().copied().reduce(pick));
        let [low, high] = [low, high].map(|corner| corner.unwrap_or_default() / self.unit);
        let meets = |bounds: &Aabb<f64, 3>| {
            let [min, max] = [bounds.min, bounds.max].map(|corner| DVec3::new(corner.x, corner.y, corner.z));
            let (middle, half) = (0.5 * (min + max), 0.5 * (max - min));
            min.cmple(high).all()
                && max.cmpge(low).all()
                && normal.dot(middle).abs() <= normal.abs().dot(half)
        };
        let mut waiting = vec![0];
        while let Some(node) = waiting.pop() {
            match &self.tree.nodes[node] {
                BvhNode::Leaf { shape_index, .. } => found(self.boxes[*shape_index].index),
                BvhNode::Node { child_l_index, child_l_aabb, child_r_index, child_r_aabb, .. } => {
                    let children = [(*child_l_index, child_l_aabb), (*child_r_index, child_r_aabb)];
                    waiting.extend(
                        children.into_iter().filter(|(_, bounds)| meets(bounds)).map(|(child, _)| child),
                    );
                }
            }
        }
    }

    fn descend(&self, node: usize, slabs: &Slabs, to: &mut f64, found: &mut impl FnMut(usize, &mut f64)) {
        match &self.tree.nodes[node] {
            BvhNode::Leaf { shape_index, .. } => found(self.boxes[*shape_index].index, to),
            BvhNode::Node { child_l_index, child_l_aabb, child_r_index, child_r_aabb, .. } => {
                for (child, bounds) in [(*child_l_index, child_l_aabb), (*child_r_index, child_r_aabb)] {
                    if slabs.meet(bounds, *to) {
                        self.descend(child, slabs, to, found);
                    }
                }
            }
        }
    }
}

struct PaddedBox {
    index: usize,
    min: DVec3,
    max: DVec3,
    node: usize,
}

impl PaddedBox {
    fn around(points: &[DVec3], index: usize) -> Self {
        let [min, max] = [DVec3::min, DVec3::max].map(|pick| points.iter().copied().reduce(pick));
        Self { index, min: min.unwrap_or_default(), max: max.unwrap_or_default(), node: 0 }
    }

    fn reach(&self) -> f64 {
        self.min.abs().max(self.max.abs()).max_element()
    }

    fn finish(&mut self, unit: f64) {
        let padding = DVec3::splat(BOX_PADDING * self.reach());
        self.min = (self.min - padding) / unit;
        self.max = (self.max + padding) / unit;
    }
}

impl Bounded<f64, 3> for PaddedBox {
    fn aabb(&self) -> Aabb<f64, 3> {
        Aabb::with_bounds(self.min.to_array().into(), self.max.to_array().into())
    }
}

impl BHShape<f64, 3> for PaddedBox {
    fn set_bh_node_index(&mut self, node: usize) {
        self.node = node;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}
