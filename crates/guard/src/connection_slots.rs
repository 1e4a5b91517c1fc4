//! The places of a server's connections.

use std::collections::BTreeMap;
use std::net::IpAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A bounded number of connections. A connection that has not yet sent a complete request gives its place up to a new
/// one, the oldest first, so that connections that say nothing lock nobody out.
#[derive(Clone, Default)]
pub struct ConnectionSlots(Arc<Mutex<Taken>>);

#[derive(Default)]
struct Taken {
    most: usize,
    next: u64,
    by_age: BTreeMap<u64, Occupant>,
}

struct Occupant {
    settled: Arc<AtomicBool>,
    /// The address of whoever has the connection, once it is a WebSocket.
    keeper: Option<IpAddr>,
    turn_out: Box<dyn FnOnce() + Send>,
}

/// A connection's place; free again when the last copy is dropped.
#[derive(Clone)]
pub struct Place(Arc<Held>);

struct Held {
    places: ConnectionSlots,
    id: u64,
    settled: Arc<AtomicBool>,
}

impl ConnectionSlots {
    /// At most `most` connections.
    #[must_use]
    pub fn new(most: usize) -> Self {
        Self(Arc::new(Mutex::new(Taken { most, ..Taken::default() })))
    }

    fn taken(&self) -> MutexGuard<'_, Taken> {
        // Consistent between calls.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes a place; `None` if all are taken by settled connections. `turn_out` is called, once and without delay, if
    /// the connection must give its place up to another; it must end the connection.
    #[must_use]
    pub fn enter(&self, turn_out: impl FnOnce() + Send + 'static) -> Option<Place> {
        let mut taken = self.taken();
        let mut leaving = None;
        if taken.by_age.len() >= taken.most {
            let unsettled = |(_, occupant): &(&u64, &Occupant)| !occupant.settled.load(Ordering::Relaxed);
            let oldest = *taken.by_age.iter().find(unsettled)?.0;
            leaving = taken.by_age.remove(&oldest);
        }
        let id = taken.next;
        taken.next += 1;
        let settled = Arc::new(AtomicBool::new(false));
        taken.by_age.insert(id, Occupant { settled: settled.clone(), keeper: None, turn_out: Box::new(turn_out) });
        drop(taken);
        if let Some(occupant) = leaving {
            (occupant.turn_out)();
        }
        Some(Place(Arc::new(Held { places: self.clone(), id, settled })))
    }

    /// Number of places taken.
    #[must_use]
    pub fn count(&self) -> usize {
        self.taken().by_age.len()
    }
}

impl Place {
    /// Keeps the place until the connection ends: its request is complete, and its sender may ask.
    pub fn settle(&self) {
        self.0.settled.store(true, Ordering::Relaxed);
    }

    /// Counts the place as that of a WebSocket of this address; false if it has `most` of them already.
    #[must_use]
    pub fn keep(&self, keeper: IpAddr, most: usize) -> bool {
        let mut taken = self.0.places.taken();
        if taken.by_age.values().filter(|occupant| occupant.keeper == Some(keeper)).count() >= most {
            return false;
        }
        if let Some(occupant) = taken.by_age.get_mut(&self.0.id) {
            occupant.keeper = Some(keeper);
        }
        true
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        self.places.taken().by_age.remove(&self.id);
    }
}

impl core::fmt::Debug for ConnectionSlots {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let taken = self.taken();
        write!(f, "ConnectionSlots({} of {})", taken.by_age.len(), taken.most)
    }
}

impl core::fmt::Debug for Place {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Place({})", self.0.id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::sync::atomic::AtomicUsize;

    #[test]
    fn who_says_nothing_makes_room_and_who_asked_stays() {
        let (places, out) = (ConnectionSlots::new(2), Arc::new(Mutex::new(Vec::new())));
        let enter = |name: &'static str| {
            let out = out.clone();
            places.enter(move || out.lock().unwrap().push(name))
        };
        let first = enter("first").unwrap();
        first.settle();
        let second = enter("second").unwrap();
        let third = enter("third").unwrap();
        assert_eq!(*out.lock().unwrap(), ["second"]);
        third.settle();
        assert!(enter("fourth").is_none());
        // Its place went to the third long ago.
        drop(second);
        assert!(enter("fifth").is_none());
        drop(third);
        assert!(enter("sixth").is_some());
        assert_eq!((out.lock().unwrap().len(), places.count()), (1, 1));
    }

    #[test]
    fn one_address_does_not_keep_all_places() {
        let places = ConnectionSlots::new(8);
        let enter = || places.enter(|| {}).unwrap();
        let [one, other] = [IpAddr::from([192, 0, 2, 1]), IpAddr::from([192, 0, 2, 2])];
        let kept: Vec<Place> = (0..4).map(|_| enter()).collect();
        assert!(kept.iter().take(3).all(|place| place.keep(one, 3)));
        assert!(!kept[3].keep(one, 3) && kept[3].keep(other, 3));
        drop(kept);
        assert!(enter().keep(one, 3), "free again");
    }

    proptest! {
        #[test]
        fn there_are_never_more_than_allowed(most in 0_usize..5, steps in proptest::collection::vec((0_u8..3, 0_usize..6), 0..60)) {
            let (places, out) = (ConnectionSlots::new(most), Arc::new(AtomicUsize::new(0)));
            let mut held: Vec<Place> = Vec::new();
            let mut entered = 0;
            for (step, which) in steps {
                match step {
                    0 => {
                        let out = out.clone();
                        if let Some(place) = places.enter(move || { out.fetch_add(1, Ordering::Relaxed); }) {
                            entered += 1;
                            held.push(place);
                        }
                    }
                    1 if which < held.len() => held[which].settle(),
                    _ if which < held.len() => drop(held.remove(which)),
                    _ => {}
                }
                prop_assert!(places.count() <= most);
                prop_assert!(out.load(Ordering::Relaxed) <= entered);
            }
            drop(held);
            prop_assert_eq!(places.count(), 0);
        }
    }
}
