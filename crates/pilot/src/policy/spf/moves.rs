//! Motions that start from where the frame was taken and end at rest.

use crate::policy::{Move, Reading, Step, View};
use spf_core::primitives::Primitives;

/// How far the craft backs off from what is in its way, metres.
pub(super) const BACK_OFF: f64 = 1.0;

/// A motion after which the next frame is taken at rest.
pub(super) fn to_rest(view: &View, primitives: Primitives) -> Step {
    Step::Move(Move { primitives, anchor: Some(view.pose), then_rest: true, looks: false })
}

/// The same as what has been read in a reply.
pub(super) fn read_to_rest(view: &View, primitives: Primitives, reading: &mut Reading) -> Step {
    reading.primitives = Some(primitives);
    to_rest(view, primitives)
}

/// A turn in place by `yaw` radians, clockwise positive.
pub(super) fn turn(view: &View, yaw: f64, reading: &mut Reading) -> Step {
    read_to_rest(view, Primitives { yaw, ..Primitives::default() }, reading)
}

/// A step back of so many metres. The pilot flies it only over what was seen, or flown through, in the last seconds.
pub(super) fn back_off(view: &View, metres: f64, why: &str, reading: &mut Reading) -> Step {
    reading.actions.push(why.to_owned());
    read_to_rest(view, Primitives { forward: -metres, ..Primitives::default() }, reading)
}
