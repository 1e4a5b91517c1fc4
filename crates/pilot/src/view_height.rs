//! Brings a target that has left the image at its upper or lower edge back into view.
//!
//! A craft that flies on to such a target gets nearer to it, and its target farther out of view.

use spf_core::camera::Camera;
use spf_core::geometry::{BodyDisplacement, EnuPosition, Pose};
use spf_core::query::ImagePoint;

/// A target is brought this far inside the image's edge, radians: 5°.
const INSIDE: f64 = 5.0 / 180.0 * core::f64::consts::PI;

/// What would bring a target into view: this climb (a descent, if negative), or this way back, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Correction {
    pub(crate) climb: f64,
    pub(crate) back: f64,
}

/// How far a level craft at `pose` has to climb, or to fly back, to see `target` above the lower and below the upper edge of
/// its image; `None` if it does, or if the target lies beside the image.
pub(crate) fn correction(camera: &Camera, pose: Pose, target: EnuPosition) -> Option<Correction> {
    let BodyDisplacement { forward, right, up } = pose.position.displacement_to(target, pose.attitude.heading);
    if forward <= 0.0 || libm::atan2(right, forward).abs() > camera.half_fov().0 {
        return None;
    }
    let edge = |v: f64| libm::atan(camera.ray(ImagePoint { u: 0.5, v }).up) - camera.tilt;
    let (lowest, highest) = (edge(1.0), edge(0.0));
    let elevation = libm::atan2(up, forward);
    let wanted = if elevation > highest {
        highest - INSIDE
    } else if elevation < lowest {
        lowest + INSIDE
    } else {
        return None;
    };
    let slope = libm::tan(wanted);
    // A level look never shows a target at this height from any distance if the edge lies on the other side of level.
    let away = if slope * up > 0.0 { up / slope } else { f64::INFINITY };
    Some(Correction { climb: up - slope * forward, back: away - forward })
}
