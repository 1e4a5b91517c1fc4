use proptest::option::of;
use proptest::prelude::*;

use super::*;

/// A row for both, with these strings in place of its `policy` and `bench`.
fn row(name: &str, policy: &str, bench: &str) -> String {
    format!("[[method]]\nname = \"{name}\"\nabout = \"a row\"\npolicy = {{ {policy} }}\nfly = \"words\"\nbench = {{ {bench} }}\n")
}

/// The error message for an invalid table.
fn refused(text: &str) -> String {
    read(text).unwrap_err().to_string()
}

const SPF: &str = "family = \"spf\"";

#[test]
fn options_that_are_left_out_are_those_of_the_first_of_a_family() {
    let bare = |family: &str| read(&row("some", &format!("family = \"{family}\""), "")).unwrap().remove(0).policy;
    assert_eq!(bare("spf"), Family::Spf {});
    assert_eq!(bare("plain"), Family::Plain { form: ActForm::Commands });
    assert_eq!(bare("pivot"), Family::Pivot { runs: 1 });
    assert_eq!(bare("typefly"), Family::TypeFly { coco: false, replanning: true });
}

#[test]
fn a_wrong_row_is_reported() {
    assert_eq!(refused(&[row("a", SPF, ""), row("a", "family = \"plain\"", "")].concat()), "duplicate name `a`");
    for name in ["", "Spf", "1m", "spf-", "-spf", "spf--x", "a,b", "a/b", "ä"] {
        let message = refused(&row(name, SPF, ""));
        assert_eq!(
            message,
            format!("invalid name `{name}`: use lower-case letters, digits and single dashes, starting with a letter")
        );
    }
    let unused = row("a", SPF, "").replace("fly = \"words\"\nbench = {  }\n", "");
    assert_eq!(refused(&unused), "`a` has neither `fly` nor `bench`: set at least one");
    assert_eq!(refused(&row("a", SPF, "").replace("a row", " ")), "`a` has no `about`: add a description");
    assert_eq!(refused(&row("a", SPF, "").replace("words", "")), "`a` has no `about`: add a description");
    assert_eq!(refused(&row("a", "family = \"pivot\", runs = 9", "")), "`runs` of `a` is 9, but must be 1 to 8");
    let long = refused(&row("a", SPF, "step = { fixed_m = 51 }"));
    assert_eq!(long, "`fixed_m` of `a` is 51, but must be 0.05 to 50");
    assert!(refused(&row("a", SPF, "step = { fixed_m = nan }")).starts_with("`fixed_m` of `a` is NaN"));
    let alike = [row("a", SPF, ""), row("b", SPF, "")].concat();
    assert_eq!(
        refused(&alike),
        "`a` and `b` both have `fly` and the same policy, so the name in a log would be ambiguous: remove `fly` from one"
    );
    let nameless = row("a", SPF, "").replace("fly = \"words\"\n", "");
    assert!(refused(&nameless).starts_with("no row with `fly` has the same policy as `a`"));
    assert!(refused(&row("a", SPF, "blind = true")).starts_with("`a` is blind, but only the policy `plain`"));
}

#[test]
fn an_unknown_word_is_reported_with_its_line() {
    for (wrong, piece) in [
        (row("a", "family = \"spff\"", ""), "unknown variant `spff`, expected one of `spf`, `plain`, `pivot`, `typefly`"),
        (row("a", "family = \"spf\", runs = 3", ""), "unknown field `runs`"),
        (row("a", "family = \"plain\", form = \"loud\"", ""), "unknown variant `loud`"),
        (row("a", "runs = 3", ""), "missing field `family`"),
        (row("a", SPF, "speed = 1"), "unknown field `speed`"),
        (row("a", SPF, "step = \"long\""), "unknown variant `long`"),
        (row("a", SPF, "") + "colour = \"red\"\n", "unknown field `colour`"),
        ("[[way]]\n".to_owned(), "unknown field `way`"),
    ] {
        let message = refused(&wrong);
        assert!(message.starts_with("TOML parse error at line ") && message.contains(piece), "{message}");
    }
}

#[test]
fn a_variant_changes_what_it_declares_and_nothing_else() {
    let settings = |words: &str| read(&row("some", SPF, words)).unwrap().remove(0).bench.unwrap();
    let preset = PilotSettings::preset(Preset::Default);
    assert_eq!((settings("").settings(6.7), settings("").preset()), (preset, Preset::Default));
    let paper = settings("preset = \"paper\"");
    assert_eq!((paper.settings(6.7), paper.preset()), (PilotSettings::preset(Preset::Paper), Preset::Paper));
    for (words, wanted) in [
        ("step = \"median\"", PilotSettings { step: StepRule::Fixed(6.7), ..preset }),
        ("step = { fixed_m = 1 }", PilotSettings { step: StepRule::FIXED, ..preset }),
        ("motion = \"sequential\"", PilotSettings { motion: Motion::Sequential, ..preset }),
        ("ending = \"timed\"", PilotSettings { ending: Ending::Timed, ..preset }),
        ("think = \"stop\"", PilotSettings { think: QueryTiming::Stop, ..preset }),
        ("track = true", PilotSettings { track: true, ..preset }),
        ("confirm_done = false", PilotSettings { confirm_done: false, ..preset }),
    ] {
        assert_eq!(settings(words).settings(6.7), wanted, "{words}");
    }
}

/// Name and description of each row, without links.
#[test]
fn the_document_lists_the_methods_of_the_bench() {
    let document = include_str!("../../../../docs/guide/bench.md");
    let section = document.split("\n## Methods\n").nth(1).and_then(|rest| rest.split("\n## ").next()).unwrap();
    let told = section.lines().filter_map(|line| {
        let (name, about) = line.strip_prefix("| `")?.strip_suffix(" |")?.split_once("` | ")?;
        Some((name, about.split(" ([").next()?))
    });
    let benched = rows().iter().filter(|row| row.bench.is_some()).map(|row| (row.name.as_str(), row.about.as_str()));
    assert_eq!(told.collect::<Vec<_>>(), benched.collect::<Vec<_>>());
}

/// One member of each family of the built-in table, with the name of the family.
fn shipped() -> Vec<(String, Family)> {
    let mut families: Vec<(String, Family)> = Vec::new();
    for row in rows() {
        let word = toml::Value::try_from(row.policy).unwrap()["family"].as_str().unwrap().to_owned();
        if families.iter().all(|(other, _)| *other != word) {
            families.push((word, row.policy));
        }
    }
    families
}

/// Every set of options of a family. A new family does not compile until it has an arm.
fn members(family: Family) -> BoxedStrategy<Family> {
    match family {
        Family::Spf {} => Just(Family::Spf {}).boxed(),
        Family::Plain { .. } => {
            let form = prop_oneof![Just(ActForm::Commands), Just(ActForm::Numeric), Just(ActForm::Discrete)];
            form.prop_map(|form| Family::Plain { form }).boxed()
        }
        Family::Pivot { .. } => RUNS.prop_map(|runs| Family::Pivot { runs }).boxed(),
        Family::TypeFly { .. } => {
            any::<(bool, bool)>().prop_map(|(coco, replanning)| Family::TypeFly { coco, replanning }).boxed()
        }
        Family::Classical {} => Just(Family::Classical {}).boxed(),
    }
}

fn families() -> impl Strategy<Value = Family> {
    proptest::strategy::Union::new(shipped().into_iter().map(|(_, family)| members(family)))
}

#[test]
fn the_head_of_the_table_describes_every_family() {
    let described: Vec<&str> =
        SHIPPED.lines().filter_map(|line| line.strip_prefix("#            ")?.split("  ").next()).collect();
    let mut places = Vec::new();
    for (word, family) in shipped() {
        assert!(described.contains(&word.as_str()), "the head of methods.toml has no line about `{word}`");
        places.push(family.place());
    }
    places.sort_unstable();
    assert_eq!(places, (0..places.len()).collect::<Vec<_>>(), "each family has its own place in the help");
}

#[test]
fn documents_name_every_policy() {
    let baselines = include_str!("../../../../docs/explanation/baselines.md");
    for row in rows().iter().filter(|row| row.fly.is_some() && !matches!(row.policy, Family::Spf {})) {
        assert!(baselines.contains(&format!("`{}`", row.name)), "docs/explanation/baselines.md does not name `{}`", row.name);
    }
}

fn bench_settings() -> impl Strategy<Value = BenchSettings> {
    let step = prop_oneof![Just(Step::Median), FIXED_M.prop_map(Step::FixedM)];
    let preset = prop_oneof![Just(Preset::Default), Just(Preset::Paper)];
    let motion = prop_oneof![Just(Motion::Sequential), Just(Motion::Blended)];
    let ending = prop_oneof![Just(Ending::Timed), Just(Ending::Measured)];
    let think = prop_oneof![Just(QueryTiming::Stop), Just(QueryTiming::Continuous)];
    (of(preset), of(step), of(motion), of(ending), of(think), of(any::<bool>()), any::<[bool; 8]>()).prop_map(
        |(
            preset,
            step,
            motion,
            ending,
            think,
            confirm_done,
            [avoid, detector, fence, boxes, map, brake, depth_sensor, track],
        )| {
            BenchSettings {
                preset,
                step,
                motion,
                ending,
                think,
                confirm_done,
                avoid,
                detector,
                method: if map { Some(Leads::Depth) } else { boxes.then_some(Leads::Boxes) },
                brake,
                track,
                depth_sensor,
                fence,
                blind: false,
            }
        },
    )
}

fn tables() -> impl Strategy<Value = Vec<MethodRow>> {
    let one = ("[a-z][a-z0-9]{0,3}(-[a-z0-9]{1,2}){0,2}", "\\PC{1,20}", families(), of("[a-z ]{1,9}"), of(bench_settings()))
        .prop_map(|(name, about, policy, fly, bench)| MethodRow { name, about, policy, fly, bench });
    proptest::collection::vec(one, 0..6)
}

proptest! {
    #[test]
    fn a_table_is_read_as_it_is_written_and_refused_where_names_or_policies_clash(rows in tables()) {
        let text = toml::to_string(&File { method: rows.clone() }).unwrap();
        prop_assert_eq!(&toml::from_str::<File>(&text).unwrap().method, &rows);
        let called = |name: &str| rows.iter().filter(|row| row.name == name).count();
        let deciding = |policy| rows.iter().filter(|row| row.fly.is_some() && row.policy == policy).count();
        let message = |row: &MethodRow| [Some(&row.about), row.fly.as_ref()].into_iter().flatten().all(|words| !words.trim().is_empty());
        let used = |row: &MethodRow| row.fly.is_some() || row.bench.is_some();
        // The classical policy needs no name that `--policy` knows.
        let named = |row: &MethodRow| match deciding(row.policy) {
            0 => row.policy == (Family::Classical {}),
            many => many == 1,
        };
        let fine = |row: &MethodRow| called(&row.name) == 1 && named(row) && message(row) && used(row);
        prop_assert_eq!(read(&text).is_ok(), rows.iter().all(fine));
    }

    #[test]
    fn a_row_that_is_there_twice_is_refused(at in 0..64_usize, to in 0..64_usize) {
        let mut rows = rows().to_vec();
        let twice = rows[at % rows.len()].clone();
        let name = twice.name.clone();
        rows.insert(to % (rows.len() + 1), twice);
        prop_assert_eq!(read(&toml::to_string(&File { method: rows }).unwrap()), Err(MethodsError::Twice(name)));
    }

    #[test]
    fn no_text_is_more_than_it_can_take(at in 0..SHIPPED.len(), cut in 0..40_usize, put in "\\PC{0,12}") {
        let floor = |at: usize| (0..=at).rev().find(|at| SHIPPED.is_char_boundary(*at)).unwrap_or_default();
        let (head, tail) = (floor(at), floor((at + cut).min(SHIPPED.len())));
        let text = [&SHIPPED[..head], &put, &SHIPPED[tail.max(head)..]].concat();
        if let Err(error) = read(&text) {
            prop_assert!(!error.to_string().is_empty());
        }
    }
}
