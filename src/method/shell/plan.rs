//! Which way a scene is drawn, and what is left out: chosen from the scene, and from what the device holds.

use super::Shell;
use super::constants::wanted_samples;
use super::volume::Enough;
use super::walk::{self, MOST_SAMPLES};
use crate::method::Choice;
use crate::scene::{March, Scene, Skip, Traversal, View};

/// The part of the volume that must be empty for rays to look how far they may leap: to look costs a fetch for every sample that is
/// taken. 18 % (lit-fur) are too little, 41 % (vase-trees) are as good as none, 42 % (tube-rocks) save two fifths.
const SPARSE: f64 = 0.5;
const SPARSE_LIT: f64 = 0.3;

/// The same of the part that is one medium: of each leap over that one sample is taken, so that 31 % (plane-trees) are too little, too.
const EVEN: f64 = 0.5;

/// How much of the volume must be nothing, or one medium, for rays to leap.
pub(super) fn enough_to_leap(scene: &Scene) -> Enough {
    let may = |skip| scene.skips.allow(skip) && matches!(scene.march, March::Default { .. });
    let sparse = if scene.shading.is_some() { SPARSE_LIT } else { SPARSE };
    Enough { empty: may(Skip::EmptySpace).then_some(sparse), even: may(Skip::EvenSpace).then_some(EVEN) }
}

/// Where rays end, for people.
pub(super) fn where_rays_end(scene: &Scene) -> String {
    match scene.end_below {
        0.0 => "rays end where nothing is let through".to_owned(),
        part => format!("rays end where {part:.0e} of the light is let through"),
    }
}

impl Shell {
    /// Whether the device has room for rays of this view to walk.
    fn has_room(&self, view: &View) -> bool {
        walk::holds(self.gpu.most_texels(), &self.scene.shell, view.width as usize * view.height as usize)
    }

    /// Whether rays walk, unless they cross the boundary too often; else tetrahedra are sorted.
    pub(super) fn walks(&self, view: &View) -> bool {
        self.scene.traversal == Traversal::Walk
            && matches!(self.scene.march, March::Default { .. })
            && wanted_samples(self.scene.march, self.texels) <= MOST_SAMPLES
            && self.has_room(view)
    }

    /// Whether no more is drawn where no more is seen.
    pub(super) fn ends_where_saturated(&self) -> bool {
        self.scene.skips.allow(Skip::Saturation) && matches!(self.scene.march, March::Default { .. })
    }

    /// See [`Method::plan`](crate::method::Method::plan).
    pub(super) fn choices(&self) -> Vec<Choice> {
        let allows = |skip: Skip| self.scene.skips.allow(skip);
        let switched_off = || "it is switched off".to_owned();
        let walks = self.walks(&self.scene.view);
        let walk = if walks {
            ("walk", "each ray goes by itself from neighbour to neighbour: nothing need be sorted".to_owned())
        } else if self.scene.traversal == Traversal::Sort {
            ("sort", "march.traversal asks for it".to_owned())
        } else if matches!(self.scene.march, March::Default { .. }) && !self.has_room(&self.scene.view) {
            ("sort", "the device's buffers of texels are too small for rays to walk".to_owned())
        } else if let March::Default { .. } = self.scene.march {
            let wanted = wanted_samples(self.scene.march, self.texels);
            ("sort", format!("a ray may take {wanted:.0} samples in one tetrahedron: too many to walk"))
        } else {
            ("sort", format!("the {} is drawn so", self.scene.march))
        };
        let on = |is_on: bool| if is_on { "on" } else { "off" };
        let enough = enough_to_leap(&self.scene);
        let (is_sparse, is_even) = (self.volume.is_sparse(), self.volume.even().is_some());
        let leaps = is_sparse || is_even;
        let leap = |skip, enough: Option<f64>, is_on, found: String| match enough {
            _ if !allows(skip) => switched_off(),
            None => format!("the {} takes all its samples", self.scene.march),
            Some(_) if is_on => found,
            Some(_) if leaps => format!("{found}: rays leap over the other"),
            Some(enough) => format!("{found}: looking would pay from {:.0} % on", 100.0 * enough),
        };
        let empty = format!("{:.0} % of the volume is empty", 100.0 * self.volume.emptiness());
        let empty = leap(Skip::EmptySpace, enough.empty, is_sparse, empty);
        let even =
            format!("{:.0} % of the volume is one medium without directions", 100.0 * self.volume.evenness());
        let even = leap(Skip::EvenSpace, enough.even, is_even, even);
        let saturation = if !allows(Skip::Saturation) {
            switched_off()
        } else if self.ends_where_saturated() {
            where_rays_end(&self.scene)
        } else {
            format!("the {} draws all", self.scene.march)
        };
        let levels = if allows(Skip::Levels) { "asked of each view" } else { "it is switched off" };
        let kept = if allows(Skip::Kept) { "compared with the frame before" } else { "it is switched off" };
        let shading = self.scene.shading.as_ref();
        let lights = shading.map_or(0, |shading| shading.lights.len());
        let casting = shading.map_or(0, |shading| shading.lights.iter().filter(|light| light.shadow).count());
        let choice = |about, chosen, why: String| Choice { about, chosen, why };
        vec![
            choice("traversal", walk.0, walk.1),
            choice(Skip::EmptySpace.name(), on(is_sparse), empty),
            choice(Skip::EvenSpace.name(), on(is_even), even),
            choice(Skip::Saturation.name(), on(self.ends_where_saturated()), saturation),
            choice(Skip::Levels.name(), on(allows(Skip::Levels)), levels.to_owned()),
            choice(Skip::Kept.name(), on(allows(Skip::Kept)), kept.to_owned()),
            choice(
                "light",
                on(shading.is_some()),
                match shading {
                    None => "the scene is unlit: nothing of it is compiled in".to_owned(),
                    Some(_) => format!("lights: {lights}"),
                },
            ),
            choice(
                "shadows",
                on(casting > 0),
                match casting {
                    0 => "no light casts any: nothing of them is compiled in".to_owned(),
                    _ => format!("cast by {casting} of {lights} lights"),
                },
            ),
            choice(
                "solids",
                on(!self.scene.solids.is_empty()),
                match self.scene.solids.len() {
                    0 => "there are none: nothing of them is compiled in".to_owned(),
                    count => format!("there are {count}"),
                },
            ),
        ]
    }
}
