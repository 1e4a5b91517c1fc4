//! The flight log, read by its own reader and by others.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use serde_json::Value;
use spf_record::log::LogReader;

use crate::harness::{Lab, Run};
use crate::python;

/// The messages of each topic, in order: time and content.
fn by_topic(path: &Path) -> BTreeMap<String, Vec<(u64, Vec<u8>)>> {
    let mut topics: BTreeMap<String, Vec<_>> = BTreeMap::new();
    for entry in LogReader::open(path).unwrap() {
        let entry = entry.unwrap();
        topics.entry(entry.topic).or_default().push((entry.time.as_nanos(), entry.data.to_vec()));
    }
    topics
}

#[test]
fn the_same_seed_gives_the_same_log() {
    let lab = Lab::new();
    let fly = |folder: &str, seed: &str, threads: &str| {
        let args = ["fly", "fly to the red crane", "--max-time", "9", "--seed", seed, "--no-video", "--out", folder];
        let output = lab.command(&args).env("RAYON_NUM_THREADS", threads).output().unwrap();
        assert_eq!(output.status.code(), Some(3), "{}", String::from_utf8_lossy(&output.stderr));
        by_topic(&lab.path(folder).join("flight.mcap"))
    };
    let first = fly("one", "5", "2");
    assert!(!first["/decision"].is_empty() && first["/command"].len() > 20);
    assert!(first == fly("second", "5", "1"), "the second log differs");
    let other = fly("other", "6", "2");
    assert!(first["/telemetry"] != other["/telemetry"], "another seed is another flight");
}

/// Reads it with the `mcap` package, every message by its schema.
#[test]
#[ignore = "needs Python: .ci/interop runs it"]
fn others_read_it() {
    let Some(python) = python::environment() else { return };
    let lab = Lab::new();
    lab.write("hold.toml", "[[event]]\nat_s = 7\ndo = \"hold\"\n[[event]]\nat_s = 7.5\ndo = \"resume\"\n");
    let args = ["fly", "fly to the red crane", "--max-time", "12", "--events", "hold.toml", "--out"];
    let video = lab.spf(&[&args[..], &["video"]].concat());
    assert_eq!(video.code, Some(3), "{}", video.stderr);
    let bare = lab.spf(&[&args[..], &["bare", "--no-video", "--depth-sensor", "on"]].concat());
    assert_eq!(bare.code, Some(3), "{}", bare.stderr);
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/log.py");
    let output = Command::new(python).arg(script).args([lab.path("video"), lab.path("bare")]).output().unwrap();
    let read = Run::of(&output);
    assert_eq!(read.code, Some(0), "{}{}", read.stdout, read.stderr);
}

fn lines(text: &str) -> Vec<Value> {
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// A flight without images, processed by every log command.
#[test]
fn a_log_is_summarised_printed_replayed_and_repaired() {
    let lab = Lab::new();
    let (_, flown) = lab.fly("mine", &["fly to the red crane", "--max-time", "14", "--seed", "9"]);
    let log = "mine/flight.mcap";

    let told = lab.spf(&["log", "info", log]);
    assert_eq!(told.code, Some(0), "{}", told.stderr);
    assert!(told.stdout.starts_with("\"fly to the red crane\", VLM oracle: timeout\nformat 3, "), "{}", told.stdout);
    assert!(told.stdout.contains("/decision") && told.stdout.contains("foxglove.SceneUpdate"), "{}", told.stdout);
    let told: Value = serde_json::from_str(&lab.spf(&["log", "info", log, "--json"]).stdout).unwrap();
    assert_eq!((&told["whole"], &told["seed"], &told["outcome"]), (&true.into(), &9.into(), &flown["outcome"]), "{told}");

    let printed = lines(&lab.spf(&["log", "cat", log, "/decision", "log"]).stdout);
    let decisions: Vec<&Value> = printed.iter().filter(|line| line["topic"] == "/decision").collect();
    assert_eq!(decisions.len() as u64, told["topics"]["/decision"]["messages"].as_u64().unwrap());
    assert_eq!(decisions[0]["message"]["reply"], lab.decisions("mine")[0]["reply"]);
    let words = printed.iter().filter(|line| line["topic"] == "/log").map(|line| line["message"]["message"].as_str().unwrap());
    assert!(words.collect::<String>().contains("taking off"));
    assert_eq!(lines(&lab.spf(&["log", "cat", log]).stdout).len() as u64, told["messages"].as_u64().unwrap());
    let wrong = lab.spf(&["log", "cat", log, "/decisions"]);
    assert!(wrong.code == Some(2) && wrong.stderr.contains("did you mean `/decision`?"), "{}", wrong.stderr);

    let again = lab.spf(&["replay", log]);
    assert_eq!(again.code, Some(0), "{}{}", again.stdout, again.stderr);
    assert!(again.stdout.starts_with("no difference: "), "{}", again.stdout);

    torn(&lab, log);
}

/// The same, truncated.
fn torn(lab: &Lab, log: &str) {
    let whole = lab.read(log);
    lab.write(log, &whole[..whole.len() / 2]);
    let told = lab.spf(&["log", "info", log]);
    assert!(told.code == Some(0) && told.stderr.contains("warning: ") && told.stderr.contains("log repair"), "{}", told.stderr);
    let again = lab.spf(&["replay", log, "--json"]);
    let report: Value = serde_json::from_str(&again.stdout).unwrap();
    assert_eq!((again.code, &report["torn"], &report["differences"]), (Some(0), &true.into(), &Value::Array(vec![])));
    let repaired = lab.spf(&["log", "repair", log]);
    assert!(repaired.code == Some(0) && repaired.stdout.starts_with("repaired `mine/flight.mcap`"), "{}", repaired.stdout);
    let told: Value = serde_json::from_str(&lab.spf(&["log", "info", log, "--json"]).stdout).unwrap();
    assert_eq!((&told["whole"], &told["outcome"]), (&true.into(), &Value::Null), "the summary was in what is gone");
    assert!(lab.spf(&["log", "repair", log]).stdout.contains("is complete"));
    lab.write("letter.txt", "no log");
    for command in [&["log", "info", "letter.txt"][..], &["log", "repair", "letter.txt"], &["replay", "letter.txt"]] {
        let run = lab.spf(command);
        assert!(run.code == Some(2) && run.stderr.contains("hint: "), "{command:?} {}", run.stderr);
    }
    assert_eq!(lab.read("letter.txt"), b"no log");
}

/// Logs whose lengths are wrong on purpose: errors, with 3 GiB of address space too.
#[cfg(target_os = "linux")]
#[test]
fn lengths_that_are_lies_take_no_memory_and_panic_nowhere() {
    let lab = Lab::new();
    let record = |opcode: u8, content: &[u8]| [&[opcode][..], &(content.len() as u64).to_le_bytes(), content].concat();
    let log = |records: &[u8]| [b"\x89MCAP0\r\n", records, &[0; 200]].concat();
    // A text of 4 GiB in a record of 8 bytes.
    lab.write("text.mcap", log(&record(1, &[&u32::MAX.to_le_bytes()[..], &[0; 4]].concat())));
    // In a chunk of 10 bytes without compression, a message of 100.
    let message = [&[5][..], &100_u64.to_le_bytes(), &[0]].concat();
    let chunk = [&[0; 16][..], &10_u64.to_le_bytes(), &[0; 8], &10_u64.to_le_bytes(), &message].concat();
    lab.write("chunk.mcap", log(&[record(1, &[0; 8]), record(6, &chunk)].concat()));
    for file in ["text.mcap", "chunk.mcap"] {
        for command in ["log info", "log repair", "replay"] {
            let limited = format!("ulimit -v 3000000; exec '{}' {command} {file}", env!("CARGO_BIN_EXE_spf"));
            let run = Command::new("sh").args(["-c", &limited]).current_dir(lab.path("")).output().unwrap();
            let said = String::from_utf8_lossy(&run.stderr);
            assert_eq!(run.status.code(), Some(2), "{command} {file}: {said}");
        }
    }
}

/// A pilot that decides differently from the log is reported.
#[test]
fn a_changed_log_differs() {
    let lab = Lab::new();
    lab.fly("mine", &["fly to the red crane", "--max-time", "12", "--preset", "paper", "--policy", "plain"]);
    // The same inputs with another head: the recorded outputs differ from the replayed ones.
    let copy = changed(&lab.read("mine/flight.mcap"), |head| head["settings"]["rate_hz"] = 20.0.into());
    lab.write("other.mcap", copy);
    let run = lab.spf(&["replay", "other.mcap"]);
    assert_eq!(run.code, Some(1), "{}{}", run.stdout, run.stderr);
    assert!(run.stdout.contains("/command") && run.stdout.contains("recorded") && run.stdout.contains(" differences in "));
}

/// A log with another head.
fn changed(log: &[u8], change: impl Fn(&mut Value)) -> Vec<u8> {
    let mut writer = mcap::Writer::new(std::io::Cursor::new(Vec::new())).unwrap();
    for message in mcap::MessageStream::new(log).unwrap() {
        let mut message = message.unwrap();
        if message.channel.topic == "/flight" {
            let mut head: Value = serde_json::from_slice(&message.data).unwrap();
            change(&mut head);
            message.data = serde_json::to_vec(&head).unwrap().into();
        }
        writer.write(&message).unwrap();
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

/// A folder of logs as one table, of each kind, read by third-party programs.
#[test]
fn a_folder_of_logs_is_one_table() {
    let lab = Lab::new();
    for (folder, seed) in [("flights/one", "1"), ("flights/two", "2")] {
        lab.fly(folder, &["fly to the red crane", "--max-time", "14", "--seed", seed]);
    }
    let (one, two) = (lab.decisions("flights/one"), lab.decisions("flights/two"));
    let parquet = cfg!(feature = "parquet");
    for table in ["decisions.csv", "decisions.jsonl", "decisions.parquet"].into_iter().take(if parquet { 3 } else { 2 }) {
        let run = lab.spf(&["log", "export", "flights", "--all-columns", "-o", table]);
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        assert!(run.stdout.starts_with(&format!("{table}: {} rows, ", one.len() + two.len())), "{}", run.stdout);
    }
    let rows = lines(&String::from_utf8(lab.read("decisions.jsonl")).unwrap());
    assert_eq!(rows[0]["log"], "flights/one/flight.mcap");
    assert_eq!((&rows[0]["flight.seed"], &rows[one.len()]["flight.seed"]), (&1.into(), &2.into()));
    assert_eq!(rows[0]["reading.waypoint.u"], one[0]["reading"]["waypoint"]["u"]);
    let summaries = lab.spf(&["log", "export", "flights", "--topic", "summary", "-o", "flights.csv"]);
    assert!(summaries.stdout.starts_with("flights.csv: 2 rows, "), "{}", summaries.stdout);
    let before = lab.read("flights.csv");
    let again = ["log", "export", "flights", "-o", "flights.csv"];
    let kept = lab.spf(&again);
    assert!(kept.code == Some(2) && kept.stderr.contains("`flights.csv` exists"), "{}", kept.stderr);
    assert_eq!(lab.read("flights.csv"), before);
    assert_eq!(lab.spf(&[&again[..], &["--overwrite"]].concat()).code, Some(0));
    assert_ne!(lab.read("flights.csv"), before);
    let nothing = lab.spf(&["log", "export", "flights", "--topic", "/camera/image", "-o", "none.csv"]);
    assert!(nothing.code == Some(2) && nothing.stderr.contains("no messages on the topic"), "{}", nothing.stderr);
    let other = lab.spf(&["log", "export", "flights", "-o", "decisions.xls"]);
    assert!(other.code == Some(2) && other.stderr.contains(".parquet"), "{}", other.stderr);
    if parquet {
        tables_of_others(&lab);
    } else {
        let run = lab.spf(&["log", "export", "flights", "-o", "decisions.parquet"]);
        assert_eq!(run.code, Some(2), "{}", run.stderr);
        assert!(run.stderr.contains("cargo install --path crates/cli --features parquet"), "{}", run.stderr);
        assert!(!lab.path("decisions.parquet").exists());
    }
}

fn tables_of_others(lab: &Lab) {
    let Some(python) = python::environment() else { return };
    let script = "\
import csv, json, sys, pyarrow.parquet
rows = [json.loads(line) for line in open('decisions.jsonl')]
texts = list(csv.DictReader(open('decisions.csv', newline='')))
table = pyarrow.parquet.read_table('decisions.parquet')
names = table.column_names
assert names == list(texts[0]) and names[0] == 'log' and 'time_s' in names, names
assert len(rows) == len(texts) == table.num_rows
for row, text, cells in zip(rows, texts, table.to_pylist()):
    assert {name: cell for name, cell in cells.items() if cell is not None} == row
    for name in names:
        value = row.get(name, '')
        same = float(text[name]) == value if isinstance(value, float) else text[name] == str(value).lower() if isinstance(value, bool) else text[name] == str(value)
        assert same, (name, text[name], value)
";
    let output = Command::new(python).args(["-c", script]).current_dir(lab.path(".")).output().unwrap();
    let read = Run::of(&output);
    assert_eq!(read.code, Some(0), "{}{}", read.stdout, read.stderr);
}

#[test]
fn a_video_is_made_of_a_log() {
    let lab = Lab::new();
    let run = lab.spf(&["fly", "fly to the red crane", "--max-time", "4", "--out", "mine"]);
    assert_eq!(run.code, Some(3), "{}", run.stderr);
    let made = lab.spf(&["log", "video", "mine/flight.mcap", "-o", "flight.mp4"]);
    assert_eq!(made.code, Some(0), "{}", made.stderr);
    let images = by_topic(&lab.path("mine/flight.mcap"))["/camera/image"].len();
    assert!(made.stdout.starts_with(&format!("flight.mp4: {images} frames, ")), "{}", made.stdout);
    assert!(lab.read("flight.mp4").len() > 50_000);
    let kept = lab.spf(&["log", "video", "mine/flight.mcap", "-o", "flight.mp4"]);
    assert!(kept.code == Some(2) && kept.stderr.contains("--overwrite"), "{}", kept.stderr);
    lab.fly("bare", &["fly to the red crane", "--max-time", "3"]);
    let none = lab.spf(&["log", "video", "bare/flight.mcap", "-o", "none.mp4"]);
    assert!(none.code == Some(2) && none.stderr.contains("no camera images"), "{}", none.stderr);
}

/// The flight's own oracle replies as before, from images rendered again from scene and true pose; a poor one does not.
#[test]
fn another_vlm_is_queried_about_the_same_frames() {
    let lab = Lab::new();
    let flight = ["fly to the red crane", "--max-time", "20", "--seed", "4", "--light", "dusk", "--camera-effects", "lens=wide"];
    lab.fly("mine", &flight);
    let ask = |vlm: &str, out: &str| -> Value {
        let run = lab.spf(&["replay", "mine/flight.mcap", "--vlm", vlm, "--out", out, "--json"]);
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        serde_json::from_str(&run.stdout).unwrap()
    };
    let same = ask("oracle", "same");
    let opinions = same["opinions"].as_array().unwrap();
    assert!(opinions.len() >= 3, "{same}");
    for opinion in opinions.iter().filter(|opinion| !opinion["then"].is_null()) {
        assert_eq!(opinion["then"]["text"], opinion["now"]["text"], "{opinion}");
    }
    let poor = ask("oracle:poor", "poor");
    let apart = poor["opinions"].as_array().unwrap().iter().filter(|opinion| opinion["then"] != opinion["now"]).count();
    assert!(apart > 0, "{poor}");
    assert_eq!(lab.names("poor").len(), opinions.len());
    let image = spf_media::jpeg::decode_any(&lab.read(&format!("poor/{}", lab.names("poor")[0]))).unwrap();
    assert_eq!((image.width(), image.height()), (1280, 480));
    let wrong = lab.spf(&["replay", "mine/flight.mcap", "--vlm", "orcale"]);
    assert!(wrong.code == Some(2) && wrong.stderr.contains("did you mean `oracle`?"), "{}", wrong.stderr);
}

/// One file to send: what was left out is told, the decisions are made again from it, and a folder can be made of it.
#[test]
fn a_flight_is_shared_and_opened() {
    let lab = Lab::new();
    let run = lab.spf(&["fly", "fly to the red crane", "--max-time", "8", "--out", "flights/001-crane"]);
    assert_eq!(run.code, Some(3), "{}", run.stderr);
    let shared = lab.spf(&["log", "share", "flights/001-crane"]);
    assert_eq!(shared.code, Some(0), "{}", shared.stderr);
    let size = lab.read("001-shared.mcap").len().div_ceil(1000);
    assert!(shared.stdout.starts_with(&format!("001-shared.mcap: {size} kB, ")), "{}", shared.stdout);
    for told in [
        "kept: the instruction, \"fly to the red crane\"\n",
        "left out: camera images (--pictures keeps them",
        "left out: date and time of the flight\n",
        "positions are metres from the start",
        "made again from it: no difference in ",
        "not in it: decisions.jsonl, queries.jsonl, summary.json, video.mp4, trajectory.svg\n",
    ] {
        assert!(shared.stdout.contains(told), "{told}: {}", shared.stdout);
    }
    assert!(!shared.stdout.contains("this version does not know"), "a log of this version: {}", shared.stdout);

    let opened = lab.spf(&["log", "open", "001-shared.mcap", "--out", "crane"]);
    assert_eq!(opened.code, Some(0), "{}{}", opened.stdout, opened.stderr);
    assert!(opened.stdout.starts_with("\"fly to the red crane\", sim with oracle: timeout\n"), "{}", opened.stdout);
    assert_eq!(lab.names("crane"), ["decisions.jsonl", "flight.mcap", "queries.jsonl", "summary.json"]);
    assert_eq!(lab.decisions("crane").len(), lab.decisions("flights/001-crane").len());
    assert_eq!(lab.spf(&["replay", "crane/flight.mcap"]).code, Some(0));
    assert!(!by_topic(&lab.path("crane/flight.mcap")).contains_key("/camera/image"));

    let with = lab.spf(&["log", "share", "flights/001-crane/flight.mcap", "--pictures", "-o", "seen.mcap"]);
    assert!(with.code == Some(0) && with.stdout.contains("kept: camera images, with everybody"), "{}", with.stdout);
    let images = by_topic(&lab.path("flights/001-crane/flight.mcap"))["/camera/image"].len();
    assert_eq!(by_topic(&lab.path("seen.mcap"))["/camera/image"].len(), images);
    let told: Value = serde_json::from_str(&lab.spf(&["log", "open", "seen.mcap", "--json"]).stdout).unwrap();
    assert_eq!((&told["pictures"], &told["replay"]["differences"]), (&images.into(), &Value::Array(vec![])));
}

/// What cannot be shared or opened is named, and no file is replaced or left half written.
#[test]
fn what_cannot_be_shared_or_opened_is_named() {
    let lab = Lab::new();
    lab.fly("mine", &["fly to the red crane", "--max-time", "4"]);
    assert_eq!(lab.spf(&["log", "share", "mine", "-o", "mine.mcap"]).code, Some(0));
    let before = lab.read("mine.mcap");
    std::fs::create_dir(lab.path("empty")).unwrap();
    lab.write("letter.txt", "a letter, and no flight log");
    lab.write("torn.mcap", &before[..before.len() - 3000]);
    for (command, told) in [
        (&["log", "share", "mine", "-o", "mine.mcap"][..], "`mine.mcap` exists"),
        (&["log", "share", "nowhere"], "cannot find the flight `nowhere`"),
        (&["log", "share", "empty"], "`empty` is not a flight: it has no flight.mcap"),
        (&["log", "share", "letter.txt", "-o", "l.mcap"], "`letter.txt` is not a log"),
        (&["log", "share", "mine.mcap", "-o", "l.mcap"], "the log was shared before"),
        (&["log", "open", "nowhere.mcap"], "cannot read the flight log `nowhere.mcap`"),
        (&["log", "open", "letter.txt"], "`letter.txt` is not a log"),
        (&["log", "open", "torn.mcap"], "the file is truncated"),
        (&["log", "open", "mine/flight.mcap"], "not made by `spf log share`"),
        (&["log", "open", "mine.mcap", "--out", "mine"], "is not empty"),
    ] {
        let run = lab.spf(command);
        assert!(run.code == Some(2) && run.stderr.contains(told), "{command:?} {:?} {}", run.code, run.stderr);
    }
    assert_eq!(lab.read("mine.mcap"), before);
    assert_eq!(lab.names("."), ["empty", "letter.txt", "mine", "mine.mcap", "torn.mcap"]);
    assert_eq!(lab.spf(&["log", "share", "mine", "-o", "mine.mcap", "--overwrite"]).code, Some(0));
    // A flight that was killed is shared as far as it was recorded.
    let log = lab.read("mine/flight.mcap");
    lab.write("mine/flight.mcap", &log[..log.len() / 2]);
    let part = lab.spf(&["log", "share", "mine", "-o", "part.mcap"]);
    assert!(part.code == Some(0) && part.stderr.contains("incomplete"), "{}{}", part.stdout, part.stderr);
    let opened = lab.spf(&["log", "open", "part.mcap"]);
    assert!(opened.code == Some(0) && opened.stdout.contains("no outcome recorded"), "{}{}", opened.stdout, opened.stderr);
}

/// Every record of an MCAP file, those of its chunks without their compression.
fn records(log: &[u8]) -> Vec<u8> {
    use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader};
    let (mut reader, mut rest, mut found) = (LinearReader::new(), log, Vec::new());
    while let Some(event) = reader.next_event() {
        match event.unwrap() {
            LinearReadEvent::ReadRequest(size) => {
                let (now, later) = rest.split_at(size.min(rest.len()));
                reader.insert(now.len()).copy_from_slice(now);
                reader.notify_read(now.len());
                rest = later;
            }
            LinearReadEvent::Record { data, .. } => found.extend_from_slice(data),
        }
    }
    found
}

/// Settings with a host, a key, paths and names; the user's name and keys in the environment.
#[test]
fn nothing_of_a_computer_is_in_a_shared_file() {
    let lab = Lab::new();
    lab.fly("mine", &["fly to the red crane", "--max-time", "8"]);
    let copy = changed(&lab.read("mine/flight.mcap"), |head| {
        head["instruction"] = "fly to wendelina's red crane, key zebra-own-key-1".into();
        head["vlm"] = "openai#/home/wendelina/best.gguf@http://nas.lan:8080/v1".into();
        head["detector"] = "/home/wendelina/yolo.onnx".into();
        head["depth_model"] = "wendelina-depth".into();
        head["prompt"] = "spf-prompt point 9\nfor wendelina".into();
        head["drone"] = "0TQZH5BEDM0F2A".into();
        head["sim"]["scene"] = "/home/wendelina/garden.toml".into();
    });
    lab.write("own.mcap", copy);
    let share = lab
        .command(&["log", "share", "own.mcap", "-o", "out.mcap"])
        .env("USER", "wendelina")
        .env("X_API_KEY", "zebra-own-key-1")
        .output();
    let shared = Run::of(&share.unwrap());
    assert_eq!(shared.code, Some(0), "{}", shared.stderr);
    let log = lab.read("out.mcap");
    let inside = String::from_utf8_lossy(&records(&log)).to_lowercase();
    assert!(inside.contains("[left out]'s red crane, key [left out]") || inside.contains("fly to [left out]"), "the instruction");
    for secret in ["wendelina", "nas.lan", "zebra", "/home", "0tqzh5bedm0f2a", "yolo", "gguf", "garden"] {
        assert!(!inside.contains(secret) && !String::from_utf8_lossy(&log).contains(secret), "{secret}");
    }
    assert!(String::from_utf8_lossy(&records(&lab.read("own.mcap"))).contains("wendelina"), "it is found where it is");
}

/// A third-party viewer, over the network, during the flight.
#[cfg(unix)]
#[test]
#[ignore = "needs Python: .ci/interop runs it"]
fn a_flight_is_seen_live() {
    let Some(python) = python::environment() else { return };
    let lab = Lab::new();
    let args = ["fly", "fly to the red crane", "--live=127.0.0.1:0", "--no-video", "--max-time", "12", "--out", "mine"];
    let mut flight = lab.command(&args).spawn().unwrap();
    let mut talk = std::io::BufReader::new(flight.stderr.take().unwrap());
    let mut line = String::new();
    let address = loop {
        line.clear();
        assert!(std::io::BufRead::read_line(&mut talk, &mut line).unwrap() > 0, "it told no address");
        if let Some((_, address)) = line.trim().split_once(" connection to ") {
            break address.to_owned();
        }
    };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/live.py");
    let output = Command::new(python).arg(script).arg(address).output().unwrap();
    let seen = Run::of(&output);
    assert_eq!(seen.code, Some(0), "{}{}", seen.stdout, seen.stderr);
    std::io::copy(&mut talk, &mut std::io::sink()).unwrap();
    assert_eq!(flight.wait().unwrap().code(), Some(3));
    // The displayed content equals the log.
    let logged = by_topic(&lab.path("mine/flight.mcap"));
    let told: Value = serde_json::from_str(&seen.stdout).unwrap();
    for (time, data) in told["/command"].as_array().unwrap().iter().map(|pair| (pair[0].as_u64().unwrap(), &pair[1])) {
        let there =
            logged["/command"].iter().any(|(at, bytes)| *at == time && serde_json::from_slice::<Value>(bytes).unwrap() == *data);
        assert!(there, "{time} {data}");
    }
}

/// Rerun reads it, the message types are Foxglove's own, and the files in docs/viewers work.
#[test]
#[ignore = "needs Python: .ci/interop runs it"]
fn rerun_opens_it_and_foxglove_knows_its_messages() {
    let Some(python) = python::environment() else { return };
    let lab = Lab::new();
    let run = lab.spf(&["fly", "fly to the red crane", "--max-time", "9", "--out", "mine"]);
    assert_eq!(run.code, Some(3), "{}", run.stderr);
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut command = Command::new(python);
    command.arg(here.join("tests/it/viewers.py")).arg(lab.path("mine/flight.mcap")).arg(here.join("../../docs/viewers"));
    let read = Run::of(&command.current_dir(lab.path(".")).output().unwrap());
    assert_eq!(read.code, Some(0), "{}{}", read.stdout, read.stderr);
}

/// There is one format: another one is named, and nothing is guessed.
#[test]
fn a_log_of_another_format_is_refused_by_name() {
    let lab = Lab::new();
    assert_eq!(lab.spf(&["fly", "fly to the red crane", "--max-time", "2", "--no-video", "--out", "mine"]).code, Some(3));
    let mut log = lab.read("mine/flight.mcap");
    let key = b"\x06\0\0\0format\x01\0\0\0";
    let at = log.windows(key.len()).position(|bytes| bytes == key).unwrap() + key.len();
    assert_eq!(log[at], b'3');
    log[at] = b'1';
    lab.write("other.mcap", &log);
    for command in [&["log", "info"][..], &["replay"]] {
        let run = lab.spf(&[command, &["other.mcap"]].concat());
        assert!(matches!(run.code, Some(1 | 2)), "{:?} {}", run.code, run.stdout);
        assert!(run.stderr.contains("unsupported log format 1; this version reads format 3"), "{}", run.stderr);
    }
}
