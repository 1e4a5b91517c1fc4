//! Whether the flight to a target goes on as it should (`docs/explanation/between-answers.md`).
//!
//! [`Watch`] judges ten times a second from what is measured anyway. A verdict other than [`Verdict::Continue`] stops the craft at most:
//! whether the instruction is fulfilled, only a second look while it holds can tell.

mod reply;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::planner::Progress;
use crate::query::Look;
use crate::time::{Duration, Time};
use crate::track::TrackQuality;

pub use reply::{monitor_schema, parse_monitor};

/// Longer side of the image that a [`Monitor`](crate::query::QueryKind::Monitor) query sends, pixels.
pub const IMAGE_SIDE: u32 = 384;
/// Width and height of the part of it that goes along enlarged, as a fraction of the image's: 384 pixels of a frame 960 wide.
pub const REGION: f64 = 0.4;

/// A target that should be visible, and whose track has not been good for this long, is lost.
const UNSEEN: Duration = Duration::from_secs(1);
/// So is one that this many replies in a row did not show.
const NOT_VISIBLE: u32 = 2;
/// A target whose box is higher than this fraction of the image may have been reached.
const TALL: f64 = 0.8;

/// How the flight to a target goes on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// As before.
    #[default]
    Continue,
    /// The instruction may be fulfilled: a second look is needed.
    Stop,
    /// The target should be visible, and is not.
    Lost,
    /// The craft is to move, and gets no nearer.
    Stuck,
}

/// Who gave a verdict.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum JudgedBy {
    /// The pilot, from its own measurements.
    Pilot,
    /// A VLM, in its reply to a [`Monitor`](crate::query::QueryKind::Monitor) query.
    Vlm,
}

/// A verdict as it is recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Judgement {
    /// The verdict.
    pub verdict: Verdict,
    /// Who gave it.
    pub by: JudgedBy,
    /// Of a lost target: the side on which it was last.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub side: Option<Look>,
    /// Whether it changes nothing: a reply about a newer frame, or another verdict, has been faster.
    #[serde(default, skip_serializing_if = "core::ops::Not::not")]
    pub outdated: bool,
}

/// What is known at one time about the target that is flown to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Observation {
    /// Quality of the target's track; `None` without a track.
    pub track: Option<TrackQuality>,
    /// Whether the target's place is in the image, and nothing known hides it.
    pub in_view: bool,
    /// Its distance and the standard deviation of that, metres.
    pub range: Option<(f64, f64)>,
    /// Height of its box, as a fraction of the image's.
    pub box_height: Option<f64>,
    /// Distance at which the instruction counts as fulfilled, metres; of the configuration.
    pub stop: f64,
    /// The path that is left to fly, metres.
    pub remaining: Option<f64>,
    /// Whether the craft was to move since the last observation.
    pub moving: bool,
}

/// Watches the flight to a target.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Watch {
    /// Since when the track of a target that should be visible has not been good.
    unseen: Option<Time>,
    /// Replies in a row that did not show a target which they might have shown.
    not_visible: u32,
    progress: Progress,
}

impl Watch {
    /// Takes what is known at `now`, about ten times a second; times must not go back.
    pub fn observe(&mut self, now: Time, seen: &Observation) -> Verdict {
        let is_bad = matches!(seen.track, Some(TrackQuality::Coasting | TrackQuality::Lost));
        if is_bad && seen.in_view {
            self.unseen.get_or_insert(now);
        } else {
            self.unseen = None;
        }
        let stuck = seen.remaining.is_some_and(|left| self.progress.is_stuck(now, seen.moving, left));
        let near = seen.range.is_some_and(|(range, sd)| range + 2.0 * sd < seen.stop);
        if self.unseen.is_some_and(|since| now.since(since) >= UNSEEN) || self.not_visible >= NOT_VISIBLE {
            Verdict::Lost
        } else if near || seen.box_height.is_some_and(|height| height > TALL) {
            Verdict::Stop
        } else if stuck {
            Verdict::Stuck
        } else {
            Verdict::Continue
        }
    }

    /// Takes whether a reply has shown the target. A reply about a view that could not show it counts neither way, and is left out.
    pub fn replied(&mut self, visible: bool) {
        self.not_visible = if visible { 0 } else { self.not_visible.saturating_add(1) };
    }

    /// Starts over: another target, or the flight to it has ended.
    pub fn reset(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A target ahead, 20 m away, on a good track, towards which the craft flies.
    fn ahead() -> Observation {
        Observation {
            track: Some(TrackQuality::Good),
            in_view: true,
            range: Some((20.0, 3.0)),
            box_height: Some(0.2),
            stop: 3.0,
            remaining: None,
            moving: true,
        }
    }

    /// The verdicts at 10 Hz, one per change.
    fn verdicts(seconds: f64, seen: impl Fn(f64) -> Observation) -> Vec<(f64, Verdict)> {
        let (mut watch, mut changes) = (Watch::default(), Vec::new());
        for tenth in 0..=(10.0 * seconds) as u32 {
            let at = 0.1 * f64::from(tenth);
            let verdict = watch.observe(Time::from_millis(100 * u64::from(tenth)), &seen(at));
            if changes.last().map_or(Verdict::Continue, |(_, last)| *last) != verdict {
                changes.push((at, verdict));
            }
        }
        changes
    }

    #[test]
    fn a_track_that_is_bad_for_a_second_is_lost_where_the_target_should_be() {
        for bad in [TrackQuality::Lost, TrackQuality::Coasting] {
            let lost_from =
                |from: f64| move |at: f64| Observation { track: (at >= from).then_some(bad).or(ahead().track), ..ahead() };
            assert_eq!(verdicts(5.0, lost_from(2.0)), [(3.0, Verdict::Lost)], "{bad:?}");
            // Behind something, or beside the image, a track that means nothing is no news.
            assert_eq!(verdicts(5.0, |at| Observation { in_view: false, ..lost_from(2.0)(at) }), []);
        }
        // Nothing can be tracked in a target of a few pixels.
        assert_eq!(verdicts(5.0, |_| Observation { track: Some(TrackQuality::TooSmall), ..ahead() }), []);
        assert_eq!(verdicts(5.0, |_| Observation { track: None, ..ahead() }), []);
        // 0.9 s, then good again.
        let blinks = |at: f64| Observation {
            track: Some(if at % 1.0 < 0.85 { TrackQuality::Lost } else { TrackQuality::Good }),
            ..ahead()
        };
        assert_eq!(verdicts(8.0, blinks), []);
    }

    #[test]
    fn two_replies_in_a_row_that_do_not_show_it_are_a_loss() {
        let now = Time::from_millis(0);
        let mut watch = Watch::default();
        for (visible, verdict) in [
            (false, Verdict::Continue),
            (true, Verdict::Continue),
            (false, Verdict::Continue),
            (false, Verdict::Lost),
            (false, Verdict::Lost),
            (true, Verdict::Continue),
        ] {
            watch.replied(visible);
            assert_eq!(watch.observe(now, &ahead()), verdict);
        }
        watch.replied(false);
        watch.replied(false);
        watch.reset();
        assert_eq!(watch.observe(now, &ahead()), Verdict::Continue);
    }

    #[test]
    fn near_and_sure_of_it_or_tall_asks_for_a_second_look() {
        let at = |range, box_height| Watch::default().observe(Time::ZERO, &Observation { range, box_height, ..ahead() });
        assert_eq!(at(Some((2.0, 0.4)), None), Verdict::Stop);
        assert_eq!(at(Some((2.0, 0.5)), None), Verdict::Continue, "3.0 m is not below 3.0 m");
        assert_eq!(at(Some((2.0, 0.6)), Some(0.3)), Verdict::Continue);
        assert_eq!(at(None, Some(0.81)), Verdict::Stop);
        assert_eq!(at(None, Some(0.8)), Verdict::Continue);
        assert_eq!(at(None, None), Verdict::Continue);
        // Lost comes first: what is not seen cannot have been reached.
        let mut watch = Watch::default();
        watch.replied(false);
        watch.replied(false);
        assert_eq!(watch.observe(Time::ZERO, &Observation { range: Some((1.0, 0.1)), ..ahead() }), Verdict::Lost);
    }

    #[test]
    fn a_craft_that_gets_no_nearer_in_four_seconds_of_motion_is_stuck() {
        let creeps = |speed: f64| move |at: f64| Observation { remaining: Some(20.0 - speed * at), ..ahead() };
        // 0.2 m in 4 s; the watch then starts over.
        assert_eq!(verdicts(4.05, creeps(0.05)), [(4.0, Verdict::Stuck)]);
        assert_eq!(verdicts(20.0, creeps(0.2)), []);
        // A craft that holds is not stuck.
        assert_eq!(verdicts(20.0, |at| Observation { moving: false, ..creeps(0.0)(at) }), []);
    }

    proptest! {
        /// Whatever is measured, a verdict has its cause.
        #[test]
        fn verdicts_have_causes(
            steps in proptest::collection::vec((0_u64..500, 0_u8..5, any::<bool>(), any::<[f64; 3]>(), any::<Option<bool>>()), 1..60),
        ) {
            let (mut watch, mut now, mut misses) = (Watch::default(), Time::ZERO, 0);
            for (passed, quality, in_view, [range, sd, height], reply) in steps {
                now += Duration::from_millis(passed);
                if let Some(visible) = reply {
                    watch.replied(visible);
                    misses = if visible { 0 } else { misses + 1 };
                }
                let track = [TrackQuality::Good, TrackQuality::Coasting, TrackQuality::Lost, TrackQuality::TooSmall].get(usize::from(quality)).copied();
                let seen = Observation { track, in_view, range: Some((range, sd)), box_height: Some(height), stop: 3.0, remaining: Some(range), moving: true };
                match watch.observe(now, &seen) {
                    Verdict::Lost => prop_assert!(misses >= 2 || in_view && matches!(track, Some(TrackQuality::Coasting | TrackQuality::Lost))),
                    Verdict::Stop => prop_assert!(range + 2.0 * sd < 3.0 || height > 0.8),
                    Verdict::Stuck => prop_assert!(now >= Time::ZERO + Duration::from_secs(4)),
                    Verdict::Continue => prop_assert!(misses < 2),
                }
            }
        }
    }
}
