//! Status, hold and landing of a Tello without a flight: for a drone whose program has died or hangs.
//!
//! Nothing here moves the drone: it only sends zero or `land`. It works without the state port, which the other program
//! may still hold.

use std::net::{SocketAddr, UdpSocket};
use std::time::Instant;

use spf_core::time::{Duration, Time};

use super::ground::Ground;
pub use super::ground::Place;
use super::intake;
pub use super::opening::{COMMAND_WAIT, STATE_WAIT};
use super::opening::{ConnectError, Firmware, bind, command_socket, enter, first_state, place};
use super::settings::TelloSettings;
use super::state::State;

/// Number of zeros, and the interval between them.
const ZEROS: u32 = 3;
const ZERO_SPACING: Duration = Duration::from_millis(50);
/// `land` is repeated after this long.
const LAND_AGAIN: Duration = Duration::from_secs(1);
/// How long its state is watched for a sign of where it is: motors that are off on a table, without an echo, are the slowest.
pub const PLACE_WAIT: Duration = Duration::from_secs(8);
/// Longest landing: from 10 m at 0.5 m/s, and until the state shows the motors off.
pub const LANDING_TIME: Duration = Duration::from_secs(25);
/// How long `land` is repeated if no state arrives.
const BLIND_TIME: Duration = Duration::from_secs(10);
/// Receive timeout of the sockets.
const POLL_INTERVAL: Duration = Duration::from_millis(20);

/// How a landing ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Landed {
    /// The telemetry shows the motors off.
    Seen,
    /// The drone still seems to be in the air.
    Airborne,
    /// `land` was sent, but no state arrives, so its effect is unknown.
    Unseen,
}

/// A Tello in SDK mode, without a pilot.
pub struct Rescue {
    command: UdpSocket,
    /// `None` if another program holds the port.
    state: Option<UdpSocket>,
    state_port: u16,
    drone: SocketAddr,
    /// Identification.
    pub firmware: Firmware,
}

impl Rescue {
    /// Enters SDK mode. A drone that is in the air stays as it is: its velocity does not change.
    ///
    /// # Errors
    /// [`ConnectError`] if the drone cannot be reached or refuses.
    pub fn connect(drone: SocketAddr, settings: &TelloSettings) -> Result<Self, ConnectError> {
        let command = command_socket(settings.local)?;
        command.connect(drone).map_err(|source| ConnectError::Unreachable { drone, source })?;
        command.set_read_timeout(Some(POLL_INTERVAL)).map_err(ConnectError::Start)?;
        let state = bind(settings.local, settings.state_port, "state").ok();
        if let Some(socket) = &state {
            socket.set_read_timeout(Some(POLL_INTERVAL)).map_err(ConnectError::Start)?;
        }
        let firmware = enter(&command, drone, &|| false)?;
        Ok(Self { command, state, state_port: settings.state_port, drone, firmware })
    }

    /// Its state; waits for it for up to [`STATE_WAIT`].
    ///
    /// # Errors
    /// [`ConnectError::InUse`] if another program holds the state port, [`ConnectError::NoState`] if none arrives, and
    /// [`ConnectError::UnreadState`] if what arrives cannot be read.
    pub fn state(&self) -> Result<State, ConnectError> {
        let port = self.state_port;
        let socket = self.state.as_ref().ok_or(ConnectError::InUse { port })?;
        first_state(socket, port, self.drone.ip(), STATE_WAIT)
    }

    /// Where it is, by this state and those that follow for up to [`PLACE_WAIT`]; it returns as soon as they tell.
    #[must_use]
    pub fn place(&self, first: &State) -> Place {
        let watched = self.state.as_ref().map(|socket| place(socket, self.drone.ip(), first, PLACE_WAIT));
        watched.unwrap_or(Place::Unknown)
    }

    /// Commands zero velocity. The drone hovers, and lands by itself 15 s after the last command.
    ///
    /// # Errors
    /// The operating system's error if nothing can be sent.
    pub fn hold(&self) -> std::io::Result<()> {
        for _ in 0..ZEROS {
            self.command.send(b"rc 0 0 0 0")?;
            std::thread::sleep(ZERO_SPACING);
        }
        Ok(())
    }

    /// Commands zero and then `land`, repeated until the telemetry shows the motors off.
    ///
    /// # Errors
    /// The operating system's error if nothing can be sent.
    pub fn land(&self) -> std::io::Result<Landed> {
        self.hold()?;
        let (begun, mut due, mut buffer) = (Instant::now(), Duration::ZERO, [0; intake::BUFFER]);
        let (mut ground, mut heard) = (Ground::default(), false);
        loop {
            let passed = begun.elapsed();
            if passed >= due {
                self.command.send(b"land")?;
                due = passed + LAND_AGAIN;
            }
            let socket = self.state.as_ref().unwrap_or(&self.command);
            if let Some(datagram) = intake::receive(socket, self.drone.ip(), intake::TEXT, &mut buffer)
                && let Some(state) = State::read(datagram)
            {
                heard = true;
                ground.observe(Time::ZERO + begun.elapsed(), &state);
            }
            if ground.is_reached() {
                return Ok(Landed::Seen);
            }
            if !heard && passed >= BLIND_TIME {
                return Ok(Landed::Unseen);
            }
            if passed >= LANDING_TIME {
                return Ok(Landed::Airborne);
            }
        }
    }
}
