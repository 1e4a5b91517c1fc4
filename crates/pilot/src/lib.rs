//! The pilot: the state machine that flies an instruction (`docs/explanation/architecture.md`).
//!
//! Callers pass in events with [`Pilot::handle`], fetch actions with [`Pilot::poll`] until it returns `None`, and call
//! again by [`Pilot::next_deadline`] at the latest. The pilot never sleeps, reads a clock or opens a socket.
//!
//! ```text
//! ground ──► take-off ──► flying ◄──► held, manual        (operator)
//!                            │
//!                            ├─ due? frame ─► policy ─► query ─► reply ─► policy ─► move ─► executor ─► envelope ─► command
//!                            ▼
//!                        Finished ──► (hovering, returning) ──► landing ──► ended
//! ```
#![forbid(unsafe_code)]

pub mod anchor;
mod boxes;
mod course;
mod deciding;
mod ending;
mod event;
pub mod follower;
mod following;
mod gimbal;
pub mod guidance;
mod guiding;
mod mapping;
mod moving;
mod operator;
pub mod policy;
mod reactions;
mod returning;
mod settings;
mod shown;
mod standing;
mod take_over;
mod target_height;
mod tracking;
mod unseen;
mod view_height;

pub use event::{Action, AnchorReport, Around, Decision, Ending, Event, LetGo, Note, OperatorEvent, Outcome, Passage, Phase};
pub use settings::{AtEnd, PilotSettings, Preset, QueryTiming};

use std::collections::{BTreeMap, VecDeque};

use crate::policy::{Move, Policy, PolicyEvent, View};
use spf_core::camera::Camera;
use spf_core::command::Setpoint;
use spf_core::craft::Craft;
use spf_core::depth::DepthGrid;
use spf_core::frame::FrameId;
use spf_core::keep_out::KeepOut;
use spf_core::motion::MotionEstimate;
use spf_core::query::QueryId;
use spf_core::ranges::RangeScan;
use spf_core::telemetry::{FlightPhase, Telemetry};
use spf_core::time::{Duration, Time, duration_from_secs};
use spf_envelope::{Cause, Envelope, Limits};
use spf_motion::estimator::{MotionEstimator, TelemetryAccuracy};
use spf_motion::executor::Executor;

/// An open query.
#[derive(Clone, Debug)]
struct Waiting {
    query: Box<spf_core::query::Query>,
    view: View,
    queried_at: Time,
    /// Part of its streamed reply has already decided; the rest is not a second decision.
    decided: bool,
}

/// The state machine that flies an instruction. See the [module](self).
pub struct Pilot {
    settings: PilotSettings,
    craft: Craft,
    camera: Camera,
    policy: Box<dyn Policy>,
    envelope: Envelope,
    estimator: MotionEstimator,
    executor: Executor,

    /// Latest time passed in; earlier times are treated as equal to it.
    now: Time,
    phase: Phase,
    craft_phase: FlightPhase,
    /// Measurement time of the newest telemetry.
    last_telemetry: Option<Time>,
    link_lost: bool,
    entered: Time,
    outbox: VecDeque<Action>,
    ending: Option<Ending>,
    instruction: String,
    waiting: BTreeMap<QueryId, Waiting>,
    view: Option<View>,
    /// What the last frames have shown.
    seen: unseen::Seen,
    /// What replies have shown to be free.
    shown: shown::Shown,
    used: Option<FrameId>,
    decisions: u32,
    late_replies: u32,

    guiding: guiding::Guiding,
    tracking: tracking::Tracking,
    following: following::Following,
    boxes: boxes::Boxes,
    gimbal: gimbal::GimbalState,
    executing: bool,
    pending: Option<Move>,
    needs_rest: bool,
    hold_since: Option<Time>,
    settled: Option<Time>,
    manual: Option<(Setpoint, Time)>,
    /// The operator's last setpoint.
    last_manual: Option<Time>,
    /// Last setpoint of the operator, also an ignored one.
    last_setpoint: Option<Time>,
    /// Time from which flight time is counted; advanced by the time flown by hand.
    counted_from: Time,
    /// Time up to which flight time is counted.
    counted_to: Time,
    /// Decisions made before the current instruction, which do not count against the limit.
    earlier_decisions: u32,
    /// The landing must not be interrupted, and why.
    must_land: Option<&'static str>,
    /// When the operator took over a landing that the craft may still be flying.
    taken_over: Option<Time>,
    /// Somebody else flies the craft.
    flown_elsewhere: Option<Elsewhere>,
    /// Time since which the camera alone has been delaying take-off.
    ready_since: Option<Time>,
    hold_after_take_off: bool,
    /// Places that the operator has marked, and the last one that the loss of the position has made void.
    kept_out: Vec<KeepOut>,
    voided: Option<u32>,
    first_motion: Option<Time>,
    next_tick: Time,
    /// Since when a limit has left nothing of the requested motion.
    kept_since: Option<Time>,
    /// The last setpoint requested from the envelope.
    wanted: Setpoint,
    /// The envelope's reaction and setpoint change that were last reported.
    last_reaction: Option<Cause>,
    last_change: Option<Cause>,
    /// When a boundary last reduced a setpoint, and which.
    held_back: Option<(Time, Cause)>,
}

/// Somebody else flies, and not by our commands.
#[derive(Clone, Copy, Debug, Default)]
struct Elsewhere {
    /// Whether whoever had our controls has left them since.
    abandoned: bool,
}

/// The components of a pilot.
pub struct PilotParts {
    /// Flight settings.
    pub settings: PilotSettings,
    /// The craft model.
    pub craft: Craft,
    /// Accuracy of its telemetry.
    pub senses: TelemetryAccuracy,
    /// The craft's camera.
    pub camera: Camera,
    /// The safety envelope's limits.
    pub limits: Limits,
    /// The decision policy.
    pub policy: Box<dyn Policy>,
    /// The user's instruction.
    pub instruction: String,
}

impl Pilot {
    /// A pilot on the ground; it takes off once telemetry reports that the craft is on the ground.
    #[must_use]
    pub fn new(parts: PilotParts) -> Self {
        let PilotParts { settings, craft, senses, camera, limits, policy, instruction } = parts;
        let mut pilot = Self {
            settings,
            craft,
            camera,
            policy,
            envelope: Envelope::new(limits, craft),
            estimator: MotionEstimator::new(&craft, senses),
            executor: Executor::new(craft, settings.motion, settings.ending).with_period(tick_length(settings.rate_hz)),
            now: Time::ZERO,
            phase: Phase::Ground,
            craft_phase: FlightPhase::OnGround,
            last_telemetry: None,
            link_lost: false,
            entered: Time::ZERO,
            outbox: VecDeque::new(),
            ending: None,
            instruction,
            waiting: BTreeMap::new(),
            view: None,
            seen: unseen::Seen::default(),
            shown: shown::Shown::default(),
            used: None,
            decisions: 0,
            late_replies: 0,
            guiding: guiding::Guiding::new(settings.guidance.map),
            tracking: tracking::Tracking::default(),
            following: following::Following::default(),
            boxes: boxes::Boxes::default(),
            gimbal: gimbal::GimbalState::default(),
            executing: false,
            pending: None,
            needs_rest: true,
            hold_since: None,
            settled: None,
            manual: None,
            last_manual: None,
            last_setpoint: None,
            counted_from: Time::ZERO,
            counted_to: Time::ZERO,
            earlier_decisions: 0,
            must_land: None,
            taken_over: None,
            flown_elsewhere: None,
            ready_since: None,
            hold_after_take_off: false,
            kept_out: Vec::new(),
            voided: None,
            first_motion: None,
            next_tick: Time::ZERO,
            kept_since: None,
            wanted: Setpoint::HOLD,
            last_reaction: None,
            last_change: None,
            held_back: None,
        };
        let text = pilot.instruction.clone();
        // A policy answers an instruction with Look or Wait; on the ground there is nothing to look at yet.
        pilot.policy.handle(PolicyEvent::Instruction(&text));
        pilot
    }

    /// Handles an event that occurred at `now`.
    pub fn handle(&mut self, now: Time, event: Event) {
        let now = self.clock(now);
        match event {
            Event::Frame(frame) => self.frame(now, frame),
            Event::Telemetry(telemetry) => self.telemetry(now, telemetry),
            Event::Depth(grid) => self.depth(now, &grid),
            Event::Gimbal(report) => self.gimbal.reports.observe(report),
            Event::Ranges(scan) => self.ranges(now, &scan),
            Event::Track(report) => self.track_report(now, report),
            Event::Reply { id, text } => self.reply(now, id, &text),
            Event::Chunk { id, text } => self.chunk(now, id, &text),
            Event::ReplyFailed { id, reason } => self.reply_failed(now, id, reason),
            Event::Operator(event) => self.operator(now, event),
            Event::Spent { reason } => self.spent(now, reason),
            Event::LinkLost => {
                self.envelope.link_lost(now);
                self.link_lost = true;
                // The craft may be anywhere when the link returns: pending queries are repeated.
                self.cancel_queries();
                self.needs_rest = true;
                self.stop_motion(now);
                self.next_tick = now;
            }
            Event::LinkRestored => {
                self.envelope.link_restored(now);
                self.link_lost = false;
            }
            Event::LetGo(news) => self.let_go(now, news),
        }
    }

    /// The next action at `now`; `None` if there is none until an event or [`Pilot::next_deadline`].
    pub fn poll(&mut self, now: Time) -> Option<Action> {
        let now = self.clock(now);
        if self.outbox.is_empty() {
            self.advance(now);
        }
        self.outbox.pop_front()
    }

    /// When to poll again if no event arrives; `None` once the flight is over.
    #[must_use]
    pub fn next_deadline(&self) -> Option<Time> {
        if self.phase == Phase::Ended {
            return None;
        }
        let queries = self.waiting.values().map(|waiting| waiting.query.deadline);
        let manual = self.manual.map(|(_, until)| until);
        queries.chain(manual).chain(self.envelope.next_deadline(self.now)).chain([self.next_tick]).min()
    }

    /// The outcome; `None` while the flight continues, also after the operator has resumed a flight that had ended.
    #[must_use]
    pub fn ending(&self) -> Option<&Ending> {
        self.ending.as_ref()
    }

    /// The current phase.
    #[must_use]
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// Number of decisions so far.
    #[must_use]
    pub fn decisions(&self) -> u32 {
        self.decisions
    }

    /// Number of replies that arrived for queries already cancelled.
    #[must_use]
    pub fn late_replies(&self) -> u32 {
        self.late_replies
    }

    /// When the first moving setpoint was sent: the start of the completion time. Take-off does not count as motion.
    #[must_use]
    pub fn first_motion(&self) -> Option<Time> {
        self.first_motion
    }

    /// The last setpoint requested from the envelope, before clearing. For recording.
    #[must_use]
    pub fn wanted(&self) -> Setpoint {
        self.wanted
    }

    /// Estimated pose of the craft at `now`.
    #[must_use]
    pub fn known_pose(&self, now: Time) -> spf_core::geometry::Pose {
        self.known(now).pose()
    }

    /// Estimated pose at a time that has passed, such as a frame's capture; `None` if it is not known, or no longer.
    #[must_use]
    pub fn pose_at(&self, time: Time) -> Option<spf_core::geometry::Pose> {
        self.estimator.pose_at(time)
    }

    /// Standard deviation of the estimated horizontal position, metres ([`MotionEstimator::position_error`]).
    #[must_use]
    pub fn position_error(&self) -> f64 {
        self.estimator.position_error()
    }

    /// When the position was last unknown, or moved by an amount that no report explains: poses of before cannot be compared with
    /// later ones.
    #[must_use]
    pub fn lost_track(&self) -> Option<Time> {
        self.estimator.lost_track()
    }

    /// Whether the craft reports no position of its own.
    #[must_use]
    pub fn is_dead_reckoned(&self) -> bool {
        self.estimator.is_dead_reckoned()
    }

    /// Estimated motion of the craft. Nothing flies before the first telemetry, so no decision is based on the default.
    fn known(&self, now: Time) -> MotionEstimate {
        self.estimator.at(now).unwrap_or_default()
    }

    /// Handles telemetry. A report older than the newest one, for instance overtaken in transit, is ignored.
    fn telemetry(&mut self, now: Time, mut telemetry: Telemetry) {
        // A craft clock that runs ahead must not make all its later reports look old.
        telemetry.time = telemetry.time.min(now);
        if self.last_telemetry.is_some_and(|last_telemetry| telemetry.time <= last_telemetry) {
            return;
        }
        self.last_telemetry = Some(telemetry.time);
        self.estimator.observe(&telemetry);
        self.map_telemetry(now, &telemetry);
        self.envelope.observe_spread(self.estimator.spread());
        self.envelope.observe_telemetry(now, &telemetry);
        self.executor.observe(telemetry.time, telemetry.phase);
        let before = core::mem::replace(&mut self.craft_phase, telemetry.phase);
        self.follow_craft(now, before, telemetry.crashed);
    }

    /// Passes a depth grid to brake and map, with the pose at its capture. A grid of unknown pose says nothing, and neither does
    /// one of a sensor that has failed: a frozen one would clear the map of what the craft flies towards.
    fn depth(&mut self, now: Time, grid: &DepthGrid) {
        if let Some(pose) = self.estimator.pose_at(grid.captured.min(now))
            && self.envelope.observe_depth(now, grid, pose)
        {
            self.map_depth(now, grid, pose);
        }
    }

    /// Passes a scan of a sensor around the craft to brake and map, with the pose at its capture.
    fn ranges(&mut self, now: Time, scan: &RangeScan) {
        if let Some(pose) = self.estimator.pose_at(scan.captured.min(now)) {
            self.envelope.observe_ranges(now, scan, pose);
            self.map_ranges(now, scan, pose);
        }
    }

    fn clock(&mut self, now: Time) -> Time {
        self.now = self.now.max(now);
        self.now
    }

    fn enter(&mut self, now: Time, phase: Phase) {
        if self.phase != phase {
            self.phase = phase;
            self.entered = now;
            self.outbox.push_back(Action::Note(Note::Phase(phase)));
        }
    }

    fn advance(&mut self, now: Time) {
        if self.phase == Phase::Ended {
            return;
        }
        self.expire_queries(now);
        self.count_time(now);
        if self.manual.take_if(|(_, until)| *until <= now).is_some() {
            self.next_tick = now;
        }
        self.react(now);
        self.limits(now);
        self.follow_gimbal(now);
        self.decide(now);
        if now >= self.next_tick {
            self.tick(now);
            // From `now`, not from the last due time: a late caller gets one tick, not a burst of missed ones.
            self.next_tick =
                now + if self.phase == Phase::Landing { ending::LAND_REPEAT } else { tick_length(self.settings.rate_hz) };
        }
    }
}

/// Time between setpoints. A rate outside [`PilotSettings::rate_hz`]'s range, or NaN, is moved to the nearest valid
/// one.
fn tick_length(rate_hz: f64) -> Duration {
    // Not `clamp`, which passes NaN through: a tick of zero length would stop time.
    duration_from_secs(1.0 / if rate_hz >= 5.0 { rate_hz.min(100.0) } else { 5.0 })
}

#[cfg(test)]
mod tests;
