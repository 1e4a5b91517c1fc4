//! From settings to what a flight is made of.

use std::net::{IpAddr, SocketAddr};
use std::path::Path;
use std::sync::Arc;

use spf_core::envelope::Limits;
use spf_core::executor::{Ending, Motion};
use spf_core::geofence::Geofence;
use spf_core::pilot::{PilotSettings, Preset, Think};
use spf_core::prompt::PromptText;
use spf_core::step::StepRule;
use spf_core::time::duration_from_secs;
use spf_drone::tello::TelloSettings;
use spf_drone::tello::craft::COMMAND_PORT;
use spf_drone::tello::sticks::Calibration;
use spf_flight::sim::{Circumstances, PolicyKind};
use spf_flight::world::Script;
use spf_render::effects::EffectsError;
use spf_sim::wind::WindError;

use crate::args::Fly;
use crate::commands::read;
use crate::error::{CliError, nearest};
use crate::settings::Settings;

/// Flags over environment over file over defaults.
pub(super) fn layered(args: &Fly) -> Result<Settings, CliError> {
    let mut settings = Settings::load(args.output.config.as_deref())?;
    let (world, method, limits, output) = (&args.world, &args.method, &args.limits, &args.output);
    let on = |flag: bool| flag.then(|| "true".to_owned());
    settings.flag("fly.scene", "--scene", world.scene.clone());
    settings.flag("fly.light", "--light", world.conditions.light.clone());
    settings.flag("fly.weather", "--weather", world.conditions.weather.clone());
    settings.flag("fly.start", "--start", world.start.clone());
    settings.flag("fly.drone", "--drone", world.drone.clone());
    settings.flag("tello.motion", "--tello-motion", world.tello_motion.clone());
    settings.flag("fly.drone_model", "--drone-model", world.drone_model.clone());
    settings.flag("fly.seed", "--seed", world.seed.clone());
    settings.flag("fly.wind", "--wind", world.wind.clone());
    settings.flag("fly.battery", "--battery", world.battery.clone());
    settings.flag("camera.effects", "--camera-effects", world.camera_effects.clone());
    settings.flag("fly.realtime", "--realtime", on(world.realtime));
    settings.flag("fly.vlm", "--vlm", method.vlm.clone());
    settings.flag("fly.prompt", "--prompt", method.prompt.clone());
    settings.flag("fly.vlm_check", "--no-vlm-check", method.no_vlm_check.then(|| "false".to_owned()));
    settings.flag("vlm.record", "--vlm-record", method.vlm_record.clone());
    settings.flag("vlm.fallback", "--vlm-fallback", method.vlm_fallback.clone());
    settings.flag("vlm.hedge_s", "--vlm-hedge", method.vlm_hedge.clone());
    settings.flag("vlm.models", "--vlm-models", method.vlm_models.clone());
    settings.flag("fly.policy", "--policy", method.policy.clone());
    settings.flag("fly.preset", "--preset", method.preset.clone());
    settings.flag("fly.step", "--step", method.step.clone());
    settings.flag("fly.motion", "--motion", method.motion.clone());
    settings.flag("fly.think", "--think", method.think.clone());
    settings.flag("fly.rate_hz", "--rate", method.rate.clone());
    settings.flag("fly.avoid", "--avoid", on(method.avoid));
    settings.flag("fly.detector", "--detector", method.detector.clone());
    settings.flag("fly.max_time_s", "--max-time", limits.max_time.clone());
    settings.flag("fly.max_decisions", "--max-decisions", limits.max_decisions.clone());
    settings.flag("fly.max_cost_usd", "--max-cost", limits.max_cost.clone());
    settings.flag("fly.geofence", "--geofence", limits.geofence.clone());
    settings.flag("fly.out", "--out", output.out.clone());
    settings.flag("fly.live", "--live", output.live.clone());
    settings.flag("fly.video", "--no-video", output.no_video.then(|| "false".to_owned()));
    Ok(settings)
}

/// Whether a key says `true`.
pub(super) fn flag(settings: &Settings, name: &'static str) -> Result<bool, CliError> {
    Ok(settings.choice(name, &[("true", true), ("false", false)])?.unwrap_or(false))
}

/// The named preset, and who decides.
pub(super) fn manner(settings: &Settings) -> Result<(Preset, PolicyKind), CliError> {
    let preset = settings.choice("fly.preset", &[("default", Preset::Default), ("paper", Preset::Paper)])?;
    let policy = settings.choice("fly.policy", &PolicyKind::ALL.map(|kind| (kind.name(), kind)))?;
    Ok((preset.unwrap_or(Preset::Default), policy.unwrap_or(PolicyKind::Spf)))
}

/// The prompt that the settings name, when they name one.
pub(super) fn prompt(settings: &Settings, policy: PolicyKind) -> Result<Option<Arc<PromptText>>, CliError> {
    let Some(path) = settings.get("fly.prompt") else { return Ok(None) };
    let refused = || CliError::usage(format!("the prompt file `{path}` is refused"));
    let prompt = PromptText::parse(&read(Path::new(path), "prompt")?)
        .map_err(|error| refused().because(&error).hint("the shipped prompts, in `prompts/`, are a beginning (docs/vlm.md)"))?;
    if prompt.kind() != policy.prompt() {
        let wanted = policy.prompt().word();
        return Err(refused().hint(format!("the policy {} takes prompts that begin with `spf-prompt {wanted}`", policy.name())));
    }
    Ok(Some(Arc::new(prompt)))
}

/// Wind, charge and camera effects.
pub(super) fn circumstances(settings: &Settings) -> Result<Circumstances, CliError> {
    let refused = |name, what, error: &dyn std::error::Error| settings.wrong(name, what).because(error);
    let mut circumstances = Circumstances::default();
    if let Some(wind) = settings.get("fly.wind") {
        circumstances.wind = wind.parse().map_err(|error: WindError| refused("fly.wind", "a wind", &error))?;
    }
    if let Some(charge) = settings.number("fly.battery", 0.0, 1.0)? {
        circumstances.battery = charge;
    }
    if let Some(effects) = settings.get("camera.effects") {
        circumstances.effects =
            effects.parse().map_err(|error: EffectsError| refused("camera.effects", "a list of camera effects", &error))?;
    }
    Ok(circumstances)
}

/// How the pilot flies: the preset, and what the settings change of it.
pub(super) fn method(settings: &Settings, preset: Preset) -> Result<PilotSettings, CliError> {
    let mut method = PilotSettings::preset(preset);
    if let Some(step) = settings.get("fly.step") {
        method.step = match step.strip_prefix("fixed:").map(str::parse::<f64>) {
            None if step == "adaptive" => StepRule::default(),
            Some(Ok(metres)) if (0.05..=50.0).contains(&metres) => StepRule::Fixed(metres),
            _ => return Err(settings.wrong("fly.step", "adaptive or fixed:METRES (0.05 to 50)")),
        };
    }
    if let Some(motion) = settings.choice("fly.motion", &[("sequential", Motion::Sequential), ("blended", Motion::Blended)])? {
        method.motion = motion;
        // Timed primitives are the paper's queue; blended ones have no durations of their own.
        if motion == Motion::Blended {
            method.ending = Ending::Measured;
        }
    }
    if let Some(think) = settings.choice("fly.think", &[("stop", Think::Stop), ("continuous", Think::Continuous)])? {
        method.think = think;
    }
    method.avoid = flag(settings, "fly.avoid")?;
    if let Some(rate) = settings.number("fly.rate_hz", 5.0, 100.0)? {
        method.rate_hz = rate;
    }
    if let Some(seconds) = settings.number("fly.max_time_s", 1.0, 86_400.0)? {
        method.max_time = duration_from_secs(seconds);
    }
    if let Some(seconds) = settings.number("fly.reply_timeout_s", 0.1, 600.0)? {
        method.reply_timeout = duration_from_secs(seconds);
    }
    if let Some(decisions) = settings.count("fly.max_decisions", 1, 100_000)? {
        method.max_decisions = decisions;
    }
    Ok(method)
}

/// Those of the settings, and `limits` where these say nothing.
pub(super) fn limits(settings: &Settings, mut limits: Limits) -> Result<Limits, CliError> {
    let set = |name, low, high, target: &mut f64| {
        settings.number(name, low, high).map(|value| {
            if let Some(value) = value {
                *target = value;
            }
        })
    };
    set("envelope.max_speed_m_s", 0.1, 30.0, &mut limits.max_speed)?;
    set("envelope.max_climb_m_s", 0.1, 10.0, &mut limits.max_climb)?;
    let mut yaw_deg = limits.max_yaw_rate.to_degrees();
    set("envelope.max_yaw_rate_deg_s", 1.0, 360.0, &mut yaw_deg)?;
    limits.max_yaw_rate = yaw_deg.to_radians();
    set("envelope.min_altitude_m", 0.0, 100.0, &mut limits.min_altitude)?;
    set("envelope.max_altitude_m", 1.0, 1000.0, &mut limits.max_altitude)?;
    set("envelope.max_distance_m", 1.0, 10_000.0, &mut limits.max_distance)?;
    set("envelope.low_battery", 0.0, 1.0, &mut limits.low_battery)?;
    if let Some(replies) = settings.count("envelope.max_failed_replies", 1, 1000)? {
        limits.max_failed_replies = replies;
    }
    if let Some(path) = settings.get("fly.geofence") {
        let text = read(Path::new(path), "geofence")?;
        let fence = Geofence::from_geojson(&text).map_err(|error| {
            CliError::usage(format!("the geofence `{path}` is refused"))
                .because(&error)
                .hint("a geofence is a GeoJSON polygon in local east/north metres (docs/safety.md)")
        })?;
        limits.geofence = Some(fence);
    }
    limits.check().map_err(|error| {
        CliError::usage("the envelope's limits do not fit together")
            .because(&error)
            .hint("`spf config show` prints the limits and where they come from")
    })?;
    Ok(limits)
}

/// The events that a file says happen to the flight.
pub(super) fn script(path: &Path) -> Result<Script, CliError> {
    Script::from_toml(&read(path, "events")?).map_err(|error| {
        CliError::usage(format!("the events file `{}` is refused", path.display()))
            .because(&error)
            .hint("its form stands in docs/flight-files.md, for example:\n[[event]]\nat_s = 12.5\ndo = \"hold\"")
    })
}

/// The address of the Tello that is to be flown; none when it is another drone.
pub(crate) fn tello(settings: &Settings) -> Result<Option<SocketAddr>, CliError> {
    let expected = "sim, tello, or tello@ADDRESS such as tello@192.168.10.1";
    match settings.get("fly.drone") {
        None | Some("sim") => Ok(None),
        Some("tello") => Ok(Some(TelloSettings::default().drone)),
        Some(other) => {
            let address = other.strip_prefix("tello@").and_then(address);
            address.map(Some).ok_or_else(|| settings.wrong_word("fly.drone", expected, nearest(other, ["sim", "tello"])))
        }
    }
}

fn address(text: &str) -> Option<SocketAddr> {
    text.parse().ok().or_else(|| text.parse::<IpAddr>().ok().map(|ip| SocketAddr::new(ip, COMMAND_PORT)))
}

/// How the Tello is reached and flown.
pub(crate) fn tello_settings(settings: &Settings, drone: SocketAddr) -> Result<TelloSettings, CliError> {
    let mut tello = TelloSettings { drone, ..TelloSettings::default() };
    if let Some(local) = settings.parse("tello.local", "an address of this machine, such as 192.168.10.2")? {
        tello.local = local;
    }
    for (name, port) in [("tello.state_port", &mut tello.state_port), ("tello.video_port", &mut tello.video_port)] {
        if let Some(number) = settings.parse::<u16>(name, "a port, 1 to 65535")? {
            *port = number;
        }
    }
    if let Some(latency) = settings.number("tello.video_latency_s", 0.0, 2.0)? {
        tello.video_latency = duration_from_secs(latency);
    }
    let Calibration { speed, climb, sink, yaw_rate } = tello.calibration;
    let number = |name, low, high, default| settings.number(name, low, high).map(|value| value.unwrap_or(default));
    tello.calibration = Calibration {
        speed: number("tello.speed_m_s", 0.1, 10.0, speed)?,
        climb: number("tello.climb_m_s", 0.1, 10.0, climb)?,
        sink: number("tello.sink_m_s", 0.1, 10.0, sink)?,
        yaw_rate: number("tello.yaw_deg_s", 10.0, 360.0, yaw_rate.to_degrees())?.to_radians(),
    };
    Ok(tello)
}
