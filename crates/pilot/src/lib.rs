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

mod admissible;
pub mod anchor;
mod answers;
mod course;
mod event;
mod flight;
mod flying;
mod following;
mod leg;
pub mod method;
mod outbox;
pub mod policy;
mod progress;
mod queries;
mod refused;
mod senses;
mod settings;
pub mod standing;
pub mod steering;
mod target;
mod view_height;

pub use event::{
    Action, AnchorReport, Around, Deadline, Decision, Ending, Event, LetGo, Note, OperatorEvent, Outcome, Passage, Phase,
};
pub use settings::{AtEnd, Counted, PilotSettings, Preset, QueryTiming};

use crate::anchor::{Anchor, AnchorView};
use crate::answers::Answers;
use crate::flight::{CraftNews, Due, Flight, TAKE_OFF_TIME};
use crate::flying::Ended;
use crate::leg::Leg;
use crate::outbox::Outbox;
use crate::policy::{Policy, PolicyEvent};
use crate::queries::Queries;
use crate::senses::Senses;
use crate::steering::Steering;
use crate::target::{Here, Target};
use spf_core::camera::Camera;
use spf_core::command::{Command, Setpoint};
use spf_core::craft::Craft;
use spf_core::depth::DepthGrid;
use spf_core::frame::FrameMeta;
use spf_core::geometry::Pose;
use spf_core::keep_out::KeepOut;
use spf_core::ranges::RangeScan;
use spf_core::telemetry::{FlightPhase, Telemetry};
use spf_core::time::{Duration, Time, duration_from_secs};
use spf_core::track::TrackReport;
use spf_envelope::{Cause, Envelope, Limits, Reaction};
use spf_motion::estimator::TelemetryAccuracy;
use spf_motion::executor::Executor;
use spf_space::Space;
use spf_space::obstacle_map::ObstacleMap;
use spf_space::planner::Guide;

/// How long a craft on the ground is given to send its first usable frame, where take-off requires one.
const VIDEO_TIME: Duration = Duration::from_secs(15);
/// Interval at which `Land` is repeated until the craft reports being on the ground: a lost command must not leave it
/// in the air.
const LAND_REPEAT: Duration = Duration::from_secs(1);

/// The state machine that flies an instruction. See the [module](self).
///
/// It only mediates: its parts never call each other. Information runs one way, from the senses to target and space, from
/// there to the leg, and from the leg through the envelope to the craft.
pub struct Pilot {
    settings: PilotSettings,
    craft: Craft,
    policy: Box<dyn Policy>,
    flight: Flight,
    senses: Senses,
    queries: Queries,
    answers: Answers,
    target: Target,
    space: Space,
    leg: Leg,
    envelope: Envelope,
    outbox: Outbox,
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
    /// What stays with a target that moves; `None` if nothing tracks.
    pub steering: Option<Box<dyn Steering>>,
    /// The user's instruction.
    pub instruction: String,
}

impl Pilot {
    /// A pilot on the ground; it takes off once telemetry reports that the craft is on the ground.
    #[must_use]
    pub fn new(parts: PilotParts) -> Self {
        let PilotParts { settings, craft, senses, camera, limits, mut policy, steering, instruction } = parts;
        // A policy answers an instruction with Look or Wait; on the ground there is nothing to look at yet.
        policy.handle(PolicyEvent::Instruction(&instruction));
        let executor = Executor::new(craft, settings.motion, settings.ending).with_period(tick_length(settings.rate_hz));
        Self {
            settings,
            craft,
            policy,
            flight: Flight::new(instruction),
            senses: Senses::new(camera, &craft, senses),
            queries: Queries::default(),
            answers: Answers::default(),
            target: Target::new(&settings, &craft, steering),
            space: Space::new(craft.radius, settings.method.is_mapped()),
            leg: Leg::new(executor),
            envelope: Envelope::new(limits, craft),
            outbox: Outbox::default(),
        }
    }

    /// Handles an event that occurred at `now`.
    pub fn handle(&mut self, now: Time, event: Event) {
        let now = self.flight.clock(now);
        let ended = match event {
            Event::Reply { id, text } => self.replied(now, id, &text),
            Event::Chunk { id, text } => self.chunk(now, id, &text),
            Event::ReplyFailed { id, reason } => self.reply_failed(now, id, reason),
            other => {
                self.observe(now, other);
                None
            }
        };
        self.conclude(now, ended);
    }

    /// Handles what is no reply.
    fn observe(&mut self, now: Time, event: Event) {
        match event {
            Event::Frame(frame) => self.frame(now, frame),
            Event::Telemetry(telemetry) => self.telemetry(now, telemetry),
            Event::Depth(grid) => self.depth(now, &grid),
            Event::Gimbal(report) => self.senses.gimbal.observe(report),
            Event::Ranges(scan) => self.ranges(now, &scan),
            Event::Track(report) => self.track_report(now, report),
            Event::Operator(event) => self.operator(now, event),
            Event::Spent { reason } => self.spent(now, reason),
            Event::LinkLost => {
                self.envelope.link_lost(now);
                self.flight.link_lost = true;
                // The craft may be anywhere when the link returns: pending queries are repeated.
                self.cancel_queries();
                self.leg.rest.is_needed = true;
                self.stop_motion(now);
                self.leg.next_tick = now;
            }
            Event::LinkRestored => {
                self.envelope.link_restored(now);
                self.flight.link_lost = false;
            }
            Event::LetGo(news) => self.let_go(now, news),
            Event::Reply { .. } | Event::Chunk { .. } | Event::ReplyFailed { .. } => {}
        }
    }

    /// The next action at `now`; `None` if there is none until an event or [`Pilot::next_deadline`].
    pub fn poll(&mut self, now: Time) -> Option<Action> {
        let now = self.flight.clock(now);
        if self.outbox.is_empty() {
            self.advance(now);
        }
        self.outbox.pop()
    }

    /// When to poll again if no event arrives, and why; `None` once the flight is over.
    #[must_use]
    pub fn next_deadline(&self) -> Option<(Time, Deadline)> {
        if self.flight.phase == Phase::Ended {
            return None;
        }
        let all = [
            (Some(self.leg.next_tick), Deadline::Tick),
            (self.queries.deadline(), Deadline::Query),
            (self.flight.hand_deadline(), Deadline::ManualSetpoint),
            (self.envelope.next_deadline(self.flight.now()), Deadline::Envelope),
        ];
        all.into_iter().filter_map(|(at, why)| Some((at?, why))).min_by_key(|(at, _)| *at)
    }

    /// The outcome; `None` while the flight continues, also after the operator has resumed a flight that had ended.
    #[must_use]
    pub fn ending(&self) -> Option<&Ending> {
        self.flight.ending.as_ref()
    }

    /// The current phase.
    #[must_use]
    pub fn phase(&self) -> Phase {
        self.flight.phase
    }

    /// Number of decisions so far.
    #[must_use]
    pub fn decisions(&self) -> u32 {
        self.answers.decisions()
    }

    /// Number of replies that arrived for queries already cancelled.
    #[must_use]
    pub fn late_replies(&self) -> u32 {
        self.queries.late()
    }

    /// When the first moving setpoint was sent: the start of the completion time. Take-off does not count as motion.
    #[must_use]
    pub fn first_motion(&self) -> Option<Time> {
        self.leg.first_motion
    }

    /// The last setpoint requested from the envelope, before clearing. For recording.
    #[must_use]
    pub fn wanted(&self) -> Setpoint {
        self.leg.wanted
    }

    /// Estimated pose of the craft at `now`.
    #[must_use]
    pub fn known_pose(&self, now: Time) -> Pose {
        self.senses.known(now).pose()
    }

    /// Estimated pose at a time that has passed, such as a frame's capture; `None` if it is not known, or no longer.
    #[must_use]
    pub fn pose_at(&self, time: Time) -> Option<Pose> {
        self.senses.estimator.pose_at(time)
    }

    /// Standard deviation of the estimated horizontal position, metres
    /// ([`position_error`](spf_motion::estimator::MotionEstimator::position_error)).
    #[must_use]
    pub fn position_error(&self) -> f64 {
        self.senses.estimator.position_error()
    }

    /// When the position was last unknown, or moved by an amount that no report explains: poses of before cannot be compared with
    /// later ones.
    #[must_use]
    pub fn lost_track(&self) -> Option<Time> {
        self.senses.estimator.lost_track()
    }

    /// Whether the craft reports no position of its own.
    #[must_use]
    pub fn is_dead_reckoned(&self) -> bool {
        self.senses.estimator.is_dead_reckoned()
    }

    /// The keep-out volumes that the operator has marked.
    #[must_use]
    pub fn kept_out(&self) -> &[KeepOut] {
        self.space.kept_out()
    }

    /// The obstacle map, if it is on. For recording.
    #[must_use]
    pub fn obstacle_map(&self) -> Option<&ObstacleMap> {
        self.space.map()
    }

    /// The target's place, if it is known. For recording.
    #[must_use]
    pub fn anchor(&self) -> Option<&Anchor> {
        self.target.anchor()
    }

    /// The same as seen from the craft. For recording.
    #[must_use]
    pub fn anchor_view(&self, now: Time) -> Option<AnchorView> {
        self.target.sight(Here { at: self.known_pose(now).position, odometry: self.senses.odometry_at(now) })
    }

    /// The plan being flown, if there is one. For recording.
    #[must_use]
    pub fn guide(&self) -> Option<&Guide> {
        self.leg.course()?.guide.as_ref()
    }

    /// The last report on the track that was asked for last; `None` without one. For recording.
    #[must_use]
    pub fn track(&self) -> Option<&TrackReport> {
        self.target.following.as_ref()?.track()
    }

    fn advance(&mut self, now: Time) {
        if self.flight.phase == Phase::Ended {
            return;
        }
        let ended = self.expire_queries(now);
        self.conclude(now, ended);
        self.flight.count_time(now);
        if self.flight.expire_hand(now) {
            self.leg.next_tick = now;
        }
        self.react(now);
        self.limits(now);
        let ended = self.follow_gimbal(now);
        self.conclude(now, ended);
        let ended = self.decide(now);
        self.conclude(now, ended);
        if now >= self.leg.next_tick {
            let ended = self.tick(now);
            self.conclude(now, ended);
            // From `now`, not from the last due time: a late caller gets one tick, not a burst of missed ones.
            let lands = self.flight.phase == Phase::Landing;
            self.leg.next_tick = now + if lands { LAND_REPEAT } else { tick_length(self.settings.rate_hz) };
        }
    }

    // ---- What arrives ----

    fn frame(&mut self, now: Time, frame: FrameMeta) {
        let frame = self.senses.frame(now, frame);
        self.envelope.observe_frame(now, &frame);
        if let Some(from) = self.senses.see(frame) {
            let odometry = self.senses.odometry_at(from.captured);
            self.space.frame(now, from, odometry);
        }
    }

    fn telemetry(&mut self, now: Time, mut telemetry: Telemetry) {
        let Some(news) = self.senses.telemetry(now, &mut telemetry) else { return };
        if news.jumped {
            self.outbox.note(Note::Limited(
                "the craft's own position estimate jumped, although it has not moved: places stay where they are; limits, geofence \
                 and home count by the new position",
            ));
        }
        if let Some(lost) = news.lost {
            self.forget_places(now, lost);
        }
        if let Some(below) = telemetry.ground_clearance.filter(|below| below.is_finite() && telemetry.phase.is_flying())
            && let Some(pose) = self.senses.estimator.pose_at(telemetry.time)
        {
            self.space.below(now, below, pose);
        }
        self.envelope.observe_spread(self.senses.estimator.spread());
        self.envelope.observe_telemetry(now, &telemetry);
        self.leg.executor.observe(telemetry.time, telemetry.phase);
        self.follow_craft(now, &telemetry);
    }

    /// Passes a depth grid to brake and map, with the pose at its capture. A grid of unknown pose says nothing, and neither does
    /// one of a sensor that has failed: a frozen one would clear the map of what the craft flies towards.
    fn depth(&mut self, now: Time, grid: &DepthGrid) {
        if let Some(pose) = self.senses.estimator.pose_at(grid.captured.min(now))
            && self.envelope.observe_depth(now, grid, pose)
        {
            self.space.depth(now, grid, pose);
        }
    }

    /// Passes a scan of a sensor around the craft to brake and map, with the pose at its capture.
    fn ranges(&mut self, now: Time, scan: &RangeScan) {
        if let Some(pose) = self.senses.estimator.pose_at(scan.captured.min(now)) {
            self.envelope.observe_ranges(now, scan, pose);
            self.space.ranges(now, scan, pose);
        }
    }

    /// Forgets all places of before `lost`: nobody knows where they are now. What flies to one stops, and decides anew from rest.
    fn forget_places(&mut self, now: Time, lost: Time) {
        self.target.forget_places(lost);
        self.space.forget_places();
        self.void_kept_out(now);
        // A craft that reports no position loses track at every pause of its reports, and is reckoned on.
        if self.is_dead_reckoned() {
            return;
        }
        if let Some(following) = &mut self.target.following {
            following.lose();
        }
        self.space.forget_boxes();
        self.envelope.observe_obstacles(core::iter::empty());
        self.senses.view = None;
        if self.leg.is_moving() {
            self.outbox.note(Note::Limited(
                "the position is another than it was: the way to where the craft flew is not known any more",
            ));
            self.stop_motion(now);
        }
        self.rest_anew(now);
    }

    /// The next decision is made from rest that begins now.
    fn rest_anew(&mut self, now: Time) {
        self.leg.rest.begin(now);
        self.leg.rest.is_needed = true;
    }

    /// Follows the phase that the craft reports.
    fn follow_craft(&mut self, now: Time, telemetry: &Telemetry) {
        match self.flight.observe(now, telemetry.phase, telemetry.crashed) {
            CraftNews::None => {}
            CraftNews::Crashed => {
                self.cancel_queries();
                self.stop_motion(now);
                self.settle(Ending::new(Outcome::Collision, "the craft collided with something"));
                self.command(now, Command::EmergencyStop);
                self.enter(now, Phase::Ended);
            }
            CraftNews::Airborne => {
                self.rest_anew(now);
                self.leg.next_tick = now;
                self.enter(now, if self.flight.start.then_hold { Phase::Held } else { Phase::Flying });
            }
            CraftNews::Refused => self.finish(now, Ending::new(Outcome::Failed, "the craft refused to take off")),
            CraftNews::Landed => self.enter(now, Phase::Ended),
            CraftNews::LandedByItself => {
                self.finish(now, Ending::new(Outcome::Failed, "the craft landed or stopped its motors"));
            }
        }
    }

    /// The craft does not fly by our commands any more.
    fn let_go(&mut self, now: Time, news: LetGo) {
        if self.flight.phase == Phase::Ended {
            return;
        }
        self.outbox.note(Note::LetGo(news));
        let lands = self.flight.phase == Phase::Landing;
        match self.flight.let_go(news) {
            // A landing that was ordered, as by a signal, is not forgotten: it is commanded again, and the craft is landed as soon as
            // it is known to be nobody's, or the flight ends because it is somebody's.
            LetGo::Somebody | LetGo::Failsafe if lands || self.flight.landing_is_final().is_some() => {}
            LetGo::Somebody | LetGo::Failsafe => self.hold(now, Phase::Held),
            LetGo::Nobody => self.finish(
                now,
                Ending::new(
                    Outcome::Aborted,
                    "the link was lost, the craft's own failsafe held it, and nobody was there to decide",
                ),
            ),
            LetGo::NotLanded if lands => self.enter(now, Phase::Ended),
            LetGo::NotLanded => {}
        }
    }

    // ---- The operator ----

    fn operator(&mut self, now: Time, event: OperatorEvent) {
        let still_held = matches!(event, OperatorEvent::Setpoint(_)) && self.flight.hears_held_key(now);
        let held = still_held.then_some("landing or returning: let go of the key, and press it again to take over");
        if let Some(why) = self.flight.refusal(&event).or(held) {
            self.flight.ignore(&event);
            return self.outbox.note(Note::OperatorIgnored(event, why));
        }
        self.outbox.note(Note::Operator(event.clone()));
        match event {
            OperatorEvent::Hold | OperatorEvent::Left => self.hold(now, Phase::Held),
            OperatorEvent::Resume => {
                self.flight.take_back();
                self.resume(now);
            }
            OperatorEvent::Setpoint(setpoint) => {
                self.hold(now, Phase::Manual);
                self.flight.take_setpoint(now, setpoint);
                self.leg.next_tick = now;
            }
            OperatorEvent::Instruction(text) => self.instruct(now, text),
            OperatorEvent::KeepOut(places) => self.keep_out(now, places),
            OperatorEvent::Land if self.flight.phase == Phase::Ground => {
                let cause = "the operator ended the flight before take-off";
                self.end_before_take_off(now, Ending::new(Outcome::Aborted, cause));
            }
            OperatorEvent::Land => self.finish(now, Ending::new(Outcome::Aborted, "the operator ended the flight")),
            OperatorEvent::Abandoned if self.flight.phase == Phase::Ground => {
                self.end_before_take_off(now, Ending::new(Outcome::Aborted, "nobody had the controls before take-off"));
            }
            OperatorEvent::Abandoned => {
                self.finish(now, Ending::new(Outcome::Aborted, "nobody had the controls any more"));
            }
            OperatorEvent::CutMotors => {
                self.cancel_queries();
                self.stop_motion(now);
                self.settle(Ending::new(Outcome::Aborted, "the operator cut the motors"));
                self.command(now, Command::EmergencyStop);
                self.enter(now, Phase::Ended);
            }
        }
    }

    /// Stops deciding and flying; open queries are cancelled.
    fn hold(&mut self, now: Time, phase: Phase) {
        self.cancel_queries();
        self.stop_motion(now);
        self.flight.hands_off();
        match self.flight.phase {
            Phase::Ground | Phase::TakeOff => self.flight.start.then_hold = true,
            _ => self.interrupt_landing(now, phase),
        }
        self.leg.next_tick = now;
    }

    fn resume(&mut self, now: Time) {
        self.flight.start.then_hold = false;
        if matches!(self.flight.phase, Phase::Held | Phase::Manual | Phase::Hovering | Phase::Returning | Phase::Landing) {
            self.flight.hands_off();
            self.answers.refused.reset();
            self.rest_anew(now);
            self.reopen(now);
            self.interrupt_landing(now, Phase::Flying);
            self.leg.next_tick = now;
        }
    }

    /// Continues a flight whose outcome was settled, with the current instruction. Time, decisions and queries count afresh.
    fn reopen(&mut self, now: Time) {
        if self.flight.reopen(now) {
            self.answers.count_anew();
            self.queries.count_anew();
            self.forget_instruction();
            self.policy.handle(PolicyEvent::Instruction(&self.flight.instruction));
        }
    }

    /// Interrupts a landing or return in progress: from now on the craft holds in `phase`, unless it reports otherwise.
    fn interrupt_landing(&mut self, now: Time, phase: Phase) {
        if self.flight.interrupt_landing(now) {
            self.leg.rest.begin(now);
        }
        self.enter(now, phase);
    }

    /// Forgets what belongs to the instruction until now: the target's place, height and track, whom the craft follows, and where
    /// it has been.
    fn forget_instruction(&mut self) {
        self.target.give_up();
        self.answers.begin_anew();
        if let Some(following) = &mut self.target.following {
            if following.untrack() {
                self.outbox.push(Action::Untrack);
            }
            following.end();
        }
    }

    fn instruct(&mut self, now: Time, text: String) {
        self.cancel_queries();
        self.stop_motion(now);
        self.leg.rest.is_needed = true;
        self.forget_instruction();
        // A fresh start: the policy forgets the previous instruction.
        self.policy.handle(PolicyEvent::Instruction(&text));
        self.flight.instruction = text;
        // Held by the operator it waits for `Resume`, also if the previous instruction had ended.
        if matches!(self.flight.phase, Phase::Hovering | Phase::Returning | Phase::Landing) {
            self.resume(now);
        }
    }

    /// Keeps out of these places from now on. The motion ends, for its way was not checked against them; the next decision leads
    /// around them. Flight by hand goes on.
    fn keep_out(&mut self, now: Time, places: Vec<KeepOut>) {
        self.stop_motion(now);
        let places = self.space.keep_out(places);
        self.policy.handle(PolicyEvent::KeepOut(places));
        self.envelope.keep_out(places);
    }

    /// Forgets the places to keep out of when the position was lost: nobody knows where they are now. What flew on its
    /// own holds, until the operator has marked them again and resumes.
    fn void_kept_out(&mut self, now: Time) {
        if !self.space.void_kept_out() {
            return;
        }
        self.keep_out(now, Vec::new());
        self.outbox.note(Note::Limited(
            "the position was lost, and is another now: the marked places are void; mark them again, then resume",
        ));
        if matches!(self.flight.phase, Phase::Ground | Phase::TakeOff | Phase::Flying) {
            self.hold(now, Phase::Held);
        }
    }

    // ---- The envelope's reactions, and limits of time ----

    /// Obeys the envelope's current reaction: the conditions and their delays are its own (`docs/explanation/safety.md`,
    /// "Reactions").
    fn react(&mut self, now: Time) {
        let phase = self.flight.phase;
        if phase == Phase::Returning {
            // Told, and nothing else: the craft's own navigation goes on, and has failsafes of its own.
            return self.outbox.reaction(self.envelope.manual_reaction(now).cause());
        }
        if !matches!(phase, Phase::Flying | Phase::Held | Phase::Manual | Phase::Hovering | Phase::TakeOff) {
            return;
        }
        // An operator in manual flight sees the craft: a frozen camera does not end it.
        let by_hand = matches!(phase, Phase::Manual | Phase::Held | Phase::Hovering);
        let reaction = if by_hand { self.envelope.manual_reaction(now) } else { self.envelope.reaction(now) };
        self.outbox.reaction(reaction.cause());
        match reaction {
            Reaction::Continue => {}
            Reaction::Hold(cause) => {
                self.stop_if_moving(now);
                if cause.is_blind() {
                    let ended = self.set_aside_unseen(now);
                    self.conclude(now, ended);
                }
            }
            Reaction::Land(cause) => {
                // Every other condition can be resolved, or judged, by an operator who sees the craft.
                if cause == Cause::LowBattery {
                    self.flight.must_land("landing on a low battery; only cutting the motors is accepted now");
                }
                self.finish(now, Ending::by(cause));
            }
        }
    }

    fn stop_if_moving(&mut self, now: Time) {
        if self.leg.is_moving() {
            self.stop_motion(now);
        }
    }

    /// Time-driven transitions: take-off, its timeout, the flight's time limit, the end of landing.
    fn limits(&mut self, now: Time) {
        match self.flight.due(now, self.settings.max_time, self.leg.next_tick) {
            Due::Nothing => {}
            Due::TakeOff => self.take_off(now),
            Due::NoTakeOff => {
                let cause = format!("no take-off within {} s", TAKE_OFF_TIME.as_secs());
                self.finish(now, Ending::new(Outcome::Failed, cause));
            }
            Due::OutOfTime => {
                let (limit, held_back) = (self.settings.max_time.as_secs_f64(), self.leg.held_back(now));
                let cause = format!("the flight time limit of {limit} s was reached{held_back}");
                self.finish(now, Ending::new(Outcome::Timeout, cause));
            }
            Due::HoverOver => self.land(now),
            Due::NoReturn(why) => {
                self.outbox.note(Note::Limited(why));
                self.land(now);
            }
            Due::LandingOver => self.enter(now, Phase::Ended),
            Due::LandAgain => self.command(now, Command::Land),
        }
    }

    fn take_off(&mut self, now: Time) {
        let limit = self.settings.max_time;
        if self.flight.is_out_of_time(now, limit) {
            let cause = format!("the flight time limit of {} s was reached on the ground", limit.as_secs_f64());
            return self.end_before_take_off(now, Ending::new(Outcome::Timeout, cause));
        }
        let (start, craft) = (&mut self.flight.start, self.flight.craft);
        if start.then_hold || craft != FlightPhase::OnGround || self.senses.estimator.newest().is_none() {
            return;
        }
        // Video takes seconds to start; without it the take-off is refused below.
        let ready = *start.ready_since.get_or_insert(now);
        let video = !self.envelope.limits().take_off_checks || self.envelope.has_fresh_frame(now);
        if !video && now.since(ready) < VIDEO_TIME {
            return;
        }
        match self.envelope.clear(now, Command::TakeOff) {
            Ok(clearance) => {
                self.outbox.push(Action::Command(clearance.cleared));
                self.enter(now, Phase::TakeOff);
            }
            Err(refusal) => {
                self.settle(Ending::new(Outcome::Aborted, refusal.to_string()));
                self.enter(now, Phase::Ended);
            }
        }
    }

    /// Ends the flight because a budget is exhausted.
    fn spent(&mut self, now: Time, reason: String) {
        let ending = Ending::new(Outcome::Aborted, reason);
        match self.flight.phase {
            Phase::Ground => self.end_before_take_off(now, ending),
            Phase::Landing | Phase::Returning | Phase::Ended => {}
            _ => self.finish(now, ending),
        }
    }

    // ---- The end ----

    /// Ends the instruction, if it has ended: the outcome is settled, and the craft lands, hovers or returns.
    fn conclude(&mut self, now: Time, ended: Ended) {
        let Some(ending) = ended else { return };
        let is_flying = self.flight.phase == Phase::Flying;
        match self.settings.at_end {
            AtEnd::Hover if is_flying => {
                self.cancel_queries();
                self.stop_motion(now);
                self.settle(ending);
                self.enter(now, Phase::Hovering);
                self.leg.next_tick = now;
            }
            AtEnd::Return if is_flying => self.return_home(now, ending),
            _ => self.finish(now, ending),
        }
    }

    /// Sets the outcome and returns home by the craft's own navigation, if the envelope clears it; else lands. The return is
    /// watched and not interfered with; the operator may hold, land, fly by hand or give a new instruction at any time.
    fn return_home(&mut self, now: Time, ending: Ending) {
        let Ok(clearance) = self.envelope.clear(now, Command::Return) else {
            self.outbox.note(Note::Limited("the safety envelope does not clear a return from here: landing"));
            return self.finish(now, ending);
        };
        self.cancel_queries();
        self.stop_motion(now);
        self.settle(ending);
        self.outbox.push(Action::Command(clearance.cleared));
        self.enter(now, Phase::Returning);
    }

    /// Ends a flight before take-off. A craft that is already taking off by itself is landed.
    fn end_before_take_off(&mut self, now: Time, ending: Ending) {
        if self.flight.craft == FlightPhase::OnGround {
            self.settle(ending);
            self.enter(now, Phase::Ended);
        } else {
            self.finish(now, ending);
        }
    }

    /// Sets the outcome and lands.
    fn finish(&mut self, now: Time, ending: Ending) {
        self.cancel_queries();
        self.stop_motion(now);
        self.settle(ending);
        self.land(now);
    }

    /// Begins the landing of a flight whose outcome is settled.
    fn land(&mut self, now: Time) {
        if !matches!(self.flight.phase, Phase::Landing | Phase::Ended) {
            self.enter(now, Phase::Landing);
            self.command(now, Command::Land);
            self.leg.next_tick = now + LAND_REPEAT;
        }
    }

    /// Sets the outcome; the first cause wins.
    fn settle(&mut self, ending: Ending) {
        if let Some(ending) = self.flight.settle(ending) {
            self.outbox.push(Action::Finished(ending));
        }
    }

    fn enter(&mut self, now: Time, phase: Phase) {
        if self.flight.enter(now, phase) {
            self.outbox.note(Note::Phase(phase));
        }
    }
}

/// Time between setpoints. A rate outside [`PilotSettings::rate_hz`]'s range, or NaN, is moved to the nearest valid
/// one.
fn tick_length(rate_hz: f64) -> Duration {
    // Not `clamp`, which passes NaN through: a tick of zero length would stop time.
    duration_from_secs(1.0 / if rate_hz >= 5.0 { rate_hz.min(100.0) } else { 5.0 })
}

/// So that what plugs into a pilot compiles as part of its tests.
#[cfg(test)]
extern crate self as spf_pilot;
#[cfg(test)]
mod tests;
