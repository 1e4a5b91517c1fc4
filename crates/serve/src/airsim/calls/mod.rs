//! Calls: which there are, with how many arguments, and what each does.
//!
//! Source of names, order and number of arguments: AirSim's `RpcLibServerBase.cpp` and `MultirotorRpcLibServer.cpp`.

mod arguments;
mod motion;
mod scene;

use spf_drone::airsim::wire::{Encoding, Raw, errors};

use super::city::{City, FRAME, LONGEST_RUN};
use super::images::Job;
use arguments::Arguments;

/// Receives the result, or the text of the error.
pub(super) type Respond = Box<dyn FnOnce(Result<Raw, String>) + Send>;

/// Pictures that are to be rendered, without holding the simulator.
pub(super) struct Pending {
    job: Job,
    /// Whether it is `simGetImage`: the bytes of one picture alone.
    single: bool,
    encoding: Encoding,
    respond: Respond,
}

impl Pending {
    /// Renders and answers.
    pub(super) fn finish(self) {
        let Self { job, single, encoding, respond } = self;
        let pictures = job.run();
        respond(Ok(match pictures.first().filter(|_| single) {
            // The client takes an empty text, and not empty bytes, for no picture.
            Some(picture) if picture.image_data_uint8.is_empty() => Raw::of("", encoding),
            Some(picture) => arguments::bytes(&picture.image_data_uint8),
            None => Raw::of(&pictures, encoding),
        }));
    }
}

/// What a method is.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// Answered when it has ended.
    Motion,
    /// Answered at once.
    Scene,
    /// Accepted without effect: it has one in Unreal's window alone.
    Nothing,
    /// Refused, with the reason.
    Refused(&'static str),
}

use Kind::{Motion, Nothing, Refused, Scene};

const RIGID: Kind = Refused("this craft is flown by velocities and positions, not by attitudes, throttles or rotors");
const LENS: Kind = Refused("cameras here have no lens but their field of view: simSetCameraFov");
const FIXED: Kind = Refused("the scene is fixed: other scenes are chosen at the start");
const DETECTIONS: Kind = Refused("there are no detections here: use the segmentation");

/// Every method: its name, its number of arguments, what it is, and which argument tells how the client writes structs.
const METHODS: &[(&str, usize, Kind, Option<usize>)] = &[
    ("ping", 0, Scene, None),
    ("getServerVersion", 0, Scene, None),
    ("getMinRequiredClientVersion", 0, Scene, None),
    ("reset", 0, Scene, None),
    ("enableApiControl", 2, Scene, None),
    ("isApiControlEnabled", 1, Scene, None),
    ("armDisarm", 2, Scene, None),
    ("getMultirotorState", 1, Scene, None),
    ("getHomeGeoPoint", 1, Scene, None),
    ("listVehicles", 0, Scene, None),
    ("getSettingsString", 0, Scene, None),
    ("cancelLastTask", 1, Scene, None),
    ("takeoff", 2, Motion, None),
    ("land", 2, Motion, None),
    ("goHome", 2, Motion, None),
    ("hover", 1, Motion, None),
    ("moveByVelocity", 7, Motion, Some(5)),
    ("moveByVelocityBodyFrame", 7, Motion, Some(5)),
    ("moveByVelocityZ", 7, Motion, Some(5)),
    ("moveByVelocityZBodyFrame", 7, Motion, Some(5)),
    ("moveToPosition", 10, Motion, Some(6)),
    ("moveOnPath", 8, Motion, Some(4)),
    ("moveToZ", 7, Motion, Some(3)),
    ("moveToGPS", 10, Motion, Some(6)),
    ("rotateToYaw", 4, Motion, None),
    ("rotateByYawRate", 3, Motion, None),
    ("moveByManual", 7, RIGID, Some(5)),
    ("moveByRC", 2, RIGID, Some(0)),
    ("moveByMotorPWMs", 6, RIGID, None),
    ("moveByRollPitchYawZ", 6, RIGID, None),
    ("moveByRollPitchYawThrottle", 6, RIGID, None),
    ("moveByRollPitchYawrateThrottle", 6, RIGID, None),
    ("moveByRollPitchYawrateZ", 6, RIGID, None),
    ("moveByAngleRatesZ", 6, RIGID, None),
    ("moveByAngleRatesThrottle", 6, RIGID, None),
    ("setAngleRateControllerGains", 4, Nothing, None),
    ("setAngleLevelControllerGains", 4, Nothing, None),
    ("setVelocityControllerGains", 4, Nothing, None),
    ("setPositionControllerGains", 4, Nothing, None),
    ("simGetVehiclePose", 1, Scene, None),
    ("simSetVehiclePose", 3, Scene, Some(0)),
    ("simGetGroundTruthKinematics", 1, Scene, None),
    ("simSetKinematics", 3, Scene, Some(0)),
    ("simGetGroundTruthEnvironment", 1, Scene, None),
    ("simGetCollisionInfo", 1, Scene, None),
    ("simGetImages", 3, Scene, Some(0)),
    ("simGetImage", 4, Scene, None),
    ("simGetCameraInfo", 3, Scene, None),
    ("simSetCameraPose", 4, Scene, Some(1)),
    ("simSetCameraFov", 4, Scene, None),
    ("simGetDistortionParams", 3, LENS, None),
    ("simSetDistortionParam", 5, LENS, None),
    ("simSetWind", 1, Scene, Some(0)),
    ("simListSceneObjects", 1, Scene, None),
    ("simGetObjectPose", 1, Scene, None),
    ("simSetObjectPose", 3, FIXED, Some(1)),
    ("simGetObjectScale", 1, FIXED, None),
    ("simSetObjectScale", 2, FIXED, Some(1)),
    ("simSpawnObject", 6, FIXED, Some(2)),
    ("simDestroyObject", 1, FIXED, None),
    ("simListAssets", 0, FIXED, None),
    ("simLoadLevel", 1, FIXED, None),
    ("simAddVehicle", 4, Refused("vehicles are those of the settings"), Some(2)),
    ("simSetSegmentationObjectID", 3, Scene, None),
    ("simGetSegmentationObjectID", 1, Scene, None),
    ("simPause", 1, Scene, None),
    ("simIsPaused", 0, Scene, None),
    ("simContinueForTime", 1, Scene, None),
    ("simContinueForFrames", 1, Scene, None),
    ("getImuData", 2, Scene, None),
    ("getBarometerData", 2, Scene, None),
    ("getMagnetometerData", 2, Scene, None),
    ("getGpsData", 2, Scene, None),
    ("getDistanceSensorData", 2, Scene, None),
    ("getLidarData", 2, Refused("there is no lidar here: use the depth pictures"), None),
    ("getRotorStates", 1, RIGID, None),
    ("simTestLineOfSightToPoint", 2, Scene, Some(0)),
    ("simTestLineOfSightBetweenPoints", 2, Scene, Some(0)),
    ("simGetWorldExtents", 0, Scene, None),
    ("simGetMeshPositionVertexBuffers", 0, Refused("meshes are not given away"), None),
    ("simCreateVoxelGrid", 6, Refused("there are no voxel grids here"), Some(0)),
    ("simRunConsoleCommand", 1, Refused("there is no console"), None),
    ("simAddDetectionFilterMeshName", 5, DETECTIONS, None),
    ("simSetDetectionFilterRadius", 5, DETECTIONS, None),
    ("simClearDetectionMeshNames", 4, DETECTIONS, None),
    ("simGetDetections", 4, DETECTIONS, None),
    ("simEnableWeather", 1, Nothing, None),
    ("simSetWeatherParameter", 2, Nothing, None),
    ("simSetTimeOfDay", 6, Nothing, None),
    ("simSetLightIntensity", 2, FIXED, None),
    ("simPrintLogMessage", 3, Nothing, None),
    ("simSetTraceLine", 3, Nothing, None),
    ("simFlushPersistentMarkers", 0, Nothing, None),
    ("simPlotPoints", 5, Nothing, None),
    ("simPlotLineStrip", 5, Nothing, None),
    ("simPlotLineList", 5, Nothing, None),
    ("simPlotArrows", 7, Nothing, None),
    ("simPlotStrings", 5, Nothing, None),
    ("simPlotTransforms", 5, Nothing, None),
    ("simPlotTransformsWithNames", 7, Nothing, None),
    ("startRecording", 0, Nothing, None),
    ("stopRecording", 0, Nothing, None),
    ("isRecording", 0, Scene, None),
];

/// How the client writes structs, if this call tells.
pub(super) fn dialect(method: &str, params: &[Raw]) -> Option<Encoding> {
    let (.., place) = METHODS.iter().find(|(name, ..)| *name == method)?;
    let told = params.get((*place)?)?;
    if matches!(method, "simGetImages") {
        return told.items()?.first()?.encoding();
    }
    told.encoding()
}

/// Makes a call. What is returned is to be finished by the caller; everything else has been answered, or will be.
pub(super) fn call(city: &mut City, method: &str, params: &[Raw], encoding: Encoding, respond: Respond) -> Option<Pending> {
    let given = params.len();
    let Some((_, arity, kind, _)) = METHODS.iter().find(|(name, ..)| *name == method) else {
        respond(Err(errors::unknown_method(method, given)));
        return None;
    };
    if *arity != given {
        respond(Err(errors::wrong_arity(method, *arity, given)));
        return None;
    }
    let failed = |why: &str| errors::failed(method, given, why);
    let arguments = Arguments(params);
    match kind {
        Nothing => respond(Ok(Raw::nil())),
        Refused(why) => respond(Err(failed(why))),
        Motion => match motion::plan(city, method, arguments) {
            Ok((index, plan)) => {
                let now = city.now();
                if let Some(vehicle) = city.vehicles.get_mut(index) {
                    vehicle.begin(now, plan.task(Box::new(move |done| respond(Ok(Raw::of(&done, Encoding::Map))))));
                }
            }
            Err(why) => respond(Err(failed(&why))),
        },
        Scene if matches!(method, "simContinueForTime" | "simContinueForFrames") => match interval(method, arguments) {
            Ok(interval) => city.run_for(interval, Box::new(move || respond(Ok(Raw::nil())))),
            Err(why) => respond(Err(failed(&why))),
        },
        Scene => match scene::call(city, method, arguments, encoding) {
            Ok(scene::Answer::Now(result)) => respond(Ok(result)),
            Ok(scene::Answer::Pictures { job, single }) => return Some(Pending { job, single, encoding, respond }),
            Err(why) => respond(Err(failed(&why))),
        },
    }
    None
}

/// The interval to run.
fn interval(method: &str, arguments: Arguments<'_>) -> Result<core::time::Duration, String> {
    let number = arguments.number(0)?;
    let seconds = if method == "simContinueForFrames" { number * FRAME.as_secs_f64() } else { number };
    if !(0.0..=LONGEST_RUN).contains(&seconds) {
        return Err(format!("{seconds} s is not between 0 and {LONGEST_RUN}"));
    }
    Ok(core::time::Duration::from_secs_f64(seconds))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_method_is_listed_twice_and_the_dialect_is_told_by_an_argument_that_exists() {
        for (n, (name, arity, _, place)) in METHODS.iter().enumerate() {
            assert!(METHODS[..n].iter().all(|(other, ..)| other != name), "{name}");
            assert!(place.is_none_or(|place| place < *arity), "{name}");
        }
    }
}
