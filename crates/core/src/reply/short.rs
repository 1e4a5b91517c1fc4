//! Short answers: a choice among the numbered marks ([`Choose`]), whether the instruction is fulfilled ([`Done`]), and whether it must
//! not be flown ([`Refuse`]).
//!
//! [`Choose`]: crate::query::QueryKind::Choose
//! [`Done`]: crate::query::QueryKind::Done
//! [`Refuse`]: crate::query::QueryKind::Refuse

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{MAX_STAGE, MAX_TEXT, ScanError, Value, Verdict, closed_schema, one_line, search};

/// Maximum number of choices parsed from an answer; further ones are ignored.
pub const MAX_CHOSEN: usize = 64;

/// The answer to a [`Choose`](crate::query::QueryKind::Choose) query.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Choice {
    /// Numbers of the chosen marks, best first, each once; empty if none is suitable. They need not exist in the image.
    pub points: Vec<u32>,
}

/// The answer to a [`Done`](crate::query::QueryKind::Done) query.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Completion {
    /// Whether the whole instruction is fulfilled.
    pub done: bool,
    /// Number of the current stage, from 1.
    pub stage: Option<u32>,
}

/// The answer to a [`Refuse`](crate::query::QueryKind::Refuse) query.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Refusal {
    /// Whether the instruction must not be flown.
    pub refuse: bool,
    /// The reason in one sentence; empty if it may be flown.
    pub reason: String,
}

/// Why an answer is neither a choice nor a completion. Nothing may be flown on it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ShortReplyError {
    /// No answer found in the text.
    #[error("the reply contains no JSON with `{wanted}`; retry, or use a model that follows schemas")]
    NoReply {
        /// The expected key.
        wanted: &'static str,
    },
    /// The answer ends inside its JSON.
    #[error("the reply ends inside its JSON; raise the limit on output tokens")]
    Truncated,
    /// The answer is longer than [`MAX_TEXT`].
    #[error("the reply exceeds {limit} bytes")]
    TooLong {
        /// The limit, bytes.
        limit: usize,
    },
    /// A field has the wrong type.
    #[error("`{field}` must be {wanted}, found `{found}`")]
    WrongType {
        /// The field.
        field: &'static str,
        /// What was expected.
        wanted: &'static str,
        /// What was found, shortened.
        found: String,
    },
}

const POINTS: [&str; 4] = ["points", "choices", "candidates", "numbers"];
const DONE: [&str; 2] = ["done", "completed"];
const REFUSE: [&str; 2] = ["refuse", "refused"];

/// Parses the numbers chosen in `text`: the first JSON object that names them, else the first list of whole numbers.
/// Accepts code fences, prose, a single number instead of a list and numbers as text; a repeated number counts once.
///
/// # Errors
/// [`ShortReplyError`]; a list with anything but whole numbers from 0 to 4 294 967 295 is refused.
pub fn parse_choice(text: &str) -> Result<Choice, ShortReplyError> {
    let object = |value: &Value, _| match value.field(&POINTS) {
        Some(found) => numbers(found).map_or_else(Verdict::Refused, Verdict::Accepted),
        None => Verdict::Other,
    };
    let named = find(text, "points", object);
    if !matches!(named, Err(ShortReplyError::NoReply { .. })) {
        return named;
    }
    let list = |value: &Value, _| match value {
        Value::Array(_) => numbers(value).map_or(Verdict::Other, Verdict::Accepted),
        _ => Verdict::Other,
    };
    find(text, "points", list)
}

/// Parses `{"done":…}` in `text`, with an optional `stage`; accepts code fences and prose.
///
/// # Errors
/// [`ShortReplyError`] if there is no valid answer.
pub fn parse_completion(text: &str) -> Result<Completion, ShortReplyError> {
    find(text, "done", |value, _| match value.field(&DONE) {
        Some(flag) => completion(value, flag).map_or_else(Verdict::Refused, Verdict::Accepted),
        None => Verdict::Other,
    })
}

/// Parses `{"refuse":…,"reason":…}` in `text`; accepts code fences and prose. The reason is one line.
///
/// # Errors
/// [`ShortReplyError`] if there is no valid answer.
pub fn parse_refusal(text: &str) -> Result<Refusal, ShortReplyError> {
    find(text, "refuse", |value, _| match value.field(&REFUSE) {
        Some(flag) => match flag.truth() {
            Some(refuse) => {
                let reason = value.field(&["reason"]).and_then(Value::text).map(one_line).unwrap_or_default();
                Verdict::Accepted(Refusal { refuse, reason })
            }
            None => Verdict::Refused(wrong("refuse", "true or false", flag)),
        },
        None => Verdict::Other,
    })
}

/// The schema of a [`Refusal`].
#[must_use]
pub fn refusal_schema() -> serde_json::Value {
    closed_schema::<Refusal>()
}

fn find<T>(
    text: &str,
    wanted: &'static str,
    judge: impl Fn(&Value, bool) -> Verdict<T, ShortReplyError>,
) -> Result<T, ShortReplyError> {
    search(text, judge).map_err(|unfound| match unfound {
        ScanError::TooLong => ShortReplyError::TooLong { limit: MAX_TEXT },
        ScanError::Refused(error) => error,
        ScanError::Truncated => ShortReplyError::Truncated,
        ScanError::NoReply | ScanError::NoJson => ShortReplyError::NoReply { wanted },
    })
}

fn wrong(field: &'static str, wanted: &'static str, found: &Value) -> ShortReplyError {
    ShortReplyError::WrongType { field, wanted, found: found.excerpt() }
}

fn whole(value: &Value) -> Option<u32> {
    value.number().filter(|n| n.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(n)).map(|n| n as u32)
}

fn numbers(value: &Value) -> Result<Choice, ShortReplyError> {
    let items = match value {
        Value::Array(items) => items.as_slice(),
        single => core::slice::from_ref(single),
    };
    let mut points = Vec::new();
    for item in items.iter().take(MAX_CHOSEN) {
        let number = whole(item).ok_or_else(|| wrong("points", "a list of whole numbers", item))?;
        if !points.contains(&number) {
            points.push(number);
        }
    }
    Ok(Choice { points })
}

fn completion(value: &Value, flag: &Value) -> Result<Completion, ShortReplyError> {
    let done = flag.truth().ok_or_else(|| wrong("done", "true or false", flag))?;
    let stage = match value.field(&["stage"]) {
        None => None,
        Some(stage) => {
            let number = whole(stage).filter(|n| *n <= MAX_STAGE);
            // Models write 0 if there is only one stage.
            Some(number.ok_or_else(|| wrong("stage", "a number from 1 to 99", stage))?).filter(|n| *n > 0)
        }
    };
    Ok(Completion { done, stage })
}

/// Which of the numbered marks.
#[derive(JsonSchema)]
#[allow(dead_code, reason = "used only for its schema")]
struct WireChoice {
    /// Why, in one short sentence.
    reason: String,
    /// Numbers of the marks, best first; empty if none leads to the target.
    points: Vec<u32>,
}

/// Whether the instruction is fulfilled.
#[derive(JsonSchema)]
#[allow(dead_code, reason = "used only for its schema")]
struct WireCompletion {
    /// Whether the whole instruction is fulfilled.
    done: bool,
    /// Number of the stage being worked on, from 1.
    stage: u32,
}

/// The JSON schema of a [`Choice`], preceded by a reason, in the same portable subset as
/// [`reply_schema`](super::reply_schema).
#[must_use]
pub fn choice_schema() -> serde_json::Value {
    plain_numbers(closed_schema::<WireChoice>())
}

/// The JSON schema of a [`Completion`], in the same portable subset.
#[must_use]
pub fn completion_schema() -> serde_json::Value {
    plain_numbers(closed_schema::<WireCompletion>())
}

/// Removes `format` and `minimum` of Rust's numbers, which some vendors reject.
pub(crate) fn plain_numbers(mut schema: serde_json::Value) -> serde_json::Value {
    match &mut schema {
        serde_json::Value::Object(map) => {
            if map.get("type").is_some_and(|kind| kind == "integer" || kind == "number") {
                map.retain(|key, _| !matches!(key.as_str(), "format" | "minimum"));
            }
            for value in map.values_mut() {
                *value = plain_numbers(value.take());
            }
        }
        serde_json::Value::Array(items) => {
            for value in items {
                *value = plain_numbers(value.take());
            }
        }
        _ => {}
    }
    schema
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn chosen(text: &str) -> Vec<u32> {
        parse_choice(text).unwrap().points
    }

    #[test]
    fn choices_are_forgiven_what_models_do() {
        for text in [
            r#"{"points":[7,3]}"#,
            r#"I like [5], but: ```json {"reason":"ahead","points":[7, "3", 7]}```"#,
            r#"The best are [7, 3]."#,
            r#"{'choices': [7.0, 3,],}"#,
        ] {
            assert_eq!(chosen(text), [7, 3], "{text}");
        }
        assert_eq!(chosen(r#"{"points":4}"#), [4]);
        assert_eq!(chosen(r#"{"points":[]}"#), [] as [u32; 0]);
        assert_eq!(chosen(&format!("{:?}", (0..100).collect::<Vec<u32>>())).len(), MAX_CHOSEN);
    }

    #[test]
    fn what_is_no_answer_is_refused() {
        let refused = |text: &str| parse_choice(text).unwrap_err();
        assert_eq!(refused("the third"), ShortReplyError::NoReply { wanted: "points" });
        assert_eq!(refused(r#"{"points":[1,"#), ShortReplyError::Truncated);
        for text in [r#"{"points":[1.5]}"#, r#"{"points":[-1]}"#, r#"{"points":[1e99]}"#, r#"{"points":"left"}"#] {
            assert!(matches!(refused(text), ShortReplyError::WrongType { field: "points", .. }), "{text}");
        }
        assert_eq!(refused(&" ".repeat(MAX_TEXT + 1)), ShortReplyError::TooLong { limit: MAX_TEXT });
    }

    #[test]
    fn completion_reads_both_its_fields() {
        let read = |text: &str| parse_completion(text).map(|c| (c.done, c.stage));
        assert_eq!(read(r#"So: {"done": "Yes", "stage": 0}"#), Ok((true, None)));
        assert_eq!(read(r#"{"done":false,"stage":2}"#), Ok((false, Some(2))));
        assert_eq!(read("yes"), Err(ShortReplyError::NoReply { wanted: "done" }));
        assert!(read(r#"{"done":false,"stage":100}"#).is_err() && read(r#"{"done":3}"#).is_err());
    }

    #[test]
    fn schemas_are_closed_and_portable() {
        for (schema, key) in [(choice_schema(), "points"), (completion_schema(), "done")] {
            assert_eq!(schema["additionalProperties"], false);
            assert!(schema["properties"][key].is_object());
            let text = schema.to_string();
            assert!(!text.contains("minimum") && !text.contains("format"), "{text}");
        }
    }

    proptest! {
        #[test]
        fn choices_survive_the_wire(points in proptest::collection::vec(any::<u32>(), 0..20), before in "[a-z .]{0,30}") {
            let mut wanted = points.clone();
            let mut seen = std::collections::BTreeSet::new();
            wanted.retain(|n| seen.insert(*n));
            prop_assert_eq!(chosen(&format!("{before}{{\"points\":{points:?}}}")), wanted);
        }

        #[test]
        fn any_text_is_read_without_panic(text in any::<String>(), json in "[\\[\\]{}\":,a-z0-9. -]{0,60}") {
            let _ = (parse_choice(&text), parse_completion(&text));
            let _ = (parse_choice(&json), parse_completion(&json));
        }
    }
}
