//! Finding a vehicle in a simulator: its dialect, its camera, its first report.

use std::time::{Duration, Instant};

use spf_core::camera::Camera;

use super::address::Address;
use super::axes;
use super::rpc::RpcError;
use super::session::Session;
use super::settings::AirSimSettings;
use super::wire::Encoding;
use super::wire::structs::{ImageRequest, ImageResponse, ImageType, MultirotorState, Quaternionr, Vector3r};

/// A simulator that has just started may answer with errors, and with empty images, for this long.
pub(super) const STARTS_WITHIN: Duration = Duration::from_secs(10);
const AGAIN: Duration = Duration::from_millis(500);
/// Most pixels of an image.
pub(super) const MOST_PIXELS: u64 = 4096 * 4096;

/// Why the connection failed. The driver adds a remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConnectError {
    /// There is no connection, or the simulator answers otherwise than it should.
    #[error(transparent)]
    Rpc(#[from] RpcError),
    /// There is no such vehicle.
    #[error("the simulator at {server} has no vehicle `{vehicle}`; it has {}", listed(.known))]
    UnknownVehicle {
        /// Host and port.
        server: String,
        /// The name.
        vehicle: String,
        /// Those that there are.
        known: Vec<String>,
    },
    /// It has a vehicle, which is no multirotor that can be flown.
    #[error("the vehicle at {address} tells no state")]
    NoMultirotor {
        /// The vehicle.
        address: Address,
        /// What it answers instead.
        #[source]
        source: RpcError,
    },
    /// The camera shows nothing.
    #[error("camera `{camera}` shows nothing: {why}")]
    NoImage {
        /// The camera.
        camera: String,
        /// What the simulator says, or what is wrong with its image.
        why: String,
    },
    /// The camera does not exist, or its optics are unknown.
    #[error("the vehicle has no camera `{camera}` whose optics are known")]
    NoCamera {
        /// The camera.
        camera: String,
        /// What the simulator answers.
        #[source]
        source: RpcError,
    },
    /// The field of view is none.
    #[error("camera `{camera}` has a field of view of {fov_deg}°")]
    FieldOfView {
        /// The camera.
        camera: String,
        /// Degrees.
        fov_deg: f64,
    },
    /// The camera does not look ahead.
    #[error("camera `{camera}` does not look ahead: it is turned aside or rolled")]
    Aside {
        /// The camera.
        camera: String,
    },
    /// The pose is not one of numbers.
    #[error("the vehicle at {address} reports a pose that is no number")]
    NoPose {
        /// The vehicle.
        address: Address,
    },
    /// A thread could not be started.
    #[error("cannot start the driver")]
    Start(#[source] std::io::Error),
}

/// Names in words.
fn listed(names: &[String]) -> String {
    const SHOWN: usize = 20;
    match names {
        [] => "none".to_owned(),
        names => names.iter().take(SHOWN).map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", "),
    }
}

impl ConnectError {
    /// What to do about it.
    #[must_use]
    pub fn hint(&self) -> Option<String> {
        Some(match self {
            Self::Rpc(RpcError::Unreachable { .. }) => "start the simulator, and wait until its scene shows; it listens where \
                LocalHostIp and ApiServerPort of its settings.json say (127.0.0.1:41451 if nothing), and docs/guide/airsim.md tells how \
                to reach one on another machine"
                .to_owned(),
            Self::Rpc(RpcError::TimedOut { .. }) => {
                "the simulator is still loading, or paused by another program (simPause): wait, or restart it".to_owned()
            }
            Self::Rpc(_) => "is it AirSim or Colosseum that listens there? Project AirSim speaks another protocol".to_owned(),
            Self::UnknownVehicle { known, server, .. } => match known.first() {
                Some(first) => format!("name one of them, as --drone airsim@{server}/{first}"),
                None => "its settings.json has no vehicle: add one of VehicleType SimpleFlight".to_owned(),
            },
            Self::NoMultirotor { .. } => {
                "SPF flies multirotors: settings.json needs \"SimMode\": \"Multirotor\" (not Car, and not ComputerVision)".to_owned()
            }
            Self::NoImage { .. } => "check Cameras and CaptureSettings of settings.json, and that the simulator renders (ViewMode \
                                     NoDisplay does, a run without a graphics card may not)"
                .to_owned(),
            Self::NoCamera { .. } => "name another as airsim.camera in spf.toml: 0 (front_center), or a name under Cameras of \
                                      settings.json; `spf doctor` lists those that it finds"
                .to_owned(),
            Self::FieldOfView { .. } => "set FOV_Degrees of the camera's CaptureSettings in settings.json, 10 to 170".to_owned(),
            Self::Aside { .. } => "name one that looks ahead as airsim.camera in spf.toml; it may be tilted".to_owned(),
            Self::NoPose { .. } => "reset the simulator (its key Backspace), or restart it".to_owned(),
            _ => return None,
        })
    }
}

/// A vehicle that was found.
pub(super) struct Found {
    pub(super) session: Session,
    pub(super) encoding: Encoding,
    pub(super) version: Option<i64>,
    /// All vehicles of the simulator, as far as it tells.
    pub(super) vehicles: Vec<String>,
    pub(super) state: MultirotorState,
    pub(super) camera: Camera,
}

/// Connects and asks; nothing is commanded. What may be because the simulator is still starting is asked again for `patience`.
pub(super) fn find(address: &Address, settings: &AirSimSettings, patience: Duration) -> Result<Found, ConnectError> {
    let until = Instant::now() + patience;
    let mut session = Session::open(address, Encoding::Map)?;
    session.ping()?;
    // Forks may lack one or the other.
    let version = optional(session.version())?;
    let vehicles = optional(session.vehicles())?.unwrap_or_default();
    if !address.vehicle.is_empty() && !vehicles.is_empty() && !vehicles.contains(&address.vehicle) {
        return Err(ConnectError::UnknownVehicle { server: address.server(), vehicle: address.vehicle.clone(), known: vehicles });
    }
    let (state, encoding) = loop {
        match session.state() {
            Ok(found) => break found,
            Err(source) if !source.is_of_call() => return Err(source.into()),
            Err(source) if Instant::now() >= until || matches!(source, RpcError::Unreadable { .. }) => {
                return Err(ConnectError::NoMultirotor { address: address.clone(), source });
            }
            Err(_) => std::thread::sleep(AGAIN),
        }
    };
    session.speak(encoding);
    let kinematics = &state.kinematics_estimated;
    let orientation = quaternion(kinematics.orientation);
    if axes::attitude(orientation).is_none() || !vector(kinematics.position).iter().all(|part| part.is_finite()) {
        return Err(ConnectError::NoPose { address: address.clone() });
    }
    // What was touched before is not of this flight; reading it clears it.
    drop(optional(session.collision())?);
    let image = first_image(&mut session, &settings.camera, until)?;
    let camera = optics(&mut session, &settings.camera, (image.width, image.height), orientation)?;
    Ok(Found { session, encoding, version, vehicles, state, camera })
}

/// What a simulator may not support.
fn optional<T>(answer: Result<T, RpcError>) -> Result<Option<T>, RpcError> {
    match answer {
        Ok(value) => Ok(Some(value)),
        Err(RpcError::Refused { .. } | RpcError::Unreadable { .. }) => Ok(None),
        Err(error) => Err(error),
    }
}

/// A raw picture of colours.
pub(super) fn scene_of(camera: &str) -> ImageRequest {
    ImageRequest { camera_name: camera.to_owned(), image_type: ImageType::Scene, pixels_as_float: false, compress: false }
}

/// What is wrong with a picture of colours; `None` if nothing is.
pub(super) fn fault_of(image: &ImageResponse) -> Option<String> {
    let (width, height) = (image.width, image.height);
    let pixels = u64::from(width) * u64::from(height);
    if pixels == 0 {
        let said: String = image.message.chars().take(200).collect();
        return Some(if said.is_empty() { format!("its image has {width}×{height} pixels") } else { said });
    }
    if pixels > MOST_PIXELS {
        return Some(format!("its image of {width}×{height} pixels is larger than 4096×4096"));
    }
    let bytes = image.image_data_uint8.len() as u64;
    (bytes != 3 * pixels)
        .then(|| format!("its image of {width}×{height} pixels has {bytes} bytes in the place of {}", 3 * pixels))
}

fn first_image(session: &mut Session, camera: &str, until: Instant) -> Result<ImageResponse, ConnectError> {
    loop {
        let why = match session.images(&[scene_of(camera)]) {
            Ok(mut images) => match images.pop() {
                Some(image) => match fault_of(&image) {
                    None => return Ok(image),
                    Some(fault) => fault,
                },
                None => "it answers without an image".to_owned(),
            },
            Err(error) if error.is_of_call() => error.to_string(),
            Err(error) => return Err(error.into()),
        };
        if Instant::now() >= until {
            return Err(ConnectError::NoImage { camera: camera.to_owned(), why });
        }
        std::thread::sleep(AGAIN);
    }
}

/// The camera of an image of this size, on a body in this attitude.
pub(super) fn optics(
    session: &mut Session,
    name: &str,
    (width, height): (u32, u32),
    body: [f64; 4],
) -> Result<Camera, ConnectError> {
    let info = session.camera(name).map_err(|source| ConnectError::NoCamera { camera: name.to_owned(), source })?;
    if !(1.0..180.0).contains(&info.fov) {
        return Err(ConnectError::FieldOfView { camera: name.to_owned(), fov_deg: info.fov });
    }
    let looks = quaternion(info.pose.orientation);
    let tilt = axes::tilt(body, looks).ok_or_else(|| ConnectError::Aside { camera: name.to_owned() })?;
    Ok(pinhole((width, height), info.fov.to_radians(), tilt))
}

/// A camera with square pixels of a horizontal field of view, radians.
pub(super) fn pinhole((width, height): (u32, u32), fov: f64, tilt: f64) -> Camera {
    let across = libm::tan(0.5 * fov);
    let vertical = 2.0 * libm::atan(across * f64::from(height) / f64::from(width.max(1)));
    Camera::from_fov(width, height, fov, vertical, tilt)
}

pub(super) fn vector(Vector3r { x_val, y_val, z_val }: Vector3r) -> [f64; 3] {
    [x_val, y_val, z_val]
}

pub(super) fn quaternion(Quaternionr { w_val, x_val, y_val, z_val }: Quaternionr) -> [f64; 4] {
    [w_val, x_val, y_val, z_val]
}
