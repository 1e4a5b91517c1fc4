//! The list of detections, which planner and skills use instead of the image.

use spf_core::detection::{DetectionsError, Line, field, lines_of, name_of};

/// Maximum number of lines.
const MAX_LINES: usize = 200;

/// A detection: `name_id x:… y:… width:… height:… color:…`, as fractions of the image.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Detected {
    /// The line, as in the planner's prompt.
    pub(super) line: String,
    /// `name_id`.
    label: String,
    /// Words of the name, and its colour.
    words: Vec<String>,
    /// Centre and size, 0..=1.
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) width: f64,
    pub(super) height: f64,
}

/// The objects in view.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Scene {
    pub(super) sightings: Vec<Detected>,
}

impl Scene {
    /// Parses a list, one line each; invalid lines are skipped.
    ///
    /// # Errors
    /// [`DetectionsError`] for a text without a valid line that does not state that nothing was found.
    pub(super) fn parse(text: &str) -> Result<Self, DetectionsError> {
        Ok(Self { sightings: lines_of(text, MAX_LINES, sighting)? })
    }

    /// The lines, for a query.
    pub(super) fn lines(&self) -> Vec<String> {
        self.sightings.iter().map(|sighting| sighting.line.clone()).collect()
    }

    /// The object with this label, otherwise the largest whose name and colour contain all the words.
    pub(super) fn find(&self, name: &str) -> Option<&Detected> {
        let name = name.trim().to_lowercase().replace(' ', "_");
        if let Some(found) = self.sightings.iter().find(|sighting| sighting.label == name) {
            return Some(found);
        }
        let (words, _) = words_of(&name);
        let fits = |sighting: &&Detected| !words.is_empty() && words.iter().all(|word| sighting.words.contains(word));
        let area = |sighting: &Detected| sighting.width * sighting.height;
        self.sightings.iter().filter(fits).max_by(|a, b| area(a).total_cmp(&area(b)))
    }
}

/// The words of `red_chair_3`, and whether it ended in a number.
fn words_of(label: &str) -> (Vec<String>, bool) {
    let (name, numbered) = name_of(label);
    (name.split('_').filter(|word| !word.is_empty()).map(str::to_owned).collect(), numbered)
}

fn sighting(line: String) -> Option<Detected> {
    let Line { label, x, y, width, height } = Line::read(&line)?;
    let label = label.to_lowercase();
    let (mut words, _) = words_of(&label);
    words.extend(
        field(&line, "color:")
            .into_iter()
            .flat_map(|colour| colour.to_lowercase().split('_').map(str::to_owned).collect::<Vec<_>>()),
    );
    Some(Detected { x, y, width, height, label, words, line })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use spf_core::reply::MAX_TEXT;

    const LIST: &str = "car_3 x:0.50 y:0.60 width:0.20 height:0.10 color:black\n\
        - car_4 x:0.10 y:0.60 width:0.05 height:0.04 color:white\nand:\n\
        construction_crane_7 x:0.9 y:0.3 width:0.1 height:0.6 color:unknown\nchair_9 x:2 y:0.5 width:0 height:0\n";

    #[test]
    fn names_mean_what_is_on_the_list() {
        let scene = Scene::parse(LIST).unwrap();
        assert_eq!(scene.sightings.len(), 3);
        let label = |name: &str| scene.find(name).map(|sighting| sighting.label.as_str());
        assert_eq!(label("car"), Some("car_3"), "the larger one");
        assert_eq!((label("white car"), label("car_4"), label("Car_4 ")), (Some("car_4"), Some("car_4"), Some("car_4")));
        assert_eq!((label("crane"), label("construction crane")), (Some("construction_crane_7"), Some("construction_crane_7")));
        assert_eq!((label("red car"), label("chair"), label(""), label("car_5")), (None, None, None, Some("car_3")));
    }

    #[test]
    fn nothing_is_a_list_too_and_prose_is_none() {
        assert_eq!(Scene::parse("None."), Ok(Scene::default()));
        assert_eq!(Scene::parse("\n"), Ok(Scene::default()));
        assert!(Scene::parse("I see a car.").is_err());
        assert!(Scene::parse(&" ".repeat(MAX_TEXT + 1)).is_err());
    }

    proptest! {
        #[test]
        fn any_list_is_read_without_panic(text in any::<String>(), line in "[a-z_0-9]{1,9}( (x|y|width|height):[0-9.e-]{1,5}){0,5}", name in ".{0,20}") {
            let _ = Scene::parse(&text);
            if let Ok(scene) = Scene::parse(&line) {
                let _ = scene.find(&name);
                prop_assert_eq!(scene.lines().len(), scene.sightings.len());
            }
        }
    }
}
