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
    /// Measure in the picture what the keys of a profile do, and write a profile with these rates
    Calibrate(ScreenCalibrate),
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
    #[arg(value_name = "PROFILE", required_unless_present_any = ["window", "class", "monitor"], conflicts_with_all = ["window", "class", "monitor"])]
    pub(crate) profile: Option<String>,
    /// Window whose title contains this text
    #[arg(long, value_name = "TITLE", conflicts_with = "monitor")]
    pub(crate) window: Option<String>,
    /// Window of this class, as `spf screen list` shows it
    #[arg(long, value_name = "CLASS", conflicts_with = "monitor")]
    pub(crate) class: Option<String>,
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

/// Presses each key of a profile in the game's window, measures in the picture how fast the craft turns and flies by it, and how soon,
/// and writes the profile with these figures; its comments and all else stay.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf screen calibrate spf-window --height 3.3
  spf screen calibrate my-game.toml --height 6 --room 20 -o measured.toml

Before: write a profile with the window's title, the keys and the field of view (docs/guide/games.md); its rates may be guesses. Put \
the craft over flat ground that has a pattern and is in view, with free space around. Things that stand on the ground may be in view \
as well. Do not type meanwhile.

A picture has no scale, so one length must be known: the height of the camera above the ground, after the take-off if the profile has \
one. Forward, sideways and vertical rates are in proportion to it: 10 % too much of it makes them 10 % too large. The turn does not \
depend on it.

The craft takes off, turns, flies ahead and back, to the right and to the left, climbs and descends, each twice, and lands, by the keys \
of the profile alone. A rate that the second run does not confirm within 20 % is not written. A key is held until the craft flies steadily, for at most 5 s, and to at most half of --room. A way that the \
picture does not show counts as flown at 1.5 times the profile's rate. A key that shows no motion for 1 s is released, and the opposite key \
brings the craft back. Nothing else keeps it from obstacles.

Keys go to the profile's window alone, and only while it has the focus. Clicking on another window, and Ctrl-C, release them.

Exit codes: 0 measured, 1 the file cannot be written, 2 usage, 5 interrupted, 6 no display or window, nothing moved, or a rate was not \
confirmed (the file is written with the others).")]
pub(crate) struct ScreenCalibrate {
    /// Profile: a name that `spf screen list` shows, or the path of a file
    #[arg(value_name = "PROFILE")]
    pub(crate) profile: String,
    /// Height of the camera above flat ground, after the take-off, metres; always needed
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub(crate) height: Option<f64>,
    /// Free space around the start, metres: better 6 times its greatest speed in m/s or more, or it is stopped too soon to measure
    #[arg(long, value_name = "M", default_value_t = 30.0, allow_negative_numbers = true)]
    pub(crate) room: f64,
    /// File for the profile
    #[arg(short, long, alias = "out", value_name = "FILE", default_value = "calibrated.toml")]
    pub(crate) output: PathBuf,
    /// Replace the file
    #[arg(long)]
    pub(crate) overwrite: bool,
}
