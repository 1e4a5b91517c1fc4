//! `spf.bench`: trials of many tasks, in threads of their own, while the caller's thread answers.

use std::path::PathBuf;
use std::time::Duration;

use pyo3::prelude::*;
use serde_json::{Value, json};
use spf_api::bench::{BenchHappening, BenchRequest, Benching, CALLERS_METHOD, Caller, rows, start};
use spf_api::vlm::LATENCY_S;
use spf_bench::contrast::{Contrast, Scoring, across};
use spf_bench::stats::Rate;
use spf_bench::table::{Line, table};
use spf_bench::task::SUITES;
use spf_bench::trial::Record;

use crate::convert;
use crate::errors::{raised, wrong};
use crate::flying::{Answers, POLICY_LATENCY_S, name_of};

/// How often a wait looks for Ctrl-C.
const LOOK_UP: Duration = Duration::from_millis(50);

/// Flies a suite, or tasks; returns the rows. The documentation is that of `spf.bench.run`.
#[pyfunction]
#[pyo3(signature = (
    suite, tasks, methods, vlms, function, name, policy, trials, seed, folder, jobs, max_cost_usd, vlm_latency_s, on_progress
))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
pub(crate) fn bench_run<'py>(
    py: Python<'py>,
    suite: Option<String>,
    tasks: Vec<String>,
    methods: Vec<String>,
    vlms: Vec<String>,
    function: Option<Bound<'py, PyAny>>,
    name: Option<String>,
    policy: Option<Bound<'py, PyAny>>,
    trials: u64,
    seed: u64,
    folder: PathBuf,
    jobs: Option<usize>,
    max_cost_usd: Option<f64>,
    vlm_latency_s: Option<f64>,
    on_progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let mut request = BenchRequest { suite, tasks, methods, vlms, caller: None, trials, seed, folder, jobs, max_cost_usd };
    let answers = match (function, policy) {
        (None, None) if vlm_latency_s.is_some() => {
            return Err(wrong(
                py,
                "vlm_latency_s is that of a function or policy",
                "an oracle's stands in its name, as in vlm=\"oracle:default@2s\"; a vendor's is measured",
            ));
        }
        (None, None) if name.is_some() => return Err(wrong(py, "name is that of a function or policy", "leave it out")),
        (None, None) => None,
        (Some(_), Some(_)) => return Err(wrong(py, "a policy queries no VLM", "give a function as vlm, or policy")),
        (Some(function), None) => {
            request.caller =
                Some(Caller { name: name.unwrap_or_else(|| name_of(&function)), latency_s: vlm_latency_s.unwrap_or(LATENCY_S) });
            Some(Answers::Reply(function))
        }
        (None, Some(policy)) => {
            if !request.methods.is_empty() || !request.vlms.is_empty() {
                return Err(wrong(
                    py,
                    "a policy is flown by itself",
                    "fly other methods in a run of theirs, and compare the two",
                ));
            }
            request.methods = vec![CALLERS_METHOD.to_owned()];
            request.caller = Some(Caller {
                name: name.unwrap_or_else(|| name_of(&policy)),
                latency_s: vlm_latency_s.unwrap_or(POLICY_LATENCY_S),
            });
            Some(Answers::step(py, policy)?)
        }
    };
    let mut running = start(&request).map_err(|error| raised(py, &error))?;
    let mut failure: Option<PyErr> = None;
    loop {
        let happened = match py.detach(|| running.wait(LOOK_UP)) {
            Some(BenchHappening::Ended) => break,
            // Whatever happens until the trials under way have ended.
            _ if failure.is_some() => Ok(()),
            Some(BenchHappening::Question(question)) => match &answers {
                Some(answers) => answers.answer(py, question),
                None => Ok(()),
            },
            Some(BenchHappening::Progress { done, of }) => {
                on_progress.as_ref().map_or(Ok(()), |tell| tell.call1((done, of)).map(drop))
            }
            None => Ok(()),
        };
        if let Err(error) = py.check_signals().and(happened)
            && failure.is_none()
        {
            running.stop();
            failure = Some(error);
        }
    }
    let ended = py.detach(|| Benching::finish(running));
    match failure {
        Some(error) => Err(error),
        None => convert::json(py, &ended.map_err(|error| raised(py, &error))?),
    }
}

/// The names of the tasks of each suite, in order.
#[pyfunction]
pub(crate) fn bench_suites() -> Vec<(&'static str, Vec<&'static str>)> {
    SUITES.iter().map(|suite| (suite.name, suite.names().collect())).collect()
}

/// The rows in a folder, as dicts.
#[pyfunction]
pub(crate) fn bench_rows(py: Python<'_>, folder: PathBuf) -> PyResult<Bound<'_, PyAny>> {
    let rows = py.detach(|| rows(&folder)).map_err(|error| raised(py, &error))?;
    convert::json(py, &rows)
}

/// Success rates of rows by method and VLM, overall, by set and by category.
#[pyfunction]
pub(crate) fn bench_rates<'py>(py: Python<'py>, rows: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let lines: Vec<Value> = table(&records(py, rows)?).iter().map(line).collect();
    convert::json(py, &lines)
}

/// The methods and VLMs of some rows against those of others, on the same starts.
#[pyfunction]
pub(crate) fn bench_pairs<'py>(
    py: Python<'py>,
    first: &Bound<'py, PyAny>,
    second: &Bound<'py, PyAny>,
    verdict: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let Some(scoring) = Scoring::ALL.into_iter().find(|known| known.name() == verdict) else {
        return Err(wrong(py, format!("unknown verdict `{verdict}`"), "strict or paper"));
    };
    let pairs: Vec<Value> = across(&records(py, first)?, &records(py, second)?, scoring).iter().map(pair).collect();
    convert::json(py, &pairs)
}

fn records(py: Python<'_>, rows: &Bound<'_, PyAny>) -> PyResult<Vec<Record>> {
    let text: String = py.import("json")?.call_method1("dumps", (rows,))?.extract()?;
    serde_json::from_str(&text).map_err(|error| wrong(py, format!("these are no rows: {error}"), "rows of spf.bench.run"))
}

fn line(line: &Line) -> Value {
    json!({
        "method": line.method, "vlm": line.vlm, "set": line.set, "category": line.category, "group": line.group(),
        "strict": rate(line.strict), "paper": rate(line.paper), "collided": rate(line.collided),
    })
}

fn rate(rate: Rate) -> Value {
    let estimate = rate.estimate();
    json!({
        "hits": rate.hits, "of": rate.of, "value": estimate.map(|e| e.value), "low": estimate.map(|e| e.low),
        "high": estimate.map(|e| e.high),
    })
}

fn pair(pair: &Contrast) -> Value {
    let [value, low, high] = pair.points();
    let [first, second] = pair.pair.each_ref().map(|(method, vlm)| format!("{method} {vlm}"));
    let apart = pair.paired.discordant;
    json!({
        "first": first, "second": second, "points": value, "low": low, "high": high, "only_first": apart.first,
        "only_second": apart.second, "p": pair.p_holm,
    })
}
