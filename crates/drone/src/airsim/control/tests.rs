//! The logic on a clock of its own.

use spf_core::craft::Craft;
use spf_envelope::{Envelope, Limits};

use super::*;

fn ms(ms: u64) -> Time {
    Time::from_millis(ms)
}

/// A vehicle whose reports and answers are made by the test.
struct Bench {
    control: Control,
    now: u64,
    seen: Seen,
    sent: Vec<(u64, Request)>,
    /// Whether velocities and hovers are answered.
    answers: bool,
}

impl Bench {
    fn new(height: f64) -> Self {
        let seen = Seen { at: ms(0), height, speed: 0.0, landed: height == 0.0 };
        let mut bench = Self { control: Control::new(ms(0)), now: 0, seen, sent: Vec::new(), answers: true };
        bench.run(50, true);
        bench
    }

    /// In the air.
    fn flying() -> Self {
        let mut bench = Self::new(5.0);
        assert!(bench.control.engage(ms(bench.now)));
        bench.run(1000, true);
        bench
    }

    fn run(&mut self, length: u64, pilot: bool) {
        for _ in 0..length / 10 {
            self.now += 10;
            let now = ms(self.now);
            if pilot {
                self.control.heartbeat(now);
            }
            if self.now.is_multiple_of(50) {
                self.seen.at = now;
                self.control.handle_report(now, self.seen, Telemetry { time: now, ..Telemetry::default() });
            }
            self.control.tick(now);
            while let Some((number, request)) = self.control.poll(now) {
                self.sent.push((self.now, request));
                if self.answers && !matches!(request, Request::TakeOff | Request::Land) {
                    self.control.handle_answer(now, number, Ok(true));
                }
            }
        }
    }

    fn apply(&mut self, command: Command) {
        let now = ms(self.now);
        let mut envelope = Envelope::new(Limits::for_craft(&Craft::quad()), Craft::quad());
        let phase = self.control.phase();
        let height = Some(self.seen.height);
        envelope.observe_telemetry(now, &Telemetry { time: now, phase, height, ..Telemetry::default() });
        let frame = spf_core::frame::FrameMeta {
            id: spf_core::frame::FrameId(0),
            captured: now,
            received: now,
            capture_counter: self.now,
            width: 8,
            height: 8,
            unusable: None,
        };
        envelope.observe_frame(now, &frame);
        let cleared = envelope.clear(now, command).unwrap().cleared;
        self.control.apply(now, &cleared);
    }

    fn answer_last(&mut self, answer: Result<bool, String>) {
        let number = self.control.number - 1;
        self.control.handle_answer(ms(self.now), number, answer);
    }

    fn requests(&self, from: u64) -> Vec<Request> {
        self.sent.iter().filter(|(at, _)| *at >= from).map(|(_, request)| *request).collect()
    }

    fn notices(&mut self) -> Vec<Notice> {
        std::iter::from_fn(|| self.control.take_notice()).collect()
    }
}

const ZERO: Request = Request::Fly([0.0; 4]);

#[test]
fn a_velocity_is_sent_every_50_ms_until_it_expires_and_then_zero_until_it_rests() {
    let mut bench = Bench::flying();
    let from = bench.now + 1;
    bench.seen.speed = 1.0;
    bench.apply(Command::Setpoint(Setpoint { forward: 1.0, up: 0.5, ..Setpoint::HOLD }));
    bench.run(1000, true);
    let flown: Vec<u64> = bench
        .sent
        .iter()
        .filter(|(at, request)| *at >= from && *request == Request::Fly([1.0, 0.0, -0.5, 0.0]))
        .map(|(at, _)| *at)
        .collect();
    // The validity of a setpoint is 0.5 s.
    assert_eq!((flown.len(), flown[9] - flown[0]), (10, 450));
    let after = bench.requests(flown[9] + 1);
    assert!(!after.is_empty() && after.iter().all(|request| *request == ZERO), "as long as it moves: {after:?}");
    bench.seen.speed = 0.1;
    bench.run(200, true);
    assert_eq!(bench.sent.last().unwrap().1, Request::Hover);
    let sent = bench.sent.len();
    bench.run(1000, true);
    assert_eq!(bench.sent.len(), sent, "a hover is said once");
}

#[test]
fn a_craft_that_reports_motion_for_ever_hovers_after_3_s() {
    let mut bench = Bench::flying();
    bench.seen.speed = 1.0;
    bench.apply(Command::Setpoint(Setpoint { forward: 1.0, ..Setpoint::HOLD }));
    bench.run(4000, true);
    assert_eq!(bench.sent.last().unwrap().1, Request::Hover);
}

#[test]
fn without_the_pilot_it_hovers_after_2_s_and_lands_after_5() {
    let mut bench = Bench::flying();
    let from = bench.now;
    bench.run(4900, false);
    assert_eq!((bench.control.phase(), bench.notices()), (FlightPhase::Flying, vec![Notice::Unattended { landing: false }]));
    bench.run(600, false);
    assert_eq!(bench.control.phase(), FlightPhase::Landing);
    let requests = bench.requests(from);
    assert_eq!(requests[requests.len() - 2..], [Request::Hover, Request::Land]);
    // The pilot's hold does not end it.
    bench.apply(Command::Setpoint(Setpoint::HOLD));
    bench.run(100, true);
    assert_eq!(bench.control.phase(), FlightPhase::Landing);
}

#[test]
fn a_landing_that_ends_in_the_air_is_commanded_again() {
    let mut bench = Bench::flying();
    bench.apply(Command::Land);
    bench.run(1000, true);
    for answer in [Ok(false), Err("no".to_owned())] {
        assert_eq!(bench.sent.last().unwrap().1, Request::Land);
        bench.answer_last(answer);
        let sent = bench.sent.len();
        bench.run(900, true);
        assert_eq!(bench.sent.len(), sent);
        bench.run(200, true);
    }
    bench.answer_last(Ok(true));
    // Its word alone is not enough: it still sinks.
    for height in [1.5, 1.0, 0.5, 0.0] {
        bench.seen.height = height;
        bench.run(500, true);
        assert_eq!(bench.control.phase(), FlightPhase::Landing);
    }
    bench.run(1100, true);
    assert_eq!((bench.control.phase(), bench.sent.last().unwrap().1), (FlightPhase::OnGround, Request::Arm(false)));
}

#[test]
fn a_report_that_it_has_landed_ends_a_landing_without_an_answer() {
    let mut bench = Bench::flying();
    bench.apply(Command::Land);
    bench.run(1000, true);
    (bench.seen.landed, bench.seen.height) = (true, 0.0);
    bench.run(900, true);
    assert_eq!(bench.control.phase(), FlightPhase::Landing);
    bench.run(300, true);
    assert_eq!(bench.control.phase(), FlightPhase::OnGround);
}

#[test]
fn a_take_off_without_an_answer_is_judged_by_its_height() {
    for (height, phase) in [(2.0, FlightPhase::Flying), (0.0, FlightPhase::OnGround)] {
        let mut bench = Bench::new(0.0);
        assert!(!bench.control.engage(ms(bench.now)));
        bench.apply(Command::TakeOff);
        bench.run(100, true);
        (bench.seen.height, bench.seen.landed) = (height, height == 0.0);
        bench.run(24_500, true);
        assert_eq!(bench.control.phase(), FlightPhase::TakingOff);
        bench.run(2500, true);
        assert_eq!(bench.control.phase(), phase);
    }
}

/// The simulator wants a craft that rests.
#[test]
fn a_take_off_that_is_refused_is_asked_for_again_and_then_given_up() {
    for (refused, phase) in [(2, FlightPhase::Flying), (3, FlightPhase::OnGround)] {
        let mut bench = Bench::new(0.0);
        bench.control.engage(ms(bench.now));
        bench.apply(Command::TakeOff);
        bench.run(100, true);
        for _ in 0..refused {
            assert_eq!((bench.control.phase(), bench.sent.last().unwrap().1), (FlightPhase::TakingOff, Request::TakeOff));
            bench.answer_last(Err("speed".to_owned()));
            bench.run(1100, true);
        }
        if phase == FlightPhase::Flying {
            bench.answer_last(Ok(true));
        }
        assert_eq!(bench.control.phase(), phase);
        // Said once, not each time.
        assert_eq!(bench.notices(), [Notice::Refused { what: "the take-off", why: "speed".to_owned() }]);
    }
}

#[test]
fn arming_that_is_refused_ends_the_take_off() {
    let mut bench = Bench::new(0.0);
    bench.control.engage(ms(bench.now));
    bench.run(10, true);
    bench.answers = false;
    bench.apply(Command::TakeOff);
    let (number, request) = bench.control.poll(ms(bench.now)).unwrap();
    assert_eq!(request, Request::Arm(true));
    bench.control.handle_answer(ms(bench.now), number, Ok(false));
    bench.run(100, true);
    assert_eq!(bench.control.phase(), FlightPhase::OnGround);
    assert!(!bench.sent.iter().any(|(_, request)| *request == Request::TakeOff), "{:?}", bench.sent);
    assert!(matches!(bench.notices()[..], [Notice::Refused { what: "arming", .. }]));
}

#[test]
fn the_motors_are_cut_whatever_it_does() {
    let mut bench = Bench::flying();
    bench.apply(Command::EmergencyStop);
    let from = bench.now + 1;
    bench.apply(Command::Setpoint(Setpoint { forward: 1.0, ..Setpoint::HOLD }));
    bench.run(1000, true);
    assert_eq!((bench.requests(from), bench.control.phase()), (vec![Request::Arm(false); 3], FlightPhase::Stopped));
    assert!(!bench.control.is_airborne());
}

#[test]
fn reports_and_calls_without_answers_fill_no_memory() {
    let mut bench = Bench::flying();
    bench.answers = false;
    for _ in 0..200 {
        bench.apply(Command::Setpoint(Setpoint { forward: 1.0, ..Setpoint::HOLD }));
        bench.run(500, true);
    }
    assert!(bench.control.open.len() <= MOST_OPEN && bench.control.events.len() <= EVENTS + 2);
    let lost = std::iter::from_fn(|| bench.control.take_event()).filter(|(_, event)| *event == DroneEvent::LinkLost).count();
    assert_eq!(lost, 1);
}

/// The craft rests at a start that is no landing: whoever gives control back does not fly.
#[test]
fn control_is_given_back_once_and_only_where_it_was_taken() {
    let mut bench = Bench::new(0.0);
    bench.control.part();
    bench.run(100, true);
    assert!(bench.sent.is_empty());
    let mut bench = Bench::new(0.0);
    bench.control.engage(ms(bench.now));
    bench.run(100, true);
    bench.control.part();
    bench.control.part();
    bench.run(100, true);
    let all: Vec<Request> = bench.requests(0);
    assert_eq!(all, [Request::Control(true), Request::Arm(false), Request::Control(false)]);
    assert!(bench.control.is_settled());
}
