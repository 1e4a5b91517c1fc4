//! `spf doctor`: checks everything that can be checked before a flight, and suggests fixes.

use std::path::Path;
use std::time::{Duration, Instant};

use spf_core::camera::Camera;
use spf_core::detection::Detection;
use spf_core::frame::FrameId;
use spf_core::query::Mark;
use spf_core::time::Duration as FlightDuration;
use spf_core::time::Time;
use spf_detect::{DepthNetwork, Detector};
pub use spf_drone::examine::{Check, Finding};
use spf_media::{Rgb, marks};
use spf_render::Channels;
use spf_vlm::check::{USUAL_CAMERA, Verdict, check};
use spf_vlm::{Vlm, VlmError};

use crate::depth_network::picture;
use crate::sim::LoadedScene;

/// How long the simulator renders.
const WATCHED: Duration = Duration::from_secs(3);
/// Inference time above which a detector is reported as slow.
const SLOW_DETECTOR: Duration = Duration::from_millis(700);
/// Number of runs of a depth network that are timed, the height of its test image above the start, metres, and the time above which
/// it is reported as slow.
const DEPTH_RUNS: u32 = 3;
const EYE_HEIGHT: f64 = 1.5;
const SLOW_DEPTH: Duration = Duration::from_secs(1);
/// Free disk space needed for a long flight with video, bytes.
const SPACE: u64 = 1 << 30;

/// Renders a scene as a flight on the wall clock does, and measures the frame rate.
#[must_use]
pub fn simulator(loaded: &LoadedScene) -> Check {
    let moment = loaded.initial_snapshot(loaded.scene.start);
    let camera = loaded.scene.default_craft.camera();
    let (begun, mut drawn) = (Instant::now(), 0_u32);
    while begun.elapsed() < WATCHED {
        drop(loaded.render(&camera, &moment, Channels::RGB));
        drawn += 1;
    }
    let rate = f64::from(drawn) / begun.elapsed().as_secs_f64();
    // The video of a flight has ten frames per second.
    let finding = if rate < 10.0 { Finding::Warning } else { Finding::Good };
    let text = format!("{} renders at {rate:.1} frames per second", loaded.scene.name);
    Check::new("simulator", finding, text, Some("reduce the load on this machine, or fly with --no-video"))
}

/// Sends test images of a dot to a VLM. `advice` is what to do about an error of it.
pub fn vlm(name: &str, vlm: &mut dyn Vlm, time: FlightDuration, advice: impl Fn(&VlmError) -> &'static str) -> Check {
    let checked = check(vlm, time, USUAL_CAMERA);
    let latencies = checked.pointed.iter().map(|pointed| pointed.answer.latency.as_secs_f64());
    let slowest = latencies.fold(0.0, f64::max);
    match checked.verdict {
        Verdict::Good(worst) => {
            let finding = if slowest > 5.0 { Finding::Warning } else { Finding::Good };
            let text = format!("{name} points within {:.1} % of the image width, latency up to {slowest:.2} s", 100.0 * worst);
            Check::new("VLM", finding, text, Some("use a faster model: the drone holds, or flies on, while waiting for a reply"))
        }
        Verdict::Failed(error) if error.is_of_stand_in() => Check::new(
            "VLM",
            Finding::Warning,
            format!("{name} is the oracle of `spf sim serve`: no VLM, and only for the view of its own simulated camera"),
            Some(advice(&error)),
        ),
        Verdict::Failed(error) => Check::new("VLM", Finding::Bad, format!("{name}: {error}"), Some(advice(&error))),
        _ => Check::new(
            "VLM",
            Finding::Bad,
            format!("{name} responds, but points inaccurately"),
            Some(
                "`spf vlm check` shows \
            details",
            ),
        ),
    }
}

/// Runs an object detector on a view of a scene, above its start. Returns also the picture with its boxes.
#[must_use]
pub fn detector(model: &Detector, loaded: &LoadedScene) -> (Check, Option<Rgb>) {
    let (_, mut image) = view(loaded);
    let began = Instant::now();
    let seen = model.detect(&image);
    let took = began.elapsed();
    let (width, height) = model.input();
    let about = format!("{} has {} classes, {width}×{height} pixels", model.name(), model.classes().len());
    match seen {
        Err(error) => {
            let advice = "use another model: docs/guide/detector.md";
            (Check::new("detector", Finding::Bad, format!("{about}: {error}"), Some(advice)), None)
        }
        Ok(seen) => {
            let finding = if took > SLOW_DETECTOR { Finding::Warning } else { Finding::Good };
            let advice = "this delays every decision: use a smaller model or input size";
            let found = format!("{about}, {:.2} s per image, {} objects", took.as_secs_f64(), seen.len());
            let mark = |found: Detection| Mark::Box { area: found.area, label: format!("{} {:.2}", found.name, found.score) };
            marks::draw(&mut image, &seen.into_iter().map(mark).collect::<Vec<_>>());
            (Check::new("detector", finding, found, Some(advice)), Some(image))
        }
    }
}

/// What is seen from above the start of a scene, and by which camera.
fn view(loaded: &LoadedScene) -> (Camera, Rgb) {
    let mut pose = loaded.scene.start;
    pose.position.up += EYE_HEIGHT;
    let camera = loaded.scene.default_craft.camera();
    let drawn = loaded.render(&camera, &loaded.initial_snapshot(pose), Channels::RGB);
    let image = Rgb::from_raw(drawn.width, drawn.height, drawn.rgb.unwrap_or_default()).unwrap_or_else(|_| Rgb::new(1, 1));
    (camera, image)
}

/// Runs a depth network on a view of a scene, above its start. Returns also a picture of what it sees.
#[must_use]
pub fn depth_network(network: &DepthNetwork, loaded: &LoadedScene) -> (Check, Option<Rgb>) {
    let (camera, image) = view(loaded);
    let began = Instant::now();
    let mut seen = network.estimate((FrameId(0), Time::ZERO), &camera, &image);
    for _ in 1..DEPTH_RUNS {
        seen = network.estimate((FrameId(0), Time::ZERO), &camera, &image);
    }
    let took = began.elapsed() / DEPTH_RUNS;
    let ((width, height), (columns, rows)) = (network.input(), network.output());
    let about = format!("{} ({}), {width}×{height} → {columns}×{rows} pixels", network.name(), network.kind());
    match seen {
        Err(error) => {
            let advice = "see docs/guide/obstacles.md, \"A depth network\"";
            (Check::new("depth network", Finding::Bad, format!("{about}: {error}"), Some(advice)), None)
        }
        Ok(estimate) => {
            let finding = if took > SLOW_DEPTH { Finding::Warning } else { Finding::Good };
            let advice = "below 1 Hz the map is late: use a smaller model, or a smaller input (fly.depth_model_size in spf.toml)";
            let hz = 1.0 / took.as_secs_f64().max(1e-6);
            let found = format!("{about}, {:.2} s per image, {hz:.1} Hz", took.as_secs_f64());
            (Check::new("depth network", finding, found, Some(advice)), Some(picture(&image, &estimate)))
        }
    }
}

/// Checks the disk that a folder is on; `None` if that cannot be determined.
#[must_use]
pub fn disk(folder: &Path) -> Option<Check> {
    let free = free_bytes(folder)?;
    let finding = if free < SPACE { Finding::Warning } else { Finding::Good };
    Some(Check::new(
        "disk",
        finding,
        format!("{:.1} GB free", free as f64 * 1e-9),
        Some(
            "free some space, or fly with \
        --no-video",
        ),
    ))
}

#[cfg(unix)]
fn free_bytes(folder: &Path) -> Option<u64> {
    let found = rustix::fs::statvfs(folder).ok()?;
    Some(found.f_bavail.saturating_mul(found.f_frsize))
}

#[cfg(not(unix))]
fn free_bytes(_folder: &Path) -> Option<u64> {
    None
}
