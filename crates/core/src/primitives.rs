//! Control primitives: the decomposition of a displacement (paper §3.4 and the appendix).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::command::Setpoint;
use crate::craft::Craft;
use crate::geometry::BodyDisplacement;

/// Signed motion of one decision, relative to the pose of its frame. `forward` is the paper's pitch primitive, `climb`
/// its throttle primitive. `yaw` comes first; `right`, `forward` and `climb` are in the level body frame *after* the
/// yaw.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Primitives {
    /// Turn, radians, clockwise positive (`Δθ = atan2(Sx, Sy)`).
    pub yaw: f64,
    /// Metres along the new heading (`√(Sx² + Sy²)`); negative is backwards.
    pub forward: f64,
    /// Metres to the right of the new heading; only used by policies that move sideways, never for a point.
    pub right: f64,
    /// Metres up (`Sz`).
    pub climb: f64,
}

/// One kind of control primitive. The order of the variants is that of the queue.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PrimitiveKind {
    /// Turn about the vertical, the paper's yaw.
    Yaw,
    /// Along the heading, the paper's pitch.
    Forward,
    /// Sideways; not in the paper.
    Right,
    /// Up or down, the paper's throttle.
    Climb,
}

impl PrimitiveKind {
    /// The order in which sequential motion flies primitives (paper, appendix): yaw, forward, sideways, up.
    pub const QUEUE: [Self; 4] = [Self::Yaw, Self::Forward, Self::Right, Self::Climb];

    /// The craft's preset speed for this primitive: m/s, or rad/s for yaw.
    #[must_use]
    pub fn speed(self, craft: &Craft) -> f64 {
        match self {
            Self::Yaw => craft.yaw_rate,
            Self::Forward | Self::Right => craft.cruise_speed,
            Self::Climb => craft.climb_speed,
        }
    }

    /// The craft's acceleration limit for this primitive: m/s², or rad/s² for yaw.
    #[must_use]
    pub fn acceleration(self, craft: &Craft) -> f64 {
        match self {
            Self::Yaw => craft.yaw_acceleration,
            Self::Forward | Self::Right => craft.acceleration,
            Self::Climb => craft.climb_acceleration,
        }
    }

    /// The setpoint that moves along this axis alone, at a signed speed in m/s, or rad/s for yaw.
    #[must_use]
    pub fn setpoint(self, speed: f64) -> Setpoint {
        match self {
            Self::Yaw => Setpoint { yaw_rate: speed, ..Setpoint::HOLD },
            Self::Forward => Setpoint { forward: speed, ..Setpoint::HOLD },
            Self::Right => Setpoint { right: speed, ..Setpoint::HOLD },
            Self::Climb => Setpoint { up: speed, ..Setpoint::HOLD },
        }
    }
}

impl Primitives {
    /// Decomposes a displacement of the level body frame (paper §3.4): `Δθ = atan2(Sx, Sy)`, `√(Sx² + Sy²)`, `Sz`. A
    /// purely vertical displacement does not turn. The result is never sideways or backwards: the craft turns towards a
    /// target behind it.
    ///
    /// ```
    /// use spf_core::geometry::BodyDisplacement;
    /// use spf_core::primitives::Primitives;
    ///
    /// // 3 m right, 4 m forward, 1 m up: turn by atan2(3, 4) = 36.87°, fly 5 m, climb 1 m.
    /// let primitives = Primitives::from_displacement(BodyDisplacement { right: 3.0, forward: 4.0, up: 1.0 });
    /// assert!((primitives.yaw.to_degrees() - 36.87).abs() < 0.01);
    /// assert!((primitives.forward - 5.0).abs() < 1e-9);
    /// assert_eq!(primitives.climb, 1.0);
    /// ```
    #[must_use]
    pub fn from_displacement(displacement: BodyDisplacement) -> Self {
        let BodyDisplacement { right, forward, up } = displacement;
        Self { yaw: libm::atan2(right, forward), forward: libm::hypot(right, forward), right: 0.0, climb: up }
    }

    /// The resulting displacement, in the level body frame *before* the yaw.
    #[must_use]
    pub fn to_displacement(&self) -> BodyDisplacement {
        let (sin, cos) = (libm::sin(self.yaw), libm::cos(self.yaw));
        BodyDisplacement {
            right: self.forward * sin + self.right * cos,
            forward: self.forward * cos - self.right * sin,
            up: self.climb,
        }
    }

    /// Signed magnitude of one primitive: metres, or radians for yaw.
    #[must_use]
    pub fn magnitude(&self, kind: PrimitiveKind) -> f64 {
        match kind {
            PrimitiveKind::Yaw => self.yaw,
            PrimitiveKind::Forward => self.forward,
            PrimitiveKind::Right => self.right,
            PrimitiveKind::Climb => self.climb,
        }
    }

    /// Duration of each primitive at the craft's preset speed, seconds: magnitude / speed (paper §3.4 and the
    /// appendix), in the order of [`PrimitiveKind::QUEUE`].
    #[must_use]
    pub fn durations(&self, craft: &Craft) -> [f64; 4] {
        PrimitiveKind::QUEUE.map(|kind| self.magnitude(kind).abs() / kind.speed(craft))
    }

    /// True if every component is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        PrimitiveKind::QUEUE.iter().all(|&kind| self.magnitude(kind).is_finite())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Right 3, forward 4, up 1: turn by atan2(3, 4) = 36.87°, fly 5 m, climb 1 m; on a quad at 3 m/s, 1 m/s and 95 °/s that
    /// takes 0.388, 1.667, 0 and 1 s.
    #[test]
    fn decomposition_by_hand() {
        let primitives = Primitives::from_displacement(BodyDisplacement { right: 3.0, forward: 4.0, up: 1.0 });
        assert!((primitives.yaw.to_degrees() - 36.869_897_645_8).abs() < 1e-9);
        assert!((primitives.forward - 5.0).abs() < 1e-12 && (primitives.climb - 1.0).abs() < 1e-12);
        for (got, expected) in primitives.durations(&Craft::quad()).into_iter().zip([0.3881, 1.6667, 0.0, 1.0]) {
            assert!((got - expected).abs() < 1e-4, "{got} {expected}");
        }
        let straight_up = Primitives::from_displacement(BodyDisplacement { right: 0.0, forward: 0.0, up: 2.0 });
        assert_eq!((straight_up.yaw, straight_up.forward), (0.0, 0.0));
    }

    /// Failing 10: the step scales lengths, never the angle.
    #[test]
    fn failing_10_yaw_does_not_scale_with_the_step() {
        let near = Primitives::from_displacement(BodyDisplacement { right: 0.1, forward: 0.2, up: 0.05 });
        let far = Primitives::from_displacement(BodyDisplacement { right: 5.0, forward: 10.0, up: 2.5 });
        assert!((near.yaw - far.yaw).abs() < 1e-12);
        let turn = |p: Primitives| p.durations(&Craft::tello())[0];
        assert!((turn(near) - turn(far)).abs() < 1e-12);
        assert!((far.forward / near.forward - 50.0).abs() < 1e-9);
    }

    proptest! {
        #[test]
        fn durations_times_speeds_give_the_displacement(right in -10.0..10.0, forward in -10.0..10.0, up in -5.0..5.0) {
            let craft = Craft::tello();
            let requested = BodyDisplacement { right, forward, up };
            let primitives = Primitives::from_displacement(requested);
            let mut flown = Primitives::default();
            for (kind, duration) in PrimitiveKind::QUEUE.into_iter().zip(primitives.durations(&craft)) {
                let magnitude = (kind.speed(&craft) * duration).copysign(primitives.magnitude(kind));
                match kind {
                    PrimitiveKind::Yaw => flown.yaw = magnitude,
                    PrimitiveKind::Forward => flown.forward = magnitude,
                    PrimitiveKind::Right => flown.right = magnitude,
                    PrimitiveKind::Climb => flown.climb = magnitude,
                }
            }
            let got = flown.to_displacement();
            let error = (got.right - right).abs() + (got.forward - forward).abs() + (got.up - up).abs();
            prop_assert!(error < 1e-9, "{got:?}");
        }
    }
}
