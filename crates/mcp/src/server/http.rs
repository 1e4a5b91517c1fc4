//! The protocol by HTTP, on this machine, for who has the token.

use std::io;
use std::net::{SocketAddr, TcpListener};
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::{Context, Poll};
use std::time::Duration;

use axum::Router;
use axum::body::{Body, Bytes, HttpBody};
use axum::extract::{Request, State};
use axum::http::{Method, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse as _, Response};
use http_body::{Frame, SizeHint};
use rmcp::transport::streamable_http_server::session::local::LocalSessionManager;
use rmcp::transport::{StreamableHttpServerConfig, StreamableHttpService};
use spf_guard::{Access, Manner, Secret};
use tokio::sync::watch;

use super::{LOOK_UP, Server, leave};

/// Maximum number of connections: several clients, each with a running call and more beside it.
const CONNECTIONS: usize = 64;
/// Maximum wait for running calls at the end.
const GRACE: Duration = Duration::from_millis(700);
/// Maximum size of a request, bytes.
const BODY: usize = 1 << 20;

/// Serves `http://ADDRESS/mcp` until `stopped` says so, and then until the flight is over. Every request needs `Authorization: Bearer TOKEN`.
///
/// # Errors
/// The listener cannot be used.
pub fn serve_http(
    server: Server,
    listener: TcpListener,
    secret: Secret,
    stopped: impl Fn() -> bool + Send + 'static,
) -> io::Result<()> {
    let deck = server.deck.clone();
    let address = listener.local_addr()?;
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?;
    let stop = watch::Sender::new(false);
    let stopping = stop.subscribe();
    let served = runtime.block_on(async {
        drop(tokio::spawn(async move {
            while !stopped() {
                tokio::time::sleep(LOOK_UP).await;
            }
            stop.send_replace(true);
        }));
        let manner = Manner { most: CONNECTIONS, ..Manner::plain(GRACE) };
        spf_guard::serve(listener, router(server, secret), Access::at(address), stopping, manner).await
    });
    leave(&deck);
    runtime.shutdown_background();
    served
}

fn router(server: Server, secret: Secret) -> Router {
    // Host and Origin are checked for every request, before this one's own checks.
    let config = StreamableHttpServerConfig::default().enforce_origin_validation().with_max_request_body_bytes(BODY);
    let service = StreamableHttpService::new(move || Ok(server.clone()), LocalSessionManager::default().into(), config);
    let guarded = middleware::from_fn_with_state(Arc::new(secret), bearer);
    spf_guard::with_headers(Router::new().nest_service("/mcp", service).layer(middleware::from_fn(heard)).layer(guarded))
}

/// Whether somebody still reads the answer of a call: an extension of its request. Sessions of older revisions outlive their streams.
#[derive(Clone)]
pub(super) struct Read(Arc<AtomicBool>);

impl Read {
    pub(super) fn is_read(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Watches over the streams of answers.
async fn heard(mut request: Request, next: Next) -> Response {
    let read = Read(Arc::new(AtomicBool::new(true)));
    let is_call = request.method() == Method::POST;
    if is_call {
        request.extensions_mut().insert(read.clone());
    }
    let response = next.run(request).await;
    if is_call { response.map(|body| Body::new(Answered { body, read })) } else { response }
}

/// The body of an answer. A client may close it once it has what it waited for.
struct Answered {
    body: Body,
    read: Read,
}

impl HttpBody for Answered {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, Self::Error>>> {
        Pin::new(&mut self.body).poll_frame(cx)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

impl Drop for Answered {
    fn drop(&mut self) {
        self.read.0.store(false, Ordering::Relaxed);
    }
}

/// Refuses requests without the token.
async fn bearer(State(secret): State<Arc<Secret>>, request: Request, next: Next) -> Response {
    let given = request.headers().get(header::AUTHORIZATION).and_then(|value| value.to_str().ok()?.strip_prefix("Bearer "));
    if given.is_some_and(|given| secret.is(given)) {
        return next.run(request).await;
    }
    let why = "the token is missing or wrong: send `Authorization: Bearer TOKEN` with what `spf mcp --http` has printed\n";
    (StatusCode::UNAUTHORIZED, [(header::WWW_AUTHENTICATE, "Bearer")], why).into_response()
}

/// The address of a server, for its clients.
#[must_use]
pub fn url(address: SocketAddr) -> String {
    format!("http://{address}/mcp")
}
