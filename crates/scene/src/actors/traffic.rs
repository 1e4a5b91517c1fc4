//! The motion of all actors, tick by tick, with a history.
//!
//! Actors never collide with each other: each reserves the space that it needs to stop at maximum braking, and moves on
//! only if the space it would then need is free of the reservations of others; otherwise it brakes within its
//! reservation. People choose first, and vehicles keep the space free into which a person wants to move, so that they
//! stop for them. Actors do not run into a craft either, whose space counts as reserved; the craft itself is not
//! restricted.

use std::collections::VecDeque;
use std::sync::Arc;

use spf_core::geometry::EnuPosition;
use spf_core::time::{Duration, Time};

use super::Gait;
use super::cast::Cast;
use super::course::{Claim, Course, GIVE_WAY_DISTANCE, Neighbour, State};
use super::place::ActorPlace;

/// Length of a tick: the frame period of the simulated camera.
pub const TICK: Duration = Duration::from_millis(50);
const TICK_NANOS: u64 = 50_000_000;
/// How far back [`Traffic::places_at`] can look.
pub const HISTORY: Duration = Duration::from_secs(10);
const HISTORY_TICKS: usize = 201;

/// The moving actors of one flight.
#[derive(Clone, Debug)]
pub struct Traffic {
    cast: Arc<Cast>,
    states: Vec<State>,
    rooms: Rooms,
    seen: Vec<Neighbour>,
    /// The order in which actors choose.
    order: Vec<usize>,
    /// Places at the last ticks, the newest last.
    history: VecDeque<Vec<ActorPlace>>,
    tick: u64,
}

/// Clearance that actors keep from a craft, metres.
const CRAFT_GAP: f64 = 0.4;

/// The reserved space of all actors, and scratch space for trying reservations.
#[derive(Clone, Debug, Default)]
struct Rooms {
    claims: Vec<Claim>,
    craft: Option<Claim>,
    trial: Claim,
    claim_ahead: Claim,
}

impl Traffic {
    /// All actors at the start of flight time.
    #[must_use]
    pub fn new(cast: Arc<Cast>, seed: u64) -> Self {
        let states: Vec<State> = cast.courses().zip(0..).map(|(course, number)| course.begin(seed, number)).collect();
        let places: Vec<ActorPlace> = cast.courses().zip(&states).map(|(course, state)| course.place(state)).collect();
        let mut rooms = Rooms { claims: vec![Claim::default(); states.len()], ..Rooms::default() };
        for (actor, (state, place)) in states.iter().zip(&places).enumerate() {
            cast.course(actor).claim(state, place, &mut rooms.claims[actor]);
        }
        let mut order: Vec<usize> = (0..states.len()).collect();
        order.sort_by_key(|&actor| cast.course(actor).motion.gait != Gait::Walk);
        let seen = cast.courses().zip(&places).map(|(course, place)| course.seen(place)).collect();
        Self { states, rooms, seen, order, history: VecDeque::from([places]), tick: 0, cast }
    }

    /// The actors.
    #[must_use]
    pub fn cast(&self) -> &Arc<Cast> {
        &self.cast
    }

    /// Sets the position and the radius, metres, of the craft from now on.
    pub fn set_craft(&mut self, position: EnuPosition, radius: f64) {
        self.rooms.craft.get_or_insert_default().take_craft(position, radius);
    }

    /// Advances until the positions at `now` are known.
    pub fn advance_to(&mut self, now: Time) {
        if self.states.is_empty() {
            return;
        }
        while self.tick * TICK_NANOS < now.as_nanos() {
            self.step();
        }
    }

    /// Positions of all actors at `at`, in the order of the cast: exact on ticks, interpolated in between. `None` for
    /// times not reached yet, or more than [`HISTORY`] ago.
    #[must_use]
    pub fn places_at(&self, at: Time) -> Option<Vec<ActorPlace>> {
        if self.states.is_empty() {
            return Some(Vec::new());
        }
        let (earlier, later, fraction) = self.about(at)?;
        Some(earlier.iter().zip(later).map(|(a, b)| a.towards(b, fraction)).collect())
    }

    /// Position of one actor; `None` for an invalid index, or a time outside the history.
    #[must_use]
    pub fn place_at(&self, actor: usize, at: Time) -> Option<ActorPlace> {
        let (earlier, later, fraction) = self.about(at)?;
        Some(earlier.get(actor)?.towards(later.get(actor)?, fraction))
    }

    /// The ticks before and after, and the fraction between them.
    fn about(&self, at: Time) -> Option<(&[ActorPlace], &[ActorPlace], f64)> {
        let (tick, rest) = (at.as_nanos() / TICK_NANOS, at.as_nanos() % TICK_NANOS);
        let oldest = self.tick + 1 - self.history.len() as u64;
        let index = usize::try_from(tick.checked_sub(oldest)?).ok()?;
        let earlier = self.history.get(index)?;
        let later = if rest == 0 { earlier } else { self.history.get(index + 1)? };
        Some((earlier, later, rest as f64 / TICK_NANOS as f64))
    }

    fn step(&mut self) {
        let mut places = if self.history.len() > HISTORY_TICKS { self.history.pop_front() } else { None }.unwrap_or_default();
        places.clear();
        places.extend(self.history.back().into_iter().flatten());
        for k in 0..self.order.len() {
            let actor = self.order[k];
            let course = self.cast.course(actor);
            let (states, rooms) = (&self.states, &mut self.rooms);
            let is_free = |state: &State, place: &ActorPlace| rooms.are_free(&self.cast, states, &places, actor, state, place);
            let next = course.next(&states[actor], &self.seen, is_free);
            places[actor] = course.place(&next);
            course.claim(&next, &places[actor], &mut self.rooms.claims[actor]);
            self.seen[actor] = course.seen(&places[actor]);
            self.states[actor] = next;
        }
        self.tick += 1;
        self.history.push_back(places);
    }
}

impl Rooms {
    /// Whether the space that an actor would need in a state is free of the reservations of others, and for a vehicle
    /// also of places that people want to enter next, unless the vehicle already blocks them.
    fn are_free(
        &mut self,
        cast: &Cast,
        states: &[State],
        places: &[ActorPlace],
        actor: usize,
        state: &State,
        place: &ActorPlace,
    ) -> bool {
        let course = cast.course(actor);
        let gap = course.gap();
        course.claim(state, place, &mut self.trial);
        if let Some(craft) = &self.craft
            && self.trial.near(craft, CRAFT_GAP)
        {
            course.fill(state, &mut self.trial);
            if self.trial.meets(craft, CRAFT_GAP) {
                return false;
            }
        }
        let yields = course.motion.gait == Gait::Drive && !Course::is_impatient(&states[actor]);
        for other in (0..states.len()).filter(|other| *other != actor) {
            let theirs = cast.course(other);
            if !self.trial.near(&self.claims[other], gap + if yields { GIVE_WAY_DISTANCE } else { 0.0 }) {
                continue;
            }
            course.fill(state, &mut self.trial);
            theirs.fill(&states[other], &mut self.claims[other]);
            if self.trial.meets(&self.claims[other], gap) {
                return false;
            }
            if yields
                && theirs.claim_ahead(&states[other], &places[other], &mut self.claim_ahead)
                && self.trial.meets(&self.claim_ahead, gap)
            {
                course.fill(&states[actor], &mut self.claims[actor]);
                if !self.claims[actor].meets(&self.claim_ahead, gap) {
                    return false;
                }
            }
        }
        true
    }
}
