//! Rangefinders and proximity sensors: `DISTANCE_SENSOR` and `OBSTACLE_DISTANCE`, as rays and back.

use mavlink::dialects::common::{DISTANCE_SENSOR_DATA, MavDistanceSensor, MavFrame, MavMessage, OBSTACLE_DISTANCE_DATA};
use spf_core::ranges::{RangeRay, RangeScan};
use spf_core::time::Time;

use crate::wire::Body;

/// `MAV_SENSOR_ORIENTATION` of sensors that look up, and down.
const UP: u8 = 24;
const DOWN: u8 = 25;
/// Width of the beam of a rangefinder that does not tell, radians: 3°.
const BEAM: f64 = 3.0 / 180.0 * core::f64::consts::PI;
/// The sensor number of `OBSTACLE_DISTANCE`; those of rangefinders are made of number and orientation.
const PROXIMITY: u32 = 1 << 16;
/// ArduPilot numbers the sectors of its proximity library from here on.
const ECHOES: u32 = 10;
/// No measurement in this sector.
const UNKNOWN: u16 = u16::MAX;

/// The rays of a scan, and what their azimuth is counted from.
#[derive(Clone, Debug, PartialEq)]
pub struct Ranges {
    /// Number of the sensor.
    pub sensor: u32,
    /// Whether azimuths are counted from north, not from straight ahead.
    pub from_north: bool,
    /// The rays.
    pub rays: Vec<RangeRay>,
    /// The vehicle's clock at the measurement, ms; zero if it has none.
    pub boot_ms: u64,
}

impl Ranges {
    /// Whether this may be what another program has told the autopilot: `OBSTACLE_DISTANCE`, with which PX4 tells what it has fused,
    /// or a rangefinder from number 10 on, as which ArduPilot tells what its avoidance knows.
    #[must_use]
    pub fn may_be_echo(&self) -> bool {
        self.sensor >= ECHOES << 8
    }

    /// Whether any of its rays is level.
    #[must_use]
    pub fn is_level(&self) -> bool {
        self.rays.iter().any(|ray| ray.elevation.abs() < core::f64::consts::FRAC_PI_4)
    }
}

/// A rangefinder that does not look down; `None` if it looks down, nowhere that is known, or says nothing.
pub(crate) fn of_rangefinder(it: &DISTANCE_SENSOR_DATA) -> Option<Ranges> {
    let orientation = it.orientation as u8;
    let (azimuth, elevation) = match orientation {
        0..=7 => (f64::from(orientation) * core::f64::consts::FRAC_PI_4, 0.0),
        UP => (0.0, core::f64::consts::FRAC_PI_2),
        _ => return None,
    };
    // A quality of 1 means that there was no measurement, and 0 that it is unknown.
    if it.signal_quality == 1 || it.current_distance == 0 || it.max_distance == 0 {
        return None;
    }
    let width = if it.horizontal_fov > 0.0 && it.horizontal_fov < 3.0 { f64::from(it.horizontal_fov) } else { BEAM };
    let reach = f64::from(it.max_distance) * 0.01;
    // Nearer than it can measure is at most that far away.
    let metres = (it.current_distance < it.max_distance).then(|| f64::from(it.current_distance.max(it.min_distance)) * 0.01);
    let sensor = u32::from(it.id) << 8 | u32::from(orientation);
    Some(Ranges {
        sensor,
        from_north: false,
        rays: vec![RangeRay { azimuth, elevation, width, metres, reach }],
        boot_ms: it.time_boot_ms.into(),
    })
}

/// The sectors of a proximity sensor.
pub(crate) fn of_sectors(it: &OBSTACLE_DISTANCE_DATA) -> Ranges {
    let increment = if it.increment_f != 0.0 && it.increment_f.is_finite() { it.increment_f } else { f32::from(it.increment) };
    let offset = if it.angle_offset.is_finite() { it.angle_offset } else { 0.0 };
    let reach = f64::from(it.max_distance) * 0.01;
    let ray = |(index, &distance): (usize, &u16)| {
        if distance == UNKNOWN || increment == 0.0 {
            return None;
        }
        let azimuth = f64::from(offset + increment * index as f32).to_radians() % core::f64::consts::TAU;
        let metres = (distance <= it.max_distance).then(|| f64::from(distance.max(it.min_distance)) * 0.01);
        Some(RangeRay { azimuth, elevation: 0.0, width: f64::from(increment.abs()).to_radians(), metres, reach })
    };
    Ranges {
        sensor: PROXIMITY,
        from_north: it.frame == MavFrame::MAV_FRAME_GLOBAL,
        rays: it.distances.iter().enumerate().filter_map(ray).collect(),
        boot_ms: it.time_usec / 1000,
    }
}

/// Whether it looks down.
pub(crate) fn looks_down(it: &DISTANCE_SENSOR_DATA) -> bool {
    it.orientation as u8 == DOWN
}

/// A scan of level rays as `OBSTACLE_DISTANCE`: 72 sectors of 5°, clockwise from straight ahead.
#[must_use]
pub fn obstacle_distance(now: Time, scan: &RangeScan) -> Body {
    let (mut distances, mut farthest) = ([UNKNOWN; 72], 0.0_f64);
    for ray in scan.rays.iter().filter(|ray| ray.is_valid() && ray.elevation == 0.0) {
        let sector = (libm::round(ray.azimuth.to_degrees() / 5.0) as i64).rem_euclid(72) as usize;
        farthest = farthest.max(ray.reach);
        let cm = |metres: f64| libm::round(metres * 100.0).min(60_000.0) as u16;
        // Beyond the range is one more than it.
        let told = ray.metres.map_or(cm(ray.reach) + 1, cm);
        distances[sector] = distances[sector].min(told);
    }
    Body::from(&MavMessage::OBSTACLE_DISTANCE(OBSTACLE_DISTANCE_DATA {
        time_usec: now.as_nanos() / 1000,
        distances,
        min_distance: 20,
        max_distance: libm::round(farthest * 100.0).min(60_000.0) as u16,
        sensor_type: MavDistanceSensor::MAV_DISTANCE_SENSOR_LASER,
        increment: 5,
        increment_f: 0.0,
        angle_offset: 0.0,
        frame: MavFrame::MAV_FRAME_BODY_FRD,
    }))
}

#[cfg(test)]
mod tests {
    use core::f64::consts::FRAC_PI_2;

    use mavlink::dialects::common::MavSensorOrientation;

    use super::*;

    fn finder(orientation: MavSensorOrientation, cm: u16) -> DISTANCE_SENSOR_DATA {
        DISTANCE_SENSOR_DATA { min_distance: 20, max_distance: 800, current_distance: cm, orientation, ..Default::default() }
    }

    #[test]
    fn a_rangefinder_looks_where_its_orientation_says() {
        let right = of_rangefinder(&finder(MavSensorOrientation::MAV_SENSOR_ROTATION_YAW_90, 350)).unwrap();
        let RangeRay { azimuth, elevation, metres, reach, .. } = right.rays[0];
        assert_eq!((azimuth, elevation, metres, reach), (FRAC_PI_2, 0.0, Some(3.5), 8.0));
        let up = of_rangefinder(&finder(MavSensorOrientation::MAV_SENSOR_ROTATION_PITCH_90, 800)).unwrap();
        assert_eq!((up.rays[0].elevation, up.rays[0].metres), (FRAC_PI_2, None));
        let near = of_rangefinder(&finder(MavSensorOrientation::MAV_SENSOR_ROTATION_NONE, 5)).unwrap();
        assert_eq!(near.rays[0].metres, Some(0.2), "nearer than it can measure");
        assert_eq!(of_rangefinder(&finder(MavSensorOrientation::MAV_SENSOR_ROTATION_PITCH_270, 350)), None, "down");
        let invalid = DISTANCE_SENSOR_DATA { signal_quality: 1, ..finder(MavSensorOrientation::MAV_SENSOR_ROTATION_NONE, 350) };
        assert_eq!(of_rangefinder(&invalid), None);
    }

    #[test]
    fn sectors_are_counted_from_their_offset_and_what_is_sent_is_read_back() {
        let mut it = OBSTACLE_DISTANCE_DATA {
            increment: 10,
            angle_offset: -20.0,
            min_distance: 20,
            max_distance: 1000,
            ..Default::default()
        };
        it.distances = [UNKNOWN; 72];
        (it.distances[0], it.distances[2], it.distances[3]) = (500, 1001, 0);
        it.frame = MavFrame::MAV_FRAME_BODY_FRD;
        let read = of_sectors(&it);
        let told: Vec<(i32, Option<f64>)> =
            read.rays.iter().map(|ray| (ray.azimuth.to_degrees().round() as i32, ray.metres)).collect();
        assert_eq!((told, read.from_north), (vec![(-20, Some(5.0)), (0, None), (10, Some(0.2))], false));
        let scan = RangeScan { captured: Time::ZERO, sensor: 0, rays: read.rays };
        let body = obstacle_distance(Time::from_millis(5), &scan);
        let mut decoder = crate::wire::Decoder::default();
        decoder.push(&crate::wire::Encoder::new([1, 191]).frame(&body));
        let Some(MavMessage::OBSTACLE_DISTANCE(sent)) = decoder.next_packet().unwrap().message() else { panic!() };
        assert_eq!((sent.distances[68], sent.distances[0], sent.distances[2], sent.distances[1]), (500, 1001, 20, UNKNOWN));
        assert_eq!((sent.max_distance, sent.increment, sent.frame), (1000, 5, MavFrame::MAV_FRAME_BODY_FRD));
    }

    proptest::proptest! {
        #[test]
        fn no_scan_panics_and_every_ray_is_valid(distances in proptest::collection::vec(proptest::prelude::any::<u16>(), 72),
            increment in proptest::prelude::any::<u8>(), step in proptest::prelude::any::<f32>(), offset in proptest::prelude::any::<f32>(),
            least in proptest::prelude::any::<u16>(), most in proptest::prelude::any::<u16>()) {
            let mut it = OBSTACLE_DISTANCE_DATA { increment, increment_f: step, angle_offset: offset, min_distance: least, max_distance: most, ..Default::default() };
            it.distances.copy_from_slice(&distances);
            let rays = of_sectors(&it).rays;
            let body = obstacle_distance(Time::ZERO, &RangeScan { captured: Time::ZERO, sensor: 0, rays });
            proptest::prop_assert_eq!(body.id, 330);
        }
    }
}
