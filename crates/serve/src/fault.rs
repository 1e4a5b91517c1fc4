//! Fault injection: one seeded machine shared by the virtual drones and the tests of flights.
//!
//! It is sans-IO: given message number `index` of a stream, sent at `now`, it returns when copies of it arrive and in
//! what state. The result depends only on the seed, the stream and the index, so neither the order of calls nor the
//! traffic of other streams changes it.
//!
//! ```
//! use spf_serve::fault::{Fault, FaultMachine, FaultPlan, Rule, Stream};
//! use spf_core::time::Time;
//!
//! let rule = Rule { stream: Stream::Frames, from: 10.0, until: Some(20.0), fault: Fault::Drop { p: 1.0 } };
//! let machine = FaultMachine::new(FaultPlan { rules: vec![rule], ..FaultPlan::default() }, 7)?;
//! assert_eq!(machine.pass(Time::from_millis(9_999), Stream::Frames, 3).len(), 1);
//! assert!(machine.pass(Time::from_millis(10_000), Stream::Frames, 4).is_empty());
//! # Ok::<(), spf_serve::fault::FaultError>(())
//! ```

use serde::{Deserialize, Serialize};
use spf_core::rng::RandomStream;
use spf_core::time::{Duration, Time, duration_from_secs};

/// The stream that is disturbed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stream {
    /// Camera frames from the craft to the pilot.
    Frames,
    /// Telemetry from the craft to the pilot.
    Telemetry,
    /// VLM replies.
    Replies,
    /// Commands from the pilot to the craft.
    Commands,
    /// The craft's responses to commands.
    Responses,
}

impl Stream {
    /// Its name among the streams of [`RandomStream`].
    fn purpose(self) -> &'static str {
        match self {
            Self::Frames => "fault frames",
            Self::Telemetry => "fault telemetry",
            Self::Replies => "fault replies",
            Self::Commands => "fault commands",
            Self::Responses => "fault responses",
        }
    }
}

/// What happens to a message. Probabilities are 0..=1, times in seconds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum Fault {
    /// The message is lost.
    Drop {
        /// Probability.
        p: f64,
    },
    /// The message is delayed by a normally distributed time, at least 0. Jitter that exceeds the interval between
    /// messages reorders them, as on a datagram link.
    Delay {
        /// Mean, s.
        mean: f64,
        /// Standard deviation, s.
        jitter: f64,
    },
    /// The message arrives twice.
    Duplicate {
        /// Probability.
        p: f64,
        /// Delay of the copy, s.
        after: f64,
    },
    /// The message is held back, so that later ones overtake it.
    Reorder {
        /// Probability.
        p: f64,
        /// Delay, s.
        by: f64,
    },
    /// Every `every` seconds messages are held back for `lasts` seconds, and then arrive all at once.
    Burst {
        /// Interval, s, from the beginning of the rule.
        every: f64,
        /// Time without arrivals at the beginning of each interval, s.
        lasts: f64,
    },
    /// The source is frozen: the last content from before the rule began arrives, with its capture counter.
    Freeze,
    /// Bits of the message are flipped.
    Corrupt {
        /// Probability.
        p: f64,
    },
    /// The message arrives empty: a blank frame, telemetry without values, a reply or command of zero length.
    Blank {
        /// Probability.
        p: f64,
    },
}

/// One fault of one stream during an interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rule {
    /// The affected stream.
    pub stream: Stream,
    /// From this flight time, s, inclusive.
    #[serde(default)]
    pub from: f64,
    /// Until this flight time, s, exclusive; `None`: to the end.
    #[serde(default)]
    pub until: Option<f64>,
    /// The fault.
    pub fault: Fault,
}

/// A fault of the craft itself, or of the whole link to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum CraftFault {
    /// No messages pass in either direction.
    LinkCut,
    /// The battery is nearly empty: the craft reports it, does not take off, and lands by itself.
    BatteryEmpty,
    /// The craft has no valid motion estimate: it refuses to fly to positions but still obeys velocities.
    ImuInvalid,
    /// Like [`ImuInvalid`](Self::ImuInvalid), but its telemetry also reports no attitude.
    ImuLost,
    /// The reported height, distance to the ground and vertical speed stay as they were when the rule began.
    HeightStuck,
    /// The reported horizontal speeds are zero.
    SpeedZero,
    /// The lens is covered: dark images with the sensor's noise.
    LensCovered,
    /// The camera shows black.
    VideoBlack,
    /// The camera shows a single colour.
    VideoUniform,
    /// Take-off is refused.
    TakeOffRefused,
    /// The craft restarts when the rule begins: the client must connect again, and in the air the motors stop.
    Reboot,
}

/// One fault of the craft during an interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CraftFaultRule {
    /// The fault.
    pub fault: CraftFault,
    /// From this flight time, s, inclusive.
    #[serde(default)]
    pub from: f64,
    /// Until this flight time, s, exclusive; `None`: to the end.
    #[serde(default)]
    pub until: Option<f64>,
}

/// All faults of a flight. Rules apply in order, each to the result of the earlier ones; delays add up.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FaultPlan {
    /// Message faults.
    #[serde(default)]
    pub rules: Vec<Rule>,
    /// Craft faults.
    #[serde(default)]
    pub craft: Vec<CraftFaultRule>,
}

/// An invalid rule.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FaultError {
    /// A probability outside 0..=1.
    #[error("fault rule `{rule}`: probability `{p}` must be 0 to 1")]
    Probability {
        /// Index of the rule.
        rule: usize,
        /// Its probability.
        p: f64,
    },
    /// A time that is negative or not finite.
    #[error("fault rule `{rule}`: `{field}` is `{value}` s, but must be 0 to 86400 s")]
    Time {
        /// Index of the rule.
        rule: usize,
        /// The field.
        field: &'static str,
        /// Its value.
        value: f64,
    },
    /// The rule ends before it begins.
    #[error("fault rule `{rule}`: it ends at `{until}` s, before it begins at `{from}` s")]
    Empty {
        /// Index of the rule.
        rule: usize,
        /// Start, s.
        from: f64,
        /// End, s.
        until: f64,
    },
}

/// State of a message on arrival.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Content {
    /// As sent.
    Intact,
    /// The last content sent before this time, in place of its own ([`Fault::Freeze`]).
    FrozenSince(Time),
    /// Some of its bits are flipped ([`Fault::Corrupt`]); this number determines which.
    Corrupt(u64),
    /// Empty ([`Fault::Blank`]).
    Blank,
}

/// One arrival of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Delivery {
    /// Time of arrival; never before it was sent.
    pub at: Time,
    /// State of the content.
    pub content: Content,
}

/// The fault machine. See the [module](self).
#[derive(Clone, Debug)]
pub struct FaultMachine {
    plan: FaultPlan,
    seed: u64,
}

/// Maximum number of copies of one message: rules that duplicate cannot multiply it without bound.
const MAX_COPIES: usize = 8;
/// Longest time in a rule, s: a day.
const MAX_TIME: f64 = 86_400.0;

impl FaultMachine {
    /// Creates a machine for `plan`.
    ///
    /// # Errors
    /// A [`FaultError`] for the first rule with a probability outside 0..=1, a time that is negative, not finite or
    /// longer than a day, or an end that is not after its start.
    pub fn new(plan: FaultPlan, seed: u64) -> Result<Self, FaultError> {
        for (rule, r) in plan.rules.iter().enumerate() {
            check(rule, r)?;
        }
        for (index, trouble) in plan.craft.iter().enumerate() {
            check_times(plan.rules.len() + index, trouble.from, trouble.until)?;
        }
        Ok(Self { plan, seed })
    }

    /// Whether the source of `stream` is frozen at `now`.
    #[must_use]
    pub fn freezes(&self, now: Time, stream: Stream) -> bool {
        self.plan.rules.iter().any(|rule| rule.stream == stream && rule.fault == Fault::Freeze && rule.applies(now))
    }

    /// Whether the craft has `fault` at `now`.
    #[must_use]
    pub fn has_fault(&self, now: Time, fault: CraftFault) -> bool {
        self.plan.craft.iter().any(|rule| rule.fault == fault && within(now, rule.from, rule.until))
    }

    /// The plan.
    #[must_use]
    pub fn plan(&self) -> &FaultPlan {
        &self.plan
    }

    /// Arrivals of message number `index` of `stream`, sent at `now`, earliest first; empty if it is lost. If no rule
    /// applies, it arrives intact at `now`.
    #[must_use]
    pub fn pass(&self, now: Time, stream: Stream, index: u64) -> Vec<Delivery> {
        let mut deliveries = vec![Delivery { at: now, content: Content::Intact }];
        for (number, rule) in self.plan.rules.iter().enumerate() {
            if rule.stream == stream && rule.applies(now) {
                let mut rng = RandomStream::new(self.seed, stream.purpose(), &[index, number as u64]);
                rule.apply(now, &mut rng, &mut deliveries);
            }
        }
        deliveries.sort();
        deliveries
    }
}

impl Rule {
    fn applies(&self, now: Time) -> bool {
        within(now, self.from, self.until)
    }

    fn apply(&self, now: Time, rng: &mut RandomStream, deliveries: &mut Vec<Delivery>) {
        let later = |d: &Delivery, by: Duration| Delivery { at: d.at + by, ..*d };
        match self.fault {
            Fault::Drop { p } => deliveries.retain(|_| !rng.chance(p)),
            Fault::Delay { mean, jitter } => {
                for d in deliveries {
                    *d = later(d, duration_from_secs(mean + jitter * rng.normal()));
                }
            }
            Fault::Duplicate { p, after } => {
                let copies: Vec<_> =
                    deliveries.iter().filter(|_| rng.chance(p)).map(|d| later(d, duration_from_secs(after))).collect();
                deliveries.extend(copies);
                deliveries.truncate(MAX_COPIES);
            }
            Fault::Reorder { p, by } => {
                for d in deliveries {
                    if rng.chance(p) {
                        *d = later(d, duration_from_secs(by));
                    }
                }
            }
            Fault::Burst { every, lasts } => {
                let begun = now.since(Time::from_secs_f64(self.from)).as_secs_f64();
                let within = if every > 0.0 { begun % every } else { begun };
                if within < lasts {
                    for d in deliveries {
                        *d = later(d, duration_from_secs(lasts - within));
                    }
                }
            }
            Fault::Freeze => {
                for d in deliveries {
                    // A blank message stays blank: it has no content to freeze.
                    if d.content == Content::Intact {
                        d.content = Content::FrozenSince(Time::from_secs_f64(self.from));
                    }
                }
            }
            Fault::Corrupt { p } => {
                for d in deliveries {
                    if rng.chance(p) && d.content == Content::Intact {
                        d.content = Content::Corrupt((rng.uniform() * (1_u64 << 53) as f64) as u64);
                    }
                }
            }
            Fault::Blank { p } => {
                for d in deliveries {
                    if rng.chance(p) {
                        d.content = Content::Blank;
                    }
                }
            }
        }
    }
}

fn within(now: Time, from: f64, until: Option<f64>) -> bool {
    now >= Time::from_secs_f64(from) && until.is_none_or(|until| now < Time::from_secs_f64(until))
}

fn check_time(rule: usize, field: &'static str, value: f64) -> Result<(), FaultError> {
    if (0.0..=MAX_TIME).contains(&value) { Ok(()) } else { Err(FaultError::Time { rule, field, value }) }
}

fn check_times(rule: usize, from: f64, until: Option<f64>) -> Result<(), FaultError> {
    check_time(rule, "from", from)?;
    let Some(until) = until else { return Ok(()) };
    check_time(rule, "until", until)?;
    if until <= from { Err(FaultError::Empty { rule, from, until }) } else { Ok(()) }
}

fn check(rule: usize, r: &Rule) -> Result<(), FaultError> {
    let probability = |p: f64| if (0.0..=1.0).contains(&p) { Ok(()) } else { Err(FaultError::Probability { rule, p }) };
    let time = |field, value| check_time(rule, field, value);
    check_times(rule, r.from, r.until)?;
    match r.fault {
        Fault::Drop { p } | Fault::Corrupt { p } | Fault::Blank { p } => probability(p),
        Fault::Delay { mean, jitter } => time("mean", mean).and(time("jitter", jitter)),
        Fault::Duplicate { p, after } => probability(p).and(time("after", after)),
        Fault::Reorder { p, by } => probability(p).and(time("by", by)),
        Fault::Burst { every, lasts } => time("every", every).and(time("lasts", lasts)),
        Fault::Freeze => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn machine(rules: &[(f64, f64, Fault)]) -> FaultMachine {
        let rules =
            rules.iter().map(|&(from, until, fault)| Rule { stream: Stream::Frames, from, until: Some(until), fault }).collect();
        FaultMachine::new(FaultPlan { rules, ..FaultPlan::default() }, 1).unwrap()
    }

    fn secs(secs: f64) -> Time {
        Time::from_secs_f64(secs)
    }

    #[test]
    fn without_a_rule_that_applies_everything_arrives_at_once() {
        let m = machine(&[(1.0, 2.0, Fault::Drop { p: 1.0 })]);
        let intact = vec![Delivery { at: secs(2.0), content: Content::Intact }];
        assert_eq!(m.pass(secs(2.0), Stream::Frames, 0), intact, "the end is exclusive");
        assert_eq!(m.pass(secs(1.0), Stream::Frames, 0), vec![], "the beginning inclusive");
        assert_eq!(m.pass(secs(1.5), Stream::Telemetry, 0).len(), 1, "another stream");
    }

    #[test]
    fn frequencies_are_those_of_the_rule() {
        let m = machine(&[(0.0, 1.0, Fault::Drop { p: 0.3 }), (0.0, 1.0, Fault::Duplicate { p: 0.5, after: 0.1 })]);
        let counts: Vec<usize> = (0..10_000).map(|i| m.pass(secs(0.5), Stream::Frames, i).len()).collect();
        let fraction = |n: usize| counts.iter().filter(|&&c| c == n).count() as f64 / 1e4;
        // 0.3 lost; 0.7 · 0.5 once; 0.7 · 0.5 twice; three standard deviations are 0.015.
        assert!((fraction(0) - 0.3).abs() < 0.015 && (fraction(1) - 0.35).abs() < 0.015 && (fraction(2) - 0.35).abs() < 0.015);
    }

    #[test]
    fn delays_are_normal_and_never_before_sending() {
        let m = machine(&[(0.0, 1.0, Fault::Delay { mean: 0.2, jitter: 0.05 })]);
        let delays: Vec<f64> =
            (0..10_000).map(|i| m.pass(secs(0.5), Stream::Frames, i)[0].at.since(secs(0.5)).as_secs_f64()).collect();
        let mean = delays.iter().sum::<f64>() / 1e4;
        assert!((mean - 0.2).abs() < 0.002, "{mean}");
        let wild = machine(&[(0.0, 1.0, Fault::Delay { mean: 0.0, jitter: 9.0 })]);
        assert!((0..100).all(|i| wild.pass(secs(0.5), Stream::Frames, i)[0].at >= secs(0.5)));
    }

    #[test]
    fn a_burst_arrives_at_the_end_of_its_pause() {
        let m = machine(&[(1.0, 9.0, Fault::Burst { every: 3.0, lasts: 1.5 })]);
        let arrives = |at: f64| m.pass(secs(at), Stream::Frames, 3)[0].at;
        for (sent, arrival) in [(0.5, 0.5), (1.0, 2.5), (2.25, 2.5), (2.5, 2.5), (3.75, 3.75), (4.0, 5.5), (5.25, 5.5)] {
            assert_eq!(arrives(sent), secs(arrival), "{sent}");
        }
    }

    #[test]
    fn frozen_and_blank_are_distinguished() {
        let m = machine(&[(1.0, 3.0, Fault::Freeze), (2.0, 3.0, Fault::Blank { p: 1.0 })]);
        assert_eq!(m.pass(secs(1.5), Stream::Frames, 0)[0].content, Content::FrozenSince(secs(1.0)));
        assert_eq!(m.pass(secs(2.5), Stream::Frames, 1)[0].content, Content::Blank);
    }

    #[test]
    fn troubles_of_the_craft_hold_for_their_time() {
        let text = r#"{"craft": [{"fault": "link_cut", "from": 2, "until": 4}, {"fault": "imu_invalid"}]}"#;
        let m = FaultMachine::new(serde_json::from_str(text).unwrap(), 0).unwrap();
        let cut: Vec<bool> = [1.9, 2.0, 3.9, 4.0].iter().map(|at| m.has_fault(secs(*at), CraftFault::LinkCut)).collect();
        assert_eq!(cut, [false, true, true, false]);
        assert!(m.has_fault(secs(0.0), CraftFault::ImuInvalid) && !m.has_fault(secs(0.0), CraftFault::BatteryEmpty));
        let backwards = r#"{"craft": [{"fault": "reboot", "from": 2, "until": 2}]}"#;
        assert!(FaultMachine::new(serde_json::from_str(backwards).unwrap(), 0).is_err());
    }

    #[test]
    fn corrupted_messages_differ_and_repeat() {
        let m = machine(&[(0.0, 1.0, Fault::Corrupt { p: 1.0 })]);
        let content = |index| m.pass(secs(0.5), Stream::Frames, index)[0].content;
        assert!(matches!(content(0), Content::Corrupt(_)));
        assert!(content(0) == content(0) && content(0) != content(1));
    }

    #[test]
    fn an_additional_rule_changes_no_sample_of_another() {
        let drop = (0.0, 1.0, Fault::Drop { p: 0.5 });
        let (one, two) = (machine(&[drop]), machine(&[drop, (0.0, 1.0, Fault::Freeze)]));
        let arrives = |m: &FaultMachine| (0..64).map(|i| m.pass(secs(0.1), Stream::Frames, i).len()).collect::<Vec<_>>();
        assert_eq!(arrives(&one), arrives(&two));
        assert!(arrives(&one).contains(&0) && arrives(&one).contains(&1));
    }

    #[test]
    fn nonsense_is_refused_with_its_rule() {
        let refused = |fault, from, until| {
            let rules = vec![Rule { stream: Stream::Replies, from, until, fault }];
            FaultMachine::new(FaultPlan { rules, ..FaultPlan::default() }, 0).unwrap_err().to_string()
        };
        assert_eq!(refused(Fault::Drop { p: 1.5 }, 0.0, None), "fault rule `0`: probability `1.5` must be 0 to 1");
        assert_eq!(
            refused(Fault::Delay { mean: f64::NAN, jitter: 0.0 }, 0.0, None),
            "fault rule `0`: `mean` is `NaN` s, but must be 0 to 86400 s"
        );
        assert_eq!(refused(Fault::Freeze, 2.0, Some(1.0)), "fault rule `0`: it ends at `1` s, before it begins at `2` s");
    }

    #[test]
    fn a_plan_reads_from_json() {
        let text = r#"{"rules": [{"stream": "replies", "fault": {"drop": {"p": 1.0}}},
            {"stream": "frames", "from": 5, "until": 9, "fault": "freeze"}]}"#;
        let plan: FaultPlan = serde_json::from_str(text).unwrap();
        assert_eq!(plan.rules[0], Rule { stream: Stream::Replies, from: 0.0, until: None, fault: Fault::Drop { p: 1.0 } });
        assert_eq!(plan.rules[1].fault, Fault::Freeze);
    }

    proptest! {
        /// Neither the order of calls nor other messages matter; nothing arrives before it was sent.
        #[test]
        fn what_happens_follows_from_seed_stream_and_index(seed: u64, index in 0..1000u64, p in 0.0..1.0_f64, jitter in 0.0..1.0_f64) {
            let rules = [Fault::Delay { mean: 0.1, jitter }, Fault::Duplicate { p, after: 0.0 }, Fault::Drop { p }, Fault::Reorder { p, by: 0.3 }]
                .map(|fault| Rule { stream: Stream::Commands, from: 0.0, until: None, fault }).to_vec();
            let plan = FaultPlan { rules, ..FaultPlan::default() };
            let (a, b) = (FaultMachine::new(plan.clone(), seed).unwrap(), FaultMachine::new(plan, seed).unwrap());
            let _ = b.pass(secs(0.0), Stream::Commands, index + 1);
            let arrivals = a.pass(secs(1.0), Stream::Commands, index);
            prop_assert_eq!(&arrivals, &b.pass(secs(1.0), Stream::Commands, index));
            prop_assert!(arrivals.len() <= MAX_COPIES && arrivals.iter().all(|d| d.at >= secs(1.0)));
            prop_assert!(arrivals.is_sorted());
        }
    }
}
