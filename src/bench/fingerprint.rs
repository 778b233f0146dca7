//! The fingerprints of the reference's pictures: of all that they depend on.

use crate::fingerprint::{Builder, Fingerprint};
use crate::reference::tolerance;
use crate::scene::{Light, Model, Scene, Shading, Solid, Source, View};
use crate::volume::{DirectionLevel, Quantity, Volume};

/// The code that a cached reference comes from: were it changed, so might its pictures be.
const REFERENCE_CODE: [(&str, &str); 13] = [
    ("crossing.rs", include_str!("../reference/crossing.rs")),
    ("hierarchy.rs", include_str!("../reference/hierarchy.rs")),
    ("integrate.rs", include_str!("../reference/integrate.rs")),
    ("layer.rs", include_str!("../reference/layer.rs")),
    ("mod.rs", include_str!("../reference/mod.rs")),
    ("penumbra.rs", include_str!("../reference/penumbra.rs")),
    ("quadrature.rs", include_str!("../reference/quadrature.rs")),
    ("shade.rs", include_str!("../reference/shade.rs")),
    ("shadow.rs", include_str!("../reference/shadow.rs")),
    ("solids.rs", include_str!("../reference/solids.rs")),
    ("supersample.rs", include_str!("../reference/supersample.rs")),
    ("texture.rs", include_str!("../reference/texture.rs")),
    ("umbra.rs", include_str!("../reference/umbra.rs")),
];

/// What of a scene the reference asks for: rays of the eye and of lights, and the density of texels across them and on solids.
const SCENE_CODE: [&str; 4] = [
    include_str!("../scene/camera.rs"),
    include_str!("../scene/mod.rs"),
    include_str!("../scene/shadow.rs"),
    include_str!("../scene/solid.rs"),
];

impl Fingerprint {
    /// Of everything that the reference's picture of `view` depends on: geometry, texture, medium, light, camera, and the
    /// reference itself; and that one pixel is drawn of every square of `every` by `every`. How finely a method marches is not among it.
    pub fn of_reference(scene: &Scene, view: &View, every: u32) -> Self {
        let mut builder = Self::builder("reference").numbers(&[tolerance(scene), scene.medium.lod_footprint]);
        if every > 1 {
            builder = builder.numbers(&[every]);
        }
        seen(builder, scene, view, &scene.volume.levels)
    }

    /// The same of [`reference::render_supersampled`](crate::reference::render_supersampled) with `side` times `side` rays
    /// a pixel: of the volume the first level alone is among it.
    pub fn of_supersampled(scene: &Scene, view: &View, side: u32, tolerance: f64) -> Self {
        let builder = Self::builder("supersampled").numbers(&[tolerance]).numbers(&[side]);
        seen(builder, scene, view, &scene.volume.levels[..1])
    }
}

/// Adds what any picture by the reference depends on.
fn seen(mut builder: Builder, scene: &Scene, view: &View, levels: &[Volume]) -> Fingerprint {
    builder = builder.bytes(env!("CARGO_PKG_VERSION").as_bytes());
    for (_, code) in REFERENCE_CODE {
        builder = builder.bytes(code.as_bytes());
    }
    for code in SCENE_CODE {
        builder = builder.bytes(code.as_bytes());
    }
    let View { camera, width, height, depth: _ } = view;
    builder = builder
        .numbers(&[scene.medium.opacity_distance, camera.fov_y, camera.near])
        .numbers(&[camera.eye, camera.target, camera.up])
        .numbers(&[*width, *height])
        .numbers(&scene.shell.topology.tetrahedra)
        .numbers(scene.shell.vertices.as_slice())
        .numbers(scene.shell.texture.as_slice())
        .numbers(&scene.shell.determinants);
    for level in levels {
        let quantity = match level.quantity {
            Quantity::Opacity => "opacity",
            Quantity::Extinction => "extinction",
        };
        builder = builder.bytes(quantity.as_bytes()).numbers(&level.size).numbers(&level.texels);
    }
    for Solid { mesh, colour, texture, origin: _ } in scene.solids.iter() {
        let levels = texture.as_ref().map_or(&[][..], |texture| &texture.levels);
        builder = builder
            .numbers(&mesh.positions)
            .numbers(&mesh.normals)
            .numbers(&mesh.triangles)
            .numbers(&mesh.uvs)
            .numbers(&[*colour]);
        for level in levels {
            builder = builder.numbers(&level.size).numbers(&level.texels);
        }
    }
    if let Some(shading) = &scene.shading {
        builder = lit(builder, scene, shading, &shading.directions.levels[..levels.len()]);
    }
    builder.finish()
}

/// Adds what the light is, and what it falls on.
fn lit(builder: Builder, scene: &Scene, shading: &Shading, levels: &[DirectionLevel]) -> Builder {
    let Shading {
        model,
        ambient,
        diffuse,
        specular,
        shininess,
        emission,
        shadow_size,
        lights,
        directions: _,
    } = shading;
    let model_name = match model {
        Model::Surface => "surface",
        Model::Fibre => "fibre",
    };
    let frames = scene.shell.frames(model.frame_kind());
    let mut builder = builder
        .bytes(model_name.as_bytes())
        .numbers(&[*ambient])
        .numbers(&[*diffuse, *specular, *shininess, emission.glow, emission.from])
        .numbers(&[*shadow_size])
        .numbers(&frames.maps)
        .numbers(&frames.of_vertices);
    for Light { source, colour, shadow } in lights {
        builder = match source {
            Source::Directional { towards } => builder.bytes(b"directional").numbers(&[*towards]),
            Source::Point { position, falloff } => {
                builder.bytes(b"point").numbers(&[*position]).numbers(&[falloff.unwrap_or(f64::INFINITY)])
            }
        }
        .numbers(&[*colour])
        .numbers(&[u32::from(*shadow)]);
    }
    for level in levels {
        builder = builder.numbers(&level.size).numbers(&level.texels);
    }
    builder
}

#[cfg(test)]
pub(crate) mod tests {
    use std::path::PathBuf;
    use std::sync::Arc;

    use glam::DVec3;

    use super::*;
    use crate::mesh::Mesh;
    use crate::mesh::generate::{Generator, Torus};
    use crate::scene::{Emission, March};
    use crate::shell::{Shell, ShellOptions};
    use crate::volume::{Directions, Pyramid};

    /// A torus of fog in 32 x 32 pixels.
    pub(crate) fn scene() -> Scene {
        let mesh = Generator::Torus(Torus { segments: 8, rings: 5, ..Torus::default() }).build().unwrap();
        let shell = Shell::build(&mesh, &ShellOptions::new(0.2)).unwrap();
        let texels = (0..8).map(|i| [0.1, 0.05, 0.0, 0.1 + 0.05 * i as f32]).collect();
        let mut scene = Scene::new(shell, Pyramid::build(Volume::new([2, 2, 2], texels).unwrap()), 0.2);
        (scene.view.width, scene.view.height) = (32, 32);
        scene
    }

    fn shell(scene: &mut Scene) -> &mut Shell {
        Arc::make_mut(&mut scene.shell)
    }

    fn volume(scene: &mut Scene) -> &mut Pyramid {
        Arc::make_mut(&mut scene.volume)
    }

    /// A change, and its name for the failure's sake.
    type Change = (&'static str, fn(&mut Scene));

    const CHANGES: &[Change] = &[
        ("a vertex", |scene| {
            let vertex = &mut Arc::make_mut(&mut shell(scene).vertices)[3];
            vertex.y = vertex.y.next_up();
        }),
        ("a texture coordinate", |scene| Arc::make_mut(&mut shell(scene).texture)[7][2].z += 1e-15),
        ("a volume", |scene| shell(scene).determinants[5] *= 1.0 + 1e-9),
        ("a texel of the first level", |scene| volume(scene).levels[0].texels[6][1] += 1e-6),
        ("a texel of the last level", |scene| volume(scene).levels[1].texels[0][3] += 1e-6),
        ("the shape of a level", |scene| volume(scene).levels[0].size = [1, 2, 4]),
        ("what alpha is", |scene| volume(scene).levels[0].quantity = Quantity::Extinction),
        ("the opacity distance", |scene| scene.medium.opacity_distance *= 2.0),
        ("the level of detail", |scene| scene.medium.lod_footprint = 0.0),
        ("the eye", |scene| scene.view.camera.eye.x += 1e-9),
        ("the near plane", |scene| scene.view.camera.near *= 2.0),
        ("the width", |scene| scene.view.width += 1),
        ("the sides", |scene| (scene.view.width, scene.view.height) = (16, 64)),
    ];

    #[test]
    fn every_change_of_the_picture_is_seen_and_no_other() {
        let print = |scene: &Scene| Fingerprint::of_reference(scene, &scene.view, 1);
        let original = print(&scene());
        assert_eq!(original.to_string().len(), 32);
        assert_eq!(original, print(&scene()));
        assert_ne!(original, Fingerprint::of_reference(&scene(), &scene().view, 4));
        for (name, change) in CHANGES {
            let mut changed = scene();
            change(&mut changed);
            assert_ne!(original, print(&changed), "{name}");
        }
        let finer = Scene { march: March::Paper { samples: 3 }, ..scene() };
        assert_eq!(original, print(&finer));
    }

    /// The same under a lamp and the sun.
    fn lit() -> Scene {
        let scene = scene();
        let sun = Source::Directional { towards: DVec3::Y };
        let lamp = Source::Point { position: DVec3::X, falloff: None };
        let shading = Shading {
            model: Model::Surface,
            ambient: DVec3::splat(0.1),
            diffuse: 1.0,
            specular: 0.5,
            shininess: 20.0,
            emission: Emission { glow: 0.0, from: 0.0 },
            shadow_size: 64,
            lights: [sun, lamp].map(|source| Light { source, colour: DVec3::ONE, shadow: false }).to_vec(),
            directions: Arc::new(Directions::normals(&scene.volume.levels[0])),
        };
        Scene { shading: Some(shading), ..scene }
    }

    /// A change of the light, and its name for the failure's sake.
    type Relight = (&'static str, fn(&mut Shading));

    const LIGHTS: &[Relight] = &[
        ("the model", |shading| shading.model = Model::Fibre),
        ("ambient light", |shading| shading.ambient.y += 1e-9),
        ("the diffuse factor", |shading| shading.diffuse = 0.5),
        ("the specular factor", |shading| shading.specular = 1.0),
        ("the shininess", |shading| shading.shininess += 1e-9),
        ("a light's direction", |shading| {
            shading.lights[0].source = Source::Directional { towards: DVec3::X };
        }),
        ("a light's position", |shading| {
            shading.lights[1].source = Source::Point { position: DVec3::Y, falloff: None };
        }),
        ("a light's falloff", |shading| {
            shading.lights[1].source = Source::Point { position: DVec3::X, falloff: Some(1.0) };
        }),
        ("a light's colour", |shading| shading.lights[1].colour.z = 0.5),
        ("a light's shadow", |shading| shading.lights[1].shadow = true),
        ("the size of shadows", |shading| shading.shadow_size += 1),
        ("the glow", |shading| shading.emission.glow = 0.5),
        ("where the glow begins", |shading| shading.emission.from = 0.5),
        ("a light less", |shading| shading.lights.truncate(1)),
        ("a normal", |shading| Arc::make_mut(&mut shading.directions).levels[0].texels[3][1] += 1e-6),
        ("a coarser normal", |shading| Arc::make_mut(&mut shading.directions).levels[1].texels[0][2] += 1e-6),
    ];

    #[test]
    fn every_change_of_the_light_is_seen() {
        let print = |scene: &Scene| Fingerprint::of_reference(scene, &scene.view, 1);
        let original = print(&lit());
        assert_ne!(original, print(&scene()), "unlit");
        assert_eq!(original, print(&lit()));
        for (name, change) in LIGHTS {
            let mut changed = lit();
            change(changed.shading.as_mut().unwrap());
            assert_ne!(original, print(&changed), "{name}");
        }
    }

    /// The same beside a triangle with a texture.
    fn solid() -> Scene {
        let texture = Volume::new([2, 1, 1], vec![[0.5, 0.25, 0.0, 1.0]; 2]).unwrap();
        let texture = Some(Arc::new(Pyramid::build(texture)));
        let mesh = Arc::new(Mesh::triangle());
        let solid = Solid { origin: PathBuf::new(), mesh, colour: DVec3::ONE, texture };
        Scene { solids: [solid].into(), ..scene() }
    }

    fn texture(solid: &mut Solid) -> &mut Pyramid {
        Arc::make_mut(solid.texture.as_mut().unwrap())
    }

    /// A change of the solid, and its name for the failure's sake.
    type Reshape = (&'static str, fn(&mut Solid));

    const SOLIDS: &[Reshape] = &[
        ("a position", |solid| Arc::make_mut(&mut solid.mesh).positions[1].x += 1e-9),
        ("a normal", |solid| Arc::make_mut(&mut solid.mesh).normals[2].x += 1e-9),
        ("the order of corners", |solid| Arc::make_mut(&mut solid.mesh).triangles[0] = [1, 2, 0]),
        ("texture coordinates", |solid| Arc::make_mut(&mut solid.mesh).uvs[0][1].y += 1e-9),
        ("the colour", |solid| solid.colour.y = 0.5),
        ("a texel", |solid| texture(solid).levels[0].texels[1][0] += 1e-6),
        ("a coarser texel", |solid| texture(solid).levels[1].texels[0][0] += 1e-6),
        ("no texture", |solid| solid.texture = None),
    ];

    #[test]
    fn every_change_of_a_solid_is_seen() {
        let print = |scene: &Scene| Fingerprint::of_reference(scene, &scene.view, 1);
        let original = print(&solid());
        assert_ne!(original, print(&scene()), "none");
        assert_eq!(original, print(&solid()));
        for (name, change) in SOLIDS {
            let mut changed = solid();
            change(&mut Arc::make_mut(&mut changed.solids)[0]);
            assert_ne!(original, print(&changed), "{name}");
        }
    }

    #[test]
    fn of_many_rays_every_change_counts_but_those_of_coarse_levels() {
        let print = |scene: &Scene| Fingerprint::of_supersampled(scene, &scene.view, 8, 1e-4);
        let original = print(&scene());
        for (name, change) in CHANGES {
            let mut changed = scene();
            change(&mut changed);
            let has_no_part = ["a texel of the last level", "the level of detail"].contains(name);
            assert_eq!(original == print(&changed), has_no_part, "{name}");
        }
        let scene = scene();
        assert_ne!(original, Fingerprint::of_supersampled(&scene, &scene.view, 4, 1e-4));
        assert_ne!(original, Fingerprint::of_supersampled(&scene, &scene.view, 8, 1e-5));
        assert_ne!(original, Fingerprint::of_reference(&scene, &scene.view, 1));
    }

    #[test]
    fn fields_do_not_run_together() {
        let print = |fields: [&str; 2]| {
            Fingerprint::builder("test").bytes(fields[0].as_bytes()).bytes(fields[1].as_bytes()).finish()
        };
        assert_ne!(print(["ab", "c"]), print(["a", "bc"]));
    }

    #[test]
    fn all_code_of_the_reference_counts() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src/reference");
        let entries = std::fs::read_dir(folder).unwrap();
        let mut files: Vec<_> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        files.sort();
        assert_eq!(files, REFERENCE_CODE.map(|(name, _)| name));
    }
}
