//! The nodes of a glTF file: each has its place in that of its parent.

use std::collections::VecDeque;

use glam::{DAffine3, DMat4, DQuat, DVec3, DVec4};
use gltf::json::Node;

use super::document::Document;
use crate::Result;

/// Where a node is, in the space of its parent.
#[derive(Debug, Clone, Copy)]
pub(super) enum Place {
    /// No clip may move it.
    Matrix(DAffine3),
    Parts {
        translation: DVec3,
        rotation: DQuat,
        scale: DVec3,
    },
}

/// The nodes at rest.
pub(super) struct Nodes {
    pub places: Vec<Place>,
    parents: Vec<Option<usize>>,
    /// All of them, each after its parent.
    order: Vec<usize>,
}

impl Place {
    fn of(document: &Document, node: &Node) -> Result<Self> {
        let is_finite = |numbers: &[f32]| numbers.iter().all(|x| x.is_finite());
        if let Some(matrix) = &node.matrix {
            if !is_finite(matrix) {
                return Err(document.error("its matrix is not finite"));
            }
            return Ok(Self::Matrix(affine(matrix.map(f64::from))));
        }
        let translation = node.translation.unwrap_or([0.0; 3]);
        let rotation = node.rotation.unwrap_or_default().0;
        let scale = node.scale.unwrap_or([1.0; 3]);
        if !is_finite(&translation) || !is_finite(&rotation) || !is_finite(&scale) {
            return Err(document.error("its translation, rotation or scale is not finite"));
        }
        let rotation = DVec4::from_array(rotation.map(f64::from)).try_normalize();
        let rotation = rotation.ok_or_else(|| document.error("its rotation is zero, which is none"))?;
        Ok(Self::Parts {
            translation: DVec3::from_array(translation.map(f64::from)),
            rotation: DQuat::from_vec4(rotation),
            scale: DVec3::from_array(scale.map(f64::from)),
        })
    }

    fn matrix(self) -> DAffine3 {
        match self {
            Self::Matrix(matrix) => matrix,
            Self::Parts { translation, rotation, scale } => {
                DAffine3::from_scale_rotation_translation(scale, rotation, translation)
            }
        }
    }
}

/// Of a matrix in columns, whose last row is 0, 0, 0, 1 by the specification.
pub(super) fn affine(columns: [f64; 16]) -> DAffine3 {
    DAffine3::from_mat4(DMat4::from_cols_array(&columns))
}

impl Nodes {
    /// # Errors
    /// [`Error::Input`](crate::Error::Input) where a node has two parents, or is its own ancestor, or has no place.
    pub fn of(document: &Document) -> Result<Self> {
        let nodes = &document.root.nodes;
        let mut parents = vec![None; nodes.len()];
        let mut places = Vec::with_capacity(nodes.len());
        for (id, node) in nodes.iter().enumerate() {
            places.push(Place::of(document, node).map_err(|error| error.of(&format!("node {id}")))?);
            for &child in node.children.iter().flatten() {
                document.get(child, "node")?;
                if let Some(other) = parents[child.value()].replace(id) {
                    return Err(
                        document.error(format!("node {child} is a child of both node {other} and node {id}"))
                    );
                }
            }
        }
        let roots = (0..nodes.len()).filter(|&id| parents[id].is_none());
        let order = descendants(nodes, roots.collect());
        if order.len() < nodes.len() {
            let mut is_below = vec![false; nodes.len()];
            order.iter().for_each(|&id| is_below[id] = true);
            let id = is_below.iter().position(|is_below| !is_below).unwrap_or_default();
            return Err(document.error(format!("node {id} is a descendant of itself, or of a node that is")));
        }
        Ok(Self { places, parents, order })
    }

    /// The nodes of the default scene, ascending.
    ///
    /// # Errors
    /// [`Error::Input`](crate::Error::Input) where there is none.
    pub fn of_scene(document: &Document) -> Result<Vec<usize>> {
        let scene = match document.root.scene {
            Some(index) => document.get(index, "scene")?,
            None => document.root.scenes.first().ok_or_else(|| document.error("there is no scene in it"))?,
        };
        scene.nodes.iter().try_for_each(|&index| document.get(index, "node").map(drop))?;
        let roots = scene.nodes.iter().map(|index| index.value()).collect();
        let mut nodes = descendants(&document.root.nodes, roots);
        nodes.sort_unstable();
        Ok(nodes)
    }

    /// Where nodes are in the world.
    pub fn in_world(&self, places: &[Place]) -> Vec<DAffine3> {
        let mut world = vec![DAffine3::IDENTITY; places.len()];
        for &id in &self.order {
            let parent = self.parents[id].map_or(DAffine3::IDENTITY, |parent| world[parent]);
            world[id] = parent * places[id].matrix();
        }
        world
    }

    /// Which nodes move where those of `moved` do.
    pub fn carried(&self, mut moved: Vec<bool>) -> Vec<bool> {
        for &id in &self.order {
            moved[id] |= self.parents[id].is_some_and(|parent| moved[parent]);
        }
        moved
    }
}

/// These nodes and those below them, each once; of a forest each after its parent, if all of `roots` are.
fn descendants(nodes: &[Node], roots: Vec<usize>) -> Vec<usize> {
    let mut order = Vec::with_capacity(nodes.len());
    let mut is_there = vec![false; nodes.len()];
    let mut next = VecDeque::from(roots);
    while let Some(id) = next.pop_front() {
        if !std::mem::replace(&mut is_there[id], true) {
            order.push(id);
            next.extend(nodes[id].children.iter().flatten().map(|child| child.value()));
        }
    }
    order
}
