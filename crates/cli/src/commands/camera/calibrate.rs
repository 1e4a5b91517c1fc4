//! `spf camera calibrate`: the latency of a camera that films this terminal.

use std::path::Path;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use spf_camera::clock::CameraTimes;
use spf_camera::clock_code::{ClockCode, MODULES, read as read_clock};
use spf_camera::latency::{FEWEST, Latency, LatencyMeter};
use spf_camera::{CameraSettings, CameraUrl};
use spf_core::time::Time;
use spf_drone::frames::Frames as _;

use super::{POLL_INTERVAL, address, first_shown, nothing, start, tello};
use crate::args::CameraCalibrate;
use crate::commands::read;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;

/// How long the clock shows one time. It is no multiple of the interval of any usual camera, so that the frames are spread over it.
const SHOWN: Duration = Duration::from_millis(93);
/// Columns and lines that the code needs; the cursor is in the line below it.
const NEEDED: (usize, usize) = (MODULES, MODULES.div_ceil(2) + 1);
/// Longest latency that is plausible, seconds.
const LONGEST: f64 = 10.0;

/// What the file contains.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Measured {
    /// Time from the capture of a frame to its arrival, s.
    latency_s: f64,
}

/// The latency given as a number of seconds, or by a file that the command has written.
pub(super) fn latency(flag: &str, given: Option<&str>) -> Result<Option<f64>, CliError> {
    let Some(text) = given else { return Ok(None) };
    let seconds = match text.parse::<f64>() {
        Ok(seconds) => seconds,
        Err(_) => {
            let file: Measured = toml::from_str(&read(Path::new(text), "latency")?).map_err(|error| {
                CliError::usage(format!("{flag}: `{text}` is no file with a latency"))
                    .because(&error)
                    .hint("`spf camera calibrate URL` measures it and writes such a file; a number of seconds can be given too")
            })?;
            file.latency_s
        }
    };
    if (0.0..=LONGEST).contains(&seconds) {
        return Ok(Some(seconds));
    }
    Err(CliError::usage(format!("{flag}: `{seconds}` is not a number of seconds from 0 to {LONGEST}")))
}

/// Shows a clock on the terminal, and reads it in the camera's frames.
pub(super) fn calibrate(args: &CameraCalibrate, printer: &Printer) -> Result<Exit, CliError> {
    if !(1.0..=600.0).contains(&args.seconds) {
        return Err(CliError::usage(format!("--seconds: `{}` is not a number from 1 to 600", args.seconds)));
    }
    if !args.overwrite && args.output.symlink_metadata().is_ok() {
        return Err(CliError::usage(format!("--output: `{}` exists", args.output.display()))
            .hint("use --overwrite to replace it, or another file with -o FILE"));
    }
    let url = address("URL", &args.url)?;
    if let CameraUrl::File { .. } = url {
        return Err(unable_to_film("a video file"));
    }
    if !printer.has_terminal() {
        return Err(CliError::usage("no terminal to show the clock on").hint("run the command in a terminal, not through a pipe"));
    }
    if let Some((columns, lines)) = printer.terminal_size().filter(|size| size.0 < NEEDED.0 || size.1 < NEEDED.1) {
        return Err(CliError::usage(format!(
            "the clock needs a terminal of {} columns and {} lines; this one has {columns} and {lines}",
            NEEDED.0, NEEDED.1
        ))
        .hint("enlarge the window, or choose a smaller font"));
    }
    let begun = Instant::now();
    let now = || Time::ZERO + begun.elapsed();
    // The arrival without the time by which a frame was held back.
    let settings = CameraSettings { latency: Duration::ZERO, times: CameraTimes::Timestamps, tello: tello(&url, printer)? };
    let camera = start(url.clone(), &settings, begun, Box::new(|image| image))?;
    if first_shown(&camera, &url, printer).is_none() {
        return Err(nothing(&camera, &url));
    }
    if camera.report().recorded {
        return Err(unable_to_film("a pipeline whose source is not live"));
    }
    printer.log("Point the camera at this terminal so that it sees the whole code, until it has been read often enough.");
    let (frames, mut meter, mut seen) = (camera.frames(), LatencyMeter::default(), None);
    let (until, mut next, mut drawn) = (Instant::now() + Duration::from_secs_f64(args.seconds), Instant::now(), false);
    let mut images = 0_u32;
    while Instant::now() < until {
        if Instant::now() >= next {
            next = Instant::now() + SHOWN;
            let millis = begun.elapsed().as_millis() as u64;
            let lines: Vec<String> = ClockCode::of(millis).lines().collect();
            meter.show(now(), millis);
            printer.show_code(&lines, drawn);
            drawn = true;
        }
        match frames.newest().filter(|(meta, _)| seen != Some(meta.id)) {
            Some((meta, photo)) => {
                seen = Some(meta.id);
                images += 1;
                if let Some(millis) = read_clock(&photo.pixels()) {
                    meter.read(meta.captured, millis);
                }
            }
            None => std::thread::sleep(POLL_INTERVAL),
        }
    }
    let Some(Latency { median, middle_half: (low, high), readings }) = meter.latency() else {
        return Err(CliError::failed(format!("the clock was read in fewer than {FEWEST} of {images} frames of the camera"))
            .hint(
                "bring the camera nearer, hold it still and straight, avoid reflections; a larger font of the terminal helps",
            ));
    };
    let latency = median.as_secs_f64();
    printer.result(&format!(
        "latency {latency:.3} s (median of {readings} readings in {images} frames, middle half {low:.3} to {high:.3} s)"
    ));
    write(&args.output, latency)?;
    printer.log(&format!("Written; use it with --camera-latency {}", args.output.display()));
    Ok(Exit::Success)
}

fn unable_to_film(what: &str) -> CliError {
    CliError::usage(format!("{what} cannot film this terminal: its images are older than the clock"))
        .hint("give the address of a live camera, and point it at the terminal")
}

fn write(path: &Path, latency: f64) -> Result<(), CliError> {
    // Milliseconds: what is smaller was not measured.
    let latency_s = (latency * 1000.0).round() / 1000.0;
    let failed = |error: &dyn std::error::Error| CliError::internal(format!("cannot write `{}`", path.display())).because(error);
    let text = toml::to_string(&Measured { latency_s }).map_err(|error| failed(&error))?;
    std::fs::write(path, format!("# Measured by spf camera calibrate.\n{text}")).map_err(|error| failed(&error))
}
