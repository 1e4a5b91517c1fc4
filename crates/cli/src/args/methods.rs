//! Help texts of `--policy` and `--method`, from the table of methods.

use spf_bench::trial::Method;
use spf_flight::policy::PolicyKind;

/// Help of `--policy`: the names, grouped by kind.
pub(super) fn policies() -> String {
    let all = PolicyKind::all();
    let kinds = all.chunk_by(|one, next| one.words() == next.words()).map(|kind| {
        let names: Vec<&str> = kind.iter().map(|policy| policy.name()).collect();
        format!("{} ({})", names.join(", "), kind[0].words())
    });
    format!("Decision policy: {} [default: {}]", kinds.collect::<Vec<_>>().join("; "), PolicyKind::spf().name())
}

/// Help of the bench's `--method`: the names.
pub(super) fn methods() -> String {
    let names: Vec<&str> = Method::all().map(Method::name).collect();
    format!("Methods (see docs/guide/bench.md), comma-separated: {} [default: spf, or the suite's]", names.join(", "))
}
