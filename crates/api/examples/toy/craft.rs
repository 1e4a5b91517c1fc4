//! The parameters of the toy.

use spf_core::craft::Craft;

/// It reaches a commanded velocity at once. Its parameters must state that, because the pilot predicts from them when a
/// move has ended and where the craft comes to rest: with those of a slower craft it would wait for motion that is
/// already over, and correct errors that do not exist.
pub(super) fn figures() -> Craft {
    // Metres and radians per second squared: any velocity within about a thousandth of a second.
    let at_once = 1000.0;
    let accelerations = Craft { acceleration: at_once, climb_acceleration: at_once, yaw_acceleration: at_once, ..Craft::quad() };
    Craft { lag: 0.0, dead_time: 0.0, ..accelerations }
}
