//! Models as OBJ files with the material file beside them.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use crate::mesh::model::Model;
use crate::{Error, Result, output};

/// Writes positions, triangles and colours, the material file under the same name with `.mtl`; textures are left out.
///
/// Positions have five digits after the point.
///
/// # Errors
/// [`Error::Output`] where a file cannot be written, [`Error::Usage`] where the name is no text, or would be that of both.
pub fn write_model(path: impl AsRef<Path>, model: &Model) -> Result<()> {
    let path = path.as_ref();
    let materials = path.with_extension("mtl");
    let Some(name) = materials.file_name().and_then(|name| name.to_str()).filter(|_| materials != path)
    else {
        let message = format!("{}: the materials need a name of their own beside it", path.display());
        return Err(Error::Usage { message, help: Some("name the file .obj".into()) });
    };
    // Writing to a string does not fail.
    let mut text = format!("mtllib {name}\n");
    for p in &model.positions {
        let _ = writeln!(text, "v {:.5} {:.5} {:.5}", p.x, p.y, p.z);
    }
    let mut of_material = vec![Vec::new(); model.materials.len()];
    for (ids, &material) in model.triangles.iter().zip(&model.triangle_materials) {
        of_material[material as usize].push(ids.map(|id| id + 1));
    }
    for (material, triangles) in of_material.iter().enumerate() {
        let _ = writeln!(text, "usemtl m{material}");
        for [a, b, c] in triangles {
            let _ = writeln!(text, "f {a} {b} {c}");
        }
    }
    let mut colours = String::new();
    for (number, material) in model.materials.iter().enumerate() {
        let [r, g, b] = material.colour.to_array();
        let _ = writeln!(colours, "newmtl m{number}\nKd {r} {g} {b}");
    }
    write(&materials, &colours)?;
    write(path, &text)
}

fn write(path: &Path, text: &str) -> Result<()> {
    let mut file = output::file_beside(path)?;
    file.write_all(text.as_bytes()).map_err(|error| output::unwritable(path, &error))?;
    output::keep(file, path)
}
