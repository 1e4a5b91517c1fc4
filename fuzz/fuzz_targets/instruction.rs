//! Any text as an instruction to the oracle: read in a scene, with candidates from that scene only, and equally every
//! time.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_core::tags::Tagged;
use spf_oracle::{Placed, account, read_instruction, resolve_truth};

fuzz_target!(|text: &str| {
    let tagged = |id, name: &str, colour: &str| Tagged {
        id,
        key: format!("object_{id}"),
        names: vec![name.to_owned()],
        colour: Some(colour.to_owned()),
        kind: name.to_owned(),
        ..Tagged::default()
    };
    let tags = [tagged(1, "tower crane", "red"), tagged(2, "person", "yellow"), tagged(3, "gate 2", "blue")];
    let objects: Vec<Placed<'_>> = tags.iter().map(|tags| Placed { tags, place: None }).collect();
    let reading = read_instruction(text, &objects, None);
    assert!(reading.steps.iter().flat_map(|step| &step.candidates).all(|id| (1..=3).contains(id)));
    assert_eq!(reading, read_instruction(text, &objects, None));
    // Words quoted to the user are in the text, except for white space.
    let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let told = account(text, &objects, None);
    assert!(told.dropped.iter().chain(&told.unused).all(|part| !part.is_empty() && words.contains(part.as_str())));
    let truth = resolve_truth(text, &objects, None);
    assert_eq!(truth.fits, !truth.objects.is_empty());
});
