//! Every fault of the process in every phase of a flight, as real processes over sockets: the program, the virtual Tello and a
//! VLM on this machine.

mod cell;
mod tap;

use std::fmt::Write as _;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use self::cell::{Outcome, fly};

/// What goes wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fault {
    Sigterm,
    Sigint,
    Sighup,
    /// SIGSTOP, and SIGCONT 3 s later.
    Sigstop,
    Panic,
    StalledTerminal,
    StalledDisk,
    FullDisk,
    CommandsLost,
}

impl Fault {
    const ALL: [Self; 9] = [
        Self::Sigterm,
        Self::Sigint,
        Self::Sighup,
        Self::Sigstop,
        Self::Panic,
        Self::StalledTerminal,
        Self::StalledDisk,
        Self::FullDisk,
        Self::CommandsLost,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Sigterm => "SIGTERM",
            Self::Sigint => "SIGINT",
            Self::Sighup => "SIGHUP",
            Self::Sigstop => "SIGSTOP for 3 s",
            Self::Panic => "panic of the flight loop",
            Self::StalledTerminal => "stalled terminal",
            Self::StalledDisk => "stalled disk",
            Self::FullDisk => "full disk",
            Self::CommandsLost => "commands lost",
        }
    }

    /// Whether the flight goes on in spite of it, so that an operator has to end it.
    fn needs_ctrl_c(self) -> bool {
        matches!(self, Self::Sigstop | Self::StalledTerminal | Self::StalledDisk | Self::FullDisk)
    }
}

/// When it goes wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    TakeOff,
    Deciding,
    Executing,
    Searching,
    Manual,
    Landing,
}

impl Phase {
    const ALL: [Self; 6] = [Self::TakeOff, Self::Deciding, Self::Executing, Self::Searching, Self::Manual, Self::Landing];

    fn name(self) -> &'static str {
        match self {
            Self::TakeOff => "take-off",
            Self::Deciding => "deciding",
            Self::Executing => "executing",
            Self::Searching => "searching",
            Self::Manual => "manual",
            Self::Landing => "landing",
        }
    }
}

/// Bound on the last motion after its reason ended that only a blocked loop exceeds, also on a busy machine, s.
const LAST_MOTION: f64 = 1.0;
/// The same where commands are lost: 3.5 s until it is known, and the envelope's 0.5 s until it holds.
const LAST_MOTION_UNHEARD: f64 = 5.0;

/// What is wrong with a cell.
fn problems(fault: Fault, phase: Phase, outcome: &Outcome) -> Vec<String> {
    let mut problems = Vec::new();
    let mut expect = |right: bool, what: String| {
        if !right {
            problems.push(format!("{}, {}: {what}\n{}", fault.name(), phase.name(), outcome.printed));
        }
    };
    let Outcome { last_motion, exit, ended_by, told_last, rows, shown, .. } = outcome;
    let bound = if fault == Fault::CommandsLost { LAST_MOTION_UNHEARD } else { LAST_MOTION };
    expect(*last_motion <= bound, format!("it moves for {last_motion:.2} s more"));
    expect(ended_by == "landing", format!("the craft's flight ended by {ended_by}"));
    expect(told_last == "land", format!("it was told `{told_last}` last"));
    let code = match fault {
        Fault::Panic => 1,
        Fault::CommandsLost if phase != Phase::Landing => 6,
        _ => 5,
    };
    expect(*exit == Some(code), format!("exit code {exit:?} and not {code}"));
    let may_lose = matches!(fault, Fault::StalledDisk | Fault::FullDisk);
    expect(rows >= shown || may_lose, format!("{rows} rows for {shown} decisions"));
    problems
}

/// Flies cells on some threads, in order.
fn fly_all(cells: &[(Fault, Phase)], threads: usize, first_address: usize) -> Vec<Outcome> {
    let next = AtomicUsize::new(0);
    let flown: Vec<Mutex<Option<Outcome>>> = cells.iter().map(|_| Mutex::new(None)).collect();
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while let Some((index, (fault, phase))) =
                    Some(next.fetch_add(1, Ordering::Relaxed)).and_then(|index| Some((index, *cells.get(index)?)))
                {
                    let address = |n: usize| format!("127.0.3.{}", first_address + 2 * index + n);
                    *flown[index].lock().unwrap() = Some(fly(fault, phase, &address(0), &address(1)));
                }
            });
        }
    });
    flown.into_iter().map(|flown| flown.into_inner().unwrap().unwrap()).collect()
}

fn assert_all(cells: &[(Fault, Phase)], flown: &[Outcome]) {
    let all = cells.iter().zip(flown);
    let problems: Vec<String> = all.flat_map(|((fault, phase), outcome)| problems(*fault, *phase, outcome)).collect();
    assert!(problems.is_empty(), "{}", problems.join("\n"));
}

/// A table: faults down, phases across.
fn table(flown: &[Outcome]) -> String {
    let phases: Vec<&str> = Phase::ALL.iter().map(|phase| phase.name()).collect();
    let mut text = format!("| fault | {} |\n|---|{}\n", phases.join(" | "), "---|".repeat(phases.len()));
    for (fault, row) in Fault::ALL.iter().zip(flown.chunks(Phase::ALL.len())) {
        let cell = |outcome: &Outcome| {
            let Outcome { last_motion, exit, told_last, rows, repaired, .. } = outcome;
            let exit = exit.map_or("signal".to_owned(), |code| code.to_string());
            format!("{last_motion:.2} s, {exit}, {told_last}, {rows}{}", if *repaired { " (r)" } else { "" })
        };
        writeln!(text, "| {} | {} |", fault.name(), row.iter().map(cell).collect::<Vec<_>>().join(" | ")).unwrap();
    }
    let columns = (0..Phase::ALL.len()).map(|column| {
        let of = flown.iter().skip(column).step_by(Phase::ALL.len());
        format!("{:.2} s", of.map(|outcome| outcome.last_motion).fold(0.0, f64::max))
    });
    writeln!(text, "| longest | {} |", columns.collect::<Vec<_>>().join(" | ")).unwrap();
    text
}

/// One cell, the middle of a step.
#[test]
fn a_panic_during_a_step_lands_the_drone() {
    let cells = [(Fault::Panic, Phase::Executing)];
    assert_all(&cells, &fly_all(&cells, cells.len(), 2));
}

/// Each fault once, each phase at least once.
#[test]
#[ignore = "flies in real time: .ci/interop runs it"]
fn whatever_fails_in_one_of_its_phases_the_drone_is_landed() {
    let phases = Phase::ALL.iter().cycle();
    let cells: Vec<(Fault, Phase)> = Fault::ALL.iter().zip(phases).map(|(fault, phase)| (*fault, *phase)).collect();
    assert_all(&cells, &fly_all(&cells, 6, 4));
}

/// Between these lines of the page is its table.
const BEGIN: &str = "<!-- table -->\n";
const END: &str = "<!-- end of table -->\n";

#[test]
#[ignore = "long: a command of CONTRIBUTING.md"]
fn however_the_program_ends_in_whatever_phase_the_drone_is_landed() {
    let cells: Vec<(Fault, Phase)> =
        Fault::ALL.iter().flat_map(|fault| Phase::ALL.iter().map(|phase| (*fault, *phase))).collect();
    let flown = fly_all(&cells, 6, 30);
    if std::env::var_os("INSTA_UPDATE").is_some_and(|update| update == "always") {
        let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/studies/2026-11-24-process-matrix.md");
        let text = std::fs::read_to_string(&page).unwrap();
        let (before, rest) = text.split_once(BEGIN).unwrap();
        let (_, after) = rest.split_once(END).unwrap();
        std::fs::write(&page, format!("{before}{BEGIN}\n{}\n{END}{after}", table(&flown))).unwrap();
    }
    assert_all(&cells, &flown);
}
