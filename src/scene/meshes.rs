//! Meshes that move by themselves. Those of a sequence, `walk.####.obj`, follow one another, and have all the same triangles: between
//! two files positions go in straight lines. That of a glTF file has its clips.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::file::MeshSection;
use super::numbered;
use super::timeline::Moment;
use crate::mesh::gltf::{Gltf, Pose};
use crate::mesh::{Mesh, Projection, obj};
use crate::progress::Progress;
use crate::{Error, Result};

/// What a sequence shows: a mesh between those of two files.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Between {
    /// Of the sequence: its texture coordinates are those of all.
    first: PathBuf,
    from: PathBuf,
    /// The same as `from` where `part` is 0.
    to: PathBuf,
    /// How far it is from the one to the other, 0..1.
    part: f64,
}

/// What a mesh that moves by itself shows.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Shown {
    Between(Between),
    /// Of a glTF file; without one it is at rest.
    Pose(Option<Pose>),
}

/// A file that was read, and the projection with which it was.
struct Read<Of> {
    path: PathBuf,
    projection: Option<Projection>,
    of: Arc<Of>,
}

/// The files that were read last.
#[derive(Default)]
pub(super) struct MeshFiles {
    sequence: Vec<Read<Mesh>>,
    gltf: Option<Read<Gltf>>,
    /// How long glTF files were read that no frame's report tells yet.
    pub(super) untold: Duration,
}

impl<Of> Read<Of> {
    fn is(&self, path: &Path, projection: Option<&Projection>) -> bool {
        self.path == path && self.projection.as_ref() == projection
    }

    fn new(path: &Path, projection: Option<&Projection>, of: Of) -> Self {
        Self { path: path.to_owned(), projection: projection.cloned(), of: Arc::new(of) }
    }
}

impl Between {
    /// What `files`, at least one, show at a moment.
    pub(super) fn of(files: Vec<PathBuf>, moment: Moment, rate: f64, time: Option<f64>) -> Self {
        let (from, to, part) = moment.between(files.len(), rate, time);
        let to = if part == 0.0 { from } else { to };
        let [first, from, to] = [0, from, to].map(|file| files[file].clone());
        Self { first, from, to, part }
    }

    /// The mesh. A projection is that of the first file, so that the texture moves with the mesh.
    pub(super) fn load(&self, projection: Option<&Projection>, files: &mut MeshFiles) -> Result<Mesh> {
        let [from, to] = [&self.from, &self.to].map(|file| files.get(file, projection));
        let (from, to) = (from?, to?);
        check(&self.to, &to, &self.from, &from, projection.is_none())?;
        let mut mesh = Mesh::clone(&from);
        if self.part > 0.0 {
            for (position, other) in mesh.positions.iter_mut().zip(&to.positions) {
                *position = position.lerp(*other, self.part);
            }
            for (normal, other) in mesh.normals.iter_mut().zip(&to.normals) {
                // Half way between opposite ones there is none.
                *normal = normal.lerp(*other, self.part).try_normalize().unwrap_or(*normal);
            }
        }
        if projection.is_some() {
            mesh.uvs.clone_from(&files.get(&self.first, projection)?.uvs);
        }
        files.sequence.retain(|read| [&self.first, &self.from, &self.to].contains(&&read.path));
        Ok(mesh)
    }
}

impl MeshFiles {
    fn get(&mut self, path: &Path, projection: Option<&Projection>) -> Result<Arc<Mesh>> {
        if let Some(read) = self.sequence.iter().find(|read| read.is(path, projection)) {
            return Ok(read.of.clone());
        }
        let read = Read::new(path, projection, obj::load(path, projection)?);
        let mesh = read.of.clone();
        self.sequence.push(read);
        Ok(mesh)
    }

    /// # Errors
    /// As [`Gltf::load`].
    pub(super) fn gltf(
        &mut self,
        path: &Path,
        projection: Option<&Projection>,
        progress: &dyn Progress,
    ) -> Result<Arc<Gltf>> {
        let read = match self.gltf.take() {
            Some(read) if read.is(path, projection) => read,
            _ => {
                progress.stage("loading the mesh");
                let start = Instant::now();
                let read = Read::new(path, projection, Gltf::load(path, projection)?);
                self.untold += start.elapsed();
                read
            }
        };
        Ok(self.gltf.insert(read).of.clone())
    }
}

/// Refuses a sequence of meshes that have not all the same triangles and texture coordinates.
///
/// # Errors
/// [`Error::Input`] with the file.
pub(super) fn check_all(section: &MeshSection, base_dir: &Path) -> Result<()> {
    let Some(path) = &section.file else { return Ok(()) };
    let Some(files) = numbered::files(&base_dir.join(path))? else { return Ok(()) };
    let projection = section.projection.as_ref();
    let first = obj::load(&files[0], projection)?;
    files[1..].iter().try_for_each(|file| {
        let mesh = obj::load(file, projection)?;
        check(file, &mesh, &files[0], &first, projection.is_none())
    })
}

/// Refuses a mesh whose triangles, or texture coordinates where they are the file's own, are not those of another.
fn check(path: &Path, mesh: &Mesh, other_path: &Path, other: &Mesh, has_own_uvs: bool) -> Result<()> {
    let other_path = other_path.display();
    let (count, expected) = (mesh.triangles.len(), other.triangles.len());
    let unlike = |triangle: &usize| mesh.triangles[*triangle] != other.triangles[*triangle];
    let moved = |triangle: &usize| mesh.uvs[*triangle] != other.uvs[*triangle];
    let message = if count != expected {
        format!("has {count} triangles, but {other_path} has {expected}")
    } else if let Some(triangle) = (0..count).find(unlike) {
        format!("triangle {} joins other vertices than in {other_path}", triangle + 1)
    } else if let Some(triangle) = (0..count).find(moved).filter(|_| has_own_uvs) {
        format!("triangle {} has other texture coordinates than in {other_path}", triangle + 1)
    } else {
        return Ok(());
    };
    Err(Error::input(path, message).with_help(
        "all meshes of a sequence must have the same triangles and texture coordinates, and no two vertices that meet in some of \
         them alone",
    ))
}
