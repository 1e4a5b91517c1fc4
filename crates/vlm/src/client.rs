//! One request and its response: streamed, limited in time and size, ended as soon as the reply is complete.

use std::future::Future;
use std::time::Instant;

use bytes::Bytes;
use reqwest::header::{CONTENT_TYPE, HeaderMap, HeaderValue, RETRY_AFTER};
use serde_json::Value;
use spf_core::grounding::GroundingProfile;
use spf_core::reply::ReplyStream;
use spf_core::time::Duration;

use crate::error::{VlmError, quote};
use crate::key::ApiKey;
use crate::upload::{Upload, Uploaded};
use crate::usage::StageTimes;
use crate::wire::sse::Events;
use crate::wire::{Gathered, WireKind, error_of};

/// Maximum size of a response, bytes.
pub(crate) const MAX_ANSWER: usize = 2 << 20;

/// Maximum bytes and time for reading the rest of a response after it was cut off.
const DRAINED: usize = 64 << 10;
const DRAINING: Duration = Duration::from_millis(300);

/// Destination of requests.
#[derive(Clone, Debug)]
pub(crate) struct Endpoint {
    /// Host and port, for messages.
    pub(crate) host: String,
    /// Base URL without trailing slash.
    pub(crate) base: String,
    /// The key and other headers required by the vendor.
    pub(crate) headers: HeaderMap,
    /// Request format.
    pub(crate) wire: WireKind,
    /// The key, to be masked in responses.
    pub(crate) key: Option<ApiKey>,
    /// Whether the vendor reports the cost of a reply at its end.
    pub(crate) reports_cost: bool,
}

impl Endpoint {
    /// Masks the key in external text, since vendors repeat it in errors.
    pub(crate) fn scrub(&self, words: String) -> String {
        self.key.as_ref().map_or_else(|| words.clone(), |key| key.scrub(&words))
    }
}

/// The state of an exchange, available if it times out.
#[derive(Debug, Default)]
pub(crate) struct Exchange {
    pub(crate) parts: StageTimes,
    pub(crate) gathered: Gathered,
    /// When the request was sent completely.
    pub(crate) uploaded: Uploaded,
    /// Bytes received so far.
    pub(crate) received: usize,
    /// Whether we ended the stream, before it reported its tokens.
    pub(crate) cut: bool,
    /// Whether it timed out.
    pub(crate) given_up: bool,
    /// When the first byte of the reply must have come.
    pub(crate) first_byte: Option<FirstByte>,
}

/// The time limit of the first byte of a reply.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FirstByte {
    /// When it must have come.
    pub(crate) until: Instant,
    /// How long that is.
    pub(crate) time: Duration,
}

/// How long the costs of a complete reply are awaited.
const LINGERING: Duration = Duration::from_millis(300);

/// When a reply counts as complete before the response ends.
pub(crate) enum Enough {
    /// As soon as a reply in these coordinates is complete; with its obstacles if the flag is set.
    Reply(GroundingProfile, bool),
    /// Never.
    Whole,
}

impl Exchange {
    /// Sends a request and reads the reply text.
    pub(crate) async fn run(
        &mut self,
        client: &reqwest::Client,
        endpoint: &Endpoint,
        path: &str,
        body: Bytes,
        enough: Enough,
        began: Instant,
    ) -> Result<String, VlmError> {
        let host = &endpoint.host;
        let request = client
            .post(format!("{}{path}", endpoint.base))
            .headers(endpoint.headers.clone())
            .header(CONTENT_TYPE, HeaderValue::from_static("application/json"))
            .body(reqwest::Body::wrap(Upload::new(body, self.uploaded.clone())));
        let response = self.first(host, request.send()).await?.map_err(|error| unreachable(host, &error))?;
        let since = |began: Instant| Some(began.elapsed().as_secs_f64());
        self.parts.head_s = since(began);
        let status = response.status().as_u16();
        let content_type = response.headers().get(CONTENT_TYPE).and_then(|value| value.to_str().ok()).unwrap_or("").to_owned();
        if !(200..300).contains(&status) {
            let wait = retry_after(response.headers());
            let body = self.whole(host, response).await?;
            return Err(refusal(host, status, &content_type, &body, wait));
        }
        if content_type.to_lowercase().starts_with("text/event-stream") {
            self.stream(endpoint, response, enough, began).await?;
        } else {
            let body = self.whole(host, response).await?;
            self.read_whole(endpoint, status, &content_type, &body)?;
        }
        self.parts.complete_s = since(began);
        self.parts.first_text_s = self.parts.first_text_s.or(self.parts.complete_s);
        if self.cut { Ok(self.gathered.text.clone()) } else { self.gathered.finish(host) }
    }

    /// Awaits something that must come before the first byte is due.
    async fn first<T>(&mut self, host: &str, work: impl Future<Output = T>) -> Result<T, VlmError> {
        let Some(FirstByte { until, time }) = self.first_byte else { return Ok(work.await) };
        tokio::time::timeout_at(until.into(), work).await.map_err(|_| {
            self.given_up = true;
            VlmError::Stalled { host: host.to_owned(), waited: time, stage: "data" }
        })
    }

    /// The next piece of a response.
    async fn chunk(&mut self, host: &str, response: &mut reqwest::Response) -> Result<Option<Bytes>, VlmError> {
        let piece = if self.received == 0 { self.first(host, response.chunk()).await? } else { response.chunk().await };
        piece.map_err(|error| broken_off(host, &error))
    }

    async fn whole(&mut self, host: &str, mut response: reqwest::Response) -> Result<Vec<u8>, VlmError> {
        let mut body = Vec::new();
        while let Some(piece) = self.chunk(host, &mut response).await? {
            self.take(host, piece.len())?;
            body.extend_from_slice(&piece);
        }
        Ok(body)
    }

    fn take(&mut self, host: &str, bytes: usize) -> Result<(), VlmError> {
        self.received += bytes;
        if self.received > MAX_ANSWER {
            return Err(VlmError::TooLong { host: host.to_owned(), limit: MAX_ANSWER });
        }
        Ok(())
    }

    fn read_whole(&mut self, endpoint: &Endpoint, status: u16, content_type: &str, body: &[u8]) -> Result<(), VlmError> {
        let host = &endpoint.host;
        match serde_json::from_slice::<Value>(body) {
            // Accept servers that stream without being asked to, or without declaring it.
            Err(_) if body.starts_with(b"data:") || body.starts_with(b"event:") => {
                let mut events = Events::default();
                let pieces = [events.push(body), events.finish()].concat();
                pieces.iter().try_for_each(|data| self.event(endpoint, data))
            }
            Err(error) => Err(no_json(host, status, content_type, body, &error)),
            Ok(object) => endpoint.wire.read(host, &object, &mut self.gathered),
        }
    }

    async fn stream(
        &mut self,
        endpoint: &Endpoint,
        mut response: reqwest::Response,
        enough: Enough,
        began: Instant,
    ) -> Result<(), VlmError> {
        let host = &endpoint.host;
        let mut events = Events::default();
        let mut reply = match enough {
            Enough::Reply(profile, avoid) => Some(ReplyStream::new(profile, avoid)),
            Enough::Whole => None,
        };
        let mut seen = 0;
        // Until when costs are awaited, once the reply is complete.
        let mut linger: Option<Instant> = None;
        loop {
            let next = self.chunk(host, &mut response);
            let piece = match linger {
                None => next.await?,
                // Without its costs the reply is as good.
                Some(until) => match tokio::time::timeout_at(until.into(), next).await {
                    Ok(Ok(piece)) => piece,
                    Ok(Err(_)) | Err(_) => {
                        self.end_early(response);
                        return Ok(());
                    }
                },
            };
            let Some(piece) = piece else { break };
            self.take(host, piece.len())?;
            for data in events.push(&piece) {
                self.event(endpoint, &data)?;
            }
            if events.overflowed() {
                return Err(VlmError::TooLong { host: host.clone(), limit: MAX_ANSWER });
            }
            if !self.gathered.text.is_empty() {
                self.parts.first_text_s.get_or_insert_with(|| began.elapsed().as_secs_f64());
            }
            if let Some(reply) = &mut reply {
                reply.push(&self.gathered.text[seen..]);
                seen = self.gathered.text.len();
                // Everything that arrived with the closing bracket has been read, including the token counts if
                // present.
                if reply.early().is_some() {
                    if !endpoint.reports_cost || self.gathered.cost_usd.is_some() {
                        self.end_early(response);
                        return Ok(());
                    }
                    linger.get_or_insert_with(|| Instant::now() + LINGERING);
                }
            }
        }
        events.finish().iter().try_for_each(|data| self.event(endpoint, data))
    }

    /// Ends a stream whose reply is complete.
    fn end_early(&mut self, response: reqwest::Response) {
        self.cut = self.gathered.end.is_none();
        tokio::spawn(drain(response));
    }

    fn event(&mut self, endpoint: &Endpoint, data: &str) -> Result<(), VlmError> {
        if data.trim() == "[DONE]" {
            return Ok(());
        }
        let object: Value = serde_json::from_str(data).map_err(|error| VlmError::Malformed {
            host: endpoint.host.clone(),
            reason: format!("a stream event is not valid JSON: {}", quote(&error.to_string())),
        })?;
        endpoint.wire.read(&endpoint.host, &object, &mut self.gathered)
    }

    /// How far the exchange had come at the timeout.
    pub(crate) fn stage(&self) -> String {
        match (self.parts.head_s, self.received, self.gathered.text.len()) {
            (None, ..) => "no data received".to_owned(),
            (_, 0, _) => "reply headers received, but no body".to_owned(),
            (_, bytes, 0) => format!("{bytes} bytes received, but no text"),
            (_, _, characters) => format!("{characters} characters of text received, but not the end"),
        }
    }
}

/// Reads the short rest of a response after it was cut off, so that its connection can be reused; if the vendor
/// continues to send, the connection is closed.
async fn drain(mut response: reqwest::Response) {
    let rest = async {
        let mut left = DRAINED;
        while let Ok(Some(piece)) = response.chunk().await {
            left = left.saturating_sub(piece.len());
            if left == 0 {
                return;
            }
        }
    };
    // Either way the response is dropped: read to its end, or with its connection.
    let _ = tokio::time::timeout(DRAINING, rest).await;
}

/// The error if no response arrived.
fn unreachable(host: &str, error: &reqwest::Error) -> VlmError {
    // The error contains the URL, which may hold private data.
    let mut reason = if error.is_timeout() { "no connection in time".to_owned() } else { String::new() };
    let mut source = std::error::Error::source(error);
    while let Some(cause) = source {
        let words = cause.to_string();
        if !reason.contains(&words) {
            reason = if reason.is_empty() { words } else { format!("{reason}: {words}") };
        }
        source = cause.source();
    }
    if reason.is_empty() {
        reason = "the request failed".to_owned();
    }
    let mut reason = quote(&reason);
    // The name used by rustls.
    if reason.contains("UnknownIssuer") {
        reason.push_str(" (untrusted certificate: set SSL_CERT_FILE to a file of trusted authorities)");
    }
    VlmError::Network { host: host.to_owned(), reason }
}

fn broken_off(host: &str, error: &reqwest::Error) -> VlmError {
    match unreachable(host, error) {
        VlmError::Network { host, reason } => VlmError::BrokenOff { host, reason },
        other => other,
    }
}

/// The error for an unsuccessful status.
fn refusal(host: &str, status: u16, content_type: &str, body: &[u8], wait: Option<Duration>) -> VlmError {
    let object = serde_json::from_slice::<Value>(body).ok();
    let error = object.as_ref().and_then(|object| error_of(host, status, object));
    let error = error.unwrap_or_else(|| match web_page(host, status, content_type, body) {
        Some(page) => page,
        None => {
            let message = match quote(&String::from_utf8_lossy(body)) {
                words if words.is_empty() => "no message".to_owned(),
                words => words,
            };
            VlmError::Vendor { host: host.to_owned(), status, code: None, message, retry_after: None }
        }
    });
    match error {
        VlmError::Vendor { host, status, code, message, retry_after } => {
            VlmError::Vendor { host, status, code, message, retry_after: wait.or(retry_after) }
        }
        other => other,
    }
}

fn no_json(host: &str, status: u16, content_type: &str, body: &[u8], error: &serde_json::Error) -> VlmError {
    if let Some(page) = web_page(host, status, content_type, body) {
        return page;
    }
    if body.iter().all(u8::is_ascii_whitespace) {
        return VlmError::Empty { host: host.to_owned(), reason: Some("empty body".to_owned()) };
    }
    if !content_type.to_lowercase().contains("json") {
        let content_type = if content_type.is_empty() { "no content type".to_owned() } else { quote(content_type) };
        return VlmError::ContentType { host: host.to_owned(), content_type };
    }
    VlmError::Malformed { host: host.to_owned(), reason: quote(&error.to_string()) }
}

/// Recognises an HTML page, by content type or first bytes.
fn web_page(host: &str, status: u16, content_type: &str, body: &[u8]) -> Option<VlmError> {
    let text = String::from_utf8_lossy(&body[..body.len().min(4096)]);
    let lower = text.to_lowercase();
    let begins = lower.trim_start();
    if !content_type.to_lowercase().contains("html") && !begins.starts_with("<!doctype html") && !begins.starts_with("<html") {
        return None;
    }
    // ASCII lowercasing keeps offsets; a non-ASCII title is omitted rather than cut wrongly.
    let title = lower.find("<title>").zip(lower.find("</title>")).and_then(|(from, to)| text.get(from + 7..to)).map(quote);
    Some(VlmError::WebPage { host: host.to_owned(), status, title: title.filter(|title| !title.is_empty()) })
}

/// The waiting time requested in the response headers.
fn retry_after(headers: &HeaderMap) -> Option<Duration> {
    let text = |name: &str| headers.get(name).and_then(|value| value.to_str().ok()).map(str::trim);
    if let Some(millis) = text("retry-after-ms").and_then(|text| text.parse::<f64>().ok()) {
        return Duration::try_from_secs_f64(millis / 1000.0).ok();
    }
    let after = text(RETRY_AFTER.as_str())?;
    if let Ok(seconds) = after.parse::<f64>() {
        return Duration::try_from_secs_f64(seconds).ok();
    }
    let at = httpdate::parse_http_date(after).ok()?;
    at.duration_since(std::time::SystemTime::now()).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn web_pages_are_distinguished_from_errors() {
        let page = b"<!DOCTYPE html><html><head><title>502 Bad\nGateway</title></head>";
        let error = refusal("h", 502, "text/html", page, None);
        assert_eq!(error, VlmError::WebPage { host: "h".to_owned(), status: 502, title: Some("502 Bad Gateway".to_owned()) });
        assert!(error.may_retry());
        let plain = refusal("h", 500, "text/plain", b"oops", Some(Duration::from_secs(2)));
        assert_eq!((plain.code(), plain.retry_after()), ("server_error", Some(Duration::from_secs(2))));
        assert_eq!(
            no_json("h", 200, "text/plain", b"hello", &serde_json::from_str::<Value>("hello").unwrap_err()).code(),
            "content_type"
        );
        assert_eq!(
            no_json("h", 200, "text/html", b"<html>", &serde_json::from_str::<Value>("<").unwrap_err()).code(),
            "web_page"
        );
    }

    #[test]
    fn waits_are_read_in_every_form() {
        let of = |name: &'static str, value: &str| {
            let mut headers = HeaderMap::new();
            headers.insert(name, value.parse().unwrap());
            retry_after(&headers)
        };
        assert_eq!(of("retry-after-ms", "250"), Some(Duration::from_millis(250)));
        assert_eq!(of("retry-after", "46"), Some(Duration::from_secs(46)));
        let soon = std::time::SystemTime::now() + Duration::from_secs(30);
        let read = of("retry-after", &httpdate::fmt_http_date(soon)).unwrap();
        assert!((28.0..=30.0).contains(&read.as_secs_f64()), "{read:?}");
        assert_eq!((of("retry-after", "-1"), of("retry-after", "soon")), (None, None));
    }
}
