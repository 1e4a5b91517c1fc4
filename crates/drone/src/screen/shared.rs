//! What the threads of a game share.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use spf_core::command::Setpoint;
use spf_core::time::{Duration, Time, duration_from_secs};
use spf_screen::profile::Profile;

use super::control::Control;
use crate::DroneEvent;
use crate::abandon::EmergencyLand;

/// Most events and commands that wait to be taken.
const MOST_WAITING: usize = 256;
/// Time for the landing's keys at the end, beyond the profile's own.
const LEAVING: Duration = Duration::from_secs(1);
/// How often an end is looked for.
const TICK: Duration = Duration::from_millis(4);

/// Something that was done, for the reckoning.
#[derive(Clone, Copy, Debug)]
pub(super) enum Done {
    /// Keys are pressed for this motion.
    Motion(Setpoint),
    /// The take-off has ended at this height.
    TookOff(f64),
}

/// State shared by the threads.
pub(super) struct Shared {
    control: Mutex<Control>,
    /// What was done with the keys, for the reckoning.
    commands: Mutex<VecDeque<(Time, Done)>>,
    events: Mutex<VecDeque<(Time, DroneEvent)>>,
    start: Instant,
    pub(super) take_off_height: f64,
    /// Greatest time that the landing's keys take.
    landing: Duration,
    /// The operator asks for the focus.
    pub(super) resumes: AtomicBool,
    pub(super) stopped: AtomicBool,
    /// Whether the keyboard's thread has released everything and ended.
    pub(super) released: AtomicBool,
}

impl Shared {
    /// For a craft that stands. `start` is flight time zero.
    pub(super) fn new(now: Time, profile: &Profile, start: Instant) -> Self {
        Self {
            control: Mutex::new(Control::new(now, profile)),
            commands: Mutex::default(),
            events: Mutex::default(),
            start,
            take_off_height: profile.take_off.height_m,
            landing: duration_from_secs(profile.landing.steps.iter().map(|step| step.for_s).sum()),
            resumes: AtomicBool::new(false),
            stopped: AtomicBool::new(false),
            released: AtomicBool::new(false),
        }
    }

    pub(super) fn now(&self) -> Time {
        Time::ZERO + self.start.elapsed()
    }

    pub(super) fn time_of(&self, at: Instant) -> Time {
        Time::ZERO + at.saturating_duration_since(self.start)
    }

    pub(super) fn control(&self) -> MutexGuard<'_, Control> {
        // The value is consistent between calls.
        self.control.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn report(&self, at: Time, event: DroneEvent) {
        let mut events = self.events.lock().unwrap_or_else(PoisonError::into_inner);
        if events.len() >= MOST_WAITING {
            events.pop_front();
        }
        events.push_back((at, event));
    }

    pub(super) fn take_report(&self) -> Option<(Time, DroneEvent)> {
        self.events.lock().unwrap_or_else(PoisonError::into_inner).pop_front()
    }

    pub(super) fn take_commands(&self) -> VecDeque<(Time, Done)> {
        std::mem::take(&mut *self.commands.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Notes what was done, for the reckoning.
    pub(super) fn did(&self, at: Time, done: Done) {
        let mut commands = self.commands.lock().unwrap_or_else(PoisonError::into_inner);
        if commands.len() >= MOST_WAITING {
            commands.pop_front();
        }
        commands.push_back((at, done));
    }
}

impl EmergencyLand for Shared {
    fn abandon(&self) {
        self.control().leave(self.now());
        let begun = Instant::now();
        while !self.control().is_over() && begun.elapsed() < self.landing + LEAVING {
            std::thread::sleep(TICK);
        }
        if !self.control().is_over() {
            tracing::warn!("not landed: the keys could not be pressed in time");
        }
        self.stopped.store(true, Ordering::Relaxed);
        let begun = Instant::now();
        while !self.released.load(Ordering::Relaxed) && begun.elapsed() < LEAVING {
            std::thread::sleep(TICK);
        }
    }
}
