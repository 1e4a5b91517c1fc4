//! Request and response formats of the vendors, as needed for a query about an image.

mod anthropic;
mod chat;
mod gemini;
mod responses;

use base64::Engine as _;
use base64::alphabet;
use base64::engine::DecodePaddingMode;
use base64::engine::general_purpose::{GeneralPurpose, GeneralPurposeConfig};
use serde_json::Value;
use spf_flight::ledger::ORACLE_SERVED;

/// Number of letters per part of a streamed answer.
const PIECE: usize = 12;
/// Estimated characters per token, and tokens per image, since clients expect token counts.
const CHARACTERS_A_TOKEN: usize = 4;
const IMAGE_TOKENS: usize = 1000;

/// A vendor's format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wire {
    Chat,
    Responses,
    Gemini,
    Anthropic,
}

/// A received query.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Question {
    /// The complete text.
    pub(super) prompt: String,
    /// The first image of the last message with one: what follows it is an enlarged part of it.
    pub(super) image: Option<Vec<u8>>,
    /// Whether the present message has shown its image.
    shown: bool,
    /// Whether the answer should be streamed.
    pub(super) stream: bool,
}

/// Response data besides the text.
#[derive(Clone, Copy, Debug)]
pub(super) struct Answered<'a> {
    pub(super) model: &'a str,
    pub(super) text: &'a str,
    pub(super) tokens_in: usize,
    pub(super) tokens_out: usize,
    /// Number of the query, for ids.
    pub(super) number: u64,
}

impl Wire {
    /// Parses a query.
    pub(super) fn question(self, body: &Value) -> Question {
        let mut question = Question { stream: body["stream"].as_bool().unwrap_or(false), ..Question::default() };
        match self {
            Self::Chat => chat::read(body, &mut question),
            Self::Responses => responses::read(body, &mut question),
            Self::Gemini => gemini::read(body, &mut question),
            Self::Anthropic => anthropic::read(body, &mut question),
        }
        question
    }

    /// A complete response.
    pub(super) fn whole(self, answered: &Answered<'_>) -> Value {
        match self {
            Self::Chat => chat::whole(answered),
            Self::Responses => responses::whole(answered),
            Self::Gemini => gemini::whole(answered),
            Self::Anthropic => anthropic::whole(answered),
        }
    }

    /// A response as a stream of server-sent events.
    pub(super) fn stream(self, answered: &Answered<'_>) -> String {
        let events = match self {
            Self::Chat => chat::events(answered),
            Self::Responses => responses::events(answered),
            Self::Gemini => gemini::events(answered),
            Self::Anthropic => anthropic::events(answered),
        };
        let encoded = |event: &Value| match event["type"].as_str() {
            Some(kind) => format!("event: {kind}\ndata: {event}\n\n"),
            None => format!("data: {event}\n\n"),
        };
        let mut stream: String = events.iter().map(encoded).collect();
        if self == Self::Chat {
            stream += "data: [DONE]\n\n";
        }
        stream
    }

    /// An error in the vendor's format.
    pub(super) fn error(self, status: u16, message: &str) -> Value {
        match self {
            Self::Chat | Self::Responses => chat::error(message),
            Self::Gemini => gemini::error(status, message),
            Self::Anthropic => anthropic::error(message),
        }
    }
}

impl Question {
    fn say(&mut self, text: Option<&str>) {
        let Some(text) = text else { return };
        if !self.prompt.is_empty() {
            self.prompt.push('\n');
        }
        self.prompt += text;
    }

    /// Begins a message.
    fn message(&mut self) {
        self.shown = false;
    }

    fn show(&mut self, data: Option<&str>) {
        let Some(data) = data else { return };
        if core::mem::replace(&mut self.shown, true) {
            return;
        }
        let base64 = data.split_once("base64,").map_or(data, |(_, behind)| behind);
        self.image = decode(base64);
    }
}

impl<'a> Answered<'a> {
    pub(super) fn new(question: &Question, text: &'a str, number: u64) -> Self {
        Self {
            // Whatever model was requested: the flight's summary must not name one that did not answer.
            model: ORACLE_SERVED,
            text,
            tokens_in: question.prompt.len() / CHARACTERS_A_TOKEN + IMAGE_TOKENS,
            tokens_out: text.len() / CHARACTERS_A_TOKEN + 1,
            number,
        }
    }

    fn pieces(&self) -> Vec<String> {
        let letters: Vec<char> = self.text.chars().collect();
        letters.chunks(PIECE).map(|piece| piece.iter().collect()).collect()
    }
}

/// Both base64 alphabets, with or without padding: SDKs differ.
fn decode(text: &str) -> Option<Vec<u8>> {
    let config = GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent);
    let alphabet = if text.contains(['-', '_']) { alphabet::URL_SAFE } else { alphabet::STANDARD };
    GeneralPurpose::new(&alphabet, config).decode(text.trim()).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use serde_json::json;

    #[test]
    fn each_vendors_question_is_read() {
        let url = "data:image/jpeg;base64,AAEC";
        let questions = [
            (
                Wire::Chat,
                json!({"model": "m", "stream": true, "messages": [{"role": "system", "content": "a"},
                {"role": "user", "content": [{"type": "image_url", "image_url": {"url": url}}, {"type": "text", "text": "b"}]}]}),
            ),
            (
                Wire::Responses,
                json!({"model": "m", "stream": true, "instructions": "a", "input": [{"role": "user", "content":
                [{"type": "input_image", "image_url": url}, {"type": "input_text", "text": "b"}]}]}),
            ),
            (
                Wire::Anthropic,
                json!({"model": "m", "stream": true, "system": "a", "messages": [{"role": "user", "content":
                [{"type": "image", "source": {"type": "base64", "data": "AAEC"}}, {"type": "text", "text": "b"}]}]}),
            ),
            (
                Wire::Gemini,
                json!({"model": "m", "stream": true, "systemInstruction": {"parts": [{"text": "a"}]},
                "contents": [{"parts": [{"inline_data": {"mime_type": "image/jpeg", "data": "AAEC"}}, {"text": "b"}]}]}),
            ),
        ];
        for (wire, body) in questions {
            let expected = Question { prompt: "a\nb".into(), image: Some(vec![0, 1, 2]), shown: true, stream: true };
            assert_eq!(wire.question(&body), expected, "{wire:?}");
        }
    }

    #[test]
    fn every_answer_names_the_oracle_whatever_was_requested() {
        let answered = Answered::new(&Question::default(), "{}", 1);
        for wire in [Wire::Chat, Wire::Responses, Wire::Anthropic, Wire::Gemini] {
            let whole = wire.whole(&answered);
            let model = whole.get("model").or(whole.get("modelVersion"));
            assert_eq!(model, Some(&ORACLE_SERVED.into()), "{wire:?}");
            assert!(wire.stream(&answered).contains(ORACLE_SERVED), "{wire:?}");
        }
    }

    #[test]
    fn the_first_image_of_the_last_message_counts() {
        let part = |data: &str| json!({"type": "image", "source": {"type": "base64", "data": data}});
        let body = json!({"messages": [{"role": "user", "content": [part("AAEC")]}, {"role": "user", "content": "a"},
            {"role": "user", "content": [part("AwQF"), part("BgcI"), {"type": "text", "text": "b"}]}]});
        assert_eq!(Wire::Anthropic.question(&body).image, Some(vec![3, 4, 5]));
    }

    proptest! {
        #[test]
        fn anything_is_read_without_panic(text in "[\\[\\]{}:\",a-z0-9_ ]{0,200}", key in "contents|messages|input", data in ".{0,40}") {
            let wires = [Wire::Chat, Wire::Responses, Wire::Gemini, Wire::Anthropic];
            let odd = json!({key: [{"parts": [{"inlineData": {"data": data.clone()}}], "content": [{"text": data.clone(), "source": 3}, 7]}, text.clone()]});
            for body in [odd, serde_json::from_str(&text).unwrap_or_default()] {
                wires.iter().for_each(|wire| drop(wire.question(&body)));
            }
            drop(decode(&data));
        }
    }
}
