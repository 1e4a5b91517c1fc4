//! Programs of the user's own, and the user, in the place of a model; and what money is asked for before it is spent.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Stdio;

use serde_json::Value;

use super::server::Server;
use super::vendors::Vendor;
use super::{AHEAD, DONE, KEY};
use crate::harness::{Lab, Run, rows};
use crate::python;

/// A program that lists no boxes, says AHEAD so many times and then DONE, and tells standard error what it was asked.
fn program(lab: &Lab, ahead: u32) -> String {
    let script = format!(
        "count=0\nwhile read -r line; do\n\
         id=${{line#*'\"id\":'}}; id=${{id%%,*}}\n\
         case $line in *declare*) echo '{{\"id\":'$id',\"boxes\":false}}'; continue;; esac\n\
         count=$((count+1)); echo \"asked $id\" >&2\n\
         if [ $count -le {ahead} ]; then echo '{{\"id\":'$id',{}'; else echo '{{\"id\":'$id',{}'; fi\ndone\n",
        &AHEAD[1..],
        &DONE[1..]
    );
    lab.write("my program.sh", script);
    format!("exec:sh '{}'", lab.path("my program.sh").display())
}

#[test]
fn a_program_flies_and_its_answers_take_the_time_that_they_are_said_to_take() {
    let lab = Lab::new();
    let vlm = program(&lab, 3);
    let times = |name: &str, more: &[&str]| {
        let (code, summary) = lab.fly(name, &[&["fly to the red crane", "--vlm", &vlm], more].concat());
        // It believes to be there, and the truth knows better.
        assert_eq!((code, &summary["outcome"], &summary["vlm"]), (3, &"reached".into(), &vlm.as_str().into()), "{summary}");
        let rows = rows(&lab.path(name).join("vlm.jsonl"));
        assert!(rows.iter().all(|row| row["cost_usd"].is_null() && row["bytes_sent"].as_u64() > Some(1000)), "{rows:?}");
        rows.iter().map(|row| row["latency_s"].as_f64().unwrap()).collect::<Vec<_>>()
    };
    assert_eq!(times("default", &[]), [1.5; 5]);
    assert_eq!(times("slow", &["--vlm-latency", "3"]), [3.0; 5]);
    // The same flight bit for bit, however long the program took.
    times("again", &[]);
    assert_eq!(lab.read("default/decisions.jsonl"), lab.read("again/decisions.jsonl"));
    let shown = lab.spf(&["-v", "fly", "fly to the red crane", "--vlm", &vlm, "--no-video", "--out", "shown"]);
    assert!(shown.stderr.contains("exec: asked 1") && shown.stderr.contains("VLM: the program `sh "), "{}", shown.stderr);
    let quiet = lab.spf(&["fly", "fly to the red crane", "--vlm", &vlm, "--no-video", "--out", "quiet"]);
    assert!(!quiet.stderr.contains("asked"), "{}", quiet.stderr);
    assert!(quiet.stderr.contains("Obstacle mode is off, because this program declares"), "{}", quiet.stderr);
}

#[test]
fn a_program_without_its_dependency_fails_before_take_off() {
    let lab = Lab::new();
    lab.write("model.sh", "echo 'ModuleNotFoundError: No module named PIL' >&2\nexit 1\n");
    // No drone is there: nothing is connected before.
    let vlm = format!("exec:sh '{}'", lab.path("model.sh").display());
    let run = lab.spf(&["fly", "go", "--drone", "tello@192.0.2.1", "--vlm", &vlm, "--no-vlm-check", "--unattended"]);
    assert_eq!(run.code, Some(6), "{}{}", run.stdout, run.stderr);
    for words in ["the program that answers does not run; take-off cancelled", "No module named PIL"] {
        assert!(run.stderr.contains(words), "{words}: {}", run.stderr);
    }
}

#[test]
fn only_the_command_line_may_name_a_program() {
    let lab = Lab::new();
    let vlm = format!("exec:touch {}", lab.path("touched").display());
    let refused = |run: Run, source: &str| {
        assert_eq!(run.code, Some(2), "{}", run.stderr);
        assert!(run.stderr.contains(source) && run.stderr.contains("command line only"), "{}", run.stderr);
        assert!(!lab.path("touched").exists());
    };
    let fly = ["fly", "fly to the red crane", "--no-video"];
    let output = lab.command(&fly).env("SPF_VLM", &vlm).output().unwrap();
    refused(Run::of(&output), "environment SPF_VLM");
    lab.write(".env", format!("SPF_VLM='{vlm}'\n"));
    refused(lab.spf(&fly), ".env SPF_VLM");
    lab.write(".env", "");
    lab.write("spf.toml", format!("[fly]\nvlm = \"{vlm}\"\n"));
    refused(lab.spf(&fly), "spf.toml:2");
    let doctor = lab.spf(&["doctor"]);
    assert!(doctor.code == Some(6) && doctor.stdout.contains("command line only"), "{}", doctor.stdout);
    assert!(!lab.path("touched").exists());
}

#[test]
fn the_doctor_without_a_drone_tells_who_answers_and_whose_keys_are_set() {
    let lab = Lab::new();
    let run = lab.spf(&["doctor"]);
    assert_eq!(run.code, Some(0), "{}", run.stdout);
    assert!(run.stdout.contains("the oracle, in place of one; no vendor's key is set"), "{}", run.stdout);
    let run = Run::of(&lab.command(&["doctor"]).env("GEMINI_API_KEY", KEY).output().unwrap());
    assert!(run.stdout.contains("a key is set for gemini: --vlm gemini") && !run.stdout.contains(KEY), "{}", run.stdout);
}

#[test]
fn a_program_that_cannot_answer_is_named_with_its_reason() {
    let lab = Lab::new();
    let missing = lab.spf(&["fly", "fly to the red crane", "--vlm", "exec:/no/such/program x", "--no-video"]);
    assert_eq!(missing.code, Some(2), "{}", missing.stderr);
    assert!(missing.stderr.contains("cannot start `/no/such/program`"), "{}", missing.stderr);
    lab.write("bad.sh", "echo 'no such model' >&2; exit 3");
    let (code, summary) = lab.fly("bad", &["fly to the red crane", "--vlm", "exec:sh bad.sh"]);
    assert_eq!((code, &summary["vlm_use"]["failed"]), (6, &serde_json::json!({ "program": 5 })), "{summary}");
    assert!(rows(&lab.path("bad/vlm.jsonl"))[0]["reason"].as_str().unwrap().contains("no such model"));
    let check = lab.spf(&["vlm", "check", "exec:sh bad.sh"]);
    assert_eq!(check.code, Some(6), "{}", check.stderr);
    assert!(check.stderr.contains("no such model") && check.stderr.contains("spf -v vlm check"), "{}", check.stderr);
}

#[test]
fn a_program_answers_questions_and_flies_the_bench() {
    let lab = Lab::new();
    let vlm = program(&lab, 2);
    let run = lab.spf(&["sim", "dataset", "--scene", "office", "-n", "4", "-o", "data"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let run = lab.spf(&["ground", "--dataset", "data", "--vlm", &vlm, "--json", "-o", "graded"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let report: Value = serde_json::from_str(&run.stdout).unwrap();
    let own = report["measures"].as_array().unwrap().iter().find(|row| row["answerer"] == vlm.as_str()).unwrap();
    assert_eq!((&own["asked"], &own["failed"], &own["unreadable"]), (&4.into(), &0.into(), &0.into()), "{own}");
    let bench = ["bench", "run", "--task", "sim-nav-red-crane", "--trials", "2", "--vlm", &vlm, "-o", "flown"];
    let run = lab.spf(&bench);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let flown = rows(&lab.path("flown/results.jsonl"));
    assert_eq!(flown.len(), 2);
    assert!(flown.iter().all(|row| row["latency_model"] == "fixed 1.5 s" && row["latency_ms"]["p50"] == 1500.0), "{flown:?}");
}

/// Runs a command whose standard input is `typed`.
fn typing(lab: &Lab, args: &[&str], typed: &str) -> Run {
    let mut child = lab.command(args).stdin(Stdio::piped()).spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let typed = typed.to_owned();
    // What is typed before an image is shown is not about it: each line follows a question.
    let stderr = child.stderr.take().unwrap();
    let typist = std::thread::spawn(move || {
        let (mut lines, mut told) = (typed.lines(), String::new());
        for line in std::io::BufRead::lines(std::io::BufReader::new(stderr)).map_while(Result::ok) {
            if line.starts_with("query ") || line.starts_with("not understood") {
                // At the end of the lines the terminal is silent until the drone has landed.
                let next = lines.next().unwrap_or("land");
                drop(writeln!(stdin, "{next}"));
            }
            told += &format!("{line}\n");
        }
        told
    });
    let output = child.wait_with_output().unwrap();
    Run { stderr: typist.join().unwrap(), ..Run::of(&output) }
}

#[test]
fn a_person_flies_by_typing() {
    let lab = Lab::new();
    let fly = ["fly", "fly to the red crane", "--vlm", "human", "--no-video", "--json", "--out"];
    let run = typing(&lab, &[fly.as_slice(), &["done"]].concat(), "0.5 0.5 4\nright\nwhat?\n480 360 3\ndone\ndone");
    let summary: Value = serde_json::from_str(&run.stdout).unwrap_or_else(|error| panic!("{error}: {}", run.stderr));
    assert_eq!((run.code, &summary["outcome"]), (Some(3), &"reached".into()), "{summary}");
    assert!(run.stderr.contains("VLM: you.") && run.stderr.contains("(960×720): fly to the red crane"), "{}", run.stderr);
    assert!(run.stderr.contains("You answered `done`") && run.stderr.contains("not understood"), "{}", run.stderr);
    let rows = rows(&lab.path("done/vlm.jsonl"));
    assert_eq!(rows.iter().map(|row| row["latency_s"].as_f64().unwrap()).collect::<Vec<_>>(), [1.5; 5], "{rows:?}");
    // Orders are carried out in the middle of a query.
    let run = typing(&lab, &[fly.as_slice(), &["landed"]].concat(), "0.5 0.5 4\nland");
    let summary: Value = serde_json::from_str(&run.stdout).unwrap_or_else(|error| panic!("{error}: {}", run.stderr));
    assert_eq!((run.code, &summary["outcome"]), (Some(5), &"aborted".into()), "{summary}");
    let bench = lab.spf(&["bench", "run", "--task", "sim-nav-red-crane", "--vlm", "human", "-o", "x"]);
    assert_eq!(bench.code, Some(2), "{}", bench.stderr);
}

#[test]
fn costs_are_told_before_they_arise() {
    let lab = Lab::new();
    let server = Server::start(|_, request| Vendor::Gemini.stream(&Vendor::Gemini.model(request), DONE));
    let vlm = format!("gemini@{}", server.url());
    let bench = |folder: &str, vlm: &str, more: &[&str]| {
        let args = ["bench", "run", "--task", "sim-nav-red-crane", "--trials", "1", "--vlm", vlm, "-o", folder];
        Run::of(&lab.command(&[&args, more].concat()).env("GEMINI_API_KEY", KEY).output().unwrap())
    };
    let run = bench("out", &vlm, &["--max-cost", "1"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(run.stderr.contains("1 flights = 20 queries × ") && run.stderr.contains("about $"), "{}", run.stderr);
    // From what was flown in the folder: two queries, and nothing left to fly.
    let mut more = vec!["--max-cost", "1"];
    let run = bench("out", &vlm, &more);
    assert!(!run.stderr.contains("queries ×"), "{}", run.stderr);
    // Without a terminal nobody can agree, and without a limit nothing is flown.
    let asked = server.questions().len();
    let run = bench("unlimited", &vlm, &[]);
    assert!(run.code == Some(2) && run.stderr.contains("this may cost money") && run.stderr.contains("--yes"), "{}", run.stderr);
    assert_eq!(server.questions().len(), asked);
    // A model without a price is refused before anything flies, unless one is given.
    let unknown = format!("gemini#my-model@{}", server.url());
    let run = bench("unknown", &unknown, &more);
    assert_eq!(run.code, Some(2), "{}", run.stderr);
    assert!(run.stderr.contains("--max-cost requires a known price") && run.stderr.contains("--vlm-price"), "{}", run.stderr);
    let run = bench("unknown", &unknown, &["--max-cost-per-trial", "1"]);
    assert!(run.code == Some(2) && run.stderr.contains("requires a known price"), "{}", run.stderr);
    // The limit is that of the run: flights of two queries, each of a tenth of a cent.
    let others = ["--task", "sim-nav-black-car", "--task", "sim-nav-white-needle"];
    let run = bench("limited", &vlm, &[&others[..], &["--jobs", "1", "--max-cost", "0.004"]].concat());
    assert_eq!(run.code, Some(5), "{}", run.stderr);
    assert!(run.stderr.contains("(--max-cost): ") && run.stderr.contains("with a higher limit"), "{}", run.stderr);
    assert!(rows(&lab.path("limited/results.jsonl")).len() < 3);
    let before = server.questions().len();
    more.clear();
    let args =
        ["fly", "fly to the red crane", "--vlm", &unknown, "--max-cost", "1", "--vlm-price", "1,2", "--json", "--no-video"];
    let run = Run::of(&lab.command(&args).env("GEMINI_API_KEY", KEY).output().unwrap());
    let summary: Value = serde_json::from_str(&run.stdout).unwrap_or_else(|error| panic!("{error}: {}", run.stderr));
    assert!(summary["vlm_use"]["cost_usd"].as_f64() > Some(0.002), "{summary}");
    assert_eq!(server.questions().len(), before + 2);
}

/// At a terminal the costs are confirmed: anything but yes flies nothing.
#[test]
#[ignore = "needs Python: .ci/interop runs it"]
fn costs_are_confirmed_at_a_terminal() {
    let Some(python) = python::environment() else { return };
    let lab = Lab::new();
    let server = Server::start(|_, request| Vendor::Gemini.stream(&Vendor::Gemini.model(request), DONE));
    lab.write("asked.py", include_str!("asked.py"));
    let vlm = format!("gemini@{}", server.url());
    for (answer, code, flown) in [("n", "5", false), ("", "5", false), ("y", "0", true)] {
        let folder = lab.path(&format!("answered-{answer}"));
        let bench = ["bench", "run", "--task", "sim-nav-red-crane", "--trials", "1", "--max-cost", "1", "--vlm", &vlm, "-o"];
        let mut asked = std::process::Command::new(&python);
        let command = lab.command(&bench);
        asked.arg(lab.path("asked.py")).arg(answer).arg(command.get_program()).args(command.get_args()).arg(&folder);
        asked.current_dir(lab.path(".")).env("GEMINI_API_KEY", KEY);
        let before = server.questions().len();
        let shown = String::from_utf8(asked.output().unwrap().stdout).unwrap();
        assert!(shown.contains("about $") && shown.contains("Continue? [y/N] "), "{shown}");
        assert_eq!((shown.lines().next(), server.questions().len() > before), (Some(code), flown), "{shown}");
    }
}

/// A model that ends within a month, whenever that is.
#[test]
fn a_model_that_ends_soon_is_announced() {
    let lab = Lab::new();
    let server = Server::start(|_, request| Vendor::Gemini.stream(&Vendor::Gemini.model(request), DONE));
    let seconds = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap().as_secs();
    let output =
        std::process::Command::new("date").args(["-u", "+%Y-%m-%d", "-d", &format!("@{}", seconds + 20 * 86_400)]).output();
    let Ok(output) = output else { return crate::harness::skip("date") };
    let day = String::from_utf8(output.stdout).unwrap().trim().to_owned();
    let row = format!(
        "[[model]]\nid = \"old\"\nvendor = \"gemini\"\nstatus = \"deprecated\"\nretires = \"{day}\"\nsuccessor = \"new\"\n"
    );
    lab.write("models.toml", row);
    let vlm = format!("gemini#old@{}", server.url());
    let args = ["fly", "fly to the red crane", "--vlm", &vlm, "--vlm-models", "models.toml", "--no-video"];
    let run = Run::of(&lab.command(&args).env("GEMINI_API_KEY", KEY).output().unwrap());
    let told = format!("warning: it will be retired on {day}, in ");
    assert!(run.stderr.contains(&told) && run.stderr.contains("its successor is new"), "{}", run.stderr);
}

#[test]
#[ignore = "takes long: .ci/interop runs it"]
fn a_trial_is_one_page_that_is_resumed_and_capped() {
    let lab = Lab::new();
    let server = Server::start(|_, request| Vendor::Gemini.stream(&Vendor::Gemini.model(request), AHEAD));
    let (own, model) = (program(&lab, 3), format!("gemini@{}", server.url()));
    let names = format!("{own},{model}");
    let trial = |more: &[&str]| {
        let args = ["vlm", "trial", &names, "-o", "tried", "--questions", "6", "--flights", "1"];
        Run::of(&lab.command(&[&args, more].concat()).env("GEMINI_API_KEY", KEY).output().unwrap())
    };
    // A cent is spent within the questions: 1200 tokens in cost 0.0012 $.
    let run = trial(&["--max-cost", "0.006"]);
    assert_eq!(run.code, Some(5), "{}\n{}", run.stdout, run.stderr);
    assert!(run.stderr.contains("--max-cost limit is reached") && run.stderr.contains("about $"), "{}", run.stderr);
    let asked = server.questions().len();
    assert!((3..9).contains(&asked), "{asked}");
    let run = trial(&["--yes"]);
    assert_eq!(run.code, Some(0), "{}\n{}", run.stdout, run.stderr);
    // Those dots were missed, so they are sent again; no question is.
    let pointing = rows(&lab.path("tried/pointing/answers.jsonl"));
    assert_eq!(pointing.len(), 12);
    let figures: Value = serde_json::from_slice(&lab.read("tried/trial.json")).unwrap();
    let found =
        |index: usize, path: &str| figures.pointer(&format!("/{index}{path}")).cloned().unwrap_or_else(|| panic!("{path}"));
    assert_eq!((found(0, "/vlm"), found(1, "/vlm")), (own.as_str().into(), model.as_str().into()));
    assert_eq!((found(1, "/pointing/asked"), found(1, "/flights/strict/of")), (6.into(), 1.into()));
    assert_eq!(found(0, "/flights/rows/0/latency_model"), "fixed 1.5 s");
    // It says `done` at once in its only flight, and is not there.
    assert_eq!(found(0, "/flights/false_done"), serde_json::json!({ "hits": 1, "of": 1 }));
    assert_eq!((found(0, "/dots/good"), found(1, "/flights/strict/hits")), (false.into(), 0.into()));
    assert!(found(1, "/flights/cost_usd").as_f64() > Some(0.0) && found(0, "/flights/cost_usd").is_null());
    let page = String::from_utf8(lab.read("tried/index.html")).unwrap();
    for words in
        ["Trial of vision-language models", "flights: false done", "√pixels", "depth labels", "No image is of the real world"]
    {
        assert!(page.to_lowercase().contains(&words.to_lowercase()), "{words}");
    }
    // Nothing is left to do, and nothing is paid for but the dots that were missed.
    let before = server.questions().len();
    let run = trial(&["--yes"]);
    assert_eq!((run.code, server.questions().len()), (Some(0), before + 3), "{}", run.stderr);
    assert_eq!(lab.spf(&["vlm", "trial", "oracle", "-o", "x"]).code, Some(2));
}

/// The forms of all vendors' answers, which the vendors' own SDKs read (`vendors.py`), in one trial.
#[test]
fn a_trial_reads_the_answers_of_every_vendor() {
    let lab = Lab::new();
    // Three dots and two questions, then the flight: ahead twice, and done.
    let answers = |vendor: Vendor| {
        Server::start(move |number, request| vendor.stream(&vendor.model(request), if number < 7 { AHEAD } else { DONE }))
    };
    let servers = Vendor::ALL.map(answers);
    let names = Vendor::ALL.iter().zip(&servers).map(|(vendor, server)| format!("{}@{}", vendor.name(), server.url()));
    let names = names.collect::<Vec<_>>();
    let args =
        ["vlm", "trial", &names.join(","), "-o", "tried", "--questions", "2", "--flights", "1", "--parallel", "1", "--yes"];
    let mut command = lab.command(&args);
    for vendor in Vendor::ALL {
        command.env(vendor.key(), KEY);
    }
    let run = Run::of(&command.output().unwrap());
    assert_eq!(run.code, Some(0), "{}\n{}", run.stdout, run.stderr);
    let figures: Value = serde_json::from_slice(&lab.read("tried/trial.json")).unwrap();
    for (index, name) in names.iter().enumerate() {
        let of = &figures[index];
        assert_eq!(
            (&of["vlm"], &of["pointing"]["asked"], &of["pointing"]["failed"]),
            (&name.as_str().into(), &2.into(), &0.into())
        );
        assert_eq!((&of["pointing"]["unreadable"], &of["flights"]["strict"]["of"]), (&0.into(), &1.into()), "{of}");
        // Tokens as this vendor counts them.
        assert!(of["flights"]["rows"][0]["tokens_in"].as_u64() > Some(1000), "{name}: {of}");
        assert!(servers[index].questions().len() >= 8, "{name}: {}", servers[index].questions().len());
    }
}

fn example(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(name)
}

#[test]
#[ignore = "needs Pillow: .ci/interop runs it"]
fn the_examples_of_programs_fly() {
    let Some(python) = python::environment() else { return };
    let lab = Lab::new();
    let vlm = |name: &str, more: &str| format!("exec:{} {}{more}", python.display(), example(name).display());
    let blob = vlm("exec_blob.py", "");
    let check = lab.spf(&["vlm", "check", &blob]);
    assert_eq!(check.code, Some(0), "{}{}", check.stdout, check.stderr);
    let (code, summary) = lab.fly("crane", &["Take off and fly to the red crane", "--vlm", &blob, "--seed", "0"]);
    assert_eq!((code, &summary["verified"]), (0, &true.into()), "{summary}");
    let (code, summary) = lab.fly("uncoloured", &["fly to the crane", "--vlm", &blob]);
    assert_eq!((code, &summary["vlm_use"]["failed"]["program"]), (6, &5.into()), "{summary}");
    // The skeleton without a model: the lines are exchanged, and nothing is found.
    let dry = vlm("exec_transformers.py", " --dry-run");
    let (code, summary) = lab.fly("dry", &["fly to the red crane", "--vlm", &dry]);
    assert_eq!(
        (code, &summary["outcome"], &summary["vlm_use"]["failed"]),
        (3, &"not_found".into(), &serde_json::json!({})),
        "{summary}"
    );
}
