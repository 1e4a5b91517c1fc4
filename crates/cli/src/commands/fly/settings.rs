//! Converts settings to a flight plan.

use std::path::Path;
use std::sync::Arc;

use spf_api::method::Choices;
pub(super) use spf_api::method::Facts;
use spf_core::prompt::PromptText;
use spf_core::query::DepthAs;
use spf_core::time::duration_from_secs;
use spf_drone::airsim::settings::AirSimSettings;
use spf_drone::mavlink::settings::{FencePlan, GimbalUse, MavlinkSettings};
use spf_drone::options::Options;
use spf_drone::tello::TelloSettings;
use spf_drone::tello::sticks::Calibration;
use spf_envelope::geofence::Geofence;
use spf_envelope::{BrakeLimits, Limits};
use spf_flight::policy::PolicyKind;
use spf_flight::sim::FlightConditions;
use spf_flight::world::Script;
use spf_pilot::PilotSettings;
use spf_vlm::exec::EXEC;

use crate::commands::read;
use crate::commands::vlm::is_human;
use crate::error::CliError;
use crate::settings::{Setting, Settings};

/// The method of a flight in words.
pub(super) fn method_words(settings: &Settings, policy: PolicyKind) -> String {
    let preset = settings.fly.preset.text().unwrap_or_default();
    format!("policy {}, preset {preset}", policy.name())
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
        return Err(CliError::usage("the prompt `paper` asks for a label, and cannot be used with fly.depth_as = \"metres\""));
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

/// What the settings choose of the method.
fn choices(settings: &Settings, policy: PolicyKind) -> Result<Choices, CliError> {
    let fly = &settings.fly;
    // A default gives way to what a person needs.
    let given = |setting: &Setting<f64>| if setting.is_given() { setting.get() } else { Ok(None) };
    Ok(Choices {
        preset: fly.preset.or_default()?,
        policy,
        step: fly.step.get()?,
        motion: fly.motion.get()?,
        think: fly.think.get()?,
        track: fly.track.or_default()?.chosen(),
        avoid: fly.avoid.or_default()?.chosen(),
        brake: fly.brake.or_default()?.chosen(),
        depth_as: fly.depth_as.get()?,
        close_up: fly.close_up.is_on()?,
        near_m: fly.near_m.get()?,
        keep_m: fly.keep_m.get()?,
        follow_time_s: fly.follow_time_s.get()?,
        rate_hz: fly.rate_hz.get()?,
        max_time_s: given(&fly.max_time_s)?,
        reply_timeout_s: given(&fly.reply_timeout_s)?,
        max_reply_age_s: fly.max_reply_age_s.get()?,
        max_decisions: fly.max_decisions.get()?,
        max_queries: fly.max_queries.get()?,
        at_end: fly.at_end.get()?,
        depth_sensor: fly.depth_sensor.or_default()?.0.is_some(),
        depth_network: fly.depth_model.text().is_some(),
        detector: fly.detector.text().is_some(),
        own_prompt: fly.prompt.text().is_some(),
        person: is_human(fly.vlm.text_or_default()),
    })
}

/// The pilot's settings: those of the preset, with the changes from the settings.
pub(super) fn method(settings: &Settings, policy: PolicyKind, facts: &Facts) -> Result<PilotSettings, CliError> {
    spf_api::method::settings(&choices(settings, policy)?, facts)
}

/// Whether obstacle mode is on if the VLM lists obstacles, and off if it does not.
pub(super) fn depends_on_boxes(settings: &Settings, policy: PolicyKind, facts: &Facts) -> Result<bool, CliError> {
    let of = |lists_boxes| method(settings, policy, &Facts { lists_boxes, ..*facts }).map(|method| method.avoid);
    Ok(of(true)? && !of(false)?)
}

/// What is to be said if obstacle mode is off for no other reason than that the model lists no boxes.
pub(super) fn without_boxes(settings: &Settings, policy: PolicyKind, facts: &Facts) -> Result<Option<String>, CliError> {
    let vlm = settings.fly.vlm.text_or_default();
    if is_human(vlm) {
        return Ok(None);
    }
    let who = if vlm.starts_with(EXEC) {
        "this program declares that it lists no obstacles"
    } else {
        "models of this family only point"
    };
    let is_off = !facts.lists_boxes && depends_on_boxes(settings, policy, facts)?;
    Ok(is_off.then(|| format!("Obstacle mode is off, because {who} (--avoid on asks for boxes all the same).")))
}

/// The brake of the envelope, if there is one.
pub(super) fn brake(settings: &Settings, method: &PilotSettings, facts: &Facts) -> Result<Option<BrakeLimits>, CliError> {
    // Whatever the policy is: the brake depends on what is measured and followed alone.
    Ok(spf_api::method::brake(&choices(settings, PolicyKind::spf())?, method, facts))
}

/// Refuses settings that contradict one another, whatever craft flies.
pub(super) fn refuse_contradictions(settings: &Settings, policy: PolicyKind) -> Result<(), CliError> {
    let fly = &settings.fly;
    if !fly.track.or_default()?.or(!is_human(fly.vlm.text_or_default())) {
        let needs = |flag: &str| CliError::usage(format!("{flag} needs a tracker")).hint("it needs --track on");
        if fly.keep_m.is_by_hand() {
            return Err(needs("--keep"));
        }
        if fly.follow_time_s.get()?.is_some() {
            return Err(needs("--follow-time"));
        }
    }
    if fly.detector.text().is_some() && policy != PolicyKind::spf() {
        return Err(CliError::usage(format!("the policy {} does not support --detector", policy.name()))
            .hint("--detector requires --policy spf; typefly has its own detector"));
    }
    Ok(())
}

/// The configured limits, else those of `limits`; the brake is apart ([`brake`]).
pub(super) fn limits(settings: &Settings, mut limits: Limits) -> Result<Limits, CliError> {
    let envelope = &settings.envelope;
    let set = |limit: &mut f64, setting: &Setting<f64>| setting.get().map(|value| *limit = value.unwrap_or(*limit));
    set(&mut limits.max_speed, &envelope.max_speed_m_s)?;
    set(&mut limits.max_climb, &envelope.max_climb_m_s)?;
    // A limit that nobody sets stays as it is, to the bit: degrees would round it.
    limits.max_yaw_rate = envelope.max_yaw_rate_deg_s.get()?.map_or(limits.max_yaw_rate, f64::to_radians);
    set(&mut limits.min_altitude, &envelope.min_altitude_m)?;
    set(&mut limits.max_altitude, &envelope.max_altitude_m)?;
    set(&mut limits.max_distance, &envelope.max_distance_m)?;
    set(&mut limits.low_battery, &envelope.low_battery)?;
    if let Some(replies) = envelope.max_failed_replies.get()? {
        limits.max_failed_replies = replies;
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
        CliError::usage("mavlink.upload_fence takes a geofence of one polygon")
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
    let airsim = AirSimSettings {
        camera: settings.airsim.camera.text_or_default().to_owned(),
        true_pose: settings.airsim.true_pose.is_on()?,
        depth_sensor: settings.fly.depth_sensor.or_default()?.0.is_some(),
        lockstep: settings.airsim.lockstep.is_on()?,
        seed: settings.fly.seed.or_default()?,
    };
    Ok(Options { tello, mavlink: MavlinkSettings { gimbal, ..MavlinkSettings::default() }, airsim, ..Options::default() })
}

#[cfg(test)]
mod tests {
    use spf_api::method::LEISURE;
    use spf_core::time::Duration;
    use spf_motion::executor::Motion;
    use spf_pilot::method::{Measured, Method};
    use spf_pilot::{AtEnd, Counted, QueryTiming};

    use super::*;

    const PLAIN: Facts =
        Facts { has_ranges: false, lists_boxes: true, flies_moves: false, is_attended: false, on_wall_clock: true };

    /// The settings with these texts in the place of their defaults.
    fn with(change: impl Fn(&mut Settings)) -> Settings {
        let mut settings = Settings::default();
        settings.fly.vlm.argument("--vlm", "gemini");
        change(&mut settings);
        settings
    }

    fn flown(settings: &Settings, facts: &Facts) -> PilotSettings {
        method(settings, settings.fly.policy.or_default().unwrap(), facts).unwrap()
    }

    #[test]
    fn without_flags_the_choices_are_those_of_the_facade() {
        let choices = choices(&Settings::default(), PolicyKind::spf()).unwrap();
        for on_wall_clock in [false, true] {
            let facts = Facts { on_wall_clock, ..PLAIN };
            let of = |choices: &Choices| spf_api::method::settings(choices, &facts).unwrap();
            let (ours, theirs) = (of(&choices), of(&Choices::default()));
            assert_eq!(ours, theirs);
            let of = |choices| spf_api::method::brake(choices, &ours, &facts);
            assert_eq!(of(&choices), of(&Choices::default()));
        }
    }

    #[test]
    fn a_craft_with_range_sensors_has_planner_anchor_and_brake() {
        let (settings, ranges) = (with(|_| {}), Facts { has_ranges: true, ..PLAIN });
        let measured = flown(&settings, &ranges);
        assert_eq!((measured.method, measured.avoid), (Method::Depth(Measured::Part), true));
        assert_eq!(brake(&settings, &measured, &ranges).unwrap(), Some(BrakeLimits::without_sensor()));
        // Without them there is nothing to plan with, and the brake is for somebody who is followed.
        let unmeasured = flown(&settings, &PLAIN);
        assert_eq!((unmeasured.method, unmeasured.track), (Method::Boxes, true));
        assert_eq!(brake(&settings, &unmeasured, &PLAIN).unwrap(), Some(BrakeLimits::without_sensor()));
        let forbidden = with(|settings| settings.fly.track.argument("--track", "off"));
        assert_eq!(brake(&forbidden, &flown(&forbidden, &PLAIN), &PLAIN).unwrap(), None);
    }

    #[test]
    fn whoever_flies_on_while_asking_follows_unless_it_is_forbidden() {
        let follows = |flag: &'static str, value: &str| {
            let settings = with(|settings| match flag {
                "--preset" => settings.fly.preset.argument(flag, value),
                "--policy" => settings.fly.policy.argument(flag, value),
                "--vlm" => settings.fly.vlm.argument(flag, value),
                _ => settings.fly.track.argument("--track", value),
            });
            refuse_contradictions(&settings, settings.fly.policy.or_default().unwrap()).unwrap();
            flown(&settings, &PLAIN).track
        };
        assert!(follows("--track", "auto") && follows("--track", "on") && !follows("--track", "off"));
        assert!(!follows("--preset", "paper") && !follows("--policy", "pivot") && !follows("--vlm", "human"));
        // What needs it is refused where it is off.
        for (vlm, track, is_refused) in [("gemini", "auto", false), ("gemini", "off", true), ("human", "auto", true)] {
            let settings = with(|settings| {
                settings.fly.vlm.argument("--vlm", vlm);
                settings.fly.track.argument("--track", track);
                settings.fly.keep_m.argument("--keep", "3");
            });
            assert_eq!(refuse_contradictions(&settings, PolicyKind::spf()).is_err(), is_refused, "{vlm} {track}");
        }
    }

    #[test]
    fn a_craft_that_flies_its_moves_by_itself_holds_meanwhile_and_is_not_guided() {
        let moves = Facts { flies_moves: true, ..PLAIN };
        let method_of = |settings: &Settings| method(settings, PolicyKind::spf(), &moves);
        let flown = method_of(&with(|_| {})).unwrap();
        assert_eq!((flown.motion, flown.think, flown.method), (Motion::Manoeuvres, QueryTiming::Stop, Method::Paper));
        let tracked = with(|settings| settings.fly.track.argument("--track", "on"));
        assert!(method_of(&tracked).unwrap_err().to_string().contains("needs --think continuous"));
    }

    #[test]
    fn a_person_has_all_the_time_that_nobody_limits() {
        let person = |change: fn(&mut Settings)| {
            let settings = with(|settings| {
                settings.fly.vlm.argument("--vlm", "human");
                change(settings);
            });
            let PilotSettings { think, max_time, reply_timeout, .. } = flown(&settings, &PLAIN);
            (think, max_time, reply_timeout)
        };
        assert_eq!(person(|_| {}), (QueryTiming::Stop, LEISURE, LEISURE));
        let limited = person(|settings| settings.fly.max_time_s.argument("--max-time", "60"));
        assert_eq!(limited, (QueryTiming::Stop, Duration::from_secs(60), LEISURE));
        let tracked = person(|settings| settings.fly.track.argument("--track", "on"));
        assert_eq!(tracked.0, QueryTiming::Continuous, "somebody walks on while the person thinks");
    }

    #[test]
    fn answers_without_progress_and_queries_are_limited_and_all_decisions_of_the_paper() {
        let limits = |preset: &str, decisions: &str, queries: &str| {
            let settings = with(|settings| {
                settings.fly.preset.argument("--preset", preset);
                settings.fly.max_decisions.argument("--max-decisions", decisions);
                settings.fly.max_queries.argument("--max-queries", queries);
            });
            let PilotSettings { counted, max_decisions, max_queries, .. } = flown(&settings, &PLAIN);
            (counted, max_decisions, max_queries)
        };
        assert_eq!(limits("default", "", ""), (Counted::WithoutProgress, 30, Some(120)));
        assert_eq!(limits("default", "9", "50"), (Counted::WithoutProgress, 9, Some(50)));
        assert_eq!(limits("paper", "", ""), (Counted::All, 60, None));
        assert_eq!(limits("paper", "200", "300"), (Counted::All, 200, Some(300)));
    }

    #[test]
    fn a_family_that_only_points_turns_obstacle_mode_off_and_it_is_said() {
        let points = Facts { lists_boxes: false, ..PLAIN };
        let of = |avoid: &str, facts: &Facts| {
            let settings = with(|settings| settings.fly.avoid.argument("--avoid", avoid));
            let policy = settings.fly.policy.or_default().unwrap();
            (flown(&settings, facts).avoid, without_boxes(&settings, policy, facts).unwrap().is_some())
        };
        assert_eq!((of("auto", &points), of("auto", &PLAIN)), ((false, true), (true, false)));
        assert_eq!((of("on", &points), of("off", &points)), ((true, false), (false, false)));
        let human = with(|settings| settings.fly.vlm.argument("--vlm", "human"));
        assert_eq!(without_boxes(&human, PolicyKind::spf(), &points).unwrap(), None);
    }

    #[test]
    fn the_craft_hovers_at_the_end_for_somebody_who_is_there() {
        let end =
            |facts: &Facts, at_end: &str| flown(&with(|settings| settings.fly.at_end.argument("--at-end", at_end)), facts).at_end;
        let attended = Facts { is_attended: true, ..PLAIN };
        assert_eq!([end(&PLAIN, ""), end(&attended, ""), end(&attended, "land")], [AtEnd::Land, AtEnd::Hover, AtEnd::Land]);
    }
}
