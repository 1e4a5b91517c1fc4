//! Programs as VLMs: small scripts that answer well, late, twice, or not at all.

use std::sync::Arc;
use std::time::{Duration, Instant};

use spf_core::frame::FrameId;
use spf_core::query::{Query, QueryId, QueryKind};
use spf_vlm::exec::{Exec, ExecOptions};
use spf_vlm::{Cancel, QueryImage, QueryRequest, Vlm, VlmError};

struct Blank;

impl QueryImage for Blank {
    fn size(&self) -> (u32, u32) {
        (960, 720)
    }

    fn jpeg(&mut self, _: (u32, u32), _: u8) -> Result<Arc<[u8]>, VlmError> {
        Ok(Arc::from([0xff, 0xd8].as_slice()))
    }
}

/// A program in a folder of its own. `$FOLDER` in the script is that folder.
fn program(script: &str, loading: Duration) -> (tempfile::TempDir, Exec) {
    program_with(script, ExecOptions { loading, ..ExecOptions::default() })
}

fn program_with(script: &str, options: ExecOptions) -> (tempfile::TempDir, Exec) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a program.sh");
    std::fs::write(&file, script.replace("$FOLDER", folder.path().to_str().unwrap())).unwrap();
    let exec = Exec::start(&format!("sh '{}' 'two words'", file.display()), options);
    (folder, exec.unwrap())
}

fn ask(exec: &mut Exec, time_left: Duration, cancel: &Cancel) -> Result<String, VlmError> {
    let query = Query {
        instruction: "to the crane".to_owned(),
        prompt: "Where?\nSay it.".to_owned(),
        ..Query::new(QueryId(7), FrameId(7), QueryKind::point(false))
    };
    let request = QueryRequest { query: &query, time_left, cancel: cancel.clone() };
    exec.answer(&request, &mut Blank).text
}

const LONG: Duration = Duration::from_secs(20);
const SHORT: Duration = Duration::from_millis(400);

#[test]
fn a_program_that_lacks_what_it_needs_is_known_before_it_is_asked() {
    let (_folder, exec) = program("echo 'No module named PIL' >&2; exit 1", SHORT);
    let error = exec.ends_within(LONG).unwrap().to_string();
    assert!(error.contains("No module named PIL"), "{error}");
    let (_folder, exec) = program("cat", SHORT);
    assert!(exec.ends_within(SHORT).is_none());
}

/// Reads requests; `$id` is the id of the one read.
const READ: &str = r#"
next() { read -r line || exit 0; id=${line#*'"id":'}; id=${id%%,*}; }
"#;

#[test]
fn a_request_is_one_line_with_everything_in_it() {
    let script = format!(
        "{READ}echo loading a model\nnext; printf '%s\\n' \"$line\" > \"$FOLDER/line\"; echo \"$1\" > \"$FOLDER/argument\"\n\
         image=${{line#*'\"image\":\"'}}; cp \"${{image%%'\"'*}}\" \"$FOLDER/image\"\n\
         echo \"{{\\\"id\\\":$id,\\\"status\\\":\\\"done\\\"}}\"\nnext"
    );
    let (folder, mut exec) = program(&script, LONG);
    assert_eq!(ask(&mut exec, LONG, &Cancel::default()).unwrap(), r#"{"status":"done"}"#);
    let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert_eq!((read("argument"), read("image")), (b"two words\n".to_vec(), vec![0xff, 0xd8]));
    let line: serde_json::Value = serde_json::from_slice(&read("line")).unwrap();
    assert_eq!((&line["id"], &line["kind"], &line["avoid"]), (&0.into(), &"point".into(), &false.into()));
    assert_eq!((&line["width"], &line["height"]), (&960.into(), &720.into()));
    assert_eq!((&line["order"], &line["scale"]), (&"xy".into(), &"pixels".into()));
    assert_eq!((&line["instruction"], &line["prompt"]), (&"to the crane".into(), &"Where?\nSay it.".into()));
    assert!(line["schema"]["properties"]["point"].is_object() && line["deadline_s"].as_f64().unwrap() > 19.0);
}

#[test]
fn late_answers_are_dropped_and_a_missed_deadline_ends_the_program() {
    // Answers the second request with the first one's answer before its own, and hangs in the third; started again it
    // answers at once.
    let script = format!(
        "{READ}echo started >> \"$FOLDER/starts\"\nnext\n\
         if [ \"$(wc -l < \"$FOLDER/starts\")\" -gt 1 ]; then echo \"{{\\\"id\\\":$id,\\\"status\\\":\\\"again\\\"}}\"; next; fi\n\
         first=$id; next\n\
         for of in $first $id; do echo \"{{\\\"id\\\":$of,\\\"status\\\":\\\"of $of\\\"}}\"; done\n\
         next; echo thinking; sleep 1000 & wait"
    );
    let (folder, mut exec) = program(&script, Duration::ZERO);
    let cancel = Cancel::default();
    cancel.cancel();
    // The first is cancelled: nothing is killed for it.
    assert_eq!(ask(&mut exec, LONG, &cancel), Err(VlmError::Cancelled));
    assert_eq!(ask(&mut exec, LONG, &Cancel::default()).unwrap(), r#"{"status":"of 1"}"#);
    let began = Instant::now();
    let error = ask(&mut exec, SHORT, &Cancel::default()).unwrap_err();
    assert_eq!(error.code(), "deadline");
    assert!(error.to_string().contains("killed and started again; it printed: thinking"), "{error}");
    assert!(began.elapsed() < Duration::from_secs(100), "{:?}", began.elapsed());
    assert_eq!(ask(&mut exec, LONG, &Cancel::default()).unwrap(), r#"{"status":"again"}"#);
    assert_eq!(std::fs::read_to_string(folder.path().join("starts")).unwrap(), "started\nstarted\n");
}

#[test]
fn an_answer_may_take_as_long_as_the_options_allow_however_much_time_the_query_has() {
    let script =
        format!("{READ}while next; do sleep $((id * 1000)); echo \"{{\\\"id\\\":$id,\\\"status\\\":\\\"of $id\\\"}}\"; done");
    let options = ExecOptions { loading: Duration::ZERO, longest_answer: SHORT, ..ExecOptions::default() };
    let (_folder, mut exec) = program_with(&script, options);
    assert_eq!(ask(&mut exec, LONG, &Cancel::default()).unwrap(), r#"{"status":"of 0"}"#);
    let began = Instant::now();
    assert_eq!(ask(&mut exec, LONG, &Cancel::default()).unwrap_err().code(), "deadline");
    assert!(began.elapsed() < Duration::from_secs(100), "{:?}", began.elapsed());
}

#[test]
fn a_program_that_loads_is_not_killed_and_its_late_answer_counts_for_nothing() {
    let script = format!(
        "{READ}echo started >> \"$FOLDER/starts\"\nsleep 1\nwhile next; do echo \"{{\\\"id\\\":$id,\\\"status\\\":\\\"of $id\\\"}}\"; done"
    );
    let (folder, mut exec) = program(&script, LONG);
    let error = ask(&mut exec, Duration::from_millis(200), &Cancel::default()).unwrap_err();
    assert!(error.to_string().contains("not answered since its start"), "{error}");
    assert_eq!(ask(&mut exec, LONG, &Cancel::default()).unwrap(), r#"{"status":"of 1"}"#);
    assert_eq!(std::fs::read_to_string(folder.path().join("starts")).unwrap(), "started\n");
}

#[test]
fn a_program_that_ends_is_started_again_with_its_last_message_told() {
    let script = format!(
        "{READ}echo started >> \"$FOLDER/starts\"\nnext\n\
         [ \"$(wc -l < \"$FOLDER/starts\")\" -gt 1 ] || {{ echo 'no such model' >&2; exit 3; }}\n\
         echo \"{{\\\"id\\\":$id,\\\"text\\\":\\\"done\\\"}}\"; next"
    );
    let (_folder, mut exec) = program(&script, LONG);
    let error = ask(&mut exec, LONG, &Cancel::default()).unwrap_err();
    assert_eq!(error.code(), "program");
    assert!(error.to_string().contains("exit status: 3; its last message: no such model"), "{error}");
    assert_eq!(ask(&mut exec, LONG, &Cancel::default()).unwrap(), "done");
}

#[test]
fn clones_share_one_program() {
    let script = format!(
        "{READ}echo started >> \"$FOLDER/starts\"\nwhile next; do echo \"{{\\\"id\\\":$id,\\\"status\\\":\\\"of $id\\\"}}\"; done"
    );
    let (folder, exec) = program(&script, LONG);
    let clones: Vec<_> = (0..4)
        .map(|_| {
            let mut exec = exec.clone();
            std::thread::spawn(move || ask(&mut exec, LONG, &Cancel::default()).unwrap())
        })
        .collect();
    let mut texts: Vec<String> = clones.into_iter().map(|clone| clone.join().unwrap()).collect();
    texts.sort();
    assert_eq!(texts, (0..4).map(|id| format!("{{\"status\":\"of {id}\"}}")).collect::<Vec<_>>());
    assert_eq!(std::fs::read_to_string(folder.path().join("starts")).unwrap(), "started\n");
}
