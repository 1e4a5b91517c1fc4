//! `spf sim serve`: parts of the simulator over the interfaces of real ones.

mod vlm;

use std::sync::atomic::Ordering;
use std::time::Duration;

use crate::args::Serve;
use crate::commands::fly::interrupts;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;

/// How often Ctrl-C is looked for.
const LOOK: Duration = Duration::from_millis(50);

/// Serves what is asked for until Ctrl-C.
pub(super) fn serve(args: &Serve, printer: &Printer) -> Result<Exit, CliError> {
    let Some(oracle) = &args.vlm else {
        return Err(CliError::usage("nothing is named to be served").hint("spf sim serve --vlm"));
    };
    let interrupts = interrupts()?;
    let _endpoint = vlm::start(args, oracle, printer)?;
    while interrupts.load(Ordering::Relaxed) == 0 {
        std::thread::sleep(LOOK);
    }
    Ok(Exit::Success)
}
