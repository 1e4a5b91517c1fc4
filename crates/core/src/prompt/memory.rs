//! The history in sentences. Each states one event or measurement, so that none can be false; where the
//! target of an ended stage is now is reckoned from such. A test reads the prompts of whole
//! flights and checks every sentence against them (`crates/bench/tests/all/sentences.rs`).

use crate::grounding::GroundingProfile;
use crate::query::{DetourKind, FinishedPlace, Look, LostTarget, Memory, Motion, PastAnswer, ReckonedRange, Said, VerticalRoom};
use crate::reply::one_line;

/// Motions below this are not mentioned, metres and degrees.
const WORTH_TELLING_M: f64 = 0.1;
const WORTH_TELLING_DEG: f64 = 2.0;
/// Something less far above or below the horizon counts as level, degrees.
const WORTH_TELLING_SLOPE_DEG: f64 = 15.0;
/// A climb below this is not distinguished from the motion, metres.
const WORTH_TELLING_CLIMB_M: f64 = 0.3;
/// A turn that is planned this differently from what was asked for is told, degrees.
const OTHER_TURN_DEG: f64 = 5.0;
/// A motion this far off the heading is told to lead to a side, and this far off backwards, degrees.
const ASIDE_DEG: f64 = 45.0;
const BACKWARDS_DEG: f64 = 135.0;
/// More room than this upwards is not worth telling, metres.
const FAR_UP_M: f64 = 20.0;
/// What was flown since the last image is told if it differs by this from what was flown since its answer, metres.
const MORE_M: f64 = 0.2;
/// Number of answers in a row that end in nothing, after which the prompt says what else can be answered.
const BLOCKED_OFTEN: u32 = 2;

/// The history, one event a line, with marked boxes in the coordinates of `profile`. Points of earlier answers are told as directions:
/// numbers would be repeated (small models answer the point of their history again).
pub(super) fn remembered(memory: &Memory, profile: &GroundingProfile) -> String {
    let mut lines = vec![format!("Stage {} is being worked on.", memory.stage.max(1))];
    for finished in &memory.finished {
        let target = finished.target.as_deref().map_or(String::new(), |target| format!(", target {}", quoted(target)));
        let place = finished.place.as_ref().map_or(String::new(), whereabouts);
        lines.push(format!("Stage {} ended with your answer {}{target}.{place}", finished.stage, ago(finished.answers_ago)));
    }
    let count = memory.answers.len() as u32;
    lines.extend((1..=count).rev().zip(&memory.answers).map(|(number, past)| answer(number, past)));
    lines.extend(since_image(memory));
    lines.extend(memory.lost.as_ref().map(lost));
    if let Some(turned) = memory.searched_deg.filter(|turned| turned.abs() >= WORTH_TELLING_DEG) {
        lines.push(format!(
            "You have not seen its target yet; the drone has turned {} {} in all.",
            degrees(turned),
            side(turned)
        ));
    }
    lines.extend(memory.room.as_ref().map(room));
    for area in &memory.kept_out {
        let area = profile.area_numbers(*area).map(|number| number.to_string()).join(", ");
        lines.push(format!(
            "The operator has marked the place in the box [{area}]: the drone keeps away from it, and flies around."
        ));
    }
    if memory.blocked >= BLOCKED_OFTEN {
        lines.push(format!(
            "You have answered \"blocked\" {} times in a row. If it is still so, give an open_way; \"waiting\" is for somebody who moves, \
             \"navigating\" for a way that is free now.",
            memory.blocked
        ));
    }
    if let Some(ReckonedRange { range_m, sd_m, near_m }) = memory.reckoned {
        lines.push(format!(
            "By all your answers the target is {} ± {} m away; within {} m counts.",
            metres(range_m),
            metres(sd_m),
            metres(near_m)
        ));
    }
    if let Some(wrong) = &memory.refused {
        lines.push(format!("Your last answer {}.", one_line(wrong)));
    }
    lines.join("\n")
}

fn room(room: &VerticalRoom) -> String {
    let (height, down, up) = (metres(room.height.abs()), metres(room.down), metres(room.up));
    let side = if room.height < 0.0 && height > 0.0 { "below" } else { "above" };
    let error = room.error.map_or(String::new(), |error| format!(" ± {}", metres(error)));
    let up = if up > FAR_UP_M { String::new() } else { format!(", {up} m higher") };
    format!("It is about {height}{error} m {side} take-off, and can go {down} m lower{up}.")
}

fn answer(number: u32, past: &PastAnswer) -> String {
    let target = past.target.as_deref().map_or_else(|| "the target".to_owned(), quoted);
    let asked = past.asked_deg.filter(|asked| asked.abs() >= WORTH_TELLING_DEG);
    let turn = asked.map_or(String::new(), |asked| format!("{} {}", degrees(asked), side(asked)));
    let said = match past.said {
        Said::Pointed => {
            let at = past.bearing_deg.map_or(String::new(), |bearing| format!(" {}", direction(bearing)));
            let range = past.range_m.map_or(String::new(), |range| format!(", about {} m", metres(range)));
            format!("{target}{at}{range}")
        }
        Said::Turn if turn.is_empty() => format!("you saw {target} and asked for a turn of less than {WORTH_TELLING_DEG}°"),
        Said::Turn => format!("you saw {target} and asked for a turn of {turn}"),
        Said::NotSeen if turn.is_empty() => format!("you did not see {target}"),
        Said::NotSeen => format!("you did not see {target}, and asked for a turn of {turn}"),
        Said::Done => "you answered \"done\"".to_owned(),
        Said::Waiting => "you answered \"waiting\"".to_owned(),
        Said::Blocked => "you answered \"blocked\"".to_owned(),
    };
    let other = past.planned_deg.filter(|planned| asked.is_some_and(|asked| (planned - asked).abs() > OTHER_TURN_DEG));
    let other = other.map_or(String::new(), |planned| format!("; {} {} planned", degrees(planned), side(planned)));
    let detour = past.detour.as_ref().map_or(String::new(), |detour| {
        let how = match detour.how {
            DetourKind::Left => "dodged to the left",
            DetourKind::Right => "dodged to the right",
            DetourKind::Up => "dodged upwards",
            DetourKind::Down => "dodged downwards",
            DetourKind::Shortened => "cut short",
            DetourKind::Held => "held back",
        };
        let because = detour.name.as_deref().map_or(String::new(), |name| format!(" because of {}", quoted(name)));
        let seen = detour.seen_before_s.map_or(String::new(), |s| format!(", seen {} s before", libm::round(s).max(1.0)));
        let walks = if detour.walks { ", who walks there" } else { "" };
        format!("; {how}{because}{seen}{walks}")
    });
    let actions: String = past.actions.iter().map(|action| format!("; {action}")).collect();
    // The motion after the last one goes on.
    let then = if number == 1 { "so far" } else { "then" };
    let motion = past.motion.map_or(String::new(), |motion| format!("; {then} {}", flown(&motion)));
    format!("{}: {said}{other}{detour}{actions}{motion}.", ago(number))
}

/// A motion in words.
fn flown(motion: &Motion) -> String {
    let mut parts = Vec::new();
    if motion.moved_m >= WORTH_TELLING_M {
        let climbed = motion.climbed_m;
        let of_it = if climbed.abs() >= WORTH_TELLING_CLIMB_M {
            format!(" ({} m {})", metres(climbed.abs()), if climbed > 0.0 { "up" } else { "down" })
        } else {
            String::new()
        };
        let toward = match motion.toward_deg.unwrap_or_default() {
            toward if toward.abs() >= BACKWARDS_DEG => " backwards".to_owned(),
            toward if toward.abs() >= ASIDE_DEG => format!(" to the {}", side(toward)),
            _ => String::new(),
        };
        parts.push(format!("{} m flown{toward}{of_it}", metres(motion.moved_m)));
    }
    if motion.turned_deg.abs() >= WORTH_TELLING_DEG {
        parts.push(format!("{} turned {}", degrees(motion.turned_deg), side(motion.turned_deg)));
    }
    if parts.is_empty() { "no motion".to_owned() } else { parts.join(", ") }
}

/// What was flown since the last image, if that is more than what was flown since its answer: what one sees of it, where the craft
/// flies on while it asks.
fn since_image(memory: &Memory) -> Option<String> {
    let (since, last) = (memory.since_image?, memory.answers.last()?.motion.unwrap_or_default());
    let is_more = (since.moved_m - last.moved_m).abs() >= MORE_M || (since.turned_deg - last.turned_deg).abs() >= OTHER_TURN_DEG;
    is_more.then(|| format!("Since your last image: {}.", flown(&since)))
}

fn lost(lost: &LostTarget) -> String {
    let mut text = format!("You last pointed at the target {}.", ago(lost.answers_ago));
    match lost.left_on {
        Some(Look::Left) => text.push_str(" It then left the image on the left."),
        Some(Look::Right) => text.push_str(" It then left the image on the right."),
        _ => {}
    }
    if lost.turned_deg.abs() >= WORTH_TELLING_DEG {
        text.push_str(&format!(" Since then the drone has turned {} {}.", degrees(lost.turned_deg), side(lost.turned_deg)));
    }
    let where_now = direction(lost.bearing_deg);
    let shown = if lost.in_frame { "in this image's width" } else { "outside this image" };
    text.push_str(&format!(" That direction is now {where_now}, {shown}."));
    text
}

/// Where the target of an ended stage is.
fn whereabouts(place: &FinishedPlace) -> String {
    let elevation = place.elevation_deg;
    let slope = match elevation.abs() >= WORTH_TELLING_SLOPE_DEG {
        true => format!(", {} {} the horizon", degrees(elevation), if elevation < 0.0 { "below" } else { "above" }),
        false => String::new(),
    };
    let outside = if place.area.is_some() { "" } else { ", outside this image" };
    format!(" It is now about {} m away, {}{slope}{outside}.", metres(place.range_m), direction(place.bearing_deg))
}

/// How long ago an answer was, of which the last one has number 1.
fn ago(number: u32) -> String {
    match number {
        0 | 1 => "1 answer ago".to_owned(),
        number => format!("{number} answers ago"),
    }
}

fn direction(bearing: f64) -> String {
    if bearing.abs() < WORTH_TELLING_DEG {
        "straight ahead".to_owned()
    } else {
        format!("{} {}", degrees(bearing), side(bearing))
    }
}

fn side(turn: f64) -> &'static str {
    if turn > 0.0 { "right" } else { "left" }
}

fn degrees(turn: f64) -> String {
    format!("{}°", libm::round(turn.abs()))
}

/// About two significant figures, which is what such a distance is good for.
fn metres(distance: f64) -> f64 {
    let distance = distance.max(0.0);
    if distance < 9.95 { libm::round(distance * 10.0) / 10.0 } else { libm::round(distance) }
}

/// A name given by a model: in quotation marks, on one line.
pub(super) fn quoted(name: &str) -> String {
    format!("\"{}\"", one_line(name).replace('"', "'"))
}
