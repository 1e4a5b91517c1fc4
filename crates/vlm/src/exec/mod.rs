//! A program of the user's own that answers queries: one JSON line in, one JSON line out (`docs/guide/vlm.md`).
//!
//! The program is started once and shared by all clones; queries are answered one after the other. Nothing is run by a
//! shell.

mod process;

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use serde::Serialize;
use serde_json::{Map, Value};
use spf_core::grounding::{AxisOrder, GroundingProfile, Scale};
use spf_core::query::QueryKind;
use spf_core::time::Duration;
use tempfile::TempDir;

use self::process::{Running, Said};
use crate::error::{VlmError, brief, quote};
use crate::image::ImageRule;
use crate::request::QueryRequest;
use crate::usage::{StageTimes, Usage};
use crate::wire::reply_schema;
use crate::{Answer, ImageSpec, QueryImage, Vlm};

/// Prefix of a VLM name that denotes a program.
pub const EXEC: &str = "exec:";

/// Maximum time for an answer if the options give no other: a model on a CPU may take minutes.
const LONGEST_ANSWER: Duration = Duration::from_secs(600);
/// Time from the start of a program to its first answer during which it is not killed: it may be loading a model.
const LOADING: Duration = Duration::from_secs(300);
/// Time that a program has to say before take-off whether its answers list obstacles: it need not have loaded a model for that.
const DECLARES: Duration = Duration::from_secs(10);
/// How often a wait looks at the cancellation.
const LOOK_UP: Duration = Duration::from_millis(10);

/// Why a program cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExecError {
    /// Not a command.
    #[error("not a command: {0}")]
    Words(&'static str),
    /// The program could not be started.
    #[error("cannot start `{program}`")]
    Start {
        /// The program.
        program: String,
        /// The cause.
        #[source]
        source: std::io::Error,
    },
    /// No folder for its images.
    #[error("cannot create a folder for the images of `{program}`")]
    Folder {
        /// The program.
        program: String,
        /// The cause.
        #[source]
        source: std::io::Error,
    },
}

/// How a program is queried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExecOptions {
    /// Maximum side length of its images, pixels; `None` for the camera's size.
    pub long_side: Option<u32>,
    /// JPEG quality, 1..=100.
    pub quality: u8,
    /// Time from its start to its first answer during which a missed deadline does not end it.
    pub loading: Duration,
    /// Maximum time for an answer, even if the query has more left: in virtual time a query has a day, and a program that
    /// hangs must not stop a run of the bench for so long.
    pub longest_answer: Duration,
}

impl Default for ExecOptions {
    fn default() -> Self {
        Self { long_side: None, quality: 90, loading: LOADING, longest_answer: LONGEST_ANSWER }
    }
}

/// A program as a VLM. Clones share the program.
#[derive(Clone)]
pub struct Exec {
    name: String,
    options: ExecOptions,
    desk: Arc<Mutex<Desk>>,
}

/// The program and what is needed to start it again.
struct Desk {
    words: Vec<String>,
    folder: TempDir,
    running: Option<Running>,
    next_id: u64,
}

/// A request, as the program reads it.
#[derive(Serialize)]
struct Line<'a> {
    /// Number of the request; the reply carries it.
    id: u64,
    /// Path of the image, a JPEG.
    image: &'a std::path::Path,
    /// Its width, pixels.
    width: u32,
    /// Its height, pixels.
    height: u32,
    /// Path of the enlarged part of it, a JPEG of the same size.
    #[serde(skip_serializing_if = "Option::is_none")]
    close_up: Option<&'a std::path::Path>,
    /// That part, `[left, top, right, bottom]` in fractions of the image.
    #[serde(skip_serializing_if = "Option::is_none")]
    close_up_area: Option<[f64; 4]>,
    /// Order of coordinates in the reply, as in the table of models.
    order: &'static str,
    /// Unit of coordinates in the reply, as in the table of models.
    scale: &'static str,
    /// Kind of answer.
    #[serde(flatten)]
    kind: &'a QueryKind,
    /// The user's instruction.
    instruction: &'a str,
    /// The whole prompt.
    prompt: &'a str,
    /// JSON schema of the reply; null if any text is allowed.
    schema: Option<Value>,
    /// Seconds until the reply is no longer used.
    deadline_s: f64,
}

impl Exec {
    /// Starts the program of a command (without `exec:`), whose words are split as a shell would split them.
    ///
    /// # Errors
    /// [`ExecError`] if the program cannot be started.
    pub fn start(command: &str, options: ExecOptions) -> Result<Self, ExecError> {
        let words = shlex::split(command).ok_or(ExecError::Words("unbalanced quotes"))?;
        let Some(program) = words.first().cloned() else { return Err(ExecError::Words("no program is named")) };
        let folder = tempfile::Builder::new().prefix("spf-exec-").tempdir();
        let folder = folder.map_err(|source| ExecError::Folder { program: program.clone(), source })?;
        let running = Running::start(&words).map_err(|source| ExecError::Start { program, source })?;
        let desk = Desk { words, folder, running: Some(running), next_id: 0 };
        Ok(Self { name: format!("{EXEC}{command}"), options, desk: Arc::new(Mutex::new(desk)) })
    }

    /// Why the program ended by itself, if it did within `wait` of its start; waits until then. One that lacks a part that it needs
    /// ends before the first query, and would be noticed in flight only.
    #[must_use]
    pub fn ends_within(&self, wait: Duration) -> Option<VlmError> {
        loop {
            let mut desk = self.desk.lock().unwrap_or_else(PoisonError::into_inner);
            let program = desk.words.first().cloned().unwrap_or_default();
            let running = desk.running.as_mut()?;
            let is_over = running.started.elapsed() >= wait;
            if let Some(reason) = running.ended() {
                return Some(VlmError::Program { program, reason });
            }
            drop(desk);
            if is_over {
                return None;
            }
            std::thread::sleep(LOOK_UP);
        }
    }

    /// Asks the program whether its answers list obstacles, as obstacle mode needs: `{"id":0,"kind":"declare"}`, answered by
    /// `{"id":0,"boxes":false}`. Whoever says anything else, or nothing within 10 s, lists them, as models do.
    #[must_use]
    pub fn lists_boxes(&self) -> bool {
        let mut desk = self.desk.lock().unwrap_or_else(PoisonError::into_inner);
        let program = desk.words.first().cloned().unwrap_or_default();
        desk.declared().unwrap_or_else(|error| {
            tracing::debug!(program, "does not declare whether its answers list boxes: {error}");
            true
        })
    }

    fn size(&self, camera: (u32, u32)) -> (u32, u32) {
        let rule = ImageRule { long_side: u32::MAX, ..ImageRule::default() };
        rule.sent(camera, self.options.long_side)
    }
}

fn pixels((width, height): (u32, u32)) -> GroundingProfile {
    GroundingProfile { order: AxisOrder::Xy, scale: Scale::Pixels { width, height }, ..GroundingProfile::default() }
}

impl Vlm for Exec {
    fn name(&self) -> &str {
        &self.name
    }

    fn image_spec(&self, camera: (u32, u32)) -> ImageSpec {
        let size = self.size(camera);
        ImageSpec { grounding: pixels(size), image_size: Some(size).filter(|size| *size != camera) }
    }

    fn answer(&mut self, request: &QueryRequest<'_>, image: &mut dyn QueryImage) -> Answer {
        let size = self.size(image.size());
        image.prepare(size);
        let jpeg = image.jpeg(size, self.options.quality);
        let close_up = request.query.close_up.map(|area| image.close_up(area, size, self.options.quality)).transpose();
        let images = jpeg.and_then(|jpeg| Ok((jpeg, close_up?)));
        // Other flights may be using the program: waiting for them is no latency of this query.
        let mut desk = self.desk.lock().unwrap_or_else(PoisonError::into_inner);
        let began = Instant::now();
        let mut account = Usage::default();
        let text =
            images.and_then(|(jpeg, close_up)| desk.ask(request, &jpeg, close_up.as_deref(), size, &self.options, &mut account));
        let latency = began.elapsed();
        account.parts = StageTimes { complete_s: text.is_ok().then_some(latency.as_secs_f64()), ..account.parts };
        Answer { text, latency, model: self.name.clone(), account }
    }
}

impl Desk {
    /// The running program; started again if it has ended.
    fn running(&mut self) -> Result<&mut Running, VlmError> {
        let program = self.words.first().cloned().unwrap_or_default();
        if let Some(reason) = self.running.as_mut().and_then(Running::ended) {
            tracing::debug!(program, reason, "starting the program again");
            self.running = None;
        }
        match &mut self.running {
            Some(running) => Ok(running),
            none => {
                let running = Running::start(&self.words)
                    .map_err(|error| VlmError::Program { program, reason: format!("it cannot be started: {error}") })?;
                Ok(none.insert(running))
            }
        }
    }

    /// What the program declares about boxes.
    fn declared(&mut self) -> Result<bool, VlmError> {
        let program = self.words.first().cloned().unwrap_or_default();
        let id = self.next_id;
        self.next_id += 1;
        let running = self.running()?;
        running.discard();
        running.send(format!(r#"{{"id":{id},"kind":"declare"}}"#));
        let began = Instant::now();
        let waited = loop {
            match running.next(LOOK_UP) {
                Some(Said::Line(line)) if line.trim_start().starts_with('{') => {
                    if let Some(said) = read_reply(&program, id, &line) {
                        let said: Value = serde_json::from_str(&said?).unwrap_or_default();
                        return Ok(said["boxes"].as_bool().unwrap_or(true));
                    }
                }
                Some(Said::Line(_)) => {}
                Some(Said::End) => {
                    let reason = running.why_ended();
                    self.running = None;
                    // Started at once: one that ends again lacks a part that it needs, which is noticed before take-off.
                    drop(self.running());
                    return Err(VlmError::Program { program, reason });
                }
                None => {}
            }
            if began.elapsed() > DECLARES {
                break began.elapsed();
            }
        };
        Err(VlmError::Deadline { host: program, waited, stage: "it has not declared anything".to_owned() })
    }

    fn image(&self, name: &str, jpeg: &[u8]) -> Result<PathBuf, VlmError> {
        let path = self.folder.path().join(name);
        let written = std::fs::write(&path, jpeg);
        written.map(|()| path).map_err(|error| VlmError::Image(format!("cannot write the image: {error}")))
    }

    fn ask(
        &mut self,
        request: &QueryRequest<'_>,
        jpeg: &[u8],
        close_up: Option<&[u8]>,
        size: (u32, u32),
        options: &ExecOptions,
        account: &mut Usage,
    ) -> Result<String, VlmError> {
        let id = self.next_id;
        self.next_id += 1;
        let path = self.image(&format!("{id}.jpg"), jpeg)?;
        let close_up = close_up.map(|jpeg| self.image(&format!("{id}-close-up.jpg"), jpeg)).transpose()?;
        let asked = self.exchange(request, id, (&path, close_up.as_deref()), size, options, account);
        // A program that is still busy with them keeps them open, or has no more use for them.
        drop(std::fs::remove_file(path));
        close_up.into_iter().for_each(|path| drop(std::fs::remove_file(path)));
        asked
    }

    fn exchange(
        &mut self,
        request: &QueryRequest<'_>,
        id: u64,
        (image, close_up): (&std::path::Path, Option<&std::path::Path>),
        (width, height): (u32, u32),
        options: &ExecOptions,
        account: &mut Usage,
    ) -> Result<String, VlmError> {
        let program = self.words.first().cloned().unwrap_or_default();
        let query = request.query;
        let running = self.running()?;
        // While it has not answered yet, it may be loading a model.
        let loaded = running.started + options.loading;
        let still_loading = if running.answered { Duration::ZERO } else { loaded.saturating_duration_since(Instant::now()) };
        let (began, time) = (Instant::now(), request.time_left.min(options.longest_answer.max(still_loading)));
        let line = Line {
            id,
            image,
            width,
            height,
            close_up,
            close_up_area: query.close_up.map(|area| [area.left, area.top, area.right, area.bottom]),
            order: "xy",
            scale: "pixels",
            kind: &query.kind,
            instruction: &query.instruction,
            prompt: &query.prompt,
            schema: reply_schema(&query.kind),
            deadline_s: time.as_secs_f64(),
        };
        let line = serde_json::to_string(&line)
            .map_err(|error| VlmError::Refused { model: program.clone(), reason: error.to_string() })?;
        // Whatever it printed unasked, such as the progress of loading, is no answer.
        running.discard();
        (account.requests, account.bytes_sent) = (1, line.len() as u64);
        running.send(line);
        let mut noise = String::new();
        loop {
            if request.cancel.is_cancelled() {
                return Err(VlmError::Cancelled);
            }
            match running.next(LOOK_UP) {
                // The progress of loading a model is often printed there; of a program that does not know the protocol it is
                // all that can be told.
                Some(Said::Line(line)) if !line.trim_start().starts_with('{') => {
                    noise = format!("; it printed: {}", brief(quote(&line)));
                }
                Some(Said::Line(line)) => {
                    if let Some(reply) = read_reply(&program, id, &line) {
                        running.answered = true;
                        return reply;
                    }
                }
                Some(Said::End) => {
                    let reason = running.why_ended();
                    self.running = None;
                    return Err(VlmError::Program { program, reason });
                }
                None if began.elapsed() < time => {}
                None => {
                    let stage = if running.answered || Instant::now() >= loaded {
                        running.kill();
                        self.running = None;
                        // Started at once, so that it is ready when the next query comes.
                        drop(self.running());
                        "the program was killed and started again"
                    } else {
                        "the program has not answered since its start"
                    };
                    return Err(VlmError::Deadline { host: program, waited: began.elapsed(), stage: format!("{stage}{noise}") });
                }
            }
        }
    }
}

/// The reply to the request `id` in a line of a program; `None` if it is the reply to another request.
///
/// # Errors
/// [`VlmError`] if the line is no reply, or says why there is none.
#[must_use]
pub fn read_reply(program: &str, id: u64, line: &str) -> Option<Result<String, VlmError>> {
    let malformed = |reason: String| VlmError::Malformed { host: program.to_owned(), reason };
    let mut object: Map<String, Value> = match serde_json::from_str(line) {
        Ok(object) => object,
        Err(error) => {
            let shown = brief(quote(line));
            return Some(Err(malformed(format!("its line is not a JSON object ({error}): {shown}"))));
        }
    };
    match object.shift_remove("id").as_ref().and_then(Value::as_u64) {
        Some(of) if of == id => {}
        Some(of) => {
            tracing::debug!(program, of, id, "dropped the reply to another request");
            return None;
        }
        None => return Some(Err(malformed("its reply lacks the `id` of the request".to_owned()))),
    }
    if let Some(Value::String(reason)) = object.get("error") {
        return Some(Err(VlmError::Program { program: program.to_owned(), reason: brief(quote(reason)) }));
    }
    Some(match (object.get("text"), object.len()) {
        // Text as a model wrote it.
        (Some(Value::String(text)), 1) => Ok(text.clone()),
        _ => Ok(Value::Object(object).to_string()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn replies_are_told_by_their_id() {
        let of = |line: &str| read_reply("p", 3, line);
        assert_eq!(of(r#"{"id":3,"status":"done","point":null}"#), Some(Ok(r#"{"status":"done","point":null}"#.to_owned())));
        assert_eq!(of(r#"{"text":"{\"a\":1}","id":3}"#), Some(Ok(r#"{"a":1}"#.to_owned())));
        assert_eq!(of(r#"{"id":2,"status":"done"}"#), None);
        assert_eq!(of(r#"{"id":3,"error":"no GPU"}"#).unwrap().unwrap_err().to_string(), "`p` failed: no GPU");
        for (line, why) in
            [("Loading…", "not a JSON object"), (r#"{"status":"done"}"#, "lacks the `id`"), (r#"{"id":-3}"#, "lacks the `id`")]
        {
            let error = of(line).unwrap().unwrap_err();
            assert_eq!(error.code(), "malformed");
            assert!(error.to_string().contains(why), "{error}");
        }
    }

    proptest! {
        #[test]
        fn no_line_panics(line in "\\PC{0,200}") {
            let _ = read_reply("p", 0, &line);
        }
    }

    #[test]
    fn commands_without_a_program_are_refused() {
        for (command, why) in [
            ("", "no program"),
            ("  ", "no program"),
            ("python3 'a", "unbalanced quotes"),
            ("/no/such/program x", "cannot start"),
        ] {
            let error = Exec::start(command, ExecOptions::default()).err().unwrap();
            assert!(error.to_string().contains(why), "{command}: {error}");
        }
    }
}
