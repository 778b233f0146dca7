//! From the section `[image]` of a scene file to what the picture is laid on.

use std::fmt::Formatter;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Deserialize;
use serde::de::value::{SeqAccessDeserializer, StrDeserializer};
use serde::de::{Deserializer, SeqAccess, Unexpected, Visitor};

use super::file::ImageSection;
use crate::frame::{Backdrop, Behind, file};
use crate::value::Colour;
use crate::{Error, Result};

/// What lies behind the shell: a colour, or the name of a picture.
#[derive(Debug, Clone, PartialEq)]
pub enum Background {
    /// As everywhere in scene files.
    Colour(Colour),
    /// PNG, JPEG or EXR, relative to the scene file.
    Picture(PathBuf),
}

impl<'de> Deserialize<'de> for Background {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct ColourOrPicture;
        impl<'de> Visitor<'de> for ColourOrPicture {
            type Value = Background;

            fn expecting(&self, formatter: &mut Formatter<'_>) -> std::fmt::Result {
                formatter.write_str(
                    "a colour such as \"#c8955a\" (sRGB) or [0.58, 0.3, 0.1] (linear), or a picture (.png, .jpg or .exr)",
                )
            }

            fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<Background, E> {
                if text.starts_with('#') {
                    return Colour::deserialize(StrDeserializer::new(text)).map(Background::Colour);
                }
                let is_picture = file::is_picture(text.as_ref());
                let picture = is_picture.then(|| Background::Picture(text.into()));
                picture.ok_or_else(|| E::invalid_value(Unexpected::Str(text), &self))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Background, A::Error> {
                Colour::deserialize(SeqAccessDeserializer::new(list)).map(Background::Colour)
            }
        }
        deserializer.deserialize_any(ColourOrPicture)
    }
}

/// What the section asks for; its picture is read.
///
/// # Errors
/// [`Error::Input`] for a picture that is missing or damaged.
pub(super) fn read(section: &ImageSection, base_dir: &Path) -> Result<Backdrop> {
    let behind = match &section.background {
        None => Behind::Nothing,
        Some(Background::Colour(colour)) => Behind::Colour(colour.0.to_array()),
        Some(Background::Picture(path)) => {
            let path = base_dir.join(path);
            let picture = file::read_picture(&path).map_err(|error| match error {
                Error::Input { path, message, help } => {
                    let message = format!("the background {message}");
                    let help = help.or_else(|| Some("its name is relative to the scene file".to_owned()));
                    Error::Input { path, message, help }
                }
                other => other,
            })?;
            Behind::Picture(Arc::new(picture))
        }
    };
    Ok(Backdrop { behind, exposure: section.exposure.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Image;
    use crate::scene::parse;
    use crate::scene::text::tests::assert_underlined;

    /// The backdrop of a small scene with such a section `[image]`.
    fn backdrop(folder: &Path, image: &str) -> Result<Backdrop> {
        let scene = format!(
            "mesh = {{ generator = 'plane', segments = 1 }}\nshell.thickness = 0.1\nvolume.recipe = 'fog.toml'\n\
             [image]\n{image}\n"
        );
        std::fs::write(folder.join("fog.toml"), "recipe = \"fog\"\nsize = [2, 2, 2]\n").unwrap();
        parse("scene.toml", &scene, folder).map(|loaded| loaded.backdrop)
    }

    #[test]
    fn a_background_is_a_colour_or_a_picture() {
        let folder = tempfile::tempdir().unwrap();
        let sky = Image { width: 2, height: 1, rgba: vec![[0.5, 0.25, 4.0, 1.0], [0.0, 0.0, 0.0, 1.0]] };
        file::write(folder.path().join("sky.exr"), &sky, &Backdrop::default()).unwrap();
        let read = |image: &str| backdrop(folder.path(), image).unwrap();
        assert_eq!(read(""), Backdrop::default());
        assert_eq!(read("background = '#ff0000'"), Backdrop::colour([1.0, 0.0, 0.0]));
        let expected = Backdrop { behind: Behind::Picture(Arc::new(sky)), exposure: -1.5 };
        assert_eq!(read("background = 'sky.exr'\nexposure = -1.5"), expected);
    }

    #[test]
    fn mistakes_are_underlined() {
        let folder = tempfile::tempdir().unwrap();
        let mistakes = [
            ("background = 'gold'", "'gold'", "or a picture (.png, .jpg or .exr)"),
            ("background = '#12345'", "'#12345'", "a colour such as"),
            ("background = 7", "7", "or a picture"),
            ("background = { file = 'sky.png' }", "{ file = 'sky.png' }", "or a picture"),
            ("exposure = 20.5", "20.5", "from -20 to 20"),
            ("exposure = nan", "nan", "from -20 to 20"),
            ("exposure = '1'", "'1'", "from -20 to 20"),
        ];
        for (image, spot, part) in mistakes {
            assert_underlined(backdrop(folder.path(), image).unwrap_err(), spot, part);
        }
    }

    #[test]
    fn a_picture_that_cannot_be_read_is_named() {
        let folder = tempfile::tempdir().unwrap();
        for (name, reason) in [("sky.jpg", "cannot be read"), ("torn.png", "cannot be decoded")] {
            std::fs::write(folder.path().join("torn.png"), "not a picture").unwrap();
            let error = backdrop(folder.path(), &format!("background = '{name}'")).unwrap_err();
            assert_eq!(error.exit_code(), 3);
            let message = error.to_string();
            assert!(message.contains(&format!("{name}: the background {reason}")), "{message}");
        }
    }
}
