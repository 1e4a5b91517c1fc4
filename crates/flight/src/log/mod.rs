//! The flight log, `flight.mcap`: all inputs and outputs of the pilot, plus messages for common viewers
//! (docs/reference/flight-log.md).

mod rows;
mod topics;

pub use rows::{
    Cancelled, CommandName, CommandRow, FlightHeader, GapRow, LinkNews, LinkRow, NoteKind, NoteRow, OperatorRow,
    PoseDeviationRow, ReplyRow, SimHead, TrackStartRow, TruthRow, Wake,
};
pub use topics::Channel;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use bytes::Bytes;
use serde::Serialize;
use spf_core::command::Command;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::query::{Query, QueryId};
use spf_core::time::{Duration, Time};
use spf_pilot::{Action, Decision, Event, Note, Pilot};
use spf_record::live::LiveSender;
use spf_record::log::foxglove::{self, Level, Marks, Prism};
use spf_record::log::{Log, LogError, LogSender, Message, Topic};
use spf_space::obstacle_map::Cell;

use crate::frame_source::FrameSource;
use crate::summary::Summary;
use crate::words;

/// Interval of pose messages, flight time.
const POSE_EVERY: Duration = Duration::from_millis(50);
/// Interval of the messages about the obstacle map, flight time.
const MAP_EVERY: Duration = Duration::from_secs(1);
/// Number of queries whose times are remembered; a pilot has at most eight open.
const QUERIES_KEPT: usize = 64;

/// A flight log being written.
pub(crate) struct FlightLog {
    log: Option<Log>,
    out: Outlet,
    frame_source: Arc<dyn FrameSource>,
    /// The pilot was woken at this time, and nothing has been logged for it yet.
    woken: Option<Time>,
    posed: Option<Time>,
    mapped: Option<Time>,
    query_times: BTreeMap<QueryId, Time>,
    /// Dropped messages (the disk was too slow) that the log does not mention yet.
    missing: u64,
}

/// Sends the messages of a flight; can be shared by several threads.
#[derive(Clone)]
pub(crate) struct Outlet {
    log: Option<LogSender>,
    live: Option<LiveSender>,
}

impl Outlet {
    /// Writes a message in one of our own formats. Returns false if the log dropped it.
    fn row<T: Serialize>(&self, channel: Channel, at: Time, row: &T) -> bool {
        // Rows are structs of plain values and always have a JSON form.
        serde_json::to_vec(row).is_ok_and(|data| self.put(channel, at, data.into()))
    }

    fn put(&self, channel: Channel, at: Time, data: Bytes) -> bool {
        let message = Message { topic: channel as usize, time: at, data };
        if let Some(live) = &self.live {
            live.send(&message);
        }
        self.log.as_ref().is_none_or(|log| log.send(message))
    }

    /// Writes a camera image and its annotations.
    pub(crate) fn image(&self, at: Time, jpeg: Bytes, size: (u32, u32), marks: &Marks) {
        self.put(Channel::Image, at, foxglove::encode(&foxglove::image(at, jpeg)));
        self.put(Channel::Annotations, at, foxglove::encode(&foxglove::annotations(at, size, marks)));
    }
}

impl FlightLog {
    /// Starts with the flight's head and the scene's outline. Messages go to the log and to live views, if any.
    pub(crate) fn start(
        log: Option<Log>,
        live: Option<LiveSender>,
        head: &FlightHeader,
        scene: &[Prism],
        frame_source: Arc<dyn FrameSource>,
    ) -> Self {
        let out = Outlet { log: log.as_ref().map(Log::sender), live };
        out.row(Channel::Flight, Time::ZERO, head);
        out.put(Channel::Scene, Time::ZERO, foxglove::encode(&foxglove::scene(Time::ZERO, scene)));
        Self { log, out, frame_source, woken: None, posed: None, mapped: None, query_times: BTreeMap::new(), missing: 0 }
    }

    /// An outlet for images, which come from another thread; also writes the calibration of the camera at their size.
    pub(crate) fn images(&self, size: (u32, u32)) -> Outlet {
        let camera = self.frame_source.camera().resized(size.0, size.1);
        self.out.put(Channel::Calibration, Time::ZERO, foxglove::encode(&foxglove::calibration(Time::ZERO, &camera)));
        self.out.clone()
    }

    /// Writes a message in one of our own formats.
    fn row<T: Serialize>(&mut self, channel: Channel, at: Time, row: &T) {
        self.log_gap(at);
        self.missing += u64::from(!self.out.row(channel, at, row));
    }

    /// Writes a Foxglove message.
    fn put<M: foxglove::Encode>(&mut self, channel: Channel, at: Time, message: &M) {
        self.log_gap(at);
        self.missing += u64::from(!self.out.put(channel, at, foxglove::encode(message)));
    }

    /// Logs the position of dropped messages, since a replay cannot continue past it.
    fn log_gap(&mut self, at: Time) {
        if self.missing > 0 && self.out.row(Channel::Gap, at, &GapRow { messages: self.missing }) {
            self.missing = 0;
        }
    }

    /// Records that the pilot was woken.
    pub(crate) fn time(&mut self, now: Time, pilot: &Pilot) {
        self.wake();
        self.woken = Some(now);
        if self.posed.is_none_or(|at| now.since(at) >= POSE_EVERY) {
            self.posed = Some(now);
            self.poses(now, &pilot.known_pose(now));
            self.row(Channel::PoseDeviation, now, &PoseDeviationRow { horizontal_m: pilot.position_error() });
        }
        if self.mapped.is_none_or(|at| now.since(at) >= MAP_EVERY) {
            self.mapped = Some(now);
            self.map(now, pilot);
        }
    }

    /// What the pilot knows of obstacles and target, and where it is led.
    fn map(&mut self, now: Time, pilot: &Pilot) {
        if let Some(map) = pilot.obstacle_map() {
            self.put(Channel::Map, now, &foxglove::cells(now, map.occupied().map(Cell::middle)));
        }
        if pilot.obstacle_map().is_some() || pilot.anchor().is_some() {
            let path: Vec<EnuPosition> = pilot.guide().iter().flat_map(|guide| &guide.path).map(|cell| cell.middle()).collect();
            let target = pilot.anchor_view(now).map(|seen| (seen.position, seen.range_sd.max(seen.lateral_sd)));
            self.put(Channel::Path, now, &foxglove::path(now, &path, target));
        }
    }

    fn poses(&mut self, now: Time, known: &Pose) {
        let tilt = self.frame_source.camera().tilt;
        self.put(Channel::Transforms, now, &foxglove::transforms(now, known, tilt));
        self.put(Channel::PoseKnown, now, &foxglove::pose(now, known));
        if let Some(truth) = self.frame_source.true_pose() {
            self.put(Channel::PoseTrue, now, &foxglove::pose(now, &truth));
        }
    }

    /// Writes a wake-up at which nothing happened.
    fn wake(&mut self) {
        if let Some(at) = self.woken.take() {
            self.row(Channel::Wake, at, &Wake { at });
        }
    }

    /// Logs an input of the pilot.
    pub(crate) fn event(&mut self, now: Time, event: &Event) {
        self.woken = None;
        match event {
            Event::Frame(frame) => self.row(Channel::Frame, now, frame),
            Event::Telemetry(telemetry) => self.row(Channel::Telemetry, now, telemetry),
            Event::Depth(grid) => self.row(Channel::Depth, now, grid),
            Event::Gimbal(report) => self.row(Channel::Gimbal, now, report),
            Event::Ranges(scan) => self.row(Channel::Ranges, now, scan),
            Event::Track(report) => self.row(Channel::Track, now, report),
            Event::Reply { id, text } => self.reply(now, *id, Some(text), None, false),
            Event::Chunk { id, text } => self.reply(now, *id, Some(text), None, true),
            Event::ReplyFailed { id, reason } => self.reply(now, *id, None, Some(reason), false),
            Event::Spent { reason } => {
                // The query that was not sent is the newest one open.
                let id = self.query_times.pop_last().map(|(id, _)| id).unwrap_or_default();
                let (failed, text, latency_s) = (Some(reason.clone()), None, None);
                self.row(Channel::Reply, now, &ReplyRow { id, text, failed, spent: true, part: false, latency_s });
            }
            Event::Operator(event) => self.row(Channel::Operator, now, &OperatorRow { event: event.clone() }),
            Event::LinkLost => self.row(Channel::Link, now, &LinkRow { link: LinkNews::Lost }),
            Event::LinkRestored => self.row(Channel::Link, now, &LinkRow { link: LinkNews::Restored }),
            Event::LetGo(news) => self.row(Channel::Link, now, &LinkRow { link: LinkNews::LetGo(*news) }),
        }
    }

    fn reply(&mut self, now: Time, id: QueryId, text: Option<&String>, failed: Option<&String>, part: bool) {
        let query_times = if part { self.query_times.get(&id).copied() } else { self.query_times.remove(&id) };
        let latency_s = query_times.map(|query_times| now.since(query_times).as_secs_f64());
        self.row(
            Channel::Reply,
            now,
            &ReplyRow { id, text: text.cloned(), failed: failed.cloned(), spent: false, part, latency_s },
        );
    }

    /// Logs an action of the pilot.
    pub(crate) fn action(&mut self, now: Time, action: &Action, pilot: &Pilot) {
        self.wake();
        if let Some((channel, data)) = output(action, pilot) {
            self.log_gap(now);
            self.missing += u64::from(!self.out.put(channel, now, data));
        }
        match action {
            Action::Ask(query) => self.ask(now, query),
            Action::Note(note) => self.note(now, note),
            Action::Finished(ending) => {
                let line = format!("{}: {}", words::outcome(ending.outcome), ending.cause);
                self.line(now, Level::Info, line);
            }
            Action::Cancel(_) | Action::Track(_) | Action::Untrack | Action::Command(_) => {}
        }
    }

    fn ask(&mut self, now: Time, query: &Query) {
        if self.query_times.len() >= QUERIES_KEPT {
            self.query_times.pop_first();
        }
        self.query_times.insert(query.id, now);
        // Ground truth of the frame, from which its ids and depth can be rendered again.
        if let Some(pose) = self.frame_source.true_pose_of(query.frame) {
            self.row(Channel::Truth, now, &TruthRow { frame: query.frame, pose });
        }
    }

    fn note(&mut self, now: Time, note: &Note) {
        let level = match note {
            Note::Envelope(_) | Note::Limited(_) | Note::LateReply(_) | Note::OperatorIgnored(..) | Note::LetGo(_) => {
                Level::Warning
            }
            Note::Phase(_) | Note::Decision(_) | Note::Around(_) | Note::Operator(_) => Level::Info,
            Note::QueryFailed { .. } => Level::Error,
        };
        if let Note::Decision(decision) = note {
            self.plan(now, decision);
        }
        self.line(now, level, words::note(note));
    }

    fn plan(&mut self, now: Time, decision: &Decision) {
        let end: Option<EnuPosition> = decision.goal.filter(|_| !decision.passed).map(|goal| goal.position);
        if let Some(end) = end {
            let plan = foxglove::plan(now, decision.pose_at_reply.position, end);
            self.put(Channel::Plan, now, &plan);
        }
    }

    fn line(&mut self, now: Time, level: Level, line: String) {
        self.put(Channel::Log, now, &foxglove::log_line(now, level, line));
    }

    /// Whether the file can no longer be written.
    pub(crate) fn has_failed(&self) -> bool {
        self.log.as_ref().is_some_and(Log::has_failed)
    }

    /// Ends the log with the flight's summary. Returns the number of dropped messages.
    pub(crate) fn finish(mut self, summary: &Summary) -> Result<u64, LogError> {
        self.wake();
        let at = Time::from_secs_f64(summary.finished_at_s).max(self.posed.unwrap_or_default());
        self.row(Channel::Summary, at, summary);
        let Self { log, out, .. } = self;
        drop(out);
        log.map_or(Ok(0), |log| log.finish().map(|facts| facts.lost))
    }
}

/// Opens the log file. A `live` flight never waits for the disk.
pub(crate) fn open(path: &Path, live: bool) -> Result<Log, LogError> {
    Log::create(path, &topics(), !live)
}

/// The topics of a flight's log and live view, in the order of [`Channel::ALL`].
#[must_use]
pub fn topics() -> Vec<Topic> {
    Channel::ALL.into_iter().map(Channel::form).collect()
}

/// The channel and bytes of an action, if a replay compares it.
pub(crate) fn output(action: &Action, pilot: &Pilot) -> Option<(Channel, Bytes)> {
    let (channel, data) = match action {
        Action::Ask(query) => (Channel::Query, serde_json::to_vec(query)),
        Action::Cancel(id) => (Channel::Cancel, serde_json::to_vec(&Cancelled { id: *id })),
        Action::Track(start) => (Channel::TrackStart, serde_json::to_vec(&TrackStartRow { start: Some(*start) })),
        Action::Untrack => (Channel::TrackStart, serde_json::to_vec(&TrackStartRow { start: None })),
        Action::Command(cleared) => {
            let row =
                |command| CommandRow { command, wanted: None, cleared: None, manoeuvre: None, valid_until: None, tilt: None };
            let valid_until = Some(cleared.valid_until());
            let row = match *cleared.get() {
                Command::TakeOff => row(CommandName::TakeOff),
                Command::Setpoint(setpoint) => CommandRow {
                    wanted: Some(pilot.wanted()),
                    cleared: Some(setpoint),
                    valid_until,
                    ..row(CommandName::Setpoint)
                },
                Command::Manoeuvre(manoeuvre) => {
                    CommandRow { manoeuvre: Some(manoeuvre), valid_until, ..row(CommandName::Manoeuvre) }
                }
                Command::Land => row(CommandName::Land),
                Command::Return => row(CommandName::Return),
                Command::Tilt(tilt) => CommandRow { tilt: Some(tilt), ..row(CommandName::Tilt) },
                Command::EmergencyStop => row(CommandName::EmergencyStop),
            };
            (Channel::Command, serde_json::to_vec(&row))
        }
        Action::Note(Note::Decision(decision)) => (Channel::Decision, serde_json::to_vec(decision)),
        Action::Note(note) => (Channel::Note, serde_json::to_vec(&NoteRow::of(note)?)),
        Action::Finished(ending) => (Channel::Finished, serde_json::to_vec(ending)),
    };
    data.ok().map(|data| (channel, data.into()))
}
