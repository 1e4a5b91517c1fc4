//! Whole lockstep flights in the city: decisions a second, without pictures and with the picture that a VLM would be sent.
//!
//! `cargo bench -p spf-flight`; scene loading is apart. Items are decisions.

use std::sync::Arc;

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use spf_core::craft::CraftKind;
use spf_core::envelope::Limits;
use spf_core::estimator::Senses;
use spf_core::grounding::GroundingProfile;
use spf_core::pilot::{Pilot, PilotParts, PilotSettings, Preset};
use spf_core::policy::spf::{Spf, SpfSettings};
use spf_drone::Drone;
use spf_flight::run::run;
use spf_flight::sim::{OracleVlm, SimDrone, SimWorld, Stage};
use spf_flight::world::{Lockstep, Script};
use spf_oracle::ErrorFile;
use spf_vlm::{Answer, Asked, Picture, Vlm};

/// The oracle, but the picture is drawn and encoded all the same.
struct Looks(OracleVlm);

impl Vlm for Looks {
    fn name(&self) -> &str {
        self.0.name()
    }

    fn answer(&mut self, asked: &Asked<'_>, picture: &mut dyn Picture) -> Answer {
        drop(black_box(picture.jpeg(picture.size(), 85)));
        self.0.answer(asked, picture)
    }
}

/// Flies to the red crane; the number of decisions.
fn fly(stage: &Arc<Stage>, pictures: bool) -> u32 {
    let world = SimWorld::new(stage.clone(), CraftKind::Quad, stage.scene.start, 0);
    let drone = SimDrone::new(world.clone());
    let capabilities = drone.capabilities();
    let settings = PilotSettings::preset(Preset::Default);
    let mut pilot = Pilot::new(PilotParts {
        settings,
        craft: capabilities.craft,
        senses: Senses::quad(),
        camera: capabilities.camera,
        limits: Limits::for_craft(&capabilities.craft),
        policy: Box::new(Spf::new(SpfSettings {
            step: settings.step,
            lifting: settings.lifting,
            shape: spf_core::avoid::PathShape::Straight,
            avoid: false,
            confirm_done: true,
            grounding: GroundingProfile::default(),
            image_size: None,
            craft: capabilities.craft,
        })),
        instruction: "Take off and fly to the red crane".to_owned(),
    });
    let errors = ErrorFile::named("default").expect("it is shipped");
    let oracle = OracleVlm::new("oracle".to_owned(), world.clone(), errors, 0);
    let vlm: Box<dyn Vlm> = if pictures { Box::new(Looks(oracle)) } else { Box::new(oracle) };
    let mut around = Lockstep::new(Box::new(drone), vlm, Script::default(), Arc::default());
    run(&mut pilot, &mut around, &mut []);
    pilot.decisions()
}

#[divan::bench(args = [false, true], sample_count = 5, sample_size = 1)]
fn decisions(bencher: Bencher<'_, '_>, pictures: bool) {
    let stage = Arc::new(Stage::load("city").expect("it is built in"));
    let made = fly(&stage, pictures);
    bencher.counter(ItemsCount::new(made)).bench(|| fly(&stage, pictures));
}

fn main() {
    divan::main();
}
