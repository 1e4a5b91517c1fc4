//! One module per command, each returning an exit code.

pub(crate) mod bench;
pub(crate) mod camera;
pub(crate) mod cockpit;
pub(crate) mod config;
pub(crate) mod depth_model;
mod detector;
mod display;
mod doctor;
pub(crate) mod fly;
pub(crate) mod ground;
pub(crate) mod log;
mod reask;
pub(crate) mod replay;
pub(crate) mod screen;
pub(crate) mod shell;
pub(crate) mod sim;
mod tello;
mod track;
pub(crate) mod vlm;

pub(crate) use doctor::doctor;
pub(crate) use tello::tello;
pub(crate) use track::track;

use std::path::Path;

use spf_bench::task::shipped;
pub(crate) use spf_flight::pose::parse_pose;
use spf_flight::sim::LoadedScene;
use spf_scene::{Scene, SceneLook};

use crate::error::CliError;

/// Loads a built-in scene or a scene file, or as in a log of the bench `SCENE+TASK`, with the objects that a built-in task adds;
/// errors suggest similar names. Says what of a model is not drawn.
pub(crate) fn load_scene(name: &str, conditions: &SceneLook) -> Result<LoadedScene, CliError> {
    let task = name.rsplit_once('+').and_then(|(scene, task)| Some((scene, shipped(task).ok()??.objects)));
    let (scene, objects) = task.as_ref().map_or((name, ""), |(scene, objects)| (*scene, objects));
    let loaded = LoadedScene::load_adding(scene, conditions, objects).map_err(|error| {
        let built_in = Scene::built_in().join(", ");
        CliError::usage(format!("cannot load the scene `{name}`"))
            .because(&error)
            .hint(format!("built-in scenes: {built_in}; or a scene file (docs/reference/scene-format.md)"))
    })?;
    for warning in &loaded.scene.warnings {
        tracing::warn!("{name}: {warning}");
    }
    Ok(loaded)
}

/// Reads a file named by the user.
pub(crate) fn read(path: &Path, what: &str) -> Result<String, CliError> {
    spf_input::read_text(path).map_err(|error| {
        CliError::usage(format!("cannot read the {what} file `{}`", path.display()))
            .because(&error)
            .hint("relative paths are resolved from the working directory")
    })
}
