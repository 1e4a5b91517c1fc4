//! Whole lockstep flights in the city: decisions per second, without images and with the image that a VLM would
//! receive.
//!
//! `cargo bench -p spf-flight`; loading the scene is not included. Items are decisions.

use std::sync::Arc;

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use spf_core::craft::CraftKind;
use spf_flight::flight::{self, FlightPlan, Site};
use spf_flight::sim::{LoadedScene, OracleVlm, Simulated, VlmFactory};
use spf_oracle::ErrorFile;
use spf_vlm::{Answer, QueryImage, QueryRequest, Vlm};

/// The oracle, but with the image rendered and encoded anyway.
struct Looks(OracleVlm);

impl Vlm for Looks {
    fn name(&self) -> &str {
        self.0.name()
    }

    fn answer(&mut self, request: &QueryRequest<'_>, image: &mut dyn QueryImage) -> Answer {
        drop(black_box(image.jpeg(image.size(), 85)));
        self.0.answer(request, image)
    }
}

/// Flies to the red crane; returns the number of decisions.
fn fly(loaded: &Arc<LoadedScene>, images: bool) -> u32 {
    let vlm_factory: VlmFactory = Arc::new(move |world, seed| {
        let world = world.ok_or("the oracle needs the simulator")?;
        let errors = ErrorFile::named("default")?;
        let oracle = OracleVlm::new("oracle".to_owned(), world.clone(), errors, seed);
        Ok(if images { Box::new(Looks(oracle)) as Box<dyn Vlm> } else { Box::new(oracle) })
    });
    let site = Site::Simulated(Simulated { kind: CraftKind::Quad, ..Simulated::new(loaded.clone(), "city") });
    let plan = FlightPlan::new(site, "Take off and fly to the red crane", "oracle", vlm_factory);
    flight::fly(plan, &mut []).expect("its start is free").summary.decisions
}

#[divan::bench(args = [false, true], sample_count = 5, sample_size = 1)]
fn decisions(bencher: Bencher<'_, '_>, images: bool) {
    let loaded = Arc::new(LoadedScene::load("city").expect("it is built in"));
    let made = fly(&loaded, images);
    bencher.counter(ItemsCount::new(made)).bench(|| fly(&loaded, images));
}

fn main() {
    divan::main();
}
