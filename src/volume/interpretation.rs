//! From the numbers of a file to a medium: linear premultiplied colour and opacity.

use super::{AlphaMode, Quantity, RawVolume, TransferFunction, Volume};
use crate::{Error, Result};

/// What the numbers of a file are to mean, as far as the file leaves it open.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Interpretation {
    /// Whether colours are premultiplied; by default as the file says, and straight where it does not say.
    pub alpha_mode: Option<AlphaMode>,
    /// The opacity of every texel of a red, green, blue volume; files of other channels take none.
    pub constant_alpha: Option<f32>,
    /// The colour and opacity of a scalar; volumes of more than one channel take none.
    pub transfer: Option<TransferFunction>,
    /// The linear colour of a scalar that is a density: extinction in proportion to it, interpolated as such.
    pub density: Option<[f32; 3]>,
}

impl Volume {
    /// The medium that `raw` stands for under `interpretation`.
    ///
    /// # Errors
    /// [`Error::Input`], naming the file, where a scalar has no transfer function, where red, green, blue
    /// have no opacity, where the interpretation does not fit the channels, and where a colour or an opacity
    /// is out of range.
    pub fn from_raw(raw: RawVolume, interpretation: &Interpretation) -> Result<Self> {
        let RawVolume { path, size, channels, values, full_scale, alpha_mode, .. } = raw;
        let mode = interpretation.alpha_mode.unwrap_or(alpha_mode);
        let scaled = |value: f32| value / full_scale;
        if let Some(colour) = interpretation.density {
            let whole = Interpretation { density: Some(colour), ..Interpretation::default() };
            if channels != 1 || *interpretation != whole {
                let message = format!(
                    "has {channels} values a texel; a density is one, and nothing else says what it means"
                );
                return Err(
                    Error::input(path, message).with_help("remove [volume.density], or the other keys")
                );
            }
            let texel =
                |&value: &f32| premultiplied([colour[0], colour[1], colour[2], value], AlphaMode::Straight);
            return Self::of(Quantity::Extinction, size, values.iter().map(texel).collect())
                .map_err(|invalid| Error::input(path, invalid.to_string()));
        }
        let texels = match (channels, &interpretation.transfer, interpretation.constant_alpha) {
            (1, Some(transfer), None) => {
                let texel = |&value: &f32| premultiplied(transfer.straight_rgba(value), AlphaMode::Straight);
                values.iter().map(texel).collect()
            }
            (2, None, None) => {
                let (texels, _) = values.as_chunks();
                let texel = |texel: &[f32; 2]| {
                    let [luminance, alpha] = texel.map(scaled);
                    premultiplied([luminance, luminance, luminance, alpha], mode)
                };
                texels.iter().map(texel).collect()
            }
            (3, None, Some(alpha)) => {
                let (texels, _) = values.as_chunks();
                let texel = |texel: &[f32; 3]| {
                    let [red, green, blue] = texel.map(scaled);
                    premultiplied([red, green, blue, alpha], mode)
                };
                texels.iter().map(texel).collect()
            }
            (4, None, None) => {
                let (texels, _) = values.as_chunks();
                texels.iter().map(|texel: &[f32; 4]| premultiplied(texel.map(scaled), mode)).collect()
            }
            (1, None, _) => {
                let error = Error::input(
                    path,
                    "has one value a texel, and nothing says which colour and opacity it means",
                );
                return Err(error.with_help("add a transfer function under [volume.transfer], or say how dense it is under [volume.density]"));
            }
            (3, _, None) => {
                let error = Error::input(path, "has red, green and blue, but no opacity");
                return Err(error.with_help("add an alpha channel to it"));
            }
            (_, Some(_), _) => {
                let message = format!("has {channels} values a texel, but a transfer function maps only one");
                return Err(Error::input(path, message).with_help("remove [volume.transfer]"));
            }
            _ => {
                let message = "a constant alpha is only for red, green, blue without an alpha channel";
                return Err(Error::input(path, message));
            }
        };
        Self::new(size, texels).map_err(|invalid| Error::input(path, invalid.to_string()))
    }
}

fn premultiplied([red, green, blue, alpha]: [f32; 4], mode: AlphaMode) -> [f32; 4] {
    match mode {
        AlphaMode::Straight => [red * alpha, green * alpha, blue * alpha, alpha],
        AlphaMode::Premultiplied => [red, green, blue, alpha],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::value::Colour;
    use crate::volume::ControlPoint;

    fn raw(channels: u32, values: &[f32]) -> RawVolume {
        RawVolume {
            path: "fog.raw".into(),
            format: String::new(),
            size: [values.len() as u32 / channels, 1, 1],
            channels,
            values: values.to_vec(),
            full_scale: 255.0,
            alpha_mode: AlphaMode::Straight,
        }
    }

    fn transfer() -> TransferFunction {
        let point = |value, alpha| ControlPoint { value, colour: Colour::linear(1.0, 0.5, 0.0), alpha };
        TransferFunction::new(vec![point(0.0, 0.0), point(200.0, 1.0)]).unwrap()
    }

    fn refused(raw: RawVolume, interpretation: &Interpretation) -> String {
        let error = Volume::from_raw(raw, interpretation).unwrap_err();
        assert_eq!(error.exit_code(), 3);
        let Error::Input { path, message, help } = error else { panic!("{error}") };
        assert_eq!(path.to_str(), Some("fog.raw"));
        format!("{message}; {}", help.unwrap_or_default())
    }

    #[test]
    fn channels_become_premultiplied_colour() {
        let straight = Interpretation::default();
        let premultiplied =
            Interpretation { alpha_mode: Some(AlphaMode::Premultiplied), ..Default::default() };
        let texel = |raw, how: &Interpretation| Volume::from_raw(raw, how).unwrap().texels[0];
        assert_eq!(texel(raw(4, &[255.0, 0.0, 510.0, 127.5]), &straight), [0.5, 0.0, 1.0, 0.5]);
        assert_eq!(texel(raw(4, &[255.0, 0.0, 510.0, 127.5]), &premultiplied), [1.0, 0.0, 2.0, 0.5]);
        assert_eq!(texel(raw(2, &[255.0, 127.5]), &straight), [0.5; 4]);
        assert_eq!(texel(raw(2, &[255.0, 127.5]), &premultiplied), [1.0, 1.0, 1.0, 0.5]);
        let glass = Interpretation { constant_alpha: Some(0.25), ..Default::default() };
        assert_eq!(texel(raw(3, &[255.0, 0.0, 510.0]), &glass), [0.25, 0.0, 0.5, 0.25]);
        let fire = Interpretation { transfer: Some(transfer()), ..Default::default() };
        assert_eq!(texel(raw(1, &[100.0]), &fire), [0.5, 0.25, 0.0, 0.5]);
    }

    #[test]
    fn what_is_missing_or_superfluous_is_named() {
        let plain = Interpretation::default();
        let fire = Interpretation { transfer: Some(transfer()), ..Default::default() };
        let glass = Interpretation { constant_alpha: Some(0.5), ..Default::default() };
        assert!(refused(raw(1, &[1.0]), &plain).contains("[volume.transfer]"));
        assert!(refused(raw(3, &[1.0; 3]), &plain).contains("no opacity"));
        assert!(refused(raw(4, &[1.0; 4]), &fire).contains("remove [volume.transfer]"));
        assert!(refused(raw(4, &[1.0; 4]), &glass).contains("constant alpha"));
    }

    #[test]
    fn values_out_of_range_are_told_with_their_place() {
        let mut values = vec![0.0; 8];
        values[7] = 256.0;
        assert!(
            refused(raw(4, &values), &Interpretation::default())
                .contains("alpha of texel (1, 0, 0) is 1.0039")
        );
    }
}
