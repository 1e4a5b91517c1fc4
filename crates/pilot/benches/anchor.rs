//! Cost of a reply for the anchor. `cargo bench -p spf-pilot --bench anchor`

use divan::{Bencher, black_box};
use spf_core::geometry::{EnuDirection, EnuPosition};
use spf_core::time::Time;
use spf_motion::odometry::Odometry;
use spf_pilot::anchor::{AnchorSettings, Anchors, RangeReading, Sighting};

fn main() {
    divan::main();
}

/// The `number`-th of replies that come every `gap_ms`, on an approach to a target 40 m north.
fn sighting(number: u64, gap_ms: u64) -> Sighting {
    let from = EnuPosition { east: 0.1 * (number % 7) as f64, north: 0.002 * (number * gap_ms) as f64, up: 3.0 };
    let ahead = EnuPosition { east: 1.0 - from.east, north: 40.0 - from.north, up: 0.5 };
    Sighting {
        captured: Time::from_millis(gap_ms * number),
        id: number,
        stage: 1,
        from,
        odometry: Odometry { way: from.north, ..Odometry::default() },
        direction: EnuDirection::towards(ahead),
        bearing_sigma: 0.02,
        elevation_sigma: 0.02,
        range: Some(RangeReading { ln_range: libm::log(ahead.distance(EnuPosition::default())), sigma: 0.25 }),
    }
}

fn after(count: u64, gap_ms: u64) -> Anchors {
    let mut anchors = Anchors::new(AnchorSettings::default());
    (0..count).for_each(|number| {
        anchors.observe(sighting(number, gap_ms));
    });
    anchors
}

/// A reply in order of capture, after the 7 replies of 10 s.
#[divan::bench]
fn in_order(bencher: Bencher<'_, '_>) {
    bencher.with_inputs(|| after(7, 1500)).bench_local_refs(|anchors| black_box(anchors.observe(sighting(7, 1500))));
}

/// A reply on the oldest frame, so that all later ones are applied again. Arguments: number of replies in 10 s.
#[divan::bench(args = [7, 100])]
fn late(bencher: Bencher<'_, '_>, count: u64) {
    let gap = 10_000 / count;
    bencher
        .with_inputs(|| after(count, gap))
        .bench_local_refs(|anchors| black_box(anchors.observe(Sighting { captured: Time::from_millis(1), ..sighting(0, gap) })));
}
