//! The HTTP thread: an async runtime of its own, so that connections stay open between queries.

use std::future::Future;

use spf_core::time::Duration;
use tokio::runtime::{Builder, Handle};
use tokio::sync::oneshot;
use tokio::task::AbortHandle;

/// Connection timeout.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);
/// Keep-alive interval of idle connections.
const KEEP_ALIVE: Duration = Duration::from_secs(15);
/// Maximum idle time of a connection.
const IDLE: Duration = Duration::from_secs(300);

/// Why the HTTP client could not be started.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TransportError {
    /// The thread or runtime could not be started.
    #[error("cannot start a thread for the VLM")]
    Thread(#[source] std::io::Error),
    /// The client could not be created, usually because of an unreadable certificate or proxy setting.
    #[error("cannot set up connections (proxy, certificates): {0}")]
    Client(String),
}

/// The HTTP client with its connections. Dropping it ends the thread and all open requests.
pub(crate) struct Transport {
    client: reqwest::Client,
    handle: Handle,
    _end: oneshot::Sender<()>,
}

impl Transport {
    /// Starts the thread. Proxies are taken from `HTTPS_PROXY`, `HTTP_PROXY`, `ALL_PROXY` and `NO_PROXY`, certificates
    /// from the system or from `SSL_CERT_FILE` and `SSL_CERT_DIR`.
    pub(crate) fn start() -> Result<Self, TransportError> {
        // Another part of the process may have chosen a provider already; any will do.
        drop(rustls::crypto::ring::default_provider().install_default());
        let client = reqwest::Client::builder()
            .user_agent(concat!("spf/", env!("CARGO_PKG_VERSION")))
            .connect_timeout(CONNECT_TIMEOUT)
            .pool_idle_timeout(IDLE)
            .http2_keep_alive_interval(KEEP_ALIVE)
            .http2_keep_alive_while_idle(true)
            .tcp_nodelay(true)
            // A redirect usually leads to a sign-in page; the key must not be sent there.
            .redirect(reqwest::redirect::Policy::none())
            .build()
            .map_err(|error| TransportError::Client(error.to_string()))?;
        let runtime = Builder::new_current_thread().enable_all().build().map_err(TransportError::Thread)?;
        let handle = runtime.handle().clone();
        let (end, ended) = oneshot::channel::<()>();
        let run = move || {
            // An error means that the sender is gone, which also ends the thread.
            let _ = runtime.block_on(ended);
        };
        std::thread::Builder::new().name("vlm http".to_owned()).spawn(run).map_err(TransportError::Thread)?;
        Ok(Self { client, handle, _end: end })
    }

    /// The client; clones share its connections.
    pub(crate) fn client(&self) -> reqwest::Client {
        self.client.clone()
    }

    /// Runs a future on the thread until it completes or is aborted.
    pub(crate) fn spawn(&self, work: impl Future<Output = ()> + Send + 'static) -> AbortHandle {
        self.handle.spawn(work).abort_handle()
    }
}
