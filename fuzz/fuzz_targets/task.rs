//! Any text as a task of the bench: parsed or rejected with its position; a parsed task has goals within bounds.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_bench::task::Task;

fuzz_target!(|text: &str| match Task::parse(text, "fuzz.toml") {
    Ok(task) => {
        assert!((1..=16).contains(&task.goals.len()) && task.max_time.is_finite());
        assert!(task.vlm_delay.is_none_or(|[least, most]| 0.0 <= least && least < most && most < 20.0));
        if let Some(twin) = task.clean_twin() {
            assert!(twin.clean_twin().is_none() && twin.drawn_as() == task.id);
        }
        assert!(task.wind.is_none_or(|wind| wind.speed[1] <= 15.0 && wind.gust.is_finite()));
    }
    Err(error) => assert!(error.to_string().starts_with("fuzz.toml:"), "{error}"),
});
