//! Strands: thin curved things that stand on the base surface, as hairs and blades of grass.

use glam::Vec3;

use super::grid::Grid;

/// Points of a strand's centre line, from root to tip.
pub(super) const POINTS: usize = 20;

/// The centre line of a strand, in tile widths; not wrapped. It nowhere comes down again.
pub(super) struct Strand {
    pub points: [Vec3; POINTS],
}

/// Where a point lies to a strand.
pub(super) struct Nearest {
    /// 0 at the root, 1 at the tip.
    pub along: f32,
    /// From the centre line to the point, in tile widths.
    pub offset: Vec3,
}

impl Strand {
    /// Hands every texel of the slice at height `z` that is within `reach` of the strand to `paint`, with its
    /// nearest place on the strand.
    pub fn near_slice(
        &self,
        grid: &Grid,
        z: f32,
        reach: f32,
        slice: &mut [[f32; 4]],
        paint: impl Fn(&Nearest, &mut [f32; 4]),
    ) {
        let above = self.points.partition_point(|point| point.z <= z + reach).min(POINTS - 1);
        let below = self.points.partition_point(|point| point.z < z - reach).saturating_sub(1);
        let near = &self.points[below..=above];
        let last = self.points[POINTS - 1].z;
        if last < z - reach || near.len() < 2 {
            return;
        }
        let low = near.iter().copied().reduce(Vec3::min).unwrap_or_default() - reach;
        let high = near.iter().copied().reduce(Vec3::max).unwrap_or_default() + reach;
        for (j, y) in grid.between(1, low.y, high.y) {
            for (i, x) in grid.between(0, low.x, high.x) {
                if let Some(nearest) = nearest_on(near, below, Vec3::new(x, y, z), reach) {
                    paint(&nearest, &mut slice[j * grid.size[0] + i]);
                }
            }
        }
    }
}

/// The nearest place on the centre line `points`, whose first is point `first` of its strand; none where it
/// is farther than `reach`.
fn nearest_on(points: &[Vec3], first: usize, position: Vec3, reach: f32) -> Option<Nearest> {
    let mut squared = reach * reach;
    let mut nearest = None;
    for (index, ends) in points.windows(2).enumerate() {
        let (edge, to) = (ends[1] - ends[0], position - ends[0]);
        let t = (to.dot(edge) / edge.length_squared()).clamp(0., 1.);
        let offset = to - t * edge;
        if offset.length_squared() < squared {
            squared = offset.length_squared();
            nearest = Some(((first + index) as f32 + t, offset));
        }
    }
    nearest.map(|(place, offset)| Nearest { along: place / (POINTS - 1) as f32, offset })
}
