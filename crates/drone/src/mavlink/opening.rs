//! Connecting to a vehicle: its heartbeat, its firmware, its rates and its parameters.

use std::time::Instant;

use spf_core::time::{Duration, Time};
use spf_mavlink::link::{Link, LinkError};
use spf_mavlink::modes::Mode;
use spf_mavlink::report::Report;
use spf_mavlink::station::Station;
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
    /// Heartbeats arrived, but none of a multicopter with PX4 or ArduPilot, or not of the one that is wanted.
    #[error(
        "no heartbeat of a multicopter with PX4 or ArduPilot{} on {url} within {} s; heard: {}",
        of(*.wanted),
        HEARTBEAT_WAIT.as_secs(),
        listed(.heard)
    )]
    Others {
        /// The address.
        url: MavlinkUrl,
        /// The system that is wanted.
        wanted: Option<u8>,
        /// Who was heard.
        heard: Vec<Station>,
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

fn of(system: Option<u8>) -> String {
    system.map_or(String::new(), |system| format!(" of system {system}"))
}

/// Stations in words.
pub(super) fn listed(stations: &[Station]) -> String {
    stations.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
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
            Self::Others { url, wanted: Some(_), heard } if heard.iter().any(Station::is_vehicle) => {
                let system = heard.iter().find(|station| station.is_vehicle()).map_or(1, |station| station.system);
                format!("name one that is there, as --drone \"mavlink@{url}?sysid={system}\"")
            }
            Self::Others { .. } => "check that the vehicle itself sends to this address, and that its frame is set up in the autopilot: \
                                    others than multicopters are not flown"
                .to_owned(),
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
            Self::Fence(_) => "`spf doctor` shows the autopilot's fence; without `mavlink.upload_fence` it is left as it is".to_owned(),
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

/// Waits for the heartbeat of a multicopter. Whoever else is heard meanwhile (receivers, cameras, other vehicles, ground stations) is
/// only remembered.
pub(super) fn find(
    url: &MavlinkUrl,
    link: &Link,
    decoder: &mut Decoder,
    settings: &MavlinkSettings,
    take_off_height: f64,
    start: Instant,
) -> Result<Found, ConnectError> {
    let (begun, mut called) = (Instant::now(), None::<Instant>);
    // Our system is not known yet; a ground station is answered by everyone.
    let caller_id = [settings.system.unwrap_or(255), COMPONENT];
    let mut caller = Encoder::new(caller_id);
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
        decoder.push(&buffer[..length]);
        while let Some(packet) = decoder.next_packet() {
            let Report::Heartbeat(heartbeat) = packet.report() else { continue };
            link.note(&packet);
            let is_wanted = |station: &Station| settings.vehicle.is_none_or(|wanted| station.system == wanted);
            let Some(autopilot) = Station::of(&packet).filter(is_wanted).and_then(|station| station.copter()) else { continue };
            let own = [settings.system.unwrap_or(packet.system), COMPONENT];
            let now = Time::ZERO + start.elapsed();
            let mode = Mode(autopilot, heartbeat.custom_mode);
            let mut vehicle = Vehicle::new(now, mode, own, take_off_height, url.is_slow());
            vehicle.handle(now, &packet.report());
            return Ok(Found { system: packet.system, component: packet.component, vehicle, encoder: Encoder::new(own) });
        }
    }
    Err(nobody(url, link, settings, caller_id))
}

/// Why no vehicle was found.
fn nobody(url: &MavlinkUrl, link: &Link, settings: &MavlinkSettings, caller: [u8; 2]) -> ConnectError {
    let mut heard = link.stations();
    // A router may send back what comes from here.
    heard.retain(|station| [station.system, station.component] != caller);
    if heard.is_empty() {
        return ConnectError::Silent { url: url.clone(), bytes: link.bytes() };
    }
    ConnectError::Others { url: url.clone(), wanted: settings.vehicle, heard }
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;
    use std::net::TcpListener;

    use spf_mavlink::modes::Autopilot;
    use spf_mavlink::wire::Body;

    use super::*;

    /// A heartbeat of system, component, type and autopilot.
    fn beat([system, component, kind, autopilot]: [u8; 4]) -> Vec<u8> {
        Encoder::new([system, component]).frame(&Body { id: 0, payload: vec![0, 0, 0, 0, kind, autopilot, 1, 4, 3] })
    }

    /// An ADS-B receiver, a camera that says that it has an autopilot and is component 1, a rover, an antenna tracker, a vehicle with
    /// another autopilot, a ground station with the vehicle's number.
    const OTHERS: [[u8; 4]; 6] = [[9, 156, 27, 0], [1, 1, 30, 0], [3, 1, 10, 3], [4, 1, 5, 3], [5, 1, 2, 17], [7, 190, 6, 8]];

    /// A link on which these heartbeats come, one after the other.
    fn heard(beats: &[[u8; 4]], wanted: Option<u8>) -> (MavlinkUrl, Link, std::net::TcpStream) {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let url: MavlinkUrl = format!("tcpout:{}", listener.local_addr().unwrap()).parse().unwrap();
        let link = Link::open(&url, wanted).unwrap();
        let (mut stream, _) = listener.accept().unwrap();
        beats.iter().for_each(|of| stream.write_all(&beat(*of)).unwrap());
        (url, link, stream)
    }

    fn found(beats: &[[u8; 4]], wanted: Option<u8>) -> (u8, Autopilot) {
        let (url, link, _stream) = heard(beats, wanted);
        let settings = MavlinkSettings { vehicle: wanted, ..MavlinkSettings::default() };
        let found = find(&url, &link, &mut Decoder::default(), &settings, 3.0, Instant::now()).unwrap();
        (found.system, found.vehicle.facts().autopilot)
    }

    #[test]
    fn whoever_is_heard_first_the_multicopter_is_waited_for() {
        for other in OTHERS {
            assert_eq!(found(&[other, other, [7, 1, 2, 12]], None), (7, Autopilot::Px4), "{other:?}");
        }
        assert_eq!(found(&[OTHERS.as_slice(), &[[7, 1, 13, 3]]].concat(), None), (7, Autopilot::ArduPilot));
        // The number chooses among multicopters.
        assert_eq!(found(&[[1, 1, 2, 12], [8, 1, 2, 3]], Some(8)), (8, Autopilot::ArduPilot));
    }

    #[test]
    fn who_was_heard_instead_is_listed_with_what_to_do() {
        let error = |beats: &[[u8; 4]], wanted: Option<u8>| {
            let (url, link, stream) = heard(beats, None);
            drop(stream);
            let (mut decoder, mut buffer) = (Decoder::default(), [0; spf_mavlink::link::LONGEST]);
            let all = 21 * beats.len();
            while link.bytes() < all {
                let (length, _) = link.receive(&mut buffer);
                decoder.push(&buffer[..length]);
                while let Some(packet) = decoder.next_packet() {
                    link.note(&packet);
                }
            }
            let settings = MavlinkSettings { vehicle: wanted, ..MavlinkSettings::default() };
            let error = nobody(&url, &link, &settings, [255, COMPONENT]);
            (error.to_string().replace(&url.to_string(), "URL"), error.hint().unwrap().replace(&url.to_string(), "URL"))
        };
        let (text, hint) = error(&[[3, 1, 10, 3], [1, 100, 30, 8], [255, 191, 18, 8]], None);
        assert_eq!(
            text,
            "no heartbeat of a multicopter with PX4 or ArduPilot on URL within 10 s; heard: system 1 component 100 (camera); system 3 \
             component 1 (rover, ArduPilot)"
        );
        assert!(hint.contains("others than multicopters are not flown"), "{hint}");
        let (text, hint) = error(&[[2, 1, 2, 12]], Some(9));
        assert!(
            text.contains("ArduPilot of system 9 on URL") && text.ends_with("system 2 component 1 (multicopter, PX4)"),
            "{text}"
        );
        assert_eq!(hint, "name one that is there, as --drone \"mavlink@URL?sysid=2\"");
        // Only what comes back from here.
        let (text, _) = error(&[[255, 191, 18, 8]], None);
        assert_eq!(text, "no heartbeat of an autopilot on URL within 10 s");
    }
}
