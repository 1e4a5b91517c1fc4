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
            Unflown::Unused { error, readings } if self.can_ask(given) => {
                choose(&error.to_string(), readings, std::io::stdin().lock(), |line| self.printer.log(line))
            }
            _ => None,
        };
        let Some(chosen) = chosen else { return Err(unflown.into()) };
        let lines = lines(&chosen, loaded, start, given, false).map_err(spf_api::Error::from)?;
        Ok((lines, Some(chosen)))
    }

    /// Whether a person sits at the terminal.
    fn can_ask(&self, given: Given) -> bool {
        let asks = matches!(given, Given::AsArgument | Given::ByKeys);
        asks && !self.printer.is_json() && std::io::stdin().is_terminal() && std::io::stderr().is_terminal()
    }
}

/// Lets a person choose a reading by its number; `None` to fly nothing.
fn choose(why: &str, readings: &[String], mut typed: impl BufRead, mut say: impl FnMut(&str)) -> Option<String> {
    if readings.is_empty() {
        return None;
    }
    say(why);
    for (number, reading) in (1..).zip(readings) {
        say(&format!("  {number}  {}", one_line(reading)));
    }
    say("Type a number to fly that instead, or Enter to end:");
    let mut line = String::new();
    // A closed terminal chooses nothing.
    typed.read_line(&mut line).ok()?;
    let number: usize = line.trim().parse().ok()?;
    readings.get(number.checked_sub(1)?).cloned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reading_is_chosen_by_its_number_and_by_nothing_else() {
        let readings = ["fly to the red church", "fly to the bus"].map(str::to_owned);
        let mut said = Vec::new();
        let mut chosen = |typed: &str| choose("why", &readings, typed.as_bytes(), |line| said.push(line.to_owned()));
        assert_eq!(chosen(" 2 \n").as_deref(), Some("fly to the bus"));
        for typed in ["", "\n", "0\n", "3\n", "-1\n", "yes\n", "fly to the red church\n"] {
            assert_eq!(chosen(typed), None, "{typed:?}");
        }
        assert!(said.contains(&"  1  fly to the red church".to_owned()));
        assert_eq!(choose("why", &[], "1\n".as_bytes(), |_| panic!("nothing to choose from")), None);
    }
}
