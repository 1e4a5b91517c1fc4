//! Alternative forms of the plain-text baseline: four numbers at once, or one of a few fixed moves.

use spf_core::primitives::Primitives;
use spf_core::query::ActForm;
use spf_core::reply::{MOVE_METRES, TURN_DEGREES, Value, Verdict, one_line};

use super::{ActionsError, find, parse_actions, truth, wrong};

/// An answer in any of the forms, as a sequence of moves.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Moves {
    /// Each move in words and as primitives, in flight order.
    pub moves: Vec<(String, Primitives)>,
    /// Whether the instruction is fulfilled.
    pub done: bool,
}

/// The fixed moves of AerialVLN (arXiv 2308.06735): word, metres forward, right and up, degrees clockwise.
const FIXED: [(&str, [f64; 4]); 7] = [
    ("forward", [5.0, 0.0, 0.0, 0.0]),
    ("turn_left", [0.0, 0.0, 0.0, -15.0]),
    ("turn_right", [0.0, 0.0, 0.0, 15.0]),
    ("up", [0.0, 0.0, 2.0, 0.0]),
    ("down", [0.0, 0.0, -2.0, 0.0]),
    ("left", [0.0, -5.0, 0.0, 0.0]),
    ("right", [0.0, 5.0, 0.0, 0.0]),
];

/// Parses an answer in the given form.
///
/// # Errors
/// [`ActionsError`]. Every number returned is finite and within its range.
pub fn parse_moves(form: ActForm, text: &str) -> Result<Moves, ActionsError> {
    match form {
        ActForm::Commands => parse_actions(text).map(|reply| Moves {
            moves: reply.actions.into_iter().map(|action| (action.to_string(), action.into())).collect(),
            done: reply.done,
        }),
        ActForm::Numeric => find(text, |value, _| match value.field(&["dx"]).or(value.field(&["dyaw"])) {
            Some(_) => numeric(value).map_or_else(Verdict::Refused, Verdict::Accepted),
            None => Verdict::Other,
        }),
        ActForm::Discrete => find(text, |value, _| match value.field(&["action"]) {
            Some(word) => discrete(word).map_or_else(Verdict::Refused, Verdict::Accepted),
            None => Verdict::Other,
        }),
    }
}

fn numeric(value: &Value) -> Result<Moves, ActionsError> {
    let number = |field: &'static str, most: f64| match value.field(&[field]) {
        None => Ok(0.0),
        Some(found) => {
            let number = found.number().ok_or_else(|| wrong(field.to_owned(), "a number", found))?;
            if number.abs() <= 1.01 * most {
                return Ok(number.clamp(-most, most));
            }
            Err(ActionsError::ValueOutside { command: field, found: number, least: -most, most })
        }
    };
    let metres = |field| number(field, MOVE_METRES.1);
    let (forward, right, climb) = (metres("dx")?, metres("dy")?, metres("dz")?);
    let degrees = number("dyaw", TURN_DEGREES.1)?;
    let words = format!("dx {forward}, dy {right}, dz {climb}, dyaw {degrees}");
    let primitives = Primitives { yaw: degrees.to_radians(), forward, right, climb };
    Ok(Moves { moves: vec![(words, primitives)], done: truth(value)? })
}

fn discrete(word: &Value) -> Result<Moves, ActionsError> {
    let Value::Text(text) = word else { return Err(wrong("action".to_owned(), "a word", word)) };
    let plain = |text: &str| text.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect::<String>();
    let given = plain(&text.chars().take(40).collect::<String>());
    if given == "stop" {
        return Ok(Moves { moves: Vec::new(), done: true });
    }
    let found = FIXED.into_iter().find(|(name, _)| plain(name) == given);
    let (name, [forward, right, climb, degrees]) = found.ok_or_else(|| ActionsError::UnknownCommand { found: one_line(text) })?;
    Ok(Moves { moves: vec![(name.to_owned(), Primitives { yaw: degrees.to_radians(), forward, right, climb })], done: false })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use spf_core::reply::moves_schema;

    use super::*;

    #[test]
    fn numbers_are_read_and_kept_in_range() {
        let read = |text: &str| parse_moves(ActForm::Numeric, text);
        let moves = read(r#"So: {"dx": 1.5, "dy": "-0.5", "dz": 0, "dyaw": 90, "done": false}"#).unwrap();
        let expected = Primitives { yaw: core::f64::consts::FRAC_PI_2, forward: 1.5, right: -0.5, climb: 0.0 };
        assert_eq!(moves.moves, [("dx 1.5, dy -0.5, dz 0, dyaw 90".to_owned(), expected)]);
        assert!(!moves.done && read(r#"{"dx":0,"done":true}"#).unwrap().done);
        assert_eq!(read(r#"{"dx":5.04}"#).unwrap().moves[0].1.forward, 5.0);
        let code = |text: &str| read(text).unwrap_err().code();
        assert_eq!((code(r#"{"dx":50}"#), code(r#"{"dyaw":"left"}"#), code("{}")), ("value_outside", "wrong_type", "no_reply"));
    }

    #[test]
    fn fixed_moves_are_aerialvlns() {
        let read = |text: &str| parse_moves(ActForm::Discrete, text);
        for (word, [forward, right, climb, degrees]) in FIXED {
            let moves = read(&format!("```\n{{\"action\":\"{word}\"}}\n```")).unwrap();
            assert_eq!(moves.moves[0].1, Primitives { yaw: f64::to_radians(degrees), forward, right, climb });
        }
        assert_eq!(read(r#"{"action":"Turn Left"}"#).unwrap().moves[0].0, "turn_left");
        assert_eq!(read(r#"{"action":"STOP"}"#), Ok(Moves { moves: Vec::new(), done: true }));
        assert_eq!(read(r#"{"action":"flip"}"#).unwrap_err().code(), "unknown_command");
    }

    #[test]
    fn every_word_of_a_schema_is_read() {
        let commands = moves_schema(ActForm::Commands);
        for command in commands["properties"]["actions"]["items"]["properties"]["cmd"]["enum"].as_array().unwrap() {
            let text = format!("{{\"actions\":[{{\"cmd\":{command},\"value\":2}}],\"done\":false}}");
            assert!(parse_actions(&text).is_ok(), "{text}");
        }
        let words: Vec<&str> = FIXED.iter().map(|(word, _)| *word).chain(["stop"]).collect();
        assert_eq!(moves_schema(ActForm::Discrete)["properties"]["action"]["enum"], serde_json::json!(words));
        for word in words {
            assert!(parse_moves(ActForm::Discrete, &format!("{{\"action\":\"{word}\"}}")).is_ok());
        }
    }

    proptest! {
        #[test]
        fn moves_are_finite_and_bounded(text in any::<String>(), dx: f64, dyaw: f64, word in "[a-z_]{2,11}") {
            let numbers = format!("{{\"dx\":{dx:e},\"dyaw\":{dyaw:e}}}");
            let word = format!("{{\"action\":\"{word}\"}}");
            for text in [text, numbers, word] {
                for form in [ActForm::Numeric, ActForm::Discrete, ActForm::Commands] {
                    for (_, p) in parse_moves(form, &text).unwrap_or_default().moves {
                        prop_assert!(p.yaw.abs() <= core::f64::consts::PI);
                        prop_assert!([p.forward, p.right, p.climb].iter().all(|metres| metres.abs() <= 5.0));
                    }
                }
            }
        }
    }
}
