//! Answers whose motion a limit refuses. Three in a row end the flight: every further one would be refused and paid for as well.

use spf_core::command::{Command, Manoeuvre, Setpoint};
use spf_core::geometry::{EnuPosition, wrap_angle};
use spf_envelope::{Cause, ClearedCommand, Limits};

use crate::policy::{Move, Step};

/// So many answers in a row end the flight.
pub(crate) const IN_A_ROW: u32 = 3;
/// Of a refused motion a limit leaves less than this fraction. Near a limit the remainder comes and goes with the height noise.
const LEFT: f64 = 0.3;
/// A craft that has come this far since an answer has flown it, metres, though a limit may have cut off its end. Before a fence,
/// climbing and sinking lead nowhere.
const FLOWN: f64 = 0.5;
/// A turn by less than this looks nowhere else, radians: 5°.
const TURNED: f64 = 5.0 / 180.0 * core::f64::consts::PI;
/// The limits that refuse motions. The minimum height is none: a craft often flies at it beside a low target. Neither are people and
/// obstacles, which give way or are flown around.
const REFUSING: [Cause; 3] = [Cause::AltitudeLimit, Cause::DistanceLimit, Cause::GeofenceLimit];
/// Place of the maximum height among them.
const CEILING: usize = 0;

/// What became of the motions of the last answers.
#[derive(Debug, Default)]
pub(crate) struct Refused {
    motion: Motion,
    /// How many answers before it were refused in a row, and how much each limit cut off them.
    row: u32,
    cut: [f64; REFUSING.len()],
}

/// The motion since the last answer: sums of what was wanted, of what each limit cut off it, and of what anything else did, metres.
#[derive(Debug, Default)]
struct Motion {
    /// Where it began, and at which heading.
    from: Option<(EnuPosition, f64)>,
    wanted: f64,
    cut: [f64; REFUSING.len()],
    held: f64,
}

/// What became of one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Came {
    /// The craft flew, or turned elsewhere.
    Flown,
    /// A limit refused it.
    Refused,
    /// There was none, or something else held it, which says nothing about the limits.
    Held,
}

impl Motion {
    fn came(&self, at: EnuPosition, heading: f64) -> Came {
        let (cut, most) = (self.cut.iter().sum::<f64>(), (1.0 - LEFT) * self.wanted);
        let is_below = 2.0 * self.cut[CEILING] >= cut;
        let length = |from: EnuPosition| if is_below { from.distance(at) } else { from.horizontal_distance(at) };
        let moved = self.from.map_or(0.0, |(from, _)| length(from));
        let turned = self.from.map_or(0.0, |(_, from)| wrap_angle(heading - from).abs());
        if moved >= FLOWN {
            Came::Flown
        } else if self.wanted == 0.0 {
            if turned >= TURNED { Came::Flown } else { Came::Held }
        } else if cut >= most {
            Came::Refused
        } else if cut + self.held >= most {
            Came::Held
        } else {
            Came::Flown
        }
    }
}

impl Refused {
    /// Takes a setpoint that was wanted, and what the envelope has left of it.
    /// `seconds`: how long it holds.
    pub(crate) fn setpoint(&mut self, limits: &Limits, wanted: Setpoint, clearance: &ClearedCommand, seconds: f64) {
        let Some(left) = clearance.setpoint() else { return };
        // What the limits of speed take away is no matter of where the craft may be.
        let wanted = slowed(limits, wanted);
        let (right, forward, up) = (wanted.right - left.right, wanted.forward - left.forward, wanted.up - left.up);
        let cut = Setpoint { right, forward, up, yaw_rate: 0.0 }.speed();
        self.cut_off(seconds * wanted.speed(), seconds * cut, clearance.changed);
    }

    /// Takes a manoeuvre that was wanted, and what the envelope has left of it.
    pub(crate) fn manoeuvre(&mut self, wanted: Manoeuvre, clearance: &ClearedCommand) {
        let length = |command: &Command| match command {
            Command::Manoeuvre(Manoeuvre::Go { displacement, .. }) => displacement.length(),
            _ => 0.0,
        };
        let (wanted, left) = (length(&Command::Manoeuvre(wanted)), length(clearance.cleared.get()));
        self.cut_off(wanted, wanted - left, clearance.changed);
    }

    /// Takes a vertical motion that was wanted, and what is left of it before it begins.
    pub(crate) fn climb(&mut self, wanted: f64, left: f64) {
        let limit = if wanted > 0.0 { Cause::AltitudeLimit } else { Cause::FloorLimit };
        self.cut_off(wanted.abs(), (wanted - left).abs(), Some(limit));
    }

    /// Takes how much was wanted, and how much of it was cut off.
    fn cut_off(&mut self, wanted: f64, cut: f64, cause: Option<Cause>) {
        self.motion.wanted += wanted;
        match REFUSING.iter().position(|limit| cause == Some(*limit)) {
            Some(limit) => self.motion.cut[limit] += cut,
            None => self.motion.held += cut,
        }
    }

    /// Begins the account of the next answer, which has come while the craft is here; it flies the last one no more.
    pub(crate) fn answered(&mut self, at: EnuPosition, heading: f64) {
        match self.motion.came(at, heading) {
            Came::Flown => (self.row, self.cut) = (0, Default::default()),
            Came::Refused => {
                self.row += 1;
                self.cut.iter_mut().zip(self.motion.cut).for_each(|(all, of)| *all += of);
            }
            Came::Held => {}
        }
        self.motion = Motion { from: Some((at, heading)), ..Motion::default() };
    }

    /// The limit that ends the flight before the next query, because it has refused the newest motion too, which is over.
    pub(crate) fn over(&self, at: EnuPosition, heading: f64) -> Option<Cause> {
        let is_refused = self.motion.came(at, heading) == Came::Refused;
        (is_refused && self.row + 1 >= IN_A_ROW).then(|| self.most())
    }

    /// Takes the step that an answer leads to. Returns the limit that ends the flight in its place: who turns elsewhere may find the
    /// target there, and who is done, or looks again, is not refused anything.
    pub(crate) fn ends(&mut self, step: &Step) -> Option<Cause> {
        match step {
            Step::Move(motion) if is_search(motion) => {
                self.reset();
                None
            }
            // Whoever stays with somebody who has left the fence waits there for them.
            Step::Follow(_) => {
                self.reset();
                None
            }
            Step::Move(_) | Step::Goto(_) | Step::Keep => (self.row >= IN_A_ROW).then(|| self.most()),
            _ => None,
        }
    }

    /// The limit that has cut off most of the motions in the row.
    fn most(&self) -> Cause {
        let all = |limit: &usize| self.cut[*limit] + self.motion.cut[*limit];
        let most = (0..REFUSING.len()).max_by(|one, other| all(one).total_cmp(&all(other)));
        most.map_or(Cause::GeofenceLimit, |most| REFUSING[most])
    }

    /// Nothing was refused: somebody else has flown, or the target is another.
    pub(crate) fn reset(&mut self) {
        *self = Self::default();
    }
}

/// The limit in words, with its value.
pub(crate) fn named(limit: Cause, limits: &Limits) -> String {
    match limit {
        Cause::AltitudeLimit => format!("the maximum height of {} m", limits.max_altitude),
        Cause::DistanceLimit => format!("the maximum distance of {} m from the take-off point", limits.max_distance),
        _ => "the geofence".to_owned(),
    }
}

/// Whether a move is there to look elsewhere.
fn is_search(motion: &Move) -> bool {
    let primitives = motion.primitives;
    motion.looks || (primitives.forward == 0.0 && primitives.right == 0.0 && primitives.climb == 0.0)
}

/// A setpoint within the limits of speed.
fn slowed(limits: &Limits, wanted: Setpoint) -> Setpoint {
    let level = libm::hypot(wanted.right, wanted.forward);
    let fraction = if level > limits.max_speed { limits.max_speed / level } else { 1.0 };
    Setpoint {
        right: wanted.right * fraction,
        forward: wanted.forward * fraction,
        up: wanted.up.max(-limits.max_climb).min(limits.max_climb),
        yaw_rate: wanted.yaw_rate,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use spf_core::craft::Craft;
    use spf_core::primitives::Primitives;

    const HERE: EnuPosition = EnuPosition { east: 3.0, north: 40.0, up: 5.0 };

    /// Of 2 s at 3 m/s so much is cut off.
    fn fly(refused: &mut Refused, cut: f64, cause: Cause) {
        for _ in 0..20 {
            refused.cut_off(3.0, 3.0 * cut, Some(cause));
        }
    }

    fn goes_on() -> Step {
        let primitives = Primitives { forward: 5.0, ..Primitives::default() };
        Step::Move(Move { primitives, anchor: None, then_rest: false, looks: false })
    }

    #[test]
    fn the_limit_that_refuses_three_in_a_row_is_named() {
        let mut refused = Refused::default();
        refused.answered(HERE, 0.0);
        for cut in [0.9, 0.8] {
            fly(&mut refused, cut, Cause::GeofenceLimit);
            refused.answered(HERE, 0.0);
            assert_eq!(refused.ends(&goes_on()), None);
        }
        fly(&mut refused, 1.0, Cause::AltitudeLimit);
        assert_eq!(refused.over(HERE, 0.0), Some(Cause::GeofenceLimit), "before a fourth is asked for");
        refused.answered(HERE, 0.0);
        assert_eq!(refused.ends(&Step::Done), None);
        assert_eq!(refused.ends(&goes_on()), Some(Cause::GeofenceLimit), "which cut off most of all");
    }

    #[test]
    fn what_holds_the_craft_otherwise_neither_counts_nor_resets() {
        let mut refused = Refused::default();
        refused.answered(HERE, 0.0);
        for cause in [Cause::DistanceLimit, Cause::Person, Cause::DistanceLimit, Cause::Obstacle, Cause::FloorLimit] {
            fly(&mut refused, 0.9, cause);
            refused.answered(HERE, 0.0);
            // A reply that failed moves nothing.
            refused.answered(HERE, 0.0);
        }
        assert_eq!(refused.ends(&goes_on()), None);
        fly(&mut refused, 0.9, Cause::DistanceLimit);
        refused.answered(HERE, 0.0);
        assert_eq!(refused.ends(&goes_on()), Some(Cause::DistanceLimit));
    }

    #[test]
    fn what_is_flown_and_a_turn_elsewhere_begin_anew() {
        let along = EnuPosition { east: HERE.east + FLOWN, ..HERE };
        let turn =
            Move { primitives: Primitives { yaw: 1.0, ..Primitives::default() }, anchor: None, then_rest: true, looks: false };
        for (cut, to, heading, step) in [
            (1.0, along, 0.0, Step::Wait),
            (0.5, HERE, 0.0, Step::Wait),
            (0.0, HERE, 0.3, Step::Wait),
            (1.0, HERE, 0.0, Step::Move(turn)),
        ] {
            let mut refused = Refused::default();
            refused.answered(HERE, 0.0);
            for _ in 0..2 {
                fly(&mut refused, 1.0, Cause::GeofenceLimit);
                refused.answered(HERE, 0.0);
            }
            if heading == 0.0 {
                fly(&mut refused, cut, Cause::GeofenceLimit);
            }
            refused.answered(to, heading);
            assert_eq!(refused.ends(&step), None);
            fly(&mut refused, 1.0, Cause::GeofenceLimit);
            refused.answered(to, heading);
            assert_eq!(refused.ends(&goes_on()), None, "{cut} {step:?}");
        }
    }

    #[test]
    fn a_limit_of_speed_is_no_limit_of_places() {
        let limits = Limits { max_speed: 0.5, max_climb: 0.3, ..Limits::for_craft(&Craft::quad()) };
        let wanted = Setpoint { right: 0.0, forward: 3.0, up: -1.0, yaw_rate: 0.2 };
        assert_eq!(slowed(&limits, wanted), Setpoint { forward: 0.5, up: -0.3, ..wanted });
        assert_eq!(slowed(&Limits::for_craft(&Craft::quad()), wanted), wanted);
    }
}
