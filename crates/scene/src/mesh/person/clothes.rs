//! Clothes and carried items.

use glam::Vec3;

use super::super::Sketch;
use super::super::round::{Ring, Section, Skin};
use super::super::yard::draw_cone;
use super::body::Head;
use super::posture::{Limb, Pose};
use super::{Bottom, Headgear, Held, Person, Posture, Top};

pub(super) fn draw(figure: &mut Sketch, pose: &Pose, person: &Person) {
    top(figure, pose, person.top);
    bottom(figure, pose, person.bottom);
    for (leg, toes) in pose.legs.iter().zip(pose.toes) {
        shoe(figure, leg, toes);
    }
    headgear(figure, &Head::of(pose), person.headgear);
    let hand = usize::from(person.posture != Posture::Waving);
    held(figure, pose, &pose.arms[hand], person.holds);
}

/// A level slice of the trunk: height above the hip joints, half width, half depth, offset to the front.
fn slice(pose: &Pose, (height, wide, deep, front): (f32, f32, f32, f32)) -> Ring {
    // The turn of the shoulders grows from the waist up.
    let turn = ((height - 0.08) / 0.35).clamp(0.0, 1.0);
    let right = pose.hips_right.lerp(pose.shoulders_right, turn).normalize();
    let ahead = pose.spine.cross(right).normalize();
    Ring { centre: pose.trunk(height) + ahead * front, side: right * wide, up: ahead * deep }
}

fn top(figure: &mut Sketch, pose: &Pose, top: Top) {
    let jacket = top == Top::Jacket;
    let (more, hem) = if jacket { (0.014, -0.075) } else { (0.0, -0.03) };
    let trunk = [
        (hem, 0.188, 0.142, 0.002),
        (0.03, 0.180, 0.132, 0.003),
        (0.09, 0.162, 0.116, 0.004),
        (0.15, 0.150, 0.110, 0.006),
        (0.24, 0.160, 0.116, 0.006),
        (0.34, 0.180, 0.124, 0.004),
        (0.42, 0.196, 0.114, 0.0),
        (0.480, 0.184, 0.090, -0.006),
        (0.520, 0.126, 0.074, -0.006),
        (0.545, 0.072, 0.062, -0.002),
    ];
    let rings: Vec<Ring> =
        trunk.iter().map(|&(height, wide, deep, front)| slice(pose, (height, wide + more, deep + more, front))).collect();
    let skin = Skin { squareness: 0.85, ..Skin::open(12) };
    figure.on("body").loft(&rings, Skin { caps: [0.02, 0.01], ..skin });
    let collar = [(0.535, 0.072, 0.066, 0.0), (0.585, 0.066, 0.062, 0.008)].map(|ring| slice(pose, ring));
    if jacket {
        figure.on("body").loft(&collar, Skin::closed(10, [0.0, 0.004]));
    }
    for arm in &pose.arms {
        let aside = pose.shoulders_right;
        let sections = if jacket {
            vec![
                Section::round(arm.root, 0.060),
                Section::round(arm.root.lerp(arm.bend, 0.5), 0.056),
                Section::round(arm.bend, 0.050),
                Section::round(arm.bend.lerp(arm.end, 0.5), 0.045),
                Section::round(arm.end, 0.038),
            ]
        } else {
            vec![
                Section::round(arm.root, 0.056),
                Section::round(arm.root.lerp(arm.bend, 0.3), 0.056),
                Section::round(arm.root.lerp(arm.bend, 0.62), 0.052),
            ]
        };
        figure.on("body").limb(&sections, aside, Skin::closed(7, [0.045, 0.004]));
    }
}

fn bottom(figure: &mut Sketch, pose: &Pose, bottom: Bottom) {
    let seat = [(-0.05, 0.150, 0.108, 0.0), (0.02, 0.156, 0.108, 0.0), (0.10, 0.150, 0.106, 0.004)].map(|ring| slice(pose, ring));
    figure.on("legs").loft(&seat, Skin::closed(10, [0.06, 0.01]));
    match bottom {
        Bottom::Skirt => {
            let knees = 0.5 * (pose.legs[0].bend + pose.legs[1].bend);
            let apart = (pose.legs[0].bend - pose.legs[1].bend).abs();
            let waist = pose.trunk(0.02);
            let sections = [
                Section { at: waist, wide: 0.160, deep: 0.110 },
                Section { at: waist.lerp(knees, 0.45), wide: 0.185, deep: 0.145 },
                Section { at: knees, wide: 0.5 * apart.x + 0.11, deep: 0.5 * apart.y + 0.12 },
            ];
            figure.on("legs").limb(&sections, Vec3::X, Skin::closed(14, [0.0, 0.01]));
        }
        Bottom::Trousers | Bottom::Shorts => {
            for leg in &pose.legs {
                let thigh = leg.root.lerp(leg.bend, 0.5);
                let mut sections = vec![Section::round(leg.root, 0.082), Section::round(thigh, 0.078)];
                if bottom == Bottom::Shorts {
                    sections.push(Section::round(leg.root.lerp(leg.bend, 0.85), 0.078));
                } else {
                    let calf = leg.bend.lerp(leg.end, 0.35) - pose.front() * 0.008;
                    sections.push(Section::round(leg.bend, 0.064));
                    sections.push(Section::round(calf, 0.060));
                    sections.push(Section::round(leg.bend.lerp(leg.end, 0.97), 0.050));
                }
                figure.on("legs").limb(&sections, pose.hips_right, Skin::closed(8, [0.06, 0.006]));
            }
        }
    }
}

fn shoe(figure: &mut Sketch, leg: &Limb, toes: Vec3) {
    let right = toes.cross(Vec3::Z).normalize_or(Vec3::X);
    let up = right.cross(toes);
    // Along the foot from the heel: offset from the ankle, half width, height of the upper.
    let profile = [
        (-0.066, 0.026, 0.050),
        (-0.045, 0.036, 0.085),
        (0.010, 0.038, 0.100),
        (0.065, 0.044, 0.080),
        (0.130, 0.046, 0.056),
        (0.175, 0.036, 0.044),
    ];
    let sole = leg.end - up * 0.08;
    let rings = profile.map(|(along, wide, high)| Ring {
        centre: sole + toes * along + up * (0.5 * high),
        side: right * -wide,
        up: up * (0.5 * high),
    });
    let skin = Skin { sides: 7, squareness: 0.62, caps: [0.012, 0.018] };
    figure.on("shoes").loft(&rings, skin);
}

fn headgear(figure: &mut Sketch, head: &Head, headgear: Headgear) {
    let mut crown = |rows: &[(f32, f32, f32, f32)], cap: f32| {
        let rings: Vec<Ring> = rows.iter().map(|&r| head.ring(r)).collect();
        figure.on("hat").loft(&rings, Skin::closed(14, [0.004, cap]));
    };
    match headgear {
        Headgear::None => {}
        Headgear::Cap => {
            crown(
                &[
                    (0.035, 0.086, 0.104, -0.008),
                    (0.080, 0.082, 0.098, -0.010),
                    (0.108, 0.062, 0.072, -0.010),
                    (0.128, 0.034, 0.040, -0.010),
                ],
                0.006,
            );
            crown(&[(0.030, 0.066, 0.070, 0.105), (0.042, 0.064, 0.066, 0.098)], 0.003);
        }
        Headgear::Hat => {
            crown(&[(0.035, 0.086, 0.106, -0.006), (0.100, 0.080, 0.098, -0.006), (0.135, 0.066, 0.082, -0.006)], 0.012);
            crown(&[(0.030, 0.165, 0.180, -0.004), (0.040, 0.160, 0.175, -0.004)], 0.002);
        }
        Headgear::Helmet => {
            crown(
                &[
                    (0.025, 0.094, 0.114, -0.006),
                    (0.070, 0.092, 0.112, -0.006),
                    (0.118, 0.068, 0.084, -0.006),
                    (0.142, 0.036, 0.046, -0.006),
                ],
                0.008,
            );
            crown(&[(0.020, 0.104, 0.132, 0.004), (0.032, 0.102, 0.128, 0.004)], 0.003);
        }
    }
}

fn held(figure: &mut Sketch, pose: &Pose, arm: &Limb, holds: Held) {
    let front = pose.front();
    let grip = arm.end + (arm.end - arm.bend).normalize() * 0.09;
    match holds {
        Held::Nothing => {}
        // Carried by its tip.
        Held::Cone => draw_cone(figure, ["held", "held_trim", "held"], grip - Vec3::Z * 0.50, 0.5),
        Held::Bag => {
            let size = Vec3::new(0.10, 0.38, 0.28);
            figure.on("held").cushion(grip - Vec3::Z * (size.z + 0.07), size, 0.03);
            for y in [-0.09, 0.09] {
                figure.on("held_trim").bar(grip + Vec3::new(0.0, y, -0.075), grip + Vec3::new(0.0, 0.5 * y, 0.0), 0.018);
            }
        }
        Held::Bottle => {
            let at = grip - Vec3::Z * 0.09 + front * 0.02;
            figure.on("held").revolve(at, &BOTTLE, 10);
            figure.on("held_trim").revolve(at + Vec3::Z * 0.225, &[(0.015, 0.0), (0.015, 0.02), (0.0, 0.02)], 8);
        }
        Held::Umbrella => {
            let foot = grip - Vec3::Z * 0.12;
            let tip = Vec3::new(0.35 * grip.x, 0.5 * grip.y, foot.z + 1.12);
            figure.on("held_trim").rod(foot, tip, 0.011, 0.009, 6);
            let canopy = [(0.55, -0.20), (0.44, -0.12), (0.28, -0.055), (0.10, -0.01), (0.0, 0.0)];
            figure.on("held").revolve(tip - Vec3::Z * 0.02, &canopy, 12);
            let lining: Vec<(f32, f32)> = canopy.iter().rev().map(|&(r, z)| (r, z - 0.006)).collect();
            figure.on("held").revolve(tip - Vec3::Z * 0.02, &lining, 12);
        }
    }
}

/// A bottle of 0.25 m: (radius, height).
const BOTTLE: [(f32, f32); 7] =
    [(0.0, 0.0), (0.034, 0.0), (0.036, 0.01), (0.036, 0.14), (0.030, 0.17), (0.014, 0.20), (0.014, 0.23)];
