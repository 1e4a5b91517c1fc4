//! Checks of a MAVLink vehicle before a flight: link, rates, state, the parameters that matter.

use std::time::{Duration, Instant};

use spf_core::time::Time;
use spf_mavlink::modes::Autopilot;
use spf_mavlink::url::MavlinkUrl;

use super::craft::MavlinkCraft;
use super::opening::listed;
use super::settings::MavlinkSettings;
use super::vehicle::Facts;
use crate::examine::{Check, Finding, battery};
use crate::{Drone as _, DroneEvent};

/// How long the link is observed.
const WATCHED: Duration = Duration::from_secs(4);
const POLL_INTERVAL: Duration = Duration::from_millis(20);
/// Reports of position per second that are requested, and over a slow link.
const POSITIONS: (f64, f64) = (20.0, 8.0);
/// Loss of messages from which on the link is weak, and bad.
const LOSS: (f64, f64) = (0.02, 0.2);
/// Dilution of precision and satellites below which a position is good.
const HDOP: f64 = 1.5;
const SATELLITES: u8 = 8;

/// Checks the vehicle at an address.
pub(super) fn examine(url: &MavlinkUrl, settings: &MavlinkSettings) -> Vec<Check> {
    let begun = Instant::now();
    let mut drone = match MavlinkCraft::connect(url, settings, begun) {
        Ok(drone) => drone,
        Err(error) => {
            let causes = core::iter::successors(std::error::Error::source(&error), |error| error.source());
            let text = causes.fold(error.to_string(), |text, cause| format!("{text}: {cause}"));
            return vec![Check::new("drone", Finding::Bad, text, error.hint().as_deref())];
        }
    };
    // What arrived while connecting is not part of the rate.
    while drone.next_event(Time::ZERO + begun.elapsed()).is_some() {}
    let (before, since, mut positions) = (drone.link_stats(), Instant::now(), 0_u32);
    while since.elapsed() < WATCHED {
        while let Some((_, event)) = drone.next_event(Time::ZERO + begun.elapsed()) {
            positions += u32::from(matches!(event, DroneEvent::Telemetry(_)));
        }
        std::thread::sleep(POLL_INTERVAL);
    }
    let (stats, facts, (mode, flying)) = (drone.link_stats(), drone.facts(), drone.state());
    let state = format!("{} at {url}, mode {mode}, {}", vehicle(&facts), if flying { "in the air" } else { "on the ground" });
    let mut checks = vec![Check::new("drone", Finding::Good, state, None)];
    let (received, lost) = (stats.received - before.received, stats.lost - before.lost);
    let share = lost as f64 / (received + lost).max(1) as f64;
    let should = if url.is_slow() { POSITIONS.1 } else { POSITIONS.0 };
    let rate = f64::from(positions) / WATCHED.as_secs_f64();
    let finding = match (rate / should, share) {
        (part, loss) if part < 0.4 || loss > LOSS.1 => Finding::Bad,
        (part, loss) if part < 0.8 || loss > LOSS.0 => Finding::Warning,
        _ => Finding::Good,
    };
    checks.push(Check::new(
        "link",
        finding,
        format!(
            "{rate:.1} Hz of {should:.0} Hz of position, {:.0} messages/s, {:.1} % lost",
            received as f64 / WATCHED.as_secs_f64(),
            100.0 * share
        ),
        Some("use a cable or a better radio, a higher rate of the serial port, and fewer other streams on it"),
    ));
    if stats.signed {
        let found = "its packets are signed; ours are not, and it takes them";
        let advice = "it may not on another link: try again on the one that you fly with";
        checks.push(Check::new("signing", Finding::Warning, found, Some(advice)));
    }
    if stats.other_stations {
        checks.push(Check::new(
            "ground station",
            Finding::Warning,
            "another ground station or onboard computer is on this link",
            Some("it can change the flight mode at any time; this program then lets go"),
        ));
    }
    let others = drone.others();
    if !others.is_empty() {
        checks.push(Check::new("also heard", Finding::Good, listed(&others), None));
    }
    checks.push(charge(&facts));
    if let Some(tilt) = drone.with_vehicle(|vehicle, now| vehicle.camera_tilt(now)) {
        checks.push(Check::new(
            "gimbal",
            Finding::Good,
            format!("looks {:.0}° below the horizon", tilt.to_degrees().round() + 0.0),
            None,
        ));
    }
    checks.extend(position(&facts));
    if let Some(may_arm) = facts.may_arm {
        let (finding, found) = match may_arm {
            true => (Finding::Good, "its checks pass".to_owned()),
            false => (Finding::Bad, format!("its checks fail: {}", facts.last_words().join("; "))),
        };
        checks.push(Check::new("arming", finding, found, Some("do what the autopilot says; a ground station shows more")));
    }
    checks.extend(parameters(&facts));
    checks
}

/// The battery, which may have no sensor.
fn charge(facts: &Facts) -> Check {
    let advice = match (facts.battery, facts.autopilot) {
        (Some(_), _) => "charge the battery: the envelope refuses take-off below 20 %",
        (None, Autopilot::Px4) => "take-off is refused without it: set up the battery's sensor (BAT1_SOURCE, BAT1_V_DIV)",
        (None, Autopilot::ArduPilot) => {
            "take-off is refused without it: set up the battery's sensor (BATT_MONITOR, BATT_CAPACITY)"
        }
    };
    match facts.battery {
        Some(charge) => battery(Some((100.0 * charge).round() as u8), advice),
        None => Check::new("battery", Finding::Bad, "its charge is unknown: the autopilot does not tell it", Some(advice)),
    }
}

/// The autopilot in words.
pub(super) fn vehicle(facts: &Facts) -> String {
    let version = facts.firmware.map_or(String::new(), |[major, minor, patch]| format!(" {major}.{minor}.{patch}"));
    let charge = facts.battery.map_or(String::new(), |charge| format!(", battery {:.0} %", 100.0 * charge));
    let fix = facts.gps.map_or(String::new(), |gps| match gps.satellites {
        Some(satellites) => format!(", {satellites} satellites"),
        None => String::new(),
    });
    format!("{}{version}{charge}{fix}", facts.autopilot.name())
}

fn position(facts: &Facts) -> Vec<Check> {
    let mut checks = Vec::new();
    if let Some(gps) = facts.gps {
        let satellites = gps.satellites.map_or("unknown satellites".to_owned(), |number| format!("{number} satellites"));
        let hdop = gps.hdop.map_or(String::new(), |hdop| format!(", HDOP {hdop:.1}"));
        let finding = match gps.fix {
            0..3 => Finding::Bad,
            _ if gps.satellites.is_some_and(|number| number < SATELLITES) || gps.hdop.is_some_and(|hdop| hdop > HDOP) => {
                Finding::Warning
            }
            _ => Finding::Good,
        };
        checks.push(Check::new(
            "GPS",
            finding,
            format!("fix type {}, {satellites}{hdop}", gps.fix),
            Some("wait under an open sky; without satellites it needs another source of position"),
        ));
    }
    checks.push(match facts.home {
        Some(home) => Check::new(
            "home",
            Finding::Good,
            format!("{:.0} m east, {:.0} m north, {:.0} m up of its origin", home.east, home.north, home.up),
            None,
        ),
        None => Check::new("home", Finding::Warning, "not set", Some("it cannot return home; wait for a position")),
    });
    checks
}

/// What its parameters mean for a flight by a program.
fn parameters(facts: &Facts) -> Vec<Check> {
    let number = |name| facts.parameter(name);
    let mut checks = Vec::new();
    let loss = match facts.autopilot {
        Autopilot::Px4 => match (number("COM_OF_LOSS_T"), number("COM_OBL_RC_ACT")) {
            (Some(time), Some(action)) if time <= 2.0 && matches!(action as i64, 3..=5) => Finding::Good,
            (_, Some(action)) if matches!(action as i64, 6 | 7) => Finding::Bad,
            _ => Finding::Warning,
        },
        Autopilot::ArduPilot => number("GUID_TIMEOUT").map_or(Finding::Warning, |_| Finding::Good),
    };
    let advice = match facts.autopilot {
        Autopilot::Px4 => {
            "set COM_OBL_RC_ACT to 5 (hold) or 4 (land) and COM_OF_LOSS_T to 1, so that it works without an RC transmitter too"
        }
        Autopilot::ArduPilot => "read GUID_TIMEOUT with a ground station: it must be a few seconds",
    };
    checks.push(Check::new("loss", loss, facts.on_loss(), Some(advice)));
    let fence = facts.fence_in_words();
    let (advice, names) = match facts.autopilot {
        Autopilot::Px4 => {
            ("set GF_MAX_HOR_DIST and GF_MAX_VER_DIST, a little beyond --max-distance and --max-altitude", "GF_ACTION")
        }
        Autopilot::ArduPilot => (
            "set FENCE_ENABLE to 1, and FENCE_RADIUS and FENCE_ALT_MAX a little beyond --max-distance and --max-altitude",
            "FENCE_ACTION",
        ),
    };
    checks.push(if fence.is_empty() {
        Check::new("fence", Finding::Warning, "the autopilot has none", Some(advice))
    } else {
        let action = number(names).map_or(String::new(), |action| format!(" ({names} {action})"));
        match facts.fenced {
            Some(false) => Check::new("fence", Finding::Warning, format!("{}, not in force", fence.join(", ")), Some(advice)),
            _ => Check::new("fence", Finding::Good, format!("{}{action}", fence.join(", ")), None),
        }
    });
    let low = match facts.autopilot {
        Autopilot::Px4 => ("COM_LOW_BAT_ACT", "set COM_LOW_BAT_ACT to 3 (return, then land)"),
        Autopilot::ArduPilot => ("BATT_FS_LOW_ACT", "set BATT_FS_LOW_ACT to 2 (RTL), and BATT_LOW_VOLT or BATT_LOW_MAH"),
    };
    if let Some(action) = number(low.0) {
        let finding = if action == 0.0 { Finding::Warning } else { Finding::Good };
        let found = if action == 0.0 { "the autopilot only warns".to_owned() } else { format!("{} {action}", low.0) };
        checks.push(Check::new("low battery", finding, found, Some(low.1)));
    }
    checks.push(match facts.return_height() {
        Ok(height) => Check::new("return", Finding::Good, format!("climbs to {height} m at most, then lands at home"), None),
        Err(why) => Check::new("return", Finding::Warning, why, Some("--at-end rtl is refused until then")),
    });
    if facts.autopilot == Autopilot::Px4 {
        checks.push(match number("MIS_TAKEOFF_ALT") {
            Some(height) => Check::new("take-off", Finding::Good, format!("to {height} m (MIS_TAKEOFF_ALT)"), None),
            None => {
                let advice = "without it a take-off is refused; improve the link, and try again";
                Check::new("take-off", Finding::Bad, "its height, MIS_TAKEOFF_ALT, could not be read", Some(advice))
            }
        });
    }
    checks
}
