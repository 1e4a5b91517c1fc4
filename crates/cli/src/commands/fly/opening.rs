//! Prepares a flight, whatever carries it.

use std::sync::Arc;

use spf_api::demands::{Beginning, tighten};
use spf_core::craft::Craft;
use spf_drone::driver::Target;
use spf_envelope::Limits;
use spf_flight::flight::FlightPlan;
use spf_pilot::AtEnd;
use spf_sim::depth_sensor::DepthSensor;

use super::manual::Manual;
use super::said::Said;
use super::settings::{
    Facts, brake, depends_on_boxes, method, method_words, options, prompt, refuse_contradictions, script, without_boxes,
};
use super::signals::flight_interrupts;
use super::{Others, Ready, no_keys, page, real, refusal, simulated};
use crate::args::{CameraArgs, Fly};
use crate::commands::camera::refuse_endless;
use crate::commands::vlm::{Pace, is_human};
use crate::commands::{depth_model, detector};
use crate::error::CliError;
use crate::printer::{Printer, one_line};
use crate::settings::{DroneName, Settings};

/// Tables of settings that every flight reads.
const TABLES: [&str; 4] = ["fly", "camera", "vlm", "envelope"];

/// What carries the camera.
pub(super) enum Carrier<'a> {
    /// The simulator's craft, with its own camera.
    Simulated,
    /// The simulator's craft, while another camera sees, for trying one and a VLM at the desk.
    Desk(&'a str),
    /// Any other drone, with the camera in the place of its own.
    Real(Box<dyn Target>, Option<&'a str>),
}

impl<'a> Carrier<'a> {
    fn of(settings: &Settings, camera: &'a CameraArgs) -> Result<Self, CliError> {
        Ok(match (settings.fly.drone.or_default()?, &camera.url) {
            (DroneName::Real(_, target), _) => {
                let eyes = real::eyes(camera, settings, target.as_ref())?;
                if let Some(url) = eyes.filter(|_| !target.is_simulated()) {
                    refuse_endless(url)?;
                }
                Self::Real(target, eyes)
            }
            (DroneName::Sim, Some(url)) => Self::Desk(url),
            (DroneName::Sim, None) => Self::Simulated,
        })
    }

    fn is_real(&self) -> bool {
        matches!(self, Self::Real(..))
    }

    /// Whether its time stands still while the pilot thinks.
    fn runs_in_lockstep(&self, settings: &Settings) -> Result<bool, CliError> {
        Ok(match self {
            Self::Real(target, _) => target.runs_in_lockstep(&options(settings)?),
            Self::Simulated | Self::Desk(_) => false,
        })
    }

    /// Refuses settings that this carrier cannot follow.
    fn refuse_others(&self, settings: &Settings) -> Result<(), CliError> {
        let has_sensor = settings.fly.depth_sensor.or_default()?.0.is_some();
        if let Self::Real(target, _) = self {
            return match settings.fly.depth_sensor.or_default()?.0 {
                Some(_) if !target.has_depth_sensor() => Err(CliError::usage("this drone has no depth sensor that is read")
                    .hint("--depth-sensor is for simulated craft, those of --drone airsim too")),
                Some(DepthSensor { fault: Some(_) }) => {
                    Err(CliError::usage("the depth sensor of this drone cannot be made to fail").hint("--depth-sensor on"))
                }
                _ => Ok(()),
            };
        }
        if settings.tello.motion.is_by_hand() {
            return Err(CliError::usage("--tello-motion requires --drone tello").hint("use --motion for the simulated craft"));
        }
        if settings.mavlink.upload_fence.is_on()? {
            return Err(CliError::usage("mavlink.upload_fence requires --drone mavlink")
                .hint("the simulated craft keeps to --geofence itself"));
        }
        if settings.fly.at_end.get()? == Some(AtEnd::Return) {
            return Err(CliError::usage("the simulated craft cannot return by itself")
                .hint("--at-end rtl is for PX4 and ArduPilot (--drone mavlink), simulated ones too; use land or hover"));
        }
        if has_sensor && matches!(self, Self::Desk(_)) {
            return Err(CliError::usage("--depth-sensor measures in the simulated scene, which the camera does not see")
                .hint("leave out --depth-sensor, or --camera"));
        }
        Ok(())
    }

    /// Refuses the oracle where it has nothing to read.
    fn refuse_oracle(&self) -> Result<(), CliError> {
        match self {
            Self::Simulated => Ok(()),
            Self::Desk(_) => Err(CliError::usage("the oracle reads the simulator's own images; what a camera sees needs a VLM")
                .hint("choose one with --vlm; `spf vlm list` lists them")),
            Self::Real(..) => Err(CliError::usage(real::NO_ORACLE)
                .hint("`spf vlm list` lists the models, and docs/guide/vlm.md describes how to choose one")),
        }
    }
}

/// Prepares the flight. All that can be wrong in the command is said before anything is loaded or connected.
pub(crate) fn ready(
    args: &Fly,
    settings: &mut Settings,
    instruction: &str,
    others: Others<'_>,
    printer: &Printer,
) -> Result<Ready, CliError> {
    let carrier = Carrier::of(settings, &args.flight.camera)?;
    let is_simulated = matches!(carrier, Carrier::Simulated);
    if !is_simulated {
        settings.fly.vlm.default_to(spf_vlm::setup::AUTO);
    }
    let settings = &*settings;
    settings.check(&TABLES)?;
    let (preset, policy) = (settings.fly.preset.or_default()?, settings.fly.policy.or_default()?);
    carrier.refuse_others(settings)?;
    refuse_contradictions(settings, policy)?;
    let prompt = prompt(settings, policy)?;
    let script = args.flight.events.as_deref().map(script).transpose()?.unwrap_or_default();
    // A flight in virtual time is over before anyone could watch it.
    let is_watched = settings.fly.realtime.is_on()? || settings.fly.live.text().is_some() || others.is_any();
    let stepped = carrier.runs_in_lockstep(settings)?;
    if settings.airsim.lockstep.is_on()? && !stepped {
        return Err(CliError::usage("--lockstep requires --drone airsim")
            .hint("flights in the embedded simulator are in virtual time anyway, and depend on no machine's speed"));
    }
    if stepped && is_watched {
        return Err(CliError::usage("--lockstep flies in the simulator's time, in which nobody can watch or steer")
            .hint("leave out --lockstep, or --cockpit, --live and --realtime"));
    }
    let pace = if (is_simulated || stepped) && !is_watched { Pace::Virtual } else { Pace::Wall };
    let pointing = page::pointing(others, settings, prompt.clone(), pace)?;
    if pointing.is_oracle {
        carrier.refuse_oracle()?;
    }
    // What an assistant says is checked when it says it, in flight too.
    if others.assistant.is_none() && refusal::is_on(settings, others.is_any())? {
        refusal::check(settings, instruction, printer)?;
    }
    let unattended = settings.fly.unattended.is_on()?;
    let attended = carrier.is_real() && !unattended && !stepped;
    if attended && !Manual::is_possible() && !others.is_any() {
        return Err(no_keys());
    }
    if !is_simulated && depth_model::is_stand_in(settings) {
        return Err(
            CliError::usage("a stand-in for a depth network has its depth from the simulator").hint("--depth-model fastdepth")
        );
    }
    let depth_network = depth_model::plan(settings)?;
    let (pointing, detector) = detector::combine(settings, pointing)?;
    let interrupts = flight_interrupts(carrier.is_real())?;
    let aboard = match &carrier {
        Carrier::Simulated => {
            let given = others.given(pace == Pace::Wall);
            let said = Said { instruction, given, anyway: args.anyway, printer };
            simulated::board(settings, &said, pace, pointing.is_oracle, &script)?
        }
        Carrier::Desk(url) => simulated::at_the_desk(&args.flight.camera, settings, url, printer)?,
        Carrier::Real(target, eyes) => real::board(&args.flight.camera, settings, target.as_ref(), *eyes, &pointing, printer)?,
    };
    // Whoever watches may give the next instruction.
    let is_attended = if carrier.is_real() { attended } else { others.is_any() };
    let facts = Facts {
        has_ranges: aboard.has_ranges,
        lists_boxes: pointing.lists_boxes,
        flies_moves: aboard.flies_moves,
        is_attended,
        on_wall_clock: pace == Pace::Wall,
    };
    // A program is asked where the answer changes anything.
    let facts = match &pointing.program {
        Some(program) if depends_on_boxes(settings, policy, &facts)? => Facts { lists_boxes: program.lists_boxes(), ..facts },
        _ => facts,
    };
    let instruction = aboard.chosen.as_deref().unwrap_or(instruction);
    let mut method = method(settings, policy, &facts)?;
    let mut limits = Limits { brake: brake(settings, &method, &facts)?, ..aboard.limits };
    let beginning = Beginning { craft: &aboard.craft, height: aboard.height };
    let demanded = match others.points() {
        true => Vec::new(),
        false => tighten(instruction, args.anyway, beginning, &mut limits, &mut method)?,
    };
    let craft = limits.capped(&aboard.craft);
    let words = method_words(settings, policy);
    let flying = format!("Flying \"{}\"{}, {words}{}.", one_line(instruction), aboard.place, aboard.drawn);
    let mut announcements = vec![flying, sentence(&pointing.sentence, &craft)];
    announcements.extend(without_boxes(settings, policy, &facts)?);
    announcements.extend(aboard.announcements);
    announcements.extend(demanded);
    if method.at_end == AtEnd::Return {
        announcements.push(real::returning(&limits, &aboard.craft)?);
    }
    if carrier.is_real() && !stepped {
        announcements.extend(end_of_a_real_flight(method.at_end, unattended, is_human(&pointing.name) && !others.is_any()));
    }
    let depth_network = depth_network.map(|(plan, sentence)| {
        announcements.push(sentence);
        plan
    });
    let plan = FlightPlan {
        policy: Arc::new(policy),
        preset,
        settings: method,
        limits,
        detector,
        depth_network,
        prompt,
        max_cost_usd: settings.fly.max_cost_usd.get()?,
        script,
        interrupts,
        ..FlightPlan::new(aboard.site, instruction, &pointing.name, pointing.vlm_factory)
    };
    let by_hand = (pace == Pace::Wall).then_some(craft);
    Ok(Ready { plan, announcements, by_hand, reader: aboard.reader, attended, camera: aboard.frames })
}

/// The VLM, and the craft's time from a zero setpoint to standstill at cruise speed.
fn sentence(points: &str, craft: &Craft) -> String {
    format!("{points} Stopping time from cruise speed: {:.2} s.", craft.standstill_time(craft.cruise_speed))
}

/// Who ends a real flight, and what the drone does then. A person who answers by `typing` lines can type no instruction.
fn end_of_a_real_flight(at_end: AtEnd, unattended: bool, typing: bool) -> Vec<String> {
    let nobody = "Unattended: no keyboard control. Only Ctrl-C, SIGTERM and the safety envelope land the drone.".to_owned();
    let also = if typing { "" } else { " and accepts a new instruction" };
    let hovers = format!("After the instruction the drone hovers for up to 60 s{also} (--at-end).");
    let said = [(unattended, nobody), (at_end == AtEnd::Hover, hovers)];
    said.into_iter().filter_map(|(is, sentence)| is.then_some(sentence)).collect()
}
