//! A vehicle with its link and threads.

use std::panic::AssertUnwindSafe;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, JoinHandle};
use std::time::Instant;

use spf_core::camera::Camera;
use spf_core::command::Command;
use spf_core::ranges::RangeScan;
use spf_core::time::{Duration, Time};
use spf_envelope::Cleared;
use spf_mavlink::link::Link;
use spf_mavlink::station::Station;
use spf_mavlink::url::MavlinkUrl;
use spf_mavlink::wire::{Decoder, Encoder, LinkStats, Sequence};
use spf_motion::estimator::TelemetryAccuracy;

use super::limits::{craft, limited};
use super::opening::{COMPONENT, ConnectError, Found, find};
use super::settings::{GimbalUse, MavlinkSettings};
use super::telling::tell;
use super::vehicle::{Facts, Vehicle};
use crate::abandon::{self, EmergencyLand};
use crate::frames::{FrameStore, Frames};
use crate::{Capabilities, Drone, DroneError, DroneEvent};

/// Interval at which due transmissions are looked for.
const SEND_INTERVAL: Duration = Duration::from_millis(5);
/// Maximum wait for attitude, position and parameters.
const STATE_WAIT: Duration = Duration::from_secs(8);
/// Minimum time in which another vehicle on the same link is listened for.
const OTHERS_WAIT: Duration = Duration::from_millis(1500);
/// Time allowed for a landing at shutdown: from 30 m at 0.7 m/s.
const LANDING_TIME: Duration = Duration::from_secs(45);
/// Standard deviation of the horizontal position by which the estimator smooths it, and its bounds, metres. What the envelope
/// follows is told with each report, unbounded.
const ACCURACY: f64 = 0.3;
const ACCURACIES: (f64, f64) = (0.05, 3.0);

/// State shared by the threads.
struct Shared {
    vehicle: Mutex<Vehicle>,
    /// Held while sending, so that frames leave in the order of their numbers.
    encoder: Mutex<Encoder>,
    stats: Mutex<LinkStats>,
    link: Link,
    target: [u8; 2],
    own: [u8; 2],
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

impl EmergencyLand for Shared {
    fn abandon(&self) {
        let begun = Instant::now();
        while self.vehicle().is_ours() {
            let now = self.now();
            self.vehicle().leave(now);
            if begun.elapsed() >= LANDING_TIME {
                tracing::error!("the craft did not report a landing within {} s", LANDING_TIME.as_secs());
                return;
            }
            self.flush();
            std::thread::sleep(SEND_INTERVAL);
        }
        self.vehicle().part();
        self.flush();
    }
}

/// A PX4 or ArduPilot behind the [`Drone`] interface. It has no camera of its own.
pub struct MavlinkCraft {
    shared: Arc<Shared>,
    frames: FrameStore,
    accuracy: f64,
    gimbal: GimbalUse,
    threads: Vec<JoinHandle<()>>,
    polled: Time,
}

impl MavlinkCraft {
    /// Connects to the autopilot at an address, and watches it: nothing is commanded until [`engage`](Self::engage). `start` is
    /// flight time zero.
    ///
    /// # Errors
    /// [`ConnectError`] if the link cannot be opened, or nothing usable arrives.
    pub fn connect(url: &MavlinkUrl, settings: &MavlinkSettings, start: Instant) -> Result<Self, ConnectError> {
        let link = Link::open(url, settings.vehicle)?;
        let mut decoder = Decoder::default();
        let found = find(url, &link, &mut decoder, settings, craft().take_off_height, start)?;
        let Found { system, component, mut vehicle, encoder } = found;
        if settings.gimbal == GimbalUse::Off {
            vehicle.ignore_gimbal();
        }
        let autopilot = vehicle.facts().autopilot.name();
        let shared = Arc::new(Shared {
            vehicle: Mutex::new(vehicle),
            encoder: Mutex::new(encoder),
            stats: Mutex::default(),
            link,
            target: [system, component],
            own: [settings.system.unwrap_or(system), COMPONENT],
            start,
            stopped: AtomicBool::new(false),
        });
        let mut craft = Self {
            shared: shared.clone(),
            frames: FrameStore::default(),
            accuracy: ACCURACY,
            gimbal: settings.gimbal,
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
            let missing = vehicle.missing(now);
            let flown = missing.is_empty();
            // Heartbeats come once a second.
            if flown && vehicle.is_read() && begun.elapsed() >= OTHERS_WAIT || begun.elapsed() >= STATE_WAIT {
                let facts = vehicle.facts();
                if lock(&shared.stats).signed && !facts.has_answered() {
                    return Err(ConnectError::Signed { url: url.clone(), autopilot });
                }
                // Before anything is armed: the other may be the one that is meant.
                if let Some(other) = shared.link.other_than(system).filter(|_| settings.vehicle.is_none()) {
                    return Err(ConnectError::TwoVehicles { url: url.clone(), systems: [system, other] });
                }
                if flown {
                    break;
                }
                let texts = facts.last_words();
                return Err(ConnectError::Missing { url: url.clone(), autopilot, missing, wait: STATE_WAIT.as_secs(), texts });
            }
            drop(vehicle);
            std::thread::sleep(SEND_INTERVAL);
        }
        let known = shared.vehicle().facts().clone();
        let said = known.position_error(shared.now());
        craft.accuracy = said.map_or(ACCURACY, |said| said.clamp(ACCURACIES.0, ACCURACIES.1));
        Ok(craft)
    }

    /// Begins to fly it: until then it is only watched. From here on it is landed if the program ends.
    pub fn engage(&self) {
        let now = self.shared.now();
        let mut vehicle = self.shared.vehicle();
        let (mode, flying) = (vehicle.mode(), vehicle.is_flying());
        let flown = vehicle.engage(now);
        if let GimbalUse::At(tilt) = self.gimbal {
            vehicle.insist_on_gimbal();
            vehicle.tilt(now, tilt);
        }
        drop(vehicle);
        abandon::register(&(self.shared.clone() as Arc<dyn EmergencyLand>));
        match (flying, flown) {
            (true, true) => {
                tracing::warn!("the craft hovers in {mode} without a program that flies it: it is flown from where it is")
            }
            (true, false) => tracing::error!(
                "the craft is in the air in {mode}: somebody may have paused it, or flies it, so that nothing is sent until you \
                 resume (T)"
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

    /// Its logic, with the present time.
    pub(super) fn with_vehicle<T>(&self, work: impl FnOnce(&mut Vehicle, Time) -> T) -> T {
        let now = self.shared.now();
        work(&mut self.shared.vehicle(), now)
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

    /// Who else sends heartbeats on the link.
    #[must_use]
    pub fn others(&self) -> Vec<Station> {
        let known = [self.shared.target, self.shared.own];
        let mut stations = self.shared.link.stations();
        stations.retain(|station| !known.contains(&[station.system, station.component]));
        stations
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
            shared.link.note(&packet);
            // A gimbal may be a component of its own.
            if packet.system == shared.target[0]
                && let Some(news) = packet.gimbal()
            {
                let now = shared.now();
                shared.vehicle().handle_gimbal(now, news);
            }
            // A ground station with the vehicle's numbers counts its packets by itself.
            let is_its = [packet.system, packet.component] == shared.target && !packet.is_controller();
            if !is_its {
                // Our own, as a router sends them back, are not another's.
                if packet.is_controller() && [packet.system, packet.component] != shared.own {
                    lock(&shared.stats).other_stations = true;
                    let now = shared.now();
                    shared.vehicle().hear_station(now);
                }
                continue;
            }
            lock(&shared.stats).signed |= packet.is_signed;
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
        let ranges = vehicle.measures_ranges(self.shared.now());
        let gimbal = vehicle.gimbal_range(self.shared.now());
        drop(vehicle);
        Capabilities { position: true, ranges, gimbal, ..Capabilities::of(craft, Camera::quad(), senses) }
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

    fn wants_surroundings(&self) -> bool {
        self.shared.vehicle().wants_surroundings()
    }

    fn surroundings(&mut self, _now: Time, scan: &RangeScan) {
        self.shared.vehicle().tell_surroundings(scan);
    }

    /// Unknown for a real craft; it is polled at this interval.
    fn next_event_at(&self) -> Option<Time> {
        Some(self.polled + SEND_INTERVAL)
    }
}
