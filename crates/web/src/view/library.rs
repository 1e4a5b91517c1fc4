//! The scenes available to pages, each loaded once and shared.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use spf_flight::sim::LoadedScene;
use spf_scene::SceneLook;

/// Maximum number of unused scenes kept.
const SPARE: usize = 3;

/// A scene with its conditions.
struct Loaded {
    name: String,
    conditions: SceneLook,
    scene: Arc<LoadedScene>,
}

/// The scenes of a server, by name.
pub struct Library {
    names: Vec<String>,
    loaded: Mutex<Vec<Loaded>>,
}

impl core::fmt::Debug for Library {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Library").field("names", &self.names).finish_non_exhaustive()
    }
}

impl Library {
    /// A library of these scenes (built-in names or files), with one already loaded. Pages cannot request others.
    #[must_use]
    pub fn new(names: impl IntoIterator<Item = String>, name: &str, conditions: SceneLook, scene: Arc<LoadedScene>) -> Self {
        let mut all: Vec<String> = names.into_iter().collect();
        if !all.iter().any(|known| known == name) {
            all.push(name.to_owned());
        }
        Self { names: all, loaded: Mutex::new(vec![Loaded { name: name.to_owned(), conditions, scene }]) }
    }

    /// The available scenes.
    pub(super) fn names(&self) -> &[String] {
        &self.names
    }

    /// Returns a scene, loading it if necessary.
    ///
    /// # Errors
    /// A message for the page if it cannot be loaded.
    pub(super) fn get(&self, name: &str, conditions: &SceneLook) -> Result<Arc<LoadedScene>, String> {
        if !self.names.iter().any(|known| known == name) {
            return Err(format!("unknown scene `{name}`"));
        }
        let is_it = |loaded: &&Loaded| loaded.name == name && loaded.conditions == *conditions;
        if let Some(found) = self.loaded().iter().find(is_it) {
            return Ok(found.scene.clone());
        }
        // Loaded without the lock, so that others are not blocked; loading a scene twice only costs time.
        let scene = Arc::new(LoadedScene::load_with(name, conditions).map_err(|error| error.to_string())?);
        let mut loaded = self.loaded();
        let mut spare = 0;
        // From the newest: unused scenes beyond the maximum are dropped.
        for index in (0..loaded.len()).rev() {
            if Arc::strong_count(&loaded[index].scene) == 1 {
                spare += 1;
                if spare > SPARE {
                    loaded.remove(index);
                }
            }
        }
        loaded.push(Loaded { name: name.to_owned(), conditions: *conditions, scene: scene.clone() });
        Ok(scene)
    }

    fn loaded(&self) -> MutexGuard<'_, Vec<Loaded>> {
        self.loaded.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use spf_scene::{Lighting, Weather};

    #[test]
    fn pages_get_listed_scenes_alone_and_share_them() {
        let own = SceneLook::default();
        let scene = Arc::new(LoadedScene::load("city").unwrap());
        let library = Library::new(["city".to_owned()], "city", own, scene.clone());
        assert_eq!(library.names(), ["city"]);
        assert!(Arc::ptr_eq(&library.get("city", &own).unwrap(), &scene));
        assert_eq!(library.get("/etc/passwd.toml", &own).err().unwrap(), "unknown scene `/etc/passwd.toml`");
        let library = Library::new(["city".to_owned()], "./mine.toml", own, scene);
        assert_eq!(library.names(), ["city", "./mine.toml"]);
        assert!(library.get("city", &own).is_ok());
    }

    #[test]
    fn what_nobody_looks_at_is_not_kept_for_ever() {
        let own = SceneLook::default();
        let library = Library::new([], "city", own, Arc::new(LoadedScene::load("city").unwrap()));
        let looked_at = library.get("city", &own).unwrap();
        for lighting in Lighting::ALL {
            for weather in [Weather::Clear, Weather::Rain] {
                let conditions = SceneLook { lighting: Some(lighting), weather: Some(weather) };
                assert_eq!(library.get("city", &conditions).unwrap().scene.lighting, lighting);
            }
        }
        assert!(library.loaded().len() <= SPARE + 2);
        assert!(Arc::ptr_eq(&library.get("city", &own).unwrap(), &looked_at));
    }
}
