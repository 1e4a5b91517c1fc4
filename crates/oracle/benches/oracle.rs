//! A percept at 960×720 and the answers based on it.

use std::collections::BTreeMap;

use divan::{Bencher, black_box};
use spf_core::camera::Camera;
use spf_core::frame::FrameId;
use spf_core::geometry::Attitude;
use spf_core::query::{Query, QueryId, QueryKind};
use spf_core::tags::Tagged;
use spf_oracle::{ErrorFile, GroundTruthView, Oracle};

fn main() {
    divan::main();
}

const W: usize = 960;
const H: usize = 720;

/// Forty objects of a street: ground, house fronts, cars, and lattices of thin bars, which cost most.
fn image() -> (Vec<u16>, Vec<f32>, Vec<Tagged>) {
    let (mut ids, mut depth) = (vec![0; W * H], vec![f32::INFINITY; W * H]);
    for y in 0..H {
        for x in 0..W {
            let house = (x / 60 + 2) as u16;
            let id = match () {
                () if y > 420 => 1,
                () if (x + y) % 12 < 3 && (200..330).contains(&x) => 30,
                () if (x + 2 * y) % 9 < 3 && (600..700).contains(&x) => 31,
                () if y > 150 + 7 * usize::from(house) => house,
                () => 0,
            };
            ids[y * W + x] = id;
            depth[y * W + x] = if id == 0 { f32::INFINITY } else { 20.0 + f32::from(id) };
        }
    }
    let tags = (1..40).map(|id| Tagged {
        id,
        key: format!("object_{id}"),
        names: vec![if id == 30 { "tower crane" } else { "building" }.to_owned()],
        colour: Some(if id == 30 { "red" } else { "grey" }.to_owned()),
        kind: if id == 1 { "ground" } else { "building" }.to_owned(),
        ..Tagged::default()
    });
    (ids, depth, tags.collect())
}

fn query(instruction: &str) -> Query {
    Query { instruction: instruction.to_owned(), ..Query::new(QueryId(0), FrameId(0), QueryKind::point(true)) }
}

#[divan::bench]
fn percept_960x720(bencher: Bencher<'_, '_>) {
    let (ids, depth, tags) = image();
    let (camera, none) = (Camera::quad(), BTreeMap::new());
    let sight = GroundTruthView {
        width: W,
        height: H,
        ids: &ids,
        depth: &depth,
        piece_ids: &[],
        pieces: &[],
        opening_ids: &[],
        opening_depth: &[],
        camera: &camera,
        attitude: Attitude::default(),
        in_frame: &none,
        light: &none,
        signs: &[],
    };
    let oracle = Oracle::new(ErrorFile::default(), 3.0, 1);
    bencher.bench(|| oracle.percept(FrameId(0), black_box(&sight), &tags));
}

#[divan::bench(args = ["fly to the red crane", "go to the second tallest building from the left next to the red crane, then search for the bus"])]
fn answer(bencher: Bencher<'_, '_>, instruction: &str) {
    let (ids, depth, tags) = image();
    let (camera, none) = (Camera::quad(), BTreeMap::new());
    let sight = GroundTruthView {
        width: W,
        height: H,
        ids: &ids,
        depth: &depth,
        piece_ids: &[],
        pieces: &[],
        opening_ids: &[],
        opening_depth: &[],
        camera: &camera,
        attitude: Attitude::default(),
        in_frame: &none,
        light: &none,
        signs: &[],
    };
    let oracle = Oracle::new(ErrorFile::default(), 3.0, 1);
    let percept = oracle.percept(FrameId(0), &sight, &tags);
    let query = query(instruction);
    bencher.bench(|| oracle.answer(black_box(&query), &percept));
}
