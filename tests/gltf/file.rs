//! glTF files in memory, part by part, by the specification of Khronos (glTF 2.0): a triangle, and an arm of two joints.

use std::f64::consts::FRAC_1_SQRT_2;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::DVec3;
use mesoshell::Error;
use mesoshell::mesh::Mesh;
use mesoshell::mesh::gltf::Gltf;
use serde_json::{Value, json};

/// A glTF file: its text, and its one buffer.
#[derive(Clone)]
pub struct File {
    pub root: Value,
    pub bytes: Vec<u8>,
}

impl File {
    /// One scene of `nodes`, of which the first is its root.
    pub fn new(nodes: Value) -> Self {
        let root = json!({
            "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": nodes,
            "meshes": [], "accessors": [], "bufferViews": [],
        });
        Self { root, bytes: Vec::new() }
    }

    pub fn add(&mut self, list: &str, value: Value) -> usize {
        let list = self.root[list].as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    }

    /// An accessor of elements of the type, component type and bytes given.
    pub fn accessor(&mut self, shape: &str, component: u32, count: usize, bytes: &[u8]) -> usize {
        let offset = self.bytes.len();
        self.bytes.extend_from_slice(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let view = json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len() });
        let view = self.add("bufferViews", view);
        let accessor =
            json!({ "bufferView": view, "componentType": component, "count": count, "type": shape });
        self.add("accessors", accessor)
    }

    pub fn floats<const N: usize>(&mut self, shape: &str, elements: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = elements.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        self.accessor(shape, 5126, elements.len(), &bytes)
    }

    pub fn indices(&mut self, indices: &[u8]) -> usize {
        self.accessor("SCALAR", 5121, indices.len(), indices)
    }

    /// A clip that moves one property of one node.
    pub fn clip<const N: usize>(
        &mut self,
        name: &str,
        (node, path): (usize, &str),
        interpolation: &str,
        times: &[f32],
        values: &[[f32; N]],
    ) {
        let times: Vec<[f32; 1]> = times.iter().map(|&time| [time]).collect();
        let input = self.floats("SCALAR", &times);
        let output = self.floats(["SCALAR", "", "VEC3", "VEC4"][N - 1], values);
        let clip = json!({
            "name": name,
            "samplers": [{ "input": input, "interpolation": interpolation, "output": output }],
            "channels": [{ "sampler": 0, "target": { "node": node, "path": path } }],
        });
        if self.root["animations"].is_null() {
            self.root["animations"] = json!([]);
        }
        self.add("animations", clip);
    }

    /// The text, with its buffer at `uri`.
    pub fn text(&self, uri: &str) -> Vec<u8> {
        let mut root = self.root.clone();
        root["buffers"] = json!([{ "byteLength": self.bytes.len(), "uri": uri }]);
        root.to_string().into_bytes()
    }

    pub fn data_uri(&self) -> String {
        format!("data:application/octet-stream;base64,{}", STANDARD.encode(&self.bytes))
    }

    pub fn binary(&self) -> Vec<u8> {
        let mut root = self.root.clone();
        if root["buffers"].is_null() {
            root["buffers"] = json!([{ "byteLength": self.bytes.len() }]);
        }
        let mut json = root.to_string().into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        let mut bytes = b"glTF\x02\0\0\0".to_vec();
        bytes.extend((28 + json.len() as u32 + self.bytes.len() as u32).to_le_bytes());
        for (kind, chunk) in [(b"JSON", &json), (b"BIN\0", &self.bytes)] {
            bytes.extend((chunk.len() as u32).to_le_bytes());
            bytes.extend(kind);
            bytes.extend(chunk);
        }
        bytes
    }

    pub fn load(&self) -> Gltf {
        self.try_load().unwrap_or_else(|error| panic!("{error}"))
    }

    pub fn try_load(&self) -> Result<Gltf, Error> {
        load(&self.binary())
    }
}

pub fn load(bytes: &[u8]) -> Result<Gltf, Error> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("file.glb");
    std::fs::write(&path, bytes).unwrap();
    Gltf::load(path, None)
}

pub const CORNERS: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
pub const UVS: [[f32; 2]; 3] = [[0.0, 0.0], [1.0, 0.0], [0.0, 0.25]];

/// A triangle that faces Z, of the first of these nodes.
pub fn triangle(nodes: Value) -> File {
    let mut file = File::new(nodes);
    let (positions, uvs) = (file.floats("VEC3", &CORNERS), file.floats("VEC2", &UVS));
    let attributes = json!({ "POSITION": positions, "TEXCOORD_0": uvs });
    file.add("meshes", json!({ "primitives": [{ "attributes": attributes }] }));
    file
}

/// A strip of three rows, at y = 0, 1.5 and 2, on two joints: one at the origin, one a unit above, which turns about Z by 90
/// degrees within a second and then rests. The lowest row is held by the first, the highest by the second, the other by both.
pub fn arm() -> File {
    let mut file = File::new(json!([
        { "children": [1, 2], "translation": [0, 0, 0] },
        { "mesh": 0, "skin": 0, "translation": [5, 6, 7] },
        { "children": [3] },
        { "translation": [0, 1, 0] },
    ]));
    let rows = [0.0, 1.5, 2.0].map(|y| [[0.0, y, 0.0], [0.25, y, 0.0]]);
    let positions = file.floats("VEC3", rows.as_flattened());
    let uvs = file.floats("VEC2", &[0, 1, 2, 3, 4, 5].map(|i| [(i % 2) as f32, (i / 2) as f32]));
    let [low, half, high] = [[255, 0, 0, 0], [128, 128, 0, 0], [0, 0, 0, 255]];
    let weights = file.accessor("VEC4", 5121, 6, &[low, low, half, half, high, high].concat());
    file.root["accessors"][weights]["normalized"] = json!(true);
    let joints = file.accessor("VEC4", 5121, 6, &[[0, 1, 0, 1]; 6].concat());
    let indices = file.indices(&[0, 1, 2, 3, 4, 5]);
    let matrix = |y: f32| {
        let mut matrix: [f32; 16] = std::array::from_fn(|i| if i % 5 == 0 { 1.0 } else { 0.0 });
        matrix[13] = -y;
        matrix
    };
    let matrices = file.floats("MAT4", &[matrix(0.0), matrix(1.0)]);
    file.root["skins"] = json!([{ "joints": [2, 3], "inverseBindMatrices": matrices }]);
    let attributes =
        json!({ "POSITION": positions, "TEXCOORD_0": uvs, "JOINTS_0": joints, "WEIGHTS_0": weights });
    file.add(
        "meshes",
        json!({ "primitives": [{ "attributes": attributes, "indices": indices, "mode": 5 }] }),
    );
    let quarter = FRAC_1_SQRT_2 as f32;
    let turns = [[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, quarter, quarter], [0.0, 0.0, quarter, quarter]];
    file.clip("bend", (3, "rotation"), "LINEAR", &[0.0, 1.0, 2.0], &turns);
    file
}

pub fn posed(gltf: &Gltf, time: f64) -> Mesh {
    gltf.mesh(Some(gltf.pose(0, time))).unwrap()
}

/// Single precision of the file's numbers.
#[track_caller]
pub fn assert_near(a: DVec3, b: DVec3) {
    assert!((a - b).length() < 1e-6, "{a} instead of {b}");
}
