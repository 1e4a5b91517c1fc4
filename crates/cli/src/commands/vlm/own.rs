//! Who else may answer: a program of the user's own (`exec:COMMAND`), and the user (`human`).

use std::io::{BufRead as _, IsTerminal as _};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

use spf_core::time::duration_from_secs;
use spf_pilot::OperatorEvent;
use spf_vlm::exec::{EXEC, Exec, ExecOptions};
use spf_vlm::human::{HELP, HUMAN, Human, ORDERS};
use spf_vlm::{Paced, Vlm};

use super::{LATENCY_S, Pointing};
use crate::background;
use crate::error::CliError;
use crate::settings::{Origin, Row, Settings};

/// The clock that determines how long an answer takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Pace {
    /// Virtual time: an answer takes the time that it is said to take.
    Virtual,
    /// The wall clock of a flight.
    Wall,
    /// Nothing waits for the answer, whose own time is of interest.
    None,
}

/// Whether a name is that of somebody who may take any time where no clock runs.
pub(super) fn is_own(name: &str) -> bool {
    is_human(name) || name.starts_with(EXEC)
}

/// Whether a person answers.
pub(crate) fn is_human(name: &str) -> bool {
    name == HUMAN
}

/// The same VLM with its replies timed by this clock.
pub(crate) fn paced(settings: &Settings, pointing: Pointing, pace: Pace) -> Result<Pointing, CliError> {
    let own = is_own(&pointing.name);
    let set = settings.vlm.latency_s.get()?;
    let latency = set.or(own.then_some(LATENCY_S)).filter(|_| pace == Pace::Virtual).map(duration_from_secs);
    let unhurried = own && pace != Pace::Wall;
    let ignored = if set.is_some() && pace == Pace::Wall { " Ignored when flying in real time: vlm.latency_s." } else { "" };
    let sentence = format!("{}{ignored}", pointing.sentence);
    if latency.is_none() && !unhurried {
        return Ok(Pointing { sentence, ..pointing });
    }
    let vlm_factory = pointing.vlm_factory;
    let paced = move |world: Option<&_>, seed| {
        let vlm = vlm_factory(world, seed)?;
        Ok(Box::new(Paced::new(vlm, latency, unhurried)) as Box<dyn Vlm>)
    };
    Ok(Pointing { vlm_factory: Arc::new(paced), sentence, latency, ..pointing })
}

/// The program of a name `exec:COMMAND`.
pub(crate) fn exec(settings: &Settings, name: &str) -> Result<Exec, CliError> {
    if !matches!(settings.fly.vlm.origin(), Origin::Flag(_)) {
        return Err(CliError::usage(format!("{}: a program may be named on the command line only", settings.fly.vlm.origin()))
            .hint(format!("--vlm '{name}'; a configuration file, which may come from someone else, must not start programs")));
    }
    let command = name.strip_prefix(EXEC).unwrap_or(name);
    let defaults = ExecOptions::default();
    let options = ExecOptions {
        long_side: settings.vlm.image_long_side.get()?,
        quality: settings.vlm.jpeg_quality.get()?.unwrap_or(defaults.quality),
        longest_answer: duration_from_secs(settings.vlm.exec_timeout_s.or_default()?),
        ..defaults
    };
    Exec::start(command, options).map_err(|error| {
        CliError::usage(format!("cannot use the VLM `{name}`"))
            .because(&error)
            .hint("--vlm 'exec:python3 my_model.py': the program and its arguments (docs/guide/vlm.md)")
    })
}

/// A program, for a flight.
pub(super) fn program(settings: &Settings, name: &str) -> Result<Pointing, CliError> {
    let exec = exec(settings, name)?;
    let program = Some(exec.clone());
    Ok(Pointing {
        name: name.to_owned(),
        vlm_factory: Arc::new(move |_, _| Ok(Box::new(exec.clone()))),
        is_oracle: false,
        sentence: format!("VLM: the program `{}`.", name.strip_prefix(EXEC).unwrap_or(name)),
        latency: None,
        program,
        lists_boxes: true,
    })
}

/// The user, for a flight.
pub(super) fn human() -> Result<Pointing, CliError> {
    let human = human_at_the_terminal()?;
    Ok(Pointing {
        name: HUMAN.to_owned(),
        vlm_factory: Arc::new(move |_, _| Ok(Box::new(human.clone()))),
        is_oracle: false,
        sentence: format!("VLM: you. {HELP} `hold`, `resume` and `land` control the drone at any time."),
        latency: None,
        program: None,
        lists_boxes: false,
    })
}

/// The user's lines, read by one thread for the life of the process: standard input cannot be given back.
struct Console {
    human: Human,
    operator: Mutex<Option<Receiver<OperatorEvent>>>,
}

static CONSOLE: LazyLock<Result<Console, String>> = LazyLock::new(|| {
    let (send, lines) = channel();
    let (order, operator) = channel();
    let human = Human::new(lines, Arc::new(background::say)).map_err(|error| error.to_string())?;
    let human = if std::io::stdin().is_terminal() { human } else { human.from_a_pipe() };
    let read = move || read(&send, &order);
    std::thread::Builder::new().name("human".to_owned()).spawn(read).map_err(|error| error.to_string())?;
    Ok(Console { human, operator: Mutex::new(Some(operator)) })
});

/// Reads standard input to its end: orders to the drone, and all else as answers.
fn read(answers: &Sender<String>, orders: &Sender<OperatorEvent>) {
    for line in std::io::stdin().lock().lines().map_while(Result::ok) {
        let order = match line.trim() {
            word if word == ORDERS[0] => Some(OperatorEvent::Hold),
            word if word == ORDERS[1] => Some(OperatorEvent::Resume),
            word if word == ORDERS[2] => Some(OperatorEvent::Land),
            _ => None,
        };
        // An error means that the flight is over. An order also ends the query that reads it: a simulated world stands still for its
        // answer, and carries out no order meanwhile.
        let sent = match order {
            Some(order) => orders.send(order).is_ok() && answers.send(line).is_ok(),
            None => answers.send(line).is_ok(),
        };
        if !sent {
            return;
        }
    }
}

fn human_at_the_terminal() -> Result<Human, CliError> {
    match &*CONSOLE {
        Ok(console) => Ok(console.human.clone()),
        Err(error) => Err(CliError::internal(format!("cannot read what you type: {error}"))),
    }
}

/// The orders that the user types, once.
pub(crate) fn console() -> Option<Receiver<OperatorEvent>> {
    let console = CONSOLE.as_ref().ok()?;
    console.operator.lock().unwrap_or_else(PoisonError::into_inner).take()
}

/// The names of a list: separated by commas, except inside quotes, where a program's arguments may have some.
pub(crate) fn listed(text: &str) -> Vec<&str> {
    let (mut names, mut from, mut quote) = (Vec::new(), 0, None);
    for (at, letter) in text.char_indices() {
        match (quote, letter) {
            (None, '\'' | '"') => quote = Some(letter),
            (Some(open), _) if open == letter => quote = None,
            (None, ',') => {
                names.push(&text[from..at]);
                from = at + 1;
            }
            _ => {}
        }
    }
    names.push(&text[from..]);
    names.into_iter().map(str::trim).filter(|name| !name.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_comma_in_quotes_separates_nothing() {
        assert_eq!(listed("gemini, oracle:poor,,"), ["gemini", "oracle:poor"]);
        assert_eq!(listed("exec:python3 'a, b.py' --x \"1,2\",oracle"), ["exec:python3 'a, b.py' --x \"1,2\"", "oracle"]);
        assert!(listed(" , ").is_empty());
    }
}
