//! The HTTP server of the page.

use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::extract::State;
use axum::extract::ws::WebSocketUpgrade;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use axum::routing::{any, get};
use spf_guard::{Access, Manner};
use tokio::sync::{Semaphore, watch};

use super::message::LONGEST;
use super::{InitialView, Library, session};

/// Maximum wait for pages at shutdown, slightly longer than each of their closing handshakes.
const SHUTDOWN_GRACE: Duration = session::SHUTDOWN_GRACE.saturating_add(Duration::from_millis(200));

/// Why the server could not start.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ViewError {
    /// The address could not be bound.
    #[error("cannot listen on {address}")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// The cause.
        #[source]
        source: std::io::Error,
    },
    /// The system's sockets or threads failed.
    #[error("the server failed")]
    Server(#[source] std::io::Error),
}

/// Stops a server, from any thread.
#[derive(Clone, Debug)]
pub struct Stopper(watch::Sender<bool>);

impl Stopper {
    /// Closes all pages and ends [`Viewer::serve`].
    pub fn stop(&self) {
        self.0.send_replace(true);
    }
}

/// A bound server that does not serve yet.
#[derive(Debug)]
pub struct Viewer {
    listener: TcpListener,
    address: SocketAddr,
    stop: Stopper,
}

struct Shared {
    library: Arc<Library>,
    /// Permits of rendering threads.
    renderers: Arc<Semaphore>,
    beginning: InitialView,
    stop: watch::Receiver<bool>,
}

impl Viewer {
    /// Binds the address; port 0 selects a free one.
    ///
    /// # Errors
    /// [`ViewError::Listen`] if it cannot be bound, for instance because the port is in use.
    pub fn bind(address: SocketAddr) -> Result<Self, ViewError> {
        let listen = |source| ViewError::Listen { address, source };
        let listener = TcpListener::bind(address).map_err(listen)?;
        let address = listener.local_addr().map_err(listen)?;
        Ok(Self { listener, address, stop: Stopper(watch::Sender::new(false)) })
    }

    /// The address served.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// A handle to stop it.
    #[must_use]
    pub fn stopper(&self) -> Stopper {
        self.stop.clone()
    }

    /// Serves until it is stopped.
    ///
    /// # Errors
    /// [`ViewError::Server`] if the system's sockets or threads fail.
    pub fn serve(self, library: Library, beginning: InitialView) -> Result<(), ViewError> {
        let shared = Arc::new(Shared {
            library: Arc::new(library),
            renderers: Arc::new(Semaphore::new(spf_guard::CONNECTIONS)),
            beginning,
            stop: self.stop.0.subscribe(),
        });
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(ViewError::Server)?;
        let (access, stop) = (Access::at(self.address), self.stop.0.subscribe());
        // Pages are closed in their own tasks.
        let served =
            runtime.block_on(spf_guard::serve(self.listener, router(shared), access, stop, Manner::plain(SHUTDOWN_GRACE)));
        // The rendering threads end with their channels and need not be awaited.
        runtime.shutdown_background();
        served.map_err(ViewError::Server)
    }
}

fn router(shared: Arc<Shared>) -> Router {
    let router = Router::new()
        .route("/", get(async || file("text/html; charset=utf-8", include_str!("page/index.html"))))
        .route("/view.css", get(async || file("text/css; charset=utf-8", include_str!("page/view.css"))))
        .route("/view.js", get(async || file("text/javascript; charset=utf-8", include_str!("page/view.js"))))
        .route("/socket", any(socket));
    spf_guard::with_headers(router).with_state(shared)
}

fn file(kind: &'static str, text: &'static str) -> Response {
    ([(header::CONTENT_TYPE, kind)], text).into_response()
}

async fn socket(State(shared): State<Arc<Shared>>, upgrade: WebSocketUpgrade) -> Response {
    upgrade.max_message_size(LONGEST).max_frame_size(LONGEST).on_upgrade(async move |socket| {
        let Shared { library, renderers, beginning, stop } = &*shared;
        session::converse(socket, library.clone(), renderers.clone(), beginning.clone(), stop.clone()).await;
    })
}
