//! The Pareto front: the points that no other point beats in both time and error.

/// Whether each of `points`, pairs of which less is better in both, is on the front: no other is at least as good in
/// both and better in one. A value that is not a number is never on it.
pub fn front(points: &[[f64; 2]]) -> Vec<bool> {
    let beats = |a: &[f64; 2], b: &[f64; 2]| a[0] <= b[0] && a[1] <= b[1] && a != b;
    let is_number = |point: &[f64; 2]| !point.iter().any(|value| value.is_nan());
    points.iter().map(|point| is_number(point) && !points.iter().any(|other| beats(other, point))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_nothing_beats_is_on_the_front() {
        let points = [[1.0, 9.0], [2.0, 5.0], [3.0, 5.0], [2.5, 6.0], [4.0, 1.0], [9.0, 0.5], [9.0, 0.7]];
        assert_eq!(front(&points), [true, true, false, false, true, true, false]);
    }

    #[test]
    fn equals_stand_side_by_side() {
        assert_eq!(front(&[[1.0, 1.0], [1.0, 1.0], [2.0, 1.0]]), [true, true, false]);
    }

    #[test]
    fn what_is_not_a_number_beats_nothing() {
        assert_eq!(front(&[[f64::NAN, 0.0], [1.0, 1.0], [2.0, f64::INFINITY]]), [false, true, false]);
        assert!(front(&[]).is_empty());
    }
}
