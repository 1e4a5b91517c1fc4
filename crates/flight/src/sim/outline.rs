//! Outlines of the scene, for a flight's map and log.

use spf_record::log::foxglove::Prism;
use spf_record::trajectory::Outline;
use spf_scene::actors::ActorPlace;
use spf_scene::{Object, Tags};

use super::loaded_scene::LoadedScene;

/// Objects flatter than this, metres, count as ground: their outlines would only hide those on top.
const FLAT: f64 = 0.2;

/// The scene from above with the actors at the given places, lowest objects first.
pub(super) fn outlines(loaded: &LoadedScene, actors: &[ActorPlace]) -> Vec<Outline> {
    let outline = |object: &Object| Outline {
        name: object.key.clone(),
        colour: colour(&object.tags),
        polygons: loaded.outline(object, actors),
    };
    lowest_first(loaded).into_iter().map(outline).collect()
}

/// The scene's objects as prisms, at the start of a flight.
pub(super) fn prisms(loaded: &LoadedScene) -> Vec<Prism> {
    let actors = loaded.cast.starts();
    let prism = |object: &Object| {
        let bounds = loaded.bounds(object, &actors);
        let (bottom, top) = (bounds.min.up, bounds.max.up);
        let polygons = loaded.outline(object, &actors);
        (top - bottom > FLAT).then(|| Prism { name: object.key.clone(), polygons, bottom, top, colour: colour(&object.tags) })
    };
    lowest_first(loaded).into_iter().filter_map(prism).collect()
}

fn lowest_first(loaded: &LoadedScene) -> Vec<&Object> {
    let mut objects: Vec<_> =
        loaded.scene.objects.iter().filter(|object| !object.opening && !object.outline.is_empty()).collect();
    objects.sort_by(|a, b| a.bounds.max.up.total_cmp(&b.bounds.max.up).then(a.id.cmp(&b.id)));
    objects
}

/// Map colour: ground by its kind, everything else by its named colour.
fn colour(tags: &Tags) -> [u8; 3] {
    let named = |words: &[&str]| words.iter().any(|word| tags.names.iter().chain(&tags.synonyms).any(|name| name.contains(word)));
    match (tags.kind.as_str(), tags.colour.as_deref()) {
        ("water", _) => [170, 205, 230],
        ("tree", _) => [130, 180, 110],
        ("ground", _) if named(&["road", "street", "avenue", "junction", "car park"]) => [204, 204, 208],
        ("ground", _) if named(&["crossing"]) => [236, 236, 236],
        ("ground", _) if named(&["grass", "lawn", "park", "meadow", "hill"]) => [216, 230, 202],
        ("ground", _) => [232, 228, 218],
        (_, Some(word)) if word.contains("red") => [205, 70, 60],
        (_, Some(word)) if word.contains("yellow") => [230, 190, 60],
        (_, Some(word)) if word.contains("green") => [110, 160, 90],
        (_, Some(word)) if word.contains("blue") => [90, 130, 200],
        (_, Some(word)) if word.contains("black") => [60, 60, 64],
        (_, Some(word)) if word.contains("white") => [246, 246, 246],
        (_, Some(word)) if word.contains("brown") || word.contains("orange") || word.contains("beige") => [190, 150, 110],
        _ => [190, 186, 180],
    }
}
