//! From the simulator's state to what the pilot is told.

use spf_core::time::Time;

use super::axes;
use super::control::{Control, Seen};
use super::opening::{quaternion, vector};
use super::senses::{Senses, Truth};
use super::wire::structs::MultirotorState;

/// Why a state cannot be told.
const NO_NUMBER: &str = "its pose is no number";
const STANDS_STILL: &str = "its time stands still (is it paused by another program?)";
/// So many states in a row with the same time are more than a slow simulator.
const STILL: u32 = 10;

/// Reports the states of one vehicle.
#[derive(Debug)]
pub(super) struct Reporter {
    senses: Senses,
    /// The simulator's time of the newest state, ns, and how often it has come again.
    stamp: Option<(u64, u32)>,
    /// What was wrong with the last one.
    fault: Option<&'static str>,
    /// Height of the ground where it last stood, metres above the origin.
    ground: f64,
}

impl Reporter {
    /// With these senses.
    pub(super) fn new(senses: Senses) -> Self {
        Self { senses, stamp: None, fault: None, ground: 0.0 }
    }

    /// Reports a state that was measured and received at these times. One that repeats an earlier one is none, and one that is no
    /// number neither: without reports the envelope holds the craft.
    pub(super) fn report(&mut self, received: Time, measured: Time, state: &MultirotorState, control: &mut Control) {
        let fault = self.fault_of(received, measured, state, control);
        if let Some(why) = fault.filter(|_| self.fault != fault) {
            control.warn(why);
        }
        self.fault = fault;
    }

    fn fault_of(
        &mut self,
        received: Time,
        measured: Time,
        state: &MultirotorState,
        control: &mut Control,
    ) -> Option<&'static str> {
        let again = self.stamp.filter(|(stamp, _)| *stamp == state.timestamp).map_or(0, |(_, again)| again.saturating_add(1));
        self.stamp = Some((state.timestamp, again));
        if again > 0 {
            return if again >= STILL { Some(STANDS_STILL) } else { self.fault };
        }
        let Some(truth) = truth_of(state) else { return Some(NO_NUMBER) };
        let stands = control.stands(state.landed_state == 0);
        if stands {
            self.ground = truth.position.up;
        }
        let told = self.senses.report(&truth, measured, stands);
        let seen = Seen {
            at: measured,
            height: truth.position.up - self.ground,
            speed: truth.velocity.speed(),
            landed: state.landed_state == 0,
        };
        control.handle_report(received, seen, told);
        None
    }
}

/// A state in our axes; `None` if it is no number.
pub(super) fn truth_of(state: &MultirotorState) -> Option<Truth> {
    let kinematics = &state.kinematics_estimated;
    let truth = Truth {
        stamp: state.timestamp,
        position: axes::position(vector(kinematics.position)),
        velocity: axes::velocity(vector(kinematics.linear_velocity)),
        attitude: axes::attitude(quaternion(kinematics.orientation))?,
        // About the body's down axis: clockwise, of a craft that is nearly level.
        yaw_rate: kinematics.angular_velocity.z_val,
    };
    truth.is_finite().then_some(truth)
}
