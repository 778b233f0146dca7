//! Whether a mesh encloses something: every edge must be run as often one way as the other. Then the winding number of any
//! point off the surface is a whole number, and where it is not zero is inside, so parts may overlap and touch.

use std::collections::HashMap;

use crate::mesh::model::Model;
use crate::{Error, Result};

/// # Errors
/// [`Error::Input`] with the number of edges at fault.
pub(super) fn check(model: &Model) -> Result<()> {
    // How many triangles run an edge from its lower to its higher id, and back.
    let mut edges = HashMap::<[u32; 2], [u32; 2]>::with_capacity(3 * model.triangles.len() / 2);
    for &[a, b, c] in &model.triangles {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            edges.entry([from.min(to), from.max(to)]).or_default()[usize::from(from > to)] += 1;
        }
    }
    let count = |is: fn(u32) -> bool| edges.values().filter(|[up, down]| up != down && is(up + down)).count();
    let (open, turned, crowded) = (count(|n| n == 1), count(|n| n == 2), count(|n| n > 2));
    let thickness = "give its surface a thickness by --surface, in texels";
    if open > 0 {
        let others = if crowded > 0 {
            format!(", and {crowded} edges with three triangles or more")
        } else {
            String::new()
        };
        let message =
            format!("the mesh is not closed: {open} of its {} edges have one triangle{others}", edges.len());
        return Err(Error::input(&model.path, message).with_help(format!("close its holes, or {thickness}")));
    }
    if crowded > 0 {
        let message = format!(
            "the mesh is not manifold: {crowded} of its {} edges have three triangles or more that enclose nothing",
            edges.len()
        );
        let help = format!("delete the inner faces, or {thickness}");
        return Err(Error::input(&model.path, message).with_help(help));
    }
    if turned > 0 {
        let message = format!(
            "the triangles at {turned} of the {} edges disagree on which side is outside",
            edges.len()
        );
        let help = format!("make its normals consistent, or {thickness}");
        return Err(Error::input(&model.path, message).with_help(help));
    }
    Ok(())
}
