//! Vendor formats: creates requests, and reads text, tokens and the end of a reply from responses.

mod anthropic;
mod chat;
mod gemini;
pub(crate) mod parameters;
mod responses;
mod schema;
pub mod sse;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde::Deserialize;
use serde_json::Value;
use spf_core::query::QueryKind;
use spf_core::reply::MAX_TEXT;
use spf_core::time::Duration;

use crate::error::{VlmError, quote};
use crate::table::{Model, merge};
use crate::usage::Tokens;

pub use crate::table::{SchemaDialect, WireKind};

/// Parameters that a model may lack, and that a row's `parameters` may list.
const OPTIONAL: [&str; 5] = ["reasoning", "reasoning_effort", "response_format", "temperature", "verbosity"];

/// A request.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// Path and query, relative to the base URL.
    pub path: String,
    /// The body.
    pub body: Value,
}

/// The contents of a query.
#[derive(Clone, Copy, Debug)]
pub struct Question<'a> {
    /// The prompt.
    pub prompt: &'a str,
    /// The image, a JPEG.
    pub jpeg: &'a [u8],
    /// An enlarged part of it, which goes along as a second image.
    pub close_up: Option<&'a [u8]>,
    /// The kind of answer requested.
    pub kind: &'a QueryKind,
}

/// The reply received so far.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gathered {
    /// The text.
    pub text: String,
    /// The arguments of a tool call: some models give their reply there.
    pub arguments: String,
    /// Thoughts of which a server makes no secret: some give the whole reply there.
    pub thoughts: String,
    /// The model, as it names itself.
    pub served: Option<String>,
    /// Token counts, once reported.
    pub tokens: Option<Tokens>,
    /// Cost in US dollars, if the vendor reports it.
    pub cost_usd: Option<f64>,
    /// How the reply ended, once known.
    pub end: Option<End>,
}

/// How a reply ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum End {
    /// Complete.
    Whole,
    /// At the token limit.
    CutOff(String),
    /// Blocked by the vendor.
    Blocked(String),
    /// Declined by the model.
    Declined(String),
    /// By an error.
    Fault(String),
}

/// The JSON schema of the reply to a kind of query; `None` if any text is allowed.
#[must_use]
pub fn reply_schema(kind: &QueryKind) -> Option<Value> {
    schema::of(kind)
}

impl WireKind {
    /// Creates the request for a query.
    #[must_use]
    pub fn request(self, model: &Model, question: &Question<'_>) -> Request {
        let schema = schema::of(question.kind).filter(|_| model.schema != SchemaDialect::None);
        let images = core::iter::once(question.jpeg).chain(question.close_up).collect();
        let ask = Ask { model, prompt: question.prompt, images, schema };
        let mut request = match self {
            Self::Gemini => gemini::request(&ask),
            Self::OpenaiChat => chat::request(&ask),
            Self::OpenaiResponses => responses::request(&ask),
            Self::Anthropic => anthropic::request(&ask),
        };
        merge(&mut request.body, &model.request);
        if let (Some(parameters), Value::Object(body)) = (&model.parameters, &mut request.body) {
            // Everything else is refused by the servers that lack it.
            let listed = |name: &str| parameters.iter().any(|listed| listed == name);
            body.retain(|name, _| !OPTIONAL.contains(&name.as_str()) || listed(name));
        }
        request
    }

    /// Reads one JSON object: an event of a stream, or a complete response.
    ///
    /// # Errors
    /// [`VlmError`] if it is an error of the vendor, or does not match this format.
    pub fn read(self, host: &str, object: &Value, into: &mut Gathered) -> Result<(), VlmError> {
        if let Value::Array(objects) = object {
            return objects.iter().try_for_each(|object| self.read(host, object, into));
        }
        if !object.is_object() {
            return Err(malformed(host, "not an object"));
        }
        if let Some(error) = error_of(host, 200, object) {
            return Err(error);
        }
        match self {
            Self::Gemini => gemini::read(host, object, into),
            Self::OpenaiChat => chat::read(host, object, into),
            Self::OpenaiResponses => responses::read(host, object, into),
            Self::Anthropic => anthropic::read(host, object, into),
        }?;
        if into.text.len().max(into.arguments.len()) > MAX_TEXT {
            return Err(VlmError::TooLong { host: host.to_owned(), limit: MAX_TEXT });
        }
        Ok(())
    }
}

impl Gathered {
    /// Adds thoughts, up to the maximum length of a reply: longer ones are none.
    fn think(&mut self, thoughts: &str) {
        if self.thoughts.len() <= MAX_TEXT {
            self.thoughts.push_str(thoughts);
        }
    }

    /// Adds the arguments of a tool call: a part of them as text, or an object.
    fn call(&mut self, arguments: &Value) {
        match arguments {
            Value::String(text) => self.arguments.push_str(text),
            Value::Null => {}
            object => self.arguments.push_str(&object.to_string()),
        }
    }

    /// What was said in the place of a text that is missing.
    fn elsewhere(&self) -> Option<&String> {
        let is_reply = |text: &&String| text.contains('{') && text.len() <= MAX_TEXT;
        [&self.arguments, &self.thoughts].into_iter().find(is_reply)
    }

    /// The text of a complete reply.
    ///
    /// # Errors
    /// [`VlmError`] if it ended abnormally, or without text.
    pub fn finish(&self, host: &str) -> Result<String, VlmError> {
        let host = || host.to_owned();
        match &self.end {
            Some(End::Declined(words)) => return Err(VlmError::Declined(quote(words))),
            Some(End::Blocked(reason)) => return Err(VlmError::Blocked { host: host(), reason: quote(reason) }),
            Some(End::CutOff(reason)) => {
                return Err(VlmError::CutOff { reason: quote(reason), characters: self.text.chars().count() });
            }
            Some(End::Fault(reason)) => {
                let code = Some(quote(reason));
                let message = "the model ended its reply early".to_owned();
                return Err(VlmError::Vendor { host: host(), status: 200, code, message, retry_after: None });
            }
            Some(End::Whole) | None => {}
        }
        if self.text.trim().is_empty() {
            if let Some(text) = self.elsewhere() {
                return Ok(text.clone());
            }
            return Err(VlmError::Empty { host: host(), reason: self.end.is_none().then(|| "no reason given".to_owned()) });
        }
        Ok(self.text.clone())
    }
}

/// A query with everything needed to write it in one of the formats.
struct Ask<'a> {
    model: &'a Model,
    prompt: &'a str,
    /// The image, and the enlarged part of it, if any.
    images: Vec<&'a [u8]>,
    schema: Option<Value>,
}

impl Ask<'_> {
    /// The images in base64, each with a prefix.
    fn images(&self, prefix: &str) -> impl Iterator<Item = String> {
        self.images.iter().map(move |jpeg| {
            let mut text = String::with_capacity(prefix.len() + jpeg.len().div_ceil(3) * 4);
            text.push_str(prefix);
            STANDARD.encode_string(jpeg, &mut text);
            text
        })
    }
}

/// Prefix of an image given as a data URL.
const DATA_URL: &str = "data:image/jpeg;base64,";

fn malformed(host: &str, reason: impl Into<String>) -> VlmError {
    VlmError::Malformed { host: host.to_owned(), reason: reason.into() }
}

/// Deserialises the object as a `T`.
fn typed<T: for<'a> Deserialize<'a>>(host: &str, object: &Value) -> Result<T, VlmError> {
    T::deserialize(object).map_err(|error| malformed(host, quote(&error.to_string())))
}

/// The error in an object, in any vendor's format; `None` if there is none.
#[must_use]
pub fn error_of(host: &str, status: u16, object: &Value) -> Option<VlmError> {
    let object = object.as_array().map_or(object, |objects| objects.first().unwrap_or(object));
    // `{"error": {…}}`, `{"error": "…"}`, and from older vLLM and in streams `{"object"|"type": "error", "message":
    // …}`.
    let bare = || {
        let says = |key: &str| object.get(key).and_then(Value::as_str) == Some("error");
        (says("object") || says("type")).then_some(object)
    };
    let error = object.get("error").filter(|error| !error.is_null()).or_else(bare)?;
    let text = |key: &str| match error.get(key) {
        Some(Value::String(text)) => Some(text.clone()),
        Some(Value::Number(number)) => Some(number.to_string()),
        _ => None,
    };
    let number = error.get("code").and_then(Value::as_u64).and_then(|code| u16::try_from(code).ok());
    let status = if status == 200 { number.filter(|code| (400..600).contains(code)).unwrap_or(status) } else { status };
    let mut message = text("message").or_else(|| error.as_str().map(str::to_owned)).unwrap_or_else(|| error.to_string());
    if let Some(param) = text("param").filter(|param| !param.is_empty() && !message.contains(param.as_str())) {
        message = format!("{message} ({param})");
    }
    // Google names the quota, of a minute or of a day, in a detail only.
    if let Some(quota) = quota(error) {
        message = format!("{message} ({quota})");
    }
    // Gemini's error code is in `status`, the others' in `code` or `type`.
    let code = text("status")
        .or_else(|| text("code").filter(|_| number.is_none()))
        .or_else(|| text("type").filter(|word| word != "error"));
    Some(VlmError::Vendor {
        host: host.to_owned(),
        status: status_of(status, code.as_deref()),
        code: code.map(|code| quote(&code)),
        message: quote(&message),
        retry_after: retry_info(error),
    })
}

/// The HTTP status corresponding to an error in a successful response.
fn status_of(status: u16, code: Option<&str>) -> u16 {
    match (status, code) {
        (200, Some("overloaded_error")) => 529,
        (200, Some("rate_limit_error" | "rate_limit_exceeded")) => 429,
        (200, Some("api_error" | "server_error")) => 500,
        _ => status,
    }
}

/// The quota that Google says is used up.
fn quota(error: &Value) -> Option<&str> {
    let violations = error.get("details")?.as_array()?.iter().find_map(|detail| detail.get("violations")?.as_array())?;
    violations.iter().find_map(|violation| violation.get("quotaId")?.as_str())
}

/// Google gives the waiting time in a detail of the error, as `"46s"`.
fn retry_info(error: &Value) -> Option<Duration> {
    let details = error.get("details")?.as_array()?;
    let delay = details.iter().find_map(|detail| detail.get("retryDelay"))?.as_str()?;
    let seconds: f64 = delay.strip_suffix('s')?.parse().ok()?;
    Duration::try_from_secs_f64(seconds).ok()
}

#[cfg(test)]
mod tests;
