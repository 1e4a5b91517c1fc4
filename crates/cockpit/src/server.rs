//! The HTTP server of the page.

use std::net::{IpAddr, SocketAddr, TcpListener};
use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::extract::ws::WebSocketUpgrade;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{any, delete, get, post};
use axum::{Extension, Router};
use spf_guard::{Access, Manner, Peer};
use tokio::sync::watch;

use crate::flights::Flights;
use crate::message::LONGEST;
use crate::page::{FILES, text};
use crate::shared::Shared;
use crate::visitor::Visitor;
use crate::{controlling, watching};

/// Maximum number of connections: a pilot's two sockets, a score of spectators, and files.
const CONNECTIONS: usize = 64;

/// Maximum wait for pages at the end.
const SHUTDOWN_GRACE: Duration = Duration::from_millis(700);

/// Serves until `stop`.
pub(crate) async fn serve(
    listener: TcpListener,
    address: SocketAddr,
    shared: Arc<Shared>,
    tls: Option<Arc<rustls::ServerConfig>>,
    stop: watch::Receiver<bool>,
) -> std::io::Result<()> {
    let manner = Manner { grace: SHUTDOWN_GRACE, most: CONNECTIONS, tls, greeted: true };
    let access = Access::at(address);
    let access = if manner.tls.is_some() { access.encrypted() } else { access };
    spf_guard::serve(listener, router(shared), access, stop, manner).await
}

fn router(shared: Arc<Shared>) -> Router {
    let mut router = Router::new()
        .route("/watch", any(watch))
        .route("/control", any(control))
        .route("/flights.json", get(flights))
        .route("/flight/{name}", delete(remove))
        .route("/flight/{name}/{file}", get(flight))
        .route("/again/{name}", post(again))
        .route("/report.html", get(report));
    for (file, name) in FILES {
        router = router.route(file.0, get(async move || ([(header::CONTENT_TYPE, file.1)], text(file, name)).into_response()));
    }
    spf_guard::with_headers(router).with_state(shared)
}

async fn watch(State(shared): State<Arc<Shared>>, visitor: Visitor, upgrade: WebSocketUpgrade) -> Response {
    limited(upgrade).on_upgrade(async move |socket| watching::converse(socket, &shared, &visitor).await)
}

async fn control(State(shared): State<Arc<Shared>>, visitor: Visitor, upgrade: WebSocketUpgrade) -> Response {
    limited(upgrade).on_upgrade(async move |socket| controlling::converse(socket, &shared, &visitor).await)
}

fn limited(upgrade: WebSocketUpgrade) -> WebSocketUpgrade {
    upgrade.max_message_size(LONGEST).max_frame_size(LONGEST).write_buffer_size(0)
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

/// The secret of a request; empty without one. No page of another site can send it.
fn bearer(headers: &HeaderMap) -> &str {
    headers.get(header::AUTHORIZATION).and_then(|secret| secret.to_str().ok()?.strip_prefix("Bearer ")).unwrap_or_default()
}

/// Deletes a flight, for who may fly: whoever else uses this machine may look only.
async fn remove(
    State(shared): State<Arc<Shared>>,
    Extension(Peer(peer)): Extension<Peer>,
    Path(name): Path<String>,
    headers: HeaderMap,
) -> Response {
    if let Err(why) = shared.controls.may_delete(bearer(&headers), peer, Instant::now()) {
        return (StatusCode::FORBIDDEN, format!("{why}\n")).into_response();
    }
    read(&shared, peer, move |flights| match flights.remove(&name) {
        Ok(done) => format!("{done}\n").into_response(),
        Err(why) => (StatusCode::CONFLICT, format!("{why}\n")).into_response(),
    })
    .await
}

/// Replays a flight, for who may fly: it takes the processor of the machine that flies.
async fn again(
    State(shared): State<Arc<Shared>>,
    Extension(Peer(peer)): Extension<Peer>,
    Path(name): Path<String>,
    headers: HeaderMap,
) -> Response {
    if let Err(why) = shared.controls.may_replay(bearer(&headers), peer, Instant::now()) {
        return (StatusCode::FORBIDDEN, format!("{why}\n")).into_response();
    }
    let Ok(turn) = shared.replays.clone().try_acquire_owned() else {
        return (StatusCode::TOO_MANY_REQUESTS, "another flight is being replayed: try again\n").into_response();
    };
    let controls = shared.controls.clone();
    read(&shared, peer, move |flights| {
        // Until the replay is over, whether somebody still waits for it or not.
        let _turn = turn;
        match flights.again(&name, || controls.is_flying()) {
            Ok(told) => ([(header::CONTENT_TYPE, "application/json")], told).into_response(),
            Err(why) => (StatusCode::CONFLICT, format!("{why}\n")).into_response(),
        }
    })
    .await
}

/// The bench's report, which has a style sheet of its own and no scripts.
async fn report(State(shared): State<Arc<Shared>>, Extension(Peer(peer)): Extension<Peer>) -> Response {
    const POLICY: &str = "sandbox; default-src 'none'; style-src 'unsafe-inline'; img-src data:; frame-ancestors 'none'";
    let headers = [(header::CONTENT_TYPE, "text/html; charset=utf-8"), (header::CONTENT_SECURITY_POLICY, POLICY)];
    let page = |flights: &Flights| match flights.report() {
        Some(page) => (headers, page).into_response(),
        None => (StatusCode::NOT_FOUND, "no report here\n").into_response(),
    };
    read(&shared, peer, page).await
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
