//! Tools with which an assistant looks, flies and stops, by the Model Context Protocol (docs/guide/mcp.md).
//!
//! A [`deck::Deck`] has at most one flight. It is flown by a [`deck::Hangar`], which the program is, with its settings; the assistant's orders go
//! into the flight's operator channel, like the keys of the terminal and the cockpit, and so through the safety envelope. A real craft
//! moves only with the operator's [`consent::Consent`]. The protocol itself is behind the feature `server`.
#![forbid(unsafe_code)]

pub mod consent;
pub mod deck;
pub mod picture;
pub mod report;
#[cfg(feature = "server")]
pub mod server;
pub mod watch;
