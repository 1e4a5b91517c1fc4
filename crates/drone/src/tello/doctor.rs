//! Checks of a Tello before a flight: network path, state, video.

use std::net::SocketAddr;
use std::time::Instant;

use super::answer::explain;
use super::craft::{Connected, Tello};
use super::opening::ConnectError;
use super::settings::TelloSettings;
use super::state::UNREAD;
use crate::examine::{Check, FIRST_FRAME, Finding, Observation, battery, light};

/// The drone shuts down slightly above this temperature, °C.
pub(super) const HOT: i32 = 80;
/// Expected state lines per second.
const STATES: f64 = 10.0;

/// Checks the Tello at an address.
pub(super) fn examine(address: SocketAddr, settings: &TelloSettings) -> Vec<Check> {
    let Connected { mut drone, state, firmware } = match Tello::connect(address, settings, Instant::now()) {
        Ok(connected) => connected,
        Err(error) => return vec![unreachable(address, settings, &error)],
    };
    let mut checks = vec![Check::new("drone", Finding::Good, format!("connected to {address}, {firmware}"), None)];
    checks.push(battery(state.battery, "charge the battery: the envelope refuses take-off below 20 %, the drone below 10 %"));
    if let Some([low, high]) = state.temperature {
        let finding = if high >= HOT { Finding::Bad } else { Finding::Good };
        checks.push(Check::new(
            "temperature",
            finding,
            format!("{low} to {high} °C"),
            Some("switch the drone off and let it cool: it shuts down above about 85 °C"),
        ));
    }
    let missing = state.missing();
    if !missing.is_empty() {
        // In flight, lines without attitude are an error of its inertial measurement.
        let finding = if missing.contains(&"attitude") { Finding::Bad } else { Finding::Warning };
        let found = format!("its state does not tell, or not in a form that can be read: {}", missing.join(", "));
        checks.push(Check::new(
            "values",
            finding,
            found,
            Some("update its firmware in the Tello app, and watch the drone all the time"),
        ));
    }
    let watched = Observation::of(&mut drone);
    checks.push(Check::new(
        "state",
        watched.reports(STATES),
        format!("{:.1} Hz of 10 Hz", watched.telemetry),
        Some("move closer to the drone, or to a place with fewer Wi-Fi networks"),
    ));
    let Some(image) = &watched.newest else {
        let todo = format!(
            "allow UDP {} from {} in the firewall; a Tello EDU in station mode sends no video with SDK 2.0",
            settings.video_port,
            address.ip()
        );
        let found = format!("none within {} s", FIRST_FRAME.as_secs());
        checks.push(Check::new("video", Finding::Bad, found, Some(&todo)));
        return checks;
    };
    checks.push(watched.video(image, "move closer to the drone; each lost datagram can cost up to a second of video"));
    checks.push(light(image, "switch on a light: in the dark the drone drifts and returns `error No valid imu`"));
    checks
}

fn unreachable(address: SocketAddr, settings: &TelloSettings, error: &ConnectError) -> Check {
    let ip = address.ip();
    let advice = match error {
        ConnectError::Port { port, .. } => {
            format!("close the program that uses UDP port {port}: another Tello program, or a second flight")
        }
        ConnectError::Unreachable { .. } | ConnectError::NoAnswer { .. } => {
            format!(
                "switch the drone on and join its Wi-Fi TELLO-…; check with `ping {ip}`; after using the app, switch the \
                    drone off and on"
            )
        }
        ConnectError::NoState { port } => format!("allow UDP {port} and {} from {ip} in the firewall", settings.video_port),
        ConnectError::UnreadState { .. } => UNREAD.to_owned(),
        ConnectError::Refused { answer, .. } => explain(answer).to_owned(),
        _ => "try again; if it persists, report a bug".to_owned(),
    };
    Check::new("drone", Finding::Bad, error.to_string(), Some(&advice))
}
