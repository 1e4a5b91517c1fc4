//! Recorded flights: the list of a folder, and the files of one of them.

mod again;
#[cfg(test)]
mod gate;
mod removal;
#[cfg(test)]
mod replay_tests;

use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll};
use std::time::{Duration, Instant, UNIX_EPOCH};

use axum::body::{Body, HttpBody};
use axum::http::header::{ACCEPT_RANGES, CONTENT_DISPOSITION, CONTENT_RANGE, CONTENT_TYPE};
use axum::http::{HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use hyper::body::{Frame, SizeHint};
use serde_json::{Value, json};
use tokio::sync::mpsc;

/// Maximum number of flights listed, the newest.
const LISTED: usize = 500;
/// Maximum size of a summary that is read for the list, and of a part of a film sent at once, bytes.
const SUMMARY: u64 = 1 << 20;
const PART: u64 = 2 << 20;
/// Size of the pieces in which a file is read, bytes, and how many of them wait to be sent at most.
const PIECE: usize = 64 << 10;
const PIECES: usize = 4;
/// The folder is read anew after this time.
const FRESH: Duration = Duration::from_secs(2);

/// The bench's report, and its maximum size, bytes.
const REPORT: &str = "report.html";
const REPORT_BYTES: u64 = 16 << 20;

/// The files of a flight that are served: their names and types, and whether a browser shows them.
const FILES: [(&str, &str, bool); 6] = [
    ("video.mp4", "video/mp4", true),
    ("trajectory.svg", "image/svg+xml", true),
    ("decisions.jsonl", "application/jsonl; charset=utf-8", true),
    ("queries.jsonl", "application/jsonl; charset=utf-8", true),
    ("summary.json", "application/json", true),
    ("flight.mcap", "application/octet-stream", false),
];

/// A folder with folders of flights.
#[derive(Clone, Debug)]
pub struct Flights {
    folder: PathBuf,
    known: Arc<Mutex<Option<Known>>>,
    /// What a replay waits for before it begins.
    #[cfg(test)]
    gate: gate::Gate,
}

/// What the folder held a moment ago.
#[derive(Clone, Debug)]
struct Known {
    at: Instant,
    found: Arc<[(String, PathBuf)]>,
    list: Arc<str>,
}

impl Flights {
    /// The flights in a folder, which need not exist yet. A folder that is a flight itself is a list of one.
    #[must_use]
    pub fn of(folder: &Path) -> Self {
        Self {
            folder: folder.to_owned(),
            known: Arc::default(),
            #[cfg(test)]
            gate: gate::Gate::default(),
        }
    }

    /// Where a file of a flight lies, links followed; `None` if there is none, or if it lies outside of the folder of flights.
    fn inside(&self, flight: &Path, file: &str) -> Option<PathBuf> {
        let (folder, path) = (self.folder.canonicalize().ok()?, flight.join(file).canonicalize().ok()?);
        path.starts_with(folder).then_some(path)
    }

    /// Whether a flight has a file.
    fn has(&self, flight: &Path, file: &str) -> bool {
        self.inside(flight, file).is_some_and(|path| path.is_file())
    }

    /// The folders of flights, with the names under which they are served; newest first.
    fn found(&self) -> Vec<(String, PathBuf)> {
        let is_flight = |path: &Path| self.has(path, "summary.json");
        if is_flight(&self.folder) {
            let name = self.folder.file_name().map_or_else(|| "flight".to_owned(), |name| name.to_string_lossy().into_owned());
            return vec![(name, self.folder.clone())];
        }
        let entries = std::fs::read_dir(&self.folder).into_iter().flatten().map_while(Result::ok);
        let mut found: Vec<(u64, String, PathBuf)> = entries
            .filter(|entry| is_flight(&entry.path()))
            .filter_map(|entry| Some((written(&entry.path()), entry.file_name().into_string().ok()?, entry.path())))
            .collect();
        found.sort_by(|a, b| (b.0, &b.1).cmp(&(a.0, &a.1)));
        found.into_iter().take(LISTED).map(|(_, name, path)| (name, path)).collect()
    }

    /// What the folder holds. Whoever asks meanwhile waits for the same answer.
    fn known(&self) -> Known {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = known.as_ref().filter(|known| known.at.elapsed() < FRESH) {
            return known.clone();
        }
        let found = self.found();
        let list = self.listed(&found).into();
        known.insert(Known { at: Instant::now(), found: found.into(), list }).clone()
    }

    /// The list, JSON. It reads files: not for a thread that must not wait.
    pub(crate) fn list(&self) -> String {
        format!(r#"{{"report":{},"flights":{}}}"#, self.has(&self.folder, REPORT), self.known().list)
    }

    fn folder(&self, name: &str) -> Option<PathBuf> {
        self.known().found.iter().find(|(known, _)| known == name).map(|(_, folder)| folder.clone())
    }

    /// Deletes a flight. What was done, or why not.
    pub(crate) fn remove(&self, name: &str) -> Result<&'static str, &'static str> {
        let folder = self.folder(name).ok_or("no such flight")?;
        if folder == self.folder {
            return Err("the folder served is this flight itself: delete it by hand");
        }
        let removed = removal::remove(&folder);
        // The list is read anew.
        self.known.lock().unwrap_or_else(PoisonError::into_inner).take();
        removed
    }

    /// What differs if a flight is replayed, JSON; given up once `flying`.
    pub(crate) fn again(&self, name: &str, flying: impl Fn() -> bool) -> Result<String, String> {
        let folder = self.folder(name).ok_or("no such flight")?;
        #[cfg(test)]
        self.gate.pass();
        let log = self.inside(&folder, "flight.mcap").ok_or(again::UNREADABLE)?;
        again::differences(&log, flying)
    }

    /// The bench's report, if there is one in the folder.
    pub(crate) fn report(&self) -> Option<Vec<u8>> {
        spf_input::read(&self.inside(&self.folder, REPORT)?, REPORT_BYTES).ok()
    }

    /// A file of a flight, or the part of it that is asked for; within a runtime that reads it on. Names are compared with what is there, never joined to a path, and no link leads out of the folder.
    pub(crate) fn file(&self, name: &str, file: &str, range: Option<&str>) -> Response {
        let missing = || (StatusCode::NOT_FOUND, "no such flight or file\n").into_response();
        let Some((file, kind, shown)) = FILES.into_iter().find(|(known, ..)| *known == file) else { return missing() };
        let Some((name, folder)) = self.known().found.iter().find(|(known, _)| known == name).cloned() else { return missing() };
        let open = self.inside(&folder, file).and_then(|path| spf_input::open(&path).ok());
        let Some(open) = open else { return missing() };
        let mut response = match part(open, range) {
            Ok(response) => response,
            Err(status) => return (status, "the file cannot be read\n").into_response(),
        };
        let headers = response.headers_mut();
        headers.insert(CONTENT_TYPE, HeaderValue::from_static(kind));
        headers.insert(ACCEPT_RANGES, HeaderValue::from_static("bytes"));
        if !shown {
            let plain: String = name.chars().filter(|c| c.is_ascii_alphanumeric() || matches!(c, '-' | '_')).collect();
            if let Ok(value) = HeaderValue::from_str(&format!("attachment; filename=\"{plain}.mcap\"")) {
                headers.insert(CONTENT_DISPOSITION, value);
            }
        }
        response
    }

    /// The list of these flights, JSON.
    fn listed(&self, found: &[(String, PathBuf)]) -> String {
        let flight = |(name, path): &(String, PathBuf)| {
            let summary = self.summary(path);
            let has = |file: &str| self.has(path, file);
            let get = |key: &str| summary.get(key).cloned().unwrap_or(Value::Null);
            json!({
                "name": name, "written": written(path), "instruction": get("instruction"),
                "earlier_instructions": get("earlier_instructions"), "outcome": get("outcome"),
                "verified": get("verified"), "cause": get("cause"), "scene": get("scene"), "drone": get("drone"), "vlm": get("vlm"),
                "time": get("finished_at_s"), "since_motion": get("completion_time_s"), "flown": get("path_length_m"),
                "decisions": get("decisions"), "not_recorded": get("not_recorded"),
                "distance": get("final_distance_m"), "collisions": get("collisions"),
                "film": has("video.mp4"), "map": has("trajectory.svg"), "log": has("flight.mcap"),
            })
        };
        Value::Array(found.iter().map(flight).collect()).to_string()
    }

    fn summary(&self, flight: &Path) -> Value {
        let text = self.inside(flight, "summary.json").and_then(|path| spf_input::read(&path, SUMMARY).ok());
        text.and_then(|text| serde_json::from_slice(&text).ok()).unwrap_or(Value::Null)
    }
}

/// Seconds since 1970 at which the flight ended; 0 if unknown.
fn written(flight: &Path) -> u64 {
    let at = std::fs::metadata(flight.join("summary.json")).and_then(|data| data.modified()).ok();
    at.and_then(|at| at.duration_since(UNIX_EPOCH).ok()).map_or(0, |since| since.as_secs())
}

/// The whole of a file, or the part that a browser asks for to jump within a film.
fn part(mut file: File, range: Option<&str>) -> Result<Response, StatusCode> {
    let failed = |_| StatusCode::INTERNAL_SERVER_ERROR;
    let length = file.metadata().map_err(failed)?.len();
    let asked = match range {
        Some(range) => Some(ranged(range, length).ok_or(StatusCode::RANGE_NOT_SATISFIABLE)?),
        None => None,
    };
    let (from, to) = asked.unwrap_or((0, length));
    file.seek(SeekFrom::Start(from)).map_err(failed)?;
    let mut response = Body::new(Pieces::of(file, to - from)).into_response();
    if asked.is_some() {
        *response.status_mut() = StatusCode::PARTIAL_CONTENT;
        let told = format!("bytes {from}-{}/{length}", to.saturating_sub(1));
        response
            .headers_mut()
            .insert(CONTENT_RANGE, HeaderValue::from_str(&told).map_err(|_| StatusCode::INTERNAL_SERVER_ERROR)?);
    }
    Ok(response)
}

/// A part of a file that is read piece by piece, as it is sent.
struct Pieces {
    left: u64,
    pieces: mpsc::Receiver<std::io::Result<Bytes>>,
}

impl Pieces {
    /// The next `length` bytes of a file; the sender's time limit ends a read that nobody takes.
    fn of(mut file: File, length: u64) -> Self {
        let (send, pieces) = mpsc::channel(PIECES);
        drop(tokio::task::spawn_blocking(move || {
            let mut left = length;
            while left > 0 {
                let mut piece = vec![0; PIECE.min(usize::try_from(left).unwrap_or(PIECE))];
                let read = file.read_exact(&mut piece).map(|()| Bytes::from(piece));
                let (read_on, size) = (read.is_ok(), read.as_ref().map_or(0, Bytes::len));
                if send.blocking_send(read).is_err() || !read_on {
                    return;
                }
                left -= size as u64;
            }
        }));
        Self { left: length, pieces }
    }
}

impl HttpBody for Pieces {
    type Data = Bytes;
    type Error = std::io::Error;

    fn poll_frame(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<std::io::Result<Frame<Bytes>>>> {
        self.pieces.poll_recv(cx).map(|piece| {
            let piece = piece?;
            self.left -= piece.as_ref().map_or(0, |piece| piece.len() as u64);
            Some(piece.map(Frame::data))
        })
    }

    fn size_hint(&self) -> SizeHint {
        SizeHint::with_exact(self.left)
    }
}

/// The first byte and the one after the last of a `Range` header with a single range, at most [`PART`] bytes.
fn ranged(header: &str, length: u64) -> Option<(u64, u64)> {
    let (from, to) = header.strip_prefix("bytes=")?.split_once('-')?;
    let (from, to) = match (from, to) {
        ("", last) => (length.saturating_sub(last.parse().ok()?), length),
        (from, "") => (from.parse().ok()?, length),
        (from, to) => (from.parse().ok()?, to.parse::<u64>().ok()?.checked_add(1)?.min(length)),
    };
    (from < to).then(|| (from, to.min(from.saturating_add(PART))))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn only_files_of_flights_are_served() {
        let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
        let _within = runtime.enter();
        let folder = tempfile::tempdir().unwrap();
        let flight = folder.path().join("001-a");
        std::fs::create_dir(&flight).unwrap();
        std::fs::create_dir(folder.path().join("no-flight")).unwrap();
        std::fs::write(flight.join("summary.json"), r#"{"instruction":"go <b>","outcome":"reached"}"#).unwrap();
        std::fs::write(flight.join("video.mp4"), [7; 100]).unwrap();
        std::fs::write(folder.path().join("secret"), "x").unwrap();
        let flights = Flights::of(folder.path());
        let list: Value = serde_json::from_str(&flights.list()).unwrap();
        assert_eq!(list["report"], json!(false));
        let list = &list["flights"];
        assert_eq!((list.as_array().unwrap().len(), &list[0]["instruction"]), (1, &json!("go <b>")));
        let status = |name: &str, file: &str, range| flights.file(name, file, range).status().as_u16();
        assert_eq!(status("001-a", "video.mp4", None), 200);
        assert_eq!(status("001-a", "video.mp4", Some("bytes=10-19")), 206);
        let whole: Vec<u8> = (0..300_000_u32).map(|at| (at % 251) as u8).collect();
        std::fs::write(flight.join("flight.mcap"), &whole).unwrap();
        let sent = |range| {
            let body = flights.file("001-a", "flight.mcap", range).into_body();
            runtime.block_on(axum::body::to_bytes(body, usize::MAX)).unwrap()
        };
        assert!(sent(None) == whole && sent(Some("bytes=100000-299998")) == whole[100_000..299_999]);
        std::fs::remove_file(flight.join("flight.mcap")).unwrap();
        assert_eq!(status("001-a", "video.mp4", Some("bytes=100-")), 416);
        for (name, file) in
            [("..", "secret"), ("001-a", "../../secret"), ("001-a", "flight.mcap"), ("no-flight", "video.mp4"), ("", "video.mp4")]
        {
            assert_eq!(status(name, file, None), 404, "{name}/{file}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn nothing_is_followed_through_a_link_out_of_the_folder() {
        use std::os::unix::fs::symlink;
        let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
        let _within = runtime.enter();
        let (base, elsewhere) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        // The folder itself may be reached through a link.
        let folder = base.path().join("flights");
        std::fs::create_dir(base.path().join("real")).unwrap();
        symlink(base.path().join("real"), &folder).unwrap();
        let (flight, other) = (folder.join("001-a"), elsewhere.path().join("private"));
        for flight in [&flight, &other] {
            std::fs::create_dir(flight).unwrap();
            std::fs::write(flight.join("summary.json"), r#"{"instruction":"told"}"#).unwrap();
            std::fs::write(flight.join("decisions.jsonl"), "secret").unwrap();
        }
        std::fs::write(elsewhere.path().join("report.html"), "secret").unwrap();
        symlink(other.join("decisions.jsonl"), flight.join("video.mp4")).unwrap();
        symlink(other.join("decisions.jsonl"), flight.join("flight.mcap")).unwrap();
        symlink(flight.join("decisions.jsonl"), flight.join("trajectory.svg")).unwrap();
        symlink("../../../../../../../../../etc/passwd", flight.join("passwd")).unwrap();
        symlink(&other, folder.join("002-linked")).unwrap();
        symlink(elsewhere.path().join("report.html"), folder.join(REPORT)).unwrap();
        std::fs::create_dir(folder.join("003-summary")).unwrap();
        symlink(other.join("summary.json"), folder.join("003-summary").join("summary.json")).unwrap();
        let flights = Flights::of(&folder);
        let list: Value = serde_json::from_str(&flights.list()).unwrap();
        let names: Vec<&Value> = list["flights"].as_array().unwrap().iter().map(|flight| &flight["name"]).collect();
        assert_eq!((names, &list["report"]), (vec![&json!("001-a")], &json!(false)), "{list}");
        let told = &list["flights"][0];
        assert_eq!((&told["film"], &told["log"], &told["map"]), (&json!(false), &json!(false), &json!(true)));
        let status = |name: &str, file: &str| flights.file(name, file, None).status().as_u16();
        for (name, file) in [("001-a", "video.mp4"), ("001-a", "flight.mcap"), ("002-linked", "decisions.jsonl")] {
            assert_eq!(status(name, file), 404, "{name}/{file}");
        }
        assert_eq!((status("001-a", "decisions.jsonl"), status("001-a", "trajectory.svg")), (200, 200), "links inside");
        assert!(flights.report().is_none());
        assert!(flights.again("001-a", || false).unwrap_err().contains("cannot be read"));
    }

    proptest! {
        #[test]
        fn a_range_lies_within_the_file(header in "bytes=[0-9]{0,20}-[0-9]{0,20}|.{0,30}", length in 0_u64..10_000_000) {
            if let Some((from, to)) = ranged(&header, length) {
                prop_assert!(from < to && to <= length && to - from <= PART);
            }
        }
    }
}
