//! The deck with the embedded simulator in real time: who may order what, and what happens if nobody says anything.

use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use spf_core::craft::CraftKind;
use spf_flight::flight::{FlightPlan, Flown, Site, fly};
use spf_flight::pointing::{Given, Pointer};
use spf_flight::sim::{LoadedScene, Simulated, VlmFactory, oracle_factory};
use spf_mcp::deck::{Deck, Flight, Hangar, Patience, Seat, Wanted};
use spf_mcp::report::{Progress, State, Status};
use spf_oracle::ErrorFile;
use spf_pilot::{AtEnd, OperatorEvent, Outcome, Phase};
use spf_vlm::Vlm;

/// What a slow machine may take for anything.
const SLOW: Duration = Duration::from_secs(120);

/// The simulator, called real or not.
struct Simulator {
    real: bool,
    scene: Arc<LoadedScene>,
    /// The channel of the last flight, as a cockpit has it.
    cockpit: Mutex<Option<Sender<OperatorEvent>>>,
    begun: AtomicU32,
    /// How long an instruction is read, and how long the files of a flight are written.
    reads: Duration,
    writes: Duration,
}

impl Hangar for Simulator {
    fn craft(&self, _: Option<&str>) -> String {
        "simulated".to_owned()
    }

    fn answers(&self) -> Option<String> {
        Some("the oracle".to_owned())
    }

    fn is_real(&self) -> bool {
        self.real
    }

    fn read(&self, _: &Wanted) -> Result<String, String> {
        std::thread::sleep(self.reads);
        Ok(String::new())
    }

    fn fly(&self, wanted: Wanted, seat: Seat) -> Result<Flown, String> {
        self.begun.fetch_add(1, Ordering::Relaxed);
        if seat.given_up.load(Ordering::Relaxed) {
            return Err("given up".to_owned());
        }
        let Seat { operator, orders, mut watch, pointing, .. } = seat;
        *self.cockpit.lock().unwrap() = Some(orders);
        let site = Simulated { realtime: true, kind: CraftKind::Tello, ..Simulated::new(self.scene.clone(), "scene") };
        let oracle = oracle_factory("oracle".to_owned(), ErrorFile::default());
        let points: VlmFactory = Arc::new(move |world, seed| {
            Ok(Box::new(Pointer::new(pointing.clone(), Arc::new(|_| {}), Some(oracle(world, seed)?))) as Box<dyn Vlm>)
        });
        let mut plan = FlightPlan::new(Site::Simulated(site), wanted.words(), "oracle", points);
        plan.settings.at_end = AtEnd::Hover;
        plan.operator = Some(operator);
        let flown = fly(plan, &mut [&mut watch]).map_err(|error| error.to_string());
        std::thread::sleep(self.writes);
        flown
    }
}

impl Simulator {
    fn new(scene: LoadedScene) -> Self {
        let (reads, writes) = (Duration::ZERO, Duration::ZERO);
        Self { real: false, scene: Arc::new(scene), cockpit: Mutex::default(), begun: AtomicU32::new(0), reads, writes }
    }

    fn office() -> Self {
        Self::new(LoadedScene::load("office").unwrap())
    }
}

/// A deck in a scene.
pub(crate) fn deck_in(scene: LoadedScene) -> Arc<Deck> {
    deck_with(Simulator::new(scene), Patience::default()).0
}

fn deck_with(simulator: Simulator, patience: Patience) -> (Arc<Deck>, Arc<Simulator>) {
    let hangar = Arc::new(simulator);
    (Deck::new(hangar.clone(), patience).unwrap(), hangar)
}

fn deck_of(real: bool, patience: Patience) -> (Arc<Deck>, Arc<Simulator>) {
    deck_with(Simulator { real, ..Simulator::office() }, patience)
}

fn deck() -> Arc<Deck> {
    deck_of(false, Patience::default()).0
}

/// Waits until something is so.
pub(crate) fn until(what: &str, mut is_so: impl FnMut() -> bool) {
    let began = Instant::now();
    while !is_so() {
        assert!(began.elapsed() < SLOW, "waited in vain: {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

pub(crate) fn take_off(deck: &Arc<Deck>) -> Flight {
    let (flight, ..) = deck.fly(Wanted { instruction: None, scene: None }).unwrap();
    until("it takes off", || flight.phase() == Some(Phase::Held));
    flight
}

fn until_landed(deck: &Deck, flight: &Flight) -> Progress {
    until("it lands", || flight.is_over());
    assert!(!deck.is_flying());
    Progress::of(flight, 1)
}

/// Points at the middle of a frame, or of the newest one.
fn point(deck: &Deck, depth: u8, frame: Option<u64>) -> Result<(Flight, u32), String> {
    deck.point(|frame| Given::point(0.5, 0.5, depth, frame), frame)
}

fn instruction(text: &str) -> Wanted {
    Wanted { instruction: Some(text.to_owned()), scene: None }
}

/// Flights in real time, which wait most of the time: all at once.
#[test]
fn the_craft_obeys_and_nobody_is_left_in_the_air() {
    let scenarios: [(&str, fn()); 9] = [
        ("a step", a_step_towards_a_point_is_flown_and_held),
        ("a stop", a_stop_works_in_every_state_and_no_call_takes_it_back),
        ("a lost client", a_cancelled_call_holds_and_a_lost_client_lands),
        ("silence", silence_lands_what_flies_no_instruction),
        ("consent", a_real_drone_moves_with_consent_alone_for_one_flight),
        ("a slow model", a_stop_waits_for_no_model),
        ("a lost page", no_lost_page_and_no_earlier_order_takes_a_stop_back),
        ("files", a_craft_that_is_down_takes_off_once_its_files_are_written),
        ("time over", a_consent_whose_time_is_over_ends_its_flight),
    ];
    let threads = scenarios.map(|(name, scenario)| std::thread::Builder::new().name(name.to_owned()).spawn(scenario).unwrap());
    let failed: Vec<_> =
        scenarios.iter().zip(threads).filter_map(|((name, _), thread)| thread.join().is_err().then_some(name)).collect();
    assert!(failed.is_empty(), "{failed:?}");
}

fn a_step_towards_a_point_is_flown_and_held() {
    let deck = deck();
    assert!(deck.newest().is_err() && deck.hold().is_err() && point(&deck, 5, None).is_err());
    let flight = take_off(&deck);
    assert_eq!(Status::of(&deck).state, State::Holding);
    let frame = deck.newest().unwrap().frame;
    let before = Status::of(&deck).east_north_m.unwrap();
    let (_, points) = point(&deck, 4, Some(frame)).unwrap();
    assert!(point(&deck, 4, Some(frame)).is_err(), "one step at a time");
    until("the step is flown", || flight.seen.borrow().points > points && flight.phase() == Some(Phase::Held));
    let pointed = flight.seen.borrow().pointed.clone().unwrap();
    assert!(pointed.flown, "{pointed:?}");
    let after = Status::of(&deck).east_north_m.unwrap();
    let flown = (after[0] - before[0]).hypot(after[1] - before[1]);
    assert!((0.8..3.0).contains(&flown), "{flown} m, {pointed:?}");
    assert!(point(&deck, 4, Some(999_999)).unwrap_err().contains("look"), "a frame that was never there");
    // An instruction in the same flight, then a landing.
    let (_, number, _) = deck.fly(instruction("fly to the door")).unwrap();
    assert!(number >= 2);
    until("it flies", || flight.phase() == Some(Phase::Flying));
    assert!(deck.fly(instruction("fly to the sofa")).unwrap_err().contains("under way"));
    assert!(point(&deck, 4, None).unwrap_err().contains("hold"));
    deck.land().unwrap();
    let landed = until_landed(&deck, &flight);
    assert_eq!((landed.outcome, landed.instruction.as_str()), (Some(Outcome::Aborted), "fly to the door"));
}

fn a_stop_works_in_every_state_and_no_call_takes_it_back() {
    let patience = Patience { stopped: Duration::from_millis(500), ..Patience::default() };
    let (deck, _) = deck_of(false, patience);
    assert!(deck.stop().contains("no flight"));
    // While it is prepared or on the ground: it does not take off, or is landed.
    let (flight, ..) = deck.fly(Wanted { instruction: None, scene: None }).unwrap();
    deck.stop();
    until_landed(&deck, &flight);
    // In flight.
    let (flight, ..) = deck.fly(instruction("fly to the door")).unwrap();
    until("it flies", || flight.phase() == Some(Phase::Flying));
    assert!(deck.stop().contains("zero velocity"));
    for refused in [deck.fly(instruction("fly to the sofa")).map(drop), point(&deck, 5, None).map(drop)] {
        assert!(refused.unwrap_err().contains("stopped"));
    }
    // Neither a hold nor more stops keep it in the air.
    deck.hold().unwrap();
    deck.stop();
    until("it lands", || {
        let _ = deck.call(true);
        deck.hold().ok();
        flight.is_over()
    });
    // The next flight is another one.
    let flight = take_off(&deck);
    deck.stop();
    until_landed(&deck, &flight);
}

fn a_cancelled_call_holds_and_a_lost_client_lands() {
    let patience = Patience { lost: Duration::from_millis(800), ..Patience::default() };
    let (deck, _) = deck_of(false, patience);
    let (flight, ..) = deck.fly(instruction("fly to the door")).unwrap();
    until("it flies", || flight.phase() == Some(Phase::Flying));
    deck.cancelled();
    until("it holds", || flight.phase() == Some(Phase::Held));
    let progress = Progress::of(&flight, 1);
    assert!(!progress.ended && progress.note.contains("hold"), "{progress:?}");
    deck.leave();
    let landed = until_landed(&deck, &flight);
    assert!(landed.cause.as_ref().unwrap().contains("nobody had the controls"), "{landed:?}");
}

fn silence_lands_what_flies_no_instruction() {
    let patience = Patience { silent: Duration::from_millis(1500), ..Patience::default() };
    let (deck, _) = deck_of(false, patience);
    let flight = take_off(&deck);
    // As long as somebody calls it stays.
    let began = Instant::now();
    while began.elapsed() < 2 * patience.silent {
        let _ = deck.call(false);
        std::thread::sleep(Duration::from_millis(50));
    }
    assert_eq!(flight.phase(), Some(Phase::Held));
    until_landed(&deck, &flight);
}

fn a_real_drone_moves_with_consent_alone_for_one_flight() {
    let (deck, hangar) = deck_of(true, Patience::default());
    let refused = |wanted| deck.fly(wanted).map(drop).unwrap_err();
    assert!(refused(instruction("fly to the door")).contains("spf mcp arm"));
    assert!(refused(Wanted { instruction: None, scene: None }).contains("armed"));
    assert_eq!(hangar.begun.load(Ordering::Relaxed), 0, "nothing was connected");
    deck.arm(Duration::from_secs(600));
    let flight = take_off(&deck);
    point(&deck, 2, None).unwrap();
    // The operator takes over: the assistant has nothing to say until it is armed anew.
    let cockpit = hangar.cockpit.lock().unwrap().clone().unwrap();
    cockpit.send(OperatorEvent::Hold).unwrap();
    until("the consent is gone", || deck.consent().contains("not armed"));
    assert!(Status::of(&deck).taken_over.is_some());
    until("it holds", || flight.phase() == Some(Phase::Held));
    assert!(point(&deck, 2, None).unwrap_err().contains("armed"));
    deck.arm(Duration::from_secs(600));
    point(&deck, 2, None).unwrap();
    // Stops are behind no question.
    deck.disarm();
    until_landed(&deck, &flight);
    assert!(refused(instruction("fly to the door")).contains("armed"), "one flight");
}

fn a_craft_that_is_down_takes_off_once_its_files_are_written() {
    let simulator = Simulator { writes: Duration::from_secs(3), ..Simulator::office() };
    let (deck, _) = deck_with(simulator, Patience::default());
    let first = take_off(&deck);
    deck.land().unwrap();
    until("it is down", || Status::of(&deck).state == State::OnGround);
    assert!(!first.is_over(), "its files are being written");
    assert_ne!(take_off(&deck).number, first.number);
}

fn a_stop_waits_for_no_model() {
    let simulator = Simulator { reads: Duration::from_secs(3), ..Simulator::office() };
    let (deck, hangar) = deck_with(simulator, Patience::default());
    let asking = deck.clone();
    let flown = std::thread::spawn(move || asking.fly(instruction("fly to the door")).map(drop));
    std::thread::sleep(Duration::from_millis(300));
    deck.stop();
    assert!(!flown.is_finished(), "the stop waits for nothing");
    assert!(flown.join().unwrap().unwrap_err().contains("meanwhile"));
    assert_eq!(hangar.begun.load(Ordering::Relaxed), 0);
}

fn no_lost_page_and_no_earlier_order_takes_a_stop_back() {
    let (deck, hangar) = deck_of(false, Patience { stopped: Duration::from_millis(500), ..Patience::default() });
    let flight = take_off(&deck);
    let cockpit = hangar.cockpit.lock().unwrap().clone().unwrap();
    cockpit.send(OperatorEvent::Hold).unwrap();
    until("the operator has it", || Status::of(&deck).taken_over.is_some());
    deck.stop();
    cockpit.send(OperatorEvent::Left).unwrap();
    until_landed(&deck, &flight);
}

fn a_consent_whose_time_is_over_ends_its_flight() {
    let (deck, _) = deck_of(true, Patience { stopped: Duration::from_millis(200), ..Patience::default() });
    deck.arm(Duration::from_secs(3));
    let (flight, ..) = deck.fly(instruction("fly to the door")).unwrap();
    until_landed(&deck, &flight);
}

#[test]
fn a_flood_of_calls_is_refused_and_stops_never_are() {
    let deck = deck();
    let refused = (0..1000).filter(|_| deck.call(false).is_err()).count();
    assert!(refused > 900, "{refused}");
    assert!((0..1000).all(|_| deck.call(true).is_ok()));
}
