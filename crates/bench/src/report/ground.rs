//! The ground plan of a trial's scene: what stands in it, seen from above, and what the task is about.

use spf_scene::{Object, Scene};

/// Kinds of things that are no obstacle to anybody.
const FLAT: [&str; 4] = ["ground", "floor", "ceiling", "water"];
/// What is lower than this is walked over, metres.
const LOW: f64 = 0.25;

/// A scene from above, metres east and north.
#[derive(Clone, Debug, Default)]
pub(super) struct Ground {
    /// Footprints of solid things.
    pub(super) solid: Vec<Vec<[f64; 2]>>,
    /// Footprints of the targets, and the middle of each with its name.
    pub(super) targets: Vec<Vec<[f64; 2]>>,
    pub(super) marks: Vec<([f64; 2], String)>,
}

impl Ground {
    /// The plan of a scene, by the name that a row tells, with the objects of these keys as targets; none where the scene cannot be
    /// loaded, such as a file that is not here. What moves stands where it begins.
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
    fn a_plan_has_what_stands_in_the_way_and_the_targets() {
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
