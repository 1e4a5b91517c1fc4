//! A flight of the deck.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use spf_flight::flight::Flown;
use spf_flight::pointing::Pointing;
use spf_pilot::{OperatorEvent, Phase};
use tokio::sync::watch;

use crate::watch::{Orders, Seen};

/// How a flight ended.
#[derive(Clone, Debug)]
pub enum Landed {
    /// It was flown.
    Flown(Box<Flown>),
    /// It did not begin, and why.
    Failed(String),
}

/// A flight that is under way, or that was the last one.
#[derive(Clone)]
pub struct Flight {
    /// Its number in this process.
    pub number: u64,
    pub(super) orders: Orders,
    /// What is known of it.
    pub seen: watch::Receiver<Seen>,
    /// How it ended, once it has.
    pub landed: watch::Receiver<Option<Landed>>,
    pub(super) pointing: Arc<Pointing>,
    pub(super) given_up: Arc<AtomicBool>,
    pub(super) folder: Arc<OnceLock<PathBuf>>,
    /// The scene that was asked for.
    pub(super) scene: Option<String>,
    /// Whether it was stopped, and lands whatever an assistant says.
    pub(super) stopped: Arc<AtomicBool>,
}

impl core::fmt::Debug for Flight {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Flight").field("id", &self.id()).field("phase", &self.phase()).finish_non_exhaustive()
    }
}

impl Flight {
    /// By which it is named: the name of its folder, once it has one.
    #[must_use]
    pub fn id(&self) -> String {
        let name = self.folder.get().and_then(|folder| folder.file_name()).map(|name| name.to_string_lossy().into_owned());
        name.unwrap_or_else(|| format!("flight-{}", self.number))
    }

    /// The scene that was asked for; `None` for that of the settings.
    #[must_use]
    pub fn scene(&self) -> Option<&str> {
        self.scene.as_deref()
    }

    /// Whether it was stopped, and lands whatever an assistant says.
    #[must_use]
    pub fn is_stopped(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }

    /// Whether its files have a folder, by which it is named from then on.
    #[must_use]
    pub fn has_folder(&self) -> bool {
        self.folder.get().is_some()
    }

    /// Whether this is its name before it had a folder.
    #[must_use]
    pub fn is_called(&self, id: &str) -> bool {
        id == format!("flight-{}", self.number)
    }

    /// Whether it is about to go on by an order that it has not told of yet, or flies to a point.
    #[must_use]
    pub fn is_going(&self) -> bool {
        self.orders.is_going()
    }

    /// Whether it has told of every order.
    #[must_use]
    pub fn is_heard(&self) -> bool {
        self.orders.is_heard()
    }

    /// Why it did not take place, if so.
    #[must_use]
    pub fn failed(&self) -> Option<String> {
        match &*self.landed.borrow() {
            Some(Landed::Failed(why)) => Some(format!("the flight did not take place: {why}")),
            _ => None,
        }
    }

    /// Whether the craft is on the ground again.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.landed.borrow().is_some()
    }

    /// Its phase; `None` while it is prepared.
    #[must_use]
    pub fn phase(&self) -> Option<Phase> {
        self.seen.borrow().phase
    }

    /// Zero velocity now; a craft on the ground stays there, and the flight is over.
    pub(super) fn hold(&self) {
        match self.phase() {
            None | Some(Phase::Ground) => {
                self.give_up();
                self.orders.give([OperatorEvent::Land]);
            }
            _ => {
                self.orders.give([OperatorEvent::Hold]);
            }
        }
    }

    /// The same for whoever was ordering and orders no more: what lands, returns or is flown by somebody else goes on.
    pub(super) fn leave(&self) {
        match self.phase() {
            None | Some(Phase::Ground) => self.hold(),
            _ => {
                self.orders.give([OperatorEvent::Left]);
            }
        }
    }

    /// A flight that has not begun does not begin.
    pub(super) fn give_up(&self) {
        self.given_up.store(true, Ordering::Relaxed);
    }

    pub(super) fn is_airborne(&self) -> bool {
        !matches!(self.phase(), None | Some(Phase::Ground | Phase::Ended))
    }

    /// Whether it flies, lands or returns without a word of anybody.
    pub(super) fn flies_by_itself(&self) -> bool {
        matches!(self.phase(), Some(Phase::TakeOff | Phase::Flying | Phase::Landing | Phase::Returning))
    }
}
