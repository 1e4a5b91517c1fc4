//! Two queries at a time on the wall clock.

use std::collections::BTreeSet;
use std::sync::{Arc, Condvar, Mutex};
use std::time::Instant;

use spf_core::frame::FrameId;
use spf_core::pilot::{Action, AskWhen, Event};
use spf_core::query::{Query, QueryId, QueryKind};
use spf_core::time::{Duration, Time};
use spf_flight::flight::{FlightPlan, Site, fly};
use spf_flight::run::World;
use spf_flight::sim::{LoadedScene, Simulated, VlmFactory, oracle_factory};
use spf_flight::world::{Live, Script, Vlms};
use spf_oracle::ErrorFile;
use spf_vlm::{Answer, QueryImage, QueryRequest, Vlm, VlmError};

/// Longer than any test takes.
const PATIENCE: Duration = Duration::from_secs(30);

/// The queries that have arrived.
type Asked = Arc<(Mutex<BTreeSet<QueryId>>, Condvar)>;

/// Answers a query once another one has arrived as well.
struct Both(Asked);

impl Vlm for Both {
    fn name(&self) -> &str {
        "both"
    }

    fn is_concurrent(&self) -> bool {
        true
    }

    fn answer(&mut self, request: &QueryRequest<'_>, _: &mut dyn QueryImage) -> Answer {
        let (asked, changed) = &*self.0;
        let mut asked = asked.lock().unwrap();
        asked.insert(request.query.id);
        changed.notify_all();
        let (asked, _) = changed.wait_timeout_while(asked, PATIENCE, |asked| asked.len() < 2).unwrap();
        let text = if asked.len() == 2 { Ok("both".to_owned()) } else { Err(VlmError::Cancelled) };
        Answer { text, latency: Duration::ZERO, model: String::new(), account: spf_vlm::Usage::default() }
    }
}

#[test]
fn a_second_client_answers_while_the_first_one_does() {
    let loaded = Arc::new(LoadedScene::load("city").unwrap());
    let craft = Simulated::new(loaded, "city").craft().unwrap();
    let asked = Asked::default();
    let both = || Box::new(Both(asked.clone())) as Box<dyn Vlm>;
    let vlms = Vlms { vlm: both(), second: Some(both()), monitor: None };
    let mut world = Live::new(Instant::now(), craft, vlms, Script::default(), Arc::default(), false).unwrap();
    for id in [1, 2] {
        let mut query = Query::new(QueryId(id), FrameId(0), QueryKind::point(false));
        query.deadline = Time::ZERO + PATIENCE;
        world.apply(&Action::Ask(Box::new(query)));
    }
    let mut answered = BTreeSet::new();
    while answered.len() < 2 {
        assert!(world.now() < Time::ZERO + PATIENCE, "{answered:?}");
        match world.wait(Time::ZERO + PATIENCE) {
            Some(Event::Reply { id, text }) if text == "both" => answered.insert(id),
            Some(Event::ReplyFailed { id, reason }) => panic!("{id:?}: {reason}"),
            _ => false,
        };
    }
}

/// Who answers one query after the other is not asked ahead.
struct Alone(Box<dyn Vlm>);

impl Vlm for Alone {
    fn name(&self) -> &str {
        self.0.name()
    }

    fn answer(&mut self, request: &QueryRequest<'_>, image: &mut dyn QueryImage) -> Answer {
        self.0.answer(request, image)
    }
}

/// How long ten decisions of a search take that finds nothing, with answers after 4 s.
fn seconds_of_a_search(alone: bool) -> f64 {
    let loaded = Arc::new(LoadedScene::load("city").unwrap());
    let oracle = oracle_factory("oracle:perfect".to_owned(), ErrorFile::named("perfect").unwrap());
    let slow: VlmFactory = Arc::new(move |world, seed| {
        let vlm: Box<dyn Vlm> = Box::new(spf_vlm::Paced::new(oracle(world, seed)?, Some(Duration::from_secs(4)), false));
        Ok(if alone { Box::new(Alone(vlm)) } else { vlm })
    });
    let site = Site::Simulated(Simulated::new(loaded, "city"));
    let mut plan = FlightPlan::new(site, "Fly to the lighthouse", "slow", slow);
    plan.settings.ask = AskWhen::News;
    plan.settings.max_decisions = 10;
    fly(plan, &mut []).unwrap().summary.finished_at_s
}

#[test]
fn who_answers_one_query_after_the_other_is_not_asked_ahead() {
    let (together, alone) = (seconds_of_a_search(false), seconds_of_a_search(true));
    assert!(together < 0.85 * alone, "{together} {alone}");
}
