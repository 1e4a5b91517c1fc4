//! A trial of VLMs (`spf vlm trial`): calibration dots, pointing questions and flights of one model on one page
//! (docs/guide/vlm.md).

pub mod echo;
mod habit;
mod page;

use serde::{Deserialize, Serialize};
use spf_core::reply::Status;
use spf_flight::dataset::Kind;
use spf_vlm::Usage;

pub use echo::EchoRow;
pub use habit::LabelCalibration;
pub use page::page;

use self::echo::repeated;
use crate::ground::measure::{Graded, Measures};
use crate::ground::{Item, ParsedReply};
use crate::stats::{Rate, median, percentile};
use crate::trial::Record;

/// Bands of target sizes: names, and upper limits of √(pixels) at the camera's size.
const SIZES: [(&str, f64); 4] =
    [("under 24 px", 24.0), ("24 to 48 px", 48.0), ("48 to 96 px", 96.0), ("96 px and more", f64::INFINITY)];
/// A target farther away than this many times the scene's `near` is not reached.
const FAR: f64 = 3.0;

/// The result of the calibration dots.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DotCheck {
    /// Name of the VLM.
    pub vlm: String,
    /// Whether it points at them.
    pub good: bool,
    /// Whether no reply came.
    #[serde(default)]
    pub silent: bool,
    /// The result in words.
    pub words: String,
    /// Latency of each reply, seconds.
    pub latencies_s: Vec<f64>,
    /// Resources used.
    pub account: Usage,
}

/// A rate of a group.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Group {
    /// Its name.
    pub name: String,
    /// The rate.
    pub rate: Rate,
}

/// What was found about one VLM.
#[derive(Clone, Debug, Serialize)]
pub struct Findings {
    /// Its name.
    pub vlm: String,
    /// The calibration dots; `None` if they were not sent.
    pub dots: Option<DotCheck>,
    /// Pointing.
    pub pointing: Measures,
    /// Hits by size of the target.
    pub by_size: Vec<Group>,
    /// Correct answers by kind of question: hits, and "not visible" for absent targets.
    pub by_kind: Vec<Group>,
    /// `done` about targets that are far away.
    pub far_done: Rate,
    /// Answers that repeat the point of the one before, although the target has moved in the image.
    pub echo: Rate,
    /// What showing parts of images cost, US dollars, where known.
    pub echo_cost_usd: Option<f64>,
    /// Its depth labels; `None` without any.
    pub habit: Option<LabelCalibration>,
    /// Its flights.
    pub flights: Flights,
}

/// Flights of one VLM.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Flights {
    /// Flights that ended by `done` at the goal.
    pub strict: Rate,
    /// Flights in which `done` was false.
    pub false_done: Rate,
    /// Flights with a collision.
    pub collided: Rate,
    /// Number of queries.
    pub queries: u64,
    /// Queries without a reply that could be used.
    pub unusable: u64,
    /// Median of the flights' median latencies, seconds.
    pub latency_p50_s: Option<f64>,
    /// Maximum of the flights' 95th percentiles, seconds.
    pub latency_p95_s: Option<f64>,
    /// Input tokens.
    pub tokens_in: u64,
    /// Output tokens, including reasoning.
    pub tokens_out: u64,
    /// Cost in US dollars, where known.
    pub cost_usd: Option<f64>,
    /// The flights.
    pub rows: Vec<Record>,
}

impl Findings {
    /// The findings about a VLM, from its dots, its graded answers about `items`, its answers about parts of images, and its
    /// flights.
    #[must_use]
    pub fn of(
        vlm: &str,
        dots: Option<DotCheck>,
        items: &[Item],
        pointing: Measures,
        graded: &[Graded],
        echoes: &[EchoRow],
        records: Vec<Record>,
    ) -> Self {
        let by_size = SIZES.iter().enumerate().map(|(band, (name, _))| {
            let of_band = |graded: &&Graded| size_of(&items[graded.item]).is_some_and(|size| band_of(size) == band);
            let rate = graded.iter().filter(of_band).filter_map(|graded| graded.grade.hit).collect();
            Group { name: (*name).to_owned(), rate }
        });
        let kinds =
            [(Kind::Present, "target in the image"), (Kind::LookAlike, "with a look-alike"), (Kind::Absent, "target absent")];
        let by_kind = kinds.iter().map(|(kind, name)| {
            let of_kind = |graded: &&Graded| kind_of(&items[graded.item]) == Some(*kind);
            let right = |graded: &Graded| match kind {
                Kind::Absent => Some(graded.grade.says_absent == Some(true)),
                _ => graded.grade.hit,
            };
            Group { name: (*name).to_owned(), rate: graded.iter().filter(of_kind).filter_map(right).collect() }
        });
        let far = graded.iter().filter(|graded| is_far(&items[graded.item]));
        let is_done = |graded: &Graded| match &graded.row.parsed {
            ParsedReply::Reply(reply) => Some(reply.status == Status::Done),
            _ => None,
        };
        let echoes: Vec<EchoRow> = echoes.iter().filter(|row| row.vlm == vlm).cloned().collect();
        let echo_costs: Vec<f64> = echoes.iter().filter_map(|row| row.account.cost_usd).collect();
        let labels: Vec<(f64, f64)> = graded.iter().filter_map(|graded| graded.grade.label).collect();
        Self {
            vlm: vlm.to_owned(),
            dots,
            by_size: by_size.filter(|group| group.rate.of > 0).collect(),
            by_kind: by_kind.filter(|group| group.rate.of > 0).collect(),
            far_done: far.filter_map(is_done).collect(),
            echo: repeated(&echoes),
            echo_cost_usd: (!echo_costs.is_empty()).then(|| echo_costs.iter().sum()),
            habit: LabelCalibration::of(labels),
            flights: Flights::of(records),
            pointing,
        }
    }

    /// Cost of everything, US dollars; `None` if no cost is known.
    #[must_use]
    pub fn cost_usd(&self) -> Option<f64> {
        let dots = self.dots.as_ref().and_then(|dots| dots.account.cost_usd);
        let costs = [dots, self.pointing.cost_usd_total, self.echo_cost_usd, self.flights.cost_usd];
        let costs: Vec<f64> = costs.into_iter().flatten().collect();
        (!costs.is_empty()).then(|| costs.iter().sum())
    }
}

impl Flights {
    fn of(rows: Vec<Record>) -> Self {
        let flown = || rows.iter().filter(|row| row.error.is_none());
        let costs: Vec<f64> = flown().filter_map(|row| row.cost_usd).collect();
        let p50: Vec<f64> = flown().filter_map(|row| Some(row.latency_ms.as_ref()?.p50 / 1e3)).collect();
        let p95: Vec<f64> = flown().filter_map(|row| Some(row.latency_ms.as_ref()?.p95 / 1e3)).collect();
        Self {
            strict: rows.iter().map(|row| row.scores.strict).collect(),
            false_done: rows.iter().map(|row| row.scores.false_stop).collect(),
            collided: rows.iter().map(|row| row.scores.collided).collect(),
            queries: flown().map(|row| u64::from(row.n_vlm_calls)).sum(),
            unusable: flown().map(|row| u64::from(row.parse_failures)).sum(),
            latency_p50_s: median(&p50),
            latency_p95_s: percentile(&p95, 1.0),
            tokens_in: flown().map(|row| row.tokens_in).sum(),
            tokens_out: flown().map(|row| row.tokens_out).sum(),
            cost_usd: (!costs.is_empty()).then(|| costs.iter().sum()),
            rows,
        }
    }
}

/// √(pixels) of an item's target.
fn size_of(item: &Item) -> Option<f64> {
    let target = item.sim.as_ref()?.row.target.as_ref()?;
    Some(libm::sqrt(target.pixels as f64))
}

fn band_of(size: f64) -> usize {
    SIZES.iter().position(|(_, limit)| size < *limit).unwrap_or(SIZES.len() - 1)
}

fn kind_of(item: &Item) -> Option<Kind> {
    item.sim.as_ref().map(|sim| sim.row.kind)
}

/// Whether an item's target is too far away to be reached.
fn is_far(item: &Item) -> bool {
    let far = item.sim.as_ref().and_then(|sim| Some(sim.row.target.as_ref()?.nearest_m > FAR * sim.row.near_m));
    far == Some(true)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_follow_each_other() {
        assert_eq!([0.0, 23.9, 24.0, 48.0, 95.9, 96.0, 1e6].map(band_of), [0, 0, 1, 2, 2, 3, 3]);
    }
}
