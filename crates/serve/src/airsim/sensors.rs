//! What a vehicle's sensors measure: from its true motion, without noise.

use spf_core::geometry::Attitude;
use spf_drone::airsim::wire::structs::{
    BarometerData, DistanceSensorData, EnvironmentState, GnssReport, GpsData, ImuData, MagnetometerData, Pose, Vector3r,
};
use spf_sim::model::GRAVITY;

use super::city::City;
use super::frames::{attitude, mounted, quaternion, to_body};

/// Pressure at sea level, pascal; temperature there, kelvin; its lapse, K/m; gas constant of air, J/(kg K): the International
/// Standard Atmosphere (ISO 2533), below 11 km.
const ISA: [f64; 4] = [101_325.0, 288.15, 0.0065, 287.052_87];
/// Strength of the earth's field at its magnetic equator, gauss (the dipole term of the International Geomagnetic Reference Field).
const EQUATOR: f64 = 0.298;

/// Pressure, temperature and density of the air, in pascal, kelvin and kg/m³.
fn air(altitude: f64) -> [f64; 3] {
    let [pressure, temperature, lapse, gas] = ISA;
    let here = (temperature - lapse * altitude).max(1.0);
    let pressure = pressure * libm::pow(here / temperature, GRAVITY / (gas * lapse));
    [pressure, here, pressure / (gas * here)]
}

/// Where a vehicle is on the earth.
pub(super) fn place(city: &mut City, vehicle: &str) -> Result<spf_drone::airsim::wire::structs::GeoPoint, String> {
    let position = city.vehicle(vehicle)?.pose().position;
    let point = city.world.of(position);
    Ok(city.geo(point))
}

/// The inertial sensor.
pub(super) fn imu(city: &mut City, vehicle: &str) -> Result<ImuData, String> {
    let time_stamp = city.stamp();
    let state = city.vehicle(vehicle)?.kinematics();
    let level = attitude(state.orientation).unwrap_or_default();
    let gained = state.linear_acceleration;
    let felt = Vector3r::new(gained.x_val, gained.y_val, gained.z_val - GRAVITY);
    Ok(ImuData {
        time_stamp,
        orientation: state.orientation,
        angular_velocity: state.angular_velocity,
        linear_acceleration: to_body(level, felt),
    })
}

/// The barometer.
pub(super) fn barometer(city: &mut City, vehicle: &str) -> Result<BarometerData, String> {
    let altitude = place(city, vehicle)?.altitude;
    let [pressure, ..] = air(altitude);
    Ok(BarometerData { time_stamp: city.stamp(), altitude, pressure, qnh: ISA[0] / 100.0 })
}

/// The magnetometer: a dipole along the earth's axis.
pub(super) fn magnetometer(city: &mut City, vehicle: &str) -> Result<MagnetometerData, String> {
    let latitude = place(city, vehicle)?.latitude.to_radians();
    let level = attitude(city.vehicle(vehicle)?.kinematics().orientation).unwrap_or_default();
    let field = Vector3r::new(EQUATOR * libm::cos(latitude), 0.0, 2.0 * EQUATOR * libm::sin(latitude));
    Ok(MagnetometerData {
        time_stamp: city.stamp(),
        magnetic_field_body: to_body(level, field),
        magnetic_field_covariance: Vec::new(),
    })
}

/// The receiver of satellites.
pub(super) fn gps(city: &mut City, vehicle: &str) -> Result<GpsData, String> {
    let (geo_point, time_stamp) = (place(city, vehicle)?, city.stamp());
    let velocity = city.vehicle(vehicle)?.kinematics().linear_velocity;
    let gnss = GnssReport { geo_point, eph: 0.0, epv: 0.0, velocity, fix_type: 3, time_utc: time_stamp };
    Ok(GpsData { time_stamp, gnss, is_valid: true })
}

/// A rangefinder; an empty name is the first.
pub(super) fn distance(city: &mut City, name: &str, vehicle: &str) -> Result<DistanceSensorData, String> {
    let time_stamp = city.stamp();
    let one = city.vehicle(vehicle)?;
    let ranges = &one.settings.ranges;
    let found = if name.is_empty() { ranges.values().next() } else { ranges.get(name) };
    let mount = *found.ok_or_else(|| format!("No distance sensor with name {name} exist on vehicle {vehicle}"))?;
    let from = mounted(&one.pose(), mount.place, mount.turned);
    Ok(DistanceSensorData {
        time_stamp,
        distance: one.range(&from, mount.farthest).max(mount.nearest),
        min_distance: mount.nearest,
        max_distance: mount.farthest,
        relative_pose: Pose { position: mount.place, orientation: quaternion(Attitude { ..mount.turned }) },
    })
}

/// The surroundings.
pub(super) fn environment(city: &mut City, vehicle: &str) -> Result<EnvironmentState, String> {
    let geo_point = place(city, vehicle)?;
    let position = city.vehicle(vehicle)?.kinematics().position;
    let [air_pressure, temperature, air_density] = air(geo_point.altitude);
    Ok(EnvironmentState {
        position,
        geo_point,
        gravity: Vector3r::new(0.0, 0.0, GRAVITY),
        air_pressure,
        temperature,
        air_density,
    })
}
