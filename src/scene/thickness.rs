//! From `shell.thickness_map` to a factor on the thickness at every position.

use std::path::Path;

use crate::Result;
use crate::mesh::Mesh;
use crate::volume::grey::Grey;

/// Reads the picture.
///
/// # Errors
/// [`Error::Input`](crate::Error::Input) where it cannot be read or is damaged.
pub(super) fn read(path: &Path) -> Result<Grey> {
    Grey::read(path).map_err(|error| {
        error.with_help("shell.thickness_map is a PNG picture, its name relative to the scene file")
    })
}

/// The factor at every position: the mean over the corners of triangles there, which differ at seams. A position of no triangle has 1.
pub(super) fn factors(map: &Grey, mesh: &Mesh) -> Vec<f64> {
    let mut sums = vec![(0.0, 0.0); mesh.positions.len()];
    for (ids, uvs) in mesh.triangles.iter().zip(&mesh.uvs) {
        for (&id, &uv) in ids.iter().zip(uvs) {
            let (sum, count) = &mut sums[id as usize];
            // Whole repeats would take digits from what is left of them in f32.
            let place = (uv - uv.floor()).as_vec2();
            *sum += f64::from(map.between(place.x, place.y));
            *count += 1.0;
        }
    }
    sums.into_iter().map(|(sum, count)| if count > 0.0 { sum / count } else { 1.0 }).collect()
}

#[cfg(test)]
mod tests {
    use image::{GrayImage, Luma};

    use crate::scene::parse;

    const SCENE: &str = "mesh = { generator = 'plane', size = 2, segments = 8 }
volume = { recipe = 'fog.toml' }
[shell]
thickness = 0.5
thickness_map = 'map.png'
";

    /// A folder with a map, of these bytes.
    fn folder(size: [u32; 2], grey: impl Fn(u32, u32) -> u8) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("fog.toml"), "recipe = \"fog\"\nsize = [2, 2, 2]\n").unwrap();
        let picture = GrayImage::from_fn(size[0], size[1], |x, y| Luma([grey(x, y)]));
        picture.save(folder.path().join("map.png")).unwrap();
        folder
    }

    #[test]
    fn a_picture_of_two_halves_makes_a_shell_of_two() {
        // Black above, a fifth (51 of 255) below.
        let folder = folder([4, 64], |_, y| if y < 32 { 0 } else { 51 });
        for limit in ["", "limit = 'safe'\n"] {
            let scene = parse("scene.toml", &format!("{SCENE}{limit}"), folder.path()).unwrap().scene;
            let shell = scene.shell;
            let base = shell.topology.base_vertices;
            let mut seen = [0, 0];
            for (ids, texture) in shell.topology.tetrahedra.iter().zip(&*shell.texture) {
                for (&id, uvw) in ids.iter().zip(texture).filter(|(id, _)| **id >= base) {
                    // Rows of vertices lie an eighth apart. Those on edges between the halves see both.
                    let v = uvw.y - uvw.y.floor();
                    let is_upper = match v {
                        0.1..0.4 => false,
                        0.6..0.9 => true,
                        _ => continue,
                    };
                    let height = shell.vertices[id as usize].distance(shell.vertices[(id - base) as usize]);
                    let expected = if is_upper { 0.0 } else { 0.5 * 0.2 };
                    // Bytes become f32.
                    assert!((height - expected).abs() < 1e-7, "v {v}: {height}");
                    seen[usize::from(is_upper)] += 1;
                }
            }
            assert!(seen.iter().all(|&count| count > 50), "{seen:?}");
            assert!(shell.limit.is_none(), "what is flat does not fold: {:?}", shell.limit);
        }
    }

    #[test]
    fn a_map_that_cannot_be_read_is_named() {
        let folder = folder([1, 1], |_, _| 0);
        std::fs::remove_file(folder.path().join("map.png")).unwrap();
        let missing = parse("scene.toml", SCENE, folder.path()).unwrap_err();
        std::fs::create_dir(folder.path().join("map.png")).unwrap();
        let is_folder = parse("scene.toml", SCENE, folder.path()).unwrap_err();
        for error in [missing, is_folder] {
            assert_eq!(error.exit_code(), 3);
            assert!(error.to_string().contains("map.png"), "{error}");
        }
    }
}
