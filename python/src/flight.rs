//! The result of a flight.

use std::path::PathBuf;

use pyo3::prelude::*;
use spf_flight::words;

use crate::convert::{json, trajectory};
use crate::record::{Decision, decisions};

/// The result of a flight, and its files. A notebook shows its map.
#[pyclass(frozen, module = "spf")]
pub(crate) struct Flight {
    flight: spf_api::flight::Flight,
}

impl Flight {
    pub(crate) fn new(flight: spf_api::flight::Flight) -> Self {
        Self { flight }
    }
}

#[pymethods]
impl Flight {
    /// What the pilot believes: reached, not_found, timeout, collision, aborted or failed.
    #[getter]
    fn outcome<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json(py, &self.flight.summary.outcome)
    }

    /// Whether ground truth confirms that the target was reached; None if it cannot tell.
    #[getter]
    fn verified(&self) -> Option<bool> {
        self.flight.summary.verified
    }

    /// Why the flight ended, in words.
    #[getter]
    fn cause(&self) -> &str {
        &self.flight.summary.cause
    }

    /// Keys of the objects of the scene that the instruction means.
    #[getter]
    fn targets(&self) -> Vec<String> {
        self.flight.summary.targets.clone()
    }

    /// The decisions, in order.
    #[getter]
    fn decisions(&self) -> Vec<Decision> {
        decisions(&self.flight.record)
    }

    /// Where the craft believed itself to be, 20 times per second.
    #[getter]
    fn trajectory<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        trajectory(py, &self.flight.record.trajectory)
    }

    /// Where it truly was at the same times.
    #[getter]
    fn true_trajectory<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        trajectory(py, &self.flight.record.true_trajectory)
    }

    /// The result as in summary.json, as a dictionary.
    #[getter]
    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json(py, &self.flight.summary)
    }

    /// The folder of its files.
    #[getter]
    fn folder(&self) -> PathBuf {
        self.flight.folder.clone()
    }

    /// The log, MCAP.
    #[getter]
    fn log_path(&self) -> PathBuf {
        self.flight.log_path()
    }

    /// The map with the trajectory, SVG.
    #[getter]
    fn map_path(&self) -> PathBuf {
        self.flight.map_path()
    }

    /// What was said before take-off: how the oracle reads the instruction, and that it is no real VLM.
    #[getter]
    fn announcements(&self) -> Vec<String> {
        self.flight.announcements.clone()
    }

    /// What could not be recorded, each with its reason.
    #[getter]
    fn recording_problems(&self) -> Vec<String> {
        self.flight.recording_problems.clone()
    }

    /// The video, MP4; None if none was asked for.
    #[getter]
    fn video_path(&self) -> Option<PathBuf> {
        let video = self.flight.folder.join("video.mp4");
        video.exists().then_some(video)
    }

    fn _repr_html_(&self, py: Python<'_>) -> PyResult<String> {
        let map = std::fs::read_to_string(self.flight.map_path())?;
        // What stands before the picture belongs to a file.
        let picture = map.find("<svg").map_or("", |at| &map[at..]);
        let told = self.__repr__().replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
        // In the cell itself: a notebook's page may not read files.
        let film = match self.video_path() {
            Some(video) => {
                let bytes = pyo3::types::PyBytes::new(py, &std::fs::read(video)?);
                let text: String =
                    py.import("base64")?.call_method1("b64encode", (bytes,))?.call_method1("decode", ("ascii",))?.extract()?;
                format!("<video controls style=\"max-width:720px\" src=\"data:video/mp4;base64,{text}\"></video>")
            }
            None => String::new(),
        };
        Ok(format!("<div><div style=\"max-width:720px\">{picture}</div>{film}<p>{told}</p></div>"))
    }

    fn __repr__(&self) -> String {
        let summary = &self.flight.summary;
        let verified = match summary.verified {
            Some(true) => ", verified by ground truth",
            Some(false) => ", not confirmed by ground truth",
            None => "",
        };
        let decisions = words::counted(summary.decisions, "decision");
        format!(
            "<spf.Flight {:?}: {}{verified}; {decisions}, {:.1} m in {:.1} s, VLM {}>",
            summary.title(),
            words::outcome(summary.outcome),
            summary.path_length_m,
            summary.finished_at_s,
            summary.vlm
        )
    }
}
