//! How the cockpit reaches a flight.

use std::sync::Arc;
use std::sync::mpsc::Sender;

use spf_core::craft::Craft;
use spf_pilot::OperatorEvent;

/// Reads an instruction before it is flown: what was understood, one line; or why it cannot be flown.
pub type ReadInstruction = Arc<dyn Fn(&str) -> Result<String, String> + Send + Sync>;

/// The operator's side of a flight.
#[derive(Clone)]
pub struct FlightControls {
    /// The flight's operator channel, which leads through the safety envelope.
    pub operator: Sender<OperatorEvent>,
    /// The craft, for the speeds of manual flight.
    pub craft: Craft,
    /// Reads a new instruction.
    pub read: ReadInstruction,
    /// Whether nothing but the page controls the flight: if the page is lost, it holds and then lands.
    pub only: bool,
}

/// How a flight ended, for the page.
#[derive(Clone, Debug)]
pub struct FlightEnd {
    /// The outcome, in words.
    pub outcome: String,
    /// The result in lines, for everybody.
    pub result: Vec<String>,
    /// Flight time when the outcome was settled, seconds, as in the summary.
    pub flight_time_s: f64,
    /// Length of the flown path by then, metres, as in the summary.
    pub path_length_m: f64,
    /// Where the files are, for whoever flew.
    pub files: String,
    /// What could not be recorded and why, for whoever flew; everybody is told that the recording is not complete.
    pub problems: Vec<String>,
}
