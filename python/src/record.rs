//! Logs of flights, and their decisions.

use std::path::PathBuf;

use pyo3::prelude::*;
use spf_api::log::{FlightRecord, PoseAt};
use spf_flight::words;

use crate::convert::{json, pose, trajectory};
use crate::errors::raised;

/// One pass of see, point, fly: a reply, and what became of it.
#[pyclass(frozen, module = "spf")]
pub(crate) struct Decision {
    decision: spf_pilot::Decision,
}

impl Decision {
    pub(crate) fn new(decision: spf_pilot::Decision) -> Self {
        Self { decision }
    }
}

#[pymethods]
impl Decision {
    /// Its number, from 1.
    #[getter]
    fn number(&self) -> u32 {
        self.decision.number
    }

    /// When the reply arrived, seconds of flight time.
    #[getter]
    fn time_s(&self) -> f64 {
        self.decision.answered.as_secs_f64()
    }

    /// The decision in words, one line.
    #[getter]
    fn text(&self) -> String {
        words::decision(&self.decision)
    }

    /// What the policy does: `goto`, `move`, `look`, `done`, `reject` and others.
    #[getter]
    fn step(&self) -> &str {
        &self.decision.step
    }

    /// The reply's text as received.
    #[getter]
    fn reply(&self) -> &str {
        &self.decision.reply
    }

    /// The prompt that it answers.
    #[getter]
    fn prompt(&self) -> &str {
        &self.decision.query.prompt
    }

    /// Where the craft believed itself to be when the frame was captured.
    #[getter]
    fn pose<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        pose(py, &self.decision.pose)
    }

    /// Where the decision leads, or None if it moves nothing.
    #[getter]
    fn goal<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.decision.goal.as_ref().map(|goal| pose(py, goal)).transpose()
    }

    /// All of it as a dictionary: a row of the log's topic /decision.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json(py, &self.decision)
    }

    fn __repr__(&self) -> String {
        format!("{:6.1} s  {:>2}. {}", self.time_s(), self.number(), self.text())
    }
}

/// Decisions as a list.
pub(crate) fn decisions(record: &FlightRecord) -> Vec<Decision> {
    record.decisions.iter().cloned().map(Decision::new).collect()
}

/// What the log of a flight holds.
#[pyclass(frozen, module = "spf")]
pub(crate) struct FlightLog {
    record: FlightRecord,
}

#[pymethods]
impl FlightLog {
    /// Settings, craft, camera and limits, and in the simulator scene and seed, as a dictionary.
    #[getter]
    fn header<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json(py, &self.record.header)
    }

    /// The decisions, in order.
    #[getter]
    fn decisions(&self) -> Vec<Decision> {
        decisions(&self.record)
    }

    /// Where the craft believed itself to be, 20 times per second.
    #[getter]
    fn trajectory<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        trajectory(py, &self.record.trajectory)
    }

    /// Where it truly was at the same times; empty for a real drone.
    #[getter]
    fn true_trajectory<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        trajectory(py, &self.record.true_trajectory)
    }

    /// The result as in summary.json, or None in a log that ends before the flight did.
    #[getter]
    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json(py, &self.record.summary)
    }

    /// Whether the log ends before the flight did.
    #[getter]
    fn is_truncated(&self) -> bool {
        self.record.is_truncated
    }

    fn __repr__(&self) -> String {
        let FlightRecord { header, decisions, trajectory, .. } = &self.record;
        let seconds = trajectory.last().map_or(0.0, |&PoseAt { time_s, .. }| time_s);
        format!("<spf.FlightLog {:?}: {} decisions in {seconds:.1} s>", header.instruction, decisions.len())
    }
}

/// Reads a log, the file flight.mcap of a flight's folder; of a truncated one, what it holds.
///
/// Raises spf.UsageError if the file cannot be read, is no flight log, or is of another version.
#[pyfunction]
pub(crate) fn read_log(py: Python<'_>, path: PathBuf) -> PyResult<FlightLog> {
    let record = py.detach(|| spf_api::log::read_log(&path)).map_err(|error| raised(py, &error))?;
    Ok(FlightLog { record })
}
