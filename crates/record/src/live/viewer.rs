//! One viewer, in its own thread.

use std::collections::BTreeMap;
use std::io::{self, ErrorKind};
use std::net::TcpStream;
use std::sync::atomic::Ordering;
use std::sync::mpsc::TryRecvError;
use std::time::Duration;

use spf_guard::{DeadlineStream, HEAD_TIME, Place, Refusal};
use tungstenite::handshake::server::{ErrorResponse, Request as Hello, Response};
use tungstenite::http::{
    HeaderValue, StatusCode,
    header::{ORIGIN, SEC_WEBSOCKET_PROTOCOL},
};
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Error, Message as Frame, WebSocket, accept_hdr_with_config};

use super::protocol::{self, Request, SUBPROTOCOLS};
use super::{GLANCE, Shared, Subscription};

/// Time limit for a viewer to accept data: then it is disconnected.
const PATIENCE: Duration = Duration::from_secs(5);
/// Maximum size of a viewer's request, bytes.
const LONGEST: usize = 64 * 1024;
/// Maximum number of subscriptions of one viewer.
const SUBSCRIPTIONS: usize = 256;

/// Serves a viewer until it disconnects, is too slow, or the flight is over.
pub(super) fn serve(stream: TcpStream, shared: &Shared, place: &Place) {
    let Some(subscription) = shared.subscriber() else { return };
    match greet(stream, shared, place).and_then(|socket| show(socket, &subscription)) {
        Ok(()) | Err(Error::ConnectionClosed | Error::AlreadyClosed) => {}
        Err(error) => tracing::debug!(%error, "viewer disconnected"),
    }
}

fn greet(stream: TcpStream, shared: &Shared, place: &Place) -> Result<WebSocket<DeadlineStream>, Error> {
    stream.set_write_timeout(Some(PATIENCE))?;
    stream.set_nodelay(true)?;
    let config = WebSocketConfig::default().max_message_size(Some(LONGEST)).max_frame_size(Some(LONGEST));
    #[allow(clippy::result_large_err, reason = "the type is given by the handshake API")]
    let answer = |hello: &Hello, response: Response| {
        let response = choose(hello, response, shared)?;
        place.settle();
        Ok(response)
    };
    let shaken = accept_hdr_with_config(DeadlineStream::new(stream, HEAD_TIME), answer, Some(config));
    let mut socket = shaken.map_err(|error| Error::Io(io::Error::other(error.to_string())))?;
    socket.get_mut().unlimited();
    socket.get_ref().get_ref().set_write_timeout(Some(PATIENCE))?;
    socket.send(Frame::text(protocol::greeting(&shared.name)))?;
    socket.send(Frame::text(protocol::advertisement(&shared.topics)))?;
    socket.get_ref().get_ref().set_read_timeout(Some(GLANCE))?;
    Ok(socket)
}

/// The first supported subprotocol that the viewer offers; an error if there is none, or if it may not connect.
#[allow(clippy::result_large_err, reason = "the type is given by the handshake API")]
fn choose(hello: &Hello, mut response: Response, shared: &Shared) -> Result<Response, ErrorResponse> {
    let refused = |status: StatusCode, why: String| {
        let mut refusal = ErrorResponse::new(Some(why));
        *refusal.status_mut() = status;
        refusal
    };
    if let Err(refusal) = shared.access.check(hello.method(), hello.headers()) {
        let origin = hello.headers().get(ORIGIN).map(|origin| String::from_utf8_lossy(origin.as_bytes()).into_owned());
        if let Some(origin) = origin.filter(|_| refusal == Refusal::Origin)
            && !shared.refused.swap(true, Ordering::Relaxed)
        {
            tracing::warn!("live view: a page from {origin:?} was refused; if it is your viewer, allow it with SPF_LIVE_ORIGIN");
        }
        return Err(refused(StatusCode::FORBIDDEN, format!("{refusal}\n")));
    }
    let offered: Vec<&str> = hello
        .headers()
        .get_all(SEC_WEBSOCKET_PROTOCOL)
        .iter()
        .filter_map(|value| value.to_str().ok())
        .flat_map(|value| value.split(','))
        .map(str::trim)
        .collect();
    match SUBPROTOCOLS.into_iter().find(|name| offered.contains(name)) {
        Some(name) => {
            response.headers_mut().insert(SEC_WEBSOCKET_PROTOCOL, HeaderValue::from_static(name));
            Ok(response)
        }
        None => {
            let why = format!("use one of the subprotocols {}\n", SUBPROTOCOLS.join(", "));
            Err(refused(StatusCode::BAD_REQUEST, why))
        }
    }
}

/// Alternates between reading requests and sending messages.
fn show(mut socket: WebSocket<DeadlineStream>, subscription: &Subscription<'_>) -> Result<(), Error> {
    // The viewer's own ids for topics.
    let mut subscriptions: BTreeMap<u32, usize> = BTreeMap::new();
    loop {
        match socket.read() {
            Ok(Frame::Text(text)) => {
                if let Ok(request) = serde_json::from_str(&text) {
                    take(request, &mut subscriptions, subscription);
                }
            }
            Ok(_) => {}
            Err(Error::Io(error)) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(error) => return Err(error),
        }
        let left_out = subscription.left_out.swap(0, Ordering::Relaxed);
        if left_out > 0 {
            socket.send(Frame::text(protocol::left_out(left_out)))?;
        }
        // At most what is queued now: a continuous stream of messages must not prevent reading the viewer's requests.
        for _ in 0..super::WAITING {
            match subscription.queue.try_recv() {
                Ok(message) => {
                    let wanted = subscriptions.iter().filter(|(_, topic)| **topic == message.topic);
                    for (&id, _) in wanted {
                        socket.write(Frame::Binary(protocol::message(id, &message)))?;
                    }
                }
                Err(TryRecvError::Empty) => break,
                // The flight is over.
                Err(TryRecvError::Disconnected) => {
                    socket.flush()?;
                    return socket.close(None);
                }
            }
        }
        socket.flush()?;
    }
}

fn take(request: Request, subscriptions: &mut BTreeMap<u32, usize>, subscription: &Subscription<'_>) {
    match request {
        Request::Subscribe { subscriptions: wanted } => {
            for entry in wanted {
                let topic = usize::try_from(entry.channel_id).ok().filter(|topic| *topic < subscription.shared.topics.len());
                if let Some(topic) = topic
                    && subscriptions.len() < SUBSCRIPTIONS
                {
                    subscriptions.insert(entry.id, topic);
                    subscription.subscribe(topic);
                }
            }
        }
        Request::Unsubscribe { subscription_ids } => {
            for id in subscription_ids {
                if let Some(topic) = subscriptions.remove(&id)
                    && !subscriptions.values().any(|other| *other == topic)
                {
                    subscription.unsubscribe(topic);
                }
            }
        }
        Request::Other => {}
    }
}
