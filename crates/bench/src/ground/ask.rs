//! Answerers, and sending them many questions: in parallel, rate-limited, up to a cost limit, skipping those already
//! answered.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use spf_core::frame::FrameId;
use spf_core::grounding::GroundingProfile;
use spf_core::prompt::{PromptInput, PromptText};
use spf_core::query::{ImageBox, ImagePoint, Memory, Query, QueryId, QueryKind};
use spf_core::reply::{Reply, Status};
use spf_core::time::Duration;
use spf_media::Rgb;
use spf_oracle::ErrorFile;
use spf_pilot::policy::spf::{is_small, region};
use spf_vlm::{Answer, Cancel, QueryRequest, Usage, Vlm, VlmError};

use super::photo::Photograph;
use super::{AnswerRow, Item, ParsedReply, oracle, photo};
use crate::fnv;

/// The baseline that always points at the image centre.
pub const CENTRE: &str = "centre";
/// Depth label of the centre baseline: mid-range.
const CENTRE_LABEL: u8 = 5;
/// Polling interval while waiting for the rate limit.
const LOOK_UP: Duration = Duration::from_millis(50);

/// Creates a VLM client, one per worker.
pub type MakeVlm = Arc<dyn Fn() -> Box<dyn Vlm> + Send + Sync>;

/// The kind of a source of answers.
#[derive(Clone)]
pub enum AnswererKind {
    /// Always the image centre.
    Centre,
    /// The oracle, for simulated images only; its errors and the seed of their random values.
    Oracle(Box<ErrorFile>, u64),
    /// A model and its prompt.
    Model(MakeVlm, Arc<PromptText>),
}

impl AnswererKind {
    /// A digest of its configuration: its prompt, or its error file and seed.
    #[must_use]
    pub fn digest(&self) -> String {
        let words = match self {
            Self::Centre => String::new(),
            Self::Oracle(errors, seed) => format!("{errors:?} {seed}"),
            Self::Model(_, prompt) => format!("{prompt:?}"),
        };
        format!("{:016x}", fnv(words.as_bytes()))
    }
}

/// A source of answers: a model, the oracle or the baseline.
#[derive(Clone)]
pub struct Answerer {
    /// The name.
    pub name: String,
    /// Its kind.
    pub kind: AnswererKind,
}

/// How questions are asked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AskOptions {
    /// Whether obstacle boxes are requested as well.
    pub avoid: bool,
    /// Whether a model that finds a small target is asked again with the target's region as a second, enlarged image.
    pub close_up: bool,
    /// Reply timeout.
    pub time: Duration,
}

impl Answerer {
    /// The image-centre baseline.
    #[must_use]
    pub fn centre() -> Self {
        Self { name: CENTRE.to_owned(), kind: AnswererKind::Centre }
    }

    /// Whether it can answer questions about an item: the oracle needs simulated images.
    #[must_use]
    pub fn sees(&self, item: &Item) -> bool {
        !matches!(self.kind, AnswererKind::Oracle(..)) || item.sim.is_some()
    }

    /// Whether it may cost money and is rate-limited.
    #[must_use]
    pub fn is_model(&self) -> bool {
        matches!(self.kind, AnswererKind::Model(..))
    }

    /// Queries about an item; `number` is its index in the dataset.
    #[must_use]
    pub fn ask(&self, item: &Item, number: u64, options: AskOptions, cancel: &Cancel) -> AnswerRow {
        let profile = GroundingProfile::default();
        match &self.kind {
            AnswererKind::Centre => centre(&item.key),
            AnswererKind::Oracle(errors, seed) => {
                let query = query(number, &item.instruction, String::new(), options, None);
                let answer = match &item.sim {
                    Some(example) => oracle::answer(&self.name, errors, *seed, &query, example),
                    None => failed(&self.name, "no ID and depth images for the oracle".to_owned()),
                };
                AnswerRow::of(&self.name, &item.key, answer, &profile)
            }
            AnswererKind::Model(make, prompt) => {
                let read = spf_input::read(&item.image, photo::LONGEST_FILE).map_err(|error| error.to_string());
                match read.and_then(|bytes| photo::decode(&bytes).map_err(|error| error.to_string())) {
                    Ok(image) => {
                        let image = Arc::new(image);
                        self.show(make().as_mut(), prompt, &image, &item.key, &item.instruction, number, options, cancel)
                    }
                    Err(error) => {
                        let why = format!("cannot read `{}`: {error}", item.image.display());
                        AnswerRow::of(&self.name, &item.key, failed(&self.name, why), &profile)
                    }
                }
            }
        }
    }

    /// Sends a model an image.
    #[expect(clippy::too_many_arguments, reason = "all parts of one question")]
    #[must_use]
    pub fn show(
        &self,
        vlm: &mut dyn Vlm,
        prompt: &PromptText,
        image: &Arc<Rgb>,
        key: &str,
        instruction: &str,
        number: u64,
        options: AskOptions,
        cancel: &Cancel,
    ) -> AnswerRow {
        let camera = (image.width(), image.height());
        let image_spec = vlm.image_spec(camera);
        let (profile, memory) = (image_spec.grounding, Memory::default());
        let mut ask = |close_up: Option<ImageBox>| {
            let new = PromptInput::new(instruction, &memory, &profile);
            let text = prompt.write(&PromptInput { avoid: options.avoid, close_up, ..new });
            let query = Query { close_up, ..query(number, instruction, text, options, image_spec.image_size) };
            let request = QueryRequest { query: &query, time_left: options.time, cancel: cancel.clone() };
            AnswerRow::of(&self.name, key, vlm.answer(&request, &mut Photograph::new(image.clone())), &profile)
        };
        let first = ask(None);
        let small = match &first.parsed {
            ParsedReply::Reply(reply) if options.close_up => {
                reply.target_box.filter(|area| is_small(area, image_spec.image_size.unwrap_or(camera)))
            }
            _ => None,
        };
        let middle = |area: ImageBox| ImagePoint { u: 0.5 * (area.left + area.right), v: 0.5 * (area.top + area.bottom) };
        let Some(close_up) = small.and_then(|area| region(middle(area))) else { return first };
        let mut second = ask(Some(close_up));
        second.latency_s += first.latency_s;
        second.account.add(&first.account);
        second
    }
}

fn failed(model: &str, why: String) -> Answer {
    Answer { text: Err(VlmError::Image(why)), latency: Duration::ZERO, model: model.to_owned(), account: Usage::default() }
}

fn centre(key: &str) -> AnswerRow {
    let reply = Reply { point: Some(ImagePoint { u: 0.5, v: 0.5 }), depth: Some(CENTRE_LABEL), ..Reply::new(Status::Navigating) };
    AnswerRow {
        answerer: CENTRE.to_owned(),
        item: key.to_owned(),
        model: CENTRE.to_owned(),
        latency_s: 0.0,
        parsed: ParsedReply::Reply(reply),
        text: None,
        account: Usage::default(),
    }
}

fn query(number: u64, instruction: &str, prompt: String, options: AskOptions, image_size: Option<(u32, u32)>) -> Query {
    Query {
        instruction: instruction.to_owned(),
        prompt,
        image_size,
        ..Query::new(QueryId(number), FrameId(number), QueryKind::point(options.avoid))
    }
}

/// A set of questions.
pub struct Plan<'a> {
    /// The items.
    pub items: &'a [Item],
    /// The answerers.
    pub answerers: &'a [Answerer],
    /// How questions are asked.
    pub options: AskOptions,
    /// Number of parallel questions.
    pub parallel: usize,
    /// Questions per minute and model; `None` for no limit.
    pub per_minute: Option<f64>,
    /// Cost limit, US dollars, including earlier costs.
    pub max_cost: Option<f64>,
}

/// How a set of questions ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// All are answered.
    Complete,
    /// Stopped by the caller.
    Stopped,
    /// The cost limit was reached.
    Spent,
}

/// State shared by the workers.
struct Desk<'a> {
    plan: &'a Plan<'a>,
    /// Items and answerers, by index.
    waiting: Mutex<VecDeque<(usize, usize)>>,
    spent: Mutex<f64>,
    /// Earliest time of the next question to each model.
    next: Mutex<BTreeMap<usize, Instant>>,
    stop: &'a AtomicU32,
    cancel: Cancel,
}

impl Plan<'_> {
    /// Number of questions.
    #[must_use]
    pub fn questions(&self) -> usize {
        self.items.iter().map(|item| self.answerers.iter().filter(|answerer| answerer.sees(item)).count()).sum()
    }

    /// Sends all questions not in `before` (answerer and item names), and passes each answer to `each`, whose error
    /// ends the run. A nonzero `stop` ends it too, cancelling open questions.
    ///
    /// # Errors
    /// The error returned by `each`.
    pub fn run<E>(
        &self,
        before: &BTreeSet<(String, String)>,
        spent: f64,
        stop: &AtomicU32,
        mut each: impl FnMut(AnswerRow) -> Result<(), E>,
    ) -> Result<Ended, E> {
        let all = (0..self.items.len()).flat_map(|item| (0..self.answerers.len()).map(move |answerer| (item, answerer)));
        let open = all.filter(|(item, answerer)| {
            let (item, answerer) = (&self.items[*item], &self.answerers[*answerer]);
            answerer.sees(item) && !before.contains(&(answerer.name.clone(), item.key.clone()))
        });
        let desk = Desk {
            plan: self,
            waiting: Mutex::new(open.collect()),
            spent: Mutex::new(spent),
            next: Mutex::default(),
            stop,
            cancel: Cancel::default(),
        };
        let mut failed = Ok(());
        std::thread::scope(|scope| {
            let (send, answers) = channel();
            for _ in 0..self.parallel.max(1) {
                let (send, desk) = (send.clone(), &desk);
                scope.spawn(move || {
                    while let Some((item, answerer)) = desk.take() {
                        let chosen = &desk.plan.answerers[answerer];
                        let row = chosen.ask(&desk.plan.items[item], item as u64, desk.plan.options, &desk.cancel);
                        *lock(&desk.spent) += row.account.cost_usd.unwrap_or(0.0);
                        if send.send(row).is_err() {
                            return;
                        }
                    }
                });
            }
            drop(send);
            loop {
                match answers.recv_timeout(LOOK_UP) {
                    // A cancelled question was not answered.
                    Ok(row) if matches!(&row.parsed, ParsedReply::Nothing(code, _) if code == "cancelled") => {}
                    Ok(row) => {
                        if let Err(error) = each(row) {
                            failed = Err(error);
                            break;
                        }
                    }
                    Err(std::sync::mpsc::RecvTimeoutError::Timeout) if desk.stopped() => desk.cancel.cancel(),
                    Err(std::sync::mpsc::RecvTimeoutError::Timeout) => {}
                    Err(std::sync::mpsc::RecvTimeoutError::Disconnected) => break,
                }
            }
            lock(&desk.waiting).clear();
            desk.cancel.cancel();
        });
        failed?;
        Ok(if desk.stopped() {
            Ended::Stopped
        } else if desk.too_dear() {
            Ended::Spent
        } else {
            Ended::Complete
        })
    }
}

impl Desk<'_> {
    /// The next question, once its time has come; `None` if there is none left or the run was stopped.
    fn take(&self) -> Option<(usize, usize)> {
        loop {
            if self.stopped() {
                return None;
            }
            let (item, answerer) = lock(&self.waiting).pop_front()?;
            if self.plan.answerers[answerer].is_model() {
                if self.too_dear() {
                    continue;
                }
                self.wait_for_turn(answerer);
            }
            return Some((item, answerer));
        }
    }

    fn wait_for_turn(&self, answerer: usize) {
        let Some(per_minute) = self.plan.per_minute.filter(|rate| *rate > 0.0) else { return };
        let turn = {
            let mut next = lock(&self.next);
            let turn = next.get(&answerer).copied().unwrap_or_else(Instant::now).max(Instant::now());
            next.insert(answerer, turn + Duration::from_secs_f64(60.0 / per_minute));
            turn
        };
        while let Some(left) = turn.checked_duration_since(Instant::now()).filter(|left| !left.is_zero()) {
            if self.stopped() {
                return;
            }
            std::thread::sleep(left.min(LOOK_UP));
        }
    }

    fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed) > 0
    }

    fn too_dear(&self) -> bool {
        self.plan.max_cost.is_some_and(|most| *lock(&self.spent) >= most)
    }
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    // The contents are consistent between calls.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
