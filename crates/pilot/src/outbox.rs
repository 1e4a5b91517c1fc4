//! What the caller is to carry out, in order.

use std::collections::VecDeque;

use crate::event::{Action, Note};
use spf_envelope::Cause;

/// Actions and reports that wait to be fetched.
#[derive(Debug, Default)]
pub(crate) struct Outbox {
    actions: VecDeque<Action>,
    /// The envelope's reaction and setpoint change that were last reported.
    reaction: Option<Cause>,
    change: Option<Cause>,
}

impl Outbox {
    pub(crate) fn push(&mut self, action: Action) {
        self.actions.push_back(action);
    }

    pub(crate) fn note(&mut self, note: Note) {
        self.push(Action::Note(note));
    }

    /// Reports the cause of the envelope's reaction once, until another replaces it.
    pub(crate) fn reaction(&mut self, cause: Option<Cause>) {
        let last = core::mem::replace(&mut self.reaction, cause);
        self.note_new(cause, last);
    }

    /// The same of its change of a setpoint.
    pub(crate) fn change(&mut self, cause: Option<Cause>) {
        let last = core::mem::replace(&mut self.change, cause);
        self.note_new(cause, last);
    }

    fn note_new(&mut self, cause: Option<Cause>, last: Option<Cause>) {
        if let Some(cause) = cause.filter(|cause| last != Some(*cause)) {
            self.note(Note::Envelope(cause));
        }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.actions.is_empty()
    }

    pub(crate) fn pop(&mut self) -> Option<Action> {
        self.actions.pop_front()
    }
}
