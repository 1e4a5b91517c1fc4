//! What the handlers of requests share.

use std::net::IpAddr;
use std::sync::Arc;
use std::time::Instant;

use tokio::sync::{Semaphore, watch};

use crate::controls::Controls;
use crate::flights::Flights;
use crate::hub::Hub;
use crate::message::Hello;

/// What is shown, what is controlled, and the end of the server.
pub(crate) struct Shared {
    pub(crate) hub: Arc<Hub>,
    pub(crate) controls: Arc<Controls>,
    pub(crate) flights: Option<Flights>,
    /// Flights that may be replayed at once.
    pub(crate) replays: Arc<Semaphore>,
    pub(crate) stop: watch::Receiver<bool>,
}

impl Shared {
    /// Whether recorded flights are shown to this address.
    pub(crate) fn shows_flights(&self, peer: IpAddr) -> bool {
        self.flights.is_some() && self.is_open_to(peer)
    }

    /// Whether this address may look without a token, as browsers do for films.
    pub(crate) fn is_open_to(&self, peer: IpAddr) -> bool {
        self.controls.may_watch(&Hello::default(), peer, Instant::now()).is_ok()
    }
}
