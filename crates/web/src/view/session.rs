//! The connection of one page: messages in, images out.

use std::sync::Arc;
use std::sync::mpsc::{TrySendError, sync_channel};
use std::time::Duration;

use axum::extract::ws::{CloseFrame, Message, WebSocket, close_code};
use tokio::sync::{Semaphore, mpsc, watch};
use tokio::time::{Instant, interval_at, timeout};

use super::message::{FromPage, ToPage};
use super::renderer::{Out, ViewRenderer};
use super::{InitialView, Library};

/// Maximum number of messages queued for the rendering thread, which reads them all between two images.
const INBOX: usize = 256;
/// Maximum number of messages queued for the socket; images are limited by what the page has displayed.
const OUTBOX: usize = 4;
/// Time limit for sending, after which a page counts as disconnected.
const SEND_TIMEOUT: Duration = Duration::from_secs(20);
const PING: Duration = Duration::from_secs(15);
/// Time limit without messages; browsers answer pings automatically.
const SILENCE: Duration = Duration::from_secs(50);

/// Time limit for a rendering thread to become free. A thread outlives its page by the image that it is rendering.
const RENDERER_WAIT: Duration = Duration::from_secs(5);

/// Time limit for the closing handshake.
pub(super) const SHUTDOWN_GRACE: Duration = Duration::from_secs(1);

/// Serves a page, starting with `beginning`, until it disconnects or the server shuts down. Each permit of `renderers`
/// allows one rendering thread: pages that come and go faster than an image is rendered would otherwise fill the memory
/// with threads.
pub(super) async fn converse(
    mut socket: WebSocket,
    library: Arc<Library>,
    renderers: Arc<Semaphore>,
    beginning: InitialView,
    mut stop: watch::Receiver<bool>,
) {
    let Ok(Ok(permit)) = timeout(RENDERER_WAIT, renderers.acquire_owned()).await else {
        let reason = "too many pages are open".to_owned();
        drop(timeout(SEND_TIMEOUT, socket.send(Message::text(text(&ToPage::Refused { reason })))).await);
        return;
    };
    let (to_renderer, inbox) = sync_channel(INBOX);
    let (out, mut outbox) = mpsc::channel(OUTBOX);
    // The scene is loaded and rendered in its own thread, which ends when either channel does.
    let spawned = std::thread::Builder::new().name("view".to_owned()).spawn(move || {
        let refused = |reason| Out::Text(text(&ToPage::Refused { reason }));
        match ViewRenderer::open(library, &beginning, out.clone()) {
            Ok(renderer) => drop(renderer.run(&inbox)),
            Err(reason) => drop(out.blocking_send(refused(reason))),
        }
        drop(permit);
    });
    if let Err(error) = spawned {
        tracing::error!("cannot start a thread for the page: {error}");
        return;
    }
    let mut ping = interval_at(Instant::now() + PING, PING);
    let mut last_message = Instant::now();
    loop {
        let message = tokio::select! {
            received = socket.recv() => {
                let Some(Ok(received)) = received else { return };
                last_message = Instant::now();
                let refused = match received {
                    Message::Text(text) => hand_over(&text, |message| to_renderer.try_send(message)),
                    Message::Binary(_) => Err("expected a text message".to_owned()),
                    Message::Ping(_) | Message::Pong(_) => Ok(()),
                    Message::Close(_) => return,
                };
                match refused {
                    Ok(()) => continue,
                    Err(reason) => Message::text(text(&ToPage::Refused { reason })),
                }
            }
            out = outbox.recv() => match out {
                Some(Out::Text(text)) => Message::text(text),
                Some(Out::Image(bytes)) => Message::binary(bytes),
                None => return,
            },
            _ = ping.tick() => {
                if last_message.elapsed() > SILENCE {
                    return;
                }
                Message::Ping(Vec::new().into())
            }
            // The value seen is a lock that must not be held while sending.
            () = async { drop(stop.wait_for(|stop| *stop).await) } => {
                let frame = CloseFrame { code: close_code::AWAY, reason: "server shutting down".into() };
                drop(timeout(SHUTDOWN_GRACE, send_close(&mut socket, frame)).await);
                return;
            }
        };
        if !matches!(timeout(SEND_TIMEOUT, socket.send(message)).await, Ok(Ok(()))) {
            return;
        }
    }
}

/// Closes a page and waits for its close frame: closing with unread messages resets the connection, and the page would
/// lose the frame.
async fn send_close(socket: &mut WebSocket, frame: CloseFrame) {
    if socket.send(Message::Close(Some(frame))).await.is_ok() {
        while let Some(Ok(_)) = socket.recv().await {}
    }
}

/// Passes a message to the rendering thread, or returns the error.
fn hand_over(text: &str, give: impl FnOnce(FromPage) -> Result<(), TrySendError<FromPage>>) -> Result<(), String> {
    match give(FromPage::read(text)?) {
        Err(TrySendError::Full(_)) => Err("too many messages".to_owned()),
        // The rendering thread is gone; the closed image channel shows the same.
        Ok(()) | Err(TrySendError::Disconnected(_)) => Ok(()),
    }
}

fn text(message: &ToPage) -> String {
    serde_json::to_string(message).unwrap_or_default()
}
