//! Observes a flight for the page. It copies what is small into slots that others read; drawing and sending happen elsewhere.

use std::sync::Arc;
use std::time::Instant;

use serde_json::{Value, json};
use spf_core::camera::Camera;
use spf_core::frame::FrameMeta;
use spf_core::geometry::EnuPosition;
use spf_core::keep_out::KeepOut;
use spf_core::telemetry::Telemetry;
use spf_core::time::{Duration, Time};
use spf_flight::log::FlightHeader;
use spf_flight::odometer::Odometer;
use spf_flight::pointing::Pointing;
use spf_flight::run::Observer;
use spf_flight::sight::Sight;
use spf_flight::words;
use spf_pilot::{Action, Event, Note, OperatorEvent, Phase, Pilot};
use spf_vlm::human::HUMAN;

use crate::hub::{Hub, Kept, json};
use crate::overlay::Drawn;
use crate::worker::{Job, LivePicture, Worker};

/// Intervals of states, of points of the flown path, and of the obstacle map.
const STATE_EVERY: Duration = Duration::from_millis(100);
const PATH_EVERY: Duration = Duration::from_millis(250);
const MAP_EVERY: Duration = Duration::from_millis(500);
/// Maximum number of obstacle cells shown, and the half height of the slice of the map, cells.
const CELLS: usize = 1500;
const SLICE: i32 = 3;

/// An observer of a flight that shows it in the cockpit.
pub struct Instruments {
    hub: Arc<Hub>,
    pointing: Arc<Pointing>,
    worker: Arc<Worker>,
    sight: Option<Sight>,
    camera: Camera,
    drawn: Drawn,
    /// A frame that is not shown yet.
    fresh: Option<FrameMeta>,
    newest: Option<FrameMeta>,
    telemetry: Option<Telemetry>,
    link_lost: bool,
    instruction: String,
    /// The open query, and when it was sent.
    asked: Option<(u64, Time)>,
    /// The end of the plan.
    goal: Option<EnuPosition>,
    /// The operator has ordered to hold, which on the ground is in effect after take-off.
    holds: bool,
    odometer: Odometer,
    /// When the outcome was settled, and what had been flown by then: the figures of the result.
    settled: Option<(Time, f64)>,
    /// Whether the map was moved to where the craft counts its position from.
    placed: bool,
    next_state: Time,
    next_path: Time,
    next_map: Time,
}

impl Instruments {
    pub(crate) fn new(hub: Arc<Hub>, pointing: Arc<Pointing>, worker: Arc<Worker>) -> Self {
        Self {
            hub,
            pointing,
            worker,
            sight: None,
            camera: Camera::quad(),
            drawn: Drawn::default(),
            fresh: None,
            newest: None,
            telemetry: None,
            link_lost: false,
            instruction: String::new(),
            asked: None,
            goal: None,
            holds: false,
            odometer: Odometer::default(),
            settled: None,
            placed: false,
            next_state: Time::ZERO,
            next_path: Time::ZERO,
            next_map: Time::ZERO,
        }
    }

    fn line(&self, now: Time, level: &str, text: &str) {
        self.hub.tell(Kept::Row, &json!({"type": "line", "t": now.as_secs_f64(), "level": level, "text": text}));
    }

    /// Hands the newest frame over to be drawn, with what belongs over it.
    fn picture(&mut self, now: Time, pilot: &Pilot) {
        let Some(meta) = self.fresh.take() else { return };
        let pose = pilot.pose_at(meta.captured).unwrap_or_else(|| pilot.known_pose(now));
        self.pointing.lost_track(pilot.lost_track());
        // Where an image was taken before a jump of the position, nobody knows.
        if pilot.lost_track().is_none_or(|lost| lost <= meta.captured) {
            self.pointing.frame(meta.id, pose);
        }
        if !self.worker.is_watched() {
            return;
        }
        let Some(photo) = self.sight.as_ref().and_then(|sight| sight.photo(meta.id)) else { return };
        let overlay = self.drawn.seen(now, meta.captured, pose, &self.camera, pilot);
        let exposed = self.sight.as_ref().map(|sight| sight.exposed(meta.id)).unwrap_or_default();
        self.worker.show(LivePicture { meta, photo, overlay, now, at: Instant::now() }, exposed);
    }

    fn state(&mut self, now: Time, pilot: &Pilot) {
        let pose = pilot.known_pose(now);
        let telemetry = self.telemetry.as_ref();
        let speed = telemetry.and_then(|telemetry| telemetry.velocity).map(|velocity| velocity.horizontal_speed());
        let anchor = pilot.anchor_view(now).map(|seen| {
            json!({"at": [seen.position.east, seen.position.north], "sd": seen.range_sd.max(seen.lateral_sd), "range": seen.range})
        });
        let path = pilot
            .guide()
            .map(|guide| guide.path.iter().map(|cell| cell.middle()).map(|at| [at.east, at.north]).collect::<Vec<_>>());
        self.pointing.anchored(pilot.anchor().map(|_| self.instruction.as_str()));
        // An instruction given later goes on with the flight.
        let settled = self.settled.filter(|_| pilot.ending().is_some());
        let (until, flown) = settled.unwrap_or_else(|| (now, self.odometer.metres()));
        let state = json!({
            "type": "state",
            "t": until.as_secs_f64(),
            "phase": pilot.phase(),
            "will_hold": self.holds && matches!(pilot.phase(), Phase::Ground | Phase::TakeOff),
            "phase_text": words::phase(pilot.phase()),
            "instruction": self.instruction,
            "height": telemetry.and_then(|telemetry| telemetry.height).unwrap_or(pose.position.up),
            "clearance": telemetry.and_then(|telemetry| telemetry.ground_clearance),
            "at": [pose.position.east, pose.position.north],
            "heading": pose.attitude.heading.to_degrees().rem_euclid(360.0),
            "speed": speed,
            "crashed": telemetry.is_some_and(|telemetry| telemetry.crashed),
            "battery": telemetry.and_then(|telemetry| telemetry.battery),
            "link": !self.link_lost,
            "telemetry_age": telemetry.map(|telemetry| now.since(telemetry.time).as_secs_f64()),
            "decisions": pilot.decisions(),
            "flown": flown,
            "sigma": pilot.is_dead_reckoned().then(|| pilot.position_error()),
            "asked": self.asked.map(|(query, at)| json!({"query": query, "for": now.since(at).as_secs_f64()})),
            "goal": self.goal.map(|goal| [goal.east, goal.north]),
            "anchor": anchor,
            "path": path,
            "marked": marked(pilot),
        });
        self.hub.state.send_replace(json(&state));
    }

    /// Occupied cells at about the craft's height.
    fn obstacles(&self, now: Time, pilot: &Pilot) {
        let Some(map) = pilot.obstacle_map() else { return };
        let level = spf_space::obstacle_map::Cell::of(pilot.known_pose(now).position).up;
        let near = map.occupied().filter(|cell| (cell.up - level).abs() <= SLICE).take(CELLS);
        let cells: Vec<[f64; 2]> = near.map(|cell| cell.middle()).map(|at| [rounded(at.east), rounded(at.north)]).collect();
        self.hub.tell(Kept::No, &json!({"type": "obstacles", "cells": cells}));
    }

    /// Tells where the scene's map lies for a craft that counts its position from its take-off point.
    fn place(&mut self, now: Time, pilot: &Pilot) {
        if self.placed || pilot.phase() != Phase::Ground {
            return;
        }
        let truth = self.sight.as_ref().and_then(Sight::place_on_map);
        if let Some(truth) = truth.filter(|_| pilot.is_dead_reckoned()) {
            let known = pilot.known_pose(now).position;
            let offset = [known.east - truth.east, known.north - truth.north];
            self.hub.tell(Kept::Row, &json!({"type": "offset", "offset": offset}));
            self.placed = true;
        }
    }
}

/// The places that the operator has marked, from above: number, and the ends of the line.
fn marked(pilot: &Pilot) -> Vec<Value> {
    let ends = |place: &KeepOut| {
        let [left, _, _, right] = place.panel.corners().map(|at| [rounded(at.east), rounded(at.north)]);
        json!({"id": place.id, "ends": [left, right]})
    };
    pilot.kept_out().iter().map(ends).collect()
}

/// Whether the flight goes on by itself, so that there is nothing to resume.
fn goes_on(phase: Phase) -> bool {
    matches!(phase, Phase::Ground | Phase::TakeOff | Phase::Flying)
}

fn rounded(metres: f64) -> f64 {
    (metres * 100.0).round() / 100.0
}

fn outlines(sight: &Sight) -> Vec<Value> {
    let outline = |outline: spf_record::trajectory::Outline| {
        let [red, green, blue] = outline.colour;
        let rings: Vec<Vec<[f64; 2]>> = outline.polygons;
        json!({"name": outline.name, "colour": format!("rgb({red} {green} {blue})"), "rings": rings})
    };
    sight.outlines().into_iter().map(outline).collect()
}

impl Observer for Instruments {
    fn begin(&mut self, head: &FlightHeader, sight: &Sight) {
        (self.camera, self.sight) = (head.camera, Some(sight.clone()));
        self.instruction.clone_from(&head.instruction);
        self.pointing.begin(head.camera, head.vlm == HUMAN);
        self.worker.begin_flight();
        let (alpha, beta) = head.camera.half_fov();
        let fence: Vec<Vec<(f64, f64)>> =
            head.limits.geofence.iter().flat_map(|fence| fence.outlines()).map(<[_]>::to_vec).collect();
        self.hub.picture.send_replace(None);
        self.hub.tell(
            Kept::Flight,
            &json!({
                "type": "flight",
                "instruction": head.instruction,
                "drone": head.drone,
                "scene": head.sim.as_ref().map(|sim| sim.scene.rsplit(['/', '\\']).next().unwrap_or_default()),
                "policy": head.policy,
                // Without the path of a program and the address of a server.
                "vlm": if head.vlm.starts_with("exec:") { "exec" } else { head.vlm.split('@').next().unwrap_or_default() },
                "points": head.policy.starts_with("spf"),
                // How far each distance that is pointed at leads: a place without a box is no sighting of the target.
                "steps": (1..=10_u8).map(|label| head.settings.step.length(label)).collect::<Vec<_>>(),
                "camera": {"width": head.camera.width, "height": head.camera.height, "half_fov": [alpha, beta],
                           "tilt": head.camera.tilt},
                "max_distance": head.limits.max_distance,
                "fence": fence,
                "outlines": outlines(sight),
            }),
        );
    }

    fn event(&mut self, _now: Time, event: &Event) {
        match event {
            Event::Frame(meta) if meta.unusable.is_none() => (self.fresh, self.newest) = (Some(*meta), Some(*meta)),
            Event::Telemetry(telemetry) => self.telemetry = Some(*telemetry),
            Event::LinkLost => self.link_lost = true,
            Event::LinkRestored => self.link_lost = false,
            _ => {}
        }
    }

    fn action(&mut self, now: Time, action: &Action, pilot: &Pilot) {
        self.pointing.phase(pilot.phase());
        self.pointing.lost_track(pilot.lost_track());
        self.picture(now, pilot);
        self.drawn.note(now, action, &self.camera);
        match action {
            Action::Ask(query) => {
                self.asked = Some((query.id.0, now));
                if let Some(meta) = self.newest.filter(|meta| meta.id == query.frame)
                    && let Some(pose) = pilot.pose_at(meta.captured)
                {
                    self.pointing.asked(meta.id, pose);
                }
                if let Some(photo) = self.sight.as_ref().and_then(|sight| sight.photo(query.frame)) {
                    self.worker.give(Job::Asked(query.clone(), photo));
                }
            }
            Action::Cancel(id) => drop(self.asked.take_if(|(asked, _)| *asked == id.0)),
            // That all is well every 2 s is no news.
            Action::Note(Note::Decision(decision)) => {
                (self.asked, self.goal) = (None, decision.goal.filter(|_| !decision.passed).map(|goal| goal.position));
                let flown_to = self.drawn.point(decision.pose, &self.camera, pilot);
                self.worker.give(Job::Decided(decision.clone(), flown_to));
            }
            Action::Note(Note::Operator(OperatorEvent::Setpoint(_)) | Note::OperatorIgnored(OperatorEvent::Setpoint(_), _)) => {}
            // Sent with every instruction, for a drone that holds.
            Action::Note(Note::OperatorIgnored(OperatorEvent::Resume, _)) if goes_on(pilot.phase()) => {}
            Action::Note(Note::Envelope(cause)) if cause.is_rate() => {}
            Action::Note(note) => {
                match note {
                    Note::Operator(OperatorEvent::Instruction(text)) => self.instruction.clone_from(text),
                    Note::Operator(OperatorEvent::Hold | OperatorEvent::Left) | Note::LetGo(_) => self.holds = true,
                    Note::Operator(OperatorEvent::Resume) => self.holds = false,
                    _ => {}
                }
                let level = match note {
                    Note::QueryFailed { .. } => "error",
                    // It lands already.
                    Note::OperatorIgnored(OperatorEvent::Land, _) => "info",
                    Note::Envelope(_) | Note::Limited(_) | Note::OperatorIgnored(..) | Note::LetGo(_) => "warning",
                    // An answer to a cancelled query, as after a hold, is nothing to worry about.
                    _ => "info",
                };
                if let Note::QueryFailed { id, .. } = note {
                    self.asked.take_if(|(asked, _)| *asked == id.0);
                }
                // A reason may name programs and servers.
                let closed = matches!(note, Note::QueryFailed { .. });
                let line = json!({"type": "line", "t": now.as_secs_f64(), "level": level, "text": words::note(note)});
                self.hub.tell_some(Kept::Row, &line, closed);
                // What the operator did shows at once.
                if matches!(note, Note::Operator(_) | Note::LetGo(_) | Note::Phase(_)) {
                    self.next_state = now;
                }
            }
            Action::Finished(ending) => {
                (self.goal, self.settled) = (None, Some((now, self.odometer.metres())));
                self.line(now, "info", &format!("{}: {}", words::outcome(ending.outcome), ending.cause));
            }
            Action::Track(_) | Action::Untrack | Action::Command(_) => {}
        }
        if now >= self.next_state {
            self.next_state = now + STATE_EVERY;
            self.state(now, pilot);
        }
    }

    fn time(&mut self, now: Time, pilot: &Pilot) {
        self.pointing.phase(pilot.phase());
        self.odometer.tick(now, pilot);
        self.place(now, pilot);
        self.picture(now, pilot);
        if now >= self.next_state {
            self.next_state = now + STATE_EVERY;
            self.state(now, pilot);
        }
        if now >= self.next_path && pilot.phase() != Phase::Ground {
            self.next_path = now + PATH_EVERY;
            let at = pilot.known_pose(now).position;
            self.hub.flown([rounded(at.east), rounded(at.north)]);
        }
        if now >= self.next_map {
            self.next_map = now + MAP_EVERY;
            self.obstacles(now, pilot);
        }
    }
}
