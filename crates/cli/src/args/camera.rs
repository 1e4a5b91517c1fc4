//! Arguments of `spf camera`.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};
use spf_camera::clock::CameraTimes;

/// Cameras that are not part of a drone.
#[derive(Debug, Subcommand)]
pub(crate) enum Camera {
    /// Receive a camera for some seconds, before a drone flies by it: frames per second, size, codec, losses, age of the frames, and one
    /// image, which is written to a file
    Test(CameraTest),
    /// Measure the latency of a camera that films a clock on this terminal, which changes eleven times a second
    Calibrate(CameraCalibrate),
}

/// Which of the times that a camera tells are believed.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum Times {
    // Its clock, where it tells when a frame was captured, and its timestamps
    Clock,
    // Its timestamps, which tell what came later than usual
    Timestamps,
    // None: only pauses tell what came later than usual
    Arrival,
}

impl From<Times> for CameraTimes {
    fn from(times: Times) -> Self {
        match times {
            Times::Clock => Self::Clock,
            Times::Timestamps => Self::Timestamps,
            Times::Arrival => Self::Arrival,
        }
    }
}

/// A camera in the place of the drone's own.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Camera")]
pub(crate) struct CameraArgs {
    /// Camera in the place of the drone's own: rtsp://, rtsp+udp://, udp-rtp://, udp-ts://, http://, v4l2:/dev/video0,
    /// file:VIDEO[?loop=true], tello or gstreamer:PIPELINE (`spf camera test --help` explains them). With the simulator, it moves and
    /// the camera sees
    #[arg(long = "camera", value_name = "URL")]
    pub(crate) url: Option<String>,
    /// Calibration of that camera: a YAML file of OpenCV, ROS or Kalibr
    #[arg(long = "camera-calibration", value_name = "FILE", requires = "url", conflicts_with = "fov", hide_short_help = true)]
    pub(crate) calibration: Option<PathBuf>,
    /// Horizontal field of view of that camera, degrees, if it is not calibrated
    #[arg(long = "camera-fov", value_name = "DEG", requires = "url", allow_negative_numbers = true, hide_short_help = true)]
    pub(crate) fov: Option<f64>,
    /// Angle by which that camera looks below the drone's forward axis, degrees [default: 0]
    #[arg(long = "camera-tilt", value_name = "DEG", requires = "url", allow_negative_numbers = true, hide_short_help = true)]
    pub(crate) tilt: Option<f64>,
    /// Time from the capture of a frame to its arrival, instead of what the camera's clock says: seconds, or the file that `spf
    /// camera calibrate` has written [default: 0.2, without a clock]
    #[arg(
        long = "camera-latency",
        value_name = "S|FILE",
        requires = "url",
        allow_negative_numbers = true,
        hide_short_help = true
    )]
    pub(crate) latency: Option<String>,
    /// Which times of that camera are believed: clock (where it has one), timestamps, or arrival (none, for timestamps that do not
    /// keep time) [default: clock, or timestamps with --camera-latency]
    #[arg(long = "camera-times", value_name = "WHICH", hide_possible_values = true, requires = "url", hide_short_help = true)]
    pub(crate) times: Option<Times>,
}

/// Tests a camera. The help shows the words of the command in `Camera`.
#[derive(Debug, Args)]
#[command(after_help = "\
Cameras, each with an example:
  an IP camera, or a server of one; the second by UDP
    spf camera test rtsp://admin@192.168.1.64/stream1
    spf camera test rtsp+udp://192.168.1.64/stream1 --seconds 30
  H.264 that a program or a radio link sends to a port of this machine, in RTP or in MPEG-TS
    spf camera test udp-rtp://:5600
    spf camera test udp-ts://239.1.2.3:1234
  JPEG images in an endless response (MJPEG), as apps on phones send them
    spf camera test http://192.168.1.70:8080/video -o porch.jpg
  a webcam of this machine, on Linux; in a size and at a rate
    spf camera test v4l2:/dev/video0
    spf camera test 'v4l2:/dev/video0?size=1280x720&fps=30'
  a film: H.264 in .mp4, .mov or .h264, once or again and again
    spf camera test file:holiday.mp4
    spf camera test 'file:holiday.mp4?loop=true'
  the video of a Tello on the ground
    spf camera test tello
    spf camera test tello@192.168.10.1
  whatever GStreamer gives, in a program that was built with --features gstreamer
    spf camera test 'gstreamer:v4l2src ! image/jpeg,width=1280 ! jpegdec'

What the rows mean:
  rate         frames shown per second: 10 or more are fine, fewer than 5 too few to fly by
  age          time from the capture of a frame to its arrival: by the camera's clock, or --latency
               plus the time by which the frame came later than usual. Up to 0.5 s is fine; by
               frames older than 1 s no drone moves
  loss         packets that did not arrive, and how often the video had a gap: none is fine
  omitted      images that came but are no frames to fly by, and why:
    superseded   a newer one was there before it was decoded, so that the newest is shown sooner
    skipped      after a loss, or at the beginning, nothing can be decoded before the next key frame
    damaged      it was cut off, or is not what it seems to be
    rejected     the decoder refuses it
    unusable     it is shown, but has no content (black, a covered lens) or parts of it are missing

H.264 with the colours 4:2:0 and 8 bits, and MJPEG can be decoded; H.265 cannot.

A password on the command line can be read by other users of this machine. Without one in the address, that of the environment \
variable CAMERA_PASSWORD is used (docs/guide/cameras.md).

Exit codes: 0 images arrive, 1 the image cannot be written, 2 usage, 6 no image arrives.")]
pub(crate) struct CameraTest {
    /// Address of the camera, in one of the forms below
    #[arg(value_name = "URL")]
    pub(crate) url: String,
    /// How long to watch after the first image, seconds
    #[arg(long, value_name = "S", default_value_t = 5.0, allow_negative_numbers = true)]
    pub(crate) seconds: f64,
    /// Time from the capture of a frame to its arrival, instead of what the camera's clock says: seconds, or the file that `spf
    /// camera calibrate` has written [default: 0.2, without a clock]
    #[arg(long, value_name = "S|FILE", allow_negative_numbers = true)]
    pub(crate) latency: Option<String>,
    /// Which times of the camera are believed: clock (where it has one), timestamps, or arrival (none, for timestamps that do not
    /// keep time) [default: clock, or timestamps with --latency]
    #[arg(long, value_name = "WHICH", hide_possible_values = true)]
    pub(crate) times: Option<Times>,
    /// JPEG file for the last image
    #[arg(short, long, value_name = "FILE", default_value = "camera.jpg")]
    pub(crate) output: PathBuf,
    /// Replace the file
    #[arg(long)]
    pub(crate) overwrite: bool,
}

/// Measures the latency of a camera. The help shows the words of the command in `Camera`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf camera calibrate rtsp://admin@192.168.1.64/stream1
  spf camera calibrate v4l2:/dev/video0 --seconds 30 -o webcam-latency.toml
  spf fly \"Fly to the red ball\" --drone tello --vlm gemini --camera rtsp://192.168.1.64/stream1 --camera-fov 78 \
    --camera-latency camera-latency.toml

The terminal needs 29 columns and 16 lines. Any live camera can be measured (`spf camera test --help` lists them), but no file. The time that the terminal and the screen take to show it, some hundredths of a second, \
is part of the result. Times by which single frames are late are not: these are recognised in flight (docs/guide/cameras.md).

Exit codes: 0 measured, 1 the file cannot be written, 2 usage, 6 no image arrives, or the clock cannot be read.")]
pub(crate) struct CameraCalibrate {
    /// Address of the camera
    #[arg(value_name = "URL")]
    pub(crate) url: String,
    /// How long to measure after the first image, seconds
    #[arg(long, value_name = "S", default_value_t = 20.0, allow_negative_numbers = true)]
    pub(crate) seconds: f64,
    /// File for the latency
    #[arg(short, long, value_name = "FILE", default_value = "camera-latency.toml")]
    pub(crate) output: PathBuf,
    /// Replace the file
    #[arg(long)]
    pub(crate) overwrite: bool,
}
