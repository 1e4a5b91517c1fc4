//! Tracks through drawn frames. Those through rendered ones are in `tests/it/tracking.rs`.

use std::sync::atomic::{AtomicUsize, Ordering};

use spf_core::geometry::Attitude;
use spf_core::query::QueryId;
use spf_media::Rgb;

use super::*;

const SIZE: (u32, u32) = (240, 180);
/// Turning rate of the camera, to the right.
const RATE_DEG_S: f64 = 12.0;

/// A camera that turns before a patterned cylinder, at 20 frames a second.
struct Scene {
    camera: Camera,
    tracking: Tracking,
    /// Number of images drawn.
    drawn: Arc<AtomicUsize>,
}

fn grain(x: i64, y: i64) -> u8 {
    let mixed = (x.wrapping_mul(0x9e37_79b9) ^ y.wrapping_mul(0x85eb_ca6b)).wrapping_mul(0xc2b2_ae35);
    (mixed >> 13 & 0xff) as u8
}

fn meta(number: u64) -> FrameMeta {
    let captured = Time::from_millis(50 * number);
    FrameMeta {
        id: FrameId(number),
        captured,
        received: captured,
        capture_counter: number,
        width: 240,
        height: 180,
        unusable: None,
    }
}

fn heading_deg(number: u64) -> f64 {
    RATE_DEG_S * 0.05 * number as f64
}

impl Scene {
    fn new() -> Self {
        let camera = Camera::from_fov(SIZE.0, SIZE.1, 90.0_f64.to_radians(), 73.7_f64.to_radians(), 0.0);
        Self { camera, tracking: Tracking::new(&camera), drawn: Arc::default() }
    }

    fn photo(&self, number: u64) -> Photo {
        let (camera, drawn) = (self.camera, self.drawn.clone());
        Photo::drawn(SIZE, move |size| {
            assert_eq!(size, SIZE);
            drawn.fetch_add(1, Ordering::Relaxed);
            let mut image = Rgb::filled(size.0, size.1, [0; 3]);
            for y in 0..size.1 {
                for x in 0..size.0 {
                    let bearing = ((f64::from(x) - camera.cx) / camera.fx).atan().to_degrees() + heading_deg(number);
                    let value = grain((bearing * 0.7).floor() as i64, i64::from(y / 4));
                    image.set_pixel(x, y, [value; 3]);
                }
            }
            image
        })
    }

    fn arrive(&mut self, number: u64) {
        let attitude = Attitude { heading: heading_deg(number).to_radians(), ..Attitude::default() };
        self.tracking.telemetry(&Telemetry { time: meta(number).captured, attitude, ..Telemetry::default() });
        let photo = self.photo(number);
        self.tracking.frame(meta(number), || Some(photo));
    }

    /// The box of what lies at bearings from 10° to 20°, as seen in a frame.
    fn area(&self, number: u64) -> ImageBox {
        let at = |bearing: f64| 0.5 + 0.5 * (bearing - heading_deg(number)).to_radians().tan();
        ImageBox { left: at(10.0), top: 0.4, right: at(20.0), bottom: 0.6 }
    }

    fn begin(&mut self, number: u64) {
        let area = self.area(number);
        self.tracking.start(TrackStart { id: QueryId(7), frame: FrameId(number), area });
    }

    /// Steps until a report, and their number.
    fn report(&mut self) -> (u32, TrackReport) {
        for steps in 1..200 {
            match self.tracking.step() {
                Progress::Report(report) => return (steps, report),
                Progress::Behind => {}
                Progress::Idle => panic!("idle after {steps} steps"),
            }
        }
        panic!("no report");
    }

    fn drawn(&self) -> usize {
        self.drawn.load(Ordering::Relaxed)
    }
}

#[test]
fn a_track_begins_in_the_old_frame_and_arrives_in_the_newest() {
    let mut scene = Scene::new();
    (0..=80).for_each(|number| scene.arrive(number));
    assert_eq!((scene.tracking.step(), scene.drawn()), (Progress::Idle, 0), "nothing is drawn before it is needed");
    scene.begin(20);
    let (steps, report) = scene.report();
    // 3 s at ten frames a second, in which the camera has turned by 36°, more than three widths of the box.
    assert_eq!((steps, report.frame, report.captured), (31, FrameId(80), Time::from_millis(4000)));
    assert_eq!((report.id, report.quality), (QueryId(7), TrackQuality::Good));
    let overlap = report.area.iou(&scene.area(80));
    assert!(overlap > 0.6, "{overlap}: {report:?} instead of {:?}", scene.area(80));
    assert_eq!((scene.tracking.step(), scene.drawn()), (Progress::Idle, 31));

    // Every other frame gives a report; a new track draws no image again.
    scene.arrive(81);
    assert_eq!(scene.tracking.step(), Progress::Idle);
    scene.arrive(82);
    assert_eq!(scene.report().1.frame, FrameId(82));
    scene.begin(40);
    assert_eq!((scene.report().0, scene.drawn()), (22, 32));
    scene.tracking.stop();
    scene.arrive(84);
    assert_eq!((scene.tracking.step(), scene.drawn()), (Progress::Idle, 32));
}

#[test]
fn a_frame_that_is_gone_is_reported_lost_once() {
    let mut scene = Scene::new();
    (0..=200).for_each(|number| scene.arrive(number));
    // 10 s old.
    scene.begin(0);
    let (steps, report) = scene.report();
    assert_eq!((steps, report.quality, report.frame), (1, TrackQuality::Lost, FrameId(200)));
    assert!(report.is_sound() && report.area == scene.area(0));
    scene.arrive(202);
    assert_eq!((scene.tracking.step(), scene.drawn()), (Progress::Idle, 0));
    // 8 s is kept; frames between those that are tracked in are not.
    scene.begin(42);
    assert_ne!(scene.report().1.frame, FrameId(42));
    scene.begin(43);
    assert_eq!(scene.report().1.quality, TrackQuality::Lost);
}

#[test]
fn a_frame_that_was_asked_about_is_kept_until_eight_later_ones_were() {
    let mut scene = Scene::new();
    let ask = |scene: &mut Scene, number| {
        let photo = scene.photo(number);
        scene.tracking.asked(FrameId(number), Some(photo));
    };
    for number in 0..=180 {
        scene.arrive(number);
        if number == 7 {
            ask(&mut scene, 7);
        }
    }
    scene.begin(7);
    assert!(matches!(scene.tracking.step(), Progress::Behind));
    (170..177).for_each(|number| ask(&mut scene, number));
    scene.begin(7);
    assert!(matches!(scene.tracking.step(), Progress::Behind));
    ask(&mut scene, 177);
    scene.begin(7);
    assert!(matches!(scene.tracking.step(), Progress::Report(TrackReport { quality: TrackQuality::Lost, .. })));
}

#[test]
fn a_slow_tracker_arrives_by_skipping_frames() {
    let mut scene = Scene::new();
    (0..=60).for_each(|number| scene.arrive(number));
    scene.begin(0);
    let mut number = 60;
    // A frame to be tracked in arrives for each image: without skipping, it stays 3 s behind for ever.
    let steps = (1..).find(|_| {
        (number + 1..=number + 2).for_each(|number| scene.arrive(number));
        number += 2;
        matches!(scene.tracking.step(), Progress::Report(_))
    });
    assert!((20..50).contains(&steps.unwrap()), "{steps:?}");
    // The newest frame counts from then on.
    (number + 1..=number + 6).for_each(|number| scene.arrive(number));
    let (steps, report) = scene.report();
    assert_eq!((steps, report.frame), (1, FrameId(number + 6)));
}

#[test]
fn a_box_that_cannot_be_tracked_is_reported_once() {
    let mut scene = Scene::new();
    (0..=10).for_each(|number| scene.arrive(number));
    // 11 pixels.
    let area = ImageBox { left: 0.5, top: 0.5, right: 0.5 + 11.0 / 240.0, bottom: 0.7 };
    scene.tracking.start(TrackStart { id: QueryId(1), frame: FrameId(0), area });
    let (steps, report) = scene.report();
    assert_eq!((steps, report.quality, report.frame), (1, TrackQuality::TooSmall, FrameId(0)));
    assert_eq!(scene.tracking.step(), Progress::Idle);
}

#[test]
fn unusable_and_repeated_frames_are_left_out() {
    let mut scene = Scene::new();
    scene.arrive(0);
    let never = || -> Option<Photo> { panic!("no image is needed") };
    scene.tracking.frame(FrameMeta { unusable: Some(spf_core::frame::Unusable::Blank), ..meta(2) }, never);
    scene.tracking.frame(FrameMeta { capture_counter: 0, ..meta(2) }, never);
    scene.tracking.frame(meta(1), never);
    scene.tracking.frame(meta(0), never);
    assert_eq!(scene.tracking.ring.newest(), Some(meta(0)));
}
