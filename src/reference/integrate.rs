//! The integral along one ray: `C = integral of T sigma c`, `T = exp(-integral of sigma)`, front to back.
//!
//! The ray is cut where the set of tetrahedra changes, where a level of detail is an integer, where the shadow of a solid begins or
//! ends, and at the planes of texel centres. On the *pieces* between, the premultiplied texture is a cubic (a smooth blend of
//! two, between levels), and `sigma` is smooth unless alpha reaches 1. A *panel* is a piece, or
//! a binary fraction of one: extinction and emission are taken at the nodes of [`Rule`], the optical depth
//! at each node is the integral of the interpolant of `sigma`, and the colour follows with
//! `T = exp(-depth)`. The panel is halved while the nested coarse rule disagrees.
//!
//! # The promise
//! A panel passes when its error is at most `tolerance / 2 (length / ray's length + 1e-5)`: the first terms
//! add up to `tolerance / 2`, and so do the second ones on a ray of fewer than 1e5 panels. The error of a
//! panel is weighted by the transmittance before it, and the error of its own transmittance by the
//! brightest colour that may follow.
//!
//! # Where alpha reaches 1
//! On a piece `1 - alpha` is a cubic. Beside a root it falls off like `x^3` at most (`x` as a part of the
//! piece), so a panel of width `h` at a root holds an optical depth of the order of `3 h (1 + ln(1 / h))`
//! times the piece's length in opacity distances. Halving towards the root is graded: each step leaves one
//! smooth panel, which passes, and one at the root, whose share shrinks with `h` until its error is below
//! the second term, after some 40 steps. Halving ends in any case at a width of 1e-15: by the same estimate
//! what such a panel holds, all of it, is about 1e-13 where a piece is one opacity distance long.

use glam::DVec3;

use super::crossing::Crossing;
use super::layer::{Layer, Ray, Width};
use super::quadrature::{AtNodes, NODES, Rule, dot};
use super::shade::{Lit, Surroundings};
use super::shadow::ShadowsOnRay;
use super::solids::Hit;
use super::texture::{ALPHA, CLEAR, Texel};
use super::{Counts, Reference, Sample};
use crate::scene::Scene;
use crate::volume::Quantity;

/// Width, as a part of its piece, of the panels that are taken as they are: see the head of this file.
const NARROWEST: f64 = 1e-15;

/// The share of the tolerance that every panel may use, however short it is.
const SHARE_OF_EACH: f64 = 1e-5;

/// A layer of the medium, and in a lit scene what it takes to shade it.
struct LitLayer<'a> {
    medium: Layer<'a>,
    surroundings: Option<Surroundings<'a>>,
}

/// What a panel adds to the ray, as if nothing were in front of it.
struct Panel {
    transmittance: f64,
    /// Premultiplied.
    colour: [f64; 3],
    alpha: f64,
    /// `integral of T sigma (z - near end) dz`.
    moment: f64,
    error: f64,
}

/// A part of the ray between two neighbouring cuts.
#[derive(Clone, Copy)]
struct Piece {
    /// Depth of the near end.
    start: f64,
    /// In depth.
    length: f64,
}

/// Integrates along one ray.
pub(super) struct RayIntegral<'a> {
    scene: &'a Scene,
    lit: Option<&'a Lit<'a>>,
    rule: &'a Rule,
    ray: Ray,
    /// World units per unit depth.
    stretch: f64,
    tolerance: f64,
    brightness: f64,
    /// In depth, summed over tetrahedra.
    total_length: f64,
    layers: Vec<LitLayer<'a>>,
    shadows: ShadowsOnRay<'a>,
    transmittance: f64,
    colour: [f64; 3],
    alpha: f64,
    /// `integral of T sigma z dz`.
    moment: f64,
    counts: Counts,
}

impl<'a> RayIntegral<'a> {
    /// The integral over `crossings`, which are in order of entry, and end where the ray meets a solid.
    pub(super) fn evaluate(
        reference: &'a Reference<'a>,
        direction: DVec3,
        crossings: &[Crossing],
        solid: Option<&Hit>,
    ) -> (Sample, Counts) {
        let ray = Ray {
            eye: reference.view.camera.eye,
            start: DVec3::ZERO,
            direction,
            width: Width { at_start: 0.0, slope: 1.0 },
            detail_per_texel: reference.lod_footprint * reference.view.pixel_at_unit_depth(),
        };
        let mut integral = Self {
            scene: reference.scene,
            lit: reference.lit.as_ref(),
            rule: &reference.rule,
            ray,
            stretch: direction.length(),
            tolerance: reference.panels_tolerance(),
            brightness: reference.brightness,
            total_length: crossings.iter().map(|crossing| crossing.exit - crossing.enter).sum(),
            layers: Vec::new(),
            shadows: ShadowsOnRay::new(reference, direction, crossings),
            transmittance: 1.0,
            colour: [0.0; 3],
            alpha: 0.0,
            moment: 0.0,
            counts: Counts { rays: 1, ..Counts::default() },
        };
        integral.sweep(crossings);
        if let Some(hit) = solid {
            integral.stop_at_solid(hit);
        }
        let [r, g, b] = integral.colour;
        let distance = integral.moment / integral.alpha * integral.stretch;
        let sample = Sample {
            rgba: [r, g, b, integral.alpha.min(1.0)],
            depth: if integral.alpha > 0.0 { distance } else { f64::INFINITY },
        };
        integral.counts.shadow_paths = integral.shadows.paths();
        (sample, integral.counts)
    }

    /// Goes from one entry or exit to the next with the tetrahedra that are active between them.
    fn sweep(&mut self, crossings: &[Crossing]) {
        let mut ends: Vec<f64> = crossings.iter().flat_map(|c| [c.enter, c.exit]).collect();
        ends.sort_unstable_by(f64::total_cmp);
        let mut waiting = crossings;
        let mut active: Vec<Crossing> = Vec::new();
        for window in ends.windows(2) {
            let [from, to] = [window[0], window[1]];
            let entered = waiting.iter().take_while(|crossing| crossing.enter <= from).count();
            active.extend_from_slice(&waiting[..entered]);
            waiting = &waiting[entered..];
            active.retain(|crossing| crossing.exit > from);
            if from < to && !active.is_empty() {
                self.counts.segments += 1;
                self.segment(from, to, &active);
                if self.is_done() {
                    return;
                }
            }
        }
    }

    /// Whether nothing that may follow can change the result by a thousandth of the tolerance.
    fn is_done(&self) -> bool {
        self.transmittance * self.brightness < 1e-3 * self.tolerance
    }

    /// Cuts a segment where a level of detail is an integer, and where a solid's shadow begins or ends.
    fn segment(&mut self, from: f64, to: f64, active: &[Crossing]) {
        let details: Vec<f64> =
            active.iter().map(|crossing| self.ray.detail(self.scene, crossing.tetrahedron)).collect();
        let mut start = from;
        while start < to && !self.is_done() {
            let end = self.ray.span_end(self.scene, &details, start, to).min(self.shadows.next_edge(start));
            self.layers.clear();
            for (crossing, &detail) in active.iter().zip(&details) {
                let layer = self.layer(crossing.tetrahedron, detail, start, 0.5 * (start + end));
                self.layers.push(layer);
            }
            self.span(start, end);
            start = end;
        }
    }

    fn layer(&self, tetrahedron: usize, detail: f64, start: f64, middle: f64) -> LitLayer<'a> {
        let medium = Layer::new(self.scene, &self.ray, tetrahedron, detail, start, middle);
        let surroundings = self.lit.map(|lit| lit.surroundings(tetrahedron, &self.ray, &medium));
        LitLayer { medium, surroundings }
    }

    /// Visits the pieces of a span with its layers, front to back.
    fn span(&mut self, start: f64, end: f64) {
        let length = end - start;
        let mut from = 0.0;
        while from < length && !self.is_done() {
            let to = self.layers.iter().fold(length, |to, layer| layer.medium.piece_end(to));
            if from < to {
                self.piece(start, from, to);
            }
            self.layers.iter_mut().for_each(|layer| layer.medium.pass(to));
            from = from.max(to);
        }
    }

    fn piece(&mut self, span_start: f64, from: f64, to: f64) {
        let mut is_empty = true;
        for layer in &mut self.layers {
            is_empty &= !layer.load(from, to);
        }
        if is_empty {
            return;
        }
        let piece = Piece { start: span_start + from, length: to - from };
        let can_be_wall = self.scene.volume.levels[0].quantity == Quantity::Opacity;
        if can_be_wall && self.layers.iter().any(|layer| layer.medium.is_wall()) {
            self.stop_at_wall(piece.start);
        } else {
            self.panels(piece, 0.0, 1.0);
        }
    }

    /// What reaches a wall sees the wall's colour at that point; of several, their mean.
    fn stop_at_wall(&mut self, depth: f64) {
        let Self { layers, shadows, colour, .. } = self;
        let walls: Vec<_> = layers.iter().filter(|layer| layer.medium.is_wall()).collect();
        let part = self.transmittance / walls.len() as f64;
        for layer in walls {
            let texel = layer.radiant(self.lit, 0.0, depth, |light, _| shadows.traced(light, depth));
            for (sum, premultiplied) in colour.iter_mut().zip(texel) {
                *sum += part * premultiplied;
            }
        }
        self.stop(depth);
    }

    /// What reaches a solid sees its colour.
    fn stop_at_solid(&mut self, hit: &Hit) {
        if !self.is_done() {
            let colour = self.shadows.colour_of_solid(hit);
            for (sum, colour) in self.colour.iter_mut().zip(colour.to_array()) {
                *sum += self.transmittance * colour;
            }
        }
        self.stop(hit.place);
    }

    /// Takes away what is left at a depth.
    fn stop(&mut self, depth: f64) {
        self.alpha += self.transmittance;
        self.moment += self.transmittance * depth;
        self.transmittance = 0.0;
    }

    /// Adds the part `low..high` (of 0..1) of a piece, halving it until it is accurate.
    fn panels(&mut self, piece: Piece, low: f64, high: f64) {
        let panel = self.panel(piece, low, high);
        let width = high - low;
        let share = width * piece.length / self.total_length + SHARE_OF_EACH;
        let middle = low + 0.5 * width;
        let can_halve = width > NARROWEST && low < middle && middle < high;
        if can_halve && self.transmittance * panel.error > 0.5 * self.tolerance * share {
            self.panels(piece, low, middle);
            if !self.is_done() {
                self.panels(piece, middle, high);
            }
            return;
        }
        for (sum, colour) in self.colour.iter_mut().zip(panel.colour) {
            *sum += self.transmittance * colour;
        }
        let start = piece.start + low * piece.length;
        self.alpha += self.transmittance * panel.alpha;
        self.moment += self.transmittance * (start * panel.alpha + panel.moment);
        self.transmittance *= panel.transmittance;
    }

    fn panel(&mut self, piece: Piece, low: f64, high: f64) -> Panel {
        self.counts.panels += 1;
        let rule = self.rule;
        let width = high - low;
        let opacity_distance = self.scene.medium.opacity_distance;
        let quantity = self.scene.volume.levels[0].quantity;
        let mut extinction: AtNodes = [0.0; NODES];
        let mut emission: [AtNodes; 3] = [[0.0; NODES]; 3];
        for i in 0..NODES {
            let x = low + width * rule.nodes[i];
            let z = piece.start + x * piece.length;
            for layer in &self.layers {
                let shadows = &mut self.shadows;
                let reaching =
                    |light, brightness| shadows.interpolated(light, z, self.transmittance * brightness);
                let texel = layer.radiant(self.lit, x, z, reaching);
                let per_alpha = match quantity {
                    Quantity::Opacity => extinction_per_alpha(texel[ALPHA], texel[CLEAR]),
                    Quantity::Extinction => 1.0,
                };
                extinction[i] += per_alpha * texel[ALPHA];
                for (emission, premultiplied) in emission.iter_mut().zip(texel) {
                    emission[i] += per_alpha * premultiplied;
                }
            }
        }
        // From per opacity distance to per panel.
        let length = width * piece.length;
        let scale = length * self.stretch / opacity_distance;
        let mut optical_depth: AtNodes = [0.0; NODES];
        for (extinction, cumulative) in extinction.iter_mut().zip(&rule.cumulative) {
            *extinction *= scale;
            for (depth, cumulative) in optical_depth.iter_mut().zip(cumulative) {
                *depth += *extinction * cumulative;
            }
        }
        let transmittance = optical_depth.map(|depth| (-depth).exp());
        let absorbed: AtNodes = std::array::from_fn(|i| transmittance[i] * extinction[i]);
        let total_depth = dot(&rule.weights, &extinction);
        let alpha = -(-total_depth).exp_m1();
        let coarse_alpha = -(-dot(&rule.coarse_weights, &extinction)).exp_m1();
        let mut error = self.brightness * (alpha - coarse_alpha).abs();
        error = error.max((alpha - dot(&rule.weights, &absorbed)).abs());
        error = error.max((alpha - dot(&rule.coarse_weights, &absorbed)).abs());
        let colour = emission.map(|emission| {
            let arriving: AtNodes = std::array::from_fn(|i| transmittance[i] * scale * emission[i]);
            let colour = dot(&rule.weights, &arriving);
            error = error.max((colour - dot(&rule.coarse_weights, &arriving)).abs());
            colour
        });
        let moment: f64 = (0..NODES).map(|i| rule.weights[i] * absorbed[i] * rule.nodes[i]).sum();
        Panel { transmittance: (-total_depth).exp(), colour, alpha, moment: moment * length, error }
    }
}

impl LitLayer<'_> {
    /// Loads the cubics of a piece; whether there is anything in it.
    fn load(&mut self, from: f64, to: f64) -> bool {
        if let Some(surroundings) = &mut self.surroundings {
            surroundings.load(from, to);
        }
        self.medium.load(from, to)
    }

    /// The texture at `x` (0..1) of the piece, at depth `z`, its colour as it is lit.
    fn radiant(
        &self,
        lit: Option<&Lit<'_>>,
        x: f64,
        z: f64,
        reaching: impl FnMut(usize, f64) -> f64,
    ) -> Texel {
        let texel = self.medium.at(x, z);
        match (lit, &self.surroundings) {
            (Some(lit), Some(surroundings)) if texel[ALPHA] > 0.0 => {
                let direction =
                    self.medium.blend(z, || surroundings.fine.at(x), || surroundings.coarse.at(x));
                lit.shade(&texel, &direction, surroundings, z, reaching)
            }
            _ => texel,
        }
    }
}

/// `-ln(1 - alpha) / alpha`, whose limit at 0 is 1, from alpha and its complement, each accurate where it is
/// the smaller. Finite even where rounding makes the complement zero.
fn extinction_per_alpha(alpha: f64, clear: f64) -> f64 {
    if alpha < 1e-8 {
        1.0 + 0.5 * alpha
    } else if alpha < 0.5 {
        -(-alpha).ln_1p() / alpha
    } else {
        -clear.max(f64::MIN_POSITIVE).ln() / alpha
    }
}

#[cfg(test)]
mod tests {
    use super::extinction_per_alpha;

    #[test]
    fn extinction_is_accurate_from_the_faintest_alpha_to_the_last_before_1() {
        // -ln(1 - a) / a = sum of a^k / (k + 1)
        for exponent in 0..60 {
            let alpha = 0.3 * 0.5_f64.powi(exponent);
            let series: f64 = (0..40).map(|k| alpha.powi(k) / f64::from(k + 1)).sum();
            let found = extinction_per_alpha(alpha, 1.0 - alpha);
            assert!((found - series).abs() < 4.0 * f64::EPSILON, "{found} for {series} at {alpha:e}");
        }
        for exponent in 1..1000 {
            let clear = 0.5_f64.powi(exponent);
            let exact = f64::from(exponent) * std::f64::consts::LN_2 / (1.0 - clear);
            let found = extinction_per_alpha(1.0 - clear, clear);
            assert!((found - exact).abs() <= 4.0 * f64::EPSILON * exact, "{found} for {exact}");
        }
        assert_eq!(extinction_per_alpha(0.0, 1.0), 1.0);
        assert!(extinction_per_alpha(1.0, 0.0).is_finite());
    }
}
