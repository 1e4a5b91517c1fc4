//! A scene loaded for flying; shared by all flights in it.

use std::sync::{Arc, Mutex, PoisonError};

use spf_core::camera::Camera;
use spf_core::craft::CraftKind;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::tags::Tagged;
use spf_core::time::Time;
use spf_envelope::Limits;
use spf_oracle::{Place, Placed};
use spf_render::effects::Posed;
use spf_render::{Channels, Frustum, RenderedImage, Renderer};
use spf_scene::actors::{ActorPlace, Cast, Traffic};
use spf_scene::collide::{Collider, ColliderError};
use spf_scene::geometry::ObjectId;
use spf_scene::{Aabb, Object, Scene, SceneError, SceneLook};
use spf_sim::model::Model;

/// A loaded scene: geometry, renderer, collider, actors and tags.
///
/// Loading takes most of the start-up time, so load once and share it through an [`Arc`].
pub struct LoadedScene {
    /// The scene.
    pub scene: Scene,
    /// Its renderer.
    pub renderer: Renderer,
    /// Its collision geometry.
    pub collider: Arc<Collider>,
    /// Its moving actors.
    pub cast: Arc<Cast>,
    /// Names and properties of its objects.
    pub tags: Vec<Tagged>,
    /// Unused render buffers. Memory thus grows with the number of concurrent queries, not of flights.
    eyes: Mutex<Vec<PerceptBuffers>>,
}

/// Render buffers for one percept of the oracle: eight megabytes, reused.
#[derive(Default)]
pub(super) struct PerceptBuffers {
    pub(super) sight: RenderedImage,
    pub(super) wide: RenderedImage,
}

/// The state of the world at an instant: camera pose and actor positions.
#[derive(Clone, Debug)]
pub struct WorldSnapshot {
    /// The camera's true pose.
    pub pose: Pose,
    /// Actor positions, in the order of the cast.
    pub actors: Vec<ActorPlace>,
}

impl Posed for WorldSnapshot {
    fn pose(&self) -> &Pose {
        &self.pose
    }
}

/// Why a scene could not be loaded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneLoadError {
    /// The scene file is invalid.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Its meshes are invalid.
    #[error("the scene has an invalid mesh: {0}")]
    Collider(#[from] ColliderError),
}

impl LoadedScene {
    /// Loads a built-in scene by name, or a scene file by path, with the light and weather given in it.
    ///
    /// # Errors
    /// [`SceneLoadError`] if there is no such scene or it is invalid.
    pub fn load(scene: &str) -> Result<Self, SceneLoadError> {
        Self::load_with(scene, &SceneLook::default())
    }

    /// Loads a scene with different light and weather.
    ///
    /// # Errors
    /// Same as [`LoadedScene::load`].
    pub fn load_with(scene: &str, conditions: &SceneLook) -> Result<Self, SceneLoadError> {
        Self::load_adding(scene, conditions, "")
    }

    /// Loads a scene with further objects, `[[objects]]` tables of the scene format.
    ///
    /// # Errors
    /// Same as [`LoadedScene::load`].
    pub fn load_adding(scene: &str, conditions: &SceneLook, objects: &str) -> Result<Self, SceneLoadError> {
        let mut scene = Scene::load_adding(scene, conditions, objects)?;
        let collider = Arc::new(Collider::new(&scene.geometry)?);
        let renderer = Renderer::new(&scene.geometry);
        let tags = scene.tagged();
        let cast = Arc::new(Cast::new(&scene.actors, &collider)?);
        // The scene alone does not know the ground height under its actors.
        for (actor, place) in cast.starts().iter().enumerate() {
            let object = scene.objects.get_mut(usize::from(cast.object(actor)).wrapping_sub(1));
            if let Some((object, bounds)) = object.zip(cast.bounds(actor, place)) {
                object.bounds = bounds;
            }
        }
        Ok(Self { scene, renderer, collider, cast, tags, eyes: Mutex::default() })
    }

    /// Default envelope limits for a craft in this scene: the usual ones, with the scene's maximum altitude.
    #[must_use]
    pub fn limits(&self, kind: CraftKind) -> Limits {
        let limits = Limits::for_craft(&Model::of(kind).craft);
        Limits { max_altitude: self.scene.max_altitude.unwrap_or(limits.max_altitude), ..limits }
    }

    /// An object's key in the scene; its id if it has none.
    #[must_use]
    pub fn key(&self, id: ObjectId) -> String {
        self.tags.iter().find(|tags| tags.id == id).map_or_else(|| id.to_string(), |tags| tags.key.clone())
    }

    /// Takes render buffers; return them with [`LoadedScene::give_back`].
    pub(super) fn eyes(&self) -> PerceptBuffers {
        self.eyes.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default()
    }

    /// Returns render buffers.
    pub(super) fn give_back(&self, eyes: PerceptBuffers) {
        self.eyes.lock().unwrap_or_else(PoisonError::into_inner).push(eyes);
    }

    /// The world seen from `pose` at time `at` of the flight with this seed.
    #[must_use]
    pub fn snapshot(&self, pose: Pose, seed: u64, at: Time) -> WorldSnapshot {
        let mut traffic = Traffic::new(self.cast.clone(), seed);
        traffic.advance_to(at);
        WorldSnapshot { pose, actors: traffic.places_at(at).unwrap_or_default() }
    }

    /// The world seen from `pose` at the start of a flight.
    #[must_use]
    pub fn initial_snapshot(&self, pose: Pose) -> WorldSnapshot {
        WorldSnapshot { pose, actors: self.cast.starts() }
    }

    /// Makes what the first image of the scene would make, for whoever renders in tasks of the thread pool
    /// ([`Renderer::prepare`](spf_render::Renderer::prepare)).
    pub fn prepare(&self) {
        self.renderer.prepare();
    }

    /// Renders an image of a snapshot.
    #[must_use]
    pub fn render(&self, camera: &Camera, snapshot: &WorldSnapshot, channels: Channels) -> RenderedImage {
        let mut image = RenderedImage::default();
        self.render_into(camera, snapshot, channels, &mut image);
        image
    }

    /// Renders a snapshot into existing buffers.
    pub fn render_into(&self, camera: &Camera, snapshot: &WorldSnapshot, channels: Channels, image: &mut RenderedImage) {
        let frustum = Frustum::new(camera, &snapshot.pose);
        let actors = self.cast.parts(&snapshot.actors, |centre, radius| frustum.sees(centre, radius));
        self.renderer.render_into(camera, &snapshot.pose, channels, &actors, image);
    }

    /// Bounding box of an object with the actors at the given places.
    #[must_use]
    pub fn bounds(&self, object: &Object, actors: &[ActorPlace]) -> Aabb {
        let moved = self.cast.of_object(object.id).and_then(|actor| self.cast.bounds(actor, actors.get(actor)?));
        moved.unwrap_or(object.bounds)
    }

    /// Footprint of an object with the actors at the given places.
    #[must_use]
    pub fn outline(&self, object: &Object, actors: &[ActorPlace]) -> Vec<Vec<[f64; 2]>> {
        let moved = self.cast.of_object(object.id).and_then(|actor| Some(self.cast.outline(actor, actors.get(actor)?)));
        moved.unwrap_or_else(|| object.outline.clone())
    }

    /// Distance from a point to the nearest surface of an object, metres, with the actors at the given places.
    #[must_use]
    pub fn distance_to(&self, object: ObjectId, actors: &[ActorPlace], point: EnuPosition) -> Option<f64> {
        match self.cast.of_object(object) {
            Some(actor) => self.cast.distance(actor, actors.get(actor)?, point),
            None => self.collider.distance_to(object, point),
        }
    }

    /// The point of an object's surface that is nearest to a point; of an actor, its middle.
    pub(super) fn nearest_of(&self, object: ObjectId, actors: &[ActorPlace], point: EnuPosition) -> Option<EnuPosition> {
        match self.cast.of_object(object) {
            Some(_) => {
                let moving = self.scene.objects.iter().find(|one| one.id == object)?;
                Some(place(&self.bounds(moving, actors)).centre)
            }
            None => self.collider.nearest_of(object, point),
        }
    }

    /// Tags and positions of all objects with the actors at the given places, for evaluation.
    #[must_use]
    pub fn placed(&self, actors: &[ActorPlace]) -> Vec<Placed<'_>> {
        let placed = |(object, tags)| Placed { tags, place: Some(place(&self.bounds(object, actors))) };
        self.scene.objects.iter().zip(&self.tags).map(placed).collect()
    }
}

fn place(bounds: &Aabb) -> Place {
    let (min, max) = (bounds.min, bounds.max);
    Place {
        centre: EnuPosition {
            east: 0.5 * (min.east + max.east),
            north: 0.5 * (min.north + max.north),
            up: 0.5 * (min.up + max.up),
        },
        height: max.up - min.up,
        width: (max.east - min.east).max(max.north - min.north),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn under_a_ceiling_the_envelope_ends_lower() {
        let (city, office) = (LoadedScene::load("city").unwrap(), LoadedScene::load("office").unwrap());
        assert_eq!(city.limits(CraftKind::Quad), Limits::for_craft(&Model::of(CraftKind::Quad).craft));
        let limits = office.limits(CraftKind::Tello);
        assert_eq!(limits.check(), Ok(()));
        let ceiling = office.scene.objects.iter().find(|object| object.key == "ceiling").unwrap();
        assert!((limits.max_altitude - ceiling.bounds.min.up).abs() < 0.05, "{} {:?}", limits.max_altitude, ceiling.bounds);
    }
}
