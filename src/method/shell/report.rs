//! The report of a frame: what it counted, what it skipped and why, and what the user should know.

use super::canvas::Canvas;
use super::constants::{MOST_SAMPLES, wanted_samples};
use super::plan::where_rays_end;
use super::seen::Seen;
use super::shadows::Shadows;
use super::{Shell, Sight};
use crate::frame::Report;
use crate::scene::Skip;
use crate::shell::Limit;

/// Shadows that are so much coarser for the solids are told of.
const COARSE: f64 = 4.0;

impl Shell {
    /// Without stages, and without what was kept of the frame before.
    pub(super) fn report(&self, sight: &Sight, seen: &Seen, rgba: &[[f32; 4]]) -> Report {
        let health = self.scene.shell.health;
        let mut report =
            Report { method: "shell".into(), device: self.gpu.info().name.clone(), ..Report::default() };
        let mut count = |name: &str, value: u64| report.counts.insert(name.to_owned(), value);
        count("tetrahedra", health.tetrahedra);
        count("tetrahedra_drawn", seen.count);
        match sight {
            Sight::Sorted(sorted) => {
                count("face_relations", sorted.face_relations);
                count("image_relations", sorted.image_relations);
                count("cycles", sorted.order.cycles.len() as u64);
                count("tetrahedra_in_cycles", sorted.cycle_members);
            }
            Sight::Walked(crossings) => {
                count("crossings", crossings.count);
                count("pixels_begun_inside", crossings.begun_inside);
                count("pixels_overlapping", crossings.overlapping);
            }
        }
        count("pixels_covered", rgba.iter().filter(|pixel| pixel[3] > 0.0).count() as u64);
        let triangles = self.scene.solids.iter().map(|solid| solid.mesh.triangles.len() as u64).sum::<u64>();
        if triangles > 0 {
            count("solid_triangles", triangles);
        }
        if let Some(shadows) = &self.shadows {
            count("shadow_pictures", shadows.pictures() as u64);
        }
        if seen.before_near > 0 {
            report.skipped.push(format!("{} tetrahedra lie before the near plane", seen.before_near));
        }
        if seen.beside > 0 {
            report.skipped.push(format!("{} tetrahedra lie beside the picture", seen.beside));
        }
        if health.zero_volume > 0 {
            report.skipped.push(format!("{} tetrahedra have no volume", health.zero_volume));
        }
        match sight {
            Sight::Sorted(sorted) if sorted.order.cycles.is_empty() => report
                .skipped
                .push("no tetrahedra hide one another in a cycle: nothing is resolved per pixel".into()),
            Sight::Sorted(_) => {}
            Sight::Walked(_) => {
                report
                    .skipped
                    .push("each ray walks from tetrahedron to tetrahedron: nothing is sorted".into());
            }
        }
        if self.ends_where_saturated() {
            report.skipped.push(where_rays_end(&self.scene));
        }
        if self.volume.is_sparse() {
            report.skipped.push("rays leap over what is empty".into());
        }
        if self.volume.even().is_some() {
            report.skipped.push("where the volume is one medium several steps are one".into());
        }
        if !seen.minified && self.scene.skips.allow(Skip::Levels) {
            report.skipped.push("all is magnified: no level of detail but 0 is compiled in".into());
        }
        if self.canvas.as_ref().is_some_and(Canvas::is_parted) {
            let magnified = seen.minified_squares.iter().filter(|minified| !**minified).count();
            report.skipped.push(format!(
                "in {magnified} of {} squares of 64 x 64 pixels all is magnified: no level of detail but 0 is read there",
                seen.minified_squares.len()
            ));
        }
        match &self.scene.shading {
            None => report.skipped.push("the scene is unlit: nothing of light is compiled in".into()),
            Some(_) if !self.scene.casts_shadows() => {
                report.skipped.push("no light casts shadows: nothing of them is compiled in".into());
            }
            _ => {}
        }
        if let Some(Limit { vertices, least, at }) = self.scene.shell.limit {
            report.counts.insert("vertices_limited".to_owned(), vertices);
            let [x, y, z] = at.to_array();
            report.skipped.push(format!(
                "the shell is thinner than asked at {vertices} vertices, so that it does not fold: {least:.3} of it at \
                 ({x:.4}, {y:.4}, {z:.4})"
            ));
        }
        if health.inverted > 0 {
            report.warnings.push(format!(
                "{} of {} tetrahedra are inverted: the shell folds; {}",
                health.inverted,
                health.tetrahedra,
                match self.scene.shell.limit {
                    Some(_) => "no thickness helps there: normals lie below their triangles, which only another mesh mends",
                    None => "make it thinner, smooth its directions, or let it give way by shell.limit = \"safe\"",
                }
            ));
        }
        if let Some(coarsened) = self.shadows.as_ref().map(Shadows::coarsened_by_solids)
            && coarsened > COARSE
        {
            report.warnings.push(format!(
                "shadows are {coarsened:.0} times as coarse as the shell alone would have them, since a light's picture shows all \
                 solids: make them smaller or move them nearer, or make shading.shadow_size larger"
            ));
        }
        let wanted = wanted_samples(self.scene.march, self.texels);
        if wanted > MOST_SAMPLES {
            report.warnings.push(format!(
                "a ray may pass {:.0} texels in one tetrahedron, and want {wanted:.0} samples there; it takes at most \
                 {MOST_SAMPLES}, so that what is seen there may be coarse or cut short: make shell.uv_scale smaller",
                self.texels
            ));
        }
        report
    }
}
