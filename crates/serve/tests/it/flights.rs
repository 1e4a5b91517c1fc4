//! The Tello's driver against the virtual Tello, connected in virtual time without sockets: whole flights, each fault,
//! the known failings of similar programs.

use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex};

use crate::wired::{CAMERA_FAULTS, Wired};
use spf_core::camera::Camera;
use spf_core::craft::{Craft, CraftKind};
use spf_core::geometry::EnuPosition;
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time};
use spf_drone::tello::sticks::Calibration;
use spf_envelope::Limits;
use spf_flight::calibrate::{self, Routine};
use spf_flight::flight::{self, FlightPlan, Site};
use spf_flight::real::Real;
use spf_flight::run::Observer;
use spf_flight::sim::{LoadedScene, OracleVlm, SimWorld, VlmFactory};
use spf_flight::site::Clock;
use spf_flight::world::Script;
use spf_motion::executor::Motion;
use spf_oracle::ErrorFile;
use spf_pilot::{Action, Event, Note, Outcome, Phase, Pilot, PilotSettings, Preset, QueryTiming};
use spf_serve::fault::{CraftFault, CraftFaultRule, Fault, FaultPlan, Rule, Stream};
use spf_serve::tello::ProtocolParameters;
use spf_sim::craft::SimCraft;
use spf_vlm::{Answer, ImageSpec, QueryImage, QueryRequest, Vlm};

/// An oracle with an additional delay, or a substitute.
struct Slow(OracleVlm, Option<Duration>);

impl Vlm for Slow {
    fn name(&self) -> &str {
        "slow"
    }

    fn image_spec(&self, camera: (u32, u32)) -> ImageSpec {
        self.0.image_spec(camera)
    }

    fn answer(&mut self, request: &QueryRequest<'_>, image: &mut dyn QueryImage) -> Answer {
        let answer = self.0.answer(request, image);
        Answer { latency: self.1.unwrap_or(answer.latency), ..answer }
    }
}

/// A model that always answers the same.
struct Says(&'static str);

impl Vlm for Says {
    fn name(&self) -> &str {
        "says"
    }

    fn image_spec(&self, _: (u32, u32)) -> ImageSpec {
        ImageSpec::default()
    }

    fn answer(&mut self, _: &QueryRequest<'_>, _: &mut dyn QueryImage) -> Answer {
        let account = spf_vlm::Usage::default();
        Answer { text: Ok(self.0.to_owned()), latency: Duration::from_secs(1), model: "says".to_owned(), account }
    }
}

/// The record of a flight.
#[derive(Default)]
struct Seen {
    outcome: Option<(Time, Outcome, String)>,
    envelope: Vec<(Time, String)>,
    phases: Vec<(Time, Phase)>,
    late_replies: Vec<Time>,
    /// Where it flies.
    world: Option<SimWorld>,
    /// Its true position, with the time.
    path: Vec<(Time, EnuPosition)>,
    /// The pilot's estimated position, with its horizontal standard deviation.
    believed: Vec<(EnuPosition, f64)>,
}

impl Observer for Seen {
    fn action(&mut self, now: Time, action: &Action, _: &Pilot) {
        match action {
            Action::Finished(ending) => self.outcome = Some((now, ending.outcome, ending.cause.clone())),
            Action::Note(Note::Envelope(cause)) => self.envelope.push((now, cause.to_string())),
            Action::Note(Note::Phase(phase)) => self.phases.push((now, *phase)),
            Action::Note(Note::LateReply(_)) => self.late_replies.push(now),
            _ => {}
        }
    }

    fn event(&mut self, _: Time, _: &Event) {}

    fn time(&mut self, now: Time, pilot: &Pilot) {
        self.believed.push((pilot.known_pose(now).position, pilot.position_error()));
        self.path.extend(self.world.as_ref().map(|world| (now, world.truth().pose.position)));
    }
}

struct Flight {
    seen: Seen,
    sent: Vec<(Time, String)>,
    world: SimWorld,
}

impl Flight {
    fn craft<T>(&self, ask: impl FnOnce(&SimCraft) -> T) -> T {
        ask(&self.world.shared_craft().lock().unwrap())
    }

    fn outcome(&self) -> Outcome {
        self.seen.outcome.as_ref().unwrap().1
    }

    /// Stick positions as commanded, as numbers.
    fn sticks(&self) -> Vec<(Time, Vec<i32>)> {
        let numbers = |text: &str| text.strip_prefix("rc ").map(|rest| rest.split(' ').map(|n| n.parse().unwrap()).collect());
        self.sent.iter().filter_map(|(at, text)| Some((*at, numbers(text)?))).collect()
    }
}

fn fly(instruction: &str, faults: FaultPlan, latency: Option<Duration>, settings: PilotSettings) -> Flight {
    fly_in("office", instruction, faults, latency, settings, "")
}

/// With an operator who performs the `events`.
fn fly_in(
    scene: &str,
    instruction: &str,
    faults: FaultPlan,
    latency: Option<Duration>,
    settings: PilotSettings,
    events: &str,
) -> Flight {
    fly_within(Limits::for_craft(&Craft::tello()), scene, instruction, faults, latency, settings, events)
}

fn fly_within(
    limits: Limits,
    scene: &str,
    instruction: &str,
    faults: FaultPlan,
    latency: Option<Duration>,
    settings: PilotSettings,
    events: &str,
) -> Flight {
    let oracle = move |world: &SimWorld| -> Box<dyn Vlm> {
        let oracle = OracleVlm::new("oracle".to_owned(), world.clone(), ErrorFile::named("perfect").unwrap(), 5);
        Box::new(Slow(oracle, latency))
    };
    fly_by(limits, scene, instruction, faults, settings, events, oracle)
}

/// With any model.
fn fly_by(
    limits: Limits,
    scene: &str,
    instruction: &str,
    faults: FaultPlan,
    settings: PilotSettings,
    events: &str,
    model: impl FnOnce(&SimWorld) -> Box<dyn Vlm>,
) -> Flight {
    let loaded = Arc::new(LoadedScene::load(scene).unwrap());
    let start = loaded.scene.start;
    let world = SimWorld::new(loaded, CraftKind::Tello, start, 5);
    let drone = Wired::new(world.clone(), ProtocolParameters::default(), faults);
    let sent = drone.sent.clone();
    let model = Mutex::new(Some(model(&world)));
    let vlm_factory: VlmFactory = Arc::new(move |_, _| Ok(model.lock().unwrap().take().unwrap()));
    let site = Site::Real(Real { drone: Box::new(drone), clock: Clock::Virtual });
    let script = Script::from_toml(events).unwrap();
    let plan = FlightPlan { settings, script, limits, ..FlightPlan::new(site, instruction, "oracle", vlm_factory) };
    let mut seen = Seen { world: Some(world.clone()), ..Seen::default() };
    flight::fly(plan, &mut [&mut seen]).unwrap();
    let sent = sent.lock().unwrap().clone();
    Flight { seen, sent, world }
}

fn settings() -> PilotSettings {
    PilotSettings { max_time: Duration::from_secs(90), ..PilotSettings::preset(Preset::Default) }
}

fn trouble(fault: CraftFault, from: f64, until: Option<f64>) -> FaultPlan {
    FaultPlan { craft: vec![CraftFaultRule { fault, from, until }], ..FaultPlan::default() }
}

fn rule(stream: Stream, from: f64, until: Option<f64>, fault: Fault) -> FaultPlan {
    FaultPlan { rules: vec![Rule { stream, from, until, fault }], ..FaultPlan::default() }
}

/// A person who stands in the office.
const GOAL: &str = "go to the person in the green shirt";

#[test]
fn a_whole_flight_over_the_protocol_lands_and_touches_nothing() {
    let flight = fly(GOAL, FaultPlan::default(), None, settings());
    assert_eq!(flight.craft(|craft| craft.dynamics().phase()), FlightPhase::OnGround, "{:?}", flight.seen.outcome);
    assert!(!flight.craft(|craft| craft.dynamics().crashed()));
    assert_eq!(flight.outcome(), Outcome::Reached, "{:?}", flight.seen.outcome);
    let words = |text: &str| flight.sent.iter().filter(|(_, sent)| sent == text).count();
    assert_eq!(words("takeoff"), 1);
    assert!(words("land") >= 1);
    // From take-off to landing a command is sent ten times per second or more.
    let sticks = flight.sticks();
    assert!(sticks.windows(2).all(|pair| pair[1].0.since(pair[0].0) <= Duration::from_millis(100)));
    assert!(sticks.len() > 100, "{}", sticks.len());
}

/// Failing 4: during a slow VLM query the drone's own timer lands it.
#[test]
fn failing_4_the_drone_s_own_landing_never_comes_while_a_vlm_thinks_for_25_s() {
    let patient = PilotSettings { reply_timeout: Duration::from_secs(40), max_time: Duration::from_secs(60), ..settings() };
    let flight = fly(GOAL, FaultPlan::default(), Some(Duration::from_secs(25)), patient);
    let (ended, ..) = flight.seen.outcome.clone().unwrap();
    assert!(ended >= Time::from_millis(30_000), "it was still flying after the first answer: {:?}", flight.seen.outcome);
    let landing = flight.sent.iter().find(|(_, text)| text == "land").unwrap().0;
    assert!(landing >= ended, "nobody landed before the pilot did");
}

/// Failing 3: images of a frozen camera move nothing, and end in a landing.
#[test]
fn failing_3_a_frozen_video_holds_then_lands() {
    let flight = fly(GOAL, rule(Stream::Frames, 6.0, None, Fault::Freeze), None, settings());
    assert_eq!(flight.outcome(), Outcome::Failed, "{:?}", flight.seen.outcome);
    assert_stopped(&flight, 6.0 + PATIENCE + ZERO);
}

#[test]
fn a_covered_black_or_blank_camera_holds_then_lands() {
    for fault in CAMERA_FAULTS {
        let flight = fly(GOAL, trouble(fault, 6.0, None), None, settings());
        let (at, outcome, cause) = flight.seen.outcome.clone().unwrap();
        assert_eq!((outcome, cause.as_str()), (Outcome::Failed, "camera frames unusable"), "{fault:?} at {at}");
        assert_stopped(&flight, 6.0 + PATIENCE + ZERO);
        assert_eq!(flight.craft(|craft| craft.dynamics().phase()), FlightPhase::OnGround);
    }
}

/// Failing 14: a Tello's camera sees 55 by 43 degrees.
#[test]
fn failing_14_the_field_of_view_is_a_tello_s() {
    let (horizontal, vertical) = Camera::tello().half_fov();
    assert!((2.0 * horizontal.to_degrees() - 55.4).abs() < 0.5 && (2.0 * vertical.to_degrees() - 42.9).abs() < 0.5);
    // A point at the right edge turns by half of that, not by 54 degrees.
    let ray = Camera::tello().ray(spf_core::query::ImagePoint { u: 1.0, v: 0.5 });
    assert!((ray.right.atan().to_degrees() - 28.7).abs() < 0.5, "{}", ray.right.atan().to_degrees());
}

/// From `seconds` on only zero was commanded, until the landing.
fn assert_stopped(flight: &Flight, seconds: f64) {
    let moving: Vec<_> =
        flight.sticks().into_iter().filter(|(at, sticks)| at.as_secs_f64() > seconds && *sticks != [0, 0, 0, 0]).collect();
    assert!(moving.is_empty(), "{moving:?}\n{:?}", flight.seen.envelope);
}

/// Between two state lines.
const STATE: f64 = 0.1;
/// Maximum wait for frames and state before the envelope holds.
const PATIENCE: f64 = 1.0;
/// From the end of the reason to move to the zero.
const ZERO: f64 = 0.2;

/// Failing 8: an override that cancels neither the pending answer nor the active command, and an emergency stop that
/// only centres the sticks.
#[test]
fn failing_8_an_override_ends_motion_and_answer_and_an_emergency_cuts_the_motors() {
    let events = "[[event]]\nat_s = 10.0\ndo = \"hold\"\n[[event]]\nat_s = 16.0\ndo = \"cut_motors\"";
    let flight = fly_in("office", GOAL, FaultPlan::default(), Some(Duration::from_secs(3)), settings(), events);
    let (hold, stop) = (Time::from_millis(10_000), Time::from_millis(16_000));
    let moved = |from: Time| flight.sticks().iter().any(|(at, sticks)| (from..hold).contains(at) && *sticks != [0; 4]);
    assert!(moved(Time::from_millis(9700)), "a command was in execution");
    assert_stopped(&flight, 10.0 + ZERO);
    assert!(flight.seen.late_replies.iter().any(|at| *at > hold), "an answer was out, came, and moved nothing");
    let emergencies: Vec<Time> = flight.sent.iter().filter(|(_, text)| text == "emergency").map(|(at, _)| *at).collect();
    let first = emergencies.iter().filter(|at| at.since(stop) <= Duration::from_millis(100)).count();
    assert!(first == 3 && emergencies.len() > 3, "three at once, then until the motors are seen off: {emergencies:?}");
    assert!(flight.sticks().iter().all(|(at, _)| *at < emergencies[0]), "nothing is said to motors that are off");
    assert_eq!((flight.outcome(), flight.craft(|craft| craft.dynamics().phase())), (Outcome::Aborted, FlightPhase::Stopped));
}

#[test]
fn a_cut_link_stops_commands_and_the_drone_lands_by_itself() {
    let flight = fly(GOAL, trouble(CraftFault::LinkCut, 6.0, None), None, settings());
    assert_eq!(flight.outcome(), Outcome::Failed, "{:?}", flight.seen.outcome);
    assert_stopped(&flight, 6.0 + PATIENCE + ZERO);
    assert!(flight.sent.iter().any(|(at, text)| text == "land" && *at > Time::from_millis(6000)), "it is tried all the same");
}

#[test]
fn a_link_that_comes_back_within_two_seconds_goes_on() {
    let flight = fly(GOAL, trouble(CraftFault::LinkCut, 6.0, Some(7.5)), None, settings());
    assert_eq!(flight.outcome(), Outcome::Reached, "{:?}", flight.seen.outcome);
    assert_eq!(flight.sent.iter().filter(|(_, text)| text == "takeoff").count(), 1);
}

#[test]
fn a_refused_take_off_ends_the_flight_on_the_ground() {
    let flight = fly(GOAL, trouble(CraftFault::TakeOffRefused, 0.0, None), None, settings());
    let (at, outcome, cause) = flight.seen.outcome.clone().unwrap();
    assert_eq!((outcome, cause.as_str()), (Outcome::Failed, "the craft refused to take off"));
    assert!(at < Time::from_millis(6000), "{at}");
    assert_eq!(flight.craft(|craft| craft.dynamics().phase()), FlightPhase::OnGround);
    assert_stopped(&flight, 0.0);
    assert_eq!(flight.sent.iter().filter(|(_, text)| text == "takeoff").count(), 1, "never said twice");
}

#[test]
fn an_empty_battery_is_landed_with() {
    let flight = fly(GOAL, trouble(CraftFault::BatteryEmpty, 7.0, None), None, settings());
    assert_ne!(flight.outcome(), Outcome::Reached, "{:?}", flight.seen.outcome);
    assert_stopped(&flight, 7.0 + STATE + ZERO);
    assert_eq!(flight.craft(|craft| craft.dynamics().phase()), FlightPhase::OnGround);
}

#[test]
fn a_restart_in_flight_ends_it_and_moves_nothing_after() {
    let flight = fly(GOAL, trouble(CraftFault::Reboot, 7.0, Some(7.05)), None, settings());
    assert_ne!(flight.outcome(), Outcome::Reached, "{:?}", flight.seen.outcome);
    assert_stopped(&flight, 7.0 + PATIENCE + ZERO);
}

#[test]
fn video_that_ends_holds_then_lands() {
    let flight = fly(GOAL, rule(Stream::Frames, 6.0, None, Fault::Drop { p: 1.0 }), None, settings());
    assert_eq!(flight.outcome(), Outcome::Failed, "{:?}", flight.seen.outcome);
    assert_stopped(&flight, 6.0 + PATIENCE + ZERO);
}

#[test]
fn state_that_ends_holds_then_lands() {
    let flight = fly(GOAL, rule(Stream::Telemetry, 6.0, None, Fault::Drop { p: 1.0 }), None, settings());
    assert_eq!(flight.outcome(), Outcome::Failed, "{:?}", flight.seen.outcome);
    assert_stopped(&flight, 6.0 + PATIENCE + ZERO);
    assert_eq!(flight.craft(|craft| craft.dynamics().phase()), FlightPhase::OnGround);
}

/// A drone that does not know its own motion refuses moves. `rc` has no answer, so that nothing shows the error.
#[test]
fn an_imu_error_that_only_answers_show_is_unknown_to_a_flight_by_rc() {
    let flight = fly(GOAL, trouble(CraftFault::ImuInvalid, 6.0, None), None, settings());
    assert_eq!(flight.outcome(), Outcome::Reached, "{:?}", flight.seen.outcome);
}

/// A height that stays at 80 cm would let the drone climb through the ceiling.
#[test]
fn a_stuck_height_is_noticed_before_the_ceiling_is_passed() {
    let cause = "the reported height does not follow the commands";
    let up = r#"{"status":"navigating","target":"tower","point":[150,500],"depth":4,"boxes":[]}"#;
    let by_hand = "[[event]]\nat_s = 8.0\ndo = \"setpoint\"\nup_m_s = 0.5\nfor_s = 20\n\
        [[event]]\nat_s = 30.0\ndo = \"resume\"";
    // The pilot climbs, or the operator does, who resumes after some time.
    for events in ["", by_hand] {
        let (limits, stuck) = (Limits::for_craft(&Craft::tello()), trouble(CraftFault::HeightStuck, 5.5, None));
        let flight = fly_by(limits, "city", "fly to the tower", stuck, settings(), events, |_| Box::new(Says(up)));
        let noticed = flight.seen.envelope.iter().find(|(_, said)| said == cause);
        let (noticed, _) = noticed.unwrap_or_else(|| panic!("{:?} {:?}", flight.seen.outcome, flight.seen.envelope));
        let climbs: Vec<_> = flight.sticks().into_iter().filter(|(_, sticks)| sticks[2] > 0).collect();
        let (_, last) = (climbs[0].0, climbs.last().unwrap().0);
        assert!(last <= *noticed + Duration::from_millis(200), "it climbs until {last}, noticed at {noticed}");
        let start = flight.seen.path[0].1.up;
        let highest = flight.seen.path.iter().map(|(_, at)| at.up - start).fold(0.0, f64::max);
        println!("noticed at {noticed}, {highest:.1} m high, {:?}", flight.seen.outcome);
        assert!((2.0..3.3).contains(&highest), "{highest} m");
        let (_, outcome, why) = flight.seen.outcome.clone().unwrap();
        assert_eq!((outcome, why.as_str()), (Outcome::Failed, cause));
        assert_eq!(flight.craft(|craft| craft.dynamics().phase()), FlightPhase::OnGround);
    }
}

/// Speeds that stay zero would keep the reckoned position at its place, so that neither fence nor distance limit held.
#[test]
fn a_speed_that_stays_zero_lands_the_drone() {
    let ahead = r#"{"status":"navigating","target":"tower","point":[450,500],"depth":6,"boxes":[]}"#;
    let limits = Limits { max_speed: 0.6, ..Limits::for_craft(&Craft::tello()) };
    let zero = trouble(CraftFault::SpeedZero, 5.0, None);
    let flight = fly_by(limits, "city", "fly to the tower", zero, settings(), "", |_| Box::new(Says(ahead)));
    let (at, outcome, why) = flight.seen.outcome.clone().unwrap();
    assert_eq!((outcome, why.as_str()), (Outcome::Failed, "the craft reports an IMU error"), "{at}");
    let flown = flight.seen.path[0].1.horizontal_distance(flight.place(Time::MAX));
    println!("landed at {at} after {flown:.1} m");
    assert!((2.0..4.5).contains(&flown), "{flown} m");
    assert_eq!(flight.craft(|craft| craft.dynamics().phase()), FlightPhase::OnGround);
}

/// Whatever reports the error: the refusal of a move, or state lines without attitude.
#[test]
fn an_imu_error_lands_the_drone_at_once() {
    let undisturbed = fly(GOAL, FaultPlan::default(), None, by_go());
    let (second, _) = undisturbed.words("go")[1].clone();
    let faulty = second.as_secs_f64() - 0.3;
    let refused = fly(GOAL, trouble(CraftFault::ImuInvalid, faulty, None), None, by_go());
    let unleveled = fly(GOAL, trouble(CraftFault::ImuLost, 8.0, None), None, settings());
    // The refusal follows within 0.1 s of the move; three lines without attitude within 0.4 s of the fault.
    for (flight, from) in [(refused, second.as_secs_f64() + 0.1), (unleveled, 8.0 + 4.0 * STATE)] {
        let (at, outcome, cause) = flight.seen.outcome.clone().unwrap();
        assert_eq!((outcome, cause.as_str()), (Outcome::Failed, "the craft reports an IMU error"), "{at}");
        let land = flight.words("land")[0].0.as_secs_f64();
        assert!((from - 0.4..from + ZERO).contains(&land), "{land} s, error at {from} s");
        assert_stopped(&flight, from + ZERO);
        assert_eq!(flight.craft(|craft| craft.dynamics().phase()), FlightPhase::OnGround);
    }
}

/// The reason for the warning in docs/guide/tello.md: stick positions stay in force when the link is cut.
#[test]
fn a_cut_link_lets_a_tello_fly_on_for_15_s() {
    let flight = fly_in("city", "fly to the red crane", trouble(CraftFault::LinkCut, 14.0, None), None, settings(), "");
    let cut = Time::from_millis(14_000);
    let (_, told) = flight.sticks().into_iter().rfind(|(at, _)| *at < cut).unwrap();
    let speed = 0.01 * f64::hypot(f64::from(told[0]), f64::from(told[1]));
    assert!(speed > 0.7, "it flew: {told:?}");
    let (from, to) = (flight.place(cut), flight.place(Time::MAX));
    let flown_on = f64::hypot(to.east - from.east, to.north - from.north);
    println!("by rc: {flown_on:.1} m after the cut, at {speed:.2} m/s");
    assert!((13.0..17.0).contains(&(flown_on / speed)), "{flown_on} m at {speed} m/s");
    assert_eq!(flight.craft(|craft| craft.dynamics().phase()), FlightPhase::OnGround, "it landed by itself");
}

/// The pilot's error, in multiples of its stated standard deviation, over whole flights: neither too small nor too
/// large.
#[test]
fn the_stated_error_of_the_dead_reckoned_position_is_the_true_one() {
    let mut last = Vec::new();
    for (scene, goal) in
        [("office", GOAL), ("yard", "fly to the door"), ("city", "fly to the red crane"), ("city", "fly to the black car")]
    {
        let flight = fly_in(scene, goal, FaultPlan::default(), None, settings(), "");
        let start = flight.seen.path[0].1;
        let heading = LoadedScene::load(scene).unwrap().scene.start.attitude.heading;
        let off: Vec<f64> = (flight.seen.path.iter().zip(&flight.seen.believed))
            .map(|((_, truth), (known, error))| {
                // The drone's north is its heading at power-on.
                let so_far = start.displacement_to(*truth, heading);
                f64::hypot(so_far.right - known.east, so_far.forward - known.north) / error.max(0.05)
            })
            .collect();
        let errors: Vec<f64> = flight.seen.believed.iter().map(|(_, error)| *error).collect();
        assert!(errors.is_sorted(), "it grows");
        let worst = off.iter().copied().fold(0.0, f64::max);
        println!(
            "{goal}: {:.2} m stated at the end, {:.1} of it true, {worst:.1} at worst",
            errors.last().unwrap(),
            off.last().unwrap()
        );
        assert!(worst < 3.5, "{goal}: {worst}");
        last.push(*off.last().unwrap());
    }
    let typical = last.iter().sum::<f64>() / last.len() as f64;
    assert!(typical > 0.15, "stated far too large: {typical}");
}

/// A Tello's position becomes uncertain with time alone; a limit of 1.2 m leaves no room after less than a minute.
#[test]
fn a_tello_lands_when_its_position_is_too_uncertain_for_the_limits() {
    let patient = PilotSettings { reply_timeout: Duration::from_secs(200), max_time: Duration::from_secs(200), ..settings() };
    let limits = Limits { max_distance: 1.2, ..Limits::for_craft(&Craft::tello()) };
    let flight = fly_within(limits, "office", GOAL, FaultPlan::default(), Some(Duration::from_secs(150)), patient, "");
    let (at, outcome, cause) = flight.seen.outcome.clone().unwrap();
    let expected = "the position is too uncertain for the distance limit or the geofence";
    assert_eq!((outcome, cause.as_str()), (Outcome::Aborted, expected), "{at}");
    // 2σ = 2·√(0.01/6·t) reaches half of 1.2 m after 54 s; the landing follows 5 s later.
    let airborne = flight.seen.phases.iter().find(|(_, phase)| *phase == Phase::Flying).unwrap().0;
    assert!((at.since(airborne).as_secs_f64() - 59.0).abs() < 8.0, "{at} after {airborne}");
    assert_eq!(flight.craft(|craft| craft.dynamics().phase()), FlightPhase::OnGround);
}

fn by_go() -> PilotSettings {
    PilotSettings { motion: Motion::Manoeuvres, think: QueryTiming::Stop, ..settings() }
}

impl Flight {
    /// Commands that begin with this, with their times.
    fn words(&self, verb: &str) -> Vec<(Time, String)> {
        self.sent.iter().filter(|(_, sent)| sent.split(' ').next() == Some(verb)).cloned().collect()
    }

    fn place(&self, at: Time) -> EnuPosition {
        self.seen.path.iter().rfind(|(t, _)| *t <= at).unwrap().1
    }
}

#[test]
fn a_whole_flight_by_go_arrives_and_moves_by_nothing_else() {
    let flight = fly(GOAL, FaultPlan::default(), None, by_go());
    assert_eq!(flight.outcome(), Outcome::Reached, "{:?}", flight.seen.outcome);
    let gone = flight.words("go");
    assert!(gone.len() >= 3 && flight.words("stop").is_empty(), "{gone:?}");
    // Nonzero sticks only for motion too short for `go`, and no sticks during a move.
    assert!(flight.sticks().iter().filter(|(_, sticks)| sticks.iter().any(|s| *s != 0)).count() < 40);
    for (at, text) in gone.iter().chain(&flight.words("cw")).chain(&flight.words("ccw")) {
        // A turn of a few degrees ends sooner than any other move.
        let is_short =
            text.split(' ').nth(1).and_then(|degrees| degrees.parse().ok()).is_some_and(|degrees: i32| degrees.abs() < 10);
        let lasts = Duration::from_millis(if is_short && !text.starts_with("go") { 150 } else { 400 });
        let close = |other: &Time| *other < *at + lasts && at.since(*other) < Duration::from_millis(400);
        assert!(!flight.sticks().iter().any(|(other, _)| close(other)), "{text} at {at}");
    }
    assert_eq!(flight.craft(|craft| craft.dynamics().phase()), FlightPhase::OnGround);
}

/// The other half of `a_cut_link_lets_a_tello_fly_on_for_15_s`: a move that the drone ends by itself goes no farther
/// than planned.
#[test]
fn by_go_a_cut_link_lets_it_fly_the_rest_of_its_step() {
    let undisturbed = fly_in("city", "fly to the red crane", FaultPlan::default(), None, by_go(), "");
    let (began, text) = undisturbed.words("go")[2].clone();
    let cut = began + Duration::from_millis(1200);
    let flight = fly_in("city", "fly to the red crane", trouble(CraftFault::LinkCut, cut.as_secs_f64(), None), None, by_go(), "");
    let cm: Vec<f64> = text.split(' ').skip(1).map(|n| n.parse().unwrap()).collect();
    let length = 0.01 * f64::hypot(cm[0], cm[1]);
    let (from, at, to) = (flight.place(began), flight.place(cut), flight.place(Time::MAX));
    let map = |a: EnuPosition, b: EnuPosition| f64::hypot(b.east - a.east, b.north - a.north);
    assert!(map(from, at) < 0.8 * length, "it was cut in the middle");
    // The drone misses by 5 % and 5 cm, one standard deviation.
    assert!((map(from, to) - length).abs() < 0.15 * length + 0.15, "{} m of {length} m", map(from, to));
    println!("by go: {:.1} m after the cut, of a step of {length:.1} m", map(at, to));
    assert!(map(at, to) < 5.5, "{} m after the cut", map(at, to));
    assert_eq!(flight.craft(|craft| craft.dynamics().phase()), FlightPhase::OnGround, "it landed by itself");
}

#[test]
fn by_go_the_end_of_a_reason_is_a_stop_and_the_flight_goes_on() {
    let undisturbed = fly(GOAL, FaultPlan::default(), None, by_go());
    let (began, _) = undisturbed.words("go")[0].clone();
    let hold = began + Duration::from_millis(900);
    let events = format!(
        "[[event]]\nat_s = {}\ndo = \"hold\"\n[[event]]\nat_s = {}\ndo = \"resume\"\n",
        hold.as_secs_f64(),
        hold.as_secs_f64() + 3.0
    );
    let flight = fly_in("office", GOAL, FaultPlan::default(), None, by_go(), &events);
    let stops = flight.words("stop");
    assert!(stops.len() == 1 && stops[0].0.since(hold) <= Duration::from_millis(200), "{stops:?}, hold at {hold}");
    let (stopped, later) = (flight.place(hold + Duration::from_millis(1600)), flight.place(hold + Duration::from_secs(3)));
    assert!(stopped.distance(later) < 0.1, "{stopped:?} {later:?}");
    assert_eq!(flight.outcome(), Outcome::Reached, "{:?}", flight.seen.outcome);

    // The video freezes during a step: it is stopped when the last frame is a second old.
    let frozen = rule(Stream::Frames, hold.as_secs_f64(), None, Fault::Freeze);
    let flight = fly(GOAL, frozen, None, by_go());
    assert_eq!(flight.outcome(), Outcome::Failed);
    let last = flight.words("go").last().unwrap().0;
    assert!(last < hold + Duration::from_millis(1200), "nothing begins on old frames: {last}");
    assert_eq!(flight.craft(|craft| craft.dynamics().phase()), FlightPhase::OnGround);
}

/// A `stop` sent after `land` would end the landing.
#[test]
fn by_go_a_landing_in_a_step_stops_it_once() {
    let undisturbed = fly(GOAL, FaultPlan::default(), None, by_go());
    let land = undisturbed.words("go")[0].0 + Duration::from_millis(900);
    let events = format!("[[event]]\nat_s = {}\ndo = \"land\"\n", land.as_secs_f64());
    // Its answer is lost, so that it would be sent again.
    let lost = rule(Stream::Responses, land.as_secs_f64(), Some(land.as_secs_f64() + 1.5), Fault::Drop { p: 1.0 });
    let flight = fly_in("office", GOAL, lost, None, by_go(), &events);
    let (stops, lands) = (flight.words("stop"), flight.words("land"));
    assert!(
        stops.len() == 1 && stops[0].0.since(land) <= Duration::from_millis(200) && stops[0].0 < lands[0].0,
        "{stops:?} {lands:?}"
    );
    assert_eq!(flight.craft(|craft| craft.dynamics().phase()), FlightPhase::OnGround);
}

#[test]
fn by_go_moves_that_the_drone_refuses_are_not_flown_otherwise() {
    let flight = fly(GOAL, trouble(CraftFault::ImuInvalid, 6.0, None), None, PilotSettings { max_decisions: 6, ..by_go() });
    assert_ne!(flight.outcome(), Outcome::Reached, "{:?}", flight.seen.outcome);
    let flown = flight.place(Time::from_millis(6000)).distance(flight.place(Time::MAX));
    assert!(flown < 1.5, "{flown} m, the landing among them");
}

#[test]
fn a_lossy_link_is_flown_over() {
    let lossy = |stream| Rule { stream, from: 0.0, until: None, fault: Fault::Drop { p: 0.15 } };
    let twice = |stream| Rule { stream, from: 0.0, until: None, fault: Fault::Duplicate { p: 0.1, after: 0.05 } };
    let late = |stream| Rule { stream, from: 0.0, until: None, fault: Fault::Delay { mean: 0.02, jitter: 0.02 } };
    let rules = [Stream::Commands, Stream::Telemetry, Stream::Frames].into_iter();
    let rules = rules.flat_map(|stream| [lossy(stream), twice(stream), late(stream)]).collect();
    let flight = fly(GOAL, FaultPlan { rules, ..FaultPlan::default() }, None, settings());
    assert_eq!(flight.craft(|craft| craft.dynamics().phase()), FlightPhase::OnGround, "{:?}", flight.seen.outcome);
    assert!(!flight.craft(|craft| craft.dynamics().crashed()));
}

/// `spf tello calibrate` measures any effect of full stick.
#[test]
fn what_full_stick_does_is_measured() {
    let yaw = 78.0_f64.to_radians();
    let figures = ProtocolParameters {
        stick_speed: 0.8,
        stick_climb: 1.1,
        stick_sink: 0.7,
        stick_yaw: yaw,
        ..ProtocolParameters::default()
    };
    let loaded = Arc::new(LoadedScene::load("yard").unwrap());
    let start = loaded.scene.start;
    let world = SimWorld::new(loaded, CraftKind::Tello, start, 5);
    let drone = Wired::new(world.clone(), figures, FaultPlan::default());
    let (sender, operator) = channel();
    let mut routine = Routine::new(Calibration::default(), sender);
    let plan = calibrate::plan(Box::new(drone), Clock::Virtual, operator, Arc::default());
    let flown = flight::fly(plan, &mut [&mut routine]).unwrap();
    let measured = routine.measured().unwrap();
    let near = |name: &str, value: f64, truth: f64, fraction: f64| {
        assert!((value / truth - 1.0).abs() < fraction, "{name}: measured {value}, in truth {truth}");
    };
    near("yaw", measured.yaw_rate, yaw, 0.05);
    near("climb", measured.climb, 1.1, 0.15);
    near("sink", measured.sink, 0.7, 0.15);
    near("speed", measured.speed, 0.8, 0.15);
    assert_eq!(flown.summary.decisions, 0);
    assert!(!world.truth().phase.eq(&FlightPhase::Flying));
}
