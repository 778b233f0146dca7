//! glTF files, put together here: what they hold, how it moves, and what is wrong with them.
#![allow(missing_docs, reason = "a test names itself")]

mod file;
mod mistakes;

use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_4, FRAC_PI_8};
use std::path::PathBuf;
use std::process::Command;
use std::sync::{Arc, Mutex};

use file::{CORNERS, File, arm, assert_near, posed, triangle};
use glam::{DVec2, DVec3};
use mesoshell::Error;
use mesoshell::mesh::gltf::Gltf;
use mesoshell::mesh::info;
use mesoshell::progress::{Progress, Silent};
use mesoshell::scene::{Loaded, Scene, Sequence};
use serde_json::{Value, json};

#[test]
fn a_skin_bends_as_its_joints_do() {
    let gltf = arm().load();
    let contents = gltf.contents();
    assert_eq!((contents.vertices, contents.joints, contents.morph_targets), (6, 2, 0));
    assert_eq!((contents.clips[0].name.as_str(), contents.clips[0].duration), ("bend", 2.0));
    let rest = gltf.mesh(None).unwrap();
    assert_eq!((rest.positions.len(), rest.triangles.len()), (6, 4));
    // The place of the node that has the skin does not count.
    assert_eq!(rest.positions[0], DVec3::ZERO);
    assert_eq!(posed(&gltf, 0.0), rest);
    for (time, angle) in [(0.5, FRAC_PI_4), (1.0, 2.0 * FRAC_PI_4), (1.5, 2.0 * FRAC_PI_4)] {
        let mesh = posed(&gltf, time);
        let (sine, cosine) = f64::sin_cos(angle);
        let turned = |x: f64, y: f64| {
            DVec3::new(x * cosine - (y - 1.0) * sine, 1.0 + x * sine + (y - 1.0) * cosine, 0.0)
        };
        for (position, at_rest) in mesh.positions.iter().zip(&rest.positions) {
            let DVec3 { x, y, .. } = *at_rest;
            let expected = match y {
                0.0 => *at_rest,
                1.5 => at_rest.midpoint(turned(x, y)),
                _ => turned(x, y),
            };
            assert_near(*position, expected);
        }
        assert!(mesh.normals.iter().all(|normal| (*normal - DVec3::Z).length() < 1e-12));
        assert_eq!((&mesh.triangles, &mesh.uvs), (&rest.triangles, &rest.uvs));
    }
}

#[test]
fn a_morph_target_counts_by_its_weight() {
    let mut file = triangle(json!([{ "mesh": 0 }]));
    let up = file.floats("VEC3", &[[0.0; 3], [0.0; 3], [0.0, 0.0, 2.0]]);
    // The second moves a single vertex: the others are left out.
    let [ids, values] = [file.indices(&[1]), file.floats("VEC3", &[[1.0, 0.0, 0.0]])];
    let view = |file: &File, accessor: usize| file.root["accessors"][accessor]["bufferView"].clone();
    let sparse = json!({
        "componentType": 5126, "count": 3, "type": "VEC3",
        "sparse": {
            "count": 1,
            "indices": { "bufferView": view(&file, ids), "componentType": 5121 },
            "values": { "bufferView": view(&file, values) },
        },
    });
    let sparse = file.add("accessors", sparse);
    file.root["meshes"][0]["primitives"][0]["targets"] = json!([{ "POSITION": up }, { "POSITION": sparse }]);
    assert_eq!(file.load().mesh(None).unwrap().positions[2], DVec3::Y);
    file.root["meshes"][0]["weights"] = json!([1, 1]);
    let mesh = file.load().mesh(None).unwrap();
    assert_eq!(mesh.positions[1..], [2.0 * DVec3::X, DVec3::new(0.0, 1.0, 2.0)]);
    file.root["nodes"][0]["weights"] = json!([0.5, 0]);
    let gltf = file.load();
    assert_eq!(gltf.contents().morph_targets, 2);
    let mesh = gltf.mesh(None).unwrap();
    assert_eq!(mesh.positions[1..], [DVec3::X, DVec3::new(0.0, 1.0, 1.0)]);
    // Of the triangle (1, 0, 0), (0, 1, 1).
    assert_near(mesh.normals[0], DVec3::new(0.0, -1.0, 1.0).normalize());
    file.clip("grow", (0, "weights"), "LINEAR", &[0.0, 2.0], &[[0.0], [0.0], [1.0], [0.5]]);
    let mesh = posed(&file.load(), 1.0);
    assert_eq!(mesh.positions[1..], [1.25 * DVec3::X, DVec3::new(0.0, 1.0, 1.0)]);
}

#[test]
fn normals_of_the_file_are_morphed_and_carried() {
    let half = FRAC_1_SQRT_2 as f32;
    let mut file = triangle(json!([{ "mesh": 0, "rotation": [half, 0, 0, half], "scale": [1, 1, 2] }]));
    let normals = file.floats("VEC3", &[[0.0, 0.0, 1.0]; 3]);
    let primitive = "/meshes/0/primitives/0";
    file.root.pointer_mut(primitive).unwrap()["attributes"]["NORMAL"] = json!(normals);
    let still = [[0.0; 3]; 3];
    let target = json!({ "POSITION": file.floats("VEC3", &still), "NORMAL": file.floats("VEC3", &[[0.0, 1.0, 0.0]; 3]) });
    file.root.pointer_mut(primitive).unwrap()["targets"] = json!([target]);
    // A quarter turn about X takes Z to -Y.
    assert_near(file.load().mesh(None).unwrap().normals[0], DVec3::NEG_Y);
    file.root["nodes"][0]["weights"] = json!([1]);
    // (0, 1, 1), on what is stretched by 2 along Z, is (0, 2, 1); turned, (0, -1, 2).
    assert_near(file.load().mesh(None).unwrap().normals[0], DVec3::new(0.0, -1.0, 2.0).normalize());
    // Morph targets without normals: those of the triangles count.
    file.root.pointer_mut(primitive).unwrap()["targets"][0].as_object_mut().unwrap().remove("NORMAL");
    assert_near(file.load().mesh(None).unwrap().normals[0], DVec3::NEG_Y);
}

#[test]
fn values_between_keys() {
    let moved = |interpolation: &str, values: &[[f32; 3]], time: f64| {
        let mut file = triangle(json!([{ "mesh": 0 }]));
        file.clip("move", (0, "translation"), interpolation, &[1.0, 3.0], values);
        file.clip("later", (0, "translation"), "STEP", &[9.0], &[[9.0; 3]]);
        posed(&file.load(), time).positions[0].x
    };
    let line = [[0.0; 3], [1.0, 0.0, 0.0]];
    for (time, expected) in [(0.0, 0.0), (1.0, 0.0), (1.5, 0.25), (2.5, 0.75)] {
        assert_eq!(moved("LINEAR", &line, time), expected, "{time}");
    }
    let steps = [[2.0; 3], [1.0; 3]];
    for (time, expected) in [(0.0, 2.0), (2.9, 2.0), (3.0 - 2e-6, 1.0)] {
        assert_eq!(moved("STEP", &steps, time), expected, "{time}");
    }
    // Slopes of 1 from the first and -1 to the second key, two seconds apart: half way 0.5 + 2 / 8 (1 + 1).
    let spline = [[7.0; 3], [0.0; 3], [1.0; 3], [-1.0; 3], [1.0; 3], [7.0; 3]];
    for (time, expected) in [(0.5, 0.0), (2.0, 1.0), (1.5, 0.15625 + 2.0 * (0.140625 + 0.046875))] {
        assert!((moved("CUBICSPLINE", &spline, time) - expected).abs() < 1e-15, "{time}");
    }
}

#[test]
fn channels_that_move_no_node_are_ignored() {
    let mut file = arm();
    let expected = posed(&file.load(), 0.7);
    let channels = file.root["animations"][0]["channels"].as_array_mut().unwrap();
    let pointer = json!({ "KHR_animation_pointer": { "pointer": "/materials/0/alphaCutoff" } });
    for target in [
        json!({ "path": "translation" }),
        json!({ "path": "pointer", "extensions": pointer }),
        json!({ "path": "pointer", "node": 3, "extensions": pointer }),
    ] {
        channels.push(json!({ "sampler": 0, "target": target }));
    }
    assert_eq!(posed(&file.load(), 0.7), expected);
    file.root["animations"][0]["channels"].as_array_mut().unwrap().remove(0);
    let gltf = file.load();
    assert_eq!((gltf.clips()[0].duration, posed(&gltf, 0.7)), (0.0, gltf.mesh(None).unwrap()));
}

#[test]
fn rotations_go_the_shorter_way_and_stay_rotations() {
    let (sine, cosine) = FRAC_PI_8.sin_cos();
    let [sine, cosine] = [sine, cosine].map(|x| x as f32);
    let turned = |interpolation: &str, values: &[[f32; 4]]| {
        let mut file = triangle(json!([{ "mesh": 0 }]));
        file.clip("turn", (0, "rotation"), interpolation, &[0.0, 1.0, 2.0], values);
        posed(&file.load(), 0.5).positions[1]
    };
    let still = [0.0, 0.0, 0.0, 1.0];
    // An eighth of a turn, written as its negative.
    let eighth = [0.0, 0.0, -sine, -cosine];
    assert_near(turned("LINEAR", &[still, eighth, still]), DVec3::new(FRAC_PI_8.cos(), FRAC_PI_8.sin(), 0.0));
    let slope = [0.0; 4];
    let eighth = [0.0, 0.0, sine, cosine];
    let spline = [slope, still, slope, slope, eighth, slope, slope, still, slope];
    // Half way between two unit quaternions is the direction of their mean.
    assert_near(turned("CUBICSPLINE", &spline), DVec3::new(FRAC_PI_8.cos(), FRAC_PI_8.sin(), 0.0));
    // A spline through zero, where there is no rotation: the key holds.
    let back = [0.0, 0.0, 0.0, -1.0];
    let spline = [slope, still, slope, slope, back, slope, slope, still, slope];
    assert_near(turned("CUBICSPLINE", &spline), DVec3::X);
}

#[test]
fn clips_repeat() {
    let gltf = arm().load();
    for (time, same) in [(2.0, 0.0), (2.5, 0.5), (-1.5, 0.5), (1e6 + 0.5, 0.5), (2.0 - 1e-9, 0.0)] {
        assert_eq!(posed(&gltf, time), posed(&gltf, same), "{time}");
    }
    // A tenth of a second, in single precision, is a little more.
    let mut file = triangle(json!([{ "mesh": 0 }]));
    file.clip("short", (0, "translation"), "LINEAR", &[0.0, 0.1], &[[0.0; 3], [1.0; 3]]);
    let gltf = file.load();
    for time in [0.1, 100.0, 3600.0, -100.0] {
        assert!(posed(&gltf, time).positions[0].x < 1e-3, "{time}");
    }
    assert!(posed(&gltf, 3600.099).positions[0].x > 0.98);
    let mut file = triangle(json!([{ "mesh": 0 }]));
    file.clip("moment", (0, "translation"), "LINEAR", &[0.0], &[[1.0; 3]]);
    assert_eq!(posed(&file.load(), 5.0).positions[0], DVec3::ONE);
}

#[test]
fn sparse_numbers_lie_over_zeros() {
    let mut file = triangle(json!([{ "mesh": 0 }]));
    let expected = file.load().mesh(None).unwrap();
    let [ids, values] = [file.indices(&[1, 2]), file.floats("VEC3", &CORNERS[1..])];
    let view = |accessor: usize| file.root["accessors"][accessor]["bufferView"].clone();
    let sparse = json!({
        "count": 2,
        "indices": { "bufferView": view(ids), "componentType": 5121 },
        "values": { "bufferView": view(values) },
    });
    file.root["accessors"][0] =
        json!({ "componentType": 5126, "count": 3, "type": "VEC3", "sparse": sparse });
    assert_eq!(file.load().mesh(None).unwrap(), expected);
    for count in [1u64 << 40, u64::MAX] {
        file.root["accessors"][0]["count"] = json!(count);
        assert!(told(&file.try_load().map(drop).unwrap_err()).contains("holds more than"));
    }
}

/// Two triangles that share an edge whose vertices are written twice.
fn seam() -> File {
    let mut file = File::new(json!([{ "mesh": 0 }]));
    let corners = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [-0.0, 1.0, 0.0],
    ];
    let positions = file.floats("VEC3", &corners);
    let uvs = file.floats("VEC2", &[0, 1, 2, 3, 4, 5].map(|i| [i as f32, 0.25]));
    let attributes = json!({ "POSITION": positions, "TEXCOORD_0": uvs });
    file.add("meshes", json!({ "primitives": [{ "attributes": attributes }] }));
    file
}

#[test]
fn seams_are_welded_and_texture_coordinates_stay() {
    let mut file = seam();
    let mesh = file.load().mesh(None).unwrap();
    assert_eq!(mesh.triangles, [[0, 1, 2], [1, 3, 2]]);
    // v runs up.
    assert_eq!(mesh.uvs[1], [3.0, 4.0, 5.0].map(|u| DVec2::new(u, 0.75)));
    // What moves only one side keeps them apart.
    let target = [[0.0; 3], [0.0; 3], [0.0; 3], [0.0, 0.0, 1.0], [0.0; 3], [0.0; 3]];
    let target = file.floats("VEC3", &target);
    file.root["meshes"][0]["primitives"][0]["targets"] = json!([{ "POSITION": target }]);
    assert_eq!(file.load().mesh(None).unwrap().positions.len(), 5);
}

#[test]
fn primitives_meshes_and_skins_are_welded() {
    // The same triangles, each half in a primitive of its own.
    let mut file = seam();
    let mut primitive = file.root["meshes"][0]["primitives"][0].clone();
    let (first, second) = (file.indices(&[0, 1, 2]), file.indices(&[3, 4, 5]));
    file.root["meshes"][0]["primitives"][0]["indices"] = json!(first);
    primitive["indices"] = json!(second);
    let whole = seam().load().mesh(None).unwrap();
    let mut two_primitives = file.clone();
    let primitives = two_primitives.root["meshes"][0]["primitives"].as_array_mut().unwrap();
    primitives.push(primitive.clone());
    assert_eq!(two_primitives.load().mesh(None).unwrap(), whole);
    // In a node of its own: together as long as no animation moves it.
    file.add("meshes", json!({ "primitives": [primitive] }));
    file.root["nodes"] =
        json!([{ "children": [1, 2] }, { "mesh": 0 }, { "mesh": 1, "translation": [0, 0, 0] }]);
    assert_eq!(file.load().mesh(None).unwrap(), whole);
    file.clip("apart", (2, "translation"), "LINEAR", &[0.0, 1.0], &[[0.0; 3]; 2]);
    assert_eq!(file.load().mesh(None).unwrap().positions.len(), 6);
    // Two skins of the same joints.
    let mut file = arm();
    let skin = file.root["skins"][0].clone();
    file.root["skins"].as_array_mut().unwrap().push(skin);
    file.root["nodes"][0]["children"] = json!([1, 2, 4]);
    file.add("nodes", json!({ "mesh": 0, "skin": 1 }));
    assert_eq!(file.load().mesh(None).unwrap().positions.len(), 6);
}

#[test]
fn strips_and_fans_face_as_triangles_do() {
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 2.0, 0.0]];
    let loaded = |mode: u32, indices: &[u8]| {
        let mut file = File::new(json!([{ "mesh": 0 }]));
        let positions = file.floats("VEC3", &corners);
        let uvs = file.floats("VEC2", &[[0.0; 2]; 5]);
        let indices = file.indices(indices);
        let attributes = json!({ "POSITION": positions, "TEXCOORD_0": uvs });
        let mut primitives = vec![json!({ "attributes": attributes, "indices": indices, "mode": mode })];
        // Lines are nothing to extrude.
        primitives.push(json!({ "attributes": attributes, "mode": 1 }));
        file.add("meshes", json!({ "primitives": primitives }));
        file.load().mesh(None).unwrap()
    };
    let triangles = loaded(4, &[0, 1, 2, 1, 3, 2, 2, 3, 4]);
    assert_eq!(triangles.triangles.len(), 3);
    assert_eq!(loaded(5, &[0, 1, 2, 3, 4]), triangles);
    let fan = loaded(6, &[0, 1, 3, 4]);
    assert_eq!(fan.triangles.len(), 2);
    assert!(triangles.normals.iter().chain(&fan.normals).all(|normal| *normal == DVec3::Z));
}

#[test]
fn a_mirrored_mesh_faces_outwards() {
    let mut file = triangle(json!([{ "mesh": 0, "scale": [-1, 1, 1] }]));
    let normals = file.floats("VEC3", &[[0.0, 0.0, 1.0]; 3]);
    let mut with_normals = file.clone();
    with_normals.root["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(normals);
    for mut file in [file, with_normals] {
        for moves in [false, true] {
            let mesh = file.load().mesh(None).unwrap();
            assert_eq!(mesh.normals, [DVec3::Z; 3]);
            assert_eq!(info(&mesh).triangles_against_normals, 0);
            if !moves {
                file.clip("move", (0, "translation"), "LINEAR", &[0.0], &[[0.0; 3]]);
            }
        }
    }
}

#[test]
fn integers_strides_and_extensions_of_them_are_read() {
    let mut file = triangle(json!([{ "mesh": 0, "scale": [0.1, 0.1, 0.1] }]));
    // Bytes, each position in four of them.
    let positions = file.accessor("VEC3", 5120, 3, &[0, 0, 0, 9, 10, 0, 0, 9, 0, 10, 0, 9]);
    let view = file.root["accessors"][positions]["bufferView"].as_u64().unwrap() as usize;
    file.root["bufferViews"][view]["byteStride"] = json!(4);
    let uvs = file.accessor("VEC2", 5123, 3, &[0, 0, 0, 0, 255, 255, 0, 0, 0, 0, 255, 255]);
    file.root["accessors"][uvs]["normalized"] = json!(true);
    file.root["meshes"][0]["primitives"][0]["attributes"] =
        json!({ "POSITION": positions, "TEXCOORD_0": uvs, "_OWN": 0 });
    file.root["extensionsRequired"] = json!(["KHR_mesh_quantization", "KHR_materials_unlit"]);
    file.root["nodes"][0]["extras"] = json!(["of any kind"]);
    let mesh = file.load().mesh(None).unwrap();
    assert_near(mesh.positions[1], DVec3::X);
    assert_eq!(mesh.uvs, [[DVec2::Y, DVec2::ONE, DVec2::ZERO]]);
}

#[test]
fn texture_coordinates_that_must_be_transformed_are_told() {
    let mut file = triangle(json!([{ "mesh": 0 }]));
    file.root["extensionsUsed"] = json!(["KHR_texture_transform"]);
    file.load();
    file.root["extensionsRequired"] = json!(["KHR_texture_basisu", "KHR_texture_transform"]);
    let refusal = told(&file.try_load().map(drop).unwrap_err());
    assert!(
        refusal.contains("need the extension KHR_texture_transform") && refusal.contains("`projection`"),
        "{refusal}"
    );
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("file.glb");
    std::fs::write(&path, file.binary()).unwrap();
    Gltf::load(path, Some(&"planar-z".parse().unwrap())).unwrap();
}

/// A scene of this mesh section, and what makes it one.
struct Animation(tempfile::TempDir);

impl Animation {
    fn new(mesh: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("fog.toml"), "recipe = \"fog\"\nsize = [2, 2, 2]\n").unwrap();
        let text = format!(
            "mesh = {{ {mesh} }}\nshell = {{ thickness = 0.1 }}\nvolume = {{ recipe = \"fog.toml\" }}\n\
             timeline = {{ frames = 8, rate = 4 }}\n"
        );
        std::fs::write(folder.path().join("scene.toml"), text).unwrap();
        Self(folder)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, bytes: &[u8]) {
        std::fs::write(self.path(name), bytes).unwrap();
    }

    fn open(&self, keys: &[&str]) -> Result<Sequence, Error> {
        let keys: Vec<String> = keys.iter().map(|&key| key.to_owned()).collect();
        Sequence::open(&self.path("scene.toml"), &keys, &Silent)
    }

    /// What is said of a scene that cannot be opened, with the advice.
    fn refusal(&self, keys: &[&str]) -> String {
        told(&self.open(keys).map(drop).unwrap_err())
    }
}

fn at(sequence: &mut Sequence, frame: u32) -> Scene {
    let Loaded { scene, .. } =
        sequence.at(frame, &Silent, &|_| Ok(())).unwrap_or_else(|error| panic!("{error}"));
    scene
}

#[test]
fn a_scene_plays_a_clip_and_keeps_its_topology() {
    let mut file = arm();
    file.clip("rise", (2, "translation"), "LINEAR", &[0.0, 4.0], &[[0.0; 3], [0.0, 4.0, 0.0]]);
    let animation = Animation::new("file = \"arm.glb\", clip = \"rise\", rate = 2");
    animation.write("arm.glb", &file.binary());
    let lowest =
        |scene: &Scene| scene.shell.vertices.iter().map(|vertex| vertex.y).fold(f64::INFINITY, f64::min);
    let mut sequence = animation.open(&[]).unwrap();
    let first = at(&mut sequence, 1);
    for frame in [3, 1, 8, 2] {
        let scene = at(&mut sequence, frame);
        // Four frames a second, a unit a second of the clip, two of those a second.
        assert!((lowest(&scene) - 0.5 * f64::from(frame - 1)).abs() < 1e-12, "frame {frame}");
        assert!(Arc::ptr_eq(&scene.shell.topology, &first.shell.topology));
        let alone = at(&mut animation.open(&[]).unwrap(), frame);
        assert_eq!(scene.shell.vertices, alone.shell.vertices, "frame {frame}");
    }
    let mut timed = animation.open(&["mesh.time=0.25"]).unwrap();
    let [a, b] = [1, 5].map(|frame| at(&mut timed, frame));
    assert_eq!(lowest(&a), 0.5);
    assert!(Arc::ptr_eq(&a.shell, &b.shell), "a time of its own stands");
    // The first one bends.
    let bent = at(&mut animation.open(&["mesh.clip=bend"]).unwrap(), 3);
    assert_eq!(lowest(&bent), 0.0);
    assert_ne!(bent.shell.vertices, first.shell.vertices);

    let refusal = animation.refusal(&["mesh.clip=fall"]);
    assert!(refusal.contains("arm.glb has no animation \"fall\""), "{refusal}");
    assert!(refusal.ends_with("those that it has: \"bend\", \"rise\""), "{refusal}");

    // By its number, too, unless another is called that; but not by the name of several.
    let lowest_with = |key: &str| lowest(&at(&mut animation.open(&[key]).unwrap(), 3));
    assert_eq!([lowest_with("mesh.clip='1'"), lowest_with("mesh.clip='2'")], [0.0, 1.0]);
    file.root["animations"][0]["name"] = json!("rise");
    animation.write("arm.glb", &file.binary());
    let refusal = animation.refusal(&[]);
    assert!(refusal.contains("arm.glb has 2 animations \"rise\""), "{refusal}");
    assert!(refusal.ends_with("choose one by its number: \"1\", \"2\""), "{refusal}");
    assert_eq!([lowest_with("mesh.clip='1'"), lowest_with("mesh.clip='2'")], [0.0, 1.0]);
    file.root["animations"][0]["name"] = json!("2");
    file.root["animations"][1].as_object_mut().unwrap().remove("name");
    animation.write("arm.glb", &file.binary());
    assert_eq!([lowest_with("mesh.clip='1'"), lowest_with("mesh.clip='2'")], [0.0, 1.0]);
}

#[test]
fn reading_is_a_stage_of_the_first_frame() {
    struct Heard(Mutex<Vec<String>>);
    impl Progress for Heard {
        fn stage(&self, name: &str) {
            self.0.lock().unwrap().push(name.to_owned());
        }
        fn fraction(&self, _: f64) {}
    }
    let animation = Animation::new("file = \"arm.glb\"");
    animation.write("arm.glb", &arm().binary());
    let heard = Heard(Mutex::default());
    let keys = ["mesh.time=1".to_owned()];
    let mut sequence = Sequence::open(&animation.path("scene.toml"), &keys, &heard).unwrap();
    assert_eq!(*heard.0.lock().unwrap(), ["loading the mesh"]);
    let Loaded { stages, .. } = sequence.at(1, &Silent, &|_| Ok(())).unwrap();
    assert_eq!(stages.iter().filter(|stage| stage.name == "load.mesh").count(), 1, "{stages:?}");
    // The clip stands at its time: the mesh is kept.
    let Loaded { stages, .. } = sequence.at(2, &Silent, &|_| Ok(())).unwrap();
    assert!(stages.iter().all(|stage| stage.name != "load.mesh"), "{stages:?}");
}

#[test]
fn the_command_line_lists_joints_and_animations() {
    let animation = Animation::new("file = \"arm.glb\"");
    animation.write("arm.glb", &arm().binary());
    let told = |more: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_mesoshell"));
        command.arg("mesh").arg("info").arg(animation.path("arm.glb")).args(more);
        String::from_utf8(command.output().unwrap().stdout).unwrap()
    };
    let json: Value = serde_json::from_str(&told(&["--json"])).unwrap();
    let counts =
        ["positions", "triangles", "vertices", "joints", "morph_targets"].map(|key| json[key].as_u64());
    assert_eq!(counts, [6, 4, 6, 2, 0].map(Some));
    assert_eq!(json["clips"], json!([{ "name": "bend", "duration": 2.0 }]));
    let text = told(&[]);
    assert!(text.contains("  joints ") && text.contains("bend, 2 s"), "{text}");
}

#[test]
fn what_does_not_move_is_kept() {
    let animation = Animation::new("file = \"a.GLB\"");
    animation.write("a.GLB", &triangle(json!([{ "mesh": 0 }])).binary());
    let mut sequence = animation.open(&[]).unwrap();
    let [a, b] = [2, 5].map(|frame| at(&mut sequence, frame));
    assert!(Arc::ptr_eq(&a.shell, &b.shell));
    for (key, part) in [
        ("mesh.clip=walk", "has no animation \"walk\" -- those that it has: none"),
        ("mesh.rate=2", "`rate` and `time` are for an animation, but"),
        ("mesh.file=a.obj", "a.obj"),
        ("mesh={file=\"a.obj\",clip=\"walk\"}", "`clip` is for a glTF file"),
        ("mesh={file=\"a.obj\",time=1}", "`rate` and `time` are for a sequence of files"),
        ("mesh={generator=\"torus\",clip=\"walk\"}", "unknown key `clip`"),
    ] {
        if let Err(error) = animation.open(&[key]) {
            assert!(told(&error).contains(part), "{}", told(&error));
        } else {
            assert_eq!(part, "a.obj", "a mesh of another kind is read with its frame");
        }
    }
    animation.write("a.1.glb", b"");
    let refusal = animation.refusal(&["mesh.file=a.#.glb"]);
    assert!(refusal.contains("a sequence is one of OBJ files"), "{refusal}");
}

#[test]
fn missing_texture_coordinates_are_told_before_the_first_frame() {
    let animation = Animation::new("file = \"a.glb\"");
    let mut file = triangle(json!([{ "mesh": 0, "translation": [3, 0, 0] }]));
    file.root["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap().remove("TEXCOORD_0");
    animation.write("a.glb", &file.binary());
    let refusal = animation.refusal(&[]);
    assert!(refusal.contains("mesh 0, primitive 0: it has no texture coordinates"), "{refusal}");
    assert!(refusal.contains("`projection`"), "{refusal}");
    let projected = Gltf::load(animation.path("a.glb"), Some(&"planar-z".parse().unwrap())).unwrap();
    assert_eq!(projected.mesh(None).unwrap().uvs, [[DVec2::ZERO, DVec2::X, DVec2::Y]]);
    at(&mut animation.open(&["mesh.projection=planar-z"]).unwrap(), 1);
}

#[test]
fn buffers_may_be_elsewhere_and_are_inputs() {
    let file = arm();
    let animation = Animation::new("file = \"arm.gltf\"");
    animation.write("arm.gltf", &file.text("its%20data.bin"));
    animation.write("its data.bin", &file.bytes);
    let load = || Gltf::load(animation.path("arm.gltf"), None);
    let expected = posed(&file.load(), 0.7);
    assert_eq!(posed(&load().unwrap(), 0.7), expected);
    let inputs = animation.open(&[]).unwrap().inputs(1).unwrap().files;
    assert_eq!(inputs, ["arm.gltf", "fog.toml", "its data.bin"].map(|name| animation.path(name)));
    // Behind a byte-order mark, too.
    animation.write("arm.gltf", &[b"\xef\xbb\xbf", &file.text("its%20data.bin")[..]].concat());
    assert_eq!(posed(&load().unwrap(), 0.7), expected);
    assert_eq!(animation.open(&[]).unwrap().inputs(1).unwrap().files, inputs);

    animation.write("its data.bin", &file.bytes[1..]);
    let refusal = told(&load().map(drop).unwrap_err());
    assert!(refusal.contains("buffer 0 has") && refusal.contains("but should have"), "{refusal}");
    std::fs::remove_file(animation.path("its data.bin")).unwrap();
    let refusal = told(&load().map(drop).unwrap_err());
    assert!(refusal.contains("its data.bin: cannot be read") && refusal.contains("buffer 0 of"), "{refusal}");
    animation.write("arm.gltf", &file.text(&file.data_uri()));
    assert_eq!(posed(&load().unwrap(), 0.7), expected);
    // And beside a binary file.
    let mut root = file.clone();
    root.root["buffers"] = json!([{ "byteLength": file.bytes.len(), "uri": "far.bin" }]);
    animation.write("arm.glb", &root.binary());
    animation.write("far.bin", &file.bytes);
    let inputs = animation.open(&["mesh.file=arm.glb"]).unwrap().inputs(1).unwrap().files;
    assert!(inputs.contains(&animation.path("far.bin")), "{inputs:?}");
}

fn told(error: &Error) -> String {
    let help = match error {
        Error::Input { help, .. } | Error::Text { help, .. } | Error::Usage { help, .. } => help.as_deref(),
        _ => None,
    };
    format!("{error} -- {}", help.unwrap_or_default())
}
