//! Converts settings to a flight plan.

use std::path::Path;
use std::sync::Arc;

use spf_core::prompt::PromptText;
use spf_core::query::DepthAs;
use spf_core::time::{Duration, duration_from_secs};
use spf_drone::mavlink::settings::{FencePlan, GimbalUse, MavlinkSettings};
use spf_drone::options::Options;
use spf_drone::tello::TelloSettings;
use spf_drone::tello::sticks::Calibration;
use spf_envelope::geofence::Geofence;
use spf_envelope::{BrakeLimits, Limits};
use spf_flight::policy::PolicyKind;
use spf_flight::sim::FlightConditions;
use spf_flight::tracking::TrackBy;
use spf_flight::world::Script;
use spf_motion::executor::{Ending, Motion};
use spf_pilot::guidance::{AnchorUse, Guidance};
use spf_pilot::{PilotSettings, Preset, QueryTiming};

use crate::commands::read;
use crate::commands::vlm::{Pace, is_human};
use crate::error::CliError;
use crate::settings::{Setting, Settings};

/// Age at which the brake no longer takes a network's depth for what is there, seconds.
const NETWORK_AGE_S: f64 = 1.5;
/// Time that a person may take: longer than any battery lasts.
const LEISURE: Duration = Duration::from_secs(86_400);

/// The method of a flight in words, with what is not as it is by default.
pub(super) fn method_words(settings: &Settings, policy: PolicyKind, method: &PilotSettings) -> String {
    let preset = settings.fly.preset.text().unwrap_or_default();
    let mut words = format!("policy {}, preset {preset}", policy.name());
    words.push_str(if method.guidance.track { ", track pixels" } else { "" });
    words
}

/// The preset and the policy.
pub(super) fn preset_and_policy(settings: &Settings) -> Result<(Preset, PolicyKind), CliError> {
    Ok((settings.fly.preset.or_default()?, settings.fly.policy.or_default()?))
}

/// The prompt in the settings, if any.
pub(super) fn prompt(settings: &Settings, policy: PolicyKind) -> Result<Option<Arc<PromptText>>, CliError> {
    let Some(path) = settings.fly.prompt.text() else { return Ok(None) };
    if let Some(prompt) = PromptText::named(path) {
        return built_in(settings, policy, prompt).map(Some);
    }
    let refused = || CliError::usage(format!("invalid prompt file `{path}`"));
    let prompt = PromptText::parse(&read(Path::new(path), "prompt")?)
        .map_err(|error| refused().because(&error).hint("start from the built-in prompts in `prompts/` (docs/guide/vlm.md)"))?;
    if prompt.kind() != policy.prompt() {
        let wanted = policy.prompt().word();
        return Err(
            refused().hint(format!("the policy {} requires a prompt that begins with `spf-prompt {wanted}`", policy.name()))
        );
    }
    Ok(Some(Arc::new(prompt)))
}

/// A built-in prompt named by `--prompt`.
fn built_in(settings: &Settings, policy: PolicyKind, prompt: Arc<PromptText>) -> Result<Arc<PromptText>, CliError> {
    if prompt.kind() != policy.prompt() {
        return Err(CliError::usage(format!("the prompt `paper` is for the policy spf, not for {}", policy.name())));
    }
    if settings.fly.depth_as.get()?.is_some_and(|depth| depth == DepthAs::Metres) {
        return Err(CliError::usage("the prompt `paper` asks for a label, and cannot be used with --depth-as metres"));
    }
    Ok(prompt)
}

/// Wind, charge and camera effects.
pub(super) fn flight_conditions(settings: &Settings) -> Result<FlightConditions, CliError> {
    let mut flight_conditions = FlightConditions::default();
    if let Some(wind) = settings.fly.wind.get()? {
        flight_conditions.wind = wind;
    }
    if let Some(charge) = settings.fly.battery.get()? {
        flight_conditions.battery = charge;
    }
    flight_conditions.depth_sensor = settings.fly.depth_sensor.or_default()?.0;
    if let Some(effects) = settings.camera.effects.get()? {
        flight_conditions.effects = effects;
    }
    Ok(flight_conditions)
}

/// Whether this VLM can be expected to list obstacles when it is asked to: a person who points does not, and a program may
/// have been written without it.
fn answers_with_boxes(vlm: &str) -> bool {
    !(is_human(vlm) || vlm.starts_with("exec:"))
}

/// The pilot's settings: the preset, with the changes from the settings.
pub(super) fn method(settings: &Settings, preset: Preset, pace: Pace) -> Result<PilotSettings, CliError> {
    let fly = &settings.fly;
    let mut method = PilotSettings::preset(preset);
    if let Some(step) = fly.step.get()? {
        method.step = step;
    }
    if let Some(motion) = fly.motion.get()? {
        method.motion = motion;
        // Timed primitives are the paper's queue; blended ones have no durations of their own.
        if motion == Motion::Blended {
            method.ending = Ending::Measured;
        }
    }
    if let Some(think) = fly.think.get()? {
        method.think = think;
    }
    let sensor = fly.depth_sensor.or_default()?.0.is_some();
    let network = fly.depth_model.text().is_some();
    let lists_boxes =
        preset == Preset::Default && !sensor && fly.policy.or_default()?.name() == "spf" && fly.prompt.text().is_none();
    method.avoid = fly.avoid.or_default()?.or(lists_boxes && answers_with_boxes(fly.vlm.text_or_default()));
    // What guides between two answers is on by itself where it can work.
    let can_guide = method.think == QueryTiming::Continuous && method.motion == Motion::Blended;
    // A depth network may be without its scale, or slow: boxes are asked for as well, and each step is checked against them.
    let measures = sensor || network;
    let map = fly.map.or_default()?.or(can_guide && measures);
    let anchor = fly.anchor.or_default()?;
    let by_itself = can_guide && (measures || method.avoid);
    method.guidance = Guidance {
        anchor: match (anchor.or(by_itself), anchor.is_auto() && !map) {
            (false, _) => AnchorUse::Off,
            (true, true) => AnchorUse::Low,
            // The planner needs a place to go to, also where that is tall.
            (true, false) => AnchorUse::Always,
        },
        map,
        sensor,
        track: fly.track.or_default()? != TrackBy::Off,
    };
    if let Some(depth) = fly.depth_as.get()? {
        method.depth = depth;
    }
    method.close_up = fly.close_up.is_on()?;
    method.near_m = fly.near_m.get()?;
    if let Some(keep) = fly.keep_m.get()? {
        method.keep_m = keep;
    }
    if fly.keep_m.is_given() && !fly.keep_m.is_from_file() && !method.guidance.track {
        return Err(CliError::usage("--keep needs a tracker").hint("add --track pixels"));
    }
    method.follow_time = fly.follow_time_s.get()?.map(duration_from_secs);
    if method.follow_time.is_some() && !method.guidance.track {
        return Err(CliError::usage("--follow-time needs a tracker").hint("add --track pixels"));
    }
    if let Some(rate) = fly.rate_hz.get()? {
        method.rate_hz = rate;
    }
    if let Some(seconds) = fly.max_time_s.get()? {
        method.max_time = duration_from_secs(seconds);
    }
    if let Some(seconds) = fly.reply_timeout_s.get()? {
        method.reply_timeout = duration_from_secs(seconds);
    }
    if let Some(at_end) = fly.at_end.get()? {
        method.at_end = at_end;
    }
    if let Some(seconds) = fly.max_reply_age_s.get()? {
        method.max_reply_age = duration_from_secs(seconds);
    }
    if let Some(decisions) = fly.max_decisions.get()? {
        method.max_decisions = decisions;
    }
    if network && !method.guidance.map {
        return Err(CliError::usage("--depth-model is for the map, which is off").hint("add --map on, or leave --map out"));
    }
    if !method.guidance.is_off() && (method.think != QueryTiming::Continuous || method.motion != Motion::Blended) {
        return Err(CliError::usage("--anchor, --map and --track need --think continuous and --motion blended")
            .hint("leave them off with the preset paper"));
    }
    if pace == Pace::Wall && is_human(fly.vlm.text_or_default()) {
        // The drone holds while a person thinks, for as long as the battery allows.
        if !fly.think.is_given() {
            method.think = QueryTiming::Stop;
        }
        if !fly.reply_timeout_s.is_given() {
            method.reply_timeout = LEISURE;
        }
        if !fly.max_time_s.is_given() {
            method.max_time = LEISURE;
        }
    }
    Ok(method)
}

/// Refuses a map that nothing measures: boxes of replies tell where something begins in the image, and little of its shape.
pub(super) fn check_map(settings: &Settings, method: &PilotSettings) -> Result<(), CliError> {
    let is_measured = method.guidance.sensor || settings.fly.depth_model.text().is_some();
    if method.guidance.map && !is_measured {
        return Err(CliError::usage("--map: nothing measures the depth of what is around the drone")
            .hint("add --depth-sensor on (the simulated craft) or --depth-model FILE, or fly a craft with range sensors; or leave --map out"));
    }
    Ok(())
}

/// The configured limits, else those of `limits`.
pub(super) fn limits(settings: &Settings, mut limits: Limits) -> Result<Limits, CliError> {
    let envelope = &settings.envelope;
    let set = |limit: &mut f64, setting: &Setting<f64>| setting.get().map(|value| *limit = value.unwrap_or(*limit));
    set(&mut limits.max_speed, &envelope.max_speed_m_s)?;
    set(&mut limits.max_climb, &envelope.max_climb_m_s)?;
    let mut yaw_deg = limits.max_yaw_rate.to_degrees();
    set(&mut yaw_deg, &envelope.max_yaw_rate_deg_s)?;
    limits.max_yaw_rate = yaw_deg.to_radians();
    set(&mut limits.min_altitude, &envelope.min_altitude_m)?;
    set(&mut limits.max_altitude, &envelope.max_altitude_m)?;
    set(&mut limits.max_distance, &envelope.max_distance_m)?;
    set(&mut limits.low_battery, &envelope.low_battery)?;
    if let Some(replies) = envelope.max_failed_replies.get()? {
        limits.max_failed_replies = replies;
    }
    let sensor = settings.fly.depth_sensor.or_default()?.0.is_some();
    let network = settings.fly.depth_model.text().is_some();
    let track = settings.fly.track.or_default()? != TrackBy::Off;
    if settings.fly.brake.or_default()?.or(sensor || network || track) {
        limits.brake = Some(match (sensor, network) {
            (true, _) => BrakeLimits::with_sensor(),
            // A network's depth comes seldom and late, and a craft whose network has no scale flies on as one without.
            (false, true) => BrakeLimits { max_depth_age: NETWORK_AGE_S, ..BrakeLimits::without_sensor() },
            (false, false) => BrakeLimits::without_sensor(),
        });
    }
    if let Some(path) = settings.fly.geofence.text() {
        let text = read(Path::new(path), "geofence")?;
        let fence = Geofence::from_geojson(&text).map_err(|error| {
            CliError::usage(format!("invalid geofence `{path}`"))
                .because(&error)
                .hint("use GeoJSON polygons in local east/north metres (docs/explanation/safety.md)")
        })?;
        limits.geofence = Some(fence);
    }
    limits.check().map_err(|error| {
        CliError::usage("inconsistent envelope limits")
            .because(&error)
            .hint("`spf config show` prints the limits and their sources")
    })?;
    Ok(limits)
}

/// The events of an events file.
pub(super) fn script(path: &Path) -> Result<Script, CliError> {
    Script::from_toml(&read(path, "events")?).map_err(|error| {
        CliError::usage(format!("invalid events file `{}`", path.display()))
            .because(&error)
            .hint("see docs/reference/flight-files.md, for example:\n[[event]]\nat_s = 12.5\ndo = \"hold\"")
    })
}

/// The fence that replaces the autopilot's, if one is to.
pub(super) fn fence(settings: &Settings, limits: &Limits) -> Result<Option<FencePlan>, CliError> {
    if !settings.mavlink.upload_fence.is_on()? {
        return Ok(None);
    }
    let Some(geofence) = &limits.geofence else { return Ok(Some(FencePlan::Circle { radius: limits.max_distance })) };
    // Of several, PX4 flies in any, and ArduPilot only where all overlap.
    let mut rings = geofence.only_polygon().ok_or_else(|| {
        CliError::usage("--upload-fence takes a geofence of one polygon")
            .hint("autopilots disagree on what several polygons mean; join them into one, which may have holes")
    })?;
    let outer = rings.next().unwrap_or_default().to_vec();
    Ok(Some(FencePlan::Polygon { outer, holes: rings.map(<[_]>::to_vec).collect() }))
}

/// The options of drivers.
pub(crate) fn options(settings: &Settings) -> Result<Options, CliError> {
    let configured = &settings.tello;
    let mut tello = TelloSettings { motion: configured.motion.or_default()?, ..TelloSettings::default() };
    if let Some(local) = configured.local.get()? {
        tello.local = local;
    }
    if let Some(port) = configured.state_port.get()? {
        tello.state_port = port;
    }
    if let Some(port) = configured.video_port.get()? {
        tello.video_port = port;
    }
    if let Some(latency) = configured.video_latency_s.get()? {
        tello.video_latency = duration_from_secs(latency);
    }
    let Calibration { speed, climb, sink, yaw_rate } = tello.calibration;
    tello.calibration = Calibration {
        speed: configured.speed_m_s.get()?.unwrap_or(speed),
        climb: configured.climb_m_s.get()?.unwrap_or(climb),
        sink: configured.sink_m_s.get()?.unwrap_or(sink),
        yaw_rate: configured.yaw_deg_s.get()?.unwrap_or(yaw_rate.to_degrees()).to_radians(),
    };
    let gimbal = settings.mavlink.gimbal.get()?.map_or(GimbalUse::Reported, |pitch| pitch.0);
    Ok(Options { tello, mavlink: MavlinkSettings { gimbal, ..MavlinkSettings::default() }, ..Options::default() })
}
