//! Common parts of tests with third-party programs.

// The configuration allows it in test functions; this is a helper of tests.
#![allow(clippy::print_stderr)]

use std::process::Command;

/// Whether ffmpeg exists; with `CI=true` it must.
pub(crate) fn have_ffmpeg() -> bool {
    let there = Command::new("ffmpeg").arg("-version").output().is_ok();
    assert!(there || std::env::var("CI").as_deref() != Ok("true"), "`ffmpeg` is missing: install Debian's package `ffmpeg`");
    if !there {
        eprintln!("NOT CHECKED: `ffmpeg` is missing, so this test did not run");
    }
    there
}
