//! Logs made to be shared: what is in them, what is not, and that the pilot decides the same from them.

use std::sync::LazyLock;

use bytes::Bytes;
use proptest::prelude::*;
use serde_json::{Value, json};
use spf_flight::log::{Channel, topics};
use spf_flight::replay::{Changes, replay};
use spf_flight::share::{LEFT_OUT, LeftOut, Pictures, ShareError, Shared, SourceEnd, check, share};
use spf_record::log::{Entry, LogReader, Message, ReadError, Topic, WholeLog};

use crate::replay::{flown, policy};

/// The entries of a flight with every input of a pilot.
static FLOWN: LazyLock<Vec<Entry>> = LazyLock::new(|| entries_of(|_| {}));

fn entries_of(change: impl FnOnce(&mut spf_flight::flight::FlightPlan)) -> Vec<Entry> {
    let folder = tempfile::tempdir().unwrap();
    let log = flown(&folder.path().join("flight"), change);
    LogReader::open(&log).unwrap().map(Result::unwrap).collect()
}

fn shared_of(entries: &[Entry], pictures: Pictures, known: &[String]) -> Result<(Shared, Vec<u8>), ShareError> {
    let read = || Ok::<_, ReadError>(entries.iter().cloned().map(Ok).collect::<Vec<_>>());
    share(read, Vec::new(), pictures, known)
}

fn read(log: &[u8]) -> Vec<Entry> {
    LogReader::new(log).map(Result::unwrap).collect()
}

/// The flight's head, changed.
fn with_head(entries: &[Entry], change: impl FnOnce(&mut Value)) -> Vec<Entry> {
    let mut entries = entries.to_vec();
    let mut head: Value = serde_json::from_slice(&entries[0].data).unwrap();
    change(&mut head);
    entries[0].data = serde_json::to_vec(&head).unwrap().into();
    entries
}

/// The messages of a topic, changed.
fn with(entries: &[Entry], topic: &str, change: impl Fn(&mut Value)) -> Vec<Entry> {
    let mut entries = entries.to_vec();
    for entry in entries.iter_mut().filter(|entry| entry.topic == topic) {
        let mut row: Value = serde_json::from_slice(&entry.data).unwrap();
        change(&mut row);
        entry.data = serde_json::to_vec(&row).unwrap().into();
    }
    entries
}

#[test]
fn a_shared_log_is_replayed_without_a_difference() {
    let plain = entries_of(|plan| plan.policy = policy("plain"));
    for entries in [&*FLOWN, &plain] {
        let (shared, log) = shared_of(entries, Pictures::LeftOut, &[]).unwrap();
        assert_eq!(shared.mark.source, SourceEnd::Whole);
        let opened = check(LogReader::new(&log[..])).unwrap();
        assert_eq!(opened.report.differences, []);
        assert!(opened.report.inputs > 1000 && opened.report.outputs > 200 && !opened.report.torn);
        assert_eq!((opened.head.instruction.as_str(), opened.mark), ("fly to the red crane", shared.mark));
        assert!(opened.summary.is_some() && !opened.decisions.is_empty());
        // As by `spf replay`, which reads any log.
        assert_eq!(replay(LogReader::new(&log[..]), &Changes::default()).unwrap(), opened.report);
        // What is kept is kept as it was.
        let of = |entries: &[Entry], topic: &str| -> Vec<Bytes> {
            entries.iter().filter(|entry| entry.topic == topic).map(|entry| entry.data.clone()).collect()
        };
        let kept = read(&log);
        for topic in ["/telemetry", "/frame", "/reply", "/operator", "/command", "/note", "/finished", "/tf", "/pose/known"] {
            assert_eq!(of(&kept, topic), of(entries, topic), "{topic}");
        }
    }
}

/// The redaction does not hide a pilot that decides differently.
#[test]
fn a_shared_log_still_tells_another_method() {
    let (_, log) = shared_of(&FLOWN, Pictures::LeftOut, &[]).unwrap();
    let other = with_head(&read(&log), |head| head["settings"]["rate_hz"] = 20.0.into());
    let report = replay(other.into_iter().map(Ok), &Changes::default()).unwrap();
    assert!(report.differences.iter().any(|difference| difference.topic == "/command"));
}

/// The words of a server, a prompt and names of one's own are left out, and the decisions are the same without them.
#[test]
fn what_is_left_out_changes_no_decision() {
    let prompt = format!("spf-prompt point 7\n{}", include_str!("../../../../prompts/point-6.txt").split_once('\n').unwrap().1);
    let entries = entries_of(|plan| {
        plan.prompt = Some(std::sync::Arc::new(spf_core::prompt::PromptText::parse(&prompt).unwrap()));
    });
    let (shared, log) = shared_of(&entries, Pictures::LeftOut, &[]).unwrap();
    assert!(shared.mark.left_out.contains(&LeftOut::OwnPrompt), "{:?}", shared.mark.left_out);
    assert_eq!(check(LogReader::new(&log[..])).unwrap().report.differences, []);
    // Every answer failed, in the words of a server.
    let reason = "nas.home.example returned HTTP 503: ask Wendelin (cell 7)";
    let failed = with(&FLOWN, "/reply", |row| *row = json!({"id": row["id"], "failed": reason, "part": false}));
    let (shared, log) = shared_of(&failed, Pictures::LeftOut, &[]).unwrap();
    assert!(shared.mark.left_out.contains(&LeftOut::FailureTexts));
    let first = read(&log).into_iter().find(|entry| entry.topic == "/reply").unwrap();
    assert_eq!(serde_json::from_slice::<Value>(&first.data).unwrap()["failed"], "HTTP 503");
}

#[test]
fn a_truncated_log_is_shared_as_far_as_it_goes() {
    let half = &FLOWN[..FLOWN.len() / 2];
    let read = || Ok::<_, ReadError>(half.iter().cloned().map(Ok).chain([Err(ReadError::Torn)]).collect::<Vec<_>>());
    let (shared, log) = share(read, Vec::new(), Pictures::LeftOut, &[]).unwrap();
    assert_eq!(shared.mark.source, SourceEnd::Truncated);
    let opened = check(LogReader::new(&log[..])).unwrap();
    assert_eq!((opened.report.differences, opened.report.torn, opened.summary), (vec![], true, None));
}

/// A disk that was too slow: the flight is told, and decided again up to the messages that are missing.
#[test]
fn a_log_with_a_gap_is_opened_and_decided_again_up_to_it() {
    let mut entries = FLOWN.clone();
    let middle = entries.len() / 2;
    let at = entries[middle].time;
    entries[middle] = Entry {
        topic: "/gap".to_owned(),
        encoding: "json".to_owned(),
        schema: "spf.Gap".to_owned(),
        data: Bytes::from_static(b"{\"messages\":7}"),
        ..entries[middle].clone()
    };
    let (_, log) = shared_of(&entries, Pictures::LeftOut, &[]).unwrap();
    let opened = check(LogReader::new(&log[..])).unwrap();
    assert_eq!((opened.gap, opened.report.torn, opened.report.differences), (Some(at), true, vec![]));
    assert!(opened.report.inputs > 500 && opened.summary.is_some());
}

#[test]
fn what_is_no_shared_log_is_refused() {
    assert!(matches!(check(FLOWN.iter().cloned().map(Ok)), Err(ShareError::NotShared)));
    let (_, log) = shared_of(&FLOWN, Pictures::LeftOut, &[]).unwrap();
    assert!(matches!(shared_of(&read(&log), Pictures::LeftOut, &[]), Err(ShareError::Already)));
    for part in [log.len() / 2, log.len() / 3, 60, 8, 0] {
        let error = check(LogReader::new(&log[..part])).unwrap_err();
        assert!(matches!(error, ShareError::Torn) || part == 0, "{part}: {error}");
    }
    assert!(matches!(check(LogReader::new(&b"a letter"[..])), Err(ShareError::Log(_))));
    let damaged = with(&FLOWN, "/telemetry", |row| *row = Value::Null);
    assert!(shared_of(&damaged, Pictures::LeftOut, &[]).is_ok(), "null is JSON");
    let mut damaged = FLOWN.clone();
    damaged[5].data = Bytes::from_static(b"{");
    damaged[5].topic = "/telemetry".to_owned();
    assert!(matches!(shared_of(&damaged, Pictures::LeftOut, &[]), Err(ShareError::Message { .. })));
}

/// A secret of each kind that a setting, a file or a server may carry.
fn secret() -> impl Strategy<Value = String> {
    let word = || "[a-z]{4,9}";
    prop_oneof![
        "[A-Za-z0-9]{32}".prop_map(|key| format!("sk-{key}")),
        (word(), word()).prop_map(|(user, folder)| format!("/home/q{user}/{folder}")),
        (word(), word()).prop_map(|(user, folder)| format!("C:\\Users\\q{user}\\{folder}")),
        (1..255_u8, 0..255_u8, 0..255_u8, 1..255_u8).prop_map(|(a, b, c, d)| format!("{a}.{b}.{c}.{d}")),
        (word(), 1024..65_535_u32).prop_map(|(host, port)| format!("http://q{host}.lan:{port}/v1")),
        word().prop_map(|host| format!("q{host}.example.net")),
        "[0-9][A-Z]{2}[0-9]{2}[A-Z]{3}[0-9]{2}[A-Z0-9]{4}",
        "[0-9A-F]{2}(:[0-9A-F]{2}){5}",
        (word(), word()).prop_map(|(user, host)| format!("q{user}@{host}")),
        Just("quwendelin".to_owned()),
    ]
}

/// A few messages of every topic of a flight, so that many can be shared in a test.
static FEW: LazyLock<Vec<Entry>> = LazyLock::new(|| {
    let mut counts = std::collections::BTreeMap::<String, u32>::new();
    let mut few = |entry: &&Entry| {
        let count = counts.entry(entry.topic.clone()).or_default();
        *count += 1;
        *count <= 2
    };
    let mut few: Vec<Entry> = FLOWN.iter().filter(&mut few).cloned().collect();
    assert!(few.len() > 20);
    let jpeg = spf_media::jpeg::Jpeg::encode(&spf_media::Rgb::filled(16, 16, [9, 9, 9]), 80).unwrap();
    let image = spf_record::log::foxglove::image(few[0].time, Bytes::copy_from_slice(jpeg.bytes()));
    let entry =
        |topic: &str, schema: &str, data| Entry { topic: topic.to_owned(), schema: schema.to_owned(), data, ..few[0].clone() };
    let image = entry("/camera/image", "foxglove.CompressedImage", spf_record::log::foxglove::encode(&image));
    few.push(image);
    few
});

/// Puts the secret into every text, as another field, and into everything else that a log can carry.
fn planted(secret: &str) -> Vec<Entry> {
    // Of these the pilot could make nothing, and no secret gets there: enumerations, and the numbers of a depth grid.
    fn plant(value: &mut Value, key: &str, secret: &str) {
        match value {
            Value::Object(fields) => {
                fields.iter_mut().for_each(|(key, value)| plant(value, key, secret));
                fields.insert(secret.to_owned(), secret.into());
                fields.insert("latitude".to_owned(), 47.376_921.into());
            }
            Value::Array(list) => list.iter_mut().for_each(|value| plant(value, key, secret)),
            Value::String(text) if key == "reply" || key == "text" => {
                *text = format!("{{\"target\":\"{secret}\",\"also\":\"{text}\"}}")
            }
            Value::String(text) => *text = format!("{text} {secret}"),
            _ => {}
        }
    }
    let mut entries = FEW.clone();
    for entry in entries.iter_mut().skip(1) {
        if entry.topic == "/depth" {
            continue;
        }
        match serde_json::from_slice::<Value>(&entry.data) {
            Ok(mut row) => {
                plant(&mut row, "", secret);
                entry.data = serde_json::to_vec(&row).unwrap().into();
            }
            // Behind the fields of a Protobuf message, one that its type does not know: number 1000, a text.
            Err(_) => {
                let field = [&[0xc2, 0x3e, secret.len() as u8], secret.as_bytes()].concat();
                entry.data = [&entry.data[..], &field].concat().into();
            }
        }
    }
    let entries = with_head(&entries, |head| {
        let sim = head["sim"].as_object_mut().unwrap();
        for key in ["scene", "light", "weather", "drone_model", "wind", "camera_effects", "depth_sensor"] {
            sim.insert(key.to_owned(), secret.into());
        }
        for key in ["program", "policy", "vlm", "detector", "depth_model", "prompt", "drone", "instruction"] {
            head[key] = secret.into();
        }
        head["vlm"] = format!("openai#{secret}@{secret}").into();
        head["instruction"] = format!("fly to the red crane of {secret}").into();
        head[secret] = secret.into();
    });
    let own = Entry { topic: format!("/{secret}"), schema: secret.to_owned(), ..entries[1].clone() };
    entries.into_iter().chain([own]).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn no_planted_secret_is_in_a_shared_log(secret in secret()) {
        let entries = planted(&secret);
        for pictures in [Pictures::LeftOut, Pictures::Kept] {
            let (_, log) = shared_of(&entries, pictures, &["Quwendelin".to_owned()]).unwrap();
            let holds = |bytes: &[u8], part: &str| bytes.windows(part.len()).any(|window| window.eq_ignore_ascii_case(part.as_bytes()));
            prop_assert!(!holds(&log, &secret));
            for entry in LogReader::new(&log[..]) {
                let entry = entry.unwrap();
                let escaped = secret.replace('\\', "\\\\");
                for part in [secret.as_str(), &escaped, "47.376921", "latitude"] {
                    let told = String::from_utf8_lossy(&entry.data);
                    prop_assert!(!holds(&entry.data, part), "{} has {part}: {told}", entry.topic);
                }
                prop_assert!(Channel::of_topic(&entry.topic).is_some());
                if entry.topic == "/flight" {
                    let head: Value = serde_json::from_slice(&entry.data).unwrap();
                    prop_assert_eq!(&head["instruction"], &json!(format!("fly to the red crane of {LEFT_OUT}")));
                    prop_assert_eq!(&head["limits"], &serde_json::from_slice::<Value>(&FEW[0].data).unwrap()["limits"]);
                }
            }
        }
    }

    /// Whatever arrives in a file is read to an error or to its end.
    #[test]
    fn a_shared_log_with_any_byte_changed_is_read_or_refused(at in 0_usize..1_000_000, byte: u8, cut in 0_usize..1_000_000) {
        static LOG: LazyLock<Vec<u8>> = LazyLock::new(|| shared_of(&FEW, Pictures::Kept, &[]).unwrap().1);
        let mut log = LOG.clone();
        let length = log.len();
        log[at % length] = byte;
        drop(check(LogReader::new(&log[..])));
        log.truncate(cut % length);
        drop(check(LogReader::new(&log[..])));
    }
}

/// Images only if they were asked for, and then without what a camera writes beside the pixels.
#[test]
fn images_are_kept_only_when_asked_for_and_only_their_pixels() {
    let mut entries = FEW.clone();
    let image = entries.iter_mut().find(|entry| entry.topic == "/camera/image").unwrap();
    let with_place = |jpeg: &[u8]| {
        let note = b"Exif\0\0 47.3769 N, 8.5417 E, Wendelin's camera";
        let length = u16::try_from(note.len() + 2).unwrap().to_be_bytes();
        Some(Bytes::from([&jpeg[..2], &[0xff, 0xe1], &length, note, &jpeg[2..]].concat()))
    };
    image.data = spf_record::log::foxglove::image_again(&image.data, with_place).unwrap();
    assert!(image.data.windows(4).any(|window| window == b"Exif"));
    let (without, log) = shared_of(&entries, Pictures::LeftOut, &[]).unwrap();
    assert!(without.mark.left_out.contains(&LeftOut::Pictures) && read(&log).iter().all(|entry| entry.topic != "/camera/image"));
    let (kept, log) = shared_of(&entries, Pictures::Kept, &[]).unwrap();
    assert!(!kept.mark.left_out.contains(&LeftOut::Pictures));
    let image = read(&log).into_iter().find(|entry| entry.topic == "/camera/image").unwrap();
    assert!(!image.data.windows(4).any(|window| window == b"Exif" || window == b"Wend"));
}

/// Each geofence is in metres from the start, and stays: without it the envelope would decide differently.
#[test]
fn a_geofence_and_a_wall_clock() {
    let fence = json!({"type": "FeatureCollection", "features": [{"type": "Feature", "properties": {"max_altitude_m": 30.0},
        "geometry": {"type": "Polygon", "coordinates": [[[-50.0, -50.0], [50.0, -50.0], [50.0, 80.0], [-50.0, -50.0]]]}}]});
    let fenced = with_head(&FEW, |head| head["limits"]["geofence"] = fence.clone());
    let (shared, log) = shared_of(&fenced, Pictures::LeftOut, &[]).unwrap();
    let head: Value = serde_json::from_slice(&read(&log)[0].data).unwrap();
    assert_eq!(head["limits"]["geofence"], fence);
    assert!(shared.mark.left_out.contains(&LeftOut::Clock));
    let mut reader = LogReader::new(&log[..]);
    reader.next();
    assert_eq!(reader.head().unwrap().started_at_ns, 0);
    // The same flight gives the same file.
    assert!(shared_of(&fenced, Pictures::LeftOut, &[]).unwrap().1 == log);
}

/// A real craft has no light and no scene, and that is nothing to leave out.
#[test]
fn what_a_real_craft_does_not_have_is_not_left_out() {
    let real = with_head(&FEW, |head| {
        head.as_object_mut().unwrap().remove("sim");
        head["drone"] = "tello".into();
    });
    let real = with(&real, "/summary", |summary| {
        for key in ["scene", "light", "weather"] {
            summary[key] = "".into();
        }
        (summary["drone"], summary["drone_model"], summary["targets"]) = ("tello".into(), "tello".into(), json!([]));
    });
    let (shared, log) = shared_of(&real, Pictures::LeftOut, &[]).unwrap();
    let summary = read(&log).into_iter().find(|entry| entry.topic == "/summary").unwrap();
    assert_eq!(Some(&summary.data), real.iter().find(|entry| entry.topic == "/summary").map(|entry| &entry.data));
    let none = [LeftOut::OtherSettings, LeftOut::OwnScene, LeftOut::VlmName, LeftOut::Unknown];
    assert!(none.iter().all(|left_out| !shared.mark.left_out.contains(left_out)), "{:?}", shared.mark.left_out);
}

/// A topic of another program in the log, whatever its name.
#[test]
fn another_programs_topic_is_not_in_the_file() {
    let own =
        Topic { name: "/own/topic", encoding: "json", schema: "own.Schema".into(), schema_encoding: "", definition: b"".into() };
    let all: Vec<Topic> = topics().into_iter().chain([own]).collect();
    let mut log = WholeLog::create(Vec::new(), &all).unwrap();
    for entry in FEW.iter().filter(|entry| entry.encoding == "json") {
        let topic = Channel::of_topic(&entry.topic).unwrap() as usize;
        log.push(&Message { topic, time: entry.time, data: entry.data.clone() }).unwrap();
    }
    log.push(&Message { topic: all.len() - 1, time: FEW[0].time, data: Bytes::from_static(b"{}") }).unwrap();
    let (shared, log) = shared_of(&read(&log.finish().unwrap()), Pictures::LeftOut, &[]).unwrap();
    assert_eq!(shared.dropped["/own/topic"], 1);
    assert!(shared.mark.left_out.contains(&LeftOut::Unknown));
    assert!(!log.windows(10).any(|window| window == b"/own/topic" || window == b"own.Schema"));
}
