//! The native part of the Python module `spf`: what [`spf_api`] offers, as Python's types. The guide is `docs/guide/python.md`.
//!
//! Nothing here decides anything of a flight, and nothing can make a cleared command. While Rust works, other threads of Python run.

#![forbid(unsafe_code)]

mod arrays;
mod bench;
mod convert;
mod errors;
mod flight;
mod flying;
mod point;
mod query;
mod record;
mod simulator;

use pyo3::prelude::*;

#[pymodule]
mod _native {
    #[pymodule_export]
    use super::bench::{bench_pairs, bench_rates, bench_rows, bench_run, bench_suites};
    #[pymodule_export]
    use super::flight::Flight;
    #[pymodule_export]
    use super::flying::fly;
    #[pymodule_export]
    use super::point::{lift, parse_reply, prompt};
    #[pymodule_export]
    use super::query::Query;
    #[pymodule_export]
    use super::record::{Decision, FlightLog, read_log};
    #[pymodule_export]
    use super::simulator::{Observation, Simulator, scenes, step_all};
}
