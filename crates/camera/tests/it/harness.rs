//! Common parts of tests with other programs.

use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use spf_camera::{Camera, CameraSettings};
use spf_drone::frames::Frames as _;

/// Limit that detects hangs only.
pub(crate) const PATIENCE: Duration = Duration::from_secs(40);

/// A program that is ended with the test.
pub(crate) struct Program(Child);

impl Drop for Program {
    fn drop(&mut self) {
        self.0.kill().ok();
        self.0.wait().ok();
    }
}

impl Program {
    pub(crate) fn start(program: &str, args: &[&str]) -> Self {
        let child = Command::new(program).args(args).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn();
        Self(child.unwrap())
    }
}

/// Whether a program and what it needs exists, which `ask` finds out; with `CI=true` it must.
pub(crate) fn have(what: &str, ask: &mut Command) -> bool {
    have_if(what, ask.output().is_ok_and(|output| output.status.success()))
}

/// The same, found out already.
pub(crate) fn have_if(what: &str, there: bool) -> bool {
    assert!(there || std::env::var("CI").as_deref() != Ok("true"), "{what} is missing");
    if !there {
        eprintln!("NOT CHECKED: {what} is missing, so this test did not run");
    }
    there
}

pub(crate) fn camera(url: &str) -> Camera {
    let settings = CameraSettings { latency: Duration::from_millis(100), ..CameraSettings::default() };
    // The clock of a program runs before its camera does. No frame is captured before its zero, so that one which came sooner than
    // the latency after it would count as younger.
    let begin = Instant::now().checked_sub(Duration::from_secs(1)).unwrap();
    Camera::start(url.parse().unwrap(), &settings, begin).unwrap()
}

pub(crate) fn wait(what: &str, camera: &Camera, mut until: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !until() {
        assert!(begun.elapsed() < PATIENCE, "{what}: {:?} {:?}", camera.report(), camera.frames().tally());
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Waits for this many images after those decoded so far; checks size and age of the newest.
pub(crate) fn images(camera: &Camera, more: u64, size: (u32, u32)) {
    let frames = camera.frames();
    let before = frames.tally().decoded;
    wait("images", camera, || frames.tally().decoded >= before + more);
    let (meta, photo) = frames.newest().unwrap();
    assert_eq!(photo.size(), size);
    let age = meta.received.since(meta.captured);
    // At least the assumed latency, unless the camera tells the time itself.
    let least = if camera.report().own_clock { Duration::ZERO } else { Duration::from_millis(100) };
    assert!(age >= least && age < Duration::from_secs(5), "{age:?}");
    // Test pictures are colourful: nothing is grey or green.
    let pixels = photo.pixels();
    let spread = |channel: usize| {
        let values = pixels.data().chunks_exact(3).map(|pixel| pixel[channel]);
        values.clone().max().unwrap() - values.min().unwrap()
    };
    assert!((0..3).all(|channel| spread(channel) > 150));
}
