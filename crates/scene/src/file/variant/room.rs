//! Free space for objects at other positions.

use core::cell::Cell;

use glam::DVec2;

use super::super::expand::Placed;
use super::super::raw::RawScene;
use super::shape::{Place, Print, Shape, distance};
use crate::actors::{Actor, Course, Gait};
use crate::limits::MAX_TRIANGLES;
use crate::mesh::{Generator, Sketch};
use crate::pose::parse_pose;

/// An object whose base is within this distance of another's top stands on it, metres.
const ON_TOP: f64 = 0.06;
/// Free height above the paths of people and vehicles, metres: crowns and jibs may extend above it.
const HEAD: f64 = 2.2;
const ROOF: f64 = 4.0;
/// Vehicles cut corners by less than this, metres.
const CUT: f64 = 0.3;
/// Space kept free around the start and ahead of it, as multiples of the scene's success radius.
const START_ROOM: f64 = 0.6;
const START_VIEW: f64 = 1.6;
/// Height of the free space over the start, metres.
const START_HEIGHT: f64 = 8.0;
/// Work spent on one variant, in units of about ten nanoseconds: the amount is bounded whatever the file contains, and
/// the same on every machine.
const EFFORT: u64 = 60_000_000;
/// Work of one edge against a mesh, with its shifts, and of one triangle generated and measured.
const EDGE_EFFORT: u64 = 500;
const TRIANGLE_EFFORT: u64 = 40;
/// Work of comparing the starts of two actors.
const ACTOR_EFFORT: u64 = 100;

/// A displaced object.
#[derive(Clone, Copy, Debug)]
pub(super) struct Move {
    pub(super) object: usize,
    pub(super) place: Place,
    /// The object that stands there now (itself if it only moves a little): whatever it touches may still be touched,
    /// such as a desk by its chair. `None` for a new object, which must not touch anything.
    pub(super) tenant: Option<usize>,
}

/// The path of an actor: points, and the clearance needed around them.
#[derive(Clone, Debug)]
struct ActorPath {
    points: Vec<DVec2>,
    reach: f64,
    height: f64,
}

/// The occupied space of a scene. Objects are numbered as in the list of objects.
#[derive(Debug)]
pub(super) struct Room {
    shapes: Vec<Shape>,
    places: Vec<Place>,
    prints: Vec<Print>,
    /// For an opening: the object it leads through.
    owners: Vec<Option<usize>>,
    /// Actors with their objects.
    courses: Vec<(usize, Course)>,
    ways: Vec<ActorPath>,
    start: Vec<Print>,
    /// East and north, from and to.
    bounds: [[f64; 2]; 2],
    triangles: usize,
    effort: Cell<u64>,
}

impl Room {
    /// The occupied space of a scene as its file lays it out.
    pub(super) fn new(raw: &RawScene, placed: &[Placed], meshes: &[Box<dyn Generator>]) -> Self {
        let bounds = raw.bounds.get_ref();
        let mut room = Self {
            shapes: Vec::new(),
            places: Vec::new(),
            prints: Vec::new(),
            owners: Vec::new(),
            courses: Vec::new(),
            ways: Vec::new(),
            start: start_room(raw),
            bounds: [bounds.east, bounds.north],
            triangles: 0,
            effort: Cell::new(EFFORT),
        };
        for object in placed {
            if room.is_full() {
                break;
            }
            let owner = object.opening_of.as_ref().and_then(|(of, _)| placed.iter().position(|other| other.key == *of));
            room.push(object, owner, meshes[object.mesh].as_ref());
        }
        room
    }

    /// Whether there are more triangles than a scene may have: it will be rejected in any layout.
    pub(super) fn is_full(&self) -> bool {
        self.triangles > MAX_TRIANGLES
    }

    /// Registers one more object, at the end of the list.
    pub(super) fn push(&mut self, object: &Placed, owner: Option<usize>, mesh: &dyn Generator) {
        let mut sketch = Sketch::default();
        mesh.draw(&mut sketch, &object.key);
        self.triangles += sketch.triangle_count();
        self.spend(TRIANGLE_EFFORT * sketch.triangle_count() as u64);
        let shape = Shape::of(&sketch, object, mesh.is_opening());
        let place = Place::of(object);
        self.prints.push(shape.print(&place));
        self.places.push(place);
        self.owners.push(owner);
        if let Some(motion) = &object.motion {
            let actor = Actor { object: 0, motion: motion.clone(), postures: vec![shape.parts().to_vec()], outline: Vec::new() };
            let course = Course::new(&actor, None);
            let (points, radius) = course.way();
            let (height, more) = if motion.gait == Gait::Walk { (HEAD, motion.aside) } else { (ROOF, CUT) };
            self.ways.push(ActorPath { points, reach: radius + more, height });
            self.courses.push((self.shapes.len(), course));
        }
        self.shapes.push(shape);
    }

    /// Removes the last object from the list.
    pub(super) fn pop(&mut self) {
        let Some(shape) = self.shapes.pop() else { return };
        self.triangles -= shape.triangles();
        self.places.pop();
        self.prints.pop();
        self.owners.pop();
        if self.courses.last().is_some_and(|(object, _)| *object == self.shapes.len()) {
            self.courses.pop();
            self.ways.pop();
        }
    }

    /// The current pose of an object.
    pub(super) fn place(&self, object: usize) -> Place {
        self.places[object]
    }

    /// Whether there is work left to compare the starts of actors.
    pub(super) fn may_look_at_actors(&self) -> bool {
        self.spend(ACTOR_EFFORT * self.courses.len() as u64)
    }

    /// Actors with their objects.
    pub(super) fn courses(&mut self) -> &mut [(usize, Course)] {
        &mut self.courses
    }

    /// Moves objects together with their openings, if they all fit. `rigid`: they move as one, so that nothing changes
    /// among them.
    pub(super) fn try_move(&mut self, moves: &[Move], rigid: bool, placed: &mut [Placed]) -> bool {
        let moves = self.with_openings(moves);
        let prints: Vec<Print> = moves.iter().map(|m| self.shapes[m.object].print(&m.place)).collect();
        if !(0..moves.len()).all(|k| self.has_room(k, &moves, &prints, rigid)) {
            return false;
        }
        for (m, print) in moves.iter().zip(prints) {
            self.places[m.object] = m.place;
            self.prints[m.object] = print;
            placed[m.object].position = m.place.position;
            placed[m.object].heading_deg = libm::remainder(m.place.heading_deg, 360.0);
        }
        true
    }

    /// The moves, with those of the openings that go along.
    fn with_openings(&self, moves: &[Move]) -> Vec<Move> {
        let mut all = moves.to_vec();
        for m in moves {
            let openings =
                (0..self.owners.len()).filter(|&opening| self.owners[opening] == Some(m.object) && opening != m.object);
            all.extend(openings.map(|opening| {
                let place = self.places[opening].carried(&self.places[m.object], &m.place);
                Move { object: opening, place, tenant: Some(opening) }
            }));
        }
        all
    }

    /// Whether all of some moves fit.
    fn has_room(&self, k: usize, moves: &[Move], prints: &[Print], rigid: bool) -> bool {
        let (m, print) = (&moves[k], &prints[k]);
        let points: usize = self.ways.iter().map(|way| way.points.len()).sum();
        if !self.spend((self.shapes.len() + points) as u64) {
            return false;
        }
        if self.shapes[m.object].is_passage() {
            return self.is_free_passage(m.object, print, moves, prints);
        }
        let old = m.tenant.map(|tenant| &self.prints[tenant]);
        let own = &self.prints[m.object];
        let loads =
            |other: usize| m.tenant.is_some() && self.shapes[other].is_solid() && own.carries(&self.prints[other], ON_TOP);
        let clashes = |other: usize| {
            let there = (other, &self.prints[other], &self.places[other]);
            self.clash((m.object, print, &m.place), there, old.map(|old| (old, &self.prints[other])))
        };
        let clashes_on_the_way = |(n, at): (&Move, &Print)| {
            let host = n.tenant.map(|tenant| &self.prints[tenant]);
            self.clash((m.object, print, &m.place), (n.object, at, &n.place), old.zip(host))
        };
        let mut others = (0..self.shapes.len()).filter(|other| moves.iter().all(|m| m.object != *other));
        self.is_within(print)
            && !self.start.iter().any(|area| area.meets(print))
            && self.ways.iter().all(|way| way.is_clear_of(print, old))
            && !others.any(|other| loads(other) || clashes(other))
            && (rigid || !moves[..k].iter().zip(prints).any(clashes_on_the_way))
            && (m.tenant.is_none() || !self.has_footing(own) || self.has_footing(print))
    }

    /// Whether an opening and the space before it are free of everything solid but the object it leads through.
    fn is_free_passage(&self, opening: usize, print: &Print, moves: &[Move], prints: &[Print]) -> bool {
        let mut others = (0..self.shapes.len()).filter(|other| moves.iter().all(|m| m.object != *other));
        let blocks =
            |other: usize, at: &Print| self.owners[opening] != Some(other) && self.shapes[other].is_solid() && print.meets(at);
        !others.any(|other| blocks(other, &self.prints[other])) && !moves.iter().zip(prints).any(|(m, at)| blocks(m.object, at))
    }

    /// Whether two objects would overlap, or one of them would stand in an opening. `before`: the footprints that stood
    /// there, or those of the two themselves; objects that touched may touch again, as long as no edge of one pierces
    /// the other's surface.
    fn clash(&self, a: (usize, &Print, &Place), b: (usize, &Print, &Place), before: Option<(&Print, &Print)>) -> bool {
        let (one, other) = (&self.shapes[a.0], &self.shapes[b.0]);
        if !a.1.meets(b.1) || self.owners[b.0] == Some(a.0) || self.owners[a.0] == Some(b.0) {
            return false;
        }
        if one.is_passage() || other.is_passage() {
            return one.is_solid() || other.is_solid();
        }
        if !one.is_solid() || !other.is_solid() {
            return false;
        }
        let touched = before.is_some_and(|(x, y)| x.meets(y));
        let edges = 3 * (one.triangles() + other.triangles()) as u64;
        !touched || !self.spend(EDGE_EFFORT * edges) || one.pierces(a.2, other, b.2)
    }

    /// Whether a footprint stays within the flyable region.
    fn is_within(&self, print: &Print) -> bool {
        let (low, high) = print.extent();
        let within = |from: f64, to: f64, [least, most]: [f64; 2]| from >= least && to <= most;
        within(low.x, high.x, self.bounds[0]) && within(low.y, high.y, self.bounds[1])
    }

    /// Whether a footprint stands on something, including ground.
    fn has_footing(&self, print: &Print) -> bool {
        self.prints.iter().any(|other| other.carries(print, ON_TOP))
    }

    /// Spends some of the remaining work; false if there is none left.
    pub(super) fn spend(&self, effort: u64) -> bool {
        let left = self.effort.get().checked_sub(effort);
        self.effort.set(left.unwrap_or(0));
        left.is_some()
    }

    /// Whether no work is left.
    pub(super) fn is_spent(&self) -> bool {
        self.effort.get() == 0
    }

    /// Whether an object just added at the end fits where it is.
    pub(super) fn has_room_for_last(&self) -> bool {
        let Some(object) = self.shapes.len().checked_sub(1) else { return false };
        let new = [Move { object, place: self.places[object], tenant: None }];
        self.has_room(0, &new, &self.prints[object..], false)
    }
}

impl ActorPath {
    /// Whether the object there leaves the path free, or at least as free as `old` did.
    fn is_clear_of(&self, print: &Print, old: Option<&Print>) -> bool {
        let clearance = self.clearance(print);
        clearance >= self.reach || old.is_some_and(|old| clearance >= self.clearance(old))
    }

    /// Metres from the path to a footprint; infinite beyond its reach.
    fn clearance(&self, print: &Print) -> f64 {
        let (low, high) = print.extent();
        let near = |p: &DVec2| {
            p.x + self.reach > low.x && p.x - self.reach < high.x && p.y + self.reach > low.y && p.y - self.reach < high.y
        };
        let to_foot = |p: DVec2| {
            let hulls = print.below(self.height);
            hulls.map(|hull| distance(p, hull)).fold(f64::INFINITY, f64::min)
        };
        self.points.iter().copied().filter(near).map(to_foot).fold(f64::INFINITY, f64::min)
    }
}

/// Around the start and ahead of it.
fn start_room(raw: &RawScene) -> Vec<Print> {
    // An invalid pose is rejected when the scene is built.
    let Some(pose) = parse_pose(raw.start.get_ref()) else { return Vec::new() };
    let at = pose.position;
    let start = Place { position: [at.east, at.north, at.up], heading_deg: pose.attitude.heading.to_degrees() };
    let (room, view) = (START_ROOM * raw.success_radius_m.get_ref(), START_VIEW * raw.success_radius_m.get_ref());
    let area = |corners: &[[f64; 2]]| {
        let hull = corners.iter().map(|&c| start.on_map() + start.turned(DVec2::from_array(c))).collect();
        Print::of_area(hull, [f64::NEG_INFINITY, at.up + START_HEIGHT])
    };
    vec![
        area(&[[-room, -room], [room, -room], [room, room], [-room, room]]),
        area(&[[-room, 0.0], [room, 0.0], [0.5 * view, view], [-0.5 * view, view]]),
    ]
}
