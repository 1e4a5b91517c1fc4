//! Arguments of `spf camera`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

/// Cameras that are not part of a drone.
#[derive(Debug, Subcommand)]
pub(crate) enum Camera {
    /// Receive a camera for some seconds: frames per second, size, codec, losses, age of the frames, and one image
    Test(CameraTest),
    /// Measure the latency of a camera that films a clock on this terminal
    Calibrate(CameraCalibrate),
}

/// A camera in the place of the drone's own.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Camera")]
pub(crate) struct CameraArgs {
    /// Camera in the place of the drone's own: rtsp://, rtsp+udp://, udp-rtp://, udp-ts://, http://, v4l2:/dev/video0, file:VIDEO
    /// or tello (see docs/guide/cameras.md). With the simulator, it moves and the camera sees
    #[arg(long = "camera", value_name = "URL")]
    pub(crate) url: Option<String>,
    /// Calibration of that camera: a YAML file of OpenCV or ROS
    #[arg(long = "camera-calibration", value_name = "FILE", requires = "url", conflicts_with = "fov")]
    pub(crate) calibration: Option<PathBuf>,
    /// Horizontal field of view of that camera, degrees, if it is not calibrated
    #[arg(long = "camera-fov", value_name = "DEG", requires = "url", allow_negative_numbers = true)]
    pub(crate) fov: Option<f64>,
    /// Angle by which that camera looks below the drone's forward axis, degrees [default: 0]
    #[arg(long = "camera-tilt", value_name = "DEG", requires = "url", allow_negative_numbers = true)]
    pub(crate) tilt: Option<f64>,
    /// Time from the capture of a frame to its arrival, instead of what the camera's clock says: seconds, or the file that `spf
    /// camera calibrate` has written [default: 0.2, without a clock]
    #[arg(long = "camera-latency", value_name = "S|FILE", requires = "url", allow_negative_numbers = true)]
    pub(crate) latency: Option<String>,
}

/// Receives a camera for some seconds and reports what arrives; one image is written to a file.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf camera test rtsp://admin:secret@192.168.1.64/stream1
  spf camera test rtsp+udp://192.168.1.64/stream1 --seconds 30
  spf camera test udp-rtp://:5600
  spf camera test udp-ts://239.1.2.3:1234
  spf camera test http://192.168.1.70:8080/video -o porch.jpg
  spf camera test 'v4l2:/dev/video0?size=1280x720&fps=30'
  spf camera test file:holiday.mp4
  spf camera test tello

H.264 and MJPEG can be decoded; H.265 cannot. A file is played once, or again and again with ?loop=true behind its name, in real \
time, and its frames count as captured at the times that it gives. The age of a frame is the time from its capture to its arrival. If the camera does \
not tell when a frame was captured, --latency is assumed, plus the time by which the frame arrived later than usual.

A password on the command line can be read by other users of this machine. Without one in the address, that of the environment \
variable CAMERA_PASSWORD is used (docs/guide/cameras.md).

Exit codes: 0 images arrive, 1 the image cannot be written, 2 usage, 6 no image arrives.")]
pub(crate) struct CameraTest {
    /// Address of the camera
    #[arg(value_name = "URL")]
    pub(crate) url: String,
    /// How long to watch after the first image, seconds
    #[arg(long, value_name = "S", default_value_t = 5.0, allow_negative_numbers = true)]
    pub(crate) seconds: f64,
    /// Time from the capture of a frame to its arrival, instead of what the camera's clock says: seconds, or the file that `spf
    /// camera calibrate` has written [default: 0.2, without a clock]
    #[arg(long, value_name = "S|FILE", allow_negative_numbers = true)]
    pub(crate) latency: Option<String>,
    /// JPEG file for the last image
    #[arg(short, long, value_name = "FILE", default_value = "camera.jpg")]
    pub(crate) output: PathBuf,
    /// Replace the file
    #[arg(long)]
    pub(crate) overwrite: bool,
}

/// Measures the latency of a camera: shows a clock on this terminal that changes eleven times a second, and reads it in the frames
/// of the camera that films it.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf camera calibrate rtsp://admin:secret@192.168.1.64/stream1
  spf fly \"Fly to the red ball\" --drone tello --vlm gemini --camera rtsp://192.168.1.64/stream1 --camera-fov 78 \
    --camera-latency camera-latency.toml

The code needs 15 lines of 29 characters. The time that the terminal and the screen take to show it, some hundredths of a second, \
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
