//! Skin and hair: head, neck, hands, and the parts of arms and legs not covered by clothes.

use glam::Vec3;

use super::super::Sketch;
use super::super::round::{Ring, Section, Skin};
use super::super::sketch::cos_sin;
use super::posture::{Limb, Pose};
use super::{Bottom, Hair, Headgear, Person, Top};

/// The dimensions below are for a skull 0.22 m high; with hair and chin a head is slightly higher.
const HEAD: f32 = 1.07;

/// The head's own frame: middle of the skull, right, front, up.
#[derive(Clone, Copy, Debug)]
pub(super) struct Head {
    pub(super) centre: Vec3,
    right: Vec3,
    front: Vec3,
    up: Vec3,
}

impl Head {
    pub(super) fn of(pose: &Pose) -> Self {
        let (c, s) = cos_sin(pose.look);
        let (right, front) = (pose.shoulders_right, pose.front());
        let (right, front) = (right * c - front * s, front * c + right * s);
        Self { centre: pose.trunk(0.695) + front * 0.022, right, front, up: right.cross(front) }
    }

    /// A point by metres to the right, the front and upwards of the middle of the skull.
    pub(super) fn at(&self, right: f32, front: f32, up: f32) -> Vec3 {
        self.centre + (self.right * right + self.front * front + self.up * up) * HEAD
    }

    /// A level cross-section: height above the middle, half width, half depth, offset to the front.
    pub(super) fn ring(&self, (up, wide, deep, front): (f32, f32, f32, f32)) -> Ring {
        Ring { centre: self.at(0.0, front, up), side: self.right * (wide * HEAD), up: self.front * (deep * HEAD) }
    }
}

pub(super) fn draw(figure: &mut Sketch, pose: &Pose, person: &Person) {
    let head = Head::of(pose);
    face(figure, &head);
    hair(figure, &head, person);
    let neck = [
        Section::round(pose.trunk(0.50), 0.06),
        Section::round(pose.trunk(0.565), 0.052),
        Section::round(head.at(0.0, -0.012, -0.07), 0.052),
    ];
    figure.on("skin").limb(&neck, pose.shoulders_right, Skin::open(8));
    for (arm, side) in pose.arms.iter().zip([-1.0, 1.0]) {
        hand(figure, arm, pose.front(), side);
        if person.top == Top::Shirt {
            let half = arm.root.lerp(arm.bend, 0.45);
            let bare = [
                Section::round(half, 0.040),
                Section::round(arm.bend, 0.037),
                Section::round(arm.bend.lerp(arm.end, 0.25), 0.037),
                Section::round(arm.end, 0.026),
            ];
            figure.on("skin").limb(&bare, pose.shoulders_right, Skin::open(8));
        }
    }
    if person.bottom != Bottom::Trousers {
        for leg in &pose.legs {
            let calf = leg.bend.lerp(leg.end, 0.3) - pose.front() * 0.012;
            let bare = [
                Section::round(leg.root.lerp(leg.bend, 0.5), 0.07),
                Section::round(leg.bend, 0.052),
                Section::round(calf, 0.054),
                Section::round(leg.end, 0.036),
            ];
            figure.on("skin").limb(&bare, pose.hips_right, Skin::open(8));
        }
    }
}

fn face(figure: &mut Sketch, head: &Head) {
    let skull = [
        (-0.112, 0.030, 0.030, 0.052),
        (-0.092, 0.052, 0.056, 0.030),
        (-0.050, 0.066, 0.080, 0.012),
        (0.000, 0.073, 0.092, 0.002),
        (0.045, 0.075, 0.096, -0.004),
        (0.085, 0.062, 0.080, -0.006),
    ];
    let rings: Vec<Ring> = skull.iter().map(|&r| head.ring(r)).collect();
    figure.on("skin").loft(&rings, Skin::closed(12, [0.012, 0.042]));
    let (tip, side) = (head.at(0.0, 0.118, -0.030), 0.016);
    let (bridge, left, right) = (head.at(0.0, 0.092, 0.018), head.at(-side, 0.086, -0.038), head.at(side, 0.086, -0.038));
    for corners in [[tip, left, bridge], [right, tip, bridge], [tip, right, left]] {
        figure.on("skin").face(&corners);
    }
    for x in [-1.0f32, 1.0] {
        figure.on("skin").ellipsoid(head.at(0.075 * x, -0.008, -0.012), Vec3::new(0.011, 0.018, 0.030), 5, 3);
        // Eyes and brows, slightly in front of the skin.
        for (slot, up, low, high, wide) in [("eyes", 0.014, -0.0045, 0.0045, 0.010), ("hair", 0.035, -0.0025, 0.0025, 0.017)] {
            let at = |dx: f32, dz: f32| {
                let (x, z) = (0.030 * x + dx, up + dz);
                // The curve of the brow: it recedes with the square of the lateral distance.
                head.at(x, 0.1005 - 8.5 * x * x, z)
            };
            figure.on(slot).face(&[at(-wide, low), at(-wide, high), at(wide, high), at(wide, low)]);
        }
    }
}

fn hair(figure: &mut Sketch, head: &Head, person: &Person) {
    if person.hair == Hair::Bald {
        return;
    }
    let under_hat = matches!(person.headgear, Headgear::Cap | Headgear::Hat | Headgear::Helmet);
    let mut rows = vec![
        (-0.070, 0.052, 0.030, -0.058),
        (-0.035, 0.072, 0.050, -0.048),
        (0.015, 0.081, 0.066, -0.040),
        (0.052, 0.083, 0.088, -0.018),
        (0.085, 0.074, 0.090, -0.008),
    ];
    if person.hair == Hair::Long {
        rows.splice(0..2, [(-0.230, 0.078, 0.026, -0.078), (-0.140, 0.092, 0.036, -0.070), (-0.050, 0.088, 0.048, -0.054)]);
    }
    if under_hat {
        rows.pop();
    }
    let rings: Vec<Ring> = rows.into_iter().map(|r| head.ring(r)).collect();
    figure.on("hair").loft(&rings, Skin::closed(10, [0.012, 0.05]));
    if person.hair == Hair::Bun {
        figure.on("hair").ellipsoid(head.at(0.0, -0.115, 0.045), Vec3::splat(0.045), 8, 6);
    }
}

/// A hand that continues the forearm, with the thumb in front.
fn hand(figure: &mut Sketch, arm: &Limb, front: Vec3, side: f32) {
    let along = (arm.end - arm.bend).normalize();
    let thumb = (front - along * front.dot(along)).normalize_or(Vec3::X * -side);
    let palm = [(-0.01, 0.026, 0.022), (0.04, 0.036, 0.019), (0.09, 0.040, 0.017), (0.13, 0.030, 0.014)];
    let sections = palm.map(|(far, wide, deep)| Section { at: arm.end + along * far, wide, deep });
    figure.on("skin").limb(&sections, thumb, Skin::closed(6, [0.0, 0.025]));
    let root = arm.end + along * 0.03 + thumb * 0.02;
    let pointing = [Section::round(root, 0.016), Section::round(root + along * 0.05 + thumb * 0.035, 0.011)];
    figure.on("skin").limb(&pointing, along.cross(thumb), Skin::closed(5, [0.0, 0.005]));
}
