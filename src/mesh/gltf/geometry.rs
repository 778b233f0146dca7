//! The triangles of a glTF file, and what moves their vertices.

use std::collections::{HashMap, HashSet};

use glam::{DAffine3, DMat3, DVec2, DVec3};
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{Accessor, Index, Skin};

use super::document::Document;
use super::nodes::affine;
use crate::Result;
use crate::mesh::deform::cofactor;
use crate::mesh::projection;

/// What carries vertices: their place in the world is `world from node * inverse_bind`.
pub(super) struct Bone {
    /// None carries what stands still.
    pub node: Option<usize>,
    pub inverse_bind: DAffine3,
}

/// A position, or a normal, that morph targets move.
#[derive(Clone)]
pub(super) struct Morphed {
    base: DVec3,
    targets: Targets,
}

/// The weights that count, ascending, and what each adds where it is 1.
type Targets = Vec<(u32, DVec3)>;

/// A vertex of the welded mesh.
pub(super) struct Vertex {
    pub position: Morphed,
    /// Bones, ascending, and their shares, which sum to 1.
    pub bones: Vec<(u32, f64)>,
}

/// A vertex of the file.
struct Source {
    /// Which of the welded ones it is.
    vertex: u32,
    uv: DVec2,
    normal: Option<Morphed>,
}

/// The normal of a vertex of the file.
pub(super) struct Normal {
    pub normal: Morphed,
    pub vertex: u32,
}

/// All triangles of the file's scene.
pub(super) struct Geometry {
    pub bones: Vec<Bone>,
    pub vertices: Vec<Vertex>,
    /// Of vertices, three different ones each.
    pub triangles: Vec<[u32; 3]>,
    /// One a corner; zero where none are needed.
    pub uvs: Vec<[DVec2; 3]>,
    /// Of normals, one a corner; where the file has not all of them, none.
    pub corner_normals: Vec<[u32; 3]>,
    pub normals: Vec<Normal>,
    /// How many vertices the file has for them.
    pub file_vertices: u64,
    /// How many different nodes are joints of skins.
    pub joints: u64,
}

/// What the geometry stands on.
pub(super) struct Base<'a> {
    pub document: &'a Document,
    /// Of each node, at rest.
    pub world_from_node: &'a [DAffine3],
    /// Of each node, whether a clip moves it.
    pub moves: &'a [bool],
    /// Of each node, the index of its first weight.
    pub first_weights: &'a [usize],
    pub needs_uvs: bool,
}

/// Triangles as they are gathered.
struct Builder<'a> {
    base: Base<'a>,
    bones: Vec<Bone>,
    /// At rest.
    world_from_bind: Vec<DAffine3>,
    bone_ids: HashMap<(Option<usize>, [u64; 12]), u32>,
    joints: HashSet<usize>,
    vertices: Vec<Vertex>,
    /// By the bits of all that a vertex is.
    vertex_ids: HashMap<Vec<u64>, u32>,
    sources: Vec<Source>,
    /// Of sources.
    triangles: Vec<[u32; 3]>,
}

impl Geometry {
    /// What the meshes of `scene`, a list of nodes, hold.
    ///
    /// # Errors
    /// [`Error::Input`](crate::Error::Input) where something is missing or makes no sense, or no triangle is there.
    pub fn of(base: Base<'_>, scene: &[usize]) -> Result<Self> {
        let document = base.document;
        let mut builder = Builder {
            base,
            bones: Vec::new(),
            world_from_bind: Vec::new(),
            bone_ids: HashMap::new(),
            joints: HashSet::new(),
            vertices: Vec::new(),
            vertex_ids: HashMap::new(),
            sources: Vec::new(),
            triangles: Vec::new(),
        };
        for &node in scene {
            let Some(index) = document.root.nodes[node].mesh else { continue };
            for (number, primitive) in document.get(index, "mesh")?.primitives.iter().enumerate() {
                let read = builder.primitive(node, primitive);
                read.map_err(|error| error.of(&format!("mesh {index}, primitive {number}")))?;
            }
        }
        builder.finish()
    }
}

impl Morphed {
    pub fn at(&self, weights: &[f64]) -> DVec3 {
        self.targets.iter().fold(self.base, |sum, &(target, delta)| sum + weights[target as usize] * delta)
    }

    fn map(&mut self, map: impl Fn(DVec3) -> DVec3, linear: impl Fn(DVec3) -> DVec3) {
        self.base = map(self.base);
        self.targets.iter_mut().for_each(|(_, delta)| *delta = linear(*delta));
    }
}

impl Vertex {
    /// The bits of all that it is, alike for 0 and -0.
    fn key(&self) -> Vec<u64> {
        let bits = |point: DVec3| point.to_array().map(|x| (x + 0.0).to_bits());
        let mut key = bits(self.position.base).to_vec();
        key.push(self.bones.len() as u64);
        key.extend(self.bones.iter().flat_map(|&(bone, share)| [u64::from(bone), share.to_bits()]));
        let targets = self.position.targets.iter();
        key.extend(targets.flat_map(|&(target, delta)| [u64::from(target)].into_iter().chain(bits(delta))));
        key
    }

    /// Where it is taken by matrices, one a bone.
    pub fn matrix(&self, bones: &[DAffine3]) -> DAffine3 {
        mixed(&self.bones, bones)
    }
}

/// The sum of the bones' matrices, each times its share.
fn mixed(shares: &[(u32, f64)], bones: &[DAffine3]) -> DAffine3 {
    let zero = DAffine3 { matrix3: DMat3::ZERO, translation: DVec3::ZERO };
    shares.iter().fold(zero, |sum, &(bone, share)| {
        let DAffine3 { matrix3, translation } = bones[bone as usize];
        DAffine3 {
            matrix3: sum.matrix3 + share * matrix3,
            translation: sum.translation + share * translation,
        }
    })
}

impl Builder<'_> {
    fn primitive(&mut self, node: usize, primitive: &Primitive) -> Result<()> {
        let document = self.base.document;
        let Checked::Valid(mode) = primitive.mode else {
            return Err(document.error("its mode is none that there is"));
        };
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            return Ok(());
        }
        let attribute = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
        let positions =
            attribute(Semantic::Positions).ok_or_else(|| document.error("it has no positions"))?;
        let positions = document.numbers::<3>(positions, None)?;
        let count = positions.len();
        let first = self.sources.len() as u32;
        let uvs = match attribute(Semantic::TexCoords(0)) {
            _ if !self.base.needs_uvs => None,
            Some(uvs) => {
                document.check_uvs()?;
                Some(document.numbers::<2>(uvs, Some(count))?)
            }
            None => {
                let message = "it has no texture coordinates, and a shell texture needs them";
                return Err(document.error(message).with_help(projection::ADVICE));
            }
        };
        let mut bones = self.bones_of(node, primitive, count)?;
        let (position_targets, normal_targets) = self.targets(node, primitive, count)?;
        let normals = attribute(Semantic::Normals).zip(normal_targets);
        let normals = match normals {
            Some((normals, targets)) => Some(morphed(document.numbers::<3>(normals, Some(count))?, targets)),
            None => None,
        };
        let mut normals = normals.into_iter().flatten();

        let stands = document.root.nodes[node].skin.is_none() && !self.base.moves[node];
        let world_from_node = self.base.world_from_node[node];
        let mut mirrored = 0;
        for (id, mut position) in morphed(positions, position_targets).into_iter().enumerate() {
            let mut normal = normals.next();
            let bones = std::mem::take(&mut bones[id]);
            let world_from_bind = if stands {
                position
                    .map(|p| world_from_node.transform_point3(p), |d| world_from_node.transform_vector3(d));
                let cofactor = cofactor(world_from_node.matrix3);
                normal.iter_mut().for_each(|normal| normal.map(|n| cofactor * n, |d| cofactor * d));
                world_from_node
            } else {
                mixed(&bones, &self.world_from_bind)
            };
            mirrored += usize::from(world_from_bind.matrix3.determinant() < 0.0);
            let vertex = Vertex { position, bones };
            let next = self.vertices.len() as u32;
            let vertices = &mut self.vertices;
            let vertex = *self.vertex_ids.entry(vertex.key()).or_insert_with(|| {
                vertices.push(vertex);
                next
            });
            let uv = uvs.as_ref().map_or(DVec2::ZERO, |uvs| DVec2::new(uvs[id][0], 1.0 - uvs[id][1]));
            self.sources.push(Source { vertex, uv, normal });
        }
        // A mirror turns triangles inside out, and their normals with them.
        let is_mirrored = 2 * mirrored > count;
        if is_mirrored {
            let normals =
                self.sources[first as usize..].iter_mut().filter_map(|source| source.normal.as_mut());
            normals.for_each(|normal| normal.map(|n| -n, |d| -d));
        }
        let corners: Vec<u32> = match primitive.indices {
            Some(index) => document
                .indices::<1>(index, None, count, "vertex")?
                .into_iter()
                .map(|[id]| first + id)
                .collect(),
            None => (first..first + count as u32).collect(),
        };
        if mode == Mode::Triangles && !corners.len().is_multiple_of(3) {
            return Err(
                document.error(format!("it has {} corners, which make no whole triangles", corners.len()))
            );
        }
        let triangles = triangles(mode, &corners);
        self.triangles.extend(triangles.map(|[a, b, c]| if is_mirrored { [a, c, b] } else { [a, b, c] }));
        Ok(())
    }

    /// Of each vertex, the bones and their shares.
    fn bones_of(&mut self, node: usize, primitive: &Primitive, count: usize) -> Result<Vec<Vec<(u32, f64)>>> {
        let document = self.base.document;
        let Some(index) = document.root.nodes[node].skin else {
            let bone = self.bone(Some(node).filter(|&node| self.base.moves[node]), DAffine3::IDENTITY);
            return Ok(vec![vec![(bone, 1.0)]; count]);
        };
        let joints = self.joints(document.get(index, "skin")?)?;
        let mut bones = vec![Vec::new(); count];
        for set in 0.. {
            let attribute = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
            let (Some(ids), Some(shares)) =
                (attribute(Semantic::Joints(set)), attribute(Semantic::Weights(set)))
            else {
                break;
            };
            let ids = document.indices::<4>(ids, Some(count), joints.len(), "joint")?;
            let shares = document.numbers::<4>(shares, Some(count))?;
            for (bones, (ids, shares)) in bones.iter_mut().zip(ids.into_iter().zip(shares)) {
                let shares = ids.into_iter().zip(shares).filter(|(_, share)| *share != 0.0);
                bones.extend(shares.map(|(id, share)| (joints[id as usize], share)));
            }
        }
        for (id, bones) in bones.iter_mut().enumerate() {
            // In one order, so that the two sides of a seam have the same sums.
            bones.sort_by(|a: &(u32, f64), b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
            bones.dedup_by(|again, bone| {
                let is_same = again.0 == bone.0;
                bone.1 += if is_same { again.1 } else { 0.0 };
                is_same
            });
            if let Some((_, share)) = bones.iter().find(|(_, share)| *share < 0.0) {
                let message = format!("vertex {id} has a joint with the weight {share}, which is below 0");
                return Err(document.error(message));
            }
            let sum: f64 = bones.iter().map(|(_, share)| share).sum();
            if sum == 0.0 {
                return Err(document
                    .error(format!("vertex {id} has no joints with weights above 0, but its mesh has a skin"))
                    .with_help("bind every vertex to a joint, and export the file again"));
            }
            bones.iter_mut().for_each(|(_, share)| *share /= sum);
        }
        Ok(bones)
    }

    /// The bones of a skin's joints.
    fn joints(&mut self, skin: &Skin) -> Result<Vec<u32>> {
        let document = self.base.document;
        document.spend(12 * skin.joints.len() as u64)?;
        let matrices = match skin.inverse_bind_matrices {
            Some(index) => document.numbers::<16>(index, None)?.into_iter().map(affine).collect(),
            None => vec![DAffine3::IDENTITY; skin.joints.len()],
        };
        if matrices.len() < skin.joints.len() {
            let message =
                format!("its skin has {} matrices for {} joints", matrices.len(), skin.joints.len());
            return Err(document.error(message));
        }
        let joints = skin.joints.iter().zip(matrices);
        joints
            .map(|(&node, matrix)| {
                document.get(node, "node")?;
                self.joints.insert(node.value());
                Ok(self.bone(Some(node.value()), matrix))
            })
            .collect()
    }

    fn bone(&mut self, node: Option<usize>, inverse_bind: DAffine3) -> u32 {
        let next = self.bones.len() as u32;
        *self.bone_ids.entry((node, inverse_bind.to_cols_array().map(f64::to_bits))).or_insert_with(|| {
            self.bones.push(Bone { node, inverse_bind });
            let world_from_node = node.map_or(DAffine3::IDENTITY, |node| self.base.world_from_node[node]);
            self.world_from_bind.push(world_from_node * inverse_bind);
            next
        })
    }

    /// Of each vertex, what its morph targets add to its position, and to its normal unless that is unknown.
    fn targets(
        &self,
        node: usize,
        primitive: &Primitive,
        count: usize,
    ) -> Result<(Vec<Targets>, Option<Vec<Targets>>)> {
        let document = self.base.document;
        let (mut positions, mut normals) = (vec![Vec::new(); count], vec![Vec::new(); count]);
        let mut has_normals = true;
        let add = |index: Index<Accessor>, weight: usize, targets: &mut [Targets]| -> Result<()> {
            for (targets, delta) in targets.iter_mut().zip(document.numbers::<3>(index, Some(count))?) {
                if delta != [0.0; 3] {
                    targets.push((weight as u32, DVec3::from_array(delta)));
                }
            }
            Ok(())
        };
        document.spend(primitive.targets.as_ref().map_or(0, Vec::len) as u64)?;
        let first = self.base.first_weights[node];
        for (weight, target) in (first..).zip(primitive.targets.iter().flatten()) {
            if let Some(index) = target.positions {
                add(index, weight, &mut positions)?;
                has_normals &= target.normals.is_some();
            }
            if let Some(index) = target.normals {
                add(index, weight, &mut normals)?;
            }
        }
        Ok((positions, has_normals.then_some(normals)))
    }

    /// Without triangles that have fewer than three different vertices, and without vertices that no triangle has.
    fn finish(self) -> Result<Geometry> {
        let Self { base: Base { document, .. }, bones, joints, vertices, sources, triangles, .. } = self;
        let mut new_ids = vec![None; vertices.len()];
        let mut kept = Vec::new();
        let has_normals = sources.iter().all(|source| source.normal.is_some());
        let mut geometry = Geometry {
            bones,
            vertices: Vec::new(),
            triangles: Vec::new(),
            uvs: Vec::new(),
            corner_normals: Vec::new(),
            normals: Vec::new(),
            file_vertices: sources.len() as u64,
            joints: joints.len() as u64,
        };
        for corners in triangles {
            let [a, b, c] = corners.map(|source| sources[source as usize].vertex);
            if a == b || b == c || c == a {
                continue;
            }
            geometry.triangles.push([a, b, c].map(|id| {
                *new_ids[id as usize].get_or_insert_with(|| {
                    kept.push(id);
                    kept.len() as u32 - 1
                })
            }));
            geometry.uvs.push(corners.map(|source| sources[source as usize].uv));
            if has_normals {
                geometry.corner_normals.push(corners);
            }
        }
        if geometry.triangles.is_empty() {
            return Err(document
                .error("no triangle with three different vertices is in its scene")
                .with_help("export the meshes that are wanted, as triangles"));
        }
        let mut vertices: Vec<Option<Vertex>> = vertices.into_iter().map(Some).collect();
        geometry.vertices = kept.into_iter().filter_map(|id| vertices[id as usize].take()).collect();
        if has_normals {
            let normal = |source: Source| {
                // A vertex that no triangle has has no corner either.
                let vertex = new_ids[source.vertex as usize].unwrap_or(0);
                source.normal.map(|normal| Normal { normal, vertex })
            };
            geometry.normals = sources.into_iter().filter_map(normal).collect();
        }
        Ok(geometry)
    }
}

fn morphed(bases: Vec<[f64; 3]>, targets: Vec<Targets>) -> Vec<Morphed> {
    let both = bases.into_iter().zip(targets);
    both.map(|(base, targets)| Morphed { base: DVec3::from_array(base), targets }).collect()
}

/// The triangles of corners, counter-clockwise: section 3.7.2.1 of the specification.
fn triangles(mode: Mode, corners: &[u32]) -> impl Iterator<Item = [u32; 3]> {
    let count = match mode {
        Mode::Triangles => corners.len() / 3,
        _ => corners.len().saturating_sub(2),
    };
    (0..count).map(move |i| {
        match mode {
            Mode::TriangleStrip => [i, i + 1 + i % 2, i + 2 - i % 2],
            Mode::TriangleFan => [i + 1, i + 2, 0],
            _ => [3 * i, 3 * i + 1, 3 * i + 2],
        }
        .map(|corner| corners[corner])
    })
}
