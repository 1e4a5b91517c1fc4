//! Low-level skills: what a call comes to. Nothing here remembers anything.

use super::TypeFlySettings;
use super::minispec::Value;
use super::scene::Scene;
use super::skills::{Argument, Axis, Figure, Skill};
use spf_core::primitives::Primitives;
use spf_core::reply::one_line;
use spf_core::time::{Duration, duration_from_secs};

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

/// What a skill comes to.
pub(super) enum Action {
    /// An immediate value.
    Value(Value),
    /// True, after these words for the user.
    Say(String),
    /// A move; `outdates` if it is so long that the list of detections becomes invalid.
    Fly { primitives: Primitives, outdates: bool },
    /// A delay.
    Delay(Duration),
    /// A question to the model about the list.
    Ask(String),
    /// The end of this program, and another one.
    RePlan,
    /// An error: the program fails.
    Error(String),
}

/// Whether a skill needs a list of the current view.
pub(super) fn looks(skill: Skill) -> bool {
    matches!(skill, Skill::IsVisible | Skill::Measure(_) | Skill::Query | Skill::TurnAndHop)
}

/// What a skill comes to, with this list of detections.
pub(super) fn perform(skill: Skill, argument: &Argument, scene: &Scene, settings: &TypeFlySettings) -> Action {
    match skill {
        Skill::Move(axis) => shift(axis, argument.number, settings),
        Skill::Turn(clockwise) => turn(clockwise, argument.number),
        Skill::Delay => delay(argument.number),
        Skill::IsVisible => Action::Value(Value::Bool(scene.find(&argument.text).is_some())),
        Skill::Measure(figure) => Action::Value(measure(figure, &argument.text, scene)),
        Skill::Log => Action::Say(format!("says {}", one_line(&argument.text))),
        // Every image is in the flight's log anyway.
        Skill::Picture => Action::Value(Value::Bool(true)),
        Skill::Query => Action::Ask(one_line(&argument.text)),
        Skill::TurnAndHop => turn_and_hop(&argument.text, scene, settings),
        Skill::RePlan => Action::RePlan,
    }
}

fn shift(axis: Axis, centimetres: f64, settings: &TypeFlySettings) -> Action {
    if !(centimetres > 0.0 && centimetres.is_finite()) {
        return Action::Error(format!("a move of {centimetres} cm is not possible: it must be positive"));
    }
    let scale = settings.scale();
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
    Action::Fly { primitives, outdates: centimetres > OUTDATING_CM * scale }
}

fn turn(clockwise: bool, degrees: f64) -> Action {
    if !degrees.is_finite() {
        return Action::Error(format!("a turn by {degrees} degrees is not possible: the angle must be finite"));
    }
    let degrees = degrees.clamp(-MOST_TURN, MOST_TURN);
    let yaw = if clockwise { degrees } else { -degrees }.to_radians();
    Action::Fly { primitives: Primitives { yaw, ..Primitives::default() }, outdates: degrees.abs() > OUTDATING_TURN }
}

fn turn_and_hop(name: &str, scene: &Scene, settings: &TypeFlySettings) -> Action {
    let Some(found) = scene.find(name) else { return Action::Value(Value::Bool(false)) };
    let yaw = (TURN_PER_WIDTH * (found.x - 0.5)).to_radians();
    let forward = WEAK_HOP_CM * settings.scale() / 100.0;
    Action::Fly { primitives: Primitives { yaw, forward, ..Primitives::default() }, outdates: false }
}

fn delay(seconds: f64) -> Action {
    if seconds.is_nan() || seconds < 0.0 {
        return Action::Error(format!("a wait of {seconds} s is not possible: it must not be negative"));
    }
    Action::Delay(duration_from_secs(seconds.min(LONGEST_DELAY)))
}

/// `None` for an object that is not in view: a program that compares it fails, and is planned again.
fn measure(figure: Figure, name: &str, scene: &Scene) -> Value {
    scene.find(name).map_or(Value::None, |found| {
        Value::Float(match figure {
            Figure::X => found.x,
            Figure::Y => found.y,
            Figure::Width => found.width,
            Figure::Height => found.height,
        })
    })
}
