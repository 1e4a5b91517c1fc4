//! Instructions that must not be flown, refused before take-off (docs/guide/fly.md, "Instructions that are refused").

use spf_core::time::Duration;
use spf_vlm::check::USUAL_CAMERA;
use spf_vlm::refusal::ask;

use crate::commands::vlm::{Pace, Pointing, is_human, pointing};
use crate::error::CliError;
use crate::printer::Printer;
use crate::settings::Settings;

/// How long a model may take for its verdict.
const PATIENCE: Duration = Duration::from_secs(20);

/// Whether instructions are checked: unless something else is said, where somebody `else` than who started the program gives them.
pub(crate) fn is_on(settings: &Settings, by_others: bool) -> Result<bool, CliError> {
    Ok(settings.fly.refuse.or_default()?.or(by_others))
}

/// Refuses an instruction that must not be flown: by one question to the model that flies, or by its words.
pub(crate) fn check(settings: &Settings, instruction: &str, printer: &Printer) -> Result<(), CliError> {
    let verdict = match by_model(settings)? {
        Some(pointing) => {
            let mut vlm = (pointing.vlm_factory)(None, 0)
                .map_err(|error| CliError::usage("the instruction cannot be checked").because(&*error))?;
            match ask(vlm.as_mut(), instruction, PATIENCE, USUAL_CAMERA) {
                Ok(verdict) => verdict,
                Err(error) => {
                    // The envelope bounds it all the same, and its words are known.
                    printer.log(&format!(
                        "warning: the model gave no verdict on the instruction, which is judged by its words: {error}"
                    ));
                    by_words(instruction)
                }
            }
        }
        None => by_words(instruction),
    };
    match verdict {
        Some(reason) => Err(CliError::usage(format!("the instruction is refused: {reason}"))
            .hint("say what you want otherwise; docs/guide/fly.md, \"Instructions that are refused\", has who decides")),
        None => Ok(()),
    }
}

fn by_words(instruction: &str) -> Option<String> {
    spf_oracle::refusal::refused(instruction).map(str::to_owned)
}

/// The model that is asked; `None` if a stand-in, a program, a recording or a person answers.
fn by_model(settings: &Settings) -> Result<Option<Pointing>, CliError> {
    let name = settings.fly.vlm.text_or_default();
    let kind = name.split(':').next().unwrap_or(name);
    if matches!(kind, "oracle" | "exec" | "replay") || is_human(name) {
        return Ok(None);
    }
    pointing(settings, None, Pace::Wall).map(Some)
}
