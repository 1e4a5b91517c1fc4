//! Help of the bench's `--method`, from the table of methods.

use spf_bench::trial::Method;

/// The help: the names.
pub(super) fn methods() -> String {
    let names: Vec<&str> = Method::all().map(Method::name).collect();
    format!("Methods (see docs/guide/bench.md), comma-separated: {} [default: spf, or the suite's]", names.join(", "))
}
