//! A vehicle with its link and threads.

use std::panic::AssertUnwindSafe;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, JoinHandle};
use std::time::Instant;

use spf_core::camera::Camera;
use spf_core::command::Command;
use spf_core::craft::Craft;
use spf_core::envelope::Cleared;
use spf_core::estimator::TelemetryAccuracy;
use spf_core::time::{Duration, Time};
use spf_mavlink::link::Link;
use spf_mavlink::modes::Autopilot;
use spf_mavlink::url::MavlinkUrl;
use spf_mavlink::wire::{Decoder, Encoder, LinkStats, Sequence};

use super::opening::{ConnectError, Found, find};
use super::settings::MavlinkSettings;
use super::vehicle::{Facts, Notice, Vehicle};
use crate::abandon::{self, EmergencyLand};
use crate::frames::{FrameStore, Frames};
use crate::{Capabilities, Drone, DroneError, DroneEvent};

/// Interval at which due transmissions are looked for.
const SEND_INTERVAL: Duration = Duration::from_millis(5);
/// Maximum wait for attitude, position and parameters.
const STATE_WAIT: Duration = Duration::from_secs(8);
/// Time allowed for a landing at shutdown: from 30 m at 0.7 m/s.
const LANDING_TIME: Duration = Duration::from_secs(45);
/// Standard deviation of the horizontal position that is assumed, and its bounds, metres.
const ACCURACY: f64 = 0.3;
const ACCURACIES: (f64, f64) = (0.05, 3.0);

/// A return that ends farther from home than this is warned of, metres.
const NEAR_HOME: f64 = 3.0;
/// Acceleration of a craft whose autopilot does not tell, m/s².
const ACCELERATION: f64 = 2.0;

/// State shared by the threads.
struct Shared {
    vehicle: Mutex<Vehicle>,
    /// Held while sending, so that frames leave in the order of their numbers.
    encoder: Mutex<Encoder>,
    stats: Mutex<LinkStats>,
    link: Link,
    target: [u8; 2],
    start: Instant,
    stopped: AtomicBool,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // The value is consistent between calls.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Shared {
    fn now(&self) -> Time {
        Time::ZERO + self.start.elapsed()
    }

    fn vehicle(&self) -> MutexGuard<'_, Vehicle> {
        lock(&self.vehicle)
    }

    /// Sends what is due, and tells the user what there is to tell.
    fn flush(&self) {
        let mut encoder = lock(&self.encoder);
        let next = || self.vehicle().poll(self.now());
        while let Some(outgoing) = next() {
            tracing::trace!(?outgoing, "to the vehicle");
            self.link.send(&encoder.frame(&outgoing.body(self.target, self.now())));
        }
        drop(encoder);
        let notice = || self.vehicle().take_notice();
        while let Some(notice) = notice() {
            tell(&notice);
        }
    }
}

fn tell(notice: &Notice) {
    match notice {
        Notice::Refused { what, result, texts } => {
            let words = if texts.is_empty() { "without a reason".to_owned() } else { format!("it says: {}", texts.join("; ")) };
            tracing::error!("the autopilot refused {what} ({}), {words}", result.words());
        }
        Notice::Says { severity, text } => match severity {
            0..=3 => tracing::error!("the autopilot: {text}"),
            4 => tracing::warn!("the autopilot: {text}"),
            _ => tracing::info!("the autopilot: {text}"),
        },
        Notice::LetGo { mode } => tracing::error!(
            "the flight mode is now {mode}, which was not commanded here: another station, the RC transmitter or a failsafe has control, \
             and nothing more is sent"
        ),
        Notice::NotOurs { what } => {
            tracing::error!(
                "no {what} is commanded: another station, the RC transmitter or a failsafe has control, until you resume (r)"
            )
        }
        Notice::UnknownHeight => tracing::error!(
            "no take-off: PX4 climbs to MIS_TAKEOFF_ALT, which could not be read, so that it cannot be checked against \
             --max-altitude; connect again, or improve the link"
        ),
        Notice::Returned { off: Some(off) } if *off > NEAR_HOME => {
            tracing::warn!("the craft has returned, landed and disarmed, {off:.1} m from its home position")
        }
        Notice::Returned { off } => {
            let off = off.map_or(String::new(), |off| format!(", {off:.1} m from its home position"));
            tracing::info!("the craft has returned, landed and disarmed{off}");
        }
        Notice::TakingBack { mode } => tracing::warn!("the operator takes control back from {mode}"),
        Notice::Unattended { landing: false } => tracing::error!("the flight loop was silent for 2 s: the craft hovers"),
        Notice::Unattended { landing: true } => tracing::error!("the flight loop was silent for 5 s: landing the craft"),
        Notice::Failed => tracing::error!("a part of the MAVLink driver failed: landing the craft"),
    }
}

impl EmergencyLand for Shared {
    fn abandon(&self) {
        let now = self.now();
        self.vehicle().leave(now);
        let begun = Instant::now();
        while self.vehicle().is_ours() {
            if begun.elapsed() >= LANDING_TIME {
                tracing::error!("the craft did not report a landing within {} s", LANDING_TIME.as_secs());
                return;
            }
            self.flush();
            std::thread::sleep(SEND_INTERVAL);
        }
    }
}

/// A PX4 or ArduPilot behind the [`Drone`] interface. It has no camera of its own.
pub struct MavlinkCraft {
    shared: Arc<Shared>,
    frames: FrameStore,
    accuracy: f64,
    threads: Vec<JoinHandle<()>>,
    polled: Time,
}

impl MavlinkCraft {
    /// Connects to the autopilot at an address, and watches it: nothing is commanded until [`engage`](Self::engage). `start` is
    /// flight time zero.
    ///
    /// # Errors
    /// [`ConnectError`] if the link cannot be opened, or nothing usable arrives.
    pub fn connect(url: &MavlinkUrl, settings: MavlinkSettings, start: Instant) -> Result<Self, ConnectError> {
        let link = Link::open(url)?;
        let mut decoder = Decoder::default();
        let found = find(url, &link, &mut decoder, settings, craft().take_off_height, start)?;
        let Found { system, component, vehicle, encoder } = found;
        let autopilot = vehicle.facts().autopilot.name();
        let shared = Arc::new(Shared {
            vehicle: Mutex::new(vehicle),
            encoder: Mutex::new(encoder),
            stats: Mutex::default(),
            link,
            target: [system, component],
            start,
            stopped: AtomicBool::new(false),
        });
        let mut craft = Self {
            shared: shared.clone(),
            frames: FrameStore::default(),
            accuracy: ACCURACY,
            threads: Vec::new(),
            polled: Time::ZERO,
        };
        let (one, two) = (shared.clone(), shared.clone());
        craft.spawn("receiver", move || receive(&one, decoder))?;
        craft.spawn("sender", move || {
            while !two.stopped.load(Ordering::Relaxed) {
                two.flush();
                std::thread::sleep(SEND_INTERVAL);
            }
        })?;
        let begun = Instant::now();
        loop {
            let now = shared.now();
            let vehicle = shared.vehicle();
            let flown = vehicle.is_oriented(now) && vehicle.is_placed();
            if flown && (vehicle.is_read() || begun.elapsed() >= STATE_WAIT) {
                break;
            }
            if begun.elapsed() >= STATE_WAIT {
                let texts = vehicle.facts().last_words();
                return Err(ConnectError::NoPosition { url: url.clone(), autopilot, wait: STATE_WAIT.as_secs(), texts });
            }
            drop(vehicle);
            std::thread::sleep(SEND_INTERVAL);
        }
        let known = shared.vehicle().facts().clone();
        let said = known.position_error.or(known.gps.and_then(|gps| gps.accuracy));
        craft.accuracy = said.map_or(ACCURACY, |said| said.clamp(ACCURACIES.0, ACCURACIES.1));
        Ok(craft)
    }

    /// Begins to fly it: until then it is only watched. From here on it is landed if the program ends.
    pub fn engage(&self) {
        let now = self.shared.now();
        let alone = !lock(&self.shared.stats).other_stations;
        let mut vehicle = self.shared.vehicle();
        let (mode, flying) = (vehicle.mode(), vehicle.is_flying());
        let flown = vehicle.engage(now, alone);
        drop(vehicle);
        abandon::register(&(self.shared.clone() as Arc<dyn EmergencyLand>));
        match (flying, flown) {
            (true, true) => {
                tracing::warn!("the craft hovers in {mode} without a program that flies it: it is flown from where it is")
            }
            (true, false) => tracing::error!(
                "the craft is in the air in {mode}: somebody may have paused it, or flies it, so that nothing is sent until you \
                 resume (r)"
            ),
            _ => {}
        }
    }

    fn spawn(&mut self, name: &str, work: impl FnOnce() + Send + 'static) -> Result<(), ConnectError> {
        let shared = self.shared.clone();
        let guarded = move || {
            // A panic must not leave the craft with its last velocity. The message was printed where it happened.
            if std::panic::catch_unwind(AssertUnwindSafe(work)).is_err() {
                let now = shared.now();
                shared.vehicle().fail(now);
                // This thread may have been the one that sends.
                while !shared.stopped.load(Ordering::Relaxed) {
                    shared.flush();
                    std::thread::sleep(SEND_INTERVAL);
                }
            }
        };
        self.threads.push(Builder::new().name(format!("mavlink {name}")).spawn(guarded).map_err(ConnectError::Start)?);
        Ok(())
    }

    /// What is known about it.
    #[must_use]
    pub fn facts(&self) -> Facts {
        self.shared.vehicle().facts().clone()
    }

    /// Its flight mode, and whether it is in the air.
    #[must_use]
    pub fn state(&self) -> (spf_mavlink::modes::Mode, bool) {
        let vehicle = self.shared.vehicle();
        (vehicle.mode(), vehicle.is_flying())
    }

    /// What the link delivered so far.
    #[must_use]
    pub fn link_stats(&self) -> LinkStats {
        *lock(&self.shared.stats)
    }

    /// Number of setpoints sent.
    #[must_use]
    pub fn setpoints_sent(&self) -> u64 {
        self.shared.vehicle().setpoints_sent()
    }
}

/// The craft that is assumed: a general quadrotor.
pub(super) fn craft() -> Craft {
    Craft::quad()
}

/// The craft with the limits that its autopilot sets, metres and seconds. Its acceleration decides where it comes to rest: one that
/// is unknown counts as low.
fn limited(usual: Craft, facts: &Facts, take_off_height: Option<f64>) -> Craft {
    // ArduPilot's are in cm.
    let (names, unit) = match facts.autopilot {
        Autopilot::Px4 => (["MPC_XY_VEL_MAX", "MPC_Z_VEL_MAX_UP", "MPC_Z_VEL_MAX_DN", "MPC_ACC_HOR"], 1.0),
        Autopilot::ArduPilot => (["WPNAV_SPEED", "WPNAV_SPEED_UP", "WPNAV_SPEED_DN", "WPNAV_ACCEL"], 0.01),
    };
    let [level, up, down, acceleration] =
        names.map(|name| facts.parameter(name).map(|value| value.abs() * unit).filter(|value| *value > 0.0));
    let vertical = up.unwrap_or(f64::INFINITY).min(down.unwrap_or(f64::INFINITY));
    Craft {
        cruise_speed: usual.cruise_speed.min(level.unwrap_or(f64::INFINITY)),
        climb_speed: usual.climb_speed.min(vertical),
        acceleration: usual.acceleration.min(acceleration.unwrap_or(ACCELERATION)),
        take_off_height: take_off_height.unwrap_or(usual.take_off_height),
        return_height: facts.return_height().ok(),
        ..usual
    }
}

fn receive(shared: &Shared, mut decoder: Decoder) {
    let mut buffer = [0; spf_mavlink::link::LONGEST];
    let mut sequence = Sequence::default();
    while !shared.stopped.load(Ordering::Relaxed) {
        let (length, restarts) = shared.link.receive(&mut buffer);
        if restarts {
            decoder.clear();
        }
        decoder.push(&buffer[..length]);
        while let Some(packet) = decoder.next_packet() {
            if [packet.system, packet.component] != shared.target {
                if packet.is_ground_station() {
                    lock(&shared.stats).other_stations = true;
                }
                continue;
            }
            // What came twice, or was overtaken: an old heartbeat would look like another station's change of mode.
            if !sequence.accept(packet.sequence, &mut lock(&shared.stats)) {
                continue;
            }
            let now = shared.now();
            shared.vehicle().handle(now, &packet.report());
        }
    }
}

impl Drop for MavlinkCraft {
    fn drop(&mut self) {
        self.shared.abandon();
        self.shared.stopped.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            drop(thread.join());
        }
    }
}

impl Drone for MavlinkCraft {
    fn name(&self) -> &str {
        "mavlink"
    }

    fn capabilities(&self) -> Capabilities {
        let senses = TelemetryAccuracy { position_noise: self.accuracy, ..TelemetryAccuracy::quad() };
        let vehicle = self.shared.vehicle();
        let craft = limited(craft(), vehicle.facts(), vehicle.climbs_to());
        drop(vehicle);
        Capabilities { position: true, ..Capabilities::of(craft, Camera::quad(), senses) }
    }

    fn frames(&self) -> Arc<dyn Frames> {
        Arc::new(self.frames.clone())
    }

    fn apply(&mut self, _now: Time, command: &Cleared<Command>) -> Result<(), DroneError> {
        // Use the link's clock, not the loop's: a setpoint expires on time however late it arrives here.
        let now = self.shared.now();
        let mut vehicle = self.shared.vehicle();
        vehicle.heartbeat(now);
        vehicle.apply(now, command);
        Ok(())
    }

    fn next_event(&mut self, until: Time) -> Option<(Time, DroneEvent)> {
        self.polled = until;
        let now = self.shared.now();
        let mut vehicle = self.shared.vehicle();
        vehicle.heartbeat(now);
        vehicle.take_event()
    }

    fn resume(&mut self, _now: Time) {
        self.shared.vehicle().resume();
    }

    /// Unknown for a real craft; it is polled at this interval.
    fn next_event_at(&self) -> Option<Time> {
        Some(self.polled + SEND_INTERVAL)
    }
}

#[cfg(test)]
mod tests {
    use spf_mavlink::modes::Mode;
    use spf_mavlink::report::Report;

    use super::*;

    #[test]
    fn the_autopilot_s_own_limits_are_those_of_the_craft() {
        let facts = |mode: Mode, parameters: &[(&str, f32)]| {
            let mut vehicle = Vehicle::new(Time::ZERO, mode, [1, 191], 3.0, false);
            for (name, field) in parameters {
                vehicle.handle(Time::ZERO, &Report::Parameter { name: (*name).to_owned(), field: *field, kind: 9 });
            }
            vehicle.facts().clone()
        };
        let (px4, copter) = (Autopilot::Px4.hold(), Autopilot::ArduPilot.hold());
        let of = |facts: &Facts| {
            let it = limited(Craft::quad(), facts, None);
            [it.cruise_speed, it.climb_speed, it.acceleration, it.take_off_height]
        };
        assert_eq!(of(&facts(px4, &[])), [3.0, 1.0, 2.0, 3.0]);
        assert_eq!(
            of(&facts(px4, &[("MPC_XY_VEL_MAX", 1.5), ("MPC_Z_VEL_MAX_DN", 0.5), ("MPC_ACC_HOR", 3.0)])),
            [1.5, 0.5, 3.0, 3.0]
        );
        assert_eq!(
            of(&facts(copter, &[("WPNAV_SPEED", 200.0), ("WPNAV_SPEED_UP", 50.0), ("WPNAV_ACCEL", 100.0)])),
            [2.0, 0.5, 1.0, 3.0]
        );
        assert_eq!(limited(Craft::quad(), &facts(px4, &[]), Some(2.5)).take_off_height, 2.5);
    }
}
