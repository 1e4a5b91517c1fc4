//! What there is to see: the newest picture and state, and everything that a page which connects later must still learn.

use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use bytes::Bytes;
use serde::Serialize;
use tokio::sync::{broadcast, watch};

use crate::film::{Unit, Units};
use crate::message::Format;

/// Maximum number of messages queued for a page; one that falls behind gets everything anew.
const QUEUED: usize = 256;
/// Maximum number of images of the film queued for a page.
const FILM: usize = 8;
/// Maximum number of rows and of decisions kept for pages that connect later.
const ROWS: usize = 600;
const DECISIONS: usize = 200;
/// Maximum number of points of the flown path kept; it is thinned by half when it is full.
const PATH: usize = 4000;

/// A message to all pages.
#[derive(Clone, Debug)]
pub(crate) struct News {
    pub(crate) text: Arc<str>,
    /// Not for spectators.
    pub(crate) closed: bool,
}

/// Where the message belongs for a page that connects later.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kept {
    /// A new flight: everything earlier is over.
    Flight,
    /// A row of the list.
    Row,
    /// The open query; none if the text is empty.
    Question,
    /// The end of the flight.
    End,
    /// Nowhere.
    No,
}

/// Everything about one decision.
#[derive(Clone, Debug, Default)]
pub(crate) struct Entry {
    /// For who may know: prompt, reply, reading.
    pub(crate) detail: Option<Arc<str>>,
    /// The picture that was sent, JPEG.
    pub(crate) picture: Option<Bytes>,
}

#[derive(Default)]
struct Past {
    flight: Option<News>,
    rows: VecDeque<News>,
    question: Option<News>,
    end: Option<News>,
    path: Vec<[f64; 2]>,
    /// Every so many points one is kept.
    stride: usize,
    skipped: usize,
    entries: BTreeMap<u64, Entry>,
}

/// The state shared by the flight, the worker and the pages.
pub(crate) struct Hub {
    /// The newest state of the flight, JSON; empty without a flight.
    pub(crate) state: watch::Sender<Arc<str>>,
    /// The newest picture: length of the head, head, JPEG.
    pub(crate) picture: watch::Sender<Option<Bytes>>,
    /// Number of pages that show JPEG pictures, and of those that show the film.
    pub(crate) viewers: [AtomicUsize; 2],
    /// Number of pages that only watch.
    pub(crate) spectators: AtomicUsize,
    film: broadcast::Sender<Arc<Unit>>,
    /// A page waits for a key frame of the film.
    key_wanted: AtomicBool,
    news: broadcast::Sender<News>,
    past: Mutex<Past>,
}

impl Hub {
    pub(crate) fn new() -> Arc<Self> {
        Arc::new(Self {
            state: watch::Sender::new(Arc::from("")),
            picture: watch::Sender::new(None),
            viewers: [const { AtomicUsize::new(0) }; 2],
            spectators: AtomicUsize::new(0),
            film: broadcast::Sender::new(FILM),
            key_wanted: AtomicBool::new(false),
            news: broadcast::Sender::new(QUEUED),
            past: Mutex::default(),
        })
    }

    /// Whether somebody shows pictures in a format.
    pub(crate) fn is_watched_as(&self, format: Format) -> bool {
        self.viewers[format as usize].load(Ordering::Relaxed) > 0
    }

    /// Sends an image of the film to all who follow it.
    pub(crate) fn roll(&self, unit: Unit) {
        drop(self.film.send(Arc::new(unit)));
    }

    /// The images of the film from now on.
    pub(crate) fn film(&self) -> Units {
        self.film.subscribe()
    }

    /// Asks for a key frame.
    pub(crate) fn want_key(&self) {
        self.key_wanted.store(true, Ordering::Relaxed);
    }

    /// Whether one was asked for since the last call.
    pub(crate) fn takes_key(&self) -> bool {
        self.key_wanted.swap(false, Ordering::Relaxed)
    }

    fn past(&self) -> MutexGuard<'_, Past> {
        // Consistent between calls.
        self.past.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Tells all pages, and keeps it for later ones.
    pub(crate) fn tell(&self, kept: Kept, message: &impl Serialize) {
        self.tell_some(kept, message, false);
    }

    /// The same, spectators left out if `closed`.
    pub(crate) fn tell_some(&self, kept: Kept, message: &impl Serialize, closed: bool) {
        let news = News { text: json(message), closed };
        let mut past = self.past();
        match kept {
            Kept::Flight => *past = Past { flight: Some(news.clone()), ..Past::default() },
            Kept::Row => {
                if past.rows.len() >= ROWS {
                    past.rows.pop_front();
                }
                past.rows.push_back(news.clone());
            }
            Kept::Question => past.question = Some(news.clone()),
            Kept::End => past.end = Some(news.clone()),
            Kept::No => {}
        }
        // Without a page nobody receives it. Sent under the lock: a page that subscribes gets it once, here or from the past.
        drop(self.news.send(news));
    }

    /// Tells all pages a line of text; `level` is `info`, `warning` or `error`.
    pub(crate) fn say(&self, text: &str, level: &str) {
        self.tell(Kept::Row, &serde_json::json!({"type": "line", "level": level, "text": text}));
    }

    /// Adds a point to the flown path, metres east and north.
    pub(crate) fn flown(&self, at: [f64; 2]) {
        let mut past = self.past();
        past.skipped += 1;
        if past.skipped > past.stride {
            past.skipped = 0;
            past.path.push(at);
            if past.path.len() >= PATH {
                let mut keep = false;
                past.path.retain(|_| {
                    keep = !keep;
                    keep
                });
                past.stride = 2 * past.stride + 1;
            }
        }
    }

    /// Keeps what is known of a decision, beside what is known already.
    pub(crate) fn keep(&self, query: u64, entry: Entry) {
        let mut past = self.past();
        let kept = past.entries.entry(query).or_default();
        kept.detail = entry.detail.or(kept.detail.take());
        kept.picture = entry.picture.or(kept.picture.take());
        if past.entries.len() > DECISIONS {
            past.entries.pop_first();
        }
    }

    /// What is kept of a decision.
    pub(crate) fn entry(&self, query: u64) -> Option<Entry> {
        self.past().entries.get(&query).cloned()
    }

    /// All that a new page must learn, and what comes after it.
    pub(crate) fn subscribe(&self) -> (Vec<News>, broadcast::Receiver<News>) {
        let past = self.past();
        let path = past.path.clone();
        let mut known: Vec<News> = past.flight.iter().cloned().collect();
        let at = known.len();
        known.extend(past.rows.iter().chain(&past.question).chain(&past.end).cloned());
        let later = self.news.subscribe();
        // The flight waits for this lock, and a long path takes a while to write.
        drop(past);
        known.insert(at, News { text: json(&serde_json::json!({"type": "path", "path": path})), closed: false });
        (known, later)
    }
}

/// A message as text. Our messages have string keys and finite numbers, so it cannot fail.
pub(crate) fn json(message: &impl Serialize) -> Arc<str> {
    serde_json::to_string(message).unwrap_or_default().into()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_page_that_comes_later_learns_everything_once() {
        let hub = Hub::new();
        hub.tell(Kept::Row, &json!("of an earlier flight"));
        hub.tell(Kept::Flight, &json!("flight"));
        hub.tell(Kept::Row, &json!("one"));
        hub.tell(Kept::No, &json!("past"));
        let (known, mut later) = hub.subscribe();
        hub.tell(Kept::Row, &json!("two"));
        let texts: Vec<&str> = known.iter().map(|news| &*news.text).collect();
        assert_eq!(texts, ["\"flight\"", r#"{"type":"path","path":[]}"#, "\"one\""]);
        assert_eq!(&*later.try_recv().unwrap().text, "\"two\"");
        assert!(later.try_recv().is_err());
    }

    #[test]
    fn memory_is_bounded() {
        let hub = Hub::new();
        for at in 0..20_000_u32 {
            hub.flown([f64::from(at), 0.0]);
            hub.tell(Kept::Row, &at);
            hub.keep(u64::from(at), Entry::default());
        }
        let past = hub.past();
        assert!(past.path.len() < PATH && past.rows.len() == ROWS && past.entries.len() == DECISIONS);
        assert!(past.path.is_sorted_by(|a, b| a[0] < b[0]) && past.path[0][0] == 0.0);
    }
}
