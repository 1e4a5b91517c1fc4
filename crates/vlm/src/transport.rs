//! The thread that talks HTTP: an async runtime of its own, so that connections stay alive while nobody asks.

use std::future::Future;

use spf_core::time::Duration;
use tokio::runtime::{Builder, Handle};
use tokio::sync::oneshot;
use tokio::task::AbortHandle;

/// A vendor that does not even open a connection in this time is not there.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);
/// A connection that is kept is asked this often whether it still stands.
const KEEP_ALIVE: Duration = Duration::from_secs(15);
/// A connection is kept this long without a question.
const IDLE: Duration = Duration::from_secs(300);

/// Why nothing can be asked at all.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TransportError {
    /// No thread or no runtime.
    #[error("no thread could be started for the VLM")]
    Thread(#[source] std::io::Error),
    /// No client: most often a certificate or a proxy that cannot be read.
    #[error("no connection can be prepared (proxy, certificates): {0}")]
    Client(String),
}

/// One client with its connections. Dropping it ends the thread and everything that is under way.
pub(crate) struct Transport {
    client: reqwest::Client,
    handle: Handle,
    _end: oneshot::Sender<()>,
}

impl Transport {
    /// Starts the thread. Proxies come from `HTTPS_PROXY`, `HTTP_PROXY`, `ALL_PROXY` and `NO_PROXY`, certificates from the system
    /// or from `SSL_CERT_FILE` and `SSL_CERT_DIR`.
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
            // A question sent elsewhere than asked is a page to sign in, most often; the key must not follow.
            .redirect(reqwest::redirect::Policy::none())
            .build()
            .map_err(|error| TransportError::Client(error.to_string()))?;
        let runtime = Builder::new_current_thread().enable_all().build().map_err(TransportError::Thread)?;
        let handle = runtime.handle().clone();
        let (end, ended) = oneshot::channel::<()>();
        let run = move || {
            // An error is the sender gone: the end all the same.
            let _ = runtime.block_on(ended);
        };
        std::thread::Builder::new().name("vlm http".to_owned()).spawn(run).map_err(TransportError::Thread)?;
        Ok(Self { client, handle, _end: end })
    }

    /// The client, whose clones share its connections.
    pub(crate) fn client(&self) -> reqwest::Client {
        self.client.clone()
    }

    /// Starts work on the thread; it goes on until it is done or aborted.
    pub(crate) fn spawn(&self, work: impl Future<Output = ()> + Send + 'static) -> AbortHandle {
        self.handle.spawn(work).abort_handle()
    }
}
