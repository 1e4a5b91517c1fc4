//! Any text as a task of the bench: read or refused with its place, and what was read has goals within bounds.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_bench::task::Task;

fuzz_target!(|text: &str| match Task::parse(text, "fuzz.toml") {
    Ok(task) => assert!((1..=16).contains(&task.goals.len()) && task.max_time.is_finite()),
    Err(error) => assert!(error.to_string().starts_with("fuzz.toml:"), "{error}"),
});
