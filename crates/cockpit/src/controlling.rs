//! The socket of the controls: orders and their acknowledgement, apart from the pictures, so that neither waits for the other.

use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::extract::ws::{CloseFrame, Message, WebSocket, close_code};
use serde_json::json;
use tokio::sync::mpsc;
use tokio::time::{interval, timeout};

use crate::controls::{Controls, TO_PAGE};
use crate::hub::json;
use crate::message::{Order, ToControls};
use crate::shared::Shared;
use crate::visitor::Visitor;

/// Time limit for sending, after which a page counts as disconnected.
const SEND: Duration = Duration::from_secs(2);
/// Interval of beats, which the page answers. The server asks, because browsers slow the timers of hidden pages down, but not
/// their sockets.
const BEAT: Duration = Duration::from_millis(250);
/// A page that answers nothing for this long is disconnected.
const SILENCE: Duration = Duration::from_secs(10);
/// Maximum number of messages within a second: manual flight needs twenty.
const MESSAGES: u32 = 60;
/// With more than this the page is disconnected; up to it every order to stop counts.
const FLOOD: u32 = 600;

/// Leaves the controls at every end.
struct AtControls<'a> {
    controls: &'a Controls,
    number: u64,
}

impl AtControls<'_> {
    /// A beat that is sent now.
    fn beat(&self) -> String {
        format!(r#"{{"type":"beat","n":{}}}"#, self.controls.beat(self.number, Instant::now()))
    }
}

impl Drop for AtControls<'_> {
    fn drop(&mut self) {
        self.controls.leave(self.number, Instant::now());
    }
}

/// Serves a page until it disconnects or the server ends.
pub(crate) async fn converse(mut socket: WebSocket, shared: &Shared, visitor: &Visitor) {
    let Some(first) = visitor.greeting(&mut socket).await else { return };
    let Ok(ToControls::Hello(hello)) = ToControls::read(&first) else { return };
    let (to_page, mut messages) = mpsc::channel::<Arc<str>>(TO_PAGE);
    let (number, session) = match shared.controls.enter(&hello, visitor.peer, to_page, Instant::now()) {
        Ok(entered) => entered,
        Err(refused) => {
            let _ = send(&mut socket, &json(&json!({"type": "refused", "why": refused.to_string()}))).await;
            return;
        }
    };
    visitor.settle();
    let at = AtControls { controls: &shared.controls, number };
    let welcome = json(&json!({"type": "welcome", "session": session, "flights": shared.shows_flights(visitor.peer)}));
    if send(&mut socket, &welcome).await.is_some() {
        let _ = talk(&mut socket, &at, &mut messages, shared).await;
    }
}

/// `None` once the page is gone.
async fn send(socket: &mut WebSocket, text: &str) -> Option<()> {
    timeout(SEND, socket.send(Message::text(text))).await.ok()?.ok()
}

async fn talk(
    socket: &mut WebSocket,
    at: &AtControls<'_>,
    messages: &mut mpsc::Receiver<Arc<str>>,
    shared: &Shared,
) -> Option<()> {
    let (mut stop, mut beat) = (shared.stop.clone(), interval(BEAT));
    // Orders name a beat: no page waits for its first one.
    beat.tick().await;
    send(socket, &at.beat()).await?;
    let (mut heard, mut counted, mut since) = (Instant::now(), 0, Instant::now());
    loop {
        tokio::select! {
            // Orders come first.
            biased;
            received = socket.recv() => {
                let text = match received {
                    Some(Ok(Message::Text(text))) => text,
                    Some(Ok(Message::Ping(_) | Message::Pong(_))) => continue,
                    _ => return None,
                };
                let now = Instant::now();
                if now.duration_since(since) > Duration::from_secs(1) {
                    (counted, since) = (0, now);
                }
                counted += 1;
                if counted > FLOOD {
                    return None;
                }
                match ToControls::read(&text) {
                    Ok(ToControls::Beat(_)) => {
                        heard = now;
                        at.controls.heard(at.number, now);
                    }
                    Ok(ToControls::Order { id, tick, order }) => {
                        let stops = matches!(order, Order::Hold | Order::Land | Order::ArmCut | Order::Cut);
                        let done = if counted > MESSAGES && !stops {
                            Err("too many orders within a second".to_owned())
                        } else {
                            at.controls.receive(at.number, id, tick, &order, now)
                        };
                        let (ok, text) = match done {
                            Ok(text) => (true, text),
                            Err(why) => (false, why),
                        };
                        send(socket, &json(&json!({"type": "ack", "id": id, "ok": ok, "text": text}))).await?;
                    }
                    Ok(ToControls::Hello(_)) => {}
                    Err(why) => send(socket, &json(&json!({"type": "error", "text": why}))).await?,
                }
            }
            message = messages.recv() => send(socket, &message?).await?,
            _ = beat.tick() => {
                if heard.elapsed() > SILENCE {
                    return None;
                }
                send(socket, &at.beat()).await?;
            }
            () = async { drop(stop.wait_for(|stop| *stop).await) } => {
                let frame = CloseFrame { code: close_code::AWAY, reason: "the program has ended".into() };
                return timeout(SEND, socket.send(Message::Close(Some(frame)))).await.ok()?.ok();
            }
        }
    }
}
