//! Connecting to a vehicle: its heartbeat, its firmware, its rates and its parameters.

use std::time::Instant;

use spf_core::time::{Duration, Time};
use spf_mavlink::link::{Link, LinkError};
use spf_mavlink::modes::{Autopilot, Mode};
use spf_mavlink::report::Report;
use spf_mavlink::url::MavlinkUrl;
use spf_mavlink::wire::{Decoder, Encoder};

use super::fence_error::FencingError;
use super::settings::MavlinkSettings;
use crate::mavlink::vehicle::Vehicle;

/// How long a heartbeat is waited for: there is one every second, and a listener of a network may start late.
const HEARTBEAT_WAIT: Duration = Duration::from_secs(10);
/// Interval of our own heartbeats meanwhile: some links stay silent until they hear one.
const CALL: Duration = Duration::from_secs(1);
/// Our component: an onboard computer (`MAV_COMP_ID_ONBOARD_COMPUTER`).
pub(super) const COMPONENT: u8 = 191;

/// Why the connection failed. The driver adds a remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConnectError {
    /// The link could not be opened.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// No heartbeat arrived.
    #[error("no heartbeat of an autopilot on {url} within {} s", HEARTBEAT_WAIT.as_secs())]
    Silent {
        /// The address.
        url: MavlinkUrl,
        /// Bytes that arrived nevertheless.
        bytes: usize,
    },
    /// Another autopilot than PX4 and ArduPilot.
    #[error("the autopilot on {url} is neither PX4 nor ArduPilot (MAV_AUTOPILOT {number})")]
    Unknown {
        /// The address.
        url: MavlinkUrl,
        /// Its number.
        number: u8,
    },
    /// Not a multicopter.
    #[error("the vehicle on {url} is no multicopter (MAV_TYPE {kind})")]
    NoCopter {
        /// The address.
        url: MavlinkUrl,
        /// Its number.
        kind: u8,
    },
    /// Heartbeats arrive, but not all messages that a flight needs.
    #[error("the {autopilot} on {url} does not send {} within {wait} s", .missing.join(", "))]
    Missing {
        /// The address.
        url: MavlinkUrl,
        /// The autopilot.
        autopilot: &'static str,
        /// Names of the messages.
        missing: Vec<&'static str>,
        /// Seconds waited.
        wait: u64,
        /// What the vehicle said meanwhile.
        texts: Vec<String>,
    },
    /// Another vehicle speaks on the same link.
    #[error("two vehicles on {url}: systems {} and {}", .systems[0], .systems[1])]
    TwoVehicles {
        /// The address.
        url: MavlinkUrl,
        /// Their system numbers.
        systems: [u8; 2],
    },
    /// It signs its messages, and answers none of ours, which are not signed.
    #[error("the {autopilot} on {url} answers nothing: its packets are signed (MAVLink signing), and ours are not")]
    Signed {
        /// The address.
        url: MavlinkUrl,
        /// The autopilot.
        autopilot: &'static str,
    },
    /// The fence could not be replaced.
    #[error("the autopilot's fence could not be replaced, so that the flight is refused")]
    Fence(#[source] FencingError),
    /// A thread could not be started.
    #[error("cannot start the driver")]
    Start(#[source] std::io::Error),
}

impl ConnectError {
    /// What to do about it.
    #[must_use]
    pub fn hint(&self) -> Option<String> {
        Some(match self {
            Self::Link(LinkError::Bind { .. }) => {
                "close the program that listens there (a ground station, another flight), or let a router such as mavlink-router or \
                 MAVProxy share the link"
                    .to_owned()
            }
            Self::Link(LinkError::Serial { .. }) => {
                "check the cable and the device's name, and that this user may open it (on Debian the group dialout)".to_owned()
            }
            Self::Link(_) => "check the address, and that the vehicle, or its simulator, runs".to_owned(),
            Self::Silent { bytes: 0, .. } => {
                "nothing arrives: check that the vehicle sends to this address and port (PX4's SITL to UDP 14540, ArduPilot's listens \
                 on TCP 5760), and the firewall"
                    .to_owned()
            }
            Self::Silent { .. } => {
                "bytes arrive, but no heartbeat: check the rate of the serial port, and that its protocol is MAVLink".to_owned()
            }
            Self::Missing { texts, .. } if texts.is_empty() => {
                "wait for satellite navigation, or another source of position, and try again".to_owned()
            }
            Self::Missing { texts, .. } => format!("the autopilot says: {}", texts.join("; ")),
            Self::TwoVehicles { url, systems } => {
                format!("name the one to fly, as --drone \"mavlink@{url}?sysid={}\"", systems[0])
            }
            Self::Signed { .. } => {
                "turn signing off for this link with the ground station that has the key; by USB an ArduPilot takes unsigned packets".to_owned()
            }
            Self::Fence(_) => "`spf doctor` shows the autopilot's fence; without --upload-fence it is left as it is".to_owned(),
            _ => return None,
        })
    }
}

/// A vehicle that was heard of.
pub(super) struct Found {
    pub(super) system: u8,
    pub(super) component: u8,
    pub(super) vehicle: Vehicle,
    pub(super) encoder: Encoder,
}

/// `MAV_TYPE` of multicopters: quad-, hexa-, octo-, tri-, deca- and dodecarotor, coaxial.
const COPTERS: [u8; 7] = [2, 3, 13, 14, 15, 29, 35];

/// Waits for the heartbeat of an autopilot.
pub(super) fn find(
    url: &MavlinkUrl,
    link: &Link,
    decoder: &mut Decoder,
    settings: &MavlinkSettings,
    take_off_height: f64,
    start: Instant,
) -> Result<Found, ConnectError> {
    let (begun, mut called, mut bytes) = (Instant::now(), None::<Instant>, 0);
    // Our system is not known yet; a ground station is answered by everyone.
    let mut caller = Encoder::new([settings.system.unwrap_or(255), COMPONENT]);
    let mut buffer = [0; spf_mavlink::link::LONGEST];
    while begun.elapsed() < HEARTBEAT_WAIT {
        if called.is_none_or(|called| called.elapsed() >= CALL) {
            called = Some(Instant::now());
            link.send(&caller.frame(&spf_mavlink::message::heartbeat_of_computer()));
        }
        let (length, restarts) = link.receive(&mut buffer);
        if restarts {
            decoder.clear();
        }
        bytes += length;
        decoder.push(&buffer[..length]);
        while let Some(packet) = decoder.next_packet() {
            let Report::Heartbeat(heartbeat) = packet.report() else { continue };
            let number = packet.autopilot().unwrap_or(8);
            link.note(&packet);
            // Cameras, gimbals and ground stations have none.
            if number == 8 || packet.system == 0 || settings.vehicle.is_some_and(|wanted| packet.system != wanted) {
                continue;
            }
            let Some(autopilot) = Autopilot::from_heartbeat(number) else {
                return Err(ConnectError::Unknown { url: url.clone(), number });
            };
            if !COPTERS.contains(&heartbeat.kind) {
                return Err(ConnectError::NoCopter { url: url.clone(), kind: heartbeat.kind });
            }
            let own = [settings.system.unwrap_or(packet.system), COMPONENT];
            let now = Time::ZERO + start.elapsed();
            let mode = Mode(autopilot, heartbeat.custom_mode);
            let mut vehicle = Vehicle::new(now, mode, own, take_off_height, url.is_slow());
            vehicle.handle(now, &packet.report());
            return Ok(Found { system: packet.system, component: packet.component, vehicle, encoder: Encoder::new(own) });
        }
    }
    Err(ConnectError::Silent { url: url.clone(), bytes })
}
