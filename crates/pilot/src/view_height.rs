//! Brings a target that has left the image at its upper or lower edge back into view.
//!
//! A craft that flies on to such a target gets nearer to it, and its target farther out of view.

use crate::policy::Move;
use spf_core::camera::Camera;
use spf_core::geometry::{BodyDisplacement, EnuPosition, Pose};
use spf_core::primitives::Primitives;
use spf_core::query::ImagePoint;
use spf_core::time::Time;

use super::Pilot;
use super::unseen::may_overhang;

/// A target is brought this far inside the image's edge, radians: 5°.
const INSIDE: f64 = 5.0 / 180.0 * core::f64::consts::PI;
/// Longest vertical motion, and longest way back, that one reply permits, metres.
const AT_MOST: f64 = 1.5;
/// A correction below this is not flown, metres.
const WORTH_FLYING: f64 = 0.15;

/// What would bring a target into view: this climb (a descent, if negative), or this way back, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Correction {
    pub(super) climb: f64,
    pub(super) back: f64,
}

/// How far a level craft at `pose` has to climb, or to fly back, to see `target` above the lower and below the upper edge of
/// its image; `None` if it does, or if the target lies beside the image.
pub(super) fn correction(camera: &Camera, pose: Pose, target: EnuPosition) -> Option<Correction> {
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

impl Pilot {
    /// Climbs or sinks so that the next frame shows a target above or below the image, or flies back where that is not
    /// possible. Returns whether the target lies there.
    pub(super) fn bring_into_view(&mut self, now: Time, target: EnuPosition) -> bool {
        let Some(Correction { climb, back }) = correction(&self.tilted_camera(), self.known_pose(now), target) else {
            return false;
        };
        let climb = climb.clamp(-AT_MOST, AT_MOST);
        let (down, up) = self.envelope.vertical_room();
        let room = climb.clamp(-down.max(0.0), up.max(0.0));
        // Boxes do not show what reaches over or under them.
        let is_safe = self.settings.guidance.sensor || !may_overhang(target, self.known_pose(now).position, room);
        let primitives = if room.abs() > WORTH_FLYING && is_safe && self.barred(now, room).is_none() {
            Primitives { climb: room, ..Primitives::default() }
        } else {
            Primitives { forward: -back.clamp(0.0, AT_MOST), ..Primitives::default() }
        };
        self.begin_move(now, Move { primitives, anchor: None, then_rest: true, looks: false });
        true
    }
}
