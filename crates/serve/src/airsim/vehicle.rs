//! One vehicle: the simulated craft, the one motion it is asked for, and what it has touched.

use std::sync::Arc;

use spf_core::command::{Command, Setpoint};
use spf_core::geometry::{Attitude, EnuPosition, EnuVelocity, Pose};
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time};
use spf_drone::airsim::wire::structs::{CollisionInfo, KinematicsState, Vector3r};
use spf_flight::sim::LoadedScene;
use spf_scene::geometry::ObjectId;
use spf_sim::craft::SimCraft;
use spf_sim::dynamics::{SimConditions, TICK};
use spf_sim::model::Model;
use spf_sim::wind::Wind;

use super::frames::{Ned, ned, quaternion};
use super::settings::VehicleSettings;
use super::task::{CONTROL, Motion, SLOW, Yaw, hold, hold_height};

/// Height of a take-off, metres above where it starts.
pub(super) const TAKE_OFF: f64 = 2.0;
/// Height to which a motion that goes up from the ground lifts off first, metres.
const LIFT_OFF: f64 = 0.3;
/// Descent rate of a landing, m/s.
const LANDING_SPEED: f64 = 0.2;
/// Time after a motion for which its last velocity is kept, so that overlapping commands meet without a brake.
const OVERLAP: Duration = Duration::from_millis(60);
/// How long a setpoint holds without another.
const VALID: Duration = Duration::from_millis(100);
/// Speed at which a craft without a task chooses the place that it holds, m/s.
const SETTLED: f64 = 0.3;

/// Told how a motion has ended: true when it was finished.
pub(super) type Done = Box<dyn FnOnce(bool) + Send>;

/// A motion under way.
pub(super) struct Task {
    pub(super) motion: Motion,
    pub(super) yaw: Yaw,
    /// When it has failed; `None` for never.
    pub(super) deadline: Option<Time>,
    pub(super) done: Done,
}

/// What a vehicle that has no task does.
enum Idle {
    /// It keeps a velocity until then.
    Keep(EnuVelocity, f64, Time),
    /// It comes to rest.
    Brake,
    /// It holds a position.
    Hold(EnuPosition),
}

/// A vehicle.
pub(super) struct Vehicle {
    pub(super) settings: VehicleSettings,
    pub(super) craft: SimCraft,
    pub(super) frame: Ned,
    pub(super) api: bool,
    pub(super) armed: bool,
    start: Pose,
    task: Option<Task>,
    idle: Idle,
    /// The pose of a vehicle that others move, in place of the craft's own motion.
    posed: Option<KinematicsState>,
    collision: CollisionInfo,
    contacts: usize,
    /// Velocity, attitude and yaw rate of the last tick, and what they were one before.
    motion: [(EnuVelocity, Attitude, f64); 2],
}

impl Vehicle {
    /// A vehicle at its start.
    pub(super) fn new(settings: VehicleSettings, loaded: &LoadedScene, wind: Vector3r, posed: bool, seed: u64) -> Self {
        let scene = loaded.scene.start;
        let place = Ned(scene.position).position(settings.start);
        let heading = settings.heading.unwrap_or(scene.attitude.heading);
        let start = Pose { position: place, attitude: Attitude { heading, ..Attitude::default() } };
        let usual = Model::quad();
        let model = Model {
            // A program may fly it for days.
            drain_flying: 0.0,
            drain_idle: 0.0,
            take_off_speed: SLOW,
            landing_speed: LANDING_SPEED,
            touch_down_speed: LANDING_SPEED,
            ..usual
        };
        let wind = Wind { east: wind.y_val, north: wind.x_val, ..Wind::default() };
        let conditions = SimConditions { wind, exact: true, ..SimConditions::new(seed) };
        let craft = SimCraft::with_traffic(loaded.cast.clone(), loaded.collider.clone(), model, start, conditions);
        let start = craft.truth().pose;
        let frame = Ned(start.position);
        let now = (EnuVelocity::default(), start.attitude, 0.0);
        let mut vehicle = Self {
            api: false,
            armed: settings.armed,
            frame,
            craft,
            start,
            task: None,
            idle: Idle::Brake,
            posed: None,
            collision: CollisionInfo::default(),
            contacts: 0,
            motion: [now; 2],
            settings,
        };
        if posed {
            vehicle.posed = Some(vehicle.kinematics());
        }
        vehicle
    }

    /// Back to the start, disarmed of its task. Time goes on.
    pub(super) fn reset(&mut self) {
        self.cancel();
        self.put(self.start, EnuVelocity::default(), Some(false));
        (self.api, self.armed, self.collision) = (false, self.settings.armed, CollisionInfo::default());
    }

    /// Whether it is moved by whoever sets its pose alone.
    pub(super) fn is_posed(&self) -> bool {
        self.posed.is_some()
    }

    /// Whether it stands on the ground.
    pub(super) fn is_landed(&self) -> bool {
        self.posed.is_none() && matches!(self.phase(), FlightPhase::OnGround | FlightPhase::Stopped)
    }

    pub(super) fn phase(&self) -> FlightPhase {
        self.craft.dynamics().phase()
    }

    /// Its true pose.
    pub(super) fn pose(&self) -> Pose {
        self.craft.dynamics().pose()
    }

    /// Its velocity.
    pub(super) fn velocity(&self) -> EnuVelocity {
        self.craft.dynamics().velocity()
    }

    /// Starts a motion; the one under way has failed.
    pub(super) fn begin(&mut self, now: Time, task: Task) {
        self.cancel();
        if !self.api || !self.armed || self.posed.is_some() || self.phase() == FlightPhase::Stopped {
            let why = if self.posed.is_some() {
                "it is moved by its pose alone"
            } else if !self.api {
                "enableApiControl was not called"
            } else if !self.armed {
                "it is not armed"
            } else {
                "it has crashed: reset puts it back"
            };
            tracing::warn!("{} does not move: {why}", self.settings.name);
            (task.done)(false);
            return;
        }
        match task.motion {
            Motion::TakeOff => {
                self.craft.set_take_off_height(TAKE_OFF);
                self.craft.apply(now, Command::TakeOff, now + VALID);
            }
            Motion::Land => self.craft.apply(now, Command::Land, now + VALID),
            _ => {}
        }
        self.task = Some(task);
    }

    /// Ends the motion under way, which has failed.
    pub(super) fn cancel(&mut self) {
        self.idle = Idle::Brake;
        if let Some(task) = self.task.take() {
            (task.done)(false);
        }
    }

    /// Arms or disarms. In the air, motors stop.
    pub(super) fn arm(&mut self, now: Time, armed: bool) {
        self.armed = armed;
        if !armed {
            self.cancel();
            self.craft.apply(now, Command::EmergencyStop, now);
        } else if self.phase() == FlightPhase::Stopped && !self.craft.dynamics().crashed() && self.velocity().speed() == 0.0 {
            self.put(self.pose(), EnuVelocity::default(), Some(false));
        }
    }

    /// Puts it somewhere; without `hovering`, it stands where there is a surface right below.
    pub(super) fn put(&mut self, pose: Pose, velocity: EnuVelocity, hovering: Option<bool>) {
        let radius = self.craft.dynamics().model().craft.radius;
        let stands = || {
            let ground = self.craft.collider().ground_below(pose.position);
            ground.is_some_and(|ground| pose.position.up - ground.up <= radius + 0.05) && velocity.speed() == 0.0
        };
        let hovering = hovering.unwrap_or_else(|| !stands());
        self.craft.place(pose, velocity, hovering);
        self.contacts = 0;
        self.idle = if hovering { Idle::Hold(pose.position) } else { Idle::Brake };
        self.motion = [(velocity, pose.attitude, 0.0); 2];
        if let Some(posed) = &mut self.posed {
            *posed = KinematicsState {
                position: self.frame.of(pose.position),
                orientation: quaternion(pose.attitude),
                linear_velocity: ned(velocity),
                ..KinematicsState::default()
            };
        }
    }

    /// Sets a whole state. The craft's own dynamics go on from place and velocity.
    pub(super) fn set_kinematics(&mut self, pose: Pose, state: KinematicsState) {
        self.put(pose, super::frames::velocity(state.linear_velocity), None);
        if let Some(posed) = &mut self.posed {
            let (position, orientation) = (posed.position, posed.orientation);
            *posed = KinematicsState { position, orientation, ..state };
        }
    }

    /// One tick of the simulation; a control step when `control`.
    pub(super) fn tick(&mut self, now: Time, control: bool, loaded: &LoadedScene, stamp: u64) {
        if self.posed.is_some() {
            // Its place is where it was put; the actors around it move all the same.
            let (pose, velocity) = (self.pose(), self.velocity());
            self.craft.advance_to(now + TICK);
            self.craft.place(pose, velocity, true);
            return;
        }
        if control {
            self.control(now);
        }
        self.craft.advance_to(now + TICK);
        let dynamics = self.craft.dynamics();
        self.motion = [self.motion[1], (dynamics.velocity(), dynamics.pose().attitude, dynamics.yaw_rate())];
        let contact = dynamics.contacts().get(self.contacts).map(|(_, object)| *object);
        if let Some(object) = contact {
            self.contacts += 1;
            self.touch(object, loaded, stamp);
            self.cancel();
        }
    }

    /// Notes that it has touched an object.
    pub(super) fn touch(&mut self, object: ObjectId, loaded: &LoadedScene, stamp: u64) {
        let position = self.pose().position;
        let surface = loaded.collider.nearest_of(object, position).unwrap_or(position);
        let (from, to) = (self.frame.of(surface), self.frame.of(position));
        let distance = surface.distance(position);
        let part = |a: f64, b: f64| if distance > 1e-9 { (b - a) / distance } else { 0.0 };
        let radius = self.craft.dynamics().model().craft.radius;
        self.collision = CollisionInfo {
            has_collided: true,
            penetration_depth: (radius - distance).max(0.0),
            time_stamp: stamp,
            normal: Vector3r::new(part(from.x_val, to.x_val), part(from.y_val, to.y_val), part(from.z_val, to.z_val)),
            impact_point: from,
            position: to,
            object_name: loaded.key(object),
            object_id: i32::from(object),
        };
    }

    /// The last collision. Reading it clears that there was one.
    pub(super) fn read_collision(&mut self) -> CollisionInfo {
        let read = self.collision.clone();
        self.collision.has_collided = false;
        read
    }

    /// The last collision.
    pub(super) fn collision(&self) -> &CollisionInfo {
        &self.collision
    }

    fn control(&mut self, now: Time) {
        let phase = self.phase();
        let (pose, velocity) = (self.pose(), self.velocity());
        let (place, heading) = (pose.position, pose.attitude.heading);
        let Some(task) = &mut self.task else {
            self.rest(now);
            return;
        };
        let outcome = match &mut task.motion {
            Motion::TakeOff if phase == FlightPhase::Flying => Err((Idle::Hold(place), true)),
            Motion::Land if phase == FlightPhase::OnGround => Err((Idle::Brake, true)),
            Motion::TakeOff | Motion::Land => Ok(None),
            Motion::Velocity { velocity, until, .. } if now >= *until => {
                Err((Idle::Keep(*velocity, task.yaw.rate(heading, *velocity), now + OVERLAP), true))
            }
            Motion::Velocity { velocity, height, .. } => {
                let up = height.map_or(velocity.up, |height| hold_height(place.up, height));
                Ok(Some(EnuVelocity { up, ..*velocity }))
            }
            Motion::Path(path) => match path.follow(place) {
                Some(velocity) => Ok(Some(velocity)),
                None => Err((Idle::Hold(path.end()), true)),
            },
            Motion::Turn { margin, at } => {
                let over = task.yaw.is_reached(heading, self.craft.dynamics().yaw_rate(), *margin);
                if over { Err((Idle::Hold(*at), true)) } else { Ok(Some(hold(place, *at))) }
            }
            Motion::Stay { at, until } if now >= *until => Err((Idle::Hold(*at), true)),
            Motion::Stay { at, .. } => Ok(Some(hold(place, *at))),
        };
        let late = task.deadline.is_some_and(|deadline| now >= deadline);
        match outcome {
            Ok(_) if late => self.end(now, Idle::Brake, false),
            Ok(None) => {}
            Ok(Some(wanted)) => {
                let yaw = task.yaw.rate(heading, velocity);
                self.fly(now, wanted, yaw);
            }
            Err((idle, finished)) => self.end(now, idle, finished),
        }
    }

    fn end(&mut self, now: Time, idle: Idle, finished: bool) {
        self.idle = idle;
        if let Some(task) = self.task.take() {
            (task.done)(finished);
        }
        self.rest(now);
    }

    /// Without a task.
    fn rest(&mut self, now: Time) {
        let (place, speed) = (self.pose().position, self.velocity().speed());
        match &self.idle {
            Idle::Keep(velocity, yaw, until) if now < *until => self.fly(now, *velocity, *yaw),
            Idle::Hold(at) => self.fly(now, hold(place, *at), 0.0),
            Idle::Keep(..) | Idle::Brake => {
                self.idle = if speed < SETTLED && self.phase() == FlightPhase::Flying { Idle::Hold(place) } else { Idle::Brake };
                self.fly(now, EnuVelocity::default(), 0.0);
            }
        }
    }

    /// Flies a velocity. From the ground, only one that goes up lifts it off.
    fn fly(&mut self, now: Time, wanted: EnuVelocity, yaw_rate: f64) {
        let command = match self.phase() {
            FlightPhase::OnGround if self.task.is_some() && wanted.up > 0.01 => {
                self.craft.set_take_off_height(LIFT_OFF);
                Command::TakeOff
            }
            FlightPhase::Landing => Command::Setpoint(Setpoint::HOLD),
            FlightPhase::Flying => {
                let (sin, cos) = libm::sincos(self.pose().attitude.heading);
                Command::Setpoint(Setpoint {
                    right: wanted.east * cos - wanted.north * sin,
                    forward: wanted.east * sin + wanted.north * cos,
                    up: wanted.up,
                    yaw_rate,
                })
            }
            _ => return,
        };
        self.craft.apply(now, command, now + VALID);
    }

    /// Its true state.
    pub(super) fn kinematics(&self) -> KinematicsState {
        if let Some(posed) = &self.posed {
            return *posed;
        }
        let pose = self.pose();
        let [(v0, a0, r0), (v1, a1, r1)] = self.motion;
        let step = TICK.as_secs_f64();
        let rates = |a: Attitude, b: Attitude, yaw: f64| {
            // Rates of the angles as a vector in the body: the usual kinematics of yaw, pitch and roll.
            let (pitching, rolling) = ((b.pitch - a.pitch) / step, (b.roll - a.roll) / step);
            let ((sp, cp), (sr, cr)) = (libm::sincos(b.pitch), libm::sincos(b.roll));
            Vector3r::new(rolling - yaw * sp, pitching * cr + yaw * cp * sr, yaw * cp * cr - pitching * sr)
        };
        let gained =
            EnuVelocity { east: (v1.east - v0.east) / step, north: (v1.north - v0.north) / step, up: (v1.up - v0.up) / step };
        KinematicsState {
            position: self.frame.of(pose.position),
            orientation: quaternion(pose.attitude),
            linear_velocity: ned(self.velocity()),
            angular_velocity: rates(a0, a1, r1),
            linear_acceleration: ned(gained),
            angular_acceleration: Vector3r::new(0.0, 0.0, (r1 - r0) / step),
        }
    }

    /// How far the first surface is straight ahead of a rangefinder, metres, at most `farthest`.
    pub(super) fn range(&self, from: &Pose, farthest: f64) -> f64 {
        let ahead = super::frames::to_world(from.attitude, Vector3r::new(farthest, 0.0, 0.0));
        let to = Ned(from.position).position(ahead);
        self.craft.collider().range(from.position, to).unwrap_or(farthest)
    }
}

/// The control step, in ticks.
pub(super) const CONTROL_TICKS: u64 = (CONTROL.as_nanos() / TICK.as_nanos()) as u64;

/// The scene, for those who keep it.
pub(super) type Loaded = Arc<LoadedScene>;
