//! Questions written to a folder for whoever answers, a person or a model that is not called over a wire, and their answers
//! (`docs/guide/bench.md`).
//!
//! Each flight has a folder of its own. Its questions are counted from 1: `q0001.txt` is the prompt, `q0001.png` the picture,
//! `a0001.txt` the answer, which whoever answers writes. A flight that is flown again writes the same questions, and takes the
//! answers that are there: so a run that was stopped goes on where it was. Questions that differ from those on the disk end the
//! run, because their answers would be answers to something else. `log.jsonl` keeps each answer as it was flown.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, ErrorKind, Read as _};
use std::path::{Path, PathBuf};
use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Instant, SystemTime};

use serde::{Deserialize, Serialize};
use spf_core::grounding::{AxisOrder, GroundingProfile, Scale};
use spf_core::query::{Query, QueryKind};
use spf_core::reply::MAX_TEXT;
use spf_core::time::Duration;

use crate::error::VlmError;
use crate::human::{self, HELP, Say};
use crate::image::ImageRule;
use crate::{Answer, ImageSpec, QueryImage, QueryRequest, Usage, Vlm};

/// What is open, one question per line: prompt, picture and answer, relative to the folder and separated by tabs.
pub const OPEN: &str = "open.txt";
/// The questions of a flight that were answered, one JSON object per line.
const LOG: &str = "log.jsonl";
/// How often a wait looks for the answer.
const LOOK_UP: Duration = Duration::from_millis(100);
/// Text that is no complete JSON object may be half written: it is taken once it has not changed for this long.
const SETTLED: Duration = Duration::from_secs(5);
/// Longest answer that is read, bytes.
const LONGEST: u64 = 4 * MAX_TEXT as u64;
/// Latency reported for an answer, which whoever flies replaces by a simulated one: wall time says nothing here.
const LATENCY: Duration = Duration::from_millis(1500);

/// The coordinates in which answers give points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Points {
    /// `[x, y]` in pixels of the picture.
    #[default]
    Pixels,
    /// `[x, y]` in thousandths of the picture's width and height.
    Thousandths,
    /// `[y, x]` in thousandths, as Gemini points.
    YxThousandths,
}

impl Points {
    fn grounding(self, (width, height): (u32, u32)) -> GroundingProfile {
        let (order, scale) = match self {
            Self::Pixels => (AxisOrder::Xy, Scale::Pixels { width, height }),
            Self::Thousandths => (AxisOrder::Xy, Scale::Thousand),
            Self::YxThousandths => (AxisOrder::Yx, Scale::Thousand),
        };
        GroundingProfile { order, scale, ..GroundingProfile::default() }
    }
}

/// How questions are asked.
#[derive(Clone, Debug, PartialEq)]
pub struct FolderOptions {
    /// The name of the VLM that whoever answers stands for.
    pub name: String,
    /// The coordinates of points.
    pub points: Points,
    /// Maximum side length of the pictures, pixels; `None` for the camera's size.
    pub long_side: Option<u32>,
    /// JPEG quality that the pictures have gone through, 1..=100, as those that a model gets.
    pub quality: u8,
    /// Whether answers are waited for. If not, a flight ends at its first question without an answer.
    pub waits: bool,
}

/// The folder of a run. Clones share it.
#[derive(Clone)]
pub struct QuestionFolder {
    run: Arc<Run>,
}

struct Run {
    folder: PathBuf,
    options: FolderOptions,
    say: Say,
    /// Lines that somebody types.
    typed: Option<Mutex<Receiver<String>>>,
    /// The lines of the file of open questions, by the path of the prompt.
    open: Mutex<BTreeMap<String, String>>,
}

/// A row of the log of a flight.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Answered {
    /// Number of the question, from 1.
    pub question: u32,
    /// Id of the query in the flight.
    pub query: u64,
    /// The file of the prompt.
    pub prompt: String,
    /// The files of its pictures.
    pub pictures: Vec<String>,
    /// The answer as it was flown.
    pub answer: String,
}

impl QuestionFolder {
    /// A folder for the questions of a run; `say` tells of each that is open. With `typed`, answers are also read from these lines.
    #[must_use]
    pub fn new(folder: &Path, options: FolderOptions, say: Say, typed: Option<Receiver<String>>) -> Self {
        let run = Run { folder: folder.to_owned(), options, say, typed: typed.map(Mutex::new), open: Mutex::default() };
        Self { run: Arc::new(run) }
    }

    /// Begins the list of open questions anew, for a run that nobody else writes to.
    ///
    /// # Errors
    /// [`VlmError::Folder`] if it cannot be written.
    pub fn begin(&self) -> Result<(), VlmError> {
        self.run.list(&BTreeMap::new())
    }

    /// The name of the VLM that whoever answers stands for.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.run.options.name
    }

    /// Where the questions of the flight with this id are.
    #[must_use]
    pub fn of_flight(&self, run_id: &str) -> PathBuf {
        self.run.folder.join(run_id)
    }

    /// The VLM of the flight with this id, from its first question.
    ///
    /// # Errors
    /// [`VlmError::Folder`] if its log cannot be read.
    pub fn vlm(&self, run_id: &str) -> Result<FolderVlm, VlmError> {
        let folder = self.of_flight(run_id);
        fs::create_dir_all(&folder).map_err(|error| failed(&folder, &error))?;
        let flown = log(&folder)?;
        Ok(FolderVlm { run: self.run.clone(), run_id: run_id.to_owned(), folder, asked: 0, flown })
    }
}

impl Run {
    fn list(&self, open: &BTreeMap<String, String>) -> Result<(), VlmError> {
        let text: String = open.values().map(|line| format!("{line}\n")).collect();
        put(&self.folder.join(OPEN), text.as_bytes())
    }

    /// Lists a question as open; with `None`, no longer.
    fn lists(&self, prompt: &str, line: Option<String>) -> Result<(), VlmError> {
        let mut open = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        let changed = match line {
            Some(line) => open.insert(prompt.to_owned(), line).is_none(),
            None => open.remove(prompt).is_some(),
        };
        if changed { self.list(&open) } else { Ok(()) }
    }
}

/// The answered questions of a flight, in order. A last line that was not written completely is left out.
///
/// # Errors
/// [`VlmError::Folder`] if the log cannot be read.
pub fn log(folder: &Path) -> Result<Vec<Answered>, VlmError> {
    let path = folder.join(LOG);
    let text = match fs::read_to_string(&path) {
        Ok(text) => text,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(failed(&path, &error)),
    };
    rows(&text).map_err(|line| wrong(&path, format!("line {line} is no row of this log: restore or delete the file")))
}

/// The rows of a log's text, without a last line that was not written completely.
///
/// # Errors
/// The number of the first line that is no row, or not the next one.
pub fn rows(text: &str) -> Result<Vec<Answered>, u32> {
    let whole = text.split_inclusive('\n').filter(|line| line.ends_with('\n'));
    let row = |(line, number)| serde_json::from_str(line).ok().filter(|row: &Answered| row.question == number).ok_or(number);
    whole.zip(1..).map(row).collect()
}

/// What the bytes of an answer's file say, and whether nobody can be writing it any more: it is a whole JSON object, which no part of
/// one is.
#[must_use]
pub fn answer_of(bytes: &[u8]) -> (String, bool) {
    // Some editors put a mark first.
    let text = String::from_utf8_lossy(bytes);
    let text = text.trim_start_matches(|first: char| first == '\u{feff}' || first.is_whitespace()).trim_end().to_owned();
    let is_whole = serde_json::from_str::<serde_json::Map<String, serde_json::Value>>(&text).is_ok();
    (text, is_whole)
}

fn failed(path: &Path, error: &io::Error) -> VlmError {
    wrong(path, format!("cannot be read or written: {error}"))
}

fn wrong(path: &Path, reason: impl Into<String>) -> VlmError {
    VlmError::Folder { path: path.display().to_string(), reason: reason.into() }
}

/// Writes a file so that it is either complete or not there.
fn put(path: &Path, bytes: &[u8]) -> Result<(), VlmError> {
    let mut beside = path.as_os_str().to_owned();
    beside.push(".new");
    let beside = PathBuf::from(beside);
    let written = fs::write(&beside, bytes).and_then(|()| fs::rename(&beside, path));
    written.map_err(|error| {
        drop(fs::remove_file(&beside));
        failed(path, &error)
    })
}

/// The contents of a file, up to the longest that is read; `None` if there is none.
fn read(path: &Path) -> Result<Option<Vec<u8>>, VlmError> {
    let mut bytes = Vec::new();
    match File::open(path).and_then(|file| file.take(LONGEST).read_to_end(&mut bytes)) {
        Ok(_) => Ok(Some(bytes)),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => Err(failed(path, &error)),
    }
}

/// The questions of one flight.
pub struct FolderVlm {
    run: Arc<Run>,
    run_id: String,
    folder: PathBuf,
    asked: u32,
    /// What was answered before the flight was flown again.
    flown: Vec<Answered>,
}

/// A file with its name.
type Named = (String, Vec<u8>);

impl FolderVlm {
    fn size(&self, camera: (u32, u32)) -> (u32, u32) {
        let rule = ImageRule { long_side: u32::MAX, ..ImageRule::default() };
        rule.sent(camera, self.run.options.long_side)
    }

    fn ask(&mut self, request: &QueryRequest<'_>, image: &mut dyn QueryImage) -> Result<String, VlmError> {
        let query = request.query;
        let number = self.asked;
        let (prompt, answer) = (format!("q{number:04}.txt"), self.folder.join(format!("a{number:04}.txt")));
        let pictures = self.pictures(query, image)?;
        self.asks(&prompt, query, &pictures, &answer)?;
        let names: Vec<String> = pictures.into_iter().map(|(name, _)| name).collect();
        let text = self.answer_to(request, &prompt, &names, &answer, self.size(image.size()))?;
        let key = format!("{}/{prompt}", self.run_id);
        self.run.lists(&key, None)?;
        self.keep(Answered { question: number, query: query.id.0, prompt, pictures: names, answer: text.clone() }, &answer)?;
        if text.chars().count() > MAX_TEXT {
            return Err(VlmError::TooLong { host: self.run.options.name.clone(), limit: MAX_TEXT });
        }
        Ok(text)
    }

    /// The pictures as whoever answers sees them: as a model does, with the traces of the JPEG that is sent.
    fn pictures(&self, query: &Query, image: &mut dyn QueryImage) -> Result<Vec<Named>, VlmError> {
        let (size, quality) = (self.size(image.size()), self.run.options.quality);
        let number = self.asked;
        image.prepare(size);
        let mut pictures = vec![(format!("q{number:04}.png"), png(&image.jpeg(size, quality)?)?)];
        if let Some(area) = query.close_up {
            pictures.push((format!("q{number:04}-close-up.png"), png(&image.close_up(area, size, quality)?)?));
        }
        Ok(pictures)
    }

    /// Writes the question, or makes sure that it is the one that was written before.
    fn asks(&self, prompt: &str, query: &Query, pictures: &[Named], answer: &Path) -> Result<(), VlmError> {
        let path = self.folder.join(prompt);
        let differs = |path: &Path| {
            let reason = "differs from what is asked now: the program, the task, a setting or an earlier answer has changed since it \
                          was written";
            wrong(path, reason)
        };
        // A picture is longer than any answer that is read.
        let is = |path: &Path, bytes: &[u8]| match fs::read(path) {
            Ok(there) => Ok(Some(there == bytes)),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(error) => Err(failed(path, &error)),
        };
        let known = is(&path, query.prompt.as_bytes())?;
        if known == Some(false) {
            return Err(differs(&path));
        }
        if known.is_none() && read(answer)?.is_some_and(|bytes| !bytes.trim_ascii().is_empty()) {
            return Err(wrong(answer, "was there before its question, and so is no answer to it: delete it"));
        }
        for (name, bytes) in pictures {
            let path = self.folder.join(name);
            match is(&path, bytes)? {
                Some(false) if known.is_some() => return Err(differs(&path)),
                Some(true) => {}
                _ => put(&path, bytes)?,
            }
        }
        // Last: who sees the prompt sees a complete question.
        if known.is_none() { put(&path, query.prompt.as_bytes()) } else { Ok(()) }
    }

    /// Waits for the answer.
    fn answer_to(
        &self,
        request: &QueryRequest<'_>,
        prompt: &str,
        pictures: &[String],
        answer: &Path,
        size: (u32, u32),
    ) -> Result<String, VlmError> {
        let asked = self.folder.join(prompt);
        let mut seen: Option<(Vec<u8>, Instant)> = None;
        let mut is_told = false;
        loop {
            let bytes = read(answer)?.filter(|bytes| !bytes.trim_ascii().is_empty());
            if let Some(bytes) = bytes {
                let (text, is_whole) = answer_of(&bytes);
                if is_whole || is_old(answer) {
                    return Ok(text);
                }
                match &seen {
                    Some((before, since)) if *before == bytes => {
                        if since.elapsed() >= SETTLED {
                            return Ok(text);
                        }
                    }
                    _ => seen = Some((bytes, Instant::now())),
                }
            }
            if !is_told {
                is_told = true;
                self.open(request.query, prompt, pictures, answer)?;
            }
            if request.cancel.is_cancelled() {
                return Err(VlmError::Cancelled);
            }
            if !self.run.options.waits && seen.is_none() {
                return Err(VlmError::Postponed);
            }
            if !asked.exists() {
                return Err(wrong(&asked, "was deleted while its answer was waited for"));
            }
            match &self.run.typed {
                Some(lines) if seen.is_none() => self.type_in(lines, request.query, size, answer)?,
                _ => std::thread::sleep(LOOK_UP),
            }
        }
    }

    /// Tells that a question is open.
    fn open(&self, query: &Query, prompt: &str, pictures: &[String], answer: &Path) -> Result<(), VlmError> {
        let run_id = &self.run_id;
        let name = answer.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let inside = |name: &str| format!("{run_id}/{name}");
        let shown = pictures.iter().map(|name| inside(name)).collect::<Vec<_>>().join("\t");
        let key = inside(prompt);
        self.run.lists(&key, Some(format!("{key}\t{shown}\t{}", inside(&name))))?;
        let typed = self.run.typed.is_some().then(|| format!("\n{}\n{HELP}", query.prompt));
        let pictures = pictures.join(", ");
        (self.run.say)(&format!(
            "open: {} with {pictures}; the answer goes to {name}{}",
            self.folder.join(prompt).display(),
            typed.unwrap_or_default()
        ));
        Ok(())
    }

    /// Looks for a typed line for a moment, and writes the answer that it means.
    fn type_in(&self, lines: &Mutex<Receiver<String>>, query: &Query, size: (u32, u32), answer: &Path) -> Result<(), VlmError> {
        use std::sync::mpsc::RecvTimeoutError::{Disconnected, Timeout};
        let line = lines.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(LOOK_UP);
        let line = match line {
            Ok(line) => line,
            Err(Timeout) => return Ok(()),
            Err(Disconnected) => return Err(wrong(answer, "was not typed: standard input has ended")),
        };
        let reply = if line.trim_start().starts_with('{') || !matches!(query.kind, QueryKind::Point { .. }) {
            line
        } else {
            match human::typed(&line, size) {
                Ok(pointed) => human::reply_to(query, pointed, &self.run.options.points.grounding(size))?,
                Err(why) => {
                    (self.run.say)(&format!("{why}. {HELP}"));
                    return Ok(());
                }
            }
        };
        // What was written meanwhile by another hand counts.
        if read(answer)?.is_some_and(|bytes| !bytes.trim_ascii().is_empty()) { Ok(()) } else { put(answer, reply.as_bytes()) }
    }

    /// Writes the row of an answered question, or makes sure that it was flown with the same answer before.
    fn keep(&mut self, row: Answered, answer: &Path) -> Result<(), VlmError> {
        let path = self.folder.join(LOG);
        match self.flown.get(row.question as usize - 1) {
            Some(before) if *before == row => Ok(()),
            Some(_) => Err(wrong(
                answer,
                format!(
                    "was changed after it was flown: put back the answer that {LOG} has; or, to fly on from the new one, delete {LOG} \
                     and all questions and answers after it"
                ),
            )),
            None => {
                self.flown.push(row);
                let lines: Result<String, _> =
                    self.flown.iter().map(|row| serde_json::to_string(row).map(|row| row + "\n")).collect();
                put(&path, lines.map_err(|error| failed(&path, &error.into()))?.as_bytes())
            }
        }
    }
}

impl Vlm for FolderVlm {
    fn name(&self) -> &str {
        &self.run.options.name
    }

    fn image_spec(&self, camera: (u32, u32)) -> ImageSpec {
        let size = self.size(camera);
        let grounding = self.run.options.points.grounding(size);
        ImageSpec { grounding, image_size: Some(size).filter(|size| *size != camera) }
    }

    /// Waits as long as it takes, whatever time the query has left: the flight's clock stands still.
    fn answer(&mut self, request: &QueryRequest<'_>, image: &mut dyn QueryImage) -> Answer {
        self.asked += 1;
        let text = self.ask(request, image);
        let account = Usage { requests: 1, ..Usage::default() };
        Answer { text, latency: LATENCY, model: self.run.options.name.clone(), account }
    }
}

/// A picture as PNG, which every viewer shows.
fn png(jpeg: &[u8]) -> Result<Vec<u8>, VlmError> {
    let image = spf_media::jpeg::decode(jpeg).map_err(|error| VlmError::Image(error.to_string()))?;
    spf_media::png::encode(&image).map_err(|error| VlmError::Image(error.to_string()))
}

/// Whether a file was last written so long ago that nobody is writing it any more.
fn is_old(path: &Path) -> bool {
    let written = fs::metadata(path).and_then(|data| data.modified()).ok();
    written.and_then(|written| SystemTime::now().duration_since(written).ok()).is_some_and(|age| age >= SETTLED)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::request::Cancel;
    use spf_core::frame::FrameId;
    use spf_core::query::{ImageBox, QueryId};
    use spf_core::reply::parse_reply;
    use std::sync::mpsc::{Sender, channel};
    use tempfile::TempDir;

    const SIZE: (u32, u32) = (64, 48);
    const DONE: &str = r#"{"status": "done", "point": null}"#;

    /// A picture of one colour.
    struct Plain(u8);

    impl QueryImage for Plain {
        fn size(&self) -> (u32, u32) {
            SIZE
        }

        fn jpeg(&mut self, size: (u32, u32), quality: u8) -> Result<Arc<[u8]>, VlmError> {
            let image = spf_media::Rgb::filled(size.0, size.1, [self.0, 90, 30]);
            Ok(spf_media::Jpeg::encode(&image, quality).unwrap().shared())
        }
    }

    fn options(waits: bool) -> FolderOptions {
        FolderOptions { name: "asked:me".to_owned(), points: Points::Pixels, long_side: None, quality: 90, waits }
    }

    fn folder(at: &TempDir, waits: bool) -> QuestionFolder {
        QuestionFolder::new(at.path(), options(waits), Arc::new(|_| {}), None)
    }

    fn query(number: u64) -> Query {
        let prompt = format!("prompt of query {number}\n");
        Query { prompt, ..Query::new(QueryId(number), FrameId(number), QueryKind::point(false)) }
    }

    /// Asks the queries of a flight up to the first that is not answered.
    fn fly(folder: &QuestionFolder, shade: u8, queries: u64) -> Vec<Result<String, VlmError>> {
        let mut vlm = folder.vlm("task/spf/asked-me/0").unwrap();
        let mut texts = Vec::new();
        for number in 0..queries {
            let query = query(number);
            let answer = vlm.answer(&QueryRequest::new(&query, Duration::ZERO), &mut Plain(shade));
            let is_over = answer.text.is_err();
            texts.push(answer.text);
            if is_over {
                break;
            }
        }
        texts
    }

    fn at(folder: &TempDir, name: &str) -> PathBuf {
        folder.path().join("task/spf/asked-me/0").join(name)
    }

    fn why(texts: &[Result<String, VlmError>]) -> String {
        let error = texts.last().unwrap().clone().unwrap_err();
        assert_eq!((error.code(), error.trouble()), ("folder", Some(crate::Trouble::Lasting)));
        error.to_string()
    }

    proptest::proptest! {
        #[test]
        fn any_bytes_are_read_as_a_log_and_as_an_answer(bytes: Vec<u8>, cut in 0_usize..80) {
            let (text, is_whole) = answer_of(&bytes);
            let begins = text.as_bytes().first() == Some(&b'{');
            proptest::prop_assert!(text.trim() == text && (!is_whole || begins));
            drop(rows(&String::from_utf8_lossy(&bytes)));
            let row = |question| Answered {
                question, query: 0, prompt: "q0001.txt".to_owned(), pictures: Vec::new(), answer: "{}".to_owned(),
            };
            let log: String = [row(1), row(2)].iter().map(|row| serde_json::to_string(row).unwrap() + "\n").collect();
            // A log that is cut off has the rows before.
            let whole = rows(&log[..cut.min(log.len())]).unwrap().len();
            proptest::prop_assert_eq!(whole, usize::from(cut >= log.len() / 2));
        }
    }

    #[test]
    fn a_flight_goes_on_at_the_first_question_without_an_answer() {
        let place = TempDir::new().unwrap();
        let asked = folder(&place, false);
        assert_eq!(fly(&asked, 7, 3), [Err(VlmError::Postponed)]);
        assert_eq!(fs::read_to_string(at(&place, "q0001.txt")).unwrap(), "prompt of query 0\n");
        let picture = fs::read(at(&place, "q0001.png")).unwrap();
        assert!(picture.starts_with(b"\x89PNG"));
        let run = "task/spf/asked-me/0";
        let open = || fs::read_to_string(place.path().join(OPEN)).unwrap();
        assert_eq!(open(), format!("{run}/q0001.txt\t{run}/q0001.png\t{run}/a0001.txt\n"));

        // An empty file is no answer yet.
        fs::write(at(&place, "a0001.txt"), "\n").unwrap();
        assert_eq!(fly(&asked, 7, 3), [Err(VlmError::Postponed)]);
        fs::write(at(&place, "a0001.txt"), format!("\u{feff}{DONE}\n")).unwrap();
        assert_eq!(fly(&asked, 7, 3), [Ok(DONE.to_owned()), Err(VlmError::Postponed)]);
        assert_eq!(open(), format!("{run}/q0002.txt\t{run}/q0002.png\t{run}/a0002.txt\n"));

        // What a crash left at the end of a write, and a picture that somebody deleted, are made good.
        fs::remove_file(at(&place, "q0001.png")).unwrap();
        fs::write(at(&place, "q0003.png"), "half").unwrap();
        let log_file = at(&place, LOG);
        let line = fs::read_to_string(&log_file).unwrap();
        fs::write(&log_file, format!("{line}{}", &line[..9])).unwrap();
        fs::write(at(&place, "a0002.txt"), DONE).unwrap();
        assert_eq!(fly(&asked, 7, 3).len(), 3);
        assert_eq!(fs::read(at(&place, "q0001.png")).unwrap(), picture);
        assert_eq!(fs::read(at(&place, "q0003.png")).unwrap(), picture);
        let rows = log(&place.path().join(run)).unwrap();
        assert_eq!(
            rows.iter().map(|row| (row.question, row.query, row.answer.as_str())).collect::<Vec<_>>(),
            [(1, 0, DONE), (2, 1, DONE)]
        );
    }

    #[test]
    fn what_does_not_fit_ends_the_run() {
        let place = TempDir::new().unwrap();
        let asked = folder(&place, false);
        fly(&asked, 7, 1);
        fs::write(at(&place, "a0001.txt"), DONE).unwrap();
        // Another picture, then another prompt.
        assert!(why(&fly(&asked, 99, 2)).contains("q0001.png` differs"));
        assert_eq!(fly(&asked, 7, 2).len(), 2);
        let prompt = fs::read_to_string(at(&place, "q0001.txt")).unwrap();
        fs::write(at(&place, "q0001.txt"), format!("{prompt}!")).unwrap();
        assert!(why(&fly(&asked, 7, 2)).contains("q0001.txt` differs"));
        fs::write(at(&place, "q0001.txt"), prompt).unwrap();
        // An answer that was flown, changed; and one that nobody could have given to this question.
        fs::write(at(&place, "a0001.txt"), r#"{"status": "blocked"}"#).unwrap();
        assert!(why(&fly(&asked, 7, 2)).contains("a0001.txt` was changed after it was flown"));
        fs::write(at(&place, "a0001.txt"), DONE).unwrap();
        fs::write(at(&place, "a0002.txt"), DONE).unwrap();
        fs::remove_file(at(&place, "q0002.txt")).unwrap();
        assert!(why(&fly(&asked, 7, 2)).contains("a0002.txt` was there before its question"));
        fs::write(at(&place, LOG), "no log\n").unwrap();
        assert!(asked.vlm("task/spf/asked-me/0").err().unwrap().to_string().contains("line 1 is no row"));
    }

    #[test]
    fn a_half_written_answer_is_waited_for() {
        let place = TempDir::new().unwrap();
        let asked = folder(&place, true);
        let answer = at(&place, "a0001.txt");
        let writer = std::thread::spawn({
            let (question, answer) = (at(&place, "q0001.txt"), answer.clone());
            move || {
                while !question.exists() {
                    std::thread::sleep(Duration::from_millis(5));
                }
                fs::write(&answer, &DONE[..20]).unwrap();
                std::thread::sleep(Duration::from_millis(400));
                fs::write(&answer, DONE).unwrap();
            }
        });
        assert_eq!(fly(&asked, 7, 1), [Ok(DONE.to_owned())]);
        writer.join().unwrap();
        // Words are taken as they are once they are old enough.
        fly(&folder(&place, false), 7, 2);
        let words = File::create(at(&place, "a0002.txt")).unwrap();
        fs::write(at(&place, "a0002.txt"), "I see\nnothing").unwrap();
        words.set_modified(SystemTime::now() - 2 * SETTLED).unwrap();
        assert_eq!(fly(&folder(&place, false), 7, 2)[1], Ok("I see\nnothing".to_owned()));
        // What is too long is no reply, as of a model.
        fly(&folder(&place, false), 7, 3);
        fs::write(at(&place, "a0003.txt"), format!("{{\"a\": \"{}\"}}", "x".repeat(MAX_TEXT))).unwrap();
        assert!(matches!(fly(&folder(&place, false), 7, 3)[2], Err(VlmError::TooLong { .. })));
    }

    #[test]
    fn a_wait_ends_when_it_is_cancelled_or_its_question_is_gone() {
        let place = TempDir::new().unwrap();
        let asked = folder(&place, true);
        let cancel = Cancel::default();
        cancel.cancel();
        let query = query(0);
        let request = QueryRequest { cancel, ..QueryRequest::new(&query, Duration::ZERO) };
        let mut vlm = asked.vlm("task/spf/asked-me/0").unwrap();
        assert_eq!(vlm.answer(&request, &mut Plain(7)).text, Err(VlmError::Cancelled));
        let question = at(&place, "q0001.txt");
        let remover = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(150));
            fs::remove_file(question).unwrap();
        });
        assert!(why(&fly(&asked, 7, 1)).contains("was deleted"));
        remover.join().unwrap();
    }

    /// Folder, lines to type, and what is said.
    fn typed(place: &TempDir, points: Points) -> (QuestionFolder, Sender<String>, Arc<Mutex<Vec<String>>>) {
        let (send, lines) = channel();
        let said: Arc<Mutex<Vec<String>>> = Arc::default();
        let heard = said.clone();
        let say: Say = Arc::new(move |text| heard.lock().unwrap().push(text.to_owned()));
        (QuestionFolder::new(place.path(), FolderOptions { points, ..options(true) }, say, Some(lines)), send, said)
    }

    #[test]
    fn an_answer_may_be_typed_in_short_and_is_kept_as_the_reply() {
        for points in [Points::Pixels, Points::Thousandths, Points::YxThousandths] {
            let place = TempDir::new().unwrap();
            let (asked, send, said) = typed(&place, points);
            for line in ["there", "32 12 4"] {
                send.send(line.to_owned()).unwrap();
            }
            let text = fly(&asked, 7, 1).remove(0).unwrap();
            assert_eq!(fs::read_to_string(at(&place, "a0001.txt")).unwrap(), text);
            let point = parse_reply(&text, &points.grounding(SIZE), false).unwrap().point.unwrap();
            assert!((point.u - 0.5).abs() < 1e-9 && (point.v - 0.25).abs() < 1e-9, "{points:?}: {text}");
            let said = said.lock().unwrap().clone();
            assert!(
                said[0].contains("q0001.txt") && said[0].contains("prompt of query 0") && said[1].starts_with("not understood")
            );
            drop(send);
            assert!(why(&fly(&asked, 7, 2)).contains("standard input has ended"));
        }
    }

    #[test]
    fn a_close_up_is_a_second_picture() {
        let place = TempDir::new().unwrap();
        let asked = folder(&place, false);
        let area = ImageBox { left: 0.25, top: 0.25, right: 0.5, bottom: 0.5 };
        let query = Query { close_up: Some(area), ..query(0) };
        let mut vlm = asked.vlm("task/spf/asked-me/0").unwrap();
        let answer = vlm.answer(&QueryRequest::new(&query, Duration::ZERO), &mut Plain(7));
        assert_eq!(answer.text, Err(VlmError::Postponed));
        assert!(at(&place, "q0001-close-up.png").exists());
        assert!(fs::read_to_string(place.path().join(OPEN)).unwrap().contains("\ttask/spf/asked-me/0/q0001-close-up.png\t"));
    }

    #[test]
    fn a_folder_that_cannot_be_written_is_named() {
        let place = TempDir::new().unwrap();
        fs::write(place.path().join("task"), "a file").unwrap();
        let error = folder(&place, true).vlm("task/spf/asked-me/0").err().unwrap();
        assert!(error.to_string().contains("cannot be read or written"), "{error}");
    }
}
