use std::sync::atomic::AtomicU64;

use super::*;
use spf_core::frame::FrameId;
use spf_core::query::{Query, QueryId, QueryKind};

/// A clock that stands still, except while somebody waits.
#[derive(Default)]
struct TestClock(AtomicU64);

impl RunClock for TestClock {
    fn now(&self) -> Duration {
        Duration::from_nanos(self.0.load(Ordering::SeqCst))
    }

    fn wait(&self, time: Duration, is_over: &dyn Fn() -> bool) {
        if !is_over() {
            self.0.fetch_add(u64::try_from(time.as_nanos()).unwrap(), Ordering::SeqCst);
        }
    }
}

struct NoImage;

impl QueryImage for NoImage {
    fn size(&self) -> (u32, u32) {
        (4, 3)
    }

    fn jpeg(&mut self, _: (u32, u32), _: u8) -> Result<Arc<[u8]>, VlmError> {
        Err(VlmError::Image("none".to_owned()))
    }
}

/// Says one thing after the other, each for a cent.
struct Says(std::vec::IntoIter<Result<String, VlmError>>);

impl Vlm for Says {
    fn name(&self) -> &str {
        "said"
    }

    fn answer(&mut self, _: &QueryRequest<'_>, _: &mut dyn QueryImage) -> Answer {
        let text = self.0.next().unwrap_or_else(|| Err(failure(503, "overloaded")));
        let account = Usage { requests: 1, cost_usd: Some(0.01), ..Usage::default() };
        Answer { text, latency: Duration::from_secs(1), model: "m".to_owned(), account }
    }
}

fn failure(status: u16, message: &str) -> VlmError {
    VlmError::Vendor { host: "h".to_owned(), status, code: None, message: message.to_owned(), retry_after: None }
}

fn good() -> Result<String, VlmError> {
    Ok("{}".to_owned())
}

struct Tried {
    service: Arc<Service>,
    fate: Fate,
    answers: Vec<Answer>,
    waits: Vec<Wait>,
}

/// The answers to so many queries.
fn tried(queries: u64, max_cost: Option<f64>, says: Vec<Result<String, VlmError>>) -> Tried {
    let waits = Arc::new(Mutex::new(Vec::new()));
    let heard = waits.clone();
    let service = Service::new(Arc::new(TestClock::default()), max_cost, move |wait| heard.lock().unwrap().push(wait.clone()));
    let fate = Fate::default();
    let mut vlm = service.guard(Box::new(Says(says.into_iter())), &fate);
    let ask = |number| {
        let query = Query::new(QueryId(number), FrameId(0), QueryKind::point(false));
        vlm.answer(&QueryRequest::new(&query, Duration::from_secs(20)), &mut NoImage)
    };
    let answers = (0..queries).map(ask).collect();
    let waits = waits.lock().unwrap().clone();
    Tried { service, fate, answers, waits }
}

#[test]
fn what_passes_is_waited_out_and_its_cost_is_counted() {
    let network = || Err(VlmError::Network { host: "h".to_owned(), reason: "no route".to_owned() });
    let tried = tried(2, None, vec![network(), Err(failure(500, "boom")), Err(failure(429, "slow down")), good(), good()]);
    assert_eq!(tried.waits.iter().map(|wait| wait.pause.as_secs()).collect::<Vec<_>>(), [5, 10, 20]);
    assert_eq!(tried.waits.iter().map(|wait| wait.failing.as_secs()).collect::<Vec<_>>(), [0, 5, 15]);
    let answer = &tried.answers[0];
    assert_eq!((answer.text.clone(), answer.latency, answer.account.requests), (good(), Duration::from_secs(1), 4));
    assert!((tried.service.spent_usd() - 0.05).abs() < 1e-9 && (tried.fate.cost_usd() - 0.05).abs() < 1e-9);
    assert_eq!((tried.service.ended(), tried.fate.lost().load(Ordering::SeqCst), tried.fate.unanswered()), (None, 0, None));
}

#[test]
fn after_two_hours_without_an_answer_the_run_ends() {
    let tried = tried(2, None, vec![good()]);
    let Some(RunEnd::Down { vlm, failing, .. }) = tried.service.ended() else { panic!("{:?}", tried.service.ended()) };
    assert_eq!((vlm.as_str(), failing), ("said", PATIENCE));
    assert_eq!(tried.waits.iter().map(|wait| wait.pause).sum::<Duration>(), PATIENCE);
    assert!(tried.waits.iter().all(|wait| wait.pause <= LONGEST_WAIT) && tried.waits.len() < 40, "{}", tried.waits.len());
    assert_eq!(tried.fate.lost().load(Ordering::SeqCst), 1);
}

#[test]
fn what_stays_ends_the_run_at_once_and_keeps_its_reason() {
    for error in [
        failure(401, "bad key"),
        failure(402, "pay"),
        failure(403, "not this region"),
        failure(404, "no such model"),
        failure(429, "You exceeded your current quota (GenerateRequestsPerDayPerProjectPerModel-FreeTier)"),
        failure(400, "Your credit balance is too low to access the API."),
        VlmError::Vendor {
            host: "h".to_owned(),
            status: 429,
            code: None,
            message: "wait".to_owned(),
            retry_after: Some(PATIENCE + Duration::from_secs(1)),
        },
    ] {
        let tried = tried(3, None, vec![Err(error.clone()), good()]);
        assert!(tried.waits.is_empty(), "{error}");
        match tried.service.ended() {
            Some(RunEnd::Refused { error: told, .. } | RunEnd::Down { error: told, .. }) => assert_eq!(told, error),
            other => panic!("{error}: {other:?}"),
        }
        // Nothing more is asked.
        assert_eq!((tried.service.spent_usd(), tried.fate.lost().load(Ordering::SeqCst)), (0.01, 3), "{error}");
    }
}

#[test]
fn one_refused_image_does_not_end_a_night() {
    let image = || Err(failure(400, "Unable to process input image"));
    let once = tried(2, None, vec![good(), image(), image(), good()]);
    assert_eq!((once.service.ended(), once.waits.len()), (None, 2));
    let always = tried(2, None, vec![good(), image(), image(), image(), image()]);
    assert!(matches!(always.service.ended(), Some(RunEnd::Refused { .. })));
    // One that has never answered is asked wrongly.
    let never = tried(1, None, vec![image(), good()]);
    assert!(matches!(never.service.ended(), Some(RunEnd::Refused { .. })) && never.waits.is_empty());
}

#[test]
fn what_a_model_says_is_its_own_and_what_never_answers_is_not() {
    let declined = tried(2, None, vec![Err(VlmError::Declined("no".to_owned())), Err(failure(400, "content_policy_violation"))]);
    assert_eq!((declined.service.ended(), declined.fate.unanswered()), (None, None));
    let late = || Err(VlmError::Deadline { host: "h".to_owned(), waited: Duration::from_secs(20), stage: "no data".to_owned() });
    let slow = tried(2, None, vec![late(), late()]);
    assert_eq!((slow.service.ended(), slow.waits.len()), (None, 0));
    assert_eq!(slow.fate.unanswered().unwrap().code(), "deadline");
    assert_eq!(tried(2, None, vec![good(), late()]).fate.unanswered(), None);
    // Between two signs of a dead network, it is one too.
    let dead = tried(1, None, vec![Err(failure(503, "x")), late(), good()]);
    assert_eq!((dead.waits.len(), dead.answers[0].text.clone()), (2, good()));
}

#[test]
fn the_money_of_the_whole_run_is_limited() {
    let tried = tried(5, Some(0.025), vec![good(), good(), good(), good()]);
    let Some(RunEnd::Spent { spent, limit }) = tried.service.ended() else { panic!("{:?}", tried.service.ended()) };
    assert!((spent - 0.03).abs() < 1e-9 && limit == 0.025);
    assert_eq!(tried.answers.iter().filter(|answer| answer.text.is_ok()).count(), 3);
}

/// A VLM that answers only when it is cancelled.
struct Hangs(Arc<Service>);

impl Vlm for Hangs {
    fn name(&self) -> &str {
        "hangs"
    }

    fn answer(&mut self, request: &QueryRequest<'_>, _: &mut dyn QueryImage) -> Answer {
        assert!(!request.cancel.is_cancelled());
        self.0.stop();
        assert!(request.cancel.is_cancelled());
        Answer { text: Err(VlmError::Cancelled), latency: Duration::ZERO, model: String::new(), account: Usage::default() }
    }
}

#[test]
fn a_stop_cancels_open_queries_and_ends_waits() {
    let service = Service::new(Arc::new(WallClock::default()), None, |_| {});
    let fate = Fate::default();
    let query = Query::new(QueryId(0), FrameId(0), QueryKind::point(false));
    let request = QueryRequest::new(&query, Duration::from_secs(600));
    let answer = service.guard(Box::new(Hangs(service.clone())), &fate).answer(&request, &mut NoImage);
    assert_eq!((answer.text, fate.lost().load(Ordering::SeqCst)), (Err(VlmError::Cancelled), 1));
    // By a signal, in the middle of a wait of the machine's clock.
    let signals = Arc::new(AtomicU32::new(0));
    let (service, fate) = {
        let signals = signals.clone();
        (Service::new(Arc::new(WallClock::default()), None, move |_| signals.store(1, Ordering::SeqCst)), Fate::default())
    };
    service.stop_on(signals).unwrap();
    let answer = service.guard(Box::new(Says(Vec::new().into_iter())), &fate).answer(&request, &mut NoImage);
    assert!(answer.text.is_err());
    assert_eq!((service.ended(), fate.lost().load(Ordering::SeqCst)), (Some(RunEnd::Stopped), 1));
}
