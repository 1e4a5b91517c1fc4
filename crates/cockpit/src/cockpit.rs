//! The cockpit's server and its thread.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, TcpListener, UdpSocket};
use std::sync::Arc;
use std::sync::mpsc::channel;
use std::thread::JoinHandle;
use std::time::Instant;

use serde_json::json;
use spf_core::query::Query;
use spf_flight::pointing::{Pointer, Pointing, Waiting};
use spf_media::Rgb;
use spf_vlm::Vlm;
use tokio::sync::{Semaphore, watch};

use crate::controls::{ArmAssistant, CHECK, Controls, Keys};
use crate::flight_controls::{FlightControls, FlightEnd, ReadInstruction};
use crate::flights::Flights;
use crate::hub::{Hub, Kept};
use crate::instruments::Instruments;
use crate::server;
use crate::shared::Shared;
use crate::tls::Tls;
use crate::worker::{LivePicture, Worker};

/// Says something to the user, such as a new address.
pub type Announce = Arc<dyn Fn(&str) + Send + Sync>;

/// Why the cockpit could not be opened.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CockpitError {
    /// The address could not be bound.
    #[error("cannot listen on {address}")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// The cause.
        #[source]
        source: std::io::Error,
    },
    /// No thread, or no random numbers.
    #[error("cannot start the server")]
    Start(#[source] std::io::Error),
}

/// The page's server. It ends when this is dropped.
pub struct Cockpit {
    address: SocketAddr,
    fingerprint: Option<String>,
    hub: Arc<Hub>,
    controls: Arc<Controls>,
    pointing: Arc<Pointing>,
    worker: Arc<Worker>,
    stop: watch::Sender<bool>,
    thread: Option<JoinHandle<()>>,
}

impl Cockpit {
    /// Serves at `address`; port 0 selects a free one. `flights` are those that can be looked at, by everybody on
    /// this machine and, if the address is not of this machine only, by nobody.
    /// `announce` is told a new address if a one-time address was used and its page is gone.
    ///
    /// # Errors
    /// [`CockpitError`] if the address cannot be bound or no thread can be started.
    pub fn open(address: SocketAddr, flights: Option<Flights>, announce: Announce) -> Result<Self, CockpitError> {
        let listen = |source| CockpitError::Listen { address, source };
        let listener = TcpListener::bind(address).map_err(listen)?;
        let address = listener.local_addr().map_err(listen)?;
        let (hub, pointing) = (Hub::new(), Arc::new(Pointing::default()));
        let keys = Keys::new(address.ip().is_loopback()).map_err(CockpitError::Start)?;
        let tls =
            (!address.ip().is_loopback()).then(|| Tls::new(&addresses(address.ip()))).transpose().map_err(CockpitError::Start)?;
        let (config, fingerprint) = tls.map(|tls| (tls.config, tls.fingerprint)).unzip();
        let controls = Arc::new(Controls::new(keys, hub.clone(), pointing.clone()));
        let worker = Worker::start(hub.clone()).map_err(CockpitError::Start)?;
        let stop = watch::Sender::new(false);
        let shared = Arc::new(Shared {
            hub: hub.clone(),
            controls: controls.clone(),
            flights,
            replays: Arc::new(Semaphore::new(1)),
            stop: stop.subscribe(),
        });
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(CockpitError::Start)?;
        let (watched, stopped) = (controls.clone(), stop.subscribe());
        let thread = std::thread::Builder::new().name("cockpit".to_owned()).spawn(move || {
            runtime.block_on(async {
                let check = check(watched, address, announce);
                tokio::select! {
                    served = server::serve(listener, address, shared, config, stopped) => {
                        if let Err(error) = served {
                            tracing::warn!(%error, "the cockpit's server failed; the flight goes on");
                        }
                    }
                    () = check => {}
                }
            });
            runtime.shutdown_background();
        });
        let thread = Some(thread.map_err(CockpitError::Start)?);
        Ok(Self { address, fingerprint, hub, controls, pointing, worker, stop, thread })
    }

    /// The address served.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// The addresses to open: to fly, and to watch. They hold secrets: show them to the user, and write them to no file.
    #[must_use]
    pub fn urls(&self) -> (String, String) {
        let (fly, watch) = self.controls.secrets();
        (url(self.address, Some(&fly)), url(self.address, watch.as_deref()))
    }

    /// The SHA-256 fingerprint of the certificate; none on this machine alone, where nothing is encrypted.
    #[must_use]
    pub fn fingerprint(&self) -> Option<&str> {
        self.fingerprint.as_deref()
    }

    /// What a flight's observers are given to show it here.
    #[must_use]
    pub fn instruments(&self) -> Instruments {
        Instruments::new(self.hub.clone(), self.pointing.clone(), self.worker.clone())
    }

    /// Shows an image that belongs to no flight, such as a clock by which the delay is measured. It must have just arrived.
    pub fn show(&self, number: u64, image: Rgb) {
        if self.worker.is_watched() {
            self.worker.show(LivePicture::alone(number, image), Vec::new());
        }
    }

    /// A VLM that answers with what is pointed at in the page; where nobody points, `other` answers, if there is one.
    #[must_use]
    pub fn pointer(&self, other: Option<Box<dyn Vlm>>) -> Pointer {
        self.pointers()(other)
    }

    /// The same as a function, which outlives this borrow.
    pub fn pointers(&self) -> impl Fn(Option<Box<dyn Vlm>>) -> Pointer + Send + Sync + 'static {
        let (pointing, hub) = (self.pointing.clone(), self.hub.clone());
        let waiting: Waiting = Arc::new(move |query| {
            let question = query.map_or_else(
                || json!({"type": "question"}),
                |Query { id, frame, memory, .. }| {
                    json!({"type": "question", "query": id.0, "frame": frame.0, "confirm": memory.confirming})
                },
            );
            hub.tell(Kept::Question, &question);
        });
        move |other| Pointer::new(pointing.clone(), waiting.clone(), other)
    }

    /// Whether the page is open that flies, and was heard a moment ago.
    #[must_use]
    pub fn has_pilot(&self) -> bool {
        self.controls.has_pilot()
    }

    /// An assistant flies here: `about` says with what. A real drone's is armed by `arm`.
    pub fn host_assistant(&self, about: &str, arm: Option<ArmAssistant>) {
        if let Some(arm) = arm {
            self.controls.let_arm(arm);
        }
        self.hub.tell(Kept::Question, &json!({"type": "assistant", "about": about}));
    }

    /// A flight begins, and the page controls it.
    pub fn begin(&self, flight: FlightControls) {
        self.controls.begin(flight);
    }

    /// The flight is over.
    pub fn end(&self, end: &FlightEnd) {
        let FlightEnd { outcome, result, flight_time_s, path_length_m, files, problems } = end;
        self.controls.end();
        self.hub.state.send_replace(Arc::from(""));
        for problem in problems {
            let text = format!("recording failed: {problem}");
            // It may name files.
            self.hub.tell_some(Kept::Row, &json!({"type": "line", "level": "error", "text": text, "recording": true}), true);
        }
        let end = json!({
            "type": "end", "outcome": outcome, "result": result, "t": flight_time_s, "flown": path_length_m,
            "incomplete": !problems.is_empty(),
        });
        self.hub.tell(Kept::End, &end);
        self.hub.tell_some(Kept::Row, &json!({"type": "line", "level": "info", "text": format!("files: {files}")}), true);
    }

    /// Waits for an instruction from the page, until `stop` says so: then `None`. `about` is shown meanwhile.
    #[must_use]
    pub fn wait_for_instruction(&self, about: &str, read: ReadInstruction, stop: impl Fn() -> bool) -> Option<String> {
        let (send, instructions) = channel();
        self.controls.wait(send, read);
        self.hub.tell(Kept::Question, &json!({"type": "waiting", "about": about}));
        loop {
            match instructions.recv_timeout(CHECK) {
                Ok(instruction) => return Some(instruction),
                Err(std::sync::mpsc::RecvTimeoutError::Timeout) if !stop() => {}
                Err(_) => return None,
            }
        }
    }

    /// Says why the last instruction could not be flown.
    pub fn refuse(&self, why: &str) {
        self.controls.end();
        // It may name files and servers.
        self.hub.tell_some(Kept::Row, &json!({"type": "line", "level": "error", "text": why}), true);
        self.hub.tell(Kept::Row, &json!({"type": "line", "level": "error", "text": "the instruction could not be flown"}));
    }
}

impl Drop for Cockpit {
    fn drop(&mut self) {
        self.stop.send_replace(true);
        self.worker.stop();
        if let Some(thread) = self.thread.take() {
            drop(thread.join());
        }
    }
}

fn url(mut address: SocketAddr, secret: Option<&str>) -> String {
    if address.ip().is_unspecified() {
        address.set_ip(own_address(address.ip()));
    }
    let scheme = if address.ip().is_loopback() { "http" } else { "https" };
    // What follows the `#` is not sent by browsers, and so in no log.
    format!("{scheme}://{address}/{}", secret.map_or(String::new(), |secret| format!("#{secret}")))
}

/// The addresses for which a certificate is made.
fn addresses(bound: IpAddr) -> Vec<IpAddr> {
    let own = if bound.is_unspecified() { own_address(bound) } else { bound };
    vec![own, Ipv4Addr::LOCALHOST.into(), Ipv6Addr::LOCALHOST.into()]
}

/// The address under which others reach this machine: that of the interface that leads out. Nothing is sent.
fn own_address(any: IpAddr) -> IpAddr {
    let socket = UdpSocket::bind((any, 0)).and_then(|socket| {
        // An address of the documentation's.
        socket.connect(("192.0.2.1", 9))?;
        socket.local_addr()
    });
    socket.map_or(any, |address| address.ip())
}

/// Watches over the page that flies.
async fn check(controls: Arc<Controls>, address: SocketAddr, announce: Announce) {
    let mut ticks = tokio::time::interval(CHECK);
    loop {
        ticks.tick().await;
        if let Some(secret) = controls.check(Instant::now()) {
            announce(&format!("The cockpit's page is gone. A new address to fly: {}", url(address, Some(&secret))));
        }
    }
}
