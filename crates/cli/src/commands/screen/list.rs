//! `spf screen list`.

use spf_screen::area::{Area, Region};
use spf_screen::profile::Profile;

use super::display;
use crate::commands::display::failed;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::{Printer, one_line, table};

pub(super) fn list(printer: &Printer) -> Result<Exit, CliError> {
    let mut rows = vec![row("profile", "window", "about")];
    for name in Profile::names() {
        if let Some(profile) = Profile::shipped(name) {
            rows.push(row(name, &profile.window.name().to_string(), &profile.about));
        }
    }
    printer.result(&table(&rows));
    let display = display()?;
    let mut rows = vec![row("monitor", "where", "")];
    for monitor in display.monitors().map_err(|error| failed(&error))? {
        rows.push(row(&monitor.name, &place(&monitor.area), if monitor.primary { "primary" } else { "" }));
    }
    printer.result(&format!("\n{}", table(&rows)));
    let mut rows = vec![["title", "class", "where", ""].map(str::to_owned).to_vec()];
    for window in display.windows().map_err(|error| failed(&error))?.iter().rev() {
        let hidden = display.hidden(window.id, &Region::WHOLE).map_err(|error| failed(&error))?;
        let state = match hidden {
            Some(hidden) => one_line(&hidden.to_string()),
            None if window.focused => "has the focus".to_owned(),
            None => String::new(),
        };
        let class = window.classes.last().cloned().unwrap_or_default();
        rows.push(vec![one_line(&window.title), one_line(&class), place(&window.area), state]);
    }
    printer.result(&format!("\n{}", table(&rows)));
    Ok(Exit::Success)
}

fn row(name: &str, place: &str, state: &str) -> Vec<String> {
    [name, place, state].map(str::to_owned).to_vec()
}

fn place(area: &Area) -> String {
    format!("{}×{} at {},{}", area.width, area.height, area.x, area.y)
}
