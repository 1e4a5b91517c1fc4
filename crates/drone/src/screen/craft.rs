//! A game behind the [`Drone`] interface, with its threads.

use std::panic::AssertUnwindSafe;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::{Builder, JoinHandle};
use std::time::Instant;

use spf_core::camera::Camera;
use spf_core::command::Command;
use spf_core::craft::Craft;
use spf_core::time::{Duration, Time};
use spf_envelope::Cleared;
use spf_motion::estimator::TelemetryAccuracy;
use spf_screen::profile::{Axis, Profile};
use spf_screen::{Display, Eye, Gamepad, Hands, Hidden, ScreenError};

use super::control::Part;
use super::pressing::press;
use super::settings::ScreenSettings;
use super::shared::Shared;
use super::watching::Watcher;
use crate::abandon::{self, EmergencyLand};
use crate::frames::{FrameStore, Frames};
use crate::{Capabilities, Drone, DroneError, DroneEvent};

/// How often the loop is to poll.
const POLL_INTERVAL: Duration = Duration::from_millis(10);

/// A game flown through its window.
pub struct ScreenCraft {
    name: String,
    shared: Arc<Shared>,
    frames: FrameStore,
    capabilities: Capabilities,
    polled: Time,
    threads: Vec<JoinHandle<()>>,
}

/// What the profile says of the craft, for executor and envelope.
pub(super) fn craft_of(profile: &Profile) -> Craft {
    let part = &profile.craft;
    let controls = &profile.controls;
    let full = |axis: &Axis| axis.rate(1.0).min(axis.rate(-1.0));
    Craft {
        cruise_speed: part.cruise * controls.forward.rate(1.0),
        climb_speed: part.cruise * full(&controls.up),
        yaw_rate: part.cruise * controls.yaw.rate_deg_s().to_radians(),
        acceleration: part.acceleration_m_s2,
        climb_acceleration: part.acceleration_m_s2,
        yaw_acceleration: 600.0_f64.to_radians(),
        lag: controls.lag_s,
        dead_time: controls.dead_time_s,
        radius: part.radius_m,
        // A game in which the craft flies from the start still climbs to look around.
        take_off_height: profile.take_off.height_m.max(1.0),
        return_height: None,
        return_climb: 0.0,
    }
}

/// Nothing is measured but the heading: velocities and the height are those of the keys. The reckoned height is reported, since the
/// take-off raises the craft by keys whose velocity is not known; so the envelope does not widen its margins for it.
fn senses(profile: &Profile) -> TelemetryAccuracy {
    let cruise = profile.craft.cruise * profile.controls.forward.rate(1.0);
    TelemetryAccuracy { velocity_noise: 0.1 * cruise, heading_noise: 0.5_f64.to_radians(), ..TelemetryAccuracy::EXACT }
}

impl ScreenCraft {
    /// Connects to the window of a profile, asks for its focus, and begins to look. `start` is flight time zero. No key is pressed before the
    /// take-off.
    ///
    /// # Errors
    /// Why there is no such window, or why it cannot be seen or flown.
    pub fn connect(name: &str, profile: &Profile, settings: &ScreenSettings, start: Instant) -> Result<Self, ConnectError> {
        let display = Display::open(settings.display.as_deref())?;
        let mut hands = Hands::open(&display, &profile.window.name())?;
        hands.check(&profile.keys())?;
        if profile.has_sticks() {
            // Held until the end: a program that loses its gamepad may pause.
            hands.take(Gamepad::open()?);
        }
        if !hands.activate()? {
            return Err(ConnectError::NoFocus);
        }
        let mut eye = Eye::new(display, profile.target());
        let image = first_picture(&mut eye)??;
        let size = spf_screen::pixels::limited((image.width(), image.height()), spf_screen::picture::LONGEST_SIDE);
        let camera: Camera = profile.optics(size);
        let now = Time::ZERO + start.elapsed();
        let shared = Arc::new(Shared::new(now, profile, start));
        abandon::register(&(shared.clone() as Arc<dyn EmergencyLand>));
        let frames = FrameStore::default();
        let mut craft = Self {
            name: name.to_owned(),
            shared: shared.clone(),
            frames: frames.clone(),
            capabilities: Capabilities::of(craft_of(profile), camera, senses(profile)),
            polled: Time::ZERO,
            threads: Vec::new(),
        };
        let (one, two) = (shared.clone(), shared);
        craft.spawn("keys", Part::Keys, move || press(hands, &one))?;
        let watcher = Watcher::new(now, eye, profile, size, frames);
        craft.spawn("picture", Part::Picture, move || watcher.run(&two))?;
        Ok(craft)
    }

    fn spawn(&mut self, name: &str, part: Part, work: impl FnOnce() + Send + 'static) -> Result<(), ConnectError> {
        let shared = self.shared.clone();
        let guarded = move || {
            // A panic has released the keys while it unwound, and its message was printed.
            if std::panic::catch_unwind(AssertUnwindSafe(work)).is_err() {
                shared.control().set_broken(shared.now(), part, true);
            }
        };
        self.threads.push(Builder::new().name(format!("screen {name}")).spawn(guarded).map_err(ConnectError::Start)?);
        Ok(())
    }
}

/// Why a window cannot be flown.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConnectError {
    /// The display or the keyboard.
    #[error(transparent)]
    Screen(#[from] ScreenError),
    /// The window cannot be seen.
    #[error(transparent)]
    Hidden(#[from] Hidden),
    /// The window manager did not give the focus.
    #[error("the window did not get the focus")]
    NoFocus,
    /// A thread did not start.
    #[error("cannot start a thread")]
    Start(#[source] std::io::Error),
}

/// The first picture; a window that was just raised may still be hidden.
pub(super) fn first_picture(eye: &mut Eye) -> Result<Result<spf_media::Rgb, Hidden>, ScreenError> {
    let begun = Instant::now();
    loop {
        match eye.look()? {
            Ok(shown) => return Ok(Ok(shown.image)),
            Err(hidden) if begun.elapsed() > Duration::from_secs(2) => return Ok(Err(hidden)),
            Err(_) => std::thread::sleep(Duration::from_millis(50)),
        }
    }
}

impl Drop for ScreenCraft {
    fn drop(&mut self) {
        self.shared.abandon();
        for thread in self.threads.drain(..) {
            drop(thread.join());
        }
    }
}

impl Drone for ScreenCraft {
    fn name(&self) -> &str {
        &self.name
    }

    fn capabilities(&self) -> Capabilities {
        self.capabilities
    }

    fn frames(&self) -> Arc<dyn Frames> {
        Arc::new(self.frames.clone())
    }

    fn apply(&mut self, _now: Time, command: &Cleared<Command>) -> Result<(), DroneError> {
        if matches!(command.get(), Command::Manoeuvre(_)) {
            return Err(DroneError::NoManoeuvres(self.name.clone()));
        }
        let now = self.shared.now();
        let mut control = self.shared.control();
        control.heartbeat(now);
        control.apply(now, command);
        Ok(())
    }

    fn next_event(&mut self, until: Time) -> Option<(Time, DroneEvent)> {
        self.polled = until;
        let mut control = self.shared.control();
        control.heartbeat(self.shared.now());
        if let Some(event) = control.take_event() {
            return Some(event);
        }
        drop(control);
        if let Some(event) = self.shared.take_report() {
            return Some(event);
        }
        let meta = self.frames.take_new_frame()?;
        Some((meta.received, DroneEvent::Frame(meta)))
    }

    fn resume(&mut self, _now: Time) {
        if self.shared.control().awaits_resume() {
            self.shared.resumes.store(true, Ordering::Relaxed);
        }
    }

    /// Unknown; it is polled at this interval.
    fn next_event_at(&self) -> Option<Time> {
        Some(self.polled + POLL_INTERVAL)
    }
}
