//! Checks of a Tello before a flight: network path, state, video.

use std::net::SocketAddr;
use std::time::Instant;

use super::answer::explain;
use super::craft::{Connected, Tello};
use super::opening::ConnectError;
use super::settings::TelloSettings;
use crate::examine::{Check, FIRST_PICTURE, Finding, Watched, battery, light};

/// The drone shuts down slightly above this temperature, °C.
const HOT: i32 = 80;
/// Expected state lines per second.
const STATES: f64 = 10.0;

/// Checks the Tello at an address.
pub(super) fn examine(address: SocketAddr, settings: &TelloSettings) -> Vec<Check> {
    let Connected { mut drone, state, firmware } = match Tello::connect(address, settings, Instant::now()) {
        Ok(connected) => connected,
        Err(error) => return vec![unreachable(address, settings, &error)],
    };
    let mut checks = vec![Check::new("drone", Finding::Good, format!("{address} answers, {firmware}"), None)];
    checks.push(battery(state.battery, "charge it: below 20 % the envelope refuses a take-off, below 10 % the drone does"));
    if let Some([low, high]) = state.temperature {
        let finding = if high >= HOT { Finding::Bad } else { Finding::Good };
        checks.push(Check::new(
            "temperature",
            finding,
            format!("{low} to {high} °C"),
            Some("switch it off and let it cool: it switches itself off above some 85 °C"),
        ));
    }
    let watched = Watched::of(&mut drone);
    checks.push(Check::new(
        "state",
        watched.reports(STATES),
        format!("{:.1} lines a second of 10", watched.telemetry),
        Some("go nearer to the drone, or to where fewer Wi-Fi networks are"),
    ));
    let Some(picture) = &watched.newest else {
        let todo = format!(
            "allow UDP {} from {} in the firewall; a Tello EDU that joined a router sends no video with SDK 2.0",
            settings.video_port,
            address.ip()
        );
        let found = format!("none within {} s", FIRST_PICTURE.as_secs());
        checks.push(Check::new("video", Finding::Bad, found, Some(&todo)));
        return checks;
    };
    checks.push(watched.video(picture, "go nearer to the drone; each lost datagram costs the rest of a second"));
    checks.push(light(picture, "switch on a light: in the dark it drifts, and answers `error No valid imu`"));
    checks
}

fn unreachable(address: SocketAddr, settings: &TelloSettings, error: &ConnectError) -> Check {
    let ip = address.ip();
    let advice = match error {
        ConnectError::Port { port, .. } => {
            format!("end the program that has UDP port {port}: another Tello program, or a second flight")
        }
        ConnectError::Unreachable { .. } | ConnectError::NoAnswer { .. } => {
            format!(
                "switch it on and join its Wi-Fi TELLO-…; `ping {ip}` should answer; after the app was used, switch it off and on"
            )
        }
        ConnectError::NoState { port } => format!("allow UDP {port} and {} from {ip} in the firewall", settings.video_port),
        ConnectError::Refused { answer, .. } => explain(answer).to_owned(),
        _ => "start again; if it stays so, tell the project".to_owned(),
    };
    Check::new("drone", Finding::Bad, error.to_string(), Some(&advice))
}
