//! The server of the page.

use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use axum::Router;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::{Request, State};
use axum::http::header::{self, HeaderName};
use axum::http::{HeaderValue, StatusCode};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::{any, get};
use tokio::sync::watch;

use super::message::LONGEST;
use super::{Beginning, Library, guard, session};

/// Most pages at once; each flies and draws in a thread of its own.
const MOST_PAGES: usize = 8;
/// How long the end waits for pages to be told, a little longer than each of them is heard out.
const SHUTDOWN_GRACE: Duration = session::SHUTDOWN_GRACE.saturating_add(Duration::from_millis(200));

/// Nothing is loaded from elsewhere, nothing runs but the page's own script, no other site may frame it.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self'; \
                      base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// Why there is no server.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ViewError {
    /// The address cannot be listened on.
    #[error("cannot listen on {address}")]
    Listen {
        /// What was asked for.
        address: SocketAddr,
        /// Why not.
        #[source]
        source: std::io::Error,
    },
    /// The system's sockets or threads failed.
    #[error("the server failed")]
    Server(#[source] std::io::Error),
}

/// Ends a server, from any thread.
#[derive(Clone, Debug)]
pub struct Stopper(watch::Sender<bool>);

impl Stopper {
    /// Tells all pages good-bye and ends [`Viewer::serve`].
    pub fn stop(&self) {
        self.0.send_replace(true);
    }
}

/// A server that listens and does not answer yet.
#[derive(Debug)]
pub struct Viewer {
    listener: TcpListener,
    address: SocketAddr,
    stop: Stopper,
}

struct Shared {
    library: Arc<Library>,
    beginning: Beginning,
    loopback: bool,
    pages: AtomicUsize,
    stop: watch::Receiver<bool>,
}

impl Viewer {
    /// Listens; port 0 takes one that is free.
    ///
    /// # Errors
    /// [`ViewError::Listen`], for instance when the port is taken.
    pub fn bind(address: SocketAddr) -> Result<Self, ViewError> {
        let listen = |source| ViewError::Listen { address, source };
        let listener = TcpListener::bind(address).map_err(listen)?;
        listener.set_nonblocking(true).map_err(listen)?;
        let address = listener.local_addr().map_err(listen)?;
        Ok(Self { listener, address, stop: Stopper(watch::Sender::new(false)) })
    }

    /// Where it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// What ends it.
    #[must_use]
    pub fn stopper(&self) -> Stopper {
        self.stop.clone()
    }

    /// Answers until it is stopped.
    ///
    /// # Errors
    /// [`ViewError::Server`] when the system gives no sockets or threads.
    pub fn serve(self, library: Library, beginning: Beginning) -> Result<(), ViewError> {
        let shared = Arc::new(Shared {
            library: Arc::new(library),
            beginning,
            loopback: self.address.ip().is_loopback(),
            pages: AtomicUsize::new(0),
            stop: self.stop.0.subscribe(),
        });
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(ViewError::Server)?;
        let served = runtime.block_on(answer(self.listener, shared));
        // The eyes' threads end with their channels; nothing waits for them.
        runtime.shutdown_background();
        served.map_err(ViewError::Server)
    }
}

async fn answer(listener: TcpListener, shared: Arc<Shared>) -> std::io::Result<()> {
    let listener = tokio::net::TcpListener::from_std(listener)?;
    let stopped = |mut stop: watch::Receiver<bool>| async move { drop(stop.wait_for(|stop| *stop).await) };
    let serving = axum::serve(listener, router(shared.clone())).with_graceful_shutdown(stopped(shared.stop.clone()));
    let end = async {
        stopped(shared.stop.clone()).await;
        // Pages are told in their own tasks; one that does not listen is not waited for.
        let all_gone = async {
            while shared.pages.load(Ordering::Relaxed) > 0 {
                tokio::time::sleep(Duration::from_millis(10)).await;
            }
        };
        drop(tokio::time::timeout(SHUTDOWN_GRACE, all_gone).await);
    };
    tokio::pin!(end);
    tokio::select! {
        // Sockets of pages are none of its connections: it is often through before the pages are told.
        served = serving.into_future() => {
            served?;
            end.await;
        }
        () = &mut end => {}
    }
    Ok(())
}

fn router(shared: Arc<Shared>) -> Router {
    Router::new()
        .route("/", get(async || file("text/html; charset=utf-8", include_str!("page/index.html"))))
        .route("/view.css", get(async || file("text/css; charset=utf-8", include_str!("page/view.css"))))
        .route("/view.js", get(async || file("text/javascript; charset=utf-8", include_str!("page/view.js"))))
        .route("/socket", any(socket))
        .layer(middleware::from_fn_with_state(shared.clone(), guarded))
        .with_state(shared)
}

fn file(kind: &'static str, text: &'static str) -> Response {
    ([(header::CONTENT_TYPE, kind)], text).into_response()
}

/// Refuses strangers, and says of every answer what a browser may do with it.
async fn guarded(State(shared): State<Arc<Shared>>, request: Request, next: Next) -> Response {
    let mut response = match guard::check(request.headers(), shared.loopback) {
        Ok(()) => next.run(request).await,
        Err(refusal) => (StatusCode::FORBIDDEN, format!("{refusal}\n")).into_response(),
    };
    let headers: [(HeaderName, &str); 5] = [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::X_FRAME_OPTIONS, "DENY"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CACHE_CONTROL, "no-store"),
    ];
    for (name, value) in headers {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

async fn socket(State(shared): State<Arc<Shared>>, upgrade: WebSocketUpgrade) -> Response {
    let Some(slot) = PageSlot::take(&shared) else {
        let text = format!("{MOST_PAGES} pages are open already; close one\n");
        return (StatusCode::SERVICE_UNAVAILABLE, text).into_response();
    };
    upgrade.max_message_size(LONGEST).max_frame_size(LONGEST).on_upgrade(async move |socket| {
        let Shared { library, beginning, stop, .. } = &*slot.0;
        session::converse(socket, library.clone(), beginning.clone(), stop.clone()).await;
    })
}

/// A page's place among the most there may be; given back when dropped.
struct PageSlot(Arc<Shared>);

impl PageSlot {
    fn take(shared: &Arc<Shared>) -> Option<Self> {
        let more = |pages| (pages < MOST_PAGES).then_some(pages + 1);
        shared.pages.fetch_update(Ordering::Relaxed, Ordering::Relaxed, more).ok()?;
        Some(Self(shared.clone()))
    }
}

impl Drop for PageSlot {
    fn drop(&mut self) {
        self.0.pages.fetch_sub(1, Ordering::Relaxed);
    }
}
