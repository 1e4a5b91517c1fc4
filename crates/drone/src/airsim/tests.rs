//! The driver against a small simulator over real sockets, in both dialects.

use std::io::{Read as _, Write as _};
use std::net::TcpListener;
use std::time::{Duration, Instant};

use spf_core::command::{Command, Setpoint};
use spf_core::craft::Craft;
use spf_core::telemetry::{FlightPhase, Telemetry};
use spf_core::time::Time;
use spf_envelope::{Cleared, Envelope, Limits};

use super::address::Address;
use super::craft::AirSimCraft;
use super::fake::{Fake, Faults, SIZE};
use super::lockstep::LockstepCraft;
use super::opening::ConnectError;
use super::rpc::{Rpc, RpcError};
use super::settings::AirSimSettings;
use super::wire::{Encoding, Message, Raw};
use crate::{Drone as _, DroneEvent};

const BOTH: [Encoding; 2] = [Encoding::Map, Encoding::Array];
const HANGS: Duration = Duration::from_secs(60);

/// Does the same with each at the same time, since most of it is waiting.
fn at_once<T: Send>(each: impl IntoIterator<Item = T>, test: impl Fn(T) + Sync) {
    std::thread::scope(|scope| each.into_iter().for_each(|one| _ = scope.spawn(|| test(one))));
}

/// A driver at a simulator, with what it has reported.
struct Flown {
    craft: AirSimCraft,
    start: Instant,
    envelope: Envelope,
    seen: Vec<DroneEvent>,
}

fn connected(fake: &Fake, settings: &AirSimSettings) -> Result<Flown, ConnectError> {
    let start = Instant::now();
    let (craft, _) = AirSimCraft::connect_within(&fake.address, settings, start, Duration::ZERO)?;
    let envelope = Envelope::new(Limits::for_craft(&Craft::quad()), Craft::quad());
    Ok(Flown { craft, start, envelope, seen: Vec::new() })
}

impl Flown {
    /// With the pose as it is, so that what is flown can be checked.
    fn of(fake: &Fake) -> Self {
        let flown = connected(fake, &AirSimSettings { true_pose: true, ..AirSimSettings::default() }).unwrap();
        flown.craft.engage();
        flown
    }

    fn now(&self) -> Time {
        Time::ZERO + self.start.elapsed()
    }

    /// Takes what was reported.
    fn poll(&mut self) {
        let now = self.now();
        while let Some((_, event)) = self.craft.next_event(now) {
            match &event {
                DroneEvent::Telemetry(told) => self.envelope.observe_telemetry(now, told),
                DroneEvent::Frame(meta) => self.envelope.observe_frame(now, meta),
                _ => {}
            }
            self.seen.push(event);
        }
    }

    /// Polls until something was reported; the time only detects a hang.
    fn until(&mut self, what: &str, mut is_it: impl FnMut(&DroneEvent) -> bool) {
        let begun = Instant::now();
        loop {
            let from = self.seen.len();
            self.poll();
            if self.seen[from..].iter().any(&mut is_it) {
                return;
            }
            assert!(begun.elapsed() < HANGS, "{what}");
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    fn until_phase(&mut self, phase: FlightPhase) {
        self.until(
            &format!("{phase:?}"),
            |event| matches!(event, DroneEvent::Telemetry(Telemetry { phase: told, .. }) if *told == phase),
        );
    }

    fn cleared(&mut self, command: Command) -> Cleared<Command> {
        let now = self.now();
        self.envelope.clear(now, command).unwrap().cleared
    }

    fn apply(&mut self, command: Command) {
        let cleared = self.cleared(command);
        let now = self.now();
        self.craft.apply(now, &cleared).unwrap();
    }

    fn take_off(&mut self) {
        self.until("telemetry", |event| matches!(event, DroneEvent::Telemetry(_)));
        self.apply(Command::TakeOff);
        self.until_phase(FlightPhase::Flying);
        self.until("a frame", |event| matches!(event, DroneEvent::Frame(_)));
    }

    /// Flies this until something is so in the simulator.
    fn fly(&mut self, fake: &Fake, setpoint: Setpoint, what: &str, mut is_so: impl FnMut(&super::fake::World) -> bool) {
        let begun = Instant::now();
        while !is_so(&fake.world()) {
            self.poll();
            self.apply(Command::Setpoint(setpoint));
            assert!(begun.elapsed() < HANGS, "{what}: {:?}", fake.world());
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

#[test]
fn both_dialects_are_recognised_and_their_camera_is_found() {
    for encoding in BOTH {
        let fake = Fake::start(encoding);
        fake.world().yaw_deg = 90.0;
        let (craft, facts) =
            AirSimCraft::connect_within(&fake.address, &AirSimSettings::default(), Instant::now(), Duration::ZERO).unwrap();
        assert_eq!((facts.encoding, facts.version, facts.flies), (encoding, Some(1), false));
        assert_eq!(facts.vehicles, ["Drone1", "Drone2"]);
        let camera = craft.capabilities().camera;
        assert_eq!(((camera.width, camera.height), (camera.cx, camera.cy)), (SIZE, (16.0, 9.0)));
        // By hand: 90° across 32 pixels is a focal length of 16 pixels; pixels are square; the craft looks where the camera looks.
        assert!((camera.fx - 16.0).abs() < 1e-9 && (camera.fy - 16.0).abs() < 1e-9 && camera.tilt.abs() < 1e-9, "{camera:?}");
        drop(craft);
        assert!(fake.world().calls.is_empty(), "it was only watched: {:?}", fake.world().calls);
    }
}

#[test]
fn a_flight_takes_off_flies_brakes_hovers_lands_and_gives_control_back() {
    at_once(BOTH, |encoding| {
        let fake = Fake::start(encoding);
        let mut flown = Flown::of(&fake);
        flown.take_off();
        assert_eq!(
            fake.world().calls.iter().map(|(method, _)| method.as_str()).take(3).collect::<Vec<_>>(),
            ["enableApiControl true", "armDisarm true", "takeoff"]
        );
        // A quarter turn a second at most, while it flies ahead: its north grows, then its east.
        let ahead = Setpoint { forward: 1.0, yaw_rate: 0.5, ..Setpoint::HOLD };
        flown.fly(&fake, ahead, "it flies ahead", |world| world.position[0] > 0.3 && world.yaw_deg > 5.0);
        let (_, numbers) = fake.world().calls.iter().rfind(|(method, _)| method == "moveByVelocityBodyFrame").unwrap().clone();
        assert_eq!(numbers[..5], [1.0, 0.0, 0.0, 0.25, 0.0]);
        assert!((numbers[5] - 0.5_f64.to_degrees()).abs() < 1e-9);
        // A zero, then a hover.
        flown.fly(&fake, Setpoint::HOLD, "it hovers", |world| world.calls.last().is_some_and(|(method, _)| method == "hover"));
        let calls = fake.world().calls.clone();
        assert_eq!(calls[calls.len() - 2].1[..3], [0.0; 3]);
        flown.apply(Command::Land);
        flown.until_phase(FlightPhase::OnGround);
        drop(flown);
        let world = fake.world();
        assert!(world.landed && !world.armed && !world.controlled);
        let end: Vec<&str> =
            world.calls.iter().map(|(method, _)| method.as_str()).skip_while(|method| *method != "land").collect();
        assert_eq!((end[0], end.last()), ("land", Some(&"enableApiControl false")));
    });
}

#[test]
fn a_program_that_ends_lands_the_craft_and_a_setpoint_that_is_not_renewed_brakes_it() {
    let fake = Fake::start(Encoding::Map);
    let mut flown = Flown::of(&fake);
    flown.take_off();
    flown.fly(&fake, Setpoint { forward: 1.0, ..Setpoint::HOLD }, "it moves", |world| world.position[0] > 0.1);
    // Nothing more is said, but the loop still polls.
    let begun = Instant::now();
    while fake.world().calls.last().is_none_or(|(method, _)| method != "hover") {
        flown.poll();
        assert!(begun.elapsed() < HANGS);
        std::thread::sleep(Duration::from_millis(10));
    }
    drop(flown);
    let world = fake.world();
    assert!(world.landed && !world.controlled, "{world:?}");
    let end: Vec<&str> = world.calls.iter().rev().take(5).map(|(method, _)| method.as_str()).collect();
    assert!(end.contains(&"hover") && end.contains(&"land"), "{end:?}");
}

#[test]
fn a_craft_in_the_air_is_taken_over_and_a_hold_ends_the_landing_that_the_pilot_began() {
    let fake = Fake::start(Encoding::Array);
    (fake.world().position, fake.world().landed) = ([0.0, 0.0, -10.0], false);
    let mut flown = Flown::of(&fake);
    flown.until_phase(FlightPhase::Flying);
    assert_eq!(fake.world().count("takeoff"), 0);
    flown.apply(Command::Land);
    flown.until_phase(FlightPhase::Landing);
    flown.apply(Command::Setpoint(Setpoint::HOLD));
    flown.until_phase(FlightPhase::Flying);
    drop(flown);
    assert!(fake.world().landed);
}

#[test]
fn an_image_is_red_where_it_is_red_and_one_that_was_not_rendered_anew_is_no_news() {
    let fake = Fake::start(Encoding::Map);
    let mut flown = connected(&fake, &AirSimSettings::default()).unwrap();
    let counters = |flown: &mut Flown, number: usize| {
        let mut found = Vec::new();
        flown.until("frames", |event| {
            if let DroneEvent::Frame(meta) = event {
                found.push((meta.capture_counter, meta.received.since(meta.captured)));
            }
            found.len() >= number
        });
        found
    };
    let fresh = counters(&mut flown, 3);
    assert!(fresh.windows(2).all(|pair| pair[1].0 > pair[0].0), "the same pixels, rendered anew: {fresh:?}");
    let (_, photo) = flown.craft.frames().newest().unwrap();
    assert_eq!((photo.pixels().pixel(0, 0), photo.pixels().pixel(31, 17)), (Some([0, 0, 255]), Some([255, 0, 0])));
    fake.world().faults.still = true;
    counters(&mut flown, 3);
    let frozen = counters(&mut flown, 3);
    assert!(frozen.windows(2).all(|pair| pair[1].0 == pair[0].0), "{frozen:?}");
}

#[test]
fn depth_comes_where_it_is_asked_for() {
    let fake = Fake::start(Encoding::Array);
    let settings = AirSimSettings { depth_sensor: true, ..AirSimSettings::default() };
    let mut flown = connected(&fake, &settings).unwrap();
    assert_eq!(flown.craft.capabilities().depth, Some(10.0));
    flown.until("depth", |event| {
        let DroneEvent::Depth(grid) = event else { return false };
        let near = grid.cm.iter().filter(|cm| (400..600).contains(*cm)).count();
        assert!(near * 10 > grid.cm.len() * 9 && (grid.camera.width, grid.camera.height) == SIZE);
        true
    });
}

#[test]
fn a_collision_in_flight_is_told_and_one_on_the_ground_is_not() {
    let fake = Fake::start(Encoding::Map);
    let mut flown = Flown::of(&fake);
    fake.world().faults.collided = true;
    fake.wait("it is read", |world| !world.faults.collided);
    flown.take_off();
    assert!(!flown.seen.iter().any(|event| matches!(event, DroneEvent::Telemetry(Telemetry { crashed: true, .. }))));
    fake.world().faults.collided = true;
    flown.until("the collision", |event| matches!(event, DroneEvent::Telemetry(Telemetry { crashed: true, .. })));
}

#[test]
fn a_pose_that_is_no_number_and_a_time_that_stands_still_are_no_reports() {
    at_once([Faults { nan: true, ..Faults::default() }, Faults { still: true, ..Faults::default() }], |fault| {
        let fake = Fake::start(Encoding::Map);
        let mut flown = Flown::of(&fake);
        flown.take_off();
        fake.world().faults = fault;
        flown.until("the link counts as lost", |event| matches!(event, DroneEvent::LinkLost));
        let from = flown.seen.len();
        flown.poll();
        assert!(!flown.seen[from..].iter().any(|event| matches!(event, DroneEvent::Telemetry(_))));
        let finite = |event: &DroneEvent| match event {
            DroneEvent::Telemetry(told) => told.position.is_none_or(|at| at.north.is_finite()),
            _ => true,
        };
        assert!(flown.seen.iter().all(finite));
        fake.world().faults = Faults::default();
        flown.until("the link is back", |event| matches!(event, DroneEvent::LinkRestored));
    });
}

#[test]
fn a_simulator_that_closes_and_comes_back_is_flown_on() {
    let fake = Fake::start(Encoding::Map);
    let mut flown = Flown::of(&fake);
    flown.take_off();
    fake.world().faults.closed = true;
    flown.until("the link is lost", |event| matches!(event, DroneEvent::LinkLost));
    fake.world().faults.closed = false;
    flown.until("the link is back", |event| matches!(event, DroneEvent::LinkRestored));
    fake.wait("its control is asked for again", |world| world.count("enableApiControl true") >= 2);
    flown.fly(&fake, Setpoint { forward: 1.0, ..Setpoint::HOLD }, "it moves", |world| world.position[0] > 0.1);
}

#[test]
fn control_that_another_program_takes_is_left_to_it_until_the_operator_resumes() {
    let fake = Fake::start(Encoding::Map);
    let mut flown = Flown::of(&fake);
    flown.take_off();
    // Beyond the time in which the simulator may still be giving it.
    let begun = Instant::now();
    while !flown.seen.iter().any(|event| matches!(event, DroneEvent::TakenOver)) {
        fake.world().controlled = false;
        flown.poll();
        assert!(begun.elapsed() < HANGS);
        std::thread::sleep(Duration::from_millis(10));
    }
    let before = fake.world().calls.len();
    flown.apply(Command::Setpoint(Setpoint { forward: 0.5, ..Setpoint::HOLD }));
    flown.apply(Command::Land);
    flown.until("it is not landed", |event| matches!(event, DroneEvent::NotLanded));
    assert_eq!(fake.world().calls.len(), before);
    flown.craft.resume(flown.now());
    flown.fly(&fake, Setpoint { forward: 0.5, ..Setpoint::HOLD }, "it is flown again", |world| {
        world.controlled && world.calls.len() > before + 2
    });
}

/// Why a connection fails, with its causes and the remedy.
fn refused(fake: &Fake, vehicle: &str) -> String {
    let address = Address { vehicle: vehicle.to_owned(), ..fake.address.clone() };
    let settings = AirSimSettings::default();
    let error = AirSimCraft::connect_within(&address, &settings, Instant::now(), Duration::ZERO).err().unwrap();
    let causes = core::iter::successors(std::error::Error::source(&error), |error| error.source());
    let text = causes.fold(error.to_string(), |text, cause| format!("{text}: {cause}"));
    format!("{text} ({})", error.hint().unwrap_or_default()).replace(&fake.address.server(), "SIM")
}

#[test]
fn what_is_missing_is_said_with_a_remedy() {
    let of = |faults: Faults| refused(&Fake::with(Encoding::Map, faults), "");
    let unknown = refused(&Fake::start(Encoding::Map), "Drone3");
    assert_eq!(
        unknown,
        "the simulator at SIM has no vehicle `Drone3`; it has `Drone1`, `Drone2` (name one of them, as --drone airsim@SIM/Drone1)"
    );
    let text = of(Faults { error: Some(("getMultirotorState", "not a multirotor")), ..Faults::default() });
    assert!(
        text.contains("tells no state") && text.contains("information: not a multirotor.") && text.contains("SimMode"),
        "{text}"
    );
    let text = of(Faults { no_image: Some("no such camera"), ..Faults::default() });
    assert!(text.starts_with("camera `0` shows nothing: no such camera (check Cameras"), "{text}");
    let text = of(Faults { short_image: true, ..Faults::default() });
    assert!(text.contains("32×18 pixels has 1727 bytes in the place of 1728"), "{text}");
    let text = of(Faults { error: Some(("simGetCameraInfo", "camera")), ..Faults::default() });
    assert!(text.contains("no camera `0` whose optics are known") && text.contains("airsim.camera"), "{text}");
    let text = of(Faults { nan: true, ..Faults::default() });
    assert!(text.contains("a pose that is no number") && text.contains("reset the simulator"), "{text}");
    let text = of(Faults { silent: Some("ping"), ..Faults::default() });
    assert!(text.contains("`ping` was not answered within 2 s") && text.contains("loading, or paused"), "{text}");
    assert!(of(Faults { closed: true, ..Faults::default() }).contains("has ended"));
    // A port that nothing is given by itself.
    let address = Address { port: 1, ..Address::default() };
    let error = Rpc::connect(&address).err().unwrap();
    assert!(matches!(error, RpcError::Unreachable { .. }), "{error:?}");
}

/// A peer that answers as it likes.
fn peer(answers: impl FnOnce(std::net::TcpStream) + Send + 'static) -> (Rpc, std::thread::JoinHandle<()>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = Address { port: listener.local_addr().unwrap().port(), ..Address::default() };
    let thread = std::thread::spawn(move || answers(listener.accept().unwrap().0));
    (Rpc::connect(&address).unwrap(), thread)
}

fn answer(id: u32, value: i64) -> Vec<u8> {
    Message::Response { id, outcome: Ok(Raw::of(&value, Encoding::Map)) }.encode()
}

#[test]
fn an_answer_that_comes_late_or_out_of_order_is_not_taken_for_another() {
    let (mut rpc, thread) = peer(|mut stream| {
        let mut buffer = [0; 256];
        // The first call is answered after the second.
        stream.read_exact(&mut buffer[..9]).unwrap();
        stream.read_exact(&mut buffer[..9]).unwrap();
        stream.write_all(&[answer(1, 11), answer(0, 10)].concat()).unwrap();
        stream.read_exact(&mut buffer[..9]).unwrap();
        stream.write_all(&answer(2, 12)).unwrap();
    });
    let mut call = |wait| rpc.call("ping", Vec::new(), Duration::from_millis(wait)).map(|raw| raw.read::<i64>().unwrap());
    assert!(matches!(call(50), Err(RpcError::TimedOut { .. })));
    assert_eq!((call(60_000).unwrap(), call(60_000).unwrap()), (11, 12));
    thread.join().unwrap();
}

#[test]
fn a_peer_that_speaks_otherwise_announces_gigabytes_or_nests_for_ever_is_refused() {
    // HTTP; an answer of 4 GB; a thousand arrays in one another.
    let announced = [&[0x94, 1, 0, 0xc0, 0xc6, 0xff, 0xff, 0xff, 0xff][..], &[0; 64]].concat();
    for bytes in [b"HTTP/1.1 400 Bad Request\r\n".to_vec(), announced, [&[0x94, 1, 0, 0xc0][..], &[0x91; 1000]].concat()] {
        let (mut rpc, thread) = peer(move |mut stream| {
            drop(stream.read(&mut [0; 64]));
            drop(stream.write_all(&bytes));
        });
        let error = rpc.call("ping", Vec::new(), HANGS).unwrap_err();
        assert!(matches!(error, RpcError::Frame { .. }), "{error:?}");
        thread.join().unwrap();
    }
}

/// What is reported until then in lockstep, as the flight loop asks for it.
fn stepped(craft: &mut LockstepCraft, envelope: &mut Envelope, until: Time) -> Vec<(Time, DroneEvent)> {
    let mut all = Vec::new();
    while let Some(at) = craft.next_event_at().filter(|at| *at <= until) {
        let Some((now, event)) = craft.next_event(at) else { continue };
        match &event {
            DroneEvent::Telemetry(told) => envelope.observe_telemetry(now, told),
            DroneEvent::Frame(meta) => envelope.observe_frame(now, meta),
            _ => {}
        }
        all.push((now, event));
    }
    all
}

/// A flight in lockstep: what was reported, and where it was before it landed.
fn flown_in_lockstep(encoding: Encoding, settings: &AirSimSettings) -> (Vec<(Time, DroneEvent)>, [f64; 3]) {
    let fake = Fake::start(encoding);
    let (mut craft, _) = LockstepCraft::connect_within(&fake.address, settings, Duration::ZERO).unwrap();
    let mut envelope = Envelope::new(Limits::for_craft(&Craft::quad()), Craft::quad());
    let from = fake.world().paused.expect("it is paused");
    let ms = Time::from_millis;
    let mut all = stepped(&mut craft, &mut envelope, ms(500));
    let mut command = |craft: &mut LockstepCraft, all: &mut Vec<_>, now: Time, command, until: Time| {
        let cleared = envelope.clear(now, command).unwrap().cleared;
        craft.apply(now, &cleared).unwrap();
        all.extend(stepped(craft, &mut envelope, until));
    };
    command(&mut craft, &mut all, ms(500), Command::TakeOff, ms(2000));
    for n in 20..40 {
        let ahead = Command::Setpoint(Setpoint { forward: 1.0, ..Setpoint::HOLD });
        command(&mut craft, &mut all, ms(100 * n), ahead, ms(100 * n + 100));
    }
    let place = fake.world().position;
    command(&mut craft, &mut all, ms(4000), Command::Land, ms(6000));
    // Its time is that of the flight, however long all this has taken.
    assert_eq!(fake.world().paused.unwrap() - from, Duration::from_millis(6000));
    drop(craft);
    let world = fake.world();
    assert!(world.landed && !world.armed && !world.controlled && world.paused.is_none());
    (all, place)
}

#[test]
fn in_lockstep_the_simulators_time_is_the_flights_and_a_flight_is_the_same_again() {
    at_once(BOTH, |encoding| {
        let settings = AirSimSettings { lockstep: true, depth_sensor: true, seed: 7, ..AirSimSettings::default() };
        let (all, place) = flown_in_lockstep(encoding, &settings);
        let times =
            |is: fn(&DroneEvent) -> bool| all.iter().filter(|(_, event)| is(event)).map(|(at, _)| *at).collect::<Vec<_>>();
        let told = times(|event| matches!(event, DroneEvent::Telemetry(_)));
        assert!((1..=120).all(|n| told.contains(&Time::from_millis(50 * n))), "{told:?}");
        let frames = times(|event| matches!(event, DroneEvent::Frame(_)));
        assert_eq!(frames, (1..=60).map(|n| Time::from_millis(100 * n)).collect::<Vec<_>>());
        assert_eq!(times(|event| matches!(event, DroneEvent::Depth(_))).len(), 60);
        // Two seconds at 1 m/s, less one step at most.
        assert!((1.9..=2.05).contains(&place[0]), "{place:?}");
        let (again, there) = flown_in_lockstep(encoding, &settings);
        assert_eq!((format!("{again:?}"), there), (format!("{all:?}"), place));
    });
}

#[test]
fn a_simulator_that_dies_in_lockstep_is_a_lost_link_and_nobody_waits_for_it() {
    let fake = Fake::start(Encoding::Map);
    let settings = AirSimSettings { lockstep: true, ..AirSimSettings::default() };
    let (mut craft, _) = LockstepCraft::connect_within(&fake.address, &settings, Duration::ZERO).unwrap();
    let mut envelope = Envelope::new(Limits::for_craft(&Craft::quad()), Craft::quad());
    stepped(&mut craft, &mut envelope, Time::from_millis(500));
    fake.world().faults.closed = true;
    let after = stepped(&mut craft, &mut envelope, Time::from_millis(5000));
    assert!(after.iter().any(|(_, event)| matches!(event, DroneEvent::LinkLost)), "{after:?}");
}

/// Images without pixels, and late ones, in flight: the frames stop, and come again.
#[test]
fn images_of_no_size_in_flight_are_no_frames() {
    at_once(BOTH, |encoding| {
        let fake = Fake::start(encoding);
        let mut flown = Flown::of(&fake);
        flown.take_off();
        fake.world().faults.no_image = Some("the renderer is busy");
        let still = |flown: &mut Flown| {
            let from = flown.seen.len();
            (0..20).for_each(|_| flown.until("telemetry", |event| matches!(event, DroneEvent::Telemetry(_))));
            flown.seen[from..].iter().filter(|event| matches!(event, DroneEvent::Frame(_))).count()
        };
        // One may have been under way.
        still(&mut flown);
        assert_eq!(still(&mut flown), 0);
        fake.world().faults.no_image = None;
        flown.until("a frame", |event| matches!(event, DroneEvent::Frame(_)));
    });
}

#[test]
fn a_simulator_that_hangs_in_lockstep_is_waited_for_once() {
    let fake = Fake::start(Encoding::Map);
    let settings = AirSimSettings { lockstep: true, ..AirSimSettings::default() };
    let (mut craft, _) = LockstepCraft::connect_within(&fake.address, &settings, Duration::ZERO).unwrap();
    let mut envelope = Envelope::new(Limits::for_craft(&Craft::quad()), Craft::quad());
    stepped(&mut craft, &mut envelope, Time::from_millis(500));
    fake.world().faults.silent = Some("ping");
    // Without an end of the waiting, each of the 20 steps of a second would take 2 s.
    let after = stepped(&mut craft, &mut envelope, Time::from_millis(600_000));
    assert!(after.iter().any(|(_, event)| matches!(event, DroneEvent::LinkLost)), "{after:?}");
}
