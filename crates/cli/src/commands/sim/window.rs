//! `spf sim window`: the simulator in a window, flown by keys as a game is.

use std::fs::File;
use std::io::Write as _;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use spf_core::command::{Command, Setpoint};
use spf_core::craft::CraftKind;
use spf_core::telemetry::FlightPhase;
use spf_core::time::Time;
use spf_flight::sim::{FlightConditions, SimWorld};
use spf_media::Rgb;
use spf_render::Channels;
use spf_screen::profile::{Controls, Key, Profile};
use spf_screen::{Display, Keyboard, Pane, ScreenError};
use spf_sim::craft::SimCraft;

use super::{conditions, parse_kind, parse_size};
use crate::args::SimWindow;
use crate::commands::display::failed;
use crate::commands::fly::signals::interrupts;
use crate::commands::{load_scene, parse_pose};
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;

/// The profile that tells the keys of this window.
const PROFILE: &str = "spf-window";
/// Keys that take off, land, and freeze the game.
const TAKE_OFF: &str = "t";
const LAND: &str = "l";
const FREEZE: &str = "p";
/// How often the keyboard is looked at.
const TICK: Duration = Duration::from_millis(5);
/// How long a setpoint holds without the keyboard's thread.
const VALID: Duration = Duration::from_millis(300);
/// Interval between two lines of the truth.
const TRUTH: Duration = Duration::from_millis(50);

/// Shows the window until it is closed, or Ctrl-C.
pub(super) fn window(args: &SimWindow, printer: &Printer) -> Result<Exit, CliError> {
    if !(1.0..=60.0).contains(&args.fps) {
        return Err(CliError::usage(format!("--fps: `{}` is not a number from 1 to 60", args.fps)));
    }
    let profile = Profile::shipped(PROFILE).ok_or_else(|| CliError::internal("no profile of the window"))?;
    let pose = args.start.as_deref().map(parse_pose).transpose().map_err(|expected| {
        CliError::usage(format!("--start: expected {expected}, found `{}`", args.start.as_deref().unwrap_or_default()))
    })?;
    let kind = args.drone_model.as_deref().map(parse_kind).transpose()?;
    let size = args.size.as_deref().map(parse_size).transpose()?;
    let truth = args.truth.as_deref().map(|path| {
        File::create_new(path).map_err(|error| {
            CliError::usage(format!("--truth: cannot write `{}`", path.display())).because(&error).hint("it must not exist")
        })
    });
    let truth = truth.transpose()?;
    let display = Display::open(None).map_err(|error| failed(&error))?;
    let loaded = Arc::new(load_scene(&args.scene, &conditions(&args.conditions)?)?);
    let kind = kind.unwrap_or(loaded.scene.default_craft);
    let start = pose.unwrap_or(loaded.scene.start);
    let world = SimWorld::under(&FlightConditions::default(), loaded.clone(), kind, start, args.seed);
    let (width, height) = size.unwrap_or((world.camera().width, world.camera().height));
    let too_large = || CliError::usage("--size: the window is too large");
    let size = (u16::try_from(width).map_err(|_| too_large())?, u16::try_from(height).map_err(|_| too_large())?);
    let title = format!("{}: {}", profile.window.title.as_deref().unwrap_or("spf sim window"), loaded.scene.name);
    let pane = Pane::open(&display, &title, size).map_err(|error| failed(&error))?;
    let keyboard = pane.keyboard().map_err(|error| failed(&error))?;
    printer.log(&format!(
        "{title}: {} takes off, {} lands, w s fly forward and back, a d to the sides, r f up and down, q e turn, {} freezes. \
         {} Stop with Ctrl-C.",
        TAKE_OFF,
        LAND,
        FREEZE,
        advice(kind)
    ));
    let stop = interrupts()?;
    let shared = Shared { start: Instant::now(), stopped: AtomicBool::new(false), frozen: AtomicBool::new(false) };
    std::thread::scope(|scope| {
        let craft = world.shared_craft();
        let (shared, controls) = (&shared, &profile.controls);
        let flying = scope.spawn(move || fly(shared, keyboard, controls, &craft, truth));
        let shown = show(shared, pane, &world, args.fps, || stop.load(Ordering::Relaxed) > 0);
        shared.stopped.store(true, Ordering::Relaxed);
        let flown = flying.join().map_err(|_| CliError::internal("the craft's thread failed"))?;
        shown.and(flown).map_err(|error| failed(&error))
    })?;
    Ok(Exit::Success)
}

/// How this craft is flown through the window.
fn advice(kind: CraftKind) -> String {
    match kind {
        CraftKind::Quad => format!("Fly it with --drone screen:{PROFILE}."),
        CraftKind::Tello => {
            format!(
                "The profile {PROFILE} does not fit this craft: its camera's field of view and its rates differ from the quad's."
            )
        }
    }
}

struct Shared {
    start: Instant,
    stopped: AtomicBool,
    /// A frozen game neither moves nor shows anything new.
    frozen: AtomicBool,
}

/// Shows what the craft's camera sees.
fn show(shared: &Shared, mut pane: Pane, world: &SimWorld, fps: f64, stop: impl Fn() -> bool) -> Result<(), ScreenError> {
    let period = Duration::from_secs_f64(1.0 / fps);
    let mut next = Instant::now();
    let size = pane.size();
    while !stop() && !shared.stopped.load(Ordering::Relaxed) && !pane.is_closed()? {
        if !shared.frozen.load(Ordering::Relaxed) {
            let snapshot = world.now();
            let still = world.still(world.truth().time, &snapshot);
            let image = still.map(|shot| world.photograph_with(&shot, Some(size), Channels::RGB));
            pane.show(image.as_ref().unwrap_or(&Rgb::new(size.0, size.1)))?;
        }
        next = (next + period).max(Instant::now());
        std::thread::sleep(next.saturating_duration_since(Instant::now()));
    }
    Ok(())
}

/// Moves the craft by the keys that are down.
fn fly(
    shared: &Shared,
    mut keyboard: Keyboard,
    controls: &Controls,
    craft: &Mutex<SimCraft>,
    mut truth: Option<File>,
) -> Result<(), ScreenError> {
    let key = |name: &str| Key::named(name).ok();
    let [take_off, land, freeze] = [TAKE_OFF, LAND, FREEZE].map(key);
    let (mut time, mut last, mut told) = (Time::ZERO, Instant::now(), Time::ZERO);
    let mut was_freezing = false;
    while !shared.stopped.load(Ordering::Relaxed) {
        let down = match keyboard.down() {
            Ok(down) => down,
            Err(error) => {
                shared.stopped.store(true, Ordering::Relaxed);
                return Err(error);
            }
        };
        let is_down = |key: Option<Key>| key.is_some_and(|key| down.contains(&key));
        if is_down(freeze) && !was_freezing {
            shared.frozen.fetch_xor(true, Ordering::Relaxed);
        }
        was_freezing = is_down(freeze);
        let passed = std::mem::replace(&mut last, Instant::now()).elapsed();
        if !shared.frozen.load(Ordering::Relaxed) {
            time += passed;
            let mut craft = craft.lock().unwrap_or_else(PoisonError::into_inner);
            craft.advance_to(time);
            let phase = craft.truth().phase;
            if is_down(take_off) && phase == FlightPhase::OnGround {
                craft.apply(time, Command::TakeOff, Time::MAX);
            } else if is_down(land) && phase == FlightPhase::Flying {
                craft.apply(time, Command::Land, Time::MAX);
            } else if phase == FlightPhase::Flying {
                let push = |keys: Option<(Key, Key)>| {
                    let part = |key| f64::from(u8::from(down.contains(&key)));
                    keys.map_or(0.0, |(plus, minus)| part(plus) - part(minus))
                };
                let axis = |axis: &spf_screen::profile::Axis| {
                    let push = push(axis.keys());
                    push * axis.rate(push)
                };
                let yaw_rate = push(controls.yaw.keys()) * controls.yaw.rate_deg_s().to_radians();
                let right = controls.right.as_ref().map_or(0.0, axis);
                let setpoint = Setpoint { right, forward: axis(&controls.forward), up: axis(&controls.up), yaw_rate };
                craft.apply(time, Command::Setpoint(setpoint), time + VALID);
            }
            if let Some(file) = &mut truth
                && time.since(told) >= TRUTH
            {
                told = time;
                let truth = craft.truth();
                let (at, heading) = (truth.pose.position, truth.pose.attitude.heading.to_degrees());
                let seconds = shared.start.elapsed().as_secs_f64();
                let line = format!(
                    "{seconds:.3}\t{:.3}\t{:.3}\t{:.3}\t{heading:.2}\t{}\n",
                    at.east,
                    at.north,
                    at.up,
                    truth.collided_with.len()
                );
                if let Err(error) = file.write_all(line.as_bytes()) {
                    tracing::warn!("the truth is no longer written: {error}");
                    told = Time::MAX;
                }
            }
        }
        std::thread::sleep(TICK);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_craft_of_the_profile_is_recommended_to_be_flown_with_it() {
        assert!(advice(CraftKind::Quad).contains("--drone screen:spf-window"));
        let tello = advice(CraftKind::Tello);
        assert!(tello.contains("does not fit") && !tello.contains("--drone"), "{tello}");
    }
}
