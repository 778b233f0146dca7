//! The sRGB curve (IEC 61966-2-1).

/// The linear value, 0..=1, of an sRGB value, 0..=1.
pub fn linear_from_srgb(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// The sRGB value, 0..=1, of a linear value, 0..=1.
pub fn srgb_from_linear(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_is_its_own_inverse() {
        for byte in 0..=255_u8 {
            let encoded = f32::from(byte) / 255.0;
            assert!((srgb_from_linear(linear_from_srgb(encoded)) - encoded).abs() < 1e-6);
        }
        // The pieces meet: their ends differ by the rounding of the standard's constants.
        assert!((linear_from_srgb(0.04045_f32.next_up()) - linear_from_srgb(0.04045)).abs() < 1e-7);
    }

    #[test]
    fn known_pairs() {
        assert_eq!([linear_from_srgb(0.0), linear_from_srgb(1.0)], [0.0, 1.0]);
        // Half of the code range, and the middle grey of 18 %.
        assert!((linear_from_srgb(0.5) - 0.214_041).abs() < 1e-6);
        assert!((srgb_from_linear(0.18) - 0.461_356).abs() < 1e-6);
    }
}
