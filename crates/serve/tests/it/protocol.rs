//! The virtual Tello's protocol in virtual time: its answers, their timing, and its flight.

use std::net::SocketAddr;

use proptest::prelude::*;
use spf_core::geometry::{EnuPosition, wrap_angle};
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time};
use spf_serve::fault::{CraftFault, CraftFaultRule, Fault, FaultMachine, FaultPlan, Rule, Stream};
use spf_serve::tello::command::{Malformed, parse};
use spf_serve::tello::{Firmware, Output, ProtocolParameters, VirtualTello};
use spf_sim::craft::SimCraft;
use spf_sim::dynamics::SimConditions;
use spf_sim::model::Model;

use crate::boxes::{at, facing, scene};

const CLIENT: ([u8; 4], u16) = ([192, 168, 10, 2], 40_000);

/// A client and a Tello, connected only by virtual time.
struct Bench {
    craft: SimCraft,
    tello: VirtualTello,
    now: Time,
    /// Answers with their times.
    answers: Vec<(Time, String)>,
    states: Vec<(Time, String)>,
}

impl Bench {
    fn with(figures: ProtocolParameters, firmware: Firmware, battery: f64, faults: FaultPlan) -> Self {
        let conditions = SimConditions { exact: true, battery, ..SimConditions::new(1) };
        let craft = SimCraft::with_conditions(scene(), Model::tello(), facing(at(0.0, 0.0, 0.0), 0.0), conditions);
        let tello = VirtualTello::new(&craft, figures, firmware, FaultMachine::new(faults, 1).unwrap(), 1);
        Self { craft, tello, now: Time::ZERO, answers: Vec::new(), states: Vec::new() }
    }

    fn new() -> Self {
        Self::with(ProtocolParameters::exact(), Firmware::V20, 1.0, FaultPlan::default())
    }

    /// In SDK mode and in the air.
    fn flying() -> Self {
        let mut bench = Self::new();
        bench.ask("command");
        assert_eq!(bench.ask("takeoff").0, "ok");
        bench
    }

    fn client() -> SocketAddr {
        SocketAddr::from(CLIENT)
    }

    fn say(&mut self, command: &str) {
        self.tello.handle(self.now, Self::client(), command.as_bytes());
    }

    fn wait(&mut self, seconds: f64) {
        let until = self.now + Duration::from_secs_f64(seconds);
        while self.now < until {
            self.now = self.tello.next_deadline().max(self.now + Duration::from_millis(1)).min(until);
            self.tello.advance(self.now, &mut self.craft);
            while let Some(output) = self.tello.poll(self.now) {
                match output {
                    Output::Response { to, bytes } => {
                        assert_eq!(to, Self::client());
                        self.answers.push((self.now, String::from_utf8_lossy(&bytes).into_owned()));
                    }
                    Output::State { to, bytes } => {
                        assert_eq!(to, SocketAddr::from((CLIENT.0, 8890)));
                        self.states.push((self.now, String::from_utf8_lossy(&bytes).into_owned()));
                    }
                }
            }
        }
    }

    /// The next answer to a command, and its latency; within 40 s.
    fn ask(&mut self, command: &str) -> (String, f64) {
        let (requested, before) = (self.now, self.answers.len());
        self.say(command);
        while self.answers.len() == before {
            assert!(self.now.since(requested) < Duration::from_secs(40), "no answer to `{command}`");
            self.wait(0.005);
        }
        let (at, text) = self.answers[before].clone();
        (text, at.since(requested).as_secs_f64())
    }

    fn place(&self) -> EnuPosition {
        self.craft.dynamics().pose().position
    }

    fn heading_deg(&self) -> f64 {
        self.craft.dynamics().pose().attitude.heading.to_degrees()
    }

    fn phase(&self) -> FlightPhase {
        self.craft.dynamics().phase()
    }

    fn field(&self, name: &str) -> String {
        let (_, line) = self.states.last().unwrap();
        let field = line.trim_end().split(';').find_map(|field| field.strip_prefix(name)?.strip_prefix(':'));
        field.unwrap_or_else(|| panic!("{name} in {line}")).to_owned()
    }
}

fn trouble(fault: CraftFault, from: f64, until: Option<f64>) -> FaultPlan {
    FaultPlan { craft: vec![CraftFaultRule { fault, from, until }], ..FaultPlan::default() }
}

#[test]
fn before_sdk_mode_it_is_silent() {
    let mut bench = Bench::new();
    for command in ["takeoff", "battery?", "nonsense", "rc 0 0 0 0"] {
        bench.say(command);
    }
    bench.wait(2.0);
    assert!(bench.answers.is_empty() && bench.states.is_empty() && bench.phase() == FlightPhase::OnGround);
}

/// The times of the reference's table.
#[test]
fn answers_come_when_the_manoeuvre_ends() {
    let mut bench = Bench::with(ProtocolParameters::default(), Firmware::V30, 1.0, FaultPlan::default());
    let mut within = |command: &str, answer: &str, low: f64, high: f64| {
        let (text, took) = bench.ask(command);
        assert!(text.starts_with(answer) && (low..=high).contains(&took), "{command}: `{text}` after {took:.3} s");
        bench.wait(0.2);
    };
    for quick in ["command", "speed 50", "speed 100", "mon", "mdirection 2", "moff", "setfps high", "setbitrate 5", "streamon"] {
        within(quick, "ok", 0.015, 0.052);
    }
    within("battery?", "100\r\n", 0.015, 0.065);
    within("sdk?", "30\r\n", 0.015, 0.065);
    within("forward 100", "error Motor stop", 0.043, 0.052);
    within("land", "error Motor stop", 0.043, 0.052);
    within("takeoff", "ok", 3.5, 4.5);
    within("forward 501", "out of range", 0.043, 0.052);
    within("forward 100", "ok", 1.7, 3.2);
    within("back 20", "ok", 0.6, 2.0);
    within("cw 90", "ok", 1.2, 2.5);
    within("ccw 360", "ok", 4.0, 6.0);
    within("up 50", "ok", 1.0, 2.7);
    within("go 100 0 0 50", "ok", 2.0, 3.8);
    within("curve 100 100 0 0 200 0 60", "ok", 5.0, 8.0);
    within("go 50 0 50 50 m1", "error No valid marker", 0.043, 0.052);
    // From 1.3 m: sinking at 0.5 m/s after the dead time.
    within("land", "ok", 2.0, 4.0);
}

#[test]
fn moves_end_where_commanded() {
    // Right, forward, up in metres and clockwise degrees, from heading north.
    let moves: [(&str, [f64; 4]); 11] = [
        ("forward 120", [0.0, 1.2, 0.0, 0.0]),
        ("back 50", [0.0, -0.5, 0.0, 0.0]),
        ("left 80", [-0.8, 0.0, 0.0, 0.0]),
        ("right 200", [2.0, 0.0, 0.0, 0.0]),
        ("up 60", [0.0, 0.0, 0.6, 0.0]),
        ("down 30", [0.0, 0.0, -0.3, 0.0]),
        ("cw 45", [0.0, 0.0, 0.0, 45.0]),
        ("ccw 300", [0.0, 0.0, 0.0, 60.0]),
        ("go 100 50 40 60", [-0.5, 1.0, 0.4, 0.0]),
        ("curve 100 100 0 0 200 0 40", [-2.0, 0.0, 0.0, 0.0]),
        ("flip r", [0.3, 0.0, 0.0, 0.0]),
    ];
    for (command, [right, forward, up, clockwise]) in moves {
        let mut bench = Bench::flying();
        let before = bench.place();
        assert_eq!(bench.ask(command).0, "ok", "{command}");
        let after = bench.place();
        let missed = EnuPosition { east: before.east + right, north: before.north + forward, up: before.up + up }.distance(after);
        let turned = wrap_angle((bench.heading_deg() - clockwise).to_radians()).to_degrees();
        assert!(missed < 0.06 && turned.abs() < 2.5, "{command}: off by {missed:.3} m and {turned:.1}°");
        assert!(bench.craft.dynamics().velocity().speed() < 0.05, "{command}: at rest when answered");
    }
}

#[test]
fn moves_spread_as_a_real_craft_s_do() {
    let mut bench = Bench::with(ProtocolParameters::default(), Firmware::V20, 1.0, FaultPlan::default());
    bench.ask("command");
    bench.ask("takeoff");
    let errors: Vec<f64> = (0..40)
        .map(|index| {
            let before = bench.place();
            assert_eq!(bench.ask(if index % 2 == 0 { "forward 100" } else { "back 100" }).0, "ok");
            before.distance(bench.place()) - 1.0
        })
        .collect();
    let spread = (errors.iter().map(|error| error * error).sum::<f64>() / 40.0).sqrt();
    // 5 % and 5 cm of a metre: 7 cm.
    assert!((0.04..0.11).contains(&spread), "{spread}");
}

#[test]
fn sticks_hold_until_replaced() {
    let mut bench = Bench::flying();
    bench.say("rc 0 50 0 0");
    bench.wait(8.0);
    let north = bench.place().north;
    assert!((3.4..4.2).contains(&north), "half a metre a second for 8 s less the dead time: {north}");
    bench.say("rc 0 0 0 100");
    bench.wait(2.0);
    let turned = bench.heading_deg();
    assert!((130.0..165.0).contains(&turned), "95 degrees a second: {turned}");
    bench.say("rc 0 0 0 0");
    bench.wait(1.5);
    let before = bench.place();
    bench.wait(3.0);
    assert!(before.distance(bench.place()) < 0.02);
    assert_eq!(bench.answers.len(), 2, "rc is never answered");
}

#[test]
fn sticks_do_nothing_on_the_ground_and_during_a_manoeuvre() {
    let mut bench = Bench::new();
    bench.ask("command");
    bench.say("rc 0 100 100 0");
    bench.wait(2.0);
    assert_eq!((bench.phase(), bench.place().north), (FlightPhase::OnGround, 0.0));
    bench.ask("takeoff");
    bench.say("up 50");
    bench.wait(0.1);
    bench.say("rc 0 100 0 0");
    bench.wait(4.0);
    assert!(bench.place().north.abs() < 0.02, "{}", bench.place().north);
}

#[test]
fn silence_lands_it_after_15_s_and_rc_does_not() {
    let mut bench = Bench::flying();
    for _ in 0..40 {
        bench.say("rc 0 0 0 0");
        bench.wait(0.5);
    }
    assert_eq!(bench.phase(), FlightPhase::Flying);
    bench.wait(14.4);
    assert_eq!(bench.phase(), FlightPhase::Flying);
    bench.wait(1.2);
    assert_eq!(bench.phase(), FlightPhase::Landing);
    assert_eq!(bench.ask("forward 50").0, "error Auto land");
    bench.wait(3.0);
    assert_eq!(bench.ask("forward 50").0, "error Motor stop");
}

#[test]
fn one_manoeuvre_at_a_time_and_stop_ends_it() {
    let mut bench = Bench::flying();
    bench.say("forward 400");
    bench.wait(1.0);
    assert_eq!(bench.ask("left 50").0, "error Not joystick");
    assert_eq!(bench.ask("stop").0, "ok");
    bench.wait(3.0);
    assert_eq!(bench.answers.last().unwrap().1, "forced stop");
    assert!(bench.place().north < 2.0 && bench.craft.dynamics().velocity().speed() < 0.02);
    assert_eq!(bench.ask("back 20").0, "ok");
}

#[test]
fn emergency_cuts_the_motors_without_an_answer() {
    let mut bench = Bench::flying();
    let answers = bench.answers.len();
    bench.say("emergency");
    bench.wait(1.0);
    assert_eq!((bench.phase(), bench.answers.len()), (FlightPhase::Stopped, answers));
    assert_eq!(bench.ask("forward 50").0, "error Motor stop");
}

#[test]
fn the_battery_decides_about_flips_and_take_off() {
    let mut bench = Bench::with(ProtocolParameters::exact(), Firmware::V20, 0.45, FaultPlan::default());
    bench.ask("command");
    bench.ask("takeoff");
    assert_eq!(bench.ask("flip l").0, "error");
    let mut flat = Bench::with(ProtocolParameters::exact(), Firmware::V20, 0.09, FaultPlan::default());
    flat.ask("command");
    assert_eq!(flat.ask("takeoff").0, "error");
    assert_eq!(flat.ask("battery?").0, "9\r\n");
}

#[test]
fn each_sdk_has_its_own_commands_and_state() {
    let answers = |firmware| {
        let mut bench = Bench::with(ProtocolParameters::exact(), firmware, 1.0, FaultPlan::default());
        bench.ask("command");
        bench.wait(0.3);
        let texts: Vec<String> = ["sdk?", "stop", "setfps low", "keepalive"].map(|text| bench.ask(text).0).into();
        (texts, bench.states.last().unwrap().1.clone())
    };
    let (old, state) = answers(Firmware::V13);
    let unknown = |verb: &str| format!("unknown command: {verb}");
    assert_eq!(old, [unknown("sdk?"), unknown("stop"), unknown("setfps"), unknown("keepalive")]);
    assert!(state.starts_with("pitch:0;roll:0;yaw:0;vgx:0;"), "{state}");
    let (middle, state) = answers(Firmware::V20);
    assert_eq!(middle, ["20\r\n".to_owned(), "ok".to_owned(), unknown("setfps"), unknown("keepalive")]);
    assert!(state.starts_with("mid:-1;x:0;y:0;z:0;mpry:0,0,0;pitch:0;"), "{state}");
    let (new, state) = answers(Firmware::V30);
    assert_eq!(new, ["30\r\n", "ok", "ok", "ok"]);
    assert!(state.starts_with("mid:-2;x:-200;y:-200;z:-200;mpry:-2,-2,-2;pitch:0;"), "{state}");
}

#[test]
fn the_state_is_sent_ten_times_a_second_and_describes_the_flight() {
    let mut bench = Bench::new();
    bench.ask("command");
    bench.wait(0.1);
    assert!(!bench.states.is_empty(), "within 100 ms of `command`");
    bench.wait(2.0);
    let times: Vec<Time> = bench.states.iter().map(|(at, _)| *at).collect();
    assert!((20..=22).contains(&times.len()), "{}", times.len());
    let (_, line) = bench.states.last().unwrap();
    assert!(line.ends_with("\r\n") && line.is_ascii() && line.split(';').count() == 22, "{line}");
    assert_eq!((bench.field("tof"), bench.field("h"), bench.field("bat")), ("10".into(), "0".into(), "100".into()));
    // With its noise: no two lines are equal.
    let down: f64 = bench.field("agz").parse().unwrap();
    assert!((down + 1000.0).abs() <= 2.0, "{down}");
    assert!(bench.states.windows(2).all(|pair| pair[0].1 != pair[1].1));
    bench.ask("takeoff");
    bench.wait(0.2);
    assert_eq!((bench.field("h"), bench.field("time")), ("80".into(), "3".into()));
    bench.say("rc 0 60 0 0");
    bench.wait(2.0);
    assert_eq!((bench.field("vgx"), bench.field("vgy")), ("-6".into(), "0".into()), "negative ahead, as measured");
    bench.say("rc 0 0 0 0");
    bench.wait(1.0);
    bench.ask("cw 90");
    bench.wait(0.2);
    let yaw: i32 = bench.field("yaw").parse().unwrap();
    assert!((88..=92).contains(&yaw), "{yaw}");
}

#[test]
fn faults_are_reported_as_by_a_real_craft() {
    let with = |fault| {
        let mut bench = Bench::with(ProtocolParameters::exact(), Firmware::V20, 1.0, trouble(fault, 0.0, None));
        bench.ask("command");
        bench
    };
    assert_eq!(with(CraftFault::TakeOffRefused).ask("takeoff").0, "error");
    let mut empty = with(CraftFault::BatteryEmpty);
    assert_eq!(empty.ask("takeoff").0, "error");
    assert_eq!(empty.ask("battery?").0, "4\r\n");
    let mut blind = with(CraftFault::ImuInvalid);
    assert_eq!(blind.ask("takeoff").0, "ok");
    assert_eq!(blind.ask("forward 50").0, "error No valid imu");
    blind.say("rc 0 50 0 0");
    blind.wait(3.0);
    assert!(blind.place().north > 1.0, "rc still works");
}

#[test]
fn an_empty_battery_in_the_air_lands_it() {
    let mut bench = Bench::with(ProtocolParameters::exact(), Firmware::V20, 1.0, trouble(CraftFault::BatteryEmpty, 6.0, None));
    bench.ask("command");
    bench.ask("takeoff");
    bench.say("forward 500");
    bench.wait(8.0);
    assert_eq!(bench.phase(), FlightPhase::OnGround);
    assert_eq!(bench.answers.last().unwrap().1, "error Auto land");
}

/// When the link is cut, no `rc` can stop it: it flies on with the last stick positions, until its own landing.
#[test]
fn a_cut_link_leaves_the_sticks_as_they_were() {
    let mut bench = Bench::with(ProtocolParameters::exact(), Firmware::V20, 1.0, trouble(CraftFault::LinkCut, 6.0, Some(40.0)));
    bench.ask("command");
    bench.ask("takeoff");
    bench.wait(5.9 - bench.now.as_secs_f64());
    bench.say("rc 0 40 0 0");
    bench.wait(0.2);
    let (states, answers) = (bench.states.len(), bench.answers.len());
    for _ in 0..20 {
        bench.say("rc 0 0 0 0");
        bench.wait(0.5);
    }
    assert_eq!((bench.states.len(), bench.answers.len()), (states, answers), "nothing passes");
    assert!(bench.place().north > 3.0, "{}", bench.place().north);
    bench.wait(8.0);
    assert_eq!(bench.phase(), FlightPhase::OnGround, "15 s after the last command that arrived");
    bench.wait(20.0);
    assert!(bench.states.len() > states, "the link is back");
}

#[test]
fn a_restart_forgets_the_client_and_drops_the_craft() {
    let mut bench = Bench::with(ProtocolParameters::exact(), Firmware::V20, 1.0, trouble(CraftFault::Reboot, 6.0, Some(6.05)));
    bench.ask("command");
    bench.ask("takeoff");
    bench.wait(7.0 - bench.now.as_secs_f64());
    let answers = bench.answers.len();
    bench.say("command");
    bench.wait(2.0);
    assert_eq!((bench.phase(), bench.answers.len()), (FlightPhase::Stopped, answers), "it is still starting");
    bench.wait(8.0);
    assert_eq!(bench.ask("command").0, "ok");
}

#[test]
fn faults_of_the_link_reach_commands_answers_and_state() {
    let rules = vec![
        Rule { stream: Stream::Responses, from: 0.0, until: None, fault: Fault::Duplicate { p: 1.0, after: 0.2 } },
        Rule { stream: Stream::Telemetry, from: 1.0, until: Some(2.0), fault: Fault::Freeze },
        Rule { stream: Stream::Telemetry, from: 2.0, until: Some(3.0), fault: Fault::Drop { p: 1.0 } },
        Rule { stream: Stream::Commands, from: 3.0, until: Some(4.0), fault: Fault::Drop { p: 1.0 } },
        Rule { stream: Stream::Responses, from: 4.0, until: None, fault: Fault::Corrupt { p: 1.0 } },
    ];
    let mut bench = Bench::with(ProtocolParameters::exact(), Firmware::V20, 1.0, FaultPlan { rules, ..FaultPlan::default() });
    bench.ask("command");
    bench.wait(0.5);
    assert_eq!(bench.answers.len(), 2, "twice");
    bench.wait(3.0 - bench.now.as_secs_f64());
    let between = |low: f64, high: f64| -> Vec<&String> {
        let within = |at: Time| (low..high).contains(&at.as_secs_f64());
        bench.states.iter().filter(|(at, _)| within(*at)).map(|(_, line)| line).collect()
    };
    let frozen = between(1.0, 2.0);
    assert!(frozen.len() >= 9 && frozen.iter().all(|line| *line == frozen[0]));
    assert!(between(2.0, 3.0).is_empty());
    bench.say("takeoff");
    bench.wait(1.1);
    assert_eq!((bench.phase(), bench.answers.len()), (FlightPhase::OnGround, 2), "the command was lost");
    let (answer, _) = bench.ask("battery?");
    assert_ne!(answer, "100\r\n");
}

#[test]
fn go_refuses_what_is_within_20_cm_on_every_axis() {
    let refused = |text: &str| parse(text.as_bytes(), Firmware::V20) == Err(Malformed::OutOfRange);
    assert!(refused("go 20 -20 20 50") && refused("go 0 0 0 50") && refused("go 501 0 0 50") && refused("go 100 0 0 9"));
    assert!(!refused("go 21 0 0 50") && !refused("go 20 20 20 50 m1"));
    assert!(parse(b"go 50 19 50 50", Firmware::V13) == Err(Malformed::OutOfRange));
}

#[test]
fn terminators_are_tolerated_and_the_rest_is_named() {
    for text in ["takeoff\r\n", "takeoff\0", " takeoff "] {
        assert!(parse(text.as_bytes(), Firmware::V20).is_ok(), "{text:?}");
    }
    let answer = |text: &[u8]| parse(text, Firmware::V20).err().and_then(|malformed| malformed.answer());
    assert_eq!(answer(b"hover"), Some("unknown command: hover".to_owned()));
    assert_eq!(answer(b"forward"), Some("error".to_owned()));
    assert_eq!(answer(b"forward fast"), Some("error".to_owned()));
    assert_eq!(answer(b"rc 0 0 0 101"), Some("out of range".to_owned()));
    assert_eq!(answer(&[0xcc, 0x58, 0x00]), None);
}

proptest! {
    #[test]
    fn no_datagram_panics(bytes in proptest::collection::vec(any::<u8>(), 0..600)) {
        for firmware in [Firmware::V13, Firmware::V20, Firmware::V30] {
            let _ = parse(&bytes, firmware);
        }
    }

    /// For any input: the craft obeys its own limits, and at most one answer is sent for each command.
    #[test]
    fn any_commands_leave_it_sound(
        commands in proptest::collection::vec((
            prop_oneof![
                "(command|takeoff|land|stop|emergency|streamon|battery\\?|mon|reboot)",
                "(up|down|left|right|forward|back|cw|ccw|speed) -?[0-9]{1,4}",
                "(go|curve|rc|jump|flip) [-0-9lrfb ]{0,30}",
            ],
            0_u32..4000,
        ), 0..12),
    ) {
        let mut bench = Bench::with(ProtocolParameters::default(), Firmware::V30, 1.0, FaultPlan::default());
        bench.ask("command");
        for (command, millis) in &commands {
            bench.say(command);
            bench.wait(f64::from(*millis) * 1e-3);
            prop_assert!(bench.craft.dynamics().velocity().horizontal_speed() < 1.2);
        }
        bench.wait(45.0);
        // One for `command`, one for each of the others, and a late one for each stop.
        let stops = commands.iter().filter(|(command, _)| command == "stop").count();
        prop_assert!(bench.answers.len() <= 1 + commands.len() + stops, "{:?}", bench.answers);
        prop_assert!(bench.craft.dynamics().phase() != FlightPhase::Flying, "silence lands it");
    }
}
