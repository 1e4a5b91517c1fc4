//! Arguments of `spf screen`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

/// Games and simulators that are flown through their window.
#[derive(Debug, Subcommand)]
pub(crate) enum Screen {
    /// List the windows and monitors of the X11 display, and the profiles that are shipped
    List,
    /// Capture a window or a monitor for some seconds: size, pictures per second, time per picture, and one picture
    Preview(ScreenPreview),
}

/// Captures a window or a monitor for some seconds; the last picture is written to a file, with the instruments painted over.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf screen preview luanti
  spf screen preview my-game.toml --seconds 10 -o picture.jpg
  spf screen preview --window \"DRL Simulator\"
  spf screen preview --monitor DP-1

The window is found by a text that its title contains, and followed when it moves. While it is covered, minimised, or partly beside \
the screen, there are no pictures. No key is pressed.

Exit codes: 0 pictures come, 1 the picture cannot be written, 2 usage, 6 no display, no window, or nothing to be seen.")]
pub(crate) struct ScreenPreview {
    /// Profile: a name that `spf screen list` shows, or the path of a file
    #[arg(value_name = "PROFILE", required_unless_present_any = ["window", "monitor"], conflicts_with_all = ["window", "monitor"])]
    pub(crate) profile: Option<String>,
    /// Window whose title contains this text
    #[arg(long, value_name = "TITLE", conflicts_with = "monitor")]
    pub(crate) window: Option<String>,
    /// Monitor of this name
    #[arg(long, value_name = "NAME")]
    pub(crate) monitor: Option<String>,
    /// How long to watch, seconds
    #[arg(long, value_name = "S", default_value_t = 3.0, allow_negative_numbers = true)]
    pub(crate) seconds: f64,
    /// JPEG file for the last picture
    #[arg(short, long, value_name = "FILE", default_value = "screen.jpg")]
    pub(crate) output: PathBuf,
    /// Replace the file
    #[arg(long)]
    pub(crate) overwrite: bool,
}
