//! The free camera of a page: moved by held keys, stopped by solid objects.

use spf_core::geometry::{Attitude, BodyDisplacement, EnuPosition, Pose, wrap_angle};
use spf_scene::collide::Collider;
use spf_scene::geometry::ObjectId;
use spf_scene::{Aabb, Scene};

/// Input of the held keys, each −1..=1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Push {
    pub(super) right: f64,
    pub(super) forward: f64,
    pub(super) up: f64,
    pub(super) yaw: f64,
    pub(super) pitch: f64,
    pub(super) fast: bool,
}

impl Push {
    fn is_none(&self) -> bool {
        [self.right, self.forward, self.up, self.yaw, self.pitch].iter().all(|fraction| *fraction == 0.0)
    }
}

/// Time constant of the speed, s.
const LAG: f64 = 0.12;
/// Yaw and pitch rates under a held key, rad/s.
const YAW_RATE: f64 = 1.3;
const PITCH_RATE: f64 = 0.8;
/// Speed factor of the fast key.
const FAST: f64 = 4.0;
/// Time to cross a scene at normal speed, s, and the limits of that speed, m/s.
const CROSSING: f64 = 30.0;
const SPEEDS: std::ops::RangeInclusive<f64> = 1.2..=8.0;
/// Maximum distance outside the scene, metres.
const MARGIN: f64 = 100.0;
/// Distance kept from a surface, so that the next move does not start in contact, metres.
const SKIN: f64 = 2e-3;
/// Speed below which it stands still, m/s.
const STILL: f64 = 0.01;

/// A pose and velocity in a scene.
#[derive(Debug)]
pub(super) struct FreeCamera {
    pose: Pose,
    /// Velocity in the level body frame, m/s.
    velocity: BodyDisplacement,
    touching: Option<ObjectId>,
    plain_speed: f64,
    room: Aabb,
}

impl FreeCamera {
    /// At rest at a pose.
    pub(super) fn new(scene: &Scene, pose: Pose) -> Self {
        let (min, max) = (scene.bounds.min, scene.bounds.max);
        let width = (max.east - min.east).max(max.north - min.north);
        let corner = |at: EnuPosition, by: f64| EnuPosition { east: at.east + by, north: at.north + by, up: at.up + by };
        let room = Aabb { min: corner(min, -MARGIN), max: corner(max, MARGIN) };
        let plain_speed = (width / CROSSING).clamp(*SPEEDS.start(), *SPEEDS.end());
        let mut camera = Self { pose, velocity: BodyDisplacement::default(), touching: None, plain_speed, room };
        camera.go(pose);
        camera
    }

    pub(super) fn pose(&self) -> Pose {
        self.pose
    }

    /// Speed, m/s.
    pub(super) fn speed(&self) -> f64 {
        let BodyDisplacement { right, forward, up } = self.velocity;
        (right * right + forward * forward + up * up).sqrt()
    }

    /// The object that stopped its last move.
    pub(super) fn touching(&self) -> Option<ObjectId> {
        self.touching
    }

    /// Jumps to a pose, at rest.
    pub(super) fn go(&mut self, pose: Pose) {
        self.pose = Pose { position: within(&self.room, pose.position), ..pose };
        self.velocity = BodyDisplacement::default();
        self.touching = None;
    }

    /// Turns by radians, clockwise and nose up; pitch is limited to straight up and down.
    pub(super) fn turn(&mut self, yaw: f64, pitch: f64) {
        let Attitude { heading, pitch: before, .. } = self.pose.attitude;
        let quarter = core::f64::consts::FRAC_PI_2;
        self.pose.attitude.heading = wrap_angle(heading + yaw);
        self.pose.attitude.pitch = (before + pitch).clamp(-quarter, quarter);
    }

    /// Moves for `seconds`. With a collider, it slides along objects as a sphere of `radius`. Returns whether anything
    /// changed.
    pub(super) fn advance(&mut self, push: &Push, seconds: f64, solid: Option<(&Collider, f64)>) -> bool {
        if push.is_none() && self.speed() < STILL {
            self.velocity = BodyDisplacement::default();
            return false;
        }
        self.turn(push.yaw * YAW_RATE * seconds, push.pitch * PITCH_RATE * seconds);
        let speed = self.plain_speed * if push.fast { FAST } else { 1.0 };
        let fraction = 1.0 - (-seconds / LAG).exp();
        let follow = |velocity: &mut f64, share_of_speed: f64| *velocity += (share_of_speed * speed - *velocity) * fraction;
        follow(&mut self.velocity.right, push.right);
        follow(&mut self.velocity.forward, push.forward);
        follow(&mut self.velocity.up, push.up);
        let BodyDisplacement { right, forward, up } = self.velocity;
        let way = BodyDisplacement { right: right * seconds, forward: forward * seconds, up: up * seconds };
        let from = self.pose.position;
        let to = within(&self.room, from.displaced(way, self.pose.attitude.heading));
        let (position, touching) = match solid {
            Some((collider, radius)) => slide(collider, radius, from, to),
            None => (to, None),
        };
        self.touching = touching;
        if touching.is_some() && seconds > 0.0 {
            // The velocity is that actually flown, so that it does not push against a wall.
            let flown = from.displacement_to(position, self.pose.attitude.heading);
            let rate = 1.0 / seconds;
            self.velocity = BodyDisplacement { right: flown.right * rate, forward: flown.forward * rate, up: flown.up * rate };
        }
        self.pose.position = position;
        true
    }
}

fn within(room: &Aabb, at: EnuPosition) -> EnuPosition {
    EnuPosition {
        east: at.east.clamp(room.min.east, room.max.east),
        north: at.north.clamp(room.min.north, room.max.north),
        up: at.up.clamp(room.min.up, room.max.up),
    }
}

/// The end position of a sphere that moves straight and slides along obstacles.
fn slide(collider: &Collider, radius: f64, from: EnuPosition, to: EnuPosition) -> (EnuPosition, Option<ObjectId>) {
    let (mut at, mut goal, mut touched) = (from, to, None);
    // Three planes meet in a corner; beyond that it stops.
    for _ in 0..4 {
        let Some(contact) = collider.sweep(at, goal, radius) else { return (goal, touched) };
        touched = Some(contact.object);
        let out = difference(contact.centre, contact.surface);
        let length = dot(out, out).sqrt();
        if length < 1e-6 {
            // Exactly on the surface, the direction out is unknown.
            return (goal, touched);
        }
        let normal = out.map(|part| part / length);
        at = shifted(contact.centre, normal, SKIN.max(radius - length + SKIN));
        let left = difference(goal, at);
        goal = shifted(goal, normal, -dot(left, normal).min(0.0));
    }
    (at, touched)
}

fn difference(to: EnuPosition, from: EnuPosition) -> [f64; 3] {
    [to.east - from.east, to.north - from.north, to.up - from.up]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn shifted(at: EnuPosition, along: [f64; 3], by: f64) -> EnuPosition {
    EnuPosition { east: at.east + along[0] * by, north: at.north + along[1] * by, up: at.up + along[2] * by }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::sync::LazyLock;

    static CITY: LazyLock<(Scene, Collider)> = LazyLock::new(|| {
        let scene = Scene::load("city").unwrap();
        let collider = Collider::new(&scene.geometry).unwrap();
        (scene, collider)
    });

    const RADIUS: f64 = 0.3;

    fn fly(camera: &mut FreeCamera, push: Push, seconds: f64, solid: bool) {
        let collider = solid.then_some((&CITY.1, RADIUS));
        for _ in 0..(seconds * 30.0) as u32 {
            camera.advance(&push, 1.0 / 30.0, collider);
        }
    }

    #[test]
    fn keys_move_along_the_heading_and_let_go_it_stands() {
        let pose = Pose { position: EnuPosition { east: 0.0, north: 0.0, up: 50.0 }, attitude: Attitude::default() };
        let mut camera = FreeCamera::new(&CITY.0, pose);
        camera.turn(core::f64::consts::FRAC_PI_2, 0.0);
        fly(&mut camera, Push { forward: 1.0, ..Push::default() }, 2.0, true);
        let at = camera.pose().position;
        // East at 8 m/s, less what the lag takes.
        assert!((13.0..16.0).contains(&at.east) && at.north.abs() < 1e-6 && (at.up - 50.0).abs() < 1e-6, "{at:?}");
        fly(&mut camera, Push::default(), 2.0, true);
        assert!(!camera.advance(&Push::default(), 0.1, None));
        assert_eq!(camera.speed(), 0.0);
    }

    #[test]
    fn the_ground_stops_it_and_without_collisions_does_not() {
        let high = Pose { position: EnuPosition { east: 0.0, north: 0.0, up: 5.0 }, attitude: Attitude::default() };
        let down = Push { up: -1.0, forward: 0.3, ..Push::default() };
        let mut camera = FreeCamera::new(&CITY.0, high);
        fly(&mut camera, down, 4.0, true);
        let at = camera.pose().position;
        assert!((0.25..0.5).contains(&at.up), "{at:?}");
        assert!(camera.touching().is_some() && at.north > 2.0, "it slides over the ground: {at:?}");
        let mut ghost = FreeCamera::new(&CITY.0, high);
        fly(&mut ghost, down, 4.0, false);
        assert!(ghost.pose().position.up < -10.0);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn it_never_passes_through_a_surface(
            pushes in prop::collection::vec((-1.0..1.0f64, -1.0..1.0f64, -1.0..1.0f64, any::<bool>()), 1..12),
        ) {
            let mut camera = FreeCamera::new(&CITY.0, CITY.0.preview);
            for (right, forward, up, fast) in pushes {
                for _ in 0..20 {
                    let before = camera.pose().position;
                    camera.advance(&Push { right, forward, up, fast, ..Push::default() }, 0.05, Some((&CITY.1, RADIUS)));
                    let after = camera.pose().position;
                    prop_assert!([after.east, after.north, after.up].iter().all(|metres| metres.is_finite()));
                    prop_assert_eq!(CITY.1.segment_blocked(before, after), None);
                }
            }
        }
    }
}
