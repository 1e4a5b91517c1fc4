//! The judge on the path that a task's file declares as accepted, without a craft: five evaluations per second of
//! flight.
//!
//! `cargo bench -p spf-bench`; loading the scene is not included.

use std::sync::Arc;

use divan::{Bencher, black_box};
use spf_bench::judge::judge_trajectory;
use spf_bench::task::shipped;

/// Approaches an object, passes several, and stays beside one that walks.
#[divan::bench(args = ["sim-nav-black-car", "real-long-cones", "real-follow-green-shirt"])]
fn accepted(bencher: Bencher<'_, '_>, task: &str) {
    let task = shipped(task).expect("it can be read").expect("it is shipped");
    let loaded = Arc::new(task.load_scene(&task.scene).expect("it is built in"));
    let way = task.trajectories.iter().find(|way| way.accepted).expect("every task has one");
    bencher.bench_local(|| judge_trajectory(black_box(&task), &loaded, way));
}

fn main() {
    divan::main();
}
