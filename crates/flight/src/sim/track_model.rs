//! A stand-in for the tracker, without pixels: for sweeps, in which rendering every frame takes too long.
//!
//! The target is the object with most pixels inside the start's box, in a small image of object ids. In each later frame the box
//! of its pixels is reported, with the errors of `track_errors`.

use std::collections::{BTreeMap, VecDeque};

use spf_core::frame::{FrameId, FrameMeta};
use spf_core::query::ImageBox;
use spf_core::telemetry::Telemetry;
use spf_core::time::Time;
use spf_core::track::{TrackQuality, TrackReport, TrackStart};
use spf_drone::frames::Frames;
use spf_render::RenderedImage;

use super::loaded_scene::WorldSnapshot;
use super::track_errors::{TargetSeen, TrackErrors};
use super::world::SimWorld;
use crate::tracking::{ASKED, Follow, INTERVAL, KEPT, Progress};

/// Width of the id images, pixels.
const WIDTH: u32 = 240;
/// Added to the distance from the target's surface, which is what its size in the image depends on, metres: half of its depth.
const HALF_DEPTH: f64 = 0.3;

/// The boxes of the objects in a frame.
type Seen = BTreeMap<u16, ImageBox>;

/// A tracker that knows which pixels belong to which object.
pub(crate) struct TrackModel {
    world: SimWorld,
    seed: u64,
    /// Frames that are tracked in, oldest first, and what was seen in those that were rendered.
    frames: VecDeque<(FrameMeta, Option<Seen>)>,
    asked: VecDeque<(FrameId, WorldSnapshot)>,
    image: RenderedImage,
    task: Option<Task>,
}

struct Task {
    start: TrackStart,
    target: Option<u16>,
    begun: bool,
    over: bool,
    at: Time,
    frame: FrameId,
    errors: TrackErrors,
    /// Distance of the target in the frame of the start, metres.
    first_range: f64,
}

impl TrackModel {
    /// A tracker of this world's objects, whose errors follow from the seed.
    pub(crate) fn new(world: SimWorld, seed: u64) -> Self {
        let (frames, asked) = (VecDeque::new(), VecDeque::new());
        Self { world, seed, frames, asked, image: RenderedImage::default(), task: None }
    }

    fn render(&mut self, snapshot: &WorldSnapshot) {
        let camera = self.world.camera();
        let height = (f64::from(WIDTH) * f64::from(camera.height) / f64::from(camera.width)).round();
        self.world.ids_into(snapshot, (WIDTH, height as u32), &mut self.image);
    }

    /// The objects in the image that was rendered last, with boxes and numbers of pixels inside `within`.
    fn boxes(&self, within: &ImageBox) -> BTreeMap<u16, (ImageBox, u32)> {
        let (width, height) = (self.image.width as usize, self.image.height as usize);
        let mut boxes = BTreeMap::new();
        for (at, id) in self.image.ids.iter().flatten().enumerate().filter(|(_, id)| **id != 0) {
            let (x, y) = ((at % width) as f64, (at / width) as f64);
            let (w, h) = (width as f64, height as f64);
            let pixel = ImageBox { left: x / w, top: y / h, right: (x + 1.0) / w, bottom: (y + 1.0) / h };
            let (area, count) = boxes.entry(*id).or_insert((pixel, 0));
            area.left = area.left.min(pixel.left);
            area.top = area.top.min(pixel.top);
            area.right = area.right.max(pixel.right);
            area.bottom = area.bottom.max(pixel.bottom);
            let (u, v) = ((x + 0.5) / w, (y + 0.5) / h);
            let inside = (within.left..=within.right).contains(&u) && (within.top..=within.bottom).contains(&v);
            *count += u32::from(inside);
        }
        boxes
    }

    /// Distance of an object from the camera, metres.
    fn range(&self, target: u16, snapshot: &WorldSnapshot) -> Option<f64> {
        let distance = self.world.loaded().distance_to(target, &snapshot.actors, snapshot.pose.position)?;
        Some(distance + HALF_DEPTH)
    }

    /// What is to be seen in one of the frames.
    fn seen(&mut self, index: usize) -> Seen {
        let (meta, seen) = &self.frames[index];
        if let Some(seen) = seen {
            return seen.clone();
        }
        let Some(snapshot) = self.world.capture(meta.id) else { return Seen::new() };
        self.render(&snapshot);
        let seen: Seen = self.boxes(&ImageBox::default()).into_iter().map(|(id, (area, _))| (id, area)).collect();
        self.frames[index].1 = Some(seen.clone());
        seen
    }

    /// Looks up the start's frame, and the object in its box.
    fn begin(&mut self, mut task: Task) -> (Task, bool) {
        task.begun = true;
        let asked = self.asked.iter().find(|(id, _)| *id == task.start.frame).map(|(_, snapshot)| snapshot.clone());
        if let Some(snapshot) = asked.or_else(|| self.world.capture(task.start.frame)) {
            self.render(&snapshot);
            let boxes = self.boxes(&task.start.area);
            let most = boxes.into_iter().filter(|(_, (_, count))| *count > 0).max_by_key(|(_, (_, count))| *count);
            if let Some((target, (area, _))) = most {
                let object = self.world.loaded().scene.object(target);
                let is_person = object.is_some_and(|object| object.tags.kind == "person");
                task.errors = TrackErrors::new(self.seed, task.start.id.0, area, is_person);
                task.target = Some(target);
                task.first_range = self.range(target, &snapshot).unwrap_or(1.0);
                task.at = spf_sim::frame_clock::FrameClock::default().captured(task.start.frame);
                task.frame = task.start.frame;
            }
        }
        task.over = task.target.is_none();
        let over = task.over;
        (task, over)
    }

    fn quality(task: &Task) -> TrackQuality {
        if task.target.is_none() {
            return TrackQuality::Lost;
        }
        task.errors.quality()
    }

    /// Follows the target into a frame.
    fn advance(&mut self, task: &mut Task, index: usize) {
        let meta = self.frames[index].0;
        let seen = self.seen(index);
        let passed = meta.captured.since(task.at).as_secs_f64();
        (task.at, task.frame) = (meta.captured, meta.id);
        let seen = task.target.and_then(|target| {
            let area = *seen.get(&target)?;
            let range = self.world.capture(meta.id).and_then(|snapshot| self.range(target, &snapshot));
            Some(TargetSeen { area, growth: range.map(|range| task.first_range / range) })
        });
        task.errors.next(meta.id.0, passed, seen);
    }
}

impl Follow for TrackModel {
    fn telemetry(&mut self, _: &Telemetry) {}

    fn frame(&mut self, meta: FrameMeta, _: &dyn Frames) {
        if self.frames.back().is_some_and(|(last, _)| meta.captured.since(last.captured) < INTERVAL) {
            return;
        }
        self.frames.push_back((meta, None));
        while self.frames.front().is_some_and(|(old, _)| meta.captured.since(old.captured) > KEPT) {
            self.frames.pop_front();
        }
    }

    fn asked(&mut self, frame: FrameId, _: &dyn Frames) {
        let Some(snapshot) = self.world.capture(frame) else { return };
        self.asked.push_back((frame, snapshot));
        if self.asked.len() > ASKED {
            self.asked.pop_front();
        }
    }

    fn start(&mut self, start: TrackStart) {
        let newest = self.frames.back().map_or((Time::ZERO, start.frame), |(meta, _)| (meta.captured, meta.id));
        self.task = Some(Task {
            start,
            target: None,
            begun: false,
            over: false,
            at: newest.0,
            frame: newest.1,
            errors: TrackErrors::new(self.seed, start.id.0, start.area, false),
            first_range: 1.0,
        });
    }

    fn stop(&mut self) {
        self.task = None;
    }

    fn step(&mut self) -> Progress {
        let Some(mut task) = self.task.take_if(|task| !task.over) else { return Progress::Idle };
        let mut over = false;
        if task.begun {
            let next = self.frames.partition_point(|(meta, _)| meta.captured <= task.at);
            if next >= self.frames.len() {
                self.task = Some(task);
                return Progress::Idle;
            }
            self.advance(&mut task, next);
        } else {
            (task, over) = self.begin(task);
        }
        let quality = Self::quality(&task);
        task.over |= task.errors.is_lost() || quality == TrackQuality::TooSmall;
        let behind = !over && !task.over && self.frames.back().is_some_and(|(newest, _)| newest.captured > task.at);
        let (area, scale) = (task.errors.area(), task.errors.scale());
        let report = TrackReport { id: task.start.id, frame: task.frame, captured: task.at, area, scale, quality };
        self.task = Some(task);
        if behind { Progress::Behind } else { Progress::Report(report) }
    }
}
