//! Execution of low-level skills.

use super::minispec::{SkillCall, Value};
use super::skills::{Argument, Axis, Figure, Skill};
use super::{TypeFly, Waits};
use spf_core::primitives::Primitives;
use spf_core::prompt::{PromptKind, PromptText};
use spf_core::query::QueryKind;
use spf_core::reply::one_line;
use spf_core::time::duration_from_secs;
use spf_pilot::policy::{FailReason, Move, Step};

/// Minimum and maximum move of the second version on a Tello, centimetres.
const MOVE_CM: (f64, f64) = (20.0, 300.0);
/// Longer moves outdate the list of detections, centimetres on a Tello.
const OUTDATING_CM: f64 = 120.0;
/// Maximum turn, degrees.
const MOST_TURN: f64 = 180.0;
/// Larger turns outdate the list of detections, degrees.
const OUTDATING_TURN: f64 = 90.0;
/// Maximum delay, seconds.
const LONGEST_DELAY: f64 = 30.0;
/// "Go to" without replanning: turn for a box at the image edge, degrees per image width from the centre …
const TURN_PER_WIDTH: f64 = 70.0;
/// … and the following hop, centimetres on a Tello.
const WEAK_HOP_CM: f64 = 110.0;

/// Result of a skill.
pub(super) enum Outcome {
    /// An immediate value.
    Value(Value),
    /// A step that must come first.
    Step(Step),
    /// An error: the program fails.
    Error(String),
}

impl TypeFly {
    /// Executes or starts a low-level skill.
    pub(super) fn perform(&mut self, call: SkillCall) -> Outcome {
        let (skill, argument) = match self.library.low(&call) {
            Ok(found) => found,
            Err(why) => return Outcome::Error(why),
        };
        let looks = matches!(skill, Skill::IsVisible | Skill::Measure(_) | Skill::Query | Skill::TurnAndHop);
        if looks && !self.fresh {
            self.waits = Waits::List(call);
            // No frame is available while the program is arriving; its end is the next chance.
            return Outcome::Step(if self.planning.is_some() { Step::Wait } else { Step::Look });
        }
        match skill {
            Skill::Move(axis) => self.shift(axis, argument.number),
            Skill::Turn(clockwise) => self.turn(clockwise, argument.number),
            Skill::Delay => self.delay(argument.number),
            Skill::IsVisible => Outcome::Value(Value::Bool(self.scene.find(&argument.text).is_some())),
            Skill::Measure(figure) => Outcome::Value(self.measure(figure, &argument.text)),
            Skill::Log => {
                self.reading.actions.push(format!("says {}", one_line(&argument.text)));
                Outcome::Value(Value::Bool(true))
            }
            // Every image is in the flight's log anyway.
            Skill::Picture => Outcome::Value(Value::Bool(true)),
            Skill::Query => self.question(argument),
            Skill::TurnAndHop => self.turn_and_hop(&argument.text),
            Skill::RePlan => {
                self.plan_again("it requested a new plan");
                Outcome::Step(if self.is_lost() { Step::Fail(FailReason::NoProgram) } else { Step::Look })
            }
        }
    }

    fn shift(&mut self, axis: Axis, centimetres: f64) -> Outcome {
        if !(centimetres > 0.0 && centimetres.is_finite()) {
            return Outcome::Error(format!("a move of {centimetres} cm is not possible: it must be positive"));
        }
        let scale = self.settings.scale();
        let centimetres = centimetres.clamp(MOVE_CM.0 * scale, MOVE_CM.1 * scale);
        let metres = centimetres / 100.0;
        let still = Primitives::default();
        let primitives = match axis {
            Axis::Forward => Primitives { forward: metres, ..still },
            Axis::Backward => Primitives { forward: -metres, ..still },
            Axis::Left => Primitives { right: -metres, ..still },
            Axis::Right => Primitives { right: metres, ..still },
            Axis::Up => Primitives { climb: metres, ..still },
            Axis::Down => Primitives { climb: -metres, ..still },
        };
        self.fly(primitives, centimetres > OUTDATING_CM * scale)
    }

    fn turn(&mut self, clockwise: bool, degrees: f64) -> Outcome {
        if !degrees.is_finite() {
            return Outcome::Error(format!("a turn by {degrees} degrees is not possible: the angle must be finite"));
        }
        let degrees = degrees.clamp(-MOST_TURN, MOST_TURN);
        let yaw = if clockwise { degrees } else { -degrees }.to_radians();
        self.fly(Primitives { yaw, ..Primitives::default() }, degrees.abs() > OUTDATING_TURN)
    }

    fn turn_and_hop(&mut self, name: &str) -> Outcome {
        let Some(found) = self.scene.find(name) else { return Outcome::Value(Value::Bool(false)) };
        let yaw = (TURN_PER_WIDTH * (found.x - 0.5)).to_radians();
        let forward = WEAK_HOP_CM * self.settings.scale() / 100.0;
        self.fly(Primitives { yaw, forward, ..Primitives::default() }, false)
    }

    fn fly(&mut self, primitives: Primitives, outdates: bool) -> Outcome {
        self.fresh = false;
        self.memory.turned += primitives.yaw;
        self.moved |= Primitives { yaw: 0.0, ..primitives } != Primitives::default();
        self.waits = Waits::Move { outdates: outdates && self.settings.replanning };
        self.reading.primitives = Some(primitives);
        Outcome::Step(Step::Move(Move { primitives, anchor: None, then_rest: true, looks: false }))
    }

    fn delay(&mut self, seconds: f64) -> Outcome {
        if seconds.is_nan() || seconds < 0.0 {
            return Outcome::Error(format!("a wait of {seconds} s is not possible: it must not be negative"));
        }
        self.fresh = false;
        self.waits = Waits::Time { long: duration_from_secs(seconds.min(LONGEST_DELAY)), until: None };
        Outcome::Step(if self.planning.is_some() { Step::Wait } else { Step::Look })
    }

    /// `None` for an object that is not in view: a program that compares it fails, and is planned again.
    fn measure(&self, figure: Figure, name: &str) -> Value {
        self.scene.find(name).map_or(Value::None, |found| {
            Value::Float(match figure {
                Figure::X => found.x,
                Figure::Y => found.y,
                Figure::Width => found.width,
                Figure::Height => found.height,
            })
        })
    }

    fn question(&mut self, argument: Argument) -> Outcome {
        let text = one_line(&argument.text);
        let sent = text.clone();
        let prompt = self.write(&PromptText::shipped(PromptKind::Question), |place| (place == "question").then(|| sent.clone()));
        let query = self.query(QueryKind::Question { text }, prompt);
        self.waits = Waits::Answer(query.id);
        Outcome::Step(Step::Ask(Box::new(query)))
    }
}
