//! What was said before a flight: read as the oracle reads it, and asked about where some of its words are used for nothing.

use std::io::{BufRead, IsTerminal as _};

use spf_api::reading::{Given, Unflown, lines};
use spf_core::geometry::Pose;
use spf_flight::sim::LoadedScene;

use crate::error::CliError;
use crate::printer::{Printer, one_line};

/// An instruction, and who gave it how.
pub(super) struct Said<'a> {
    pub(super) instruction: &'a str,
    /// `None` if somebody points instead, and nothing is read.
    pub(super) given: Option<Given>,
    /// Whether it is flown although some of its words are used for nothing.
    pub(super) anyway: bool,
    pub(super) printer: &'a Printer,
}

impl Said<'_> {
    /// How the oracle reads the instruction: the lines that say so, and another instruction if one was chosen instead.
    pub(super) fn read(&self, loaded: &LoadedScene, start: Option<Pose>) -> Result<(Vec<String>, Option<String>), CliError> {
        let Some(given) = self.given else { return Ok((Vec::new(), None)) };
        let unflown = match lines(self.instruction, loaded, start, given, self.anyway) {
            Ok(lines) => return Ok((lines, None)),
            Err(unflown) => unflown,
        };
        let chosen = match &unflown {
            Unflown::Unused { error, readings } if self.can_ask(given) && !readings.is_empty() => {
                choose(&error.to_string(), readings, std::io::stdin().lock(), |line| self.printer.log(line))
            }
            _ => return Err(unflown.into()),
        };
        let Some(chosen) = chosen else {
            return Err(CliError::usage("nothing is flown: no reading was chosen")
                .hint("say it in words that are all used, or fly without the others with --anyway"));
        };
        let lines = lines(&chosen, loaded, start, given, false).map_err(spf_api::Error::from)?;
        Ok((lines, Some(chosen)))
    }

    /// Whether a person sits at the terminal.
    fn can_ask(&self, given: Given) -> bool {
        let asks = matches!(given, Given::AsArgument | Given::ByKeys);
        asks && !self.printer.is_json() && std::io::stdin().is_terminal() && std::io::stderr().is_terminal()
    }
}

/// Lets a person choose a reading by its number, and ask again once; `None` to fly nothing.
fn choose(why: &str, readings: &[String], mut typed: impl BufRead, mut say: impl FnMut(&str)) -> Option<String> {
    say(why);
    for (number, reading) in (1..).zip(readings) {
        say(&format!("  {number}  {}", one_line(reading)));
    }
    say("Type a number to fly that instead, or Enter to end:");
    for is_last in [false, true] {
        let mut line = String::new();
        // A closed terminal chooses nothing.
        typed.read_line(&mut line).ok()?;
        let said = line.trim();
        if said.is_empty() {
            return None;
        }
        let number = said.parse::<usize>().ok().and_then(|number| number.checked_sub(1));
        if let Some(chosen) = number.and_then(|at| readings.get(at)) {
            return Some(chosen.clone());
        }
        let again = if is_last { "" } else { " Type one of them, or Enter to end:" };
        say(&format!("\"{}\" is none of these numbers.{again}", one_line(said)));
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reading_is_chosen_by_its_number_and_by_nothing_else() {
        let readings = ["fly to the red church", "fly to the bus"].map(str::to_owned);
        let mut said = Vec::new();
        let mut chosen = |typed: &str| choose("why", &readings, typed.as_bytes(), |line| said.push(line.to_owned()));
        for typed in [" 2 \n", "7\n2\n", "yes\n2\n"] {
            assert_eq!(chosen(typed).as_deref(), Some("fly to the bus"), "{typed:?}");
        }
        for typed in ["", "\n", "0\n", "3\n", "-1\n", "yes\n", "fly to the red church\n", "3\n\n", "3\n4\n1\n"] {
            assert_eq!(chosen(typed), None, "{typed:?}");
        }
        assert!(said.contains(&"  1  fly to the red church".to_owned()));
        assert!(said.contains(&"\"3\" is none of these numbers. Type one of them, or Enter to end:".to_owned()), "{said:?}");
    }
}
