//! The HTTP server of the page.

use std::net::{IpAddr, SocketAddr, TcpListener};
use std::sync::Arc;
use std::time::Duration;

use axum::extract::ws::WebSocketUpgrade;
use axum::extract::{Path, Request, State};
use axum::http::header::{self, HeaderName};
use axum::http::{HeaderMap, HeaderValue, StatusCode};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::{any, get};
use axum::{Extension, Router};
use spf_guard::{Access, Peer};
use tokio::sync::watch;

use crate::flights::Flights;
use crate::message::LONGEST;
use crate::page::{FILES, text};
use crate::shared::Shared;
use crate::{controlling, watching};

/// Maximum number of connections: a pilot's two sockets, a score of spectators, and files.
const CONNECTIONS: usize = 64;

/// Maximum wait for pages at the end.
const SHUTDOWN_GRACE: Duration = Duration::from_millis(700);

/// No external resources, no scripts but the page's own, and no embedding by other sites.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; media-src 'self'; \
                      connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// Serves until `stop`.
pub(crate) async fn serve(
    listener: TcpListener,
    address: SocketAddr,
    shared: Arc<Shared>,
    stop: watch::Receiver<bool>,
) -> std::io::Result<()> {
    spf_guard::serve_many(listener, router(shared), Access::at(address), stop, SHUTDOWN_GRACE, CONNECTIONS).await
}

fn router(shared: Arc<Shared>) -> Router {
    let mut router = Router::new()
        .route("/watch", any(watch))
        .route("/control", any(control))
        .route("/flights.json", get(flights))
        .route("/flight/{name}/{file}", get(flight));
    for (file, name) in FILES {
        router = router.route(file.0, get(async move || ([(header::CONTENT_TYPE, file.1)], text(file, name)).into_response()));
    }
    router.layer(middleware::from_fn(headed)).with_state(shared)
}

/// Adds security headers to every response.
async fn headed(request: Request, next: Next) -> Response {
    let mut response = next.run(request).await;
    let headers: [(HeaderName, &str); 6] = [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::X_FRAME_OPTIONS, "DENY"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CACHE_CONTROL, "no-store"),
        (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    ];
    for (name, value) in headers {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

async fn watch(State(shared): State<Arc<Shared>>, Extension(Peer(peer)): Extension<Peer>, upgrade: WebSocketUpgrade) -> Response {
    let limited = upgrade.max_message_size(LONGEST).max_frame_size(LONGEST).write_buffer_size(0);
    limited.on_upgrade(async move |socket| watching::converse(socket, &shared, peer).await)
}

async fn control(
    State(shared): State<Arc<Shared>>,
    Extension(Peer(peer)): Extension<Peer>,
    upgrade: WebSocketUpgrade,
) -> Response {
    let limited = upgrade.max_message_size(LONGEST).max_frame_size(LONGEST).write_buffer_size(0);
    limited.on_upgrade(async move |socket| controlling::converse(socket, &shared, peer).await)
}

/// The recorded flights, if they are served.
fn served(shared: &Shared, peer: IpAddr) -> Result<Flights, (StatusCode, &'static str)> {
    // Recordings hold prompts, and browsers fetch films without our tokens.
    if !shared.is_open_to(peer) {
        return Err((StatusCode::FORBIDDEN, "flights are shown on this machine only\n"));
    }
    shared.flights.clone().ok_or((StatusCode::NOT_FOUND, "no flights are served\n"))
}

/// Reads files in another thread: a slow disk must not delay the controls.
async fn read(shared: &Shared, peer: IpAddr, reading: impl FnOnce(&Flights) -> Response + Send + 'static) -> Response {
    let flights = match served(shared, peer) {
        Ok(flights) => flights,
        Err(refused) => return refused.into_response(),
    };
    let read = tokio::task::spawn_blocking(move || reading(&flights)).await;
    read.unwrap_or_else(|_| (StatusCode::INTERNAL_SERVER_ERROR, "the flights cannot be read\n").into_response())
}

async fn flights(State(shared): State<Arc<Shared>>, Extension(Peer(peer)): Extension<Peer>) -> Response {
    let list = |flights: &Flights| ([(header::CONTENT_TYPE, "application/json")], flights.list()).into_response();
    read(&shared, peer, list).await
}

async fn flight(
    State(shared): State<Arc<Shared>>,
    Extension(Peer(peer)): Extension<Peer>,
    Path((name, file)): Path<(String, String)>,
    headers: HeaderMap,
) -> Response {
    let range = headers.get(header::RANGE).and_then(|range| range.to_str().ok()).map(str::to_owned);
    read(&shared, peer, move |flights| flights.file(&name, &file, range.as_deref())).await
}
