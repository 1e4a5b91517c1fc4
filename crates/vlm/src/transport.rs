//! The HTTP thread: an async runtime of its own, so that connections stay open between queries.

use std::collections::BTreeMap;
use std::future::Future;
use std::sync::{Arc, Mutex, PoisonError};

use spf_core::time::Duration;
use tokio::runtime::{Builder, Handle};
use tokio::sync::oneshot;
use tokio::task::AbortHandle;

/// Connection timeout of the first client, which only tells whether one can be created.
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

/// HTTP clients with their connections, by connection timeout; of each there is a spare one, for a connection that hangs
/// is used again as long as it is open.
#[derive(Clone)]
pub(crate) struct Clients {
    any: reqwest::Client,
    made: Arc<Mutex<BTreeMap<(Duration, bool), reqwest::Client>>>,
}

impl Clients {
    /// The client with this connection timeout; clones share its connections.
    pub(crate) fn get(&self, connect: Duration, spare: bool) -> reqwest::Client {
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        // What could be created once can be created again.
        made.entry((connect, spare)).or_insert_with(|| client(connect).unwrap_or_else(|_| self.any.clone())).clone()
    }
}

fn client(connect: Duration) -> Result<reqwest::Client, TransportError> {
    reqwest::Client::builder()
        .user_agent(concat!("spf/", env!("CARGO_PKG_VERSION")))
        .connect_timeout(connect)
        .pool_idle_timeout(IDLE)
        .http2_keep_alive_interval(KEEP_ALIVE)
        .http2_keep_alive_while_idle(true)
        .tcp_nodelay(true)
        // A redirect usually leads to a sign-in page; the key must not be sent there.
        .redirect(reqwest::redirect::Policy::none())
        .build()
        .map_err(|error| TransportError::Client(error.to_string()))
}

/// The HTTP thread and its clients. Dropping it ends the thread and all open requests.
pub(crate) struct Transport {
    clients: Clients,
    handle: Handle,
    _end: oneshot::Sender<()>,
}

impl Transport {
    /// Starts the thread. Proxies are taken from `HTTPS_PROXY`, `HTTP_PROXY`, `ALL_PROXY` and `NO_PROXY`, certificates
    /// from the system or from `SSL_CERT_FILE` and `SSL_CERT_DIR`.
    pub(crate) fn start() -> Result<Self, TransportError> {
        // Another part of the process may have chosen a provider already; any will do.
        drop(rustls::crypto::ring::default_provider().install_default());
        let any = client(CONNECT_TIMEOUT)?;
        let made = BTreeMap::from([((CONNECT_TIMEOUT, false), any.clone())]);
        let clients = Clients { any, made: Arc::new(Mutex::new(made)) };
        let runtime = Builder::new_current_thread().enable_all().build().map_err(TransportError::Thread)?;
        let handle = runtime.handle().clone();
        let (end, ended) = oneshot::channel::<()>();
        let run = move || {
            // An error means that the sender is gone, which also ends the thread.
            let _ = runtime.block_on(ended);
        };
        std::thread::Builder::new().name("vlm http".to_owned()).spawn(run).map_err(TransportError::Thread)?;
        Ok(Self { clients, handle, _end: end })
    }

    /// The clients; clones share them.
    pub(crate) fn clients(&self) -> Clients {
        self.clients.clone()
    }

    /// Runs a future on the thread until it completes or is aborted.
    pub(crate) fn spawn(&self, work: impl Future<Output = ()> + Send + 'static) -> AbortHandle {
        self.handle.spawn(work).abort_handle()
    }
}
