//! The actors of a scene with their meshes and collision geometry, independent of their positions.

use glam::Vec3;
use spf_core::geometry::EnuPosition;

use super::course::Course;
use super::place::{ActorPlace, Frame};
use super::{Actor, Gait};
use crate::bounds::Aabb;
use crate::collide::{Collider, ColliderError};
use crate::geometry::{ObjectId, Part};

/// Below this speed a person stands still, m/s.
const STANDING: f64 = 0.05;
/// Length of a double step on foot as a multiple of the person's height (Murray, Drought & Kory 1964: 1.5 m at 1.75 m).
const STRIDE: f64 = 0.86;

/// The actors of a scene; shared by all flights in it.
#[derive(Debug, Default)]
pub struct Cast {
    members: Vec<Member>,
}

#[derive(Debug)]
struct Member {
    object: ObjectId,
    course: Course,
    postures: Vec<Posture>,
    outline: Vec<Vec<[f64; 2]>>,
    /// Metres of one double step.
    stride: f64,
    /// A sphere centred at this height above the actor's position encloses the whole body.
    middle: f32,
    ball: f32,
}

#[derive(Debug)]
struct Posture {
    parts: Vec<Part>,
    collider: Collider,
}

impl Cast {
    /// Prepares the actors of a scene, placed on its solid ground.
    ///
    /// # Errors
    /// [`ColliderError`] for invalid meshes.
    pub fn new(actors: &[Actor], ground: &Collider) -> Result<Self, ColliderError> {
        let members: Result<_, _> = actors.iter().map(|actor| Member::new(actor, ground)).collect();
        Ok(Self { members: members? })
    }

    /// Number of actors.
    #[must_use]
    pub fn len(&self) -> usize {
        self.members.len()
    }

    /// Whether there are no actors.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.members.is_empty()
    }

    /// The index of the actor with this object id; `None` for static objects.
    #[must_use]
    pub fn of_object(&self, object: ObjectId) -> Option<usize> {
        self.members.iter().position(|member| member.object == object)
    }

    /// The object id of an actor; 0 for an invalid index.
    #[must_use]
    pub fn object(&self, actor: usize) -> ObjectId {
        self.members.get(actor).map_or(0, |member| member.object)
    }

    /// The object ids of all actors, in order.
    pub fn objects(&self) -> impl ExactSizeIterator<Item = ObjectId> + '_ {
        self.members.iter().map(|member| member.object)
    }

    /// Initial positions of all actors.
    #[must_use]
    pub fn starts(&self) -> Vec<ActorPlace> {
        self.courses().map(Course::start).collect()
    }

    pub(super) fn courses(&self) -> impl ExactSizeIterator<Item = &Course> + '_ {
        self.members.iter().map(|member| &member.course)
    }

    pub(super) fn course(&self, actor: usize) -> &Course {
        &self.members[actor].course
    }

    /// The meshes, in the world frame, of all actors whose bounding sphere (centre, radius) `sees` accepts.
    #[must_use]
    pub fn parts(&self, places: &[ActorPlace], sees: impl Fn(Vec3, f32) -> bool) -> Vec<Part> {
        let mut parts = Vec::new();
        for (member, place) in self.members.iter().zip(places) {
            let frame = Frame::of(place);
            if !sees(frame.point(Vec3::new(0.0, 0.0, member.middle)), member.ball) {
                continue;
            }
            parts.extend(member.posture(place).parts.iter().map(|part| placed(part, &frame)));
        }
        parts
    }

    /// Bounding box of an actor at a place; `None` for an invalid index.
    #[must_use]
    pub fn bounds(&self, actor: usize, place: &ActorPlace) -> Option<Aabb> {
        let member = self.members.get(actor)?;
        place.bounds(&member.posture(place).parts)
    }

    /// Footprint polygons of an actor at a place, metres east and north; empty for an invalid index.
    #[must_use]
    pub fn outline(&self, actor: usize, place: &ActorPlace) -> Vec<Vec<[f64; 2]>> {
        self.members.get(actor).map_or_else(Vec::new, |member| place.outline(&member.outline))
    }

    /// Distance from a point to the nearest solid surface of an actor at a place, metres.
    #[must_use]
    pub fn distance(&self, actor: usize, place: &ActorPlace, point: EnuPosition) -> Option<f64> {
        let member = self.members.get(actor)?;
        member.posture(place).collider.nearest(Frame::of(place).local(point)).map(|near| near.distance)
    }

    /// Whether a sphere around a point can touch an actor that is within `spare` metres of a place; false for an
    /// invalid index.
    #[must_use]
    pub fn may_touch(&self, actor: usize, place: &ActorPlace, point: EnuPosition, spare: f64) -> bool {
        let Some(member) = self.members.get(actor) else { return false };
        let away = Frame::of(place).local(point);
        let reach = f64::from(member.ball) + spare;
        let up = away.up - f64::from(member.middle);
        away.east * away.east + away.north * away.north + up * up <= reach * reach
    }

    /// Where the centre of a sphere moving from `from` to `to` first touches an actor that meanwhile moves from one
    /// place to another. Both paths are straight, and the actor keeps the posture of the later place.
    #[must_use]
    pub fn sweep(
        &self,
        actor: usize,
        places: [&ActorPlace; 2],
        from: EnuPosition,
        to: EnuPosition,
        radius: f64,
    ) -> Option<EnuPosition> {
        let [before, after] = places.map(Frame::of);
        let contact = self.members.get(actor)?.posture(places[1]).collider.sweep(before.local(from), after.local(to), radius)?;
        Some(after.world(contact.centre))
    }
}

impl Member {
    fn new(actor: &Actor, ground: &Collider) -> Result<Self, ColliderError> {
        let posture = |parts: &Vec<Part>| Ok(Posture { parts: parts.clone(), collider: Collider::of_parts(parts)? });
        let postures: Vec<Posture> = actor.postures.iter().map(posture).collect::<Result<_, _>>()?;
        let positions = || actor.postures.iter().flatten().flat_map(|part| part.vertices.iter().map(|v| v.position));
        let top = positions().map(|p| p.z).fold(0.1_f32, f32::max);
        let middle = 0.5 * top;
        let ball = positions().map(|p| (p - Vec3::new(0.0, 0.0, middle)).length()).fold(0.1_f32, f32::max);
        Ok(Self {
            object: actor.object,
            course: Course::new(actor, Some(ground)),
            postures,
            outline: actor.outline.clone(),
            stride: STRIDE * f64::from(top),
            middle,
            ball,
        })
    }

    fn posture(&self, place: &ActorPlace) -> &Posture {
        let steps = self.postures.len() - 1;
        if steps == 0 || place.speed < STANDING || self.course.motion.gait == Gait::Drive {
            return &self.postures[0];
        }
        let turns = place.walked / self.stride;
        let phase = ((turns - libm::floor(turns)) * steps as f64) as usize;
        &self.postures[1 + phase.min(steps - 1)]
    }
}

fn placed(part: &Part, frame: &Frame) -> Part {
    Part { vertices: part.vertices.iter().map(|v| frame.vertex(v)).collect(), ..part.clone() }
}
