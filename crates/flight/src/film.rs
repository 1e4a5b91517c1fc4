//! `video.mp4`: the camera view with decisions overlaid, in flight time.

use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;

use spf_core::camera::Camera;
use spf_core::depth::DepthGrid;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::keep_out::MARKED;
use spf_core::lift::{Lifting, project_displacement, range_of_label};
use spf_core::panel::Panel;
use spf_core::query::{ImageBox, ImagePoint, Mark};
use spf_core::reply::ObstacleBox;
use spf_core::time::{Duration, Time};
use spf_core::track::TrackQuality;
use spf_drone::frames::Photo;
use spf_media::Scaler;
use spf_media::frame::Rgb;
use spf_media::jpeg::Jpeg;
use spf_media::marks::{self, Hud};
use spf_pilot::{Action, Note, Pilot};
use spf_record::log::foxglove::Marks;
use spf_record::video::{VideoError, VideoWriter};

use crate::frame_source::FrameSource;
use crate::log::Outlet;
use crate::words;

mod depth_view;
mod map_view;
mod track_view;

/// Frames per second of flight time: the paper's controller acts ten times per second.
const FPS: u64 = 10;
/// About half the camera's resolution: a third of the rendering time, with text still readable.
pub(crate) const SIZE: (u32, u32) = (640, 480);
/// Maximum number of frames queued for rendering.
const WAITING: usize = 16;
/// Maximum number of rendered images queued for encoding, a megabyte each: a slow image delays the encoder no more than it must.
const RENDERED: usize = 3;

/// Quality of the JPEG images in the log, high enough to keep the edges of distant objects.
const JPEG_QUALITY: u8 = 80;

/// How long the boxes of a reply are shown.
const BOXES_SHOWN: Duration = Duration::from_millis(1000);

/// How long a depth grid is shown: a sensor that delivers none has failed.
const DEPTH_SHOWN: Duration = Duration::from_millis(500);

/// Older snapshots may no longer be available: the simulator keeps ten seconds.
const FORGOTTEN: Duration = Duration::from_secs(9);

/// The contents of one video frame.
struct Shot {
    /// Flight time of the frame.
    at: Time,
    photo: Photo,
    /// Estimated pose.
    known: Pose,
    waypoint: Option<EnuPosition>,
    boxes: Vec<(ImageBox, String)>,
    query_marks: Vec<Mark>,
    /// The tracked box.
    track: Option<(ImageBox, TrackQuality)>,
    title: String,
    status: String,
    decision: String,
    craft: String,
    /// The obstacle map, with the newest depth grid below it, if there are any.
    corner: Option<Rgb>,
}

/// A video being recorded. Frames are rendered in one thread and encoded in another, so that setpoints are never delayed;
/// the resulting bytes do not depend on timing. On the wall clock, frames are dropped if there is no time for them.
pub(crate) struct Film {
    frame_source: Arc<dyn FrameSource>,
    title: String,
    next: Time,
    decision: String,
    waypoint: Option<EnuPosition>,
    /// The boxes of the last reply, each with its caption, and when their frame was captured.
    boxes: Vec<(Panel, String)>,
    captured: Time,
    /// The marks of the last query, such as PIVOT's arrows.
    query_marks: Vec<Mark>,
    /// Until when boxes and marks are shown.
    drawn_until: Time,
    /// The newest grid of the depth sensor, and when it arrived.
    depth: Option<(Time, DepthGrid)>,
    live: bool,
    shots: SyncSender<Shot>,
    renderer: JoinHandle<()>,
    encoder: JoinHandle<Result<(), VideoError>>,
}

impl Film {
    /// Opens the file and starts both threads. The unmarked camera images also go to the `log`.
    pub(crate) fn start(
        path: &Path,
        frame_source: Arc<dyn FrameSource>,
        title: &str,
        log: Option<Outlet>,
        live: bool,
    ) -> Result<Self, VideoError> {
        let writer = VideoWriter::create(path, SIZE.0, SIZE.1, FPS as f64)?;
        let (shots, waiting) = sync_channel(WAITING);
        let (rendered, images) = sync_channel(RENDERED);
        let camera = *frame_source.camera();
        let renderer = std::thread::spawn(move || render(&waiting, &rendered));
        let encoder = std::thread::spawn(move || encode(writer, &camera, &images, log.as_ref()));
        Ok(Self {
            frame_source,
            title: title.to_owned(),
            next: Time::ZERO,
            decision: String::new(),
            waypoint: None,
            boxes: Vec::new(),
            captured: Time::ZERO,
            query_marks: Vec::new(),
            drawn_until: Time::ZERO,
            depth: None,
            live,
            shots,
            renderer,
            encoder,
        })
    }

    /// Remembers what a depth sensor measured.
    pub(crate) fn depth(&mut self, now: Time, grid: &DepthGrid) {
        self.depth = Some((now, grid.clone()));
    }

    /// Updates the overlay from an action.
    pub(crate) fn note(&mut self, now: Time, action: &Action) {
        match action {
            // A policy that uses marks holds until the reply arrives, so the marks stay in place.
            Action::Ask(query) if query.marks.iter().any(is_choice) => {
                self.boxes.clear();
                self.query_marks = query.marks.iter().filter(|mark| is_choice(mark)).cloned().collect();
                self.drawn_until = Time::MAX;
            }
            Action::Note(Note::Decision(decision)) => {
                self.decision = format!("{}. {}", decision.number, words::decision(decision));
                self.waypoint = decision.goal.filter(|_| !decision.passed).map(|goal| goal.position);
                // They belong to the frame of the decision, and are shown where they are by now.
                let place = |b: &ObstacleBox| Panel::new(self.frame_source.camera(), decision.pose, b.area, b.depth);
                let boxes = decision.reading.reply.iter().flat_map(|reply| &reply.boxes).filter(|b| b.name != MARKED);
                self.boxes =
                    boxes.map(|b| (place(b), format!("{} {:.0} m", b.name, range_of_label(f64::from(b.depth))))).collect();
                self.captured = decision.captured;
                self.drawn_until = now + BOXES_SHOWN;
            }
            Action::Note(Note::Envelope(cause)) if !cause.is_rate() => self.decision = format!("envelope: {cause}"),
            Action::Finished(ending) => {
                self.decision = format!("{}: {}", words::outcome(ending.outcome), ending.cause);
                self.waypoint = None;
                self.query_marks.clear();
            }
            _ => {}
        }
    }

    /// Queues all frames due by `now`. Returns false once the encoder has stopped; [`Film::finish`] then gives the
    /// reason.
    pub(crate) fn advance(&mut self, now: Time, pilot: &Pilot) -> bool {
        while self.next <= now {
            let Some(photo) = self.frame_source.shot(self.next) else {
                // Not available yet, or the shutter is open; or so long ago that the simulator no longer has it, after
                // the whole machine was suspended: continue from here.
                if now.since(self.next) > FORGOTTEN {
                    self.next = now;
                }
                return true;
            };
            let shot = self.shot(self.next, photo, pilot);
            let open = if self.live {
                !matches!(self.shots.try_send(shot), Err(TrySendError::Disconnected(_)))
            } else {
                self.shots.send(shot).is_ok()
            };
            if !open {
                return false;
            }
            self.next += Duration::from_nanos(1_000_000_000 / FPS);
        }
        true
    }

    fn shot(&self, at: Time, photo: Photo, pilot: &Pilot) -> Shot {
        let known = pilot.known_pose(at);
        // Adding zero removes the sign of negative zero, which would print as "-00".
        let heading = known.attitude.heading.to_degrees().round().rem_euclid(360.0) + 0.0;
        // If the craft reports its position the error is constant, and of no interest here.
        let error = pilot.position_error();
        let drifted = if pilot.is_dead_reckoned() { format!("  position ±{error:.1} m") } else { String::new() };
        let shown = at < self.drawn_until;
        let mut boxes = if shown { self.boxes_at(known) } else { Vec::new() };
        // Whoever walks is no longer where a box was seen.
        let age = at.since(self.captured).as_secs_f64();
        let seen = if boxes.is_empty() { String::new() } else { format!("  boxes seen {age:.1} s ago") };
        boxes.extend(marked_at(pilot, self.frame_source.camera(), known));
        Shot {
            at,
            photo,
            known,
            waypoint: self.waypoint,
            boxes,
            query_marks: if shown { self.query_marks.clone() } else { Vec::new() },
            track: track_view::area(pilot, self.frame_source.camera(), at, known),
            title: self.title.clone(),
            status: format!("{:.1} s  {}", at.as_secs_f64(), words::phase(pilot.phase())),
            decision: self.decision.clone(),
            craft: format!(
                "height {:.1} m  heading {heading:03.0}  decisions {}{drifted}{seen}",
                known.position.up,
                pilot.decisions()
            ),
            corner: self.corner(at, known, pilot),
        }
    }

    /// The obstacle map, and what the depth sensor measures, if it still does.
    fn corner(&self, at: Time, known: Pose, pilot: &Pilot) -> Option<Rgb> {
        let depth = self.depth.as_ref().filter(|(arrived, _)| at.since(*arrived) <= DEPTH_SHOWN);
        let depth = depth.map(|(_, grid)| depth_view::draw(grid, map_view::SIDE));
        match (map_view::draw(pilot, known), depth) {
            (Some(map), Some(depth)) => Some(stacked(&map, &depth)),
            (map, depth) => map.or(depth),
        }
    }

    /// The boxes as seen from a pose.
    fn boxes_at(&self, known: Pose) -> Vec<(ImageBox, String)> {
        let seen = |(place, caption): &(Panel, String)| {
            let (area, _) = place.seen_from(self.frame_source.camera(), known)?;
            Some((area, caption.clone()))
        };
        self.boxes.iter().filter_map(seen).collect()
    }

    /// Finishes the file.
    pub(crate) fn finish(self) -> Result<(), VideoError> {
        drop(self.shots);
        // A panic of either thread is a bug, but it must not unwind through the loop that flies the craft.
        let rendered = self.renderer.join().map_err(|_| VideoError::Panicked);
        rendered.and(self.encoder.join().unwrap_or(Err(VideoError::Panicked)))
    }
}

/// Renders on all processors, while the encoder, which uses one, is at work on the images before.
fn render(shots: &Receiver<Shot>, rendered: &SyncSender<(Shot, Rgb)>) {
    let mut scaler = Scaler::default();
    for shot in shots {
        let image = shot.photo.at(SIZE, &mut scaler);
        if rendered.send((shot, image)).is_err() {
            // The encoder has stopped, and knows why.
            return;
        }
    }
}

fn encode(
    mut writer: VideoWriter,
    camera: &Camera,
    rendered: &Receiver<(Shot, Rgb)>,
    log: Option<&Outlet>,
) -> Result<(), VideoError> {
    let mut trouble = None;
    for (shot, mut image) in rendered {
        let marks = Marks { waypoint: waypoint(camera, &shot), boxes: shot.boxes.clone() };
        if let Some(log) = log
            && let Ok(jpeg) = Jpeg::encode(&image, JPEG_QUALITY)
        {
            log.image(shot.at, jpeg.bytes().to_vec().into(), SIZE, &marks);
        }
        annotate(&mut image, &shot, &marks);
        if let Err(error) = writer.push(shot.at, &image) {
            trouble = Some(error);
            break;
        }
    }
    // Finish the file, so that everything up to the error can be played.
    let ended = writer.finish().map(|_| ());
    trouble.map_or(ended, Err)
}

/// Distance from which on a waypoint is shown, metres.
const SHOWN_FROM_M: f64 = 0.3;

/// The end of the plan in the image. Plans use the pilot's estimate of the world, so the estimated pose is used for
/// projection.
fn waypoint(camera: &Camera, shot: &Shot) -> Option<(ImagePoint, String)> {
    let ahead = shot.known.position.displacement_to(shot.waypoint?, shot.known.attitude.heading);
    // A turn on the spot has no waypoint to show, and the place where it began drifts with the estimated position.
    if ahead.length() < SHOWN_FROM_M {
        return None;
    }
    let point = project_displacement(ahead, camera, shot.known.attitude, Lifting::Levelled)?;
    Some((point, format!("waypoint {:.1} m", ahead.length())))
}

/// Whether a mark of a query is one to choose from. Boxes are the places that the operator has marked, which are drawn where they
/// are by now.
fn is_choice(mark: &Mark) -> bool {
    !matches!(mark, Mark::Box { .. })
}

/// The places that the operator has marked, as seen from a pose.
fn marked_at(pilot: &Pilot, camera: &Camera, known: Pose) -> impl Iterator<Item = (ImageBox, String)> {
    pilot.kept_out().iter().filter_map(move |place| Some((place.area_in(camera, known)?, format!("keep away {}", place.id + 1))))
}

/// Two images of the same width, one above the other, with a line between them.
fn stacked(upper: &Rgb, lower: &Rgb) -> Rgb {
    let line = vec![0; 3 * 2 * upper.width() as usize];
    let data = [upper.data(), &line, lower.data()].concat();
    Rgb::from_raw(upper.width(), upper.height() + 2 + lower.height(), data).unwrap_or_else(|_| upper.clone())
}

fn annotate(image: &mut Rgb, shot: &Shot, drawn: &Marks) {
    if let Some((area, quality)) = &shot.track {
        track_view::draw(image, area, *quality);
    }
    let mut boxes = drawn.as_marks();
    boxes.splice(..0, shot.query_marks.iter().cloned());
    // Perception on one line and the resulting step on the next: together they are too long for the frame.
    let (seen, then) = shot.decision.split_once(" → ").unwrap_or((&shot.decision, ""));
    let hud = Hud { title: &shot.title, status: &shot.status, lines: &[seen, then, &shot.craft], corner: shot.corner.as_ref() };
    marks::annotate(image, &boxes, drawn.waypoint.as_ref().map(|(point, caption)| (*point, caption.as_str())), &hud);
}
