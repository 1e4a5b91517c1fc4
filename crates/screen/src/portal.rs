//! What the user lets the desktop show of a session of Wayland: the portal ScreenCast, by PipeWire and GStreamer.
//!
//! The desktop asks the user for a window or monitor, and hands out a stream of its pictures (`org.freedesktop.portal.ScreenCast`).
//! GStreamer's program `gst-launch-1.0` reads it, with its element `pipewiresrc`; so no system library is linked. The desktop sends a
//! picture when something has changed. Where the window is, and whether it has the focus, is not told.

use std::io::Read as _;
use std::os::fd::OwnedFd;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use ashpd::desktop::PersistMode;
use ashpd::desktop::screencast::{CursorMode, Screencast, SelectSourcesOptions, SourceType};
use spf_media::Rgb;
use tokio::runtime::Runtime;

use crate::area::{Area, Region};
use crate::choosing::LEAST;
use crate::picture::Shown;
use crate::{Hidden, ScreenError};

/// How long the first picture is awaited.
const FIRST: Duration = Duration::from_secs(10);
/// Age at which a picture counts as lost. GStreamer repeats the last one ten times a second, so that a stream that has ended is noticed.
const STALE: Duration = Duration::from_secs(1);
/// Greatest side of a picture, pixels.
const MOST: i32 = 16_384;

/// A stream that the user has chosen. It ends with this value.
pub(crate) struct Stream {
    size: (u32, u32),
    latest: Arc<Mutex<Latest>>,
    program: Child,
    /// The stream lasts as long as the connection to the portal.
    _connection: (Runtime, Screencast),
}

#[derive(Default)]
struct Latest {
    image: Option<(Rgb, Instant)>,
    ended: bool,
}

/// What the portal hands out.
struct Offered {
    remote: OwnedFd,
    node: u32,
    size: (i32, i32),
}

impl Stream {
    /// Asks the user, which may take as long as the user does, and waits for the first picture.
    pub(crate) fn open() -> Result<Self, ScreenError> {
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build();
        let runtime = runtime.map_err(|error| ScreenError::Portal(error.to_string()))?;
        tracing::warn!("the desktop asks which window may be seen: choose the game's");
        let (proxy, offered) = runtime.block_on(choose()).map_err(|error| ScreenError::Portal(error.to_string()))?;
        let (width, height) = offered.size;
        if !(1..=MOST).contains(&width) || !(1..=MOST).contains(&height) {
            return Err(ScreenError::Portal(format!(
                "a picture of {width}×{height}, or of a size that the desktop does not tell"
            )));
        }
        let mut program = Command::new("gst-launch-1.0")
            .args(["-q", "pipewiresrc", "fd=0", &format!("path={}", offered.node), "keepalive-time=100"])
            // With borders, if the window changes its shape.
            .args(["!", "videoconvert", "!", "videoscale", "!", &format!("video/x-raw,format=RGB,width={width},height={height}")])
            .args(["!", "fdsink", "fd=1", "sync=false"])
            .stdin(offered.remote)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .map_err(|error| ScreenError::Portal(format!("gst-launch-1.0 cannot be started: {error}")))?;
        let latest = Arc::<Mutex<Latest>>::default();
        let size = (width.unsigned_abs(), height.unsigned_abs());
        if let Some(mut output) = program.stdout.take() {
            let latest = latest.clone();
            // It ends with the program.
            std::thread::spawn(move || {
                // GStreamer begins each row at a multiple of four bytes.
                let stride = (size.0 as usize * 3).next_multiple_of(4);
                let mut bytes = vec![0; stride * size.1 as usize];
                while output.read_exact(&mut bytes).is_ok() {
                    let image = part(&bytes, stride, Area { x: 0, y: 0, width: size.0, height: size.1 });
                    latest.lock().unwrap_or_else(PoisonError::into_inner).image = image.map(|image| (image, Instant::now()));
                }
                latest.lock().unwrap_or_else(PoisonError::into_inner).ended = true;
            });
        }
        let stream = Self { size, latest, program, _connection: (runtime, proxy) };
        let begun = Instant::now();
        loop {
            let latest = stream.latest.lock().unwrap_or_else(PoisonError::into_inner);
            if latest.image.is_some() {
                break;
            }
            if latest.ended || begun.elapsed() > FIRST {
                return Err(ScreenError::Portal(
                    "no picture came: GStreamer needs its element `pipewiresrc` (Debian: gstreamer1.0-pipewire, gstreamer1.0-tools and \
                     gstreamer1.0-plugins-base)"
                        .to_owned(),
                ));
            }
            drop(latest);
            std::thread::sleep(Duration::from_millis(20));
        }
        Ok(stream)
    }

    /// The newest picture of a part of it.
    pub(crate) fn look(&self, region: &Region) -> Result<Result<Shown, Hidden>, ScreenError> {
        let latest = self.latest.lock().unwrap_or_else(PoisonError::into_inner);
        let (width, height) = self.size;
        let area = Area { x: 0, y: 0, width, height }.part(region);
        if area.width < LEAST || area.height < LEAST {
            return Ok(Err(Hidden::Tiny { width: area.width, height: area.height }));
        }
        match &latest.image {
            Some((image, at)) if !latest.ended && at.elapsed() < STALE => {
                let image = part(image.data(), width as usize * 3, area);
                Ok(image.map(|image| Shown { image, area, at: *at }).ok_or(Hidden::OffScreen))
            }
            _ => Err(ScreenError::Portal("the pictures have ended".to_owned())),
        }
    }
}

/// Part of a picture whose rows begin every `stride` bytes.
fn part(bytes: &[u8], stride: usize, area: Area) -> Option<Rgb> {
    let (left, width) = (area.x.unsigned_abs() as usize * 3, area.width as usize * 3);
    let rows = bytes.chunks(stride).skip(area.y.unsigned_abs() as usize).take(area.height as usize);
    let data: Vec<u8> = rows.filter_map(|row| row.get(left..left + width)).flatten().copied().collect();
    Rgb::from_raw(area.width, area.height, data).ok()
}

impl Drop for Stream {
    fn drop(&mut self) {
        drop(self.program.kill());
        drop(self.program.wait());
    }
}

impl std::fmt::Debug for Stream {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Stream").field("size", &self.size).finish_non_exhaustive()
    }
}

/// Lets the user choose a window, or a monitor where the desktop offers only those.
async fn choose() -> Result<(Screencast, Offered), ashpd::Error> {
    let proxy = Screencast::new().await?;
    let session = proxy.create_session(Default::default()).await?;
    let known = proxy.available_source_types().await?;
    let sources = if known.contains(SourceType::Window) { SourceType::Window } else { SourceType::Monitor };
    let wanted = SelectSourcesOptions::default()
        .set_cursor_mode(CursorMode::Hidden)
        .set_sources(Some(sources.into()))
        .set_multiple(false)
        .set_persist_mode(PersistMode::DoNot);
    proxy.select_sources(&session, wanted).await?.response()?;
    let streams = proxy.start(&session, None, Default::default()).await?.response()?;
    let stream = streams.streams().first().ok_or(ashpd::Error::NoResponse)?;
    let remote = proxy.open_pipe_wire_remote(&session, Default::default()).await?;
    let offered = Offered { remote, node: stream.pipe_wire_node_id(), size: stream.size().unwrap_or_default() };
    Ok((proxy, offered))
}
