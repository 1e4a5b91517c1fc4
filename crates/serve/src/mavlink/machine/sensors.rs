//! Sensors around the craft, from the solid geometry of the scene: rangefinders ahead, left and right, and a proximity sensor all
//! round.

use spf_core::geometry::Pose;
use spf_core::ranges::RangeRay;
use spf_core::time::Time;
use spf_mavlink::dialect::{
    DISTANCE_SENSOR_DATA, MavDistanceSensor, MavFrame, MavMessage, MavSensorOrientation, OBSTACLE_DISTANCE_DATA,
};
use spf_mavlink::wire::Body;
use spf_sim::craft::SimCraft;

/// Range of the rangefinders and of the proximity sensor, cm.
const FINDER: (u16, u16) = (20, 1200);
const PROXIMITY: (u16, u16) = (20, 1000);
/// Beam of a rangefinder, radians, and number of rays that it is made of, on either side of its middle.
const BEAM: f64 = 0.05;
const BESIDE: i32 = 1;
/// Sectors of the proximity sensor.
const SECTORS: usize = 72;

/// Distance to the nearest thing in a beam, cm; `None` if there is none in range.
fn measured(craft: &SimCraft, azimuth: f64, width: f64, most: u16) -> Option<u16> {
    let pose: Pose = craft.dynamics().pose();
    let reach = f64::from(most) * 0.01;
    let ray = RangeRay { azimuth, elevation: 0.0, width, metres: None, reach };
    let step = 0.5 * width / f64::from(BESIDE + 1);
    let ends = (-BESIDE..=BESIDE).map(|n| ray.end(pose, step * f64::from(n)));
    let near = ends.filter_map(|end| craft.collider().range(pose.position, end)).fold(f64::INFINITY, f64::min);
    (near < reach).then_some((near * 100.0) as u16)
}

/// What the rangefinders measure.
pub(super) fn rangefinders(time_boot_ms: u32, craft: &SimCraft) -> [Body; 3] {
    [
        (1, MavSensorOrientation::MAV_SENSOR_ROTATION_NONE, 0.0),
        (2, MavSensorOrientation::MAV_SENSOR_ROTATION_YAW_90, core::f64::consts::FRAC_PI_2),
        (3, MavSensorOrientation::MAV_SENSOR_ROTATION_YAW_270, -core::f64::consts::FRAC_PI_2),
    ]
    .map(|(id, orientation, azimuth)| {
        Body::from(&MavMessage::DISTANCE_SENSOR(DISTANCE_SENSOR_DATA {
            time_boot_ms,
            min_distance: FINDER.0,
            max_distance: FINDER.1,
            current_distance: measured(craft, azimuth, BEAM, FINDER.1).unwrap_or(FINDER.1),
            mavtype: MavDistanceSensor::MAV_DISTANCE_SENSOR_LASER,
            id,
            orientation,
            covariance: u8::MAX,
            horizontal_fov: BEAM as f32,
            vertical_fov: BEAM as f32,
            ..DISTANCE_SENSOR_DATA::default()
        }))
    })
}

/// What the proximity sensor measures.
pub(super) fn proximity(now: Time, craft: &SimCraft) -> MavMessage {
    let width = core::f64::consts::TAU / SECTORS as f64;
    let mut distances = [u16::MAX; SECTORS];
    for (sector, distance) in distances.iter_mut().enumerate() {
        let found = measured(craft, sector as f64 * width, width, PROXIMITY.1);
        *distance = found.unwrap_or(PROXIMITY.1 + 1).max(PROXIMITY.0);
    }
    MavMessage::OBSTACLE_DISTANCE(OBSTACLE_DISTANCE_DATA {
        time_usec: now.as_nanos() / 1000,
        distances,
        min_distance: PROXIMITY.0,
        max_distance: PROXIMITY.1,
        sensor_type: MavDistanceSensor::MAV_DISTANCE_SENSOR_LASER,
        increment: 5,
        increment_f: 0.0,
        angle_offset: 0.0,
        frame: MavFrame::MAV_FRAME_BODY_FRD,
    })
}

/// What ArduPilot's proximity library tells of what it was told: eight sectors, as rangefinders from number 10 on.
pub(super) fn echo(time_boot_ms: u32, told: &OBSTACLE_DISTANCE_DATA) -> Vec<Body> {
    use MavSensorOrientation as Looks;
    let sectors = [
        Looks::MAV_SENSOR_ROTATION_NONE,
        Looks::MAV_SENSOR_ROTATION_YAW_45,
        Looks::MAV_SENSOR_ROTATION_YAW_90,
        Looks::MAV_SENSOR_ROTATION_YAW_135,
        Looks::MAV_SENSOR_ROTATION_YAW_180,
        Looks::MAV_SENSOR_ROTATION_YAW_225,
        Looks::MAV_SENSOR_ROTATION_YAW_270,
        Looks::MAV_SENSOR_ROTATION_YAW_315,
    ];
    let body = |(sector, orientation): (usize, Looks)| {
        let current_distance = told.distances[sector * SECTORS / 8];
        (current_distance <= told.max_distance).then(|| {
            Body::from(&MavMessage::DISTANCE_SENSOR(DISTANCE_SENSOR_DATA {
                time_boot_ms,
                min_distance: told.min_distance,
                max_distance: told.max_distance,
                current_distance,
                id: 10 + sector as u8,
                orientation,
                ..DISTANCE_SENSOR_DATA::default()
            }))
        })
    };
    sectors.into_iter().enumerate().filter_map(body).collect()
}
