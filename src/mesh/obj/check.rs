//! The check of an OBJ file, line by line, before it is parsed: every error names its line.

use std::path::Path;

use crate::mesh::{LARGEST_COORDINATE, projection};
use crate::{Error, Result};

/// What [`check`] let through.
#[derive(Default)]
pub(super) struct Checked {
    /// The lines that `tobj` is to see: `v`, `vt`, `vn` and `f`, without comments and continuations.
    pub text: String,
    /// Whether every face corner has a normal.
    pub has_normals: bool,
    /// Whether any face corner has texture coordinates, and the first line with one that has not.
    any_uv: bool,
    line_without_uv: Option<usize>,
    /// The material files that are named.
    pub material_files: Vec<MaterialFile>,
    /// The materials that faces use, each once, with the first line that asks for it.
    pub materials: Vec<(String, usize)>,
    /// For each triangle of the faces' fans, the index of its material, if it has one.
    pub triangle_materials: Vec<Option<u32>>,
}

/// A material file that an OBJ file names.
pub(super) struct MaterialFile {
    /// The line that names it.
    pub line: usize,
    /// As written.
    pub name: String,
}

impl Checked {
    /// # Errors
    /// [`Error::Input`] unless every face corner has texture coordinates.
    pub fn require_uvs(&self, path: &Path) -> Result<()> {
        let Some(line) = self.line_without_uv else { return Ok(()) };
        let message = if self.any_uv {
            format!("line {line}: this face has a corner without texture coordinates, while others have them")
        } else {
            "the mesh has no texture coordinates, and a shell texture needs them".into()
        };
        Err(Error::input(path, message).with_help(projection::ADVICE))
    }
}

/// The three kinds of numbered lines that a face corner `v/vt/vn` refers to.
const KINDS: [&str; 3] = ["position", "texture coordinate", "normal"];

/// Checks every line by itself, then that the indices of all faces are in range.
pub(super) fn check(path: &Path, text: &str) -> Result<Checked> {
    let mut checked = Checked { has_normals: true, ..Checked::default() };
    // How many of each kind there are so far; the highest index used so far, and its line.
    let (mut counts, mut highest) = ([0; 3], [(0, 0); 3]);
    let mut faces = 0;
    let mut material = None;
    let lines = text.lines().count();
    let is_cut_off = |line| line == lines && !text.ends_with('\n');
    let fail = |line: usize, message: String| {
        let cut = if is_cut_off(line) { " (the file ends in this line: it may be cut off)" } else { "" };
        Error::input(path, format!("line {line}: {message}{cut}"))
            .with_help("correct the line, or export the mesh again")
    };

    for (line, words) in logical_lines(text) {
        let mut words = words.split_whitespace();
        let keyword = words.next().unwrap_or_default();
        let words: Vec<&str> = words.collect();
        let kept = match keyword {
            "v" => {
                counts[0] += 1;
                // A fourth number alone is a weight; more are a colour.
                let kept = if words.len() == 4 { 4 } else { 3 };
                let numbers = check_numbers(&words, kept).map_err(|message| fail(line, message))?;
                let weighs = |x: &f64| (x / numbers[3]).abs() <= LARGEST_COORDINATE;
                if kept == 4 && !numbers[..3].iter().all(weighs) {
                    return Err(fail(line, format!("{} is no weight for a position", words[3])));
                }
                kept
            }
            "vt" | "vn" => {
                let (kind, kept) = if keyword == "vt" { (1, 2) } else { (2, 3) };
                counts[kind] += 1;
                check_numbers(&words, kept).map_err(|message| fail(line, message))?;
                kept
            }
            "f" => {
                if words.len() < 3 {
                    return Err(fail(line, format!("a face has {} corners, but needs three", words.len())));
                }
                faces += 1;
                checked.triangle_materials.extend(std::iter::repeat_n(material, words.len() - 2));
                for corner in &words {
                    let indices = corner_indices(corner, counts).map_err(|message| fail(line, message))?;
                    for (highest, index) in highest.iter_mut().zip(indices) {
                        *highest = (*highest).max((index.unwrap_or(0), line));
                    }
                    match indices[1] {
                        Some(_) => checked.any_uv = true,
                        None => _ = checked.line_without_uv.get_or_insert(line),
                    }
                    checked.has_normals &= indices[2].is_some();
                }
                words.len()
            }
            "mtllib" => {
                checked.material_files.push(MaterialFile { line, name: words.join(" ") });
                continue;
            }
            "usemtl" => {
                let name = words.join(" ");
                let known = checked.materials.iter().position(|(known, _)| *known == name);
                material = Some(known.unwrap_or(checked.materials.len()) as u32);
                if known.is_none() {
                    checked.materials.push((name, line));
                }
                continue;
            }
            _ => continue,
        };
        checked.text.push_str(keyword);
        for word in &words[..kept] {
            checked.text.push(' ');
            checked.text.push_str(word);
        }
        checked.text.push('\n');
    }

    if faces == 0 {
        return Err(Error::input(path, "there are no faces in it")
            .with_help("is it a Wavefront OBJ file, and complete? Faces are lines that begin with `f`"));
    }
    for ((kind, count), (index, line)) in KINDS.into_iter().zip(counts).zip(highest) {
        if index > count {
            return Err(fail(line, format!("a face uses {kind} {index}, but the file has {count}")));
        }
    }
    Ok(checked)
}

/// Lines with their numbers from 1, without comments; a line that ends in a backslash goes on in the next.
fn logical_lines(text: &str) -> impl Iterator<Item = (usize, String)> {
    let mut lines = (1..).zip(text.trim_start_matches('\u{feff}').lines());
    std::iter::from_fn(move || {
        let (number, first) = lines.next()?;
        let strip = |line: &str| line.split('#').next().unwrap_or_default().trim_end().to_owned();
        let mut line = strip(first);
        while line.ends_with('\\') {
            line.pop();
            let Some((_, next)) = lines.next() else { break };
            line.push(' ');
            line.push_str(&strip(next));
        }
        Some((number, line))
    })
}

/// The first `count` words as numbers within ±[`LARGEST_COORDINATE`].
pub(super) fn check_numbers(words: &[&str], count: usize) -> Result<Vec<f64>, String> {
    if words.len() < count {
        return Err(format!("there are {} numbers where {count} are needed", words.len()));
    }
    let number = |word: &&str| match word.parse::<f64>() {
        Ok(x) if x.abs() <= LARGEST_COORDINATE => Ok(x),
        Ok(_) => Err(format!("{word} is not a finite number within 1e32")),
        Err(_) => Err(format!("\"{word}\" is not a number")),
    };
    words[..count].iter().map(number).collect()
}

/// The indices of a corner `v`, `v/vt`, `v//vn` or `v/vt/vn`, from 1; negative ones count back from
/// the lines so far.
fn corner_indices(corner: &str, counts: [usize; 3]) -> Result<[Option<usize>; 3], String> {
    let mut indices = [None; 3];
    for (kind, field) in corner.split('/').enumerate() {
        if kind >= 3 {
            return Err(format!("\"{corner}\" has more than three indices"));
        }
        if field.is_empty() {
            continue;
        }
        let name = KINDS[kind];
        indices[kind] = Some(match field.parse::<i32>() {
            Ok(0) => return Err(format!("\"{corner}\" uses {name} 0, but OBJ files count from 1")),
            Ok(index @ 1..) => index as usize,
            Ok(back) => (counts[kind] + 1)
                .checked_sub(back.unsigned_abs() as usize)
                .filter(|&i| i > 0)
                .ok_or(format!(
                    "\"{corner}\" goes back {} {name}s, but {} came before",
                    -i64::from(back),
                    counts[kind]
                ))?,
            Err(_) => return Err(format!("\"{corner}\" is not a face corner such as 3, 3/1 or 3/1/2")),
        });
    }
    match indices[0] {
        Some(_) => Ok(indices),
        None => Err(format!("\"{corner}\" has no position")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The message and the help for a text that must not pass, with or without texture coordinates.
    fn refusal(text: &str) -> String {
        let path = Path::new("bad.obj");
        let error = match check(path, text) {
            Ok(checked) => checked.require_uvs(path).unwrap_err(),
            Err(error) => error,
        };
        let Error::Input { message, help, .. } = &error else { panic!("{error:?}") };
        format!("{message} -- {}", help.as_deref().expect("every error says what to do"))
    }

    const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\n";

    #[test]
    fn every_defect_is_told_with_its_line() {
        let cases = [
            ("", "no faces"),
            ("v 0 0 0\nl 1 2 3\n", "no faces"),
            ("v 0 0\n", "line 1: there are 2 numbers where 3 are needed"),
            ("# a\n\nv 0 zero 0\n", "line 3: \"zero\" is not a number"),
            ("v 0 0 0\nv 0 nan 0\n", "line 2: nan is not a finite number"),
            ("v 0 0 0\nv 0 0 -inf\n", "line 2: -inf"),
            ("v 0 0 1e999\n", "line 1: 1e999"),
            ("v 1 1 1 0\n", "line 1: 0 is no weight"),
            ("v 1 0 0 1e-200\n", "line 1: 1e-200 is no weight"),
            ("vt 0.5\n", "line 1: there are 1 numbers where 2"),
            ("vt 0.5 inf\n", "line 1: inf"),
            ("vn 0 0 x\n", "line 1: \"x\""),
            ("TRIANGLEf 1/1 2/1\n", "line 6: a face has 2 corners"),
            ("TRIANGLEf 1/1 2/1 4/1\n", "line 6: a face uses position 4, but the file has 3"),
            ("TRIANGLEf 1/1 2/9 3/1\n", "line 6: a face uses texture coordinate 9, but the file has 1"),
            ("TRIANGLEf 1/1/1 2/1/1 3/1/2\n", "line 6: a face uses normal 2, but the file has 1"),
            (
                "TRIANGLEf 1//1 2//1 3//6148914691236517206\n",
                "line 6: \"3//6148914691236517206\" is not a face",
            ),
            ("TRIANGLEf 0/1 2/1 3/1\n", "line 6: \"0/1\" uses position 0, but OBJ files count from 1"),
            ("TRIANGLEf -4/1 2/1 3/1\n", "line 6: \"-4/1\" goes back 4 positions, but 3 came before"),
            ("TRIANGLEf 1/1/1/1 2/1 3/1\n", "line 6: \"1/1/1/1\" has more than three"),
            ("TRIANGLEf /1 2/1 3/1\n", "line 6: \"/1\" has no position"),
            ("TRIANGLEf 1 2 3\n", "the mesh has no texture coordinates"),
            ("TRIANGLEf 1/1 2/1 3/1\nf 1/1 2/1 3\n", "line 7: this face has a corner without texture"),
        ];
        for (text, words) in cases {
            let refusal = refusal(&text.replace("TRIANGLE", TRIANGLE));
            assert!(refusal.contains(words), "{text:?}: {refusal:?} should say {words:?}");
        }
    }

    #[test]
    fn missing_texture_coordinates_name_the_way_out() {
        assert!(refusal(&format!("{TRIANGLE}f 1 2 3")).contains("`projection`"));
    }

    #[test]
    fn the_last_line_of_a_cut_file_is_suspected() {
        let words = "it may be cut off";
        assert!(refusal(&format!("{TRIANGLE}f 1/1 2/1")).contains(words));
        assert!(refusal("v 0 0 0\nv 1.").contains(words));
        assert!(!refusal(&format!("{TRIANGLE}f 1/1 2/1\n")).contains(words));
    }

    #[test]
    fn what_does_not_matter_is_left_out() {
        let text = "\u{feff}mtllib a.mtl\no thing # one\nv 0 0 0 # origin\nv 2 0 0 2\nv 0 1 \\\n 0 1 1 1\nvt 0 0 0\n\
                    usemtl\nl 1 2 3\ns off\nf 1/1 2/1 \\\n-1/-1\n";
        let checked = check(Path::new("good.obj"), text).unwrap();
        assert_eq!(checked.text, "v 0 0 0\nv 2 0 0 2\nv 0 1 0\nvt 0 0\nf 1/1 2/1 -1/-1\n");
        assert!(checked.require_uvs(Path::new("good.obj")).is_ok() && !checked.has_normals);
    }
}
