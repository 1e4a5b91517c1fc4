//! In tests replays wait here, so that what happens meanwhile does not depend on how fast they are.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};

/// Where replays wait: each says that it has begun, and goes on when it is told to. The default lets all pass.
#[derive(Clone, Debug, Default)]
pub(super) struct Gate(Option<Arc<Mutex<Ends>>>);

/// What tells that a replay has begun, and what it waits for.
type Ends = (Sender<()>, Receiver<()>);

impl Gate {
    /// A closed one, with what tells of replays that have begun, and what lets them go on.
    pub(super) fn closed() -> (Self, Receiver<()>, Sender<()>) {
        let ((begins, begun), (go_on, told)) = (channel(), channel());
        (Self(Some(Arc::new(Mutex::new((begins, told))))), begun, go_on)
    }

    pub(super) fn pass(&self) {
        if let Some(gate) = &self.0 {
            let gate = gate.lock().unwrap();
            gate.0.send(()).unwrap();
            gate.1.recv().unwrap();
        }
    }
}
