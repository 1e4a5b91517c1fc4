//! `video.mp4`: what the camera sees, with what was decided drawn on it, in flight time.

use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;

use spf_core::lift::{Lifting, project_displacement};
use spf_core::pilot::{Action, Note, Pilot};
use spf_core::query::Mark;
use spf_core::time::{Duration, Time};
use spf_media::frame::Rgb;
use spf_media::marks::{self, Colour, Hud};
use spf_record::video::{VideoError, VideoWriter};

use crate::sim::SimWorld;
use crate::words;

/// Pictures a flight second: the paper's controller acts ten times a second, so nothing is between two pictures.
const FPS: u64 = 10;
/// Half the camera's sides and a bit: a third of the drawing time, and text is still read easily.
const SIZE: (u32, u32) = (640, 480);
/// Pictures that may wait for the encoder.
const WAITING: usize = 4;

/// A video in the making. Drawing happens here, encoding in a thread of its own; the bytes depend on neither.
pub(crate) struct Film {
    world: SimWorld,
    title: String,
    next: Time,
    decision: String,
    waypoint: Option<spf_core::geometry::EnuPosition>,
    boxes: Vec<Mark>,
    boxes_until: Time,
    pictures: SyncSender<(Time, Rgb)>,
    encoder: JoinHandle<Result<(), VideoError>>,
}

impl Film {
    /// Opens the file and starts the encoder.
    pub(crate) fn start(path: &Path, world: SimWorld, title: &str) -> Result<Self, VideoError> {
        let writer = VideoWriter::create(path, SIZE.0, SIZE.1, FPS as f64)?;
        let (pictures, waiting) = sync_channel(WAITING);
        let encoder = std::thread::spawn(move || encode(writer, &waiting));
        Ok(Self {
            world,
            title: title.to_owned(),
            next: Time::ZERO,
            decision: String::new(),
            waypoint: None,
            boxes: Vec::new(),
            boxes_until: Time::ZERO,
            pictures,
            encoder,
        })
    }

    /// Takes note of what is to be shown.
    pub(crate) fn note(&mut self, now: Time, action: &Action) {
        match action {
            Action::Note(Note::Decision(decision)) => {
                self.decision = format!("{}. {}", decision.number, words::decision(decision));
                self.waypoint = decision.goal.filter(|_| !decision.passed).map(|goal| goal.position);
                let boxes = decision.reading.reply.iter().flat_map(|reply| &reply.boxes);
                self.boxes = boxes.map(|b| Mark::Box { area: b.area, label: format!("{} {}", b.name, b.depth) }).collect();
                // Boxes belong to the frame that was decided on; soon they would be drawn over something else.
                self.boxes_until = now + Duration::from_millis(600);
            }
            Action::Note(Note::Envelope(cause)) => self.decision = format!("envelope: {cause}"),
            Action::Finished(ending) => {
                self.decision = format!("{}: {}", words::outcome(ending.outcome), ending.cause);
                self.waypoint = None;
            }
            _ => {}
        }
    }

    /// Draws every picture that is due by `now`. False once the encoder has stopped; [`Film::finish`] then tells why.
    pub(crate) fn advance(&mut self, now: Time, pilot: &Pilot) -> bool {
        while self.next <= now {
            let Some(pose) = self.world.true_pose_at(self.next) else { return true };
            let picture = self.draw(self.next, &pose, pilot);
            if self.pictures.send((self.next, picture)).is_err() {
                return false;
            }
            self.next += Duration::from_nanos(1_000_000_000 / FPS);
        }
        true
    }

    fn draw(&self, at: Time, pose: &spf_core::geometry::Pose, pilot: &Pilot) -> Rgb {
        let mut picture = self.world.photograph(pose, Some(SIZE));
        if at < self.boxes_until {
            marks::draw(&mut picture, &self.boxes);
        }
        let known = pilot.known_pose(at);
        // What was seen on one line and what was made of it on the next: together they are too long for the picture.
        let (seen, then) = self.decision.split_once(" → ").unwrap_or((&self.decision, ""));
        let status = format!("{:.1} s  {}", at.as_secs_f64(), words::phase(pilot.phase()));
        let heading = known.attitude.heading.to_degrees().rem_euclid(360.0);
        let craft = format!("height {:.1} m  heading {heading:03.0}  decisions {}", known.position.up, pilot.decisions());
        marks::draw_hud(&mut picture, &Hud { title: &self.title, status: &status, lines: &[seen, then, &craft] });
        if let Some(goal) = self.waypoint {
            // The plan lives in the pilot's world: it is drawn as the pilot believes to see it.
            let ahead = known.position.displacement_to(goal, known.attitude.heading);
            if let Some(point) = project_displacement(ahead, self.world.camera(), known.attitude, Lifting::Levelled) {
                marks::draw_waypoint(&mut picture, point, &format!("{:.1} m", ahead.length()), Colour::WAYPOINT);
            }
        }
        picture
    }

    /// Ends the file.
    pub(crate) fn finish(self) -> Result<(), VideoError> {
        drop(self.pictures);
        // A panic of the encoder is a bug and goes on here.
        self.encoder.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    }
}

fn encode(mut writer: VideoWriter, pictures: &Receiver<(Time, Rgb)>) -> Result<(), VideoError> {
    let mut trouble = None;
    for (time, picture) in pictures {
        if let Err(error) = writer.push(time, &picture) {
            trouble = Some(error);
            break;
        }
    }
    // What was written until the trouble can still be played.
    let ended = writer.finish().map(|_| ());
    trouble.map_or(ended, Err)
}
