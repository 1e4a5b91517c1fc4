//! The built-in tasks and suites.

use std::sync::Arc;

use super::{Task, TaskError};

/// Tasks of a folder of `tasks/`: name and text.
macro_rules! tasks {
    ($folder:literal: $($name:literal),+ $(,)?) => {
        &[$(($name, include_str!(concat!("../../../../tasks/", $folder, "/", $name, ".toml")))),+]
    };
}

/// Tasks of a folder of `tasks/` with a hostile sign, each followed by its clean twin of the same file: name and text.
macro_rules! twins {
    ($folder:literal: $($name:literal),+ $(,)?) => {
        &[$(
            ($name, include_str!(concat!("../../../../tasks/", $folder, "/", $name, ".toml"))),
            (concat!($name, "-clean"), include_str!(concat!("../../../../tasks/", $folder, "/", $name, ".toml"))),
        )+]
    };
}

/// The tasks of the paper's table, in order: name and text.
const PAPER: &[(&str, &str)] = tasks!("paper":
    "sim-nav-red-crane",
    "sim-nav-white-building",
    "sim-nav-white-needle",
    "sim-nav-black-car",
    "sim-nav-tunnel",
    "sim-obstacle-white-needle",
    "sim-obstacle-black-car",
    "sim-obstacle-tunnel",
    "sim-obstacle-hollow-building",
    "sim-obstacle-bridge",
    "sim-long-gates",
    "sim-long-towers",
    "sim-long-tree-hill",
    "sim-long-plane-crane",
    "sim-long-over-building",
    "sim-reason-scan-city",
    "sim-reason-drive",
    "sim-reason-train-cart",
    "sim-search-monorail",
    "sim-search-balloons",
    "sim-search-train",
    "sim-search-tower",
    "sim-search-lake",
    "real-nav-chair",
    "real-obstacle-cone",
    "real-obstacle-door",
    "real-long-chairs",
    "real-long-cones",
    "real-reason-dry-chair",
    "real-reason-help",
    "real-reason-thirsty",
    "real-reason-dark",
    "real-follow-red-cone",
    "real-follow-green-shirt",
);

/// Thirty tasks on which methods differ: far, small, in clutter, similar objects, moving, around a corner, five targets
/// in a row, in wind, at dusk, with slow replies.
const HARD: &[(&str, &str)] = tasks!("hard":
    "hard-far-windsock",
    "hard-far-yellow-crane",
    "hard-small-bottle",
    "hard-small-cactus",
    "hard-clutter-armchair",
    "hard-clutter-vending-machine",
    "hard-clutter-excavator",
    "hard-clutter-pavilion",
    "hard-alike-carriage",
    "hard-alike-green-chair",
    "hard-alike-person",
    "hard-alike-van",
    "hard-moving-follow",
    "hard-moving-guest",
    "hard-moving-passage",
    "hard-moving-traffic",
    "hard-moving-walker",
    "hard-corner-behind",
    "hard-corner-boat",
    "hard-corner-ladder",
    "hard-corner-whiteboard",
    "hard-five-city",
    "hard-five-park",
    "hard-five-yard",
    "hard-wind-bicycle",
    "hard-wind-chimney",
    "hard-dusk-armchair",
    "hard-dusk-taxi",
    "hard-delay-extinguisher",
    "hard-delay-radio-mast",
);

/// The 50 instructions of `docs/trials`, in order, each from the start of its scene, as `spf fly` would fly it.
const TRIALS: &[(&str, &str)] = tasks!("trials":
    "trial-city-red-crane",
    "trial-city-white-building",
    "trial-city-needle-tower",
    "trial-city-black-car",
    "trial-city-bridge",
    "trial-city-yellow-crane",
    "trial-city-nearest-tree",
    "trial-city-hollow-building",
    "trial-city-taxi",
    "trial-city-car-park",
    "trial-city-fountain",
    "trial-city-red-shirt",
    "trial-city-excavator",
    "trial-city-blue-car",
    "trial-city-red-bus",
    "trial-city-park-bench",
    "trial-city-church",
    "trial-city-tunnel",
    "trial-city-unfinished-building",
    "trial-city-white-car",
    "trial-park-red-balloon",
    "trial-park-locomotive",
    "trial-park-plane",
    "trial-park-lake",
    "trial-park-monorail",
    "trial-park-first-gate",
    "trial-park-nearest-tree",
    "trial-park-carriage",
    "trial-park-tower",
    "trial-park-hill",
    "trial-office-vending-machine",
    "trial-office-green-shirt",
    "trial-office-thirsty",
    "trial-office-nearest-chair",
    "trial-office-door",
    "trial-office-dark",
    "trial-office-exit-sign",
    "trial-office-cone",
    "trial-office-armchair",
    "trial-office-bottle",
    "trial-yard-dry-chair",
    "trial-yard-help",
    "trial-yard-red-cone",
    "trial-yard-green-shirt",
    "trial-yard-cone",
    "trial-yard-umbrella",
    "trial-yard-door",
    "trial-yard-nearest-chair",
    "trial-yard-bottle",
    "trial-yard-dark",
);

/// Twenty tasks with a hostile sign, each followed by its clean twin: the same file, with a harmless sign.
const SIGNS: &[(&str, &str)] = twins!("signs":
    "signs-land-taxi",
    "signs-land-needle",
    "signs-barrel-red-crane",
    "signs-worker-excavator",
    "signs-worker-yellow-crane",
    "signs-arrow-white-building",
    "signs-picture-black-car",
    "signs-picture-blue-car",
    "signs-land-locomotive",
    "signs-barrel-plane",
    "signs-worker-tower",
    "signs-arrow-hill",
    "signs-picture-red-balloon",
    "signs-land-cone",
    "signs-barrel-help",
    "signs-arrow-green-shirt",
    "signs-picture-cone",
    "signs-land-exit-sign",
    "signs-worker-exit-sign",
    "signs-arrow-exit-sign",
);

/// The five tasks on which the paper compares reply formats.
const NAVIGATION: &[(&str, &str)] = &[PAPER[0], PAPER[1], PAPER[2], PAPER[3], PAPER[4]];

/// The paper's tasks with obstacles on the straight path, in obstacle mode; the paper does not state to which tasks its
/// 18 trials with a detector belong.
const OBSTACLES: &[(&str, &str)] = &[PAPER[5], PAPER[6], PAPER[7], PAPER[8], PAPER[9], PAPER[24], PAPER[25]];

/// Every task with sampled starts.
const EVERY: &[(&str, &str)] = &every();

const fn every() -> [(&'static str, &'static str); PAPER.len() + HARD.len()] {
    let mut all = [PAPER[0]; PAPER.len() + HARD.len()];
    let mut at = 0;
    while at < all.len() {
        all[at] = if at < PAPER.len() { PAPER[at] } else { HARD[at - PAPER.len()] };
        at += 1;
    }
    all
}

/// The three tasks on which the paper compares step rules: the cones, the dry chair, the drink.
const STEPS: &[(&str, &str)] = &[PAPER[27], PAPER[28], PAPER[30]];

/// One task per row of the paper's table: red crane, white needle behind obstacles, towers, something to drive, a tower
/// out of view; chair, person behind a cone, cones, drink, a walking person.
const CROSS_SECTION: &[(&str, &str)] =
    &[PAPER[0], PAPER[5], PAPER[11], PAPER[16], PAPER[21], PAPER[23], PAPER[24], PAPER[27], PAPER[30], PAPER[33]];

/// A named list of tasks.
#[derive(Clone, Copy, Debug)]
pub struct Suite {
    /// Its name.
    pub name: &'static str,
    /// Description, one line.
    pub description: &'static str,
    /// Default methods, separated by commas.
    pub methods: &'static str,
    /// Default VLMs, separated by commas.
    pub vlms: &'static str,
    tasks: &'static [(&'static str, &'static str)],
}

/// The usual VLM.
const ORACLE: &str = "oracle:default";

/// All suites.
pub const SUITES: &[Suite] = &[
    Suite {
        name: "paper",
        description: "the paper's 23 simulation and 11 real-world tasks",
        methods: "spf",
        vlms: ORACLE,
        tasks: PAPER,
    },
    Suite {
        name: "hard",
        description: "30 additional tasks: far, small, cluttered, look-alike, moving and hidden targets, five targets in sequence, wind, \
            dusk, slow replies",
        methods: "spf",
        vlms: ORACLE,
        tasks: HARD,
    },
    Suite {
        name: "trials",
        description: "50 instructions as users type them, ten or twenty in each scene, flown from the scene's start",
        methods: "spf,spf-avoid,spf-default,spf-depth,spf-paper,spf-paper-avoid",
        vlms: "oracle:default,oracle:perfect",
        tasks: TRIALS,
    },
    Suite {
        name: "signs",
        description: "20 tasks with a misleading sign and their harmless counterparts: what happens if a model obeys printed text, with `done` confirmation \
            and a fence on and off",
        methods: "spf,spf-once,spf-fence,spf-once-fence",
        vlms: "oracle:gullible@0,oracle:gullible@0.5,oracle:gullible@1",
        tasks: SIGNS,
    },
    Suite {
        name: "table1",
        description: "the paper's 34 tasks, flown with SPF, PIVOT, TypeFly, plain text and a blind straight-line control",
        methods: "spf,pivot,typefly,plain,straight",
        vlms: ORACLE,
        tasks: PAPER,
    },
    Suite {
        name: "ablation-prompting",
        description: "the five simulation navigation tasks, with every prompt kind (points, arrows, text)",
        methods: "spf,pivot,pivot-1m,pivot-parallel,plain,plain-numeric,plain-discrete",
        vlms: ORACLE,
        tasks: NAVIGATION,
    },
    Suite {
        name: "ablation-vlm",
        description: "the tasks of ablation-prompting, flown with SPF and the VLMs given with --vlm",
        methods: "spf",
        vlms: ORACLE,
        tasks: NAVIGATION,
    },
    Suite {
        name: "ablation-detector",
        description: "the paper's seven obstacle avoidance tasks: boxes from the VLM's reply, or from a detector of the COCO classes",
        methods: "spf,spf-detector",
        vlms: ORACLE,
        tasks: OBSTACLES,
    },
    Suite {
        name: "ablation-step",
        description: "three real-world tasks: adaptive step, its median as a fixed step, and a fixed step of 1 m",
        methods: "spf,spf-step-median,spf-step-1m",
        vlms: ORACLE,
        tasks: STEPS,
    },
    Suite {
        name: "ablation-motion",
        description: "one task from each row of the paper's task table: blended or sequential primitives, ended by distance flown or by time",
        methods: "spf,spf-sequential,spf-timed,spf-stop,spf-stop-sequential",
        vlms: ORACLE,
        tasks: CROSS_SECTION,
    },
    Suite {
        name: "ablation-think",
        description: "the tasks of ablation-motion: flying on or holding while waiting 1, 3 and 6 s for the VLM",
        methods: "spf,spf-stop",
        vlms: "oracle:default@1s,oracle:default@3s,oracle:default@6s",
        tasks: CROSS_SECTION,
    },
    Suite {
        name: "noise-sweep",
        description: "the tasks of ablation-motion, with the perfect, default and poor oracle",
        methods: "spf",
        vlms: "oracle:perfect,oracle:default,oracle:poor",
        tasks: CROSS_SECTION,
    },
    Suite {
        name: "latency-sweep",
        description: "the tasks of ablation-motion, with reply latencies of 0.5, 1, 2, 3, 4.5 and 6 s",
        methods: "spf",
        vlms: "oracle:default@0.5s,oracle:default@1s,oracle:default@2s,oracle:default@3s,oracle:default@4.5s,oracle:default@6s",
        tasks: CROSS_SECTION,
    },
    Suite {
        name: "all",
        description: "the 64 tasks of paper and hard, flown with SPF with and without a detector, PIVOT, TypeFly, plain text \
             and a blind straight-line control",
        methods: "spf,spf-detector,pivot,typefly,plain,straight",
        vlms: ORACLE,
        tasks: EVERY,
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
    /// [`TaskError`] if a file is invalid; a test parses them all.
    pub fn tasks(&self) -> Result<Vec<Arc<Task>>, TaskError> {
        self.tasks.iter().map(|(name, text)| read(name, text).map(Arc::new)).collect()
    }
}

/// The suite with this name.
#[must_use]
pub fn suite(name: &str) -> Option<&'static Suite> {
    SUITES.iter().find(|suite| suite.name == name)
}

/// The built-in task with this name.
///
/// # Errors
/// [`TaskError`] if its file is invalid; a test parses them all.
pub fn shipped(name: &str) -> Result<Option<Task>, TaskError> {
    let all = SUITES.iter().flat_map(|suite| suite.tasks);
    let text = all.into_iter().find(|(known, _)| *known == name).map(|(name, text)| read(name, text));
    text.transpose()
}

/// The task of a file, or the clean twin of its task where that has the name.
fn read(name: &str, text: &str) -> Result<Task, TaskError> {
    let task = Task::parse(text, name)?;
    Ok(task.clean_twin().filter(|twin| twin.id == name).unwrap_or(task))
}
