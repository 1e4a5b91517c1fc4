//! Errors as exceptions: `spf.Error`, with the program's words, and its hint as an attribute.

use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyType;
use spf_api::Error;
use spf_api::error::ErrorKind;

static USAGE: PyOnceLock<Py<PyType>> = PyOnceLock::new();
static OTHER: PyOnceLock<Py<PyType>> = PyOnceLock::new();

/// The exception for an error.
pub(crate) fn raised(py: Python<'_>, error: &Error) -> PyErr {
    let (class, name) = if error.kind() == ErrorKind::Usage { (&USAGE, "UsageError") } else { (&OTHER, "Error") };
    let made = class.import(py, "spf._types", name).and_then(|class| {
        let exception = class.call1((error.to_string(),))?;
        exception.setattr("hint", error.advice())?;
        Ok(exception)
    });
    made.map_or_else(|instead| instead, PyErr::from_value)
}

/// The exception for a wrong argument.
pub(crate) fn wrong(py: Python<'_>, message: impl Into<String>, hint: &str) -> PyErr {
    raised(py, &Error::usage(message).hint(hint))
}
