use spf_core::tags::Tagged;

use super::*;

fn tagged(id: u16, names: &[&str], colour: Option<&str>, kind: &str) -> Tagged {
    Tagged {
        id,
        key: format!("object_{id}"),
        names: names.iter().map(|name| (*name).to_owned()).collect(),
        colour: colour.map(str::to_owned),
        kind: kind.to_owned(),
        ..Tagged::default()
    }
}

fn read(instruction: &str) -> InstructionReading {
    let tags = [
        tagged(1, &["tower crane"], Some("red"), "crane"),
        tagged(2, &["car"], Some("blue"), "car"),
        tagged(3, &["church"], None, "building"),
        tagged(4, &["bus_green"], None, "object"),
        tagged(5, &["bus_red"], None, "object"),
        tagged(6, &["bridge"], Some("beige"), "bridge"),
    ];
    let objects: Vec<Placed<'_>> = tags.iter().map(|tags| Placed { tags, place: None }).collect();
    read_instruction(instruction, &objects, None)
}

fn corrections(reading: &InstructionReading) -> Vec<(&str, &str)> {
    reading.corrections.iter().map(|c| (c.written.as_str(), c.read.as_str())).collect()
}

#[test]
fn slips_of_people_in_a_hurry_are_put_right_and_shown() {
    for (message, target, object, shown) in [
        ("GO TO TEH RED CRAN", "red crane", 1, vec![("teh", "the"), ("cran", "crane")]),
        ("flyy to the bleu car pls", "blue car", 2, vec![("flyy", "fly"), ("bleu", "blue")]),
        ("hed for the churhc", "church", 3, vec![("hed", "head"), ("churhc", "church")]),
        ("Go to the brige", "bridge", 6, vec![("brige", "bridge")]),
    ] {
        let reading = read(message);
        assert_eq!(reading.steps.len(), 1, "{message}: {reading:?}");
        assert_eq!((reading.steps[0].target.as_str(), &reading.steps[0].candidates), (target, &vec![object]), "{message}");
        for pair in shown {
            assert!(corrections(&reading).contains(&pair), "{message}: {reading:?}");
        }
    }
}

#[test]
fn names_of_models_are_read_head_first_too() {
    assert_eq!(read("fly to the green bus").steps[0].candidates, [4]);
    assert_eq!(read("fly to the bus").steps[0].candidates, [4, 5]);
}

#[test]
fn what_is_known_but_absent_is_understood_and_what_is_not_is_named() {
    let absent = read("fly to the elephant");
    assert!(absent.is_understood() && absent.steps[0].candidates.is_empty() && absent.corrections.is_empty(), "{absent:?}");
    let nonsense = read("fly to the qwertzuiop");
    assert!(!nonsense.is_understood() && nonsense.steps[0].unknown[0].word == "qwertzuiop", "{nonsense:?}");
    assert!(!read("???").is_understood() && !read("blarg").is_understood());
    let both = read("fly to the church, then to the zzgrmpf");
    assert!(both.is_understood() && both.steps[0].is_understood() && !both.steps[1].is_understood(), "{both:?}");
}

#[test]
fn a_word_that_nobody_knows_is_passed_over_beside_a_thing_and_named() {
    let ignored = |reading: &InstructionReading| -> Vec<String> { reading.ignored.iter().map(|w| w.word.clone()).collect() };
    for (message, object, passed_over) in [
        ("fly to the wonky crane", 1, "wonky"),
        ("go to 2j the red crane", 1, "2j"),
        ("the blue car zzgrmpf", 2, "zzgrmpf"),
        ("fly to the church next to the blorb", 3, "blorb"),
    ] {
        let reading = read(message);
        assert!(reading.is_understood(), "{message}: {reading:?}");
        assert_eq!((&reading.steps[0].candidates, ignored(&reading)), (&vec![object], vec![passed_over.to_owned()]), "{message}");
    }
    // Exclusions are kept: a colour, a name, and words known to mean something else.
    for message in ["fly to the wonky green crane", "fly to the Hilton church", "go to the police car"] {
        assert!(read(message).steps[0].candidates.is_empty(), "{message}: {:?}", read(message));
    }
    assert_eq!(read("fly to the chuurrcch crane").ignored[0].nearest.as_deref(), Some("church"));
}

#[test]
fn what_is_right_as_it_stands_is_put_right_to_nothing() {
    for message in ["go to the lady", "go to the shirt", "go to the printer", "would you mind going to the vending machine"] {
        assert!(read(message).corrections.is_empty(), "{message}: {:?}", read(message));
    }
}

#[test]
fn a_slip_of_the_verb_of_flying_is_put_right_where_a_verb_stands() {
    for (message, shown) in [
        ("flie to the church", ("flie", "fly")),
        ("fligh to the church", ("fligh", "fly")),
        ("haed to the church", ("haed", "head")),
    ] {
        let reading = read(message);
        assert_eq!((reading.steps.len(), &reading.steps[0].candidates), (1, &vec![3]), "{message}: {reading:?}");
        assert!(corrections(&reading).contains(&shown), "{message}: {reading:?}");
    }
    // In the place of a noun it is none.
    assert!(corrections(&read("go to the flie")).iter().all(|(_, read)| *read != "fly"));
}

#[test]
fn a_time_of_day_is_no_misspelt_object() {
    let tags = [tagged(1, &["church"], None, "building"), tagged(2, &["duck"], None, "animal")];
    let objects: Vec<Placed<'_>> = tags.iter().map(|tags| Placed { tags, place: None }).collect();
    for message in [
        "go to the church at dusk",
        "go to the church at night",
        "at dawn, fly to the church",
        "fly to the church in the early morning",
        "visit the church before sunset",
        "go to the church tonight",
        "go to the church at 5 pm",
        "go to the church by 11am",
    ] {
        let reading = read_instruction(message, &objects, None);
        assert!(reading.corrections.is_empty() && reading.steps.len() == 1, "{message}: {reading:?}");
        assert_eq!(reading.steps[0].candidates, [1], "{message}: {reading:?}");
    }
    let duck = read_instruction("go to the duk", &objects, None);
    assert!(duck.steps.iter().all(|step| step.candidates != [1]), "{duck:?}");
}

#[test]
fn what_is_mostly_another_language_is_not_flown() {
    for message in [
        "geh zum roten Auto",
        "flieg bitte zum Bus",
        "va a la iglesia",
        "vole vers la voiture rouge",
        "vai alla chiesa",
        "ga naar de church",
        "飞到红色的汽车",
        "лети к церкви",
    ] {
        let reading = read(message);
        assert!(reading.is_foreign && !reading.is_understood(), "{message}: {reading:?}");
    }
    for message in
        ["GO TO TEH RED CRAN", "fly to the wonky crane", "fly to La Scala church", "flyy to the bleu car pls", "church", "go"]
    {
        assert!(!read(message).is_foreign, "{message}: {:?}", read(message));
    }
}

#[test]
fn a_place_told_by_an_object_is_this_object() {
    // What else stands there is not meant.
    let tags =
        [tagged(1, &["church"], None, "building"), tagged(2, &["tree"], None, "tree"), tagged(3, &["bench"], None, "furniture")];
    let place = |east: f64, north: f64| crate::Place {
        centre: spf_core::geometry::EnuPosition { east, north, up: 1.0 },
        height: 2.0,
        width: 2.0,
    };
    let places = [place(0.0, 50.0), place(0.0, 40.0), place(1.0, 41.0)];
    let objects: Vec<Placed<'_>> = tags.iter().zip(places).map(|(tags, place)| Placed { tags, place: Some(place) }).collect();
    let from = spf_core::geometry::Pose::default();
    for (message, object) in [
        ("fly in front of the church", 1),
        ("stop in front of the church", 1),
        ("go to the front of the church", 1),
        ("hover right beside the church", 1),
        ("fly to the left of the church", 1),
        ("land on top of the church", 1),
        ("in front of the church", 1),
        ("fly to the bench in front of the church", 3),
        ("the tree in front of the church", 2),
    ] {
        let reading = read_instruction(message, &objects, Some(from));
        assert_eq!(reading.steps.last().unwrap().candidates, [object], "{message}: {reading:?}");
    }
}

#[test]
fn a_look_around_needs_no_target() {
    let reading = read("look around");
    assert!(reading.is_understood() && reading.steps[0].verb == Verb::Scan && reading.steps[0].target.is_empty());
}

/// The reading in a scene with people and numbered objects: steps as verb and candidates.
fn steps(instruction: &str) -> Vec<(Verb, Vec<u16>)> {
    let mut tags = vec![
        tagged(1, &["person", "man"], Some("red"), "person"),
        tagged(2, &["person", "woman"], Some("yellow"), "person"),
        tagged(3, &["person", "man"], Some("white"), "person"),
        tagged(4, &["gate", "first gate", "gate 1"], Some("red"), "gate"),
        tagged(5, &["gate", "second gate", "gate 2"], Some("blue"), "gate"),
        tagged(6, &["whiteboard", "board"], Some("white"), "furniture"),
        tagged(7, &["kiosk", "stall"], Some("green"), "building"),
        tagged(8, &["bin"], Some("blue"), "bin"),
        tagged(9, &["tree"], None, "tree"),
        tagged(10, &["fountain"], None, "structure"),
        tagged(11, &["bench"], None, "furniture"),
    ];
    tags[1].qualities = vec!["walking".to_owned()];
    tags[2].synonyms = vec!["man with a cone".to_owned()];
    tags[10].uses = vec!["sit".to_owned()];
    let objects: Vec<Placed<'_>> = tags.iter().map(|tags| Placed { tags, place: None }).collect();
    read_instruction(instruction, &objects, None).steps.into_iter().map(|step| (step.verb, step.candidates)).collect()
}

#[test]
fn terse_phrasings_are_understood() {
    use Verb::{Follow, GoTo, Through};
    type Case = (&'static str, &'static [(Verb, &'static [u16])]);
    let cases: &[Case] = &[
        ("show me the stall up close", &[(GoTo, &[7])]),
        ("whats that green stall doing over there, go have a look", &[(GoTo, &[7])]),
        ("get a shot of the fountain plz", &[(GoTo, &[10])]),
        ("go to the fountain and take a photo of it", &[(GoTo, &[10]), (GoTo, &[10])]),
        ("can u take me to the bin pls mate", &[(GoTo, &[8])]),
        ("i need to get to the fountain, quick", &[(GoTo, &[10])]),
        ("i wanna see the tree", &[(GoTo, &[9])]),
        ("wheres the fountain", &[(GoTo, &[10])]),
        ("bin", &[(GoTo, &[8])]),
        ("blue trash can", &[(GoTo, &[8])]),
        ("flyto thefountain", &[(GoTo, &[10])]),
        ("the little snack stand with the stripy roof", &[(GoTo, &[7])]),
        ("go to the bloke in white carrying a cone", &[(GoTo, &[3])]),
        ("the lady in the yellow top walking around", &[(GoTo, &[2])]),
        ("who is that in the red jumper? follow him", &[(GoTo, &[1]), (Follow, &[1])]),
        ("somebody in a red jumper", &[(GoTo, &[1])]),
        ("fly thru gate nr 2", &[(Through, &[5])]),
        ("through gate 1 then gate two", &[(Through, &[4]), (Through, &[5])]),
        ("go through gate 7", &[(Through, &[])]),
        ("fly to the white board", &[(GoTo, &[6])]),
        ("somewhere to sit near the fountain", &[(GoTo, &[11])]),
        ("fly to the bin, is there somebody in there", &[(GoTo, &[8])]),
        ("lets go and have a look at the tree", &[(GoTo, &[9])]),
        ("would you mind going to the bin and stopping in front of it", &[(GoTo, &[8]), (GoTo, &[8])]),
        ("the fountain thingy", &[(GoTo, &[10])]),
        ("theres a red guy standing at the bin", &[(GoTo, &[1])]),
        ("i was wondering whether you could get me a nice shot of the fountain", &[(GoTo, &[10])]),
        ("get in close to the tree", &[(GoTo, &[9])]),
        ("that fountain looks cool, go there", &[(GoTo, &[10])]),
        ("see the guy in white? go to him", &[(GoTo, &[3]), (GoTo, &[3])]),
        ("the green thing with the long arm", &[(GoTo, &[7])]),
        ("i dont mean the tree, i mean the fountain", &[(GoTo, &[10])]),
        ("look at the person in yellow from above", &[(GoTo, &[2])]),
        ("go to the person in yellow quickly", &[(GoTo, &[2])]),
        ("go to the person in pink from above", &[(GoTo, &[])]),
        ("if you see a bin go to the fountain", &[(GoTo, &[10])]),
        ("if you see a bin, go to the fountain", &[(GoTo, &[10])]),
        ("if you see a bin go to it", &[(GoTo, &[8])]),
        ("if you see a bus stop at the fountain go to the tree", &[(GoTo, &[9])]),
        ("if you see the fountain, fly to it", &[(GoTo, &[10])]),
        ("if there is a man in white follow him", &[(Follow, &[3])]),
        ("go to the red or the blue gate", &[(GoTo, &[4, 5])]),
        ("go to the tree or the bin", &[(GoTo, &[8, 9])]),
        ("fly to the fountain or go to the tree", &[(GoTo, &[9, 10])]),
        ("go to a bin or a tree or the bench", &[(GoTo, &[8, 9, 11])]),
        ("fly through the red gate, no wait, the blue one", &[(Through, &[5])]),
        ("go to the tree, sorry, i mean the bin", &[(GoTo, &[8])]),
        ("go to the bin. no, wait, go to the tree", &[(GoTo, &[9])]),
        ("go to the bench, i mean the bin", &[(GoTo, &[8])]),
    ];
    let read: Vec<String> = cases
        .iter()
        .filter(|(message, right)| !steps(message).iter().map(|(verb, of)| (*verb, of.as_slice())).eq(right.iter().copied()))
        .map(|(message, right)| format!("{message}: {:?}, not {right:?}", steps(message)))
        .collect();
    assert!(read.is_empty(), "{}", read.join("\n"));
}

#[test]
fn a_direction_is_no_thing_to_fly_to() {
    for message in [
        "fly north 20 metres",
        "fly forward 20m",
        "go up a bit",
        "turn left 90 degrees",
        "please move back two metres",
        "ascend 5 m",
        "fly to the left",
    ] {
        let reading = read(message);
        assert!(!reading.is_understood() && reading.directions.len() == 1, "{message}: {reading:?}");
    }
    for message in ["go up to the church", "turn around", "fly left of the church", "fly forward to the crane"] {
        assert!(read(message).directions.is_empty() && read(message).is_understood(), "{message}: {:?}", read(message));
    }
    let both = read("fly forward 10 metres, then go to the church");
    assert!(both.is_understood() && both.directions == ["fly forward 10 metres"], "{both:?}");
    assert_eq!(both.steps[0].candidates, [3]);
}

#[test]
fn an_instruction_without_a_flight_ends_at_once() {
    for message in [
        "what should i cook tonight",
        "play some music",
        "make me a sandwich",
        "tell me a joke",
        "divide 17 by 4",
        "what is the capital of france",
        "do my maths homework pls",
        "blah blah blubb",
        "asdf jkl hhhh",
        // No minute, and not everywhere, is a thing that one could look for.
        "hover for a minute",
        "go everywhere except the bridge",
        "fly to the music",
    ] {
        assert!(!read(message).is_understood(), "{message}: {:?}", read(message));
    }
    // An absent target is searched for.
    for message in
        ["is there a bicycle anywhere? go to it", "fly to the windmill", "find me a printer", "somewhere to pray", "hotel"]
    {
        assert!(read(message).is_understood(), "{message}: {:?}", read(message));
    }
}

#[test]
fn where_a_thing_is_not_here_the_nearest_in_meaning_is_named() {
    assert_eq!(read("fly to the ambulance").steps[0].alike, ["blue car", "bus_green", "bus_red"]);
    assert!(read("fly to the elephant").steps[0].alike.is_empty());
}

proptest::proptest! {
    #[test]
    fn any_order_of_everyday_phrases_is_parsed(words in proptest::collection::vec(proptest::sample::select(vec![
        "whats", "who", "is", "that", "the", "red", "crane", "church", "doing", "parked", "sat", "with", "on", "it", "him",
        "somebody", "in", "a", "jumper", "go", "have", "look", "2", "nr", "two", "wonky", "north", "20m", ",", ".", "one", "way",
        "out", "near", "somewhere", "to", "sit", "flyto", "w/", "inside", "where", "can", "i", "over", "carrying", "then",
    ]), 0..24)) {
        let reading = read(&words.join(" "));
        for step in &reading.steps {
            proptest::prop_assert!(step.candidates.iter().all(|id| (1..=6).contains(id)));
        }
        // The result is the same on every call.
        proptest::prop_assert_eq!(&reading, &read(&words.join(" ")));
    }
}

proptest::proptest! {
    #[test]
    fn any_text_is_read(text in "\\PC{0,120}") {
        let reading = read(&text);
        for step in &reading.steps {
            proptest::prop_assert!(step.candidates.iter().all(|id| (1..=6).contains(id)));
        }
    }
}

#[test]
fn a_shape_is_a_motion_and_a_square_with_its_article_a_place() {
    let tags = [
        tagged(1, &["plaza", "square"], None, "plaza"),
        tagged(2, &["fountain"], None, "fountain"),
        tagged(3, &["table"], None, "table"),
    ];
    let objects: Vec<Placed<'_>> = tags.iter().map(|tags| Placed { tags, place: None }).collect();
    let read = |message: &str| read_instruction(message, &objects, None);
    for message in
        ["fly in a square", "fly a big square", "draw two circles", "fly in circles please", "fly a figure of eight", "zigzag"]
    {
        let reading = read(message);
        assert!(!reading.is_understood() && reading.directions.len() == 1, "{message}: {reading:?}");
    }
    for (message, object) in [
        ("fly to the square", 1),
        ("cross the square", 1),
        ("go to a square", 1),
        ("circle the fountain", 2),
        ("fly a circle around the fountain", 2),
        ("fly to the fountain in a big square", 2),
        ("go to the square table", 3),
    ] {
        assert_eq!(read(message).steps[0].candidates, [object], "{message}: {:?}", read(message));
    }
}

#[test]
fn a_place_without_an_object_of_its_own_is_where_its_objects_are() {
    let within = |id: u16, name: &str, group: &str| Tagged { group: Some(group.to_owned()), ..tagged(id, &[name], None, name) };
    let mut tags = [
        within(1, "table", "meeting room"),
        within(2, "whiteboard", "meeting room"),
        within(3, "chair", "break room"),
        within(4, "chair", "office"),
        tagged(5, &["sign", "break room"], None, "sign"),
        within(6, "plant", "corridor"),
        within(7, "plant", "office"),
    ];
    Tagged::represent_groups(&mut tags);
    let objects: Vec<Placed<'_>> = tags.iter().map(|tags| Placed { tags, place: None }).collect();
    for (message, meant) in [
        ("the meeting room", &[1, 2][..]),
        ("go to the meeting room", &[1, 2]),
        ("fly to the break room", &[5]),
        ("fly to the chair in the break room", &[3]),
        ("go to the plant in the hall", &[6]),
    ] {
        let reading = read_instruction(message, &objects, None);
        assert_eq!(reading.steps[0].candidates, meant, "{message}: {reading:?}");
    }
}

#[test]
fn what_an_unknown_thing_stands_on_is_kept_and_a_dash_separates() {
    let tags =
        [tagged(1, &["bottle"], None, "bottle"), tagged(2, &["table"], None, "table"), tagged(3, &["bus"], Some("red"), "bus")];
    let objects: Vec<Placed<'_>> = tags.iter().map(|tags| Placed { tags, place: None }).collect();
    let bottle = parse("bottle of quixley on the table", &vocabulary(objects.iter().map(|o| o.tags)));
    let target = &bottle.clauses[0].target;
    assert!(target.relations.iter().any(|(_, anchors)| anchors[0].nouns == ["table"]), "{target:?}");
    let dash = read_instruction("nice bottle - go to the bus", &objects, None);
    assert_eq!(dash.steps.last().unwrap().candidates, [3], "{dash:?}");
}
