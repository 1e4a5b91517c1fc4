//! Parsing a reply (the aim is under 20 µs) and checking a path against obstacles.

use divan::{Bencher, black_box};
use spf_core::grounding::GroundingProfile;
use spf_core::prompt::{PromptInput, point_prompt};
use spf_core::query::{ImageBox, ImagePoint, Memory};
use spf_core::reply::{MAX_TEXT, ObstacleBox, Reply, ReplyStream, Status, parse_reply};

fn main() {
    divan::main();
}

fn reply(boxes: usize) -> Reply {
    let obstacle = |i: usize| ObstacleBox {
        area: ImageBox { left: 0.1 * i as f64, top: 0.1, right: 0.1 * i as f64 + 0.08, bottom: 0.9 },
        depth: 3,
        name: format!("pole {i}"),
    };
    Reply {
        stage: Some(1),
        point: Some(ImagePoint { u: 0.55, v: 0.4 }),
        depth: Some(6),
        target: Some("the red tower crane".to_owned()),
        boxes: (0..boxes).map(obstacle).collect(),
        ..Reply::new(Status::Navigating)
    }
}

#[divan::bench(args = [0, 4, 10])]
fn parse(bencher: Bencher<'_, '_>, boxes: usize) {
    let profile = GroundingProfile::default();
    let text = format!("Here is the answer:\n```json\n{}\n```", reply(boxes).to_json(&profile, boxes > 0));
    bencher.bench(|| parse_reply(black_box(&text), &profile, true).expect("a valid reply"));
}

#[divan::bench]
fn parse_in_chunks_of_four(bencher: Bencher<'_, '_>) {
    let profile = GroundingProfile::default();
    let text = reply(4).to_json(&profile, true);
    let chunks: Vec<&str> = (0..text.len()).step_by(4).map(|i| &text[i..(i + 4).min(text.len())]).collect();
    bencher.bench(|| {
        let mut stream = ReplyStream::new(profile, true);
        for chunk in black_box(&chunks) {
            stream.push(chunk);
        }
        stream.finish().expect("a valid reply")
    });
}

/// The slowest known text of the maximum length: brackets that never close, each of which is tried.
#[divan::bench]
fn refuse_hostile_64_kib(bencher: Bencher<'_, '_>) {
    let profile = GroundingProfile::default();
    let text = "[".repeat(16) + &"[],".repeat((MAX_TEXT - 16) / 3);
    bencher.bench(|| parse_reply(black_box(&text), &profile, true).expect_err("no reply"));
}

#[divan::bench]
fn write_prompt(bencher: Bencher<'_, '_>) {
    let (memory, profile) = (Memory::default(), GroundingProfile::default());
    let input = PromptInput { avoid: true, ..PromptInput::new("fly to the red crane", &memory, &profile) };
    bencher.bench(|| point_prompt(black_box(&input)));
}
