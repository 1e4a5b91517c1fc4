//! `spf sim dataset`: its files are read back, and the oracle is graded on them.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::Value;
use spf_core::frame::FrameId;
use spf_core::query::{Query, QueryId, QueryKind};
use spf_core::reply::parse_reply;
use spf_core::tags::Tagged;
use spf_flight::dataset::Kind;
use spf_flight::dataset::record::{DatasetHeader, Row};
use spf_media::{file, jpeg};
use spf_oracle::{ErrorFile, GroundTruthView, Oracle, Placed, masks, resolve_truth};

use crate::harness::{Lab, rows};

const SIZE: [&str; 2] = ["--size", "480x360"];

fn make(lab: &Lab, folder: &str, count: &str, more: &[&str]) -> crate::harness::Run {
    let mut args = vec!["sim", "dataset", "-n", count, "-o", folder, "--seed", "5"];
    args.extend(SIZE);
    args.extend(more);
    lab.spf(&args)
}

/// A 16-bit grey image.
fn grey16(path: &Path) -> Vec<u16> {
    let image = file::decode(&std::fs::read(path).unwrap(), file::Limits::default());
    let image = image.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    assert_eq!((image.channels(), image.bits()), (1, 16), "{}", path.display());
    image.into_grey16()
}

/// The tags of a legend, as the oracle reads them.
fn tags(legend: &Value) -> Vec<Tagged> {
    let objects = legend["objects"].as_array().unwrap();
    let words = |value: &Value| -> Vec<String> {
        value.as_array().unwrap().iter().map(|word| word.as_str().unwrap().to_owned()).collect()
    };
    let key_of = |id: u64| objects.iter().find(|o| o["id"] == id).map(|o| o["key"].as_str().unwrap().to_owned());
    let tagged = |object: &Value| {
        let tags = &object["tags"];
        Tagged {
            id: object["id"].as_u64().unwrap() as u16,
            key: object["key"].as_str().unwrap().to_owned(),
            names: words(&tags["names"]),
            synonyms: words(&tags["synonyms"]),
            colour: tags["colour"].as_str().map(str::to_owned),
            kind: tags["kind"].as_str().unwrap().to_owned(),
            qualities: words(&tags["qualities"]),
            uses: words(&tags["uses"]),
            group: tags["group"].as_str().map(str::to_owned),
            stands_for_group: false,
            opening: object["opening"].as_bool().unwrap(),
            opening_of: tags["opening_of"].as_u64().and_then(key_of),
            looks_like: tags["looks_like"].as_u64().and_then(key_of),
        }
    };
    let mut all: Vec<Tagged> = objects.iter().map(tagged).collect();
    Tagged::represent_groups(&mut all);
    all
}

/// The oracle's inputs for one example, from its files.
struct Seen {
    ids: Vec<u16>,
    depth: Vec<f32>,
    opening_ids: Vec<u16>,
    opening_depth: Vec<f32>,
    in_frame: BTreeMap<u16, f32>,
    light: BTreeMap<u16, f32>,
}

impl Seen {
    fn read(folder: &Path, row: &Row) -> Self {
        let metres = |path: &str| grey16(&folder.join(path)).iter().map(|cm| f32::from(*cm) / 100.0).collect();
        Self {
            ids: grey16(&folder.join(&row.files.ids)),
            depth: metres(&row.files.depth),
            opening_ids: row.files.opening_ids.as_ref().map(|path| grey16(&folder.join(path))).unwrap_or_default(),
            opening_depth: row.files.opening_depth.as_deref().map(metres).unwrap_or_default(),
            in_frame: row.visible.iter().map(|thing| (thing.id, thing.in_frame)).collect(),
            light: row.visible.iter().map(|thing| (thing.id, thing.light)).collect(),
        }
    }
}

/// The oracle's point in one example, as a pixel; `None` if it replies that the target is not visible.
fn pointed(oracle: &Oracle, head: &DatasetHeader, row: &Row, seen: &Seen, tags: &[Tagged]) -> Option<(usize, usize)> {
    let (w, h) = (head.camera.width as usize, head.camera.height as usize);
    let sight = GroundTruthView {
        width: w,
        height: h,
        ids: &seen.ids,
        depth: &seen.depth,
        piece_ids: &[],
        pieces: &[],
        opening_ids: &seen.opening_ids,
        opening_depth: &seen.opening_depth,
        camera: &head.camera,
        attitude: Default::default(),
        in_frame: &seen.in_frame,
        light: &seen.light,
        signs: &[],
    };
    let frame = FrameId(row.number);
    let percept = oracle.percept(frame, &sight, tags);
    let query = Query { instruction: row.instruction.clone(), ..Query::new(QueryId(row.number), frame, QueryKind::point(false)) };
    let reply = parse_reply(&oracle.answer(&query, &percept).text, &Default::default(), false).unwrap();
    reply.point.map(|point| ((point.u * w as f64) as usize, (point.v * h as f64) as usize))
}

#[test]
#[ignore = "long: .ci/interop runs it"]
fn a_dataset_is_consistent_and_the_oracle_can_be_graded_on_it() {
    let lab = Lab::new();
    let run = make(&lab, "data", "40", &[]);
    assert_eq!((run.code, run.stdout.as_str()), (Some(0), "data\n"), "{}", run.stderr);
    let folder = lab.path("data");
    let head: DatasetHeader = serde_json::from_slice(&lab.read("data/dataset.json")).unwrap();
    let legend: Value = serde_json::from_slice(&lab.read("data/legends/0.json")).unwrap();
    let tags = tags(&legend);
    let rows: Vec<Row> =
        rows(&folder.join("examples.jsonl")).into_iter().map(|row| serde_json::from_value(row).unwrap()).collect();
    assert_eq!((rows.len(), head.examples, head.format), (40, 40, 1));

    // A quarter each, to within two examples.
    let of_kind = |kind: Kind| rows.iter().filter(|row| row.kind == kind).count();
    assert!((8..=12).contains(&of_kind(Kind::Absent)) && (8..=12).contains(&of_kind(Kind::LookAlike)));
    // Wordings vary, and so do distances.
    let wordings: std::collections::BTreeSet<_> = rows.iter().map(|row| row.wording).collect();
    let distances = || rows.iter().filter_map(|row| row.target.as_ref()).map(|target| target.distance_m);
    assert!(wordings.len() >= 5, "{wordings:?}");
    assert!(distances().fold(f64::MAX, f64::min) < 10.0 && distances().fold(0.0, f64::max) > 40.0);

    let oracle = Oracle::new(ErrorFile::named("perfect").unwrap(), head.scenes[0].near_m, 1);
    let (mut hits, mut present, mut silent, mut absent) = (0, 0, 0, 0);
    for row in &rows {
        let seen = Seen::read(&folder, row);
        check(&folder, &head, row, &seen, &tags);
        let point = pointed(&oracle, &head, row, &seen, &tags);
        match &row.target {
            Some(target) => {
                present += 1;
                let ids = if target.opening { &seen.opening_ids } else { &seen.ids };
                hits += usize::from(point.is_some_and(|(x, y)| ids[y * head.camera.width as usize + x] == target.id));
            }
            None => {
                absent += 1;
                silent += usize::from(point.is_none());
            }
        }
    }
    assert!(hits * 10 > present * 9, "the perfect oracle hits {hits} of {present}");
    assert!(silent * 10 > absent * 9, "the perfect oracle says of {silent} of {absent} that they are not there");
}

/// The contents of a row, compared with its images.
fn check(folder: &Path, head: &DatasetHeader, row: &Row, seen: &Seen, tags: &[Tagged]) {
    let (w, number) = (head.camera.width as usize, row.number);
    let image = jpeg::decode(&std::fs::read(folder.join(&row.files.image)).unwrap()).unwrap();
    assert_eq!((image.width(), image.height()), (head.camera.width, head.camera.height));
    let visible =
        |opening: bool| row.visible.iter().filter(move |thing| thing.opening == opening).map(|thing| (thing.id, thing.pixels));
    for (ids, opening) in [(&seen.ids, false), (&seen.opening_ids, true)] {
        let counted: Vec<(u16, u64)> = masks(ids, w).iter().map(|mask| (mask.id, mask.area)).collect();
        assert_eq!(counted, visible(opening).collect::<Vec<_>>(), "{number}");
    }
    // The instruction matches only the target among the visible objects; with an absent target, nothing. (Words of
    // place need the scene.)
    let shown: Vec<Placed<'_>> = tags
        .iter()
        .filter(|tags| row.visible.iter().any(|thing| thing.id == tags.id))
        .map(|tags| Placed { tags, place: None })
        .collect();
    let meant = resolve_truth(&row.instruction, &shown, None).objects;
    match &row.target {
        Some(target) if row.wording == spf_flight::dataset::Wording::Place => assert!(meant.contains(&target.id), "{row:?}"),
        Some(target) => assert_eq!(meant, [target.id], "{row:?}"),
        None => assert_eq!(meant, [0_u16; 0], "{row:?}"),
    }
    assert_eq!(row.target.is_none(), row.kind == Kind::Absent);
    assert!(row.kind != Kind::LookAlike || !row.look_alikes.is_empty(), "{row:?}");
    let Some(target) = &row.target else {
        assert_eq!(row.files.mask, None);
        return;
    };
    let mask = std::fs::read(folder.join(row.files.mask.as_ref().unwrap())).unwrap();
    let mask = file::decode(&mask, file::Limits::default()).unwrap();
    assert_eq!((mask.channels(), mask.bits()), (1, 8));
    let mask = mask.into_grey8();
    assert!(mask.iter().all(|value| [0, 255].contains(value)));
    let inside: Vec<usize> = (0..mask.len()).filter(|at| mask[*at] == 255).collect();
    let columns = || inside.iter().map(|at| (at % w) as u32);
    let lines = || inside.iter().map(|at| (at / w) as u32);
    let (x, y) = (columns(), lines());
    let bounds = [columns().min().unwrap(), lines().min().unwrap(), x.max().unwrap() + 1, y.max().unwrap() + 1];
    assert_eq!((inside.len() as u64, bounds), (target.pixels, target.bounds), "{number}");
    let at = target.point[1] as usize * w + target.point[0] as usize;
    assert_eq!(mask[at], 255, "{number}");
    // 256 pixels at 960×720 are 64 here.
    assert!(target.pixels >= 64 && (0.0..1.0).contains(&target.occlusion), "{target:?}");
    let depth = f64::from(if target.opening { seen.opening_depth[at] } else { seen.depth[at] });
    assert!((depth - 0.01..2.0 * depth + 0.02).contains(&target.distance_m), "{number}: {depth} {target:?}");
    assert!(target.nearest_m <= target.distance_m + 0.05, "{number}: {target:?}");
}

#[test]
fn the_same_seed_gives_the_same_bytes_also_in_pieces() {
    let lab = Lab::new();
    assert_eq!(make(&lab, "whole", "6", &[]).code, Some(0));
    assert_eq!(make(&lab, "pieces", "4", &[]).code, Some(0));
    // A truncated row, and an image of an example that was never finished.
    let path = lab.path("pieces/examples.jsonl");
    let text = String::from_utf8(lab.read("pieces/examples.jsonl")).unwrap();
    std::fs::write(&path, &text[..text.len() - 40]).unwrap();
    let refused = make(&lab, "pieces", "6", &[]);
    assert_eq!(refused.code, Some(2));
    assert!(refused.stderr.contains("--resume") && refused.stderr.contains("already holds a dataset"), "{}", refused.stderr);
    let other = make(&lab, "pieces", "6", &["--resume", "--min-pixels", "999"]);
    assert!(other.code == Some(2) && other.stderr.contains("different settings"), "{}", other.stderr);
    let resumed = make(&lab, "pieces", "6", &["--resume"]);
    assert!(resumed.code == Some(0) && resumed.stderr.contains("3 of 6 examples already done"), "{}", resumed.stderr);
    for folder in ["pictures", "ids", "depth", "openings", "masks", "legends"] {
        let names = lab.names(&format!("whole/{folder}"));
        assert_eq!(names, lab.names(&format!("pieces/{folder}")));
        for name in names {
            assert!(
                lab.read(&format!("whole/{folder}/{name}")) == lab.read(&format!("pieces/{folder}/{name}")),
                "{folder}/{name}"
            );
        }
    }
    for name in ["dataset.json", "examples.jsonl"] {
        assert_eq!(lab.read(&format!("whole/{name}")), lab.read(&format!("pieces/{name}")), "{name}");
    }
    // Started again with another seed: nothing of the old dataset is left.
    assert_eq!(lab.spf(&["sim", "dataset", "-n", "2", "-o", "pieces", "--overwrite", "--size", "480x360"]).code, Some(0));
    assert_eq!(lab.names("pieces/pictures").len(), 2);
}

#[test]
fn a_folder_of_something_else_is_left_alone() {
    let lab = Lab::new();
    std::fs::create_dir(lab.path("mine")).unwrap();
    lab.write("mine/letter.txt", "dear");
    for more in [&[][..], &["--resume"], &["--overwrite"]] {
        let run = make(&lab, "mine", "1", more);
        assert!(run.code == Some(2) && run.stderr.contains("holds no dataset"), "{}", run.stderr);
        assert_eq!(lab.names("mine"), ["letter.txt"]);
    }
    let run = make(&lab, "mine/letter.txt/data", "1", &[]);
    assert!(run.code == Some(2) && run.stderr.contains("cannot use"), "{}", run.stderr);
}

/// No file may grow past 12 KiB: a write fails in the middle, as on a full disk.
#[cfg(unix)]
#[test]
fn a_disk_that_fills_up_leaves_whole_examples() {
    let lab = Lab::new();
    let mut command = std::process::Command::new("sh");
    let line = "trap '' XFSZ; ulimit -f 64; exec \"$0\" \"$@\"";
    command.args(["-c", line, env!("CARGO_BIN_EXE_spf"), "sim", "dataset", "-n", "40", "-o", "data", "--size", "64x48"]);
    command.current_dir(lab.path(".")).env_clear().env("PATH", std::env::var_os("PATH").unwrap());
    let run = crate::harness::Run::of(&command.stdin(std::process::Stdio::null()).output().unwrap());
    assert!(run.code == Some(1) && run.stderr.contains("--resume"), "{:?} {}", run.code, run.stderr);
}

/// Third-party readers: Python's json and Pillow.
#[test]
#[ignore = "needs Python: .ci/interop runs it"]
fn python_reads_it() {
    let lab = Lab::new();
    let Some(python) = crate::python::environment() else { return };
    assert_eq!(make(&lab, "data", "6", &["--pictures", "png"]).code, Some(0));
    lab.write("read.py", include_str!("dataset.py"));
    let output = std::process::Command::new(python).arg("read.py").arg("data").current_dir(lab.path(".")).output().unwrap();
    let message = String::from_utf8_lossy(&output.stdout);
    assert!(
        output.status.success() && message.trim() == "read 6 examples",
        "{message}{}",
        String::from_utf8_lossy(&output.stderr)
    );
}
