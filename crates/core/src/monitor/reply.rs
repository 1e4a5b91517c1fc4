//! The answer to a [`Monitor`](crate::query::QueryKind::Monitor) query: one word of three.

use serde_json::json;

use super::Verdict;
use crate::reply::{self, ShortReplyError, find, wrong};

/// The words of an answer.
const WORDS: [(&str, Verdict); 3] = [("continue", Verdict::Continue), ("stop", Verdict::Stop), ("lost", Verdict::Lost)];

/// Parses `{"state":"continue"}`, `"stop"` or `"lost"` in `text`; accepts code fences and prose around it, and capitals. A word alone is
/// refused, since prose may contain any of them.
///
/// # Errors
/// [`ShortReplyError`] if there is no valid answer.
pub fn parse_monitor(text: &str) -> Result<Verdict, ShortReplyError> {
    find(text, "state", |value, _| match value.field(&["state"]) {
        Some(state) => {
            let word = state.text().map(str::trim);
            let known = WORDS.iter().find(|(name, _)| word.is_some_and(|word| word.eq_ignore_ascii_case(name)));
            match known {
                Some((_, verdict)) => reply::Verdict::Accepted(*verdict),
                None => reply::Verdict::Refused(wrong("state", "continue, stop or lost", state)),
            }
        }
        None => reply::Verdict::Other,
    })
}

/// The JSON schema of an answer, in the same portable subset as [`reply_schema`](crate::reply::reply_schema).
#[must_use]
pub fn monitor_schema() -> serde_json::Value {
    json!({
        "type": "object",
        "properties": {
            "state": { "type": "string", "enum": WORDS.map(|(word, _)| word), "description": "How the flight goes on." },
        },
        "required": ["state"],
        "additionalProperties": false,
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::reply::MAX_TEXT;

    #[test]
    fn the_three_words_are_read() {
        for (word, verdict) in WORDS {
            for text in [
                format!(r#"{{"state":"{word}"}}"#),
                format!("```json\n{{\"state\": \"{}\", \"why\": \"the crane is ahead\"}}\n```", word.to_uppercase()),
                format!(r#"It should not stop: {{"state":" {word} "}}"#),
            ] {
                assert_eq!(parse_monitor(&text), Ok(verdict), "{text}");
            }
        }
    }

    #[test]
    fn anything_else_is_refused_with_a_reason() {
        let refused = |text: &str| parse_monitor(text).unwrap_err().to_string();
        for text in ["stop", r#""stop""#, r#"["stop"]"#, r#"{"done":true}"#, r#"{"state":null}"#, ""] {
            assert_eq!(parse_monitor(text), Err(ShortReplyError::NoReply { wanted: "state" }), "{text}");
        }
        assert_eq!(refused(r#"{"state":"stuck"}"#), "`state` must be continue, stop or lost, found `stuck`");
        for text in [r#"{"state":true}"#, r#"{"state":["lost"]}"#, r#"{"state":"lost or stop"}"#] {
            assert!(refused(text).starts_with("`state` must be continue, stop or lost"), "{text}");
        }
        assert_eq!(parse_monitor(r#"{"state":"st"#), Err(ShortReplyError::Truncated));
        assert_eq!(parse_monitor(&" ".repeat(MAX_TEXT + 1)), Err(ShortReplyError::TooLong { limit: MAX_TEXT }));
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(text in any::<String>(), json in "[\\[\\]{}\":,a-z0-9. -]{0,60}", word in "[a-zA-Z ]{0,9}") {
            let _ = (parse_monitor(&text), parse_monitor(&json));
            let read = parse_monitor(&format!("{{\"state\":\"{word}\"}}")).ok();
            let known = WORDS.iter().find(|(name, _)| word.trim().eq_ignore_ascii_case(name)).map(|(_, verdict)| *verdict);
            prop_assert_eq!(read, known);
        }
    }
}
