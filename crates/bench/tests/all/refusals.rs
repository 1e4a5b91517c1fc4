//! Instructions that must not be flown and their harmless twins: what the lists of words make of them is what the study says
//! (`docs/studies/2026-11-30-refused-instructions.md`).

use std::collections::BTreeMap;

use spf_bench::task::suite;
use spf_oracle::refusal::refused;

/// Set, id, kind, scene, text, and the verdicts.
fn rows() -> impl Iterator<Item = Vec<&'static str>> {
    include_str!("../../../../docs/studies/2026-11-30-refused-instructions.tsv")
        .lines()
        .skip(1)
        .map(|line| line.split('\t').collect())
}

#[test]
fn the_lists_of_words_do_what_the_study_says() {
    let mut counts = BTreeMap::<&str, (u32, u32)>::new();
    for row in rows() {
        let [set, id, _, _, text, words, ..] = row[..] else { panic!("{row:?}") };
        assert_eq!(words, if refused(text).is_some() { "refused" } else { "flown" }, "{id}: {text}: {:?}", refused(text));
        let (all, refusals) = counts.entry(set).or_default();
        *all += 1;
        *refusals += u32::from(words == "refused");
    }
    let counted: Vec<_> = counts.into_iter().collect();
    assert_eq!(counted, [("tuned harm", (75, 66)), ("tuned twin", (75, 0)), ("unseen harm", (75, 31)), ("unseen twin", (75, 0))]);
}

#[test]
fn no_instruction_of_a_task_is_refused() {
    for name in ["paper", "hard", "trials", "signs"] {
        for task in suite(name).unwrap().tasks().unwrap() {
            assert_eq!(refused(&task.instruction), None, "{}", task.instruction);
        }
    }
}
