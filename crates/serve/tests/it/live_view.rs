//! The view of a served craft by RTSP.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{Duration, Instant};

use spf_camera::{Camera, CameraSettings};
use spf_core::craft::CraftKind;
use spf_core::time::Time;
use spf_drone::frames::Frames as _;
use spf_flight::sim::{LoadedScene, SimWorld};
use spf_serve::live_camera::{LiveCamera, LiveCameraPlan};

/// How many are compared with the one before.
const IMAGES: u64 = 12;
/// Limit that detects hangs only.
const PATIENCE: Duration = Duration::from_secs(600);

/// Those of a frozen camera are, and then the pilot holds, so that nothing would change any more.
#[test]
fn images_of_a_craft_that_does_not_move_are_never_equal() {
    let loaded = Arc::new(LoadedScene::load("park").unwrap());
    let pose = loaded.scene.start;
    let world = SimWorld::new(loaded, CraftKind::Quad, pose, 1);
    let start = Instant::now();
    let plan = LiveCameraPlan::new(world.clone(), start, SocketAddr::from(([127, 0, 0, 1], 0)));
    let served = LiveCamera::start(plan).unwrap();
    let camera = Camera::start(served.url().parse().unwrap(), &CameraSettings::default(), start).unwrap();
    while camera.frames().tally().decoded < IMAGES {
        assert!(start.elapsed() < PATIENCE, "{:?} {:?}", camera.report(), camera.frames().tally());
        world.shared_craft().lock().unwrap().advance_to(Time::ZERO + start.elapsed());
        std::thread::sleep(Duration::from_millis(10));
    }
    let tally = camera.frames().tally();
    assert_eq!(tally.repeated, 0, "{} of {} repeated", tally.repeated, tally.decoded);
}
