//! The cockpit of a flight: its page, beside the terminal.

use std::net::SocketAddr;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::Sender;
use std::time::Duration;

use qrcode::QrCode;
use qrcode::render::unicode::Dense1x2;
use spf_cockpit::{Cockpit, FlightControls, FlightEnd, Flights, ReadInstruction};
use spf_core::craft::Craft;
use spf_core::prompt::PromptText;
use spf_flight::flight::Flown;
use spf_flight::pointing::Pointer;
use spf_flight::sim::VlmFactory;
use spf_flight::words;
use spf_pilot::OperatorEvent;
use spf_vlm::Vlm;
use spf_vlm::human::HUMAN;

use super::{Assistant, Others};
use crate::background;
use crate::commands::vlm::{Pace, Pointing, is_human, pointing as of_settings};
use crate::error::CliError;
use crate::printer::Printer;
use crate::settings::Settings;
use spf_api::reading::Reader;

/// The folder in which flights are recorded if nothing else is said.
pub(crate) const FLIGHTS: &str = "flights";
/// How often a wait looks at Ctrl-C and the page.
const LOOK_UP: Duration = Duration::from_millis(50);

/// Serves the page, and prints its address followed by `path`.
pub(crate) fn open(address: SocketAddr, flights: &Path, path: &str, printer: &Printer) -> Result<Cockpit, CliError> {
    let announce = Arc::new(|line: &str| background::say(line));
    let cockpit = Cockpit::open(address, Some(Flights::of(flights)), announce).map_err(|error| {
        CliError::usage("cannot open the cockpit").because(&error).hint("--cockpit=127.0.0.1:0 picks a free port")
    })?;
    let (fly, watch) = cockpit.urls();
    if path.is_empty() {
        printer.log(&format!("Cockpit: open {fly}"));
    } else {
        // What follows the `#` gives the right to delete.
        let (page, key) = fly.split_once('#').unwrap_or((&fly, ""));
        printer.log(&format!("Flights: open {page}{path}#key={key}"));
    }
    if !cockpit.address().ip().is_loopback() {
        qr_code(&fly).iter().for_each(|line| printer.log(line));
        printer.log(&format!("To watch only: {watch}"));
        printer.log("The address to fly works once.");
    }
    if let Some(fingerprint) = cockpit.fingerprint() {
        printer
            .log("The browser warns, because nobody vouches for the certificate: it was made a moment ago. Compare its SHA-256:");
        printer.log(&format!("  {fingerprint}"));
    }
    Ok(cockpit)
}

/// An address as a QR code, for a phone's camera; the lines of a dark terminal. None if the address is too long for one.
fn qr_code(url: &str) -> Vec<String> {
    let Ok(code) = QrCode::new(url) else { return Vec::new() };
    let drawn = code.render::<Dense1x2>().dark_color(Dense1x2::Light).light_color(Dense1x2::Dark).build();
    drawn.lines().map(str::to_owned).collect()
}

/// Waits until the page is open that will fly; false if the user ends the program first.
pub(super) fn wait_for_pilot(cockpit: &Cockpit, interrupts: &AtomicU32, printer: &Printer) -> bool {
    if !cockpit.has_pilot() {
        printer.log("The drone takes off when the page is open. Ctrl-C ends.");
    }
    while !cockpit.has_pilot() {
        if interrupts.load(Ordering::Relaxed) > 0 {
            return false;
        }
        std::thread::sleep(LOOK_UP);
    }
    true
}

/// The operator's side of a flight, for the page.
pub(crate) fn controls(operator: Sender<OperatorEvent>, craft: Craft, reader: Reader, only: bool) -> FlightControls {
    let read = read_by(reader);
    FlightControls { operator, craft, read, only }
}

/// How a flight ended, for the page: the figures of its summary.
pub(crate) fn end(flown: &Flown, result: Vec<String>, folder: &Path) -> FlightEnd {
    FlightEnd {
        outcome: words::outcome(flown.summary.outcome).to_owned(),
        result,
        flight_time_s: flown.summary.finished_at_s,
        path_length_m: flown.summary.path_length_m,
        files: folder.display().to_string(),
        problems: flown.recording_problems.clone(),
    }
}

/// How an instruction is read.
pub(super) fn read_by(reader: Reader) -> ReadInstruction {
    Arc::new(move |text: &str| reader.understood(text))
}

/// The VLM of a flight. With a cockpit a person points in the page instead of typing, and may correct any other VLM; so may an
/// assistant.
pub(super) fn pointing(
    others: Others<'_>,
    settings: &Settings,
    prompt: Option<Arc<PromptText>>,
    pace: Pace,
) -> Result<Pointing, CliError> {
    let pointing = match (others.assistant, others.cockpit) {
        (Some(Assistant { pointing: shared, .. }), _) => {
            let shared = shared.clone();
            pointed(settings, prompt, pace, "VLM: none. The assistant points.", move |other| {
                Pointer::new(shared.clone(), Arc::new(|_| {}), other)
            })?
        }
        (None, Some(cockpit)) => {
            let pointers = cockpit.pointers();
            return pointed(settings, prompt, pace, "VLM: you. Click in the cockpit's picture to point.", pointers);
        }
        (None, None) => return of_settings(settings, prompt, pace),
    };
    let Some(cockpit) = others.cockpit else { return Ok(pointing) };
    // Whoever looks at the page corrects the assistant too.
    let (pointers, inner) = (cockpit.pointers(), pointing.vlm_factory);
    let vlm_factory: VlmFactory = Arc::new(move |world, seed| Ok(Box::new(pointers(Some(inner(world, seed)?))) as Box<dyn Vlm>));
    Ok(Pointing { vlm_factory, ..pointing })
}

/// The VLM of the settings behind somebody who points, or, with `--vlm human`, nobody else.
fn pointed(
    settings: &Settings,
    prompt: Option<Arc<PromptText>>,
    pace: Pace,
    alone: &str,
    pointers: impl Fn(Option<Box<dyn Vlm>>) -> Pointer + Send + Sync + 'static,
) -> Result<Pointing, CliError> {
    if is_human(settings.fly.vlm.text_or_default()) {
        return Ok(Pointing {
            name: HUMAN.to_owned(),
            vlm_factory: Arc::new(move |_, _| Ok(Box::new(pointers(None)) as Box<dyn Vlm>)),
            is_oracle: false,
            sentence: alone.to_owned(),
            latency: None,
            program: None,
            lists_boxes: false,
        });
    }
    let pointing = of_settings(settings, prompt, pace)?;
    let inner = pointing.vlm_factory;
    let vlm_factory: VlmFactory = Arc::new(move |world, seed| Ok(Box::new(pointers(Some(inner(world, seed)?))) as Box<dyn Vlm>));
    Ok(Pointing { vlm_factory, ..pointing })
}
