//! From what a user chooses to the pilot's settings and the brake: a function of the choices and of what is known of the craft,
//! called once. The program's flags and this crate's [`Request`](crate::flight::Request) both come through here.

use spf_core::query::DepthAs;
use spf_core::step::StepRule;
use spf_core::time::{Duration, duration_from_secs};
use spf_envelope::BrakeLimits;
use spf_flight::policy::PolicyKind;
use spf_motion::executor::{Ending, Motion};
use spf_pilot::method::{Method, Sensed};
use spf_pilot::{AtEnd, Counted, PilotSettings, Preset, QueryTiming};

use crate::error::Error;

/// Flight time: enough for twenty answers of a model that takes 10 s for each, while the craft holds.
const FLIGHT_TIME: Duration = Duration::from_secs(300);
/// Answers in a row without progress: more than a search needs between two places, of two circles with looks up and down.
const WITHOUT_PROGRESS: u32 = 30;
/// Queries of a flight, each of which may cost money.
const MAX_QUERIES: u32 = 120;
/// Time that a person may take: longer than any battery lasts.
pub const LEISURE: Duration = Duration::from_secs(86_400);

/// What a user chooses of the method. `None` leaves a choice to the preset, or to what the craft and the VLM can do. The default is
/// that of the program without flags.
#[derive(Clone, Debug)]
pub struct Choices {
    /// The named preset.
    pub preset: Preset,
    /// The policy.
    pub policy: PolicyKind,
    /// The rule of step lengths.
    pub step: Option<StepRule>,
    /// How primitives are flown.
    pub motion: Option<Motion>,
    /// When the next query is sent.
    pub think: Option<QueryTiming>,
    /// Whether somebody who is followed is tracked in the frames.
    pub track: Option<bool>,
    /// Obstacle mode: whether replies list obstacles.
    pub avoid: Option<bool>,
    /// Whether the envelope brakes before obstacles.
    pub brake: Option<bool>,
    /// How distances are requested.
    pub depth_as: Option<DepthAs>,
    /// Whether a second, enlarged image goes along with a query.
    pub close_up: bool,
    /// Distance from the target at which the instruction counts as fulfilled, metres.
    pub near_m: Option<f64>,
    /// Distance kept from somebody who is followed, metres.
    pub keep_m: Option<f64>,
    /// How long somebody is followed, seconds.
    pub follow_time_s: Option<f64>,
    /// Rate of setpoints, Hz.
    pub rate_hz: Option<f64>,
    /// Flight time, seconds.
    pub max_time_s: Option<f64>,
    /// Timeout of a reply, seconds.
    pub reply_timeout_s: Option<f64>,
    /// Age of a frame at its reply above which the reply moves nothing, seconds.
    pub max_reply_age_s: Option<f64>,
    /// Number of decisions, those without progress with the preset `default`.
    pub max_decisions: Option<u32>,
    /// Number of queries.
    pub max_queries: Option<u32>,
    /// What the craft does at the end.
    pub at_end: Option<AtEnd>,
    /// Whether the simulated craft has a depth sensor.
    pub depth_sensor: bool,
    /// Whether a network estimates depth.
    pub depth_network: bool,
    /// Whether a detector adds boxes to replies.
    pub detector: bool,
    /// Whether the prompt is not the built-in one.
    pub own_prompt: bool,
    /// Whether the VLM is a person.
    pub person: bool,
}

impl Default for Choices {
    fn default() -> Self {
        Self {
            preset: Preset::Default,
            policy: PolicyKind::spf(),
            step: None,
            motion: None,
            think: None,
            track: None,
            avoid: None,
            brake: None,
            depth_as: None,
            close_up: false,
            near_m: None,
            keep_m: None,
            follow_time_s: None,
            rate_hz: None,
            max_time_s: None,
            reply_timeout_s: None,
            max_reply_age_s: None,
            max_decisions: None,
            max_queries: None,
            at_end: None,
            depth_sensor: false,
            depth_network: false,
            detector: false,
            own_prompt: false,
            person: false,
        }
    }
}

/// What the method depends on besides the choices; known once the craft is.
#[derive(Clone, Copy, Debug)]
pub struct Facts {
    /// Whether sensors around the craft measure ranges.
    pub has_ranges: bool,
    /// Whether the VLM can be expected to list obstacles.
    pub lists_boxes: bool,
    /// Whether the craft flies each move by itself to its end, so that a later answer could not change it.
    pub flies_moves: bool,
    /// Whether somebody is there who may give the next instruction.
    pub is_attended: bool,
    /// Whether the flight is on the wall clock, not in virtual time.
    pub on_wall_clock: bool,
}

/// What measures the depth of what is around the craft.
fn sensed(choices: &Choices, facts: &Facts) -> Sensed {
    Sensed { depth_sensor: choices.depth_sensor, depth_network: choices.depth_network, ranges: facts.has_ranges }
}

/// The pilot's settings: those of the preset, with the choices. A function of these and the facts alone; nothing changes them
/// afterwards.
///
/// # Errors
/// A usage error for a tracker or a depth network where the craft is not led between two answers.
pub fn settings(choices: &Choices, facts: &Facts) -> Result<PilotSettings, Error> {
    let (preset, policy) = (choices.preset, choices.policy);
    let is_person = facts.on_wall_clock && choices.person;
    let mut method = PilotSettings::preset(preset);
    if let Some(step) = choices.step {
        method.step = step;
    }
    if let Some(motion) = choices.motion {
        method.motion = motion;
        // Timed primitives are the paper's queue; blended ones have no durations of their own.
        if motion == Motion::Blended {
            method.ending = Ending::Measured;
        }
    }
    let is_tracked = choices.track == Some(true);
    // The drone holds while a person thinks, unless it is to follow somebody meanwhile.
    let holds = is_person && !is_tracked;
    if let Some(think) = choices.think.or(holds.then_some(QueryTiming::Stop)) {
        method.think = think;
    }
    if facts.flies_moves {
        (method.motion, method.think) = (Motion::Manoeuvres, QueryTiming::Stop);
    }
    let sensed = sensed(choices, facts);
    let lists_boxes = preset == Preset::Default && !sensed.depth_sensor && policy == PolicyKind::spf() && !choices.own_prompt;
    method.avoid = choices.avoid.unwrap_or(lists_boxes && facts.lists_boxes) || choices.detector;
    let is_guided = method.is_guided();
    if is_tracked && !is_guided {
        return Err(Error::usage("--track needs --think continuous and --motion blended")
            .hint("leave it out with the preset paper, and with --tello-motion go"));
    }
    if sensed.depth_network && !is_guided {
        return Err(Error::usage("--depth-model is for the map, through which a craft is led between two answers")
            .hint("it needs --think continuous and --motion blended"));
    }
    method.track = choices.track.unwrap_or(policy == PolicyKind::spf() && is_guided && !is_person);
    method.method = Method::for_craft(is_guided, method.avoid, sensed);
    method.depth = choices.depth_as.unwrap_or(method.depth);
    method.close_up = choices.close_up;
    method.near_m = choices.near_m;
    method.keep_m = choices.keep_m.unwrap_or(method.keep_m);
    method.follow_time = choices.follow_time_s.map(duration_from_secs);
    method.rate_hz = choices.rate_hz.unwrap_or(method.rate_hz);
    // For as long as the battery allows.
    let otherwise = |most: Duration| if is_person { LEISURE } else { most };
    let flight_time = if preset == Preset::Default { FLIGHT_TIME } else { method.max_time };
    method.max_time = choices.max_time_s.map_or(otherwise(flight_time), duration_from_secs);
    method.reply_timeout = choices.reply_timeout_s.map_or(otherwise(method.reply_timeout), duration_from_secs);
    method.at_end = choices.at_end.or(facts.is_attended.then_some(AtEnd::Hover)).unwrap_or(method.at_end);
    method.max_reply_age = choices.max_reply_age_s.map_or(method.max_reply_age, duration_from_secs);
    count_answers(choices, &mut method);
    Ok(method)
}

/// Sets the limits on decisions and queries.
fn count_answers(choices: &Choices, method: &mut PilotSettings) {
    // The paper's flights count every decision.
    if choices.preset == Preset::Default {
        (method.counted, method.max_decisions) = (Counted::WithoutProgress, WITHOUT_PROGRESS);
        method.max_queries = Some(MAX_QUERIES);
    }
    method.max_decisions = choices.max_decisions.unwrap_or(method.max_decisions);
    method.max_queries = choices.max_queries.or(method.max_queries);
}

/// The brake of the envelope, if there is one.
#[must_use]
pub fn brake(choices: &Choices, method: &PilotSettings, facts: &Facts) -> Option<BrakeLimits> {
    let sensed = sensed(choices, facts);
    if !choices.brake.unwrap_or(sensed != Sensed::default() || method.track) {
        return None;
    }
    Some(match sensed {
        Sensed { depth_sensor: true, .. } => BrakeLimits::with_sensor(),
        Sensed { depth_network: true, .. } => BrakeLimits::with_network(),
        Sensed { .. } => BrakeLimits::without_sensor(),
    })
}
