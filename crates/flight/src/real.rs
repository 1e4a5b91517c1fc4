//! One whole flight with a real craft, on the wall clock: no truth, no seed.

use std::sync::Arc;
use std::sync::atomic::AtomicU32;
use std::sync::mpsc::Receiver;
use std::time::Instant;

use spf_core::envelope::Limits;
use spf_core::estimator::Senses;
use spf_core::geometry::Pose;
use spf_core::pilot::{Action, Ending, Note, OperatorEvent, Outcome, Pilot, PilotParts, PilotSettings, Preset};
use spf_core::prompt::PromptText;
use spf_core::time::Time;
use spf_drone::Drone;
use spf_vlm::Vlm;

use crate::glass::Glass;
use crate::ledger::{Accounted, Ledger};
use crate::log::Head;
use crate::recorder::Recorder;
use crate::run::{Observer, run};
use crate::sim::{FlightError, Flown, PolicyKind, RecordPlan, WhoPoints};
use crate::summary::Summary;
use crate::witness::Witness;
use crate::world::{Live, Script};

/// All that decides a flight with a real craft.
pub struct RealPlan {
    /// The craft, connected.
    pub drone: Box<dyn Drone>,
    /// When its flight time was zero.
    pub start: Instant,
    /// What its telemetry tells.
    pub senses: Senses,
    /// What the person said.
    pub instruction: String,
    /// Who decides.
    pub policy: PolicyKind,
    /// The named preset that `settings` began as.
    pub preset: Preset,
    /// How.
    pub settings: PilotSettings,
    /// Within what.
    pub limits: Limits,
    /// The name on the command line of who points.
    pub vlm: String,
    /// Who points.
    pub who: WhoPoints,
    /// The name of who detects; `None` without a detector.
    pub detector: Option<String>,
    /// What it is told; `None`: the shipped prompt.
    pub prompt: Option<Arc<PromptText>>,
    /// US dollars from which on nothing more is asked, and the flight ends.
    pub max_cost_usd: Option<f64>,
    /// Operator events.
    pub script: Script,
    /// Counts Ctrl-C; the first one lands.
    pub interrupts: Arc<AtomicU32>,
    /// What a person does by hand, on the wall clock.
    pub operator: Option<Receiver<OperatorEvent>>,
    /// Where to record; `None` records nothing.
    pub record: Option<RecordPlan>,
}

/// Flies.
///
/// # Errors
/// [`FlightError`] when the flight cannot begin; once begun it always ends in a [`Flown`].
pub fn fly(plan: RealPlan, observers: &mut [&mut dyn Observer]) -> Result<Flown, FlightError> {
    let capabilities = plan.drone.capabilities();
    let camera = capabilities.camera;
    let ledger = plan.record.as_ref().map_or_else(Ledger::default, |record| Ledger::in_file(&record.out.file("vlm.jsonl")));
    let vlm = (plan.who)(None, 0).map_err(FlightError::Vlm)?;
    let vlm = Box::new(Accounted::new(vlm, ledger.clone(), plan.max_cost_usd));
    let prompt = plan.prompt.clone().unwrap_or_else(|| PromptText::shipped(plan.policy.prompt()));
    let eyesight = vlm.eyesight((camera.width, camera.height));
    let head = Head {
        format: spf_record::log::FORMAT,
        program: env!("CARGO_PKG_VERSION").to_owned(),
        instruction: plan.instruction.clone(),
        policy: plan.policy.name().to_owned(),
        preset: plan.preset,
        settings: plan.settings,
        craft: capabilities.craft,
        senses: plan.senses,
        camera,
        limits: plan.limits.clone(),
        vlm: plan.vlm.clone(),
        detector: plan.detector.clone(),
        grounding: eyesight.grounding,
        image_size: eyesight.image_size,
        drone: plan.drone.name().to_owned(),
        prompt: plan.prompt.as_ref().map(|prompt| prompt.source().to_owned()),
        sim: None,
    };
    let mut pilot = Pilot::new(PilotParts {
        settings: plan.settings,
        craft: capabilities.craft,
        senses: plan.senses,
        camera,
        limits: plan.limits.clone(),
        policy: plan.policy.policy(&plan.settings, capabilities.craft, eyesight, prompt, 0),
        instruction: plan.instruction.clone(),
    });
    let witness = Witness::Real { camera, frames: plan.drone.frames() };
    let mut recorder = plan.record.as_ref().map(|record| Recorder::new(record, &head, witness, true));
    let mut belief = Belief { instruction: plan.instruction.clone(), last: None, flown: 0.0, settled: None };
    let mut glass = Glass::default();
    let mut around = Live::new(plan.start, plan.drone, vlm, plan.script, plan.interrupts).map_err(FlightError::Thread)?;
    around = around.with_operator(plan.operator);
    {
        let mut all: Vec<&mut dyn Observer> = vec![&mut belief, &mut glass];
        if let Some(recorder) = &mut recorder {
            all.push(recorder);
        }
        for observer in observers.iter_mut() {
            all.push(&mut **observer);
        }
        run(&mut pilot, &mut around, &mut all);
    }
    let (at, ending) = belief.settled.unwrap_or_else(|| {
        (Time::ZERO, Ending { outcome: Outcome::Failed, cause: "the flight ended without an outcome".to_owned() })
    });
    let mut summary = Summary {
        format: 1,
        instruction: belief.instruction,
        outcome: ending.outcome,
        cause: ending.cause,
        verified: None,
        completion_time_s: pilot.first_motion().map(|first| at.since(first).as_secs_f64()),
        finished_at_s: at.as_secs_f64(),
        path_length_m: belief.flown,
        decisions: pilot.decisions(),
        final_distance_m: None,
        collisions: 0,
        touched: Vec::new(),
        targets: Vec::new(),
        target_in_view: None,
        seed: 0,
        vlm: plan.vlm,
        detector: plan.detector,
        preset: plan.preset,
        policy: plan.policy.name().to_owned(),
        settings: plan.settings,
        scene: String::new(),
        light: String::new(),
        weather: String::new(),
        drone: head.drone.clone(),
        drone_model: head.drone,
        wind: None,
        battery: None,
        camera_effects: None,
        late_replies: pilot.late_replies(),
        glass_to_decision: glass.latency(),
        not_recorded: Vec::new(),
        prompt: plan.prompt.as_ref().map(|prompt| prompt.name()),
        vlm_use: ledger.total(),
    };
    let mut recording_problems = recorder.map(|recorder| recorder.finish(&mut summary)).unwrap_or_default();
    recording_problems.extend(ledger.problem());
    Ok(Flown { summary, recording_problems })
}

/// What the pilot believed when the outcome was settled.
struct Belief {
    instruction: String,
    last: Option<Pose>,
    flown: f64,
    settled: Option<(Time, Ending)>,
}

impl Observer for Belief {
    fn time(&mut self, now: Time, pilot: &Pilot) {
        let pose = pilot.known_pose(now);
        if let Some(last) = self.last.replace(pose)
            && self.settled.is_none()
        {
            self.flown += last.position.distance(pose.position);
        }
    }

    fn action(&mut self, now: Time, action: &Action, _pilot: &Pilot) {
        match action {
            Action::Finished(ending) => self.settled = Some((now, ending.clone())),
            Action::Note(Note::Operator(OperatorEvent::Instruction(text))) => {
                self.instruction.clone_from(text);
            }
            _ => {}
        }
    }
}
