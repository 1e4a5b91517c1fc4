//! Scene errors.

use thiserror::Error;

use crate::limits::MAX_BYTES;

/// Why a scene could not be loaded.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SceneError {
    /// No built-in scene has this name.
    #[error("unknown scene `{name}`\n\nhint: {hint}")]
    Unknown {
        /// The name given.
        name: String,
        /// The known names, or the nearest one.
        hint: String,
    },
    /// The file could not be read.
    #[error("cannot read the scene file `{path}`")]
    Read {
        /// The path.
        path: String,
        /// The cause.
        #[source]
        source: std::io::Error,
    },
    /// The file is not a valid scene file.
    #[error("{file}:{line}: {message}{}", hint.as_ref().map(|h| format!("\n\nhint: {h}")).unwrap_or_default())]
    Invalid {
        /// The file.
        file: String,
        /// Line, from 1.
        line: usize,
        /// The problem.
        message: String,
        /// How to fix it.
        hint: Option<String>,
    },
    /// The glTF file cannot be loaded as a scene.
    #[error("{file}: {message}{}", hint.as_ref().map(|h| format!("\n\nhint: {h}")).unwrap_or_default())]
    Model {
        /// The file.
        file: String,
        /// The problem, and its place in the file.
        message: String,
        /// How to fix it.
        hint: Option<String>,
    },
}

impl SceneError {
    pub(crate) fn unknown(name: &str, known: &[&str]) -> Self {
        let hint = nearest(name, known.iter().copied()).map_or_else(
            || format!("built-in scenes are `{}`; scene files end in `.toml`, `.glb` or `.gltf`", known.join("`, `")),
            |near| format!("did you mean `{near}`?"),
        );
        Self::Unknown { name: name.to_owned(), hint }
    }

    pub(crate) fn bad_seed(scene: &str, seed: &str) -> Self {
        let hint = format!("the variant seed must be a whole number from 0 to {}, as in `{scene}@17`", u64::MAX);
        Self::Unknown { name: format!("{scene}@{seed}"), hint }
    }

    pub(crate) fn no_variants(file: &str, line: usize) -> Self {
        let hint = "remove `@` and the number, or define variations under `[vary]` (docs/reference/scene-format.md)".to_owned();
        Self::Invalid { file: file.to_owned(), line, message: "this scene has no variants".to_owned(), hint: Some(hint) }
    }

    pub(crate) fn no_objects(file: &str) -> Self {
        let hint = "refer to the model from an object in a scene file (docs/reference/scene-format.md)".to_owned();
        let message = "objects cannot be added to a glTF model".to_owned();
        Self::Invalid { file: file.to_owned(), line: 1, message, hint: Some(hint) }
    }

    pub(crate) fn too_large(file: &str) -> Self {
        Self::Invalid {
            file: file.to_owned(),
            line: 1,
            message: format!("the file exceeds {MAX_BYTES} bytes"),
            hint: Some("use templates, `places` and `repeat` for repeated objects".to_owned()),
        }
    }
}

/// The candidate nearest to a word, if it is close enough (at most a third of the letters differ).
pub(crate) fn nearest<'a>(word: &str, candidates: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let distance = |c: &str| strsim::damerau_levenshtein(word, c);
    let best = candidates.min_by_key(|c| distance(c))?;
    (distance(best) <= 1 + word.chars().count() / 3).then_some(best)
}

/// A hint from a parser's message: the nearest of the names listed in backticks.
#[must_use]
pub fn hint_from(message: &str) -> Option<String> {
    let mut quoted = message.split('`').skip(1).step_by(2);
    let wrong = quoted.next()?;
    if !message.starts_with("unknown") {
        return None;
    }
    let known: Vec<&str> = quoted.collect();
    match nearest(wrong, known.iter().copied()) {
        Some(near) => Some(format!("did you mean `{near}`?")),
        None => Some(format!("known keys: `{}`", known.join("`, `"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_of_the_finger_is_recognised() {
        let message = "unknown field `colur`, expected one of `names`, `colour`, `kind`";
        assert_eq!(hint_from(message).as_deref(), Some("did you mean `colour`?"));
        assert_eq!(nearest("zebra", ["tower", "car"].into_iter()), None);
    }
}
