//! MJPEG by HTTP.

use std::time::Duration;

use http_auth::{PasswordClient, PasswordParams};
use reqwest::header::{AUTHORIZATION, CONTENT_TYPE, WWW_AUTHENTICATE};
use reqwest::{Client, Response, StatusCode};
use spf_drone::frames::VideoStats;

use super::{SILENCE, runtime, unless_stopped};
use crate::address::{Credentials, Server};
use crate::failure::{SourceError, reason};
use crate::feed::{Feed, Packets};
use crate::mjpeg::PartReader;

/// Time for a connection and for the header of the answer.
const ANSWER_TIME: Duration = Duration::from_secs(10);

/// Receives JPEG images.
pub(super) fn mjpeg(server: &Server, feed: &mut Feed) -> Result<(), SourceError> {
    runtime()?.block_on(receive(server, feed))
}

async fn receive(server: &Server, feed: &mut Feed) -> Result<(), SourceError> {
    let Some(answer) = unless_stopped(feed, ask(server), ANSWER_TIME).await else { return Ok(()) };
    let mut answer = answer.ok_or_else(SourceError::no_answer)??;
    let kind = answer.headers().get(CONTENT_TYPE).and_then(|kind| kind.to_str().ok()).unwrap_or("").to_ascii_lowercase();
    // Cameras without a type, and with a wrong one, are read; a page for people is none.
    if ["text/", "application/json", "video/", "audio/"].iter().any(|wrong| kind.starts_with(wrong)) {
        let kind = kind.split(';').next().unwrap_or("").chars().filter(char::is_ascii_graphic).take(40).collect();
        return Err(SourceError::NoImages(kind));
    }
    let (mut reader, mut parts) = (PartReader::default(), Vec::new());
    loop {
        let Some(chunk) = unless_stopped(feed, answer.chunk(), SILENCE).await else { return Ok(()) };
        let chunk = chunk.ok_or(SourceError::Silent(SILENCE.as_secs()))?.map_err(|error| connection(&error))?;
        let Some(chunk) = chunk else {
            return Err(if kind.starts_with("image/") { SourceError::Still } else { SourceError::Ended });
        };
        let at = feed.now();
        reader.push(&chunk, &mut parts);
        feed.tally(VideoStats { damaged: reader.damaged(), ..VideoStats::default() }, Packets::default());
        // What came together with a newer image is old.
        feed.superseded(parts.len().saturating_sub(1));
        if let Some(part) = parts.drain(..).next_back() {
            feed.jpeg(at, part.timestamp.map(|seconds| (seconds * 1e9) as i64), None, part.jpeg);
        }
    }
}

/// Sends the request, and once more with user name and password if the server asks for them.
async fn ask(server: &Server) -> Result<Response, SourceError> {
    // Fails if another part of the program was first, which is just as well.
    drop(rustls::crypto::ring::default_provider().install_default());
    // A camera is in the local network, whatever the proxy for web pages.
    let client = Client::builder().no_proxy().connect_timeout(ANSWER_TIME).build().map_err(|error| connection(&error))?;
    let answer = client.get(&server.url).send().await.map_err(|error| connection(&error))?;
    let answer = match (&server.credentials, answer.status()) {
        (Some(credentials), StatusCode::UNAUTHORIZED) => {
            // The challenge is that of the server to which it redirected, which must be the same, at the same port and as secret.
            if reqwest::Url::parse(&server.url).is_ok_and(|url| url.origin() != answer.url().origin()) {
                return Err(SourceError::Elsewhere);
            }
            let authorization = authorization(&answer, credentials)?;
            let again = client.get(answer.url().clone()).header(AUTHORIZATION, authorization);
            again.send().await.map_err(|error| connection(&error))?
        }
        _ => answer,
    };
    match answer.status() {
        status if status.is_success() => Ok(answer),
        StatusCode::UNAUTHORIZED => Err(SourceError::Refused { given: server.credentials.is_some() }),
        status => Err(SourceError::Status { code: status.as_u16(), reason: reason(status.as_u16()) }),
    }
}

/// The header that answers the server's challenge (RFC 7617 and RFC 7616).
fn authorization(answer: &Response, credentials: &Credentials) -> Result<String, SourceError> {
    let mut builder = PasswordClient::builder();
    for challenge in answer.headers().get_all(WWW_AUTHENTICATE) {
        if let Ok(challenge) = challenge.to_str() {
            builder = builder.challenges(challenge);
        }
    }
    let url = answer.url();
    let uri = url.query().map_or_else(|| url.path().to_owned(), |query| format!("{}?{query}", url.path()));
    let params = PasswordParams {
        username: &credentials.user,
        password: &credentials.password,
        uri: &uri,
        method: "GET",
        body: Some(&[]),
    };
    // The texts of the crate may quote what it was given.
    builder.build().and_then(|mut client| client.respond(&params)).map_err(|_| SourceError::Refused { given: true })
}

/// The cause of a failure, without the address.
fn connection(error: &reqwest::Error) -> SourceError {
    let mut cause: &dyn std::error::Error = error;
    while let Some(source) = cause.source() {
        cause = source;
    }
    let why = if std::ptr::addr_eq(cause, error) {
        if error.is_timeout() { "no connection in time".to_owned() } else { "the address or the answer is invalid".to_owned() }
    } else {
        cause.to_string()
    };
    SourceError::connection(why, cause.downcast_ref())
}
