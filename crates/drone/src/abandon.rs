//! Craft that must be landed when the program ends in a way that runs no destructors: a second Ctrl-C, a signal while
//! the flight loop is stuck.

use std::sync::{Arc, Mutex, PoisonError, Weak};

/// A connection to a craft that can land it without its flight loop.
pub trait EmergencyLand: Send + Sync {
    /// Commands zero, then a landing, and waits until the craft is reported on the ground, or until the craft's own deadline.
    /// Returns at once for a craft on the ground.
    fn abandon(&self);
}

static CONNECTED: Mutex<Vec<Weak<dyn EmergencyLand>>> = Mutex::new(Vec::new());

/// Registers a connection; it is forgotten when it is dropped.
pub fn register(connection: &Arc<dyn EmergencyLand>) {
    let mut connected = CONNECTED.lock().unwrap_or_else(PoisonError::into_inner);
    connected.retain(|other| other.strong_count() > 0);
    connected.push(Arc::downgrade(connection));
}

/// Whether any craft is connected.
#[must_use]
pub fn is_any_connected() -> bool {
    CONNECTED.lock().unwrap_or_else(PoisonError::into_inner).iter().any(|connection| connection.strong_count() > 0)
}

/// Lands all connected craft and waits for them. For a signal handler's thread, just before the process exits.
pub fn land_all() {
    let connected: Vec<_> = {
        let connected = CONNECTED.lock().unwrap_or_else(PoisonError::into_inner);
        connected.iter().filter_map(Weak::upgrade).collect()
    };
    std::thread::scope(|scope| {
        for connection in &connected {
            scope.spawn(|| connection.abandon());
        }
    });
}
