//! What a place to fly in gives to a flight, whether it is simulated or not.

use std::sync::Arc;
use std::time::Instant;

use spf_core::time::Time;
use spf_drone::Drone;

use crate::frame_source::FrameSource;
use crate::log::SimHead;
use crate::run::Observer;
use crate::summary::Summary;

/// What a flight's time goes by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// Nothing waits: time goes on to whatever comes next. For a craft that knows when it tells something next.
    Virtual,
    /// The wall clock, from when the flight begins.
    Wall,
    /// The wall clock since a time that the craft goes by already.
    WallSince(Instant),
}

/// What a site gives.
pub(crate) struct Parts {
    /// The craft.
    pub(crate) drone: Box<dyn Drone>,
    /// What its time goes by.
    pub(crate) clock: Clock,
    /// Of all chance.
    pub(crate) seed: u64,
    /// What a recorder sees.
    pub(crate) frame_source: Arc<dyn FrameSource>,
    /// Who says how it went.
    pub(crate) judge: Box<dyn Judge>,
    /// What a simulated flight is drawn again from.
    pub(crate) sim: Option<SimHead>,
}

/// Watches a flight and says how it went: by the truth where there is one, else as the pilot knows it.
pub(crate) trait Judge: Observer {
    /// The pilot settled on an outcome, under this instruction.
    fn settle(&mut self, now: Time, instruction: &str);

    /// Fills in what it knows.
    fn tell(&self, summary: &mut Summary);
}
