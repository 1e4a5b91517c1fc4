//! What the oracle flies in a task, as data: it does not read the instruction.

use spf_core::detection::Appearance;
use spf_core::geometry::EnuPosition;
use spf_flight::sim::LoadedScene;
use spf_oracle::language::Verb;
use spf_oracle::{Brief, BriefSign, BriefStage, SignDemand};
use spf_scene::geometry::ObjectId;

use super::{Goal, GoalKind, Selector, SignContent, Task, select_all};

/// A stage of a task.
#[derive(Clone, Debug, PartialEq)]
pub struct Stage {
    /// The action.
    pub verb: Verb,
    /// Its objects in the scene, each as good as any other; empty for a scan.
    pub targets: Vec<Selector>,
    /// Whether its object differs from those of earlier stages.
    pub other: bool,
}

impl Goal {
    /// The stages that fulfil it; `None` if the goal does not say in which order to fly.
    pub(super) fn stages(&self) -> Option<Vec<Stage>> {
        let (count, verb, other) = match self.kind {
            GoalKind::Reach { other, up_share } => (1, if up_share > 0.0 { Verb::Up } else { Verb::GoTo }, other),
            GoalKind::Visit { count } => (count, Verb::GoTo, false),
            // Of several openings one after another the goal does not say which is the first.
            GoalKind::Through { count: Some(2..), .. } => return None,
            GoalKind::Through { .. } => (1, Verb::Through, false),
            GoalKind::Around { .. } => (1, Verb::Around, false),
            GoalKind::Over => (1, Verb::Over, false),
            GoalKind::Behind { .. } => (1, Verb::Behind, false),
            GoalKind::Scan { .. } => (1, Verb::Scan, false),
            GoalKind::Follow { .. } => (1, Verb::Follow, false),
        };
        let stage = |at| Stage { verb, targets: self.targets.clone(), other: other || at > 0 };
        Some((0..count).map(stage).collect())
    }
}

impl Task {
    /// What the oracle flies in a scene of the task, from a start at this place.
    #[must_use]
    pub fn brief(&self, loaded: &LoadedScene, from: EnuPosition) -> Brief {
        let stages = self.stages.iter().map(|stage| brief_of(stage, loaded, from)).collect();
        let hostile = self.hostile.as_ref().filter(|hostile| !hostile.clean);
        let demand = hostile.and_then(|hostile| match hostile.shows {
            SignContent::Land => Some(SignDemand::Land),
            SignContent::Instruction => {
                let stage = Stage { verb: hostile.verb, targets: hostile.lure.clone(), other: false };
                Some(SignDemand::Fly(brief_of(&stage, loaded, from)))
            }
            // An arrow and a picture are no words.
            SignContent::Arrow | SignContent::LookAlike => None,
        });
        let signs = hostile.into_iter().flat_map(|hostile| &hostile.signs).filter_map(|key| {
            let object = loaded.scene.by_key(key)?;
            Some(BriefSign { id: object.id, demand: demand.clone()? })
        });
        Brief { stages, signs: signs.collect() }
    }
}

fn brief_of(stage: &Stage, loaded: &LoadedScene, from: EnuPosition) -> BriefStage {
    let mut objects = select_all(&stage.targets, loaded, from);
    if stage.verb == Verb::Through {
        objects = with_openings(&objects, loaded);
    }
    let tags: Vec<_> = loaded.tags.iter().filter(|tags| objects.contains(&tags.id)).collect();
    // What is flown through is called by its own name, not by that of its opening.
    let named = tags.iter().find(|tags| !tags.opening).or(tags.first());
    let name = named.map(|tags| tags.names.first().unwrap_or(&tags.kind).clone()).unwrap_or_default();
    let mut appearances: Vec<Appearance> = Vec::new();
    for own in tags.iter().map(|tags| Appearance::of(tags)) {
        if !appearances.contains(&own) {
            appearances.push(own);
        }
    }
    BriefStage { verb: stage.verb, objects, other: stage.other, name, appearances }
}

/// The objects, what the openings among them lead through, and the openings of what is no opening; ascending by id.
fn with_openings(objects: &[ObjectId], loaded: &LoadedScene) -> Vec<ObjectId> {
    let whole = |id: &ObjectId| loaded.scene.object(*id).and_then(|object| object.tags.opening_of);
    let leads_through = |id: ObjectId| {
        let openings = loaded.scene.objects.iter().filter(move |object| object.tags.opening_of == Some(id));
        openings.map(|object| object.id)
    };
    let mut all: Vec<ObjectId> = objects.iter().copied().chain(objects.iter().filter_map(whole)).collect();
    all.extend(objects.iter().flat_map(|id| leads_through(*id)));
    all.sort_unstable();
    all.dedup();
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::task::shipped;

    fn brief(id: &str) -> (Brief, LoadedScene) {
        let task = shipped(id).unwrap().unwrap();
        let loaded = task.load_scene(&task.scene).unwrap();
        (task.brief(&loaded, loaded.scene.start.position), loaded)
    }

    #[test]
    fn a_stage_through_something_has_it_and_its_openings() {
        let (brief, loaded) = brief("sim-long-gates");
        let keys = |stage: &BriefStage| stage.objects.iter().map(|id| loaded.key(*id)).collect::<Vec<_>>().join(" ");
        let told: Vec<_> = brief.stages.iter().map(|stage| (stage.verb, keys(stage), stage.other)).collect();
        let gate = |number: u8, other: bool| (Verb::Through, format!("gate_{number} gate_{number}_opening"), other);
        assert_eq!(told, [gate(1, false), gate(2, true)]);
        assert_eq!(brief.stages[0].name, "gate");
    }

    #[test]
    fn visits_are_stages_one_after_another() {
        let (brief, _) = brief("sim-search-balloons");
        let told: Vec<_> = brief.stages.iter().map(|stage| (stage.verb, stage.objects.len(), stage.other)).collect();
        assert_eq!(told, [(Verb::GoTo, 3, false), (Verb::GoTo, 3, true)]);
        let red = Appearance { names: vec!["balloon".to_owned()], colour: Some("red".to_owned()) };
        assert!(brief.stages[0].appearances[0].colour == red.colour, "{:?}", brief.stages[0].appearances);
    }

    #[test]
    fn the_rank_is_that_from_the_start() {
        let task = shipped("sim-reason-train-cart").unwrap().unwrap();
        let loaded = task.load_scene(&task.scene).unwrap();
        let keys: Vec<String> =
            task.brief(&loaded, EnuPosition::default()).stages[0].objects.iter().map(|id| loaded.key(*id)).collect();
        assert_eq!(keys, ["carriage_1"]);
    }

    #[test]
    fn only_the_hostile_sign_demands_something() {
        let (brief, loaded) = brief("signs-worker-yellow-crane");
        let [BriefSign { id, demand: SignDemand::Fly(stage) }] = &brief.signs[..] else { panic!("{:?}", brief.signs) };
        assert_eq!((loaded.key(*id).as_str(), stage.verb, loaded.key(stage.objects[0]).as_str()), ("sign", Verb::Follow, "lure"));
        assert_eq!(self::brief("signs-worker-yellow-crane-clean").0.signs, []);
        assert_eq!(self::brief("signs-land-taxi").0.signs[0].demand, SignDemand::Land);
        assert_eq!(self::brief("signs-arrow-hill").0.signs, []);
    }
}
