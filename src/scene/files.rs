//! Which files a scene is made of.
//!
//! Whatever string in a scene or a recipe is the name of something that exists, beside the text, is taken for a file that is read:
//! too many do no harm to those who ask whether one of them has changed. Of the files that name others (recipes, OBJ, MTL, glTF, NRRD)
//! these are taken too.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use toml::{Table, Value};

use super::numbered;
use crate::input;
use crate::mesh::gltf;
use crate::volume::stack;

/// The files that a text in TOML names, relative to `folder`; sorted, none twice.
pub(super) fn of(text: &str, folder: &Path) -> Vec<PathBuf> {
    let mut files = BTreeSet::new();
    named_in_toml(text, folder, &mut files);
    files.into_iter().collect()
}

fn named_in_toml(text: &str, folder: &Path, files: &mut BTreeSet<PathBuf>) {
    // A file that is no TOML is none that is read as such.
    for (_, value) in text.parse::<Table>().unwrap_or_default() {
        named_in_value(&value, folder, files);
    }
}

fn named_in_value(value: &Value, folder: &Path, files: &mut BTreeSet<PathBuf>) {
    match value {
        Value::String(name) => add(&folder.join(name), files),
        Value::Array(list) => list.iter().for_each(|one| named_in_value(one, folder, files)),
        Value::Table(table) => table.iter().for_each(|(_, one)| named_in_value(one, folder, files)),
        _ => {}
    }
}

fn add(path: &Path, files: &mut BTreeSet<PathBuf>) {
    if !path.is_file() {
        if let Ok(Some(sequence)) = numbered::files(path) {
            sequence.iter().for_each(|one| add(one, files));
            return;
        }
        // Of a folder or a pattern the slices, which name nothing.
        let slices = stack::images(path).unwrap_or_default();
        files.extend(slices.into_iter().filter(|slice| slice.is_file()));
        return;
    }
    if !files.insert(path.to_owned()) {
        return;
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
    let names_after = |keyword: &str| -> Vec<PathBuf> {
        let bytes = input::bytes(path, u64::MAX).unwrap_or_default();
        let lines = bytes.split(|&byte| byte == b'\n');
        let named = lines.filter_map(|line| line.trim_ascii().strip_prefix(keyword.as_bytes()));
        named.map(|name| folder.join(String::from_utf8_lossy(name.trim_ascii()).as_ref())).collect()
    };
    let named = match ending.as_str() {
        "toml" => {
            named_in_toml(&input::text(path).unwrap_or_default(), folder, files);
            return;
        }
        "obj" => names_after("mtllib "),
        "glb" | "gltf" => gltf::named_files(path),
        "mtl" => names_after("map_Kd "),
        "nhdr" | "nrrd" => [names_after("data file:"), names_after("datafile:")].concat(),
        _ => return,
    };
    named.iter().for_each(|name| add(name, files));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_that_files_name_are_found() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        std::fs::create_dir(folder.path().join("slices")).unwrap();
        for name in ["letters.png", "other.png", "bark.png", "data.raw", "slices/2.png", "slices/1.png"] {
            write(name, "");
        }
        write("relief.toml", "recipe = 'height-map'\nimage = 'letters.png'\n");
        write("tree.obj", "# a tree\nmtllib tree.mtl\r\nv 0 0 0\n");
        write("tree.mtl", "newmtl bark\n  map_Kd bark.png\n");
        write("fog.nhdr", "NRRD0005\ndata file: data.raw\n");
        write("walk 1.bin", "");
        write("fox.gltf", r#"{ "buffers": [{ "uri": "walk%201.bin" }, { "uri": "data:,a" }, {}], "a": [] }"#);
        let text = "volume.recipe = 'relief.toml'\nsolid = [{ file = 'tree.obj' }, { file = 'none.obj' }]\n\
                    mesh.file = 'fox.gltf'\n\
                    a = { b = ['slices', 'fog.nhdr'] }\n";
        let found = of(text, folder.path());
        let found: Vec<_> =
            found.iter().map(|path| path.strip_prefix(folder.path()).unwrap().to_str().unwrap()).collect();
        let expected = [
            "bark.png",
            "data.raw",
            "fog.nhdr",
            "fox.gltf",
            "letters.png",
            "relief.toml",
            "slices/1.png",
            "slices/2.png",
            "tree.mtl",
            "tree.obj",
            "walk 1.bin",
        ];
        assert_eq!(found, expected);
    }
}
