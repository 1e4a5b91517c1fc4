//! AirSim's `settings.json`, as far as a headless multirotor has a use for it: vehicles, cameras, clock, wind, origin.
//!
//! Source: AirSim's page on its settings. What is unknown is ignored, as AirSim does; what is known and wrong is refused.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;
use spf_core::geometry::Attitude;
use spf_drone::airsim::wire::structs::{GeoPoint, ImageType, Vector3r};

/// Longest file, bytes.
pub(super) const LONGEST: u64 = 1 << 20;
/// Most vehicles.
const VEHICLES: usize = 16;
/// Most cameras and sensors of a vehicle.
const CARRIED: usize = 64;
/// Longest side of a picture, pixels.
const LONGEST_SIDE: u32 = 4096;
/// Farthest anything may be from the start, metres.
const FARTHEST: f64 = 1e5;

/// Why settings cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SettingsError {
    /// The file cannot be read.
    #[error("cannot read the settings")]
    Read(#[from] std::io::Error),
    /// It is not JSON, or a value has the wrong type.
    #[error("not settings of AirSim")]
    Json(#[from] serde_json::Error),
    /// A value is out of range.
    #[error("{0}")]
    Value(String),
}

/// Size and field of view of one kind of picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capture {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Horizontal field of view, the whole angle, degrees.
    pub fov: f64,
}

impl Default for Capture {
    /// AirSim's: 256 × 144 pixels, 90°.
    fn default() -> Self {
        Self { width: 256, height: 144, fov: 90.0 }
    }
}

/// A camera on a vehicle.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CameraMount {
    /// Its place, body FRD, metres.
    pub place: Vector3r,
    /// Its attitude on the body.
    pub turned: Attitude,
    /// Its pictures, by the number of their type; what is absent is as the scene's picture.
    pub captures: BTreeMap<u8, Capture>,
}

impl CameraMount {
    /// Size and field of view of this type of picture.
    #[must_use]
    pub fn capture(&self, image_type: ImageType) -> Capture {
        let of = |number| self.captures.get(&number).copied();
        of(image_type.number()).or_else(|| of(0)).unwrap_or_default()
    }
}

/// A rangefinder on a vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeMount {
    /// Its place, body FRD, metres.
    pub place: Vector3r,
    /// Its attitude on the body.
    pub turned: Attitude,
    /// Metres.
    pub nearest: f64,
    /// Metres.
    pub farthest: f64,
}

impl Default for RangeMount {
    /// AirSim's: forward, 0.2 to 40 m.
    fn default() -> Self {
        Self { place: Vector3r::default(), turned: Attitude::default(), nearest: 0.2, farthest: 40.0 }
    }
}

/// A vehicle.
#[derive(Clone, Debug, PartialEq)]
pub struct VehicleSettings {
    /// Its name.
    pub name: String,
    /// Whether its motors may start without `armDisarm`.
    pub armed: bool,
    /// Start, NED from the scene's start, metres; it stands on the surface below.
    pub start: Vector3r,
    /// Heading at the start, radians; `None` for the scene's.
    pub heading: Option<f64>,
    /// Its cameras, by name.
    pub cameras: BTreeMap<String, CameraMount>,
    /// Its rangefinders, by name.
    pub ranges: BTreeMap<String, RangeMount>,
}

/// Settings.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Vehicles, in order of their names; at least one.
    pub vehicles: Vec<VehicleSettings>,
    /// Simulated seconds per second.
    pub clock_speed: f64,
    /// Wind, NED, m/s; the vertical part is without effect.
    pub wind: Vector3r,
    /// The scene's start on the earth.
    pub origin: GeoPoint,
    /// Whether vehicles are moved by whoever sets their pose alone: computer vision mode, or an external physics engine.
    pub posed: bool,
    /// The text, for `getSettingsString`.
    pub text: String,
}

/// The five cameras that every vehicle has: name, number, forward and right of the centre, yaw and pitch in degrees.
const CAMERAS: [(&str, &str, [f64; 2], f64, f64); 5] = [
    ("front_center", "0", [0.5, 0.0], 0.0, 0.0),
    ("front_right", "1", [0.5, 0.25], 0.0, 0.0),
    ("front_left", "2", [0.5, -0.25], 0.0, 0.0),
    ("bottom_center", "3", [0.0, 0.0], 0.0, -90.0),
    ("back_center", "4", [-0.5, 0.0], 180.0, 0.0),
];

impl Default for Settings {
    /// One vehicle, `SimpleFlight`, with AirSim's cameras.
    fn default() -> Self {
        Self::parse("{}").unwrap_or_else(|_| unreachable!("an empty object is valid"))
    }
}

impl Settings {
    /// Reads a file.
    ///
    /// # Errors
    /// [`SettingsError`] if it cannot be read or used.
    pub fn load(path: &Path) -> Result<Self, SettingsError> {
        let text = String::from_utf8(spf_input::read(path, LONGEST)?).map_err(std::io::Error::other)?;
        Self::parse(&text)
    }

    /// Reads a text.
    ///
    /// # Errors
    /// [`SettingsError`] if it is not JSON, or a value has a wrong type or is out of range.
    pub fn parse(text: &str) -> Result<Self, SettingsError> {
        let file: File = serde_json::from_str(text.trim_start_matches('\u{feff}'))?;
        let clock_speed = within("ClockSpeed", file.clock_speed.unwrap_or(1.0), 0.01, 100.0)?;
        let wind = file.wind.unwrap_or_default().vector("Wind", 100.0)?;
        let defaults = captures("CameraDefaults", &file.camera_defaults)?;
        let mut vehicles = file.vehicles;
        if vehicles.is_empty() {
            vehicles.insert("SimpleFlight".to_owned(), Vehicle::default());
        }
        if vehicles.len() > VEHICLES {
            return Err(SettingsError::Value(format!("Vehicles: {} are more than {VEHICLES}", vehicles.len())));
        }
        let external =
            vehicles.values().any(|one| one.physics_engine_name.as_deref().is_some_and(|name| name == "ExternalPhysicsEngine"));
        let vehicles = vehicles.into_iter().map(|(name, one)| one.read(name, &defaults)).collect::<Result<_, _>>()?;
        let place = file.origin_geopoint.unwrap_or(Origin { latitude: 47.641_468, longitude: -122.140_165, altitude: 122.0 });
        let origin = GeoPoint {
            latitude: within("OriginGeopoint.Latitude", place.latitude, -89.0, 89.0)?,
            longitude: within("OriginGeopoint.Longitude", place.longitude, -180.0, 180.0)?,
            altitude: within("OriginGeopoint.Altitude", place.altitude, -500.0, 9000.0)?,
        };
        let posed = external
            || file.sim_mode.as_deref() == Some("ComputerVision")
            || file.physics_engine_name.as_deref() == Some("ExternalPhysicsEngine");
        Ok(Self { vehicles, clock_speed, wind, origin, posed, text: text.to_owned() })
    }
}

fn within(name: &str, value: f64, low: f64, high: f64) -> Result<f64, SettingsError> {
    let fits = (low..=high).contains(&value);
    fits.then_some(value).ok_or_else(|| SettingsError::Value(format!("{name}: expected {low} to {high}, found {value}")))
}

fn captures(of: &str, camera: &Camera) -> Result<BTreeMap<u8, Capture>, SettingsError> {
    let mut all = BTreeMap::new();
    for one in &camera.capture_settings {
        let number = u8::try_from(one.image_type.unwrap_or(0)).ok().and_then(ImageType::of);
        let Some(image_type) = number else {
            // AirSim's -1 is the picture of its own window, which there is none of here.
            continue;
        };
        let usual = Capture::default();
        let side = |name: &str, value: Option<f64>, usual: u32| {
            within(&format!("{of}.{name}"), value.unwrap_or(f64::from(usual)), 1.0, f64::from(LONGEST_SIDE))
        };
        let capture = Capture {
            width: side("Width", one.width, usual.width)? as u32,
            height: side("Height", one.height, usual.height)? as u32,
            fov: within(&format!("{of}.FOV_Degrees"), one.fov_degrees.unwrap_or(usual.fov), 1.0, 170.0)?,
        };
        all.insert(image_type.number(), capture);
    }
    Ok(all)
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "PascalCase", default)]
struct File {
    sim_mode: Option<String>,
    clock_speed: Option<f64>,
    physics_engine_name: Option<String>,
    wind: Option<Place>,
    origin_geopoint: Option<Origin>,
    camera_defaults: Camera,
    vehicles: BTreeMap<String, Vehicle>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "PascalCase")]
struct Origin {
    latitude: f64,
    longitude: f64,
    altitude: f64,
}

/// A place and an attitude, as they are written everywhere: NED or FRD, metres, degrees.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "PascalCase", default)]
struct Place {
    x: Option<f64>,
    y: Option<f64>,
    z: Option<f64>,
    yaw: Option<f64>,
    pitch: Option<f64>,
    roll: Option<f64>,
}

impl Place {
    fn vector(&self, of: &str, most: f64) -> Result<Vector3r, SettingsError> {
        let part = |name: &str, value: Option<f64>| within(&format!("{of}.{name}"), value.unwrap_or(0.0), -most, most);
        Ok(Vector3r::new(part("X", self.x)?, part("Y", self.y)?, part("Z", self.z)?))
    }

    fn attitude(&self, of: &str) -> Result<Attitude, SettingsError> {
        let part = |name: &str, value: Option<f64>| {
            within(&format!("{of}.{name}"), value.unwrap_or(0.0), -360.0, 360.0).map(f64::to_radians)
        };
        Ok(Attitude { heading: part("Yaw", self.yaw)?, pitch: part("Pitch", self.pitch)?, roll: part("Roll", self.roll)? })
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "PascalCase", default)]
struct Camera {
    capture_settings: Vec<OneCapture>,
    #[serde(flatten)]
    place: Place,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "PascalCase", default)]
struct OneCapture {
    image_type: Option<i64>,
    width: Option<f64>,
    height: Option<f64>,
    #[serde(rename = "FOV_Degrees")]
    fov_degrees: Option<f64>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "PascalCase", default)]
struct Sensor {
    sensor_type: Option<i64>,
    enabled: Option<bool>,
    min_distance: Option<f64>,
    max_distance: Option<f64>,
    #[serde(flatten)]
    place: Place,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "PascalCase", default)]
struct Vehicle {
    vehicle_type: Option<String>,
    default_vehicle_state: Option<String>,
    physics_engine_name: Option<String>,
    cameras: BTreeMap<String, Camera>,
    sensors: BTreeMap<String, Sensor>,
    #[serde(flatten)]
    place: Place,
}

impl Vehicle {
    fn read(&self, name: String, defaults: &BTreeMap<u8, Capture>) -> Result<VehicleSettings, SettingsError> {
        let of = format!("Vehicles.{name}");
        let known = self
            .vehicle_type
            .as_deref()
            .is_none_or(|kind| matches!(kind.to_lowercase().as_str(), "simpleflight" | "computervision"));
        if !known {
            let kind = self.vehicle_type.as_deref().unwrap_or_default();
            return Err(SettingsError::Value(format!("{of}.VehicleType: only SimpleFlight is simulated, found {kind}")));
        }
        if self.cameras.len() + self.sensors.len() > CARRIED {
            return Err(SettingsError::Value(format!("{of}: more than {CARRIED} cameras and sensors")));
        }
        let usual = |&(name, _, [x, y], yaw, pitch): &(&str, &str, [f64; 2], f64, f64)| {
            let turned = Attitude { heading: f64::to_radians(yaw), pitch: f64::to_radians(pitch), roll: 0.0 };
            (name.to_owned(), CameraMount { place: Vector3r::new(x, y, 0.0), turned, captures: defaults.clone() })
        };
        let mut cameras: BTreeMap<_, _> = CAMERAS.iter().map(usual).collect();
        for (name, camera) in &self.cameras {
            let at = format!("{of}.Cameras.{name}");
            let mut captured = defaults.clone();
            captured.extend(captures(&at, camera)?);
            let (place, turned) = (camera.place.vector(&at, 100.0)?, camera.place.attitude(&at)?);
            cameras.insert(camera_name(name).to_owned(), CameraMount { place, turned, captures: captured });
        }
        let mut ranges = BTreeMap::new();
        for (name, sensor) in &self.sensors {
            if sensor.sensor_type != Some(5) || sensor.enabled == Some(false) {
                continue;
            }
            let (at, usual) = (format!("{of}.Sensors.{name}"), RangeMount::default());
            let nearest = within(&format!("{at}.MinDistance"), sensor.min_distance.unwrap_or(usual.nearest), 0.0, 1000.0)?;
            let farthest = sensor.max_distance.unwrap_or(usual.farthest);
            let farthest = within(&format!("{at}.MaxDistance"), farthest, nearest, FARTHEST)?;
            let (place, turned) = (sensor.place.vector(&at, 100.0)?, sensor.place.attitude(&at)?);
            ranges.insert(name.clone(), RangeMount { place, turned, nearest, farthest });
        }
        if ranges.is_empty() {
            ranges.insert("Distance".to_owned(), RangeMount::default());
        }
        let heading = self.place.yaw.map(|_| self.place.attitude(&of)).transpose()?.map(|attitude| attitude.heading);
        let armed = self
            .default_vehicle_state
            .as_deref()
            .is_none_or(|state| !state.eq_ignore_ascii_case("Inactive") && !state.eq_ignore_ascii_case("Disarmed"));
        Ok(VehicleSettings { start: self.place.vector(&of, FARTHEST)?, heading, armed, cameras, ranges, name })
    }
}

/// The name of a camera that was asked for by name or by number; empty is the first one.
pub(super) fn camera_name(asked: &str) -> &str {
    let asked = if asked.is_empty() { "0" } else { asked };
    CAMERAS.iter().find(|(_, number, ..)| *number == asked).map_or(asked, |(name, ..)| name)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn an_empty_file_is_one_vehicle_with_the_usual_cameras() {
        let settings = Settings::parse("{}").unwrap();
        assert_eq!(settings.vehicles.len(), 1);
        let vehicle = &settings.vehicles[0];
        assert_eq!((vehicle.name.as_str(), vehicle.armed, vehicle.cameras.len()), ("SimpleFlight", true, 5));
        assert_eq!(vehicle.cameras["front_center"].capture(ImageType::Scene), Capture::default());
        assert_eq!((camera_name(""), camera_name("3"), camera_name("mine")), ("front_center", "bottom_center", "mine"));
        assert!(!settings.posed);
    }

    #[test]
    fn the_example_of_the_documentation_is_read() {
        let text = r#"{ "SettingsVersion": 1.2, "SimMode": "Multirotor", "ClockSpeed": 2, "Wind": {"X":1,"Y":2,"Z":0},
          "OriginGeopoint": {"Latitude": 1.5, "Longitude": 2.5, "Altitude": 3},
          "CameraDefaults": {"CaptureSettings": [{"ImageType": 3, "Width": 64, "Height": 32, "FOV_Degrees": 60}]},
          "Vehicles": {"B": {"VehicleType": "SimpleFlight"},
            "A": {"X": 4, "Y": -5, "Yaw": 90, "DefaultVehicleState": "Disarmed",
              "Cameras": {"mine": {"CaptureSettings": [{"ImageType":0,"Width":640,"Height":480}], "X":0.5, "Pitch": -45}},
              "Sensors": {"Down": {"SensorType": 5, "Pitch": -90, "MaxDistance": 20}, "Imu": {"SensorType": 2}}}}}"#;
        let settings = Settings::parse(text).unwrap();
        let names: Vec<_> = settings.vehicles.iter().map(|one| one.name.as_str()).collect();
        assert_eq!((names, settings.clock_speed), (vec!["A", "B"], 2.0));
        assert_eq!((settings.wind, settings.origin.altitude), (Vector3r::new(1.0, 2.0, 0.0), 3.0));
        let a = &settings.vehicles[0];
        assert_eq!((a.start, a.heading, a.armed), (Vector3r::new(4.0, -5.0, 0.0), Some(90_f64.to_radians()), false));
        let mine = &a.cameras["mine"];
        assert_eq!(mine.capture(ImageType::Scene), Capture { width: 640, height: 480, fov: 90.0 });
        assert_eq!(mine.capture(ImageType::DepthVis), Capture { width: 64, height: 32, fov: 60.0 });
        assert!((mine.turned.pitch + 45_f64.to_radians()).abs() < 1e-12);
        assert_eq!((a.ranges.len(), a.ranges["Down"].farthest), (1, 20.0));
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (text, named) in [
            (r#"{"ClockSpeed": 0}"#, "ClockSpeed"),
            (r#"{"Vehicles": {"D": {"VehicleType": "PhysXCar"}}}"#, "Vehicles.D.VehicleType"),
            (r#"{"CameraDefaults": {"CaptureSettings": [{"Width": 100000}]}}"#, "CameraDefaults.Width"),
            (r#"{"Vehicles": {"D": {"Cameras": {"c": {"CaptureSettings": [{"FOV_Degrees": 0}]}}}}}"#, "Cameras.c.FOV_Degrees"),
            (r#"{"Vehicles": {"D": {"X": 1e9}}}"#, "Vehicles.D.X"),
        ] {
            let error = Settings::parse(text).unwrap_err().to_string();
            assert!(error.contains(named), "{text}: {error}");
        }
        assert!(matches!(Settings::parse("not json"), Err(SettingsError::Json(_))));
    }

    #[test]
    fn who_brings_the_physics_along_is_told_apart() {
        for text in [r#"{"SimMode": "ComputerVision"}"#, r#"{"PhysicsEngineName": "ExternalPhysicsEngine"}"#] {
            assert!(Settings::parse(text).unwrap().posed, "{text}");
        }
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(text in ".{0,200}", width in any::<f64>(), x in any::<i64>(), name in "[A-Za-z0-9_]{0,9}") {
            drop(Settings::parse(&text));
            let made = format!(
                r#"{{"CameraDefaults":{{"CaptureSettings":[{{"Width":{width:?}}}]}},"Vehicles":{{"{name}":{{"X":{x}}}}}}}"#
            );
            if let Ok(settings) = Settings::parse(&made) {
                prop_assert!(settings.vehicles.iter().all(|one| one.start.x_val.abs() <= FARTHEST));
                prop_assert!((1..=LONGEST_SIDE).contains(&settings.vehicles[0].cameras["front_center"].capture(ImageType::Scene).width));
            }
        }
    }
}
