//! `spf camera`: cameras that are not part of a drone.

mod calibrate;
mod geometry;

use std::path::Path;
use std::time::{Duration, Instant};

use spf_camera::address::FORMS;
use spf_camera::camera::USUAL_LATENCY;
use spf_camera::{Camera, CameraReport, CameraSettings, CameraState, CameraUrl};
use spf_core::camera::Camera as Optics;
use spf_core::time::duration_from_secs;
use spf_drone::examine::{Check, Finding};
use spf_drone::frames::{FrameStats, Frames as _};
use spf_drone::tello::TelloSettings;
use spf_drone::tello::driver::command_port;
use spf_media::{Jpeg, Rgb};

use self::geometry::Geometry;
use crate::args::{Camera as CameraCommand, CameraArgs, CameraTest};
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
/// How long `spf doctor` watches.
const CHECKED: Duration = Duration::from_secs(3);
/// Quality of the image that is written.
const QUALITY: u8 = 90;
/// What helps against losses.
const LOSSES: &str = "rtsp:// (by TCP) loses nothing; else use a cable or a better link, fewer pixels and a lower bit rate, or a key \
                      frame every 0.2 s";
/// The password of a camera whose address has none.
const PASSWORD: &str = "CAMERA_PASSWORD";

/// Runs the command.
pub(crate) fn camera(command: &CameraCommand, printer: &Printer) -> Result<Exit, CliError> {
    match command {
        CameraCommand::Test(args) => test(args, printer),
        CameraCommand::Calibrate(args) => calibrate::calibrate(args, printer),
    }
}

/// Reads an address given for `what`. It is not quoted in errors, since it may contain a password.
pub(crate) fn address(what: &str, text: &str) -> Result<CameraUrl, CliError> {
    let mut url: CameraUrl = text.parse().map_err(|error| {
        CliError::usage(format!("{what}: not the address of a camera"))
            .because(&error)
            .hint(format!("forms: {} (docs/guide/cameras.md)", FORMS.join(", ")))
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
    if args.calibration.is_some() || args.fov.is_some() || args.tilt.is_some() || args.latency.is_some() {
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
    printer.log(&format!("Receiving {} …", one_line(&shown)));
    let Some(size) = first_image(&camera) else { return Err(nothing(&camera.report(), &url)) };
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

/// Checks a camera for `spf doctor`.
pub(crate) fn check(url: &str, args: &CameraArgs, tello: TelloSettings) -> Result<Check, CliError> {
    let url = address("--camera", url)?;
    let geometry = Geometry::of(args, &url)?;
    let shown = url.to_string();
    let camera = geometry.start(url, tello, Instant::now())?;
    let watched = Watched::of(&camera, CHECKED);
    let report = camera.report();
    let Some(image) = &watched.image else {
        let why = report.last_failure.as_deref().map_or_else(|| "no image".to_owned(), one_line);
        let advice = "try it with `spf camera test`, and with another program";
        return Ok(Check::new("camera", Finding::Bad, format!("{}: {why}", one_line(&shown)), Some(advice)));
    };
    let (rate, gaps, size) = (watched.rate(), watched.stats.video.gaps, (image.width(), image.height()));
    let found = format!("{}×{}, {rate:.1} frames/s, {gaps} gaps", size.0, size.1);
    Ok(match geometry.mismatch(size) {
        Some(words) => Check::new("camera", Finding::Warning, format!("{found}; {words}"), Some("calibrate it at this size")),
        None => {
            let finding = if rate < 5.0 {
                Finding::Bad
            } else if gaps > 0 || rate < 10.0 {
                Finding::Warning
            } else {
                Finding::Good
            };
            Check::new("camera", finding, found, Some(LOSSES))
        }
    })
}

/// A camera that has shown its first image. `what` is the argument that names it.
pub(crate) fn watch(what: &str, url: &str, printer: &Printer) -> Result<Camera, CliError> {
    let url = address(what, url)?;
    let settings = settings(None, tello(&url, printer)?, &url);
    let camera = start(url.clone(), &settings, Instant::now(), Box::new(|image| image))?;
    printer.log(&format!("Receiving {} …", one_line(&url.to_string())));
    match first_image(&camera) {
        Some(_) => Ok(camera),
        None => Err(nothing(&camera.report(), &url)),
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
fn settings(latency: Option<f64>, tello: TelloSettings, url: &CameraUrl) -> CameraSettings {
    // That of a Tello is a setting of its own.
    let usual = if matches!(url, CameraUrl::Tello(_)) { tello.video_latency } else { USUAL_LATENCY };
    CameraSettings { latency: latency.map_or(usual, duration_from_secs), own_clock: latency.is_none(), tello }
}

fn start(url: CameraUrl, settings: &CameraSettings, start: Instant, finish: Finish) -> Result<Camera, CliError> {
    Camera::start_with(url, settings, start, finish).map_err(|error| CliError::internal("cannot receive").because(&error))
}

/// Completes a frame, such as by removing the distortion of a lens.
type Finish = Box<dyn FnMut(Rgb) -> Rgb + Send>;

/// Waits for the first image; its size.
fn first_image(camera: &Camera) -> Option<(u32, u32)> {
    let (frames, begun) = (camera.frames(), Instant::now());
    while frames.newest().is_none() && begun.elapsed() < FIRST_FRAME && !is_over(camera) {
        std::thread::sleep(POLL_INTERVAL);
    }
    frames.newest().map(|(meta, _)| (meta.width, meta.height))
}

fn test(args: &CameraTest, printer: &Printer) -> Result<Exit, CliError> {
    let url = address("URL", &args.url)?;
    if !(0.0..=3600.0).contains(&args.seconds) {
        return Err(CliError::usage(format!("--seconds: `{}` is not a number of seconds from 0 to 3600", args.seconds)));
    }
    let settings = settings(calibrate::latency("--latency", args.latency.as_deref())?, tello(&url, printer)?, &url);
    if !args.overwrite && args.output.symlink_metadata().is_ok() {
        return Err(CliError::usage(format!("--output: `{}` exists", args.output.display()))
            .hint("use --overwrite to replace it, or another file with -o FILE"));
    }
    let camera = start(url.clone(), &settings, Instant::now(), Box::new(|image| image))?;
    printer.log(&format!("Receiving {} …", one_line(&url.to_string())));
    let watched = Watched::of(&camera, duration_from_secs(args.seconds));
    let report = camera.report();
    let Some(image) = &watched.image else { return Err(nothing(&report, &url)) };
    printer.result(&table(&watched.rows(&report, &args.output)));
    write(&args.output, image)?;
    if watched.stats.video.gaps > 0 {
        printer.log(&format!("warning: losses interrupted the video {} times: {LOSSES}", watched.stats.video.gaps));
    }
    if let CameraState::Failed(why) = &report.state {
        printer.log(&format!("warning: the camera failed at last: {}", one_line(why)));
    }
    Ok(Exit::Success)
}

/// Why nothing arrived.
fn nothing(report: &CameraReport, url: &CameraUrl) -> CliError {
    let error = CliError::failed(format!("no image from the camera {}", one_line(&url.to_string())));
    let (why, hint) = match (&report.last_failure, url) {
        // The reason says what to do.
        (Some(why), CameraUrl::V4l2(_) | CameraUrl::Tello(_) | CameraUrl::Gstreamer(_) | CameraUrl::File { .. }) => {
            return error.because(&std::io::Error::other(one_line(why)));
        }
        (Some(why), _) => (one_line(why), "check address, user name and password with another program, such as ffplay or VLC"),
        (None, _) => {
            let hint = match url {
                CameraUrl::UdpRtp(_) | CameraUrl::UdpTs(_) => {
                    "check that the camera sends to this machine and port, and that no firewall blocks UDP"
                }
                CameraUrl::V4l2(_) => "plug the camera in again, or try it with another program, such as ffplay",
                CameraUrl::Tello(_) => "check that no firewall blocks UDP port 11111",
                CameraUrl::Gstreamer(_) => "try the pipeline with gst-launch-1.0 and autovideosink behind it",
                CameraUrl::File { .. } => "check that the file contains video",
                CameraUrl::Rtsp { .. } | CameraUrl::Mjpeg(_) => "try the address with another program, such as ffplay or VLC",
            };
            (format!("no image within {} s", FIRST_FRAME.as_secs()), hint)
        }
    };
    error.because(&std::io::Error::other(why)).hint(hint)
}

/// What arrived while a camera was watched.
struct Watched {
    image: Option<Rgb>,
    /// Time until the first image.
    first: Duration,
    /// Time watched after the first image, and frames in it.
    watched: Duration,
    frames: u32,
    /// Ages of frames at their arrival, seconds, sorted.
    ages: Vec<f64>,
    stats: FrameStats,
}

impl Watched {
    fn of(camera: &Camera, time: Duration) -> Self {
        let store = camera.frames();
        let begun = Instant::now();
        first_image(camera);
        let first = begun.elapsed();
        let (since, mut ages, mut frames) = (Instant::now(), Vec::new(), 0);
        let has_ended = || camera.report().state == CameraState::Ended;
        while store.newest().is_some() && since.elapsed() < time && !has_ended() {
            if let Some(meta) = store.take_new_frame() {
                frames += 1;
                ages.push(meta.received.since(meta.captured).as_secs_f64());
            }
            std::thread::sleep(POLL_INTERVAL);
        }
        ages.sort_by(f64::total_cmp);
        let image = store.newest().map(|(_, photo)| photo.pixels().as_ref().clone());
        Self { image, first, watched: since.elapsed(), frames, ages, stats: store.tally() }
    }

    /// Frames per second.
    fn rate(&self) -> f64 {
        let watched = self.watched.as_secs_f64();
        if watched > 0.0 { f64::from(self.frames) / watched } else { 0.0 }
    }

    fn rows(&self, report: &CameraReport, output: &Path) -> Vec<Vec<String>> {
        let row = |what: &str, found: String| vec![what.to_owned(), found];
        let Self { first, watched, ages, stats, .. } = self;
        let (width, height) = self.image.as_ref().map_or((0, 0), |image| (image.width(), image.height()));
        let (watched, rate) = (watched.as_secs_f64(), self.rate());
        let mut rows = vec![
            row("image", format!("{width}×{height}, {}", report.codec.unwrap_or("unknown codec"))),
            row("rate", format!("{rate:.1} frames/s in {watched:.1} s, first frame after {:.1} s", first.as_secs_f64())),
        ];
        if let (Some(median), Some(worst)) = (ages.get(ages.len() / 2), ages.last()) {
            let basis = if report.own_clock { "by the camera's clock" } else { "assumed latency and delays" };
            rows.push(row("age", format!("median {median:.2} s, worst {worst:.2} s at arrival ({basis})")));
        }
        let lost = match report.packets {
            Some(received) => {
                let all = (received + report.packets_lost).max(1);
                format!("{} of {all} packets ({:.1} %)", report.packets_lost, 100.0 * report.packets_lost as f64 / all as f64)
            }
            None => format!("{} packets", report.packets_lost),
        };
        rows.push(row(
            "loss",
            format!(
                "{lost}, {} gaps, {} images skipped until a key frame, {} damaged, {} rejected, {} unusable",
                stats.video.gaps, stats.video.skipped, stats.video.damaged, stats.refused, stats.unusable
            ),
        ));
        if report.connections > 1 {
            rows.push(row("connections", format!("{} (last failure: {})", report.connections, failure(report))));
        }
        rows.push(row("picture", output.display().to_string()));
        rows
    }
}

fn failure(report: &CameraReport) -> String {
    report.last_failure.as_deref().map_or_else(|| "none".to_owned(), one_line)
}

/// Whether nothing more is to be expected: the end of a file, a failure that does not pass by itself, or some in a row.
fn is_over(camera: &Camera) -> bool {
    let report = camera.report();
    let failed = matches!(report.state, CameraState::Failed(_));
    report.state == CameraState::Ended || failed && (report.needs_attention || report.connections >= MOST_FAILURES)
}

fn write(path: &Path, image: &Rgb) -> Result<(), CliError> {
    let failed = |error: &dyn std::error::Error| CliError::internal(format!("cannot write `{}`", path.display())).because(error);
    let jpeg = Jpeg::encode(image, QUALITY).map_err(|error| failed(&error))?;
    std::fs::write(path, jpeg.bytes()).map_err(|error| failed(&error))
}
