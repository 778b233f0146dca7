//! SXMPVO: relations of faces, relations of the image, and the search, in one call.

use std::time::{Duration, Instant};

use glam::DVec3;

use super::abuffer::ABuffer;
use super::relations::{FaceTable, Relations};
use super::search::InFront;
use super::{Order, gaps};
use crate::scene::View;
use crate::shell::{Shell, Topology};

/// Wall time of each part.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Times {
    /// Exact signs of all faces, and the relations that they give.
    pub relations: Duration,
    /// The A-buffer of boundary faces, and the relations that it gives.
    pub abuffer: Duration,
    /// The graph, and the search in it.
    pub search: Duration,
}

/// An order, with what was learnt on the way.
#[derive(Debug, Clone, PartialEq)]
pub struct Sorted {
    /// Front to back.
    pub order: Order,
    /// One a tetrahedron: bit `k` is set where the eye lies strictly on the inner side of face `k`: a ray
    /// leaves through it. The very signs that the order was made from; 0 where there is no volume.
    pub exit_faces: Vec<u8>,
    /// Relations between tetrahedra that share a face.
    pub face_relations: u64,
    /// Further relations, found by the A-buffer.
    pub image_relations: u64,
    /// Tetrahedra in [`Order::cycles`].
    pub cycle_members: u64,
    /// See [`Times`].
    pub times: Times,
}

/// Sorts one topology for many views, or while its vertices move.
#[derive(Debug, Clone)]
pub struct Sorter {
    faces: FaceTable,
}

impl Sorter {
    /// Lists the faces of `topology`.
    pub fn new(topology: &Topology) -> Self {
        Self { faces: FaceTable::new(topology) }
    }

    /// Orders all tetrahedra of `shell`, whose topology is the one of [`Sorter::new`], for the pixel centres
    /// of `view`. The result depends on nothing else, the number of threads included.
    pub fn sort(&self, shell: &Shell, view: &View) -> Sorted {
        let eye = view.camera.eye;
        let mut lap = Instant::now();
        let mut elapsed = || {
            let begin = std::mem::replace(&mut lap, Instant::now());
            lap - begin
        };
        let Relations { pairs, exit_faces, boundary } =
            self.faces.relate(&shell.determinants, &shell.vertices, eye);
        let relations = elapsed();

        let image_pairs = {
            let abuffer = ABuffer::of_view(&shell.vertices, &boundary, view);
            gaps::relate(&abuffer, shell.topology.tetrahedra.len())
        };
        let abuffer = elapsed();

        let mut lists: Vec<&[[u32; 2]]> = vec![&pairs];
        lists.extend(image_pairs.iter().map(Vec::as_slice));
        let in_front = InFront::new(shell.topology.tetrahedra.len(), &lists);
        let (mut sequence, cycles) = in_front.components();
        for cycle in &cycles {
            sort_by_centroid(&mut sequence[cycle.clone()], shell, eye);
        }
        let search = elapsed();

        Sorted {
            cycle_members: cycles.iter().map(|cycle| cycle.len() as u64).sum(),
            order: Order { sequence, cycles },
            exit_faces,
            face_relations: pairs.len() as u64,
            image_relations: in_front.relations().saturating_sub(pairs.len()) as u64,
            times: Times { relations, abuffer, search },
        }
    }
}

/// [`Sorter::sort`] for a single view.
pub fn sort(shell: &Shell, view: &View) -> Sorted {
    Sorter::new(&shell.topology).sort(shell, view)
}

/// Sorts tetrahedra by the distance of their centroids from the eye, and by id: the best guess where
/// no order is right.
fn sort_by_centroid(tetrahedra: &mut [u32], shell: &Shell, eye: DVec3) {
    let distance = |id: u32| {
        let corners = shell.topology.tetrahedra[id as usize].map(|v| shell.vertices[v as usize] - eye);
        corners.into_iter().sum::<DVec3>().length_squared()
    };
    tetrahedra.sort_by(|&a, &b| distance(a).total_cmp(&distance(b)).then(a.cmp(&b)));
}
