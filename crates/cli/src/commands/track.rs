//! `spf track`: follows a box through a video.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use spf_camera::film::{Film, FilmError, VideoFrame};
use spf_camera::{CameraState, CameraUrl};
use spf_core::time::{Time, duration_from_secs};
use spf_drone::frames::Frames as _;
use spf_follow::track::{Quality, SMALLEST, Tracker};
use spf_media::marks::{Canvas, Colour, Point, Rect, TextStyle};
use spf_media::track::{PixelBox, TrackImage};
use spf_media::{Rgb, resize};
use spf_record::VideoWriter;

use crate::args::Track;
use crate::commands::camera;
use crate::commands::fly::signals::interrupts;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;

/// Maximum size of a video file, bytes.
const LONGEST: u64 = 2 << 30;
/// Longest side of the images in which the tracker works, pixels.
const WORKING_SIDE: u32 = 480;
/// Longest side of the annotated film, pixels.
const FILM_SIDE: u32 = 1920;
const FORMATS: &str = "H.264 in MP4 (.mp4, .mov) and bare H.264 streams (.h264) can be read; convert others: ffmpeg -i VIDEO -c:v \
                       libx264 video.mp4";
/// Interval at which new frames of a camera are looked for.
const POLL_INTERVAL: Duration = Duration::from_millis(2);
const QUALITIES: [Quality; 4] = [Quality::Good, Quality::Coasting, Quality::Lost, Quality::TooSmall];

/// Tracks a box and writes film and table.
pub(crate) fn track(args: &Track, printer: &mut Printer) -> Result<Exit, CliError> {
    let area = parse_box(&args.area)?;
    for (flag, value, least) in [("--from", args.from, 0.0), ("--rate", args.rate, 0.1)] {
        if !(value >= least && value <= 1e6) {
            return Err(CliError::usage(format!("{flag}: `{value}` is not a number of at least {least}"))
                .hint("--from is in seconds, --rate in images per second: --from 8 --rate 10"));
        }
    }
    if let Some(url) = args.video.to_str().filter(|text| CameraUrl::is_one(text)) {
        return live(args, area, url, printer);
    }
    if args.seconds.is_some() {
        return Err(CliError::usage("--seconds is for cameras").hint("a video is followed to its end"));
    }
    let bytes = spf_input::read(&args.video, LONGEST).map_err(|error| {
        CliError::usage(format!("cannot read the video `{}`", args.video.display()))
            .because(&error)
            .hint("spf track VIDEO --box X0,Y0,X1,Y1")
    })?;
    let film = open(&bytes).map_err(|error| undecodable(&args.video, &error))?;
    let folder = args.output.clone().unwrap_or_else(|| default_folder(&args.video));
    let files = Files { table: folder.join("track.tsv"), film: folder.join("track.mp4") };
    files.spare(args.overwrite)?;
    let mut run = Run { args, area, files: &files, folder: &folder, due: args.from, began: None, counts: [0; 4] };
    printer.start_count("images read", film.len() as u64, 0);
    let (mut read, mut failure) = (0, None);
    let played = film.play(|frame| {
        read += 1;
        printer.count(read);
        match run.take(&frame) {
            Ok(()) => ControlFlow::Continue(()),
            Err(error) => {
                failure = Some(error);
                ControlFlow::Break(())
            }
        }
    });
    printer.end_live();
    if let Some(error) = failure {
        return Err(error);
    }
    let counts = run.counts;
    let seconds = run.finish()?;
    let Some(seconds) = seconds else {
        if let Err(error) = &played {
            return Err(undecodable(&args.video, error));
        }
        return Err(CliError::usage(format!("--from: the video `{}` ends before {} s", args.video.display(), args.from))
            .hint("choose an earlier time"));
    };
    report(&folder, counts, seconds, printer);
    if let Err(error) = played {
        return Err(CliError::failed(format!("the video `{}` could not be decoded to its end", args.video.display()))
            .because(&error)
            .hint("the files contain what was decoded"));
    }
    Ok(Exit::Success)
}

/// Says what was tracked.
fn report(folder: &Path, counts: [u64; 4], seconds: f64, printer: &Printer) {
    let parts: Vec<String> = QUALITIES
        .iter()
        .zip(counts)
        .filter(|(quality, count)| *count > 0 || **quality == Quality::Good)
        .map(|(quality, count)| format!("{} {count}", quality.word()))
        .collect();
    let images: u64 = counts.iter().sum();
    let film = folder.join("track.mp4");
    printer.result(&format!("{}: {images} images, {seconds:.1} s: {}", film.display(), parts.join(", ")));
}

/// Follows the box in the newest frames of a camera, until Ctrl-C, until the time is over, or until the camera ends.
fn live(args: &Track, area: PixelBox, url: &str, printer: &Printer) -> Result<Exit, CliError> {
    let seconds = args.seconds.unwrap_or(f64::INFINITY);
    if seconds.is_nan() || seconds <= 0.0 {
        return Err(CliError::usage(format!("--seconds: `{seconds}` is not a number above 0")));
    }
    if args.from > 0.0 {
        return Err(CliError::usage("--from is for videos").hint("of a camera, the box is that in its first image"));
    }
    let folder = args.output.clone().unwrap_or_else(|| PathBuf::from("camera-track"));
    let files = Files { table: folder.join("track.tsv"), film: folder.join("track.mp4") };
    files.spare(args.overwrite)?;
    let interrupts = interrupts()?;
    let camera = camera::watch("VIDEO", url, printer)?;
    let frames = camera.frames();
    let mut run = Run { args, area, files: &files, folder: &folder, due: 0.0, began: None, counts: [0; 4] };
    let (begun, mut first, mut seen) = (Instant::now(), None, None);
    while interrupts.load(Ordering::Relaxed) == 0 && begun.elapsed().as_secs_f64() < seconds {
        let newest = frames.newest().filter(|(meta, _)| seen != Some(meta.id));
        match newest {
            Some((meta, photo)) => {
                seen = Some(meta.id);
                let start = *first.get_or_insert(meta.captured);
                run.take(&VideoFrame { at: meta.captured.since(start).as_secs_f64(), image: photo.pixels().as_ref().clone() })?;
            }
            None if camera.report().state == CameraState::Ended => break,
            None => std::thread::sleep(POLL_INTERVAL),
        }
    }
    let counts = run.counts;
    let seconds = run.finish()?.unwrap_or(0.0);
    report(&folder, counts, seconds, printer);
    Ok(Exit::Success)
}

fn open(bytes: &[u8]) -> Result<Film, FilmError> {
    let film = Film::open(bytes)?;
    if film.is_empty() { Err(FilmError::Container("it contains no images".to_owned())) } else { Ok(film) }
}

fn undecodable(path: &Path, error: &FilmError) -> CliError {
    CliError::usage(format!("cannot decode the video `{}`", path.display())).because(error).hint(error.hint().unwrap_or(FORMATS))
}

fn default_folder(video: &Path) -> PathBuf {
    let stem = video.file_stem().map_or_else(|| "video".into(), |stem| stem.to_string_lossy());
    PathBuf::from(format!("{stem}-track"))
}

/// Four numbers that are a box.
fn parse_box(text: &str) -> Result<PixelBox, CliError> {
    let wrong = |why: &str| {
        CliError::usage(format!("--box: `{text}`: {why}"))
            .hint("left, top, right, bottom in pixels of the video: --box 300,120,380,260")
    };
    let numbers: Vec<f64> = text.split(',').filter_map(|word| word.trim().parse().ok()).collect();
    let [left, top, right, bottom] = numbers[..] else { return Err(wrong("four numbers are needed")) };
    if text.split(',').count() != 4 || numbers.iter().any(|number| !number.is_finite()) {
        return Err(wrong("four numbers are needed"));
    }
    if left >= right || top >= bottom {
        return Err(wrong("left must be less than right, and top less than bottom"));
    }
    Ok(PixelBox { left, top, right, bottom })
}

/// The files that are written.
struct Files {
    table: PathBuf,
    film: PathBuf,
}

impl Files {
    /// Refuses files that exist, unless they are to be replaced.
    fn spare(&self, overwrite: bool) -> Result<(), CliError> {
        for file in [&self.table, &self.film] {
            if !overwrite && file.symlink_metadata().is_ok() {
                return Err(CliError::usage(format!("--output: `{}` exists", file.display()))
                    .hint("use --overwrite to replace it, or another folder with -o DIR"));
            }
        }
        Ok(())
    }
}

/// A track in the making.
struct Run<'a> {
    args: &'a Track,
    area: PixelBox,
    files: &'a Files,
    folder: &'a Path,
    /// When the next image is due, seconds of the video.
    due: f64,
    began: Option<Began>,
    /// Images of each of [`QUALITIES`].
    counts: [u64; 4],
}

/// What there is from the first image on.
struct Began {
    tracker: Tracker,
    table: BufWriter<File>,
    film: VideoWriter,
    /// Size of the images in which the tracker works.
    working: (u32, u32),
    first: f64,
    last: f64,
}

impl Run<'_> {
    /// Takes an image of the video, if one is due.
    fn take(&mut self, frame: &VideoFrame) -> Result<(), CliError> {
        if frame.at + 1e-6 < self.due {
            return Ok(());
        }
        let step = 1.0 / self.args.rate;
        self.due = (self.due + step).max(frame.at + 0.5 * step);
        let size = (frame.image.width(), frame.image.height());
        if let Some(began) = &mut self.began {
            let image = TrackImage::of(&resize(&frame.image, began.working.0, began.working.1));
            began.tracker.next(&image, None);
            began.last = frame.at;
        } else {
            self.began = Some(self.begin(frame, size)?);
        }
        let Some(began) = &mut self.began else { return Ok(()) };
        let track = began.tracker.track();
        let scale = |pixels: u32, working: u32| f64::from(pixels) / f64::from(working);
        let area = track.area.in_image_scaled(scale(size.0, began.working.0), scale(size.1, began.working.1));
        if let Some(count) = QUALITIES.iter().position(|quality| *quality == track.quality) {
            self.counts[count] += 1;
        }
        let PixelBox { left, top, right, bottom } = area;
        let quality = track.quality.word();
        writeln!(began.table, "{:.3}\t{left:.1}\t{top:.1}\t{right:.1}\t{bottom:.1}\t{:.4}\t{quality}", frame.at, track.scale)
            .map_err(|error| unwritable(&self.files.table, &error))?;
        let mut image = frame.image.clone();
        draw(&mut image, &area, track.quality, track.scale);
        let time = Time::ZERO + duration_from_secs(frame.at - began.first);
        began.film.push(time, &image).map_err(|error| CliError::internal("cannot write the film").because(&error))
    }

    /// Checks the box in the first image, and creates the files.
    fn begin(&self, frame: &VideoFrame, size: (u32, u32)) -> Result<Began, CliError> {
        let (width, height) = size;
        let given = &self.args.area;
        let area = self.area;
        if area.left < 0.0 || area.top < 0.0 || area.right > f64::from(width) || area.bottom > f64::from(height) {
            return Err(CliError::usage(format!("--box: `{given}` is not inside the image of {width}×{height} pixels"))
                .hint("left, top, right, bottom in pixels of the video, from the upper left corner"));
        }
        let working = fitted(size, WORKING_SIDE);
        let scale = (f64::from(working.0) / f64::from(width), f64::from(working.1) / f64::from(height));
        let area = area.in_image_scaled(scale.0, scale.1);
        let image = TrackImage::of(&resize(&frame.image, working.0, working.1));
        let tracker = Tracker::start(&image, area);
        match tracker.track().quality {
            Quality::TooSmall => {
                let (wide, high) = (SMALLEST / scale.0, SMALLEST / scale.1);
                return Err(CliError::usage(format!("--box: `{given}` is too small to be tracked"))
                    .hint(format!("in this video a box must be at least {wide:.0}×{high:.0} pixels")));
            }
            Quality::Good => {}
            _ => {
                return Err(CliError::usage(format!("--box: `{given}` shows nothing that can be tracked: it is plain"))
                    .hint("choose a box with edges and corners in it, or another time with --from"));
            }
        }
        std::fs::create_dir_all(self.folder)
            .map_err(|error| CliError::usage(format!("cannot use the folder `{}`", self.folder.display())).because(&error))?;
        let mut table = BufWriter::new(File::create(&self.files.table).map_err(|error| unwritable(&self.files.table, &error))?);
        writeln!(table, "time_s\tleft\ttop\tright\tbottom\tscale\tquality")
            .map_err(|error| unwritable(&self.files.table, &error))?;
        let (wide, high) = fitted(size, FILM_SIDE);
        let even = |side: u32| (side & !1).max(16);
        let film = VideoWriter::create(&self.files.film, even(wide), even(high), self.args.rate)
            .map_err(|error| CliError::internal("cannot write the film").because(&error))?;
        Ok(Began { tracker, table, film, working, first: frame.at, last: frame.at })
    }

    /// Completes the files; the seconds of video that were tracked, or `None` if there was no image.
    fn finish(self) -> Result<Option<f64>, CliError> {
        let Some(mut began) = self.began else { return Ok(None) };
        began.table.flush().map_err(|error| unwritable(&self.files.table, &error))?;
        began.film.finish().map_err(|error| CliError::internal("cannot write the film").because(&error))?;
        Ok(Some(began.last - began.first))
    }
}

fn unwritable(path: &Path, error: &std::io::Error) -> CliError {
    CliError::internal(format!("cannot write `{}`", path.display())).because(error)
}

/// A size scaled down until its longer side is at most `longest`.
fn fitted((width, height): (u32, u32), longest: u32) -> (u32, u32) {
    let long = width.max(height);
    if long <= longest {
        return (width, height);
    }
    let side = |side: u32| ((u64::from(side) * u64::from(longest) + u64::from(long) / 2) / u64::from(long)).max(1) as u32;
    (side(width), side(height))
}

fn draw(image: &mut Rgb, area: &PixelBox, quality: Quality, scale: f64) {
    let colour = match quality {
        Quality::Good => Colour::rgb(80, 220, 100),
        Quality::Coasting => Colour::OBSTACLE,
        Quality::Lost => Colour::rgb(255, 70, 60),
        _ => Colour::rgb(150, 150, 150),
    };
    let mut canvas = Canvas::new(image);
    let unit = canvas.unit();
    let PixelBox { left, top, right, bottom } = *area;
    canvas.frame(Rect { left, top, right, bottom }, (3.0 * unit).max(2.0), colour);
    let height = (18.0 * unit).max(12.0);
    let text = format!("{}  ×{scale:.2}", quality.word());
    canvas.label(Point::new(left, top - 1.6 * height), &text, TextStyle::plain(height, colour), Colour::INK);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_are_read_or_refused() {
        let area = parse_box("1, 2,30.5,40").unwrap();
        assert_eq!((area.left, area.top, area.right, area.bottom), (1.0, 2.0, 30.5, 40.0));
        for wrong in ["", "1,2,3", "1,2,3,x", "1,2,3,4,5", "1,2,3,4,x", "5,2,3,4", "1,2,3,nan", "1,2,inf,4"] {
            assert!(parse_box(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn sizes_keep_their_shape() {
        assert_eq!(fitted((960, 720), 480), (480, 360));
        assert_eq!(fitted((720, 1280), 480), (270, 480));
        assert_eq!(fitted((320, 240), 480), (320, 240));
        assert_eq!(fitted((u32::MAX, 1), 480), (480, 1));
    }
}
