use super::*;
use spf_core::camera::Camera;
use spf_core::frame::{FrameId, FrameMeta};
use spf_core::geometry::Pose;
use spf_core::primitives::Primitives;
use spf_core::query::VerticalRoom;
use spf_pilot::policy::{Expected, Move};

const CAR: &str = "car_3 x:0.50 y:0.60 width:0.20 height:0.10 color:black";

/// A policy on a Tello, with an instruction.
struct Instructed {
    policy: TypeFly,
    frames: u64,
}

impl Instructed {
    fn new(change: impl FnOnce(&mut TypeFlySettings)) -> Self {
        let mut settings = TypeFlySettings::new(Craft::tello());
        change(&mut settings);
        let mut policy = TypeFly::new(settings);
        assert_eq!(policy.step(PolicyEvent::Instruction("go to the car")), Step::Look);
        Self { policy, frames: 0 }
    }

    fn frame(&mut self) -> Step {
        self.frames += 1;
        let frame = FrameMeta {
            id: FrameId(self.frames),
            captured: Time::from_millis(1000 * self.frames),
            received: Time::from_millis(1000 * self.frames),
            capture_counter: self.frames,
            width: 960,
            height: 720,
            unusable: None,
        };
        self.policy.step(PolicyEvent::Frame(&View {
            frame,
            camera: Camera::tello(),
            pose: Pose::default(),
            at_rest: true,
            expected: Expected::Unknown,
            reckoned: None,
            room: VerticalRoom::default(),
        }))
    }

    fn reply(&mut self, to: &Query, text: &str) -> Step {
        self.policy.step(PolicyEvent::Reply { id: to.id, text, arrived: Time::ZERO, pose: Pose::default() })
    }

    /// Passes a frame with these detections; returns the policy's response.
    fn sees(&mut self, list: &str) -> Step {
        let sent = query(self.frame());
        assert!(matches!(sent.kind, QueryKind::Detect { .. }) && sent.detections.is_empty());
        self.reply(&sent, list)
    }

    /// The first frame, its list and the program; returns the program's first step.
    fn plans(&mut self, list: &str, program: &str) -> Step {
        let sent = query(self.sees(list));
        assert_eq!(sent.kind, QueryKind::Program);
        self.reply(&sent, program)
    }

    /// The program has ended: the next frame is queried.
    fn ends(&mut self, step: Step, done: bool) -> Step {
        assert_eq!(step, Step::Look);
        let sent = query(self.frame());
        assert_eq!(sent.kind, QueryKind::Done);
        self.reply(&sent, &format!("{{\"done\":{done},\"stage\":1}}"))
    }

    fn moved(&mut self) -> Step {
        self.policy.step(PolicyEvent::MoveEnded { completed: true })
    }
}

fn query(step: Step) -> Query {
    match step {
        Step::Ask(query) => *query,
        other => panic!("{other:?}"),
    }
}

fn motion(step: Step) -> Primitives {
    match step {
        Step::Move(Move { primitives, anchor: None, then_rest: true, looks: false }) => primitives,
        other => panic!("{other:?}"),
    }
}

fn forward(metres: f64) -> Primitives {
    Primitives { forward: metres, ..Primitives::default() }
}

#[test]
fn the_planner_receives_skills_list_and_instruction() {
    let mut told = Instructed::new(|_| ());
    let sent = query(told.sees(CAR));
    for words in [
        "mf move_forward(argument): fly forward by centimetres\n",
        "\ncar_3 x:0.50",
        "«go to the car»",
        "rp re_plan",
        "end it with rp",
    ] {
        assert!(sent.prompt.contains(words), "{words}: {}", sent.prompt);
    }
    assert_eq!(sent.detections, [CAR]);
    assert!(!sent.prompt.contains("Your last program"));
}

#[test]
fn moves_follow_one_another_and_the_program_ends() {
    let mut told = Instructed::new(|_| ());
    assert_eq!(motion(told.plans(CAR, "mf,100;tc(45);ml,5;mu,30;->True;")), forward(1.0));
    assert!((motion(told.moved()).yaw - 45.0_f64.to_radians()).abs() < 1e-12);
    assert_eq!(motion(told.moved()), Primitives { right: -0.2, ..Primitives::default() }, "no less than 20 cm");
    assert_eq!(motion(told.moved()), Primitives { climb: 0.3, ..Primitives::default() });
    let over = told.moved();
    assert_eq!(told.ends(over, true), Step::Done);
}

#[test]
fn an_end_that_the_image_does_not_show_is_replanned() {
    let mut told = Instructed::new(|_| ());
    let over = told.plans(CAR, "->True;");
    let list = query(told.ends(over, false));
    assert_eq!(list.kind, QueryKind::Detect { coco: false, scored: false });
    let sent = query(told.reply(&list, CAR));
    assert!(sent.prompt.contains("It ended because: the image does not show"), "{}", sent.prompt);
    motion(told.reply(&sent, "mf,50;->True;"));
    let over = told.moved();
    // A program that moved was useful; six in a row that did not move are not accepted.
    let mut step = told.ends(over, false);
    for _ in 0..6 {
        let list = query(step);
        let sent = query(told.reply(&list, CAR));
        let over = told.reply(&sent, "->True;");
        step = told.ends(over, false);
    }
    assert_eq!(step, Step::Fail(FailReason::NoProgram));
}

#[test]
fn skills_look_again_after_each_move() {
    let mut told = Instructed::new(|_| ());
    // The list used for planning is fresh; after the move another one is needed.
    assert_eq!(motion(told.plans(CAR, "?iv,car{mf,50;}?iv,car{mb,50;}->True;")), forward(0.5));
    assert_eq!(told.moved(), Step::Look);
    let over = told.sees("none");
    assert_eq!(told.ends(over, true), Step::Done);
}

#[test]
fn goto_orients_and_approaches_until_the_box_fills_half_the_image() {
    let mut told = Instructed::new(|_| ());
    let at = |x: f64, height: f64| format!("car_3 x:{x} y:0.5 width:0.1 height:{height} color:black");
    assert!(
        (motion(told.plans(&at(0.8, 0.1), "_1=g('car_3');?_1==False{rp;}->True;")).yaw - 15.0_f64.to_radians()).abs() < 1e-12
    );
    assert_eq!(told.moved(), Step::Look);
    assert_eq!(motion(told.sees(&at(0.55, 0.1))), forward(0.4));
    assert_eq!(told.moved(), Step::Look);
    assert_eq!(motion(told.sees(&at(0.5, 0.4))), forward(0.4));
    assert_eq!(told.moved(), Step::Look);
    let over = told.sees(&at(0.5, 0.6));
    assert_eq!(told.ends(over, true), Step::Done);
}

#[test]
fn a_program_that_ends_badly_is_planned_again_a_few_times() {
    let mut told = Instructed::new(|_| ());
    assert_eq!(told.plans(CAR, "log,'no such thing';->False;"), Step::Look);
    let again = query(told.sees("none"));
    assert!(again.prompt.contains("It ended because: it returned False") && again.prompt.contains("log('no such thing') = True"));
    assert_eq!(again.memory.actions, ["log('no such thing') = True"]);
    // An object lost from view has no measurements: comparing them is an error.
    assert_eq!(told.reply(&again, "?ox,car>0.5{tc,15;}"), Step::Look);
    for _ in 0..3 {
        assert_eq!(told.plans("none", "fly,3;"), Step::Look);
    }
    assert_eq!(told.plans("none", "->False;"), Step::Fail(FailReason::NotFound));
    let mut once = Instructed::new(|settings| settings.replanning = false);
    assert_eq!(once.plans("none", "fly,3;"), Step::Fail(FailReason::NoProgram));
}

#[test]
fn long_moves_outdate_the_plan() {
    let mut told = Instructed::new(|_| ());
    assert_eq!(motion(told.plans(CAR, "mf,200;mf,50;->True;")), forward(2.0));
    assert_eq!(told.moved(), Step::Look);
    assert!(query(told.sees(CAR)).prompt.contains("move_forward") && told.policy.previous.contains("mf(200) = True"));
    let mut once = Instructed::new(|settings| settings.replanning = false);
    assert_eq!(motion(once.plans(CAR, "mf,200;mf,50;->True;")), forward(2.0));
    assert_eq!(motion(once.moved()), forward(0.5));
}

#[test]
fn the_weak_configuration_turns_once_and_hops_once() {
    let mut told = Instructed::new(|settings| (settings.replanning, settings.coco) = (false, true));
    let sent = query(told.frame());
    assert_eq!(sent.kind, QueryKind::Detect { coco: true, scored: false });
    assert!(sent.prompt.contains("classes only: person, bicycle,"), "{}", sent.prompt);
    let sent = query(told.reply(&sent, "car_3 x:0.80 y:0.6 width:0.1 height:0.1 color:black"));
    assert!(!sent.prompt.contains("rp;") && !sent.prompt.contains("re_plan"), "{}", sent.prompt);
    let moved = motion(told.reply(&sent, "g(car);->True;"));
    assert!((moved.yaw - (70.0 * 0.3_f64).to_radians()).abs() < 1e-12 && (moved.forward - 1.1).abs() < 1e-12);
    assert_eq!(told.moved(), Step::Done);
}

#[test]
fn a_faster_craft_flies_longer_hops() {
    let mut told = Instructed::new(|settings| settings.craft = Craft::quad());
    assert_eq!(motion(told.plans(CAR, "a(car);->True;")), forward(1.2));
}

#[test]
fn queries_are_sent_while_the_program_runs() {
    let mut told = Instructed::new(|_| ());
    let sent = query(told.plans(CAR, "_1=sa('what can be driven?');?_1!=False{mf,50;}->True;"));
    assert_eq!(sent.kind, QueryKind::Question { text: "what can be driven?".to_owned() });
    assert!(sent.prompt.contains("«what can be driven?»") && sent.detections == [CAR]);
    assert_eq!(motion(told.reply(&sent, " 'car_3'.\n")), forward(0.5));
}

#[test]
fn a_program_runs_while_it_arrives_and_nothing_of_it_twice() {
    let mut told = Instructed::new(|_| ());
    let sent = query(told.sees(CAR));
    let mut chunk = |text: &str| told.policy.step(PolicyEvent::Chunk { id: sent.id, text });
    assert_eq!(chunk("mf,"), Step::Wait);
    assert_eq!(motion(chunk("50;mf,1")), forward(0.5));
    assert_eq!(chunk("00;"), Step::Wait, "the first move is under way");
    assert_eq!(motion(told.moved()), forward(1.0));
    assert_eq!(told.moved(), Step::Wait, "nothing more has arrived");
    let over = told.reply(&sent, "mf,50;mf,100;->True;");
    assert_eq!(told.ends(over, true), Step::Done);
}

#[test]
fn a_wait_ends_by_the_frames() {
    let mut told = Instructed::new(|_| ());
    assert_eq!(told.plans(CAR, "d(2.5);->True;"), Step::Look);
    for _ in 0..3 {
        assert_eq!(told.frame(), Step::Wait);
    }
    let over = told.frame();
    assert_eq!(told.ends(over, true), Step::Done);
}

#[test]
fn an_unusable_reply_is_refused_and_queried_again() {
    let mut told = Instructed::new(|_| ());
    assert!(matches!(told.sees("I see a car."), Step::Reject(_)));
    assert!(matches!(told.plans(CAR, "8{tc,45;"), Step::Reject(why) if why.starts_with("line 1, column 9")));
    assert!(matches!(told.plans(CAR, " \n"), Step::Reject(_)), "nothing is no program");
    let over = told.plans(CAR, "->True;");
    assert_eq!(told.ends(over, true), Step::Done);
}

#[test]
fn what_is_cut_short_or_never_answered_is_planned_anew() {
    let mut told = Instructed::new(|_| ());
    motion(told.plans(CAR, "mf,50;->True;"));
    assert_eq!(told.policy.step(PolicyEvent::MoveEnded { completed: false }), Step::Wait);
    let sent = query(told.sees(CAR));
    assert_eq!(told.policy.step(PolicyEvent::ReplyFailed { id: sent.id }), Step::Wait);
    assert_eq!(told.reply(&sent, "->True;"), Step::Wait, "too late");
    let over = told.plans(CAR, "->True;");
    assert_eq!(told.ends(over, true), Step::Done);
}
