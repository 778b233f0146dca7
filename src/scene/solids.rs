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
    /// All but the mesh.
    base: Option<Solid>,
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
        let of_base = |base: &BaseSection| {
            let material = Material { colour: base.colour.0, texture: texture(&base.texture)? };
            Ok::<_, Error>(Solid {
                origin: base.texture.as_ref().map_or_else(PathBuf::new, |texture| base_dir.join(texture)),
                mesh: Arc::default(),
                colour: material.colour.as_dvec3(),
                texture: pyramid(&material),
            })
        };
        let base = base.map(of_base).transpose()?;
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
            let origin = section.texture.as_ref().map_or(path, |texture| base_dir.join(texture));
            others.extend(of_model(&model, &origin)?);
        }
        Ok(Self { base, others })
    }

    /// Whether the base mesh is one.
    pub(super) fn has_base(&self) -> bool {
        self.base.is_some()
    }

    /// All of them, the base first, where `mesh` is what the shell was built on.
    pub(super) fn build(&self, mesh: &Arc<Mesh>) -> Arc<[Solid]> {
        let of_base = |base: &Solid| Solid { mesh: mesh.clone(), ..base.clone() };
        self.base.iter().map(of_base).chain(self.others.iter().cloned()).collect()
    }
}

/// One for each material that is used; `origin` is what messages blame.
fn of_model(model: &Model, origin: &Path) -> Result<Vec<Solid>> {
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
            Solid {
                origin: origin.to_owned(),
                mesh: Arc::new(mesh),
                colour: material.colour.as_dvec3(),
                texture: pyramid(material),
            }
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

#[cfg(test)]
mod tests {
    use std::fs;

    use glam::DVec2;
    use image::{Rgb, RgbImage};
    use tempfile::TempDir;

    use super::*;
    use crate::scene;

    const SCENE: &str = "mesh = { generator = 'plane', size = 2, segments = 1 }
shell = { thickness = 0.1 }
volume = { recipe = 'fog.toml' }
";

    /// A square of two materials, one a triangle, with (u, v) from 0 to 1.
    const SQUARE: &str = "mtllib square.mtl
v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0
vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1
usemtl bricks\nf 1/1 2/2 3/3
usemtl paint\nf 1/1 3/3 4/4
";

    const RED: [u8; 3] = [255, 0, 0];
    const GREEN: [u8; 3] = [0, 255, 0];
    const BLUE: [u8; 3] = [0, 0, 255];
    const WHITE: [u8; 3] = [255; 3];

    /// A folder with all that the scenes name. The picture has a red and a green pixel above a blue and a white one.
    fn folder() -> TempDir {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
        write("fog.toml", "recipe = 'fog'\nsize = [4, 4, 4]\n");
        write("square.obj", SQUARE);
        write("square.mtl", "newmtl bricks\nmap_Kd four.png\nnewmtl paint\nKd 0.25 0.5 0.75\n");
        write("bare.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n");
        write("empty.obj", "v 0 0 0\n");
        write("doubled.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 3 2 1\n");
        write("torn.png", "no picture");
        let pixels = [[RED, GREEN], [BLUE, WHITE]];
        let picture = RgbImage::from_fn(2, 2, |x, y| Rgb(pixels[y as usize][x as usize]));
        picture.save(folder.path().join("four.png")).unwrap();
        folder
    }

    fn solids(sections: &str) -> Result<Vec<Solid>> {
        let folder = folder();
        let loaded = scene::parse("scene.toml", &format!("{SCENE}{sections}"), folder.path())?;
        Ok(loaded.scene.solids.to_vec())
    }

    /// The texels of the full texture: below left, below right, above left, above right.
    fn texels(solid: &Solid) -> Vec<[f32; 4]> {
        let level = &solid.texture.as_ref().unwrap().levels[0];
        assert_eq!(level.size, [2, 2, 1]);
        level.texels.clone()
    }

    /// Bytes of 0 and 255 are 0 and 1 in any space.
    fn opaque(colours: [[u8; 3]; 4]) -> Vec<[f32; 4]> {
        colours.map(|[r, g, b]| [r, g, b, 255].map(|byte| f32::from(byte) / 255.0)).to_vec()
    }

    #[test]
    fn a_picture_lies_on_a_solid_as_it_is_seen() {
        let of_solid = "[[solid]]\nfile = 'square.obj'\ntexture = 'four.png'";
        for sections in [of_solid, "[base]\ntexture = 'four.png'"] {
            let solids = solids(sections).unwrap();
            assert_eq!(texels(&solids[0]), opaque([BLUE, WHITE, RED, GREEN]), "v runs up");
            assert!(solids[0].origin.ends_with("four.png"), "{:?}", solids[0].origin);
        }
        let Mesh { positions, triangles, uvs, .. } = &*solids(of_solid).unwrap()[0].mesh;
        for (ids, uvs) in triangles.iter().zip(uvs) {
            for (&id, uv) in ids.iter().zip(uvs) {
                assert_eq!(positions[id as usize].truncate(), *uv, "on this square they are the same");
            }
        }
    }

    #[test]
    fn materials_are_kept_unless_the_scene_has_its_own() {
        let materials = |keys: &str| {
            let solids = solids(&format!("[[solid]]\nfile = 'square.obj'\n{keys}")).unwrap();
            solids.iter().map(|solid| (solid.colour, solid.texture.is_some())).collect::<Vec<_>>()
        };
        let paint = DVec3::new(0.25, 0.5, 0.75);
        let own = DVec3::new(0.5, 1.0, 2.0);
        assert_eq!(materials(""), [(DVec3::ONE, true), (paint, false)]);
        assert_eq!(materials("colour = [0.5, 1, 2]"), [(own, false)]);
        assert_eq!(materials("texture = 'four.png'"), [(DVec3::ONE, true)]);
        assert_eq!(materials("texture = 'four.png'\ncolour = [0.5, 1, 2]"), [(own, true)]);
        let kept = &solids("[[solid]]\nfile = 'square.obj'").unwrap()[0];
        assert_eq!(texels(kept), opaque([BLUE, WHITE, RED, GREEN]));
        assert!(kept.origin.ends_with("square.obj"), "{:?}", kept.origin);
    }

    #[test]
    fn a_solid_is_scaled_and_then_moved() {
        let keys = "scale = 2\nposition = [10, 20, 30]";
        let solids = solids(&format!("[[solid]]\nfile = 'bare.obj'\n{keys}")).unwrap();
        assert_eq!(solids.len(), 1);
        let corners = [[10.0, 20.0], [12.0, 20.0], [12.0, 22.0], [10.0, 22.0]];
        assert_eq!(solids[0].mesh.positions, corners.map(|corner| DVec2::from(corner).extend(30.0)));
        assert_eq!(solids[0].mesh.normals, [DVec3::Z; 4]);
    }

    #[test]
    fn the_base_comes_first_and_is_what_the_shell_is_built_on() {
        let solids = solids("[base]\ncolour = [0.5, 1, 2]\n[[solid]]\nfile = 'square.obj'").unwrap();
        assert_eq!((solids.len(), solids[0].colour), (3, DVec3::new(0.5, 1.0, 2.0)));
        assert!(solids[0].mesh.positions.contains(&DVec3::new(1.0, 0.0, 1.0)), "{:?}", solids[0].mesh);
    }

    #[test]
    fn what_is_wrong_with_a_solid_is_told() {
        let mistakes = [
            ("[[solid]]\nfile = 'none.obj'", "none.obj", "cannot be read"),
            ("[[solid]]\nfile = 'empty.obj'", "empty.obj", "no faces"),
            ("[[solid]]\nfile = 'doubled.obj'", "doubled.obj", "no normal"),
            ("[[solid]]\nfile = 'bare.obj'\ntexture = 'four.png'", "bare.obj", "no texture coordinates"),
            ("[[solid]]\nfile = 'square.obj'\ntexture = 'none.png'", "none.png", "cannot be read"),
            ("[base]\ntexture = 'torn.png'", "torn.png", "cannot be read"),
        ];
        for (sections, file, part) in mistakes {
            let error = solids(sections).unwrap_err();
            let message = error.to_string();
            assert_eq!(error.exit_code(), 3, "{message}");
            assert!(message.contains(file) && message.contains(part), "{sections}: {message}");
        }
    }
}
