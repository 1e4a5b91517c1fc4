//! Camera poses for dataset images: at flying heights in free space, with an object in view.

use spf_core::camera::Camera;
use spf_core::geometry::{Attitude, EnuPosition, Pose, wrap_angle};
use spf_core::rng::RandomStream;

use spf_scene::Object;
use spf_scene::actors::ActorPlace;

use crate::sim::LoadedScene;

/// Maximum viewing distance, metres.
const FARTHEST: f64 = 120.0;
/// Minimum and maximum height above the start, metres.
const HEIGHTS: (f64, f64) = (0.4, 25.0);
/// Radius that must be free around the camera, metres.
const ROOM: f64 = 0.4;
/// Standard deviation of pitch and roll of a craft hovering in light wind, radians.
const TILT: f64 = 0.026;
/// Maximum offset of the object from the image centre, as a fraction of half the field of view.
const ASIDE: f64 = 0.8;

/// Samples poses in one scene, with the actors at the given places.
pub(super) struct Views<'a> {
    pub(super) loaded: &'a LoadedScene,
    pub(super) actors: &'a [ActorPlace],
    pub(super) camera: &'a Camera,
}

impl Views<'_> {
    /// A pose looking towards `object` from any side, at a log-uniform distance; `None` if that position is not free.
    pub(super) fn of(&self, object: &Object, rng: &mut RandomStream) -> Option<Pose> {
        let scene = &self.loaded.scene;
        let bounds = self.loaded.bounds(object, self.actors);
        let (min, max) = (bounds.min, bounds.max);
        // Aim at any part of it: the centre of a large object is always far away.
        let mut part = |low: f64, high: f64| low + rng.uniform() * (high - low);
        let (east, north) = (part(min.east, max.east), part(min.north, max.north));
        // Close enough for the last decisions of a flight, or as far as the scene reaches.
        let away = log_uniform(rng, 0.7 * scene.near, FARTHEST);
        let bearing = core::f64::consts::TAU * rng.uniform();
        let position = EnuPosition {
            east: east - away * libm::sin(bearing),
            north: north - away * libm::cos(bearing),
            up: scene.start.position.up + log_uniform(rng, HEIGHTS.0, HEIGHTS.1),
        };
        if !self.is_free(position) {
            return None;
        }
        let (sideways, _) = self.camera.half_fov();
        let aside = ASIDE * sideways * (2.0 * rng.uniform() - 1.0);
        let attitude = Attitude { heading: wrap_angle(bearing + aside), pitch: TILT * rng.normal(), roll: TILT * rng.normal() };
        Some(Pose { position, attitude })
    }

    /// Whether a craft can hover there: within the scene's bounds, above ground, and clear of all objects.
    fn is_free(&self, position: EnuPosition) -> bool {
        let LoadedScene { scene, collider, cast, .. } = self.loaded;
        let touched = |(actor, place)| cast.distance(actor, place, position).is_some_and(|distance| distance < ROOM);
        scene.bounds.contains(position)
            && collider.ground_below(position).is_some()
            && collider.contact(position, ROOM).is_none()
            && !self.actors.iter().enumerate().any(touched)
            && !scene.objects.iter().any(|object| self.is_inside(object, position))
    }

    /// Whether a position is inside an object's outline and height. An object that also contains the start (a room, a
    /// roof overhead) does not count.
    fn is_inside(&self, object: &Object, position: EnuPosition) -> bool {
        let inside = |p: EnuPosition| {
            let outline = || self.loaded.outline(object, self.actors);
            !object.opening
                && self.loaded.bounds(object, self.actors).contains(p)
                && outline().iter().any(|polygon| surrounds(polygon, p))
        };
        let start = self.loaded.scene.start.position;
        inside(position) && !inside(EnuPosition { up: start.up + HEIGHTS.0, ..start })
    }
}

fn log_uniform(rng: &mut RandomStream, low: f64, high: f64) -> f64 {
    low * libm::exp(rng.uniform() * libm::log(high / low))
}

/// Whether a polygon, east and north, contains a position: a line from it to the west crosses an odd number of sides.
fn surrounds(polygon: &[[f64; 2]], p: EnuPosition) -> bool {
    let mut inside = false;
    for (i, a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        if (a[1] > p.north) != (b[1] > p.north) {
            let fraction = (p.north - a[1]) / (b[1] - a[1]);
            inside ^= p.east > a[0] + fraction * (b[0] - a[0]);
        }
    }
    inside
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polygon_surrounds_its_middle_alone() {
        let square = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]];
        let at = |east, north| EnuPosition { east, north, up: 0.0 };
        assert!(surrounds(&square, at(2.0, 2.0)));
        for outside in [at(-1.0, 2.0), at(5.0, 2.0), at(2.0, -1.0), at(2.0, 5.0)] {
            assert!(!surrounds(&square, outside));
        }
    }

    #[test]
    fn poses_in_the_city_are_free_and_near_and_far() {
        let loaded = LoadedScene::load("city").unwrap();
        let (camera, actors) = (Camera::quad(), loaded.cast.starts());
        let views = Views { loaded: &loaded, actors: &actors, camera: &camera };
        let LoadedScene { scene, collider, .. } = &loaded;
        let crane = scene.objects.iter().find(|object| object.tags.names.iter().any(|name| name.contains("crane"))).unwrap();
        let mut rng = RandomStream::new(1, "test", &[]);
        let poses: Vec<Pose> = (0..400).filter_map(|_| views.of(crane, &mut rng)).collect();
        assert!(poses.len() > 50, "{}", poses.len());
        for pose in &poses {
            assert!(collider.contact(pose.position, 0.3).is_none() && scene.bounds.contains(pose.position));
        }
        let distances = || poses.iter().filter_map(|pose| collider.distance_to(crane.id, pose.position));
        assert!(distances().fold(f64::MAX, f64::min) < 6.0 && distances().fold(0.0, f64::max) > 60.0);
    }
}
