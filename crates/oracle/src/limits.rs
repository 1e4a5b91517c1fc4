//! Limits within the words of an instruction: "not higher than 5 metres", "slowly" (docs/guide/fly.md, "Limits within the words").
//!
//! They are read whatever model flies, and only tighten the envelope or the approach. What is understood and cannot be kept, because
//! nothing on board measures it, is named instead.

use std::sync::LazyLock;

use regex_lite::{Captures, Regex};
use serde::Deserialize;

/// What an instruction demands besides its target.
#[derive(Clone, Debug, PartialEq)]
pub struct LimitWords {
    /// The words, as written.
    pub words: String,
    /// What they demand.
    pub demand: Demand,
}

/// A demand within the words of an instruction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Demand {
    /// At most this high, metres above the take-off point.
    Height(f64),
    /// At most this fast, metres per second.
    Speed(f64),
    /// Slower than usual.
    Slow,
    /// As fast as possible, which is no limit.
    Fast,
    /// At most this far from the take-off point, metres.
    Distance(f64),
    /// At most this long, seconds.
    Time(f64),
    /// At least this far from the target's surface, metres.
    StandOff(f64),
    /// Clear of obstacles.
    Obstacles,
    /// Something that nothing on board measures, in words that complete "the drone does not measure …".
    Unmeasured(&'static str),
}

/// `limits.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    parts: std::collections::BTreeMap<String, String>,
    rule: Vec<Row>,
    refused: Vec<Refused>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    limit: String,
    /// What stays in the place of the words; nothing if absent.
    #[serde(default)]
    keeps: String,
    patterns: Vec<String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Refused {
    why: String,
    /// What stays in the place of the words; nothing if absent.
    #[serde(default)]
    keeps: String,
    patterns: Vec<String>,
}

/// What found words demand; `None` if a number in them is none.
type Demanded = dyn Fn(&Captures<'_>) -> Option<Demand> + Send + Sync;

struct Rule {
    pattern: Regex,
    keeps: String,
    demand: Box<Demanded>,
}

static RULES: LazyLock<Vec<Rule>> = LazyLock::new(|| {
    let file: File = toml::from_str(include_str!("limits.toml")).expect("the embedded lists are valid; a test reads them");
    let whole = |pattern: &str| {
        let filled = (0..3).fold(pattern.to_owned(), |text, _| {
            file.parts.iter().fold(text, |text, (name, part)| text.replace(&format!("{{{name}}}"), part))
        });
        // The small words before a limit belong to it: "but", "and please".
        let text = format!(
            r"(?i)(?:\b(?:but|and|though|while|please|just|always|also)\s+)*\b(?:{filled})(?:\b|$)(?:\s+(?:though|please|thanks)\b)*"
        );
        Regex::new(&text).expect("the embedded patterns are valid; a test reads them")
    };
    let limits = file.rule.iter().flat_map(|row| row.patterns.iter().map(move |pattern| (row, pattern)));
    let limits = limits.map(|(row, pattern)| {
        let limit = row.limit.clone();
        let demand = Box::new(move |found: &Captures<'_>| demanded(&limit, found));
        Rule { pattern: whole(pattern), keeps: row.keeps.clone(), demand }
    });
    let refused = file.refused.iter().flat_map(|row| row.patterns.iter().map(move |pattern| (row, pattern)));
    let refused = refused.map(|(row, pattern)| {
        let why: &'static str = String::leak(row.why.clone());
        Rule { pattern: whole(pattern), keeps: row.keeps.clone(), demand: Box::new(move |_| Some(Demand::Unmeasured(why))) }
    });
    limits.chain(refused).collect()
});

/// The limits in an instruction, in the order of the rules, and the instruction without their words.
#[must_use]
pub fn limits(instruction: &str) -> (Vec<LimitWords>, String) {
    let mut rest = instruction.to_owned();
    let mut found = Vec::new();
    for rule in &*RULES {
        // Each finds a few places at most; what it takes out it does not find again.
        while let Some(captures) = rule.pattern.captures(&rest)
            && let Some(demand) = (rule.demand)(&captures)
            && let Some(whole) = captures.get(0)
            && found.len() < MOST
        {
            let mut range = whole.range();
            let mut demand = demand;
            if matches!(demand, Demand::Unmeasured(_)) {
                range.end = range.start + first_part(&rest[range.clone()]).len();
            }
            // "Keep 5 m away from the bus": the target, if it was named before.
            if matches!(demand, Demand::StandOff(_))
                && rule.keeps.is_empty()
                && let Some(from) = FROM.find(&rest[range.end..])
            {
                if !is_named_before(from.as_str(), &rest[..range.start]) {
                    demand = Demand::Unmeasured("the distance to anything but the target");
                }
                range.end += from.end();
            }
            found.push(LimitWords { words: rest[range.clone()].trim().to_owned(), demand });
            // The words before and after do not become neighbours: "the bus slowly, then" is no "bus then".
            let keeps = if rule.keeps.is_empty() { " " } else { rule.keeps.as_str() };
            rest.replace_range(range, keeps);
        }
    }
    (found, rest)
}

/// Why an instruction to land on something is refused, as in `limits.toml`.
pub const LANDING_ON: &str = "on what it lands: it lands below where the flight ends";

/// Where an instruction keeps a distance from its target, within this multiple of it the target is near.
pub const NEAR_STAND_OFF: f64 = 1.6;

/// The distance that an instruction keeps from its target, metres; `None` if it demands none.
#[must_use]
pub fn stand_off(instruction: &str) -> Option<f64> {
    let demanded = limits(instruction).0.into_iter().filter_map(|limit| match limit.demand {
        Demand::StandOff(metres) => Some(metres),
        _ => None,
    });
    demanded.reduce(f64::max)
}

/// The part of words before the next action: "avoid the trees" of "avoid the trees and fly to the bus".
fn first_part(words: &str) -> &str {
    // Behind the conjunction with which the part itself may begin.
    let begun = words.find(' ').unwrap_or(0) + 1;
    let end = [" and ", " then ", " but "].iter().filter_map(|next| words.get(begun..)?.to_lowercase().find(next)).min();
    end.and_then(|end| words.get(..begun + end)).unwrap_or(words)
}

/// From what a distance is kept, behind it.
static FROM: LazyLock<Regex> = LazyLock::new(|| Regex::new(r"(?i)^\s+(?:from|of|to)\b[^,.;]*").expect("a test reads it"));

/// Whether the last word was said before: what is meant by it is the target.
fn is_named_before(from: &str, before: &str) -> bool {
    let words = |text: &str| text.to_lowercase().split(|c: char| !c.is_alphanumeric()).map(str::to_owned).collect::<Vec<_>>();
    let named = words(from).into_iter().rfind(|word| !word.is_empty());
    named.is_some_and(|named| words(before).contains(&named))
}

/// Maximum number of limits of an instruction; real ones have one or two.
const MOST: usize = 12;

fn demanded(limit: &str, found: &Captures<'_>) -> Option<Demand> {
    let value = || Some(number(found.name("n")?.as_str())? * unit(found.name("u")?.as_str())?);
    Some(match limit {
        "height" => Demand::Height(value()?),
        "speed" => Demand::Speed(value()?),
        "slow" => Demand::Slow,
        "fast" => Demand::Fast,
        "distance" => Demand::Distance(value()?),
        "time" => Demand::Time(value()?),
        "stand-off" => Demand::StandOff(value()?),
        "obstacles" => Demand::Obstacles,
        _ => return None,
    })
}

fn number(text: &str) -> Option<f64> {
    const WORDS: [(&str, f64); 21] = [
        ("a", 1.0),
        ("an", 1.0),
        ("half a", 0.5),
        ("half an", 0.5),
        ("one", 1.0),
        ("two", 2.0),
        ("three", 3.0),
        ("four", 4.0),
        ("five", 5.0),
        ("six", 6.0),
        ("seven", 7.0),
        ("eight", 8.0),
        ("nine", 9.0),
        ("ten", 10.0),
        ("twelve", 12.0),
        ("fifteen", 15.0),
        ("twenty", 20.0),
        ("thirty", 30.0),
        ("forty", 40.0),
        ("fifty", 50.0),
        ("hundred", 100.0),
    ];
    let lower = text.to_lowercase();
    let word = WORDS.iter().find(|(word, _)| *word == lower).map(|(_, value)| *value);
    word.or_else(|| lower.replace(',', ".").parse().ok()).filter(|value: &f64| value.is_finite() && *value > 0.0)
}

/// In metres, metres per second or seconds.
fn unit(text: &str) -> Option<f64> {
    let lower = text.to_lowercase();
    Some(match lower.as_str() {
        "ft" | "feet" | "foot" => 0.3048,
        "km/h" | "kmh" | "kph" => 1.0 / 3.6,
        "mph" => 0.44704,
        unit if unit.starts_with("min") => 60.0,
        _ => 1.0,
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn limits_are_read_and_taken_out() {
        for (text, words, demand, rest) in [
            ("go to the church, no higher than 5 metres", "no higher than 5 metres", Demand::Height(5.0), "go to the church"),
            (
                "Don't climb above 20 m and go to the church",
                "Don't climb above 20 m",
                Demand::Height(20.0),
                "and go to the church",
            ),
            (
                "fly to the cactus and keep it low, under one metre.",
                "under one metre",
                Demand::Height(1.0),
                "fly to the cactus and keep it low",
            ),
            ("slowly fly to the bus", "slowly", Demand::Slow, "fly to the bus"),
            ("fly to the bus, nice and slow", "nice and slow", Demand::Slow, "fly to the bus"),
            ("fly to the bus as quickly as possible", "as quickly as possible", Demand::Fast, "fly to the bus"),
            ("fly to the bus, not too fast", "not too fast", Demand::Slow, "fly to the bus"),
            ("fly to the bus at most 2 km/h", "at most 2 km/h", Demand::Speed(2.0 / 3.6), "fly to the bus"),
            (
                "find the bus but not further than 40 m from here",
                "but not further than 40 m from here",
                Demand::Distance(40.0),
                "find the bus",
            ),
            ("reach the bus within two minutes", "within two minutes", Demand::Time(120.0), "reach the bus"),
            (
                "go to the bus but stay at least 15 metres away from it",
                "but stay at least 15 metres away from it",
                Demand::StandOff(15.0),
                "go to the bus",
            ),
            ("go to the bus, keep 5 metres away", "keep 5 metres away", Demand::StandOff(5.0), "go to the bus"),
            (
                "go to the bus and don't get closer than 10 feet",
                "and don't get closer than 10 feet",
                Demand::StandOff(3.048),
                "go to the bus",
            ),
            (
                "go to the bus but stay 4 m away from the bus",
                "but stay 4 m away from the bus",
                Demand::StandOff(4.0),
                "go to the bus",
            ),
            ("stop 3 m in front of the bus", "stop 3 m in front of", Demand::StandOff(3.0), "stop in front of the bus"),
            ("go to the bus avoiding all obstacles", "avoiding all obstacles", Demand::Obstacles, "go to the bus"),
            ("go to the bus without hitting anything", "without hitting anything", Demand::Obstacles, "go to the bus"),
        ] {
            let (found, left) = limits(text);
            assert_eq!(found, [LimitWords { words: words.to_owned(), demand }], "{text}");
            let left = left.split_whitespace().collect::<Vec<_>>().join(" ").trim_end_matches([' ', ',', '.']).to_owned();
            assert_eq!(left, rest, "{text}");
        }
    }

    #[test]
    fn what_nothing_measures_is_named() {
        for (text, why) in [
            ("go to the fountain and dont fly over anybody's head", "below"),
            ("go to the fountain without crossing the road", "below"),
            ("circle the fountain and keep the camera on it the whole time", "camera"),
            ("go to the bus, keep me in view", "camera"),
            ("go to the bus at a height of 4 m", "exact height"),
            ("hover 3 metres above the ground at the bus", "exact height"),
            ("go to the bus, never lower than 3 m", "lowest height"),
            ("go to the duck without scaring it", "disturbs"),
            ("go to the bus, keep to the left of the road", "side"),
            ("go to the sofa. Stay at least 1 meter away from anyone you meet", "distance to anything"),
            ("go to the bus, avoid the trees", "distance to anything"),
            ("go to the desk and land on it", LANDING_ON),
            ("go near the pond but avoid the trees and fly to the bus", "distance to anything"),
        ] {
            let (found, rest) = limits(text);
            assert!(
                matches!(&found[..], [LimitWords { demand: Demand::Unmeasured(said), .. }] if said.contains(why)),
                "{text}: {found:?}"
            );
            assert!(
                text.contains("pond but") == rest.contains("and fly to the bus") && rest.starts_with("go")
                    || rest.starts_with("circle")
                    || rest.starts_with("hover"),
                "{rest}"
            );
        }
    }

    #[test]
    fn what_names_a_thing_is_no_limit() {
        for text in [
            "fly over the bridge",
            "go to the far end",
            "go around the pond",
            "fly to the second house on the left",
            "fly under the bridge",
            "fly to the person without a hat",
            "the car not next to the van",
            "find something to sit on",
            "no, go to the church",
        ] {
            assert_eq!(limits(text), (vec![], text.to_owned()));
        }
    }

    proptest! {
        #[test]
        fn no_text_panics(text in "\\PC{0,300}") {
            let _ = limits(&text);
        }

        #[test]
        fn any_order_of_words_of_limits_ends(words in proptest::collection::vec(proptest::sample::select(vec![
            "not", "higher", "than", "5", "m", "slowly", "keep", "away", "from", "it", "the", "bus", ",", "over", "stay", "within",
        ]), 0..24)) {
            let (found, rest) = limits(&words.join(" "));
            prop_assert!(found.len() <= MOST && rest.len() < 400);
        }
    }
}
