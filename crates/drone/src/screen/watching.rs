//! The thread that looks: frames, the turn between them, and the reports of the reckoned motion.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

use spf_core::camera::Camera;
use spf_core::command::Setpoint;
use spf_core::frame::Unusable;
use spf_core::query::ImagePoint;
use spf_core::time::{Duration, Time, duration_from_secs};
use spf_media::points::Points;
use spf_media::track::TrackImage;
use spf_media::{Rgb, Scaler};
use spf_screen::area::Region;
use spf_screen::picture::Pictures;
use spf_screen::profile::Profile;
use spf_screen::{Eye, Hidden, ScreenError};

use super::control::{Bar, Part};
use super::motion::deflection;
use super::reckoning::Reckoning;
use super::shared::{Done, Shared};
use super::stillness::Stillness;
use super::turning::turn;
use crate::DroneEvent;
use crate::frames::FrameStore;

/// Time between two pictures.
const PERIOD: Duration = Duration::from_millis(50);
/// Width of the pictures in which points are followed, pixels.
const FLOW_WIDTH: u32 = 480;
/// Points this near to an instrument may belong to it, as a fraction of the picture.
const MARGIN: f64 = 0.02;
/// A greater turn from picture to picture cannot be followed, radians.
const GREATEST_TURN: f64 = 0.35;

/// Looks at the window.
pub(super) struct Watcher {
    eye: Eye,
    pictures: Pictures,
    profile: Profile,
    frames: FrameStore,
    stillness: Stillness,
    flow: Flow,
    reckoning: Reckoning,
    last: Option<Rgb>,
    size: (u32, u32),
    hidden: Option<Hidden>,
}

impl Watcher {
    pub(super) fn new(now: Time, eye: Eye, profile: &Profile, size: (u32, u32), frames: FrameStore) -> Self {
        Self {
            eye,
            pictures: Pictures::new(&profile.camera.masks),
            profile: profile.clone(),
            frames,
            stillness: Stillness::default(),
            flow: Flow::new(profile.camera.masks.clone()),
            reckoning: Reckoning::new(now, profile.controls.dead_time_s, profile.controls.lag_s),
            last: None,
            size,
            hidden: None,
        }
    }

    /// Looks until the craft is dropped.
    pub(super) fn run(mut self, shared: &Arc<Shared>) {
        let mut next = Instant::now();
        while !shared.stopped.load(Ordering::Relaxed) {
            let looked = self.look(shared);
            let is_news = shared.control().set_broken(shared.now(), Part::Picture, looked.is_err());
            if let Err(error) = looked {
                if is_news {
                    tracing::error!("the window can no longer be captured: {error}");
                }
                std::thread::sleep(Duration::from_millis(500));
            }
            next = (next + PERIOD).max(Instant::now());
            std::thread::sleep(next.saturating_duration_since(Instant::now()));
        }
    }

    fn look(&mut self, shared: &Shared) -> Result<(), ScreenError> {
        let latency = duration_from_secs(self.profile.camera.latency_s);
        let seen = self.eye.look()?;
        let received = shared.now();
        match seen {
            Ok(shown) => {
                if self.hidden.take().is_some() {
                    tracing::info!("the window can be seen again");
                }
                let taken = shared.time_of(shown.at);
                let captured = taken - latency;
                let image = self.pictures.finish(shown.image);
                self.reckon(shared, captured);
                let frozen = self.picture(captured, &image);
                let mut control = shared.control();
                control.bar(Bar::Hidden, false);
                control.bar(Bar::Frozen, frozen);
                drop(control);
                let unusable = if frozen {
                    Some(Unusable::Frozen)
                } else {
                    ((image.width(), image.height()) != self.size).then_some(Unusable::Resized)
                };
                self.frames.receive_live(captured, received, image.clone(), unusable);
                self.last = Some(image);
            }
            Err(hidden) => {
                shared.control().bar(Bar::Hidden, true);
                if self.hidden.as_ref() != Some(&hidden) {
                    tracing::warn!("nothing can be seen: {hidden}");
                    self.hidden = Some(hidden);
                }
                self.reckon(shared, received - latency);
                self.flow.forget();
                if let Some(last) = &self.last {
                    self.frames.receive_live(received - latency, received, last.clone(), Some(Unusable::Hidden));
                }
            }
        }
        let phase = shared.control().phase();
        let telemetry = self.reckoning.telemetry(phase);
        shared.report(received, DroneEvent::Telemetry(telemetry));
        Ok(())
    }

    fn reckon(&mut self, shared: &Shared, to: Time) {
        for (at, done) in shared.take_commands() {
            match done {
                Done::Motion(setpoint) => self.reckoning.command(at, setpoint),
                Done::TookOff(height) => self.reckoning.stand_at(height),
            }
        }
        self.reckoning.advance(to);
    }

    /// Takes a picture into account; whether it has stopped to answer.
    fn picture(&mut self, captured: Time, image: &Rgb) -> bool {
        let pushed = deflection(&self.profile.controls, self.reckoning.pushed(captured));
        let frozen = self.stillness.is_frozen(captured, image, pushed);
        let size = (image.width(), image.height());
        if size == self.size {
            let camera = self.profile.optics(size);
            let commanded = self.reckoning.commanded_heading();
            if let Some(more) = self.flow.next(image, &camera, self.reckoning.motion(), commanded) {
                self.reckoning.correct_heading(more);
            }
        } else {
            self.flow.forget();
        }
        frozen
    }
}

/// Points followed from picture to picture.
pub(super) struct Flow {
    points: Points,
    scaler: Scaler,
    masks: Vec<Region>,
    before: BTreeMap<u32, ImagePoint>,
    commanded: f64,
}

impl Flow {
    pub(super) fn new(masks: Vec<Region>) -> Self {
        Self { points: Points::default(), scaler: Scaler::default(), masks, before: BTreeMap::new(), commanded: 0.0 }
    }

    /// Begins anew with the next picture.
    pub(super) fn forget(&mut self) {
        self.points = Points::default();
        self.before.clear();
    }

    /// The turn since the last picture in excess of what was commanded, radians; `None` if the picture does not tell. `commanded` is the
    /// sum of all commanded turns.
    pub(super) fn next(&mut self, image: &Rgb, camera: &Camera, motion: Setpoint, commanded: f64) -> Option<f64> {
        let asked = commanded - std::mem::replace(&mut self.commanded, commanded);
        let pairs = self.pairs(image, camera, asked);
        let turned = turn(camera, &pairs, motion, Some(asked))?;
        (turned.angle.abs() < GREATEST_TURN).then_some(turned.angle - asked)
    }

    /// Points with their places in the last picture and in this one.
    fn pairs(&mut self, image: &Rgb, camera: &Camera, asked: f64) -> Vec<(ImagePoint, ImagePoint)> {
        let (width, height) = (FLOW_WIDTH, (FLOW_WIDTH * image.height() / image.width().max(1)).max(16));
        let small = self.scaler.scale(image, width, height);
        let grey: Vec<u8> = small.data().as_chunks::<3>().0.iter().map(|pixel| grey(*pixel)).collect();
        self.scaler.reuse(small);
        let Ok(image) = TrackImage::from_grey(width, height, grey) else { return Vec::new() };
        // Near the middle a turn shifts all points alike.
        let shift = -asked * camera.fx * f64::from(width) / f64::from(camera.width.max(1));
        let shift = spf_media::track::Shift { x: shift, y: 0.0 };
        let found = self.points.next(&image, |_| Some(shift));
        let (w, h) = (f64::from(width), f64::from(height));
        let place = |x: f64, y: f64| ImagePoint { u: (x + 0.5) / w, v: (y + 0.5) / h };
        let free = |at: &ImagePoint| !self.masks.iter().any(|mask| mask.is_near(at.u, at.v, MARGIN));
        let now: BTreeMap<u32, ImagePoint> =
            found.iter().map(|point| (point.id, place(point.x, point.y))).filter(|(_, at)| free(at)).collect();
        let pairs = now.iter().filter_map(|(id, to)| Some((*self.before.get(id)?, *to))).collect();
        self.before = now;
        pairs
    }
}

/// BT.709 luma.
fn grey([red, green, blue]: [u8; 3]) -> u8 {
    ((54 * u32::from(red) + 183 * u32::from(green) + 19 * u32::from(blue)) >> 8) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a camera that has turned by an angle sees of a wall all around, with blocks of colour. An instrument at the lower edge stays.
    fn picture(camera: &Camera, turned: f64) -> Rgb {
        let mut image = Rgb::new(960, 720);
        for y in 0..720_u32 {
            for x in 0..960_u32 {
                let ray = camera.ray(ImagePoint { u: (f64::from(x) + 0.5) / 960.0, v: (f64::from(y) + 0.5) / 720.0 });
                let (around, up) = (ray.right.atan() + turned, ray.up / ray.right.hypot(1.0));
                let (column, row) = ((around * 22.0 + 200.0) as u32, (up * 22.0 + 200.0) as u32);
                let level = (column.wrapping_mul(2_654_435_761) ^ row.wrapping_mul(40_503).wrapping_mul(column + 7)) >> 5;
                let instrument = y > 560 && (x / 12 + y / 12) % 2 == 0;
                image.set_pixel(x, y, if instrument { [255; 3] } else { [(level % 200) as u8; 3] });
            }
        }
        image
    }

    #[test]
    fn a_turn_is_seen_in_the_pictures_and_instruments_do_not_count() {
        let camera = Profile::shipped("luanti").unwrap().optics((960, 720));
        let mut flow = Flow::new(vec![Region([0.0, 0.75, 1.0, 0.25])]);
        assert_eq!(flow.next(&picture(&camera, 0.0), &camera, Setpoint::HOLD, 0.0), None);
        // None was commanded.
        let turned = flow.next(&picture(&camera, 0.02), &camera, Setpoint::HOLD, 0.0).unwrap();
        assert!((turned - 0.02).abs() < 0.002, "{turned}");
        // What was commanded leaves nothing to be corrected.
        let rest = flow.next(&picture(&camera, 0.04), &camera, Setpoint::HOLD, 0.02).unwrap();
        assert!(rest.abs() < 0.002, "{rest}");
        flow.forget();
        assert_eq!(flow.next(&picture(&camera, 0.06), &camera, Setpoint::HOLD, 0.02), None);
    }
}
