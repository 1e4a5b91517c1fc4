//! Control primitives: what a displacement becomes (paper §3.4 and the appendix).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Signed motion of one decision, relative to the pose of its frame. The paper's pitch primitive is `forward`, its throttle
/// primitive is `climb`. `yaw` comes first; `right`, `forward` and `climb` are in the level body frame *after* the yaw.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Primitives {
    /// Turn, radians, clockwise positive (`Δθ = atan2(Sx, Sy)`).
    pub yaw: f64,
    /// Metres along the new heading (`√(Sx² + Sy²)`); negative backs off.
    pub forward: f64,
    /// Metres to the right of the new heading; never from a point, only from policies that move sideways.
    pub right: f64,
    /// Metres up (`Sz`).
    pub climb: f64,
}
