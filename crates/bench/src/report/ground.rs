//! Ground plan of a trial's scene, with the task's targets.

use spf_scene::{Object, Scene};

/// Kinds of objects that are never obstacles.
const FLAT: [&str; 4] = ["ground", "floor", "ceiling", "water"];
/// Objects lower than this are omitted, metres.
const LOW: f64 = 0.25;

/// A scene from above, metres east and north.
#[derive(Clone, Debug, Default)]
pub(super) struct Ground {
    /// Footprints of solid objects.
    pub(super) solid: Vec<Vec<[f64; 2]>>,
    /// Footprints of the targets, and the centre of each with its name.
    pub(super) targets: Vec<Vec<[f64; 2]>>,
    pub(super) marks: Vec<([f64; 2], String)>,
}

impl Ground {
    /// The plan of the scene with this name, with the objects of these keys as targets; `None` if the scene cannot be
    /// loaded, such as a missing file. Actors are at their initial positions.
    pub(super) fn load(scene: &str, targets: &[String]) -> Option<Self> {
        let scene = Scene::load(scene).ok()?;
        let mut ground = Self::default();
        for object in &scene.objects {
            if targets.contains(&object.key) {
                ground.targets.extend(object.outline.iter().cloned());
                ground.marks.push((middle(object), object.key.clone()));
            } else if is_solid(object) {
                ground.solid.extend(object.outline.iter().cloned());
            }
        }
        Some(ground)
    }
}

fn is_solid(object: &Object) -> bool {
    let height = object.bounds.max.up - object.bounds.min.up;
    !object.opening && !FLAT.contains(&object.tags.kind.as_str()) && height > LOW
}

fn middle(object: &Object) -> [f64; 2] {
    let (min, max) = (object.bounds.min, object.bounds.max);
    [0.5 * (min.east + max.east), 0.5 * (min.north + max.north)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plan_has_the_obstacles_and_the_targets() {
        let ground = Ground::load("city@340970708", &["red_crane".to_owned()]).unwrap();
        assert!(ground.solid.len() > 20, "{}", ground.solid.len());
        assert_eq!(ground.marks.len(), 1);
        let scene = Scene::load("city@340970708").unwrap();
        let crane = scene.by_key("red_crane").unwrap();
        assert_eq!(ground.marks[0].0, middle(crane));
        assert_eq!(ground.targets, crane.outline);
        assert!(Ground::load("no such scene", &[]).is_none());
    }
}
