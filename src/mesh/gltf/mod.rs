//! glTF 2.0 files (Khronos Group, "glTF 2.0 Specification", ISO/IEC 12113:2022), in text and binary, with skins, morph targets
//! and their animations.
//!
//! All triangles of the default scene become one mesh, whose triangles and texture coordinates stay while it moves. A vertex
//! is morphed, then carried by the joints of its skin, or by its node. Vertices of the file are welded where they have the
//! same position before all that, and everything that moves them is the same, so that no motion tears them apart; what no
//! animation moves is welded by its place in the world. Texture coordinates are those of the first set, with v turned upwards,
//! as OBJ files have it. Normals are averaged at each vertex of every pose as those of an OBJ file are; if one is missing, or a
//! morph target has none, all are computed from the triangles of the pose. Materials, pictures, cameras and lights are not read.
//!
//! | beside | what |
//! |---|---|
//! | `document` | the text, the bytes, and the files that they are in |
//! | `accessor` | numbers out of bytes |
//! | `nodes` | the hierarchy |
//! | `clip` | animations |
//! | `geometry` | triangles, and what moves their vertices |

mod accessor;
mod clip;
mod document;
mod geometry;
mod nodes;

use std::path::{Path, PathBuf};

use glam::{DAffine3, DVec3};
use gltf::json::animation::Property;
use rayon::prelude::*;
use serde::Serialize;

pub use clip::Clip;
pub use document::named_files;

use self::document::Document;
use self::geometry::{Base, Geometry, Normal};
use self::nodes::Nodes;
use super::deform::cofactor;
use super::{Mesh, Projection, normals};
use crate::{Error, Result};

/// Vertices that one task of the thread pool takes at least: some 20 us of work.
const TASK: usize = 256;

/// How near to its end a clip begins again, in seconds or, after a second, relative to the time: one that is a whole number of its
/// durations, but for their being written in single precision, which is off by up to 6e-8 of it. More than that would cut off
/// what is shown: after an hour it is less than a millisecond.
const END_ROUNDING: f64 = 2e-7;

/// Whether a name ends as those of glTF files do.
pub fn has_name_of_one(path: &Path) -> bool {
    path.extension()
        .is_some_and(|ending| ["glb", "gltf"].iter().any(|known| ending.eq_ignore_ascii_case(known)))
}

/// A mesh that moves.
pub struct Gltf {
    path: PathBuf,
    /// Its nodes.
    scene: Vec<usize>,
    nodes: Nodes,
    weights: Weights,
    clips: Vec<Clip>,
    geometry: Geometry,
    /// One a position; empty until they are known.
    rest_normals: Vec<DVec3>,
}

/// What is in a file, counted.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Contents<'a> {
    /// Those of the file, before they are welded.
    pub vertices: u64,
    /// Nodes that carry vertices of skins.
    pub joints: u64,
    /// Of all nodes of the scene.
    pub morph_targets: u64,
    /// The animations.
    pub clips: &'a [Clip],
}

/// A moment of a clip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Its index.
    clip: usize,
    /// Seconds, from 0 to below its duration.
    time: f64,
}

/// How much of each morph target there is at rest, those of one node after those of another.
struct Weights {
    rest: Vec<f64>,
    /// Of each node; and behind the last.
    firsts: Vec<usize>,
}

impl Weights {
    fn of(document: &Document) -> Result<Self> {
        let mut weights = Self { rest: Vec::new(), firsts: Vec::new() };
        for (id, node) in document.root.nodes.iter().enumerate() {
            weights.firsts.push(weights.rest.len());
            let Some(index) = node.mesh else { continue };
            let mesh = document.get(index, "mesh")?;
            let mut counts =
                mesh.primitives.iter().map(|primitive| primitive.targets.as_ref().map_or(0, Vec::len));
            let count = counts.next().unwrap_or(0);
            if counts.any(|other| other != count) {
                return Err(document.error(format!(
                    "mesh {index}: its primitives differ in how many morph targets they have"
                )));
            }
            // What is asked again of every node that has the mesh, triangles or not.
            document.spend((mesh.primitives.len() + count) as u64)?;
            match node.weights.as_ref().or(mesh.weights.as_ref()) {
                Some(own) if own.len() != count || own.iter().any(|weight| !weight.is_finite()) => {
                    let own = own.len();
                    let message = format!(
                        "node {id}: its {own} weights are not {count} finite numbers, one a morph target"
                    );
                    return Err(document.error(message));
                }
                Some(own) => weights.rest.extend(own.iter().map(|weight| f64::from(*weight))),
                None => weights.rest.resize(weights.rest.len() + count, 0.0),
            }
        }
        weights.firsts.push(weights.rest.len());
        Ok(weights)
    }

    fn of_node(&self, node: usize) -> std::ops::Range<usize> {
        self.firsts[node]..self.firsts[node + 1]
    }
}

impl Gltf {
    /// Reads a file. A projection makes texture coordinates, of the mesh at rest, in place of those of the file.
    ///
    /// # Errors
    /// [`Error::Input`] when the file, or one that it names, cannot be read, is damaged, needs an extension that is not
    /// supported, has no triangles, has no texture coordinates where no projection is given, or has a vertex without a normal.
    pub fn load(path: impl AsRef<Path>, projection: Option<&Projection>) -> Result<Self> {
        let document = Document::read(path.as_ref())?;
        let nodes = Nodes::of(&document)?;
        let scene = Nodes::of_scene(&document)?;
        let weights = Weights::of(&document)?;
        let clips = Clip::all(&document, |node| weights.of_node(node).len())?;
        let mut moves = vec![false; nodes.places.len()];
        for channel in clips.iter().flat_map(|clip| &clip.channels) {
            moves[channel.node] |= channel.property != Property::MorphTargetWeights;
        }
        let base = Base {
            document: &document,
            world_from_node: &nodes.in_world(&nodes.places),
            moves: &nodes.carried(moves),
            first_weights: &weights.firsts,
            needs_uvs: projection.is_none(),
        };
        let geometry = Geometry::of(base, &scene)?;
        let path = document.path;
        let mut gltf = Self { path, scene, nodes, weights, clips, geometry, rest_normals: Vec::new() };
        if let Some(projection) = projection {
            let (positions, _) = gltf.placed(None);
            gltf.geometry.uvs = projection.uvs(&positions, &gltf.geometry.triangles);
        }
        gltf.rest_normals = gltf.mesh(None)?.normals;
        Ok(gltf)
    }

    /// What the file holds.
    pub fn contents(&self) -> Contents<'_> {
        Contents {
            vertices: self.geometry.file_vertices,
            joints: self.geometry.joints,
            morph_targets: self.scene.iter().map(|&node| self.weights.of_node(node).len() as u64).sum(),
            clips: &self.clips,
        }
    }

    /// The animations.
    pub fn clips(&self) -> &[Clip] {
        &self.clips
    }

    /// The pose of a clip, given by its index, at a time in seconds. Before 0 and after its duration a clip is repeated.
    ///
    /// # Panics
    /// Where there is no such clip.
    pub fn pose(&self, clip: usize, time: f64) -> Pose {
        let duration = self.clips[clip].duration;
        let rounding = END_ROUNDING * time.abs().max(1.0);
        // Not a number where the clip has a single moment.
        let time = time.rem_euclid(duration);
        let is_within = time < duration - rounding;
        Pose { clip, time: if is_within { time } else { 0.0 } }
    }

    /// The mesh in a pose; without one, at rest. Where a pose leaves a vertex without a normal, it has that of the mesh at
    /// rest.
    ///
    /// # Errors
    /// [`Error::Input`] where a vertex is moved beyond [`LARGEST_COORDINATE`](super::LARGEST_COORDINATE).
    pub fn mesh(&self, pose: Option<Pose>) -> Result<Mesh> {
        let (positions, normals) = self.placed(pose);
        let or_at_rest =
            |(id, normal): (usize, &Option<DVec3>)| normal.or(self.rest_normals.get(id).copied());
        let normals: Vec<_> = normals.iter().enumerate().map(or_at_rest).collect();
        let mesh = Mesh {
            positions,
            normals: normals.iter().map(|normal| normal.unwrap_or(DVec3::Y)).collect(),
            triangles: self.geometry.triangles.clone(),
            uvs: self.geometry.uvs.clone(),
        };
        let when = pose.map_or("at rest".to_owned(), |pose| {
            format!("{} s into \"{}\"", pose.time, self.clips[pose.clip].name)
        });
        mesh.validate().map_err(|message| Error::input(&self.path, message).of(&when))?;
        match normals.iter().position(Option::is_none) {
            None => Ok(mesh),
            Some(id) => {
                let position = mesh.positions[id];
                Err(Error::input(&self.path, normals::missing(position)).with_help(normals::ADVICE))
            }
        }
    }

    /// Positions, and normals where there are any.
    fn placed(&self, pose: Option<Pose>) -> (Vec<DVec3>, Vec<Option<DVec3>>) {
        let (mut places, mut weights) = (self.nodes.places.clone(), self.weights.rest.clone());
        if let Some(Pose { clip, time }) = pose {
            for channel in &self.clips[clip].channels {
                let weights = &mut weights[self.weights.of_node(channel.node)];
                channel.apply(time, &mut places[channel.node], weights);
            }
        }
        let Geometry { bones, vertices, triangles, normals, corner_normals, .. } = &self.geometry;
        let world_from_node = self.nodes.in_world(&places);
        let bones = bones.iter().map(|bone| {
            bone.node.map_or(DAffine3::IDENTITY, |node| world_from_node[node]) * bone.inverse_bind
        });
        let bones: Vec<DAffine3> = bones.collect();
        let of_vertex = vertices.par_iter().with_min_len(TASK).map(|vertex| {
            let matrix = vertex.matrix(&bones);
            (matrix.transform_point3(vertex.position.at(&weights)), cofactor(matrix.matrix3))
        });
        let (positions, cofactors): (Vec<_>, Vec<_>) = of_vertex.unzip();
        let of_normal = normals
            .par_iter()
            .with_min_len(TASK)
            .map(|Normal { normal, vertex }| cofactors[*vertex as usize] * normal.at(&weights));
        let directions: Vec<DVec3> = of_normal.collect();
        let corners = corner_normals.iter().map(|ids| ids.map(|id| directions[id as usize]));
        let corners: Option<Vec<_>> = (!corner_normals.is_empty()).then(|| corners.collect());
        let normals = normals::where_there_are(&positions, triangles, corners.as_deref());
        (positions, normals)
    }
}
