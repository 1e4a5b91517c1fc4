//! The tasks that come with the program, and the suites that they make.

use std::sync::Arc;

use super::{Task, TaskError};

/// The tasks of the paper's table, in its order: name and text.
const PAPER: &[(&str, &str)] = &[
    ("sim-nav-red-crane", include_str!("../../../../tasks/paper/sim-nav-red-crane.toml")),
    ("sim-nav-white-building", include_str!("../../../../tasks/paper/sim-nav-white-building.toml")),
    ("sim-nav-white-needle", include_str!("../../../../tasks/paper/sim-nav-white-needle.toml")),
    ("sim-nav-black-car", include_str!("../../../../tasks/paper/sim-nav-black-car.toml")),
    ("sim-nav-tunnel", include_str!("../../../../tasks/paper/sim-nav-tunnel.toml")),
    ("sim-obstacle-white-needle", include_str!("../../../../tasks/paper/sim-obstacle-white-needle.toml")),
    ("sim-obstacle-black-car", include_str!("../../../../tasks/paper/sim-obstacle-black-car.toml")),
    ("sim-obstacle-tunnel", include_str!("../../../../tasks/paper/sim-obstacle-tunnel.toml")),
    ("sim-obstacle-hollow-building", include_str!("../../../../tasks/paper/sim-obstacle-hollow-building.toml")),
    ("sim-obstacle-bridge", include_str!("../../../../tasks/paper/sim-obstacle-bridge.toml")),
    ("sim-long-gates", include_str!("../../../../tasks/paper/sim-long-gates.toml")),
    ("sim-long-towers", include_str!("../../../../tasks/paper/sim-long-towers.toml")),
    ("sim-long-tree-hill", include_str!("../../../../tasks/paper/sim-long-tree-hill.toml")),
    ("sim-long-plane-crane", include_str!("../../../../tasks/paper/sim-long-plane-crane.toml")),
    ("sim-long-over-building", include_str!("../../../../tasks/paper/sim-long-over-building.toml")),
    ("sim-reason-scan-city", include_str!("../../../../tasks/paper/sim-reason-scan-city.toml")),
    ("sim-reason-drive", include_str!("../../../../tasks/paper/sim-reason-drive.toml")),
    ("sim-reason-train-cart", include_str!("../../../../tasks/paper/sim-reason-train-cart.toml")),
    ("sim-search-monorail", include_str!("../../../../tasks/paper/sim-search-monorail.toml")),
    ("sim-search-balloons", include_str!("../../../../tasks/paper/sim-search-balloons.toml")),
    ("sim-search-train", include_str!("../../../../tasks/paper/sim-search-train.toml")),
    ("sim-search-tower", include_str!("../../../../tasks/paper/sim-search-tower.toml")),
    ("sim-search-lake", include_str!("../../../../tasks/paper/sim-search-lake.toml")),
    ("real-nav-chair", include_str!("../../../../tasks/paper/real-nav-chair.toml")),
    ("real-obstacle-cone", include_str!("../../../../tasks/paper/real-obstacle-cone.toml")),
    ("real-obstacle-door", include_str!("../../../../tasks/paper/real-obstacle-door.toml")),
    ("real-long-chairs", include_str!("../../../../tasks/paper/real-long-chairs.toml")),
    ("real-long-cones", include_str!("../../../../tasks/paper/real-long-cones.toml")),
    ("real-reason-dry-chair", include_str!("../../../../tasks/paper/real-reason-dry-chair.toml")),
    ("real-reason-help", include_str!("../../../../tasks/paper/real-reason-help.toml")),
    ("real-reason-thirsty", include_str!("../../../../tasks/paper/real-reason-thirsty.toml")),
    ("real-reason-dark", include_str!("../../../../tasks/paper/real-reason-dark.toml")),
    ("real-follow-red-cone", include_str!("../../../../tasks/paper/real-follow-red-cone.toml")),
    ("real-follow-green-shirt", include_str!("../../../../tasks/paper/real-follow-green-shirt.toml")),
];

/// The five on which the paper compares ways of asking.
const NAVIGATION: &[(&str, &str)] = &[PAPER[0], PAPER[1], PAPER[2], PAPER[3], PAPER[4]];

/// A named list of tasks.
#[derive(Clone, Copy, Debug)]
pub struct Suite {
    /// Its name.
    pub name: &'static str,
    /// What it is, in a line.
    pub description: &'static str,
    /// Methods that it compares where none are named, joined by commas.
    pub methods: &'static str,
    tasks: &'static [(&'static str, &'static str)],
}

/// Every suite.
pub const SUITES: &[Suite] = &[
    Suite { name: "paper", description: "the paper's 23 simulation and 11 real-world tasks", methods: "spf", tasks: PAPER },
    Suite {
        name: "table1",
        description: "the same, flown by SPF, PIVOT, TypeFly, plain text and blindly straight on",
        methods: "spf,pivot,typefly,plain,straight",
        tasks: PAPER,
    },
    Suite {
        name: "ablation-prompting",
        description: "the five navigation tasks, with every form of question",
        methods: "spf,pivot,pivot-1m,pivot-parallel,plain,plain-numeric,plain-discrete",
        tasks: NAVIGATION,
    },
];

impl Suite {
    /// The names of its tasks, in order.
    pub fn names(&self) -> impl ExactSizeIterator<Item = &'static str> {
        self.tasks.iter().map(|(name, _)| *name)
    }

    /// Its tasks, in order.
    ///
    /// # Errors
    /// [`TaskError`] when one of the files is no task; a test reads them all.
    pub fn tasks(&self) -> Result<Vec<Arc<Task>>, TaskError> {
        self.tasks.iter().map(|(name, text)| Task::parse(text, name).map(Arc::new)).collect()
    }
}

/// The suite of that name.
#[must_use]
pub fn suite(name: &str) -> Option<&'static Suite> {
    SUITES.iter().find(|suite| suite.name == name)
}

/// The task of that name that comes with the program.
///
/// # Errors
/// [`TaskError`] when its file is no task; a test reads them all.
pub fn shipped(name: &str) -> Result<Option<Task>, TaskError> {
    let all = SUITES.iter().flat_map(|suite| suite.tasks);
    let text = all.into_iter().find(|(known, _)| *known == name).map(|(name, text)| Task::parse(text, name));
    text.transpose()
}
