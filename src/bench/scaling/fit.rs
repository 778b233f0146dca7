//! Slopes in logarithms.

/// Of the line of least squares through `(log x, log y)`; `None` of less than two different sizes, or where a number is not positive.
pub fn slope(points: &[(f64, f64)]) -> Option<f64> {
    if points.iter().any(|&(x, y)| !(x > 0.0 && y > 0.0)) {
        return None;
    }
    let count = points.len() as f64;
    let mean =
        |part: fn(&(f64, f64)) -> f64| points.iter().map(|point| part(point).ln()).sum::<f64>() / count;
    let (x, y) = (mean(|point| point.0), mean(|point| point.1));
    let along = |point: &(f64, f64)| point.0.ln() - x;
    let squares = points.iter().map(|point| along(point).powi(2)).sum::<f64>();
    let products = points.iter().map(|point| along(point) * (point.1.ln() - y)).sum::<f64>();
    (squares > 0.0).then(|| products / squares)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_is_its_slope() {
        let power = |exponent: f64| [1.0, 3.0, 10.0, 70.0].map(|x: f64| (x, 5.0 * x.powf(exponent)));
        for exponent in [0.0, 0.5, 1.0, 2.0] {
            assert!((slope(&power(exponent)).unwrap() - exponent).abs() < 1e-12);
        }
        assert_eq!(slope(&[(1.0, 2.0), (1.0, 3.0)]), None);
        assert_eq!(slope(&[(1.0, 2.0), (2.0, 0.0)]), None);
        assert_eq!(slope(&[]), None);
    }
}
