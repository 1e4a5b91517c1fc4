//! What the handlers of requests share.

use std::sync::Arc;

use tokio::sync::watch;

use crate::controls::Controls;
use crate::flights::Flights;
use crate::hub::Hub;

/// What is shown, what is controlled, and the end of the server.
pub(crate) struct Shared {
    pub(crate) hub: Arc<Hub>,
    pub(crate) controls: Arc<Controls>,
    pub(crate) flights: Option<Flights>,
    pub(crate) stop: watch::Receiver<bool>,
}
