//! The flight loop, which joins a pilot and a world.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

use spf_core::time::Time;
use spf_pilot::{Action, Event, Pilot};

use crate::log::FlightHeader;
use crate::sight::Sight;

/// The environment of a pilot: it waits, delivers events, and carries out actions.
///
/// There are two implementations, [`Lockstep`](crate::world::Lockstep) in virtual time and [`Live`](crate::world::Live)
/// on the wall clock. They are the only places that read a clock.
pub trait World {
    /// Current flight time.
    fn now(&self) -> Time;

    /// Waits for the next event, at most until `deadline`; `None` if the deadline comes first. Afterwards
    /// [`World::now`] is the event's time or the deadline.
    fn wait(&mut self, deadline: Time) -> Option<Event>;

    /// Carries out an action: sends a query, cancels one, or passes a cleared command to the craft.
    fn apply(&mut self, action: &Action);

    /// Lets a craft that wants it know what the pilot's map shows around it. Called after the actions of each instant.
    fn surroundings(&mut self, pilot: &Pilot) {
        let _ = pilot;
    }
}

/// Observes a flight, for progress display and recording.
pub trait Observer {
    /// A flight is about to begin. Called once, before anything else and before take-off.
    fn begin(&mut self, head: &FlightHeader, sight: &Sight) {
        let _ = (head, sight);
    }

    /// An event was passed to the pilot.
    fn event(&mut self, now: Time, event: &Event) {
        let _ = (now, event);
    }

    /// The pilot returned an action.
    fn action(&mut self, now: Time, action: &Action, pilot: &Pilot) {
        let _ = (now, action, pilot);
    }

    /// Time advanced to `now`; called before anything else at `now`.
    fn time(&mut self, now: Time, pilot: &Pilot) {
        let _ = (now, pilot);
    }
}

/// An observer that panicked. It was not called again; the flight continued.
#[derive(Debug)]
pub struct ObserverFailure {
    /// Index of the observer.
    pub observer: usize,
    /// The payload of the panic.
    pub panic: Box<dyn Any + Send>,
}

/// Observers, none of which can unwind into the loop.
struct Observers<'a, 'b> {
    all: Vec<Option<&'a mut &'b mut dyn Observer>>,
    failures: Vec<ObserverFailure>,
}

impl Observers<'_, '_> {
    fn each(&mut self, call: impl Fn(&mut dyn Observer)) {
        for (index, slot) in self.all.iter_mut().enumerate() {
            let Some(observer) = slot else { continue };
            // State left inconsistent by a panic is not used again.
            if let Err(panic) = catch_unwind(AssertUnwindSafe(|| call(&mut ***observer))) {
                *slot = None;
                self.failures.push(ObserverFailure { observer: index, panic });
            }
        }
    }
}

/// Runs a flight until it is over: on the ground again, or motors cut. Returns the observers that failed.
pub fn run(pilot: &mut Pilot, world: &mut dyn World, observers: &mut [&mut dyn Observer]) -> Vec<ObserverFailure> {
    let mut observers = Observers { all: observers.iter_mut().map(Some).collect(), failures: Vec::new() };
    loop {
        let now = world.now();
        while let Some(action) = pilot.poll(now) {
            // First the commands that move or stop the craft: no observer delays a command.
            world.apply(&action);
            observers.each(|observer| observer.action(now, &action, pilot));
        }
        world.surroundings(pilot);
        let Some((deadline, why)) = pilot.next_deadline() else { return observers.failures };
        tracing::trace!(now = now.as_secs_f64(), at = deadline.as_secs_f64(), "waits at most until {}", why.words());
        let event = world.wait(deadline);
        let now = world.now();
        observers.each(|observer| observer.time(now, pilot));
        if let Some(event) = event {
            observers.each(|observer| observer.event(now, &event));
            pilot.handle(now, event);
        }
    }
}
