//! Draws and encodes pictures in a thread of its own: of what is live only the newest, of decisions each one.

use std::collections::VecDeque;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use bytes::Bytes;
use serde_json::json;
use spf_core::frame::FrameMeta;
use spf_core::pilot::Decision;
use spf_core::query::Query;
use spf_core::time::Time;
use spf_drone::frames::Photo;
use spf_flight::words;
use spf_media::{Jpeg, Scaler, marks};

use crate::hub::{Entry, Hub, Kept};
use crate::overlay::Overlay;
use crate::watching::framed;

/// Maximum number of waiting jobs besides the newest picture.
const JOBS: usize = 64;
/// JPEG qualities of live pictures and of those kept with decisions.
const QUALITY: u8 = 72;
const KEPT_QUALITY: u8 = 70;
/// Width of live pictures, pixels, as long as drawing one is fast enough, and else.
const WIDTHS: [u32; 3] = [960, 640, 480];
/// A picture should take no longer than this.
const PACE: Duration = Duration::from_millis(45);
/// Minimum interval between live pictures.
const INTERVAL: Duration = Duration::from_millis(33);
/// Width of pictures kept with decisions, pixels.
const KEPT_WIDTH: u32 = 640;

/// A picture to be shown live.
pub(crate) struct LivePicture {
    pub(crate) meta: FrameMeta,
    pub(crate) photo: Photo,
    pub(crate) overlay: Overlay,
    /// Flight time, and the instant that it was.
    pub(crate) now: Time,
    pub(crate) at: Instant,
}

/// Other work.
pub(crate) enum Job {
    /// A frame was sent to a VLM.
    Asked(Box<Query>, Photo),
    /// A decision was made.
    Decided(Box<Decision>),
}

#[derive(Default)]
struct Inbox {
    picture: Option<LivePicture>,
    jobs: VecDeque<Job>,
    stop: bool,
}

/// The worker's inbox.
pub(crate) struct Worker {
    inbox: Mutex<Inbox>,
    filled: Condvar,
    hub: Arc<Hub>,
}

impl Worker {
    /// Starts the thread, which ends by [`Worker::stop`].
    pub(crate) fn start(hub: Arc<Hub>) -> std::io::Result<Arc<Self>> {
        let worker = Arc::new(Self { inbox: Mutex::default(), filled: Condvar::new(), hub });
        let inside = worker.clone();
        std::thread::Builder::new().name("cockpit pictures".to_owned()).spawn(move || inside.run())?;
        Ok(worker)
    }

    fn inbox(&self) -> MutexGuard<'_, Inbox> {
        // Consistent between calls.
        self.inbox.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Ends the thread.
    pub(crate) fn stop(&self) {
        self.inbox().stop = true;
        self.filled.notify_all();
    }

    /// Whether somebody looks at live pictures.
    pub(crate) fn is_watched(&self) -> bool {
        self.hub.viewers.load(Ordering::Relaxed) > 0
    }

    /// Shows a picture, instead of one that waits.
    pub(crate) fn show(&self, picture: LivePicture) {
        self.inbox().picture = Some(picture);
        self.filled.notify_one();
    }

    /// Does a job when there is time; if too many wait, the oldest is left out.
    pub(crate) fn give(&self, job: Job) {
        let mut inbox = self.inbox();
        if inbox.jobs.len() >= JOBS {
            inbox.jobs.pop_front();
        }
        inbox.jobs.push_back(job);
        drop(inbox);
        self.filled.notify_one();
    }

    fn run(&self) {
        let (mut scaler, mut pace) = (Scaler::default(), Pace::default());
        loop {
            let mut inbox = self.inbox();
            while inbox.picture.is_none() && inbox.jobs.is_empty() && !inbox.stop {
                inbox = self.filled.wait(inbox).unwrap_or_else(PoisonError::into_inner);
            }
            if inbox.stop {
                return;
            }
            let (picture, job) = (inbox.picture.take(), inbox.jobs.pop_front());
            drop(inbox);
            if let Some(picture) = picture {
                self.draw(&picture, &mut scaler, &mut pace);
            }
            match job {
                Some(Job::Asked(query, photo)) => self.asked(&query, &photo, &mut scaler),
                Some(Job::Decided(decision)) => self.decided(&decision),
                None => {}
            }
        }
    }

    fn draw(&self, picture: &LivePicture, scaler: &mut Scaler, pace: &mut Pace) {
        let began = Instant::now();
        if began < pace.not_before {
            return;
        }
        let size = sized(&picture.photo, pace.width());
        let image = picture.photo.at(size, scaler);
        let encoded = Jpeg::encode(&image, QUALITY);
        scaler.reuse(image);
        let Ok(jpeg) = encoded else { return };
        pace.took(began.elapsed());
        pace.not_before = began + INTERVAL;
        let LivePicture { meta, overlay, now, at, .. } = picture;
        let age = now.since(meta.captured).as_secs_f64() + at.elapsed().as_secs_f64();
        let head = json!({
            "frame": meta.id.0, "captured": meta.captured.as_secs_f64(), "age": age,
            "received": now.since(meta.received).as_secs_f64() + at.elapsed().as_secs_f64(), "overlay": overlay,
        });
        self.hub.picture.send_replace(Some(framed(&head.to_string(), jpeg.bytes())));
    }

    /// Keeps the picture that a query was about, with its marks.
    fn asked(&self, query: &Query, photo: &Photo, scaler: &mut Scaler) {
        let mut image = photo.at(sized(photo, KEPT_WIDTH), scaler);
        marks::draw(&mut image, &query.marks);
        if let Ok(jpeg) = Jpeg::encode(&image, KEPT_QUALITY) {
            let picture = Some(Bytes::copy_from_slice(jpeg.bytes()));
            self.hub.keep(query.id.0, Entry { detail: None, picture });
        }
        scaler.reuse(image);
    }

    fn decided(&self, decision: &Decision) {
        let (query, reading) = (decision.query.id.0, &decision.reading);
        let point = reading.waypoint.or(reading.reply.as_ref().and_then(|reply| reply.point));
        let row = json!({
            "type": "decision", "n": decision.number, "query": query, "t": decision.answered.as_secs_f64(),
            "text": words::decision(decision), "step": decision.step, "latency": decision.latency_s,
            "age": decision.frame_age_s, "point": point.map(|at| [at.u, at.v]),
            "at": [decision.pose.position.east, decision.pose.position.north],
            "goal": decision.goal.map(|goal| [goal.position.east, goal.position.north]),
            "refused": reading.refused.is_some(),
        });
        let detail = json!({
            "instruction": decision.query.instruction, "prompt": decision.query.prompt, "reply": decision.reply,
            "reading": reading,
        });
        self.hub.keep(query, Entry { detail: Some(detail.to_string().into()), picture: None });
        self.hub.tell(Kept::Row, &row);
    }
}

/// The size of a picture of this width at most, in the photo's shape.
fn sized(photo: &Photo, width: u32) -> (u32, u32) {
    let (full, high) = photo.size();
    if full <= width { (full, high) } else { (width, (high * width).div_ceil(full.max(1)).max(1)) }
}

/// Chooses the size of live pictures by the time that they take.
struct Pace {
    width: usize,
    average: Duration,
    not_before: Instant,
}

impl Default for Pace {
    fn default() -> Self {
        Self { width: 0, average: Duration::ZERO, not_before: Instant::now() }
    }
}

impl Pace {
    fn width(&self) -> u32 {
        WIDTHS[self.width]
    }

    fn took(&mut self, time: Duration) {
        self.average = if self.average.is_zero() { time } else { (self.average * 7 + time) / 8 };
        if self.average > PACE && self.width + 1 < WIDTHS.len() {
            (self.width, self.average) = (self.width + 1, Duration::ZERO);
        } else if self.average < PACE / 4 && self.width > 0 {
            (self.width, self.average) = (self.width - 1, Duration::ZERO);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slow_pictures_become_smaller_and_fast_ones_larger() {
        let mut pace = Pace::default();
        (0..30).for_each(|_| pace.took(Duration::from_millis(80)));
        assert_eq!(pace.width(), 480);
        (0..30).for_each(|_| pace.took(Duration::from_millis(20)));
        assert_eq!(pace.width(), 480, "it does not swing");
        (0..30).for_each(|_| pace.took(Duration::from_millis(5)));
        assert_eq!(pace.width(), 960);
    }
}
