//! The order of convergence: the power of the distance between samples with which the error falls, measured as the slope
//! of log error over log distance (Etiene et al. 2013, who found errors in renderers by it).

use super::fit::slope;

/// Errors (RMSE) below this are rounding, not quadrature. A pixel is a chain of some hundred blends in f32, each of which
/// rounds by up to 2^-25 of a value of at most 1: as a random walk, `sqrt(300) 2^-25 = 5e-7`; twice that is left out.
pub const ROUNDING_FLOOR: f64 = 1e-6;

/// The slope of the least squares line through log error over log spacing, of the points `[spacing, error]` whose error
/// is above [`ROUNDING_FLOOR`], and how many these are. `None` where they do not make a line.
pub fn order(points: &[[f64; 2]]) -> Option<(f64, usize)> {
    let above = |[_, error]: &&[f64; 2]| error.is_finite() && *error > ROUNDING_FLOOR;
    let points: Vec<[f64; 2]> = points.iter().filter(above).copied().collect();
    Some((slope(&points)?, points.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_law_has_its_power() {
        for power in [0.5, 1.0, 2.0, 4.0] {
            let points = [2.0, 1.0, 0.5, 0.25].map(|h: f64| [h, 0.3 * h.powf(power)]);
            let (slope, count) = order(&points).unwrap();
            assert!((slope - power).abs() < 1e-12 && count == 4, "{slope}");
            // It is the slope, not a constant.
            let bent = points.map(|[h, error]| [h, error * h.sqrt()]);
            assert!((order(&bent).unwrap().0 - power - 0.5).abs() < 1e-12);
        }
    }

    #[test]
    fn the_least_squares_line_is_taken() {
        // Logs to base 10 (0, 0), (1, 1), (2, 5): the slope is ((-1)(-2) + (1)(3)) / 2.
        let points = [[1.0, 1.0], [10.0, 10.0], [100.0, 1e5]];
        assert!((order(&points).unwrap().0 - 2.5).abs() < 1e-12);
    }

    #[test]
    fn rounding_is_left_out() {
        let mut points = [2.0, 1.0, 0.5].map(|h: f64| [h, 1e-4 * h * h]).to_vec();
        points.extend([[0.25, 0.9e-6], [0.125, 0.9e-6], [0.1, 0.0], [0.1, f64::INFINITY], [0.1, f64::NAN]]);
        let (slope, count) = order(&points).unwrap();
        assert!((slope - 2.0).abs() < 1e-12 && count == 3, "{slope} of {count}");
    }

    #[test]
    fn a_point_is_no_line() {
        assert_eq!(order(&[]), None);
        assert_eq!(order(&[[1.0, 0.1]]), None);
        assert_eq!(order(&[[1.0, 0.1], [1.0, 0.2]]), None);
        assert_eq!(order(&[[1.0, 1e-9], [0.5, 1e-9], [0.25, 1.0]]), None);
    }
}
