//! From the section `[shell.wind]` of a scene file to what the shell leans with.

use serde::Deserialize;
use toml::Spanned;

use super::motion::{unit, vector};
use super::text::Text;
use crate::Result;
use crate::shell::Wind;
use crate::value::{Exactly, Finite, Positive};

/// `[shell.wind]`: what the outer side of the shell leans with.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WindSection {
    /// Where it blows to; not zero.
    pub direction: Spanned<Exactly<3, Finite>>,
    /// The tangent of the angle by which a normal leans where the wind blows along the surface.
    pub strength: Finite,
    /// How far the strength goes up and down.
    #[serde(default = "none")]
    pub gust: Finite,
    /// World units.
    #[serde(default = "one")]
    pub size: Positive,
    /// In turns.
    #[serde(default = "none")]
    pub phase: Finite,
}

fn none() -> Finite {
    Finite(0.0)
}

fn one() -> Positive {
    Positive(1.0)
}

impl WindSection {
    /// # Errors
    /// [`Error`](crate::Error) with the spot, where the direction is zero.
    pub(super) fn wind(&self, text: &Text) -> Result<Wind> {
        let Some(direction) = unit(vector(self.direction.get_ref())) else {
            return Err(text
                .error(self.direction.span(), "the wind blows nowhere, expected a direction that is not zero")
                .with_help("a wind of `strength = 0` is none"));
        };
        let Self { strength, gust, size, phase, .. } = self;
        Ok(Wind { direction, strength: strength.0, gust: gust.0, size: size.0, phase: phase.0 })
    }
}

#[cfg(test)]
mod tests {
    use crate::scene::text::tests::assert_underlined;
    use crate::scene::{Loaded, parse};

    fn load(wind: &str) -> crate::Result<Loaded> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("fog.toml"), "recipe = \"fog\"\nsize = [2, 2, 2]\n").unwrap();
        let scene = format!(
            "mesh = {{ generator = 'plane', size = 2, segments = 2 }}\nvolume = {{ recipe = 'fog.toml' }}\n\
             [shell]\nthickness = 0.5\n{wind}\n"
        );
        parse("scene.toml", &scene, folder.path())
    }

    #[test]
    fn a_plane_leans_with_the_wind() {
        let shell = load("wind = { direction = [1e30, 0, 0], strength = 0.75 }").unwrap().scene.shell;
        for (base, outer) in
            shell.vertices.iter().zip(&shell.vertices[shell.topology.base_vertices as usize..])
        {
            // 3, 4, 5.
            let leaning = *outer - *base;
            assert!((leaning.x - 0.3).abs() < 1e-12 && (leaning.length() - 0.5).abs() < 1e-12, "{leaning}");
        }
    }

    #[test]
    fn mistakes_are_underlined() {
        let mistakes = [
            ("wind = { direction = [0, 0, 0], strength = 1 }", "[0, 0, 0]", "not zero"),
            ("wind = { direction = [1, 0, 0], strength = nan }", "nan", "finite"),
            ("wind = { direction = [1, 0, 0], strength = 1, size = 0 }", "0", "greater than 0"),
        ];
        for (wind, spot, part) in mistakes {
            assert_underlined(load(wind).unwrap_err(), spot, part);
        }
    }
}
