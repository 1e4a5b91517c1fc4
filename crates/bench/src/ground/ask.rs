//! Who is asked, and asking many questions: in parallel, under a rate, up to a cost, and only what was not answered before.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use spf_core::frame::FrameId;
use spf_core::grounding::GroundingProfile;
use spf_core::prompt::{PromptInput, PromptText};
use spf_core::query::{ImagePoint, Memory, Query, QueryId, QueryKind};
use spf_core::reply::{Reply, Status};
use spf_core::time::Duration;
use spf_media::Rgb;
use spf_oracle::ErrorFile;
use spf_vlm::{Account, Answer, Asked, Cancel, Vlm, VlmError};

use super::photo::Photograph;
use super::{AnswerRow, Item, Said, oracle, photo};
use crate::fnv;

/// The one who always points at the middle of the image.
pub const CENTRE: &str = "centre";
/// Label of the one who points at the middle: halfway.
const CENTRE_LABEL: u8 = 5;
/// How often a wait for the rate looks up.
const LOOK_UP: Duration = Duration::from_millis(50);

/// Makes a model that can be asked, one for each worker.
pub type MakeVlm = Arc<dyn Fn() -> Box<dyn Vlm> + Send + Sync>;

/// Who answers.
#[derive(Clone)]
pub enum Mind {
    /// Always the middle of the image.
    Centre,
    /// The oracle, where there is what it reads; its errors and the seed of their draws.
    Oracle(Box<ErrorFile>, u64),
    /// A model, and what it is told.
    Model(MakeVlm, Arc<PromptText>),
}

impl Mind {
    /// A number of how it answers, as far as that is told here: its prompt, or its error file and seed.
    #[must_use]
    pub fn manner(&self) -> String {
        let words = match self {
            Self::Centre => String::new(),
            Self::Oracle(errors, seed) => format!("{errors:?} {seed}"),
            Self::Model(_, prompt) => format!("{prompt:?}"),
        };
        format!("{:016x}", fnv(words.as_bytes()))
    }
}

/// Somebody who is asked, by the name in tables.
#[derive(Clone)]
pub struct Answerer {
    /// The name.
    pub name: String,
    /// Who.
    pub mind: Mind,
}

/// How a question is put.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Manner {
    /// Whether boxes of obstacles are asked for too.
    pub avoid: bool,
    /// How long an answer is waited for.
    pub time: Duration,
}

impl Answerer {
    /// The one who always points at the middle.
    #[must_use]
    pub fn centre() -> Self {
        Self { name: CENTRE.to_owned(), mind: Mind::Centre }
    }

    /// Whether it can be asked about an item: the oracle needs what only simulated images have.
    #[must_use]
    pub fn sees(&self, item: &Item) -> bool {
        !matches!(self.mind, Mind::Oracle(..)) || item.sim.is_some()
    }

    /// Whether asking it may cost money and is held to a rate.
    #[must_use]
    pub fn is_model(&self) -> bool {
        matches!(self.mind, Mind::Model(..))
    }

    /// Asks about an item, by its place in the dataset.
    #[must_use]
    pub fn ask(&self, item: &Item, number: u64, manner: Manner, cancel: &Cancel) -> AnswerRow {
        let profile = GroundingProfile::default();
        match &self.mind {
            Mind::Centre => centre(&item.key),
            Mind::Oracle(errors, seed) => {
                let query = query(number, &item.instruction, String::new(), manner, None);
                let answer = match &item.sim {
                    Some(example) => oracle::answer(&self.name, errors, *seed, &query, example),
                    None => failed(&self.name, "there is nothing that the oracle could read".to_owned()),
                };
                AnswerRow::of(&self.name, &item.key, answer, &profile)
            }
            Mind::Model(make, prompt) => {
                let read = std::fs::read(&item.picture).map_err(|error| error.to_string());
                match read.and_then(|bytes| photo::decode(&bytes).map_err(|error| error.to_string())) {
                    Ok(picture) => {
                        let picture = Arc::new(picture);
                        self.show(make().as_mut(), prompt, &picture, &item.key, &item.instruction, number, manner, cancel)
                    }
                    Err(error) => {
                        let why = format!("`{}` cannot be read: {error}", item.picture.display());
                        AnswerRow::of(&self.name, &item.key, failed(&self.name, why), &profile)
                    }
                }
            }
        }
    }

    /// Asks a model about an image.
    #[expect(clippy::too_many_arguments, reason = "a question is made of these")]
    #[must_use]
    pub fn show(
        &self,
        vlm: &mut dyn Vlm,
        prompt: &PromptText,
        picture: &Arc<Rgb>,
        key: &str,
        instruction: &str,
        number: u64,
        manner: Manner,
        cancel: &Cancel,
    ) -> AnswerRow {
        let eyesight = vlm.eyesight((picture.width(), picture.height()));
        let (profile, memory) = (eyesight.grounding, Memory::default());
        let text = prompt.write(&PromptInput { instruction, memory: &memory, profile: &profile, avoid: manner.avoid });
        let query = query(number, instruction, text, manner, eyesight.image_size);
        let asked = Asked { query: &query, time_left: manner.time, cancel: cancel.clone() };
        let answer = vlm.answer(&asked, &mut Photograph::new(picture.clone()));
        AnswerRow::of(&self.name, key, answer, &profile)
    }
}

fn failed(model: &str, why: String) -> Answer {
    Answer { text: Err(VlmError::Picture(why)), latency: Duration::ZERO, model: model.to_owned(), account: Account::default() }
}

fn centre(key: &str) -> AnswerRow {
    let reply = Reply {
        status: Status::Navigating,
        look: None,
        stage: None,
        point: Some(ImagePoint { u: 0.5, v: 0.5 }),
        depth: Some(CENTRE_LABEL),
        open_way: None,
        target: None,
        boxes: Vec::new(),
    };
    AnswerRow {
        answerer: CENTRE.to_owned(),
        item: key.to_owned(),
        model: CENTRE.to_owned(),
        latency_s: 0.0,
        said: Said::Reply(reply),
        text: None,
        account: Account::default(),
    }
}

fn query(number: u64, instruction: &str, prompt: String, manner: Manner, image_size: Option<(u32, u32)>) -> Query {
    Query {
        instruction: instruction.to_owned(),
        prompt,
        image_size,
        ..Query::new(QueryId(number), FrameId(number), QueryKind::Point { avoid: manner.avoid })
    }
}

/// Many questions.
pub struct Plan<'a> {
    /// About what.
    pub items: &'a [Item],
    /// Of whom.
    pub answerers: &'a [Answerer],
    /// How each is put.
    pub manner: Manner,
    /// Questions at once.
    pub parallel: usize,
    /// Questions a minute to each model; none: as fast as they are answered.
    pub per_minute: Option<f64>,
    /// US dollars, with what was spent before, after which no model is asked any more.
    pub max_cost: Option<f64>,
}

/// How a round of questions ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// Everything is answered.
    Complete,
    /// Somebody stopped it.
    Stopped,
    /// The money is spent.
    Spent,
}

/// What workers share.
struct Desk<'a> {
    plan: &'a Plan<'a>,
    /// Items and answerers by number.
    waiting: Mutex<VecDeque<(usize, usize)>>,
    spent: Mutex<f64>,
    /// When each model may be asked next.
    next: Mutex<BTreeMap<usize, Instant>>,
    stop: &'a AtomicU32,
    cancel: Cancel,
}

impl Plan<'_> {
    /// Questions there are.
    #[must_use]
    pub fn questions(&self) -> usize {
        self.items.iter().map(|item| self.answerers.iter().filter(|answerer| answerer.sees(item)).count()).sum()
    }

    /// Asks everything that is not in `before` (answerer and item by name), and hands each answer to `each`, which may end it by an
    /// error. `stop` other than 0 ends it too: answers that are out are taken back.
    ///
    /// # Errors
    /// That of `each`.
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
                        let asked = &desk.plan.answerers[answerer];
                        let row = asked.ask(&desk.plan.items[item], item as u64, desk.plan.manner, &desk.cancel);
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
                    // A question that was taken back was not answered.
                    Ok(row) if matches!(&row.said, Said::Nothing(code, _) if code == "cancelled") => {}
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
    /// The next question, when its time has come; none when there is none, or nobody wants it any more.
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
    // What is in it is whole between calls.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
