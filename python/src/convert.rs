//! Values that several parts convert.

use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyType;
use serde::Serialize;
use spf_api::log::PoseAt;
use spf_core::craft::CraftKind;
use spf_core::geometry::{Attitude, EnuPosition, Pose};

use crate::arrays;
use crate::errors::wrong;

static POSE: PyOnceLock<Py<PyType>> = PyOnceLock::new();
static TRAJECTORY: PyOnceLock<Py<PyType>> = PyOnceLock::new();

/// A value as Python reads its JSON: dictionaries, lists, numbers, texts.
pub(crate) fn json<'py>(py: Python<'py>, value: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(value).map_err(|error| pyo3::exceptions::PyValueError::new_err(error.to_string()))?;
    py.import("json")?.call_method1("loads", (text,))
}

/// East, north and up in metres; heading, pitch and roll in degrees.
fn numbers(pose: &Pose) -> [f64; 6] {
    let (EnuPosition { east, north, up }, Attitude { heading, pitch, roll }) = (pose.position, pose.attitude);
    [east, north, up, heading.to_degrees(), pitch.to_degrees(), roll.to_degrees()]
}

/// A `spf.Pose`.
pub(crate) fn pose<'py>(py: Python<'py>, pose: &Pose) -> PyResult<Bound<'py, PyAny>> {
    let [east, north, up, heading, pitch, roll] = numbers(pose);
    POSE.import(py, "spf._types", "Pose")?.call1((east, north, up, heading, pitch, roll))
}

/// A `spf.Trajectory`.
pub(crate) fn trajectory<'py>(py: Python<'py>, poses: &[PoseAt]) -> PyResult<Bound<'py, PyAny>> {
    let times = arrays::numbers(py, poses.iter().map(|at| at.time_s), None)?;
    let rows = arrays::numbers(py, poses.iter().flat_map(|at| numbers(&at.pose)), Some(6))?;
    TRAJECTORY.import(py, "spf._types", "Trajectory")?.call1((times, rows))
}

/// A start: east, north and up in metres, heading and perhaps pitch in degrees.
pub(crate) fn start(py: Python<'_>, numbers: Option<Vec<f64>>) -> PyResult<Option<Pose>> {
    let Some(numbers) = numbers else { return Ok(None) };
    let text = numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
    spf_flight::pose::parse_pose(&text)
        .map(Some)
        .map_err(|expected| wrong(py, format!("start must be {expected}"), "start=(0, -20, 3, 90)"))
}

/// A craft by its name.
pub(crate) fn craft(py: Python<'_>, name: Option<&str>) -> PyResult<Option<CraftKind>> {
    let Some(name) = name else { return Ok(None) };
    let found = [CraftKind::Quad, CraftKind::Tello].into_iter().find(|kind| kind.name() == name);
    found.map(Some).ok_or_else(|| wrong(py, format!("unknown craft `{name}`"), "use quad or tello"))
}
