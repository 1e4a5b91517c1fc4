//! An HTTP server whose connections, times and sizes are bounded.
//!
//! Not `axum::serve`: it bounds neither the number of connections nor the time in which a request must come.

use std::convert::Infallible;
use std::io;
use std::net::{IpAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use axum::Router;
use axum::body::{Body, to_bytes};
use axum::extract::Request;
use axum::http::header::{CONNECTION, CONTENT_LENGTH, UPGRADE};
use axum::http::{HeaderValue, StatusCode};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use hyper::body::Incoming;
use hyper::server::conn::http1::Builder;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;
use tokio::sync::{Notify, watch};
use tokio::time::timeout;

use crate::socket::Socket;
use crate::{Access, BODY_BYTES, BODY_TIME, CONNECTIONS, ConnectionSlots, HEAD_BYTES, HEAD_TIME, Place};

/// Maximum number of headers.
const HEADERS: usize = 64;
/// Interval of attempts if no connection can be accepted, usually because of too many open files.
const ACCEPT_AGAIN: Duration = Duration::from_millis(100);
/// Maximum number of clients that are told that there is no place, and the time limit for it; others are disconnected.
const TURNED_AWAY: usize = 8;
const TURNING_AWAY: Duration = Duration::from_secs(1);
/// Maximum number of WebSockets from one address other than this machine's, so that one stranger does not take all places.
const KEPT: usize = 16;
/// Interval at which the end of the connections is checked at shutdown.
const GLANCE: Duration = Duration::from_millis(10);

/// The address from which a request comes: an extension of every request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Peer(pub IpAddr);

/// Serves `router` until `stop` is true or its sender is gone, then closes the connections and waits up to `grace` for
/// them.
///
/// Every request is checked: who asks, the time of its head and body, its size; handlers receive a complete body. A
/// connection carries one request, or a WebSocket, which is no longer limited in time: whoever serves it must be.
///
/// # Errors
/// The operating system's error if the listener cannot be used.
pub async fn serve(
    listener: TcpListener,
    router: Router,
    access: Access,
    stop: watch::Receiver<bool>,
    grace: Duration,
) -> io::Result<()> {
    serve_many(listener, router, access, stop, grace, CONNECTIONS).await
}

/// The same with up to `most` connections.
///
/// # Errors
/// As for [`serve`].
pub async fn serve_many(
    listener: TcpListener,
    router: Router,
    access: Access,
    mut stop: watch::Receiver<bool>,
    grace: Duration,
    most: usize,
) -> io::Result<()> {
    listener.set_nonblocking(true)?;
    let listener = tokio::net::TcpListener::from_std(listener)?;
    let access = Arc::new(access);
    let router = router.layer(middleware::from_fn(move |request: Request, next: Next| admit(access.clone(), request, next)));
    let (places, turned_away) = (ConnectionSlots::new(most), Arc::new(AtomicUsize::new(0)));
    loop {
        let accepted = tokio::select! {
            accepted = listener.accept() => accepted,
            // A dropped sender also means the end.
            _ = stop.wait_for(|stop| *stop) => break,
        };
        let Ok((stream, peer)) = accepted else {
            tokio::time::sleep(ACCEPT_AGAIN).await;
            continue;
        };
        let out = Arc::new(Notify::new());
        let turn_out = out.clone();
        match places.enter(move || turn_out.notify_one()) {
            Some(place) => {
                drop(tokio::spawn(converse(stream, Peer(peer.ip().to_canonical()), place, out, router.clone(), stop.clone())))
            }
            None => turn_away(stream, &turned_away, most),
        }
    }
    drop(listener);
    let gone = async {
        while places.count() > 0 {
            tokio::time::sleep(GLANCE).await;
        }
    };
    drop(timeout(grace, gone).await);
    Ok(())
}

/// One connection, until it ends or must give up its place.
async fn converse(
    stream: TcpStream,
    peer: Peer,
    place: Place,
    out: Arc<Notify>,
    router: Router,
    mut stop: watch::Receiver<bool>,
) {
    drop(stream.set_nodelay(true));
    let held = place.clone();
    let service = service_fn(move |mut request: hyper::Request<Incoming>| {
        request.extensions_mut().insert(held.clone());
        request.extensions_mut().insert(peer);
        let routed = TowerToHyperService::new(router.clone());
        async move { hyper::service::Service::call(&routed, request.map(Body::new)).await.map_err(|never: Infallible| never) }
    });
    let connection = Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEAD_TIME)
        .max_buf_size(HEAD_BYTES)
        .max_headers(HEADERS)
        .serve_connection(TokioIo::new(Socket::new(stream, place)), service)
        .with_upgrades();
    tokio::pin!(connection);
    let mut stopping = false;
    loop {
        tokio::select! {
            ended = connection.as_mut() => {
                if let Err(error) = ended {
                    tracing::debug!(%error, "connection ended");
                }
                return;
            }
            () = out.notified() => {
                tracing::debug!("idle connection closed to make room for a new one");
                return;
            }
            _ = stop.wait_for(|stop| *stop), if !stopping => {
                stopping = true;
                connection.as_mut().graceful_shutdown();
            }
        }
    }
}

/// Tells a client that there is no place, without a place for it.
fn turn_away(mut stream: TcpStream, turned_away: &Arc<AtomicUsize>, most: usize) {
    if turned_away.fetch_add(1, Ordering::Relaxed) >= TURNED_AWAY {
        turned_away.fetch_sub(1, Ordering::Relaxed);
        return;
    }
    let turned_away = turned_away.clone();
    drop(tokio::spawn(async move {
        let body = format!("all {most} connections are in use: close a page or another client, or try again\n");
        let head = format!(
            "HTTP/1.1 503 Service Unavailable\r\ncontent-type: text/plain; charset=utf-8\r\ncontent-length: {}\r\nretry-after: 1\r\n\
             connection: close\r\n\r\n",
            body.len()
        );
        let told = async {
            stream.write_all((head + &body).as_bytes()).await?;
            stream.shutdown().await?;
            // Closing with unread data resets the connection, and the client would lose the answer.
            let (mut unread, mut left) = ([0; 4096], HEAD_BYTES);
            while left > 0 {
                match stream.read(&mut unread).await? {
                    0 => break,
                    length => left = left.saturating_sub(length),
                }
            }
            io::Result::Ok(())
        };
        drop(timeout(TURNING_AWAY, told).await);
        turned_away.fetch_sub(1, Ordering::Relaxed);
    }));
}

/// Answers a request if it is admitted. The next request is a new connection, since an idle one would hold a place; a
/// connection that becomes a WebSocket goes on.
async fn admit(access: Arc<Access>, request: Request, next: Next) -> Response {
    let mut response = check(access, request, next).await;
    if response.status() != StatusCode::SWITCHING_PROTOCOLS {
        response.headers_mut().insert(CONNECTION, HeaderValue::from_static("close"));
    }
    response
}

/// Checks a request and reads its body, before anything is done for it.
async fn check(access: Arc<Access>, request: Request, next: Next) -> Response {
    if let Err(refusal) = access.check(request.method(), request.headers()) {
        return refused(StatusCode::FORBIDDEN, &refusal.to_string());
    }
    let place = request.extensions().get::<Place>().cloned();
    let settle = || place.iter().for_each(Place::settle);
    if request.headers().contains_key(UPGRADE) {
        let peer = request.extensions().get::<Peer>().map(|peer| peer.0).filter(|peer| !peer.is_loopback());
        if let (Some(place), Some(peer)) = (&place, peer)
            && !place.keep(peer, KEPT)
        {
            return refused(StatusCode::TOO_MANY_REQUESTS, &format!("more than {KEPT} connections from {peer}: close a page"));
        }
        settle();
        return next.run(request).await;
    }
    let too_large = || refused(StatusCode::PAYLOAD_TOO_LARGE, &format!("the body exceeds {} MiB", BODY_BYTES >> 20));
    let length = request.headers().get(CONTENT_LENGTH).and_then(|length| length.to_str().ok()?.parse::<usize>().ok());
    if length.is_some_and(|length| length > BODY_BYTES) {
        return too_large();
    }
    let (head, body) = request.into_parts();
    let body = match timeout(BODY_TIME, to_bytes(body, BODY_BYTES)).await {
        Ok(Ok(body)) => body,
        Ok(Err(error)) if is_too_large(&error) => return too_large(),
        Ok(Err(_)) => return refused(StatusCode::BAD_REQUEST, "the body is incomplete"),
        Err(_) => return refused(StatusCode::REQUEST_TIMEOUT, &format!("the body took more than {} s", BODY_TIME.as_secs())),
    };
    settle();
    next.run(Request::from_parts(head, Body::from(body))).await
}

/// Whether a body was longer than allowed, and not broken off.
fn is_too_large(error: &axum::Error) -> bool {
    // The type is of a crate that is not ours to name; its name is.
    std::error::Error::source(error).is_some_and(|source| source.to_string().contains("length limit exceeded"))
}

fn refused(status: StatusCode, why: &str) -> Response {
    (status, format!("{why}\n")).into_response()
}
