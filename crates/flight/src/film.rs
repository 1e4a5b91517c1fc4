//! `video.mp4`: what the camera sees, with what was decided drawn on it, in flight time.

use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;

use spf_core::camera::Camera;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::lift::{Lifting, project_displacement};
use spf_core::pilot::{Action, Note, Pilot};
use spf_core::query::{ImageBox, ImagePoint, Mark};
use spf_core::time::{Duration, Time};
use spf_drone::frames::Photo;
use spf_media::Scaler;
use spf_media::frame::Rgb;
use spf_media::jpeg::Jpeg;
use spf_media::marks::{self, Colour, Hud};
use spf_record::log::foxglove::Marks;
use spf_record::video::{VideoError, VideoWriter};

use crate::frame_source::FrameSource;
use crate::log::Outlet;
use crate::words;

/// Images a flight second: the paper's controller acts ten times a second, so nothing is between two images.
const FPS: u64 = 10;
/// Half the camera's sides and a bit: a third of the drawing time, and text is still read easily.
pub(crate) const SIZE: (u32, u32) = (640, 480);
/// Images that may wait to be drawn.
const WAITING: usize = 16;

/// Quality of the JPEG images in the log: a far car keeps its edges.
const JPEG_QUALITY: u8 = 80;

/// Older poses may be forgotten by the simulator, which keeps ten seconds.
const FORGOTTEN: Duration = Duration::from_secs(9);

/// What one image shows.
struct Shot {
    /// The flight time that it is an image of.
    at: Time,
    photo: Photo,
    /// Where the pilot believes to be.
    known: Pose,
    waypoint: Option<EnuPosition>,
    boxes: Vec<(ImageBox, String)>,
    asked: Vec<Mark>,
    title: String,
    status: String,
    decision: String,
    craft: String,
}

/// A video in the making. Images are drawn and encoded in a thread of their own, so that no setpoint waits for one; the bytes
/// do not depend on it. On the wall clock an image for which there is no time is left out.
pub(crate) struct Film {
    frame_source: Arc<dyn FrameSource>,
    title: String,
    next: Time,
    decision: String,
    waypoint: Option<EnuPosition>,
    boxes: Vec<(ImageBox, String)>,
    /// The marks of the latest question, such as PIVOT's arrows.
    asked: Vec<Mark>,
    /// Until when boxes and marks are shown.
    drawn_until: Time,
    live: bool,
    shots: SyncSender<Shot>,
    encoder: JoinHandle<Result<(), VideoError>>,
}

impl Film {
    /// Opens the file and starts the encoder. The images go to the `log` too, as the camera saw them.
    pub(crate) fn start(
        path: &Path,
        frame_source: Arc<dyn FrameSource>,
        title: &str,
        log: Option<Outlet>,
        live: bool,
    ) -> Result<Self, VideoError> {
        let writer = VideoWriter::create(path, SIZE.0, SIZE.1, FPS as f64)?;
        let (shots, waiting) = sync_channel(WAITING);
        let camera = *frame_source.camera();
        let encoder = std::thread::spawn(move || encode(writer, &camera, &waiting, log.as_ref()));
        Ok(Self {
            frame_source,
            title: title.to_owned(),
            next: Time::ZERO,
            decision: String::new(),
            waypoint: None,
            boxes: Vec::new(),
            asked: Vec::new(),
            drawn_until: Time::ZERO,
            live,
            shots,
            encoder,
        })
    }

    /// Takes note of what is to be shown.
    pub(crate) fn note(&mut self, now: Time, action: &Action) {
        match action {
            // Who asks about marks holds until the answer is there, so that they stay where they belong.
            Action::Ask(query) if !query.marks.is_empty() => {
                self.boxes.clear();
                self.asked.clone_from(&query.marks);
                self.drawn_until = Time::MAX;
            }
            Action::Note(Note::Decision(decision)) => {
                self.decision = format!("{}. {}", decision.number, words::decision(decision));
                self.waypoint = decision.goal.filter(|_| !decision.passed).map(|goal| goal.position);
                let boxes = decision.reading.reply.iter().flat_map(|reply| &reply.boxes);
                self.boxes = boxes.map(|b| (b.area, format!("{} {}", b.name, b.depth))).collect();
                // They belong to the frame that was decided on; soon they would be drawn over something else.
                self.drawn_until = now + Duration::from_millis(600);
            }
            Action::Note(Note::Envelope(cause)) => self.decision = format!("envelope: {cause}"),
            Action::Finished(ending) => {
                self.decision = format!("{}: {}", words::outcome(ending.outcome), ending.cause);
                self.waypoint = None;
                self.asked.clear();
            }
            _ => {}
        }
    }

    /// Takes every image that is due by `now`. False once the encoder has stopped; [`Film::finish`] then tells why.
    pub(crate) fn advance(&mut self, now: Time, pilot: &Pilot) -> bool {
        while self.next <= now {
            let Some(photo) = self.frame_source.shot(self.next) else {
                // Not flown yet, or the shutter is open; or so long ago that the simulator forgot, after a standstill of the
                // whole machine: go on from here.
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
        // Adding zero takes the sign from a negative one, which would read "-00".
        let heading = known.attitude.heading.to_degrees().round().rem_euclid(360.0) + 0.0;
        // Of a craft that tells its position this stays what it is, and a person need not know it.
        let error = pilot.position_error();
        let drifted = if pilot.is_dead_reckoned() { format!("  position ±{error:.1} m") } else { String::new() };
        let shown = at < self.drawn_until;
        Shot {
            at,
            photo,
            known,
            waypoint: self.waypoint,
            boxes: if shown { self.boxes.clone() } else { Vec::new() },
            asked: if shown { self.asked.clone() } else { Vec::new() },
            title: self.title.clone(),
            status: format!("{:.1} s  {}", at.as_secs_f64(), words::phase(pilot.phase())),
            decision: self.decision.clone(),
            craft: format!("height {:.1} m  heading {heading:03.0}  decisions {}{drifted}", known.position.up, pilot.decisions()),
        }
    }

    /// Ends the file.
    pub(crate) fn finish(self) -> Result<(), VideoError> {
        drop(self.shots);
        // A panic of the encoder is a bug and goes on here.
        self.encoder.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    }
}

fn encode(mut writer: VideoWriter, camera: &Camera, shots: &Receiver<Shot>, log: Option<&Outlet>) -> Result<(), VideoError> {
    let (mut trouble, mut scaler) = (None, Scaler::default());
    for shot in shots {
        let mut picture = shot.photo.at(SIZE, &mut scaler);
        let marks = Marks { waypoint: waypoint(camera, &shot), boxes: shot.boxes.clone() };
        if let Some(log) = log
            && let Ok(jpeg) = Jpeg::encode(&picture, JPEG_QUALITY)
        {
            log.picture(shot.at, jpeg.bytes().to_vec().into(), SIZE, &marks);
        }
        annotate(&mut picture, &shot, &marks);
        if let Err(error) = writer.push(shot.at, &picture) {
            trouble = Some(error);
            break;
        }
        scaler.reuse(picture);
    }
    // What was written until the trouble can still be played.
    let ended = writer.finish().map(|_| ());
    trouble.map_or(ended, Err)
}

/// Where the plan's end is in the image. The plan lives in the pilot's world: it is drawn as the pilot believes to see it.
fn waypoint(camera: &Camera, shot: &Shot) -> Option<(ImagePoint, String)> {
    let ahead = shot.known.position.displacement_to(shot.waypoint?, shot.known.attitude.heading);
    let point = project_displacement(ahead, camera, shot.known.attitude, Lifting::Levelled)?;
    Some((point, format!("{:.1} m", ahead.length())))
}

fn annotate(picture: &mut Rgb, shot: &Shot, drawn: &Marks) {
    marks::draw(picture, &shot.asked);
    marks::draw(picture, &drawn.as_marks());
    // What was seen on one line and what was made of it on the next: together they are too long for the image.
    let (seen, then) = shot.decision.split_once(" → ").unwrap_or((&shot.decision, ""));
    marks::draw_hud(picture, &Hud { title: &shot.title, status: &shot.status, lines: &[seen, then, &shot.craft] });
    if let Some((point, caption)) = &drawn.waypoint {
        marks::draw_waypoint(picture, *point, caption, Colour::WAYPOINT);
    }
}
