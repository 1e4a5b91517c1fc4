//! Stages: what an answer points at, and when the next one begins.

use super::*;

#[test]
fn stages_advance_one_an_answer_and_end_with_the_last() {
    let oracle = oracle("perfect");
    let painting = Painting::new().with(tagged(1, "car", "vehicle", "black"), 430..530, 310..410, 2.0).with(
        tagged(2, "tree", "tree", "green"),
        700..800,
        100..400,
        30.0,
    );
    let mut query = query(0, POINT, "fly to the car and then to the tree");
    let reply = ask(&oracle, &painting, &query);
    assert_eq!((reply.status, reply.stage, reply.target.as_deref()), (Status::Navigating, Some(2), Some("green tree")));
    query.memory.stage = 2;
    assert_eq!(ask(&oracle, &painting, &query).stage, Some(2));
    query.instruction = "fly to the tree and then to the car".to_owned();
    assert_eq!(ask(&oracle, &painting, &query).status, Status::Done);
}

fn stage(verb: language::Verb, objects: &[u16], other: bool) -> BriefStage {
    BriefStage { verb, objects: objects.to_vec(), other, name: "thing".to_owned(), appearances: Vec::new() }
}

fn briefed(stages: Vec<BriefStage>) -> Oracle {
    oracle("perfect").with_brief(Some(Arc::new(Brief { stages, signs: Vec::new() })))
}

#[test]
fn a_brief_takes_the_place_of_the_words() {
    use language::Verb::{GoTo, Scan};
    // Whatever the instruction says, in whatever language.
    for words in ["fly to the red crane", "flieg zum roten Kran", "make me a sandwich", ""] {
        let reply = ask(&briefed(vec![stage(GoTo, &[2], false)]), &site(), &query(0, POINT, words));
        assert_eq!((reply.status, reply.target.as_deref()), (Status::Navigating, Some("yellow crane")), "{words}");
        let absent = ask(&briefed(vec![stage(GoTo, &[9], false)]), &site(), &query(0, POINT, words));
        assert_eq!((absent.status, absent.target.as_deref()), (Status::NotVisible, Some("thing")), "{words}");
    }
    let scan = ask(&briefed(vec![stage(Scan, &[], false)]), &site(), &query(0, POINT, "fly to the red crane"));
    assert_eq!((scan.status, scan.look, scan.target.as_deref()), (Status::NotVisible, Some(Look::Right), Some("surroundings")));
}

#[test]
fn with_a_brief_another_object_is_none_of_an_earlier_stage() {
    let painting = Painting::new().with(tagged(1, "cone", "cone", "orange"), 430..530, 310..410, 2.0).with(
        tagged(2, "cone", "cone", "orange"),
        700..730,
        340..380,
        12.0,
    );
    let go = |objects: &[u16], other: bool| stage(language::Verb::GoTo, objects, other);
    // Both count in both stages: from the first, which is near, the other one.
    let mut query = query(0, POINT, "");
    query.memory.targets = vec!["orange cone".to_owned()];
    let reply = ask(&briefed(vec![go(&[1, 2], false), go(&[1, 2], true)]), &painting, &query);
    assert_eq!((reply.stage, reply.target.as_deref()), (Some(2), Some("next orange cone")));
    assert!(reply.point.unwrap().u > 0.7, "{reply:?}");
    // Without it, the largest.
    let reply = ask(&briefed(vec![go(&[1, 2], false), go(&[1, 2], false)]), &painting, &query);
    assert!((reply.point.unwrap().u - 0.5).abs() < 0.01, "{reply:?}");
}

#[test]
fn a_program_for_a_brief_knows_name_and_colour_alone() {
    let of = |appearance: spf_core::detection::Appearance| {
        let oracle = briefed(vec![BriefStage { appearances: vec![appearance], ..stage(language::Verb::GoTo, &[1], false) }]);
        let mut query = query(0, QueryKind::Program, "");
        query.detections = vec![
            "car_7 x:0.30 y:0.50 width:0.10 height:0.10 color:black".to_owned(),
            "car_8 x:0.70 y:0.50 width:0.20 height:0.20 color:white".to_owned(),
        ];
        oracle.answer(&query, &site().percept(&oracle, 0)).text
    };
    let car = |colour: Option<&str>| spf_core::detection::Appearance {
        names: vec!["van".to_owned(), "car".to_owned()],
        colour: colour.map(str::to_owned),
    };
    assert!(of(car(Some("black"))).contains("'car_7'") && of(car(None)).contains("'car_8'"));
    assert_eq!(of(car(Some("red"))), "_1=s('red thing');?_1==False{->False;}rp;");
}

/// An answer after which the craft has turned.
fn answered(said: Said, turned_deg: f64) -> PastAnswer {
    PastAnswer {
        said,
        target: None,
        bearing_deg: None,
        range_m: None,
        asked_deg: None,
        planned_m: None,
        planned_deg: None,
        detour: None,
        actions: Vec::new(),
        motion: Some(Motion { turned_deg, ..Motion::default() }),
    }
}

#[test]
fn through_goes_by_the_opening() {
    let oracle = oracle("perfect");
    let mouth = |id: u16, name: &str| Tagged {
        opening: true,
        opening_of: Some("tunnel_1".to_owned()),
        ..tagged(id, name, "opening", "")
    };
    let solid = tagged(1, "tunnel", "structure", "grey");
    let painting = Painting::new()
        .with(solid.clone(), 200..700, 200..500, 20.0)
        .with(mouth(2, "tunnel mouth"), 400..500, 350..450, 20.0)
        .with(mouth(3, "tunnel exit"), 440..460, 390..410, 60.0);
    let mut query = query(0, POINT, "fly through the tunnel in front of you");
    let reply = ask(&oracle, &painting, &query);
    assert_eq!((reply.stage, reply.target.as_deref()), (Some(1), Some("tunnel mouth")));
    // Inside, the exit is the next target.
    query.memory.stage = 2;
    let inside = Painting::new().with(solid, 0..960, 0..720, 5.0).with(mouth(3, "tunnel exit"), 440..520, 350..420, 20.0);
    let reply = ask(&oracle, &inside, &query);
    assert_eq!((reply.stage, reply.target.as_deref()), (Some(2), Some("tunnel exit")));
    // Out of it nothing of the tunnel is in view: straight on for four moves more, then done.
    let out = Painting::new().with(tagged(5, "tree", "tree", "green"), 700..800, 100..400, 30.0);
    assert_eq!(ask(&oracle, &out, &query).stage, Some(3));
    // Whoever has turned away from it instead looks back, once.
    for (said, turned_deg, look) in
        [(Said::Pointed, -36.0, Some(Look::Right)), (Said::Pointed, 36.0, Some(Look::Left)), (Said::NotSeen, 36.0, None)]
    {
        query.memory.answers = vec![answered(said, turned_deg)];
        let reply = ask(&oracle, &out, &query);
        assert_eq!((reply.look, reply.stage), (look, Some(if look.is_some() { 2 } else { 3 })), "{said:?} {turned_deg}");
    }
    query.memory.answers.clear();
    query.memory.stage = 3;
    assert_eq!(ask(&oracle, &out, &query).stage, Some(4));
    query.memory.stage = 7;
    assert_eq!(ask(&oracle, &out, &query).status, Status::Done);
    // If something else follows, one move is enough: it may be in the way of the others.
    query.instruction = "fly through the tunnel and then to the tree".to_owned();
    query.memory.stage = 4;
    let reply = ask(&oracle, &out, &query);
    assert_eq!((reply.status, reply.stage, reply.target.as_deref()), (Status::Navigating, Some(5), Some("green tree")));
}

#[test]
fn right_in_an_opening_one_flies_on_and_no_building_passes_for_a_hollow_one() {
    let oracle = oracle("perfect");
    let out = Painting::new().with(tagged(5, "tree", "tree", "green"), 700..800, 100..400, 30.0);
    let mut query = query(0, POINT, "fly through the gate");
    query.memory.targets = vec!["opening".to_owned()];
    let reply = ask(&oracle, &out, &query);
    assert_eq!((reply.status, reply.stage), (Status::Navigating, Some(2)));
    // After a search, the craft is not inside it.
    query.memory.turned = 1.2;
    assert_eq!(ask(&oracle, &out, &query).status, Status::NotVisible);

    let school = tagged(1, "building", "building", "brown");
    let near = Painting::new().with(school.clone(), 100..800, 100..600, 2.0);
    query.memory = Memory::default();
    query.instruction = "fly through the hollow building".to_owned();
    assert_eq!(ask(&oracle, &near, &query).status, Status::NotVisible);
    let hollow = Tagged { qualities: vec!["hollow".to_owned()], ..school };
    let far = Painting::new().with(hollow.clone(), 300..500, 200..400, 40.0);
    assert_eq!(ask(&oracle, &far, &query).status, Status::Navigating);
    // Reached without seeing an opening: not flown into.
    let near = Painting::new().with(hollow, 100..800, 100..600, 2.0);
    assert_eq!(ask(&oracle, &near, &query).status, Status::NotVisible);
}

#[test]
fn who_goes_round_keeps_to_what_he_began_with_and_no_longer() {
    let oracle = oracle("perfect");
    let tree = |id, colour: &str| tagged(id, "tree", "tree", colour);
    let two = Painting::new().with(tree(1, "green"), 100..200, 200..500, 9.0).with(tree(2, "red"), 500..900, 100..600, 9.0);
    let mut query = query(0, POINT, "go around the tree, then go around the tree");
    // Beside it, with the green one begun: the larger red one is not mistaken for it.
    query.memory.stage = 7;
    query.memory.targets = ["green tree", "left of the green tree", "straight on", "tree"].map(str::to_owned).to_vec();
    assert_eq!(ask(&oracle, &two, &query).target.as_deref(), Some("left of the green tree"));
    // After reaching another one, that one is circled.
    query.memory.targets.push("red tree".to_owned());
    assert_eq!(ask(&oracle, &two, &query).target.as_deref(), Some("left of the red tree"));
}

#[test]
fn the_next_is_another_than_the_one_that_was_gone_to() {
    let oracle = oracle("perfect");
    let painting = Painting::new().with(tagged(1, "tower", "tower", "brown"), 300..500, 100..600, 2.5).with(
        tagged(2, "tower", "tower", "red"),
        700..760,
        200..400,
        40.0,
    );
    let mut query = query(0, POINT, "fly to the first tower and then fly to the second tower");
    query.memory.stage = 1;
    query.memory.targets = vec!["brown tower".to_owned()];
    let reply = ask(&oracle, &painting, &query);
    assert_eq!((reply.stage, reply.target.as_deref()), (Some(2), Some("next red tower")));
    query.memory.stage = 2;
    query.memory.targets.push("next red tower".to_owned());
    assert_eq!(ask(&oracle, &painting, &query).target.as_deref(), Some("next red tower"));
}

#[test]
fn an_earlier_target_that_is_still_ahead_is_not_the_next() {
    let oracle = oracle("perfect");
    let painting = Painting::new().with(tagged(1, "cone", "cone", "orange"), 350..650, 300..700, 0.7).with(
        tagged(2, "cone", "cone", "orange"),
        100..160,
        300..400,
        3.0,
    );
    let mut query = query(0, QueryKind::point(true), "fly to the cone and the next");
    query.memory.stage = 2;
    query.memory.targets = ["orange cone", "next orange cone"].map(str::to_owned).to_vec();
    let finished = |stage: u32, area: Option<ImageBox>, range_m: f64| {
        let place = Some(FinishedPlace { area, bearing_deg: 0.0, elevation_deg: 0.0, range_m });
        vec![FinishedStage { stage, answers_ago: 2, target: Some("orange cone".to_owned()), place }]
    };
    let ahead = Some(ImageBox { left: 0.4, top: 0.4, right: 0.7, bottom: 1.0 });
    let mut pointed = |history: Vec<FinishedStage>| {
        query.memory.finished = history;
        ask(&oracle, &painting, &query).point.map(|point| point.u < 0.3)
    };
    assert_eq!(pointed(finished(1, ahead, 0.6)), Some(true));
    // Nothing is known of where it is; it is out of the image; it is much farther away; the place is that of this stage's target.
    for history in [Vec::new(), finished(1, None, 0.6), finished(1, ahead, 9.0), finished(2, ahead, 0.6)] {
        assert_eq!(pointed(history), Some(false));
    }
    // Nothing else is in view.
    let one = Painting::new().with(tagged(1, "cone", "cone", "orange"), 350..650, 300..700, 0.7);
    query.memory.finished = finished(1, ahead, 0.6);
    assert_eq!(ask(&oracle, &one, &query).status, Status::NotVisible);
}

#[test]
fn what_reaches_into_the_image_may_be_the_earlier_target_beside_it() {
    let oracle = oracle("perfect");
    let painting = Painting::new().with(tagged(1, "tower", "tower", "brown"), 0..150, 0..600, 1.2);
    let mut query = query(0, QueryKind::point(true), "fly to the first tower and then fly to the second tower");
    query.memory.stage = 2;
    query.memory.targets = ["brown tower", "next red tower"].map(str::to_owned).to_vec();
    let mut seen = |bearing_deg: f64| {
        let place = Some(FinishedPlace { area: None, bearing_deg, elevation_deg: 0.0, range_m: 1.6 });
        query.memory.finished = vec![FinishedStage { stage: 1, answers_ago: 9, target: Some("brown tower".to_owned()), place }];
        ask(&oracle, &painting, &query).status
    };
    assert_eq!(seen(-52.0), Status::NotVisible);
    // On the other side, or behind the craft.
    assert_ne!(seen(52.0), Status::NotVisible);
    assert_ne!(seen(-150.0), Status::NotVisible);
}

#[test]
fn a_move_straight_on_counts_once_it_is_flown() {
    let oracle = oracle("perfect");
    let painting = Painting::new();
    let mut query = query(0, POINT, "fly over the building and search the surroundings behind it");
    // The first of ten moves behind the building.
    query.memory.stage = 3;
    let answer = |planned_m: Option<f64>, moved_m: f64| PastAnswer {
        target: Some("straight on".to_owned()),
        planned_m,
        actions: Vec::new(),
        motion: Some(Motion { moved_m, ..Motion::default() }),
        ..answered(Said::Pointed, 0.0)
    };
    let mut stage = |answers: Vec<PastAnswer>, answers_ago: u32| {
        query.memory.answers = answers;
        query.memory.finished = vec![FinishedStage { stage: 2, answers_ago, target: None, place: None }];
        ask(&oracle, &painting, &query).stage
    };
    assert_eq!(stage(vec![answer(Some(4.0), 1.5)], 1), Some(3));
    assert_eq!(stage(vec![answer(Some(4.0), 1.5), answer(Some(4.0), 2.0)], 2), Some(4));
    // What was flown in the stage before does not count.
    assert_eq!(stage(vec![answer(Some(4.0), 4.0), answer(Some(4.0), 0.1)], 1), Some(3));
    // A turn is no move, and what cannot be flown is given up.
    assert_eq!(stage(vec![answer(None, 0.2)], 1), Some(3));
    assert_eq!(stage(vec![answer(Some(4.0), 0.0); 3], 3), Some(4));
    // Nothing is told of answers.
    assert_eq!(stage(Vec::new(), 1), Some(4));
}

#[test]
fn what_is_visible_through_an_opening_determines_how_far_to_fly() {
    let oracle = oracle("perfect");
    let frame = Tagged { opening: true, opening_of: Some("gate_1".to_owned()), ..tagged(2, "opening", "opening", "") };
    let painting = Painting::new()
        .with(tagged(1, "gate", "gate", "red"), 300..660, 200..500, 2.0)
        .with(tagged(3, "wall", "wall", "grey"), 320..640, 220..480, 6.0)
        .with(frame, 320..640, 220..480, 2.0);
    let mut query = query(0, POINT, "fly through the gate");
    query.memory.stage = 2;
    // Not the 2 m of the opening itself (label 2), but the 6 m of the wall behind it: 1 + 4.5·log10 6 = 4.5.
    let depth = ask(&oracle, &painting, &query).depth.unwrap();
    assert!((4..=5).contains(&depth), "{depth}");
}

#[test]
fn a_scan_ends_after_a_full_turn_and_follow_never() {
    let oracle = oracle("perfect");
    let mut scan = query(0, POINT, "take off and scan this city area");
    assert_eq!(ask(&oracle, &site(), &scan).status, Status::NotVisible);
    scan.memory.turned = 6.0;
    assert_eq!(ask(&oracle, &site(), &scan).status, Status::Done);
    let close = Painting::new().with(tagged(1, "person", "person", ""), 430..530, 310..610, 5.0);
    let reply = ask(&oracle, &close, &query(0, POINT, "follow the person"));
    assert_eq!((reply.status, reply.depth), (Status::Following, Some(1)));
    // Nearer than that one keeps away: a person in front blocks the way.
    let closer = Painting::new().with(tagged(1, "person", "person", ""), 430..530, 310..610, 1.0);
    let reply = ask(&oracle, &closer, &query(0, POINT, "follow the person"));
    assert_eq!((reply.status, reply.look, reply.point), (Status::Blocked, None, None));
}
