//! Policies with several queries: all use the same pilot.

use super::*;
use crate::policy::{Move, Output, PolicyEvent, View};
use spf_core::primitives::Primitives;
use spf_core::query::QueryKind;

/// Sends three dependent queries about one frame, moves according to the answers, and queries while moving; that answer
/// is `done` or starts another round.
struct Chooser {
    view: Option<View>,
    answers: Vec<f64>,
    next_id: u64,
    ask_on: bool,
}

impl Chooser {
    fn new() -> Self {
        Self { view: None, answers: Vec::new(), next_id: 0, ask_on: false }
    }

    fn ask(&mut self, kind: QueryKind) -> Step {
        let id = QueryId(self.next_id);
        self.next_id += 1;
        let frame = self.view.unwrap().frame.id;
        Step::Ask(Box::new(Query { prompt: format!("{:?}", self.answers), ..Query::new(id, frame, kind) }))
    }
}

impl Policy for Chooser {
    fn name(&self) -> &'static str {
        "chooser"
    }

    fn handle(&mut self, event: PolicyEvent<'_>) -> Output {
        let step = match event {
            PolicyEvent::Frame(view) => {
                self.view = Some(*view);
                self.answers.clear();
                self.ask(QueryKind::Choose)
            }
            PolicyEvent::Reply { text: "done", .. } => Step::Done,
            PolicyEvent::Reply { text: "go on", .. } => Step::Wait,
            PolicyEvent::Reply { text, .. } => {
                self.answers.push(text.parse().unwrap());
                if self.answers.len() < 3 {
                    return self.ask(QueryKind::Choose).into();
                }
                self.ask_on = true;
                let primitives = Primitives { forward: self.answers.iter().sum(), ..Primitives::default() };
                Step::Move(Move { primitives, anchor: Some(self.view.unwrap().pose), then_rest: false, looks: false })
            }
            PolicyEvent::Continue if core::mem::take(&mut self.ask_on) => self.ask(QueryKind::Done),
            _ => Step::Wait,
        };
        step.into()
    }
}

#[test]
fn a_policy_sends_three_dependent_queries_on_one_frame_then_moves_and_queries_while_moving() {
    for preset in PRESETS {
        let mut done_asked = 0;
        let mut flight = Setup::preset(preset).policy(Chooser::new()).fly(move |query, _| {
            let text = match query.kind {
                QueryKind::Choose => "2",
                _ => {
                    done_asked += 1;
                    if done_asked < 2 { "go on" } else { "done" }
                }
            };
            Answer::After(secs(1.0), text.to_owned())
        });
        assert_eq!(flight.end(), Outcome::Reached, "{preset:?}");
        let queries: Vec<(u64, &str)> = flight.queries.iter().map(|(_, query)| (query.frame.0, &*query.prompt)).collect();
        assert_eq!(queries.len(), 8, "two rounds of three and one");
        for round in queries.chunks(4) {
            assert!(round.iter().all(|(frame, _)| *frame == round[0].0), "one frame: {round:?}");
            let prompts: Vec<&str> = round.iter().map(|(_, prompt)| *prompt).collect();
            assert_eq!(prompts, ["[]", "[2.0]", "[2.0, 2.0]", "[2.0, 2.0, 2.0]"], "each depends on the answer before");
        }
        // A round is one decision: its queries carry the number of the decision that they prepare.
        let steps: Vec<(u32, &str)> = flight.decisions().map(|d| (d.number, &*d.step)).collect();
        let (ask, wait) = ("ask", "wait");
        let expected = [(1, ask), (1, ask), (1, "move"), (2, wait), (2, ask), (2, ask), (2, "move"), (3, "done")];
        assert_eq!(steps, expected, "{preset:?}");
        assert_eq!(flight.pilot.decisions(), 3);
        // The query while moving was sent together with the motion, and did not stop it.
        let thinking = flight.setpoints_since(flight.queries[3].0).take_while(|(at, _)| *at < flight.queries[3].0 + secs(1.0));
        assert!(thinking.filter(|(_, setpoint)| !setpoint.is_hold()).count() > 7, "{preset:?}");
    }
}

#[test]
fn one_failed_question_of_a_round_stops_and_the_round_begins_anew() {
    let mut queries = 0;
    let mut flight = Setup::preset(Preset::Default).policy(Chooser::new()).fly(move |query, _| {
        queries += 1;
        match query.kind {
            _ if queries == 2 => Answer::FailsAfter(secs(0.5)),
            QueryKind::Choose => Answer::After(secs(0.5), "1".to_owned()),
            _ => Answer::After(secs(0.5), "done".to_owned()),
        }
    });
    assert_eq!(flight.end(), Outcome::Reached);
    assert_ne!(flight.queries[1].1.frame, flight.queries[2].1.frame);
    assert_eq!(flight.queries[2].1.prompt, "[]");
}

/// A policy that never waits, whatever the events.
struct Restless(u64);

impl Policy for Restless {
    fn name(&self) -> &'static str {
        "restless"
    }

    fn handle(&mut self, event: PolicyEvent<'_>) -> Output {
        self.0 += 1;
        let primitives = Primitives { climb: 0.5, ..Primitives::default() };
        let step = match (self.0 % 3, event) {
            (_, PolicyEvent::Instruction(_)) => Step::Wait,
            (0, _) => Step::Move(Move { primitives, anchor: None, then_rest: false, looks: false }),
            _ => Step::Ask(Box::new(Query::new(QueryId(self.0), FrameId(0), QueryKind::Detect { coco: false, scored: false }))),
        };
        step.into()
    }
}

/// The harness fails on more than 64 actions at one instant.
#[test]
fn a_policy_that_never_waits_is_bounded_and_its_flight_ends() {
    for timeout in [0.0, 5.0] {
        let mut setup = Setup::preset(Preset::Default).policy(Restless(0));
        setup.settings.reply_timeout = secs(timeout);
        setup.settings.max_time = secs(20.0);
        let mut flight = setup.fly(|_, _| Answer::Never);
        assert_ne!(flight.end(), Outcome::Reached);
    }
}

/// A streaming policy: it moves as soon as the beginning of an answer suffices, and has the whole answer at its end.
struct Eager {
    moved: bool,
    id: u64,
}

impl Policy for Eager {
    fn name(&self) -> &'static str {
        "eager"
    }

    fn handle(&mut self, event: PolicyEvent<'_>) -> Output {
        let step = match event {
            PolicyEvent::Frame(view) => {
                self.moved = false;
                self.id += 1;
                let mut chooser = Chooser { view: Some(*view), answers: Vec::new(), next_id: self.id, ask_on: false };
                chooser.ask(QueryKind::Program)
            }
            PolicyEvent::Chunk { text: "forward", .. } if !core::mem::replace(&mut self.moved, true) => Step::Move(Move {
                primitives: Primitives { forward: 3.0, ..Primitives::default() },
                anchor: None,
                then_rest: false,
                looks: false,
            }),
            _ => Step::Wait,
        };
        step.into()
    }
}

#[test]
fn a_part_of_an_answer_may_move_and_the_answer_counts_once() {
    let mut flight = Setup::preset(Preset::Default).policy(Eager { moved: false, id: 0 }).fly(|_, _| Answer::Never);
    flight.until_asked(1);
    let id = flight.queries[0].1.id;
    for text in ["for", "forward", "forward"] {
        flight.pass(0.2);
        flight.tell(Event::Chunk { id, text: text.to_owned() });
    }
    flight.until_moving();
    assert_eq!(flight.pilot.decisions(), 1);
    flight.tell(Event::Reply { id, text: "forward".to_owned() });
    assert_eq!((flight.pilot.decisions(), flight.decisions().next().unwrap().number), (1, 1));
    // Parts of an unexpected answer do not count either.
    let before = flight.commands.len();
    flight.operator(OperatorEvent::Hold);
    flight.tell(Event::Chunk { id, text: "forward".to_owned() });
    flight.pass(1.0);
    assert!(flight.commands[before..].iter().all(|(_, command)| *command == Command::Setpoint(Setpoint::HOLD)));
}
