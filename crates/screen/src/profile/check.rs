//! The ranges of a profile's values.

use std::collections::BTreeSet;

use super::{Axis, Controls, Profile, ProfileError, Step, Yaw};

/// Longest text, characters.
const LONGEST_TEXT: usize = 400;
/// Greatest number of masks, and of steps in a sequence.
const MOST: usize = 32;
/// Longest sequence, seconds.
const LONGEST_SEQUENCE: f64 = 60.0;

fn value(key: &str, expected: impl Into<String>, found: impl ToString) -> ProfileError {
    ProfileError::Value { key: key.to_owned(), expected: expected.into(), found: found.to_string() }
}

fn number(key: &str, found: f64, least: f64, most: f64) -> Result<(), ProfileError> {
    // No number is in no range.
    if (least..=most).contains(&found) { Ok(()) } else { Err(value(key, format!("expected {least} to {most}"), found)) }
}

fn text(key: &str, found: &str, least: usize) -> Result<(), ProfileError> {
    let length = found.chars().count();
    let is_clean = !found.chars().any(char::is_control);
    if (least..=LONGEST_TEXT).contains(&length) && is_clean {
        return Ok(());
    }
    let shown: String = found.chars().filter(|letter| !letter.is_control()).take(40).collect();
    Err(value(key, format!("expected a line of {least} to {LONGEST_TEXT} characters"), shown))
}

pub(super) fn check(profile: &Profile) -> Result<(), ProfileError> {
    let Profile { about, source, window, camera, controls, craft, take_off, landing, reset } = profile;
    text("about", about, 1)?;
    text("source", source, 1)?;
    // A shorter text would be part of the titles of many windows.
    if let Some(title) = &window.title {
        text("window.title", title, 3)?;
    }
    if let Some(class) = &window.class {
        text("window.class", class, 1)?;
    }
    match (window.portal, window.title.is_some() || window.class.is_some()) {
        (false, false) => return Err(value("window", "expected title, class or portal = true", "none of them")),
        (true, true) => return Err(value("window.portal", "expected no title and no class beside it", "both")),
        _ => {}
    }
    if window.portal && (!profile.keys().is_empty() || matches!(controls.yaw, Yaw::Mouse(_))) {
        let expected = "expected sticks alone, since a portal does not tell whether the window has the focus";
        return Err(value("window.portal", expected, "keys or mouse"));
    }
    let region = "expected [left, top, width, height] as fractions of the size, within the picture";
    if !window.region.is_valid() {
        return Err(value("window.region", region, format!("{:?}", window.region.0)));
    }
    match (camera.horizontal_fov_deg, camera.vertical_fov_deg) {
        (Some(fov), None) => number("camera.horizontal_fov_deg", fov, 10.0, 160.0)?,
        (None, Some(fov)) => number("camera.vertical_fov_deg", fov, 10.0, 140.0)?,
        (Some(_), Some(_)) => {
            return Err(value("camera", "expected one field of view: the other follows from the picture's shape", "two"));
        }
        (None, None) => return Err(value("camera", "expected horizontal_fov_deg or vertical_fov_deg", "neither")),
    }
    number("camera.tilt_deg", camera.tilt_deg, -90.0, 90.0)?;
    number("camera.latency_s", camera.latency_s, 0.0, 1.0)?;
    if camera.masks.len() > MOST {
        return Err(value("camera.masks", format!("expected at most {MOST}"), camera.masks.len()));
    }
    if let Some(mask) = camera.masks.iter().find(|mask| !mask.is_valid()) {
        return Err(value("camera.masks", region, format!("{:?}", mask.0)));
    }
    axes(controls)?;
    number("craft.cruise", craft.cruise, 0.1, 1.0)?;
    number("craft.radius_m", craft.radius_m, 0.05, 5.0)?;
    number("craft.acceleration_m_s2", craft.acceleration_m_s2, 0.5, 100.0)?;
    number("craft.max_altitude_m", craft.max_altitude_m, 1.0, 1000.0)?;
    number("craft.max_distance_m", craft.max_distance_m, 1.0, 10_000.0)?;
    number("take_off.height_m", take_off.height_m, 0.0, 50.0)?;
    sequence("take_off.steps", &take_off.steps)?;
    sequence("landing.steps", &landing.steps)?;
    sequence("reset.steps", &reset.steps)
}

fn axes(controls: &Controls) -> Result<(), ProfileError> {
    let Controls { pulse_hz, dead_time_s, lag_s, forward, right, up, yaw, gamepad: _ } = controls;
    number("controls.pulse_hz", *pulse_hz, 5.0, 50.0)?;
    number("controls.dead_time_s", *dead_time_s, 0.0, 2.0)?;
    number("controls.lag_s", *lag_s, 0.01, 5.0)?;
    let curve = controls.curve();
    number("controls.gamepad.dead_zone", curve.dead_zone, 0.0, 0.5)?;
    number("controls.gamepad.exponent", curve.exponent, 1.0, 4.0)?;
    let (mut keys, mut sticks) = (Vec::new(), Vec::new());
    for (name, axis) in [("forward", Some(forward)), ("right", right.as_ref()), ("up", Some(up))] {
        let Some(axis) = axis else { continue };
        let Axis { plus, minus, stick, rate_m_s, minus_rate_m_s } = axis;
        number(&format!("controls.{name}.rate_m_s"), *rate_m_s, 0.1, 50.0)?;
        number(&format!("controls.{name}.minus_rate_m_s"), minus_rate_m_s.unwrap_or(*rate_m_s), 0.1, 50.0)?;
        match (plus, minus, stick) {
            (Some(plus), Some(minus), None) => keys.extend([*plus, *minus]),
            (None, None, Some(stick)) => sticks.push(*stick),
            _ => {
                let given = [("plus", plus.is_some()), ("minus", minus.is_some()), ("stick", stick.is_some())];
                let given: Vec<_> = given.iter().filter(|(_, is_given)| *is_given).map(|(name, _)| *name).collect();
                let found = if given.is_empty() { "neither".to_owned() } else { given.join(", ") };
                return Err(value(&format!("controls.{name}"), "expected two keys, `plus` and `minus`, or a `stick`", found));
            }
        }
    }
    number("controls.yaw.rate_deg_s", yaw.rate_deg_s(), 5.0, 360.0)?;
    match yaw {
        Yaw::Keys(yaw) => keys.extend([yaw.plus, yaw.minus]),
        Yaw::Stick(yaw) => sticks.push(yaw.stick),
        Yaw::Mouse(mouse) => number("controls.yaw.mouse_deg", mouse.mouse_deg.abs(), 0.001, 10.0)?,
    }
    let mut seen = BTreeSet::new();
    if let Some(twice) = keys.iter().find(|key| !seen.insert(**key)) {
        return Err(value("controls", "expected each key in one place", twice));
    }
    let mut seen = BTreeSet::new();
    match sticks.iter().find(|stick| !seen.insert(stick.axis())) {
        Some(twice) => Err(value("controls", "expected each axis of a stick in one place", twice)),
        None => Ok(()),
    }
}

fn sequence(name: &str, steps: &[Step]) -> Result<(), ProfileError> {
    if steps.len() > MOST {
        return Err(value(name, format!("expected at most {MOST} steps"), steps.len()));
    }
    for step in steps {
        number(&format!("{name}.for_s"), step.for_s, 0.02, LONGEST_SEQUENCE)?;
        if step.hold.is_some() && step.push.is_some() {
            return Err(value(name, "expected `hold` or `push` in a step", "both"));
        }
    }
    number(name, steps.iter().map(|step| step.for_s).sum(), 0.0, LONGEST_SEQUENCE)
}
