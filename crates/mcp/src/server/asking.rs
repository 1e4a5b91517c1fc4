//! The operator's consent, asked for in the client, where that asks its user: an extra beside the cockpit and `spf mcp arm`.
//!
//! The client carries our state back to us and could say anything: it is a random number that counts once, with the same call, for two
//! minutes. What is answered then arms the assistant as the cockpit does.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use rmcp::model::{
    CallToolResponse, ElicitRequest, ElicitRequestParams, ElicitationSchema, InputRequest, InputRequests, InputRequiredResult,
    InputResponses,
};

use crate::deck::Deck;
use spf_guard::Secret;

/// How long the question stays open, and for how long an answer arms.
const OPEN: Duration = Duration::from_secs(120);
const ARMED: Duration = Duration::from_secs(600);
/// The name of the question and of what is typed.
const QUESTION: &str = "consent";
const WORDS: &str = "words";

/// A question that is open.
#[derive(Debug)]
struct Open {
    state: Secret,
    /// The call that it is about, with its arguments.
    call: String,
    until: Instant,
}

/// What is asked for in the client.
#[derive(Debug, Default)]
pub(super) struct Asking {
    open: Mutex<Option<Open>>,
}

/// What comes of asking.
pub(super) enum Asked {
    /// The operator has armed the assistant.
    Armed,
    /// The user must be asked first.
    Ask(Box<CallToolResponse>),
    /// It was no consent, and why.
    Refused(String),
}

impl Asking {
    /// Asks, or takes the answer that a call brings with it.
    pub(super) fn ask(&self, deck: &Deck, call: &str, state: Option<&str>, answers: Option<&InputResponses>) -> Asked {
        let mut open = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        let drone = deck.hangar().craft(None);
        let words = format!("arm {drone}");
        let Some(state) = state else {
            let Ok(secret) = Secret::new() else { return Asked::Refused("no random numbers".to_owned()) };
            let response = question(&drone, call, &words, secret.text());
            *open = Some(Open { state: secret, call: call.to_owned(), until: Instant::now() + OPEN });
            return Asked::Ask(Box::new(response));
        };
        // Whatever comes of it, it counts once.
        let is_ours = open.take().is_some_and(|open| open.state.is(state) && open.call == call && Instant::now() < open.until);
        if !is_ours {
            return Asked::Refused("this question was not asked about this call, or is answered already: call again".to_owned());
        }
        let answer = answers.and_then(|answers| answers.get(QUESTION));
        let accepted = answer.is_some_and(|answer| {
            answer["action"] == "accept" && answer["content"][WORDS].as_str().map(str::trim) == Some(words.as_str())
        });
        if !accepted {
            return Asked::Refused("the user did not type the words that arm the assistant: nothing flies".to_owned());
        }
        deck.arm(ARMED);
        Asked::Armed
    }
}

fn question(drone: &str, call: &str, words: &str, state: &str) -> CallToolResponse {
    let message = format!(
        "The assistant wants to fly the real drone `{drone}`: {call}. If you stand where you see it and can stop it, type `{words}`: it may then \
         fly for {} min, one flight.",
        ARMED.as_secs() / 60
    );
    let schema = ElicitationSchema::builder().required_string(WORDS).build_unchecked();
    let asked = ElicitRequestParams::FormElicitationParams { meta: None, message, requested_schema: schema };
    let mut requests = InputRequests::new();
    requests.insert(QUESTION.to_owned(), InputRequest::Elicitation(ElicitRequest::new(asked)));
    InputRequiredResult::new(Some(requests), Some(state.to_owned())).into()
}
