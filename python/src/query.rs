//! A query of a flight, as a function of the user sees it.

use std::sync::Arc;

use pyo3::prelude::*;
use spf_api::Question;

use crate::arrays::shared;
use crate::convert::json;

/// A question of a flight about one frame, for a function that answers it.
#[pyclass(frozen, module = "spf")]
pub(crate) struct Query {
    question: Arc<Question>,
}

impl Query {
    pub(crate) fn new(question: Arc<Question>) -> Self {
        Self { question }
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
