//! The target's box between two answers, tracked in rendered frames and on the wall clock.

use std::collections::VecDeque;
use std::path::Path;
use std::sync::{Arc, OnceLock};
use std::time::Instant;

use spf_core::camera::Camera;
use spf_core::command::Command;
use spf_core::craft::{Craft, CraftKind};
use spf_core::frame::{FrameId, FrameMeta};
use spf_core::query::{ImageBox, QueryId};
use spf_core::time::{Duration, Time};
use spf_core::track::{TrackQuality, TrackReport, TrackStart};
use spf_drone::frames::{FrameStore, Frames};
use spf_drone::{Capabilities, Drone, DroneError, DroneEvent};
use spf_envelope::Cleared;
use spf_flight::flight::{FlightPlan, Site, fly};
use spf_flight::recorder::RecordPlan;
use spf_flight::replay::{Changes, replay, row};
use spf_flight::run::{Observer, World};
use spf_flight::sim::{LoadedScene, SimWorld, Simulated, VlmFactory, oracle_factory};
use spf_flight::world::{Live, Script};
use spf_media::Rgb;
use spf_motion::estimator::TelemetryAccuracy;
use spf_oracle::ErrorFile;
use spf_pilot::{Action, Event, Pilot, PilotSettings, Preset};
use spf_record::log::LogReader;
use spf_record::out_dir::OutDir;
use spf_render::Channels;
use spf_vlm::{Answer, Paced, QueryImage, QueryRequest, Vlm};

/// Latency of the answers.
const LATENCY: Duration = Duration::from_secs(3);

/// What a flight's tracks gave, compared with what is to be seen of the target.
#[derive(Default)]
struct Tracks {
    world: Arc<OnceLock<SimWorld>>,
    compare: bool,
    /// Of each start, how far the craft has turned since its frame, radians.
    turned: Vec<f64>,
    /// The object in the box of the last start.
    target: u16,
    reports: Vec<(Time, TrackReport)>,
    start: Option<TrackStart>,
    waiting: bool,
    /// The first report after each start: its quality, the overlap of its box with what is to be seen in its frame, and that of
    /// the box of the start.
    first: Vec<(TrackQuality, f64, f64)>,
}

impl Tracks {
    /// The ids seen in a frame, 480 pixels wide, and the size.
    fn ids(&self, frame: FrameId) -> (Vec<u16>, usize, usize) {
        let world = self.world.get().unwrap();
        let camera = world.camera().resized(480, 360);
        let image = world.loaded().render(&camera, &world.capture(frame).unwrap(), Channels { ids: true, ..Channels::default() });
        (image.ids.unwrap(), 480, 360)
    }

    /// The box of the target in a frame.
    fn truth(&self, frame: FrameId) -> Option<ImageBox> {
        let (ids, width, height) = self.ids(frame);
        let places = ids.iter().enumerate().filter(|(_, id)| **id == self.target).map(|(at, _)| (at % width, at / width));
        let (left, right) = (places.clone().map(|(x, _)| x).min()?, places.clone().map(|(x, _)| x).max()?);
        let (top, bottom) = (places.clone().map(|(_, y)| y).min()?, places.map(|(_, y)| y).max()?);
        let part = |at: usize, of: usize| at as f64 / of as f64;
        Some(ImageBox {
            left: part(left, width),
            top: part(top, height),
            right: part(right + 1, width),
            bottom: part(bottom + 1, height),
        })
    }

    /// The object that fills most of a box.
    fn most(&self, start: &TrackStart) -> u16 {
        let (ids, width, height) = self.ids(start.frame);
        let mut pixels = std::collections::BTreeMap::<u16, usize>::new();
        for (at, id) in ids.iter().enumerate() {
            let (x, y) = ((at % width) as f64 / width as f64, (at / width) as f64 / height as f64);
            let inside = (start.area.left..start.area.right).contains(&x) && (start.area.top..start.area.bottom).contains(&y);
            *pixels.entry(*id).or_default() += usize::from(inside && *id != 0);
        }
        pixels.into_iter().max_by_key(|(_, count)| *count).unwrap().0
    }
}

impl Observer for Tracks {
    fn event(&mut self, now: Time, event: &Event) {
        let Event::Track(report) = event else { return };
        self.reports.push((now, *report));
        if self.compare && core::mem::take(&mut self.waiting) {
            let truth = self.truth(report.frame).unwrap();
            let start = self.start.unwrap();
            self.first.push((report.quality, truth.iou(&report.area), truth.iou(&start.area)));
        }
    }

    fn action(&mut self, _: Time, action: &Action, _: &Pilot) {
        let Action::Track(start) = action else { return };
        let world = self.world.get().unwrap();
        let before = world.capture(start.frame).unwrap().pose.attitude.heading;
        self.turned.push(spf_core::geometry::wrap_angle(world.truth().pose.attitude.heading - before).abs());
        self.waiting = true;
        self.start = Some(*start);
        if self.compare {
            self.target = self.most(start);
        }
    }
}

/// A flight of at most 22 s, whose answers are 3 s late.
fn flown(tracks: &mut Tracks, track: bool, seconds: u64, folder: Option<&Path>) {
    let loaded = Arc::new(LoadedScene::load("city").unwrap());
    let mut start = loaded.scene.start;
    // The target is far to the right at first.
    start.attitude.heading -= 0.65;
    let site = Simulated { kind: CraftKind::Quad, seed: 3, start: Some(start), ..Simulated::new(loaded, "city") };
    let (world, oracle) =
        (tracks.world.clone(), oracle_factory("oracle:perfect".to_owned(), ErrorFile::named("perfect").unwrap()));
    let vlm_factory: VlmFactory = Arc::new(move |of, seed| {
        world.set(of.unwrap().clone()).ok();
        Ok(Box::new(Paced::new(oracle(of, seed)?, Some(LATENCY), false)))
    });
    let plan = FlightPlan {
        settings: PilotSettings { max_time: Duration::from_secs(seconds), track, ..PilotSettings::preset(Preset::Default) },
        record: folder.map(|folder| RecordPlan { out: OutDir::at(folder).unwrap(), video: false, view: None }),
        ..FlightPlan::new(Site::Simulated(site), "follow the black car", "oracle:perfect", vlm_factory)
    };
    let flown = fly(plan, &mut [tracks]).unwrap();
    assert_eq!(flown.summary.settings.track, track);
    assert!(flown.recording_problems.is_empty(), "{:?}", flown.recording_problems);
}

#[test]
fn a_box_that_is_three_seconds_old_is_on_the_target_though_the_craft_has_turned() {
    let mut tracks = Tracks { compare: true, ..Tracks::default() };
    flown(&mut tracks, true, 22, None);
    let most = tracks.turned.iter().copied().fold(0.0, f64::max).to_degrees();
    assert!(most > 15.0, "{most}°");
    assert!(tracks.first.len() >= 4, "{:?}", tracks.first);
    let on = |(quality, overlap, _): &(TrackQuality, f64, f64)| *quality == TrackQuality::Good && *overlap > 0.7;
    // While the craft turns fast, a track may coast at first.
    assert!(tracks.first.iter().filter(|first| on(first)).count() >= 4, "{:?}", tracks.first);
    // The box of the reply itself shows something else by then.
    assert!(tracks.first.iter().any(|(.., of_reply)| *of_reply == 0.0), "{:?}", tracks.first);
    // Ten reports a second once a track has begun, each after its frame and its computing time.
    let gaps = tracks.reports.windows(2).filter(|pair| pair[1].1.captured - Duration::from_millis(100) == pair[0].1.captured);
    assert!(gaps.count() > 80, "{}", tracks.reports.len());
    assert!(tracks.reports.iter().all(|(at, report)| at.since(report.captured) >= Duration::from_millis(160)));
}

#[test]
#[ignore = "takes long: .ci/interop runs it"]
fn a_tracked_flight_is_the_same_again_and_replays_without_pixels() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path().join("flight");
    let (mut once, mut again) = (Tracks::default(), Tracks::default());
    flown(&mut once, true, 12, Some(&folder));
    flown(&mut again, true, 12, None);
    assert!(once.reports.len() > 40 && once.reports == again.reports);

    let log = folder.join("flight.mcap");
    let replayed = replay(LogReader::open(&log).unwrap(), &Changes::default()).unwrap();
    assert_eq!(replayed.differences, []);
    let logged = LogReader::open(&log).unwrap().map(Result::unwrap).filter(|entry| entry.topic == "/track");
    let logged: Vec<TrackReport> = logged.map(|entry| row(&entry).unwrap()).collect();
    assert_eq!(logged, once.reports.iter().map(|(_, report)| *report).collect::<Vec<_>>());

    let mut without = Tracks::default();
    flown(&mut without, false, 12, None);
    assert!(without.reports.is_empty() && without.turned.is_empty());
}

/// A camera in a stand that pans over a pattern by 4 pixels an image, 20 images a second.
struct Stand {
    frames: FrameStore,
    number: u64,
    waiting: VecDeque<(Time, DroneEvent)>,
}

const SIZE: (u32, u32) = (320, 240);

fn captured(number: u64) -> Time {
    Time::from_millis(50 * number)
}

fn image(number: u64) -> Rgb {
    let mut image = Rgb::filled(SIZE.0, SIZE.1, [0; 3]);
    for (x, y) in (0..SIZE.1).flat_map(|y| (0..SIZE.0).map(move |x| (x, y))) {
        let (column, row) = ((u64::from(x) + 4 * number) / 5, u64::from(y) / 5);
        let grain = (column.wrapping_mul(0x9e37_79b9) ^ row.wrapping_mul(0x85eb_ca6b)).wrapping_mul(0xc2b2_ae35);
        image.set_pixel(x, y, [(grain >> 13 & 0xff) as u8; 3]);
    }
    image
}

/// The box of one part of the pattern.
fn area(number: u64) -> ImageBox {
    let left = (240.0 - 4.0 * number as f64) / 320.0;
    ImageBox { left, top: 0.4, right: left + 0.15, bottom: 0.6 }
}

impl Drone for Stand {
    fn name(&self) -> &str {
        "stand"
    }

    fn capabilities(&self) -> Capabilities {
        let camera = Camera::from_fov(SIZE.0, SIZE.1, 1.2, 0.9, 0.0);
        Capabilities::of(Craft::quad(), camera, TelemetryAccuracy::EXACT)
    }

    fn frames(&self) -> Arc<dyn Frames> {
        Arc::new(self.frames.clone())
    }

    fn apply(&mut self, _: Time, _: &Cleared<Command>) -> Result<(), DroneError> {
        Ok(())
    }

    fn next_event(&mut self, until: Time) -> Option<(Time, DroneEvent)> {
        while captured(self.number) <= until {
            let at = captured(self.number);
            self.frames.receive(at, at, image(self.number));
            self.waiting.extend(self.frames.take_new_frame().map(|meta| (at, DroneEvent::Frame(meta))));
            self.number += 1;
        }
        self.waiting.pop_front()
    }

    fn next_event_at(&self) -> Option<Time> {
        Some(captured(self.number))
    }
}

/// Nobody asks it.
struct Silent;

impl Vlm for Silent {
    fn name(&self) -> &str {
        "silent"
    }

    fn answer(&mut self, _: &QueryRequest<'_>, _: &mut dyn QueryImage) -> Answer {
        panic!("not asked")
    }
}

/// The next report within this time.
fn report(world: &mut Live, patience: Duration) -> Option<TrackReport> {
    let deadline = world.now() + patience;
    while world.now() < deadline {
        if let Some(Event::Track(report)) = world.wait(deadline) {
            return Some(report);
        }
    }
    None
}

fn newest(world: &mut Live, after: Duration) -> FrameMeta {
    let (deadline, mut newest) = (world.now() + after, None);
    while world.now() < deadline {
        if let Some(Event::Frame(meta)) = world.wait(deadline) {
            newest = Some(meta);
        }
    }
    newest.unwrap()
}

#[test]
#[ignore = "runs in real time: .ci/interop runs it"]
fn on_the_wall_clock_reports_come_from_a_thread_of_their_own() {
    let stand = Stand { frames: FrameStore::default(), number: 0, waiting: VecDeque::new() };
    let drone = Box::new(stand);
    let mut world = Live::new(Instant::now(), drone, Box::new(Silent), Script::default(), Arc::default(), true).unwrap();
    newest(&mut world, Duration::from_millis(900));
    // A frame that was captured half a second ago; it is one of those in which the tracker looks.
    let frame = FrameId(8);
    world.apply(&Action::Track(TrackStart { id: QueryId(3), frame, area: area(frame.0) }));
    let mut last = None;
    for _ in 0..4 {
        let report = report(&mut world, Duration::from_secs(60)).unwrap();
        assert_eq!((report.id, report.quality), (QueryId(3), TrackQuality::Good));
        assert!(last.replace(report.frame).is_none_or(|last| last < report.frame) && report.frame > frame);
        let overlap = report.area.iou(&area(report.frame.0));
        assert!(overlap > 0.7, "{overlap}: {report:?}");
    }
    // No further reports without a track, but for one that was under way.
    world.apply(&Action::Untrack);
    report(&mut world, Duration::from_secs(1));
    assert_eq!(report(&mut world, Duration::from_secs(1)), None);
    // The thread ends with the world, even in the middle of a track.
    world.apply(&Action::Track(TrackStart { id: QueryId(4), frame: FrameId(16), area: area(16) }));
    drop(world);
}

/// While a page was waited for, say. By the first of these states, which is too old, no craft would take off.
#[test]
fn of_what_a_craft_reported_before_the_flight_only_the_newest_state_counts() {
    let loaded = Arc::new(LoadedScene::load("city").unwrap());
    let craft = Simulated::new(loaded, "city").craft().unwrap();
    let before = Duration::from_secs(60);
    let start = Instant::now().checked_sub(before).unwrap();
    let mut world = Live::new(start, craft, Box::new(Silent), Script::default(), Arc::default(), false).unwrap();
    let first = loop {
        if let Some(Event::Telemetry(telemetry)) = world.wait(Time::ZERO + Duration::from_secs(120)) {
            break telemetry.time;
        }
    };
    assert!(world.now().since(first) < before / 2, "{first:?} at {:?}", world.now());
}
