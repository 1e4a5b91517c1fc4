//! The protocol: responses and their timing.

mod tasks;

use std::net::{IpAddr, SocketAddr};

use spf_core::command::{Command, Setpoint};
use spf_core::rng::RandomStream;
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time, duration_from_secs};
use spf_sim::craft::SimCraft;

use super::command::{Malformed, Read, Request, parse};
use super::figures::{Firmware, ProtocolParameters};
use super::link::Link;
use super::manoeuvre::CONTROL;
use super::state::State;
use crate::fault::{CraftFault, FaultMachine, Stream};
use tasks::{Conditions, Ended, Tasks};

/// Default ports of clients for state and video.
const STATE_PORT: u16 = 8890;
const VIDEO_PORT: u16 = 11_111;
/// The speed configured at power-on, cm/s.
const DEFAULT_SPEED: i32 = 100;
/// Delay of the stopped manoeuvre's response after `stop`, s.
const FORCED_STOP: f64 = 0.5;
/// Duration of a restart, s.
const BOOT: f64 = 8.0;
/// Temperatures, °C: at power-on, and the limits in flight and on the ground with motors off; time constants, s.
const COLD: f64 = 45.0;
const FLYING_HEAT: (f64, f64) = (65.0, 120.0);
const LYING_HEAT: (f64, f64) = (78.0, 400.0);

/// Largest error of the accelerometer, 0.001 g.
const ACCELEROMETER_NOISE: f64 = 2.0;

/// A datagram to send.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Output {
    /// The response to a command, from the command port.
    Response {
        /// Destination.
        to: SocketAddr,
        /// Contents.
        bytes: Vec<u8>,
    },
    /// A state line, from any port of the drone's address.
    State {
        /// Destination.
        to: SocketAddr,
        /// Contents.
        bytes: Vec<u8>,
    },
}

/// Destination and format of the video.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VideoRequest {
    /// Destination.
    pub to: SocketAddr,
    /// Frames per second.
    pub fps: u32,
    /// Whether the size is halved.
    pub low_resolution: bool,
    /// Whether the downward camera is used.
    pub downwards: bool,
    /// Number of `streamon` commands; each starts with a key frame.
    pub stream_number: u32,
}

/// The protocol of one virtual Tello. Sans-IO; see the [module](super).
#[derive(Debug)]
pub struct VirtualTello {
    figures: ProtocolParameters,
    firmware: Firmware,
    rng: RandomStream,
    seed: u64,
    link: Link,
    /// The last client that sent `command`.
    client: Option<IpAddr>,
    ports: (u16, u16),
    stream: Option<VideoRequest>,
    /// Number of `streamon` commands.
    streams: u32,
    pads: bool,
    speed: i32,
    tasks: Tasks,
    last_command: Time,
    datum: f64,
    temperature: f64,
    motor_time: f64,
    next_state: Time,
    next_control: Time,
    booted: Time,
    /// The state when the reported height became stuck.
    stuck: Option<State>,
}

impl VirtualTello {
    /// A Tello switched on now, at the craft's time. Random errors depend on `seed`.
    #[must_use]
    pub fn new(craft: &SimCraft, figures: ProtocolParameters, firmware: Firmware, faults: FaultMachine, seed: u64) -> Self {
        let now = craft.time();
        Self {
            figures,
            firmware,
            rng: RandomStream::new(seed, "virtual tello", &[]),
            seed,
            link: Link::new(faults),
            client: None,
            ports: (STATE_PORT, VIDEO_PORT),
            stream: None,
            streams: 0,
            pads: false,
            speed: DEFAULT_SPEED,
            tasks: Tasks::new(now),
            last_command: now,
            datum: craft.dynamics().pose().attitude.heading,
            temperature: COLD,
            motor_time: 0.0,
            next_state: now,
            next_control: now,
            booted: now,
            stuck: None,
        }
    }

    /// Sets new faults.
    pub fn set_faults(&mut self, faults: FaultMachine) {
        self.link.set_faults(faults);
    }

    /// The current faults.
    #[must_use]
    pub fn faults(&self) -> &FaultMachine {
        self.link.faults()
    }

    /// Destination and format of the video; `None` if no client wants it.
    #[must_use]
    pub fn video(&self) -> Option<VideoRequest> {
        self.stream
    }

    /// When [`advance`](Self::advance) is next needed.
    #[must_use]
    pub fn next_deadline(&self) -> Time {
        self.link.next_at().unwrap_or(Time::MAX).min(self.next_control).min(self.next_state)
    }

    /// Handles a datagram to the command port.
    pub fn handle(&mut self, now: Time, from: SocketAddr, datagram: &[u8]) {
        self.link.send(now, Stream::Commands, from, datagram);
    }

    /// Advances to `now`: simulates the craft and executes commands that have arrived.
    pub fn advance(&mut self, now: Time, craft: &mut SimCraft) {
        loop {
            let due = self.next_control.min(self.next_state);
            while let Some(packet) = self.link.take(now.min(due), |stream| stream == Stream::Commands) {
                craft.advance_to(packet.at);
                self.obey(packet.at, packet.peer, &packet.bytes, craft);
            }
            if due > now {
                craft.advance_to(now);
                return;
            }
            craft.advance_to(due);
            if self.next_control <= due {
                self.control(due, craft);
                self.next_control = due + CONTROL;
            }
            if self.next_state <= due {
                self.send_state(due, craft);
                self.next_state = due + duration_from_secs(self.figures.state_period);
            }
        }
    }

    /// The next datagram to send at `now`.
    pub fn poll(&mut self, now: Time) -> Option<Output> {
        let packet = self.link.take(now, |stream| stream != Stream::Commands)?;
        let (to, bytes) = (packet.peer, packet.bytes);
        Some(if packet.stream == Stream::Telemetry { Output::State { to, bytes } } else { Output::Response { to, bytes } })
    }

    fn answer(&mut self, at: Time, to: SocketAddr, text: &str) {
        self.link.send(at, Stream::Responses, to, text.as_bytes());
    }

    fn answer_quickly(&mut self, now: Time, to: SocketAddr, text: &str) {
        let after = self.figures.quick(&mut self.rng);
        self.answer(now + after, to, text);
    }

    fn refuse(&mut self, now: Time, to: SocketAddr, text: &str) {
        self.answer(now + duration_from_secs(self.figures.refusal), to, text);
    }

    fn obey(&mut self, now: Time, from: SocketAddr, datagram: &[u8], craft: &mut SimCraft) {
        if now < self.booted {
            return;
        }
        let request = parse(datagram, self.firmware);
        if request == Ok(Request::Sdk) {
            self.last_command = now;
            self.client = Some(from.ip());
            self.next_state = self.next_state.min(now + Duration::from_millis(10));
            return self.answer_quickly(now, from, "ok");
        }
        // Before `command` it uses another protocol.
        if self.client.is_none() {
            return;
        }
        match request {
            Ok(request) => {
                self.last_command = now;
                self.run(now, from, request, craft);
            }
            Err(Malformed::Noise) => {}
            Err(malformed) => {
                self.last_command = now;
                if let Some(answer) = malformed.answer() {
                    self.refuse(now, from, &answer);
                }
            }
        }
    }

    fn run(&mut self, now: Time, from: SocketAddr, request: Request, craft: &mut SimCraft) {
        match request {
            Request::Rc(sticks) => return self.rc(now, sticks, craft),
            Request::Emergency => {
                self.tasks.drop_running();
                craft.apply(now, Command::EmergencyStop, Time::MAX);
                return;
            }
            Request::Stop => return self.stop(now, from, craft),
            Request::Read(read) => {
                let text = format!("{}\r\n", self.reading(read, craft));
                return self.answer_quickly(now, from, &text);
            }
            Request::Stream(on) => {
                let to = SocketAddr::new(from.ip(), self.ports.1);
                self.streams += u32::from(on);
                let wish = VideoRequest { to, fps: 30, low_resolution: false, downwards: false, stream_number: self.streams };
                self.stream = on.then_some(wish);
            }
            Request::Speed(speed) => self.speed = speed,
            Request::Pads(on) => self.pads = on,
            Request::PadDirection if !self.pads => return self.refuse(now, from, "error"),
            Request::Ports(state, video) => {
                self.ports = (state, video);
                self.change_video(|wish| wish.to.set_port(video));
            }
            Request::Fps(fps) => self.change_video(|wish| wish.fps = fps),
            Request::LowResolution(low) => self.change_video(|wish| wish.low_resolution = low),
            Request::DownVision(on) => self.change_video(|wish| wish.downwards = on),
            Request::Reboot { answers } => {
                if answers {
                    self.answer_quickly(now, from, "ok,drone will reboot");
                }
                return self.restart(now, craft);
            }
            Request::Extension(text) => return self.answer_quickly(now, from, text),
            // Propellers are not visible, and throwing is not simulated.
            Request::Motor(_) if craft.dynamics().phase() != FlightPhase::OnGround => return self.refuse(now, from, "error"),
            Request::ThrowFly => return self.refuse(now, from, "error"),
            Request::Sdk | Request::PadDirection | Request::VideoSetting | Request::Acknowledge | Request::Motor(_) => {}
            Request::TakeOff
            | Request::Land
            | Request::Move(..)
            | Request::Turn(_)
            | Request::Flip(_)
            | Request::Go { .. }
            | Request::Curve { .. }
            | Request::OverPad => return self.begin(now, from, request, craft),
        }
        self.answer_quickly(now, from, "ok");
    }

    /// Handles a motion command: it is refused, or starts.
    fn begin(&mut self, now: Time, from: SocketAddr, request: Request, craft: &mut SimCraft) {
        let (faults, rng) = (self.link.faults(), &mut self.rng);
        let mut given = Conditions { figures: &self.figures, faults, speed: self.speed, rng };
        if let Err(why) = self.tasks.begin(now, from, request, craft, &mut given) {
            self.refuse(now, from, why);
        }
    }

    fn change_video(&mut self, change: impl FnOnce(&mut VideoRequest)) {
        if let Some(request) = &mut self.stream {
            change(request);
        }
    }

    /// Stick positions hold until replaced. A position command in progress is not affected.
    fn rc(&mut self, now: Time, [right, forward, up, clockwise]: [i32; 4], craft: &mut SimCraft) {
        if self.tasks.is_running() || craft.dynamics().phase() == FlightPhase::Landing {
            return;
        }
        let ProtocolParameters { stick_speed, stick_climb, stick_sink, stick_yaw, .. } = self.figures;
        let fraction = |stick: i32| f64::from(stick) * 0.01;
        let vertical = if up > 0 { stick_climb } else { stick_sink };
        let setpoint = Setpoint {
            right: fraction(right) * stick_speed,
            forward: fraction(forward) * stick_speed,
            up: fraction(up) * vertical,
            yaw_rate: fraction(clockwise) * stick_yaw,
        };
        craft.apply(now, Command::Setpoint(setpoint), Time::MAX);
    }

    fn stop(&mut self, now: Time, from: SocketAddr, craft: &mut SimCraft) {
        if matches!(craft.dynamics().phase(), FlightPhase::Flying | FlightPhase::Landing) {
            craft.apply(now, Command::Setpoint(Setpoint::HOLD), Time::MAX);
            if let Some(to) = self.tasks.stop() {
                self.answer(now + duration_from_secs(FORCED_STOP), to, "forced stop");
            }
        }
        self.answer_quickly(now, from, "ok");
    }

    fn restart(&mut self, now: Time, craft: &mut SimCraft) {
        craft.apply(now, Command::EmergencyStop, Time::MAX);
        self.booted = now + duration_from_secs(BOOT);
        self.tasks.drop_running();
        (self.client, self.stream) = (None, None);
        (self.ports, self.pads, self.speed) = ((STATE_PORT, VIDEO_PORT), false, DEFAULT_SPEED);
        self.datum = craft.dynamics().pose().attitude.heading;
    }

    /// Every [`CONTROL`]: the current manoeuvre, automatic landing, temperature.
    fn control(&mut self, now: Time, craft: &mut SimCraft) {
        let seconds = CONTROL.as_secs_f64();
        let flying = craft.dynamics().airborne();
        let (towards, time) = if flying { FLYING_HEAT } else { LYING_HEAT };
        self.temperature += (towards - self.temperature) * seconds / time;
        if flying {
            self.motor_time += seconds;
        }
        if !self.faults().has_fault(now, CraftFault::HeightStuck) {
            self.stuck = None;
        } else if self.stuck.is_none() {
            self.stuck = Some(self.state(craft));
        }
        if self.faults().has_fault(now, CraftFault::Reboot) && now >= self.booted {
            self.restart(now, craft);
        }
        if let Some(Ended { at, to, text }) = self.tasks.go_on(now, craft, &self.figures) {
            self.answer(at, to, text);
        }
        if self.tasks.is_running() {
            self.last_command = now;
        }
        let idle = now.since(self.last_command) >= duration_from_secs(self.figures.idle_landing);
        let empty = self.faults().has_fault(now, CraftFault::BatteryEmpty);
        if craft.dynamics().phase() == FlightPhase::Flying && (empty || (idle && !self.tasks.is_running())) {
            if let Some(to) = self.tasks.drop_running() {
                self.refuse(now, to, "error Auto land");
            }
            craft.apply(now, Command::Land, Time::MAX);
        }
    }

    /// The state as reported, with the faults of the sensors.
    fn state(&self, craft: &SimCraft) -> State {
        let state = State::of(craft, self.datum, self.pads, self.temperature, self.motor_time);
        let has = |fault| self.faults().has_fault(craft.time(), fault);
        let battery = if has(CraftFault::BatteryEmpty) { state.battery.min(4) } else { state.battery };
        let attitude = state.attitude.filter(|_| !has(CraftFault::ImuLost));
        let [_, _, down] = state.speed;
        let speed = if has(CraftFault::SpeedZero) { [0, 0, down] } else { state.speed };
        let state = State { battery, attitude, speed, ..state };
        self.stuck.map_or(state, |stuck| state.with_height_of(&stuck))
    }

    fn send_state(&mut self, now: Time, craft: &SimCraft) {
        let Some(client) = self.client.filter(|_| now >= self.booted) else { return };
        let mut state = self.state(craft);
        // No two lines of a real drone are equal. A stream of its own, so that nothing else depends on how many were sent.
        let mut noise = RandomStream::new(self.seed, "accelerometer", &[now.as_nanos()]);
        state.acceleration.iter_mut().for_each(|axis| *axis += ACCELEROMETER_NOISE * (2.0 * noise.uniform() - 1.0));
        let line = state.line(self.firmware);
        self.link.send(now, Stream::Telemetry, SocketAddr::new(client, self.ports.0), line.as_bytes());
    }

    fn reading(&self, read: Read, craft: &SimCraft) -> String {
        let state = self.state(craft);
        let temperature = libm::round(state.temperature);
        match read {
            Read::Battery => state.battery.to_string(),
            Read::Speed => format!("{}.0", self.speed),
            Read::Time => format!("{}s", state.motor_time),
            Read::Wifi => "90".to_owned(),
            Read::Sdk => if self.firmware == Firmware::V30 { "30" } else { "20" }.to_owned(),
            Read::Serial => "0TQSIM00000001".to_owned(),
            Read::Height => format!("{}dm", state.height / 10),
            Read::Temperature => format!("{}~{}C", temperature - 1.0, temperature + 1.0),
            Read::Attitude => state.attitude_text(),
            Read::Barometer => format!("{:.6}", state.barometer),
            Read::Acceleration => {
                let [x, y, z] = state.acceleration;
                format!("agx:{x:.2};agy:{y:.2};agz:{z:.2};")
            }
            Read::Tof => format!("{}mm", state.tof * 10),
            Read::Hardware => "TELLO".to_owned(),
            Read::WifiVersion => "1.3.0.0".to_owned(),
            Read::Ap => String::new(),
            Read::Ssid => "TELLO-SIM001".to_owned(),
            Read::ExtTof => format!("tof {}", if state.tof > 800 { 8192 } else { state.tof * 10 }),
            Read::ExtVersion => "esp32v1.0.0.0".to_owned(),
        }
    }
}
