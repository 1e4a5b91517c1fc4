//! The shipped tasks: each judges its own trajectories as its file says, and its trials begin as the instruction has it.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use std::collections::BTreeMap;
use std::sync::Arc;

use spf_bench::judge::judge_trajectory;
use spf_bench::task::{Category, Set, Task, View, suite};
use spf_bench::trial::draw;
use spf_flight::sim::Stage;

fn paper() -> Vec<Arc<Task>> {
    suite("paper").unwrap().tasks().unwrap()
}

#[test]
fn the_papers_table_is_whole() {
    let tasks = paper();
    let mut counts: BTreeMap<(Set, Category), usize> = BTreeMap::new();
    for task in &tasks {
        *counts.entry((task.set, task.category)).or_default() += 1;
        assert_eq!(task.avoid, task.category == ObstacleAvoidance, "{}", task.id);
        assert_eq!(task.craft.name(), if task.set == Set::Simulation { "quad" } else { "tello" }, "{}", task.id);
    }
    use Category::{Follow, LongHorizon, Navigation, ObstacleAvoidance, Reasoning, Search};
    let of = |set, category| counts.get(&(set, category)).copied().unwrap_or(0);
    let row = |set| [Navigation, ObstacleAvoidance, LongHorizon, Reasoning, Search, Follow].map(|category| of(set, category));
    assert_eq!(row(Set::Simulation), [5, 5, 5, 3, 5, 0]);
    assert_eq!(row(Set::RealWorld), [1, 2, 2, 4, 0, 2]);
}

#[test]
fn names_are_those_of_the_files() {
    for (name, task) in suite("paper").unwrap().names().zip(paper()) {
        assert_eq!(name, task.id);
    }
}

#[test]
fn targets_are_in_view_as_the_instruction_has_it() {
    for task in paper() {
        let wanted = match (task.category, task.instruction.contains("in front")) {
            (_, true) => View::Always,
            (Category::Search, _) if task.instruction.contains("sight") => View::Half,
            (Category::Search, _) => View::Never,
            _ => View::Half,
        };
        // A scan has no target.
        assert!(task.start.view == wanted || task.start_targets().is_empty(), "{}", task.id);
        let [least, most] = task.start.range;
        let limits = if task.set == Set::Simulation { 15.0..=100.0 } else { 3.0..=15.0 };
        assert!(limits.contains(&least) && limits.contains(&most), "{}", task.id);
    }
}

#[test]
fn every_task_judges_its_own_trajectories() {
    let mut stages: BTreeMap<String, Arc<Stage>> = BTreeMap::new();
    let mut wrong = Vec::new();
    for task in paper() {
        let stage = stages.entry(task.scene.clone()).or_insert_with(|| Arc::new(Stage::load(&task.scene).unwrap()));
        let accepted = task.trajectories.iter().filter(|trajectory| trajectory.accepted).count();
        assert_eq!((accepted, task.trajectories.len()), (1, 3), "{}", task.id);
        for trajectory in &task.trajectories {
            let judgement = judge_trajectory(&task, stage, trajectory).unwrap();
            if judgement.accepted != trajectory.accepted {
                wrong.push(format!("{}: {}: {judgement:?}", task.id, trajectory.why));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_draw_follows_from_task_and_seed() {
    for id in ["sim-search-tower", "real-reason-dark"] {
        let task = paper().into_iter().find(|task| task.id == id).unwrap();
        let [one, again] = [draw(&task, 3).unwrap(), draw(&task, 3).unwrap()];
        assert_eq!((one.start, &one.scene, one.range), (again.start, &again.scene, again.range));
        let other = draw(&task, 4).unwrap();
        assert_ne!((one.start, &one.scene), (other.start, &other.scene));
        assert!((task.start.range[0]..=task.start.range[1]).contains(&one.range.unwrap()));
    }
}
