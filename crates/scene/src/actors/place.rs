//! Pose of an actor, and the transform from its own frame to the world.

use glam::Vec3;
use serde::Serialize;
use spf_core::geometry::{EnuPosition, wrap_angle};

use crate::bounds::Aabb;
use crate::geometry::{Part, Vertex};

/// The pose of an actor at an instant.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ActorPlace {
    /// Position of its base.
    pub position: EnuPosition,
    /// Clockwise from north, radians, −π..=π.
    pub heading: f64,
    /// Positive nose up, radians; for vehicles on ramps.
    pub pitch: f64,
    /// Distance covered since the start of the flight, metres, which determines the gait.
    pub walked: f64,
    /// Speed over ground, m/s.
    pub speed: f64,
}

impl ActorPlace {
    /// The pose at `fraction` of the interval to a later one.
    pub(crate) fn towards(&self, later: &Self, fraction: f64) -> Self {
        let part = |a: f64, b: f64| a + (b - a) * fraction;
        Self {
            position: self.position.towards(later.position, fraction),
            heading: wrap_angle(self.heading + wrap_angle(later.heading - self.heading) * fraction),
            pitch: part(self.pitch, later.pitch),
            walked: part(self.walked, later.walked),
            speed: part(self.speed, later.speed),
        }
    }
}

impl ActorPlace {
    /// Extent of a mesh in the actor's frame when the actor is here; `None` for an empty mesh.
    pub(crate) fn bounds(&self, parts: &[Part]) -> Option<Aabb> {
        let frame = Frame::of(self);
        Aabb::around(parts.iter().flat_map(|part| part.vertices.iter().map(|v| frame.point(v.position))))
    }

    /// Footprint polygons in the actor's frame, transformed to the map.
    pub(crate) fn outline(&self, polygons: &[Vec<[f64; 2]>]) -> Vec<Vec<[f64; 2]>> {
        let (sin, cos) = (libm::sin(self.heading), libm::cos(self.heading));
        let EnuPosition { east, north, .. } = self.position;
        let on_map = |p: &[f64; 2]| [east + p[0] * cos + p[1] * sin, north + p[1] * cos - p[0] * sin];
        polygons.iter().map(|polygon| polygon.iter().map(on_map).collect()).collect()
    }
}

/// Transform from an actor's own frame to the world: pitched, turned clockwise by the heading, moved.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    right: Vec3,
    forward: Vec3,
    above: Vec3,
    origin: Vec3,
}

impl Frame {
    pub(crate) fn of(place: &ActorPlace) -> Self {
        let (sh, ch) = (libm::sin(place.heading) as f32, libm::cos(place.heading) as f32);
        let (sp, cp) = (libm::sin(place.pitch) as f32, libm::cos(place.pitch) as f32);
        Self {
            right: Vec3::new(ch, -sh, 0.0),
            forward: Vec3::new(sh * cp, ch * cp, sp),
            above: Vec3::new(-sh * sp, -ch * sp, cp),
            origin: narrow(place.position),
        }
    }

    fn turned(&self, v: Vec3) -> Vec3 {
        self.right * v.x + self.forward * v.y + self.above * v.z
    }

    /// From the actor's frame into the world.
    pub(crate) fn point(&self, local: Vec3) -> Vec3 {
        self.turned(local) + self.origin
    }

    pub(crate) fn vertex(&self, v: &Vertex) -> Vertex {
        Vertex { position: self.point(v.position), normal: self.turned(v.normal), uv: v.uv }
    }

    /// From the world into the actor's frame.
    pub(crate) fn local(&self, world: EnuPosition) -> EnuPosition {
        let v = narrow(world) - self.origin;
        widen(Vec3::new(v.dot(self.right), v.dot(self.forward), v.dot(self.above)))
    }

    /// From the actor's frame into the world.
    pub(crate) fn world(&self, local: EnuPosition) -> EnuPosition {
        widen(self.point(narrow(local)))
    }
}

fn narrow(p: EnuPosition) -> Vec3 {
    Vec3::new(p.east as f32, p.north as f32, p.up as f32)
}

fn widen(v: Vec3) -> EnuPosition {
    EnuPosition { east: f64::from(v.x), north: f64::from(v.y), up: f64::from(v.z) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_frame_turns_clockwise_and_its_nose_goes_up() {
        let position = EnuPosition { east: 10.0, north: 20.0, up: 1.0 };
        let quarter = core::f64::consts::FRAC_PI_2;
        let place = ActorPlace { position, heading: quarter, pitch: 0.1, walked: 0.0, speed: 0.0 };
        let frame = Frame::of(&place);
        // Facing east: forward is east and up a little, right is south.
        let nose = frame.point(Vec3::new(0.0, 2.0, 0.0));
        assert!((nose - Vec3::new(10.0 + 2.0 * 0.995_004, 20.0, 1.0 + 2.0 * 0.099_833)).length() < 1e-5, "{nose}");
        assert!((frame.point(Vec3::X) - Vec3::new(10.0, 19.0, 1.0)).length() < 1e-5);
        let back = frame.local(frame.world(EnuPosition { east: 0.3, north: -1.2, up: 0.8 }));
        assert!((back.east - 0.3).abs() < 1e-5 && (back.north + 1.2).abs() < 1e-5 && (back.up - 0.8).abs() < 1e-5);
    }

    #[test]
    fn headings_meet_the_short_way() {
        let at = |heading: f64| ActorPlace { position: EnuPosition::default(), heading, pitch: 0.0, walked: 0.0, speed: 0.0 };
        let middle = at(3.0).towards(&at(-3.0), 0.5).heading;
        assert!((middle.abs() - core::f64::consts::PI).abs() < 1e-9, "{middle}");
    }
}
