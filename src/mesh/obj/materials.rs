//! Material files (MTL) of OBJ files, and their textures: `newmtl`, `Kd` and `map_Kd`; parsed by `tobj`.
//!
//! `Kd` is linear, as Blender writes it; textures are sRGB. As Wavefront has it, the two are multiplied. Options of
//! `map_Kd`, opacity and all that depends on the light are not read.
//!
//! `tobj` panics at a colour of fewer than three numbers, so every line is checked first, and it sees those that matter.

use std::collections::HashMap;
use std::io::Cursor;
use std::path::Path;

use glam::Vec3;

use super::check::{MaterialFile, check_numbers};
use crate::mesh::model::{Material, Texture};
use crate::{Error, Result, input};

/// The materials of all `files` that the OBJ file at `obj` names, by their names.
pub(super) fn load(obj: &Path, files: &[MaterialFile]) -> Result<HashMap<String, Material>> {
    let mut materials = HashMap::new();
    let folder = obj.parent().unwrap_or(Path::new(""));
    for MaterialFile { line, name } in files {
        let path = folder.join(name);
        let bytes = input::bytes(&path, input::LONGEST_TEXT).map_err(|error| {
            Error::input(
                obj,
                format!("line {line}: the material file {} cannot be read: {error}", path.display()),
            )
            .with_help(
                "put it where the line says, or give one colour for all, without materials, by --colour",
            )
        })?;
        materials.extend(parse(&path, &String::from_utf8_lossy(&bytes))?);
    }
    Ok(materials)
}

/// The materials of the text of a file at `path`.
fn parse(path: &Path, text: &str) -> Result<HashMap<String, Material>> {
    let text = checked(path, text)?;
    let (materials, _) = tobj::load_mtl_buf(&mut Cursor::new(text))
        .map_err(|error| Error::input(path, format!("is not a readable material file: {error}")))?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let material = |material: tobj::Material| {
        let colour = Vec3::from(material.diffuse.unwrap_or([1.0; 3]).map(|x| x as f32));
        let texture = material.diffuse_texture.map(|name| Texture::read(&folder.join(name))).transpose()?;
        Ok((material.name, Material { colour, texture }))
    };
    materials.into_iter().map(material).collect()
}

/// The lines that `tobj` is to see.
fn checked(path: &Path, text: &str) -> Result<String> {
    let mut kept = String::new();
    for (number, line) in (1..).zip(text.lines()) {
        let fail = |message: String| {
            Error::input(path, format!("line {number}: {message}"))
                .with_help("correct the line, or export the model again")
        };
        let line = line.trim();
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        match keyword {
            "Kd" => {
                let words: Vec<_> = rest.split_whitespace().collect();
                let numbers = check_numbers(&words, 3).map_err(fail)?;
                if let Some(bad) = numbers.iter().find(|x| !(0.0..=1e30).contains(*x)) {
                    return Err(fail(format!("{bad} is no colour; it must be at least 0, at most 1e30")));
                }
            }
            "map_Kd" if rest.trim_start().starts_with('-') => {
                return Err(fail("options of map_Kd are not supported, only the name of a picture".into()));
            }
            "newmtl" | "map_Kd" if rest.trim().is_empty() => {
                return Err(fail(format!("{keyword} needs a name")));
            }
            "newmtl" | "map_Kd" => {}
            _ => continue,
        }
        kept.push_str(line);
        kept.push('\n');
    }
    Ok(kept)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::srgb::linear_from_srgb;

    #[test]
    fn colours_and_textures_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let picture = image::RgbImage::from_pixel(3, 2, image::Rgb([255, 0, 128]));
        picture.save(folder.path().join("a b.png")).unwrap();
        let text =
            "newmtl plain\nKd 0.25 .5 1 # a comment\nNs what\nKs 0\nnewmtl painted one\nmap_Kd a b.png\n";
        let materials = parse(&folder.path().join("m.mtl"), text).unwrap();
        assert_eq!(materials.len(), 2);
        assert_eq!(materials["plain"], Material { colour: Vec3::new(0.25, 0.5, 1.0), texture: None });
        let colour = materials["painted one"].colour_at(glam::DVec2::ZERO, 0.0);
        assert!(colour.distance(Vec3::new(1.0, 0.0, linear_from_srgb(128.0 / 255.0))) < 1e-6, "{colour}");
    }

    #[test]
    fn defects_are_told_with_their_line() {
        for (text, words) in [
            ("newmtl a\nKd 1 1\n", "line 2: there are 2 numbers where 3"),
            ("newmtl a\nKd 1 1 x\n", "line 2: \"x\" is not a number"),
            ("newmtl a\nKd 1 1 -1\n", "line 2: -1 is no colour"),
            ("newmtl\n", "line 1: newmtl needs a name"),
            ("newmtl a\nmap_Kd -s 2 2 2 a.png\n", "line 2: options"),
            ("newmtl a\nmap_Kd none.png\n", "none.png: the texture cannot be read"),
        ] {
            let error = parse(Path::new("m.mtl"), text).unwrap_err();
            assert_eq!(error.exit_code(), 3);
            assert!(error.to_string().contains(words), "{error} should say {words:?}");
        }
    }
}
