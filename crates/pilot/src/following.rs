//! Staying with a target that moves: its track from one answer to the next, and where it is by that.

use crate::policy::{Expected, Goto, Output, Step, View};
use crate::settings::PilotSettings;
use crate::steering::{Answer, Steering, TargetEstimate, WayOut};
use core::f64::consts::{FRAC_PI_2, FRAC_PI_3, FRAC_PI_6};
use spf_core::camera::Camera;
use spf_core::command::Setpoint;
use spf_core::craft::Craft;
use spf_core::direction::Direction;
use spf_core::geometry::{EnuPosition, Pose, wrap_angle};
use spf_core::lift::{Lifting, project_displacement, range_of_label};
use spf_core::motion::MotionEstimate;
use spf_core::primitives::Primitives;
use spf_core::query::QueryId;
use spf_core::reply::Status;
use spf_core::time::{Duration, Time};
use spf_core::track::{TrackReport, TrackStart};
use spf_space::avoid::is_grown_up;

/// How far a way out must be known, metres, and how fast it is flown then, m/s: the craft stops within it.
const WAYS: [(f64, f64); 3] = [(2.0, 2.0), (1.0, 1.0), (0.6, 0.4)];
/// Directions that lead away from the target, radians from straight away: up to 90° to either side.
const WAYS_OUT: [f64; 7] = [0.0, FRAC_PI_6, -FRAC_PI_6, FRAC_PI_3, -FRAC_PI_3, FRAC_PI_2, -FRAC_PI_2];
/// A target walks at more than this, m/s.
const WALKS: f64 = 0.3;
/// Farthest step back that a reply without a track leads to, metres.
const STEP_BACK: f64 = 1.0;

/// The target that is followed, and its track.
pub(crate) struct Following {
    /// Estimates the target, and steers.
    steering: Box<dyn Steering>,
    /// Distance to keep, metres.
    keep: f64,
    /// How long is enough.
    enough: Option<Duration>,
    /// The track that was asked for, and the last report on it.
    track: Option<(QueryId, Option<TrackReport>)>,
    /// When it was first followed.
    since: Option<Time>,
    /// What is known of the target; `None` until a reply that follows it has seen it.
    held: Option<Held>,
    /// Whether the brake knows of boxes.
    pub(crate) brakes: bool,
}

/// What is known of the target.
#[derive(Debug, Default)]
struct Held {
    /// Whether the last reply sees something before it.
    is_barred: bool,
    /// The craft flies the step of a reply until the track is good.
    waits: bool,
    /// Whether the last way out that was not straight led to the left of straight away from the target.
    to_left: bool,
}

/// What a reply asks of the tracker.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum TrackNews {
    /// Track this.
    Track(TrackStart),
    /// Track nothing any more.
    Untrack,
}

impl Following {
    /// Nobody to follow yet.
    pub(crate) fn new(settings: &PilotSettings, steering: Box<dyn Steering>) -> Self {
        Self {
            steering,
            keep: settings.keep_m,
            enough: settings.follow_time,
            track: None,
            since: None,
            held: None,
            brakes: false,
        }
    }

    /// The last report on the track that was asked for last; `None` without one.
    pub(crate) fn track(&self) -> Option<&TrackReport> {
        self.track.as_ref()?.1.as_ref()
    }

    /// Where the target is.
    pub(crate) fn target(&self, now: Time, at: EnuPosition) -> Option<TargetEstimate> {
        self.steering.target(now, at)
    }

    /// Takes a reply that sees the target; any other target ends it.
    pub(crate) fn learn(&mut self, view: &View, output: &Output) {
        self.waits(false);
        let goto = match &output.step {
            Step::Follow(goto) => goto,
            Step::Keep | Step::Look | Step::Ask(_) | Step::Wait | Step::Reject(_) => return,
            // Something else is in the way first; the reply sees the target all the same.
            Step::Move(_) if output.reading.is_following() && self.held.is_some() => return,
            // A search, or another target.
            _ => return self.lose(),
        };
        let Some(area) = goto.area else { return };
        let target = output.reading.reply.as_ref().and_then(|reply| reply.target.as_deref());
        let is_person = target.is_some_and(is_grown_up);
        if self.held.is_none() {
            self.steering.start(self.keep);
        }
        self.held.get_or_insert_default().is_barred = goto.corridor.is_none();
        let range = range_of_label(goto.label);
        let answer = Answer { captured: view.frame.captured, pose: view.pose, area, range, is_person };
        self.steering.answer(&view.camera, &answer);
    }

    /// The box to be tracked that a reply gives which follows somebody, or the end of the track where it leads elsewhere.
    pub(crate) fn track_reply(&mut self, id: QueryId, view: &View, output: &Output) -> Option<TrackNews> {
        let step = &output.step;
        let reply = output.reading.reply.as_ref().filter(|_| !matches!(step, Step::Reject(_)))?;
        match (reply.status, reply.target_box) {
            (Status::Following, area) => {
                let area = area?;
                self.track = Some((id, None));
                Some(TrackNews::Track(TrackStart { id, frame: view.frame.id, area }))
            }
            (Status::NotVisible | Status::Navigating, _) if !matches!(step, Step::Keep | Step::Look) => {
                self.untrack().then_some(TrackNews::Untrack)
            }
            _ => None,
        }
    }

    /// Ends the track; returns whether there was one.
    pub(crate) fn untrack(&mut self) -> bool {
        let was_tracked = self.track.take().is_some();
        if was_tracked {
            self.lose();
        }
        was_tracked
    }

    /// Forgets where the target is. How long it has been followed goes on: a short loss does not begin it anew.
    pub(crate) fn lose(&mut self) {
        self.held = None;
        self.steering.start(self.keep);
    }

    fn waits(&mut self, waits: bool) {
        if let Some(held) = &mut self.held {
            held.waits = waits;
        }
    }

    /// A new instruction: another target.
    pub(crate) fn end(&mut self) {
        self.lose();
        self.since = None;
    }

    /// Takes a report on the track; those on earlier tracks, and older ones, are ignored. Returns whether it counts.
    pub(crate) fn report(&mut self, report: &TrackReport) -> bool {
        let Some((id, last)) = &mut self.track else { return false };
        let is_newer = last.is_none_or(|last| last.captured < report.captured);
        let counts = *id == report.id && is_newer && report.is_sound();
        if counts {
            *last = Some(*report);
        }
        counts
    }

    /// Takes where the target was in a frame taken at `pose`. Returns whether the step of the reply that was flown so far needs no
    /// end: the track is good now.
    pub(crate) fn tracked(&mut self, now: Time, report: &TrackReport, pose: Pose) -> bool {
        self.steering.report(report, pose);
        self.steering.is_tracked(now) && self.held.as_ref().is_some_and(|held| held.waits)
    }

    /// Whether the craft can stay with the target of a reply from now on, by its track.
    pub(crate) fn can_begin(&self, now: Time, goto: &Goto) -> bool {
        self.steering.is_tracked(now) && !goto.is_detour
    }

    /// The step to a target without a track, for instance of one that is still too small: no nearer than the distance to keep.
    pub(crate) fn step_to(&self, goto: &Goto) -> Primitives {
        let mut primitives = goto.motion.primitives;
        let room = range_of_label(goto.label) - self.keep;
        primitives.forward = primitives.forward.min(room.max(-STEP_BACK));
        primitives
    }

    /// Notes that such a step is flown until the track is good.
    pub(crate) fn wait(&mut self, goto: &Goto, is_flown: bool) {
        self.waits(!goto.is_detour && is_flown);
    }

    /// The craft stays with the target from now on.
    pub(crate) fn begin(&mut self, now: Time) {
        self.waits(false);
        self.since.get_or_insert(now);
    }

    /// How long the target was to be followed, if that time is over and it is seen for sure.
    pub(crate) fn is_enough(&self, now: Time, target: &TargetEstimate) -> Option<Duration> {
        let (time, since) = self.enough.zip(self.since)?;
        (target.is_sure && now.since(since) >= time).then_some(time)
    }

    /// The setpoint that stays with the target.
    pub(crate) fn setpoint(
        &self,
        now: Time,
        known: &MotionEstimate,
        craft: &Craft,
        target: &TargetEstimate,
        way_out: Option<WayOut>,
    ) -> Setpoint {
        let setpoint = self.steering.setpoint(now, known, craft, way_out).unwrap_or(Setpoint::HOLD);
        // Who is followed shows that the way is clear, unless the reply sees something before them.
        let is_barred = self.held.as_ref().is_some_and(|held| held.is_barred);
        let off = wrap_angle(known.position.bearing_to(target.position) - known.attitude.heading);
        let towards = setpoint.forward * libm::cos(off) + setpoint.right * libm::sin(off);
        if is_barred && towards > 1e-6 {
            return Setpoint { forward: 0.0, right: 0.0, ..setpoint };
        }
        setpoint
    }

    /// Where the craft can get away from the target over space that `is_free`; straight away if possible, and far rather than near,
    /// and to the same side as before.
    pub(crate) fn way_out(
        &mut self,
        at: EnuPosition,
        target: &TargetEstimate,
        is_free: impl Fn(EnuPosition) -> bool,
    ) -> Option<WayOut> {
        let away = target.position.bearing_to(at);
        let side = if self.held.as_ref().is_some_and(|held| held.to_left) { -1.0 } else { 1.0 };
        let ways = WAYS.iter().flat_map(|&(far, speed)| WAYS_OUT.iter().map(move |off| (far, speed, side * off)));
        let place = |far: f64, off: f64| Direction { bearing: wrap_angle(away + off), elevation: 0.0 }.place(at, far);
        let (_, speed, off) = ways.into_iter().find(|&(far, _, off)| is_free(place(far, off)))?;
        if let Some(held) = self.held.as_mut().filter(|_| off != 0.0) {
            held.to_left = off < 0.0;
        }
        Some(WayOut { bearing: wrap_angle(away + off), speed })
    }

    /// Whether a frame taken at `pose` should show the target, as its track tells (`target`), or the place where somebody who is
    /// followed was last seen.
    pub(crate) fn expected(&self, now: Time, camera: &Camera, pose: Pose, target: Option<TargetEstimate>) -> Option<Expected> {
        let target = target.filter(|target| target.is_sure);
        let place = target.map(|target| target.position).or_else(|| self.steering.last_place(now))?;
        let away = pose.position.displacement_to(place, pose.attitude.heading);
        let range = away.length();
        match project_displacement(away, camera, pose.attitude, Lifting::Levelled).filter(|at| at.is_in_image()) {
            Some(at) => Some(Expected::Followed { at, range, is_tracked: target.is_some() }),
            None => {
                let place = self.steering.went_to(now)?;
                let off = wrap_angle(pose.position.bearing_to(place) - pose.attitude.heading);
                (off.abs() > camera.half_fov().0).then_some(Expected::Left { off })
            }
        }
    }
}

/// Whether a target walks: the craft cannot wait for it at rest.
pub(crate) fn walks(target: &TargetEstimate) -> bool {
    target.is_sure && target.velocity.horizontal_speed() > WALKS
}
