//! The video of a Tello without a pilot, for a program that only looks. Nothing here moves the drone. As any command does, those that
//! start the video and request a key frame restart its own timer, which lands it 15 s after the last command. So none is sent to one
//! that flies, as far as its state tells.

use std::io::ErrorKind;
use std::net::{SocketAddr, UdpSocket};
use std::time::Instant;

use spf_core::time::Duration;

use super::answer::{Answer, explain};
use super::ground::ABOVE_GROUND;
use super::intake;
use super::opening::{ConnectError, STATE_WAIT, bind, command_socket, enter, first_state, is_flying, receive};
use super::settings::TelloSettings;
use super::state::State;

/// Receive buffer for more than half a second of video, bytes.
pub(super) const VIDEO_BUFFER: usize = 4 << 20;
/// Tries to start the video, and how long each is answered.
const TRIES: u32 = 3;
const ANSWER_WAIT: Duration = Duration::from_secs(1);
/// Timeout of the sockets.
const POLL_INTERVAL: Duration = Duration::from_millis(20);
/// How long the state is awaited before the first command: a Tello goes on sending it to a machine whose program has ended.
const LISTENING: Duration = Duration::from_millis(400);
/// Interval between requests for a key frame.
const REQUEST_INTERVAL: Duration = Duration::from_millis(500);
const START: &[u8] = b"streamon";

/// A Tello that sends its video.
pub struct VideoLink {
    command: UdpSocket,
    video: UdpSocket,
    state: UdpSocket,
    drone: SocketAddr,
    requested: Instant,
    motors: Motors,
    buffer: [u8; intake::BUFFER],
}

impl VideoLink {
    /// Enters SDK mode and starts the video, unless the drone flies or `stopped` becomes true.
    ///
    /// # Errors
    /// [`ConnectError`] if the drone flies, cannot be reached or refuses, or if another program receives its state or its video.
    pub fn connect(drone: SocketAddr, settings: &TelloSettings, stopped: &dyn Fn() -> bool) -> Result<Self, ConnectError> {
        let port = settings.state_port;
        let state = bind(settings.local, port, "state").map_err(|error| match error {
            ConnectError::Port { source, .. } if source.kind() == ErrorKind::AddrInUse => ConnectError::InUse { port },
            other => other,
        })?;
        let video = video_socket(settings)?;
        for socket in [&state, &video] {
            socket.set_read_timeout(Some(POLL_INTERVAL)).map_err(ConnectError::Start)?;
        }
        let heard = first_state(&state, port, drone.ip(), LISTENING).ok();
        if heard.is_some_and(|first| is_flying(&state, drone.ip(), &first)) {
            return Err(ConnectError::Flies);
        }
        let command = command_socket(settings.local)?;
        command.connect(drone).map_err(|source| ConnectError::Unreachable { drone, source })?;
        command.set_read_timeout(Some(POLL_INTERVAL)).map_err(ConnectError::Start)?;
        enter(&command, drone, stopped)?;
        let first = first_state(&state, port, drone.ip(), STATE_WAIT)?;
        if heard.is_none() && is_flying(&state, drone.ip(), &first) {
            return Err(ConnectError::Flies);
        }
        for _ in 0..TRIES {
            if stopped() {
                break;
            }
            command.send(START).map_err(|source| ConnectError::Unreachable { drone, source })?;
            let mut answer = Answer::Noise;
            receive(&command, drone.ip(), ANSWER_WAIT, |bytes| {
                answer = Answer::read(bytes);
                matches!(answer, Answer::Ok | Answer::Refused(_))
            });
            match answer {
                Answer::Ok => {
                    let (requested, buffer) = (Instant::now(), [0; intake::BUFFER]);
                    // From here on it is asked for the state without waiting.
                    state.set_nonblocking(true).map_err(ConnectError::Start)?;
                    let motors = Motors { time: first.motor_time, flies: false };
                    return Ok(Self { command, video, state, drone, requested, motors, buffer });
                }
                Answer::Refused(answer) => {
                    let meaning = explain(&answer);
                    return Err(ConnectError::Refused { command: "streamon", answer, meaning });
                }
                _ => {}
            }
        }
        Err(ConnectError::NoAnswer { drone })
    }

    /// The next datagram of the video; `None` if none came for a moment.
    pub fn receive(&mut self) -> Option<&[u8]> {
        intake::receive(&self.video, self.drone.ip(), intake::VIDEO, &mut self.buffer)
    }

    /// Whether its motors have turned, or it was above the ground, since the connection: somebody else flies it.
    pub fn flies(&mut self) -> bool {
        let mut buffer = [0; intake::BUFFER];
        while let Ok((length, from)) = self.state.recv_from(&mut buffer) {
            if intake::accepts(from.ip(), self.drone.ip(), length, intake::TEXT)
                && let Some(state) = State::read(&buffer[..length])
            {
                self.motors.observe(&state);
            }
        }
        self.motors.flies
    }

    /// Requests a key frame after a loss, as [`Tello`](super::Tello) does, at most twice a second. One that flies is not asked.
    pub fn request_key_frame(&mut self) {
        if self.requested.elapsed() >= REQUEST_INTERVAL && !self.flies() {
            self.requested = Instant::now();
            // One that is lost is followed by another.
            drop(self.command.send(START));
        }
    }
}

impl Drop for VideoLink {
    fn drop(&mut self) {
        // Nobody is listening any more.
        if !self.flies() {
            drop(self.command.send(b"streamoff"));
        }
    }
}

/// Whether a drone that stood on the ground has begun to fly.
struct Motors {
    time: Option<u32>,
    flies: bool,
}

impl Motors {
    fn observe(&mut self, state: &State) {
        let turn = match (self.time, state.motor_time) {
            (Some(before), Some(time)) => before != time,
            // A firmware without a motor time.
            (None, None) => state.height.is_some_and(|height| height >= ABOVE_GROUND),
            _ => false,
        };
        self.time = state.motor_time.or(self.time);
        self.flies |= turn;
    }
}

/// The local socket of the video.
pub(super) fn video_socket(settings: &TelloSettings) -> Result<UdpSocket, ConnectError> {
    let video = bind(settings.local, settings.video_port, "video")?;
    // A small buffer loses video when this machine is busy; a system that grants less reports it nowhere else.
    if let Err(error) = socket2::SockRef::from(&video).set_recv_buffer_size(VIDEO_BUFFER) {
        tracing::debug!(%error, "cannot enlarge the receive buffer of the video socket");
    }
    Ok(video)
}

#[cfg(test)]
mod tests {
    use std::net::{IpAddr, Ipv4Addr};
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU32, Ordering};
    use std::thread::JoinHandle;

    use super::*;
    use crate::address::own_address;

    /// Height in centimetres, and the motor time, of a drone that obeys every command.
    #[derive(Default)]
    struct Shown {
        height: AtomicU32,
        time: AtomicU32,
        ended: AtomicU32,
    }

    /// A drone that sends its state to this address every 20 ms, whether or not it was asked for it; it returns what it was told.
    fn drone(shown: &Arc<Shown>, client: SocketAddr) -> (SocketAddr, JoinHandle<Vec<String>>) {
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        socket.set_read_timeout(Some(Duration::from_millis(20))).unwrap();
        let (address, shown) = (socket.local_addr().unwrap(), shown.clone());
        let run = move || {
            let (mut told, mut buffer) = (Vec::new(), [0; 100]);
            while shown.ended.load(Ordering::Relaxed) == 0 {
                let (height, time) = (shown.height.load(Ordering::Relaxed), shown.time.load(Ordering::Relaxed));
                let line = format!("pitch:0;roll:0;yaw:0;tof:{height};h:{height};bat:80;time:{time};\r\n");
                socket.send_to(line.as_bytes(), client).unwrap();
                if let Ok((length, from)) = socket.recv_from(&mut buffer) {
                    told.push(String::from_utf8_lossy(&buffer[..length]).into_owned());
                    let answer = if told.last().is_some_and(|word| word.ends_with('?')) { "error" } else { "ok" };
                    socket.send_to(answer.as_bytes(), from).unwrap();
                }
            }
            told
        };
        (address, std::thread::spawn(run))
    }

    /// Settings with ports of its own, and where the state arrives.
    fn settings() -> (TelloSettings, SocketAddr) {
        let (state, video) = (own_address(), own_address());
        let local = IpAddr::V4(*state.ip());
        let settings = TelloSettings { local, state_port: state.port(), video_port: video.port(), ..TelloSettings::default() };
        (settings, SocketAddr::V4(state))
    }

    #[test]
    fn nothing_is_sent_to_a_drone_that_flies() {
        let ((settings, client), shown) = (settings(), Arc::<Shown>::default());
        shown.height.store(80, Ordering::Relaxed);
        let (address, running) = drone(&shown, client);
        let motors = shown.clone();
        let turning = std::thread::spawn(move || {
            while motors.ended.load(Ordering::Relaxed) == 0 {
                motors.time.fetch_add(1, Ordering::Relaxed);
                std::thread::sleep(Duration::from_millis(200));
            }
        });
        let refused = VideoLink::connect(address, &settings, &|| false);
        shown.ended.store(1, Ordering::Relaxed);
        turning.join().unwrap();
        assert!(matches!(refused, Err(ConnectError::Flies)), "{:?}", refused.err());
        assert_eq!(running.join().unwrap(), Vec::<String>::new());
    }

    #[test]
    fn one_that_takes_off_is_asked_for_nothing_more() {
        let ((settings, client), shown) = (settings(), Arc::<Shown>::default());
        let (address, running) = drone(&shown, client);
        let mut link = VideoLink::connect(address, &settings, &|| false).unwrap();
        assert!(matches!(VideoLink::connect(address, &settings, &|| false), Err(ConnectError::InUse { .. })));
        std::thread::sleep(REQUEST_INTERVAL);
        link.request_key_frame();
        assert!(!link.flies());
        shown.time.store(1, Ordering::Relaxed);
        let begun = Instant::now();
        while !link.flies() {
            assert!(begun.elapsed() < Duration::from_secs(20));
            std::thread::sleep(Duration::from_millis(5));
        }
        std::thread::sleep(REQUEST_INTERVAL);
        link.request_key_frame();
        drop(link);
        shown.ended.store(1, Ordering::Relaxed);
        let told = running.join().unwrap();
        let asked = |what: &str| told.iter().filter(|word| *word == what).count();
        assert_eq!((asked("streamon"), asked("streamoff")), (2, 0), "{told:?}");
    }

    #[test]
    fn nothing_more_is_sent_once_nobody_waits() {
        let ((settings, client), shown) = (settings(), Arc::<Shown>::default());
        let (address, running) = drone(&shown, client);
        assert!(matches!(VideoLink::connect(address, &settings, &|| true), Err(ConnectError::NoAnswer { .. })));
        std::thread::sleep(Duration::from_millis(200));
        shown.ended.store(1, Ordering::Relaxed);
        assert_eq!(running.join().unwrap(), Vec::<String>::new());
    }

    #[test]
    fn one_on_the_ground_is_told_that_nobody_looks_any_more() {
        let ((settings, client), shown) = (settings(), Arc::<Shown>::default());
        let (address, running) = drone(&shown, client);
        drop(VideoLink::connect(address, &settings, &|| false).unwrap());
        std::thread::sleep(Duration::from_millis(200));
        shown.ended.store(1, Ordering::Relaxed);
        assert_eq!(running.join().unwrap().last().unwrap(), "streamoff");
    }
}
