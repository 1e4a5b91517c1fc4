//! The number of the vehicle's rally points: asked for at connect, since a return may lead to one of them.

use spf_core::time::{Duration, Time};

use super::Outgoing;

/// It is asked for again after this long, at most this often.
const AGAIN: Duration = Duration::from_millis(700);
const TRIES: u8 = 5;

/// The conversation about it.
#[derive(Debug)]
pub(super) struct Rally {
    tries: u8,
    due: Time,
    /// Whether the answer is to be acknowledged.
    answered: bool,
}

impl Rally {
    pub(super) fn new(now: Time) -> Self {
        Self { tries: 0, due: now, answered: false }
    }

    /// The number arrived.
    pub(super) fn answered(&mut self) {
        self.answered = true;
    }

    /// Whether it was asked for in vain.
    pub(super) fn has_given_up(&self) -> bool {
        self.tries > TRIES
    }

    /// Asks for the number unless it `is_known` or another transfer `is_busy`, and ends that conversation.
    pub(super) fn poll(&mut self, now: Time, is_known: bool, is_busy: bool) -> Option<Outgoing> {
        if core::mem::take(&mut self.answered) {
            return Some(Outgoing::EndRallyPoints);
        }
        if is_known || self.has_given_up() || now < self.due || is_busy {
            return None;
        }
        (self.tries, self.due) = (self.tries + 1, now + AGAIN);
        (self.tries <= TRIES).then_some(Outgoing::CountRallyPoints)
    }
}
