//! Noise, by the midpoint rule with very many steps, straight from the definitions.

use glam::DVec3;
use mesoshell::reference::{Reference, TOLERANCE};
use mesoshell::scene::{Scene, View};
use mesoshell::volume::{Pyramid, Volume};

use super::{
    OPACITY_DISTANCE, SIDE, THICKNESS, error, flat_shell, level_zero, noise, rays, scene, slant,
    slanted_view, torus_shell, view,
};

/// Vulkan's linear filter, straight from its definition.
pub fn filtered(volume: &Volume, texture: DVec3) -> [f64; 4] {
    let size = volume.size.map(i64::from);
    let mut sum = [0.0; 4];
    let place: [f64; 3] = std::array::from_fn(|i| texture[i] * size[i] as f64 - 0.5);
    for corner in 0..8 {
        let mut weight = 1.0;
        let mut texel = [0; 3];
        for i in 0..3 {
            let (low, far) = (place[i].floor(), corner >> i & 1);
            let part = place[i] - low;
            weight *= if far == 1 { part } else { 1.0 - part };
            let index = low as i64 + far;
            texel[i] = if i == 2 { index.clamp(0, size[i] - 1) } else { index.rem_euclid(size[i]) } as u32;
        }
        for (sum, value) in sum.iter_mut().zip(volume.texel(texel)) {
            *sum += weight * f64::from(value);
        }
    }
    sum
}

/// The midpoint rule on `steps` equal steps of depth, tetrahedra found by trial.
fn brute_force(scene: &Scene, view: &View, direction: DVec3, range: [f64; 2], steps: u32) -> [f64; 4] {
    let shell = &scene.shell;
    let size = scene.volume.levels[0].size.map(f64::from);
    let pixel = view.pixel_at_unit_depth();
    let (mut colour, mut depth) = ([0.0; 4], 0.0_f64);
    let dz = (range[1] - range[0]) / f64::from(steps);
    let ds = dz * direction.length() / scene.medium.opacity_distance;
    let mut candidates: Vec<usize> = (0..shell.topology.tetrahedra.len()).collect();
    candidates.retain(|&t| {
        // Tetrahedra whose bounding sphere the ray meets.
        let vertices = shell.vertices_of(t);
        let middle = vertices.iter().sum::<DVec3>() / 4.0;
        let radius = vertices.iter().map(|v| v.distance(middle)).fold(0.0, f64::max);
        (middle - view.camera.eye).reject_from(direction).length() <= radius
    });
    for i in 0..steps {
        let z = range[0] + (f64::from(i) + 0.5) * dz;
        let point = view.camera.eye + z * direction;
        for &t in &candidates {
            let b = shell.barycentric(t, point);
            if b.iter().any(|&b| b < 0.0) {
                continue;
            }
            let texture = (0..4).map(|k| b[k] * shell.texture[t][k]).sum();
            let map = shell.cells()[t].texture_from_world.transpose();
            let across = |i: usize| map.col(i).reject_from(direction).length();
            let rho = (0..3).map(|i| size[i] * across(i)).fold(0.0, f64::max);
            let last = scene.volume.levels.len() - 1;
            let lod = (scene.medium.lod_footprint * z * pixel * rho).log2().clamp(0.0, last as f64);
            let level = (lod as usize).min(last);
            let [fine, coarse] =
                [level, (level + 1).min(last)].map(|level| filtered(&scene.volume.levels[level], texture));
            let part = lod - level as f64;
            let [r, g, b, a]: [f64; 4] = std::array::from_fn(|c| fine[c] * (1.0 - part) + coarse[c] * part);
            let step = -(-a).ln_1p() * ds;
            if a > 0.0 {
                let seen = (-depth).exp() * -(-step).exp_m1();
                for (sum, premultiplied) in colour.iter_mut().zip([r, g, b, a]) {
                    *sum += seen * premultiplied / a;
                }
            }
            depth += step;
        }
    }
    colour
}

#[test]
fn brute_force_agrees_on_noise_in_a_bent_shell() {
    let view = view(DVec3::new(0.4, 2.4, 2.3), DVec3::new(0.5, 0.0, 0.3), 3);
    let mut scene = scene(torus_shell(), Pyramid::build(noise([6, 6, 3], 0.9)), view);
    for footprint in [0.0, 0.15] {
        scene.medium.lod_footprint = footprint;
        let reference = Reference::new(&scene, &view);
        let mut opaque = 0.0_f64;
        for (point, direction) in rays(&view) {
            let found = reference.integrate_ray(point).rgba;
            let run = |steps| brute_force(&scene, &view, direction, [1.0, 5.5], steps);
            let [coarse, fine] = [run(25_000), run(100_000)];
            // A step that straddles the end of the shell or of a tetrahedron errs by the first order, the
            // others by the second. At most half a step of the greatest extinction is gained or lost at an
            // end; inner ends hand it to the neighbour, whose extinction there is the same; a ray has two or
            // four outer ones.
            let h = 4.5 / 100_000.0 * direction.length();
            let bound = 4.0 * 0.5 * -(0.1_f64).ln() * h / OPACITY_DISTANCE;
            assert!(error(&found, &fine) <= bound && error(&found, &coarse) <= 4.0 * bound);
            opaque = opaque.max(found[3]);
        }
        assert!(opaque > 0.5);
    }
}

#[test]
fn brute_force_agrees_on_noise_in_a_flat_shell() {
    let volume = noise([5, 4, 6], 0.95);
    let view = slanted_view();
    let scene = scene(flat_shell(), level_zero(volume.clone()), view);
    let reference = Reference::new(&scene, &view);
    for (point, direction) in rays(&view).into_iter().step_by(5) {
        // Neither shell nor tetrahedra: texture coordinates from the plane's own map.
        let run = |steps: u32| {
            let length = THICKNESS * slant(direction);
            let ds = length / f64::from(steps);
            let (mut colour, mut depth) = ([0.0; 4], 0.0_f64);
            for i in 0..steps {
                let y = THICKNESS * (1.0 - (f64::from(i) + 0.5) / f64::from(steps));
                let p = view.camera.eye + direction * ((y - view.camera.eye.y) / direction.y);
                let texture = DVec3::new(p.x / SIDE + 0.5, 0.5 - p.z / SIDE, y / THICKNESS);
                let [r, g, b, a] = filtered(&volume, texture);
                let step = -(-a).ln_1p() * ds / OPACITY_DISTANCE;
                let seen = (-depth).exp() * -(-step).exp_m1();
                if a > 0.0 {
                    for (sum, premultiplied) in colour.iter_mut().zip([r, g, b, a]) {
                        *sum += seen * premultiplied / a;
                    }
                }
                depth += step;
            }
            colour
        };
        // The midpoint rule is of second order, across the kinks at texel planes too: the error of the finer
        // run is a third of the difference; kinks fall anywhere in a step, which triples it at most.
        let [coarse, fine] = [run(20_000), run(40_000)];
        let bound = error(&coarse, &fine) + 2.0 * TOLERANCE;
        assert!(bound < 1e-7, "{bound:e}");
        let found = reference.integrate_ray(point).rgba;
        assert!(error(&found, &fine) <= bound, "{found:?} {fine:?} {bound:e}");
    }
}
