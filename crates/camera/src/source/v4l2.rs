//! Cameras of this machine, by Video4Linux (crate `rscam`, which asks the kernel without any other library).
//!
//! The library shows neither the flags of a buffer, such as that of an error, nor the file descriptor by which it could be awaited
//! with a timeout. So each image is examined, and a camera that sends nothing keeps its thread and its device.

mod identity;
mod listing;

use std::fs::OpenOptions;
use std::io;
use std::os::unix::fs::FileTypeExt;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::time::{Duration, Instant};

use rscam::{Config, Error};
use rustix::time::{ClockId, clock_gettime};
use spf_drone::frames::VideoStats;

use self::identity::Identity;
use self::listing::modes;
use super::{POLL_INTERVAL, SILENCE};
use crate::address::LocalCamera;
use crate::failure::SourceError;
use crate::feed::{Feed, Packets};
use crate::intact;
use crate::modes::{Format, Mode, choose, format, is_bare_sensor, list, name};
use crate::yuyv;

/// Buffers that the kernel fills in turn: one is read, one is filled, one waits.
const BUFFERS: u32 = 3;
/// How long the device is awaited at the end. A thread that waits for a camera which sends nothing ends with the program.
const ENDING: Duration = Duration::from_millis(500);
/// Fields: no interlacing.
const PROGRESSIVE: u32 = rscam::FIELD_NONE;

/// What is known of a camera that was opened before: after it was unplugged, nothing else than it, as it was, will do.
#[derive(Debug, Default)]
pub(crate) struct Known {
    first: Option<(Option<Identity>, Mode)>,
}

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
pub(super) fn receive(wanted: &LocalCamera, known: &mut Known, feed: &mut Feed) -> Result<(), SourceError> {
    let (camera, mode) = open(wanted, known)?;
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
    // When the last usable image came, and why others since then were none.
    let (mut last, mut unusable) = (Instant::now(), None);
    while !feed.stopped() {
        if last.elapsed() > SILENCE {
            if let Some((why, passes)) = unusable.take() {
                return Err(SourceError::Device { path: wanted.path.clone(), why, passes });
            }
            // The device cannot be opened again while the other thread waits for it.
            last = Instant::now();
            feed.fail(&SourceError::Silent(SILENCE.as_secs()));
        }
        let captured = match images.recv_timeout(POLL_INTERVAL) {
            Ok(Ok(captured)) => captured,
            Ok(Err(error)) => return Err(io_failure(wanted, &error)),
            Err(RecvTimeoutError::Disconnected) => return Err(SourceError::Ended),
            Err(RecvTimeoutError::Timeout) => continue,
        };
        let at = feed.now() - captured.at.elapsed();
        let (stamp, age) = (i64::try_from(captured.stamp).ok().and_then(|stamp| stamp.checked_mul(1000)), Some(captured.age));
        let length = captured.bytes.len();
        let refused = if captured.stamp == 0 {
            // Drivers older than Linux 3.9 give the time of day (V4L2_BUF_FLAG_TIMESTAMP_UNKNOWN), and loops of other programs times of
            // their own: by the kernel's clock these are in the future, or older than is believed, and only tell what came late.
            // A driver gives a buffer in which nothing was captured back so.
            Some(("its images have no time stamp".to_owned(), false))
        } else if format == Format::Jpeg {
            match intact::decode(&captured.bytes) {
                Some(image) => {
                    feed.decoded(at, stamp, age, image, "JPEG");
                    None
                }
                None => Some((format!("its images of {length} bytes are no intact JPEG; try another cable, port or size"), true)),
            }
        } else if yuyv::length(size) == Some(length) {
            feed.yuyv(at, stamp, age, captured.bytes, size);
            None
        } else {
            let expected = yuyv::length(size).unwrap_or(0);
            Some((format!("its images have {length} bytes, expected {expected}; try another size or MJPG"), false))
        };
        if refused.is_some() {
            (tally.damaged, unusable) = (tally.damaged + 1, refused);
        } else {
            (tally.units, last, unusable) = (tally.units + 1, captured.at, None);
        }
        feed.tally(tally, Packets::default());
    }
    Ok(())
}

/// Opens the device in the best of its modes, or in that of the first time.
fn open(wanted: &LocalCamera, known: &mut Known) -> Result<(rscam::Camera, Mode), SourceError> {
    let path = wanted.path.to_str().ok_or_else(|| failed(wanted, "the name of the device is no text"))?;
    // The library says only that opening failed; a file that is no device would be asked things that it does not know.
    let kind = OpenOptions::new().read(true).write(true).open(&wanted.path).and_then(|file| file.metadata());
    let kind = kind.map_err(|error| early_failure(wanted, &error))?.file_type();
    if !kind.is_char_device() {
        return Err(not_a_camera(wanted));
    }
    let identity = Identity::of(&wanted.path);
    if let Some((first, _)) = &known.first
        && *first != identity
    {
        let name = identity.as_ref().map_or("unknown", Identity::name);
        let why = format!("another camera is at this device ({name}); plug the first one in where it was");
        return Err(SourceError::Device { path: wanted.path.clone(), why, passes: true });
    }
    let mut camera = rscam::Camera::new(path).map_err(|error| early_failure(wanted, &error))?;
    let mut modes = modes(&camera, wanted)?;
    if let Some((_, first)) = &known.first {
        modes.retain(|mode| mode == first);
        if modes.is_empty() {
            return Err(failed(wanted, &format!("it no longer has {first}, in which it was received first")));
        }
    }
    let mut refusal = None;
    // A camera may list rates that it then does not take.
    while let Some(mode) = choose(&modes, wanted) {
        let config =
            Config { interval: mode.interval, resolution: mode.size, format: &mode.code, field: PROGRESSIVE, nbuffers: BUFFERS };
        match camera.start(&config) {
            Ok(()) => {
                known.first.get_or_insert((identity, mode));
                return Ok((camera, mode));
            }
            Err(Error::Io(error)) => return Err(io_failure(wanted, &error)),
            Err(other) => {
                modes.retain(|other| *other != mode);
                refusal.get_or_insert(format!("it refuses {mode} ({other}); ask for another size or rate"));
            }
        }
    }
    let why = refusal.unwrap_or_else(|| match list(&modes) {
        none if none.is_empty() => unread(&modes),
        known => format!("it has no such size and rate; it has {known}"),
    });
    Err(failed(wanted, &why))
}

/// Of a camera that sends nothing of what is read here. Its H.264 is none of it: the library hides the numbers of the buffers, so that
/// nobody knows which image is missing.
fn unread(modes: &[Mode]) -> String {
    let mut codes: Vec<String> = modes.iter().map(|mode| name(mode.code)).collect();
    codes.dedup();
    let codes = codes.join(", ");
    if modes.iter().all(|mode| is_bare_sensor(mode.code)) {
        return format!(
            "it is a bare sensor ({codes}), whose images libcamera makes: let rpicam-vid, or GStreamer's libcamerasrc, send them in \
             H.264 (docs/guide/cameras.md)"
        );
    }
    format!("it sends {codes}; only MJPG and YUYV are read here: let ffmpeg or GStreamer send it (docs/guide/cameras.md)")
}

fn failed(wanted: &LocalCamera, why: &str) -> SourceError {
    SourceError::Device { path: wanted.path.clone(), why: why.to_owned(), passes: false }
}

fn not_a_camera(wanted: &LocalCamera) -> SourceError {
    failed(
        wanted,
        "this is no camera that gives images by itself; a webcam often has two devices, of which the first sends images: \
         `ls -l /dev/v4l/by-id` lists them",
    )
}

/// The same, before the device has shown that it is a camera.
fn early_failure(wanted: &LocalCamera, error: &io::Error) -> SourceError {
    use rustix::io::Errno;
    match error.raw_os_error().map(Errno::from_raw_os_error) {
        Some(Errno::NOTTY | Errno::INVAL | Errno::ISDIR) => not_a_camera(wanted),
        _ => io_failure(wanted, error),
    }
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
        Some(Errno::IO | Errno::PROTO) => {
            ("an error on the way from the camera: check the cable, and use another port, without a hub".to_owned(), true)
        }
        Some(Errno::NOTTY | Errno::INVAL) => (
            format!("it refuses this size or rate ({error}): ask for another, or let ffmpeg send it (docs/guide/cameras.md)"),
            false,
        ),
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
        for (path, expected, waits_long) in [
            ("/dev/video-none", "plug the camera in", false),
            ("/dev/null", "this is no camera", true),
            ("/dev/zero", "this is no camera", true),
            ("/etc/hostname", "this is no camera", true),
            ("/dev", "this is no camera", true),
        ] {
            let Err(error) = open(&wanted(path), &mut Known::default()) else { panic!("{path}") };
            let text = error.to_string();
            assert!(text.contains(expected) && text.starts_with(path), "{text}");
            assert_eq!(error.waits_long(), waits_long, "{text}");
        }
    }

    #[test]
    fn each_refusal_of_the_system_says_what_to_do() {
        let text = |number| io_failure(&wanted("/dev/video0"), &io::Error::from_raw_os_error(number)).to_string();
        use rustix::io::Errno;
        assert!(text(Errno::ACCESS.raw_os_error()).contains("group `video`"));
        assert!(text(Errno::BUSY.raw_os_error()).contains("`fuser /dev/video0`"));
        assert!(text(Errno::NODEV.raw_os_error()).contains("unplugged"));
        assert!(text(Errno::IO.raw_os_error()).contains("check the cable"));
        // Only a device that has shown nothing yet may be no camera.
        assert!(text(Errno::INVAL.raw_os_error()).contains("refuses this size or rate"));
        let early = early_failure(&wanted("/dev/video0"), &io::Error::from_raw_os_error(Errno::NOTTY.raw_os_error()));
        assert!(early.to_string().contains("no camera"));
        assert!(text(Errno::NOSPC.raw_os_error()).contains("USB bus"));
    }
}
