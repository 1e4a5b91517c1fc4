//! What can be said in a scene: instructions that the oracle reads whole, and that have been flown.

use serde::Serialize;

/// An instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(super) struct Saying {
    /// What is asked for: "fly to", "follow", …
    pub(super) kind: &'static str,
    /// How hard it is to fly: easy, medium, hard.
    pub(super) difficulty: &'static str,
    pub(super) instruction: &'static str,
}

/// What can be said in a built-in scene; nothing for another one.
pub(super) fn sayings(scene: &str) -> Vec<Saying> {
    let lines = include_str!("say.tsv").lines().filter(|line| !line.starts_with('#'));
    let saying = |line: &'static str| {
        let mut cells = line.split('\t');
        let mut cell = || cells.next().unwrap_or_default();
        (cell() == scene).then(|| Saying { kind: cell(), difficulty: cell(), instruction: cell() })
    };
    lines.filter_map(saying).collect()
}

/// The list for people: one paragraph for each kind.
pub(super) fn text(scene: &str, sayings: &[Saying]) -> String {
    if sayings.is_empty() {
        return format!(
            "\nThere is no list of what can be said in {scene}; `spf sim scenes {scene} --objects` lists what is there.\n"
        );
    }
    let mut text = format!(
        "\nTo the oracle one can say in {scene} (easy, medium, hard; each has been fulfilled with seed 0). In other words too, as long \
         as it uses them all:\n"
    );
    for kind in sayings.chunk_by(|a, b| a.kind == b.kind) {
        text += &format!("\n{}:\n", kind[0].kind);
        for saying in kind {
            text += &format!("  {:<7} {}\n", saying.difficulty, saying.instruction);
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_built_in_scene_has_about_forty_in_all_kinds() {
        for scene in spf_scene::Scene::built_in() {
            let sayings = sayings(scene);
            assert!((35..=50).contains(&sayings.len()), "{scene}: {}", sayings.len());
            assert!(sayings.iter().all(|saying| ["easy", "medium", "hard"].contains(&saying.difficulty)));
            let kinds = sayings.chunk_by(|a, b| a.kind == b.kind).count();
            assert!(kinds >= 6, "{scene}: {kinds} kinds");
            assert!(text(scene, &sayings).contains(sayings[0].instruction));
        }
        assert_eq!(sayings("mine.toml"), []);
    }
}
