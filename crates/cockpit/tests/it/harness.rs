//! What tests that need programs of others share.

/// Skips with a notice if a tool is missing; on CI it must exist.
#[allow(clippy::print_stderr, reason = "tests may print; the library may not")]
pub(crate) fn skip(what: &str) {
    assert!(std::env::var_os("CI").is_none_or(|ci| ci != "true"), "{what} is missing on CI");
    eprintln!("SKIPPED: {what} is missing");
}
