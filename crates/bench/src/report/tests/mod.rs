//! Reports of synthetic rows, read back.

mod folder;

use std::path::PathBuf;

use folder::{Folder, Row};
use proptest::prelude::*;

use super::{ReportError, Source, csv_files, latex, page};
use crate::contrast::MethodPair;
use crate::stats::wilson;

fn source(folder: &Folder) -> Source {
    Source::read(&[folder.path()]).unwrap()
}

fn page_of(folder: &Folder) -> String {
    page::page(&source(folder), &folder.path())
}

fn csv_of(folder: &Folder, name: &str) -> Vec<csv::StringRecord> {
    let files = csv_files::files(&source(folder));
    let text = &files.iter().find(|(file, _)| *file == name).unwrap().1;
    csv::Reader::from_reader(text.as_bytes()).records().map(Result::unwrap).collect()
}

/// Two methods, four seeds: `spf` succeeds in three of four, `plain` in one, with two levels of errors.
fn two_methods() -> Folder {
    let row = |method, vlm, seed, done| Row { method, vlm, seed, done, ..Row::default() };
    let mut rows = Vec::new();
    for seed in 0..4 {
        rows.push(row("spf", "oracle:perfect", seed, seed < 3));
        rows.push(row("spf", "oracle:poor", seed, seed < 2));
        rows.push(row("plain", "oracle:perfect", seed, seed == 0));
    }
    Folder::of(&rows)
}

#[test]
fn numbers_in_the_page_are_those_of_the_rows() {
    let folder = two_methods();
    let page = page_of(&folder);
    for (hits, of) in [(3, 4), (2, 4), (1, 4)] {
        let (low, high) = wilson(hits, of).unwrap();
        let rate = 100.0 * hits as f64 / of as f64;
        let cell = format!("{hits}/{of} = {rate:.1} %<small class=\"below\"> [{:.1}, {:.1}]</small>", 100.0 * low, 100.0 * high);
        assert!(page.contains(&cell), "{cell}");
    }
    // Three against one of the same four: two discordant pairs, both in one direction.
    assert!(page.contains("spf · oracle-perfect − plain · oracle-perfect</th><td>4</td><td>+50.0<small>"), "{page}");
    // 3 of 12 rows exist for every seed; every failure has its article, its link and its command.
    assert_eq!(page.matches("<article").count(), 12 - 3 - 2 - 1);
    for seed in 1..4 {
        let id = format!("drink/plain/oracle-perfect/{seed}");
        assert!(page.contains(&format!("id=\"trial/{id}\"")) && page.contains(&format!("href=\"#trial/{id}\"")), "{id}");
        assert!(
            page.contains(&format!("<pre>spf bench show {id} --task ./drink.toml -o shown-drink-plain-oracle-perfect-{seed}"))
        );
    }
    assert!(page.contains("spf bench run --task ./drink.toml --trials 4 (seeds 0 to 3)"), "{page}");
}

#[test]
fn csv_reads_back_as_it_was_flown() {
    let folder = two_methods();
    let trials = csv_of(&folder, "trials.csv");
    assert_eq!(trials.len(), 12);
    let done = trials.iter().filter(|row| &row[4] == "spf" && &row[5] == "oracle-perfect" && &row[8] == "true");
    let times: Vec<f64> = done.map(|row| row[18].parse().unwrap()).collect();
    assert_eq!(times, [20.0, 21.0, 22.0]);
    let success = csv_of(&folder, "success.csv");
    let all = success.iter().find(|row| [&row[0], &row[1], &row[2], &row[4]] == ["plain", "oracle-perfect", "all", "strict"]);
    let all = all.unwrap();
    assert_eq!((&all[5], &all[6], all[7].parse::<f64>().unwrap()), ("1", "4", wilson(1, 4).unwrap().0));
    let levels = csv_of(&folder, "error_levels.csv");
    let of_spf: Vec<(&str, &str)> = levels.iter().filter(|row| &row[0] == "spf").map(|row| (&row[2], &row[3])).collect();
    assert_eq!(of_spf, [("perfect", "3"), ("poor", "2")]);
    // By both verdicts, the one pair under one oracle.
    assert_eq!(csv_of(&folder, "compared.csv").len(), 2);
}

#[test]
fn measures_of_navigation_are_means_of_the_rows_that_have_them() {
    let folder = Folder::of(&[0, 1, 2, 3].map(|seed| Row { seed, ..Row::default() }));
    let mut rows: Vec<serde_json::Value> =
        folder.text("results.jsonl").lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let give = |row: &mut serde_json::Value, [spl, ndtw, sdtw, metres]: [f64; 4], strict: bool, osr: bool| {
        (row["spl"], row["ndtw"], row["sdtw"], row["final_distance_m"]) = (spl.into(), ndtw.into(), sdtw.into(), metres.into());
        (row["scores"]["strict"], row["scores"]["collided"], row["osr"]) = (strict.into(), (!strict).into(), osr.into());
    };
    give(&mut rows[0], [0.8, 0.6, 0.6, 2.0], true, true);
    give(&mut rows[1], [0.0, 0.2, 0.0, 7.0], false, true);
    // Somebody who is followed moves, and a scan leads nowhere.
    rows[2]["category"] = "follow".into();
    rows[3]["shortest_m"] = 0.0.into();
    folder.put("results.jsonl", &rows.iter().map(|row| format!("{row}\n")).collect::<String>());
    // Of two trials: SR 1, OSR 2, CR 1; NE (2 + 7) / 2, SPL (0.8 + 0) / 2, nDTW (0.6 + 0.2) / 2, SDTW (0.6 + 0) / 2.
    let methods = csv_of(&folder, "methods.csv");
    let last: Vec<f64> = methods[0].iter().skip(methods[0].len() - 8).map(|field| field.parse().unwrap()).collect();
    assert_eq!(last, [2.0, 1.0, 2.0, 1.0, 4.5, 0.4, 0.4, 0.3]);
    let page = page_of(&folder);
    let table = &page[page.find("id=\"navigation\"").unwrap()..];
    let row = table.split("</tr>").nth(1).unwrap();
    assert!(row.contains("<td>4.5 m</td><td>0.40</td><td>0.40</td><td>0.30</td>"), "{row}");
    let files = latex::files(&source(&folder));
    let (_, text) = files.iter().find(|(name, _)| *name == "navigation.tex").unwrap();
    assert!(text.contains("1/2 [9, 91] & 2/2 [34, 100] & 4.5 & 0.40 & 0.40 & 0.30 & 1/2 [9, 91]"), "{text}");
}

#[test]
fn the_same_rows_give_the_same_bytes() {
    let (one, two) = (two_methods(), two_methods());
    let files = |folder: &Folder| (csv_files::files(&source(folder)), latex::files(&source(folder)));
    assert_eq!((page_of(&one), files(&one)), (page_of(&two), files(&two)));
}

#[test]
fn latex_is_balanced_and_its_rows_are_as_wide_as_its_head() {
    for (name, text) in latex::files(&source(&two_methods())) {
        let body: Vec<&str> = text.lines().filter(|line| line.ends_with("\\\\")).collect();
        let columns = body[0].matches(" & ").count();
        assert!(body.iter().all(|row| row.matches(" & ").count() == columns), "{name}: {text}");
        assert!(text.contains(&format!("{{l{}}}", "r".repeat(columns))), "{name}: {text}");
        assert_eq!(text.matches('{').count(), text.matches('}').count(), "{name}");
        assert!(name == "published.tex" || text.starts_with("% spf bench run --task ./drink.toml"), "{name}: {text}");
    }
}

#[test]
fn curves_are_plotted_only_from_what_was_flown() {
    let page = page_of(&two_methods());
    assert!(page.contains("aria-label=\"Success rate by oracle error level\""));
    assert!(page.contains("no method was flown with more than one latency"));
    let slow = |vlm, ms| Row { vlm, latency_ms: ms, ..Row::default() };
    let page = page_of(&Folder::of(&[slow("oracle:./quick.toml", 500.0), slow("oracle:./slow.toml", 6000.0)]));
    assert!(page.contains("aria-label=\"Success rate by reply latency\""));
    let page = page_of(&Folder::of(&[Row::default()]));
    assert!(page.contains("the trials have fewer than two error levels") && !page.contains("Success rate by reply latency"));
}

#[test]
fn real_models_stand_beside_the_published_figures_with_model_and_day() {
    let page = page_of(&Folder::of(&[Row { vlm: "gemini", model: Some("gemini-2.5-flash"), ..Row::default() }]));
    let block = &page[page.find("id=\"published\"").unwrap()..];
    for words in ["served by gemini-2.5-flash, flown from 2026-01-02 to 2026-01-03", "108/115 = 93.9 %", "1/1 = 100.0 %"] {
        assert!(block.contains(words), "{words}");
    }
    assert!(page_of(&two_methods()).contains("No real model was used in these trials."));
}

#[test]
fn words_from_elsewhere_are_no_markup() {
    let evil = "</style><script>alert(1)</script><img src=x onerror='alert(2)'>\"'&";
    let row = Row {
        done: false,
        instruction: evil,
        cause: evil,
        touched: Some(evil),
        scene: evil,
        model: Some(evil),
        ..Row::default()
    };
    let folder = Folder::of(&[row]).made_by(&format!("spf {evil}"));
    folder.put("results.jsonl", &folder.text("results.jsonl").replace("\"scores\"", "\"error\":\"<script>x\",\"scores\""));
    let page = page_of(&folder);
    assert!(page.contains("&lt;script&gt;alert(1)") && page.contains("could not be flown"));
    for markup in ["<script", "<img", "<iframe"] {
        assert!(!page.to_lowercase().contains(markup), "{markup}");
    }
    // Every quote inside an attribute is one of ours: external text cannot add an attribute.
    assert!(!page.split('<').any(|tag| tag.split('>').next().unwrap().contains(" onerror=")), "{page}");
    let commands = latex::files(&source(&folder));
    assert!(commands.iter().all(|(_, text)| text.lines().next().unwrap().starts_with(['%', '\\'])));
}

#[test]
fn names_that_need_it_are_quoted_in_commands() {
    let row = Row { done: false, vlm: "replay:my file's.jsonl", ..Row::default() };
    let page = page_of(&Folder::of(&[row]));
    let command = page.split("<pre>").nth(1).unwrap().split("</pre>").next().unwrap();
    let command = command.replace("&quot;", "\"").replace("&amp;", "&");
    let words = shlex::split(&command).unwrap();
    assert_eq!(words[..3], ["spf", "bench", "show"]);
    assert!(words.windows(2).any(|pair| pair == ["--vlm", "replay:my file's.jsonl"]), "{words:?}");
}

#[test]
fn an_unfinished_run_reports_how_much_is_missing() {
    let folder = two_methods();
    let text = folder.text("results.jsonl");
    let lines: Vec<&str> = text.split_inclusive('\n').collect();
    // Remainder after a kill: rows in order of completion, the last truncated.
    folder.put("results.jsonl", &format!("{}{}{}", lines[6], lines[0], &lines[1][..50]));
    let source = source(&folder);
    assert_eq!(source.missing()[0].trials.len(), 10);
    assert!(source.records[0].run_id < source.records[1].run_id);
    let page = page_of(&folder);
    assert!(page.contains("10 of 12 trials of the plan in"), "{page}");
    assert!(page_of(&two_methods()).find("class=\"warn\"").is_none());
}

#[test]
fn a_folder_without_paths_is_reported_without_them() {
    let folder = two_methods();
    folder.remove("paths.jsonl");
    folder.remove("run.json");
    let page = page_of(&folder);
    assert!(page.contains("12 flights have no trajectory") && page.contains("did not record its arguments"));
    assert!(!page.contains("class=\"map\""));
}

#[test]
fn planned_pairs_are_compared_alone() {
    let folder = two_methods();
    let pair = |first: &str, second: &str| vec![MethodPair { first: first.to_owned(), second: second.to_owned() }];
    let source = |planned| Source::read(&[folder.path()]).unwrap().comparing(planned);
    let page = page::page(&source(pair("plain", "spf")).unwrap(), &folder.path());
    assert!(page.contains("plain · oracle-perfect − spf · oracle-perfect</th><td>4</td><td>−50.0<small>"), "{page}");
    // `plain` was flown with one VLM only.
    assert!(!page.contains("− spf · oracle-poor</th>") && !page.contains("spf · oracle-perfect − plain"), "{page}");
    let error = source(pair("spf", "plian")).unwrap_err().to_string();
    assert!(error.starts_with("no trial was flown with the method `plian`; these were: spf, plain"), "{error}");
}

#[test]
fn shares_are_one_run_together() {
    let (one, other) = (two_methods(), two_methods());
    let text = one.text("results.jsonl");
    let (first, second) = text.split_at(text.match_indices('\n').nth(5).unwrap().0 + 1);
    one.put("results.jsonl", first);
    other.put("results.jsonl", second);
    let both = Source::read(&[one.path(), other.path()]).unwrap();
    assert!(both.missing().is_empty() && both.records.len() == 12);
    let twice = Source::read(&[one.path(), one.path()]).unwrap_err();
    assert!(matches!(twice, ReportError::Twice { .. }), "{twice}");
}

#[test]
fn what_is_no_folder_of_results_is_reported() {
    let folder = two_methods();
    let missing = Source::read(&[PathBuf::from("nowhere")]).unwrap_err();
    assert!(missing.to_string().contains("`nowhere` is not a results folder"), "{missing}");
    let text = folder.text("results.jsonl");
    folder.put("results.jsonl", &text.replacen("drink/spf", "../spf", 1));
    assert!(Source::read(&[folder.path()]).unwrap_err().to_string().contains("is not a trial of the plan"));
    folder.put("results.jsonl", "{}\n");
    assert!(Source::read(&[folder.path()]).unwrap_err().to_string().contains("line 1: not a valid result row"));
    folder.put("results.jsonl", "");
    assert!(matches!(Source::read(&[folder.path()]).unwrap_err(), ReportError::Empty { .. }));
    folder.put("results.jsonl", &text);
    for name in ["bench.json", "run.json"] {
        let kept = folder.text(name);
        folder.put(name, "[]");
        let error = Source::read(&[folder.path()]).unwrap_err().to_string();
        assert!(error.contains(&format!("`{name}` was not written by spf")), "{error}");
        folder.put(name, &kept);
    }
    let kept = folder.text("bench.json");
    folder.put("bench.json", &kept.replacen("\"format\":3", "\"format\":1", 1).replacen("\"format\": 3", "\"format\": 1", 1));
    let error = Source::read(&[folder.path()]).unwrap_err().to_string();
    assert!(error.contains("its format is 1; this version reads format 3"), "{error}");
    folder.put("bench.json", &kept);
    folder.put("paths.jsonl", "{\"run_id\":\"x\",\"targets\":[],\"from_s\":0,\"places\":[[1e300,0,0]]}\n");
    assert!(Source::read(&[folder.path()]).unwrap_err().to_string().contains("paths.jsonl"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// A damaged folder is rejected or reported, nothing worse.
    #[test]
    fn damage_is_refused_or_reported(file in 0..4_usize, at in 0.0..1.0_f64, with in any::<[u8; 3]>()) {
        let folder = Folder::of(&[Row::default(), Row { seed: 1, done: false, ..Row::default() }]);
        let name = ["bench.json", "results.jsonl", "paths.jsonl", "run.json"][file];
        let mut bytes = folder.text(name).into_bytes();
        let place = (at * bytes.len() as f64) as usize;
        let end = (place + with.len()).min(bytes.len());
        bytes[place..end].copy_from_slice(&with[..end - place]);
        folder.put_bytes(name, &bytes);
        if let Ok(source) = Source::read(&[folder.path()]) {
            prop_assert!(page::page(&source, &folder.path()).ends_with("</html>"));
            for record in &source.records {
                let again = serde_json::to_string(record).unwrap();
                prop_assert_eq!(&serde_json::from_str::<crate::trial::Record>(&again).unwrap(), record);
            }
        }
    }
}
