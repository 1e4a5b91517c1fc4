//! HTTP server of the endpoint.

use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use axum::Router;
use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, Path, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post, put};
use serde_json::Value;
use spf_flight::ledger::ORACLE_SERVED;
use spf_flight::pose::parse_pose;
use spf_guard::Access;
use spf_media::{Jpeg, jpeg};
use tokio::sync::{Semaphore, watch};

use super::lens::FrameProvider;
use super::memory::Unrecognised;
use super::responder::{OracleReply, Responder};
use super::wire::{Answered, Question, Wire};

/// Maximum number of images decoded or rendered at the same time; further requests wait. Each takes tens of megabytes.
const AT_ONCE: usize = 2;
/// JPEG quality of /frame.jpg.
const QUALITY: u8 = 90;

/// Why the endpoint could not start.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EndpointError {
    /// The address could not be bound.
    #[error("cannot listen on {address}")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// The cause.
        #[source]
        source: std::io::Error,
    },
    /// A thread could not be started.
    #[error("cannot start the thread of the VLM endpoint")]
    Thread(#[source] std::io::Error),
}

/// A bound endpoint that does not serve yet.
#[derive(Debug)]
pub struct Endpoint {
    listener: TcpListener,
    address: SocketAddr,
}

/// A running endpoint; it stops when dropped.
pub struct Serving {
    stop: watch::Sender<bool>,
    thread: Option<JoinHandle<()>>,
}

struct Shared {
    lens: Arc<dyn FrameProvider>,
    responder: Responder,
    questions: AtomicU64,
    work: Arc<Semaphore>,
}

impl Endpoint {
    /// Binds the address; port 0 selects a free one.
    ///
    /// # Errors
    /// [`EndpointError::Listen`] if it cannot be bound.
    pub fn bind(address: SocketAddr) -> Result<Self, EndpointError> {
        let listen = |source| EndpointError::Listen { address, source };
        let listener = TcpListener::bind(address).map_err(listen)?;
        let address = listener.local_addr().map_err(listen)?;
        Ok(Self { listener, address })
    }

    /// The address served.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Serves in a separate thread.
    ///
    /// # Errors
    /// [`EndpointError::Thread`] if it cannot be started.
    pub fn serve(self, lens: Arc<dyn FrameProvider>, responder: Responder) -> Result<Serving, EndpointError> {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(EndpointError::Thread)?;
        let shared = Arc::new(Shared { lens, responder, questions: AtomicU64::new(0), work: Arc::new(Semaphore::new(AT_ONCE)) });
        let (stop, stopped) = watch::channel(false);
        let work = move || {
            runtime.block_on(async {
                let access = Access::at(self.address);
                let served =
                    spf_guard::serve(self.listener, router(shared), access, stopped, spf_guard::Manner::plain(Duration::ZERO))
                        .await;
                if let Err(error) = served {
                    tracing::error!(%error, "the endpoint failed");
                }
            });
            runtime.shutdown_background();
        };
        let thread = std::thread::Builder::new().name("endpoint".to_owned()).spawn(work).map_err(EndpointError::Thread)?;
        Ok(Serving { stop, thread: Some(thread) })
    }
}

impl Drop for Serving {
    fn drop(&mut self) {
        self.stop.send_replace(true);
        if let Some(thread) = self.thread.take() {
            drop(thread.join());
        }
    }
}

fn router(shared: Arc<Shared>) -> Router {
    let mut router =
        Router::new().route("/frame.jpg", get(frame)).route("/pose", put(pose)).route("/{version}/models/{call}", post(gemini));
    for (path, wire) in [("chat/completions", Wire::Chat), ("responses", Wire::Responses), ("messages", Wire::Anthropic)] {
        let ask = move |State(shared): State<Arc<Shared>>, body: Bytes| ask(shared, wire, body, None);
        router = router.route(&format!("/v1/{path}"), post(ask)).route(&format!("/{path}"), post(ask));
    }
    // The guard bounds the body.
    router.layer(DefaultBodyLimit::disable()).with_state(shared)
}

async fn frame(State(shared): State<Arc<Shared>>) -> Response {
    let Ok(turn) = shared.work.clone().acquire_owned().await else { return StatusCode::SERVICE_UNAVAILABLE.into_response() };
    let taken = tokio::task::spawn_blocking(move || {
        let _turn = turn;
        let (frame, image) = shared.lens.newest()?;
        Some((frame, Jpeg::encode(&image, QUALITY).ok()?))
    });
    match taken.await.ok().flatten() {
        Some((frame, jpeg)) => {
            let headers = [(header::CONTENT_TYPE, "image/jpeg".to_owned()), (header::CACHE_CONTROL, "no-store".to_owned())];
            (headers, [("x-frame-id", frame.0.to_string())], jpeg.bytes().to_vec()).into_response()
        }
        None => (StatusCode::SERVICE_UNAVAILABLE, "the camera has no frame yet\n").into_response(),
    }
}

async fn pose(State(shared): State<Arc<Shared>>, body: String) -> Response {
    match parse_pose(body.trim()) {
        Ok(pose) if shared.lens.put(pose) => StatusCode::NO_CONTENT.into_response(),
        Ok(_) => (StatusCode::CONFLICT, "the camera is on a drone and moves with it\n").into_response(),
        Err(expected) => (StatusCode::UNPROCESSABLE_ENTITY, format!("the body must be {expected}\n")).into_response(),
    }
}

/// Gemini's path contains model and method; the oracle answers for every model.
async fn gemini(State(shared): State<Arc<Shared>>, Path((_, call)): Path<(String, String)>, body: Bytes) -> Response {
    match call.rsplit_once(':') {
        Some((_, method @ ("generateContent" | "streamGenerateContent"))) => {
            ask(shared, Wire::Gemini, body, Some(method.starts_with("stream"))).await
        }
        _ => refused(Wire::Gemini, StatusCode::NOT_FOUND, "only generateContent and streamGenerateContent are supported"),
    }
}

/// `streams`: whether the answer is streamed, if the path says so.
async fn ask(shared: Arc<Shared>, wire: Wire, body: Bytes, streams: Option<bool>) -> Response {
    let began = Instant::now();
    let Ok(turn) = shared.work.clone().acquire_owned().await else { return StatusCode::SERVICE_UNAVAILABLE.into_response() };
    let number = shared.questions.fetch_add(1, Ordering::Relaxed);
    // The turn ends with the work, which goes on if the client leaves.
    let work = move || {
        let _turn = turn;
        think(&shared, wire, number, &body, streams)
    };
    let thought = tokio::task::spawn_blocking(work).await;
    let (question, OracleReply { text, latency }) = match thought {
        Ok(Ok(thought)) => thought,
        Ok(Err((status, why))) => return refused(wire, status, &why),
        Err(_) => return refused(wire, StatusCode::INTERNAL_SERVER_ERROR, "the oracle failed"),
    };
    let answered = Answered::new(&question, &text, number);
    let (kind, body) = if question.stream {
        ("text/event-stream", wire.stream(&answered))
    } else {
        ("application/json", wire.whole(&answered).to_string())
    };
    tokio::time::sleep(latency.saturating_sub(began.elapsed())).await;
    ([(header::CONTENT_TYPE, kind)], body).into_response()
}

/// Reads a request and answers it; the question is returned without its image.
fn think(
    shared: &Shared,
    wire: Wire,
    number: u64,
    body: &[u8],
    streams: Option<bool>,
) -> Result<(Question, OracleReply), (StatusCode, String)> {
    let mut question = read_request(wire, body).map_err(|why| (StatusCode::BAD_REQUEST, why))?;
    if let Some(stream) = streams {
        question.stream = stream;
    }
    let unusable = |why: String| (StatusCode::UNPROCESSABLE_ENTITY, why);
    let image = question.image.take().ok_or_else(|| unusable("the request contains no image (base64, JPEG)".to_owned()))?;
    let image = jpeg::decode_within(&image, spf_guard::MAX_PIXELS).map_err(|error| unusable(error.to_string()))?;
    let answer = shared.responder.answer(shared.lens.now(), number, &question.prompt, &image);
    let reply = answer.map_err(|why| match why {
        Unrecognised::Wording(_) => unusable(why.to_string()),
        // By this name its clients know that the picture is the reason (`VlmError::is_of_stand_in`).
        _ => unusable(format!("{ORACLE_SERVED}: {why}")),
    })?;
    Ok((question, reply))
}

/// Reads any bytes as a request in every format, up to the decoded image, for fuzzing.
#[doc(hidden)]
pub fn read_any_request(bytes: &[u8]) {
    for wire in [Wire::Chat, Wire::Responses, Wire::Gemini, Wire::Anthropic] {
        let question = read_request(wire, bytes);
        if let Some(image) = question.ok().and_then(|question| question.image) {
            drop(jpeg::decode_within(&image, 1 << 20));
        }
    }
}

fn read_request(wire: Wire, body: &[u8]) -> Result<Question, String> {
    let body = serde_json::from_slice::<Value>(body).map_err(|_| "the body is not valid JSON".to_owned())?;
    Ok(wire.question(&body))
}

fn refused(wire: Wire, status: StatusCode, message: &str) -> Response {
    let body = wire.error(status.as_u16(), message).to_string();
    (status, [(header::CONTENT_TYPE, "application/json")], body).into_response()
}
