//! `spf screen calibrate`.

use std::sync::atomic::Ordering;

use spf_drone::screen::calibrate::{CalibrateError, Found, Known, Measured, calibrate as measure};
use spf_drone::screen::settings::ScreenSettings;
use spf_screen::profile::{Change, Profile, edited};

use super::profile;
use crate::args::ScreenCalibrate;
use crate::commands::display::failed;
use crate::commands::fly::signals::flight_interrupts;
use crate::commands::sim::write;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::{Printer, table};

pub(super) fn calibrate(args: &ScreenCalibrate, printer: &Printer) -> Result<Exit, CliError> {
    let height = args.height.ok_or_else(|| {
        CliError::usage("--height is missing: a picture has no scale, so that one length must be known")
            .hint("give the height of the camera above flat ground after the take-off, metres: --height 3.3")
    })?;
    for (flag, metres, least) in [("--height", height, 0.2), ("--room", args.room, 1.0)] {
        if !(least..=500.0).contains(&metres) {
            return Err(CliError::usage(format!("{flag}: `{metres}` is not a number of metres from {least} to 500")));
        }
    }
    if !args.overwrite && args.output.symlink_metadata().is_ok() {
        return Err(CliError::usage(format!("--output: `{}` exists", args.output.display()))
            .hint("use --overwrite to replace it, or another file with -o FILE"));
    }
    let known = profile(&args.profile)?;
    let text = Profile::text(&args.profile).map_err(|error| CliError::usage("cannot read the profile").because(&error))?;
    let interrupted = flight_interrupts(true)?;
    printer.log(&format!(
        "Keys of this display are pressed for the window with {} for about two minutes, as long as it has the focus: do not type. Clicking on \
         another window, or Ctrl-C, ends this and releases them. The craft needs {} m of free space to each side.",
        known.window.name(), args.room
    ));
    let stop = || interrupted.load(Ordering::Relaxed) > 0;
    let lengths = Known { height, room: args.room };
    let measured = measure(&known, &ScreenSettings::default(), lengths, &stop, &mut |what| printer.log(what));
    let found = measured.map_err(|error| match &error {
        CalibrateError::Screen(screen) => failed(screen),
        CalibrateError::Interrupted => CliError::aborted("interrupted; the keys are released"),
        _ => CliError::failed(error.to_string()),
    })?;
    printer.result(&table(&lines(&found, &known)));
    if found.rows.iter().all(|row| row.runs == [None, None]) {
        return Err(CliError::failed("nothing moved in the picture; no file was written")
            .hint("check that the game takes the keys of the profile, and that ground with a pattern is in view"));
    }
    for row in &found.rows {
        if let Some(warning) = warning(row) {
            printer.log(&format!("warning: {warning}"));
        }
    }
    let name: String = args.profile.chars().filter(|letter| !letter.is_control()).take(100).collect();
    let mut changes = found.changes;
    changes.push(("source", Change::Text(format!("Measured by `spf screen calibrate {name} --height {height}`"))));
    let text = edited(&text, &changes).and_then(|text| Profile::parse(&text).map(|_| text));
    let text = text.map_err(|error| CliError::failed("what was measured fits no profile").because(&error))?;
    write(&args.output, text.as_bytes())?;
    printer.result(&format!("file: {}", args.output.display()));
    printer.log(&format!(
        "The craft does not end where it began: before another run, bring it back to {height} m above ground, in level view."
    ));
    let guessed: Vec<String> = found
        .rows
        .iter()
        .filter(|row| row.rate().is_none_or(|rate| rate <= 0.0 && row.key != "mouse"))
        .map(|row| format!("{} by `{}`", row.axis, row.key))
        .collect();
    if guessed.is_empty() {
        return Ok(Exit::Success);
    }
    let (many, all) = (guessed.len(), found.rows.len());
    Err(CliError::failed(format!(
        "{many} of {all} rates were not confirmed by two runs, and are not in the file: {}",
        guessed.join(", ")
    ))
    .hint("their rates in the file are still guesses: do not fly with it; close menus of the game, and run this again"))
}

/// The table of what was measured.
fn lines(found: &Found, profile: &Profile) -> Vec<Vec<String>> {
    let mut lines = vec![["axis", "key", "in the profile", "first run", "second run"].map(str::to_owned).to_vec()];
    let seen = |now: Option<f64>, unit: &str| now.map_or_else(|| "not seen".to_owned(), |now| format!("{now:.3} {unit}"));
    for row in &found.rows {
        let unit = match (row.axis, row.key.as_str()) {
            ("yaw", "mouse") => "°/pixel",
            ("yaw", _) => "°/s",
            _ => "m/s",
        };
        let [one, two] = row.runs.map(|run| seen(run, unit));
        lines.push(vec![row.axis.to_owned(), row.key.clone(), format!("{:.3} {unit}", row.before), one, two]);
    }
    for (name, before, now) in
        [("dead time", profile.controls.dead_time_s, found.dead_time), ("lag", profile.controls.lag_s, found.lag)]
    {
        lines.push(vec![name.to_owned(), String::new(), format!("{before:.3} s"), seen(now, "s")]);
    }
    if let Some(pictures) = found.pictures_per_s {
        lines.push(vec!["game".to_owned(), String::new(), String::new(), format!("{pictures:.1} pictures/s")]);
    }
    if let Some(pulses) = found.pulses {
        let before = format!("{} /s", profile.controls.pulse_hz);
        lines.push(vec!["pulses".to_owned(), String::new(), before, format!("{pulses} /s, which such a game notices")]);
    }
    lines
}

/// What is doubtful about a line.
fn warning(row: &Measured) -> Option<String> {
    let Measured { axis, key, before, runs, is_steady } = row;
    match row.rate() {
        None => {
            let what = if runs.contains(&None) { "not seen twice" } else { "not the same twice" };
            Some(format!(
                "{axis} by `{key}` was {what}, and stays as it was (as that of the other key, if it has no rate of its own): ground with a \
                 pattern, or things all around, must be in view"
            ))
        }
        Some(rate) if key == "mouse" => (rate * before < 0.0).then(|| {
            "the mouse turns the other way than the profile says: does the game look straight ahead, and not up or down?"
                .to_owned()
        }),
        Some(rate) if rate < 0.0 => {
            Some(format!("{axis} by `{key}` goes the other way, and stays as it was: exchange `plus` and `minus` in the profile"))
        }
        Some(_) if !is_steady => Some(format!(
            "{axis} by `{key}` was still changing when the key was released: with more --room it is measured better"
        )),
        Some(_) => None,
    }
}
