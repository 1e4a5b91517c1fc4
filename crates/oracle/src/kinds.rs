//! Answers to kinds of query other than *Point*.

use core::fmt::Write as _;

use libm::hypot;
use serde_json::json;
use spf_core::coco;
use spf_core::detection::{Detection, MAX_DETECTIONS, write_detections};
use spf_core::query::{Mark, Query};
use spf_core::tags::Tagged;

use super::Oracle;
use super::language::item::Item;
use super::language::lexicon::{NOUNS, PHRASES};
use super::language::resolve::meant;
use super::language::score::vocabulary;
use super::language::{Phrase, Verb, parse};
use super::percept::Percept;
use super::refusal;
use super::sight::PerceivedObject;
use super::stages::{Aim, clause_of};

/// Farther than this fraction of the width from the percept's point, no candidate is chosen (`docs/explanation/oracle.md`).
const CHOOSE_WITHIN: f64 = 0.15;

/// The numbered mark nearest to the percept's point: `{"points":[n]}`; empty if none is near.
pub(super) fn choose(query: &Query, percept: &Percept, aim: &Aim) -> String {
    let (w, h) = (f64::from(percept.camera.width), f64::from(percept.camera.height));
    let nearest = aim.place.and_then(|place| {
        query
            .marks
            .iter()
            .filter_map(|mark| match mark {
                Mark::Number { at, number } => Some((hypot((at.u - place.point.u) * w, (at.v - place.point.v) * h), *number)),
                _ => None,
            })
            .filter(|(away, _)| *away <= CHOOSE_WITHIN * w)
            .min_by(|a, b| a.0.total_cmp(&b.0))
    });
    let points: Vec<u32> = nearest.into_iter().map(|(_, number)| number).collect();
    json!({ "points": points }).to_string()
}

/// `{"refuse":…,"reason":…}`.
pub(super) fn refuse(instruction: &str) -> String {
    let reason = refusal::refused(instruction);
    json!({ "refuse": reason.is_some(), "reason": reason.unwrap_or_default() }).to_string()
}

/// `{"done":…,"stage":…}`.
pub(super) fn done(aim: &Aim) -> String {
    json!({ "done": aim.done, "stage": aim.stage }).to_string()
}

/// One line per object: `name_id x:… y:… width:… height:… color:…`, as fractions of the image to two decimals. `coco`:
/// only objects of COCO classes, by class name.
pub(super) fn detect<'a>(seen: impl Iterator<Item = &'a PerceivedObject>, coco: bool) -> String {
    let mut out = String::new();
    for thing in seen {
        let b = thing.bounds;
        let Some(name) = (if coco { class(&thing.tags) } else { Some(called(&thing.tags)) }) else { continue };
        let name = name.replace(' ', "_");
        let colour = thing.tags.colour.as_deref().unwrap_or("unknown").replace(' ', "_");
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "{name}_{} x:{:.2} y:{:.2} width:{:.2} height:{:.2} color:{colour}",
            thing.id,
            0.5 * (b.left + b.right),
            0.5 * (b.top + b.bottom),
            b.right - b.left,
            b.bottom - b.top,
        );
    }
    out
}

/// The same in a detector's format: four decimals, and as score the probability of noticing the object.
pub(super) fn detect_scored<'a>(seen: impl Iterator<Item = (&'a PerceivedObject, f64)>, coco: bool) -> String {
    let found = seen.filter_map(|(thing, score)| {
        let name = if coco { class(&thing.tags)? } else { called(&thing.tags) };
        Some(Detection { name: name.to_owned(), score, area: thing.bounds })
    });
    write_detections(&found.take(MAX_DETECTIONS).collect::<Vec<_>>())
}

/// The first name of an object.
fn called(tags: &Tagged) -> &str {
    tags.names.first().unwrap_or(&tags.kind)
}

/// The COCO class of an object, by any of its names; `None` for openings, which no detector knows.
fn class(tags: &Tagged) -> Option<&str> {
    let names = tags.names.iter().chain([&tags.kind]);
    if tags.opening { None } else { names.into_iter().find_map(|name| coco::class_of(name)) }
}

/// A parsed line of a list of detections.
struct Listed {
    /// `name_id`, as used in programs.
    label: String,
    tags: Tagged,
    x: f64,
    y: f64,
    width: f64,
    height: f64,
}

fn detections(lines: &[String]) -> Vec<Listed> {
    let field =
        |line: &str, key: &str| -> Option<f64> { line.split_whitespace().find_map(|part| part.strip_prefix(key)?.parse().ok()) };
    lines
        .iter()
        .enumerate()
        .filter_map(|(index, line)| {
            let label = line.split_whitespace().next()?;
            let name = match label.rsplit_once('_') {
                Some((name, id)) if id.bytes().all(|b| b.is_ascii_digit()) => name,
                _ => label,
            };
            let colour = line.split_whitespace().find_map(|part| part.strip_prefix("color:"));
            Some(Listed {
                label: label.to_owned(),
                tags: Tagged {
                    id: u16::try_from(index + 1).ok()?,
                    key: label.to_owned(),
                    names: vec![name.replace('_', " ")],
                    colour: colour.filter(|c| *c != "unknown").map(|c| c.replace('_', " ")),
                    ..Tagged::default()
                },
                x: field(line, "x:").unwrap_or(0.5),
                y: field(line, "y:").unwrap_or(0.5),
                width: field(line, "width:").unwrap_or(0.0),
                height: field(line, "height:").unwrap_or(0.0),
            })
        })
        .collect()
}

/// The detections that a phrase may mean, largest first. Objects given as data are told by name and colour, which are all that a
/// list has.
fn listed<'a>(phrase: &Phrase, list: &'a [Listed]) -> Vec<&'a Listed> {
    let items: Vec<Item<'_>> = list
        .iter()
        .map(|d| Item {
            tags: &d.tags,
            across: Some(d.x),
            half: 0.5 * d.width,
            // The list has no ranges: the larger box counts as the nearer.
            range: Some(1.0 / d.height.max(1e-3)),
            size: Some(d.width * d.height),
            height: Some(d.height),
            position: None,
            weight: d.width * d.height,
        })
        .collect();
    let mut found: Vec<&Listed> = match &phrase.told {
        Some(told) => {
            let is = |d: &&Listed| told.appearances.iter().any(|own| own.fits(called(&d.tags), d.tags.colour.as_deref()));
            list.iter().filter(is).collect()
        }
        None => meant(phrase, &items).into_iter().map(|i| &list[i]).collect(),
    };
    found.sort_by(|a, b| (b.width * b.height).total_cmp(&(a.width * a.height)));
    found
}

/// A MiniSpec program for the current part of the instruction: turn to its target and approach it, or search if it is
/// not listed. The planner takes typical object sizes into account: a large object that fills half the image is still
/// far away.
pub(super) fn program(oracle: &Oracle, query: &Query) -> String {
    let list = detections(&query.detections);
    let instruction = match &oracle.brief {
        Some(brief) => brief.instruction(),
        None => parse(&query.instruction, &vocabulary(list.iter().map(|d| &d.tags))),
    };
    let Some(clause) = instruction.clauses.get(clause_of(&instruction, query.memory.stage)) else { return "->False;".to_owned() };
    let Some(found) = listed(&clause.target, &list).first().copied() else {
        return if clause.target.nouns.is_empty() {
            "8{tc(45);}->True;".to_owned()
        } else {
            format!("_1=s('{}');?_1==False{{->False;}}rp;", wanted(&clause.target))
        };
    };
    let name = &found.label;
    let mut out = format!("o('{name}');");
    if found.y > LOW {
        out.push_str("md(100);");
    } else if found.y < HIGH {
        out.push_str("mu(100);");
    }
    if clause.verb == Verb::Through && found.height > 0.5 {
        out.push_str(ON_THROUGH);
    } else if found.height > 0.5 {
        out.push_str(if is_large(name) { "mf(200);" } else { "mf(60);" });
    } else {
        let _ = write!(out, "_1=a('{name}');?_1==False{{rp;}}");
    }
    out.push_str("->True;");
    out
}

/// A box centred lower than this in the image requires a descent …
const LOW: f64 = 0.65;
/// … and one centred higher than this a climb.
const HIGH: f64 = 0.3;
/// Straight through an opening: 36 m, in steps short enough for the list to stay valid for a craft at 3 m/s.
const ON_THROUGH: &str = "12{mf(300);}";

/// Whether the name is that of an object taller than a house.
fn is_large(label: &str) -> bool {
    label.split('_').any(|part| NOUNS.large.contains(part))
}

/// The search target, in the vocabulary of lists.
fn wanted(phrase: &Phrase) -> String {
    // Of several colours none is asked for.
    let told = phrase
        .told
        .iter()
        .flat_map(|told| &told.appearances)
        .map(|own| own.colour.as_deref())
        .reduce(|a, b| a.filter(|_| a == b));
    let words: Vec<&str> =
        told.flatten().into_iter().chain(phrase.colours.iter().chain(&phrase.nouns).map(String::as_str)).collect();
    words.join(" ").replace('\'', "")
}

/// Answers a question about the list: how many, is there, which one. Questions that the list cannot answer give
/// `False`.
pub(super) fn question(text: &str, lines: &[String]) -> String {
    let list = detections(lines);
    let requested = text.to_lowercase();
    let phrase = parse(&strip_question(&requested), &vocabulary(list.iter().map(|d| &d.tags)))
        .clauses
        .into_iter()
        .next_back()
        .map(|c| c.target)
        .unwrap_or_default();
    let found = listed(&phrase, &list);
    if requested.trim_start().starts_with("how many") {
        found.len().to_string()
    } else if ["is ", "are ", "do ", "does ", "can "].iter().any(|start| requested.trim_start().starts_with(start)) {
        if found.is_empty() { "False" } else { "True" }.to_owned()
    } else {
        found.first().map_or_else(|| "False".to_owned(), |d| d.label.clone())
    }
}

/// The noun phrase of a question.
fn strip_question(text: &str) -> String {
    let mut rest = text.trim().trim_end_matches('?');
    for start in &PHRASES.question_starts {
        if let Some(after) = rest.strip_prefix(start.as_str()) {
            rest = after.trim_start();
        }
    }
    for end in &PHRASES.question_ends {
        rest = rest.trim_end().strip_suffix(end.as_str()).unwrap_or(rest);
    }
    format!("find {rest}")
}
