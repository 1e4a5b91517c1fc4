//! Cost of a decision apart from the model: from a camera frame of 960×720 to the bytes of a request, and from the
//! bytes of an answer to a reply.
//!
//! `cargo bench -p spf-vlm`

use divan::{Bencher, black_box};
use serde_json::{Value, json};
use spf_core::grounding::GroundingProfile;
use spf_core::query::QueryKind;
use spf_core::reply::parse_reply;
use spf_media::{Jpeg, Rgb, Scaler};
use spf_vlm::table::Table;
use spf_vlm::wire::sse::Events;
use spf_vlm::wire::{Gathered, Question, WireKind};

/// A frame with detail everywhere, which is harder to encode than a camera frame.
fn frame() -> Rgb {
    let mut frame = Rgb::new(960, 720);
    for y in 0..720 {
        for x in 0..960 {
            let grain = ((x * 7919 + y * 104_729) % 61) as u8;
            frame.set_pixel(x, y, [(x / 4) as u8 ^ grain, (y / 3) as u8, ((x + y) / 7) as u8 ^ (grain / 2)]);
        }
    }
    frame
}

#[divan::bench(args = ["gemini", "openai", "anthropic", "vllm"])]
fn frame_to_request(bencher: Bencher<'_, '_>, name: &str) {
    let (frame, table) = (frame(), Table::shipped());
    let model = table.select(name, "2026-11-21").expect("it is in the table").model;
    let kind = QueryKind::point(true);
    let mut scaler = Scaler::default();
    bencher.bench_local(|| {
        let (width, height) = model.image.sent((960, 720), None);
        let scaled = scaler.scale(black_box(&frame), width, height);
        let jpeg = Jpeg::encode(&scaled, 70).expect("it has a size");
        scaler.reuse(scaled);
        let question = Question { prompt: "Where?", jpeg: jpeg.bytes(), close_up: None, kind: &kind };
        serde_json::to_vec(&model.wire.request(&model, &question).body)
    });
}

#[divan::bench]
fn answer_to_reply(bencher: Bencher<'_, '_>) {
    let text = r#"{"status":"navigating","look":null,"stage":1,"point":[480,500],"depth":6,"target":"the crane"}"#;
    let event = |piece: &str| format!("data: {}\n\n", json!({ "choices": [{ "delta": { "content": piece } }] }));
    let stream: String = text.as_bytes().chunks(7).map(|piece| event(&String::from_utf8_lossy(piece))).collect();
    bencher.bench(|| {
        let mut gathered = Gathered::default();
        for data in Events::default().push(black_box(stream.as_bytes())) {
            let object: Value = serde_json::from_str(&data).expect("it is JSON");
            WireKind::OpenaiChat.read("h", &object, &mut gathered).expect("it is an answer");
        }
        parse_reply(&gathered.text, &GroundingProfile::default(), false)
    });
}

fn main() {
    divan::main();
}
