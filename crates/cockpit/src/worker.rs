//! Draws and encodes pictures in a thread of its own: of what is live only the newest, of decisions each one.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use bytes::Bytes;
use serde_json::{Value, json};
use spf_core::frame::{FrameId, FrameMeta};
use spf_core::query::Query;
use spf_core::time::Time;
use spf_drone::frames::Photo;
use spf_flight::words;
use spf_media::{Jpeg, Rgb, Scaler, marks};
use spf_pilot::Decision;

use crate::ahead::{Drawn, Exposed};
use crate::film::{Film, Unit};
use crate::hub::{Entry, Hub, Kept};
use crate::message::Format;
use crate::overlay::{Overlay, Point};
use crate::watching::framed;

/// Pictures that wait for their pixels to be drawn at most, and how long nothing may be shown because of that.
const LATE: usize = 16;
const PATIENCE: Duration = Duration::from_secs(1);
/// Maximum number of waiting jobs besides the newest picture.
const JOBS: usize = 64;
/// JPEG qualities of live pictures and of those kept with decisions.
const QUALITY: u8 = 72;
const KEPT_QUALITY: u8 = 70;
/// Width of live pictures, pixels, as long as drawing one is fast enough, and else.
const WIDTHS: [u32; 3] = [960, 640, 480];
/// A picture should take no longer than this.
const PACE: Duration = Duration::from_millis(45);
/// Below this the next larger size, of 2.25 times as many pixels at most, is fast enough too.
const LARGER_BELOW: Duration = Duration::from_millis(18);
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

impl LivePicture {
    /// An image that has just arrived and belongs to no flight.
    pub(crate) fn alone(number: u64, image: Rgb) -> Self {
        let (now, id) = (Time::ZERO, FrameId(number));
        let (width, height) = (image.width(), image.height());
        let meta = FrameMeta { id, captured: now, received: now, capture_counter: number, width, height, unusable: None };
        Self { meta, photo: Photo::received(Arc::new(image)), overlay: Overlay::default(), now, at: Instant::now() }
    }

    /// What is told with it.
    fn head(&self) -> Value {
        let Self { meta, overlay, now, at, .. } = self;
        let waited = at.elapsed().as_secs_f64();
        json!({
            "frame": meta.id.0, "captured": meta.captured.as_secs_f64(), "age": now.since(meta.captured).as_secs_f64() + waited,
            "received": now.since(meta.received).as_secs_f64() + waited, "overlay": overlay,
        })
    }
}

/// What drawing needs from one picture to the next.
#[derive(Default)]
struct Drawing {
    scaler: Scaler,
    pace: Pace,
    film: Film,
    key_wanted: bool,
    /// Frames that are drawn before they are delivered, and when one was last shown or the first one began.
    ahead: Drawn,
    shown: Option<Instant>,
    /// The flight that these are of.
    flight: u64,
}

impl Drawing {
    /// The picture to show now: the newest one, or, if frames are drawn ahead, the newest one that is drawn.
    fn choose(&mut self, inbox: &mut Inbox) -> Option<LivePicture> {
        if self.flight != inbox.flight {
            (self.flight, self.ahead, self.shown) = (inbox.flight, Drawn::default(), None);
        }
        let drawn = inbox.pictures.iter().rposition(|picture| self.ahead.has(picture.meta.id));
        let now = Instant::now();
        let waits = inbox.ahead && self.shown.is_none_or(|at| now.duration_since(at) < PATIENCE);
        let chosen = match drawn {
            Some(at) => inbox.pictures.drain(..=at).next_back(),
            // Its pixels will be there in a moment.
            None if waits => None,
            None => inbox.pictures.drain(..).next_back(),
        };
        if chosen.is_some() || self.shown.is_none() {
            self.shown = Some(now);
        }
        chosen
    }

    /// The frame to draw while nothing else is to be done.
    fn next_exposed(&mut self, inbox: &mut Inbox) -> Option<(FrameMeta, Photo)> {
        inbox.exposed.frames.retain(|(meta, _)| !self.ahead.has(meta.id));
        inbox.exposed.take(Instant::now(), self.pace.average)
    }

    fn ahead(&mut self, meta: &FrameMeta, photo: &Photo) {
        let began = Instant::now();
        let pixels = photo.at(sized(photo, self.pace.width()), &mut self.scaler);
        self.ahead.put(meta.id, pixels, began.elapsed());
    }
}

/// Other work.
pub(crate) enum Job {
    /// A frame was sent to a VLM.
    Asked(Box<Query>, Photo),
    /// A decision was made, after which the craft flies to this place of its frame.
    Decided(Box<Decision>, Option<Point>),
}

#[derive(Default)]
struct Inbox {
    /// The newest pictures; only the last one if none is drawn ahead.
    pictures: VecDeque<LivePicture>,
    exposed: Exposed,
    /// Number of the flight: each counts its frames from 0.
    flight: u64,
    /// Whether frames can be drawn before they are delivered.
    ahead: bool,
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

    /// A flight begins: pictures of the one before are not shown any more.
    pub(crate) fn begin_flight(&self) {
        let mut inbox = self.inbox();
        inbox.flight += 1;
        inbox.pictures.clear();
        inbox.exposed = Exposed::default();
    }

    /// Whether somebody looks at live pictures.
    pub(crate) fn is_watched(&self) -> bool {
        self.hub.is_watched_as(Format::Jpeg) || self.hub.is_watched_as(Format::Film)
    }

    /// Shows a picture, instead of one that waits. Frames that come after it, and are exposed already, are drawn meanwhile.
    pub(crate) fn show(&self, picture: LivePicture, exposed: Vec<(FrameMeta, Photo)>) {
        let mut inbox = self.inbox();
        // One that is being drawn may be ready a little after it was delivered.
        inbox.ahead = !exposed.is_empty();
        let most = if inbox.ahead { LATE } else { 1 };
        while inbox.pictures.len() >= most {
            inbox.pictures.pop_front();
        }
        inbox.exposed = Exposed { frames: exposed, clock: Some((picture.now, picture.at)) };
        inbox.pictures.push_back(picture);
        drop(inbox);
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
        let mut drawing = Drawing::default();
        loop {
            let mut inbox = self.inbox();
            let (picture, job, exposed) = loop {
                if inbox.stop {
                    return;
                }
                let (picture, job) = (drawing.choose(&mut inbox), inbox.jobs.pop_front());
                // What is not shown yet comes last.
                let exposed = if picture.is_none() && job.is_none() { drawing.next_exposed(&mut inbox) } else { None };
                if picture.is_some() || job.is_some() || exposed.is_some() {
                    break (picture, job, exposed);
                }
                inbox = self.filled.wait(inbox).unwrap_or_else(PoisonError::into_inner);
            };
            drop(inbox);
            if let Some(picture) = picture {
                self.draw(&picture, &mut drawing);
            }
            match job {
                Some(Job::Asked(query, photo)) => self.asked(&query, &photo, &mut drawing.scaler),
                Some(Job::Decided(decision, flown_to)) => self.decided(&decision, flown_to.as_ref()),
                None => {}
            }
            if let Some((meta, photo)) = exposed {
                drawing.ahead(&meta, &photo);
            }
        }
    }

    fn draw(&self, picture: &LivePicture, Drawing { scaler, pace, film, key_wanted, ahead, .. }: &mut Drawing) {
        let began = Instant::now();
        if began < pace.not_before {
            return;
        }
        let drawn = ahead.take(picture.meta.id);
        let (image, took) =
            drawn.unwrap_or_else(|| (picture.photo.at(sized(&picture.photo, pace.width()), scaler), Duration::ZERO));
        *key_wanted |= self.hub.takes_key();
        if self.hub.is_watched_as(Format::Film)
            && let Some(unit) = film.encode(&image, key_wanted)
        {
            let mut head = picture.head();
            (head["key"], head["codec"]) = (json!(unit.key), json!(unit.codec));
            self.hub.roll(Unit { key: unit.key, message: framed(&head.to_string(), &unit.annex_b) });
        }
        if self.hub.is_watched_as(Format::Jpeg)
            && let Ok(jpeg) = Jpeg::encode(&image, QUALITY)
        {
            self.hub.picture.send_replace(Some(framed(&picture.head().to_string(), jpeg.bytes())));
        }
        scaler.reuse(image);
        pace.took(took + began.elapsed());
        pace.not_before = began + INTERVAL;
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

    fn decided(&self, decision: &Decision, flown_to: Option<&Point>) {
        let (query, reading) = (decision.query.id.0, &decision.reading);
        // Of the answer itself: what was made of it, such as a shift clear of an obstacle, shows in what is flown to.
        let point = reading.reply.as_ref().and_then(|reply| reply.point).or(reading.waypoint);
        let row = json!({
            "type": "decision", "n": decision.number, "query": query, "t": decision.answered.as_secs_f64(),
            "text": words::decision(decision), "step": decision.step, "latency": decision.latency_s,
            "age": decision.frame_age_s, "point": point.map(|at| [at.u, at.v]), "flown_to": flown_to,
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

/// The size of a picture of this width at most, in the photo's shape; even sides, as video has them.
fn sized(photo: &Photo, width: u32) -> (u32, u32) {
    let (full, high) = photo.size();
    let (width, high) = if full <= width { (full, high) } else { (width, (high * width).div_ceil(full.max(1))) };
    ((width & !1).max(16), (high & !1).max(16))
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
        } else if self.average < LARGER_BELOW && self.width > 0 {
            (self.width, self.average) = (self.width - 1, Duration::ZERO);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_drawn_ahead_in_one_flight_is_not_shown_in_the_next() {
        let (mut drawing, mut inbox) = (Drawing::default(), Inbox { ahead: true, ..Inbox::default() });
        assert!(drawing.choose(&mut inbox).is_none());
        drawing.ahead.put(FrameId(7), Rgb::new(2, 2), Duration::ZERO);
        inbox.pictures.push_back(LivePicture::alone(7, Rgb::new(2, 2)));
        assert!(drawing.choose(&mut inbox).is_some(), "of the same flight");
        let worker = Worker { inbox: Mutex::new(inbox), filled: Condvar::new(), hub: Hub::new() };
        worker.inbox().pictures.push_back(LivePicture::alone(7, Rgb::new(2, 2)));
        worker.begin_flight();
        let mut inbox = worker.inbox();
        assert!(inbox.pictures.is_empty());
        inbox.pictures.push_back(LivePicture::alone(7, Rgb::new(2, 2)));
        assert!(drawing.choose(&mut inbox).is_none(), "its pixels are those of the flight before");
    }

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
