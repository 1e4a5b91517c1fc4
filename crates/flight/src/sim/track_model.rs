//! A stand-in for the tracker, without pixels: for sweeps, in which rendering every frame takes too long.
//!
//! The target is the object with most pixels inside the start's box, in a small image of object ids. In each later frame the box
//! of its pixels is reported, with errors. A target without any pixel is hidden: the box is kept for a while, then lost, and found
//! again some frames after it has come back. Besides, a track is lost for good with a constant hazard.
//!
//! The constants are estimates: the hazard is that with which the tracker loses a quarter to a third of its targets in 8 s in
//! rendered flights (`docs/guide/track.md`), the errors give overlaps with the visible part of about 0.9.

use std::collections::{BTreeMap, VecDeque};

use spf_core::frame::{FrameId, FrameMeta};
use spf_core::query::ImageBox;
use spf_core::rng::RandomStream;
use spf_core::telemetry::Telemetry;
use spf_core::time::Time;
use spf_core::track::{TrackQuality, TrackReport, TrackStart};
use spf_drone::frames::Frames;
use spf_render::RenderedImage;

use super::loaded_scene::WorldSnapshot;
use super::world::SimWorld;
use crate::tracking::{ASKED, Follow, INTERVAL, KEPT, Progress};

/// Width of the id images, pixels.
const WIDTH: u32 = 240;
/// Probability per second that a visible target is lost for good.
const LOSS_PER_S: f64 = 0.045;
/// Error of each edge that stays the same for a track, standard deviation as a fraction of the box's side.
const BIAS: f64 = 0.02;
/// Error of each edge in each frame, in the same unit.
const NOISE: f64 = 0.01;
/// Frames without the target until it counts as lost.
const COAST: u32 = 5;
/// Frames in which a target that was lost must be visible again until it is found.
const FIND: u32 = 3;
/// The smallest side of a box that can be tracked, as a fraction of the image's width: 12 of 480 pixels.
const SMALLEST: f64 = 12.0 / 480.0;

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
    area: ImageBox,
    /// Distance of the target in the frame of the start, metres.
    first_range: f64,
    scale: f64,
    /// Error of each edge, as a fraction of the side.
    bias: [f64; 4],
    /// Frames since the target was last visible, and since it is visible again.
    missing: u32,
    back: u32,
    lost: bool,
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
            if let Some((target, _)) = most {
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
        if task.lost || task.target.is_none() || task.missing > COAST {
            TrackQuality::Lost
        } else if task.over || side(&task.area) < SMALLEST {
            TrackQuality::TooSmall
        } else if task.missing > 0 {
            TrackQuality::Coasting
        } else {
            TrackQuality::Good
        }
    }

    /// Follows the target into a frame.
    fn advance(&mut self, task: &mut Task, index: usize) {
        let meta = self.frames[index].0;
        let seen = self.seen(index);
        let key = [task.start.id.0, meta.id.0];
        let passed = meta.captured.since(task.at).as_secs_f64();
        (task.at, task.frame) = (meta.captured, meta.id);
        let Some(area) = task.target.and_then(|target| seen.get(&target)) else {
            task.missing += 1;
            task.back = 0;
            return;
        };
        task.back += 1;
        if task.missing > COAST && task.back < FIND {
            return;
        }
        task.missing = 0;
        let mut noise = RandomStream::new(self.seed, "track error", &key);
        let [left, top, right, bottom] = task.bias.map(|bias| bias + NOISE * noise.normal());
        let (width, height) = (area.right - area.left, area.bottom - area.top);
        task.area = ImageBox {
            left: area.left + left * width,
            top: area.top + top * height,
            right: area.right + right * width,
            bottom: area.bottom + bottom * height,
        };
        // From the distances: the edge of the image cuts off the mask, but not the points that a tracker follows.
        let range = task.target.zip(self.world.capture(meta.id)).and_then(|(target, snapshot)| self.range(target, &snapshot));
        if let Some(range) = range {
            task.scale = task.first_range / range * (1.0 + right - left);
        }
        task.lost |= RandomStream::new(self.seed, "track loss", &key).chance(LOSS_PER_S * passed);
    }
}

/// The shorter side, as a fraction of the image's width, for images of 4:3.
fn side(area: &ImageBox) -> f64 {
    (area.right - area.left).min(0.75 * (area.bottom - area.top))
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
        let mut bias = RandomStream::new(self.seed, "track bias", &[start.id.0]);
        let newest = self.frames.back().map_or((Time::ZERO, start.frame), |(meta, _)| (meta.captured, meta.id));
        self.task = Some(Task {
            start,
            target: None,
            begun: false,
            over: false,
            at: newest.0,
            frame: newest.1,
            area: start.area,
            first_range: 1.0,
            scale: 1.0,
            bias: [(); 4].map(|()| BIAS * bias.normal()),
            missing: 0,
            back: 0,
            lost: false,
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
        task.over |= task.lost || quality == TrackQuality::TooSmall;
        let behind = !over && !task.over && self.frames.back().is_some_and(|(newest, _)| newest.captured > task.at);
        let report =
            TrackReport { id: task.start.id, frame: task.frame, captured: task.at, area: task.area, scale: task.scale, quality };
        self.task = Some(task);
        if behind { Progress::Behind } else { Progress::Report(report) }
    }
}
