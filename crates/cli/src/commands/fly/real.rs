//! `spf fly --drone tello`: a real craft, or one that nobody can tell from it.

use std::net::SocketAddr;
use std::time::Instant;

use spf_core::craft::CraftKind;
use spf_core::envelope::Limits;
use spf_core::estimator::Senses;
use spf_core::executor::Motion;
use spf_core::pilot::Think;
use spf_core::time::duration_from_secs;
use spf_drone::Drone;
use spf_drone::tello::{ConnectError, Connected, Tello, TelloSettings};
use spf_flight::keys::HELP;
use spf_flight::real::{self, RealPlan};
use spf_flight::sim::RecordPlan;
use spf_record::live::Live;
use spf_sim::model::Model;
use spf_vlm::Vlm;
use spf_vlm::check::{Verdict, check};

use super::manual::Manual;
use super::settings::{flag, limits, manner, method, prompt, script, tello_settings};
use super::{give_back, interrupts, live_view, out_dir, report, standstill, tell_view};
use crate::args::Fly;
use crate::commands::detector;
use crate::commands::vlm::{Pointing, pointing};
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::{Printer, one_line};
use crate::progress::Progress;
use crate::settings::Settings;

/// What the person must know before a Tello takes off.
pub(crate) const WARNING: &str = "A Tello holds its last velocity: when the link is cut nothing can stop it before it lands by itself, 15 s \
                       after the last command. Ctrl-C lands, a second one ends the program.";

/// The same, when it ends each step by itself.
const OWN_WARNING: &str = "Each step ends by itself: when the link is cut the Tello flies the rest of it, at most 5 m, hovers, and lands 15 s after the \
                           last command. Steps within 20 cm are flown by rc. Ctrl-C lands, a second one ends the program.";

/// Flies a Tello.
pub(super) fn fly(
    args: &Fly,
    mut settings: Settings,
    instruction: &str,
    drone: SocketAddr,
    mut printer: Printer,
) -> Result<Exit, CliError> {
    settings.default("fly.vlm", spf_vlm::setup::AUTO);
    let (preset, policy) = manner(&settings)?;
    let (policy, mut method) = detector::manner(&settings, policy, method(&settings, preset)?)?;
    let prompt = prompt(&settings, policy)?;
    let own = settings.choice("tello.motion", &[("rc", false), ("go", true)])?.unwrap_or(false);
    if own {
        // Whatever else is set: what the drone flies by itself has no end that a later answer could move.
        (method.motion, method.think) = (Motion::Manoeuvres, Think::Stop);
    }
    let limits = limits(&settings, Limits::for_craft(&Model::of(CraftKind::Tello).craft))?;
    let tello = tello_settings(&settings, drone)?;
    let script = args.world.events.as_deref().map(script).transpose()?.unwrap_or_default();
    let max_cost_usd = settings.number("fly.max_cost_usd", 0.0, 1e6)?;
    let pointing = pointing(&settings, prompt.clone())?;
    check_vlm(&settings, &pointing, &printer)?;
    let (pointing, detector) = detector::beside(&settings, policy, pointing)?;
    let interrupts = interrupts()?;
    let start = Instant::now();
    let Connected { drone: craft, firmware, .. } = connect(&tello, start, &printer)?;
    if own && firmware.sdk.is_none() {
        return Err(CliError::usage("this Tello cannot be flown with --tello-motion go")
            .hint("its firmware speaks SDK 1.3, in which nothing ends a move; update it in the Tello app, or fly it by rc"));
    }
    let view = settings.get("fly.live").map(|address| live_view(address, &settings)).transpose()?;
    let out = out_dir(&settings, instruction)?;
    let record = RecordPlan { out: out.clone(), video: flag(&settings, "fly.video")?, view: view.as_ref().map(Live::sender) };
    printer.start_live();
    printer.say(&format!(
        "Flying \"{}\", policy {}, preset {}.",
        one_line(instruction),
        policy.name(),
        settings.get("fly.preset").unwrap_or_default(),
    ));
    printer.say(&format!("{} Standstill after a stop: {:.2} s at cruise.", pointing.sentence, standstill(CraftKind::Tello)));
    printer.say(if own { OWN_WARNING } else { WARNING });
    if let Some(view) = &view {
        tell_view(view, &printer);
    }
    let (manual, operator) = Manual::start(craft.capabilities().craft);
    if manual.is_on() {
        printer.say(HELP);
    }
    let frames = craft.frames();
    let plan = RealPlan {
        drone: Box::new(craft),
        start,
        senses: Senses::tello(),
        instruction: instruction.to_owned(),
        policy,
        preset,
        settings: method,
        limits,
        vlm: pointing.name,
        who: pointing.who,
        detector,
        prompt,
        max_cost_usd,
        script,
        interrupts,
        operator,
        record: Some(record),
    };
    let mut progress = Progress::new(&printer);
    let flown = real::fly(plan, &mut [&mut progress]);
    drop(manual);
    printer.end_live();
    let flown = flown.map_err(|error| {
        give_back(&out);
        CliError::usage("the flight cannot begin").because(&error)
    })?;
    for problem in &flown.recording_problems {
        printer.say(&format!("warning: not recorded: {problem}"));
    }
    let tally = frames.tally();
    printer.say(&format!(
        "video: {} frames decoded, {} gaps, {} skipped until a key frame, {} refused, {} overtaken by newer ones",
        tally.decoded, tally.video.gaps, tally.video.skipped, tally.refused, tally.overtaken
    ));
    report(&flown.summary, out.path(), &printer)?;
    Ok(Exit::of(flown.summary.outcome, flown.summary.verified))
}

/// Connects, and tells to whom.
pub(crate) fn connect(tello: &TelloSettings, start: Instant, printer: &Printer) -> Result<Connected, CliError> {
    let connected = Tello::connect(tello, start).map_err(|error| refused(&error, tello.drone))?;
    let battery = connected.state.battery.map_or("battery unknown".to_owned(), |charge| format!("battery {charge} %"));
    printer.say(&format!("Connected to the Tello at {}: {}, {battery}.", tello.drone.ip(), connected.firmware));
    Ok(connected)
}

/// A VLM that points astray is found out on the ground.
fn check_vlm(settings: &Settings, pointing: &Pointing, printer: &Printer) -> Result<(), CliError> {
    // A recording and the oracle have no answer to pictures of a dot.
    let answers =
        !(pointing.name.starts_with("oracle") || settings.get("fly.vlm").is_some_and(|name| name.starts_with("replay:")));
    if !answers || !flag(settings, "fly.vlm_check")? {
        return Ok(());
    }
    printer.say("Asking the VLM about three pictures of a dot …");
    let time = settings.number("fly.reply_timeout_s", 0.1, 600.0)?.unwrap_or(20.0);
    let mut vlm: Box<dyn Vlm> =
        (pointing.who)(None, 0).map_err(|error| CliError::usage("the VLM cannot be asked").because(&*error))?;
    match check(vlm.as_mut(), duration_from_secs(time)).verdict {
        Verdict::Good(worst) => {
            printer.say(&format!("{} answers and points within {:.1} % of the picture.", pointing.name, 100.0 * worst));
            Ok(())
        }
        Verdict::Failed(error) => Err(CliError::failed("the VLM does not answer; nothing took off").because(&error)),
        _ => Err(CliError::failed(format!("{} points astray; nothing took off", pointing.name))
            .hint(format!("`spf vlm check {}` tells how; --no-vlm-check flies all the same", pointing.name))),
    }
}

fn refused(error: &ConnectError, drone: SocketAddr) -> CliError {
    let said = CliError::failed("the Tello cannot be flown").because(error);
    match error {
        ConnectError::Port { port, .. } => {
            said.hint(format!("another program has port {port}: end it (other Tello programs, a second flight)"))
        }
        ConnectError::Unreachable { .. } | ConnectError::NoAnswer { .. } => said.hint(format!(
            "is it on, and is this machine in its Wi-Fi TELLO-…? `ping {}` should answer; a Tello that was flown by the app wants to be switched off and on",
            drone.ip()
        )),
        ConnectError::NoState { port } => {
            said.hint(format!("a firewall lets commands out and nothing in: allow UDP {port} and 11111 from {}", drone.ip()))
        }
        _ => said,
    }
}
