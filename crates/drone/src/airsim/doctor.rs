//! Checks of a simulator before a flight: dialect, vehicles, cameras, rates, clock.

use std::time::{Duration, Instant};

use spf_core::time::Time;

use super::address::Address;
use super::craft::{AirSimCraft, Facts};
use super::opening::scene_of;
use super::rpc::RpcError;
use super::session::Session;
use super::settings::AirSimSettings;
use crate::Drone as _;
use crate::examine::{Check, Finding, Observation};

/// Images narrower than this show a person 20 m away with a few pixels.
pub(super) const WIDE_ENOUGH: u32 = 480;
/// How they become larger.
pub(super) const LARGER: &str = "set Width and Height of the camera's CaptureSettings in settings.json, such as 960 and 720, and \
                                 restart the simulator";
/// Cameras that every vehicle has.
const BUILT_IN: [&str; 5] = ["front_center", "front_right", "front_left", "bottom_center", "back_center"];
/// Most cameras that are asked.
const MOST_CAMERAS: usize = 24;
/// Expected states per second.
const STATES: f64 = 20.0;
/// Rate of the simulator's time from which on it is no longer that of the wall clock.
const RATE: core::ops::RangeInclusive<f64> = 0.9..=1.1;

/// Checks the vehicle at an address. Nothing is commanded.
pub(super) fn examine(address: &Address, settings: &AirSimSettings) -> Vec<Check> {
    let (mut drone, facts) = match AirSimCraft::connect(address, settings, Instant::now()) {
        Ok(connected) => connected,
        Err(error) => {
            let causes = core::iter::successors(std::error::Error::source(&error), |error| error.source());
            let text = causes.fold(error.to_string(), |text, cause| format!("{text}: {cause}"));
            return vec![Check::new("drone", Finding::Bad, text, error.hint().as_deref())];
        }
    };
    let mut checks = vec![Check::new("drone", Finding::Good, found(address, &facts), None)];
    if !facts.vehicles.is_empty() {
        checks.push(Check::new("vehicles", Finding::Good, facts.vehicles.join(", "), None));
    }
    match Session::open(address, facts.encoding) {
        Ok(mut session) => {
            checks.push(cameras(&mut session, address));
            checks.extend(clock(&mut session).map_err(|error| tracing::debug!(%error, "no clock")).ok());
        }
        Err(error) => checks.push(Check::new("cameras", Finding::Warning, error.to_string(), None)),
    }
    // What arrived meanwhile is not part of the rate.
    while drone.next_event(Time::MAX).is_some() {}
    let watched = Observation::of(&mut drone);
    checks.push(Check::new(
        "state",
        watched.reports(STATES),
        format!("{:.1} Hz of {STATES:.0} Hz", watched.telemetry),
        Some("close what loads the machine, or lower the simulator's graphics"),
    ));
    let Some(image) = &watched.newest else {
        let advice = "check Cameras and CaptureSettings of settings.json";
        checks.push(Check::new("video", Finding::Bad, format!("no image of camera `{}`", settings.camera), Some(advice)));
        return checks;
    };
    let video = watched.video(image, "lower the simulator's graphics, or the size of the images");
    checks.push(video.with_picture(image.pixels()));
    let (width, height) = image.size();
    let finding = if width < WIDE_ENOUGH { Finding::Warning } else { Finding::Good };
    checks.push(Check::new("image", finding, format!("camera `{}`: {width}×{height}", settings.camera), Some(LARGER)));
    checks
}

fn found(address: &Address, facts: &Facts) -> String {
    let version = facts.version.map_or(String::new(), |version| format!(", version {version} of its interface"));
    let where_ = if facts.flies { "in the air" } else { "on the ground" };
    format!("{} at {address}{version}, {where_}", facts.dialect())
}

/// The cameras that answer, with size and field of view.
fn cameras(session: &mut Session, address: &Address) -> Check {
    let mut names: Vec<String> = BUILT_IN.map(str::to_owned).to_vec();
    names.extend(session.settings().ok().map(|text| named_in(&text, &address.vehicle)).unwrap_or_default());
    names.truncate(MOST_CAMERAS);
    let seen: Vec<String> = names.iter().filter_map(|name| camera(session, name)).collect();
    match seen.is_empty() {
        true => Check::new("cameras", Finding::Warning, "none of the usual names answers", Some("look into settings.json")),
        false => Check::new("cameras", Finding::Good, seen.join(", "), None),
    }
}

fn camera(session: &mut Session, name: &str) -> Option<String> {
    let info = session.camera(name).ok()?;
    let images = session.images(&[scene_of(name)]).ok()?;
    let image = images.first().filter(|image| image.width > 0)?;
    Some(format!("{name} {}×{} {:.0}°", image.width, image.height, info.fov))
}

/// Names of the cameras that a settings.json adds to a vehicle, or to all if it has no name.
pub(super) fn named_in(settings: &str, vehicle: &str) -> Vec<String> {
    let Ok(settings) = serde_json::from_str::<serde_json::Value>(settings) else { return Vec::new() };
    let Some(vehicles) = settings["Vehicles"].as_object() else { return Vec::new() };
    let meant = vehicles.iter().filter(|(name, _)| vehicle.is_empty() || *name == vehicle);
    let cameras = meant.filter_map(|(_, vehicle)| vehicle["Cameras"].as_object()).flat_map(|cameras| cameras.keys());
    cameras.take(MOST_CAMERAS).cloned().collect()
}

/// How fast the simulator's time runs.
fn clock(session: &mut Session) -> Result<Check, RpcError> {
    const WATCHED: Duration = Duration::from_secs(1);
    let mut time = || session.state().map(|(state, _)| (Instant::now(), state.timestamp));
    let (begun, from) = time()?;
    std::thread::sleep(WATCHED);
    let (ended, to) = time()?;
    let rate = to.saturating_sub(from) as f64 * 1e-9 / ended.duration_since(begun).as_secs_f64();
    let finding = if RATE.contains(&rate) { Finding::Good } else { Finding::Warning };
    let advice = "a flight in real time needs 1: set ClockSpeed to 1 in settings.json, or let it render less; --lockstep flies at any rate";
    Ok(Check::new("clock", finding, format!("its time runs at {rate:.2} of real time"), Some(advice)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_of_the_settings_are_those_of_the_vehicle() {
        let settings = r#"{"Vehicles": {"A": {"Cameras": {"low": {}, "high": {}}}, "B": {"Cameras": {"wide": {}}}, "C": {}}}"#;
        assert_eq!(named_in(settings, "A"), ["low", "high"]);
        assert_eq!(named_in(settings, "").len(), 3);
        for text in
            ["", "{", "[]", "{}", r#"{"Vehicles": 3}"#, r#"{"Vehicles": {"A": 3}}"#, r#"{"Vehicles": {"A": {"Cameras": []}}}"#]
        {
            assert_eq!(named_in(text, ""), Vec::<String>::new(), "{text}");
        }
    }
}
