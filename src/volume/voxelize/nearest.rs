//! For every texel the nearest one of a set: P. F. Felzenszwalb, D. P. Huttenlocher, *Distance Transforms of Sampled
//! Functions*, 2012, which finds squared distances axis by axis as the lower envelope of parabolas; here with the texel at
//! which each parabola stands. u and v go around where the volume tiles.

use super::Grid;

/// Far from any texel of the set.
const NOWHERE: u64 = u64::MAX;

/// The nearest texel of the set so far, and the square of its distance in texels.
#[derive(Clone, Copy)]
struct Near {
    square: u64,
    texel: usize,
}

/// The index of the nearest texel that is in the set; its own where the set is empty.
pub(super) fn sources(grid: &Grid, is_in_set: &[bool]) -> Vec<usize> {
    let near = |(texel, &is_in)| Near { square: if is_in { 0 } else { NOWHERE }, texel };
    let mut texels: Vec<Near> = is_in_set.iter().enumerate().map(near).collect();
    let [width, height, _] = grid.size;
    for (axis, stride) in [(0, 1), (1, width), (2, width * height)] {
        let (count, goes_around) = (grid.size[axis], grid.tile && axis < 2);
        for start in 0..texels.len() {
            if start / stride % count == 0 {
                sweep(&mut texels, start, stride, count, goes_around);
            }
        }
    }
    texels.iter().map(|near| near.texel).collect()
}

/// A parabola of the envelope, from where on it is the lowest.
struct Parabola {
    at: i64,
    near: Near,
    from: f64,
}

fn sweep(texels: &mut [Near], start: usize, stride: usize, count: usize, goes_around: bool) {
    let n = count as i64;
    let mut envelope: Vec<Parabola> = Vec::new();
    for at in if goes_around { -n..2 * n } else { 0..n } {
        let near = texels[start + at.rem_euclid(n) as usize * stride];
        if near.square == NOWHERE {
            continue;
        }
        let height = |at: i64, near: Near| (near.square + (at * at) as u64) as f64;
        let mut from = f64::NEG_INFINITY;
        while let Some(last) = envelope.last() {
            from = (height(at, near) - height(last.at, last.near)) / (2 * (at - last.at)) as f64;
            if from > last.from {
                break;
            }
            envelope.pop();
            from = f64::NEG_INFINITY;
        }
        envelope.push(Parabola { at, near, from });
    }
    let mut lowest = 0;
    for at in 0..n {
        while envelope.get(lowest + 1).is_some_and(|next| next.from < at as f64) {
            lowest += 1;
        }
        let Some(Parabola { at: foot, near, .. }) = envelope.get(lowest) else { return };
        texels[start + at as usize * stride] =
            Near { square: near.square + ((at - foot) * (at - foot)) as u64, texel: near.texel };
    }
}

#[cfg(test)]
mod tests {
    use rand::RngExt;
    use rand_pcg::Pcg32;

    use super::*;

    #[test]
    fn no_texel_of_the_set_is_nearer() {
        let size = [7, 5, 6];
        let mut random = Pcg32::new(5, 5);
        for tile in [false, true] {
            let grid = Grid { size, tile };
            let is_in_set: Vec<bool> = (0..7 * 5 * 6).map(|_| random.random::<f64>() < 0.03).collect();
            let place = |texel: usize| [texel % 7, texel / 7 % 5, texel / 35];
            let square = |a: usize, b: usize| {
                let apart = |axis: usize| {
                    let straight = place(a)[axis].abs_diff(place(b)[axis]);
                    if tile && axis < 2 { straight.min(size[axis] - straight) } else { straight }
                };
                (0..3).map(|axis| apart(axis).pow(2)).sum::<usize>()
            };
            let set: Vec<usize> = (0..210).filter(|&texel| is_in_set[texel]).collect();
            assert!(set.len() > 2);
            for (texel, source) in sources(&grid, &is_in_set).into_iter().enumerate() {
                assert!(is_in_set[source]);
                let nearest = set.iter().map(|&other| square(texel, other)).min();
                assert_eq!(Some(square(texel, source)), nearest, "{texel} {source}");
            }
        }
    }

    #[test]
    fn an_empty_set_changes_nothing() {
        let grid = Grid { size: [2, 2, 2], tile: true };
        assert_eq!(sources(&grid, &[false; 8]), [0, 1, 2, 3, 4, 5, 6, 7]);
    }
}
