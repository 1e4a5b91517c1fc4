//! The one loop that joins a pilot and a world.

use spf_core::pilot::{Action, Event, Pilot};
use spf_core::time::Time;

/// Whatever happens around the pilot: it waits, tells what happened, and does what it is asked.
///
/// There are two implementations, [`Lockstep`](crate::world::Lockstep) in virtual time and [`Live`](crate::world::Live) on the wall
/// clock, and they are the only two places that know what time it is.
pub trait World {
    /// Flight time now.
    fn now(&self) -> Time;

    /// Waits for the next event, at most until `deadline`; `None` when the deadline came first. Afterwards [`World::now`] is the
    /// event's time or the deadline.
    fn wait(&mut self, deadline: Time) -> Option<Event>;

    /// Does what the pilot asks: passes a query on, forgets one, passes a cleared command to the craft.
    fn apply(&mut self, action: &Action);
}

/// Someone who watches a flight: progress, recording.
pub trait Observer {
    /// The pilot was told this.
    fn event(&mut self, now: Time, event: &Event) {
        let _ = (now, event);
    }

    /// The pilot wanted this.
    fn action(&mut self, now: Time, action: &Action, pilot: &Pilot) {
        let _ = (now, action, pilot);
    }

    /// Time went on to `now`, before anything else that happens at `now` is told.
    fn time(&mut self, now: Time, pilot: &Pilot) {
        let _ = (now, pilot);
    }
}

/// Flies until the flight is over: on the ground again, or motors cut.
pub fn run(pilot: &mut Pilot, world: &mut dyn World, observers: &mut [&mut dyn Observer]) {
    loop {
        let now = world.now();
        while let Some(action) = pilot.poll(now) {
            for observer in observers.iter_mut() {
                observer.action(now, &action, pilot);
            }
            world.apply(&action);
        }
        let Some(deadline) = pilot.next_deadline() else { return };
        let event = world.wait(deadline);
        let now = world.now();
        for observer in observers.iter_mut() {
            observer.time(now, pilot);
        }
        if let Some(event) = event {
            for observer in observers.iter_mut() {
                observer.event(now, &event);
            }
            pilot.handle(now, event);
        }
    }
}
