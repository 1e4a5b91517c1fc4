//! The oracle on an example of a simulated dataset, from its files alone.

use std::collections::BTreeMap;

use spf_core::frame::FrameId;
use spf_core::query::Query;
use spf_oracle::{ErrorFile, GroundTruthView, Oracle};
use spf_vlm::{Answer, Usage, VlmError};

use super::source::SimExample;

/// The answer of an oracle with these errors for an example.
pub(super) fn answer(name: &str, errors: &ErrorFile, seed: u64, query: &Query, example: &SimExample) -> Answer {
    let (camera, row) = (&example.head.camera, &example.row);
    let oracle = Oracle::new(errors.clone(), row.near_m, seed);
    let failed = |error: String| Answer {
        text: Err(VlmError::Image(error)),
        latency: spf_core::time::Duration::ZERO,
        model: name.to_owned(),
        account: Usage::default(),
    };
    let layers = match example.layers() {
        Ok(layers) => layers,
        Err(error) => return failed(format!("cannot read the ground-truth images of example {}: {error}", row.number)),
    };
    let of = |value: fn(&spf_flight::dataset::Visible) -> f32| -> BTreeMap<u16, f32> {
        row.visible.iter().map(|thing| (thing.id, value(thing))).collect()
    };
    let (in_frame, light) = (of(|thing| thing.in_frame), of(|thing| thing.light));
    let sight = GroundTruthView {
        width: camera.width as usize,
        height: camera.height as usize,
        ids: &layers.ids,
        depth: &layers.depth,
        piece_ids: &[],
        pieces: &[],
        opening_ids: &layers.opening_ids,
        opening_depth: &layers.opening_depth,
        camera,
        attitude: spf_core::geometry::Attitude::default(),
        in_frame: &in_frame,
        light: &light,
        signs: &row.signs,
    };
    let percept = oracle.percept(FrameId(row.number), &sight, &example.tags);
    let reply = oracle.answer(query, &percept);
    Answer { text: Ok(reply.text), latency: reply.latency, model: name.to_owned(), account: Usage::default() }
}
