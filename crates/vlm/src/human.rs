//! A person who points: lines typed in a terminal become replies (`docs/guide/vlm.md`).

use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use serde_json::{Map, Value, json};
use spf_core::grounding::{AxisOrder, GroundingProfile, Scale};
use spf_core::query::{ImagePoint, Look, Query, QueryKind};
use spf_core::reply::DEPTH_LABELS;
use spf_core::time::Duration;
use tempfile::TempDir;

use crate::error::VlmError;
use crate::wire::reply_schema;
use crate::{Answer, ImageSpec, QueryImage, QueryRequest, Usage, Vlm};

/// The name on the command line.
pub const HUMAN: &str = "human";

/// What may be typed.
pub const HELP: &str = "Type `u v DEPTH` (u from the left, v from the top, as fractions or in pixels of the image; DEPTH 1 to \
                        10), `left`, `right`, `up`, `down` or `behind` if the target is out of view, or `done`.";

/// Orders to the drone, which whoever reads the lines carries out.
pub const ORDERS: [&str; 3] = ["hold", "resume", "land"];

const QUALITY: u8 = 92;
/// How often a wait looks at the cancellation.
const LOOK_UP: Duration = Duration::from_millis(20);

/// Shows a line to the person.
pub type Say = Arc<dyn Fn(&str) + Send + Sync>;

/// A person at a terminal. Clones share the terminal.
#[derive(Clone)]
pub struct Human {
    lines: Arc<Mutex<Receiver<String>>>,
    say: Say,
    folder: Arc<TempDir>,
    /// Whether a line may be older than the image that it answers.
    takes_earlier_lines: bool,
}

impl Human {
    /// A person whose typed lines arrive through `lines`, and who reads what `say` shows.
    ///
    /// # Errors
    /// The operating system's error if there is no folder for the images.
    pub fn new(lines: Receiver<String>, say: Say) -> std::io::Result<Self> {
        let folder = tempfile::Builder::new().prefix("spf-human-").tempdir()?;
        Ok(Self { lines: Arc::new(Mutex::new(lines)), say, folder: Arc::new(folder), takes_earlier_lines: false })
    }

    /// The same, for lines that nobody types while looking, as those of a pipe: one answers each query, in their order.
    #[must_use]
    pub fn from_a_pipe(self) -> Self {
        Self { takes_earlier_lines: true, ..self }
    }

    fn ask(&self, request: &QueryRequest<'_>, image: &mut dyn QueryImage, size: (u32, u32)) -> Result<String, VlmError> {
        let query = request.query;
        let schema = schema_of(query)?;
        let path = self.folder.path().join(format!("{}.jpg", query.frame.0));
        let written = std::fs::write(&path, image.jpeg(size, QUALITY)?);
        written.map_err(|error| VlmError::Image(format!("cannot write the image: {error}")))?;
        let close_up = query.close_up.map(|area| image.close_up(area, size, QUALITY)).transpose()?;
        let enlarged = match close_up {
            Some(jpeg) => {
                let path = self.folder.path().join(format!("{}-close-up.jpg", query.frame.0));
                std::fs::write(&path, jpeg).map_err(|error| VlmError::Image(format!("cannot write the image: {error}")))?;
                format!(", enlarged where the target was: {}", path.display())
            }
            None => String::new(),
        };
        let lines = self.lines.lock().unwrap_or_else(PoisonError::into_inner);
        // What was typed before the image was there is not about it.
        while !self.takes_earlier_lines && lines.try_recv().is_ok() {}
        let (width, height) = size;
        let confirm = if query.memory.confirming { " You answered `done`. Look again, and confirm or correct it." } else { "" };
        (self.say)(&format!(
            "query {}: {} ({width}×{height}){enlarged}: {}{confirm}",
            query.id.0,
            path.display(),
            query.instruction
        ));
        let began = Instant::now();
        loop {
            if request.cancel.is_cancelled() {
                (self.say)("never mind: this query is no longer open");
                return Err(VlmError::Cancelled);
            }
            if began.elapsed() >= request.time_left {
                (self.say)("too late for this query");
                let stage = "nothing was typed".to_owned();
                return Err(VlmError::Deadline { host: HUMAN.to_owned(), waited: began.elapsed(), stage });
            }
            match lines.recv_timeout(LOOK_UP) {
                // An order to the drone ends the query.
                Ok(line) if ORDERS.contains(&line.trim()) => return Err(VlmError::Cancelled),
                Ok(line) => match typed(&line, size) {
                    Ok(pointed) => return Ok(reply(&schema, pointed, &pixels(size)).to_string()),
                    Err(why) => (self.say)(&format!("{why}. {HELP}")),
                },
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => {
                    let reason = "standard input has ended".to_owned();
                    return Err(VlmError::Program { program: HUMAN.to_owned(), reason });
                }
            }
        }
    }
}

impl Vlm for Human {
    fn name(&self) -> &str {
        HUMAN
    }

    fn image_spec(&self, camera: (u32, u32)) -> ImageSpec {
        ImageSpec { grounding: pixels(camera), image_size: None }
    }

    fn answer(&mut self, request: &QueryRequest<'_>, image: &mut dyn QueryImage) -> Answer {
        let began = Instant::now();
        let size = image.size();
        let text = self.ask(request, image, size);
        Answer { text, latency: began.elapsed(), model: HUMAN.to_owned(), account: Usage { requests: 1, ..Usage::default() } }
    }
}

/// The reply of a person who has pointed, in the form that the query asks for and with the coordinates of `profile`.
///
/// # Errors
/// [`VlmError::Refused`] if the query does not ask where to fly.
pub fn reply_to(query: &Query, pointed: Pointed, profile: &GroundingProfile) -> Result<String, VlmError> {
    Ok(reply(&schema_of(query)?, pointed, profile).to_string())
}

fn schema_of(query: &Query) -> Result<Value, VlmError> {
    reply_schema(&query.kind).filter(|_| matches!(query.kind, QueryKind::Point { .. })).ok_or_else(|| {
        let reason = "`human` answers only where to fly: use --policy spf".to_owned();
        VlmError::Refused { model: HUMAN.to_owned(), reason }
    })
}

/// The coordinates in which a person points, in an image of this size: pixels.
#[must_use]
pub fn pixels((width, height): (u32, u32)) -> GroundingProfile {
    GroundingProfile { order: AxisOrder::Xy, scale: Scale::Pixels { width, height }, ..GroundingProfile::default() }
}

/// What a person answers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pointed {
    /// Fly towards this point; the depth label is from 1 to [`DEPTH_LABELS`].
    Point(ImagePoint, u8),
    /// The target is out of view, on this side.
    Look(Look),
    /// The instruction is fulfilled.
    Done,
}

/// Reads a typed line about an image of this size, pixels.
pub(crate) fn typed(line: &str, (width, height): (u32, u32)) -> Result<Pointed, String> {
    const LOOKS: [(&str, Look); 5] =
        [("left", Look::Left), ("right", Look::Right), ("up", Look::Up), ("down", Look::Down), ("behind", Look::Behind)];
    let words: Vec<&str> = line.split([' ', '\t', ',']).filter(|word| !word.is_empty()).collect();
    match words.as_slice() {
        ["done"] => Ok(Pointed::Done),
        [word] => {
            let look = LOOKS.iter().find(|(name, _)| name == word).map(|(_, look)| Pointed::Look(*look));
            look.ok_or_else(|| "not understood".to_owned())
        }
        [u, v, depth] => {
            let number = |word: &str| word.parse::<f64>().ok().filter(|value| *value >= 0.0);
            let (Some(mut u), Some(mut v)) = (number(u), number(v)) else { return Err("u and v must be numbers".to_owned()) };
            // 1 × 1 is the whole image in fractions, and one of its pixels otherwise.
            if u > 1.0 || v > 1.0 {
                (u, v) = (u / f64::from(width), v / f64::from(height));
            }
            if u > 1.0 || v > 1.0 {
                return Err(format!("the point is outside the image of {width}×{height} pixels"));
            }
            let depth = depth.parse().ok().filter(|depth| (1..=DEPTH_LABELS).contains(depth));
            let depth = depth.ok_or_else(|| format!("the depth label must be a whole number from 1 to {DEPTH_LABELS}"))?;
            Ok(Pointed::Point(ImagePoint { u, v }, depth))
        }
        [] => Err("nothing was typed".to_owned()),
        _ => Err("not understood".to_owned()),
    }
}

/// The reply in the form that the query's schema asks for: what was not typed is null or empty.
fn reply(schema: &Value, pointed: Pointed, profile: &GroundingProfile) -> Value {
    let mut known = Map::new();
    match pointed {
        Pointed::Done => {
            known.insert("status".to_owned(), json!("done"));
        }
        Pointed::Look(way) => {
            known.insert("status".to_owned(), json!("not_visible"));
            known.insert("look".to_owned(), json!(way));
        }
        Pointed::Point(point, depth) => {
            known.insert("status".to_owned(), json!("navigating"));
            known.insert("point".to_owned(), json!(profile.point_numbers(point)));
            known.insert("depth".to_owned(), json!(depth));
        }
    }
    let properties = schema.get("properties").and_then(Value::as_object);
    let fields = properties.into_iter().flatten().filter_map(|(name, field)| {
        let kinds: Vec<&str> = match field.get("type") {
            Some(Value::String(kind)) => vec![kind],
            Some(Value::Array(kinds)) => kinds.iter().filter_map(Value::as_str).collect(),
            _ => Vec::new(),
        };
        let empty = || {
            let of = |kind: &str| kinds.contains(&kind);
            (of("null").then_some(Value::Null))
                .or_else(|| of("array").then(|| json!([])))
                .or_else(|| of("string").then(|| json!("")))
        };
        Some((name.clone(), known.get(name).cloned().or_else(empty)?))
    });
    Value::Object(fields.collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use spf_core::frame::FrameId;
    use spf_core::query::QueryId;
    use spf_core::reply::{Status, parse_reply};

    const SIZE: (u32, u32) = (960, 720);

    #[test]
    fn lines_become_replies_that_the_parser_reads() {
        for avoid in [false, true] {
            let schema = reply_schema(&QueryKind::point(avoid)).unwrap();
            let read = |line: &str| {
                let text = reply(&schema, typed(line, SIZE).unwrap(), &pixels(SIZE)).to_string();
                parse_reply(&text, &pixels(SIZE), avoid).unwrap_or_else(|error| panic!("{text}: {error}"))
            };
            assert_eq!((read("done").status, read("done").point), (Status::Done, None));
            assert_eq!((read("left").status, read("left").look), (Status::NotVisible, Some(Look::Left)));
            for line in ["0.5 0.25 6", "480,180,6", " 480 180\t6 "] {
                let reply = read(line);
                assert_eq!((reply.status, reply.depth), (Status::Navigating, Some(6)));
                assert_eq!(reply.point, Some(ImagePoint { u: 0.5, v: 0.25 }), "{line}");
            }
        }
    }

    #[test]
    fn other_lines_are_explained() {
        for (line, why) in [
            ("", "nothing"),
            ("0.5 0.5", "not understood"),
            ("a b 3", "numbers"),
            ("961 10 3", "outside"),
            ("0.5 0.5 11", "1 to 10"),
            ("-1 0 3", "numbers"),
            ("NaN 0 3", "numbers"),
            ("go", "not understood"),
        ] {
            let error = typed(line, SIZE).unwrap_err();
            assert!(error.contains(why), "{line}: {error}");
        }
    }

    #[test]
    fn a_person_is_asked_again_until_it_is_understood() {
        struct Blank;
        impl QueryImage for Blank {
            fn size(&self) -> (u32, u32) {
                SIZE
            }
            fn jpeg(&mut self, _: (u32, u32), _: u8) -> Result<Arc<[u8]>, VlmError> {
                Ok(Arc::from([0xff, 0xd8].as_slice()))
            }
        }
        let (send, lines) = std::sync::mpsc::channel();
        let (shown, seen) = std::sync::mpsc::channel();
        let shown = Mutex::new(shown);
        let mut human = Human::new(lines, Arc::new(move |line| shown.lock().unwrap().send(line.to_owned()).unwrap())).unwrap();
        send.send("1 2 3".to_owned()).unwrap();
        let query =
            Query { instruction: "to the crane".to_owned(), ..Query::new(QueryId(4), FrameId(9), QueryKind::point(false)) };
        let typist = std::thread::spawn(move || {
            let line = seen.recv().unwrap();
            assert!(line.contains("query 4") && line.contains("9.jpg") && line.contains("to the crane"), "{line}");
            let path = line.split(' ').find(|word| word.ends_with(".jpg")).unwrap().to_owned();
            assert_eq!(std::fs::read(path).unwrap(), [0xff, 0xd8]);
            send.send("hello".to_owned()).unwrap();
            assert!(seen.recv().unwrap().starts_with("not understood"));
            send.send("0.25 0.5 4".to_owned()).unwrap();
            (send, seen)
        });
        let ask = |human: &mut Human, time_left| human.answer(&QueryRequest::new(&query, time_left), &mut Blank).text;
        let text = ask(&mut human, Duration::from_secs(20)).unwrap();
        assert!(text.contains("[240.0,360.0]"), "{text}");
        let (send, _seen) = typist.join().unwrap();
        assert_eq!(ask(&mut human, Duration::ZERO).unwrap_err().code(), "deadline");
        send.send("0.5 0.5 2".to_owned()).unwrap();
        let mut piped = human.clone().from_a_pipe();
        assert!(ask(&mut piped, Duration::from_secs(20)).unwrap().contains("[480.0,360.0]"));
        drop(send);
        assert_eq!(ask(&mut human, Duration::from_secs(20)).unwrap_err().to_string(), "`human` failed: standard input has ended");
    }

    proptest! {
        #[test]
        fn no_line_panics(line in "\\PC{0,60}") {
            let _ = typed(&line, SIZE);
        }
    }
}
