//! Any bytes as the instruction set of another benchmark: tasks whose files are read again, or an error that names the file. Any
//! text as such a task's file, whose flights are measured within bounds.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_bench::import::parse;
use spf_bench::task::{ForeignTask, MOST_CORNERS, MOST_WORDINGS};

fuzz_target!(|data: &[u8]| {
    match parse(data, "fuzz.json") {
        Ok(set) => {
            assert!(!set.tasks.is_empty() && set.tasks.len() <= set.episodes);
            set.tasks.iter().for_each(sound);
        }
        Err(error) => assert!(error.to_string().starts_with("`fuzz.json`"), "{error}"),
    }
    if let Ok(text) = core::str::from_utf8(data) {
        match ForeignTask::parse(text, "fuzz.toml") {
            Ok(task) => sound(&task),
            Err(error) => assert!(error.to_string().starts_with("fuzz.toml:"), "{error}"),
        }
    }
});

fn sound(task: &ForeignTask) {
    assert!((1..=MOST_WORDINGS).contains(&task.wordings.len()) && (1..=MOST_CORNERS).contains(&task.reference.len()));
    let text = task.to_toml().expect("a task has a file");
    // Only what was rounded differs.
    let again = ForeignTask::parse(&text, "again.toml").expect("what is written is read");
    assert!(again.wordings == task.wordings && again.reference.len() == task.reference.len());
    let scores = task.measure(&[task.start.position, task.destination.position], true, false);
    assert!([scores.spl, scores.ndtw, scores.sdtw].iter().all(|score| (0.0..=1.0).contains(score)), "{scores:?}");
    assert!(scores.success && scores.error_m == Some(0.0));
}
