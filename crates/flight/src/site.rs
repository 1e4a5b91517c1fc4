//! The parts that a site, simulated or real, provides to a flight.

use std::sync::Arc;
use std::time::Instant;

use spf_core::time::Time;
use spf_drone::Drone;

use crate::frame_source::FrameSource;
use crate::log::SimHead;
use crate::run::Observer;
use crate::summary::Summary;

/// The clock of a flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// Virtual time: advances directly to the next event, without waiting. For a craft whose next report time is known.
    Virtual,
    /// The wall clock, from the start of the flight.
    Wall,
    /// The wall clock, counted from a time that the craft already uses.
    WallSince(Instant),
}

/// The parts provided by a site.
pub(crate) struct Parts {
    /// The craft.
    pub(crate) drone: Box<dyn Drone>,
    /// The clock.
    pub(crate) clock: Clock,
    /// Seed of all random choices.
    pub(crate) seed: u64,
    /// Frames and truth for a recorder.
    pub(crate) frame_source: Arc<dyn FrameSource>,
    /// Evaluates the flight.
    pub(crate) judge: Box<dyn Judge>,
    /// Data to render a simulated flight again.
    pub(crate) sim: Option<SimHead>,
}

/// Observes a flight and evaluates it: by ground truth where available, else by the pilot's estimate.
pub(crate) trait Judge: Observer {
    /// The pilot settled on an outcome, with this instruction.
    fn settle(&mut self, now: Time, instruction: &str);

    /// Fills in its part of the summary.
    fn tell(&self, summary: &mut Summary);
}
