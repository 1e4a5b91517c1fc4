//! Whether a frame shows something to ask about ([`AskWhen::News`]): while the craft flies on as an answer has told, the next query
//! can wait until something is new, or until its answer will be needed.

use super::{AskWhen, Pilot};
use crate::geometry::{EnuPosition, Pose, wrap_angle};
use crate::lift::range_of_label;
use crate::policy::{Expected, View};
use crate::time::{Duration, Time, duration_from_secs};
use crate::track::TrackQuality;

/// After this time one asks in any case.
const LONGEST: Duration = Duration::from_secs(3);
/// The part of the range at which the target was seen that may be flown before one asks again.
const CLOSER: f64 = 0.5;
/// An answer is to be there this long before the motion ends.
const AHEAD: Duration = Duration::from_millis(300);

/// What is known about the last query.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct News {
    /// Capture time and pose of its frame.
    asked: Option<(Time, Pose)>,
    /// Whether the target's track has been good since its answer, or, without one yet, since it was sent.
    tracked: bool,
    /// Where the motion ends that its answer has given.
    goal: Option<EnuPosition>,
}

impl Pilot {
    /// Notes that a query about this view is sent.
    pub(super) fn note_asked(&mut self, view: &View) {
        self.news = News { asked: Some((view.frame.captured, view.pose)), tracked: self.has_good_track(), goal: None };
    }

    /// Notes where an answer leads. Its box begins a new track.
    pub(super) fn note_goal(&mut self, goal: Option<Pose>) {
        self.news.goal = goal.map(|goal| goal.position);
        self.news.tracked = false;
    }

    /// Notes that a report on the track has arrived.
    pub(super) fn note_track(&mut self) {
        self.news.tracked |= self.has_good_track();
    }

    /// Whether to ask about a view now: always, unless the settings say otherwise.
    pub(super) fn has_news(&self, now: Time, view: &View) -> bool {
        if self.settings.ask == AskWhen::Always || !self.executing || !self.is_guided() {
            return true;
        }
        // Beside somebody who walks the brake knows other people by the boxes of the last answers alone, for 3 s.
        if self.guiding.is_following() {
            return true;
        }
        let Some((captured, pose)) = self.news.asked else { return true };
        // A search, a second look, a reply that was refused.
        let Some(reply) = self.policy.reading().reply.filter(|reply| reply.status.leads_to_a_point()) else { return true };
        let turned = wrap_angle(view.pose.attitude.heading - pose.attitude.heading).abs();
        let flown = view.pose.position.distance(pose.position);
        let range = reply.label().map_or(0.0, range_of_label);
        now.since(captured) >= LONGEST
            || turned > view.camera.half_fov().0
            || flown >= CLOSER * range
            || self.news.tracked && !self.has_good_track()
            || view.expected == Expected::Aside
            || self.has_verdict()
            || self.guiding.is_escaping()
            || self.time_left(now) <= self.guiding.longest_answer() + AHEAD
    }

    /// Time until the motion ends, at the least.
    fn time_left(&self, now: Time) -> Duration {
        let Some(goal) = self.news.goal else { return Duration::ZERO };
        duration_from_secs(self.known(now).position.distance(goal) / self.craft.cruise_speed.max(f64::EPSILON))
    }

    fn has_good_track(&self) -> bool {
        self.track().is_some_and(|track| track.quality == TrackQuality::Good)
    }
}
