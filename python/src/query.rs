//! A query of a flight, as a function of the user sees it.

use std::sync::Arc;

use pyo3::prelude::*;
use spf_api::Question;
use spf_core::primitives::Primitives;
use spf_core::query::ImagePoint;

use crate::arrays::shared;
use crate::convert::json;
use crate::errors::{raised, wrong};
use crate::point::leads;

/// A question of a flight about one frame, for a function that answers it, or a policy.
#[pyclass(frozen, module = "spf")]
pub(crate) struct Query {
    question: Arc<Question>,
}

impl Query {
    pub(crate) fn new(question: Arc<Question>) -> Self {
        Self { question }
    }

    /// A point in pixels as fractions of the image.
    fn point(&self, (x, y): (f64, f64)) -> ImagePoint {
        let image = self.question.image();
        ImagePoint { u: x / f64::from(image.width()), v: y / f64::from(image.height()) }
    }

    /// Answers for a policy with what it returned: a step of `spf._types`.
    pub(crate) fn step(&self, py: Python<'_>, step: &Bound<'_, PyAny>) -> PyResult<()> {
        let name = step.get_type().name()?;
        let number = |field: &str| step.getattr(field)?.extract::<f64>();
        let answered = match name.to_str()? {
            "Move" => self.question.answer_move(Primitives {
                forward: number("forward")?,
                right: number("right")?,
                climb: number("up")?,
                yaw: number("turn_deg")?.to_radians(),
            }),
            "Point" => self.question.answer_point(self.point((number("x")?, number("y")?)), number("label")?),
            "Hold" => {
                self.question.answer_hold();
                return Ok(());
            }
            "Done" => {
                self.question.answer_done();
                return Ok(());
            }
            other => {
                let message = format!("a policy returned `{other}`, not a step");
                return Err(wrong(py, message, "return spf.Move, spf.Point, spf.Hold or spf.Done"));
            }
        };
        answered.map_err(|error| raised(py, &error))
    }
}

#[pymethods]
impl Query {
    /// The instruction.
    #[getter]
    fn instruction(&self) -> &str {
        &self.question.query().instruction
    }

    /// The whole text that a VLM would be sent: the task, the form of the reply, and what has happened so far.
    #[getter]
    fn prompt(&self) -> &str {
        &self.question.query().prompt
    }

    /// The image, (H, W, 3) of uint8, sRGB, rows from the top. It is read-only and shares the memory of the frame.
    #[getter]
    fn image(slf: Bound<'_, Self>) -> PyResult<Bound<'_, PyAny>> {
        let image = slf.get().question.image().clone();
        shared(&[image.height() as usize, image.width() as usize, 3], image.data(), slf.into_any())
    }

    /// The JSON schema of the reply, or None if any text is allowed.
    #[getter]
    fn schema<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json(py, &self.question.schema())
    }

    /// Whether the last answer was `done` and is asked again, with the craft at rest, to be believed.
    #[getter]
    fn confirming(&self) -> bool {
        self.question.query().memory.confirming
    }

    /// The moves that a policy has flown last, in words, at most five; empty for a function that is the VLM.
    #[getter]
    fn moves(&self) -> Vec<String> {
        self.question.query().memory.actions.clone()
    }

    /// Where a point of the image leads with a depth label, 1 to 10, in level flight, as spf.lift of this camera: a dict with step_m,
    /// right_m, forward_m, up_m, and the same as a turn and a flight, yaw_deg, distance_m, climb_m.
    ///
    /// point: (x, y) in pixels of the image. Raises spf.UsageError for a point outside it.
    fn lift<'py>(&self, py: Python<'py>, point: (f64, f64), label: f64) -> PyResult<Bound<'py, PyAny>> {
        let lifted = self.question.lift(self.point(point), label).map_err(|error| raised(py, &error))?;
        leads(py, &lifted)
    }

    /// The distance from the target within which the instruction counts as fulfilled, metres; None if none is stated.
    #[getter]
    fn near_m(&self) -> Option<f64> {
        self.question.query().near_m
    }

    /// What is known of the flight so far, as numbers: a dict as `memory` in the topic /query of the flight log. For a function that is
    /// the VLM it has the last answers and what was flown since the last image (since_image); always the height above the take-off
    /// point and how far the craft may climb and sink (room), metres.
    #[getter]
    fn history<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json(py, &self.question.query().memory)
    }

    /// The number of the query, from 0.
    #[getter]
    fn number(&self) -> u64 {
        self.question.query().id.0
    }

    fn __repr__(&self) -> String {
        let (query, image) = (self.question.query(), self.question.image());
        format!("<spf.Query {}: {:?}, image {}×{}>", query.id.0, query.instruction, image.width(), image.height())
    }
}
