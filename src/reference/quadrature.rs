//! The quadrature rule of a panel: Gauss-Kronrod 7-15 on `0..1`, with the matrix that integrates the
//! interpolant from 0 to each node.
//!
//! A. S. Kronrod, *Nodes and Weights of Quadrature Formulas*, 1965; abscissae and weights as in
//! Piessens et al., *QUADPACK*, 1983 (`qk15`). The 15 nodes integrate polynomials exactly to degree 22,
//! the 7 Gauss nodes among them to degree 13: their difference tells when a panel must be halved.

/// Nodes of the rule.
pub const NODES: usize = 15;

/// Values at the nodes, or weights of them.
pub type AtNodes = [f64; NODES];

/// The non-negative abscissae on -1..1, outermost first; the odd ones are those of the Gauss rule.
const ABSCISSAE: [f64; 8] = [
    0.991_455_371_120_812_6,
    0.949_107_912_342_758_5,
    0.864_864_423_359_769_1,
    0.741_531_185_599_394_4,
    0.586_087_235_467_691_1,
    0.405_845_151_377_397_2,
    0.207_784_955_007_898_47,
    0.0,
];

/// Kronrod weights of [`ABSCISSAE`]; they add up to 2 over -1..1.
const KRONROD: [f64; 8] = [
    0.022_935_322_010_529_224,
    0.063_092_092_629_978_55,
    0.104_790_010_322_250_18,
    0.140_653_259_715_525_92,
    0.169_004_726_639_267_9,
    0.190_350_578_064_785_4,
    0.204_432_940_075_298_9,
    0.209_482_141_084_727_82,
];

/// Gauss weights of the odd [`ABSCISSAE`].
const GAUSS: [f64; 4] =
    [0.129_484_966_168_869_7, 0.279_705_391_489_276_7, 0.381_830_050_505_118_9, 0.417_959_183_673_469_4];

/// Nodes of the short rule on `0..1`, Gauss-Kronrod 3-7.
pub const SHORT_NODES: [f64; 7] = [
    0.019_754_365_645_990_3,
    0.112_701_665_379_258_3,
    0.282_878_125_326_598_7,
    0.5,
    0.717_121_874_673_401_3,
    0.887_298_334_620_741_7,
    0.980_245_634_354_009_7,
];

/// Its weights, exact to degree 11: of each two nodes that mirror each other, from the outermost, and of the middle.
pub const SHORT_WEIGHTS: [f64; 4] =
    [0.052_328_113_013_233_7, 0.134_244_044_934_166_7, 0.200_698_707_387_981_1, 0.225_458_269_329_237_1];

/// The same, exact to degree 5 only.
pub const SHORT_COARSE_WEIGHTS: [f64; 4] = [0.0, 5.0 / 18.0, 0.0, 4.0 / 9.0];

/// A rule for functions on the interval `0..1`.
#[derive(Debug, Clone)]
pub struct Rule {
    /// Ascending, strictly inside `0..1`.
    pub nodes: AtNodes,
    /// `integral of f = sum of weights[i] f(nodes[i])`, exact to degree 22.
    pub weights: AtNodes,
    /// The same, exact to degree 13 only; zero at the nodes that Kronrod added.
    pub coarse_weights: AtNodes,
    /// `integral of f from 0 to nodes[i] = sum over j of f(nodes[j]) cumulative[j][i]`, exact to degree 14.
    pub cumulative: [AtNodes; NODES],
}

impl Rule {
    /// Builds the rule.
    pub fn new() -> Self {
        let mirrored = |i: usize| i.min(NODES - 1 - i);
        let nodes = std::array::from_fn(|i| {
            let half = 0.5 * ABSCISSAE[mirrored(i)];
            if i < NODES / 2 { 0.5 - half } else { 0.5 + half }
        });
        let weights = std::array::from_fn(|i| 0.5 * KRONROD[mirrored(i)]);
        let coarse_weights =
            std::array::from_fn(|i| if i % 2 == 1 { 0.5 * GAUSS[mirrored(i) / 2] } else { 0.0 });
        let cumulative = std::array::from_fn(|j| {
            std::array::from_fn(|i| {
                let end: f64 = nodes[i];
                let value = |m: usize| weights[m] * lagrange(&nodes, j, end * nodes[m]);
                end * (0..NODES).map(value).sum::<f64>()
            })
        });
        Self { nodes, weights, coarse_weights, cumulative }
    }
}

/// The polynomial that is 1 at node `j` and 0 at the others.
fn lagrange(nodes: &AtNodes, j: usize, x: f64) -> f64 {
    (0..NODES).filter(|&k| k != j).map(|k| (x - nodes[k]) / (nodes[j] - nodes[k])).product()
}

/// `sum of a[i] b[i]`.
pub fn dot(a: &AtNodes, b: &AtNodes) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Weights and nodes are given to 16 digits, so sums of 15 terms below 1 are right to a few ulp.
    const ROUNDING: f64 = 4e-16;

    fn monomial_error(weights: &AtNodes, degree: i32) -> f64 {
        let rule = Rule::new();
        let exact = 1.0 / f64::from(degree + 1);
        (dot(weights, &rule.nodes.map(|x| x.powi(degree))) - exact).abs()
    }

    #[test]
    fn rules_are_exact_to_their_degree_and_not_beyond() {
        let rule = Rule::new();
        for degree in 0..=22 {
            assert!(monomial_error(&rule.weights, degree) < ROUNDING, "degree {degree}");
        }
        for degree in 0..=13 {
            assert!(monomial_error(&rule.coarse_weights, degree) < ROUNDING, "degree {degree}");
        }
        assert!(monomial_error(&rule.coarse_weights, 14) > 10.0 * ROUNDING);
    }

    #[test]
    fn the_short_rule_is_exact_to_its_degree_and_not_beyond() {
        let error = |weights: &[f64; 4], degree: i32| {
            let terms = (0..7).map(|i: usize| weights[i.min(6 - i)] * SHORT_NODES[i].powi(degree));
            (terms.sum::<f64>() - 1.0 / f64::from(degree + 1)).abs()
        };
        assert!((0..=11).all(|degree| error(&SHORT_WEIGHTS, degree) < ROUNDING));
        assert!((0..=5).all(|degree| error(&SHORT_COARSE_WEIGHTS, degree) < ROUNDING));
        assert!(error(&SHORT_WEIGHTS, 12) > 1e-8 && error(&SHORT_COARSE_WEIGHTS, 6) > 1e-4);
    }

    #[test]
    fn cumulative_integrates_the_interpolant() {
        let rule = Rule::new();
        for degree in 0..NODES {
            let power = i32::try_from(degree).unwrap();
            for i in 0..NODES {
                let sum: f64 = (0..NODES).map(|j| rule.nodes[j].powi(power) * rule.cumulative[j][i]).sum();
                let exact = rule.nodes[i].powi(power + 1) / f64::from(power + 1);
                // Lagrange polynomials at these nodes stay below 2; the products round 15 times.
                assert!((sum - exact).abs() < 1e-14, "degree {degree}, node {i}: {sum} for {exact}");
            }
        }
    }
}
