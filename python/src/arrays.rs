//! Arrays of NumPy: of memory that stays where it is, and of numbers.

use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

/// A number that an array can hold.
pub(crate) trait Element {
    /// Its letter and size, as NumPy writes them.
    const KIND: &'static str;
}

impl Element for u8 {
    const KIND: &'static str = "u1";
}

impl Element for u16 {
    const KIND: &'static str = "u2";
}

impl Element for f32 {
    const KIND: &'static str = "f4";
}

/// Memory of another object, which this one keeps alive, by NumPy's array interface: neither a copy nor `unsafe` is needed.
#[pyclass(frozen)]
struct Memory {
    address: usize,
    shape: Vec<usize>,
    kind: &'static str,
    #[expect(dead_code, reason = "held so that the memory stays")]
    owner: Py<PyAny>,
}

#[pymethods]
impl Memory {
    #[getter]
    fn __array_interface__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let order = if cfg!(target_endian = "little") { '<' } else { '>' };
        let interface = PyDict::new(py);
        interface.set_item("version", 3)?;
        interface.set_item("shape", pyo3::types::PyTuple::new(py, &self.shape)?)?;
        interface.set_item("typestr", format!("{order}{}", self.kind))?;
        // True: nobody may write to it.
        interface.set_item("data", (self.address, true))?;
        Ok(interface)
    }
}

/// A read-only array of this shape over `data`, without a copy. It keeps `owner` alive.
///
/// `data` must have as many elements as the shape, belong to `owner`, stay where it is, and never change: this is for frozen classes that
/// own their data through an `Arc` or a cell that is written once.
pub(crate) fn shared<'py, T: Element>(shape: &[usize], data: &[T], owner: Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    assert_eq!(shape.iter().product::<usize>(), data.len(), "an array has as many elements as its memory");
    let py = owner.py();
    let memory = Memory { address: data.as_ptr().addr(), shape: shape.to_vec(), kind: T::KIND, owner: owner.unbind() };
    py.import("numpy")?.call_method1("asarray", (Py::new(py, memory)?,))
}

/// A read-only array of numbers, in rows of `columns` unless that is `None`.
pub(crate) fn numbers<'py>(
    py: Python<'py>,
    numbers: impl Iterator<Item = f64>,
    columns: Option<usize>,
) -> PyResult<Bound<'py, PyAny>> {
    let bytes: Vec<u8> = numbers.flat_map(f64::to_ne_bytes).collect();
    let array = py.import("numpy")?.call_method1("frombuffer", (PyBytes::new(py, &bytes),))?;
    match columns {
        Some(columns) => array.call_method1("reshape", (-1, columns)),
        None => Ok(array),
    }
}
