//! `spf mcp arm`: the operator's consent, typed in a terminal, for a server that another program has started.
//!
//! Server and command meet in a folder of the user's own: the server keeps a file there that tells what it flies, the command
//! puts one beside it that says for how long.

use std::io::{BufRead as _, IsTerminal as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Weak};
use std::time::{Duration, SystemTime};

use serde::{Deserialize, Serialize};
use spf_mcp::deck::Deck;

use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;

/// How often a server says that it is there, and looks whether it is armed.
const BEAT: Duration = Duration::from_secs(1);
const LOOK_UP: Duration = Duration::from_millis(100);
/// A server that has said nothing for so long is gone.
const GONE: Duration = Duration::from_secs(10);
/// How long the command waits until its server has read what it wrote.
const TAKEN: Duration = Duration::from_secs(3);

/// What a server tells of itself.
#[derive(Debug, Serialize, Deserialize)]
struct Told {
    drone: String,
    process: u32,
}

/// What the command tells a server.
#[derive(Debug, Serialize, Deserialize)]
struct Armed {
    minutes: u8,
}

/// The folder where both meet, which nobody else can write to.
fn meeting() -> Result<PathBuf, CliError> {
    // Not where the environment says: that of a client's programs is another than that of a terminal.
    let home = std::env::home_dir().ok_or_else(|| CliError::usage("no folder of the user's own is known").hint("set HOME"))?;
    let folder = home.join(".spf").join("mcp");
    std::fs::create_dir_all(&folder)
        .map_err(|error| CliError::internal(format!("cannot make `{}`", folder.display())).because(&error))?;
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        std::fs::set_permissions(&folder, std::fs::Permissions::from_mode(0o700))
            .map_err(|error| CliError::internal(format!("`{}` is not this user's", folder.display())).because(&error))?;
    }
    Ok(folder)
}

/// A server's place in that folder, for as long as it lives.
pub(super) struct Desk {
    path: PathBuf,
    stop: Arc<AtomicBool>,
}

impl Desk {
    /// Tells of a server, and arms its deck when somebody says so.
    pub(super) fn open(deck: &Arc<Deck>, drone: &str) -> Result<Self, CliError> {
        let failed =
            |error: &dyn std::error::Error| CliError::internal("cannot tell `spf mcp arm` of this server").because(error);
        let path = meeting()?.join(format!("{}.json", std::process::id()));
        let told = Told { drone: drone.to_owned(), process: std::process::id() };
        let text = serde_json::to_string(&told).map_err(|error| failed(&error))?;
        // What somebody typed for a process that is gone is not for this one.
        drop(std::fs::remove_file(armed(&path)));
        std::fs::write(&path, &text).map_err(|error| failed(&error))?;
        let (stop, deck) = (Arc::<AtomicBool>::default(), Arc::downgrade(deck));
        let (watched, stopped) = (path.clone(), stop.clone());
        let thread = std::thread::Builder::new().name("consent".to_owned());
        thread.spawn(move || watch(&watched, &text, &stopped, &deck)).map_err(|error| failed(&error))?;
        Ok(Self { path, stop })
    }
}

impl Drop for Desk {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        drop(std::fs::remove_file(armed(&self.path)));
        drop(std::fs::remove_file(&self.path));
    }
}

fn armed(server: &Path) -> PathBuf {
    server.with_extension("armed")
}

fn watch(path: &Path, told: &str, stop: &AtomicBool, deck: &Weak<Deck>) {
    let mut beats = 0;
    while !stop.load(Ordering::Relaxed) {
        let Some(deck) = deck.upgrade() else { return };
        if let Ok(text) = spf_input::read_text(&armed(path)) {
            let is_fresh = age(&armed(path)).is_some_and(|age| age < GONE);
            // Once, whatever it says.
            if std::fs::remove_file(armed(path)).is_ok()
                && is_fresh
                && let Ok(Armed { minutes }) = serde_json::from_str(&text)
            {
                deck.arm(Duration::from_secs(60 * u64::from(minutes)));
                tracing::warn!("armed for {minutes} min and one flight, by `spf mcp arm`");
            }
        }
        drop(deck);
        beats += 1;
        if beats % (BEAT.as_millis() / LOOK_UP.as_millis()) == 0 && !stop.load(Ordering::Relaxed) {
            drop(std::fs::write(path, told));
        }
        std::thread::sleep(LOOK_UP);
    }
}

/// How long ago a file was written.
fn age(path: &Path) -> Option<Duration> {
    let written = std::fs::metadata(path).and_then(|data| data.modified()).ok()?;
    SystemTime::now().duration_since(written).ok()
}

/// The servers that are there.
fn servers(folder: &Path) -> Vec<(PathBuf, Told)> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().map_while(Result::ok).map(|entry| entry.path());
    let lives = |path: &PathBuf| age(path).is_some_and(|age| age < GONE);
    let mut found: Vec<(PathBuf, Told)> = entries
        .filter(|path| path.extension().is_some_and(|kind| kind == "json") && lives(path))
        .filter_map(|path| Some((path.clone(), serde_json::from_str(&spf_input::read_text(&path).ok()?).ok()?)))
        .collect();
    found.sort_by_key(|(_, told)| told.process);
    found
}

/// Asks for typed words, and arms the assistant of the server that is there.
pub(super) fn arm(minutes: u8, printer: &Printer) -> Result<Exit, CliError> {
    let terminal = std::io::stdin();
    if !terminal.is_terminal() {
        return Err(CliError::usage("arming is for a person at a terminal: standard input is none")
            .hint("type `spf mcp arm` in a terminal, or arm in the cockpit"));
    }
    let servers = servers(&meeting()?);
    let (path, Told { drone, process }) = match servers.as_slice() {
        [] => {
            return Err(CliError::usage("no `spf mcp` with a real drone runs under this user")
                .hint("start the assistant's client first; a simulated drone needs no arming"));
        }
        [server] => server,
        many => {
            for (number, (_, told)) in many.iter().enumerate() {
                printer.log(&format!("{}: drone {}, process {}", number + 1, told.drone, told.process));
            }
            printer.log("Which one? Type its number.");
            let chosen = line()?.parse::<usize>().ok().and_then(|number| many.get(number.checked_sub(1)?));
            chosen.ok_or_else(|| CliError::aborted("no such number: nothing is armed"))?
        }
    };
    printer.log(&format!(
        "The assistant of process {process} will be able to fly the drone `{drone}` for {minutes} min and one flight. Stand where you \
         see it; stop it with the cockpit, with Ctrl-C in the server's terminal, or by `stop` in the assistant."
    ));
    printer.log(&format!("Type `arm {drone}` to go on:"));
    if line()? != format!("arm {drone}") {
        return Err(CliError::aborted("not what was asked for: nothing is changed"));
    }
    let text = serde_json::to_string(&Armed { minutes }).map_err(|error| CliError::internal("cannot arm").because(&error))?;
    let cannot = |error: &dyn std::error::Error| CliError::internal("cannot arm").because(error);
    // In one step: the server never reads half of it.
    let half = path.with_extension("half");
    std::fs::write(&half, text).map_err(|error| cannot(&error))?;
    std::fs::rename(&half, armed(path)).map_err(|error| cannot(&error))?;
    let began = std::time::Instant::now();
    while armed(path).exists() {
        if began.elapsed() >= TAKEN {
            drop(std::fs::remove_file(armed(path)));
            return Err(CliError::failed("the server did not take it: nothing is armed").hint("is it still running?"));
        }
        std::thread::sleep(LOOK_UP);
    }
    printer.log(&format!("Armed for {minutes} min and one flight."));
    Ok(Exit::Success)
}

/// A line that somebody types.
fn line() -> Result<String, CliError> {
    let mut line = String::new();
    std::io::stdin().lock().read_line(&mut line).map_err(|error| CliError::internal("cannot read a line").because(&error))?;
    Ok(line.trim().to_owned())
}
