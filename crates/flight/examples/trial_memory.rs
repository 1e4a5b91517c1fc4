//! Memory added by each further trial in one process, with a shared scene: `cargo run --release -p spf-flight --features figures
//! --example trial_memory`. Linux only: it reads the resident memory from the kernel.
//!
//! A trial is a simulated craft, its pilot, the oracle and the lockstep world that connects them, as in `spf fly
//! --no-video`. Each is flown for 20 s of flight and then kept with its complete state.

#![allow(clippy::print_stdout, reason = "an example's output")]

use std::error::Error;
use std::sync::Arc;

use spf_core::craft::CraftKind;
use spf_core::grounding::GroundingProfile;
use spf_core::time::duration_from_secs;
use spf_drone::Drone;
use spf_envelope::Limits;
use spf_flight::run::run;
use spf_flight::sim::{LoadedScene, OracleVlm, SimDrone, SimWorld};
use spf_flight::world::{Lockstep, Script};
use spf_oracle::ErrorFile;
use spf_pilot::policy::spf::{Spf, SpfSettings};
use spf_pilot::{Pilot, PilotParts, PilotSettings, Preset};
use spf_space::avoid::PathShape;

/// Reported numbers of trials.
const COUNTS: [usize; 4] = [1, 2, 10, 100];

/// A trial after its flight, with all its parts.
fn flown(scene: &Arc<LoadedScene>, seed: u64) -> Result<(Pilot, Lockstep), Box<dyn Error>> {
    let world = SimWorld::new(scene.clone(), CraftKind::Quad, scene.scene.start, seed);
    let drone = SimDrone::new(world.clone());
    let capabilities = drone.capabilities();
    let settings = PilotSettings { max_time: duration_from_secs(20.0), ..PilotSettings::preset(Preset::Default) };
    let mut pilot = Pilot::new(PilotParts {
        settings,
        craft: capabilities.craft,
        senses: capabilities.senses,
        camera: capabilities.camera,
        limits: Limits::for_craft(&capabilities.craft),
        policy: Box::new(Spf::new(SpfSettings {
            step: settings.step,
            lifting: settings.lifting,
            avoid: settings.avoid,
            confirm_done: settings.confirm_done,
            grounding: GroundingProfile::default(),
            image_size: None,
            craft: capabilities.craft,
            shape: PathShape::Straight,
            depth: settings.depth,
            near_m: settings.near_m,
            method: settings.method,
            keep_m: None,
            close_up: false,
        })),
        steering: None,
        instruction: "fly to the red crane".to_owned(),
    });
    let oracle = OracleVlm::new("oracle".to_owned(), world.clone(), ErrorFile::named("default")?, seed);
    let mut around = Lockstep::new(Box::new(drone), Box::new(oracle), Script::default(), Arc::default());
    assert!(run(&mut pilot, &mut around, &mut []).is_empty());
    Ok((pilot, around))
}

/// Resident memory of this process, KiB.
fn resident() -> Result<u64, Box<dyn Error>> {
    let status = std::fs::read_to_string("/proc/self/status")?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).ok_or("the kernel tells no VmRSS")?;
    Ok(line.trim().trim_end_matches("kB").trim().parse()?)
}

fn main() -> Result<(), Box<dyn Error>> {
    let empty = resident()?;
    let scene = Arc::new(LoadedScene::load("city")?);
    let loaded = resident()?;
    println!("process {empty} KiB, with the scene {loaded} KiB");
    println!("| trials | resident | per further trial |\n|---|---|---|");
    let mut trials = Vec::new();
    let mut first = 0;
    for count in COUNTS {
        while trials.len() < count {
            trials.push(flown(&scene, trials.len() as u64)?);
        }
        let now = resident()?;
        if count == 1 {
            first = now;
            println!("| 1 | {now} KiB | – ({} KiB for the first) |", now.saturating_sub(loaded));
        } else {
            println!("| {count} | {now} KiB | {} KiB |", now.saturating_sub(first) / (count as u64 - 1));
        }
    }
    let decisions: u32 = trials.iter().map(|(pilot, _)| pilot.decisions()).sum();
    println!("{} handles to one scene, {decisions} decisions in all", Arc::strong_count(&scene));
    Ok(())
}
