//! How the cockpit reaches a flight.

use std::sync::Arc;
use std::sync::mpsc::Sender;

use spf_core::craft::Craft;
use spf_core::pilot::OperatorEvent;

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
