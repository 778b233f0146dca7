//! Which scenes a gallery shows, and what their pictures are called.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use crate::{Error, Result, input};

/// Keys at the top of files that are no scenes: recipes and sweeps.
const KEYS_OF_OTHERS: [&str; 4] = ["recipe", "scenes", "plans", "antialiasing"];

/// The scene files that are named, and those in folders that are: each folder's own in the order of their names, then those of the
/// folders in it. Recipes and sweeps in folders are left out; no file comes twice.
///
/// # Errors
/// [`Error::Input`] for a folder that cannot be listed, or that has no scene in it.
pub fn scenes(named: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for path in named {
        let before = found.len();
        if !path.is_dir() {
            found.push(path.clone());
            continue;
        }
        list(path, &mut found)?;
        if found.len() == before {
            return Err(Error::input(path, "there is no scene in this folder")
                .with_help("name a scene file, or a folder of scene files (*.toml)"));
        }
    }
    let mut seen = HashSet::new();
    found.retain(|path| seen.insert(path.canonicalize().unwrap_or_else(|_| path.clone())));
    Ok(found)
}

fn list(folder: &Path, found: &mut Vec<PathBuf>) -> Result<()> {
    let unreadable =
        |error: std::io::Error| Error::input(folder, format!("the folder cannot be listed: {error}"));
    let (mut files, mut folders) = (Vec::new(), Vec::new());
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let entry = entry.map_err(unreadable)?;
        let path = entry.path();
        // A link to a folder is not followed: it may lead back here.
        if entry.file_type().map_err(unreadable)?.is_dir() {
            folders.push(path);
        } else if path.extension().is_some_and(|extension| extension == "toml") && may_be_scene(&path) {
            files.push(path);
        }
    }
    files.sort();
    folders.sort();
    found.append(&mut files);
    folders.iter().try_for_each(|folder| list(folder, found))
}

/// What cannot be read or parsed may be one: it is told later what is wrong with it.
fn may_be_scene(path: &Path) -> bool {
    let Ok(text) = input::text(path) else { return true };
    let Ok(table) = toml::de::DeTable::parse(&text) else { return true };
    !KEYS_OF_OTHERS.iter().any(|&key| table.get_ref().contains_key(key))
}

/// Where the picture of each scene is, within the gallery: in a folder named as the scene's own. None has a name in `taken`,
/// nor that of another.
pub fn picture_names(scenes: &[PathBuf], taken: &[&str]) -> Vec<PathBuf> {
    let mut taken: HashSet<PathBuf> = taken.iter().map(PathBuf::from).collect();
    let name = |scene: &PathBuf| {
        let stem = scene.file_stem().unwrap_or_default().to_string_lossy();
        let folder = scene.parent().and_then(Path::file_name).map(PathBuf::from).unwrap_or_default();
        let numbered = |number: u32| match number {
            1 => folder.join(format!("{stem}.png")),
            _ => folder.join(format!("{stem}-{number}.png")),
        };
        let free = (1..)
            .map(numbered)
            .find(|name| !taken.contains(name))
            .expect("there are fewer scenes than numbers");
        taken.insert(free.clone());
        free
    };
    scenes.iter().map(name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_are_searched_in_order_and_nothing_comes_twice() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir_all(at("a/inner")).unwrap();
        std::fs::create_dir_all(at("empty")).unwrap();
        let files = [
            ("a/z.toml", "mesh = 1"),
            ("a/b.toml", "not a scene, nor anything"),
            ("a/inner/a.toml", ""),
            ("a/fur.toml", "recipe = 'fur'"),
            ("a/sweep.toml", "scenes = []"),
            ("a/notes.txt", ""),
            ("c.toml", ""),
        ];
        for (name, text) in files {
            std::fs::write(at(name), text).unwrap();
        }
        let found = scenes(&[at("a/z.toml"), at("nowhere.toml"), at("a"), folder.path().to_owned()]).unwrap();
        let expected = ["a/z.toml", "nowhere.toml", "a/b.toml", "a/inner/a.toml", "c.toml"];
        assert_eq!(found, expected.map(at));
        // What is named itself is taken for what it is said to be.
        assert_eq!(scenes(&[at("a/fur.toml")]).unwrap(), [at("a/fur.toml")]);
        let error = scenes(&[at("a"), at("empty")]).unwrap_err();
        assert!(error.exit_code() == 3 && error.to_string().contains("empty: there is no scene"), "{error}");
    }

    #[test]
    fn no_two_pictures_have_one_name() {
        let scenes = ["s.toml", "x/a.toml", "y/x/a.toml", "../x/a-2.toml", "sheet.toml"].map(PathBuf::from);
        let expected = ["s.png", "x/a.png", "x/a-2.png", "x/a-2-2.png", "sheet-2.png"].map(PathBuf::from);
        assert_eq!(picture_names(&scenes, &["sheet.png"]), expected);
    }
}
