//! Display text for outcomes, phases and decisions, in one place.

use std::fmt::Display;

use spf_core::reply::{Look, Status};
use spf_pilot::{Around, Decision, LetGo, Note, OperatorEvent, Outcome, Passage, Phase};
use spf_space::avoid::Avoidance;
use spf_vlm::ORACLE_SERVED;
use spf_vlm::human::HUMAN;

use crate::ledger::VlmUse;

/// Display text of an outcome.
#[must_use]
pub fn outcome(outcome: Outcome) -> &'static str {
    match outcome {
        Outcome::Reached => "reached",
        Outcome::NotFound => "not found",
        Outcome::Timeout => "timeout",
        Outcome::Collision => "collision",
        Outcome::Aborted => "aborted",
        Outcome::Failed => "failed",
    }
}

/// Display text of a phase.
#[must_use]
pub fn phase(phase: Phase) -> &'static str {
    match phase {
        Phase::Ground => "on the ground",
        Phase::TakeOff => "taking off",
        Phase::Flying => "flying",
        Phase::Held => "held",
        Phase::Manual => "under manual control",
        Phase::Hovering => "hovering",
        Phase::Returning => "returning home",
        Phase::Landing => "landing",
        Phase::Ended => "ended",
    }
}

/// Display text of an operator input.
#[must_use]
pub fn operator(event: &OperatorEvent) -> String {
    match event {
        OperatorEvent::Hold => "hold".to_owned(),
        OperatorEvent::Resume => "resume".to_owned(),
        OperatorEvent::Setpoint(_) => "setpoint".to_owned(),
        OperatorEvent::Instruction(text) => format!("new instruction \"{text}\""),
        OperatorEvent::KeepOut(places) if places.is_empty() => "no places to keep out of".to_owned(),
        OperatorEvent::KeepOut(places) => {
            format!("keep out of {}", counted(places.len(), "marked place"))
        }
        OperatorEvent::Land => "land".to_owned(),
        OperatorEvent::Left => "left the controls, hold".to_owned(),
        OperatorEvent::Abandoned => "away from the controls for long, land".to_owned(),
        OperatorEvent::CutMotors => "cut the motors".to_owned(),
    }
}

/// Display text of who has a craft that does not fly by our commands any more.
#[must_use]
pub fn let_go(news: LetGo) -> &'static str {
    match news {
        LetGo::Somebody => "somebody else has control: nothing is sent until you resume (T)",
        LetGo::Failsafe => "the craft's own failsafe holds it since the link was lost: T flies on, L lands",
        LetGo::Nobody => "the craft's own failsafe holds it since the link was lost, and nobody is here to decide: landing",
        LetGo::NotLanded => "not landed by us: somebody else has control",
    }
}

/// Display text of a detour.
#[must_use]
pub fn around(around: &Around) -> String {
    let side = match around.side {
        Passage::Left => "around the left of",
        Passage::Right => "around the right of",
        Passage::Over => "over",
        Passage::Under => "under",
    };
    format!("{side}: {}", around.name.as_deref().unwrap_or("an obstacle"))
}

/// Display text of a report of the pilot, one line.
#[must_use]
pub fn note(note: &Note) -> String {
    match note {
        Note::Phase(now) => phase(*now).to_owned(),
        Note::Decision(made) => format!("{}. {}", made.number, decision(made)),
        Note::Envelope(cause) => format!("envelope: {cause}"),
        Note::Around(detour) => around(detour),
        Note::Limited(why) => (*why).to_owned(),
        Note::LateReply(id) => format!("the reply to query {} came too late and is ignored", id.0),
        Note::QueryFailed { reason, .. } => format!("no usable reply: {reason}"),
        Note::LetGo(news) => let_go(*news).to_owned(),
        Note::Operator(event) => format!("operator: {}", operator(event)),
        Note::OperatorIgnored(event, why) => format!("operator: {} ignored: {why}", operator(event)),
    }
}

/// Display text of a direction in which to look.
#[must_use]
pub fn look(look: Look) -> &'static str {
    match look {
        Look::Left => "left",
        Look::Right => "right",
        Look::Up => "up",
        Look::Down => "down",
        Look::Behind => "behind",
        Look::Ahead => "ahead",
    }
}

/// Display text of a decision, one line: target, point, depth label, step, primitives.
#[must_use]
pub fn decision(decision: &Decision) -> String {
    let reading = &decision.reading;
    if let Some(refused) = &reading.refused {
        return format!("reply refused: {refused}");
    }
    let mut line = match &reading.reply {
        Some(reply) => match reply.status {
            Status::Done if decision.step == "look" => "done reported: holding to confirm".to_owned(),
            Status::Done => "done".to_owned(),
            Status::NotVisible if decision.step == "keep" => "not visible, goes on to its estimated position".to_owned(),
            Status::NotVisible => match reply.look {
                Some(way) => format!("not visible, search {}", look(way)),
                None => "not visible".to_owned(),
            },
            Status::Waiting => "waits: somebody passes first".to_owned(),
            Status::Blocked => "blocked".to_owned(),
            Status::Navigating | Status::Following => {
                let target = reply.target.as_deref().unwrap_or("target");
                let stage = reply.stage.filter(|stage| *stage > 1).map_or(String::new(), |stage| format!(" (stage {stage})"));
                let point = reading.waypoint.or(reply.point).map_or(String::new(), |p| format!(" at ({:.2}, {:.2})", p.u, p.v));
                let depth = reply.depth.map_or(String::new(), |depth| format!(", depth label {depth}"));
                let step = reading.step.map_or(String::new(), |step| format!(", step {step:.2} m"));
                format!("{target}{stage}{point}{depth}{step}")
            }
        },
        None => reading.actions.join(", "),
    };
    match reading.avoidance {
        None | Some(Avoidance::Clear) => {}
        Some(Avoidance::Shifted { .. }) => line.push_str(", shifted clear of an obstacle"),
        Some(Avoidance::Shortened { .. }) => line.push_str(", shortened before an obstacle"),
        Some(Avoidance::Hold) => line.push_str(", path blocked"),
    }
    let held = matches!(reading.avoidance, Some(Avoidance::Hold));
    if reading.waypoint.is_some() && reading.step.is_none() && reading.primitives.is_some() && !held {
        line.push_str(", yaw first");
    }
    if decision.passed {
        line.push_str(" → already passed, yaw only");
    } else if let Some(anchor) = decision.anchor.as_ref().filter(|_| decision.step == "goto") {
        // What is flown follows from all replies so far, not from the step of this one.
        line.push_str(&format!(" → target estimated {:.1} ± {:.1} m away", anchor.sight.range, anchor.sight.range_sd));
    } else if let Some(p) = &reading.primitives {
        let mut parts = Vec::new();
        if p.yaw.abs() > 0.005 {
            parts.push(format!("yaw {:+.0}°", p.yaw.to_degrees()));
        }
        for (name, metres) in [("forward", p.forward), ("right", p.right), ("climb", p.climb)] {
            if metres.abs() >= 0.005 {
                parts.push(format!("{name} {metres:+.2} m"));
            }
        }
        if !parts.is_empty() {
            line.push_str(&format!(" → {}", parts.join(", ")));
        }
    } else if reading.reply.is_some() && !reading.actions.is_empty() {
        // Nothing is flown: what is done instead.
        line.push_str(&format!(": {}", reading.actions.join("; ")));
    }
    line
}

/// Display text of VLM usage, one line.
#[must_use]
pub fn vlm_use(used: &VlmUse) -> String {
    let models: Vec<&str> = used.models.keys().map(String::as_str).collect();
    let names = if models.is_empty() { "none".to_owned() } else { models.join(", ") };
    let failed: u32 = used.failed.values().sum();
    let failed = if failed > 0 { format!(" ({failed} failed)") } else { String::new() };
    let latency = used.median_latency_s.map_or(String::new(), |seconds| format!(", median {seconds:.2} s"));
    let about = if used.tokens_estimated { "about " } else { "" };
    let is_oracle = !models.is_empty() && models.iter().all(|model| *model == ORACLE_SERVED);
    if is_oracle {
        return format!("VLM: the oracle of a server (no real VLM, free of charge), {} queries{failed}{latency}", used.questions);
    }
    // A person in the cockpit and the oracle cost nothing, and read no tokens.
    let is_free = |model: &&str| *model == HUMAN || *model == "oracle" || model.starts_with("oracle:");
    if !models.is_empty() && models.iter().all(is_free) {
        return format!("VLM: {names}, {} queries{failed}{latency}", used.questions);
    }
    let cost = used.cost_usd.map_or("price unknown".to_owned(), |cost| format!("{about}${cost:.4}"));
    format!(
        "VLM: {names}, {} queries{failed}{latency}, {about}{} tokens in, {} out, {} thinking, {cost}",
        used.questions, used.tokens_in, used.tokens_out, used.tokens_thinking
    )
}

/// A number of things, with the plural where it belongs.
#[must_use]
pub fn counted<N: Display + PartialEq + From<u8>>(number: N, what: &str) -> String {
    format!("{number} {what}{}", if number == N::from(1) { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_oracle_behind_a_server_has_no_price() {
        let used = |model: &str, cost_usd| VlmUse {
            questions: 3,
            models: [(model.to_owned(), 3)].into(),
            cost_usd,
            ..VlmUse::default()
        };
        let oracle = vlm_use(&used(ORACLE_SERVED, Some(0.0)));
        assert!(oracle.starts_with("VLM: the oracle of a server") && !oracle.contains('$'), "{oracle}");
        assert!(vlm_use(&used("gpt-6-luna", Some(0.5))).ends_with("$0.5000"));
        assert!(vlm_use(&used("gpt-6-luna", None)).ends_with("price unknown"));
        assert_eq!(vlm_use(&used(HUMAN, None)), "VLM: human, 3 queries");
    }
}
