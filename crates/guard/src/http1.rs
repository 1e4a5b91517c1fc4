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
use tokio_rustls::{TlsAcceptor, rustls};

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
/// The first byte of a handshake of TLS (RFC 8446, 5.1).
const TLS_HANDSHAKE: u8 = 22;
/// Interval at which the end of the connections is checked at shutdown.
const GLANCE: Duration = Duration::from_millis(10);

/// The address from which a request comes: an extension of every request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Peer(pub IpAddr);

/// How a server serves.
#[derive(Clone)]
pub struct Manner {
    /// Maximum wait for its connections at the end.
    pub grace: Duration,
    /// Maximum number of connections.
    pub most: usize,
    /// With a certificate: TLS, and nothing but TLS.
    pub tls: Option<Arc<rustls::ServerConfig>>,
    /// Whether a WebSocket keeps its place only once its handler settles its [`Place`], when it knows who speaks: until then it
    /// may have to give it up ([`TurnedOut`]).
    pub greeted: bool,
}

impl Manner {
    /// Plain HTTP with [`CONNECTIONS`] connections.
    #[must_use]
    pub fn plain(grace: Duration) -> Self {
        Self { grace, most: CONNECTIONS, tls: None, greeted: false }
    }
}

/// Tells a WebSocket whose place is not settled that it must give it up: an extension of every request.
#[derive(Clone)]
pub struct TurnedOut(Arc<Notify>);

impl TurnedOut {
    /// Waits until it must.
    pub async fn wait(&self) {
        self.0.notified().await;
    }
}

/// Serves `router` until `stop` is true or its sender is gone, then closes the connections and waits for them.
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
    mut stop: watch::Receiver<bool>,
    manner: Manner,
) -> io::Result<()> {
    listener.set_nonblocking(true)?;
    let listener = tokio::net::TcpListener::from_std(listener)?;
    let access = Arc::new(access);
    let greeted = manner.greeted;
    let router =
        router.layer(middleware::from_fn(move |request: Request, next: Next| admit(access.clone(), greeted, request, next)));
    let (places, turned_away) = (ConnectionSlots::new(manner.most), Arc::new(AtomicUsize::new(0)));
    let tls = manner.tls.map(TlsAcceptor::from);
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
                let visit =
                    Visit { peer: Peer(peer.ip().to_canonical()), place, out, router: router.clone(), stop: stop.clone() };
                drop(tokio::spawn(visit.begin(stream, tls.clone())));
            }
            None if tls.is_none() => turn_away(stream, &turned_away, manner.most),
            None => {}
        }
    }
    drop(listener);
    let gone = async {
        while places.count() > 0 {
            tokio::time::sleep(GLANCE).await;
        }
    };
    drop(timeout(manner.grace, gone).await);
    Ok(())
}

/// One connection.
struct Visit {
    peer: Peer,
    place: Place,
    out: Arc<Notify>,
    router: Router,
    stop: watch::Receiver<bool>,
}

impl Visit {
    /// Serves it, after the handshake of TLS if that is spoken.
    async fn begin(self, stream: TcpStream, tls: Option<TlsAcceptor>) {
        drop(stream.set_nodelay(true));
        let Some(tls) = tls else {
            let socket = Socket::new(stream, self.place.clone());
            return self.converse(TokioIo::new(socket)).await;
        };
        let out = self.out.clone();
        let shaken = async {
            let mut first = [0];
            if stream.peek(&mut first).await.is_ok_and(|read| read == 1) && first[0] != TLS_HANDSHAKE {
                return not_tls(stream).await;
            }
            tls.accept(Socket::new(stream, self.place.clone())).await.ok()
        };
        let shaken = tokio::select! {
            shaken = timeout(HEAD_TIME, shaken) => shaken.ok().flatten(),
            () = out.notified() => None,
        };
        match shaken {
            Some(stream) => self.converse(TokioIo::new(stream)).await,
            None => tracing::debug!("no handshake of TLS"),
        }
    }

    /// Serves it until it ends or must give up its place.
    async fn converse(mut self, io: impl hyper::rt::Read + hyper::rt::Write + Unpin + Send + 'static) {
        let Self { peer, place, out, router, stop } = &mut self;
        let (held, peer, turned_out) = (place.clone(), *peer, TurnedOut(out.clone()));
        let service = service_fn(move |mut request: hyper::Request<Incoming>| {
            request.extensions_mut().insert(held.clone());
            request.extensions_mut().insert(peer);
            request.extensions_mut().insert(turned_out.clone());
            let routed = TowerToHyperService::new(router.clone());
            async move { hyper::service::Service::call(&routed, request.map(Body::new)).await.map_err(|never: Infallible| never) }
        });
        let connection = Builder::new()
            .timer(TokioTimer::new())
            .header_read_timeout(HEAD_TIME)
            .max_buf_size(HEAD_BYTES)
            .max_headers(HEADERS)
            .serve_connection(io, service)
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
}

/// Tells somebody who does not speak TLS that this server does.
async fn not_tls<T>(mut stream: TcpStream) -> Option<T> {
    let body = "this server speaks TLS: open its address with https://\n";
    let head = format!(
        "HTTP/1.1 400 Bad Request\r\ncontent-type: text/plain; charset=utf-8\r\ncontent-length: {}\r\nconnection: close\r\n\r\n",
        body.len()
    );
    let mut unread = [0; 4096];
    stream.write_all((head + body).as_bytes()).await.ok()?;
    stream.shutdown().await.ok()?;
    // Closing with unread data resets the connection, and the client would lose the answer.
    drop(stream.read(&mut unread).await);
    None
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
async fn admit(access: Arc<Access>, greeted: bool, request: Request, next: Next) -> Response {
    let mut response = check(access, greeted, request, next).await;
    if response.status() != StatusCode::SWITCHING_PROTOCOLS {
        response.headers_mut().insert(CONNECTION, HeaderValue::from_static("close"));
    }
    response
}

/// Checks a request and reads its body, before anything is done for it.
async fn check(access: Arc<Access>, greeted: bool, request: Request, next: Next) -> Response {
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
        if !greeted {
            settle();
        }
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
