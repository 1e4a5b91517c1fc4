//! Whose answer is this? A Tello numbers nothing: an answer is known by having been waited for.
//!
//! One order is in flight at a time. An answer is credited to it only if it is of the kind that the order can have and comes
//! neither before the order can have been carried out nor after it was given up. After an order the next one whose answers look
//! alike waits until a copy of the last answer can no longer come ([`ECHO`]); after one that was given up, until its late answer
//! can no longer come ([`GRACE`]). Motion is never sent a second time.

use std::collections::VecDeque;

use spf_core::time::{Duration, Time};

use super::answer::Answer;

/// A copy of an answer comes within this time of it.
pub const ECHO: Duration = Duration::from_millis(500);
/// The answer of an order that was given up comes within this time of that.
pub const GRACE: Duration = Duration::from_secs(10);
/// Between two orders, as the drone needs it.
pub const SPACING: Duration = Duration::from_millis(100);

/// What answers an order can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// `ok` or a refusal.
    Act,
    /// A value.
    Read,
}

/// Something to be said to the drone, and its answer waited for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Order {
    /// The words.
    pub text: String,
    /// What it can be answered.
    pub kind: Kind,
    /// An `ok` before this is not its own: no take-off is over in a tenth of a second.
    pub earliest: Duration,
    /// It is given up after so long.
    pub timeout: Duration,
    /// How often it may be said again when no answer comes. Always 0 for motion.
    pub repeats: u32,
}

impl Order {
    /// Something that may be said twice and takes no time.
    #[must_use]
    pub fn quick(text: &str) -> Self {
        let kind = if text.ends_with('?') { Kind::Read } else { Kind::Act };
        Self { text: text.to_owned(), kind, earliest: Duration::ZERO, timeout: Duration::from_secs(2), repeats: 2 }
    }

    /// A motion: said once, whatever happens.
    #[must_use]
    pub fn motion(text: &str, earliest: Duration, timeout: Duration) -> Self {
        Self { text: text.to_owned(), kind: Kind::Act, earliest, timeout, repeats: 0 }
    }

    /// Whether `answer` can be this order's, `after` it was said. None when it cannot.
    fn accepts(&self, answer: &Answer, after: Duration) -> bool {
        match (answer, self.kind) {
            (Answer::Ok, Kind::Act) => after >= self.earliest,
            (Answer::Value(_), Kind::Read) => true,
            (Answer::Refused(text), kind) => match text.to_ascii_lowercase().strip_prefix("unknown command: ") {
                // This one names its order.
                Some(verb) => self.text.split(' ').next().is_some_and(|own| own.eq_ignore_ascii_case(verb)),
                None => kind == Kind::Act,
            },
            _ => false,
        }
    }
}

/// What became of an order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Fate {
    /// Answered.
    Answered(Answer),
    /// No answer came.
    TimedOut,
}

#[derive(Clone, Debug)]
struct InFlight {
    order: Order,
    said: Time,
    repeats_left: u32,
    /// Answers to an earlier saying of it can come until then.
    echoes_until: Time,
}

/// The conversation with one drone. Sans-IO.
#[derive(Clone, Debug, Default)]
pub struct Conversation {
    waiting: VecDeque<Order>,
    flight: Option<InFlight>,
    /// Nothing is said before.
    quiet_until: Time,
    /// No order of the kind is said before: acts, reads.
    tombs: [Time; 2],
    ended: VecDeque<(Order, Fate)>,
    strays: u64,
    /// What was put in the place of everything else and was not said yet.
    urgent: Option<String>,
}

impl Conversation {
    /// Puts an order at the end of those that wait.
    pub fn submit(&mut self, order: Order) {
        self.waiting.push_back(order);
    }

    /// Forgets the orders that were not said yet.
    pub fn clear(&mut self) {
        self.waiting.clear();
    }

    /// Puts an order in the place of the one in flight and of all that wait, and says it at once: `stop`. A late answer of what was
    /// in flight may be taken for this one's; then what it was to end has ended.
    pub fn interrupt(&mut self, now: Time, order: Order) {
        self.waiting.clear();
        self.urgent = Some(order.text.clone());
        let repeats_left = order.repeats;
        self.flight = Some(InFlight { order, said: now, repeats_left, echoes_until: now + ECHO });
    }

    /// Takes an order back that was not said yet; false when it was.
    pub fn withdraw(&mut self, text: &str) -> bool {
        let before = self.waiting.len();
        self.waiting.retain(|order| order.text != text);
        self.waiting.len() < before
    }

    /// Whether nothing waits and nothing is in flight.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.waiting.is_empty() && self.flight.is_none()
    }

    /// Something that is answered like an act was said past this conversation (`land` on the way down): its answer belongs to
    /// nobody, and until it can no longer come no act begins.
    pub fn said_past(&mut self, now: Time) {
        self.tombs[0] = self.tombs[0].max(now + GRACE);
    }

    /// Answers that were credited to nobody so far.
    #[must_use]
    pub fn strays(&self) -> u64 {
        self.strays
    }

    /// A datagram came from the command port.
    pub fn handle(&mut self, now: Time, datagram: &[u8]) {
        let answer = Answer::read(datagram);
        let credited = self.flight.take_if(|flight| flight.order.accepts(&answer, now.since(flight.said)));
        let Some(InFlight { order, echoes_until, .. }) = credited else {
            self.strays += 1;
            return;
        };
        self.quiet_until = now + SPACING;
        let tomb = &mut self.tombs[order.kind as usize];
        *tomb = (*tomb).max(now + ECHO).max(echoes_until);
        self.ended.push_back((order, Fate::Answered(answer)));
    }

    /// What to say now.
    pub fn poll(&mut self, now: Time) -> Option<String> {
        if let Some(text) = self.urgent.take() {
            return Some(text);
        }
        if let Some(flight) = &mut self.flight {
            if now.since(flight.said) < flight.order.timeout {
                return None;
            }
            if flight.repeats_left > 0 {
                // Whichever of the sayings is answered: it is the same order.
                flight.repeats_left -= 1;
                flight.echoes_until = now + GRACE;
                flight.said = now;
                return Some(flight.order.text.clone());
            }
            let tomb = &mut self.tombs[flight.order.kind as usize];
            *tomb = (*tomb).max(now + GRACE);
            if let Some(InFlight { order, .. }) = self.flight.take() {
                self.ended.push_back((order, Fate::TimedOut));
            }
        }
        let kind = self.waiting.front()?.kind;
        if now < self.quiet_until || now < self.tombs[kind as usize] {
            return None;
        }
        let order = self.waiting.pop_front()?;
        let text = order.text.clone();
        let repeats_left = order.repeats;
        self.flight = Some(InFlight { order, said: now, repeats_left, echoes_until: Time::ZERO });
        Some(text)
    }

    /// The next order that ended, and how.
    pub fn take_ended(&mut self) -> Option<(Order, Fate)> {
        self.ended.pop_front()
    }
}

#[cfg(test)]
mod tests {
    use spf_core::rng::Draw;

    use super::*;

    const STEP: Duration = Duration::from_millis(5);

    /// An order's words carry its number, and a drone of the test answers with that number hidden in the letter case, so that the
    /// test, not the conversation, knows whose answer an answer is.
    struct Schedule {
        draw: Draw,
        /// When, what, whose.
        under_way: Vec<(Time, Vec<u8>, usize)>,
    }

    impl Schedule {
        fn delay(&mut self) -> Duration {
            Duration::from_secs_f64(0.02 + 0.1 * self.draw.uniform())
        }

        /// The drone hears order `number` and answers, over a bad link.
        fn hear(&mut self, now: Time, text: &str, number: usize, motion: bool) {
            let answer = if text.ends_with('?') {
                format!("{}\r\n", number % 100)
            } else if self.draw.chance(0.1) {
                "error".to_owned()
            } else {
                "ok".to_owned()
            };
            let takes =
                if motion && answer == "ok" { Duration::from_secs_f64(0.6 + 3.0 * self.draw.uniform()) } else { Duration::ZERO };
            let mut at = now + takes + self.delay();
            if self.draw.chance(0.15) {
                return;
            }
            // Late: after the order's timeout, within the grace.
            if self.draw.chance(0.1) {
                at += Duration::from_secs_f64(2.0 + 7.0 * self.draw.uniform());
            }
            self.under_way.push((at, answer.clone().into_bytes(), number));
            if self.draw.chance(0.2) {
                self.under_way.push((at + Duration::from_secs_f64(0.45 * self.draw.uniform()), answer.into_bytes(), number));
            }
            if self.draw.chance(0.05) {
                self.under_way.push((at, vec![0xcc, 0x58, 0x00, 0x7c], usize::MAX));
            }
        }
    }

    /// Lost, late, doubled and overtaking answers: each that is credited belongs to its order, and no motion is said twice.
    #[test]
    fn ten_thousand_schedules_credit_no_answer_to_another_order() {
        for seed in 0..10_000 {
            let mut schedule = Schedule { draw: Draw::new(seed, "schedule", &[]), under_way: Vec::new() };
            let mut conversation = Conversation::default();
            let orders: Vec<Order> = (0..6)
                .map(|number| match schedule.draw.below(4) {
                    0 => Order::quick(&format!("x{number}?")),
                    1 => Order::quick(&format!("set{number}")),
                    _ => Order::motion(&format!("go{number}"), Duration::from_millis(500), Duration::from_secs(4)),
                })
                .collect();
            orders.iter().for_each(|order| conversation.submit(order.clone()));
            let (mut now, mut said, mut ended) = (Time::ZERO, vec![0; orders.len()], 0);
            while ended < orders.len() {
                assert!(now < Time::from_millis(300_000), "seed {seed}: it ends");
                while let Some(text) = conversation.poll(now) {
                    let number = orders.iter().position(|order| order.text == text).unwrap();
                    said[number] += 1;
                    schedule.hear(now, &text, number, orders[number].repeats == 0);
                }
                while let Some((_, fate)) = conversation.take_ended() {
                    assert_eq!(fate, Fate::TimedOut);
                    ended += 1;
                }
                schedule.under_way.sort_by_key(|(at, ..)| *at);
                while schedule.under_way.first().is_some_and(|(at, ..)| *at <= now) {
                    let (_, bytes, whose) = schedule.under_way.remove(0);
                    conversation.handle(now, &bytes);
                    while let Some((order, fate)) = conversation.take_ended() {
                        let number = orders.iter().position(|other| *other == order).unwrap();
                        assert!(matches!(fate, Fate::Answered(_)));
                        assert_eq!(number, whose, "seed {seed}: {order:?} was given the answer of {:?}", orders.get(whose));
                        ended += 1;
                    }
                }
                now += STEP;
            }
            for (order, said) in orders.iter().zip(said) {
                assert!(said >= 1 && said <= order.repeats + 1, "seed {seed}: {order:?} was said {said} times");
            }
        }
    }

    #[test]
    fn an_ok_that_comes_too_soon_is_nobody_s() {
        let mut conversation = Conversation::default();
        conversation.submit(Order::motion("takeoff", Duration::from_secs(1), Duration::from_secs(20)));
        assert_eq!(conversation.poll(Time::ZERO), Some("takeoff".to_owned()));
        conversation.handle(Time::from_millis(300), b"ok");
        assert_eq!((conversation.take_ended(), conversation.strays()), (None, 1));
        conversation.handle(Time::from_millis(4000), b"ok");
        assert!(matches!(conversation.take_ended(), Some((_, Fate::Answered(Answer::Ok)))));
    }

    #[test]
    fn what_an_unknown_command_names_is_whose_it_is() {
        let mut conversation = Conversation::default();
        conversation.submit(Order::quick("sdk?"));
        assert_eq!(conversation.poll(Time::ZERO), Some("sdk?".to_owned()));
        for stray in ["unknown command: keepalive", "error", "ok", "forced stop"] {
            conversation.handle(Time::from_millis(50), stray.as_bytes());
        }
        assert_eq!((conversation.take_ended(), conversation.strays()), (None, 4));
        conversation.handle(Time::from_millis(60), b"unknown command: sdk?");
        assert!(conversation.take_ended().is_some());
    }
}
