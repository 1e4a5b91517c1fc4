//! Cameras of this machine, by Video4Linux (crate `rscam`, which asks the kernel without any other library).

use std::fs::OpenOptions;
use std::io;
use std::os::unix::fs::FileTypeExt;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::time::{Duration, Instant};

use rscam::{Config, Error, IntervalInfo, ResolutionInfo};
use rustix::time::{ClockId, clock_gettime};
use spf_drone::frames::VideoStats;
use spf_media::jpeg::with_huffman_tables;

use super::{POLL_INTERVAL, SILENCE};
use crate::address::LocalCamera;
use crate::failure::SourceError;
use crate::feed::{Feed, Packets};
use crate::mjpeg::is_whole;
use crate::modes::{Format, Mode, choose, format, list, name};
use crate::yuyv;

/// Buffers that the kernel fills in turn: one is read, one is filled, one waits.
const BUFFERS: u32 = 3;
/// How long the device is awaited at the end. A thread that waits for a camera which sends nothing ends with the program.
const ENDING: Duration = Duration::from_millis(500);
/// Sizes that are tried of a camera which can have any within limits.
const SIZES: [(u32, u32); 5] = [(1920, 1080), (1280, 720), (800, 600), (640, 480), (320, 240)];
/// Intervals that are tried of a camera which does not list any, or which can have any within limits.
const INTERVALS: [(u32, u32); 5] = [(1, 30), (1, 25), (1, 15), (1, 10), (1, 5)];
/// Fields: no interlacing.
const PROGRESSIVE: u32 = rscam::FIELD_NONE;

/// What the kernel gave.
struct Captured {
    bytes: Vec<u8>,
    /// The kernel's time stamp, microseconds.
    stamp: u64,
    /// Time since then on the same clock, seconds; negative or huge if it was another clock.
    age: f64,
    at: Instant,
}

/// Receives until stopped.
pub(super) fn receive(wanted: &LocalCamera, feed: &mut Feed) -> Result<(), SourceError> {
    let (camera, mode) = open(wanted)?;
    let format = format(mode.code).ok_or_else(|| failed(wanted, "it sends a format that was not asked for"))?;
    tracing::debug!("{}: {mode}", wanted.path.display());
    let (send, images) = sync_channel(1);
    // It waits for the kernel without end, so that it is another thread than the one that looks whether to stop.
    let capturing = std::thread::Builder::new()
        .name("camera-capture".to_owned())
        .spawn(move || capture(&camera, &send))
        .map_err(|error| failed(wanted, &error.to_string()))?;
    let received = forward(&images, wanted, (format, mode.size), feed);
    // Its next image finds nobody, and closes the device.
    drop(images);
    let begun = Instant::now();
    while !capturing.is_finished() && begun.elapsed() < ENDING {
        std::thread::sleep(Duration::from_millis(5));
    }
    received
}

/// Gives images to the other thread until that ends. Those that come while it has not taken the one before are dropped.
fn capture(camera: &rscam::Camera, images: &SyncSender<io::Result<Captured>>) {
    loop {
        let taken = camera.capture().map(|frame| {
            let (stamp, now) = (frame.get_timestamp(), clock_gettime(ClockId::Monotonic));
            let age = now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9 - stamp as f64 * 1e-6;
            Captured { bytes: frame.to_vec(), stamp, age, at: Instant::now() }
        });
        let has_failed = taken.is_err();
        match images.try_send(taken) {
            Err(TrySendError::Disconnected(_)) => return,
            // A failure must arrive.
            Err(TrySendError::Full(taken)) if has_failed => drop(images.send(taken)),
            _ => {}
        }
        if has_failed {
            return;
        }
    }
}

fn forward(
    images: &Receiver<io::Result<Captured>>,
    wanted: &LocalCamera,
    (format, size): (Format, (u32, u32)),
    feed: &mut Feed,
) -> Result<(), SourceError> {
    let mut tally = VideoStats::default();
    let mut last = Instant::now();
    while !feed.stopped() {
        let captured = match images.recv_timeout(POLL_INTERVAL) {
            Ok(Ok(captured)) => captured,
            Ok(Err(error)) => return Err(io_failure(wanted, &error)),
            Err(RecvTimeoutError::Disconnected) => return Err(SourceError::Ended),
            Err(RecvTimeoutError::Timeout) => {
                if last.elapsed() > SILENCE {
                    // The device cannot be opened again while the other thread waits for it.
                    last = Instant::now();
                    feed.fail(&SourceError::Silent(SILENCE.as_secs()));
                }
                continue;
            }
        };
        last = captured.at;
        let at = feed.now() - captured.at.elapsed();
        let stamp = i64::try_from(captured.stamp).ok().and_then(|stamp| stamp.checked_mul(1000)).filter(|stamp| *stamp > 0);
        let age = stamp.map(|_| captured.age);
        tally.units += 1;
        match format {
            Format::Jpeg if is_whole(&captured.bytes) => {
                feed.jpeg(at, stamp, age, with_huffman_tables(&captured.bytes).into_owned());
            }
            Format::Yuyv if yuyv::length(size) == Some(captured.bytes.len()) => feed.yuyv(at, stamp, age, captured.bytes, size),
            // It was cut off on its way.
            _ => (tally.units, tally.damaged) = (tally.units - 1, tally.damaged + 1),
        }
        feed.tally(tally, Packets::default());
    }
    Ok(())
}

/// Opens the device in the best of its modes.
fn open(wanted: &LocalCamera) -> Result<(rscam::Camera, Mode), SourceError> {
    let path = wanted.path.to_str().ok_or_else(|| failed(wanted, "the name of the device is no text"))?;
    // The library says only that opening failed; a file that is no device would be asked things that it does not know.
    let kind = OpenOptions::new().read(true).write(true).open(&wanted.path).and_then(|file| file.metadata());
    let kind = kind.map_err(|error| io_failure(wanted, &error))?.file_type();
    if !kind.is_char_device() {
        return Err(not_a_camera(wanted));
    }
    let mut camera = rscam::Camera::new(path).map_err(|error| io_failure(wanted, &error))?;
    let modes = modes(&camera, wanted)?;
    let Some(mode) = choose(&modes, wanted) else {
        return Err(failed(
            wanted,
            &match list(&modes) {
                none if none.is_empty() => format!("it sends {}; only MJPG and YUYV can be decoded", codes(&modes)),
                known => format!("it has no such size and rate; it has {known}"),
            },
        ));
    };
    let config =
        Config { interval: mode.interval, resolution: mode.size, format: &mode.code, field: PROGRESSIVE, nbuffers: BUFFERS };
    camera.start(&config).map_err(|error| match error {
        Error::Io(error) => io_failure(wanted, &error),
        other => failed(wanted, &format!("it refuses {mode} ({other}); ask for another size or rate")),
    })?;
    Ok((camera, mode))
}

/// The modes that a camera lists.
fn modes(camera: &rscam::Camera, wanted: &LocalCamera) -> Result<Vec<Mode>, SourceError> {
    let mut modes = Vec::new();
    // A kernel driver lists some formats, each with some sizes and intervals; the limits bound one that never ends.
    for info in camera.formats().take(64) {
        let code = info.map_err(|error| io_failure(wanted, &error))?.format;
        for size in sizes(camera, code, wanted.size).into_iter().take(256) {
            let listed = camera.intervals(&code, size).ok();
            let intervals = match listed {
                Some(IntervalInfo::Discretes(listed)) if listed.iter().any(|interval| interval.0 > 0) => listed,
                _ => wanted.rate.map(|rate| (1, rate)).into_iter().chain(INTERVALS).collect(),
            };
            modes.extend(intervals.into_iter().take(64).map(|interval| Mode { code, size, interval }));
        }
    }
    // The second device of a webcam, which tells about its images, lists none.
    if modes.is_empty() { Err(not_a_camera(wanted)) } else { Ok(modes) }
}

fn sizes(camera: &rscam::Camera, code: [u8; 4], wanted: Option<(u32, u32)>) -> Vec<(u32, u32)> {
    match camera.resolutions(&code) {
        Ok(ResolutionInfo::Discretes(sizes)) => sizes.into_iter().filter(|(width, height)| *width > 0 && *height > 0).collect(),
        Ok(ResolutionInfo::Stepwise { min, max, step }) => {
            let on = |value: u32, min: u32, max: u32, step: u32| {
                (min..=max).contains(&value) && (value - min).is_multiple_of(step.max(1))
            };
            let tried = wanted.into_iter().chain(SIZES).chain([max]);
            tried.filter(|(w, h)| on(*w, min.0, max.0, step.0) && on(*h, min.1, max.1, step.1)).collect()
        }
        Err(_) => Vec::new(),
    }
}

fn codes(modes: &[Mode]) -> String {
    let mut codes: Vec<String> = modes.iter().map(|mode| name(mode.code)).collect();
    codes.dedup();
    codes.join(", ")
}

fn failed(wanted: &LocalCamera, why: &str) -> SourceError {
    SourceError::Device { path: wanted.path.clone(), why: why.to_owned(), passes: false }
}

fn not_a_camera(wanted: &LocalCamera) -> SourceError {
    failed(
        wanted,
        "this is no camera; a webcam often has two devices, of which the first sends images: `ls -l /dev/v4l/by-id` lists them",
    )
}

/// What the operating system says, and what to do.
fn io_failure(wanted: &LocalCamera, error: &io::Error) -> SourceError {
    use rustix::io::Errno;
    let (why, passes) = match error.raw_os_error().map(Errno::from_raw_os_error) {
        Some(Errno::NOENT) => ("there is no such device: plug the camera in, and see `ls /dev/video*`".to_owned(), true),
        Some(Errno::ACCESS | Errno::PERM) => {
            ("no permission: `sudo usermod -aG video $USER` adds you to the group `video`; then log in again".to_owned(), false)
        }
        Some(Errno::BUSY) => (format!("another program uses it: `fuser {}` names the process", wanted.path.display()), true),
        Some(Errno::NODEV | Errno::NXIO) => ("the camera was unplugged".to_owned(), true),
        Some(Errno::NOTTY | Errno::INVAL | Errno::ISDIR) => return not_a_camera(wanted),
        Some(Errno::NOSPC) => ("the USB bus has no room for it: use another port, a smaller size, or MJPG".to_owned(), true),
        _ => (error.to_string(), true),
    };
    SourceError::Device { path: wanted.path.clone(), why, passes }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wanted(path: &str) -> LocalCamera {
        LocalCamera { path: path.into(), size: None, rate: None }
    }

    #[test]
    fn what_is_no_camera_is_refused_with_advice() {
        for (path, expected, attention) in [
            ("/dev/video-none", "plug the camera in", false),
            ("/dev/null", "this is no camera", true),
            ("/dev/zero", "this is no camera", true),
            ("/etc/hostname", "this is no camera", true),
            ("/dev", "this is no camera", true),
        ] {
            let Err(error) = open(&wanted(path)) else { panic!("{path}") };
            let text = error.to_string();
            assert!(text.contains(expected) && text.starts_with(path), "{text}");
            assert_eq!(error.needs_attention(), attention, "{text}");
        }
    }

    #[test]
    fn each_refusal_of_the_system_says_what_to_do() {
        let text = |number| io_failure(&wanted("/dev/video0"), &io::Error::from_raw_os_error(number)).to_string();
        use rustix::io::Errno;
        assert!(text(Errno::ACCESS.raw_os_error()).contains("group `video`"));
        assert!(text(Errno::BUSY.raw_os_error()).contains("`fuser /dev/video0`"));
        assert!(text(Errno::NODEV.raw_os_error()).contains("unplugged"));
        assert!(text(Errno::NOTTY.raw_os_error()).contains("no camera"));
        assert!(text(Errno::NOSPC.raw_os_error()).contains("USB bus"));
    }
}
