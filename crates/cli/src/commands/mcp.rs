//! `spf mcp`: an assistant that looks, flies and stops.

mod arm;
mod craft;

use std::net::{SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use spf_mcp::deck::{Deck, Patience};
use spf_mcp::server::{Secret, Server, serve_http, serve_stdio, url};

use self::craft::Craft;
use super::fly::page;
use super::fly::signals::interrupts;
use crate::args::{Mcp, McpCommand};
use crate::background;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;
use crate::settings::Settings;

/// How often the end looks at Ctrl-C and the flight.
const LOOK_UP: Duration = Duration::from_millis(50);
/// A token that the user has chosen.
const TOKEN: &str = "SPF_MCP_TOKEN";

/// Serves an assistant, or arms one.
pub(crate) fn mcp(args: &Mcp, printer: &Printer) -> Result<Exit, CliError> {
    if let Some(McpCommand::Arm { minutes }) = args.command {
        return arm::arm(minutes, printer);
    }
    let settings = Settings::of(&args.settings, printer)?;
    let folder = folder(settings.fly.out.text(), printer)?;
    let cockpit = settings.fly.cockpit.get()?;
    let cockpit = cockpit.map(|address| page::open(address, &folder, "", printer)).transpose()?;
    let craft = Arc::new(Craft::new(args.flight(""), &settings, cockpit, folder.clone())?);
    let real = craft.is_real_craft();
    let deck = Deck::new(craft.clone(), Patience::default())
        .map_err(|error| CliError::internal("cannot start a thread").because(&error))?;
    craft.let_arm(&deck);
    let desk = real.then(|| arm::Desk::open(&deck, &craft.in_words())).transpose()?;
    let server = Server::new(deck.clone(), folder, craft.scene());
    let server = if args.ask_in_client { server.asking_in_the_client() } else { server };
    craft.greeting().iter().for_each(|line| printer.log(line));
    let count = interrupts()?;
    let served = match args.http {
        None => {
            land_and_exit_on_signal(count, deck.clone())?;
            serve_stdio(server)
        }
        Some(address) => http(server, address, count, printer)?,
    };
    // What tells `spf mcp arm` of this server.
    drop(desk);
    served.map_err(|error| CliError::failed("the client's messages could not be read").because(&error))?;
    Ok(Exit::Success)
}

/// The folder in which flights are recorded: clients start programs in any folder, which may be one that nobody can write to.
fn folder(given: Option<&str>, printer: &Printer) -> Result<PathBuf, CliError> {
    if let Some(given) = given {
        return made(Path::new(given)).map_err(|error| CliError::usage(format!("--out: cannot make `{given}`")).because(&error));
    }
    let here = std::env::current_dir().map(|here| here.join(page::FLIGHTS));
    let home = std::env::home_dir().map(|home| home.join("spf").join(page::FLIGHTS));
    let found = here.ok().filter(|here| here.parent().is_some_and(|parent| parent.parent().is_some())).into_iter().chain(home);
    for folder in found {
        if let Ok(made) = made(&folder) {
            printer.log(&format!("Flights are recorded in {}", made.display()));
            return Ok(made);
        }
    }
    Err(CliError::usage("no folder for the flights can be made here").hint("--out DIR names one"))
}

fn made(folder: &Path) -> std::io::Result<PathBuf> {
    std::fs::create_dir_all(folder)?;
    // Whether something can be written there, only trying tells.
    drop(tempfile_in(folder)?);
    folder.canonicalize()
}

/// A file that is gone when it is dropped.
fn tempfile_in(folder: &Path) -> std::io::Result<tempfile::NamedTempFile> {
    tempfile::NamedTempFile::new_in(folder)
}

/// Serves by HTTP until Ctrl-C.
fn http(server: Server, address: SocketAddr, count: Arc<AtomicU32>, printer: &Printer) -> Result<std::io::Result<()>, CliError> {
    if !address.ip().is_loopback() {
        return Err(CliError::usage("--http is for this machine only: whoever reaches a drone's server could fly it")
            .hint("use an address of the form 127.0.0.1:PORT, and a tunnel such as ssh -L from elsewhere"));
    }
    let secret = match std::env::var(TOKEN) {
        Ok(text) => Secret::chosen(&text)
            .ok_or_else(|| CliError::usage(format!("{TOKEN} must have at least 16 characters, and no spaces")))?,
        Err(_) => Secret::new().map_err(|error| CliError::internal("no random numbers for a token").because(&error))?,
    };
    let listener = TcpListener::bind(address).map_err(|error| {
        CliError::usage(format!("cannot listen on {address}")).because(&error).hint("--http 127.0.0.1:0 picks a free port")
    })?;
    let address = listener.local_addr().map_err(|error| CliError::internal("cannot tell the port").because(&error))?;
    printer.log(&format!("MCP: {}", url(address)));
    if std::env::var_os(TOKEN).is_none() {
        printer.log(&format!("Token: {}", secret.text()));
    }
    printer.log("Ctrl-C lands and ends.");
    let stopped = move || count.load(Ordering::Relaxed) > 0;
    Ok(serve_http(server, listener, secret, stopped))
}

/// A signal lands a flight, as in every flight; then the program ends, though its standard input is still open.
fn land_and_exit_on_signal(count: Arc<AtomicU32>, deck: Arc<Deck>) -> Result<(), CliError> {
    let until = move || {
        while count.load(Ordering::Relaxed) == 0 {
            std::thread::sleep(LOOK_UP);
        }
        while deck.is_flying() {
            std::thread::sleep(LOOK_UP);
        }
        background::flush();
        #[allow(clippy::exit, reason = "nothing else ends a read of standard input")]
        std::process::exit(Exit::Success as i32);
    };
    let thread = std::thread::Builder::new().name("signals of mcp".to_owned()).spawn(until);
    thread.map(drop).map_err(|error| CliError::internal("cannot start a thread").because(&error))
}
