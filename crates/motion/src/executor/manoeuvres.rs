//! Manoeuvres that the craft flies and ends by itself: a turn, then straight to the position. Anything too short for a
//! manoeuvre is flown by setpoints.

use std::collections::VecDeque;

use super::axis::Rules;
use super::sequential::Queue;
use super::{Outcome, TickInput};
use spf_core::command::{Manoeuvre, Setpoint};
use spf_core::geometry::BodyDisplacement;
use spf_core::primitives::Primitives;
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time};

/// Smaller turns cannot be commanded, radians.
const LEAST_TURN: f64 = 1.0 * core::f64::consts::PI / 180.0;
/// A craft that does not report within this time that it is flying a manoeuvre has refused it.
const REPORTED_WITHIN: Duration = Duration::from_millis(500);
/// Overhead of a manoeuvre besides its flight time: command, start, end and acknowledgement, s.
const OVERHEAD: f64 = 4.0;

#[derive(Clone, Debug)]
enum Leg {
    Manoeuvre(Manoeuvre),
    /// The remainder for setpoints.
    Short(Primitives),
}

/// A manoeuvre in progress.
#[derive(Clone, Copy, Debug)]
struct UnderWay {
    since: Time,
    /// Whether the craft has reported that it is flying it.
    reported: bool,
}

/// The manoeuvres of one decision, in order.
#[derive(Clone, Debug)]
pub(super) struct Manoeuvres {
    legs: VecDeque<Leg>,
    under_way: Option<UnderWay>,
    short: Option<Queue>,
    rules: Rules,
}

impl Manoeuvres {
    pub(super) fn new(primitives: Primitives, rules: Rules) -> Self {
        let mut legs = VecDeque::new();
        if primitives.yaw.abs() >= LEAST_TURN {
            legs.push_back(Leg::Manoeuvre(Manoeuvre::Turn { angle: primitives.yaw }));
        }
        let Primitives { right, forward, climb: up, .. } = primitives;
        let longest = BodyDisplacement { right, forward, up }.max_component();
        if longest >= Manoeuvre::MIN_DISPLACEMENT {
            // Equal parts, so that the last is not too short to be commanded. 20 is far more than ever needed.
            let parts = libm::ceil(longest / Manoeuvre::MAX_DISPLACEMENT).min(20.0);
            let displacement = BodyDisplacement { right: right / parts, forward: forward / parts, up: up / parts };
            let speed = displacement.speed_within(rules.craft.cruise_speed, rules.craft.climb_speed);
            let go = Manoeuvre::Go { displacement, speed };
            legs.extend((0..parts as usize).map(|_| Leg::Manoeuvre(go)));
        } else if longest > 0.0 {
            legs.push_back(Leg::Short(Primitives { yaw: 0.0, ..primitives }));
        }
        Self { legs, under_way: None, short: None, rules }
    }

    /// Maximum extra time beyond the flight time at full speed, s.
    pub(super) fn overhead(&self) -> f64 {
        OVERHEAD * self.legs.len() as f64
    }

    /// Takes the craft's report, measured at `time`.
    pub(super) fn observe(&mut self, time: Time, phase: FlightPhase) {
        let Some(under_way) = self.under_way.as_mut().filter(|under_way| time > under_way.since) else { return };
        if phase == FlightPhase::Manoeuvring {
            under_way.reported = true;
        } else if under_way.reported || time >= under_way.since + REPORTED_WITHIN {
            self.under_way = None;
        }
    }

    pub(super) fn tick(&mut self, view: &TickInput<'_>) -> Outcome {
        if self.under_way.is_some() {
            return Outcome::Wait;
        }
        if let Some(queue) = &mut self.short {
            return queue.tick(view);
        }
        // Each starts where the previous one has come to rest.
        match if view.rest { self.legs.pop_front() } else { None } {
            Some(Leg::Manoeuvre(manoeuvre)) => {
                self.under_way = Some(UnderWay { since: view.now, reported: false });
                Outcome::Begin(manoeuvre)
            }
            Some(Leg::Short(primitives)) => {
                let mut queue = Queue::new(view.state, primitives, self.rules);
                let outcome = queue.tick(view);
                self.short = Some(queue);
                outcome
            }
            None if self.legs.is_empty() => Outcome::Arrived,
            None => Outcome::Fly(Setpoint::HOLD),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::executor::Ending;
    use spf_core::craft::Craft;

    fn legs(yaw: f64, forward: f64, climb: f64) -> Vec<String> {
        let rules = Rules { craft: Craft::tello(), ending: Ending::Measured };
        let manoeuvres = Manoeuvres::new(Primitives { yaw, forward, right: 0.0, climb }, rules);
        let reported = |leg: &Leg| match leg {
            Leg::Manoeuvre(Manoeuvre::Turn { angle }) => format!("turn {:.0}", angle.to_degrees()),
            Leg::Manoeuvre(Manoeuvre::Go { displacement, speed }) => {
                format!("go {:.2} {:.2} at {speed:.2}", displacement.forward, displacement.up)
            }
            Leg::Short(primitives) => format!("short {:.2} {:.2}", primitives.forward, primitives.climb),
        };
        manoeuvres.legs.iter().map(reported).collect()
    }

    #[test]
    fn hand_worked_manoeuvres() {
        assert_eq!(legs(0.5, 1.5, -0.1), ["turn 29", "go 1.50 -0.10 at 1.00"]);
        // Too long for one: three of equal length. At 45° the climb's 0.8 m/s allow 1.13 m/s along the path.
        assert_eq!(legs(0.0, 11.4, 0.0), ["go 3.80 0.00 at 1.00"; 3]);
        assert_eq!(legs(0.0, 2.0, 2.0), ["go 2.00 2.00 at 1.13"]);
        // Within 20 cm on every axis, and a turn within a degree.
        assert_eq!(legs(0.01, 0.19, 0.19), ["short 0.19 0.19"]);
        assert_eq!(legs(-3.0, 0.0, 0.0), ["turn -172"]);
        assert!(legs(0.0, 0.0, 0.0).is_empty());
    }
}
