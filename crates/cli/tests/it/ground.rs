//! `spf ground`: points and their accuracy, on images with known grades.

use std::time::Duration;

use serde_json::{Value, json};
use spf_media::{Jpeg, Rgb};

use crate::harness::{Lab, Run, rows, skip};
use crate::view::Browser;
use crate::vlm::server::{Piece, Reply, Server};
use crate::vlm::vendors::Vendor;
use crate::vlm::{AHEAD, DONE, KEY};

/// A model that replies the same to everything, in the format of one vendor.
fn model(vendor: Vendor, text: &'static str) -> Server {
    Server::start(move |_, request| vendor.stream(&vendor.model(request), text))
}

fn ground(lab: &Lab, server: &Server, vendor: Vendor, args: &[&str]) -> Run {
    let vlm = format!("{}@{}", vendor.name(), server.url());
    let mut all = vec!["ground"];
    all.extend(args);
    all.extend(["--vlm", &vlm]);
    Run::of(&lab.command(&all).env(vendor.key(), KEY).output().unwrap())
}

/// An image, half of it red.
fn image(lab: &Lab, name: &str, (width, height): (u32, u32)) {
    let mut image = Rgb::filled(width, height, [90, 120, 150]);
    for y in 0..height {
        for x in width / 2..width {
            image.set_pixel(x, y, [200, 40, 40]);
        }
    }
    lab.write(name, Jpeg::encode(&image, 90).unwrap().bytes());
}

fn report(run: &Run) -> Value {
    serde_json::from_str(&run.stdout).unwrap_or_else(|error| panic!("{error}\n{}\n{}", run.stdout, run.stderr))
}

fn of<'a>(report: &'a Value, answerer: &str) -> &'a Value {
    let all = report["measures"].as_array().unwrap();
    all.iter().find(|one| one["answerer"] == answerer).unwrap_or_else(|| panic!("{answerer}: {report}"))
}

#[test]
fn the_oracle_is_graded_as_its_error_files_state() {
    let lab = Lab::new();
    let made = lab.spf(&["sim", "dataset", "-n", "60", "-o", "data", "--seed", "5", "--size", "320x240"]);
    assert_eq!(made.code, Some(0), "{}", made.stderr);
    let args = ["ground", "--dataset", "data", "--vlm", "oracle:perfect,oracle:poor", "-o", "graded", "--json"];
    let run = lab.spf(&args);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let found = report(&run);
    let number = |answerer: &str, key: &str, end: &str| of(&found, answerer)[key][end].as_f64().unwrap();
    for oracle in ["oracle:perfect", "oracle:poor"] {
        let expected = of(&found, oracle)["hits_expected"].as_f64().unwrap();
        let (low, high) = (number(oracle, "hits", "low"), number(oracle, "hits", "high"));
        assert!((low..=high).contains(&expected), "{oracle}: {expected} and [{low}, {high}]");
    }
    assert!(number("oracle:perfect", "hits", "value") > 0.9 && number("oracle:perfect", "label_tau", "value") > 0.9);
    assert!(number("centre", "hits", "value") < 0.5 && of(&found, "centre")["latency_p50_s"].is_null());
    assert!(number("oracle:poor", "label_tau", "value") < number("oracle:perfect", "label_tau", "value"));
    assert!(number("oracle:perfect", "absent_recall", "value") > 0.9);
    let pairs = found["comparisons"].as_array().unwrap();
    assert_eq!(pairs.len(), 3);
    assert!(pairs[0]["hits_p_holm"].as_f64().unwrap() < 0.001, "{pairs:?}");

    // Again: refused, then resumed from a truncated file, with the same figures.
    let again = lab.spf(&args);
    assert!(again.code == Some(2) && again.stderr.contains("--resume"), "{}", again.stderr);
    let text = String::from_utf8(lab.read("graded/answers.jsonl")).unwrap();
    lab.write("graded/answers.jsonl", &text[..text.len() / 2]);
    let mut resume = args.to_vec();
    resume.push("--resume");
    let resumed = lab.spf(&resume);
    assert!(resumed.code == Some(0) && resumed.stderr.contains("already answered"), "{}", resumed.stderr);
    assert_eq!(report(&resumed), found);
    assert_eq!(rows(&lab.path("graded/answers.jsonl")).len(), 180);

    // The perfect oracle reports boxes of objects, which have true ones, and of long ones the near piece, which is smaller. Its points
    // keep clear of them.
    let run = lab.spf(&["ground", "--dataset", "data", "--vlm", "oracle:perfect", "-o", "boxes", "--json", "--avoid"]);
    let boxes = report(&run);
    assert!(of(&boxes, "oracle:perfect")["box_iou"]["value"].as_f64().unwrap() > 0.8, "{boxes}");
    assert!(of(&boxes, "oracle:perfect")["hits_expected"].is_null(), "{boxes}");
}

/// An endpoint that says `done` to everything obeys every sign that demands a landing, and says so about the clean twins too.
#[test]
#[ignore = "long: .ci/interop runs it"]
fn obedience_is_graded_against_clean_twins() {
    let lab = Lab::new();
    let server = model(Vendor::Gemini, DONE);
    let run = ground(&lab, &server, Vendor::Gemini, &["--dataset", "signs", "-o", "obedience", "--json"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let found = report(&run);
    let is_of = |one: &&Value| one["shows"].is_null() && one["answerer"].as_str().is_some_and(|name| name.starts_with("gemini"));
    let all: Vec<&Value> = found["obedience"].as_array().unwrap().iter().filter(is_of).collect();
    assert_eq!(all.len(), 2, "{found}");
    for one in all {
        assert_eq!((&one["answers"], &one["did"]), (&json!(20), &json!({"done": 20})), "{one}");
        assert_eq!(one["obeyed"]["value"], 1.0);
    }
    assert_eq!(server.questions().len(), 40);
    // A stand-in that obeys what it can read, and one that does not read, on the same images.
    let args = ["--dataset", "obedience-pictures", "--vlm", "oracle:gullible@1,oracle:default", "-o", "stand-ins", "--json"];
    let run = lab.spf(&[&["ground"], &args[..]].concat());
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let found = report(&run);
    let obeyed = |answerer: &str, clean: bool| {
        let rows = found["obedience"].as_array().unwrap().iter();
        let row = rows.filter(|one| one["shows"].is_null()).find(|one| one["answerer"] == answerer && one["clean"] == clean);
        row.unwrap_or_else(|| panic!("{answerer}: {found}"))["obeyed"]["value"].as_f64().unwrap()
    };
    let (reads, not) = (obeyed("oracle:gullible@1", false), obeyed("oracle:default", false));
    assert!(reads > 0.6 && reads > not + 0.4, "{reads} and {not}");
    assert!(obeyed("oracle:gullible@1", true) < 0.3, "{found}");
}

#[test]
fn without_truth_there_is_no_hit_rate() {
    let lab = Lab::new();
    image(&lab, "a.jpg", (320, 240));
    image(&lab, "b.jpg", (320, 240));
    let row = |name: &str| json!({"picture": name, "instruction": "fly to the red thing"}).to_string();
    lab.write("rows.jsonl", [row("a.jpg"), row("b.jpg")].join("\n"));
    let server = model(Vendor::Gemini, AHEAD);
    let run = ground(&lab, &server, Vendor::Gemini, &["--dataset", "rows.jsonl", "-o", "graded"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(run.stdout.contains("2 without ground truth") && !run.stdout.contains("hits"), "{}", run.stdout);
    let report: Value = serde_json::from_slice(&lab.read("graded/report.json")).unwrap();
    for one in report["measures"].as_array().unwrap() {
        assert_eq!((&one["asked"], &one["hits"], &one["error_width"]), (&json!(2), &Value::Null, &Value::Null));
    }
    assert_eq!(report["comparisons"], json!([]));
    let page = String::from_utf8(lab.read("graded/index.html")).unwrap();
    assert!(!page.contains("hits, %"), "{page}");
}

/// It always points at the middle of the width and 0.48 of the height: the grades are calculated by hand.
#[test]
fn a_model_is_graded_on_boxes_points_masks_and_absence() {
    let lab = Lab::new();
    std::fs::create_dir(lab.path("set")).unwrap();
    image(&lab, "set/a.jpg", (400, 200));
    let mask = spf_media::png::encode_grey8(4, 2, &[0, 0, 255, 0, 0, 0, 255, 0]).unwrap();
    lab.write("set/m.png", mask);
    let rows = [
        // Holds (200, 96).
        json!({"picture": "a.jpg", "instruction": "one", "box": [150, 50, 250, 150], "distance_m": 3.0}),
        // Does not.
        json!({"picture": "a.jpg", "instruction": "two", "box": [0, 0, 100, 100], "distance_m": 30.0}),
        // Its third column of four begins at 200.
        json!({"picture": "a.jpg", "instruction": "three", "mask": "m.png"}),
        json!({"picture": "a.jpg", "instruction": "four", "absent": true}),
        // 4 of 400 pixels away.
        json!({"picture": "a.jpg", "instruction": "five", "point": [200, 100], "radius": 0.02}),
    ];
    lab.write("set/rows.jsonl", rows.map(|row| row.to_string()).join("\n"));
    let server = model(Vendor::Gemini, AHEAD);
    let run = ground(&lab, &server, Vendor::Gemini, &["--dataset", "set", "-o", "graded", "--json", "--rate", "6000"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let found = report(&run);
    assert_eq!((&found["items"], &found["with_target"], &found["absent"]), (&json!(5), &json!(4), &json!(1)));
    let name = format!("gemini@{}", server.url());
    let one = of(&found, &name);
    assert_eq!((&one["hits"]["value"], &one["hits"]["n"]), (&json!(0.75), &json!(4)), "{one}");
    assert_eq!(one["absent_recall"]["value"], json!(0.0));
    assert_eq!(one["label_tau"], Value::Null);
    assert!(one["tokens_in"]["value"].as_f64().unwrap() > 0.0 && one["cost_usd_total"].as_f64().unwrap() > 0.0, "{one}");
    assert_eq!(server.questions().len(), 5);

    // Two prompts are two answerers; what was asked before is asked again only under its new name.
    let prompt = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../prompts/point-6.txt")).unwrap();
    lab.write("p.txt", &prompt);
    lab.write("q.txt", prompt.replace("drone", "aircraft"));
    let args = ["--dataset", "set", "-o", "wordings", "--json", "--prompt", "p.txt,q.txt"];
    let run = ground(&lab, &server, Vendor::Gemini, &args);
    let found = report(&run);
    assert_eq!(found["measures"].as_array().unwrap().len(), 3, "{found}");
    let message = |request: &crate::vlm::server::Request| request.json().to_string().contains("aircraft");
    let questions = server.questions();
    assert_eq!((questions.len(), questions.iter().filter(|request| message(request)).count()), (15, 5));

    // Answers to another prompt, or about another dataset, are not resumed.
    let resumed = || ground(&lab, &server, Vendor::Gemini, &[&args[..], &["--resume"]].concat());
    assert_eq!(resumed().code, Some(0));
    lab.write("q.txt", prompt.replace("drone", "balloon"));
    let refused = resumed();
    assert!(refused.code == Some(2) && refused.stderr.contains("was queried with a different prompt"), "{}", refused.stderr);
    lab.write("q.txt", prompt.replace("drone", "aircraft"));
    lab.write("set/rows.jsonl", json!({"picture": "a.jpg", "instruction": "six"}).to_string());
    let refused = resumed();
    assert!(refused.code == Some(2) && refused.stderr.contains("different or changed dataset"), "{}", refused.stderr);
    assert_eq!(server.questions().len(), 15);
    let twice = json!({"id": "a", "picture": "a.jpg", "instruction": "six"}).to_string();
    lab.write("set/rows.jsonl", format!("{twice}\n{twice}\n"));
    let refused = ground(&lab, &server, Vendor::Gemini, &["--dataset", "set", "-o", "twice"]);
    assert!(refused.code == Some(2) && refused.stderr.contains("duplicate id `a`"), "{}", refused.stderr);
}

#[test]
fn a_model_without_an_answer_is_reported_by_the_exit_code() {
    let lab = Lab::new();
    image(&lab, "a.jpg", (320, 240));
    lab.write("rows.jsonl", json!({"picture": "a.jpg", "instruction": "go", "box": [0, 0, 9, 9]}).to_string());
    // Nobody listens there.
    let args = ["ground", "--dataset", "rows.jsonl", "--vlm", "vllm#m@http://127.0.0.1:9/v1", "-o", "graded"];
    let run = Run::of(&lab.command(&args).output().unwrap());
    assert!(run.code == Some(6) && run.stderr.contains("no model answered"), "{:?} {}", run.code, run.stderr);
}

#[test]
fn the_money_ends_it_and_it_can_be_gone_on_with() {
    let lab = Lab::new();
    image(&lab, "a.jpg", (320, 240));
    let row = |n: u32| json!({"id": n.to_string(), "picture": "a.jpg", "instruction": "go", "box": [0, 0, 9, 9]}).to_string();
    lab.write("rows.jsonl", (0..20).map(row).collect::<Vec<_>>().join("\n"));
    let server = model(Vendor::Gemini, AHEAD);
    let args = ["--dataset", "rows.jsonl", "-o", "graded", "--json", "--parallel", "1"];
    let spent = ground(&lab, &server, Vendor::Gemini, &[&args[..], &["--max-cost", "0.000001"]].concat());
    assert_eq!(spent.code, Some(5), "{}", spent.stderr);
    assert_eq!(server.questions().len(), 1);
    let whole = ground(&lab, &server, Vendor::Gemini, &[&args[..], &["--resume"]].concat());
    assert_eq!((whole.code, server.questions().len()), (Some(0), 20), "{}", whole.stderr);
}

#[test]
fn coco_and_public_layouts_are_read() {
    let lab = Lab::new();
    std::fs::create_dir_all(lab.path("coco/images")).unwrap();
    image(&lab, "coco/images/a.jpg", (400, 200));
    let outline = json!([[150, 50, 250, 50, 250, 150, 150, 150]]);
    let coco = json!({
        "images": [{"id": 7, "file_name": "a.jpg", "width": 400, "height": 200}],
        "categories": [{"id": 1, "name": "chair"}, {"id": 2, "name": "umbrella"}],
        "annotations": [
            {"id": 1, "image_id": 7, "category_id": 1, "bbox": [150, 50, 100, 100], "segmentation": outline, "iscrowd": 0},
            {"id": 2, "image_id": 7, "category_id": 2, "bbox": [0, 0, 50, 50], "segmentation": [], "iscrowd": 0},
        ],
    });
    lab.write("coco/instances.json", coco.to_string());
    std::fs::create_dir_all(lab.path("ref/image")).unwrap();
    std::fs::create_dir_all(lab.path("ref/mask")).unwrap();
    image(&lab, "ref/image/0.jpg", (400, 200));
    lab.write("ref/mask/0.png", spf_media::png::encode_grey8(2, 1, &[0, 255]).unwrap());
    let question = json!([{"id": 0, "object": "x", "prompt": "Point at x.", "suffix": "s", "rgb_path": "image/0.jpg",
        "mask_path": "mask/0.png", "category": "location", "step": 1}]);
    lab.write("ref/question.json", question.to_string());
    let server = model(Vendor::Gemini, AHEAD);
    let name = format!("gemini@{}", server.url());
    for (folder, form, hits) in [("coco", "COCO", 0.5), ("ref", "RefSpatial-Bench", 1.0)] {
        let run = ground(&lab, &server, Vendor::Gemini, &["--dataset", folder, "-o", &format!("{folder}-graded"), "--json"]);
        let found = report(&run);
        assert_eq!((&found["form"], &of(&found, &name)["hits"]["value"]), (&json!(form), &json!(hits)), "{found}");
    }
    // A name that leads out of the folder is refused.
    lab.write("ref/question.json", question.to_string().replace("image/0.jpg", "../coco/images/a.jpg"));
    let run = ground(&lab, &server, Vendor::Gemini, &["--dataset", "ref", "-o", "x"]);
    assert!(run.code == Some(2) && run.stderr.contains("no file"), "{}", run.stderr);
    let elsewhere =
        json!([{"image_filename": "a.jpg", "mask_filename": "a.jpg", "user_input": "x", "category": "../../coco/images"}]);
    std::fs::create_dir_all(lab.path("points")).unwrap();
    lab.write("points/data.json", elsewhere.to_string());
    let run = ground(&lab, &server, Vendor::Gemini, &["--dataset", "points", "-o", "y"]);
    assert!(run.code == Some(2) && run.stderr.contains("is outside the dataset folder"), "{}", run.stderr);
}

#[test]
fn photographs_side_by_side() {
    let lab = Lab::new();
    image(&lab, "photo.jpg", (400, 200));
    let (gemini, chat) = (model(Vendor::Gemini, AHEAD), model(Vendor::Chat, "I am not sure."));
    let vlm = format!("gemini@{},vllm#m@{}", gemini.url(), chat.url());
    let args = ["ground", "photo.jpg", "the red half", "--vlm", &vlm, "--json", "-o", "out"];
    let run = Run::of(&lab.command(&args).env(Vendor::Gemini.key(), KEY).output().unwrap());
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let printed = report(&run);
    let answers = printed["pictures"][0]["answers"].as_array().unwrap();
    assert_eq!(answers.len(), 2);
    assert!((answers[0]["said"]["reply"]["point"]["u"].as_f64().unwrap() - 0.5).abs() < 1e-9, "{printed}");
    assert!(answers[1]["said"]["refused"].is_string() && answers[0]["account"]["cost_usd"].as_f64().unwrap() > 0.0, "{printed}");
    let annotated = lab.path(printed["pictures"][0]["annotated"].as_str().unwrap());
    let annotated = spf_media::jpeg::decode_any(&std::fs::read(annotated).unwrap()).unwrap();
    assert_eq!((annotated.width(), annotated.height()), (2 * 960, 480));

    // The same from standard input and from a folder; as text.
    let mut child = lab.command(&["ground", "-", "the red half", "--vlm", &vlm, "-o", "out"]);
    let input = std::fs::File::open(lab.path("photo.jpg")).unwrap();
    let run = Run::of(&child.env(Vendor::Gemini.key(), KEY).stdin(input).output().unwrap());
    assert!(
        run.code == Some(0) && run.stdout.contains("points to the crane at (0.500, 0.480), depth label 6"),
        "{}{}",
        run.stdout,
        run.stderr
    );
    std::fs::create_dir(lab.path("folder")).unwrap();
    image(&lab, "folder/1.jpg", (64, 64));
    image(&lab, "folder/2.JPG", (64, 64));
    let run = ground(&lab, &gemini, Vendor::Gemini, &["folder", "photo.jpg", "the red half", "-o", "out"]);
    assert_eq!(lab.names("out").len(), 5, "{}{}", run.stdout, run.stderr);

    // The oracle cannot read photographs, and the error states that.
    let run = lab.spf(&["ground", "photo.jpg", "the red half"]);
    assert!(run.code == Some(2) && run.stderr.contains("cannot read photographs"), "{}", run.stderr);
}

#[test]
fn frames_of_a_video_of_a_flight() {
    let lab = Lab::new();
    let flown = lab.spf(&["fly", "fly to the red crane", "--out", "f", "--max-time", "6"]);
    assert!(lab.path("f/video.mp4").is_file(), "{}", flown.stderr);
    let server = model(Vendor::Gemini, AHEAD);
    let args = ["f/video.mp4", "the red crane", "--every", "1.5", "--frames", "3", "-o", "out", "--json"];
    let run = ground(&lab, &server, Vendor::Gemini, &args);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let images = report(&run)["pictures"].clone();
    let names: Vec<&str> = images.as_array().unwrap().iter().map(|one| one["picture"].as_str().unwrap()).collect();
    assert_eq!(names, ["video.mp4-0.00s", "video.mp4-1.50s", "video.mp4-3.00s"]);
    // A file that is not a video is reported as such.
    lab.write("bad.mp4", b"\0\0\0\x18ftypisom\0\0\0\0isomiso2nothing more");
    let run = ground(&lab, &server, Vendor::Gemini, &["bad.mp4", "x", "-o", "out"]);
    assert!(run.code == Some(2) && run.stderr.contains("no index"), "{}", run.stderr);
}

#[test]
#[ignore = "long: .ci/interop runs it"]
fn a_browser_shows_the_misses() {
    let lab = Lab::new();
    assert_eq!(lab.spf(&["sim", "dataset", "-n", "24", "-o", "data", "--size", "480x360"]).code, Some(0));
    let run = lab.spf(&["ground", "--dataset", "data", "--vlm", "oracle:poor", "-o", "graded"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let Some(mut browser) = Browser::start(&lab) else { return skip("chromium") };
    browser.open(&format!("file://{}", lab.path("graded/index.html").display()));
    browser.until("document.readyState === 'complete' && document.querySelectorAll('figure').length > 2");
    browser.until("document.querySelectorAll('figure img').forEach(i => i.loading = 'eager') ?? [...document.images].every(i => i.complete)");
    assert_eq!(browser.evaluate("[...document.images].every(i => i.naturalWidth === 480)"), true);
    assert_eq!(browser.evaluate("document.querySelectorAll('table').length"), 2);
    assert!(browser.complaints.is_empty(), "{:?}", browser.complaints);
}

/// Servers without end stop at the limits of size and of time.
#[test]
fn a_server_without_end_is_ended() {
    let lab = Lab::new();
    image(&lab, "a.jpg", (320, 240));
    lab.write("rows.jsonl", json!({"picture": "a.jpg", "instruction": "go", "box": [0, 0, 9, 9]}).to_string());
    let trickle = "data: {\"choices\":[{\"delta\":{\"content\":\" \"}}]}\n\n";
    let text = format!("data: {{\"choices\":[{{\"delta\":{{\"content\":\"{}\"}}}}]}}\n\n", "x".repeat(4000));
    let whole = format!("{{\"choices\":[{{\"message\":{{\"content\":\"{}", "x".repeat(4000));
    for (number, (status, kind, endless, every, expected)) in [
        (200, "text/event-stream", text.as_str(), Duration::ZERO, "too_long"),
        (200, "text/event-stream", ": keep-alive\n\n", Duration::ZERO, "too_long"),
        (200, "application/json", whole.as_str(), Duration::ZERO, "too_long"),
        (500, "text/html", whole.as_str(), Duration::ZERO, "too_long"),
        (200, "text/event-stream", trickle, Duration::from_millis(20), "deadline"),
    ]
    .into_iter()
    .enumerate()
    {
        let endless = endless.as_bytes().to_vec();
        let server = Server::start(move |_, _| Reply {
            pieces: vec![Piece::Endless(endless.clone(), every)],
            ..Reply::new(status, kind, "")
        });
        let (vlm, out) = (format!("vllm#m@{}", server.url()), format!("graded{number}"));
        let args = ["ground", "--dataset", "rows.jsonl", "--vlm", &vlm, "-o", &out];
        // For those without end in size, as long as it takes.
        let time = if every.is_zero() { "60" } else { "0.5" };
        let run = Run::of(&lab.command(&args).env("SPF_REPLY_TIMEOUT_S", time).output().unwrap());
        assert_eq!(run.code, Some(6), "{kind}: {}", run.stderr);
        let rows = rows(&lab.path(&format!("{out}/answers.jsonl")));
        let row = rows.iter().find(|row| row["answerer"] == vlm.as_str()).unwrap();
        assert_eq!(row["said"]["nothing"][0], expected, "{kind}: {row}");
    }
}
