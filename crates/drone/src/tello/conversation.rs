//! Matching responses to commands. The Tello protocol has no sequence numbers, so responses are matched by order and
//! timing.
//!
//! Only one order is in flight at a time. A response is matched to it only if it is of the expected kind, and arrives
//! neither before the order can have been carried out nor after it timed out. The next order with the same kind of
//! response waits until a duplicate of the last response can no longer arrive ([`ECHO`]), or after a timeout until the
//! late response can no longer arrive ([`GRACE`]). Motion commands are never sent twice.

use std::collections::VecDeque;

use spf_core::time::{Duration, Time};

use super::answer::Answer;

/// Duplicates of a response arrive within this time.
pub const ECHO: Duration = Duration::from_millis(500);
/// The response to an order that timed out arrives within this time after the timeout.
pub const GRACE: Duration = Duration::from_secs(10);
/// Minimum interval between two orders, as the drone requires.
pub const SPACING: Duration = Duration::from_millis(100);

/// The kind of response that an order expects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// `ok` or an error.
    Act,
    /// A value.
    Read,
}

/// A command to send, with the response to wait for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Order {
    /// Command text.
    pub text: String,
    /// Kind of response.
    pub kind: Kind,
    /// An `ok` earlier than this belongs to another order: no take-off completes in a tenth of a second.
    pub earliest: Duration,
    /// Response timeout.
    pub timeout: Duration,
    /// Number of retries without a response. Always 0 for motion.
    pub repeats: u32,
}

impl Order {
    /// A command that may be repeated and completes at once.
    #[must_use]
    pub fn quick(text: &str) -> Self {
        let kind = if text.ends_with('?') { Kind::Read } else { Kind::Act };
        Self { text: text.to_owned(), kind, earliest: Duration::ZERO, timeout: Duration::from_secs(2), repeats: 2 }
    }

    /// A motion command: never sent twice.
    #[must_use]
    pub fn motion(text: &str, earliest: Duration, timeout: Duration) -> Self {
        Self { text: text.to_owned(), kind: Kind::Act, earliest, timeout, repeats: 0 }
    }

    /// Whether `answer` can belong to this order, `after` it was sent; `None` if not.
    fn accepts(&self, answer: &Answer, after: Duration) -> bool {
        match (answer, self.kind) {
            (Answer::Ok, Kind::Act) => after >= self.earliest,
            (Answer::Value(_), Kind::Read) => true,
            (Answer::Refused(text), kind) => match text.to_ascii_lowercase().strip_prefix("unknown command: ") {
                // This response names its order.
                Some(verb) => self.text.split(' ').next().is_some_and(|own| own.eq_ignore_ascii_case(verb)),
                None => kind == Kind::Act,
            },
            _ => false,
        }
    }
}

/// The result of an order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum OrderOutcome {
    /// Answered.
    Answered(Answer),
    /// No response arrived.
    TimedOut,
}

#[derive(Clone, Debug)]
struct InFlight {
    order: Order,
    sent_at: Time,
    repeats_left: u32,
    /// Until when responses to an earlier transmission can arrive.
    echoes_until: Time,
}

/// The command channel of one drone. Sans-IO.
#[derive(Clone, Debug, Default)]
pub struct Conversation {
    waiting: VecDeque<Order>,
    flight: Option<InFlight>,
    /// Nothing is sent before this time.
    quiet_until: Time,
    /// No order of the kind is sent before these times: acts, reads.
    tombs: [Time; 2],
    ended: VecDeque<(Order, OrderOutcome)>,
    strays: u64,
    /// An urgent order that replaces all others and has not been sent yet.
    urgent: Option<String>,
}

impl Conversation {
    /// Appends an order to the queue.
    pub fn submit(&mut self, order: Order) {
        self.waiting.push_back(order);
    }

    /// Drops the orders not sent yet.
    pub fn clear(&mut self) {
        self.waiting.clear();
    }

    /// Replaces the order in flight and all queued ones by this one, and sends it at once: `stop`. A late response to
    /// the order in flight may be matched to this one; in that case the manoeuvre to be stopped has ended anyway.
    pub fn interrupt(&mut self, now: Time, order: Order) {
        self.waiting.clear();
        self.urgent = Some(order.text.clone());
        let repeats_left = order.repeats;
        self.flight = Some(InFlight { order, sent_at: now, repeats_left, echoes_until: now + ECHO });
    }

    /// Removes an order from the queue; false if it was already sent.
    pub fn withdraw(&mut self, text: &str) -> bool {
        let before = self.waiting.len();
        self.waiting.retain(|order| order.text != text);
        self.waiting.len() < before
    }

    /// Whether nothing is queued or in flight.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.waiting.is_empty() && self.flight.is_none()
    }

    /// Records that a command with an act response was sent outside of this channel (`land` while descending): its
    /// response belongs to no order, and no act starts until it can no longer arrive.
    pub fn sent_outside(&mut self, now: Time) {
        self.tombs[0] = self.tombs[0].max(now + GRACE);
    }

    /// Number of unmatched responses so far.
    #[must_use]
    pub fn strays(&self) -> u64 {
        self.strays
    }

    /// Handles a datagram from the command port.
    pub fn handle(&mut self, now: Time, datagram: &[u8]) {
        let answer = Answer::read(datagram);
        let credited = self.flight.take_if(|flight| flight.order.accepts(&answer, now.since(flight.sent_at)));
        let Some(InFlight { order, echoes_until, .. }) = credited else {
            self.strays += 1;
            return;
        };
        self.quiet_until = now + SPACING;
        let tomb = &mut self.tombs[order.kind as usize];
        *tomb = (*tomb).max(now + ECHO).max(echoes_until);
        self.ended.push_back((order, OrderOutcome::Answered(answer)));
    }

    /// The next datagram to send.
    pub fn poll(&mut self, now: Time) -> Option<String> {
        if let Some(text) = self.urgent.take() {
            return Some(text);
        }
        if let Some(flight) = &mut self.flight {
            if now.since(flight.sent_at) < flight.order.timeout {
                return None;
            }
            if flight.repeats_left > 0 {
                // A response to any of the transmissions is valid: it is the same order.
                flight.repeats_left -= 1;
                flight.echoes_until = now + GRACE;
                flight.sent_at = now;
                return Some(flight.order.text.clone());
            }
            let tomb = &mut self.tombs[flight.order.kind as usize];
            *tomb = (*tomb).max(now + GRACE);
            if let Some(InFlight { order, .. }) = self.flight.take() {
                self.ended.push_back((order, OrderOutcome::TimedOut));
            }
        }
        let kind = self.waiting.front()?.kind;
        if now < self.quiet_until || now < self.tombs[kind as usize] {
            return None;
        }
        let order = self.waiting.pop_front()?;
        let text = order.text.clone();
        let repeats_left = order.repeats;
        self.flight = Some(InFlight { order, sent_at: now, repeats_left, echoes_until: Time::ZERO });
        Some(text)
    }

    /// The next completed order, and its result.
    pub fn take_ended(&mut self) -> Option<(Order, OrderOutcome)> {
        self.ended.pop_front()
    }
}

#[cfg(test)]
mod tests {
    use spf_core::rng::RandomStream;

    use super::*;

    const STEP: Duration = Duration::from_millis(5);

    /// Order texts carry a number, and the test's drone encodes that number in the letter case of its response, so that
    /// the test knows which order a response belongs to independently of the channel.
    struct Schedule {
        rng: RandomStream,
        /// Time, datagram and order number.
        under_way: Vec<(Time, Vec<u8>, usize)>,
    }

    impl Schedule {
        fn delay(&mut self) -> Duration {
            Duration::from_secs_f64(0.02 + 0.1 * self.rng.uniform())
        }

        /// The drone receives order `number` and responds, over an unreliable link.
        fn hear(&mut self, now: Time, text: &str, number: usize, motion: bool) {
            let answer = if text.ends_with('?') {
                format!("{}\r\n", number % 100)
            } else if self.rng.chance(0.1) {
                "error".to_owned()
            } else {
                "ok".to_owned()
            };
            let takes =
                if motion && answer == "ok" { Duration::from_secs_f64(0.6 + 3.0 * self.rng.uniform()) } else { Duration::ZERO };
            let mut at = now + takes + self.delay();
            if self.rng.chance(0.15) {
                return;
            }
            // Late: after the order's timeout, within the grace period.
            if self.rng.chance(0.1) {
                at += Duration::from_secs_f64(2.0 + 7.0 * self.rng.uniform());
            }
            self.under_way.push((at, answer.clone().into_bytes(), number));
            if self.rng.chance(0.2) {
                self.under_way.push((at + Duration::from_secs_f64(0.45 * self.rng.uniform()), answer.into_bytes(), number));
            }
            if self.rng.chance(0.05) {
                self.under_way.push((at, vec![0xcc, 0x58, 0x00, 0x7c], usize::MAX));
            }
        }
    }

    /// With lost, late, duplicated and reordered responses, each matched response belongs to its order, and no motion
    /// is sent twice.
    #[test]
    fn ten_thousand_schedules_credit_no_answer_to_another_order() {
        for seed in 0..10_000 {
            let mut schedule = Schedule { rng: RandomStream::new(seed, "schedule", &[]), under_way: Vec::new() };
            let mut conversation = Conversation::default();
            let orders: Vec<Order> = (0..6)
                .map(|number| match schedule.rng.below(4) {
                    0 => Order::quick(&format!("x{number}?")),
                    1 => Order::quick(&format!("set{number}")),
                    _ => Order::motion(&format!("go{number}"), Duration::from_millis(500), Duration::from_secs(4)),
                })
                .collect();
            orders.iter().for_each(|order| conversation.submit(order.clone()));
            let (mut now, mut times_sent, mut ended) = (Time::ZERO, vec![0; orders.len()], 0);
            while ended < orders.len() {
                assert!(now < Time::from_millis(300_000), "seed {seed}: it ends");
                while let Some(text) = conversation.poll(now) {
                    let number = orders.iter().position(|order| order.text == text).unwrap();
                    times_sent[number] += 1;
                    schedule.hear(now, &text, number, orders[number].repeats == 0);
                }
                while let Some((_, fate)) = conversation.take_ended() {
                    assert_eq!(fate, OrderOutcome::TimedOut);
                    ended += 1;
                }
                schedule.under_way.sort_by_key(|(at, ..)| *at);
                while schedule.under_way.first().is_some_and(|(at, ..)| *at <= now) {
                    let (_, bytes, whose) = schedule.under_way.remove(0);
                    conversation.handle(now, &bytes);
                    while let Some((order, fate)) = conversation.take_ended() {
                        let number = orders.iter().position(|other| *other == order).unwrap();
                        assert!(matches!(fate, OrderOutcome::Answered(_)));
                        assert_eq!(number, whose, "seed {seed}: {order:?} was given the answer of {:?}", orders.get(whose));
                        ended += 1;
                    }
                }
                now += STEP;
            }
            for (order, times_sent) in orders.iter().zip(times_sent) {
                assert!(times_sent >= 1 && times_sent <= order.repeats + 1, "seed {seed}: {order:?} was sent {times_sent} times");
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
        assert!(matches!(conversation.take_ended(), Some((_, OrderOutcome::Answered(Answer::Ok)))));
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
