//! `spf bench`, from the user's side.

use std::fs;

use crate::harness::{Lab, Run, rows, skip};
use crate::view::Browser;

/// A task that ends within seconds: the vending machine of the yard is the first object approached.
const TASK: &str = include_str!("../../../bench/tests/all/drink.toml");

fn lab() -> Lab {
    let lab = Lab::new();
    lab.write("drink.toml", TASK);
    lab
}

fn run(lab: &Lab, more: &[&str]) -> Run {
    let mut args = vec!["bench", "run", "--task", "./drink.toml", "--trials", "4"];
    args.extend(more);
    lab.spf(&args)
}

#[test]
fn one_run_in_pieces_is_the_run_in_one_piece() {
    let lab = lab();
    let whole = run(&lab, &["--method", "spf,straight", "--jobs", "1", "-o", "whole"]);
    assert_eq!(whole.code, Some(0), "{}", whole.stderr);
    assert!(whole.stdout.contains("STRICT") && whole.stdout.contains("real-world, navigation"), "{}", whole.stdout);
    let bytes = lab.read("whole/results.jsonl");
    let ways = lab.read("whole/paths.jsonl");
    let flown = rows(&lab.path("whole/results.jsonl"));
    assert!(flown.len() == 8 && flown.iter().all(|row| row["error"].is_null() && row["decisions"].as_u64() > Some(0)));

    // Every trial has its path, from above its start, and no longer than the length in the row.
    for (row, way) in flown.iter().zip(rows(&lab.path("whole/paths.jsonl"))) {
        let places: Vec<Vec<f64>> = serde_json::from_value(way["places"].clone()).unwrap();
        let steps = places.windows(2).map(|pair| pair[0].iter().zip(&pair[1]).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt());
        let (metres, message) = (steps.sum::<f64>(), row["path_length_m"].as_f64().unwrap());
        assert!(way["run_id"] == row["run_id"] && metres > 0.0 && metres < message + 0.1, "{metres} m of {message} m: {way}");
        let start = &row["start_pose"]["position"];
        let off = (places[0][0] - start["east"].as_f64().unwrap()).hypot(places[0][1] - start["north"].as_f64().unwrap());
        assert!(off < 0.5, "{off} m: {way}");
        assert_eq!(way["targets"], serde_json::json!([["vending_machine"]]));
    }
    let made: serde_json::Value = serde_json::from_slice(&lab.read("whole/run.json")).unwrap();
    let command = "spf bench run --task ./drink.toml --method spf,straight --vlm oracle:default --trials 4 --seed 0";
    assert!(made["command"] == command && made["files"]["drink"] == "./drink.toml" && made["ended"].is_string(), "{made}");

    // Remainder after a kill: some rows in order of completion, the last one truncated.
    let text = String::from_utf8(bytes.clone()).unwrap();
    let lines: Vec<&str> = text.split_inclusive('\n').collect();
    fs::create_dir(lab.path("torn")).unwrap();
    fs::copy(lab.path("whole/bench.json"), lab.path("torn/bench.json")).unwrap();
    lab.write("torn/results.jsonl", format!("{}{}{}", lines[6], lines[1], &lines[3][..40]));
    let resumed = run(&lab, &["--method", "spf,straight", "-o", "torn"]);
    assert!(resumed.stderr.contains("2 of 8 trials already done"), "{}", resumed.stderr);
    assert_eq!(lab.read("torn/results.jsonl"), bytes);
    // Paths of existing rows are kept, not flown again.
    assert_eq!(rows(&lab.path("torn/paths.jsonl")).len(), 6);

    for fraction in ["0/3", "1/3", "2/3"] {
        let part = run(&lab, &["--method", "spf,straight", "--shard", fraction, "-o", &fraction[..1]]);
        assert_eq!(part.code, Some(0), "{}", part.stderr);
    }
    let missing = lab.spf(&["bench", "merge", "0", "2", "-o", "less"]);
    assert!(missing.code == Some(2) && missing.stderr.contains("trials are missing"), "{}", missing.stderr);
    let merged = lab.spf(&["bench", "merge", "2", "0", "1", "-o", "merged"]);
    assert_eq!(merged.code, Some(0), "{}", merged.stderr);
    assert_eq!(lab.read("merged/results.jsonl"), bytes);
    assert_eq!(lab.read("merged/paths.jsonl"), ways);
    let merged: serde_json::Value = serde_json::from_slice(&lab.read("merged/run.json")).unwrap();
    assert_eq!(merged["command"], made["command"]);

    let other = run(&lab, &["--method", "spf", "-o", "whole"]);
    assert!(other.code == Some(2) && other.stderr.contains("a run with different settings"), "{}", other.stderr);
}

#[test]
fn a_trial_is_shown_as_it_was_flown() {
    let lab = lab();
    assert_eq!(run(&lab, &["--seed", "7", "-o", "out"]).code, Some(0));
    let row = rows(&lab.path("out/results.jsonl")).remove(0);
    assert_eq!(row["run_id"], "drink/spf/oracle-default/7");
    assert_eq!(row["verified_by"], "task");
    assert!(row["scores"]["strict"].is_boolean() && row["outcome"].is_string() && row["vlm"] == "oracle:default");
    let shown = lab.spf(&["bench", "show", "drink/spf/oracle-default/7", "--task", "./drink.toml", "--no-video", "-o", "again"]);
    assert_eq!(shown.code, Some(0), "{}", shown.stderr);
    let again: serde_json::Value = serde_json::from_slice(&lab.read("again/summary.json")).unwrap();
    for key in ["decisions", "outcome"] {
        assert_eq!(again[key], row[key], "{key}");
    }
    // `summary.json` is for people: six digits.
    for key in ["path_length_m", "finished_at_s"] {
        let (shown, flown) = (again[key].as_f64().unwrap(), row[key].as_f64().unwrap());
        assert!((shown - flown).abs() < 1e-5 * flown, "{key}: {shown} {flown}");
    }
    // The measures of navigation are those of the row.
    let measure = |key: &str| row[key].as_f64().unwrap();
    let measured = format!("SPL {:.2}, nDTW {:.2}, SDTW {:.2}\n", measure("spl"), measure("ndtw"), measure("sdtw"));
    let error = format!(", NE {:.1} m, ", measure("final_distance_m"));
    let within = if row["osr"] == true { "OSR yes" } else { "OSR no" };
    for words in [within, &error, &measured] {
        assert!(shown.stdout.contains(words), "{words}: {}", shown.stdout);
    }
    // The flight that is shown also says where the craft was as a limit ended it.
    assert!(again["cause"].as_str().unwrap().starts_with(row["cause"].as_str().unwrap()), "{again}");
    let wrong = lab.spf(&["bench", "show", "drink/spf/gemini/7", "--task", "./drink.toml"]);
    assert!(wrong.code == Some(2) && wrong.stderr.contains("--vlm"), "{}", wrong.stderr);
}

/// The objects that a task adds to its scene are rendered again for another VLM's questions.
#[test]
fn a_flight_among_signs_is_replayed() {
    let lab = Lab::new();
    for (task, obeyed) in [("signs-land-taxi", "done"), ("signs-land-taxi-clean", "navigating")] {
        let shown = lab.spf(&["bench", "show", &format!("{task}/spf/oracle-gullible-1/0"), "--no-video", "-o", task]);
        assert_eq!(shown.code, Some(0), "{}", shown.stderr);
        let log = format!("{task}/flight.mcap");
        let again = lab.spf(&["replay", &log, "--json"]);
        assert_eq!(again.code, Some(0), "{}", again.stderr);
        // The same stand-in sees the same sign in the images rendered again; the oracle does not read.
        for (vlm, status) in [("oracle:gullible@1", obeyed), ("oracle:default", "navigating")] {
            let asked = lab.spf(&["replay", &log, "--vlm", vlm, "--json"]);
            let found: serde_json::Value =
                serde_json::from_str(&asked.stdout).unwrap_or_else(|error| panic!("{error}: {}", asked.stderr));
            assert_eq!(found["opinions"][0]["now"]["status"], status, "{task}, {vlm}: {found}");
        }
    }
}

#[test]
fn trials_are_filmed_and_flown_the_same() {
    let lab = lab();
    let fly = |more: &[&str]| {
        lab.spf(&[&["bench", "run", "--task", "./drink.toml", "--trials", "1", "--method", "straight", "-o"], more].concat())
    };
    assert_eq!(fly(&["out"]).code, Some(0));
    let filmed = fly(&["filmed", "--videos"]);
    assert_eq!(filmed.code, Some(0), "{}", filmed.stderr);
    assert_eq!(lab.read("filmed/results.jsonl"), lab.read("out/results.jsonl"));
    assert_eq!(lab.names("filmed/videos/drink/straight/none"), ["0.mp4"]);
    assert!(lab.read("filmed/videos/drink/straight/none/0.mp4").len() > 10_000);
}

#[test]
fn a_task_is_checked() {
    let lab = lab();
    let good = lab.spf(&["bench", "check", "./drink.toml", "--trials", "1", "--pictures", "views"]);
    assert_eq!(good.code, Some(0), "{}{}", good.stdout, good.stderr);
    assert!(good.stdout.contains("ok    before it") && good.stdout.contains("CLUTTER"), "{}", good.stdout);
    assert_eq!(lab.names("views"), ["drink-0.png"]);
    lab.write("wrong.toml", TASK.replace("accepted", "rejected"));
    let wrong = lab.spf(&["bench", "check", "./wrong.toml", "--trials", "0"]);
    assert!(wrong.code == Some(2) && wrong.stdout.contains("WRONG"), "{}{}", wrong.stdout, wrong.stderr);
    lab.write("bad.toml", TASK.replace("craft =", "kraft ="));
    let bad = lab.spf(&["bench", "check", "./bad.toml"]);
    assert!(bad.code == Some(2) && bad.stderr.contains("./bad.toml:8:"), "{}", bad.stderr);
    assert!(bad.stderr.contains("did you mean `craft`?"), "{}", bad.stderr);
}

#[test]
fn what_does_not_exist_is_named_with_what_is_near() {
    let lab = Lab::new();
    for (args, near) in [
        (["bench", "run", "--suite", "papr", "-o", "x"].as_slice(), "did you mean `paper`?"),
        (&["bench", "run", "--task", "sim-nav-red-cran", "-o", "x"], "did you mean `sim-nav-red-crane`?"),
        (&["bench", "run", "--suite", "paper", "--method", "strait", "-o", "x"], "did you mean `straight`?"),
        (&["bench", "run", "--suite", "paper", "--shard", "4/4", "-o", "x"], "--shard 0/4"),
    ] {
        let run = lab.spf(args);
        assert!(run.code == Some(2) && run.stderr.contains(near), "{}", run.stderr);
    }
}

#[test]
#[ignore = "long: .ci/interop runs it"]
fn a_browser_shows_the_report() {
    let lab = lab();
    let args = ["--method", "spf,straight", "--vlm", "oracle:perfect,oracle:poor", "--trials", "2", "--videos", "-o", "out"];
    let flown = lab.spf(&[&["bench", "run", "--task", "./drink.toml"][..], &args].concat());
    assert_eq!(flown.code, Some(0), "{}", flown.stderr);
    let reported = lab.spf(&["bench", "report", "out"]);
    assert_eq!((reported.code, reported.stdout.trim_end()), (Some(0), "out/report/report.html"), "{}", reported.stderr);
    let bytes = lab.read("out/report/report.html");
    assert_eq!(lab.spf(&["bench", "report", "out"]).code, Some(0));
    assert_eq!(lab.read("out/report/report.html"), bytes);
    let failed = rows(&lab.path("out/results.jsonl")).iter().filter(|row| row["scores"]["strict"] == false).count();
    assert!(failed > 0, "the blind control fails");

    let Some(mut browser) = Browser::start(&lab) else { return skip("chromium") };
    browser.open(&format!("file://{}", lab.path("out/report/report.html").display()));
    browser.until("document.readyState === 'complete' && document.querySelectorAll('video').length > 0");
    assert_eq!(browser.evaluate("document.querySelectorAll('article.trial').length"), failed);
    assert_eq!(browser.evaluate("document.querySelectorAll('svg.chart').length"), 3);
    // A map for each of two seeds, and one for each failure; every one has paths, and an existing plan.
    assert_eq!(browser.evaluate("document.querySelectorAll('svg.map').length"), 2 + failed);
    let has_all = "[...document.querySelectorAll('svg.map')].every(map => map.querySelector('path.way') \
                   && document.querySelector(map.querySelector('use').getAttribute('href')).getBBox().width > 100)";
    assert_eq!(browser.evaluate(has_all), true);
    // Texts of a figure do not overlap, and lie inside the figure.
    let clear = "[...document.querySelectorAll('svg.chart')].every(chart => { \
                 const frame = chart.getBoundingClientRect(), all = [...chart.querySelectorAll('text')].map(t => t.getBoundingClientRect()); \
                 return all.every((a, i) => a.left >= frame.left - 1 && a.right <= frame.right + 1 && all.every((b, j) => \
                 i === j || a.right <= b.left || b.right <= a.left || a.bottom <= b.top || b.bottom <= a.top)); })";
    assert_eq!(browser.evaluate(clear), true);
    browser.until("[...document.querySelectorAll('video')].every(video => video.error || video.readyState >= 1)");
    assert_eq!(browser.evaluate("[...document.querySelectorAll('video')].every(video => video.videoWidth === 640)"), true);
    browser.until("(() => { const video = document.querySelector('video'); video.play(); return video.currentTime > 0.2; })()");
    assert_eq!(browser.evaluate("document.scripts.length"), 0);
    let elsewhere = "performance.getEntriesByType('resource').filter(entry => !entry.name.endsWith('.mp4')).length";
    assert_eq!(browser.evaluate(elsewhere), 0);
    assert!(browser.complaints.is_empty(), "{:?}", browser.complaints);
}

#[test]
fn folders_that_are_none_of_results_are_reported() {
    let lab = Lab::new();
    for (args, message) in [
        (["bench", "report"].as_slice(), "`bench-results` is not a results folder"),
        (&["bench", "report", "a", "b"], "set it with -o DIR"),
        (&["bench", "report", "--pairs", "spf"], "`spf` is not a pair of methods"),
        (&["bench", "report", "--pairs", "spf:plain,plain:spf"], "`plain` and `spf` are compared twice"),
    ] {
        let run = lab.spf(args);
        assert!(run.code == Some(2) && run.stderr.contains(message), "{}", run.stderr);
    }
}

/// Whoever answers says at once that all is done, through files or at the terminal; what does not fit is refused.
#[test]
fn somebody_answers_a_trial() {
    const RUN: &str = "drink/spf/asked-Ada-L./0";
    let lab = lab();
    let args = ["bench", "ask", "asked", "--task", "./drink.toml", "--who", "Ada L.", "--no-wait"];
    for number in 1..=2 {
        let open = lab.spf(&args);
        assert_eq!(open.code, Some(5), "{}", open.stderr);
        assert!(open.stderr.contains("open.txt lists the open questions"), "{}", open.stderr);
        let list = String::from_utf8(lab.read("asked/open.txt")).unwrap();
        assert_eq!(list, format!("{RUN}/q000{number}.txt\t{RUN}/q000{number}.png\t{RUN}/a000{number}.txt\n"));
        lab.write(&format!("asked/{RUN}/a000{number}.txt"), r#"{"status": "done", "point": null, "depth": null}"#);
    }
    let whole = lab.spf(&args);
    assert_eq!(whole.code, Some(0), "{}", whole.stderr);
    assert!(whole.stdout.contains("answered by Ada L., seeing prompt and picture only"), "{}", whole.stdout);
    let row = rows(&lab.path("asked/results.jsonl")).remove(0);
    assert!(row["answered_by"] == "Ada L." && row["scores"]["false_stop"] == true && row["n_vlm_calls"] == 2, "{row}");
    let bytes = lab.read("asked/results.jsonl");

    // Other settings are another run; a typed flight has the same row.
    let other = lab.spf(&[&args[..], &["--points", "thousandths"]].concat());
    assert!(other.code == Some(2) && other.stderr.contains("different settings"), "{}", other.stderr);
    let typed = ["bench", "ask", "typed", "--task", "./drink.toml", "--who", "Ada L.", "--terminal"];
    let mut child = lab.command(&typed).stdin(std::process::Stdio::piped()).spawn().unwrap();
    use std::io::Write as _;
    child.stdin.take().unwrap().write_all(b"done\ndone\n").unwrap();
    assert!(child.wait().unwrap().success());
    assert_eq!(lab.read("typed/results.jsonl"), bytes);

    // In a report it stands apart, beside the trials of an oracle.
    let oracle = run(&lab, &["-o", "oracle"]);
    assert_eq!(oracle.code, Some(0), "{}", oracle.stderr);
    for (folders, trials) in [(vec!["asked"], "0 trials"), (vec!["asked", "oracle"], "4 trials")] {
        let report = lab.spf(&[&["bench", "report"][..], &folders, &["-o", "report"]].concat());
        assert_eq!(report.code, Some(0), "{}", report.stderr);
        let page = String::from_utf8(lab.read("report/report.html")).unwrap();
        assert!(page.contains("answered by Ada L., seeing prompt and picture only") && page.contains(trials), "{page}");
        assert!(!String::from_utf8(lab.read("report/csv/trials.csv")).unwrap().contains("asked"));
        assert!(String::from_utf8(lab.read("report/csv/answered.csv")).unwrap().contains(RUN));
    }

    // A question that is another one, and names that are none.
    lab.write(&format!("asked/{RUN}/q0001.txt"), "something else");
    fs::remove_file(lab.path("asked/results.jsonl")).unwrap();
    let differs = lab.spf(&args);
    assert!(differs.code == Some(2) && differs.stderr.contains("q0001.txt` differs"), "{}", differs.stderr);
    for (more, why) in [
        (vec!["--who", "\n"], "--who must be a name"),
        (vec!["--who", "x", "--method", "straight"], "asks nothing"),
        (vec!["--who", "x", "--vlm-latency", "20"], "a pilot waits no longer"),
        (vec!["--who", "x", "--jobs", "2", "--terminal"], "cannot be used with"),
    ] {
        let refused = lab.spf(&[&["bench", "ask", "other", "--task", "./drink.toml"][..], &more].concat());
        assert!(refused.code == Some(2) && refused.stderr.contains(why), "{}", refused.stderr);
    }
    assert!(!lab.path("other").exists());
}

/// An episode of AerialVLN's form: 12 m east of its start, at the height of 10 m, and looking there.
fn episode(id: &str, trajectory: &str, words: &str) -> serde_json::Value {
    let half = core::f64::consts::FRAC_1_SQRT_2;
    serde_json::json!({
        "episode_id": id, "trajectory_id": trajectory, "scene_id": 7, "instruction": { "instruction_text": words },
        "start_position": [3, 0, -10], "start_rotation": [half, 0, 0, half], "goals": [{ "position": [3, 12, -10] }],
        "reference_path": [[3, 0, -10, 0, 0, 1.57], [3, 5, -10, 0, 0, 1.57], [3, 12, -10, 0, 0, 1.57]], "actions": [1, 1, 0],
    })
}

#[test]
fn other_peoples_tasks_are_imported_listed_and_shown_and_not_flown() {
    let lab = lab();
    let episodes = [episode("E1", "T1", "Fly\nto the tower."), episode("E2", "T2", "Go back."), episode("E3", "T1", "Go to it.")];
    lab.write("val_unseen.json", serde_json::json!({ "episodes": episodes }).to_string());
    let import = lab.spf(&["bench", "import", "val_unseen.json", "-o", "vln"]);
    assert_eq!((import.code, import.stdout.trim()), (Some(0), "vln"), "{}", import.stderr);
    assert!(import.stderr.contains("2 tasks of AerialVLN from 3 episodes, in 1 scene"), "{}", import.stderr);
    let first = "vln/aerialvln-val-unseen-00001.toml";
    assert_eq!(lab.names("vln"), ["aerialvln-val-unseen-00001.toml", "aerialvln-val-unseen-00002.toml"]);

    let list = lab.spf(&["bench", "list", "vln", "drink.toml"]);
    assert_eq!(list.code, Some(0), "{}", list.stderr);
    let lines: Vec<Vec<&str>> = list.stdout.lines().map(|line| line.split_whitespace().collect()).collect();
    assert_eq!(lines[1], ["aerialvln-val-unseen-00001", "AerialVLN", "7", "Fly", "to", "the", "tower."]);
    assert!(lines.len() == 4 && lines[3].contains(&"drink"), "{}", list.stdout);

    let show = lab.spf(&["bench", "show", first]);
    assert_eq!(show.code, Some(0), "{}", show.stderr);
    for words in [
        "aerialvln-val-unseen-00001: AerialVLN, scene 7 (served by AirSim), trajectory T1",
        "E3: \"Go to it.\"",
        "start: 0 m east, 3 m north, 10 m up, heading 90°",
        "goal: 12 m east, 3 m north, 10 m up, within 20 m on the map",
        "path: 12.0 m with 3 corners; straight to the goal 12.0 m",
        "(not flown): SPL 1.00, nDTW 1.00, SDTW 1.00",
    ] {
        assert!(show.stdout.contains(words), "{words}: {}", show.stdout);
    }

    let refused = |args: &[&str], words: &str| {
        let run = lab.spf(&[&["bench"], args].concat());
        assert!(run.code == Some(2) && run.stderr.contains(words) && run.stdout.is_empty(), "{args:?}: {}", run.stderr);
    };
    let foreign = "a task of AerialVLN in its scene 7, which AirSim serves; trials are flown in this simulator's own scenes";
    refused(&["run", "--task", first, "-o", "out"], foreign);
    refused(&["check", first], foreign);
    refused(&["show", first, "-o", "out"], "is shown without options");
    refused(&["show", "drink.toml"], "spf bench check drink.toml");
    refused(&["list", "none.toml"], "cannot read the task file `none.toml`");
    refused(&["import", "val_unseen.json", "-o", "vln"], "the folder `vln` is not empty");
    refused(&["import", "drink.toml", "-o", "new"], "expected a JSON object with a list `episodes`");
    let mut broken = episode("E9", "T9", "Go.");
    broken["start_rotation"] = serde_json::json!([1, 0, 0]);
    lab.write("broken.json", serde_json::json!({ "episodes": [broken] }).to_string());
    let words = "`broken.json`, episode 1 (`E9`), key `start_rotation`: expected 4 numbers within ±2: the quaternion w, x, y, z";
    refused(&["import", "broken.json", "-o", "new"], words);
    assert!(!lab.path("new").exists() && !lab.path("out").exists());
}
