//! Lines of least squares in logarithms: powers, as of time with size or of error with spacing, are their slopes.

/// The slope of the line of least squares through the logarithms of points `[x, y]`; `None` where they do not make a line: of less than
/// two, of one `x` alone, or where a number is not positive.
pub fn slope(points: &[[f64; 2]]) -> Option<f64> {
    let logs: Vec<[f64; 2]> = points.iter().map(|point| point.map(f64::ln)).collect();
    let count = logs.len() as f64;
    let mean = [0, 1].map(|axis| logs.iter().map(|log| log[axis]).sum::<f64>() / count);
    let moment =
        |axis: usize| logs.iter().map(|log| (log[0] - mean[0]) * (log[axis] - mean[axis])).sum::<f64>();
    let slope = moment(1) / moment(0);
    (logs.len() >= 2 && slope.is_finite()).then_some(slope)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_is_its_slope() {
        let power = |exponent: f64| [1.0, 3.0, 10.0, 70.0].map(|x: f64| [x, 5.0 * x.powf(exponent)]);
        for exponent in [0.0, 0.5, 1.0, 2.0] {
            assert!((slope(&power(exponent)).unwrap() - exponent).abs() < 1e-12);
        }
    }

    #[test]
    fn what_makes_no_line_has_no_slope() {
        assert_eq!(slope(&[[1.0, 2.0], [1.0, 3.0]]), None);
        assert_eq!(slope(&[[1.0, 2.0], [2.0, 0.0]]), None);
        assert_eq!(slope(&[[1.0, 2.0], [2.0, -1.0]]), None);
        assert_eq!(slope(&[[1.0, 2.0]]), None);
        assert_eq!(slope(&[]), None);
    }
}
