//! Links that are silent for a while, and who has the craft afterwards: nobody is left in the air, and nobody is fought.

use std::fmt::Write as _;
use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::channel;

use rayon::prelude::*;

use super::*;

/// Who has it when the link is back.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Charge {
    /// Nobody; its radio lies untouched.
    Radio,
    /// Nobody; it has no receiver.
    NoReceiver,
    /// Its pilot, who has taken it over by the radio.
    Pilot,
    /// Its pilot, who has put it into the very hold that is its failsafe.
    Holding,
    /// Unknown: another station was heard.
    Station,
}

impl Charge {
    const ALL: [Self; 5] = [Self::Radio, Self::NoReceiver, Self::Pilot, Self::Holding, Self::Station];

    fn words(self) -> &'static str {
        match self {
            Self::Radio => "nobody, radio untouched",
            Self::NoReceiver => "nobody, no receiver",
            Self::Pilot => "its pilot, in a mode of the radio",
            Self::Holding => "its pilot, in the failsafe's mode",
            Self::Station => "unknown, another station heard",
        }
    }
}

/// What ends the flight if nothing else does.
#[derive(Clone, Copy, Debug, PartialEq)]
enum End {
    Time,
    Signal,
}

#[derive(Clone, Copy, Debug)]
struct Cell {
    autopilot: Autopilot,
    silent: f64,
    charge: Charge,
    attended: bool,
    end: End,
}

/// When the link falls silent, and when the flight is ended, seconds.
const SILENT_AT: f64 = 12.0;
const END_AT: f64 = 45.0;

/// The first interrupt, as of SIGTERM or Ctrl-C.
struct Signal(Arc<AtomicU32>);

impl Observer for Signal {
    fn time(&mut self, now: Time, _: &Pilot) {
        if now.as_secs_f64() >= END_AT {
            self.0.store(1, Ordering::Relaxed);
        }
    }
}

/// What became of it.
struct Flown {
    flight: Flight,
    /// When the flight loop ended, seconds.
    ended: f64,
}

fn fly_cell(cell: Cell) -> Flown {
    let Cell { autopilot, silent, charge, attended, end } = cell;
    let loaded = park();
    let start = loaded.scene.start;
    let world = SimWorld::new(loaded, CraftKind::Quad, start, 5);
    let lost = |stream| Rule { stream, from: SILENT_AT, until: Some(SILENT_AT + silent), fault: Fault::Drop { p: 1.0 } };
    let faults = FaultPlan { rules: vec![lost(Stream::Telemetry), lost(Stream::Commands)], ..FaultPlan::default() };
    let mode = match (charge, autopilot) {
        (Charge::Pilot, Autopilot::Px4) => Some(Mode::px4(3, 0)),
        (Charge::Pilot, Autopilot::ArduPilot) => Some(Mode(autopilot, 5)),
        (Charge::Holding, _) => Some(autopilot.hold()),
        _ => None,
    };
    let deeds = mode.map(|mode| (SILENT_AT + 0.5 * silent, Deed::Radio(mode))).into_iter().collect();
    let parameters: &[(&str, f64)] = if autopilot == Autopilot::Px4 { &[("COM_OBL_RC_ACT", 5.0)] } else { &[] };
    let mut drone = WiredVehicle::new(world.clone(), autopilot, parameters, faults, deeds);
    if charge != Charge::NoReceiver {
        drone.carry_receiver();
    }
    drone.get_ready();
    if charge == Charge::Station {
        let now = drone.now;
        drone.driver.hear_station(now);
    }
    let told = drone.told.clone();
    let oracle = OracleVlm::new("oracle".to_owned(), world.clone(), ErrorFile::named("perfect").unwrap(), 5);
    let model: Mutex<Option<Box<dyn Vlm>>> = Mutex::new(Some(Box::new(oracle)));
    let vlm_factory: VlmFactory = Arc::new(move |_, _| Ok(model.lock().unwrap().take().unwrap()));
    let site = Site::Real(Real { drone: Box::new(drone), clock: Clock::Virtual });
    let max_time = Duration::from_secs_f64(if end == End::Time { END_AT } else { 300.0 });
    let settings = PilotSettings { max_time, at_end: AtEnd::Hover, ..PilotSettings::preset(Preset::Default) };
    let limits = Limits { take_off_battery: 0.0, low_battery: 0.0, ..Limits::for_craft(&Craft::quad()) };
    let (operator, inputs) = channel();
    let interrupts = Arc::new(AtomicU32::new(0));
    let plan = FlightPlan {
        settings,
        limits,
        operator: attended.then_some(inputs),
        interrupts: interrupts.clone(),
        ..FlightPlan::new(site, GOAL, "oracle", vlm_factory)
    };
    let mut seen = Seen::default();
    let mut signal = Signal(if end == End::Signal { interrupts } else { Arc::default() });
    flight::fly(plan, &mut [&mut seen, &mut signal]).unwrap();
    drop(operator);
    let ended = seen.phases.iter().find(|(_, phase)| *phase == Phase::Ended).map_or(f64::INFINITY, |(at, _)| at.as_secs_f64());
    let told = core::mem::take(&mut *told.lock().unwrap());
    Flown { flight: Flight { seen, told, world }, ended }
}

fn cells() -> Vec<Cell> {
    let mut all = Vec::new();
    for autopilot in BOTH {
        for silent in [1.0, 3.0, 5.0, 10.0] {
            for charge in Charge::ALL {
                for attended in [true, false] {
                    for end in [End::Time, End::Signal] {
                        all.push(Cell { autopilot, silent, charge, attended, end });
                    }
                }
            }
        }
    }
    all
}

/// Its satellites are lost, and its position is good to twice the distance that it may fly: no take-off, and a flight is landed.
#[test]
fn an_uncertain_position_is_no_position() {
    for autopilot in BOTH {
        let blur = 2.0 * Limits::for_craft(&Craft::quad()).max_distance as f32;
        for (at, landed) in [(0.0, false), (12.0, true)] {
            let flight = fly(autopilot, &[], none(), vec![(at, Deed::Blur(blur))], "");
            let (when, outcome, cause) = flight.seen.outcome.clone().unwrap();
            assert_eq!((outcome, flight.phase()), (Outcome::Aborted, FlightPhase::OnGround), "{autopilot:?} {cause}");
            assert_eq!(flight.entered(Phase::TakeOff).is_empty(), !landed, "{autopilot:?} {cause}");
            assert!(cause.contains("uncertain") && when < Time::from_secs_f64(at + 25.0), "{autopilot:?} {when} {cause}");
        }
    }
}

/// What is wrong with it; empty if nothing is.
fn faults_of(cell: Cell, flown: &Flown) -> Vec<String> {
    let Flown { flight, ended } = flown;
    let mut wrong = Vec::new();
    let back = SILENT_AT + cell.silent;
    let let_go = flight.told.notices.iter().any(|(_, it)| matches!(it, Notice::LetGo { .. }));
    let failsafe = flight.told.notices.iter().any(|(_, it)| matches!(it, Notice::HeldByFailsafe { .. }));
    let on_ground = flight.phase() == FlightPhase::OnGround;
    let mode = flight.told.modes.last().unwrap().1;
    // A craft that has arrived hovers for a minute.
    if *ended > END_AT + 75.0 {
        wrong.push(format!("it ends at {ended} s"));
    }
    let somebodys = match cell.charge {
        Charge::Radio | Charge::NoReceiver => false,
        Charge::Pilot | Charge::Holding => true,
        // Nobody has taken anything from an autopilot that stayed in its mode.
        Charge::Station => cell.autopilot == Autopilot::Px4 && let_go,
    };
    if somebodys {
        // A heartbeat tells it a second later at most.
        let sent = flight.sent(back + 1.2, 1e9);
        if !sent.is_empty() {
            wrong.push(format!("{} sent after somebody took over, first {:?}", sent.len(), sent[0]));
        }
        if on_ground || !let_go {
            wrong.push(format!("on the ground: {on_ground}, let go: {let_go}"));
        }
    } else {
        if !on_ground {
            wrong.push(format!("it is left in the air in {mode}"));
        }
        if failsafe && !cell.attended && *ended > back + 35.0 {
            wrong.push(format!("nobody was there, and it landed at {ended} s"));
        }
        if let_go {
            wrong.push("it was let go although nobody had it".to_owned());
        }
    }
    wrong
}

fn check(cells: &[Cell]) -> Vec<(Cell, Flown)> {
    let flown: Vec<_> = cells.par_iter().map(|cell| (*cell, fly_cell(*cell))).collect();
    let wrong: Vec<String> = flown
        .iter()
        .flat_map(|(cell, flown)| faults_of(*cell, flown).into_iter().map(move |fault| format!("{cell:?}: {fault}")))
        .collect();
    assert!(wrong.is_empty(), "{} of {} are wrong\n{}", wrong.len(), cells.len(), wrong.join("\n"));
    flown
}

#[test]
fn after_every_tenth_silence_nobody_is_left_in_the_air_and_nobody_is_fought() {
    let some: Vec<Cell> =
        cells().into_iter().enumerate().filter(|(at, _)| at % 10 == at / 10 % 10).map(|(_, cell)| cell).collect();
    check(&some);
}

/// Between these lines of the page is its table.
const BEGIN: &str = "<!-- table -->\n";
const END: &str = "<!-- end of table -->\n";

#[test]
#[ignore = "long: .ci/interop runs it"]
fn after_every_silence_nobody_is_left_in_the_air_and_nobody_is_fought() {
    let flown = check(&cells());
    let mut table =
        "| autopilot | who has it | attended | end by | silent 1 s | 3 s | 5 s | 10 s |\n|---|---|---|---|---|---|---|---|\n"
            .to_owned();
    let of_row = |cell: &Cell| (cell.autopilot.name(), cell.charge.words(), cell.attended, cell.end == End::Time);
    for (at, (cell, _)) in flown.iter().enumerate() {
        let row = of_row(cell);
        if flown[..at].iter().any(|(before, _)| of_row(before) == row) {
            continue;
        }
        let end = if cell.end == End::Time { "time limit" } else { "signal" };
        write!(table, "| {} | {} | {} | {end} |", row.0, row.1, if cell.attended { "yes" } else { "no" }).unwrap();
        for (_, flown) in flown.iter().filter(|(cell, _)| of_row(cell) == row) {
            let mode = flown.flight.told.modes.last().unwrap().1;
            let place =
                if flown.flight.phase() == FlightPhase::OnGround { "landed".to_owned() } else { format!("left in {mode}") };
            write!(table, " {place}, {:.0} s |", flown.ended).unwrap();
        }
        table.push('\n');
    }
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/studies/2026-11-28-silent-links.md");
    let text = std::fs::read_to_string(&page).unwrap();
    let (before, rest) = text.split_once(BEGIN).unwrap();
    let (was, after) = rest.split_once(END).unwrap();
    if std::env::var_os("INSTA_UPDATE").is_some_and(|update| update == "always") {
        std::fs::write(&page, format!("{before}{BEGIN}\n{table}\n{END}{after}")).unwrap();
    } else {
        assert_eq!(was.trim(), table.trim());
    }
}
