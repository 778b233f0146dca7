//! glTF files that are wrong, cut off or spoilt: each is told, and none brings the reader down.

use std::path::Path;

use glam::DVec3;
use mesoshell::Error;
use mesoshell::mesh::gltf::Gltf;
use rand::{RngExt, SeedableRng};
use serde_json::{Value, json};

use super::file::{arm, load, triangle};
use super::told;

/// A place in the text of [`arm`], what is written there, and a part of what is said of it.
fn defects() -> Vec<(&'static str, Value, &'static str)> {
    let ghost = u32::MAX;
    vec![
        ("/asset/version", json!("1.0"), "is of glTF 1.0"),
        (
            "/extensionsRequired",
            json!(["KHR_draco_mesh_compression"]),
            "needs the extension KHR_draco_mesh_compression",
        ),
        (
            "/extensionsRequired",
            json!(["KHR_texture_procedurals"]),
            "needs the extension KHR_texture_procedurals",
        ),
        ("/scene", json!(7), "there is no scene 7"),
        ("/scenes/0/nodes", json!([99]), "there is no node 99"),
        ("/scenes/0/nodes", json!([]), "no triangle"),
        ("/nodes/3/children", json!([2]), "both node 0 and node 3"),
        ("/nodes/3/children", json!([0]), "is a descendant of itself"),
        ("/nodes/3/children", json!([3]), "node 3 is a child of both"),
        ("/nodes/3/children", json!([ghost]), "there is no node 4294967295"),
        ("/nodes/3/rotation", json!([0, 0, 0, 0]), "node 3: its rotation is zero"),
        (
            "/nodes/3/matrix",
            json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]),
            "it moves node 3, which has a matrix",
        ),
        ("/nodes/0/matrix", json!([1e300, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]), ""),
        ("/nodes/0/scale", json!([1e38, 1e38, 1e38]), "1e32"),
        ("/nodes/1/mesh", json!(1), "there is no mesh 1"),
        ("/nodes/1/skin", json!(1), "there is no skin 1"),
        ("/nodes/1/weights", json!([1]), "its 1 weights are not 0 finite numbers"),
        ("/skins/0/joints", json!([2]), "names the joint 1, but there are 1"),
        ("/skins/0/joints", json!([2, 3, 0]), "2 matrices for 3 joints"),
        ("/skins/0/joints", json!([2, 44]), "there is no node 44"),
        ("/meshes/0/primitives/0/mode", json!(9), "its mode is none"),
        ("/meshes/0/primitives/0/mode", json!(0), "no triangle"),
        ("/meshes/0/primitives/0/mode", json!(4), ""),
        ("/meshes/0/primitives/0/attributes/POSITION", json!(99), "there is no accessor 99"),
        (
            "/meshes/0/primitives/0/attributes/POSITION",
            json!(1),
            "accessor 1: it holds elements of type Vec2",
        ),
        ("/meshes/0/primitives/0/attributes", json!({}), "it has no positions"),
        ("/meshes/0/primitives/0/attributes/WEIGHTS_0", json!(3), ""),
        ("/meshes/0/primitives/0/attributes/WEIGHTS_1", json!(3), ""),
        ("/meshes/0/primitives/0/attributes/JOINTS_0", json!(2), "accessor 2: it names the joint"),
        ("/meshes/0/primitives/0/indices", json!(2), "not of 1 numbers"),
        ("/accessors/0/count", json!(5), "it holds 6 elements, but should hold 5"),
        ("/accessors/0/count", json!(u64::MAX), "reach beyond the end of buffer view 0"),
        ("/accessors/0/count", json!(1u64 << 60), "reach beyond the end of buffer view 0"),
        ("/accessors/0/bufferView", json!(null), "it has no buffer view"),
        ("/accessors/0/bufferView", json!(77), "there is no buffer view 77"),
        ("/accessors/0/byteOffset", json!(4), "reach beyond the end of buffer view 0"),
        ("/accessors/0/byteOffset", json!(u64::MAX), "reach beyond the end of buffer view 0"),
        ("/accessors/0/componentType", json!(1), "its type is none"),
        ("/accessors/0/type", json!("MAT2"), "not of 3 numbers"),
        (
            "/accessors/0/sparse",
            json!({ "count": u64::MAX, "indices": { "bufferView": 0, "componentType": 5125 },
            "values": { "bufferView": 0 } }),
            "reach beyond the end",
        ),
        (
            "/accessors/0/sparse",
            json!({ "count": 2, "indices": { "bufferView": 2, "componentType": 5121 },
            "values": { "bufferView": 0 } }),
            "its sparse index 255 is not below 6",
        ),
        ("/bufferViews/0/byteLength", json!(u64::MAX), "buffer view 0 reaches beyond the end of buffer 0"),
        ("/bufferViews/0/byteOffset", json!(u64::MAX), "buffer view 0 reaches beyond the end of buffer 0"),
        ("/bufferViews/0/buffer", json!(3), "reaches beyond the end of buffer 3"),
        ("/bufferViews/0/byteStride", json!(0), "a stride of 0 for elements of 12 bytes"),
        ("/bufferViews/0/byteStride", json!(u64::MAX), "reach beyond the end of buffer view 0"),
        ("/buffers", json!([{ "byteLength": 100000 }]), "but should have 100000"),
        ("/buffers", json!([{ "byteLength": u64::MAX }]), "longer than 2048 MiB"),
        ("/buffers", json!([{ "byteLength": 1 }]), "reaches beyond the end of buffer 0"),
        ("/buffers", json!([{ "byteLength": 1 }, { "byteLength": 1 }]), "buffer 1 has neither"),
        ("/buffers", json!([{ "byteLength": 1, "uri": "data:,x" }]), "not in base64"),
        ("/buffers", json!([{ "byteLength": 1, "uri": "none.bin" }]), "none.bin: cannot be read"),
        ("/animations/0/channels/0/sampler", json!(2), "there is no sampler 2"),
        ("/animations/0/channels/0/target/node", json!(9), "there is no node 9"),
        (
            "/animations/0/channels/0/target/path",
            json!("colour"),
            "a path or an interpolation that there is not",
        ),
        ("/animations/0/channels/0/target/path", json!("weights"), "has no morph targets to weigh"),
        ("/animations/0/channels/0/target/path", json!("scale"), "elements of type Vec4"),
        ("/animations/0/samplers/0/interpolation", json!("CUBICSPLINE"), "but should hold 9"),
        ("/animations/0/samplers/0/input", json!(0), "not of 1 numbers"),
        ("/animations/0/samplers/0/output", json!(88), "there is no accessor 88"),
    ]
}

#[test]
fn every_defect_is_told() {
    for (place, value, part) in defects() {
        let mut file = arm();
        let (parent, key) = place.rsplit_once('/').unwrap();
        match file.root.pointer_mut(parent).unwrap() {
            Value::Array(list) => list[key.parse::<usize>().unwrap()] = value,
            object => object[key] = value,
        }
        match file.try_load() {
            // Some are merely strange.
            Ok(gltf) => assert!(part.is_empty() && gltf.mesh(None).is_ok(), "{place} should say {part}"),
            Err(error) => {
                let told = told(&error);
                assert!(told.contains(part), "{place}: {told:?} should say {part:?}");
                assert!(!told.ends_with("-- ") || part == "1e32", "{place}: {told:?} advises nothing");
                assert!(told.contains("file.glb: ") || part.contains("none.bin"), "{told}");
            }
        }
    }
}

#[test]
fn numbers_that_are_none_are_told() {
    for (offset, part) in [(0, "accessor 0: element 0 is [NaN, 0.0, 0.0]"), (72, "accessor 1: element 0")] {
        let mut file = arm();
        file.bytes[offset..offset + 4].copy_from_slice(&f32::NAN.to_le_bytes());
        let told = told(&file.try_load().map(drop).unwrap_err());
        assert!(told.contains(part), "{told}");
    }
    for times in [[1.0, 1.0], [-1.0, 0.0]] {
        let mut file = arm();
        file.clip("when", (2, "scale"), "LINEAR", &times, &[[1.0; 3]; 2]);
        let told = told(&file.try_load().map(drop).unwrap_err());
        assert!(told.contains("times of keys must ascend"), "{told}");
    }
    for (first, part) in
        [(-1.0, "vertex 0 has a joint with the weight -1, which is below 0"), (0.0, "vertex 0 has no joints")]
    {
        let mut file = arm();
        let mut weights = [[1.0, 0.0, 0.0, 0.0]; 6];
        weights[0][0] = first;
        let weights = file.floats("VEC4", &weights);
        file.root["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = json!(weights);
        let told = told(&file.try_load().map(drop).unwrap_err());
        assert!(told.contains(part), "{told}");
    }
    let mut file = arm();
    file.clip("far", (2, "scale"), "LINEAR", &[0.0, 1.0], &[[1.0; 3], [f32::MAX; 3]]);
    let gltf = file.load();
    let error = gltf.mesh(Some(gltf.pose(1, 0.5))).unwrap_err().to_string();
    assert!(error.contains("0.5 s into \"far\": position"), "{error}");
    // Nothing is left of it, and so no normal: it has those at rest.
    file.clip("gone", (2, "scale"), "LINEAR", &[0.0, 1.0], &[[1.0; 3], [-1.0; 3]]);
    let gltf = file.load();
    assert_eq!(gltf.mesh(Some(gltf.pose(2, 0.5))).unwrap().normals, [DVec3::Z; 6]);
}

#[test]
fn a_short_file_cannot_ask_for_much() {
    // Any number of morph targets, all of which are the same.
    let mut file = triangle(json!([{ "mesh": 0 }]));
    let count = 1000;
    let positions = file.floats("VEC3", &vec![[0.0; 3]; count]);
    let primitive = json!({ "attributes": { "POSITION": positions, "TEXCOORD_0": file.floats("VEC2", &vec![[0.0; 2]; count]) } });
    file.root["meshes"][0]["primitives"][0] = primitive;
    file.root["meshes"][0]["primitives"][0]["targets"] =
        json!(vec![json!({ "POSITION": positions }); 30_000]);
    assert!(told(&file.try_load().map(drop).unwrap_err()).contains("holds more than"));
    // A chain of nodes, all of which are roots of the scene.
    let many = 100_000;
    let mut file = triangle(json!([]));
    file.root["nodes"] = (0..many).map(|id| json!({ "children": [id + 1] })).collect();
    file.add("nodes", json!({ "mesh": 0 }));
    file.root["scenes"][0]["nodes"] = (0..many).collect();
    assert_eq!(file.load().mesh(None).unwrap().triangles.len(), 1);
}

#[test]
fn every_truncation_is_an_error() {
    let whole = arm().binary();
    load(&whole).unwrap();
    for end in 0..whole.len() {
        let error = load(&whole[..end]).map(drop).unwrap_err();
        assert!(matches!(error, Error::Input { .. }), "{error:?}");
        assert!(end < 12 || error.to_string().contains(": has "), "{error}");
    }
    // With the length that it has.
    for end in 12..whole.len() {
        let mut cut = whole[..end].to_vec();
        cut[8..12].copy_from_slice(&(end as u32).to_le_bytes());
        assert!(load(&cut).is_err(), "{end} bytes");
    }
    assert!(Gltf::load(Path::new("no-such.glb"), None).is_err());
}

#[test]
fn any_byte_may_be_wrong() {
    let whole = arm().binary();
    let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(7);
    let mut loaded = 0;
    for _ in 0..20_000 {
        let mut spoilt = whole.clone();
        for _ in 0..random.random_range(1..4) {
            let at = random.random_range(0..spoilt.len());
            spoilt[at] = random.random_range(0..=255u8);
        }
        if let Ok(gltf) = load(&spoilt) {
            loaded += 1;
            let poses = (0..gltf.clips().len()).map(|clip| Some(gltf.pose(clip, 0.7)));
            poses.chain([None]).for_each(|pose| drop(gltf.mesh(pose)));
        }
    }
    assert!(loaded > 1000, "{loaded} of 20000 are still meshes");
}
