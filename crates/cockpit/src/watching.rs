//! The socket of pictures and state: the newest ones only, at the pace of the page.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use axum::extract::ws::{CloseFrame, Message, WebSocket, close_code};
use bytes::Bytes;
use serde_json::json;
use tokio::sync::broadcast::error::RecvError;
use tokio::time::{interval_at, sleep_until, timeout};

use crate::controls::{Refused, SPECTATORS};
use crate::film::{Seat, Take};
use crate::hub::{Hub, News, json};
use crate::message::{Format, Hello, ToWatch};
use crate::shared::Shared;
use crate::visitor::Visitor;

/// Time limit for sending, after which a page counts as disconnected.
const SEND: Duration = Duration::from_secs(10);
const PING: Duration = Duration::from_secs(5);
/// Time limit without any message; browsers answer pings by themselves.
const SILENCE: Duration = Duration::from_secs(20);
/// Pictures on their way to a page at most: one is drawn while the next one travels.
const UNDERWAY: u64 = 2;
/// Maximum number of messages of a page within a second.
const MESSAGES: u32 = 200;

/// Minimum interval between two formats that a page asks for: each begins with a key frame, for all who watch.
const FORMAT_AGAIN: Duration = Duration::from_secs(1);
/// Minimum interval between two key frames that a page asks for; it doubles with each, up to the most, and begins anew after a quiet
/// time. A page that falls behind again and again goes on at the key frames that come by themselves.
const KEY_AGAIN: Duration = Duration::from_secs(2);
const KEY_MOST: Duration = Duration::from_secs(32);
const KEY_QUIET: Duration = Duration::from_secs(60);

/// When a page may ask for a key frame.
#[derive(Debug, Default)]
struct Requests {
    last: Option<(Instant, Duration)>,
}

impl Requests {
    fn may(&mut self, now: Instant) -> bool {
        let wait = match self.last {
            None => KEY_AGAIN,
            Some((at, wait)) if now.duration_since(at) < wait => return false,
            Some((at, _)) if now.duration_since(at) >= KEY_QUIET => KEY_AGAIN,
            Some((_, wait)) => (2 * wait).min(KEY_MOST),
        };
        self.last = Some((now, wait));
        true
    }
}

/// Counts a page that shows pictures, and how many of them.
struct Viewer<'a> {
    hub: &'a Hub,
    format: Format,
    seat: Seat,
    sent: u64,
    shown: u64,
}

impl<'a> Viewer<'a> {
    fn new(hub: &'a Hub, format: Format) -> Self {
        hub.viewers[format as usize].fetch_add(1, Ordering::Relaxed);
        Self { hub, format, seat: Seat::default(), sent: 0, shown: 0 }
    }

    fn shown(&mut self, count: u64) {
        self.shown = self.shown.max(count.min(self.sent));
    }

    fn underway(&self) -> u64 {
        self.sent - self.shown
    }
}

impl Drop for Viewer<'_> {
    fn drop(&mut self) {
        let others = self.hub.viewers[self.format as usize].fetch_sub(1, Ordering::Relaxed) > 1;
        // Nobody is to get an old one as the newest.
        if self.format == Format::Jpeg && !others {
            self.hub.picture.send_replace(None);
        }
    }
}

/// Serves a page until it disconnects or the server ends.
pub(crate) async fn converse(mut socket: WebSocket, shared: &Shared, visitor: &Visitor) {
    let Some(first) = visitor.greeting(&mut socket).await else { return };
    let hello = match ToWatch::read(&first) {
        Ok(ToWatch::Hello(hello)) => hello,
        _ => Hello::default(),
    };
    match shared.controls.may_watch(&hello, visitor.peer, Instant::now()) {
        Ok(knows) => {
            let _spectator = match Spectator::new(&shared.hub, knows) {
                Some(spectator) => spectator,
                None => return refuse(&mut socket, &Refused::Full).await,
            };
            visitor.settle();
            let _ = show(&mut socket, shared, knows).await;
        }
        Err(refused) => refuse(&mut socket, &refused).await,
    }
}

async fn refuse(socket: &mut WebSocket, refused: &Refused) {
    let text = json(&json!({"type": "refused", "why": refused.to_string()}));
    drop(timeout(SEND, socket.send(Message::text(&*text))).await);
}

/// Counts a page that only watches.
struct Spectator<'a>(Option<&'a Hub>);

impl<'a> Spectator<'a> {
    /// `None` if there are enough of them.
    fn new(hub: &'a Hub, knows: bool) -> Option<Self> {
        if knows {
            return Some(Self(None));
        }
        let spectator = Self(Some(hub));
        (hub.spectators.fetch_add(1, Ordering::Relaxed) < SPECTATORS).then_some(spectator)
    }
}

impl Drop for Spectator<'_> {
    fn drop(&mut self) {
        if let Some(hub) = self.0 {
            hub.spectators.fetch_sub(1, Ordering::Relaxed);
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
    let mut viewer = Viewer::new(hub, Format::Jpeg);
    let (known, mut news) = hub.subscribe();
    all(socket, known, knows).await?;
    let (mut pictures, mut states, mut stop) = (hub.picture.subscribe(), hub.state.subscribe(), shared.stop.clone());
    let mut film = hub.film();
    pictures.mark_changed();
    states.mark_changed();
    let mut ping = interval_at(tokio::time::Instant::now() + PING, PING);
    let (mut heard, mut counted, mut since) = (Instant::now(), 0, Instant::now());
    let (mut requests, mut asked, mut format_from) = (Requests::default(), None, tokio::time::Instant::now());
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
                        Ok(ToWatch::Shown(count)) => viewer.shown(count),
                        Ok(ToWatch::Format(format)) => asked = Some(format),
                        Ok(ToWatch::Open(query)) => open(socket, hub, query, knows).await?,
                        _ => {}
                    },
                    Message::Close(_) => return None,
                    _ => {}
                }
            }
            () = sleep_until(format_from), if asked.is_some() => {
                format_from = tokio::time::Instant::now() + FORMAT_AGAIN;
                viewer = Viewer::new(hub, asked.take().unwrap_or(Format::Jpeg));
                film = hub.film();
                if viewer.format == Format::Film && requests.may(Instant::now()) {
                    hub.want_key();
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
            changed = pictures.changed(), if viewer.format == Format::Jpeg && viewer.underway() < UNDERWAY => {
                changed.ok()?;
                let picture = pictures.borrow_and_update().clone();
                if let Some(picture) = picture {
                    viewer.sent += 1;
                    send(socket, Message::Binary(picture)).await?;
                }
            }
            unit = film.recv(), if viewer.format == Format::Film => match unit {
                Ok(unit) => match viewer.seat.take(unit.key, viewer.underway(), film.len()) {
                    Take::Send => {
                        viewer.sent += 1;
                        send(socket, Message::Binary(unit.message.clone())).await?;
                    }
                    Take::Skip => {}
                    Take::WantKey if requests.may(Instant::now()) => hub.want_key(),
                    Take::WantKey => {}
                },
                Err(RecvError::Lagged(_)) => viewer.seat.lose(),
                Err(RecvError::Closed) => return None,
            },
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

/// A binary message: the length of the head, the head, the JPEG or access unit.
pub(crate) fn framed(head: &str, jpeg: &[u8]) -> Bytes {
    let length = u32::try_from(head.len()).unwrap_or_default().to_le_bytes();
    [&length[..], head.as_bytes(), jpeg].concat().into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_asks_for_key_frames_ever_less_often() {
        let (began, mut requests) = (Instant::now(), Requests::default());
        // Ten times a second, for two minutes.
        let granted: Vec<u64> =
            (0..1200).filter(|tenth| requests.may(began + Duration::from_millis(100 * tenth))).map(|tenth| tenth / 10).collect();
        assert_eq!(granted, [0, 2, 6, 14, 30, 62, 94]);
        // After a quiet time as at first.
        let later = began + Duration::from_secs(300);
        assert!(requests.may(later) && !requests.may(later + Duration::from_secs(1)) && requests.may(later + KEY_AGAIN));
    }
}
