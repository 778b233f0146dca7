//! What the medium lets through to the points of an eye's ray from a light, traced at a few of them and interpolated between.
//!
//! Along a ray the integrand is asked for at thousands of points, and a path to the light costs as much as a dozen of
//! them. But what passes is itself an integral, and smooth as integrals are: mostly it does not change from one
//! texel to the next by more than a polynomial says. So the ray is cut into *stretches* of a few texels; each is traced at nine
//! equally spaced points when it is first asked for. If the quartic through five of them tells the other four to within twice what
//! is allowed, the two halves are quartics; else the stretch is halved, and five of a half's nine points are known.
//!
//! What the eye's integral takes in is the mean error on a stretch. It is at most 0.4 of the difference that was tested
//! where the function has a kink, wherever that is, 0.2 where its derivative has, and 0.015 where it is smooth. At a jump, where the
//! ray enters a wall, halving ends at [`NARROWEST`].
//!
//! The integral weights an error by the transmittance before the point, and by what the point would make of the light, so what
//! is allowed is another at each: deep in the medium, or where little light is sent on, a few paths do. Nothing is traced where the integrand is not asked for, as in empty space, or where the
//! surface faces away from the light.
//!
//! A shadow thinner than an eighth of a stretch, half a texel, may be overlooked: the medium casts none so thin, since a single texel
//! is interpolated over the width of two. Those of solids are known exactly: see `umbra`.

/// Points of a stretch.
const POINTS: usize = 9;

/// A stretch that is no longer than this part of a whole one is not halved, and what is between its points linear. A jump in it is
/// misplaced by an eighth of that.
const NARROWEST: f64 = 1e-6;

/// Stands for a half that was not asked for yet.
const UNKNOWN: u32 = u32::MAX;

/// A part of the ray.
struct Stretch {
    /// Equally spaced, both ends included.
    values: [f64; POINTS],
    /// The largest difference between four of them and the quartic through the others.
    miss: f64,
    halves: [u32; 2],
}

/// A function of depth along one ray.
pub struct Penumbra {
    start: f64,
    /// Depth of a whole stretch.
    length: f64,
    wholes: Vec<u32>,
    stretches: Vec<Stretch>,
}

impl Penumbra {
    /// On `start..end` in depth, where whole stretches are not longer than `longest`.
    pub fn new(start: f64, end: f64, longest: f64) -> Self {
        // A few million of them are a few rays too many.
        let count = ((end - start) / longest).ceil().clamp(1.0, 1e6);
        Self {
            start,
            length: (end - start) / count,
            wholes: vec![UNKNOWN; count as usize],
            stretches: Vec::new(),
        }
    }

    /// The value at a depth, to within `allowed`, where `trace` knows it exactly.
    pub fn at(&mut self, depth: f64, allowed: f64, mut trace: impl FnMut(f64) -> f64) -> f64 {
        let place = (depth - self.start) / self.length;
        let whole = (place as usize).min(self.wholes.len() - 1);
        let mut low = self.start + whole as f64 * self.length;
        let mut length = self.length;
        if self.wholes[whole] == UNKNOWN {
            let values = std::array::from_fn(|i| trace(low + length * (i as f64 / 8.0)));
            self.wholes[whole] = self.add(values);
        }
        let mut stretch = self.wholes[whole];
        loop {
            let Stretch { values, miss, halves } = &self.stretches[stretch as usize];
            let x = (8.0 * (depth - low) / length).clamp(0.0, 8.0);
            if *miss <= 2.0 * allowed {
                let half = if x < 4.0 { 0 } else { 4 };
                let values = std::array::from_fn(|i| values[half + i]);
                return quartic(&values, x - half as f64);
            }
            if length <= NARROWEST * self.length {
                let before = (x as usize).min(7);
                return values[before] + (x - before as f64) * (values[before + 1] - values[before]);
            }
            let half = usize::from(x >= 4.0);
            length *= 0.5;
            low += half as f64 * length;
            let known = halves[half];
            if known == UNKNOWN {
                let parent = *values;
                let values = std::array::from_fn(|i| match i % 2 {
                    0 => parent[4 * half + i / 2],
                    _ => trace(low + length * (i as f64 / 8.0)),
                });
                let added = self.add(values);
                self.stretches[stretch as usize].halves[half] = added;
                stretch = added;
            } else {
                stretch = known;
            }
        }
    }

    fn add(&mut self, values: [f64; POINTS]) -> u32 {
        let five = std::array::from_fn(|i| values[2 * i]);
        let misses = (1..POINTS).step_by(2).map(|i| (quartic(&five, 0.5 * i as f64) - values[i]).abs());
        let miss = misses.fold(0.0, f64::max);
        self.stretches.push(Stretch { values, miss, halves: [UNKNOWN; 2] });
        (self.stretches.len() - 1) as u32
    }
}

/// At `x`, the polynomial through five values at 0, 1, 2, 3, 4: Newton's, of forward differences.
fn quartic(values: &[f64; 5], x: f64) -> f64 {
    let mut differences = *values;
    for order in 1..5 {
        for i in (order..5).rev() {
            differences[i] -= differences[i - 1];
        }
    }
    let [a, b, c, d, e] = differences;
    a + x * (b + (x - 1.0) / 2.0 * (c + (x - 2.0) / 3.0 * (d + (x - 3.0) / 4.0 * e)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Smooth, then a kink, then a jump.
    fn function(x: f64) -> f64 {
        if x < 1.0 {
            (3.0 * x).sin()
        } else if x < 3.0 {
            3.0_f64.sin() + (x - 2.0).abs() - 1.0
        } else {
            -1.0
        }
    }

    #[test]
    fn what_is_interpolated_is_as_accurate_as_is_allowed() {
        for allowed in [1e-2, 1e-4, 1e-6] {
            let mut penumbra = Penumbra::new(0.1, 4.1, 0.3);
            let (mut traced, mut largest, mut sum) = (0, 0.0_f64, 0.0);
            for i in 0..40_000 {
                // There and back again.
                let x = 0.1 + 1e-4 * f64::from(if i % 2 == 0 { i } else { 40_000 - i });
                let found = penumbra.at(x, allowed, |x| {
                    traced += 1;
                    function(x)
                });
                // The jump is misplaced by a millionth of a stretch at most.
                if (x - 3.0).abs() > 1e-6 {
                    let error = (found - function(x)).abs();
                    (largest, sum) = (largest.max(error), sum + error);
                }
            }
            // With a kink beside its end a stretch errs by up to 3.4 times the difference that was tested there.
            assert!(largest <= 7.0 * allowed && sum / 4e4 <= 0.5 * allowed, "{largest:e} {sum:e}");
            // Fourteen whole stretches; some halving.
            assert!(traced > 9 * 14 && traced < 700, "{traced}");
        }
    }

    #[test]
    fn nothing_is_traced_where_nobody_asks() {
        let mut penumbra = Penumbra::new(0.0, 10.0, 1.0);
        let mut farthest = 0.0_f64;
        let square = penumbra.at(0.5, 1e-9, |x| {
            farthest = farthest.max(x);
            x * x
        });
        assert_eq!((square, farthest), (0.25, 1.0));
        assert_eq!(penumbra.at(0.25, 1e-9, |_| panic!("known")), 0.0625);
    }

    #[test]
    fn a_quartic_is_the_polynomial_through_five_points() {
        let polynomial = |x: f64| 1.0 + x * (2.0 - x * (0.5 + x * (0.25 - 0.125 * x)));
        let values = std::array::from_fn(|i| polynomial(i as f64));
        for x in [0.0, 0.5, 1.7, 3.0, 4.0] {
            assert!((quartic(&values, x) - polynomial(x)).abs() < 1e-13);
        }
    }
}
