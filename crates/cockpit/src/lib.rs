//! The cockpit: a flight in a browser (docs/guide/cockpit.md).
//!
//! [`Cockpit`] serves the page from a thread of its own. [`Instruments`] observes a flight for it and never waits: whoever
//! watches gets the newest picture and the newest state, and nothing that a page does or fails to do delays the loop that flies.
//! Orders of the page go into the operator channel of the flight, like the keys of the terminal.

mod ahead;
mod cockpit;
mod controlling;
mod controls;
mod film;
mod flight_controls;
mod flights;
mod hub;
mod instruments;
mod message;
mod overlay;
mod page;
mod server;
mod shared;
mod tls;
mod visitor;
mod watching;
mod worker;

pub use cockpit::{Announce, Cockpit, CockpitError};
pub use controls::ArmAssistant;
pub use flight_controls::{FlightControls, FlightEnd, ReadInstruction};
pub use flights::Flights;
pub use instruments::Instruments;

/// Reads a message of the page, for fuzzing; whether it is one.
#[doc(hidden)]
#[must_use]
pub fn read_page_message(text: &str) -> bool {
    message::ToControls::read(text).is_ok() || message::ToWatch::read(text).is_ok()
}
