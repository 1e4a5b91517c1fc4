//! `spf camera`: cameras that are not part of a drone.

mod calibrate;
mod geometry;
mod watched;

use std::path::Path;
use std::time::{Duration, Instant};

use spf_camera::address::{AddressError, FORMS, suggestion};
use spf_camera::camera::USUAL_LATENCY;
use spf_camera::clock::CameraTimes;
use spf_camera::diagnosis::{Trouble, no_image, progress, troubles};
use spf_camera::{Camera, CameraSettings, CameraState, CameraUrl};
use spf_core::camera::Camera as Optics;
use spf_core::time::duration_from_secs;
use spf_drone::examine::Check;
use spf_drone::frames::Frames as _;
use spf_drone::tello::TelloSettings;
use spf_drone::tello::driver::command_port;
use spf_media::{Jpeg, Rgb};

use self::geometry::Geometry;
use self::watched::{LOSSES, Watched};
use crate::args::{Camera as CameraCommand, CameraArgs, CameraTest, Times};
use crate::commands::fly::settings::options;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::{Printer, one_line, table};
use crate::settings::Settings;

/// Maximum wait for the first image: a camera may send a key frame every 5 s, after connecting.
const FIRST_FRAME: Duration = Duration::from_secs(15);
/// Interval at which new frames are looked for.
const POLL_INTERVAL: Duration = Duration::from_millis(2);
/// Failed connections without an image after which there is no point in waiting; they take some four seconds.
const MOST_FAILURES: u32 = 4;
/// Interval at which it is said what has come, as long as no image has.
const SAID_EVERY: Duration = Duration::from_secs(2);
/// How long `spf doctor` watches.
const CHECKED: Duration = Duration::from_secs(3);
/// Quality of the image that is written.
const QUALITY: u8 = 90;
/// The password of a camera whose address has none.
const PASSWORD: &str = "CAMERA_PASSWORD";

/// Runs the command.
pub(crate) fn camera(command: &CameraCommand, printer: &Printer) -> Result<Exit, CliError> {
    match command {
        CameraCommand::Test(args) => test(args, printer),
        CameraCommand::Calibrate(args) => calibrate::calibrate(args, printer),
    }
}

/// Reads an address given for `what`. Errors quote nothing of it that may be a password.
pub(crate) fn address(what: &str, text: &str) -> Result<CameraUrl, CliError> {
    let mut url: CameraUrl = text.parse().map_err(|error| {
        let meant = suggestion(text).map(|meant| format!("{meant} "));
        let known = match &error {
            // Others say what is wrong with a known form.
            AddressError::Scheme => format!("Cameras are: {} (docs/guide/cameras.md)", FORMS.join(", ")),
            _ if meant.is_some() => String::new(),
            _ => "`spf camera test --help` shows examples".to_owned(),
        };
        let hint = format!("{}{known}", meant.unwrap_or_default());
        CliError::usage(format!("{what}: not the address of a camera")).because(&error).hint(hint.trim())
    })?;
    if let Some(known) = url.credentials_mut()
        && known.password.is_empty()
        && let Ok(password) = std::env::var(PASSWORD)
    {
        known.password = password;
    }
    Ok(url)
}

/// The camera in the place of the one that a drone of this name has: none if none is given, or if it is the drone's own.
pub(crate) fn instead_of<'a>(args: &'a CameraArgs, drone: &str) -> Result<Option<&'a str>, CliError> {
    let Some(text) = args.url.as_deref() else { return Ok(None) };
    let CameraUrl::Tello(address) = address("--camera", text)? else { return Ok(Some(text)) };
    match command_port(drone) {
        Some(flown) if flown == address => {}
        Some(_) => {
            return Err(CliError::usage("--camera: the states of two Tellos would arrive at the same UDP port")
                .hint("let another program send the video of the second one, such as ffmpeg to udp-rtp://"));
        }
        None => return Ok(Some(text)),
    }
    if args.calibration.is_some() || args.fov.is_some() || args.tilt.is_some() || args.latency.is_some() || args.times.is_some() {
        return Err(CliError::usage("--camera: this is the camera of the drone itself, whose lens and latency are known")
            .hint("leave out --camera and what belongs to it; tello.video_latency_s in spf.toml sets the latency"));
    }
    Ok(None)
}

/// Refuses a film without end as the camera of a real drone, which would follow it as long as its battery lasts.
pub(crate) fn refuse_endless(url: &str) -> Result<(), CliError> {
    match address("--camera", url)? {
        CameraUrl::File { repeats: true, .. } => {
            Err(CliError::usage("--camera: a film without end (?loop=true) flies no real drone")
                .hint("try it with --drone sim, or with `spf sim serve --tello` and --drone tello@127.0.0.1"))
        }
        _ => Ok(()),
    }
}

/// What to say before take-off of a camera that shows a recording. A pipeline that is not live never ends either: with it, only a
/// simulated craft flies.
pub(crate) fn recording(camera: &Camera, is_simulated: bool) -> Result<Option<&'static str>, CliError> {
    let report = camera.report();
    if report.recorded && report.codec == Some("raw") && !is_simulated {
        return Err(CliError::usage("--camera: a pipeline whose source is not live flies no real drone")
            .hint("its images are those of a recording, or made up; use a live source, such as v4l2src or rtspsrc"));
    }
    Ok(report.recorded.then_some("Pictures come from a recording: they do not show what the craft does."))
}

/// Starts the camera in the place of a drone's own, and waits for its first image; `start` is flight time
/// zero, and `tello` are the settings for the video of a Tello. Returns it with the optics of its images.
pub(crate) fn open(
    url: &str,
    args: &CameraArgs,
    tello: TelloSettings,
    start: Instant,
    printer: &Printer,
) -> Result<(Camera, Optics), CliError> {
    let url = address("--camera", url)?;
    let geometry = Geometry::of(args, &url)?;
    let shown = url.to_string();
    let camera = geometry.start(url.clone(), tello, start)?;
    let Some(size) = first_shown(&camera, &url, printer) else { return Err(nothing(&camera, &url)) };
    if let Some(words) = geometry.mismatch(size) {
        return Err(CliError::usage(format!("--camera-calibration: {words}; the images are {}×{}", size.0, size.1))
            .hint("set the camera to the calibrated size, or calibrate it at this one"));
    }
    let optics = geometry.optics(size);
    let (across, down) = optics.half_fov();
    printer.log(&format!(
        "Camera {}: {}×{}, field of view {:.0}° × {:.0}°, tilt {:.0}°.",
        one_line(&shown),
        size.0,
        size.1,
        2.0 * across.to_degrees(),
        2.0 * down.to_degrees(),
        optics.tilt.to_degrees(),
    ));
    Ok((camera, optics))
}

/// Checks a camera for `spf doctor`: its lens, if it is calibrated, and what arrives.
pub(crate) fn check(url: &str, args: &CameraArgs, tello: TelloSettings) -> Result<Vec<Check>, CliError> {
    let url = address("--camera", url)?;
    let geometry = Geometry::of(args, &url)?;
    let camera = geometry.start(url.clone(), tello, Instant::now())?;
    first_image(&camera, |_, _| {});
    let watched = Watched::of(&camera, CHECKED);
    let watched = watched.check(&camera, &url, |size| geometry.mismatch(size));
    Ok(geometry.lens().into_iter().chain([watched]).collect())
}

/// A camera that has shown its first image. `what` is the argument that names it.
pub(crate) fn watch(what: &str, url: &str, printer: &Printer) -> Result<Camera, CliError> {
    let url = address(what, url)?;
    let settings = settings(None, None, tello(&url, printer)?, &url);
    let camera = start(url.clone(), &settings, Instant::now(), Box::new(|image| image))?;
    match first_shown(&camera, &url, printer) {
        Some(_) => Ok(camera),
        None => Err(nothing(&camera, &url)),
    }
}

/// One image of a camera.
pub(crate) fn picture(url: &str, printer: &Printer) -> Result<Rgb, CliError> {
    let camera = watch("IMAGE", url, printer)?;
    let newest = camera.frames().newest().map(|(_, photo)| photo.pixels().as_ref().clone());
    newest.ok_or_else(|| CliError::internal("the image of the camera is gone"))
}

/// Settings for the video of a Tello, where no drone is named: those of `spf.toml` and the environment.
fn tello(url: &CameraUrl, printer: &Printer) -> Result<TelloSettings, CliError> {
    match url {
        CameraUrl::Tello(_) => Ok(options(&Settings::load(None, printer)?)?.tello),
        _ => Ok(TelloSettings::default()),
    }
}

/// A latency that somebody has measured counts more than the camera's clock.
fn settings(latency: Option<f64>, times: Option<Times>, tello: TelloSettings, url: &CameraUrl) -> CameraSettings {
    // That of a Tello is a setting of its own.
    let usual = if matches!(url, CameraUrl::Tello(_)) { tello.video_latency } else { USUAL_LATENCY };
    let times = times.map_or(if latency.is_some() { CameraTimes::Timestamps } else { CameraTimes::Clock }, CameraTimes::from);
    CameraSettings { latency: latency.map_or(usual, duration_from_secs), times, tello }
}

fn start(url: CameraUrl, settings: &CameraSettings, start: Instant, finish: Finish) -> Result<Camera, CliError> {
    Camera::start_with(url, settings, start, finish).map_err(|error| CliError::internal("cannot receive").because(&error))
}

/// Completes a frame, such as by removing the distortion of a lens.
type Finish = Box<dyn FnMut(Rgb) -> Rgb + Send>;

/// Waits for the first image, and says every other second what has come so far; its size.
fn first_shown(camera: &Camera, url: &CameraUrl, printer: &Printer) -> Option<(u32, u32)> {
    printer.log(&format!("Receiving {} …", one_line(&url.to_string())));
    first_image(camera, |waited, so_far| {
        printer.log(&format!(
            "  no image after {:.0} of {} s: {}",
            waited.as_secs_f64(),
            FIRST_FRAME.as_secs(),
            one_line(so_far)
        ));
    })
}

/// Waits for the first image; its size. Tells at intervals how long it has waited, and what has come so far.
fn first_image(camera: &Camera, tell: impl Fn(Duration, &str)) -> Option<(u32, u32)> {
    let (frames, begun, mut told) = (camera.frames(), Instant::now(), Duration::ZERO);
    while frames.newest().is_none() && begun.elapsed() < FIRST_FRAME && !is_over(camera) {
        if begun.elapsed() >= told + SAID_EVERY {
            told += SAID_EVERY;
            tell(told, &progress(&camera.report(), &frames.tally()));
        }
        std::thread::sleep(POLL_INTERVAL);
    }
    frames.newest().map(|(meta, _)| (meta.width, meta.height))
}

fn test(args: &CameraTest, printer: &Printer) -> Result<Exit, CliError> {
    let url = address("URL", &args.url)?;
    if !(0.0..=3600.0).contains(&args.seconds) {
        return Err(CliError::usage(format!("--seconds: `{}` is not a number of seconds from 0 to 3600", args.seconds)));
    }
    let settings = settings(calibrate::latency("--latency", args.latency.as_deref())?, args.times, tello(&url, printer)?, &url);
    if !args.overwrite && args.output.symlink_metadata().is_ok() {
        return Err(CliError::usage(format!("--output: `{}` exists", args.output.display()))
            .hint("use --overwrite to replace it, or another file with -o FILE"));
    }
    let camera = start(url.clone(), &settings, Instant::now(), Box::new(|image| image))?;
    let begun = Instant::now();
    first_shown(&camera, &url, printer);
    let first = begun.elapsed();
    let watched = Watched::of(&camera, duration_from_secs(args.seconds));
    let report = camera.report();
    let Some(image) = &watched.image else { return Err(nothing(&camera, &url)) };
    printer.result(&table(&watched.rows(&report, first, &args.output)));
    write(&args.output, image)?;
    for Trouble { why, hint } in troubles(&report) {
        printer.log(&format!("warning: {why}: {hint}"));
    }
    if watched.stats.video.gaps > 0 {
        printer.log(&format!("warning: losses interrupted the video {} times: {LOSSES}", watched.stats.video.gaps));
    }
    if let CameraState::Failed(failure) = &report.state {
        printer.log(&format!("warning: the camera failed at last: {}", one_line(&failure.why)));
    }
    Ok(Exit::Success)
}

/// Why nothing arrived.
fn nothing(camera: &Camera, url: &CameraUrl) -> CliError {
    let failure = no_image(url, &camera.report(), &camera.frames().tally(), FIRST_FRAME.as_secs());
    let error = CliError::failed(format!("no image from the camera {}", one_line(&url.to_string())))
        .because(&std::io::Error::other(one_line(&failure.why)));
    match failure.hint {
        Some(hint) => error.hint(hint),
        // The reason says what to do.
        None => error,
    }
}

/// Whether nothing more is to be expected: the end of a file, a failure that does not pass by itself, or some in a row. An answer such
/// as 404 may pass: a server that is starting does not know its streams yet.
fn is_over(camera: &Camera) -> bool {
    let report = camera.report();
    let failed = matches!(report.state, CameraState::Failed(_));
    report.state == CameraState::Ended || failed && (report.lasts || report.connections >= MOST_FAILURES)
}

fn write(path: &Path, image: &Rgb) -> Result<(), CliError> {
    let failed = |error: &dyn std::error::Error| CliError::internal(format!("cannot write `{}`", path.display())).because(error);
    let jpeg = Jpeg::encode(image, QUALITY).map_err(|error| failed(&error))?;
    std::fs::write(path, jpeg.bytes()).map_err(|error| failed(&error))
}
