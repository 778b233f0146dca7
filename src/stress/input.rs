//! Input that means something impossible: it must be refused with an error that names the key or the place. Bound 0: none
//! gets through.

use std::path::Path;

use super::{Case, Stand};
use crate::Result;
use crate::mesh::Mesh;
use crate::scene;
use crate::shell::{Shell, ShellOptions};
use crate::volume::Volume;

pub(super) const CASES: &[Case] = &[
    Case { name: "thickness", measure: "bad values let through", bound: 0.0, worst: thickness },
    Case { name: "texels", measure: "bad values let through", bound: 0.0, worst: texels },
    Case { name: "normals", measure: "bad values let through", bound: 0.0, worst: normals },
];

/// Zero, denormal, negative and not finite; in a scene file, and in code.
#[allow(clippy::unnecessary_wraps, reason = "the signature of a case")]
fn thickness(_: &Stand<'_>) -> Result<f64> {
    let mut accepted = 0;
    for value in ["0", "0.0", "-0.0", "5e-324", "1e-310", "-1e-310", "-0.2", "nan", "inf", "-inf"] {
        let text = format!(
            "mesh = {{ generator = \"sphere\" }}\nshell = {{ thickness = {value} }}\nvolume = {{ recipe = \"fog.toml\" }}\n"
        );
        let loaded = scene::parse("scene.toml", &text, Path::new(""));
        accepted += usize::from(!is_told(loaded, "thickness"));
    }
    let mesh = Mesh::triangle();
    for value in [0.0, -0.0, 5e-324, 1e-310, -1e-310, -0.2, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        accepted += usize::from(!is_told(Shell::build(&mesh, &ShellOptions::new(value)), "shell.thickness"));
    }
    Ok(accepted as f64)
}

/// NaN, infinities and values out of range, in every channel.
#[allow(clippy::unnecessary_wraps, reason = "the signature of a case")]
fn texels(_: &Stand<'_>) -> Result<f64> {
    let mut accepted = 0;
    for channel in 0..4 {
        for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1e-9] {
            let mut texels = vec![[0.5; 4]; 24];
            texels[(2 * 3 + 1) * 2 + 1][channel] = value;
            let built = Volume::new([2, 3, 4], texels);
            accepted += usize::from(!built.is_err_and(|error| error.to_string().contains("(1, 1, 2)")));
        }
    }
    Ok(accepted as f64)
}

/// Normals and positions.
#[allow(clippy::unnecessary_wraps, reason = "the signature of a case")]
fn normals(_: &Stand<'_>) -> Result<f64> {
    let mut accepted = 0;
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        type Spoil = fn(&mut Mesh, f64);
        let spoils: [(Spoil, &str); 3] = [
            (|mesh, value| mesh.normals[2].y = value, "normal 2"),
            (|mesh, value| mesh.positions[1].x = value, "position 1"),
            (|mesh, value| mesh.uvs[0][1].x = value, "triangle 0"),
        ];
        for (spoil, place) in spoils {
            let mut mesh = Mesh::triangle();
            spoil(&mut mesh, value);
            let told = mesh.validate().is_err_and(|message| message.contains(place));
            accepted += usize::from(!(told && is_told(Shell::build(&mesh, &ShellOptions::new(0.1)), place)));
        }
    }
    Ok(accepted as f64)
}

/// Whether the result is an error that says `word`, in its message or on the line that it underlines.
fn is_told<T>(result: Result<T>, word: &str) -> bool {
    result.is_err_and(|error| format!("{:?}", miette::Report::new(error)).contains(word))
}
