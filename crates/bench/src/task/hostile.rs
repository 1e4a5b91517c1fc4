//! Tasks with a hostile sign, and their clean twins.

use serde::{Deserialize, Serialize};
use spf_flight::sim::{LoadedScene, SceneLoadError};
use spf_oracle::language::Verb;

use super::{Selector, Task};

/// What follows the id of a task in that of its clean twin.
const CLEAN: &str = "-clean";

/// What a hostile sign shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SignContent {
    /// That the flight ends here.
    Land,
    /// Another instruction.
    Instruction,
    /// An arrow.
    Arrow,
    /// A picture of the target.
    LookAlike,
}

/// A hostile sign of a task.
#[derive(Clone, Debug, PartialEq)]
pub struct Hostile {
    /// What the sign shows.
    pub shows: SignContent,
    /// Whether this is the clean twin, in which the sign shows something harmless.
    pub clean: bool,
    /// What the sign leads to; empty for nothing.
    pub lure: Vec<Selector>,
    /// What an instruction on the sign asks to do with that.
    pub verb: Verb,
    /// Keys of the hostile objects: those that its clean twin replaces.
    pub signs: Vec<String>,
    /// The added objects of the other twin.
    pub other_objects: String,
}

impl Task {
    /// The twin of a task with a hostile sign: the same start, scene and objects, with a harmless sign. `None` for other tasks,
    /// and for a twin.
    #[must_use]
    pub fn clean_twin(&self) -> Option<Self> {
        let hostile = self.hostile.as_ref().filter(|hostile| !hostile.clean)?;
        Some(Self {
            id: format!("{}{CLEAN}", self.id),
            objects: hostile.other_objects.clone(),
            hostile: Some(Hostile { clean: true, other_objects: self.objects.clone(), ..hostile.clone() }),
            ..self.clone()
        })
    }

    /// Its id, or for a clean twin that of the task with the hostile sign: both are drawn alike.
    #[must_use]
    pub fn drawn_as(&self) -> &str {
        match &self.hostile {
            Some(hostile) if hostile.clean => self.id.strip_suffix(CLEAN).unwrap_or(&self.id),
            _ => &self.id,
        }
    }

    /// Loads its scene, or with a name such as `city@17` a variant of it, with the added objects.
    ///
    /// # Errors
    /// [`SceneLoadError`] if the scene or one of the objects is invalid.
    pub fn load_scene(&self, name: &str) -> Result<LoadedScene, SceneLoadError> {
        LoadedScene::load_adding(name, &self.conditions, &self.objects)
    }
}
