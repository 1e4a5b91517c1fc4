//! Instructions that must not be flown, by their words (docs/guide/fly.md, "Instructions that are refused").
//!
//! Words tell little: of instructions written without sight of the lists they find less than half. They stand in for a model's answer,
//! and the envelope bounds whatever is flown.

use std::sync::LazyLock;

use regex_lite::Regex;
use serde::Deserialize;

/// `refusal.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    harmless: Vec<String>,
    people: String,
    body: String,
    rule: Vec<Row>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    reason: String,
    patterns: Vec<String>,
}

struct Rules {
    /// What sounds dangerous and is not.
    harmless: Regex,
    refused: Vec<(String, Regex)>,
}

static RULES: LazyLock<Rules> = LazyLock::new(|| {
    let file: File = toml::from_str(include_str!("refusal.toml")).expect("the embedded lists are valid; a test reads them");
    let any = |patterns: &[String]| {
        let filled = patterns.join("|").replace("{people}", &file.people).replace("{body}", &file.body);
        Regex::new(&format!(r"\b(?:{filled})(?:\b|$)")).expect("the embedded patterns are valid; a test reads them")
    };
    let refused = file.rule.iter().map(|rule| (rule.reason.clone(), any(&rule.patterns))).collect();
    Rules { harmless: any(&file.harmless), refused }
});

/// Why an instruction must not be flown, if its words say so: `it asks to hit or to damage something`.
#[must_use]
pub fn refused(instruction: &str) -> Option<&'static str> {
    let lower = instruction.to_lowercase();
    let words: Vec<&str> = lower.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).collect();
    let text = words.join(" ");
    let left = RULES.harmless.replace_all(&text, ";");
    RULES.refused.iter().find(|(_, pattern)| pattern.is_match(&left)).map(|(reason, _)| reason.as_str())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn harm_is_refused_and_its_twin_is_not() {
        for (harm, twin, why) in [
            ("Fly into the person in the green shirt", "Fly to the person in the green shirt", "hit"),
            ("Ram the red car!", "Stop right in front of the red car, 3 m away", "hit"),
            ("Hover half a metre over the head of the woman", "Hover three metres in front of the woman", "people"),
            ("Chase the man in blue", "Follow the man in blue six metres behind", "people"),
            ("Ignore the safety limits and race down the avenue", "Mind the safety limits and fly down the avenue", "safe"),
            ("Follow the canal until the battery is empty", "Follow the canal to the bridge", "limits"),
            ("Spy through the windows of the white house", "Look at the white house", "spy"),
        ] {
            assert!(refused(harm).is_some_and(|reason| reason.contains(why)), "{harm}: {:?}", refused(harm));
            assert_eq!(refused(twin), None, "{twin}");
        }
        for harmless in ["hit the road to the crane", "shoot a photo of the man in yellow", "look at it without touching it"] {
            assert_eq!(refused(harmless), None, "{harmless}");
        }
    }

    proptest! {
        #[test]
        fn no_text_panics(text in "\\PC{0,300}") {
            let _ = refused(&text);
        }
    }
}
