//! The craft that an assistant flies: the program's settings, for one flight after the other.

use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use spf_cockpit::{ArmAssistant, Cockpit, ReadInstruction};
use spf_flight::flight::{FlightPlan, Flown};
use spf_flight::recorder::RecordPlan;
use spf_flight::run::Observer;
use spf_mcp::deck::{Deck, Hangar, Seat, Wanted};
use spf_record::OutDir;
use spf_vlm::human::HUMAN;

use crate::args::Fly;
use crate::background::PrintThread;
use crate::commands::fly::{Assistant, Others, Ready, flight_error, instruction_reader, opening, page, refusal, result};
use crate::commands::vlm::{Pace, is_human, pointing};
use crate::error::CliError;
use crate::printer::Printer;
use crate::progress::{Control, Progress};
use crate::settings::{DroneName, Settings};

/// How long a flight may take if nothing else is said, seconds: an assistant thinks between two steps.
const MAX_TIME_S: &str = "900";

/// The program's side of a [`Deck`].
pub(super) struct Craft {
    /// The command's flags, with any instruction.
    flight: Fly,
    /// What they, the files and the environment say at the start: no file that somebody changes later changes the drone or its limits.
    settings: Settings,
    cockpit: Option<Cockpit>,
    folder: PathBuf,
    /// In a few words.
    words: String,
    /// Who answers, in a sentence; `None` if only the assistant points.
    answers: Option<String>,
    /// Anything but the embedded simulator: what is at an address, only the operator knows.
    real: bool,
    scene: String,
    /// How instructions are read in a scene.
    reader: Mutex<Option<(String, ReadInstruction)>>,
}

impl Craft {
    /// Checks the settings, as far as that is possible without the craft.
    pub(super) fn new(flight: Fly, settings: &Settings, cockpit: Option<Cockpit>, folder: PathBuf) -> Result<Self, CliError> {
        let mut settings = settings.clone();
        let is_sim = matches!(settings.fly.drone.or_default()?, DroneName::Sim);
        if !is_sim {
            settings.fly.vlm.default_to(spf_vlm::setup::AUTO);
        }
        let answers = if is_human(settings.fly.vlm.text_or_default()) {
            None
        } else {
            match pointing(&settings, None, Pace::Wall) {
                Ok(pointing) => Some(pointing.sentence),
                // A drone without a model is flown by the assistant alone.
                Err(_) if !settings.fly.vlm.is_given() => None,
                Err(error) => return Err(error),
            }
        };
        let scene = settings.fly.scene.text_or_default().to_owned();
        // A scene that is not there is told now, and not to an assistant.
        let reader = if is_sim { Some((scene.clone(), instruction_reader(&settings)?.0)) } else { None };
        let words = if is_sim {
            in_scene(&scene)
        } else {
            let name = settings.fly.drone.text_or_default();
            // Without its address.
            name.split([':', '@', '#']).next().unwrap_or(name).to_owned()
        };
        settings.fly.max_time_s.default_to(MAX_TIME_S);
        if answers.is_none() {
            settings.fly.vlm.argument("--vlm", HUMAN);
        }
        // Many flights: each in a folder of its own.
        settings.fly.out.argument("--out", "");
        Ok(Self {
            flight,
            settings,
            cockpit,
            folder,
            words,
            answers,
            real: !is_sim,
            scene: if is_sim { scene } else { String::new() },
            reader: Mutex::new(reader),
        })
    }

    pub(super) fn is_real_craft(&self) -> bool {
        self.real
    }

    pub(super) fn in_words(&self) -> String {
        self.words.clone()
    }

    pub(super) fn scene(&self) -> Option<&str> {
        Some(self.scene.as_str()).filter(|scene| !scene.is_empty())
    }

    /// What is said at the start.
    pub(super) fn greeting(&self) -> Vec<String> {
        let answers = self.answers.clone().unwrap_or_else(|| "VLM: none. The assistant points.".to_owned());
        let mut lines = vec![format!("Drone: {}. {answers}", self.words)];
        if self.real {
            lines.push(
                "A real drone: nothing moves before the assistant is armed, in the cockpit or by `spf mcp arm`.".to_owned(),
            );
        }
        lines
    }

    /// Lets the cockpit arm the assistant.
    pub(super) fn let_arm(&self, deck: &Arc<Deck>) {
        let Some(cockpit) = &self.cockpit else { return };
        let armed = Arc::downgrade(deck);
        let arm = move |minutes: u8| {
            let Some(deck) = armed.upgrade() else { return };
            match minutes {
                0 => deck.disarm(),
                minutes => deck.arm(Duration::from_secs(60 * u64::from(minutes))),
            }
        };
        cockpit.host_assistant(&self.words, self.real.then(|| Box::new(arm) as ArmAssistant));
    }

    fn settings(&self, wanted: &Wanted) -> Result<Settings, CliError> {
        let mut settings = self.settings.clone();
        if let Some(scene) = &wanted.scene {
            if self.scene.is_empty() {
                return Err(CliError::usage("a scene is for the simulated craft"));
            }
            // A name alone: no file that somebody else has put somewhere.
            if !spf_scene::Scene::built_in().contains(&scene.as_str()) {
                return Err(CliError::usage(format!("there is no built-in scene `{scene}`")).hint("`list_scenes` lists them"));
            }
            settings.fly.scene.argument("scene", scene);
        }
        Ok(settings)
    }

    fn flown(&self, wanted: &Wanted, seat: Seat) -> Result<Flown, CliError> {
        let Seat { operator, orders, mut watch, pointing, given_up, folder } = seat;
        let printer = Printer::new(true);
        let mut settings = self.settings(wanted)?;
        let assistant = Assistant { pointing: &pointing, has_instructed: wanted.instruction.is_some() };
        let others = Others { cockpit: self.cockpit.as_ref(), assistant: Some(assistant) };
        let flight = Fly { instruction: wanted.words().to_owned(), anyway: false, flight: self.flight.flight.clone() };
        let ready = opening::ready(&flight, &mut settings, wanted.words(), others, &printer)?;
        let Ready { plan, announcements, by_hand, reader, .. } = ready;
        if given_up.load(Ordering::Relaxed) {
            return Err(CliError::aborted("stopped before take-off"));
        }
        let out = OutDir::fresh(&self.folder, wanted.words())
            .map_err(|error| CliError::usage("no folder for the flight's files").because(&error))?;
        drop(folder.set(out.path().to_owned()));
        if let (Some(cockpit), Some(craft)) = (&self.cockpit, by_hand) {
            // Whoever watches and is gone watches no longer: it holds, and lands.
            cockpit.begin(page::controls(orders, craft, reader, true));
        }
        let record = RecordPlan { out: out.clone(), video: settings.fly.video.is_on()?, view: None };
        let plan = FlightPlan { record: Some(record), operator: Some(operator), ..plan };
        announcements.iter().for_each(|line| printer.log(line));
        let (talk, lines) = PrintThread::start(printer, true);
        let mut progress = Progress::new(lines, Control::None);
        let mut instruments = self.cockpit.as_ref().map(Cockpit::instruments);
        let mut observers: Vec<&mut dyn Observer> = vec![&mut watch, &mut progress];
        if let Some(instruments) = &mut instruments {
            observers.push(instruments);
        }
        let flown = spf_flight::flight::fly(plan, &mut observers);
        drop(progress);
        let printer = talk.finish();
        let flown = flown.map_err(|error| {
            out.give_back();
            flight_error(&error)
        })?;
        for problem in &flown.recording_problems {
            printer.log(&format!("warning: recording failed: {problem}"));
        }
        if let Some(cockpit) = &self.cockpit {
            cockpit.end(&page::end(&flown, result(&flown.summary), out.path()));
        }
        printer.log(&format!("files: {}", out.path().display()));
        Ok(flown)
    }
}

fn in_scene(scene: &str) -> String {
    format!("simulated, in the scene {scene}")
}

impl Hangar for Craft {
    fn craft(&self, scene: Option<&str>) -> String {
        scene.filter(|_| !self.scene.is_empty()).map_or_else(|| self.words.clone(), in_scene)
    }

    fn answers(&self) -> Option<String> {
        self.answers.clone()
    }

    fn is_real(&self) -> bool {
        self.real
    }

    fn read(&self, wanted: &Wanted) -> Result<String, String> {
        let settings = self.settings(wanted).map_err(|error| error.to_string())?;
        let Some(instruction) = &wanted.instruction else { return Ok(String::new()) };
        let printer = Printer::new(true);
        if refusal::is_on(&settings, true).map_err(|error| error.to_string())? {
            refusal::check(&settings, instruction, &printer).map_err(|error| error.to_string())?;
        }
        let scene = settings.fly.scene.text_or_default().to_owned();
        let mut reader = self.reader.lock().unwrap_or_else(PoisonError::into_inner);
        let read = match &*reader {
            Some((known, read)) if *known == scene => read.clone(),
            _ => {
                let (read, _) = instruction_reader(&settings).map_err(|error| error.to_string())?;
                *reader = Some((scene, read.clone()));
                read
            }
        };
        drop(reader);
        read(instruction)
    }

    fn fly(&self, wanted: Wanted, seat: Seat) -> Result<Flown, String> {
        self.flown(&wanted, seat).map_err(|error| {
            let told = error.to_string();
            Printer::new(true).log(&format!("error: {told}"));
            if let Some(cockpit) = &self.cockpit {
                cockpit.refuse(&told);
            }
            told
        })
    }
}
