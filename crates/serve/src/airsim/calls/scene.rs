//! Calls that are answered at once: states, poses, pictures, sensors, the scene.

use glam::DVec3;
use regex_lite::RegexBuilder;
use spf_core::geometry::{Attitude, EnuPosition, Pose};
use spf_drone::airsim::wire::structs::{
    self as wire, CameraInfo, GeoPoint, ImageRequest, ImageType, KinematicsState, MultirotorState, ProjectionMatrix, Quaternionr,
    RcData, Vector3r,
};
use spf_drone::airsim::wire::{Encoding, Raw};
use spf_scene::geometry::ObjectId;

use super::arguments::{Arguments, check, kept};
use crate::airsim::city::City;
use crate::airsim::frames::{attitude, mounted, quaternion};
use crate::airsim::images::{Job, camera};
use crate::airsim::sensors;

/// Longest pattern of names, and most memory that it may take, bytes.
const PATTERN: usize = 1000;
const PATTERN_MEMORY: usize = 1 << 20;
/// Strongest wind, m/s.
const STORM: f64 = 100.0;
/// Distance of the near plane of a camera's projection, metres.
const NEAR: f64 = 0.1;

/// What a call is answered with.
pub(super) enum Answer {
    /// This.
    Now(Raw),
    /// Pictures, once they are rendered.
    Pictures {
        /// Them.
        job: Job,
        /// Whether it is the bytes of one.
        single: bool,
    },
}

/// Makes a call.
pub(super) fn call(city: &mut City, method: &str, a: Arguments<'_>, encoding: Encoding) -> Result<Answer, String> {
    let nil = Ok(Answer::Now(Raw::nil()));
    macro_rules! answer {
        ($value:expr) => {
            Ok(Answer::Now(Raw::of(&$value, encoding)))
        };
    }
    match method {
        "ping" => answer!(true),
        "getServerVersion" | "getMinRequiredClientVersion" => answer!(1),
        "isRecording" => answer!(false),
        "reset" => {
            city.reset();
            nil
        }
        "enableApiControl" => {
            let enabled = a.read(0)?;
            let vehicle = city.vehicle(&a.text(1)?)?;
            vehicle.api = enabled;
            if !enabled {
                vehicle.cancel();
            }
            nil
        }
        "isApiControlEnabled" => answer!(city.vehicle(&a.text(0)?)?.api),
        "armDisarm" => {
            let (now, armed) = (city.now(), a.read(0)?);
            city.vehicle(&a.text(1)?)?.arm(now, armed);
            answer!(true)
        }
        "cancelLastTask" => {
            city.vehicle(&a.text(0)?)?.cancel();
            nil
        }
        "listVehicles" => answer!(city.vehicles.iter().map(|one| one.settings.name.as_str()).collect::<Vec<_>>()),
        "getSettingsString" => answer!(city.settings.text),
        "getMultirotorState" => answer!(state(city, &a.text(0)?, encoding)?),
        "getHomeGeoPoint" => {
            let home = city.vehicle(&a.text(0)?)?.frame.0;
            answer!(city.geo(city.world.of(home)))
        }
        "simGetVehiclePose" => answer!(city.vehicle(&a.text(0)?)?.kinematics().pose()),
        "simGetGroundTruthKinematics" => answer!(city.vehicle(&a.text(0)?)?.kinematics()),
        "simGetGroundTruthEnvironment" => answer!(sensors::environment(city, &a.text(0)?)?),
        "simGetCollisionInfo" => answer!(city.vehicle(&a.text(0)?)?.read_collision()),
        "simSetVehiclePose" => {
            let pose: wire::Pose = a.read(0)?;
            put(city, &a.text(2)?, pose, None, a.read(1)?)?;
            nil
        }
        "simSetKinematics" => {
            let state: KinematicsState = a.read(0)?;
            let parts = [state.linear_velocity, state.angular_velocity, state.linear_acceleration, state.angular_acceleration];
            parts.into_iter().try_for_each(|part| check(part).map(drop))?;
            put(city, &a.text(2)?, state.pose(), Some(state), a.read(1)?)?;
            nil
        }
        "simGetImages" => {
            let requests: Vec<ImageRequest> = a.read(0)?;
            Ok(Answer::Pictures { job: Job::new(city, &a.text(1)?, requests)?, single: false })
        }
        "simGetImage" => {
            let image_type: ImageType = a.read(1)?;
            let request = ImageRequest { camera_name: a.text(0)?, image_type, pixels_as_float: false, compress: true };
            Ok(Answer::Pictures { job: Job::new(city, &a.text(2)?, vec![request])?, single: true })
        }
        "simGetCameraInfo" => answer!(camera_info(city, &a.text(0)?, &a.text(1)?)?),
        "simSetCameraPose" => {
            let pose: wire::Pose = a.read(1)?;
            let (place, turned) = (check(pose.position)?, attitude(pose.orientation).ok_or("the orientation is no rotation")?);
            let (_, mount, _) = city.camera(&a.text(2)?, &a.text(0)?)?;
            (mount.place, mount.turned) = (place, turned);
            nil
        }
        "simSetCameraFov" => {
            let fov = a.number(1)?;
            if !(1.0..=170.0).contains(&fov) {
                return Err(format!("a field of view of {fov} degrees is not between 1 and 170"));
            }
            let (_, mount, _) = city.camera(&a.text(2)?, &a.text(0)?)?;
            mount.captures.entry(0).or_default();
            mount.captures.values_mut().for_each(|capture| capture.fov = fov);
            nil
        }
        "simSetWind" => {
            let wind = a.vector(0)?;
            if wind.x_val.hypot(wind.y_val) > STORM {
                return Err(format!("wind above {STORM} m/s is not simulated"));
            }
            city.vehicles.iter_mut().for_each(|vehicle| vehicle.craft.set_wind(wind.y_val, wind.x_val));
            nil
        }
        "simListSceneObjects" => {
            let found = matching(city, &a.text(0)?, true)?;
            answer!(found.into_iter().map(|(name, _)| name).collect::<Vec<_>>())
        }
        "simGetObjectPose" => answer!(object_pose(city, &a.text(0)?)),
        "simSetSegmentationObjectID" => {
            let number: i64 = a.number(1)? as i64;
            let Ok(number) = u8::try_from(number) else { return Err(format!("{number} is not between 0 and 255")) };
            let found = matching(city, &a.text(0)?, a.read(2)?)?;
            found.iter().for_each(|(_, id)| city.set_label(*id, number));
            answer!(!found.is_empty())
        }
        "simGetSegmentationObjectID" => {
            let found = matching(city, &a.text(0)?, false)?;
            answer!(found.first().map_or(-1, |(_, id)| i32::from(city.label(*id))))
        }
        "simPause" => {
            city.pause(a.read(0)?);
            nil
        }
        "simIsPaused" => answer!(city.is_paused()),
        "getImuData" => answer!(sensors::imu(city, &a.text(1)?)?),
        "getBarometerData" => answer!(sensors::barometer(city, &a.text(1)?)?),
        "getMagnetometerData" => answer!(sensors::magnetometer(city, &a.text(1)?)?),
        "getGpsData" => answer!(sensors::gps(city, &a.text(1)?)?),
        "getDistanceSensorData" => answer!(sensors::distance(city, &a.text(0)?, &a.text(1)?)?),
        "simTestLineOfSightToPoint" => {
            let from = city.vehicle(&a.text(1)?)?.pose().position;
            answer!(sees(city, from, on_earth(city, a, 0)?))
        }
        "simTestLineOfSightBetweenPoints" => answer!(sees(city, on_earth(city, a, 0)?, on_earth(city, a, 1)?)),
        "simGetWorldExtents" => {
            let bounds = city.loaded.scene.bounds;
            answer!([bounds.min, bounds.max].map(|corner| city.geo(city.world.of(corner))))
        }
        other => Err(format!("{other} is not answered here")),
    }
}

/// The state of a vehicle; Colosseum's has three fields more.
fn state(city: &mut City, name: &str, encoding: Encoding) -> Result<MultirotorState, String> {
    let (gps_location, timestamp) = (sensors::place(city, name)?, city.stamp());
    let vehicle = city.vehicle(name)?;
    let more = encoding == Encoding::Array;
    Ok(MultirotorState {
        collision: vehicle.collision().clone(),
        kinematics_estimated: vehicle.kinematics(),
        gps_location,
        timestamp,
        landed_state: u8::from(!vehicle.is_landed()),
        rc_data: RcData::default(),
        ready: more.then_some(true),
        ready_message: more.then(String::new),
        can_arm: more.then_some(true),
    })
}

/// Puts a vehicle somewhere. Unless collisions are ignored, it stops at what lies between.
fn put(city: &mut City, name: &str, pose: wire::Pose, state: Option<KinematicsState>, ignore: bool) -> Result<(), String> {
    let (loaded, stamp) = (city.loaded.clone(), city.stamp());
    let vehicle = city.vehicle(name)?;
    let before = vehicle.pose();
    let mut position = kept(vehicle.frame, pose.position, before.position)?;
    let q = pose.orientation;
    let keeps = [q.w_val, q.x_val, q.y_val, q.z_val].iter().any(|part| part.is_nan());
    let attitude = if keeps { before.attitude } else { attitude(q).ok_or("the orientation is no rotation")? };
    let radius = vehicle.craft.dynamics().model().craft.radius;
    let mut touched = None;
    if !ignore {
        // It may stand on something: what it touches already does not count.
        let raised = |p: EnuPosition| EnuPosition { up: p.up + 0.02, ..p };
        if let Some(contact) = loaded.collider.sweep(raised(before.position), raised(position), radius) {
            (position, touched) = (contact.centre, Some(contact.object));
        }
    }
    let level = Attitude { pitch: 0.0, roll: 0.0, ..attitude };
    let pose = Pose { position, attitude: if vehicle.is_posed() { attitude } else { level } };
    vehicle.cancel();
    match state {
        Some(state) => vehicle.set_kinematics(pose, state),
        None => vehicle.put(pose, Default::default(), None),
    }
    let touched = touched.or_else(|| vehicle.is_posed().then(|| loaded.collider.contact(position, radius - 0.01)).flatten());
    if let Some(object) = touched {
        vehicle.touch(object, &loaded, stamp);
    }
    Ok(())
}

fn camera_info(city: &mut City, name: &str, vehicle: &str) -> Result<CameraInfo, String> {
    let (_, mount, body) = city.camera(vehicle, name)?;
    let (pose, capture) = (mounted(&body, mount.place, mount.turned), mount.capture(ImageType::Scene));
    let lens = camera(capture);
    let (x, y) = (2.0 * lens.fx / f64::from(capture.width), 2.0 * lens.fy / f64::from(capture.height));
    // From the camera's forward, right, down to the picture's right and up from its middle, -1 to 1; depth is reversed, without an end.
    let matrix = [[0.0, x, 0.0, 0.0], [0.0, 0.0, -y, 0.0], [0.0, 0.0, 0.0, NEAR], [1.0, 0.0, 0.0, 0.0]];
    let frame = city.vehicle(vehicle)?.frame;
    Ok(CameraInfo { pose: frame.pose(&pose), fov: capture.fov, proj_mat: ProjectionMatrix { matrix } })
}

/// Objects by name: of one whole name, without regard to case, or of a pattern that fits the whole name.
fn matching(city: &City, name: &str, pattern: bool) -> Result<Vec<(String, ObjectId)>, String> {
    let objects = city.objects();
    if !pattern {
        let same = |other: &&str| other.eq_ignore_ascii_case(name);
        return Ok(objects.iter().filter(|(other, _)| same(other)).map(|(other, id)| ((*other).to_owned(), *id)).collect());
    }
    if name.len() > PATTERN {
        return Err(format!("a pattern of {} bytes is longer than {PATTERN}", name.len()));
    }
    let built = RegexBuilder::new(&format!("^(?:{name})$")).case_insensitive(true).size_limit(PATTERN_MEMORY).build();
    let regex = built.map_err(|error| format!("`{name}` is no pattern: {error}"))?;
    Ok(objects.iter().filter(|(other, _)| regex.is_match(other)).map(|(other, id)| ((*other).to_owned(), *id)).collect())
}

/// Pose of an object, or of a vehicle, in the world; of an object the middle of its extent. NaN if there is none.
fn object_pose(city: &City, name: &str) -> wire::Pose {
    if let Some(vehicle) = city.vehicles.iter().find(|vehicle| vehicle.settings.name == name) {
        return city.world.pose(&vehicle.pose());
    }
    let Some(object) = city.loaded.scene.objects.iter().find(|object| object.key == name) else {
        return wire::Pose { position: Vector3r::NAN, orientation: Quaternionr::NAN };
    };
    let actors = city.actors();
    let bounds = city.loaded.bounds(object, &actors);
    let middle = (DVec3::from(corner(bounds.min)) + DVec3::from(corner(bounds.max))) * 0.5;
    let place = city.loaded.cast.of_object(object.id).and_then(|actor| actors.get(actor));
    let heading = place.map_or(0.0, |place| place.heading);
    wire::Pose {
        position: city.world.of(EnuPosition::of_vector(middle)),
        orientation: quaternion(Attitude { heading, ..Attitude::default() }),
    }
}

fn corner(p: EnuPosition) -> [f64; 3] {
    [p.east, p.north, p.up]
}

fn on_earth(city: &City, a: Arguments<'_>, place: usize) -> Result<EnuPosition, String> {
    let point: GeoPoint = a.read(place)?;
    Ok(city.world.position(check(city.point(point))?))
}

fn sees(city: &City, from: EnuPosition, to: EnuPosition) -> bool {
    city.loaded.collider.segment_blocked(from, to).is_none()
}
