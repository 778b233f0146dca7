//! Tangents of fibres from the volume itself: the direction along which alpha changes least about a texel, the eigenvector of
//! the smallest eigenvalue of the structure tensor (J. Bigün, G. H. Granlund, *Optimal orientation detection of linear
//! symmetry*, 1987). A fibre's gradients are all across it, so in an ideal one that eigenvalue is 0, and its eigenvector the same
//! however the texture is stretched.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::super::{Volume, texel_at};
use super::derivatives::{gradient_per_texel, neighbours};

/// Sums of `g g^T` about each texel, of the gradient `g` per texel; its six different entries: xx, yy, zz, xy, xz, yz.
pub(super) struct Tensors {
    size: [u32; 3],
    entries: Vec<[f64; 6]>,
}

impl Tensors {
    /// The binomial window 1-4-6-4-1 along each axis: wide enough to hold a fibre one or two texels thick.
    pub(super) fn of(volume: &Volume) -> Self {
        let size = volume.size;
        let products = (0..volume.texels.len()).into_par_iter().map(|index| {
            let g = gradient_per_texel(volume, texel_at(size, index));
            [g.x * g.x, g.y * g.y, g.z * g.z, g.x * g.y, g.x * g.z, g.y * g.z]
        });
        let mut tensors = Self { size, entries: products.collect() };
        for axis in [0, 0, 1, 1, 2, 2] {
            tensors.smooth(axis);
        }
        tensors
    }

    /// The window 1-2-1 along one axis.
    fn smooth(&mut self, axis: usize) {
        let smoothed = (0..self.entries.len()).into_par_iter().map(|index| {
            let [before, after] = neighbours(self.size, texel_at(self.size, index), axis)
                .map(|at| self.entries[self.index(at)]);
            std::array::from_fn(|e| 0.25 * (before[e] + after[e]) + 0.5 * self.entries[index][e])
        });
        self.entries = smoothed.collect();
    }

    fn index(&self, at: [u32; 3]) -> usize {
        let [u, v, w] = at.map(|i| i as usize);
        (w * self.size[1] as usize + v) * self.size[0] as usize + u
    }

    /// In texture space, of the length [`certainty`]; zero where alpha does not change about the texel.
    pub(super) fn tangent(&self, at: [u32; 3]) -> DVec3 {
        let [xx, yy, zz, xy, xz, yz] = self.entries[self.index(at)];
        let trace = xx + yy + zz;
        if trace == 0.0 {
            return DVec3::ZERO;
        }
        let tensor = DMat3::from_cols(DVec3::new(xx, xy, xz), DVec3::new(xy, yy, yz), DVec3::new(xz, yz, zz));
        let tensor = tensor * trace.recip();
        let along = least_eigenvector(tensor);
        let tangent = (along / DVec3::from_array(self.size.map(f64::from))).normalize_or_zero();
        certainty(tensor, along) * if tangent.z < 0.0 { -tangent } else { tangent }
    }
}

/// Of a positive semidefinite matrix of trace 1. The inverse, squared again and again, becomes the projection on it.
fn least_eigenvector(matrix: DMat3) -> DVec3 {
    // Keeps the inverse finite where the least eigenvalue is 0, and no two eigenvalues in other order.
    let mut power = (matrix + 1e-6 * DMat3::IDENTITY).inverse();
    for _ in 0..8 {
        power *=
            power.to_cols_array().into_iter().fold(0.0, |most: f64, entry| most.max(entry.abs())).recip();
        power = power * power;
    }
    // Every column of the projection is along the eigenvector; the longest has lost least to rounding.
    let columns = [power.x_axis, power.y_axis, power.z_axis];
    let longest = columns.into_iter().max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
    longest.unwrap_or_default().normalize_or_zero()
}

/// How much a tensor of trace 1 is that of a fibre, 0 to 1: `(b - a) / (b + a + c / 10)` of its eigenvalues `a <= b <= c`, of
/// which the first is that of `along`. It is small where no direction is better than another: in a blob all three are about
/// equal; across a sheet alpha changes far more than along it, and by how much `b` is greater than `a` is chance.
fn certainty(tensor: DMat3, along: DVec3) -> f64 {
    let least = along.dot(tensor * along);
    // The other two from their sum and product.
    let [xx, yy, zz] = [tensor.x_axis.x, tensor.y_axis.y, tensor.z_axis.z];
    let [xy, xz, yz] = [tensor.x_axis.y, tensor.x_axis.z, tensor.y_axis.z];
    let minors = xx * yy - xy * xy + xx * zz - xz * xz + yy * zz - yz * yz;
    let (sum, product) = (1.0 - least, minors - least * (1.0 - least));
    let root = (0.25 * sum * sum - product).max(0.0).sqrt();
    let [middle, most] = [0.5 * sum - root, 0.5 * sum + root];
    ((middle - least) / (middle + least + 0.1 * most)).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;

    #[test]
    fn the_least_eigenvector_is_found_in_any_turn() {
        for (turn, values) in [(0.3, [0.0, 0.4, 0.6]), (1.7, [0.1, 0.2, 0.7]), (2.9, [0.0, 0.5, 0.5])] {
            let turn =
                DMat3::from_quat(DQuat::from_axis_angle(DVec3::new(0.2, -0.6, 0.77).normalize(), turn));
            let matrix = turn * DMat3::from_diagonal(DVec3::from_array(values)) * turn.transpose();
            let found = least_eigenvector(matrix);
            assert!(found.dot(turn.x_axis).abs() > 1.0 - 1e-9, "{found} for {}", turn.x_axis);
            let [a, b, c] = values;
            assert!((certainty(matrix, found) - (b - a) / (b + a + 0.1 * c)).abs() < 1e-6);
        }
    }

    /// Fibres of a round profile that all lean the same way, in a texture that repeats.
    #[test]
    fn leaning_fibres_have_their_tangent() {
        let size = [32, 16, 16];
        // Across one height of the texture a fibre moves by 8 texels in u and by -4 in v.
        let lean = DVec3::new(8.0 / 32.0, -4.0 / 16.0, 1.0);
        let texels = (0..size.iter().product::<u32>() as usize).map(|index| {
            let at = DVec3::from_array(texel_at(size, index).map(f64::from)) + 0.5;
            let place = at - at.z / 16.0 * DVec3::new(8.0, -4.0, 16.0);
            let apart = (place - 8.0).rem_euclid(DVec3::splat(16.0)) - 8.0;
            let alpha = 0.9 * (-(apart.x * apart.x + apart.y * apart.y) / 8.0).exp();
            [0.0, 0.0, 0.0, alpha as f32]
        });
        let volume = Volume::new(size, texels.collect()).unwrap();
        let tensors = Tensors::of(&volume);
        let (mut found, mut certain) = (0, 0.0);
        // The texture's ends in w cut the fibres; the window reaches 2 texels.
        for index in (0..volume.texels.len()).filter(|&i| volume.texels[i][3] > 0.1) {
            let at = texel_at(size, index);
            if (3..13).contains(&at[2]) {
                let tangent = tensors.tangent(at);
                certain += tangent.length();
                let tangent = tangent.normalize();
                // Central differences shorten a wave of 16 texels by a few hundredths.
                assert!(tangent.dot(lean.normalize()) > 0.995, "{at:?}: {tangent} for {lean}");
                found += 1;
            }
        }
        assert!(found > 300 && certain / f64::from(found) > 0.5, "{found}, {certain}");
        // A sheet, rough by a hundredth, has none.
        let rough = |i: usize| 0.01 * ((i * 7919) % 101) as f32 / 101.0;
        let texels = (0..4096).map(|i| [0.0, 0.0, 0.0, 0.1 + 0.05 * (i / 256) as f32 + rough(i)]).collect();
        let sheet = Tensors::of(&Volume::new([16, 16, 16], texels).unwrap());
        let longest = (0..4096).map(|i| sheet.tangent(texel_at([16; 3], i)).length()).fold(0.0, f64::max);
        assert!(longest < 0.1, "{longest}");
        let empty = Volume::new([2, 2, 2], vec![[0.0; 4]; 8]).unwrap();
        assert_eq!(Tensors::of(&empty).tangent([0, 1, 0]), DVec3::ZERO);
    }
}
