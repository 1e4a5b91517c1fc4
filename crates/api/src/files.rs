//! What a user names by a path: scenes and other files.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError, Weak};

use spf_bench::task::shipped;
use spf_flight::sim::LoadedScene;
use spf_scene::{Scene, SceneLook};

use crate::error::Error;

/// Loads a built-in scene or a scene file, or as in a log of the bench `SCENE+TASK`, with the objects that a built-in task adds;
/// errors name the scenes that there are. Warns of what of a model
/// is not drawn.
///
/// # Errors
/// A usage error if there is no such scene, or its file is invalid.
pub fn load_scene(name: &str, conditions: &SceneLook) -> Result<LoadedScene, Error> {
    let task = name.rsplit_once('+').and_then(|(scene, task)| Some((scene, shipped(task).ok()??.objects)));
    let (scene, objects) = task.as_ref().map_or((name, ""), |(scene, objects)| (*scene, objects));
    let loaded = LoadedScene::load_adding(scene, conditions, objects).map_err(|error| {
        let built_in = Scene::built_in().join(", ");
        Error::usage(format!("cannot load the scene `{name}`"))
            .because(&error)
            .hint(format!("built-in scenes: {built_in}; or a scene file (docs/reference/scene-format.md)"))
    })?;
    for warning in &loaded.scene.warnings {
        tracing::warn!("{name}: {warning}");
    }
    Ok(loaded)
}

/// The same in its own light, shared by all who use it at once: a built-in scene is loaded once while somebody has it. A file may change,
/// and is loaded each time.
pub(crate) fn shared_scene(name: &str) -> Result<Arc<LoadedScene>, Error> {
    static SHARED: Mutex<BTreeMap<String, Weak<LoadedScene>>> = Mutex::new(BTreeMap::new());
    if name.contains(['/', '.']) || Path::new(name).exists() {
        return load_scene(name, &SceneLook::default()).map(Arc::new);
    }
    let mut shared = SHARED.lock().unwrap_or_else(PoisonError::into_inner);
    shared.retain(|_, scene| scene.strong_count() > 0);
    if let Some(scene) = shared.get(name).and_then(Weak::upgrade) {
        return Ok(scene);
    }
    let scene = Arc::new(load_scene(name, &SceneLook::default())?);
    shared.insert(name.to_owned(), Arc::downgrade(&scene));
    Ok(scene)
}

/// Reads a file named by the user; `what` is its content in a word or two, for messages.
///
/// # Errors
/// A usage error if it cannot be read.
pub fn read(path: &Path, what: &str) -> Result<String, Error> {
    spf_input::read_text(path).map_err(|error| {
        Error::usage(format!("cannot read the {what} file `{}`", path.display()))
            .because(&error)
            .hint("relative paths are resolved from the working directory")
    })
}
