//! A scene made ready to fly in; shared by every flight in it.

use std::sync::Arc;

use spf_core::geometry::EnuPosition;
use spf_sim::collide::{Collider, ColliderError};
use spf_sim::oracle::{Place, Placed, Tagged};
use spf_sim::render::Renderer;
use spf_sim::scene::{Conditions, Scene, SceneError};

/// Scene, renderer, collider and tags.
pub struct Stage {
    /// The scene.
    pub scene: Scene,
    /// Draws it.
    pub renderer: Renderer,
    /// Touches it.
    pub collider: Arc<Collider>,
    /// What its objects are called.
    pub tags: Vec<Tagged>,
}

/// Why a scene cannot be flown in.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StageError {
    /// The scene file.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Its meshes.
    #[error("the scene's meshes cannot be touched: {0}")]
    Collider(#[from] ColliderError),
}

impl Stage {
    /// Loads a built-in scene by name, or a scene file by path.
    ///
    /// # Errors
    /// [`StageError`] when there is no such scene or it is not sound.
    pub fn load(scene: &str) -> Result<Self, StageError> {
        Self::load_with(scene, &Conditions::default())
    }

    /// The same under other light and weather than the file's own.
    ///
    /// # Errors
    /// As [`Stage::load`].
    pub fn load_with(scene: &str, conditions: &Conditions) -> Result<Self, StageError> {
        let scene = Scene::load_with(scene, conditions)?;
        let collider = Arc::new(Collider::new(&scene.geometry)?);
        let renderer = Renderer::new(&scene.geometry);
        let tags = scene.tagged();
        Ok(Self { scene, renderer, collider, tags })
    }

    /// Tags and places of all objects, as the truth reads them.
    pub(crate) fn placed(&self) -> Vec<Placed<'_>> {
        self.scene.objects.iter().zip(&self.tags).map(|(object, tags)| Placed { tags, place: Some(place(object)) }).collect()
    }
}

fn place(object: &spf_sim::scene::Object) -> Place {
    let (min, max) = (object.bounds.min, object.bounds.max);
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
