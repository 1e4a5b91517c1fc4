//! The classical baseline: a pilot without a language model. Colour and class of the targets are given to it as data; it asks a
//! detector what is in view, takes the largest box that fits, and flies towards it (docs/explanation/baselines.md).

use libm::{hypot, sqrt};
use spf_core::camera::Camera;
use spf_core::coco;
use spf_core::craft::Craft;
use spf_core::detection::{Appearance, DetectionsError, Line, field, lines_of, name_of};
use spf_core::geometry::{EnuPosition, Pose, wrap_angle};
use spf_core::grounding::GroundingProfile;
use spf_core::lift::{self, Lifting};
use spf_core::primitives::Primitives;
use spf_core::prompt::{PromptInput, PromptKind, PromptText};
use spf_core::query::{ImagePoint, Memory, Query, QueryId, QueryKind};
use spf_core::reply::Look;
use spf_pilot::policy::search::{Search, SearchAction};
use spf_pilot::policy::{FailReason, Move, Output, Policy, PolicyEvent, Reading, Step, View};

/// Maximum number of lines of a list.
const MAX_LINES: usize = 200;
/// A box that ends within this fraction of the image size from an edge is considered cut off there.
const EDGE: f64 = 0.01;
/// Growth of a box from which a range is reckoned …
const GROWN: f64 = 1.25;
/// … if it was at least this large: lists have two decimals.
const MEASURABLE: f64 = 0.06;
/// From this size on a box may be that of something that is reached and whose range its growth no longer tells.
const LARGE: f64 = 0.5;
/// Fraction of the distance that counts as reached to which it flies.
const INSIDE: f64 = 0.7;
/// Longest step, and the step towards something at an unknown range, in seconds at cruise speed.
const LONGEST_S: f64 = 3.0;
const UNKNOWN_S: f64 = 1.3;
/// Shortest step, metres.
const SHORTEST_M: f64 = 0.3;
/// A box within this angle of an earlier target's place is that target, radians: 15°.
const SAME: f64 = 0.262;
/// Length of the move through an opening, in multiples of the distance that counts as reached.
const BEYOND: f64 = 4.0;
/// Turns of a look all around.
const TURNS: u32 = 4;
/// Distance kept from what is followed, in multiples of the distance that counts as reached.
const KEPT: f64 = 1.5;
/// The distance that counts as reached where none is given, metres.
const NEAR_M: f64 = 1.0;

/// What a stage asks of this pilot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Act {
    /// To fly to it.
    Reach,
    /// To fly to it, and straight on.
    Through,
    /// To turn all around.
    Turn,
    /// To stay with it, without an end.
    Follow,
}

/// One stage: what to do, and with what, by class and colour.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sought {
    /// What to do.
    pub act: Act,
    /// How what counts appears in a list of detections; empty for a turn.
    pub appearances: Vec<Appearance>,
    /// Whether it is something else than in earlier stages.
    pub other: bool,
}

/// Settings of the classical policy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClassicalSettings {
    /// The craft.
    pub craft: Craft,
    /// Size at which images are sent, if not the camera's.
    pub image_size: Option<(u32, u32)>,
    /// Distance from the target that counts as reached, metres.
    pub near_m: Option<f64>,
    /// Obstacle mode: without boxes of what is above, no climb in a search.
    pub avoid: bool,
}

/// A detection: its box, centre and size as fractions of the image.
#[derive(Clone, Debug, PartialEq)]
struct Sighting {
    name: String,
    colour: Option<String>,
    x: f64,
    y: f64,
    width: f64,
    height: f64,
}

/// A sighting of the target from a place, for reckoning its range by how its box grows.
#[derive(Clone, Copy, Debug)]
struct Seen {
    pose: Pose,
    /// Width and height of the box, each if no edge cuts it.
    size: [Option<f64>; 2],
}

/// The classical policy.
#[derive(Clone, Debug)]
pub struct Classical {
    settings: ClassicalSettings,
    stages: Vec<Sought>,
    instruction: String,
    stage: usize,
    /// Places of the targets of ended stages.
    ended: Vec<EnuPosition>,
    /// The last sighting of this stage's target, and its reckoned place.
    seen: Option<Seen>,
    place: Option<EnuPosition>,
    turned: u32,
    side: Look,
    search: Option<Search>,
    asked: Option<(QueryId, Box<View>)>,
    moving: bool,
    next_id: u64,
    reading: Reading,
}

impl Classical {
    /// A policy for these stages; it waits for the start of the flight, and does not read the instruction.
    #[must_use]
    pub fn new(settings: ClassicalSettings, stages: Vec<Sought>) -> Self {
        Self {
            settings,
            stages,
            instruction: String::new(),
            stage: 0,
            ended: Vec::new(),
            seen: None,
            place: None,
            turned: 0,
            side: Look::Right,
            search: None,
            asked: None,
            moving: false,
            next_id: 0,
            reading: Reading::default(),
        }
    }

    fn near(&self) -> f64 {
        self.settings.near_m.unwrap_or(NEAR_M)
    }

    fn ask(&mut self, view: &View) -> Step {
        let id = QueryId(self.next_id);
        self.next_id += 1;
        self.asked = Some((id, Box::new(*view)));
        let (memory, profile) = (Memory::default(), GroundingProfile::default());
        let input = PromptInput { near_m: self.settings.near_m, ..PromptInput::new(&self.instruction, &memory, &profile) };
        let prompt = PromptText::shipped(PromptKind::Detect).write_with(&input, |place| (place == "classes").then(String::new));
        Step::Ask(Box::new(Query {
            instruction: self.instruction.clone(),
            prompt,
            image_size: self.settings.image_size,
            ..Query::new(id, view.frame.id, QueryKind::Detect { coco: false, scored: false })
        }))
    }

    /// Acts on a list of what is in view.
    fn listed(&mut self, text: &str, view: &View) -> Step {
        let list = match read(text) {
            Ok(list) => list,
            Err(error) => {
                self.reading.refused = Some(error.to_string());
                return Step::Reject(error.to_string());
            }
        };
        let Some(stage) = self.stages.get(self.stage).cloned() else { return Step::Fail(FailReason::NotFound) };
        if stage.act == Act::Turn {
            return self.turn(view);
        }
        let Some(found) = self.best(&stage, &list, view).cloned() else {
            self.reading.actions = vec![format!("sees none of {} objects that fits", list.len())];
            return self.look_elsewhere(view);
        };
        self.approach(&stage, &found, view)
    }

    /// The largest box that fits, but for earlier targets where another is asked for.
    fn best<'l>(&self, stage: &Sought, list: &'l [Sighting], view: &View) -> Option<&'l Sighting> {
        let fits = |of: &&Sighting| stage.appearances.iter().any(|own| own.fits(&of.name, of.colour.as_deref()));
        let is_ended = |of: &&Sighting| {
            let towards = wrap_angle(view.pose.attitude.heading + bearing(&view.camera, of.x));
            stage.other && self.ended.iter().any(|place| wrap_angle(direction(view.pose.position, *place) - towards).abs() < SAME)
        };
        let area = |of: &&Sighting| of.width * of.height;
        list.iter().filter(fits).filter(|of| !is_ended(of)).max_by(|a, b| area(a).total_cmp(&area(b)))
    }

    fn approach(&mut self, stage: &Sought, found: &Sighting, view: &View) -> Step {
        if let Some(search) = &mut self.search {
            search.reset();
        }
        self.side = if found.x < 0.5 { Look::Left } else { Look::Right };
        let range = self.reckon(found, view);
        let near = self.near();
        let far = range.map_or_else(|| "at an unknown range".to_owned(), |range| format!("at {range:.1} m"));
        self.reading.actions = vec![format!("{} {far}", found.name)];
        let ends = if stage.act == Act::Follow { KEPT * near } else { near };
        if range.is_some_and(|range| range <= ends) {
            return match stage.act {
                Act::Follow => Step::Look,
                Act::Through => {
                    let on = Primitives { forward: BEYOND * near, ..Primitives::default() };
                    self.end_stage();
                    self.fly(view, on)
                }
                Act::Reach | Act::Turn => {
                    self.end_stage();
                    if self.stage == self.stages.len() { Step::Done } else { Step::Look }
                }
            };
        }
        let cruise = self.settings.craft.cruise_speed;
        let step = range.map_or(UNKNOWN_S * cruise, |range| range - INSIDE * ends);
        let step = step.clamp(SHORTEST_M, LONGEST_S * cruise);
        let point = ImagePoint { u: found.x, v: found.y };
        self.reading.waypoint = Some(point);
        self.reading.step = Some(step);
        let lifted = match lift::unproject(&view.camera, point, step) {
            Ok(camera) => lift::lift(camera, &view.camera, view.pose.attitude, Lifting::Levelled),
            Err(error) => {
                self.reading.refused = Some(error.to_string());
                return Step::Reject(error.to_string());
            }
        };
        self.reading.displacement = Some(lifted);
        self.fly(view, Primitives::from_displacement(lifted))
    }

    /// The range of the target, metres: by the usual height of its class; else by how its box grew on the way; else by what was
    /// reckoned before and how far the craft has come since.
    fn reckon(&mut self, found: &Sighting, view: &View) -> Option<f64> {
        let (camera, here) = (&view.camera, view.pose.position);
        let uncut = |centre: f64, size: f64| {
            (centre - 0.5 * size > EDGE && centre + 0.5 * size < 1.0 - EDGE && size > 0.0).then_some(size)
        };
        let seen = Seen { pose: view.pose, size: [uncut(found.x, found.width), uncut(found.y, found.height)] };
        let height = coco::class_of(&found.name).and_then(coco::height);
        let by_height = height.zip(seen.size[1]).map(|(metres, size)| metres * camera.fy / (size * f64::from(camera.height)));
        let by_growth = || {
            let before = self.seen?;
            let come = here.distance(before.pose.position);
            let both = before
                .size
                .into_iter()
                .zip(seen.size)
                .filter_map(|(before, now)| Some(now? / before.filter(|size| *size >= MEASURABLE)?));
            let growth = both.fold(0.0, f64::max);
            (growth >= GROWN).then(|| come / (growth - 1.0))
        };
        let measured = by_height.or_else(by_growth);
        if let Some(range) = measured {
            self.place = Some(placed(view, found, range));
        }
        let is_measurable = |seen: Seen| seen.size.into_iter().flatten().any(|size| size >= MEASURABLE);
        if measured.is_some() || !self.seen.is_some_and(is_measurable) {
            self.seen = Some(seen);
        }
        let range = measured.or_else(|| self.place.map(|place| here.distance(place)));
        // A small box at the place where it should be reached: what was reckoned is wrong.
        let is_wrong =
            measured.is_none() && found.width.max(found.height) < LARGE && range.is_some_and(|range| range <= self.near());
        if is_wrong {
            (self.place, self.seen) = (None, Some(seen));
            return None;
        }
        range
    }

    fn end_stage(&mut self) {
        self.ended.extend(self.place.take());
        (self.seen, self.search, self.turned) = (None, None, 0);
        self.stage += 1;
    }

    /// One of the turns of a look all around.
    fn turn(&mut self, view: &View) -> Step {
        if self.turned == TURNS {
            self.end_stage();
            return if self.stage == self.stages.len() { Step::Done } else { Step::Look };
        }
        self.turned += 1;
        let yaw = core::f64::consts::TAU / f64::from(TURNS);
        self.fly(view, Primitives { yaw, ..Primitives::default() })
    }

    /// The same search as in the other policies.
    fn look_elsewhere(&mut self, view: &View) -> Step {
        (self.seen, self.place) = (None, None);
        let (fov, craft) = (2.0 * view.camera.half_fov().0, self.settings.craft);
        let heading = view.pose.attitude.heading;
        let (avoid, side) = (self.settings.avoid, self.side);
        let search = self.search.get_or_insert_with(|| Search::new(fov, &craft));
        let mut action = search.next(side, heading, None);
        while let SearchAction::Look(primitives) = action
            && avoid
            && primitives.climb != 0.0
        {
            action = search.next(Look::Right, heading, None);
        }
        match action {
            SearchAction::Look(primitives) => self.fly(view, primitives),
            SearchAction::Fly { .. } | SearchAction::Exhausted => Step::Fail(FailReason::NotFound),
        }
    }

    fn fly(&mut self, view: &View, primitives: Primitives) -> Step {
        self.reading.primitives = Some(primitives);
        self.moving = true;
        Step::Move(Move { primitives, anchor: Some(view.pose), then_rest: true, looks: false })
    }

    /// The step that follows from an event.
    fn step(&mut self, event: PolicyEvent<'_>) -> Step {
        match event {
            PolicyEvent::Instruction(text) => {
                let (next_id, stages) = (self.next_id, core::mem::take(&mut self.stages));
                *self = Self { instruction: text.to_owned(), next_id, ..Self::new(self.settings, stages) };
                Step::Look
            }
            PolicyEvent::Frame(view) if self.asked.is_none() && !self.moving => {
                // The move through the last opening has been flown.
                if self.stage > 0 && self.stage == self.stages.len() { Step::Done } else { self.ask(view) }
            }
            PolicyEvent::Reply { id, text, .. } => match self.asked.take_if(|asked| asked.0 == id) {
                Some((_, view)) => {
                    self.reading = Reading::default();
                    self.listed(text, &view)
                }
                None => Step::Wait,
            },
            PolicyEvent::ReplyFailed { id } => {
                self.asked.take_if(|asked| asked.0 == id);
                Step::Wait
            }
            PolicyEvent::MoveEnded { .. } => {
                self.moving = false;
                Step::Wait
            }
            PolicyEvent::Frame(_) | PolicyEvent::Chunk { .. } | PolicyEvent::KeepOut(_) | PolicyEvent::Continue => Step::Wait,
        }
    }
}

impl Policy for Classical {
    fn name(&self) -> &'static str {
        "classical"
    }

    fn handle(&mut self, event: PolicyEvent<'_>) -> Output {
        let is_reply = matches!(event, PolicyEvent::Reply { .. });
        let step = self.step(event);
        Output { step, reading: if is_reply { self.reading.clone() } else { Reading::default() } }
    }
}

fn read(text: &str) -> Result<Vec<Sighting>, DetectionsError> {
    lines_of(text, MAX_LINES, |line| {
        let Line { label, x, y, width, height } = Line::read(&line)?;
        let colour = field(&line, "color:").filter(|colour| *colour != "unknown").map(|colour| colour.replace('_', " "));
        Some(Sighting { name: name_of(label).0.replace('_', " "), colour, x, y, width, height })
    })
}

/// Angle of an image column from the heading, radians clockwise.
fn bearing(camera: &Camera, u: f64) -> f64 {
    libm::atan2(u * f64::from(camera.width) - camera.cx, camera.fx)
}

/// Direction from one place to another, radians clockwise from north.
fn direction(from: EnuPosition, to: EnuPosition) -> f64 {
    libm::atan2(to.east - from.east, to.north - from.north)
}

/// The place of a sighting at this range.
fn placed(view: &View, found: &Sighting, range: f64) -> EnuPosition {
    let (camera, pose) = (&view.camera, view.pose);
    let right = (found.x * f64::from(camera.width) - camera.cx) / camera.fx;
    let up = (camera.cy - found.y * f64::from(camera.height)) / camera.fy;
    let forward = range / sqrt(1.0 + right * right + up * up);
    let (sin, cos) = libm::sincos(pose.attitude.heading + bearing(camera, found.x));
    let level = forward * hypot(1.0, right);
    EnuPosition {
        east: pose.position.east + level * sin,
        north: pose.position.north + level * cos,
        up: pose.position.up + forward * up,
    }
}
