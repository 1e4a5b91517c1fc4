//! The light of a scene file under the requested conditions, and its active lamps.

use core::ops::Range;

use glam::Vec3;
use toml::Spanned;

use super::raw::{RawLamp, RawLight, RawScene};
use super::source::Source;
use super::surface::Colour;
use crate::error::SceneError;
use crate::geometry::{Lamp, Light};
use crate::light::{Lighting, SceneLook, Shining, Weather};
use crate::mesh::Bulb;

/// Maximum number of active lamps in a scene: each costs a millisecond when the scene is prepared.
const MAX_LAMPS: usize = 500;

/// Azimuth of the sun if the file does not set one, degrees clockwise from north.
const AZIMUTH_DEG: f64 = 222.0;

/// The light of the file under these conditions, with the lamps that do not belong to objects.
pub(super) fn shining(raw: &RawScene, conditions: &SceneLook, source: &Source<'_>) -> Result<Shining, SceneError> {
    let mut shining = light_alone(&raw.light, conditions, source)?;
    for lamp in &raw.lamps {
        let bulb = bulb(lamp, source)?;
        add(&mut shining, &bulb, |p| p, 1.0, &lamp.span(), source)?;
    }
    Ok(shining)
}

/// The light alone.
pub(super) fn light_alone(raw: &RawLight, conditions: &SceneLook, source: &Source<'_>) -> Result<Shining, SceneError> {
    let own = (raw.time.unwrap_or_default(), raw.weather.unwrap_or_default());
    let (lighting, weather) = (conditions.lighting.unwrap_or(own.0), conditions.weather.unwrap_or(own.1));
    Ok(Shining { lighting, weather, light: light(raw, lighting, weather, own, source)? })
}

/// Adds a lamp if it is active; `to_world` transforms a point of its frame, `scale` scales its lengths.
pub(super) fn add(
    shining: &mut Shining,
    bulb: &Bulb,
    to_world: impl Fn(Vec3) -> Vec3,
    scale: f32,
    at: &Range<usize>,
    source: &Source<'_>,
) -> Result<(), SceneError> {
    if !(bulb.always || shining.lit()) {
        return Ok(());
    }
    if shining.light.lamps.len() >= MAX_LAMPS {
        let hint = "use a material with `emission_lit` for lamps that do not need to light their surroundings";
        return Err(source.error(at, format!("more than {MAX_LAMPS} lamps"), Some(hint.to_owned())));
    }
    let Lamp { position, colour, reach } = bulb.lamp;
    // Equally bright at the scaled distances.
    shining.light.lamps.push(Lamp { position: to_world(position), colour: colour * (scale * scale), reach: reach * scale });
    Ok(())
}

fn bulb(lamp: &Spanned<RawLamp>, source: &Source<'_>) -> Result<Bulb, SceneError> {
    let raw = lamp.get_ref();
    let wrong = |message: String| Err(source.error(&lamp.span(), message, None));
    if raw.position.iter().any(|v| v.is_nan() || v.abs() > 2000.0) {
        return wrong("a lamp must be within 2000 m of the origin".to_owned());
    }
    if !(0.0..=10_000.0).contains(&raw.strength) {
        return wrong(format!("`strength` must be from 0 to 10000, not `{}`", raw.strength));
    }
    if !(0.5..=60.0).contains(&raw.reach_m) {
        return wrong(format!("`reach_m` must be from 0.5 to 60 metres, not `{}`", raw.reach_m));
    }
    let [x, y, z] = raw.position.map(|v| v as f32);
    let lamp = Lamp { position: Vec3::new(x, y, z), colour: raw.colour.0 * raw.strength as f32, reach: raw.reach_m as f32 };
    Ok(Bulb { lamp, always: raw.always })
}

/// The named light in the named weather, overridden by the file's keys as far as the file's own light and weather
/// (`own`) are in force.
fn light(
    raw: &RawLight,
    lighting: Lighting,
    weather: Weather,
    own: (Lighting, Weather),
    source: &Source<'_>,
) -> Result<Light, SceneError> {
    let number = |value: &Option<Spanned<f64>>, key: &str, low: f64, high: f64| match value {
        Some(v) if !(low..=high).contains(v.get_ref()) => {
            Err(source.error(&v.span(), format!("`{key}` must be from {low} to {high}, not `{}`", v.get_ref()), None))
        }
        v => Ok(v.as_ref().map(|v| *v.get_ref())),
    };
    // Every key is checked, even if it is overridden.
    let azimuth = number(&raw.sun_azimuth_deg, "sun_azimuth_deg", -360.0, 360.0)?.unwrap_or(AZIMUTH_DEG).to_radians();
    let elevation = number(&raw.sun_elevation_deg, "sun_elevation_deg", 1.0, 90.0)?;
    let strength = number(&raw.sun_strength, "sun_strength", 0.0, 10.0)?;
    let haze = number(&raw.haze_per_m, "haze_per_m", 0.0, 1.0)?;
    let exposure = number(&raw.exposure, "exposure", 0.01, 100.0)?;
    let (named_elevation, clear) = lighting.clear();
    let mut light = weather.over(clear);
    if let Some(haze) = haze.filter(|_| weather == own.1) {
        light.haze = haze as f32;
    }
    light.has_dark_areas = raw.dark_places || lighting.lit();
    let kept = lighting == own.0;
    let elevation = elevation.filter(|_| kept).unwrap_or(named_elevation).to_radians();
    let (ce, se) = (libm::cos(elevation), libm::sin(elevation));
    light.to_sun = Vec3::new((ce * libm::sin(azimuth)) as f32, (ce * libm::cos(azimuth)) as f32, se as f32).normalize();
    if kept && weather == own.1 {
        let colour = |target: &mut Vec3, c: Option<Colour>| *target = c.map_or(*target, |c| c.0);
        colour(&mut light.sun, raw.sun);
        colour(&mut light.sky_ambient, raw.sky_ambient);
        colour(&mut light.ground_ambient, raw.ground_ambient);
        colour(&mut light.zenith, raw.zenith);
        colour(&mut light.horizon, raw.horizon);
        light.sun *= strength.unwrap_or(1.0) as f32;
        light.exposure = exposure.map(|e| e as f32);
    }
    Ok(light)
}
