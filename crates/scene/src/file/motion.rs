//! `walk` and `drive`: the motion of actors, validated.

use toml::Spanned;

use super::raw::RawObject;
use super::source::Source;
use crate::actors::{Gait, Motion, PathEnd};
use crate::error::SceneError;
use crate::limits::FARTHEST;

/// Maximum number of corners of a path.
const MAX_CORNERS: usize = 1000;
/// Maximum path length, metres: it is sampled every half metre.
const LONGEST: f64 = 20_000.0;

/// The motion of an object; `None` for a static one.
pub(super) fn motion(object: &RawObject, source: &Source<'_>) -> Result<Option<Motion>, SceneError> {
    let (raw, gait) = match (&object.walk, &object.drive) {
        (None, None) => return Ok(None),
        (Some(walk), None) => (walk, Gait::Walk),
        (None, Some(drive)) => (drive, Gait::Drive),
        (Some(_), Some(drive)) => {
            return Err(source.error(&drive.span(), "`walk` and `drive` cannot be combined", None));
        }
    };
    let at = raw.span();
    if object.position.is_some() || object.places.is_some() || object.repeat.is_some() || object.heading_deg.is_some() {
        let hint =
            "remove `position`, `heading_deg`, `places` and `repeat`; `start` sets its initial position on the path".to_owned();
        return Err(source.error(&at, "a moving object is placed by its path", Some(hint)));
    }
    let raw = raw.get_ref();
    let on_foot = gait == Gait::Walk;
    let round = match &raw.round {
        Some(round) if !on_foot && *round.get_ref() == PathEnd::ThereAndBack => {
            let hint = "use `loop = \"circle\"` or `loop = \"once\"`".to_owned();
            return Err(source.error(&round.span(), "a vehicle cannot turn on the spot", Some(hint)));
        }
        Some(round) => *round.get_ref(),
        None if on_foot => PathEnd::ThereAndBack,
        None => PathEnd::Circle,
    };
    let (path, heights) = corners(&raw.path, round, source)?;
    let number = |value: &Option<Spanned<f64>>, key: &str, default: f64, high: f64| match value {
        Some(v) if !(0.0..=high).contains(v.get_ref()) => {
            Err(source.error(&v.span(), format!("`{key}` must be from 0 to {high}, not `{}`", v.get_ref()), None))
        }
        v => Ok(v.as_ref().map_or(default, |v| *v.get_ref())),
    };
    let speed = *raw.speed_m_s.get_ref();
    if !(0.05..=30.0).contains(&speed) {
        let message = format!("`speed_m_s` must be from 0.05 to 30, not `{speed}`");
        return Err(source.error(&raw.speed_m_s.span(), message, None));
    }
    if let (Some(aside), false) = (&raw.aside_m, on_foot) {
        return Err(source.error(&aside.span(), "`aside_m` is not valid for a vehicle", None));
    }
    Ok(Some(Motion {
        gait,
        path,
        heights,
        round,
        speed,
        wait: number(&raw.wait_s, "wait_s", 0.0, 600.0)?,
        start: number(&raw.start, "start", 0.0, 1.0)?,
        turn_radius: number(&raw.turn_radius_m, "turn_radius_m", if on_foot { 0.6 } else { 5.0 }, 100.0)?,
        aside: number(&raw.aside_m, "aside_m", if on_foot { 1.0 } else { 0.0 }, 5.0)?,
    }))
}

type Corners = (Vec<[f64; 2]>, Option<Vec<f64>>);

/// The corners of a path, either all with a height or none.
fn corners(path: &Spanned<Vec<Vec<f64>>>, round: PathEnd, source: &Source<'_>) -> Result<Corners, SceneError> {
    let refuse = |message: String, hint: &str| Err(source.error(&path.span(), message, Some(hint.to_owned())));
    let least = if round == PathEnd::Circle { 3 } else { 2 };
    let points = path.get_ref();
    if !(least..=MAX_CORNERS).contains(&points.len()) {
        return refuse(format!("this path must have {least} to {MAX_CORNERS} corners"), "use `path = [[east, north], …]`");
    }
    if !points.iter().flatten().all(|v| v.abs() <= FARTHEST) {
        return refuse(format!("a path must stay within {FARTHEST} m of the scene's origin"), "coordinates are in metres");
    }
    let level = points.iter().all(|p| p.len() == 2);
    if !level && !points.iter().all(|p| p.len() == 3) {
        let hint = "use `[east, north]` to follow the ground, or `[east, north, up]` at every corner";
        return refuse("path corners must all have two numbers, or all three".to_owned(), hint);
    }
    let ground: Vec<[f64; 2]> = points.iter().map(|p| [p[0], p[1]]).collect();
    let gap = |a: &[f64; 2], b: &[f64; 2]| libm::hypot(a[0] - b[0], a[1] - b[1]);
    let mut gaps: Vec<f64> = ground.windows(2).map(|pair| gap(&pair[0], &pair[1])).collect();
    if round == PathEnd::Circle {
        gaps.extend(ground.first().zip(ground.last()).map(|(first, last)| gap(first, last)));
    }
    if gaps.iter().any(|gap| *gap < 0.1) || gaps.iter().sum::<f64>() > LONGEST {
        let hint = "a circular path closes automatically: remove the repeated first corner";
        return refuse(format!("path corners must be at least 0.1 m apart, and the path at most {LONGEST} m long"), hint);
    }
    Ok((ground, (!level).then(|| points.iter().map(|p| p[2]).collect())))
}
