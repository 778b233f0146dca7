//! The texture along a ray: trilinear reconstruction as one cubic polynomial a cell.
//!
//! Texel centres lie at `(i + 1/2) / n`; u and v repeat, w clamps to the edge (Vulkan 1.3, "Texel
//! Filtering"). A *cell* is the box between eight neighbouring texel centres. Texture
//! coordinates are affine in the ray's depth, so within a cell the reconstruction is a product of
//! three linear functions: a cubic, kept in Bernstein form. Its coefficients are weighted means
//! of the corners, so `1 - alpha` is a sum of terms that are not negative and keeps its relative accuracy
//! where alpha comes near 1, as a power basis would not.

use glam::DVec3;

use crate::volume::{DirectionLevel, Volume};

/// Premultiplied red, green, blue, then alpha, then `1 - alpha`; or of directions x, y, z times their weight, then the weight.
/// Whoever needs less reconstructs the last few of them: two are alpha and `1 - alpha`.
pub type Texel<const N: usize = 5> = [f64; N];

/// Index of alpha in a [`Texel`].
pub const ALPHA: usize = 3;
/// Index of `1 - alpha` in a [`Texel`].
pub const CLEAR: usize = 4;

/// A texel cubic over a piece of a ray, in Bernstein form over `0..1`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cubic<const N: usize = 5>(pub [Texel<N>; 4]);

impl<const N: usize> Cubic<N> {
    /// Neither colour nor opacity anywhere.
    pub const EMPTY: Self = {
        let mut texel = [0.0; N];
        texel[N - 1] = 1.0;
        Self([texel; 4])
    };

    /// Whether alpha is 1 all along the piece.
    pub fn is_wall(&self) -> bool {
        self.0.iter().all(|texel| texel[N - 1] == 0.0)
    }

    /// `1 - part` of this and `part` of the other.
    pub fn lerp(&self, other: &Self, part: f64) -> Self {
        Self(std::array::from_fn(|k| lerp(&self.0[k], &other.0[k], part)))
    }

    /// The value at `x` in `0..=1`.
    pub fn at(&self, x: f64) -> Texel<N> {
        let y = 1.0 - x;
        let basis = [y * y * y, 3.0 * x * y * y, 3.0 * x * x * y, x * x * x];
        std::array::from_fn(|c| (0..4).map(|k| basis[k] * self.0[k][c]).sum())
    }
}

/// The texels of one level, u fastest.
#[derive(Debug, Clone, Copy)]
pub struct Texels<'a> {
    /// Along u, v, w.
    pub size: [u32; 3],
    /// The last of the four is a weight of the others.
    pub values: &'a [[f32; 4]],
}

impl<'a> From<&'a Volume> for Texels<'a> {
    fn from(volume: &'a Volume) -> Self {
        Self { size: volume.size, values: &volume.texels }
    }
}

impl<'a> From<&'a DirectionLevel> for Texels<'a> {
    fn from(level: &'a DirectionLevel) -> Self {
        Self { size: level.size, values: &level.texels }
    }
}

/// Where a ray meets the texel lattice of one level: visited cell by cell, front to back.
#[derive(Debug, Clone)]
pub struct Lattice<'a, const N: usize = 5> {
    texels: Texels<'a>,
    /// The texel whose centre is the origin of `start`, before wrapping.
    base: DVec3,
    /// Lattice coordinates at the start of the span, relative to `base`, each in 0..1.
    start: DVec3,
    /// Change of lattice coordinates per unit depth.
    slope: DVec3,
    /// The next lattice plane ahead on each axis, relative to `base`.
    plane: DVec3,
    /// The depth, from the start of the span, of that plane.
    crossing: DVec3,
    /// The loaded cell, relative to `base`.
    cell: DVec3,
    corners: [Texel<N>; 8],
    corners_are_empty: bool,
}

impl<'a, const N: usize> Lattice<'a, N> {
    /// For a span that starts at the texture-space point `start` and moves by `slope` per unit depth.
    pub fn new(texels: impl Into<Texels<'a>>, start: DVec3, slope: DVec3) -> Self {
        let texels = texels.into();
        let size = DVec3::from_array(texels.size.map(f64::from));
        let (start, slope) = (start * size - 0.5, slope * size);
        let base = start.floor();
        let start = start - base;
        // From exactly a plane, backwards: the next one is a whole cell away.
        let plane = DVec3::from_array(std::array::from_fn(|i| {
            if slope[i] > 0.0 || start[i] > 0.0 { f64::from(u8::from(slope[i] > 0.0)) } else { -1.0 }
        }));
        let mut lattice = Self {
            texels,
            base,
            start,
            slope,
            plane,
            crossing: DVec3::INFINITY,
            cell: DVec3::NAN,
            corners: [[0.0; N]; 8],
            corners_are_empty: true,
        };
        (0..3).for_each(|axis| lattice.find_crossing(axis));
        lattice
    }

    fn find_crossing(&mut self, axis: usize) {
        if self.slope[axis] != 0.0 {
            self.crossing[axis] = (self.plane[axis] - self.start[axis]) / self.slope[axis];
        }
    }

    /// The depth, from the start of the span, at which the current cell ends.
    pub fn next_crossing(&self) -> f64 {
        self.crossing.min_element()
    }

    /// The number of cells that the ray passes on its way, along the axis on which they are most.
    pub fn cells_along(&self, length: f64) -> f64 {
        (self.slope * length).abs().max_element()
    }

    /// Passes all planes up to `depth`.
    pub fn pass(&mut self, depth: f64) {
        for axis in 0..3 {
            while self.crossing[axis] <= depth {
                self.plane[axis] += self.slope[axis].signum();
                self.find_crossing(axis);
            }
        }
    }

    /// The reconstruction between two depths within one cell, whatever was passed; `None` where it is empty.
    pub fn cubic(&mut self, from: f64, to: f64) -> Option<Cubic<N>> {
        let cell = (self.start + self.slope * (0.5 * (from + to))).floor();
        if cell != self.cell {
            self.load(cell);
        }
        if self.corners_are_empty {
            return None;
        }
        let within = |depth: f64| (self.start + self.slope * depth - cell).clamp(DVec3::ZERO, DVec3::ONE);
        let (near, far) = (within(from), within(to));
        // The corners of the box that the piece spans: bit i of a corner's index says near or far on axis i.
        let mut corners = self.corners;
        for axis in 0..3 {
            let bit = 1 << axis;
            for low in (0..8).filter(|corner| corner & bit == 0) {
                let (a, b) = (corners[low], corners[low | bit]);
                corners[low] = lerp(&a, &b, near[axis]);
                corners[low | bit] = lerp(&a, &b, far[axis]);
            }
        }
        // The blossom of a product of three linear functions: means over the corners with k far axes.
        let mean = |[i, j, k]: [usize; 3]| -> Texel<N> {
            std::array::from_fn(|c| (corners[i][c] + corners[j][c] + corners[k][c]) / 3.0)
        };
        Some(Cubic([corners[0], mean([1, 2, 4]), mean([3, 5, 6]), corners[7]]))
    }

    fn load(&mut self, cell: DVec3) {
        let size = self.texels.size;
        let first = (self.base + cell).to_array().map(|texel| texel as i64);
        // [axis][near or far]
        let index: [[usize; 2]; 3] = std::array::from_fn(|axis| {
            let count = i64::from(size[axis]);
            [0, 1].map(|step| {
                let texel = first[axis] + step;
                let wrapped = if axis == 2 { texel.clamp(0, count - 1) } else { texel.rem_euclid(count) };
                wrapped as usize
            })
        });
        let row = size[0] as usize;
        let slice = row * size[1] as usize;
        self.corners = std::array::from_fn(|corner| {
            let [u, v, w] = std::array::from_fn(|axis| index[axis][(corner >> axis) & 1]);
            let [r, g, b, a] = self.texels.values[u + v * row + w * slice].map(f64::from);
            let all = [r, g, b, a, 1.0 - a];
            std::array::from_fn(|c| all[all.len() - N + c])
        });
        self.corners_are_empty =
            self.corners.iter().all(|texel| texel[..N - 1].iter().all(|channel| *channel == 0.0));
        self.cell = cell;
    }
}

fn lerp<const N: usize>(a: &Texel<N>, b: &Texel<N>, x: f64) -> Texel<N> {
    std::array::from_fn(|c| (1.0 - x) * a[c] + x * b[c])
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    use super::*;
    use crate::volume::Quantity;

    /// The trilinear filter, term by term.
    fn filtered(volume: &Volume, texture: DVec3) -> [f64; 4] {
        let size = volume.size.map(|n| n as i64);
        let place = texture * DVec3::from_array(volume.size.map(f64::from)) - 0.5;
        let mut sum = [0.0; 4];
        for corner in 0..8 {
            let mut weight = 1.0;
            let texel: [u32; 3] = std::array::from_fn(|axis| {
                let far = (corner >> axis) & 1;
                let part = place[axis] - place[axis].floor();
                weight *= if far == 1 { part } else { 1.0 - part };
                let index = place[axis].floor() as i64 + far;
                (if axis == 2 { index.clamp(0, size[2] - 1) } else { index.rem_euclid(size[axis]) }) as u32
            });
            for (sum, value) in sum.iter_mut().zip(volume.texel(texel)) {
                *sum += weight * f64::from(value);
            }
        }
        sum
    }

    #[test]
    fn cubics_are_the_filtered_texture_from_cell_to_cell() {
        let mut random = Pcg32::seed_from_u64(3);
        let size = [5, 3, 4];
        let texels = (0..60).map(|_| [0.0; 4].map(|_: f32| random.random::<f32>())).collect();
        let volume = Volume { size, texels, quantity: Quantity::Opacity };
        for ray in 0..40 {
            let mut vector = || DVec3::from_array([0.0; 3].map(|_: f64| random.random_range(-1.5..1.5)));
            // Some start on a plane of texel centres, some run along an axis.
            let start = if ray % 4 == 0 { DVec3::new(0.7, -0.5, 0.375) } else { vector() };
            let slope =
                if ray % 3 == 0 { DVec3::AXES[ray % 9 / 3] * (0.5 - (ray % 2) as f64) } else { vector() };
            let mut lattice: Lattice = Lattice::new(&volume, start, slope);
            let (mut from, mut cells) = (0.0, 0);
            while from < 1.0 {
                let to = lattice.next_crossing().min(1.0);
                if from < to {
                    let cubic = lattice.cubic(from, to).unwrap();
                    for x in [0.0, 0.3, 0.5, 1.0] {
                        let expected = filtered(&volume, start + slope * (from + x * (to - from)));
                        let found = cubic.at(x);
                        // Lattice coordinates below 10 are rounded by 2e-15; texels differ by 1 at most.
                        for c in 0..4 {
                            assert!((found[c] - expected[c]).abs() < 1e-14, "{found:?} {expected:?}");
                        }
                        assert!((found[CLEAR] + found[ALPHA] - 1.0).abs() < 1e-15);
                    }
                    cells += 1;
                }
                lattice.pass(to);
                from = to;
            }
            let planes = (slope * DVec3::new(5.0, 3.0, 4.0)).abs().element_sum();
            assert!((f64::from(cells) - 1.0 - planes).abs() <= 3.0, "{cells} cells, {planes} planes");
        }
    }

    #[test]
    fn empty_cells_and_walls_are_known_exactly() {
        let layer = |alpha: f32| [alpha; 4];
        let volume = Volume {
            size: [1, 1, 4],
            texels: [0.0, 0.0, 1.0, 1.0].map(layer).to_vec(),
            quantity: Quantity::Opacity,
        };
        let mut lattice: Lattice = Lattice::new(&volume, DVec3::new(0.1, 0.2, 0.0), DVec3::Z);
        // Texel centres at w = 1/8, 3/8, 5/8, 7/8; below the first and above the last, w clamps.
        assert_eq!(lattice.cubic(0.0, 0.125), None);
        assert_eq!(lattice.cubic(0.125, 0.375), None);
        assert!(!lattice.cubic(0.375, 0.625).unwrap().is_wall());
        assert!(lattice.cubic(0.625, 0.875).unwrap().is_wall());
        assert!(lattice.cubic(0.875, 1.0).unwrap().is_wall());
    }
}
