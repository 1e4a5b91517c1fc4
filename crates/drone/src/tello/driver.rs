//! The Tello's driver registration.

use std::net::{IpAddr, SocketAddr};
use std::time::Instant;

use spf_core::craft::Craft;
use spf_envelope::Limits;
use spf_motion::executor::Motion;

use super::craft::{Connected, Tello};
use super::doctor;
use super::opening::ConnectError;
use super::settings::{COMMAND_PORT, TelloMotion};
use crate::driver::{self, Driver, Target};
use crate::examine::Check;
use crate::options::Options;

/// Address of a Tello in its factory setting, as its own access point.
const USUAL: SocketAddr = SocketAddr::new(IpAddr::V4(std::net::Ipv4Addr::new(192, 168, 10, 1)), COMMAND_PORT);

/// Warning before take-off with `rc` motion.
const WARNING: &str = "If the link is lost, the Tello holds its last velocity and cannot be stopped until it lands \
automatically, 15 s after the last command; where that matters, fly with --tello-motion go. Ctrl-C lands; a second Ctrl-C \
lands without finishing the files.";

/// Warning before take-off with `go` motion.
const OWN_WARNING: &str = "If the link is lost, the Tello completes the current step (at most 5 m), hovers, and lands 15 s \
after the last command. Steps of up to 20 cm use rc. Ctrl-C lands; a second Ctrl-C lands without finishing the files.";

/// The driver.
pub const DRIVER: Driver = Driver {
    scheme: "tello",
    form: "tello[@ADDRESS]",
    about: "a DJI Tello, at 192.168.10.1 unless ADDRESS is given; see docs/guide/tello.md",
    target: |rest| {
        let name = format!("{}{rest}", DRIVER.scheme);
        command_port(&name).map(|drone| Box::new(NamedTello(drone)) as Box<dyn Target>)
    },
};

/// Command port of the craft with this name, such as `tello` or `tello@192.168.10.1`; `None` if it names no Tello.
#[must_use]
pub fn command_port(name: &str) -> Option<SocketAddr> {
    let rest = name.strip_prefix(DRIVER.scheme)?;
    if rest.is_empty() { Some(USUAL) } else { rest.strip_prefix('@').and_then(address) }
}

fn address(text: &str) -> Option<SocketAddr> {
    text.parse().ok().or_else(|| text.parse::<IpAddr>().ok().map(|ip| SocketAddr::new(ip, COMMAND_PORT)))
}

/// A Tello at an address.
struct NamedTello(SocketAddr);

impl Target for NamedTello {
    fn craft(&self) -> Craft {
        Craft::tello()
    }

    /// Limits for a room: a Tello weighs 80 g and has no position. It shuts down slightly above the maximum
    /// temperature.
    fn limits(&self) -> Limits {
        Limits {
            max_altitude: 5.0,
            max_distance: 20.0,
            max_speed: 0.6,
            take_off_checks: true,
            max_temperature: Some(f64::from(doctor::HOT)),
            ..Limits::for_craft(&self.craft())
        }
    }

    fn motion(&self, options: &Options) -> Option<Motion> {
        (options.tello.motion == TelloMotion::Go).then_some(Motion::Manoeuvres)
    }

    fn is_simulated(&self) -> bool {
        self.0.ip().is_loopback()
    }

    fn connect(&self, options: &Options, start: Instant) -> Result<driver::Connected, driver::ConnectError> {
        let connected = Tello::connect(self.0, &options.tello, start);
        let Connected { drone, state, firmware } = connected.map_err(|error| self.refused(error))?;
        let battery = state.battery.map_or("battery unknown".to_owned(), |charge| format!("battery {charge} %"));
        Ok(driver::Connected {
            drone: Box::new(drone),
            summary: format!("Connected to the Tello at {}: {firmware}, {battery}.", self.0.ip()),
            warning: if options.tello.motion == TelloMotion::Go { OWN_WARNING } else { WARNING }.to_owned(),
        })
    }

    fn examine(&self, options: &Options) -> Vec<Check> {
        doctor::examine(self.0, &options.tello)
    }
}

impl NamedTello {
    fn refused(&self, error: ConnectError) -> driver::ConnectError {
        explained(self.0.ip(), error)
    }
}

/// The error with a hint on what to do.
#[must_use]
pub fn explained(ip: IpAddr, error: ConnectError) -> driver::ConnectError {
    let hint = match &error {
        ConnectError::Port { port, .. } => {
            Some(format!("close the program that uses port {port} (another Tello program, a second flight)"))
        }
        ConnectError::Unreachable { .. } | ConnectError::NoAnswer { .. } => Some(format!(
            "check that the drone is on, that this machine is in its Wi-Fi TELLO-…, and that `ping {ip}` works; after \
                using the app, switch the drone off and on"
        )),
        ConnectError::NoState { port } => {
            Some(format!("a firewall may block incoming packets: allow UDP {port} and 11111 from {ip}"))
        }
        ConnectError::UnreadState { .. } => Some(super::state::UNREAD.to_owned()),
        ConnectError::InUse { port } => Some(format!("close the program that uses port {port}; it may show the video itself")),
        ConnectError::Flies => Some("wait until it has landed; whoever flies it shows what it sees".to_owned()),
        _ => None,
    };
    driver::ConnectError { craft: "the Tello", source: error.into(), hint }
}
