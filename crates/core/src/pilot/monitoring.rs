//! Watches the flight to a target between two replies ([`crate::monitor`]): from what is measured anyway at each tick, and with a cheap
//! query every 2 s, or as soon as the measurements ask for one.
//!
//! A verdict stops the craft at most. What follows, the next query about a frame taken at rest decides.

use super::{Action, Note, Phase, Pilot, Waiting};
use crate::envelope::Reaction;
use crate::frame::FrameId;
use crate::geometry::Pose;
use crate::geometry::wrap_angle;
use crate::monitor::{IMAGE_SIDE, JudgedBy, Judgement, Observation, REGION, Verdict, Watch, parse_monitor};
use crate::policy::{Expected, PolicyEvent, Step, View};
use crate::prompt::{PromptKind, PromptText};
use crate::query::{ImageBox, ImagePoint, Look, Memory, Query, QueryId, QueryKind};
use crate::reply::Status;
use crate::time::{Duration, Time};
use crate::track::TrackQuality;

/// Interval of the queries.
const QUERY_PERIOD: Duration = Duration::from_secs(2);
/// After a verdict that has stopped the craft, none is asked for during this time: if the second look has not confirmed it, the same
/// question from the same place would stop the craft again.
const QUIET: Duration = Duration::from_secs(6);
/// Minimum interval of observations; ticks may be faster.
const WATCH_PERIOD: Duration = Duration::from_millis(90);
/// A report of the tracker counts for this long.
const TRACKED: Duration = Duration::from_millis(500);
/// An older frame is not asked about.
const FRESH: Duration = Duration::from_millis(500);
/// Numbers of the monitor's queries begin here, above those of any policy.
pub(super) const FIRST_ID: u64 = 1_000_000_000;

/// The state of the monitor.
#[derive(Debug, Default)]
pub(super) struct Monitoring {
    watch: Watch,
    watched: Option<Time>,
    /// The watch's last verdict.
    verdict: Verdict,
    /// Whether that verdict asks for a query at once.
    due: bool,
    /// What is flown to; `None` in a search, a second look, or a hold.
    target: Option<Target>,
    /// The open query.
    open: Option<Waiting>,
    /// When the last one was sent, about which frame.
    asked: Option<(Time, FrameId)>,
    /// Number of queries so far.
    count: u64,
    /// Capture time of the newest frame about which the policy has had a reply.
    answered: Option<Time>,
    /// Nothing is asked before this time: a second look has just been taken.
    quiet_until: Time,
}

/// What the last reply led to.
#[derive(Clone, Debug)]
struct Target {
    name: Option<String>,
    stage: u32,
    area: Option<ImageBox>,
    /// Whether it may walk, so that nearing it tells nothing.
    moves: bool,
}

/// Where the target's place is relative to an image.
enum Place {
    Unknown,
    Outside,
    At(ImagePoint),
}

impl Pilot {
    /// Whether the flight is watched.
    pub(super) fn monitors(&self) -> bool {
        self.settings.guidance.monitor && self.is_guided()
    }

    /// Whether the last verdict asks for a new query of the policy as well.
    pub(super) fn has_verdict(&self) -> bool {
        self.monitoring.verdict != Verdict::Continue
    }

    /// The deadline of the open query.
    pub(super) fn monitor_deadline(&self) -> Option<Time> {
        self.monitoring.open.as_ref().map(|open| open.query.deadline)
    }

    /// Takes a reply of the policy's, and the step that follows.
    pub(super) fn monitor_policy(&mut self, waiting: &Waiting, step: &Step) {
        if !self.monitors() || !matches!(waiting.query.kind, QueryKind::Point { .. }) {
            return;
        }
        let Some(reply) = self.policy.reading().reply else { return };
        let captured = waiting.view.frame.captured;
        let monitoring = &mut self.monitoring;
        monitoring.answered = Some(monitoring.answered.map_or(captured, |last| last.max(captured)));
        match (reply.status, step) {
            (status, Step::Move(_) | Step::Goto(_) | Step::Follow(_)) if status.leads_to_a_point() => {
                let stage = reply.stage.unwrap_or(1);
                if monitoring.target.as_ref().is_none_or(|target| target.stage != stage) {
                    monitoring.restart();
                }
                monitoring.watch.replied(true);
                let moves = matches!(step, Step::Follow(_));
                monitoring.target = Some(Target { name: reply.target, stage, area: reply.target_box, moves });
            }
            (Status::NotVisible, Step::Keep) => {
                // On the way around something, no reply can show what is behind it.
                if waiting.view.expected != Expected::Aside {
                    monitoring.watch.replied(false);
                }
            }
            _ => monitoring.forget(),
        }
    }

    /// Observes the flight, and asks if it is time.
    pub(super) fn monitor(&mut self, now: Time) {
        let reaction = self.envelope.reaction(now);
        let flies = self.phase == Phase::Flying && !self.link_lost && matches!(reaction, Reaction::Continue);
        if !self.monitors() || !flies || self.monitoring.target.is_none() {
            return;
        }
        if self.monitoring.watched.is_none_or(|last| now.since(last) >= WATCH_PERIOD) {
            self.monitoring.watched = Some(now);
            self.observe(now);
        }
        self.ask_monitor(now);
    }

    fn observe(&mut self, now: Time) {
        let Some(seen) = self.observation(now) else { return };
        let verdict = self.monitoring.watch.observe(now, &seen);
        let last = core::mem::replace(&mut self.monitoring.verdict, verdict);
        if verdict == last || verdict == Verdict::Continue {
            return;
        }
        let side = (verdict == Verdict::Lost).then(|| self.side(now));
        self.note(Note::Monitor(Judgement { verdict, by: JudgedBy::Pilot, side, outdated: false }));
        match verdict {
            Verdict::Lost => self.act_on(now, verdict, side),
            // With a map, the course finds a way out by itself.
            Verdict::Stuck if !self.is_mapped() => self.act_on(now, verdict, None),
            Verdict::Stop | Verdict::Stuck | Verdict::Continue => self.monitoring.due = true,
        }
    }

    fn observation(&self, now: Time) -> Option<Observation> {
        let target = self.monitoring.target.as_ref()?;
        let pose = self.known_pose(now);
        let track = self.track().filter(|track| self.settings.guidance.track && now.since(track.captured) < TRACKED);
        let good = track.filter(|track| track.quality == TrackQuality::Good).map(|track| track.area);
        let sight = self.guiding.anchors.anchor().filter(|_| !target.moves);
        let sight = sight.map(|anchor| anchor.seen_from(pose.position, self.estimator.odometry_at(now)));
        let range = sight.map(|sight| (sight.range, sight.range_sd));
        let planned = self.guide().filter(|_| self.is_mapped()).map(|guide| guide.remaining);
        Some(Observation {
            track: track.map(|track| track.quality),
            in_view: matches!(self.place_in(now, pose), Place::At(_)),
            range,
            box_height: good.or(target.area).map(|area| area.bottom - area.top),
            stop: self.settings.near_m.unwrap_or_else(|| self.stop_distance()),
            remaining: planned.filter(|_| !target.moves).or(range.map(|(range, _)| range)),
            moving: self.executing && !self.wanted.is_hold(),
        })
    }

    /// Where the target's place is in an image taken at `pose`.
    fn place_in(&self, now: Time, pose: Pose) -> Place {
        if let Some(Expected::InView { at, .. } | Expected::Followed { at, is_tracked: true, .. }) =
            self.expected_by_track(now, pose)
        {
            return Place::At(at);
        }
        let moves = self.monitoring.target.as_ref().is_some_and(|target| target.moves);
        let Some(anchor) = self.guiding.anchors.anchor().filter(|_| !moves) else { return Place::Unknown };
        let sight = anchor.seen_from(pose.position, self.estimator.odometry_at(now));
        // The direction to a target that is almost reached is not known.
        if sight.lateral_sd > 0.5 * sight.range {
            return Place::Unknown;
        }
        match anchor.image_point(&self.camera, pose, self.settings.lifting) {
            Some(at) if !self.is_hidden(pose.position, sight.position, sight.range) => Place::At(at),
            _ => Place::Outside,
        }
    }

    /// The side on which the target was last: where its track was good, else where its place is.
    fn side(&self, now: Time) -> Look {
        let pose = self.known_pose(now);
        let good = self.track().filter(|track| track.quality == TrackQuality::Good).and_then(|track| {
            let then = self.estimator.pose_at(track.captured)?;
            let aside = libm::atan(self.camera.ray(track.area.middle()).right);
            Some(wrap_angle(then.attitude.heading + aside - pose.attitude.heading))
        });
        let placed = self.guiding.anchors.anchor().map(|anchor| {
            let bearing = pose.position.bearing_to(anchor.position());
            wrap_angle(bearing - pose.attitude.heading)
        });
        if good.or(placed).unwrap_or(0.0) < 0.0 { Look::Left } else { Look::Right }
    }

    fn ask_monitor(&mut self, now: Time) {
        let Monitoring { open, asked, due, target, count, .. } = &self.monitoring;
        let (Some(target), Some(view), None) = (target, self.view, open) else { return };
        let is_time = now >= self.monitoring.quiet_until && (*due || asked.is_none_or(|(at, _)| now.since(at) >= QUERY_PERIOD));
        let is_new = asked.is_none_or(|(_, frame)| frame != view.frame.id) && now.since(view.frame.captured) <= FRESH;
        // Whoever asks again at once gets the same answer at the same price.
        if !(is_time && is_new) {
            return;
        }
        let close_up = match self.place_in(now, view.pose) {
            Place::Outside => return,
            Place::Unknown => None,
            Place::At(at) => Some(region(at)),
        };
        let memory = Memory {
            stage: target.stage,
            targets: target.name.clone().into_iter().collect(),
            last_seen: Some(self.side(now)),
            ..Memory::default()
        };
        let mut query = Query {
            instruction: self.instruction.clone(),
            memory,
            image_size: Some(image_size(view.frame.width, view.frame.height)),
            near_m: self.settings.near_m,
            close_up,
            deadline: self.reply_deadline(now),
            ..Query::new(QueryId(FIRST_ID + count), view.frame.id, QueryKind::Monitor)
        };
        query.prompt = PromptText::shipped(PromptKind::Monitor).write_monitor(&query);
        self.send_monitor(now, Box::new(query), view);
    }

    fn send_monitor(&mut self, now: Time, query: Box<Query>, view: View) {
        let monitoring = &mut self.monitoring;
        monitoring.count += 1;
        monitoring.due = false;
        monitoring.asked = Some((now, view.frame.id));
        monitoring.open = Some(Waiting { query: query.clone(), view, queried_at: now, decided: false });
        self.outbox.push_back(Action::Ask(query));
    }

    /// Takes a reply; `false` if it is none to the monitor's query.
    pub(super) fn monitor_reply(&mut self, now: Time, id: QueryId, text: &str) -> bool {
        let Some(open) = self.monitoring.open.take_if(|open| open.query.id == id) else { return false };
        let verdict = match parse_monitor(text) {
            Ok(verdict) => verdict,
            Err(error) => {
                let reason = format!("the monitor: {error}");
                self.note(Note::QueryFailed { id, reason });
                return true;
            }
        };
        // The policy may have had a reply about a newer frame meanwhile, or have begun to search.
        let captured = open.view.frame.captured;
        let outdated = self.monitoring.target.is_none() || self.monitoring.answered.is_some_and(|newest| newest > captured);
        let side = (verdict == Verdict::Lost).then(|| self.side(now));
        self.note(Note::Monitor(Judgement { verdict, by: JudgedBy::Vlm, side, outdated }));
        if !outdated && verdict != Verdict::Continue {
            self.act_on(now, verdict, side);
        }
        true
    }

    /// Whether the monitor's query has this number.
    pub(super) fn monitoring_is(&self, id: QueryId) -> bool {
        self.monitoring.open.as_ref().is_some_and(|open| open.query.id == id)
    }

    /// Takes the failure of the monitor's query. The flight goes on as without a monitor.
    pub(super) fn monitor_failed(&mut self, reason: String) {
        if let Some(open) = self.monitoring.open.take() {
            self.note(Note::QueryFailed { id: open.query.id, reason: format!("the monitor: {reason}") });
        }
    }

    /// Gives up the monitor's query if its deadline has passed.
    pub(super) fn expire_monitor(&mut self, now: Time) {
        if let Some(open) = self.monitoring.open.take_if(|open| open.query.deadline <= now) {
            self.outbox.push_back(Action::Cancel(open.query.id));
            let reason = format!("the monitor: no reply within {} s", self.settings.reply_timeout.as_secs_f64());
            self.note(Note::QueryFailed { id: open.query.id, reason });
        }
    }

    /// Cancels the monitor's query, and watches nothing until a reply leads to a target again.
    pub(super) fn cancel_monitor(&mut self) {
        self.monitoring.forget();
        if let Some(open) = self.monitoring.open.take() {
            self.outbox.push_back(Action::Cancel(open.query.id));
        }
    }

    /// Holds, and lets the policy decide by a frame taken at rest. The replies to queries about earlier frames are out of date.
    fn act_on(&mut self, now: Time, verdict: Verdict, side: Option<Look>) {
        let Some(view) = self.view else { return };
        self.cancel_queries();
        self.monitoring.quiet_until = now + QUIET;
        let step = self.policy.handle(PolicyEvent::Monitor { verdict, side });
        self.carry_out(now, step, &view);
    }
}

impl Monitoring {
    /// Watches anew.
    fn restart(&mut self) {
        self.watch.reset();
        (self.verdict, self.due) = (Verdict::Continue, false);
    }

    /// Watches nothing for now.
    fn forget(&mut self) {
        self.restart();
        self.target = None;
    }
}

/// The part of the image around a point, moved so that it lies within the image.
fn region(at: ImagePoint) -> ImageBox {
    let start = |middle: f64| (middle - 0.5 * REGION).clamp(0.0, 1.0 - REGION);
    let (left, top) = (start(at.u), start(at.v));
    ImageBox { left, top, right: left + REGION, bottom: top + REGION }
}

/// The size at which a frame is sent.
fn image_size(width: u32, height: u32) -> (u32, u32) {
    let long = width.max(height).max(1);
    let side = |pixels: u32| (f64::from(pixels) * f64::from(IMAGE_SIDE.min(long)) / f64::from(long)) as u32;
    (side(width).max(1), side(height).max(1))
}
