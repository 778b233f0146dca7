//! From the sections `[shading]` and `[[light]]` of a scene file to [`Shading`].

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;
use toml::Spanned;

use super::file::{LightSection, SceneFile, ShadingSection};
use super::shading::{Emission, MOST_LIGHTS, Model, Shading};
use super::text::Text;
use super::{Camera, Light, Source};
use crate::Result;
use crate::value::{Exactly, Finite};
use crate::volume::{Directions, Volume};

/// Light beyond this comes near the end of f32, once it is multiplied by a texel's glow.
const BRIGHTEST: f64 = 1e6;

/// All of a [`Shading`] but what depends on the volume.
pub struct Lighting<'a> {
    section: &'a ShadingSection,
    /// Where each light stands in the text.
    lights: Vec<(std::ops::Range<usize>, Light)>,
    /// Where the directions are stored; else they are derived.
    stored: Option<PathBuf>,
}

impl<'a> Lighting<'a> {
    /// What the file says; `None` where its scene is unlit.
    ///
    /// # Errors
    /// [`Error`](crate::Error) with the spot.
    pub fn of(text: &Text, file: &'a SceneFile, base_dir: &Path) -> Result<Option<Self>> {
        let Some(section) = &file.shading else {
            return match file.light.first() {
                Some(light) => Err(text
                    .error(light.span(), "a [[light]] needs a section [shading] that says how it is seen")),
                None => Ok(None),
            };
        };
        if let Some(light) = file.light.get(MOST_LIGHTS) {
            let message = format!("there are {} lights, expected at most {MOST_LIGHTS}", file.light.len());
            return Err(text.error(light.span(), message));
        }
        let lights = file.light.iter().map(|light| Ok((light.span(), self::light(text, light)?)));
        let lights: Vec<_> = lights.collect::<Result<_>>()?;
        let span = section.span();
        let section = section.get_ref();
        let stored = match (section.model, &section.normals, &section.tangents) {
            (Model::Surface, stored, None) | (Model::Fibre, None, stored) => {
                stored.as_ref().map(|file| base_dir.join(file.get_ref()))
            }
            (Model::Surface, _, Some(file)) => {
                return Err(text
                    .error(file.span(), "`tangents` are for the model \"fibre\": a surface has `normals`"));
            }
            (Model::Fibre, Some(file), _) => {
                return Err(text
                    .error(file.span(), "`normals` are for the model \"surface\": a fibre has `tangents`"));
            }
        };
        let lighting = Self { section, lights, stored };
        let (factor, added) = lighting.shading(Arc::new(Directions { levels: Vec::new() })).bounds();
        if factor.max(added) > BRIGHTEST {
            let message = format!(
                "lights and factors together are {:.1e} times white, expected at most {BRIGHTEST:e}",
                factor.max(added)
            );
            return Err(text.error(span, message));
        }
        Ok(Some(lighting))
    }

    /// Refuses a point light that the camera's near plane would cut off from what it sees: it is inside the camera.
    ///
    /// # Errors
    /// [`Error`](crate::Error) with the light's spot.
    pub fn check_camera(&self, text: &Text, camera: &Camera) -> Result<()> {
        for (span, light) in &self.lights {
            let Source::Point { position, .. } = light.source else { continue };
            let distance = position.distance(camera.eye);
            if distance < camera.near {
                let message = format!(
                    "the light is inside the camera, expected a distance from the eye of at least that of the near plane, {}; it is {distance}",
                    camera.near
                );
                return Err(text
                    .error(span.clone(), message)
                    .with_help("move the light, or make camera.near smaller"));
            }
        }
        Ok(())
    }

    /// What the directions of a volume are made of.
    pub fn origin(&self) -> (Model, Option<PathBuf>) {
        (self.section.model, self.stored.clone())
    }

    /// Reads or derives the volume's directions.
    ///
    /// # Errors
    /// As [`Directions::stored`].
    pub fn directions(&self, volume: &Volume) -> Result<Directions> {
        match (&self.stored, self.section.model) {
            (Some(path), _) => Directions::stored(path, volume),
            (None, Model::Surface) => Ok(Directions::normals(volume)),
            (None, Model::Fibre) => Ok(Directions::tangents(volume)),
        }
    }

    /// With the volume's directions.
    pub fn shading(&self, directions: Arc<Directions>) -> Shading {
        let section = self.section;
        Shading {
            model: section.model,
            ambient: section.ambient.0.as_dvec3(),
            diffuse: section.diffuse.0,
            specular: section.specular.0,
            shininess: section.shininess.0,
            emission: Emission { glow: section.glow.0, from: section.glow_from.0 },
            shadow_size: section.shadow_size.0,
            lights: self.lights.iter().map(|(_, light)| *light).collect(),
            directions,
        }
    }
}

fn light(text: &Text, section: &Spanned<LightSection>) -> Result<Light> {
    let vector = |v: &Exactly<3, Finite>| DVec3::from_array(v.0.map(|x| x.0));
    let colour = section.get_ref().colour.0.as_dvec3();
    let source = match section.get_ref() {
        LightSection { direction: Some(direction), position: None, falloff: None, .. } => {
            let towards = -vector(direction.get_ref());
            // Scaled first: the square of what is far from 1 is out of range.
            let towards = (towards / towards.abs().max_element()).normalize_or_zero();
            if towards == DVec3::ZERO {
                return Err(text.error(direction.span(), "a light's `direction` must not be zero"));
            }
            Source::Directional { towards }
        }
        LightSection { direction: None, position: Some(position), falloff, .. } => {
            Source::Point { position: vector(position), falloff: falloff.map(|falloff| falloff.0) }
        }
        _ => {
            let message = "a [[light]] needs either `direction`, or `position` with or without `falloff`";
            return Err(text.error(section.span(), message));
        }
    };
    Ok(Light { source, colour, shadow: section.get_ref().shadow })
}
