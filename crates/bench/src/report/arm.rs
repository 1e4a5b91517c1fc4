//! Arms of a comparison: a method with a VLM.

use crate::measures::{Means, Navigation};
use crate::stats::{Rate, median, percentile};
use crate::table::vlm_of;
use crate::trial::{NO_VLM, Record};

/// A method with a VLM.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Arm {
    /// The method.
    pub method: String,
    /// The VLM, as in the trial's name.
    pub vlm: String,
    /// Index of the method in the report: its colour and mark.
    pub(super) colour: usize,
    /// Index of the VLM among those of this method: its dash pattern.
    pub(super) dash: usize,
}

/// Summary statistics of an arm.
pub(super) struct Sums {
    pub(super) strict: Rate,
    pub(super) paper: Rate,
    pub(super) collided: Rate,
    pub(super) false_stop: Rate,
    pub(super) timeout: Rate,
    /// Completion times of the successes, seconds, in order.
    pub(super) times: Vec<f64>,
    /// Measures of navigation, over the trials that have them.
    pub(super) navigation: Means,
    /// Median of the trials' median latencies, seconds.
    pub(super) latency_s: Option<f64>,
}

impl Arm {
    /// All arms, in order of appearance.
    pub(super) fn all(records: &[Record]) -> Vec<Self> {
        let (mut arms, mut methods, mut vlms): (Vec<Self>, Vec<String>, Vec<String>) = Default::default();
        for record in records {
            if arms.iter().any(|arm| arm.flew(record)) {
                continue;
            }
            let vlm = vlm_of(record);
            let dash = if vlm == NO_VLM { 0 } else { place(&mut vlms, &vlm) };
            arms.push(Self { colour: place(&mut methods, &record.method), dash, method: record.method.clone(), vlm });
        }
        arms
    }

    pub(super) fn flew(&self, record: &Record) -> bool {
        self.method == record.method && record.run_id.split('/').nth(2) == Some(self.vlm.as_str())
    }

    /// Display name.
    pub(super) fn name(&self) -> String {
        name(&self.method, &self.vlm)
    }

    /// Whether it is the blind control.
    pub(super) fn is_blind(&self) -> bool {
        self.vlm == NO_VLM
    }

    /// The oracle's error level, if an oracle was used, whatever its latency (`oracle-default-3s`).
    pub(super) fn level(&self) -> Option<&str> {
        let is_latency = |word: &str| word.strip_suffix('s').is_some_and(|seconds| seconds.parse::<f64>().is_ok());
        let untimed = self.vlm.rsplit_once('-').filter(|(_, last)| is_latency(last));
        match untimed.map_or(self.vlm.as_str(), |(vlm, _)| vlm).strip_prefix("oracle") {
            Some("") => Some("default"),
            Some(level) => level.strip_prefix('-'),
            None => None,
        }
    }

    /// Whether a vision-language model was used, or a recording of one.
    pub(super) fn is_real(&self) -> bool {
        !self.is_blind() && self.level().is_none()
    }
}

/// The display name of an arm.
pub(super) fn name(method: &str, vlm: &str) -> String {
    if vlm == NO_VLM { method.to_owned() } else { format!("{method} · {vlm}") }
}

fn place(among: &mut Vec<String>, name: &str) -> usize {
    among.iter().position(|known| known == name).unwrap_or_else(|| {
        among.push(name.to_owned());
        among.len() - 1
    })
}

impl Sums {
    /// Statistics of some rows.
    pub(super) fn of<'a>(records: impl Iterator<Item = &'a Record>) -> Self {
        let records: Vec<&Record> = records.collect();
        let rate = |hit: fn(&Record) -> bool| records.iter().map(|record| hit(record)).collect::<Rate>();
        let latencies = records.iter().filter_map(|record| Some(record.latency_ms.as_ref()?.p50 / 1e3));
        Self {
            strict: rate(|record| record.scores.strict),
            paper: rate(|record| record.scores.paper),
            collided: rate(|record| record.scores.collided),
            false_stop: rate(|record| record.scores.false_stop),
            timeout: rate(|record| record.scores.timeout),
            times: records.iter().filter_map(|record| completion(record)).collect(),
            navigation: Means::of(&records.iter().filter_map(|record| record.navigation()).collect::<Vec<Navigation>>()),
            latency_s: median(&latencies.collect::<Vec<f64>>()),
        }
    }

    /// Quartiles of the completion times.
    pub(super) fn quartiles(&self) -> Option<[f64; 3]> {
        let at = |fraction| percentile(&self.times, fraction);
        Some([at(0.25)?, at(0.5)?, at(0.75)?])
    }
}

/// Completion time of a success by the verdict strict, seconds from the first motion.
pub(super) fn completion(record: &Record) -> Option<f64> {
    record.flight.as_ref().filter(|_| record.scores.strict)?.completion_time_s
}
