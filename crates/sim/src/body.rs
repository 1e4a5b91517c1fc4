//! Response of the body to a velocity setpoint, tick by tick: lag, limits, tilt, drag, wind. No scene, no flight
//! phases.

use spf_core::command::Setpoint;
use spf_core::geometry::{Attitude, EnuPosition, EnuVelocity, Pose, wrap_angle};

use crate::model::{GRAVITY, Model};

/// Motion of a rigid craft in the world frame.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Body {
    pub(crate) position: EnuPosition,
    pub(crate) velocity: EnuVelocity,
    pub(crate) attitude: Attitude,
    pub(crate) yaw_rate: f64,
    /// Wind as estimated by the craft's controller: east, north.
    pub(crate) learned: (f64, f64),
}

/// Coefficients of a tick, computed once per model and tick length.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Response {
    step: f64,
    /// Acceleration per velocity error that makes the discrete response exactly first-order, 1/s.
    gain: f64,
    tilt_share: f64,
    wind_share: f64,
    thrust_limit: f64,
}

impl Response {
    pub(crate) fn new(model: &Model, step: f64) -> Self {
        let fraction = |lag: f64| if lag > 0.0 { 1.0 - libm::exp(-step / lag) } else { 1.0 };
        Self {
            step,
            gain: fraction(model.craft.lag) / step,
            tilt_share: fraction(model.tilt_lag),
            wind_share: fraction(model.wind_lag),
            thrust_limit: GRAVITY * libm::tan(model.max_tilt),
        }
    }
}

/// Scales a vector down to the length `limit`.
fn limited(pair: (f64, f64), limit: f64) -> (f64, f64) {
    let square = pair.0 * pair.0 + pair.1 * pair.1;
    if square <= limit * limit {
        return pair;
    }
    let fraction = limit / libm::sqrt(square);
    (pair.0 * fraction, pair.1 * fraction)
}

impl Body {
    pub(crate) fn pose(&self) -> Pose {
        Pose { position: self.position, attitude: self.attitude }
    }

    /// One tick with motors on. `creep` is the craft's unmeasured drift, east and north, m/s.
    ///
    /// The controller requests the acceleration that makes the velocity follow with first-order lag, within the craft's
    /// limits, and the thrust that balances the drag of its own motion and of the estimated wind; tilt bounds the
    /// thrust. In still air and within the limits, the response is the first-order lag alone.
    pub(crate) fn follow(&mut self, model: &Model, response: &Response, setpoint: Setpoint, air: EnuVelocity, creep: (f64, f64)) {
        let step = response.step;
        let craft = &model.craft;

        let wanted = setpoint.yaw_rate.clamp(-model.max_yaw_rate, model.max_yaw_rate);
        let turning = ((wanted - self.yaw_rate) * response.gain).clamp(-craft.yaw_acceleration, craft.yaw_acceleration);
        let before = self.yaw_rate;
        self.yaw_rate += turning * step;
        self.attitude.heading = wrap_angle(self.attitude.heading + 0.5 * (before + self.yaw_rate) * step);
        let (sin, cos) = (libm::sin(self.attitude.heading), libm::cos(self.attitude.heading));

        let (right, forward) = limited((setpoint.right, setpoint.forward), model.max_speed);
        let east = right * cos + forward * sin + creep.0;
        let north = forward * cos - right * sin + creep.1;
        let requested = limited(
            ((east - self.velocity.east) * response.gain, (north - self.velocity.north) * response.gain),
            craft.acceleration,
        );
        let thrust = limited(
            (
                requested.0 + model.drag * (self.velocity.east - self.learned.0),
                requested.1 + model.drag * (self.velocity.north - self.learned.1),
            ),
            response.thrust_limit,
        );
        let gained =
            (thrust.0 - model.drag * (self.velocity.east - air.east), thrust.1 - model.drag * (self.velocity.north - air.north));
        self.learned.0 += (air.east - self.learned.0) * response.wind_share;
        self.learned.1 += (air.north - self.learned.1) * response.wind_share;

        let climb = setpoint.up.clamp(-model.max_sink, model.max_climb);
        let lift = ((climb - self.velocity.up) * response.gain).clamp(-craft.climb_acceleration, craft.climb_acceleration);
        self.accelerate((gained.0, gained.1, lift), step);

        // Thrust along the body's own axes; nose down (negative pitch) to push forward, right side down to push right.
        let (ahead, aside) = (thrust.0 * sin + thrust.1 * cos, thrust.0 * cos - thrust.1 * sin);
        let (pitch, roll) = (-libm::atan(ahead / GRAVITY), libm::atan(aside / GRAVITY));
        self.attitude.pitch += (pitch - self.attitude.pitch) * response.tilt_share;
        self.attitude.roll += (roll - self.attitude.roll) * response.tilt_share;
    }

    /// One tick without motors: gravity and drag; the attitude does not change.
    pub(crate) fn fall(&mut self, model: &Model, response: &Response, air: EnuVelocity) {
        self.yaw_rate = 0.0;
        let v = self.velocity;
        let pull = -GRAVITY - model.drag * v.up;
        self.accelerate((-model.drag * (v.east - air.east), -model.drag * (v.north - air.north), pull), response.step);
    }

    /// Comes to rest, level.
    pub(crate) fn rest(&mut self) {
        self.stop();
        self.attitude.pitch = 0.0;
        self.attitude.roll = 0.0;
    }

    /// Sets the velocity to zero.
    pub(crate) fn stop(&mut self) {
        self.velocity = EnuVelocity::default();
        self.yaw_rate = 0.0;
    }

    fn accelerate(&mut self, acceleration: (f64, f64, f64), step: f64) {
        let before = self.velocity;
        self.velocity.east += acceleration.0 * step;
        self.velocity.north += acceleration.1 * step;
        self.velocity.up += acceleration.2 * step;
        self.position.east += 0.5 * (before.east + self.velocity.east) * step;
        self.position.north += 0.5 * (before.north + self.velocity.north) * step;
        self.position.up += 0.5 * (before.up + self.velocity.up) * step;
    }
}
