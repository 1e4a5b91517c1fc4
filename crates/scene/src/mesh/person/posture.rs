//! Joint positions: postures and gait, for a person of 1.75 m, x right, y forward, z up, metres.

use core::f64::consts::{PI, TAU};

use glam::Vec3;

use super::super::sketch::cos_sin;
use super::{Held, Posture};

/// Lengths between joints (fractions of stature after Winter, Biomechanics and Motor Control of Human Movement, 2009).
const UPPER_ARM: f32 = 0.30;
const FOREARM: f32 = 0.255;
const THIGH: f32 = 0.43;
const SHANK: f32 = 0.42;
/// Ankle above the sole.
const ANKLE: f32 = 0.08;
/// Hip joints above the ground when standing.
const HIPS: f32 = 0.925;
/// Half the distance of the hip joints and of the shoulder joints.
const HIP: f32 = 0.09;
const SHOULDER: f32 = 0.176;
/// Shoulder joints above the hip joints along the trunk.
const TRUNK: f32 = 0.442;

/// A leg or an arm: hip, knee, ankle; shoulder, elbow, wrist.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limb {
    pub(super) root: Vec3,
    pub(super) bend: Vec3,
    pub(super) end: Vec3,
}

/// A body's joints; left before right.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pose {
    /// Between the hip joints.
    pub(super) pelvis: Vec3,
    /// Along the trunk, and the directions in which hips and shoulders point to their right.
    pub(super) spine: Vec3,
    pub(super) hips_right: Vec3,
    pub(super) shoulders_right: Vec3,
    pub(super) legs: [Limb; 2],
    pub(super) arms: [Limb; 2],
    /// Direction of the toes.
    pub(super) toes: [Vec3; 2],
    /// Turn of the head to the right, radians.
    pub(super) look: f64,
}

/// The parameters of a posture.
struct Plan {
    pelvis: Vec3,
    /// Lean of the trunk forward and turn of the shoulders to the left, radians.
    lean: f64,
    twist: f64,
    ankles: [Vec3; 2],
    toes: [Vec3; 2],
    /// Wrists relative to their shoulders, metres, and the direction of the elbows.
    wrists: [Vec3; 2],
    elbows: [Vec3; 2],
    look: f64,
}

/// The cycle of walking.
pub(super) struct Gait;

impl Gait {
    /// Metres walked in a cycle of two steps (Murray, Drought & Kory 1964: 0.86 of the height).
    pub(super) const STRIDE: f32 = 1.505;
    /// Fraction of the cycle for which a foot is on the ground.
    const STANCE: f32 = 0.6;
    /// Forward and upward motion of the ankle while the foot rolls off over its toes.
    const ROLL: [f32; 2] = [0.09, 0.11];

    /// Ankle, from below the hip, and pitch of the foot (toes down positive, radians) at a fraction of that leg's own cycle.
    fn foot(fraction: f32) -> (Vec3, f64) {
        let half = 0.5 * Self::STANCE * Self::STRIDE;
        if fraction < Self::STANCE {
            // On the ground the foot moves back as fast as the body moves forward: heel strike, flat, heel off.
            let s = fraction / Self::STANCE;
            let strike = (1.0 - s / 0.18).max(0.0);
            let off = ((s - 0.6) / 0.4).max(0.0);
            let pitch = -0.35 * f64::from(strike) + 0.75 * f64::from(off * off);
            let rise = 0.02 * strike + Self::ROLL[1] * off * off;
            return (Vec3::new(0.0, half * (1.0 - 2.0 * s) + Self::ROLL[0] * off * off, ANKLE + rise), pitch);
        }
        let s = (fraction - Self::STANCE) / (1.0 - Self::STANCE);
        let ease = s * s * (3.0 - 2.0 * s);
        let (_, arch) = cos_sin(PI * f64::from(s));
        let start = -half + Self::ROLL[0];
        let lift = Self::ROLL[1] * (1.0 - s) + 0.02 * s + 0.08 * arch;
        let pitch = 0.75 - 1.1 * f64::from(ease);
        (Vec3::new(0.0, start + (half - start) * ease, ANKLE + lift), pitch)
    }

    fn plan(phase: f32) -> Plan {
        let phase = phase - libm::floorf(phase);
        let other = (phase + 0.5) - libm::floorf(phase + 0.5);
        let feet = [Self::foot(phase), Self::foot(other)];
        let (swing, turn) = cos_sin(f64::from(phase) * TAU);
        // Both feet are down, and the body lowest, just after each heel strike.
        let (bob, _) = cos_sin(2.0 * TAU * (f64::from(phase) - 0.05));
        let pelvis = Vec3::new(0.012 * turn, 0.0, HIPS - 0.045 - 0.022 * bob);
        let side = [-1.0f32, 1.0];
        let mut ankles = [Vec3::ZERO; 2];
        let mut toes = [Vec3::Y; 2];
        let mut wrists = [Vec3::ZERO; 2];
        for i in 0..2 {
            ankles[i] = feet[i].0 + Vec3::X * (0.075 * side[i]);
            let (c, s) = cos_sin(feet[i].1);
            toes[i] = Vec3::new(0.06 * side[i], c, -s);
            // Each arm swings with the other leg: the left leg is forward where `swing` is 1.
            let forward = swing * side[i];
            wrists[i] = Vec3::new(0.07 * side[i], 0.05 + 0.22 * forward, -0.52 + 0.05 * forward.abs());
        }
        Plan {
            pelvis,
            lean: 0.05,
            twist: -0.13 * f64::from(swing),
            ankles,
            toes,
            wrists,
            elbows: [Vec3::new(-0.3, -1.0, 0.0), Vec3::new(0.3, -1.0, 0.0)],
            look: 0.0,
        }
    }
}

impl Plan {
    fn standing() -> Self {
        Self {
            pelvis: Vec3::new(0.015, 0.0, HIPS),
            lean: 0.02,
            twist: 0.06,
            ankles: [Vec3::new(-0.13, 0.05, ANKLE), Vec3::new(0.11, -0.03, ANKLE)],
            toes: [Vec3::new(-0.32, 1.0, 0.0), Vec3::new(0.22, 1.0, 0.0)],
            wrists: [Vec3::new(-0.10, 0.09, -0.52), Vec3::new(0.09, 0.04, -0.53)],
            elbows: [Vec3::new(-0.6, -1.0, 0.0), Vec3::new(0.6, -1.0, 0.0)],
            look: 0.2,
        }
    }

    fn sitting(seat: f32) -> Self {
        let reach = (0.42 + 0.25 * (0.45 - seat)).clamp(0.3, 0.6);
        Self {
            pelvis: Vec3::new(0.0, -0.04, seat + 0.095),
            lean: -0.08,
            twist: 0.0,
            ankles: [Vec3::new(-0.13, reach, ANKLE), Vec3::new(0.12, reach - 0.05, ANKLE)],
            toes: [Vec3::new(-0.18, 1.0, 0.0), Vec3::new(0.18, 1.0, 0.0)],
            wrists: [Vec3::new(0.05, 0.31, -0.33), Vec3::new(-0.04, 0.33, -0.33)],
            elbows: [Vec3::new(-0.7, -1.0, -0.2), Vec3::new(0.7, -1.0, -0.2)],
            look: 0.1,
        }
    }

    /// As standing upright; the figure is laid on its back once it is complete.
    fn lying() -> Self {
        Self {
            pelvis: Vec3::new(0.0, 0.0, HIPS),
            lean: 0.0,
            twist: 0.0,
            ankles: [Vec3::new(-0.24, -0.02, ANKLE), Vec3::new(0.13, 0.06, 0.30)],
            toes: [Vec3::new(-0.7, 0.9, 0.35), Vec3::new(0.5, 0.7, -0.55)],
            wrists: [Vec3::new(-0.42, 0.0, 0.28), Vec3::new(0.30, 0.0, -0.40)],
            elbows: [Vec3::new(-1.0, 0.0, -0.4), Vec3::new(1.0, 0.0, 0.2)],
            look: 0.5,
        }
    }

    fn waving() -> Self {
        Self {
            wrists: [Vec3::new(-0.10, 0.07, -0.52), Vec3::new(0.24, 0.08, 0.40)],
            elbows: [Vec3::new(-0.6, -1.0, 0.0), Vec3::new(1.0, 0.1, -0.35)],
            look: 0.0,
            ..Self::standing()
        }
    }
}

impl Pose {
    pub(super) fn of(posture: Posture, phase: f32, seat: f32, holds: Held) -> Self {
        let mut plan = match posture {
            Posture::Standing => Plan::standing(),
            Posture::Walking => Gait::plan(phase),
            Posture::Sitting => Plan::sitting(seat.clamp(0.25, 0.8)),
            Posture::Lying => Plan::lying(),
            Posture::Waving => Plan::waving(),
        };
        // Both hands are waving: a held item stays in the lower one.
        let hand = usize::from(posture != Posture::Waving);
        let outward = if hand == 1 { 1.0 } else { -1.0 };
        match holds {
            Held::Nothing => {}
            Held::Bag | Held::Cone if posture == Posture::Sitting => {}
            Held::Bag => plan.wrists[hand] = Vec3::new(0.10 * outward, 0.02, -0.545),
            Held::Cone => plan.wrists[hand] = Vec3::new(0.20 * outward, 0.12, -0.47),
            Held::Bottle | Held::Umbrella => {
                plan.wrists[hand] = Vec3::new(0.03 * outward, 0.27, -0.20);
                plan.elbows[hand] = Vec3::new(0.5 * outward, -0.6, -1.0);
            }
        }
        Self::joined(&plan)
    }

    fn joined(plan: &Plan) -> Self {
        let (c, s) = cos_sin(plan.lean);
        let spine = Vec3::new(0.0, s, c);
        let (c, s) = cos_sin(plan.twist);
        let shoulders_right = Vec3::new(c, s, 0.0);
        let shoulders = plan.pelvis + spine * TRUNK;
        let leg = |i: usize, side: f32| {
            let root = plan.pelvis + Vec3::X * (HIP * side);
            // Knees point between the toes and straight ahead.
            let hint = (plan.toes[i] * Vec3::new(1.0, 1.0, 0.0)).normalize_or(Vec3::Y) + Vec3::Y;
            jointed(root, plan.ankles[i], [THIGH, SHANK], hint)
        };
        let arm = |i: usize, side: f32| {
            let root = shoulders + shoulders_right * (SHOULDER * side);
            let way = plan.wrists[i];
            let out = shoulders_right * way.x + shoulders_right.cross(Vec3::NEG_Z) * way.y + Vec3::Z * way.z;
            jointed(root, root + out, [UPPER_ARM, FOREARM], plan.elbows[i])
        };
        Self {
            pelvis: plan.pelvis,
            spine,
            hips_right: Vec3::X,
            shoulders_right,
            legs: [leg(0, -1.0), leg(1, 1.0)],
            arms: [arm(0, -1.0), arm(1, 1.0)],
            toes: plan.toes.map(Vec3::normalize),
            look: plan.look,
        }
    }

    /// The point on the trunk's axis `height` above the hip joints.
    pub(super) fn trunk(&self, height: f32) -> Vec3 {
        self.pelvis + self.spine * height
    }

    /// Direction in which the trunk faces.
    pub(super) fn front(&self) -> Vec3 {
        self.spine.cross(self.shoulders_right).normalize()
    }
}

/// A limb of two bones from `root` towards `end`, bending towards `hint`; an end out of reach is moved closer.
fn jointed(root: Vec3, end: Vec3, bones: [f32; 2], hint: Vec3) -> Limb {
    let [a, b] = bones;
    let way = end - root;
    let reach = way.length().clamp((a - b).abs() + 0.02, 0.998 * (a + b));
    let along = way.normalize_or(Vec3::NEG_Z);
    let across = (hint - along * hint.dot(along)).normalize_or(Vec3::Y);
    let foot = (a * a - b * b + reach * reach) / (2.0 * reach);
    let off = (a * a - foot * foot).max(0.0).sqrt();
    Limb { root, bend: root + along * foot + across * off, end: root + along * reach }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bones_keep_their_lengths_in_every_posture() {
        let postures = [Posture::Standing, Posture::Sitting, Posture::Lying, Posture::Waving];
        let still = postures.into_iter().map(|p| Pose::of(p, 0.0, 0.45, Held::Nothing));
        let gait = (0..40).map(|i| Pose::of(Posture::Walking, i as f32 / 40.0, 0.45, Held::Nothing));
        for pose in still.chain(gait) {
            for (limbs, [a, b]) in [(pose.legs, [THIGH, SHANK]), (pose.arms, [UPPER_ARM, FOREARM])] {
                for limb in limbs {
                    let (upper, lower) = ((limb.bend - limb.root).length(), (limb.end - limb.bend).length());
                    assert!((upper - a).abs() < 1e-3 && (lower - b).abs() < 1e-3, "{limb:?}: {upper} {lower}");
                }
            }
        }
    }

    #[test]
    fn a_foot_on_the_ground_stays_where_it_is() {
        // While flat, between strike and heel-off, the foot moves back by as much as the body moves on.
        for i in 0..20 {
            let (a, b) = (0.12 + 0.01 * i as f32, 0.13 + 0.01 * i as f32);
            let slip = Gait::foot(b).0.y - Gait::foot(a).0.y + 0.01 * Gait::STRIDE;
            assert!(slip.abs() < 1e-5, "at {a}: {slip}");
        }
    }

    #[test]
    fn the_gait_closes() {
        let (a, b) = (Pose::of(Posture::Walking, 0.0, 0.45, Held::Nothing), Pose::of(Posture::Walking, 1.0, 0.45, Held::Nothing));
        assert_eq!(a.legs[0].end, b.legs[0].end);
        // Half a cycle later left and right are exchanged.
        let c = Pose::of(Posture::Walking, 0.5, 0.45, Held::Nothing);
        assert!((a.legs[0].end.y - c.legs[1].end.y).abs() < 1e-5 && (a.arms[0].end.y - c.arms[1].end.y).abs() < 0.02);
        // The foot arrives where it will be put down.
        let (end, start) = (Gait::foot(0.9999).0, Gait::foot(0.0).0);
        assert!((end - start).length() < 0.01, "{end} {start}");
        let (off, swing) = (Gait::foot(0.5999).0, Gait::foot(0.6).0);
        assert!((off - swing).length() < 0.01, "{off} {swing}");
    }
}
