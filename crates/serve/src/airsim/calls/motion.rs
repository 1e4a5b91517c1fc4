//! Calls that move a vehicle: what is to be flown, read from the arguments.

use spf_core::geometry::{EnuPosition, wrap_angle};
use spf_core::telemetry::FlightPhase;
use spf_core::time::Time;
use spf_drone::airsim::wire::structs::{GeoPoint, Vector3r, YawMode};

use super::arguments::{Arguments, check};
use crate::airsim::city::City;
use crate::airsim::frames::velocity;
use crate::airsim::task::{Motion, Path, SLOW, Yaw};
use crate::airsim::vehicle::{Done, TAKE_OFF, Task};

/// Speed above which no take-off begins, m/s.
const STANDING: f64 = 0.05;
/// Most points of a path.
const POINTS: usize = 10_000;

/// What is to be flown.
pub(super) struct Plan {
    motion: Motion,
    yaw: Yaw,
    deadline: Option<Time>,
}

impl Plan {
    /// With whoever waits for its end.
    pub(super) fn task(self, done: Done) -> Task {
        Task { motion: self.motion, yaw: self.yaw, deadline: self.deadline, done }
    }
}

/// What a call asks for, and of which vehicle.
pub(super) fn plan(city: &City, method: &str, a: Arguments<'_>) -> Result<(usize, Plan), String> {
    let index = city.index(&a.text(a.0.len().saturating_sub(1))?)?;
    let vehicle = city.vehicles.get(index).ok_or("there is no vehicle")?;
    let (now, frame, pose) = (city.now(), vehicle.frame, vehicle.pose());
    let (place, heading) = (pose.position, pose.attitude.heading);
    let keep = Yaw::Rate(0.0);
    let straight = |end: EnuPosition, speed: f64| Motion::Path(Path::new(place, &[end], speed, -1.0));
    let above = |z: f64| EnuPosition { up: frame.position(Vector3r::new(0.0, 0.0, z)).up, ..place };
    let plan = |motion, yaw, deadline| Plan { motion, yaw, deadline };
    let made = match method {
        "takeoff" => {
            let speed = vehicle.velocity().speed();
            if speed > STANDING {
                return Err(format!("the vehicle is moving at {speed:.2} m/s: a take-off begins at rest"));
            }
            let on_ground = vehicle.phase() == FlightPhase::OnGround;
            let end = EnuPosition { up: place.up + TAKE_OFF, ..place };
            plan(if on_ground { Motion::TakeOff } else { straight(end, SLOW) }, keep, a.later(0, now)?)
        }
        "land" => plan(Motion::Land, keep, a.later(0, now)?),
        "goHome" => plan(straight(frame.0, SLOW), keep, a.later(0, now)?),
        "hover" => plan(straight(place, SLOW), keep, None),
        "moveByVelocity" | "moveByVelocityBodyFrame" => {
            let wanted = turned(method, a.point(0)?, heading);
            let motion = Motion::Velocity { velocity: velocity(wanted), height: None, until: a.until(3, now)? };
            plan(motion, yaw(a, 4, 5, false)?, None)
        }
        "moveByVelocityZ" | "moveByVelocityZBodyFrame" => {
            let [x, y, z] = [a.number(0)?, a.number(1)?, check(Vector3r::new(0.0, 0.0, a.number(2)?))?.z_val];
            let wanted = turned(method, check(Vector3r::new(x, y, 0.0))?, heading);
            let motion = Motion::Velocity { velocity: velocity(wanted), height: Some(above(z).up), until: a.until(3, now)? };
            plan(motion, yaw(a, 4, 5, false)?, None)
        }
        "moveToPosition" => {
            let end = frame.position(a.point(0)?);
            let path = Path::new(place, &[end], speed(a, 3)?, lookahead(a, 7)?);
            plan(Motion::Path(path), yaw(a, 5, 6, true)?, a.later(4, now)?)
        }
        "moveToGPS" => {
            let geo = GeoPoint { latitude: a.number(0)?, longitude: a.number(1)?, altitude: a.number(2)? };
            let end = city.world.position(check(city.point(geo))?);
            let path = Path::new(place, &[end], speed(a, 3)?, lookahead(a, 7)?);
            plan(Motion::Path(path), yaw(a, 5, 6, true)?, a.later(4, now)?)
        }
        "moveOnPath" => {
            let points: Vec<Vector3r> = a.read(0)?;
            if points.is_empty() || points.len() > POINTS {
                return Err(format!("a path has 1 to {POINTS} points, this one {}", points.len()));
            }
            let points = points.into_iter().map(|point| check(point).map(|point| frame.position(point)));
            let path = Path::new(place, &points.collect::<Result<Vec<_>, _>>()?, speed(a, 1)?, lookahead(a, 5)?);
            plan(Motion::Path(path), yaw(a, 3, 4, true)?, a.later(2, now)?)
        }
        "moveToZ" => {
            let end = above(check(Vector3r::new(0.0, 0.0, a.number(0)?))?.z_val);
            let path = Path::new(place, &[end], speed(a, 1)?, lookahead(a, 4)?);
            let mode: YawMode = a.read(3)?;
            plan(Motion::Path(path), free(mode)?, a.later(2, now)?)
        }
        "rotateToYaw" => {
            let margin = a.number(2)?.to_radians().abs();
            let yaw = Yaw::Heading(wrap_angle(a.number(0)?.to_radians()));
            plan(Motion::Turn { margin, at: place }, yaw, a.later(1, now)?)
        }
        "rotateByYawRate" => {
            plan(Motion::Stay { at: place, until: a.until(1, now)? }, Yaw::Rate(a.number(0)?.to_radians()), None)
        }
        other => return Err(format!("{other} is no motion")),
    };
    Ok((index, made))
}

/// A velocity in the world: of the body's frame, it is turned by the heading at the call, and stays so.
fn turned(method: &str, v: Vector3r, heading: f64) -> Vector3r {
    if !method.ends_with("BodyFrame") {
        return v;
    }
    let (sin, cos) = libm::sincos(heading);
    Vector3r::new(v.x_val * cos - v.y_val * sin, v.x_val * sin + v.y_val * cos, v.z_val)
}

fn speed(a: Arguments<'_>, place: usize) -> Result<f64, String> {
    let speed = a.number(place)?;
    if speed > 0.0 { Ok(speed.min(100.0)) } else { Err(format!("a velocity of {speed} m/s reaches nothing")) }
}

fn lookahead(a: Arguments<'_>, place: usize) -> Result<f64, String> {
    let lookahead = a.number(place)?;
    if lookahead == 0.0 { Err("lookahead distance cannot be zero".to_owned()) } else { Ok(lookahead.min(1000.0)) }
}

/// The heading without a direction of travel.
fn free(mode: YawMode) -> Result<Yaw, String> {
    let angle = mode.yaw_or_rate.to_radians();
    if !angle.is_finite() {
        return Err("the yaw is no finite number".to_owned());
    }
    Ok(if mode.is_rate { Yaw::Rate(angle) } else { Yaw::Heading(wrap_angle(angle)) })
}

/// The heading by drivetrain (0 any way, 1 forward only) and yaw mode. On a path, forward only and a rate contradict each other.
fn yaw(a: Arguments<'_>, drivetrain: usize, mode: usize, on_path: bool) -> Result<Yaw, String> {
    let forward = match a.number(drivetrain)? {
        0.0 => false,
        1.0 => true,
        other => return Err(format!("there is no drivetrain {other}")),
    };
    let mode: YawMode = a.read(mode)?;
    let yaw = free(mode)?;
    match yaw {
        Yaw::Heading(offset) if forward => Ok(Yaw::Travel(offset)),
        Yaw::Rate(_) if forward && on_path => {
            Err("yaw cannot be specified as a rate if the drivetrain is ForwardOnly".to_owned())
        }
        _ => Ok(yaw),
    }
}
