//! From the sections `[base]` and `[[solid]]` of a scene file to [`Solid`]s.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DVec3, Vec3};
use toml::Spanned;

use super::Solid;
use super::file::{BaseSection, SolidSection};
use super::text::Text;
use crate::mesh::model::{Material, Model, Texture};
use crate::mesh::{Mesh, normals, obj};
use crate::volume::{Filter, Pyramid};
use crate::{Error, Result};

/// All that a scene file says of its opaque surfaces, with what can be read before the mesh of the shell is there.
pub(super) struct Solids {
    base: Option<(DVec3, Option<Arc<Pyramid>>)>,
    others: Vec<Solid>,
}

impl Solids {
    /// Reads the files that the sections name.
    ///
    /// # Errors
    /// [`Error`] with the spot, or with the file.
    pub(super) fn read(
        text: &Text,
        base: Option<&BaseSection>,
        sections: &[Spanned<SolidSection>],
        base_dir: &Path,
    ) -> Result<Self> {
        let texture = |file: &Option<PathBuf>| {
            file.as_ref().map(|file| Texture::read(&base_dir.join(file))).transpose()
        };
        let material = |base: &BaseSection| {
            Ok::<_, Error>(Material { colour: base.colour.0, texture: texture(&base.texture)? })
        };
        let base = base.map(material).transpose()?;
        let base = base.map(|material| (material.colour.as_dvec3(), pyramid(&material)));
        let mut others = Vec::new();
        for section in sections {
            let span = section.span();
            let section = section.get_ref();
            let path = base_dir.join(&section.file);
            // A colour or a texture here stands for all that the file has of materials.
            let texture = texture(&section.texture)?;
            let colour = section.colour.map(|colour| colour.0);
            let colour = colour.or(texture.is_some().then_some(Vec3::ONE));
            let mut model = obj::load_model(&path, colour)?;
            if texture.is_some() && !model.has_uvs() {
                let message =
                    format!("{} has no texture coordinates for this solid's texture", path.display());
                return Err(text.error(span, message).with_help("export them too, or leave out `texture`"));
            }
            model.materials[0].texture = texture;
            let [x, y, z] = section.position.0.map(|x| x.0);
            for position in &mut model.positions {
                *position = *position * section.scale.0 + DVec3::new(x, y, z);
            }
            others.extend(of_model(&model)?);
        }
        Ok(Self { base, others })
    }

    /// Whether the base mesh is one.
    pub(super) fn has_base(&self) -> bool {
        self.base.is_some()
    }

    /// All of them, the base first, where `mesh` is what the shell was built on.
    pub(super) fn build(&self, mesh: &Arc<Mesh>) -> Arc<[Solid]> {
        let of_base = |(colour, texture): &(DVec3, Option<Arc<Pyramid>>)| Solid {
            mesh: mesh.clone(),
            colour: *colour,
            texture: texture.clone(),
        };
        self.base.iter().map(of_base).chain(self.others.iter().cloned()).collect()
    }
}

/// One for each material that is used.
fn of_model(model: &Model) -> Result<Vec<Solid>> {
    // Smooth across materials.
    let normals = normals::per_position(&model.positions, &model.triangles, None).map_err(|id| {
        let message = format!(
            "the position {} has no normal: its faces have no area, or face opposite ways and cancel out",
            model.positions[id]
        );
        Error::input(&model.path, message)
            .with_help("delete degenerate faces, and one side of surfaces that are doubled back to back")
    })?;
    let solid = |(index, material): (usize, &Material)| {
        let of_it = |&triangle: &usize| model.triangle_materials[triangle] as usize == index;
        let triangles: Vec<usize> = (0..model.triangles.len()).filter(of_it).collect();
        (!triangles.is_empty()).then(|| {
            let mesh = Mesh {
                positions: model.positions.clone(),
                normals: normals.clone(),
                triangles: triangles.iter().map(|&triangle| model.triangles[triangle]).collect(),
                uvs: triangles.iter().map(|&triangle| model.uvs[triangle]).collect(),
            };
            Solid { mesh: Arc::new(mesh), colour: material.colour.as_dvec3(), texture: pyramid(material) }
        })
    };
    let solids: Vec<Solid> = model.materials.iter().enumerate().filter_map(solid).collect();
    if solids.is_empty() {
        return Err(Error::input(&model.path, "there is no triangle in it".to_owned())
            .with_help("a solid needs at least one face"));
    }
    Ok(solids)
}

fn pyramid(material: &Material) -> Option<Arc<Pyramid>> {
    // Opacities are all 1: their mean is what every filter makes of them, and this one is quick.
    let of = |texture: &Texture| Arc::new(Pyramid::build_with(texture.volume(), Filter::Paper, [1.0; 3]));
    material.texture.as_ref().map(of)
}
