//! What the X11 display says when it fails, and what to do.

use spf_screen::ScreenError;

use crate::error::CliError;

/// The error of the display with a hint.
pub(crate) fn failed(error: &ScreenError) -> CliError {
    let failure = CliError::failed(error.to_string());
    match error {
        ScreenError::NoDisplay { .. } => {
            failure.hint("run it in the session that shows the game; `echo $DISPLAY` there names the display")
        }
        ScreenError::Wayland => failure.hint("name a window, or log in to a session of X11 (\"on Xorg\")"),
        ScreenError::NoWindow(_) => failure.hint("start the game; `spf screen list` shows the titles and classes of all windows"),
        ScreenError::Portal(_) => failure.hint("docs/guide/games.md tells what the portal needs"),
        ScreenError::Ambiguous { .. } => {
            failure.hint("close the others, or give more of the title, or the class, in a profile of your own")
        }
        ScreenError::NoKey(_) => failure.hint("set the keyboard's layout, or name the key by its code (`#25`; `xev` shows it)"),
        _ => failure,
    }
}
