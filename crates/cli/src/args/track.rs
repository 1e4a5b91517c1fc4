//! Arguments of `spf track`.

use std::path::PathBuf;

use clap::Args;

/// Follows a box through a video, or in the images of a camera, from pixels alone, and writes an annotated film and a table.
/// It shows how well the tracker holds a target in your own video between two answers of a model: no model is queried, and
/// nothing flies.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf track holiday.mp4 --box 300,120,380,260
  spf track flights/001-fly-to-the-red-crane/video.mp4 --box 300,180,360,300 --from 8 -o crane
  spf track rtsp://192.168.1.64/stream1 --box 300,120,380,260 --seconds 30

The video is H.264 in MP4 (.mp4, .mov) or a bare H.264 stream (.h264); convert others with ffmpeg -i VIDEO -c:v libx264 \
video.mp4. The box is that of the target in the first image at or after --from, in pixels of the video, from the upper left \
corner. Of a camera (docs/guide/cameras.md), the newest image is followed until Ctrl-C; the times are those of capture.

DIR/track.tsv has a row per image: time_s, left, top, right, bottom (pixels of the video), scale (size divided by that at the \
start) and quality:
  good       the box is on the target
  coasting   not recognised for less than half a second; the box is where it is expected
  lost       hidden, gone or changed; the box means nothing, until the target is found again
  too-small  under 12 pixels: no track any more
DIR/track.mp4 shows the same: green, amber, red and grey (docs/guide/track.md).

Exit codes: 0 success, 1 files incomplete, 2 usage, 6 the video cannot be decoded to its end.")]
pub(crate) struct Track {
    /// The video, or the address of a camera
    #[arg(value_name = "VIDEO|URL")]
    pub(crate) video: PathBuf,
    /// Box of the target in the first image, pixels: left, top, right, bottom
    #[arg(long = "box", value_name = "X0,Y0,X1,Y1", allow_hyphen_values = true)]
    pub(crate) area: String,
    /// Start at this time of the video, seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0, allow_negative_numbers = true)]
    pub(crate) from: f64,
    /// Images per second that are tracked; a flight has ten
    #[arg(long, value_name = "HZ", default_value_t = 10.0, allow_negative_numbers = true)]
    pub(crate) rate: f64,
    /// Stop after this time; for cameras [default: at Ctrl-C]
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub(crate) seconds: Option<f64>,
    /// Output folder [default: the video's name with -track, or camera-track, in the working directory]
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    /// Replace the output files if they exist
    #[arg(long)]
    pub(crate) overwrite: bool,
}
