//! The socket of pictures and state: the newest ones only, at the pace of the page.

use std::net::IpAddr;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use axum::extract::ws::{CloseFrame, Message, WebSocket, close_code};
use bytes::Bytes;
use serde_json::json;
use tokio::sync::broadcast::error::RecvError;
use tokio::time::{interval_at, timeout};

use crate::hub::{Hub, News, json};
use crate::message::{Hello, ToWatch};
use crate::shared::Shared;

/// Time limit for the first message.
const GREETING: Duration = Duration::from_secs(5);
/// Time limit for sending, after which a page counts as disconnected.
const SEND: Duration = Duration::from_secs(10);
const PING: Duration = Duration::from_secs(5);
/// Time limit without any message; browsers answer pings by themselves.
const SILENCE: Duration = Duration::from_secs(20);
/// Pictures on their way to a page at most: one is drawn while the next one travels.
const UNDERWAY: u64 = 2;
/// Maximum number of messages of a page within a second.
const MESSAGES: u32 = 200;

/// Counts a page that shows pictures.
struct Viewer<'a>(&'a Hub);

impl<'a> Viewer<'a> {
    fn new(hub: &'a Hub) -> Self {
        hub.viewers.fetch_add(1, Ordering::Relaxed);
        Self(hub)
    }
}

impl Drop for Viewer<'_> {
    fn drop(&mut self) {
        self.0.viewers.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Serves a page until it disconnects or the server ends.
pub(crate) async fn converse(mut socket: WebSocket, shared: &Shared, peer: IpAddr) {
    let Ok(Some(Ok(Message::Text(first)))) = timeout(GREETING, socket.recv()).await else { return };
    let hello = match ToWatch::read(&first) {
        Ok(ToWatch::Hello(hello)) => hello,
        _ => Hello::default(),
    };
    match shared.controls.may_watch(&hello, peer, Instant::now()) {
        Ok(knows) => drop(show(&mut socket, shared, knows).await),
        Err(refused) => {
            let text = json(&json!({"type": "refused", "why": refused.to_string()}));
            drop(timeout(SEND, socket.send(Message::text(&*text))).await);
        }
    }
}

/// `None` once the page is gone.
async fn send(socket: &mut WebSocket, message: Message) -> Option<()> {
    timeout(SEND, socket.send(message)).await.ok()?.ok()
}

async fn all(socket: &mut WebSocket, news: Vec<News>, knows: bool) -> Option<()> {
    for news in news.iter().filter(|news| knows || !news.closed) {
        send(socket, Message::text(&*news.text)).await?;
    }
    Some(())
}

async fn show(socket: &mut WebSocket, shared: &Shared, knows: bool) -> Option<()> {
    let hub = &shared.hub;
    let _viewer = Viewer::new(hub);
    let (known, mut news) = hub.subscribe();
    all(socket, known, knows).await?;
    let (mut pictures, mut states, mut stop) = (hub.picture.subscribe(), hub.state.subscribe(), shared.stop.clone());
    pictures.mark_changed();
    states.mark_changed();
    let mut ping = interval_at(tokio::time::Instant::now() + PING, PING);
    let (mut sent, mut shown, mut heard) = (0_u64, 0_u64, Instant::now());
    let (mut counted, mut since) = (0, Instant::now());
    loop {
        tokio::select! {
            received = socket.recv() => {
                let Some(Ok(received)) = received else { return None };
                heard = Instant::now();
                if since.elapsed() > Duration::from_secs(1) {
                    (counted, since) = (0, heard);
                }
                counted += 1;
                if counted > MESSAGES {
                    return None;
                }
                match received {
                    Message::Text(text) => match ToWatch::read(&text) {
                        Ok(ToWatch::Shown(count)) => shown = shown.max(count.min(sent)),
                        Ok(ToWatch::Open(query)) => open(socket, hub, query, knows).await?,
                        _ => {}
                    },
                    Message::Close(_) => return None,
                    _ => {}
                }
            }
            told = news.recv() => match told {
                Ok(told) if knows || !told.closed => send(socket, Message::text(&*told.text)).await?,
                Ok(_) => {}
                // Too slow for some of it: everything anew.
                Err(RecvError::Lagged(_)) => {
                    let (known, next) = hub.subscribe();
                    news = next;
                    all(socket, known, knows).await?;
                }
                Err(RecvError::Closed) => return None,
            },
            changed = states.changed() => {
                changed.ok()?;
                let state = states.borrow_and_update().clone();
                if !state.is_empty() {
                    send(socket, Message::text(&*state)).await?;
                }
            }
            // A page that has not shown the last pictures gets no more of them, and then the newest one.
            changed = pictures.changed(), if sent - shown < UNDERWAY => {
                changed.ok()?;
                let picture = pictures.borrow_and_update().clone();
                if let Some(picture) = picture {
                    sent += 1;
                    send(socket, Message::Binary(picture)).await?;
                }
            }
            _ = ping.tick() => {
                if heard.elapsed() > SILENCE {
                    return None;
                }
                send(socket, Message::Ping(Bytes::new())).await?;
            }
            () = async { drop(stop.wait_for(|stop| *stop).await) } => {
                // The end of the flight, told just before.
                while let Ok(told) = news.try_recv() {
                    all(socket, vec![told], knows).await?;
                }
                let frame = CloseFrame { code: close_code::AWAY, reason: "the program has ended".into() };
                return send(socket, Message::Close(Some(frame))).await;
            }
        }
    }
}

/// Sends what is known of a decision: to spectators the picture alone.
async fn open(socket: &mut WebSocket, hub: &Hub, query: u64, knows: bool) -> Option<()> {
    let entry = hub.entry(query).unwrap_or_default();
    let detail = entry.detail.filter(|_| knows);
    let picture = entry.picture.is_some();
    let text = match detail {
        Some(detail) => format!(r#"{{"type":"opened","query":{query},"picture":{picture},"detail":{detail}}}"#),
        None => format!(r#"{{"type":"opened","query":{query},"picture":{picture}}}"#),
    };
    send(socket, Message::text(text)).await?;
    match entry.picture {
        Some(jpeg) => send(socket, Message::Binary(framed(&format!(r#"{{"query":{query}}}"#), &jpeg))).await,
        None => Some(()),
    }
}

/// A binary message: the length of the head, the head, the JPEG.
pub(crate) fn framed(head: &str, jpeg: &[u8]) -> Bytes {
    let length = u32::try_from(head.len()).unwrap_or_default().to_le_bytes();
    [&length[..], head.as_bytes(), jpeg].concat().into()
}
