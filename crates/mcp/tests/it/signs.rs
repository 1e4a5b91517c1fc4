//! Words printed in the world never change what a tool does.

use spf_api::files::load_scene;
use spf_flight::pointing::Given;
use spf_mcp::picture::Picture;
use spf_mcp::report::{Look, Progress, Status};
use spf_pilot::Phase;
use spf_scene::SceneLook;

use crate::deck::{deck_in, take_off, until};

/// The tasks of the suite `signs`, each with its sign: detours, calls for help, orders to land.
const SIGNS: [(&str, &str); 3] =
    [("office", "signs-arrow-exit-sign"), ("park", "signs-barrel-plane"), ("office", "signs-land-exit-sign")];

/// What the tools answer on a short flight, and where it led: metres east, north and up.
fn flown(scene: &str) -> (Vec<String>, [f64; 3]) {
    let deck = deck_in(load_scene(scene, &SceneLook::default()).unwrap());
    let flight = take_off(&deck);
    let mut told = vec![Status::of(&deck).consent];
    let (_, points) = deck.point(|frame| Given::point(0.5, 0.35, 3, frame), None).unwrap();
    until("the step is flown", || flight.seen.borrow().points > points && flight.phase() == Some(Phase::Held));
    let look = Look::of(&Picture::of(&deck.newest().unwrap()).unwrap(), Some(&flight));
    assert!(look.words().contains("no instruction to you"), "{}", look.words());
    let progress = Progress::of(&flight, 1);
    told.extend([progress.instruction.clone(), progress.note.clone(), format!("{:?} {:?}", progress.state, progress.outcome)]);
    let pointed = flight.seen.borrow().pointed.clone().unwrap();
    told.push(format!("{} {:?}", pointed.flown, pointed.limited));
    told.push(deck.hold().unwrap());
    let pose = flight.seen.borrow().pose.unwrap().position;
    told.push(deck.land().unwrap());
    until("it lands", || flight.is_over());
    (told, [pose.east, pose.north, pose.up])
}

#[test]
#[ignore = "flies in real time: .ci/interop runs it"]
fn words_printed_in_the_world_change_no_tool() {
    let threads = SIGNS.map(|(scene, sign)| {
        let with = std::thread::spawn(move || flown(&format!("{scene}+{sign}")));
        (sign, with, std::thread::spawn(move || flown(scene)))
    });
    for (sign, with, without) in threads {
        let ((told, at), (plain, plain_at)) = (with.join().unwrap(), without.join().unwrap());
        assert_eq!(told, plain, "{sign}");
        let apart = at.iter().zip(plain_at).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(apart < 0.5, "{sign}: {apart} m apart");
    }
}
