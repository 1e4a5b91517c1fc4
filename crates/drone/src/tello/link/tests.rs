//! State and messages of the link when lines are late, lost or repeated, or come from a drone in the air.

use spf_core::craft::Craft;
use spf_core::telemetry::Telemetry;
use spf_envelope::{Envelope, Limits};

use super::*;

const STEP: u64 = 10;

/// A link with its current time, its messages, and the values of the drone's next state line.
struct Bench {
    link: Link,
    now: u64,
    said: Vec<(u64, String)>,
    /// Whether lines arrive; those held back arrive at once when it is set again.
    online: bool,
    held_back: Vec<Vec<u8>>,
    motors_since: Option<u64>,
    height: i32,
    /// The first reported speed, dm/s.
    speed: i32,
    with_motor_time: bool,
    /// Whether commands reach the drone.
    hears: bool,
    serial: u64,
}

impl Bench {
    fn new() -> Self {
        Self {
            link: Link::new(Calibration::default()),
            now: 0,
            said: Vec::new(),
            online: true,
            held_back: Vec::new(),
            motors_since: None,
            height: 0,
            speed: 0,
            with_motor_time: true,
            hears: true,
            serial: 0,
        }
    }

    /// In the air at 80 cm, with its motors running and a pilot.
    fn flying() -> Self {
        let mut bench = Self { motors_since: Some(0), height: 80, ..Self::new() };
        bench.link.adopt(Time::ZERO);
        bench.run(3000, true);
        bench
    }

    fn time(&self) -> Time {
        Time::from_millis(self.now)
    }

    fn line(&mut self) -> Vec<u8> {
        self.serial += 1;
        let seconds = self.motors_since.map_or(3, |since| 4 + self.now.saturating_sub(since) / 1000);
        let time = if self.with_motor_time { format!("time:{seconds};") } else { String::new() };
        let (tof, height, speed, noise) = (10 + self.height, self.height, self.speed, self.serial);
        format!("pitch:0;roll:0;yaw:0;vgx:{speed};vgy:0;vgz:0;tof:{tof};h:{height};bat:80;{time}agz:-1000.{noise};").into_bytes()
    }

    /// Runs for some time, with or without calls of the pilot.
    fn run(&mut self, ms: u64, pilot: bool) {
        for _ in 0..ms / STEP {
            self.now += STEP;
            if pilot {
                self.link.heartbeat(self.time());
            }
            if self.now.is_multiple_of(100) {
                let line = self.line();
                self.held_back.push(line);
            }
            if self.online {
                for line in std::mem::take(&mut self.held_back) {
                    self.link.handle_state(self.time(), &line);
                }
            }
            while let Some(text) = self.link.poll(self.time()) {
                if self.hears && text == reach::QUESTION {
                    self.link.handle_answer(self.time(), b"80\r\n");
                }
                self.said.push((self.now, text));
            }
        }
    }

    fn apply(&mut self, command: Command) {
        let mut envelope = Envelope::new(Limits::for_craft(&Craft::tello()), Craft::tello());
        let telemetry = Telemetry { time: self.time(), battery: Some(0.8), ..Telemetry::default() };
        envelope.observe_telemetry(self.time(), &telemetry);
        let cleared = envelope.clear(self.time(), command).unwrap().cleared;
        self.link.apply(self.time(), &cleared);
    }

    fn count(&self, text: &str) -> usize {
        self.said.iter().filter(|(_, said)| said == text).count()
    }

    fn notices(&mut self) -> Vec<Notice> {
        std::iter::from_fn(|| self.link.take_notice()).collect()
    }
}

#[test]
fn lines_that_come_late_in_a_burst_end_no_flight() {
    for late in [900, 1300, 1900] {
        let mut bench = Bench::flying();
        for _ in 0..5 {
            bench.online = false;
            bench.run(late, true);
            bench.online = true;
            bench.run(1000, true);
        }
        assert_eq!(bench.link.phase, FlightPhase::Flying, "{late} ms");
        assert_eq!((bench.count("land"), bench.notices()), (0, Vec::new()), "{late} ms");
    }
}

#[test]
fn a_flight_is_over_only_after_land_was_sent_and_the_motors_were_reported_off() {
    let mut bench = Bench::flying();
    // The motors stop in flight, and it lies on the ground.
    (bench.motors_since, bench.height) = (None, 0);
    bench.run(2500, true);
    assert_eq!(bench.link.phase, FlightPhase::Landing);
    assert!(bench.count("land") >= 1, "{:?}", bench.said.last());
    assert_eq!(bench.notices(), [Notice::MotorsOff]);
    bench.run(2500, true);
    assert_eq!(bench.link.phase, FlightPhase::OnGround);
}

#[test]
fn a_land_lost_in_a_stall_is_repeated_until_the_motors_stop() {
    let mut bench = Bench::flying();
    bench.apply(Command::Land);
    bench.online = false;
    bench.run(4000, true);
    bench.online = true;
    // It still hovers: no `land` arrived.
    bench.run(5000, true);
    assert_eq!(bench.link.phase, FlightPhase::Landing);
    assert!(bench.count("land") >= 8, "{}", bench.count("land"));
    (bench.motors_since, bench.height) = (None, 0);
    bench.run(3000, true);
    assert_eq!(bench.link.phase, FlightPhase::OnGround);
}

#[test]
fn without_motor_time_a_hover_close_to_the_ground_is_no_landing() {
    let mut bench = Bench { with_motor_time: false, ..Bench::flying() };
    bench.height = 20;
    bench.apply(Command::Land);
    bench.run(6000, true);
    assert_eq!(bench.link.phase, FlightPhase::Landing);
    bench.height = 0;
    bench.run(4500, true);
    assert_eq!(bench.link.phase, FlightPhase::OnGround);
}

#[test]
fn landing_in_the_first_second_of_a_take_off_follows_the_drone_up_and_down() {
    let mut bench = Bench::new();
    bench.run(1000, true);
    bench.apply(Command::TakeOff);
    bench.run(500, true);
    assert_eq!(bench.count("takeoff"), 1);
    bench.apply(Command::Land);
    // The take-off is carried out before any `land` arrives.
    bench.run(800, true);
    bench.link.handle_answer(bench.time(), b"error Motor stop");
    (bench.motors_since, bench.height) = (Some(bench.now), 80);
    bench.run(4000, true);
    assert_eq!(bench.link.phase, FlightPhase::Landing, "the motors turn");
    assert!(bench.count("land") >= 4);
    (bench.motors_since, bench.height) = (None, 0);
    bench.run(3000, true);
    assert_eq!(bench.link.phase, FlightPhase::OnGround);
}

#[test]
fn a_line_that_is_repeated_unchanged_is_no_telemetry() {
    let mut bench = Bench::flying();
    let line = bench.line();
    while bench.link.take_event().is_some() {}
    for ms in (0..3000).step_by(100) {
        bench.link.handle_state(bench.time() + Duration::from_millis(ms), &line);
    }
    let reports = std::iter::from_fn(|| bench.link.take_event());
    let last = reports.filter(|(_, event)| matches!(event, DroneEvent::Telemetry(_))).last().unwrap().0;
    assert_eq!(last, bench.time() + Duration::from_millis(900));
}

#[test]
fn a_take_off_that_cannot_be_sent_in_two_seconds_is_never_sent() {
    let mut bench = Bench::new();
    bench.link.order(Order::quick("streamon"));
    bench.run(500, true);
    bench.apply(Command::TakeOff);
    bench.run(30_000, true);
    assert_eq!(bench.count("takeoff"), 0);
    assert_eq!(bench.link.phase, FlightPhase::OnGround);
    assert!(bench.notices().contains(&Notice::Unsaid { command: "takeoff".to_owned() }));
}

#[test]
fn a_lost_take_off_is_given_up_within_ten_seconds() {
    let mut bench = Bench::new();
    bench.run(1000, true);
    bench.apply(Command::TakeOff);
    bench.run(6500, true);
    // The response to `land` of a drone on the ground.
    assert!(bench.count("land") >= 1 && bench.notices().contains(&Notice::NoTakeOff));
    bench.run(2500, true);
    assert_eq!((bench.link.phase, bench.count("takeoff")), (FlightPhase::OnGround, 1));
}

#[test]
fn a_slow_take_off_whose_motors_turn_is_waited_for() {
    let mut bench = Bench::new();
    bench.run(1000, true);
    bench.apply(Command::TakeOff);
    bench.run(500, true);
    bench.motors_since = Some(bench.now);
    bench.run(8500, true);
    assert_eq!((bench.link.phase, bench.count("land")), (FlightPhase::TakingOff, 0));
}

#[test]
fn a_pilot_that_falls_silent_is_a_hold_after_two_seconds_and_a_landing_after_five() {
    let mut bench = Bench::flying();
    bench.apply(Command::Setpoint(Setpoint::HOLD));
    let silent = bench.now;
    bench.run(9000, false);
    assert_eq!(bench.notices(), [Notice::Unattended { landing: false }, Notice::Unattended { landing: true }]);
    let (at, _) = bench.said.iter().find(|(_, text)| text == "land").unwrap();
    assert!((5000..5200).contains(&(at - silent)), "{at}");
    assert_eq!(bench.said.iter().filter(|(at, text)| *at > silent + 5200 && text.starts_with("rc")).count(), 0);
    assert!(bench.count("land") >= 4, "repeated until the ground is seen");
}

#[test]
fn a_program_that_ends_in_the_air_sends_zero_three_times_and_lands() {
    let mut bench = Bench::flying();
    let begun = bench.now;
    bench.link.leave(bench.time());
    bench.run(200, false);
    let after: Vec<&str> = bench.said.iter().filter(|(at, _)| *at > begun).map(|(_, text)| text.as_str()).collect();
    assert!(after.starts_with(&["rc 0 0 0 0"; 3]) && after[3] == "land", "{after:?}");
    assert!(bench.link.is_airborne());
    (bench.motors_since, bench.height) = (None, 0);
    bench.run(2500, false);
    assert!(!bench.link.is_airborne());
}

#[test]
fn a_drone_found_in_the_air_is_flown_without_a_take_off_command() {
    let mut bench = Bench::flying();
    let phases: Vec<FlightPhase> = std::iter::from_fn(|| bench.link.take_event())
        .filter_map(|(_, event)| match event {
            DroneEvent::Telemetry(telemetry) => Some(telemetry.phase),
            _ => None,
        })
        .collect();
    assert!(phases.iter().all(|phase| *phase == FlightPhase::Flying) && !phases.is_empty());
    assert_eq!(bench.count("takeoff"), 0);
}

#[test]
fn a_failed_thread_lands_the_drone() {
    let mut bench = Bench::flying();
    bench.link.fail(bench.time());
    bench.run(500, true);
    assert_eq!((bench.count("land"), bench.link.phase), (1, FlightPhase::Landing));
}

#[test]
fn a_landing_of_the_pilot_ends_with_its_hold_and_no_other_setpoint() {
    let mut bench = Bench::flying();
    bench.apply(Command::Land);
    bench.run(500, true);
    assert_eq!((bench.link.phase, bench.count("land")), (FlightPhase::Landing, 1));
    bench.apply(Command::Setpoint(Setpoint::HOLD));
    bench.run(3000, true);
    assert_eq!(bench.link.phase, FlightPhase::Flying);
    assert_eq!(bench.count("land"), 1);
    assert!(bench.count("stop") >= 1 && !bench.notices().contains(&Notice::MotorsOff));
    // If the drone continues to descend, it is landed for good.
    (bench.motors_since, bench.height) = (None, 0);
    bench.run(3000, true);
    assert!(bench.count("land") >= 2 && bench.notices().contains(&Notice::MotorsOff));
}

/// The pilot sends setpoints until telemetry reports that its craft lands.
#[test]
fn a_landing_of_the_driver_is_not_ended_by_setpoints() {
    for begin in [Link::leave, Link::fail] {
        let mut bench = Bench::flying();
        let now = bench.time();
        begin(&mut bench.link, now);
        for _ in 0..20 {
            bench.apply(Command::Setpoint(Setpoint::HOLD));
            bench.run(100, true);
        }
        assert_eq!(bench.link.phase, FlightPhase::Landing);
        assert!(bench.count("land") >= 2);
    }
}

#[test]
fn emergency_is_repeated_until_the_motors_are_seen_off() {
    let mut bench = Bench::flying();
    bench.apply(Command::EmergencyStop);
    bench.run(1000, true);
    assert!(bench.count("emergency") >= 7 && bench.link.is_urgent(), "{}", bench.count("emergency"));
    (bench.motors_since, bench.height) = (None, 0);
    bench.run(2500, true);
    assert!(!bench.link.is_urgent());
    let sent = bench.count("emergency");
    bench.run(5000, true);
    assert_eq!(bench.count("emergency"), sent);
    // Not for ever: a drone that was picked up and started again is left alone.
    let mut bench = Bench::flying();
    bench.apply(Command::EmergencyStop);
    bench.run(20_000, true);
    assert!(!bench.link.is_urgent() && bench.count("emergency") <= 28, "{}", bench.count("emergency"));
}

#[test]
fn a_request_for_a_key_frame_delays_no_setpoint_and_no_landing() {
    let mut bench = Bench::flying();
    bench.apply(Command::Setpoint(Setpoint { forward: 0.5, ..Setpoint::HOLD }));
    bench.said.clear();
    for _ in 0..20 {
        bench.link.ask_for_key_frame();
        bench.run(100, true);
    }
    assert_eq!(bench.count("streamon"), 20);
    let sticks: Vec<u64> = bench.said.iter().filter(|(_, text)| text.starts_with("rc ")).map(|(at, _)| *at).collect();
    assert!(sticks.len() >= 20 && sticks.windows(2).all(|pair| pair[1] - pair[0] <= 100), "{sticks:?}");
    bench.apply(Command::Land);
    bench.said.clear();
    bench.link.ask_for_key_frame();
    bench.run(300, true);
    assert!(bench.count("land") == 1 && bench.count("streamon") == 0, "{:?}", bench.said);
}

/// Its state arrives, and what is said to it does not: a Tello flies on at its last velocity, and only its answers tell.
#[test]
fn a_drone_that_answers_nothing_while_its_state_arrives_is_a_lost_link() {
    let mut bench = Bench::flying();
    let link_events = |bench: &mut Bench| {
        let events = std::iter::from_fn(|| bench.link.take_event());
        events.filter(|(_, event)| !matches!(event, DroneEvent::Telemetry(_))).collect::<Vec<_>>()
    };
    bench.run(20_000, true);
    assert_eq!(link_events(&mut bench), [], "it answers");
    bench.hears = false;
    bench.run(3000, true);
    assert_eq!(link_events(&mut bench), []);
    bench.run(600, true);
    let lost = link_events(&mut bench);
    assert!(matches!(lost[..], [(_, DroneEvent::LinkLost)]), "{lost:?}");
    assert_eq!(bench.notices(), [Notice::Unheard]);
    // It is asked on, and any answer ends the loss.
    bench.hears = true;
    bench.run(600, true);
    let restored = link_events(&mut bench);
    assert!(matches!(restored[..], [(_, DroneEvent::LinkRestored)]), "{restored:?}");
    // A landing needs no answers to be repeated.
    bench.apply(Command::Land);
    bench.hears = false;
    bench.run(10_000, true);
    assert!(bench.count("land") >= 9 && link_events(&mut bench).is_empty());
}

/// An answer may be late, or repeated by the network: as long as the state shows a drone in the air, it is told to land.
#[test]
fn an_answer_that_the_motors_are_off_ends_no_flight_while_the_state_shows_height() {
    let mut bench = Bench::flying();
    bench.apply(Command::Land);
    bench.run(500, true);
    bench.link.handle_answer(bench.time(), b"error Motor stop");
    bench.run(3000, true);
    assert_eq!((bench.link.phase, bench.count("land")), (FlightPhase::Landing, 4));
    (bench.motors_since, bench.height) = (None, 0);
    bench.run(500, true);
    bench.link.handle_answer(bench.time(), b"error Motor stop");
    assert_eq!(bench.link.phase, FlightPhase::OnGround);
}

/// A state line that shows the ground may be late, repeated or forged: with such an answer it ends no flight either, as long
/// as other lines show height.
#[test]
fn an_answer_that_the_motors_are_off_ends_no_flight_after_a_single_line_that_shows_the_ground() {
    let mut bench = Bench::flying();
    bench.apply(Command::Land);
    for _ in 0..30 {
        bench.run(100, true);
        let flown = (bench.motors_since.take(), std::mem::take(&mut bench.height));
        let line = bench.line();
        (bench.motors_since, bench.height) = flown;
        bench.link.handle_state(bench.time(), &line);
        bench.link.handle_answer(bench.time(), b"error Motor stop");
    }
    assert_eq!((bench.link.phase, bench.count("land")), (FlightPhase::Landing, 3));
}

/// In the dark a Tello that is flown by `rc` measures no speed: its position cannot be reckoned, and no limit on it holds.
#[test]
fn a_drone_that_reports_no_speed_while_it_is_told_to_fly_is_an_imu_error() {
    let mut bench = Bench::flying();
    let is_error = |bench: &Bench| bench.link.telemetry(bench.time()).imu_error;
    bench.link.tell(bench.time(), Setpoint { forward: 0.5, ..Setpoint::HOLD }, Time::MAX);
    for second in 1..7 {
        bench.run(1000, true);
        // 2 m at 0.5 m/s, and the response of the drone.
        assert_eq!(is_error(&bench), second > 4, "{second} s");
    }
    // Landing is no flight by commanded speeds.
    let mut bench = Bench::flying();
    bench.link.tell(bench.time(), Setpoint { forward: 0.5, ..Setpoint::HOLD }, Time::MAX);
    bench.run(1000, true);
    bench.apply(Command::Land);
    bench.run(8000, true);
    assert!(!is_error(&bench));
}

/// Between the zeros and `land` such an answer belongs to something else.
#[test]
fn an_answer_that_the_motors_are_off_ends_no_flight_before_land_was_sent() {
    let mut bench = Bench::flying();
    bench.height = 0;
    bench.run(200, true);
    bench.apply(Command::Land);
    bench.link.handle_answer(bench.time(), b"error Motor stop");
    assert_eq!((bench.link.phase, bench.count("land")), (FlightPhase::Landing, 0));
    bench.run(500, true);
    assert_eq!(bench.count("land"), 1);
    bench.link.handle_answer(bench.time(), b"error Motor stop");
    assert_eq!(bench.link.phase, FlightPhase::OnGround);
}

#[test]
fn a_drone_that_flies_on_while_it_is_told_to_stand_is_an_imu_error() {
    let mut bench = Bench::flying();
    let is_error = |bench: &Bench| bench.link.telemetry(bench.time()).imu_error;
    bench.link.tell(bench.time(), Setpoint { forward: 0.5, ..Setpoint::HOLD }, Time::MAX);
    bench.speed = 4;
    bench.run(20_000, true);
    assert!(!is_error(&bench), "told to");
    bench.apply(Command::Setpoint(Setpoint::HOLD));
    bench.run(2500, true);
    assert!(!is_error(&bench), "it comes to rest");
    bench.run(2500, true);
    assert!(is_error(&bench) && bench.notices() == [Notice::Motion(MotionFault::Adrift)]);
    // The pilot holds no longer, and nothing is said to keep it in the air.
    bench.apply(Command::Land);
    let asked = bench.count(reach::QUESTION);
    bench.run(3000, true);
    assert_eq!(bench.count(reach::QUESTION), asked);
}

/// The direction of the reported speed follows from the commands, and must not be that of a setpoint that has ended.
#[test]
fn whatever_ends_a_setpoint_the_reported_velocity_loses_its_direction() {
    let expires = |_: &mut Bench| {};
    let lands = |bench: &mut Bench| bench.apply(Command::Land);
    let fails = |bench: &mut Bench| bench.link.fail(bench.time());
    for (name, end) in [("expiry", expires as fn(&mut Bench)), ("landing", lands), ("failure", fails)] {
        let mut bench = Bench::flying();
        bench.speed = 3;
        // Valid for 2 s, unless something ends it sooner.
        let valid = if name == "expiry" { 2000 } else { 60_000 };
        bench.link.tell(bench.time(), Setpoint { forward: 0.4, ..Setpoint::HOLD }, bench.time() + Duration::from_millis(valid));
        bench.run(2000, true);
        let velocity = |bench: &Bench| bench.link.telemetry(bench.time()).velocity.unwrap();
        assert!((velocity(&bench).north - 0.3).abs() < 0.01, "{name}: {:?}", velocity(&bench));
        end(&mut bench);
        // Its dead time, and three times its lag.
        bench.run(1500, true);
        assert!(velocity(&bench).north.abs() < 1e-9, "{name}: {:?}", velocity(&bench));
    }
}
