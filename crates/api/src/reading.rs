//! How the oracle reads an instruction: before take-off, and in flight when a new one is given.

use std::collections::BTreeSet;
use std::sync::Arc;

use spf_core::geometry::Pose;
use spf_core::tags::Tagged;
use spf_core::time::Time;
use spf_flight::keys::Pressed;
use spf_flight::sim::LoadedScene;
use spf_oracle::language::Verb;
use spf_oracle::limits::{Demand, limits};
use spf_oracle::{Account, InstructionReading, Placed, ReadStep, UnknownWord, account, read_instruction};
use spf_pilot::OperatorEvent;

use crate::demands::refuse_in_flight;
use crate::error::{Error, one_line, quoted};

/// Maximum number of scene objects listed if no word matches.
const EXAMPLES: usize = 8;

/// Where an instruction is given, and so how one lands and flies by hand there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Given {
    /// On the command line, for a flight in virtual time.
    AsArgument,
    /// Typed in the terminal in flight, or on the command line for a flight that has its keys.
    ByKeys,
    /// On the page, or on the command line for a flight that has one.
    OnPage,
    /// By an assistant, in a call of a tool.
    ByAssistant,
    /// In a file, for a time of the flight.
    ByScript,
}

impl Given {
    /// For an instruction on the command line.
    pub fn for_flight(cockpit: bool, realtime: bool) -> Self {
        match (cockpit, realtime) {
            (true, _) => Self::OnPage,
            (false, true) => Self::ByKeys,
            (false, false) => Self::AsArgument,
        }
    }

    /// What else there is to do than to fly to an object.
    fn advice(self) -> &'static str {
        match self {
            Self::AsArgument | Self::ByScript => "the drone lands by itself at the end; to fly manually, use --realtime",
            Self::ByKeys => "to land, press L; to fly manually, the arrow keys, W, A, S and D",
            Self::ByAssistant => "to land, call `land`; to fly by yourself, call `take_off`, `look` and `point`",
            Self::OnPage => "to land, press Land; to fly manually, open Fly by hand",
        }
    }
}

/// An instruction that is not flown as it stands.
#[derive(Clone, Debug)]
pub enum Unflown {
    /// Nothing in it is understood, so that the flight could only end in a fruitless search.
    NotUnderstood(Error),
    /// Some of its words are used for nothing.
    Unused {
        /// Those words, and what to do.
        error: Error,
        /// Instructions of the same meaning, as far as there is one, in which every word is used.
        readings: Vec<String>,
    },
}

impl From<Unflown> for Error {
    fn from(unflown: Unflown) -> Self {
        match unflown {
            Unflown::NotUnderstood(error) | Unflown::Unused { error, .. } => error,
        }
    }
}

/// The lines that show how the oracle reads an instruction. `start` is the start pose of the flight, if not the scene's own. With
/// `anyway` words that are used for nothing are announced instead of refused.
///
/// # Errors
/// [`Unflown`].
pub fn lines(
    instruction: &str,
    loaded: &LoadedScene,
    start: Option<Pose>,
    given: Given,
    anyway: bool,
) -> Result<Vec<String>, Unflown> {
    let objects = loaded.placed(&loaded.cast.starts());
    let from = Some(start.unwrap_or(loaded.scene.start));
    let reading = read_instruction(instruction, &objects, from);
    if !reading.is_understood() {
        return Err(Unflown::NotUnderstood(not_understood(instruction, &reading, loaded, given)));
    }
    let Account { dropped, mut unused } = account(instruction, &objects, from);
    // A step of which nothing is understood could only be searched for in vain.
    let strange = reading.steps.iter().filter(|step| !step.is_understood()).map(|step| step.target.clone());
    let is_new = |words: &String| !words.is_empty() && !unused.iter().any(|part| part.contains(words.as_str()));
    unused.extend(strange.filter(is_new).collect::<Vec<_>>());
    let steps: Vec<String> = reading.steps.iter().map(|step| described(step, &loaded.tags)).collect();
    let reads = format!("reads: {}", steps.join("; then "));
    if !unused.is_empty() && !anyway {
        let readings = whole_readings(instruction, &reading, &objects, from);
        let error = unused_words(instruction, &unused, &reads, &readings, &reading, given);
        return Err(Unflown::Unused { error, readings });
    }
    let mut lines = vec![reads];
    if !reading.corrections.is_empty() {
        let read =
            reading.corrections.iter().map(|word| format!("\"{}\" as \"{}\"", one_line(&word.written), one_line(&word.read)));
        lines.push(format!("spelling: {}", read.collect::<Vec<_>>().join(", ")));
    }
    if !dropped.is_empty() {
        lines.push(format!("dropped: {} (asks for nothing that the drone could do)", quoted(&dropped)));
    }
    if !unused.is_empty() {
        lines.push(format!("not understood: {} (the flight ends when the rest is fulfilled)", quoted(&unused)));
    }
    Ok(lines)
}

/// The error for words that are used for nothing.
fn unused_words(
    instruction: &str,
    unused: &[String],
    reads: &str,
    readings: &[String],
    reading: &InstructionReading,
    given: Given,
) -> Error {
    let alike = reading.ignored.iter().filter_map(|word| Some(format!("did you mean `{}`?", word.nearest.as_ref()?)));
    let meant: Vec<String> = alike.collect();
    let meant = if meant.is_empty() { String::new() } else { format!("; {}", meant.join(" ")) };
    let message = format!("the oracle has no use for {} in \"{}\"; it {reads}{meant}", quoted(unused), one_line(instruction));
    let say = match readings {
        [] => "say it without them".to_owned(),
        readings => format!("say {}", readings.iter().map(|reading| format!("\"{reading}\"")).collect::<Vec<_>>().join(" or ")),
    };
    let anyway = if given == Given::AsArgument { "; --anyway flies without them" } else { "" };
    Error::usage(message).hint(format!("{say}{anyway}"))
}

/// Instructions that are near to a reading, and in which every word is used: its steps in plain words, with each of the objects that
/// the last one may mean.
fn whole_readings(instruction: &str, reading: &InstructionReading, objects: &[Placed<'_>], from: Option<Pose>) -> Vec<String> {
    let names = |step: &ReadStep| -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        let meant = step.candidates.iter().filter_map(|id| objects.iter().find(|object| object.tags.id == *id));
        for name in meant.map(|object| object.tags.words()).chain(step.alike.iter().cloned()) {
            if !names.contains(&name) {
                names.push(name);
            }
        }
        names
    };
    let Some((last, before)) = reading.steps.split_last() else { return Vec::new() };
    let before: Option<Vec<String>> = before.iter().map(|step| Some(said(step.verb, names(step).first()?))).collect();
    let Some(before) = before else { return Vec::new() };
    let demanded = limits(instruction).0.into_iter().filter(|limit| !matches!(limit.demand, Demand::Unmeasured(_)));
    let kept: Vec<String> = demanded.map(|limit| limit.words).collect();
    let sentence = |name: &String| {
        let steps: Vec<String> = before.iter().cloned().chain([said(last.verb, name)]).collect();
        let steps = steps.join(", then ");
        // The limits of the instruction go with each reading.
        kept.iter().fold(steps, |text, words| format!("{text}, {words}"))
    };
    let is_whole = |text: &String| {
        let again = read_instruction(text, objects, from);
        account(text, objects, from).unused.is_empty()
            && again.steps.len() == reading.steps.len()
            && again.steps.iter().zip(&reading.steps).all(|(again, step)| {
                let is_same = |id: &u16| step.candidates.is_empty() || step.candidates.contains(id);
                !again.candidates.is_empty() && again.candidates.iter().all(is_same)
            })
    };
    names(last).iter().map(sentence).filter(is_whole).take(READINGS).collect()
}

/// Maximum number of readings that are offered.
const READINGS: usize = 4;

/// A step in plain words.
fn said(verb: Verb, name: &str) -> String {
    let verb = match verb {
        Verb::GoTo => "fly to",
        Verb::Through => "fly through",
        Verb::Around => "fly around",
        Verb::Over => "fly over",
        Verb::Up => "fly up",
        Verb::Behind => "fly behind",
        Verb::Scan => return "look around".to_owned(),
        Verb::Follow => "follow",
    };
    format!("{verb} the {name}")
}

/// Reads the instructions that are given in flight.
#[derive(Clone, Default)]
pub struct Reader {
    /// The scene and the start, where the oracle reads; `None` where a model does.
    scene: Option<(Arc<LoadedScene>, Option<Pose>)>,
}

impl Reader {
    /// A reader for the oracle in a scene. The objects are those that are there at the start of the flight, seen from there.
    pub fn of_oracle(loaded: &Arc<LoadedScene>, start: Option<Pose>) -> Self {
        Self { scene: Some((loaded.clone(), start)) }
    }

    /// A reader where a model reads: it looks for limits only.
    pub fn of_model() -> Self {
        Self { scene: None }
    }

    fn lines(&self, text: &str, given: Given) -> Result<Vec<String>, Error> {
        refuse_in_flight(text)?;
        match &self.scene {
            Some((loaded, start)) => Ok(lines(text, loaded, *start, given, false)?),
            None => Ok(Vec::new()),
        }
    }

    /// How an instruction of the page is read, one line; or why it is not flown, in words for a person.
    pub fn understood(&self, text: &str) -> Result<String, String> {
        self.lines(text, Given::OnPage).map(|lines| lines.join("; ")).map_err(|error| format!("error: {error}"))
    }

    /// The lines for an instruction that a script gives at this time.
    ///
    /// # Errors
    /// As for [`lines`].
    pub fn scripted(&self, at: Time, text: &str) -> Result<Vec<String>, Error> {
        let lines = self.lines(text, Given::ByScript)?;
        let at = at.since(Time::ZERO).as_secs_f64();
        Ok(lines.into_iter().map(|line| format!("new instruction at {at} s {line}")).collect())
    }

    /// Of what was typed, what is passed to the pilot, and the lines to print. An instruction of which nothing is understood is
    /// not passed on, and the drone goes on holding.
    pub fn admit(&self, pressed: Pressed) -> (Vec<OperatorEvent>, Vec<String>) {
        let mut printed: Vec<String> = pressed.hint.map(str::to_owned).into_iter().collect();
        let mut admitted = Vec::with_capacity(pressed.events.len());
        let mut refused = false;
        for event in pressed.events {
            // The resumption that belongs to a typed instruction is refused with it.
            let resumes = core::mem::take(&mut refused) && event == OperatorEvent::Resume;
            match &event {
                OperatorEvent::Instruction(text) => match self.lines(text, Given::ByKeys) {
                    Ok(lines) => printed.extend(lines),
                    Err(error) => {
                        printed.push(format!(
                            "error: {error}\nThe drone holds position: T resumes the last instruction, Enter opens the prompt again."
                        ));
                        refused = true;
                        continue;
                    }
                },
                _ if resumes => continue,
                _ => {}
            }
            admitted.push(event);
        }
        (admitted, printed)
    }
}

fn not_understood(instruction: &str, reading: &InstructionReading, loaded: &LoadedScene, given: Given) -> Error {
    if reading.is_foreign {
        let what = format!("the oracle reads English only, and cannot parse \"{}\"", one_line(instruction));
        return Error::usage(what).hint(
            "give the instruction in English, or let a real model read it, as with `--vlm gemini` or `--vlm ollama#MODEL` \
             (`spf vlm list` lists all)",
        );
    }
    let mut named = BTreeSet::new();
    let unknown: Vec<String> = reading
        .steps
        .iter()
        .flat_map(|step| &step.unknown)
        .filter(|unknown| named.insert(&unknown.word))
        .map(unknown_word)
        .collect();
    let directions: Vec<String> = reading.directions.iter().map(|words| format!("`{}`", one_line(words))).collect();
    let things = || loaded.tags.iter().filter(|tags| !tags.opening && !tags.is_surface()).map(Tagged::words);
    let typed = |target: &String| !target.is_empty() && instruction.to_lowercase().contains(target.as_str());
    let nothing = reading.steps.iter().map(|step| one_line(&step.target)).find(typed);
    let limit = limits(instruction).0.first().filter(|_| reading.steps.is_empty()).map(|limit| one_line(&limit.words));
    let why = match (unknown.is_empty(), directions.is_empty(), nothing, limit) {
        (false, ..) => unknown.join(", "),
        (true, false, ..) => format!("{} names no object to fly to", directions.join(", ")),
        (true, true, Some(nothing), _) => format!("`{nothing}` is no object that the oracle knows"),
        (true, true, None, Some(limit)) => {
            let to = things().next().unwrap_or_default();
            format!("`{limit}` alone is no destination; say where to fly too, as in \"fly to the {to}, keep 3 m away\"")
        }
        (true, true, None, None) => "it names no object to fly to".to_owned(),
    };
    // One unknown word is a slip or a name; several without a known one are another language.
    let language = if unknown.len() > 1 && reading.directions.is_empty() { ", which reads English only," } else { "" };
    let advice = if unknown.is_empty() { format!("name an object ({}); ", given.advice()) } else { String::new() };
    let mut seen = BTreeSet::new();
    let examples: Vec<String> = things().filter(|words| seen.insert(words.clone())).take(EXAMPLES).collect();
    Error::usage(format!("the oracle{language} cannot parse \"{}\": {why}", one_line(instruction))).hint(format!(
        "{advice}objects in {scene} include: {}; `spf sim scenes {scene} --say` lists what can be said",
        examples.join(", "),
        scene = loaded.scene.name
    ))
}

/// A word that was not understood, with a likely intended one.
fn unknown_word(unknown: &UnknownWord) -> String {
    let near = unknown.nearest.as_ref().map_or(String::new(), |near| format!("; did you mean `{near}`?"));
    format!("unknown word `{}`{near}", one_line(&unknown.word))
}

/// One step: its action and its target.
fn described(step: &ReadStep, tags: &[Tagged]) -> String {
    let verb = match step.verb {
        Verb::GoTo => "fly to",
        Verb::Through => "fly through",
        Verb::Around => "fly around",
        Verb::Over => "fly over",
        Verb::Up => "climb",
        Verb::Behind => "fly behind",
        Verb::Scan => "look around",
        Verb::Follow => "follow",
    };
    let target = one_line(&step.target);
    let names: BTreeSet<String> =
        step.candidates.iter().filter_map(|id| tags.iter().find(|tags| tags.id == *id)).map(Tagged::words).collect();
    let several = step.candidates.len();
    match (names.first(), names.len()) {
        (Some(name), 1) if several == 1 => format!("{verb} → {name}"),
        (Some(name), 1) => format!("{verb} → {name} ({several} candidates)"),
        (Some(_), _) => {
            let named = names.iter().take(3).cloned().collect::<Vec<_>>().join(", ");
            let more = if names.len() > 3 { ", …" } else { "" };
            format!("{verb} → {target} ({several} candidates: {named}{more})")
        }
        (None, _) if target.is_empty() => verb.to_owned(),
        (None, _) => match step.unknown.first() {
            Some(unknown) => format!("{verb} → {target} ({})", unknown_word(unknown)),
            None if !step.is_understood() => format!("{verb} → {target} (no object that the oracle knows)"),
            None if step.alike.is_empty() => {
                format!("{verb} → {target} (not in this scene; the drone will search for it)")
            }
            None => format!(
                "{verb} → {target} (not in this scene, closest in meaning is {}; the drone will search for it)",
                step.alike.join(" or ")
            ),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_flown_is_named_as_it_was_typed() {
        let city = LoadedScene::load("city").unwrap();
        for (text, named) in [
            ("hover for a minute", "`minute` is no object"),
            ("go everywhere except the bridge", "`everywhere` is no object"),
            ("go to the church and wait a minute", "no use for \"minute\" in"),
            ("quickly", "`quickly` alone is no destination"),
            ("what's behind the church", "no use for \"what's\""),
            (
                "keep 3 metres away from the taxi",
                "`keep 3 metres away from the taxi` alone is no destination; say where to fly too",
            ),
            ("go to the lamp in the car park", "no use for \"in the car park\""),
            ("fly to the roof of the church", "no use for \"roof\""),
            ("go to the opposite side of the taxi", "no use for \"opposite side\""),
        ] {
            let refused = lines(text, &city, None, Given::AsArgument, false).map_err(Error::from).unwrap_err().to_string();
            assert!(refused.contains(named), "{text}: {refused}");
        }
        // A verb that ends a name is none, and tags tell what is in the car park.
        for (text, read) in [
            ("first the church, then the bus stop", "reads: fly to → cream church; then fly to → grey bus stop"),
            ("stop in front of the bus", "reads: fly to → red bus"),
            ("go to the red car in the car park", "reads: fly to → red car"),
        ] {
            assert_eq!(lines(text, &city, None, Given::AsArgument, false).unwrap(), [read], "{text}");
        }
    }

    #[test]
    fn an_instruction_in_flight_is_read_and_one_that_says_nothing_is_not_flown() {
        let reader = Reader::of_oracle(&Arc::new(LoadedScene::load("city").unwrap()), None);
        let typed =
            |text: &str| Pressed { events: vec![OperatorEvent::Instruction(text.to_owned()), OperatorEvent::Resume], hint: None };
        let (events, lines) = reader.admit(typed("go to teh red cran"));
        assert_eq!(events, typed("go to teh red cran").events);
        assert_eq!(lines[0], "reads: fly to → red tower crane");
        assert!(lines.iter().any(|line| line.starts_with("spelling: ")));
        // Words that nothing uses, and limits, which are fixed at take-off, by whatever model.
        for (reader, text, why) in [
            (reader.clone(), "go to the red crane from above", "no use for \"from above\""),
            (reader.clone(), "go slowly to the red crane", "\"slowly\" from now on"),
            (Reader::of_model(), "go slowly to the red crane", "\"slowly\" from now on"),
        ] {
            let (events, lines) = reader.admit(typed(text));
            assert!(events.is_empty() && lines[0].contains(why), "{lines:?}");
        }
        assert_eq!(Reader::of_model().admit(typed("fly from above")).0, typed("fly from above").events);
        // The resumption is refused with it, a later one is not: it resumes what was flown before.
        let (events, lines) = reader.admit(typed("qwertzuiop"));
        assert_eq!(events, []);
        assert!(lines[0].contains("unknown word `qwertzuiop`") && lines[0].contains("The drone holds"), "{lines:?}");
        let resume = Pressed { events: vec![OperatorEvent::Resume], hint: Some("a hint") };
        assert_eq!(reader.admit(resume), (vec![OperatorEvent::Resume], vec!["a hint".to_owned()]));
        assert!(reader.scripted(Time::from_secs_f64(12.0), "qwertzuiop").is_err());
        // How one lands is said as it is done there: the page has no flags and no keys L and W.
        let on_page = reader.understood("land").unwrap_err();
        assert!(on_page.contains("press Land") && !on_page.contains("--realtime") && !on_page.contains("by itself"), "{on_page}");
        assert!(reader.admit(typed("land")).1[0].contains("press L;"));
        let lines = reader.scripted(Time::from_secs_f64(12.0), "fly to the church").unwrap();
        assert_eq!(lines, ["new instruction at 12 s reads: fly to → cream church"]);
    }
}
