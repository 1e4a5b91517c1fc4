//! What can happen to the messages between the pilot and its craft: a small part of `spf_serve::fault`, which the core cannot use.

use super::{Duration, Time, secs};
use spf_core::rng::RandomStream;

/// The stream that is disturbed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Stream {
    Frames,
    Telemetry,
    Replies,
    Commands,
}

/// What happens to a message. Probabilities are 0..=1, times in seconds.
#[derive(Clone, Copy, Debug)]
pub(super) enum Fault {
    Drop,
    Delay {
        by: f64,
    },
    Duplicate {
        p: f64,
        after: f64,
    },
    Reorder {
        p: f64,
        by: f64,
    },
    /// The last content from before the rule began arrives.
    Freeze,
    /// The message arrives empty.
    Blank {
        p: f64,
    },
}

/// One fault of one stream from a time until another.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rule {
    pub(super) stream: Stream,
    pub(super) from: f64,
    pub(super) until: Option<f64>,
    pub(super) fault: Fault,
}

/// State of a message on arrival.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Content {
    Intact,
    FrozenSince(Time),
    Blank,
}

/// Delays and states of the copies of message number `index` of a stream, sent at `now`; none if it is lost.
pub(super) fn pass(rules: &[Rule], now: Time, stream: Stream, index: u64) -> Vec<(Duration, Content)> {
    let mut copies = vec![(Duration::ZERO, Content::Intact)];
    for (number, rule) in rules.iter().enumerate() {
        let begun = now >= Time::from_secs_f64(rule.from);
        let ended = rule.until.is_some_and(|until| now >= Time::from_secs_f64(until));
        if rule.stream == stream && begun && !ended {
            let mut random = RandomStream::new(1, &format!("{stream:?}"), &[index, number as u64]);
            rule.apply(&mut random, &mut copies);
        }
    }
    copies
}

impl Rule {
    fn apply(&self, random: &mut RandomStream, copies: &mut Vec<(Duration, Content)>) {
        match self.fault {
            Fault::Drop => copies.clear(),
            Fault::Delay { by } => copies.iter_mut().for_each(|copy| copy.0 += secs(by)),
            Fault::Duplicate { p, after } => {
                for (delay, content) in copies.clone() {
                    if random.chance(p) {
                        copies.push((delay + secs(after), content));
                    }
                }
            }
            Fault::Reorder { p, by } => {
                for copy in copies {
                    if random.chance(p) {
                        copy.0 += secs(by);
                    }
                }
            }
            Fault::Freeze => copies.iter_mut().for_each(|copy| copy.1 = Content::FrozenSince(Time::from_secs_f64(self.from))),
            Fault::Blank { p } => {
                for copy in copies {
                    if random.chance(p) {
                        copy.1 = Content::Blank;
                    }
                }
            }
        }
    }
}
