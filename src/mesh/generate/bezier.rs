//! Cubic Bernstein polynomials and their derivatives.

/// The weights of the four control points at `t`, 0..1.
pub(super) fn weights(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t]
}

/// The derivatives of [`weights`] by `t`.
pub(super) fn slopes(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [-3.0 * s * s, 3.0 * s * (s - 2.0 * t), 3.0 * t * (2.0 * s - t), 3.0 * t * t]
}

/// Which of `pieces` equal pieces of 0..1 the parameter `t` falls into, and where in it, 0..1.
pub(super) fn piece(t: f64, pieces: usize) -> (usize, f64) {
    let scaled = t * pieces as f64;
    let index = (scaled as usize).min(pieces - 1);
    (index, scaled - index as f64)
}
