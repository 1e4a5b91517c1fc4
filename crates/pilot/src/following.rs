//! Stays with a moving target, from the reports of its tracker (`docs/explanation/between-answers.md`).

use core::f64::consts::{FRAC_PI_2, FRAC_PI_3, FRAC_PI_6};

use super::{Outcome, Pilot, Waiting};
use crate::follower::{Answer, Follower, TargetEstimate, WayOut};
use crate::policy::{Expected, Goto, Output, Step};
use spf_core::command::Setpoint;
use spf_core::direction::Direction;
use spf_core::geometry::{EnuPosition, Pose, wrap_angle};
use spf_core::lift::{Lifting, project_displacement, range_of_label};
use spf_core::motion::MotionEstimate;
use spf_core::time::Time;
use spf_core::track::TrackReport;
use spf_space::avoid::is_grown_up;

/// How far a way out must be known, metres, and how fast it is flown then, m/s: the craft stops within it.
const WAYS: [(f64, f64); 3] = [(2.0, 2.0), (1.0, 1.0), (0.6, 0.4)];
/// Directions that lead away from the target, radians from straight away: up to 90° to either side.
const WAYS_OUT: [f64; 7] = [0.0, FRAC_PI_6, -FRAC_PI_6, FRAC_PI_3, -FRAC_PI_3, FRAC_PI_2, -FRAC_PI_2];
/// From a person's middle to the surface, metres.
const HALF_PERSON: f64 = 0.25;
/// A target walks at more than this, m/s.
const WALKS: f64 = 0.3;
/// Farthest step back that a reply without a track leads to, metres.
const STEP_BACK: f64 = 1.0;

/// The target that is followed.
#[derive(Debug, Default)]
pub(super) struct Following {
    follower: Option<Follower>,
    /// When it was first followed.
    since: Option<Time>,
    /// Whether the instruction is to stay with it, as opposed to a flight to it.
    stays: bool,
    /// Where the last reply's frame was taken, and how far from there the way is clear, metres.
    clear: (EnuPosition, f64),
    /// The craft flies the step of a reply until the track is good.
    waits: bool,
    /// Whether the last way out that was not straight led to the left of straight away from the target.
    to_left: bool,
}

impl Pilot {
    /// The target that is followed, if there is one. For recording.
    #[must_use]
    pub fn followed(&self, now: Time) -> Option<TargetEstimate> {
        self.following.follower.as_ref().filter(|_| self.guiding.is_following())?.target(now, self.known_pose(now).position)
    }

    /// Takes a reply that sees the target to follow; any other target ends it.
    pub(super) fn follow_reply(&mut self, waiting: &Waiting, output: &Output) {
        self.following.waits = false;
        let stays = output.reading.is_following();
        let goto = match &output.step {
            Step::Follow(goto) => goto,
            Step::Keep | Step::Look | Step::Ask(_) | Step::Wait | Step::Reject(_) => return,
            // Something else is in the way first; the reply sees the target all the same.
            Step::Move(_) if stays && self.following.stays => return,
            // A search, or another target.
            _ => return self.lose_target(),
        };
        let Some(area) = goto.area else { return };
        let target = output.reading.reply.as_ref().and_then(|reply| reply.target.as_deref());
        let is_person = target.is_some_and(is_grown_up);
        let (camera, keep) = (self.camera, if stays { self.settings.keep_m } else { self.stop_distance() + HALF_PERSON });
        let begun = self.following.follower.take().filter(|_| self.following.stays == stays);
        (self.following.stays, self.following.clear) = (stays, (waiting.view.pose.position, goto.clear));
        let follower = self.following.follower.insert(begun.unwrap_or_else(|| Follower::new(camera, keep)));
        let view = &waiting.view;
        let range = range_of_label(goto.label);
        follower.answer(&Answer { captured: view.frame.captured, pose: view.pose, area, range, is_person });
    }

    /// Whether the craft moves along with a target that walks: it cannot wait for it at rest.
    pub(super) fn goes_along(&self, now: Time) -> bool {
        self.followed(now).is_some_and(|target| target.is_sure && target.velocity.horizontal_speed() > WALKS)
    }

    /// Forgets where the target is. How long it has been followed goes on: a short loss does not begin it anew.
    pub(super) fn lose_target(&mut self) {
        self.following = Following { since: self.following.since, ..Following::default() };
    }

    /// A new instruction: another target.
    pub(super) fn end_following(&mut self) {
        self.following = Following::default();
    }

    /// Takes a report on the target to follow.
    pub(super) fn follow_report(&mut self, now: Time, report: &TrackReport) {
        let pose = self.camera_pose_at(report.captured);
        let (Some(follower), Some(pose)) = (&mut self.following.follower, pose) else { return };
        follower.report(report, pose);
        // The step of the reply that was flown so far needs no end.
        if follower.is_tracked(now) && self.following.waits && self.executing {
            self.stay_with_target(now);
        }
    }

    /// Stays with the target from now on. What is in the way is flown around first; and without a track, for instance of a
    /// target that is still too small, the reply's own step is flown, no nearer than the distance to keep.
    pub(super) fn begin_following(&mut self, now: Time, goto: &Goto) {
        let follower = self.following.follower.as_ref();
        let is_tracked = follower.is_some_and(|follower| follower.is_tracked(now));
        if goto.is_detour || self.link_lost || !self.can_follow() || !is_tracked {
            let mut motion = goto.motion;
            let room = range_of_label(goto.label) - follower.map_or(self.settings.keep_m, Follower::keep);
            motion.primitives.forward = motion.primitives.forward.min(room.max(-STEP_BACK));
            self.begin_move(now, motion);
            self.following.waits = !goto.is_detour && self.can_follow() && self.executing;
            return;
        }
        self.stay_with_target(now);
    }

    fn stay_with_target(&mut self, now: Time) {
        if !self.guiding.is_following() {
            self.following.waits = false;
            self.executor.stop(now);
            self.guiding.begin_following();
            if self.following.stays {
                self.following.since.get_or_insert(now);
            }
        }
        self.start_moving(now, false);
    }

    /// The setpoint that stays with the target; a hold, and the end of it, if the target is lost.
    pub(super) fn follow_target(&mut self, now: Time, known: &MotionEstimate) -> Setpoint {
        let target = self.following.follower.as_ref().and_then(|follower| follower.target(now, known.position));
        let Some(target) = target else {
            self.stop_motion(now);
            return Setpoint::HOLD;
        };
        let enough = self.settings.follow_time.zip(self.following.since);
        if let Some((time, _)) =
            enough.filter(|(time, since)| self.following.stays && target.is_sure && now.since(*since) >= *time)
        {
            let cause = format!("the target was followed for {} s", time.as_secs_f64());
            self.end_instruction(now, Outcome::Reached, cause);
            return Setpoint::HOLD;
        }
        let way_out = self.way_out(now, known, &target);
        let setpoint = self.following.follower.as_ref().and_then(|follower| follower.setpoint(now, known, &self.craft, way_out));
        let setpoint = setpoint.unwrap_or(Setpoint::HOLD);
        let (from, clear) = self.following.clear;
        // On the way to somebody, no farther than the reply's boxes leave the way clear. Who is followed shows that it is, unless
        // the reply sees something before them.
        let is_bounded = !self.following.stays || clear <= 0.0;
        let off = wrap_angle(known.position.bearing_to(target.position) - known.attitude.heading);
        let towards = setpoint.forward * libm::cos(off) + setpoint.right * libm::sin(off);
        if is_bounded && towards > 1e-6 && from.distance(known.position) >= clear {
            return Setpoint { forward: 0.0, right: 0.0, ..setpoint };
        }
        setpoint
    }

    /// Tells the envelope where somebody is with whom the craft stays, whatever it does.
    pub(super) fn keep_away_from_person(&mut self, now: Time, at: EnuPosition) {
        let follower = self.following.follower.as_ref().filter(|_| self.following.stays);
        if let Some(target) = follower.and_then(|follower| follower.target(now, at)) {
            self.envelope.observe_person(now, target.position);
        }
    }

    /// Whether a frame taken at `pose` should show the target, as its track tells, or the place where somebody who is followed was
    /// last seen.
    pub(super) fn expected_by_track(&self, now: Time, pose: Pose) -> Option<Expected> {
        let target = self.followed(now).filter(|target| target.is_sure);
        let lost = || self.following.follower.as_ref().filter(|_| self.following.stays)?.last_place(now);
        let place = target.map(|target| target.position).or_else(lost)?;
        let away = pose.position.displacement_to(place, pose.attitude.heading);
        let range = away.length();
        match project_displacement(away, &self.camera, pose.attitude, Lifting::Levelled).filter(|at| at.is_in_image()) {
            Some(at) if self.following.stays => Some(Expected::Followed { at, range, is_tracked: target.is_some() }),
            Some(at) => Some(Expected::InView { at, range }),
            None if self.following.stays => {
                let place = self.following.follower.as_ref()?.went_to(now)?;
                let off = wrap_angle(pose.position.bearing_to(place) - pose.attitude.heading);
                (off.abs() > self.camera.half_fov().0).then_some(Expected::Left { off })
            }
            None => None,
        }
    }

    /// Where the craft can get away from the target over space that is known to be free; straight away if possible, and far rather
    /// than near, and to the same side as before.
    fn way_out(&mut self, now: Time, known: &MotionEstimate, target: &TargetEstimate) -> Option<WayOut> {
        let at = known.position;
        let away = target.position.bearing_to(at);
        let side = if self.following.to_left { -1.0 } else { 1.0 };
        let ways = WAYS.iter().flat_map(|&(far, speed)| WAYS_OUT.iter().map(move |off| (far, speed, side * off)));
        let is_free = |far: f64, off: f64| {
            self.is_way_out(now, at, Direction { bearing: wrap_angle(away + off), elevation: 0.0 }.place(at, far))
        };
        let (_, speed, off) = ways.into_iter().find(|&(far, _, off)| is_free(far, off))?;
        if off != 0.0 {
            self.following.to_left = off < 0.0;
        }
        Some(WayOut { bearing: wrap_angle(away + off), speed })
    }
}
