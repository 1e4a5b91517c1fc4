//! A panic on demand, for the tests of what it leaves behind; only in debug builds. SIGUSR2 makes the flight loop panic if
//! the environment has [`WANTED`].

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use signal_hook::consts::SIGUSR2;
use spf_core::command::Command;
use spf_core::time::Time;
use spf_drone::frames::Frames;
use spf_drone::{Capabilities, Drone, DroneError, DroneEvent};
use spf_envelope::Cleared;

/// The variable that allows the panic.
const WANTED: &str = "PANIC_OF_FLIGHT_LOOP_ON_SIGUSR2";

static PANICS: AtomicBool = AtomicBool::new(false);

/// Takes note of a signal.
pub(super) fn hear(signal: i32) {
    if signal == SIGUSR2 && std::env::var_os(WANTED).is_some() {
        PANICS.store(true, Ordering::Relaxed);
    }
}

/// The drone, or one whose next call after the signal panics in the flight loop.
pub(super) fn around(drone: Box<dyn Drone>) -> Box<dyn Drone> {
    if std::env::var_os(WANTED).is_some() { Box::new(Drill(drone)) } else { drone }
}

struct Drill(Box<dyn Drone>);

impl Drone for Drill {
    fn name(&self) -> &str {
        self.0.name()
    }

    fn capabilities(&self) -> Capabilities {
        self.0.capabilities()
    }

    fn frames(&self) -> Arc<dyn Frames> {
        self.0.frames()
    }

    fn apply(&mut self, now: Time, command: &Cleared<Command>) -> Result<(), DroneError> {
        self.0.apply(now, command)
    }

    fn next_event(&mut self, until: Time) -> Option<(Time, DroneEvent)> {
        assert!(!PANICS.swap(false, Ordering::Relaxed), "a panic that was asked for");
        self.0.next_event(until)
    }

    fn resume(&mut self, now: Time) {
        self.0.resume(now);
    }

    fn next_event_at(&self) -> Option<Time> {
        self.0.next_event_at()
    }
}
