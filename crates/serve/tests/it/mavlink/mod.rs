//! The MAVLink driver against the virtual vehicle: whole flights by language, somebody else who takes over, refusals, the death of
//! the program, a radio that loses and repeats packets.

mod carried;
mod fences;
mod gimbal;
mod glass;
mod nobody;
mod old;
mod protocol;
mod ranges;
mod returning;
mod taken;
mod tap;
pub(crate) mod wired;

use std::sync::{Arc, Mutex, OnceLock};

use spf_core::craft::{Craft, CraftKind};
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time};
use spf_drone::Drone as _;
use spf_drone::mavlink::vehicle::{Notice, Outgoing};
use spf_envelope::Limits;
use spf_flight::flight::{self, FlightPlan, Site};
use spf_flight::real::Real;
use spf_flight::run::Observer;
use spf_flight::sim::{LoadedScene, OracleVlm, SimWorld, VlmFactory};
use spf_flight::site::Clock;
use spf_flight::world::Script;
use spf_mavlink::command::{CommandResult, VehicleCommand, ids};
use spf_mavlink::modes::{Autopilot, Mode};
use spf_oracle::ErrorFile;
use spf_pilot::{Action, AtEnd, Event, Note, Outcome, Phase, Pilot, PilotSettings, Preset};
use spf_serve::fault::{Fault, FaultPlan, Rule, Stream};
use spf_vlm::Vlm;

use self::wired::{Deed, Told, WiredVehicle};

/// Battery, what happens at the end, and tilt of a camera on a gimbal, degrees below the horizon.
type Kind = (f64, AtEnd, Option<f64>);

const BOTH: [Autopilot; 2] = [Autopilot::Px4, Autopilot::ArduPilot];
/// Something in the park that is seen from the start.
const GOAL: &str = "fly to the fountain";

fn park() -> Arc<LoadedScene> {
    static SCENE: OnceLock<Arc<LoadedScene>> = OnceLock::new();
    SCENE.get_or_init(|| Arc::new(LoadedScene::load("park").unwrap())).clone()
}

#[derive(Default)]
struct Seen {
    outcome: Option<(Time, Outcome, String)>,
    phases: Vec<(Time, Phase)>,
}

impl Observer for Seen {
    fn action(&mut self, now: Time, action: &Action, _: &Pilot) {
        match action {
            Action::Finished(ending) => self.outcome = Some((now, ending.outcome, ending.cause.clone())),
            Action::Note(Note::Phase(phase)) => self.phases.push((now, *phase)),
            _ => {}
        }
    }

    fn event(&mut self, _: Time, _: &Event) {}
}

struct Flight {
    seen: Seen,
    told: Told,
    world: SimWorld,
}

impl Flight {
    fn phase(&self) -> FlightPhase {
        self.world.truth().phase
    }

    fn entered(&self, phase: Phase) -> Vec<f64> {
        self.seen.phases.iter().filter(|(_, entered)| *entered == phase).map(|(at, _)| at.as_secs_f64()).collect()
    }

    fn has_notice(&self, is: impl Fn(&Notice) -> bool) -> bool {
        self.told.notices.iter().any(|(_, notice)| is(notice))
    }

    /// What was sent to move or command the craft from this time on, until another.
    fn sent(&self, from: f64, until: f64) -> Vec<&Outgoing> {
        let within = |at: &Time| (from..until).contains(&at.as_secs_f64());
        let moves = |sent: &Outgoing| match sent {
            Outgoing::Setpoint(_) => true,
            Outgoing::Command(sent) => !matches!(sent.command.id, ids::INTERVAL | ids::REQUEST),
            _ => false,
        };
        self.told.sent.iter().filter(|(at, sent)| within(at) && moves(sent)).map(|(_, sent)| sent).collect()
    }
}

fn fly(autopilot: Autopilot, parameters: &[(&str, f64)], faults: FaultPlan, deeds: Vec<(f64, Deed)>, events: &str) -> Flight {
    fly_charged(autopilot, parameters, faults, deeds, events, (1.0, AtEnd::Land, None))
}

fn fly_charged(
    autopilot: Autopilot,
    parameters: &[(&str, f64)],
    faults: FaultPlan,
    deeds: Vec<(f64, Deed)>,
    events: &str,
    (battery, at_end, tilt): Kind,
) -> Flight {
    fly_by_script(autopilot, parameters, faults, deeds, Script::from_toml(events).unwrap(), (battery, at_end, tilt))
}

fn fly_by_script(
    autopilot: Autopilot,
    parameters: &[(&str, f64)],
    faults: FaultPlan,
    deeds: Vec<(f64, Deed)>,
    script: Script,
    (battery, at_end, tilt): Kind,
) -> Flight {
    let loaded = park();
    let start = loaded.scene.start;
    let conditions = spf_flight::sim::FlightConditions { battery, ..Default::default() };
    let world = SimWorld::under(&conditions, loaded, CraftKind::Quad, start, 5);
    let mut drone = WiredVehicle::new(world.clone(), autopilot, parameters, faults, deeds);
    if tilt.is_some() {
        drone.carry_gimbal(false);
    }
    drone.get_ready();
    if let Some(tilt) = tilt {
        let now = drone.now;
        drone.driver.tilt(now, tilt.to_radians());
    }
    let told = drone.told.clone();
    let oracle = OracleVlm::new("oracle".to_owned(), world.clone(), ErrorFile::named("perfect").unwrap(), 5);
    let model: Mutex<Option<Box<dyn Vlm>>> = Mutex::new(Some(Box::new(oracle)));
    let vlm_factory: VlmFactory = Arc::new(move |_, _| Ok(model.lock().unwrap().take().unwrap()));
    let site = Site::Real(Real { drone: Box::new(drone), clock: Clock::Virtual });
    let settings = PilotSettings { max_time: Duration::from_secs(120), at_end, ..PilotSettings::preset(Preset::Default) };
    // The envelope of a small battery would refuse first.
    let limits = Limits { take_off_battery: 0.0, low_battery: 0.0, ..Limits::for_craft(&Craft::quad()) };
    let plan = FlightPlan { settings, script, limits, ..FlightPlan::new(site, GOAL, "oracle", vlm_factory) };
    let mut seen = Seen::default();
    flight::fly(plan, &mut [&mut seen]).unwrap();
    let told = core::mem::take(&mut *told.lock().unwrap());
    Flight { seen, told, world }
}

fn none() -> FaultPlan {
    FaultPlan::default()
}

#[test]
fn a_flight_by_language_over_the_protocol_reaches_lands_and_disarms() {
    for autopilot in BOTH {
        let flight = fly(autopilot, &[], none(), Vec::new(), "");
        let (_, outcome, cause) = flight.seen.outcome.clone().unwrap();
        assert_eq!((outcome, flight.phase()), (Outcome::Reached, FlightPhase::OnGround), "{autopilot:?}: {cause}");
        assert!(flight.world.truth().collided_with.is_empty());
        let modes: Vec<String> = flight.told.modes.iter().map(|(_, mode)| mode.to_string()).collect();
        let expected: &[&str] = match autopilot {
            Autopilot::Px4 => &["AUTO.LOITER", "AUTO.TAKEOFF", "AUTO.LOITER", "OFFBOARD", "AUTO.LAND"],
            Autopilot::ArduPilot => &["STABILIZE", "GUIDED", "LAND"],
        };
        assert_eq!(modes, expected, "{autopilot:?}");
        // From the first setpoint to the landing there are 20 a second.
        let setpoints: Vec<Time> =
            flight.told.sent.iter().filter(|(_, sent)| matches!(sent, Outgoing::Setpoint(_))).map(|(at, _)| *at).collect();
        assert!(setpoints.windows(2).all(|pair| pair[1].since(pair[0]) <= Duration::from_millis(60)), "{autopilot:?}");
        assert!(setpoints.len() > 200 && !flight.has_notice(|it| matches!(it, Notice::LetGo { .. } | Notice::Refused { .. })));
    }
}

/// Its estimator is reset twice on the way, by metres: it ends where it ends without that, and reaches its goal.
#[test]
fn a_reset_of_the_estimator_does_not_lead_the_flight_astray() {
    for autopilot in BOTH {
        let ended = |deeds| {
            let flight = fly(autopilot, &[], none(), deeds, "");
            let (at, outcome, cause) = flight.seen.outcome.clone().unwrap();
            assert_eq!((outcome, flight.phase()), (Outcome::Reached, FlightPhase::OnGround), "{autopilot:?}: {cause}");
            assert!(flight.world.truth().collided_with.is_empty());
            (at, flight.world.truth().pose.position)
        };
        let (at, plain) = ended(Vec::new());
        // Once the craft flies, and before it is there.
        let deed = |part: f64, by| (part * at.as_secs_f64(), Deed::Jump(by));
        let (_, jumped) = ended(vec![deed(0.5, [9.0, -6.0]), deed(0.75, [-4.0, 5.0])]);
        assert!(plain.horizontal_distance(jumped) < 1.5, "{autopilot:?}: {plain:?} {jumped:?}");
    }
}

#[test]
fn a_radio_that_loses_a_fifth_and_repeats_a_fifth_changes_nothing_but_the_time() {
    let rules: Vec<Rule> = [Stream::Telemetry, Stream::Commands]
        .into_iter()
        .flat_map(|stream| {
            let rule = |fault| Rule { stream, from: 0.0, until: None, fault };
            [rule(Fault::Drop { p: 0.2 }), rule(Fault::Duplicate { p: 0.2, after: 0.3 })]
        })
        .collect();
    for autopilot in BOTH {
        let flight = fly(autopilot, &[], FaultPlan { rules: rules.clone(), ..FaultPlan::default() }, Vec::new(), "");
        let (_, outcome, cause) = flight.seen.outcome.clone().unwrap();
        assert_eq!(
            (outcome, flight.phase()),
            (Outcome::Reached, FlightPhase::OnGround),
            "{autopilot:?}: {cause} {:?}",
            flight.told.notices
        );
        assert!(!flight.has_notice(|it| matches!(it, Notice::LetGo { .. })), "{autopilot:?}: {:?}", flight.told.notices);
    }
}

/// The pilot's radio, and another ground station: we let go at once, and stay away until the operator resumes.
#[test]
fn somebody_else_takes_over_and_is_not_fought_and_the_operator_takes_back() {
    let loiter = |autopilot| match autopilot {
        Autopilot::Px4 => (Mode::px4(3, 0), VehicleCommand::new(ids::SET_MODE, &[129.0, 4.0, 3.0])),
        Autopilot::ArduPilot => (Mode(autopilot, 5), VehicleCommand::new(ids::SET_MODE, &[129.0, 17.0])),
    };
    let resume = "[[event]]\nat_s = 24.0\ndo = \"resume\"\n";
    for autopilot in BOTH {
        let (radio, station) = loiter(autopilot);
        for deed in [Deed::Radio(radio), Deed::Station(station)] {
            let flight = fly(autopilot, &[], none(), vec![(12.0, deed)], resume);
            assert!(flight.entered(Phase::Held).iter().any(|at| (12.0..13.2).contains(at)), "{:?}", flight.seen.phases);
            assert!(flight.has_notice(|it| matches!(it, Notice::LetGo { .. })), "{:?}", flight.told.notices);
            // The heartbeat comes once a second at least.
            assert_eq!(flight.sent(13.2, 24.0), Vec::<&Outgoing>::new(), "{autopilot:?} {deed:?}");
            let back = flight.told.notices.iter().find(|(_, it)| matches!(it, Notice::TakingBack { .. }));
            assert!(back.is_some_and(|(at, _)| at.as_secs_f64() >= 24.0), "{:?}", flight.told.notices);
            assert_eq!(flight.seen.outcome.as_ref().unwrap().1, Outcome::Reached, "{:?}", flight.seen.outcome);
        }
    }
}

/// Its pilot lands it by the radio: the flight is over, and nothing of ours interferes.
#[test]
fn a_landing_by_the_radio_ends_the_flight() {
    for autopilot in BOTH {
        let flight = fly(autopilot, &[], none(), vec![(12.0, Deed::Radio(autopilot.land()))], "");
        assert_eq!(flight.seen.outcome.as_ref().unwrap().1, Outcome::Failed, "{:?}", flight.seen.outcome);
        assert_eq!((flight.phase(), flight.sent(13.2, 1e9).len()), (FlightPhase::OnGround, 0), "{autopilot:?}");
    }
}

#[test]
fn a_refusal_to_arm_ends_the_flight_with_the_autopilot_s_own_words() {
    for (autopilot, words) in BOTH.into_iter().zip(["Preflight Fail: low battery", "PreArm: Battery 1 low voltage failsafe"]) {
        let flight = fly_charged(autopilot, &[], none(), Vec::new(), "", (0.12, AtEnd::Land, None));
        let (_, outcome, cause) = flight.seen.outcome.clone().unwrap();
        assert_eq!((outcome, cause.as_str()), (Outcome::Failed, "the craft refused to take off"));
        let refused = flight.told.notices.iter().find_map(|(_, notice)| match notice {
            Notice::Refused { what, result, texts } => Some((*what, *result, texts.clone())),
            _ => None,
        });
        let (what, result, texts) = refused.unwrap();
        assert_eq!((what, texts), ("arming", vec![words.to_owned()]), "{autopilot:?}");
        assert!(matches!(result, CommandResult::TemporarilyRejected | CommandResult::Failed));
    }
}

/// Whatever kills the program, the autopilot does what its parameters say.
#[test]
fn a_program_that_dies_leaves_the_craft_to_the_autopilot_s_own_action() {
    let cases = [
        (Autopilot::Px4, vec![("COM_OBL_RC_ACT", 5.0)], "AUTO.LOITER", FlightPhase::Flying),
        (Autopilot::Px4, vec![("COM_OBL_RC_ACT", 4.0)], "AUTO.LAND", FlightPhase::OnGround),
        (Autopilot::ArduPilot, Vec::new(), "GUIDED", FlightPhase::Flying),
    ];
    for (autopilot, parameters, mode, phase) in cases {
        let (mut drone, world) = hovering(autopilot, &parameters);
        drone.dies_at = Some(drone.now);
        let until = drone.now + Duration::from_secs(12);
        while drone.now < until {
            drone.step();
        }
        let last = drone.told.lock().unwrap().modes.last().unwrap().1;
        assert_eq!((last.to_string().as_str(), world.truth().phase), (mode, phase));
        assert!(world.truth().velocity.speed() < 0.1, "{:?}", world.truth());
    }
}

/// A vehicle that flies by our setpoints.
fn hovering(autopilot: Autopilot, parameters: &[(&str, f64)]) -> (WiredVehicle, SimWorld) {
    let loaded = park();
    let start = loaded.scene.start;
    let world = SimWorld::new(loaded, CraftKind::Quad, start, 5);
    let drone = WiredVehicle::new(world.clone(), autopilot, parameters, none(), Vec::new());
    take_off(drone, world)
}

/// Takes it off, until it flies by our setpoints.
fn take_off(mut drone: WiredVehicle, world: SimWorld) -> (WiredVehicle, SimWorld) {
    drone.get_ready();
    let mut envelope = spf_envelope::Envelope::new(Limits::for_craft(&Craft::quad()), Craft::quad());
    let mut phase = FlightPhase::OnGround;
    let mut asked = false;
    while phase != FlightPhase::Flying {
        assert!(drone.now < Time::from_secs_f64(120.0), "{:?}", drone.told.lock().unwrap().notices);
        let until = drone.now + Duration::from_millis(50);
        while let Some((_, event)) = drone.next_event(until) {
            if let spf_drone::DroneEvent::Telemetry(telemetry) = event {
                envelope.observe_telemetry(drone.now, &telemetry);
                phase = telemetry.phase;
            }
        }
        if !core::mem::replace(&mut asked, true) {
            let clearance = envelope.clear(drone.now, spf_core::command::Command::TakeOff).unwrap();
            drone.apply(drone.now, &clearance.cleared).unwrap();
        }
    }
    (drone, world)
}

/// With a heartbeat a second, a mode that we commanded before the last one is still shown: it is ours all the same.
#[test]
fn a_landing_soon_after_the_take_off_and_a_hold_soon_after_the_landing_are_ours() {
    let passes = |drone: &mut WiredVehicle, seconds: f64| {
        let until = drone.now + spf_core::time::duration_from_secs(seconds);
        while drone.now < until {
            drone.driver.heartbeat(drone.now);
            drone.step();
        }
    };
    let commands = |drone: &WiredVehicle, id: u16| {
        let told = drone.told.lock().unwrap();
        told.sent.iter().filter(|(_, sent)| matches!(sent, Outgoing::Command(sent) if sent.command.id == id)).count()
    };
    let lets_go = |drone: &WiredVehicle| {
        drone.told.lock().unwrap().notices.iter().any(|(_, notice)| matches!(notice, Notice::LetGo { .. }))
    };
    for autopilot in BOTH {
        let (mut drone, world) = hovering(autopilot, &[]);
        let mut envelope = spf_envelope::Envelope::new(Limits::for_craft(&Craft::quad()), Craft::quad());
        drone.beat_strictly();
        passes(&mut drone, 1.3);
        let land = envelope.clear(drone.now, spf_core::command::Command::Land).unwrap();
        drone.apply(drone.now, &land.cleared).unwrap();
        passes(&mut drone, 0.3);
        let hold = envelope.clear(drone.now, spf_core::command::Command::Setpoint(spf_core::command::Setpoint::HOLD)).unwrap();
        drone.apply(drone.now, &hold.cleared).unwrap();
        passes(&mut drone, 6.0);
        assert!(!lets_go(&drone) && drone.driver.is_ours(), "{autopilot:?}");
        assert_eq!((drone.driver.mode(), world.truth().phase), (autopilot.external(), FlightPhase::Flying));
        let land = envelope.clear(drone.now, spf_core::command::Command::Land).unwrap();
        drone.apply(drone.now, &land.cleared).unwrap();
        passes(&mut drone, 25.0);
        assert_eq!((world.truth().phase, drone.driver.is_ours(), lets_go(&drone)), (FlightPhase::OnGround, false, false));
        // And up again, for half a second.
        let take_offs = commands(&drone, ids::TAKE_OFF);
        let mut envelope = spf_envelope::Envelope::new(Limits::for_craft(&Craft::quad()), Craft::quad());
        while let Some((_, event)) = drone.next_event(drone.now) {
            if let spf_drone::DroneEvent::Telemetry(telemetry) = event {
                envelope.observe_telemetry(drone.now, &telemetry);
            }
        }
        let take_off = envelope.clear(drone.now, spf_core::command::Command::TakeOff).unwrap();
        drone.apply(drone.now, &take_off.cleared).unwrap();
        while commands(&drone, ids::TAKE_OFF) == take_offs {
            assert!(drone.now < Time::from_secs_f64(90.0), "{:?}", drone.told.lock().unwrap().notices);
            passes(&mut drone, 0.05);
        }
        passes(&mut drone, 0.5);
        let land = envelope.clear(drone.now, spf_core::command::Command::Land).unwrap();
        drone.apply(drone.now, &land.cleared).unwrap();
        passes(&mut drone, 25.0);
        assert_eq!((world.truth().phase, drone.driver.is_ours(), lets_go(&drone)), (FlightPhase::OnGround, false, false));
    }
}

/// The acknowledgement of the take-off is lost, and ArduPilot refuses it the second time: it is flown, and lands.
#[test]
fn a_take_off_whose_acknowledgement_is_lost_is_flown() {
    for autopilot in BOTH {
        let loaded = park();
        let start = loaded.scene.start;
        let world = SimWorld::new(loaded, CraftKind::Quad, start, 5);
        // Telemetry is lost for a second and a half from when the take-off may be sent: heartbeats, states, acknowledgements.
        let lost = Rule { stream: Stream::Telemetry, from: 6.2, until: Some(7.7), fault: Fault::Drop { p: 1.0 } };
        let faults = FaultPlan { rules: vec![lost], ..FaultPlan::default() };
        let mut drone = WiredVehicle::new(world.clone(), autopilot, &[], faults, Vec::new());
        drone.get_ready();
        assert!(drone.now < Time::from_secs_f64(6.0));
        let mut envelope = spf_envelope::Envelope::new(Limits::for_craft(&Craft::quad()), Craft::quad());
        let (mut asked, mut phase) = (false, FlightPhase::OnGround);
        while phase != FlightPhase::Flying {
            assert!(drone.now < Time::from_secs_f64(40.0), "{autopilot:?} {:?}", drone.told.lock().unwrap().notices);
            let until = drone.now + Duration::from_millis(5);
            while let Some((_, event)) = drone.next_event(until) {
                if let spf_drone::DroneEvent::Telemetry(telemetry) = event {
                    envelope.observe_telemetry(drone.now, &telemetry);
                    phase = telemetry.phase;
                }
            }
            if drone.now >= Time::from_secs_f64(6.17) && !core::mem::replace(&mut asked, true) {
                let clearance = envelope.clear(drone.now, spf_core::command::Command::TakeOff).unwrap();
                drone.apply(drone.now, &clearance.cleared).unwrap();
            }
        }
        let sent = drone
            .told
            .lock()
            .unwrap()
            .sent
            .iter()
            .filter(|(_, sent)| matches!(sent, Outgoing::Command(sent) if sent.command.id == ids::TAKE_OFF))
            .count();
        assert!(drone.driver.is_ours() && sent >= 1, "{autopilot:?} {sent}");
    }
}
