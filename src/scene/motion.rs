//! From the sections `[mesh.transform]` and `[[deform]]` of a scene file to what moves the mesh.

use glam::DVec3;
use serde::Deserialize;
use toml::Spanned;

use super::text::Text;
use crate::mesh::Mesh;
use crate::mesh::deform::{self, Bend, Deform, Noise, Taper, Transform, Twist, Wave};
use crate::value::{Exactly, Finite, Positive};
use crate::{Error, Result};

/// `[mesh.transform]`: where the mesh is.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TransformSection {
    /// None of them 0.
    pub scale: Spanned<Exactly<3, Finite>>,
    /// Degrees, about X, then Y, then Z.
    pub rotate: Exactly<3, Finite>,
    /// World units.
    pub translate: Exactly<3, Finite>,
}

impl Default for TransformSection {
    fn default() -> Self {
        let zero = Exactly([Finite(0.0); 3]);
        Self { scale: Spanned::new(0..0, Exactly([Finite(1.0); 3])), rotate: zero, translate: zero }
    }
}

/// `[[deform]]`: a deformation of the mesh. Which of the keys it has depends on its kind.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeformSection {
    /// What tracks and overrides call it.
    pub name: Option<String>,
    /// What it does.
    pub kind: Kind,
    /// Not zero.
    pub axis: Option<Exactly<3, Finite>>,
    /// A point on the axis.
    pub centre: Option<Exactly<3, Finite>>,
    /// From and to, along the axis from the centre, ascending.
    pub range: Option<Exactly<2, Finite>>,
    /// Degrees.
    pub angle: Option<Finite>,
    /// Of a bend: not along the axis.
    pub towards: Option<Exactly<3, Finite>>,
    /// Of a taper.
    pub factor: Option<Positive>,
    /// Of a wave or of noise: not zero.
    pub direction: Option<Exactly<3, Finite>>,
    /// World units.
    pub amplitude: Option<Finite>,
    /// World units.
    pub wavelength: Option<Positive>,
    /// Of noise: world units.
    pub size: Option<Positive>,
    /// In turns.
    pub phase: Option<Finite>,
    /// Of noise.
    pub seed: Option<u32>,
}

/// What a deformation does: see [`Deform`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs, reason = "documented at Deform")]
pub enum Kind {
    Wave,
    Bend,
    Twist,
    Taper,
    Noise,
}

impl Kind {
    fn name(self) -> &'static str {
        match self {
            Self::Wave => "wave",
            Self::Bend => "bend",
            Self::Twist => "twist",
            Self::Taper => "taper",
            Self::Noise => "noise",
        }
    }

    /// The keys that it must have, and those that it may have besides.
    fn keys(self) -> (&'static [&'static str], &'static [&'static str]) {
        match self {
            Self::Wave => (&["axis", "direction", "amplitude", "wavelength"], &["centre", "range", "phase"]),
            Self::Bend => (&["axis", "towards", "range", "angle"], &["centre"]),
            Self::Twist => (&["axis", "range", "angle"], &["centre"]),
            Self::Taper => (&["axis", "range", "factor"], &["centre"]),
            Self::Noise => (&["amplitude", "size"], &["direction", "phase", "seed"]),
        }
    }
}

/// What moves a mesh.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Motion {
    transform: Option<Transform>,
    deforms: Vec<Deform>,
}

impl Motion {
    /// What the sections say.
    ///
    /// # Errors
    /// [`Error`] with the spot.
    pub(super) fn of(
        text: &Text,
        transform: Option<&TransformSection>,
        deforms: &[Spanned<DeformSection>],
    ) -> Result<Self> {
        let transform = transform.map(|section| self::transform(text, section)).transpose()?;
        let deforms = deforms.iter().map(|section| self::deform(text, section)).collect::<Result<_>>()?;
        Ok(Self { transform, deforms })
    }

    /// Whether the mesh stays as it is.
    pub(super) fn is_none(&self) -> bool {
        *self == Self::default()
    }

    pub(super) fn apply(&self, mesh: &mut Mesh) {
        if let Some(transform) = &self.transform {
            transform.apply(mesh);
        }
        deform::apply(&self.deforms, mesh);
    }
}

pub(super) fn vector(Exactly(numbers): &Exactly<3, Finite>) -> DVec3 {
    DVec3::from_array(numbers.map(|x| x.0))
}

/// In the direction of a vector; none where it is zero.
pub(super) fn unit(given: DVec3) -> Option<DVec3> {
    // Scaled first: the square of what is far from 1 is out of range.
    (given / given.abs().max_element()).try_normalize()
}

fn transform(text: &Text, section: &TransformSection) -> Result<Transform> {
    let scale = vector(section.scale.get_ref());
    if scale.to_array().contains(&0.0) {
        return Err(text.error(
            section.scale.span(),
            "a mesh that is scaled by 0 is flat, expected three numbers other than 0",
        ));
    }
    Ok(Transform {
        scale,
        rotation: Transform::euler(vector(&section.rotate)),
        translate: vector(&section.translate),
    })
}

fn deform(text: &Text, section: &Spanned<DeformSection>) -> Result<Deform> {
    let error = |message: String| -> Error { text.error(section.span(), message) };
    let DeformSection { kind, .. } = *section.get_ref();
    let section = section.get_ref();
    let given = [
        ("axis", section.axis.is_some()),
        ("centre", section.centre.is_some()),
        ("range", section.range.is_some()),
        ("angle", section.angle.is_some()),
        ("towards", section.towards.is_some()),
        ("factor", section.factor.is_some()),
        ("direction", section.direction.is_some()),
        ("amplitude", section.amplitude.is_some()),
        ("wavelength", section.wavelength.is_some()),
        ("size", section.size.is_some()),
        ("phase", section.phase.is_some()),
        ("seed", section.seed.is_some()),
    ];
    let (must, may) = kind.keys();
    for (key, is_given) in given {
        if is_given && !must.contains(&key) && !may.contains(&key) {
            return Err(error(format!(
                "a {} has no key `{key}`, expected {}",
                kind.name(),
                [must, may].concat().join(", ")
            )));
        }
        if !is_given && must.contains(&key) {
            return Err(error(format!("missing key `{key}`: a {} needs {}", kind.name(), must.join(", "))));
        }
    }
    let direction = |given: &Option<Exactly<3, Finite>>, key: &str| {
        let given = given.as_ref().map_or(DVec3::ZERO, vector);
        unit(given).ok_or_else(|| error(format!("`{key}` must not be zero")))
    };
    let range = section.range.map(|Exactly(range)| range.map(|x| x.0));
    if let Some([from, to]) = range
        && from >= to
    {
        return Err(error(format!("`range` is [{from}, {to}], expected two numbers that ascend")));
    }
    // What must be given has been found to be.
    let number = |given: Option<Finite>| given.map_or(0.0, |number| number.0);
    let length = |given: Option<Positive>| given.map_or(1.0, |length| length.0);
    let (angle, amplitude, phase) = (number(section.angle), number(section.amplitude), number(section.phase));
    let centre = section.centre.as_ref().map_or(DVec3::ZERO, vector);
    let along = range.unwrap_or([0.0, 1.0]);
    let axis = match must.contains(&"axis") {
        true => direction(&section.axis, "axis")?,
        false => DVec3::Y,
    };
    Ok(match kind {
        Kind::Wave => {
            let wavelength = length(section.wavelength);
            let direction = direction(&section.direction, "direction")?;
            Deform::Wave(Wave { axis, centre, direction, amplitude, wavelength, phase, range })
        }
        Kind::Bend => {
            let towards = direction(&section.towards, "towards")?;
            let across = (towards - towards.dot(axis) * axis).normalize_or_zero();
            // Below this sine rounding alone would decide where to.
            if towards.cross(axis).length() < 1e-9 {
                return Err(error("`towards` must not lie along `axis`".to_owned()));
            }
            Deform::Bend(Bend { axis, centre, towards: across, range: along, angle })
        }
        Kind::Twist => Deform::Twist(Twist { axis, centre, range: along, angle }),
        Kind::Taper => Deform::Taper(Taper { axis, centre, range: along, factor: length(section.factor) }),
        Kind::Noise => Deform::Noise(Noise {
            amplitude,
            size: length(section.size),
            phase,
            seed: section.seed.unwrap_or(1),
            direction: section
                .direction
                .as_ref()
                .map(|_| direction(&section.direction, "direction"))
                .transpose()?,
        }),
    })
}

#[cfg(test)]
mod tests {
    use super::super::load;
    use super::*;

    const SCENE: &str = "shell.thickness = 1\nvolume.recipe = 'fog.toml'\n[mesh]\ngenerator = 'torus'\n";

    fn motion(added: &str) -> Result<Motion> {
        let text = Text::new("scene", format!("{SCENE}{added}"), &[])?;
        let file = load::read(&text)?;
        Motion::of(&text, file.mesh.get_ref().transform.as_ref(), &file.deform)
    }

    #[test]
    fn what_is_left_out_moves_nothing() {
        assert!(motion("").unwrap().is_none());
        let same = motion("transform = { rotate = [0, 0, 0] }\n").unwrap();
        let mut mesh = Mesh::triangle();
        same.apply(&mut mesh);
        assert_eq!(mesh, Mesh::triangle());
    }

    #[test]
    fn the_transform_comes_before_the_deformations() {
        let added = "transform = { translate = [0, 1, 0], scale = [2, 1, 1] }\n[[deform]]\nkind = 'taper'\naxis = [0, 5, 0]\n\
                     range = [0, 1]\nfactor = 3\n";
        let mut mesh = Mesh::triangle();
        motion(added).unwrap().apply(&mut mesh);
        // X goes to (2, 1, 0), at the end of the range, where all is three times as wide.
        assert_eq!(mesh.positions, [DVec3::Y, DVec3::new(6.0, 1.0, 0.0), 2.0 * DVec3::Y]);
    }

    #[test]
    fn mistakes_are_told() {
        for (added, part) in [
            ("transform = { scale = [1, 0, 1] }\n", "scaled by 0"),
            ("transform = { move = [1, 0, 1] }\n", "unknown key `move`"),
            ("[[deform]]\nkind = 'swirl'\n", "unknown name `swirl`"),
            (
                "[[deform]]\nkind = 'twist'\naxis = [0, 1, 0]\nrange = [0, 1]\n",
                "missing key `angle`: a twist needs",
            ),
            (
                "[[deform]]\nkind = 'twist'\naxis = [0, 1, 0]\nrange = [0, 1]\nangle = 3\nsize = 3\n",
                "a twist has no key `size`",
            ),
            (
                "[[deform]]\nkind = 'twist'\naxis = [0, 0, 0]\nrange = [0, 1]\nangle = 3\n",
                "`axis` must not be zero",
            ),
            ("[[deform]]\nkind = 'twist'\naxis = [0, 1, 0]\nrange = [1, 1]\nangle = 3\n", "that ascend"),
            (
                "[[deform]]\nkind = 'bend'\naxis = [0, 1, 0]\ntowards = [0, 3, 0]\nrange = [0, 1]\nangle = 3\n",
                "must not lie along `axis`",
            ),
        ] {
            let error = motion(added).unwrap_err().to_string();
            assert!(error.contains(part), "{added}: {error}");
        }
    }
}
