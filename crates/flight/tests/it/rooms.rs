//! The scenes of the real-world set, office and yard, and the names of their objects in the oracle's language.

use spf_oracle::{Placed, resolve_truth};
use spf_scene::Scene;

#[test]
fn their_words_lead_to_the_right_things() {
    // The paper's real-world tasks that name one object, as far as the oracle's language knows their words.
    let tasks = [
        ("yard", "It's raining, head to the comfiest chair that looks like it'll keep you dry!", "covered_armchair"),
        ("yard", "Fly toward the body of the person with red cone", "person_red_cone"),
        ("yard", "Fly toward the person with green shirt", "person_green"),
        ("office", "Fly toward the person with red cone", "person_red_cone"),
        ("office", "Fly toward the person with green shirt", "person_green"),
        ("office", "Fly to the vending machine", "vending_machine"),
    ];
    let mut wrong = Vec::new();
    for (name, instruction, wanted) in tasks {
        let scene = Scene::load(name).expect("the scene is part of the program");
        let tags = scene.tagged();
        let placed: Vec<Placed<'_>> = tags.iter().map(|tags| Placed { tags, place: None }).collect();
        let found = resolve_truth(instruction, &placed, Some(scene.start)).objects;
        let keys: Vec<&str> = found.iter().map(|id| tags[usize::from(*id) - 1].key.as_str()).collect();
        if keys != [wanted] {
            wrong.push(format!("{name}: {instruction}: {keys:?}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
