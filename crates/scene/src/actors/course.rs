//! One actor on its path: the space it occupies, and its motion from tick to tick.

use glam::DVec2;
use spf_core::geometry::{EnuPosition, wrap_angle};
use spf_core::rng::RandomStream;

use super::footprint::Footprint;
use super::place::ActorPlace;
use super::route::{Route, Spot};
use super::{Actor, Gait, Motion, PathEnd};

/// Length of a tick, seconds.
pub(super) const STEP: f64 = 0.05;
/// An actor within this distance of its stopping point has arrived, metres.
const ARRIVED: f64 = 0.01;
/// Speed at which a person steps aside, m/s, and turns, rad/s.
const ASIDE_SPEED: f64 = 0.5;
const TURN_RATE: f64 = 3.5;
/// A person turns on the spot until they face their path within this angle, radians.
const FACING: f64 = 1.0;
/// Distance up to which a person looks for others in its path, metres.
const NOTICED: f64 = 8.0;
/// Distance up to which vehicles look for places that a person wants to enter, metres.
pub(super) const GIVE_WAY_DISTANCE: f64 = 3.0;
/// An actor blocked for this long turns round, or stops giving way to places that others only want to enter; seconds.
const PATIENCE: f64 = 12.0;
/// Actors whose heights differ by more than this pass over one another, metres.
const STOREY: f64 = 3.0;

/// Acceleration, braking and clearances of an actor with this gait; m/s² and metres.
#[derive(Clone, Copy, Debug)]
struct MotionLimits {
    speeding: f64,
    /// Deceleration for a foreseen stop.
    braking: f64,
    /// Maximum deceleration, for others in the way.
    stopping: f64,
    lateral: f64,
    /// Clearance from others when it moves on; people approach a vehicle more closely than it approaches them.
    gap: f64,
    /// Spacing of the places at which the path ahead is checked.
    sample: f64,
}

const WALKING: MotionLimits = MotionLimits { speeding: 1.0, braking: 0.8, stopping: 2.0, lateral: 2.0, gap: 0.1, sample: 0.2 };
const DRIVING: MotionLimits = MotionLimits { speeding: 1.5, braking: 1.5, stopping: 4.0, lateral: 2.0, gap: 0.5, sample: 0.5 };

/// A path and the actor that moves along it.
#[derive(Clone, Debug)]
pub(crate) struct Course {
    pub(super) motion: Motion,
    route: Route,
    body: Footprint,
    limits: MotionLimits,
}

/// Position of an actor on its course, and its motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct State {
    /// Metres along the route.
    along: f64,
    /// Metres to the right of the route's direction.
    aside: f64,
    pub(super) speed: f64,
    back: bool,
    /// Remaining pause, seconds; infinite at the end of the last lap.
    wait: f64,
    /// On a closed path with a pause: the pause is over, but the start has not been passed yet.
    rested: bool,
    heading: f64,
    walked: f64,
    cruise: f64,
    /// Seconds without progress.
    blocked: f64,
    pauses: u64,
    seed: u64,
    number: u64,
}

/// The space that an actor may need until it stands still: discs, which are compared with those of the others.
#[derive(Clone, Debug, Default)]
pub(super) struct Claim {
    centre: DVec2,
    reach: f64,
    up: f64,
    radius: f64,
    /// Empty until someone comes near.
    discs: Vec<DVec2>,
}

/// What an actor that may have to step aside knows about another one.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Neighbour {
    pub(super) at: DVec2,
    pub(super) velocity: DVec2,
    pub(super) radius: f64,
}

impl Course {
    /// The course of an actor; if `ground` is given, it follows the ground.
    pub(crate) fn new(actor: &Actor, ground: Option<&crate::collide::Collider>) -> Self {
        let limits = match actor.motion.gait {
            Gait::Walk => WALKING,
            Gait::Drive => DRIVING,
        };
        let route = Route::new(&actor.motion, limits.lateral, limits.braking, ground);
        Self { motion: actor.motion.clone(), route, body: Footprint::of(actor), limits }
    }

    /// The start position.
    pub(crate) fn start(&self) -> ActorPlace {
        self.place(&self.begin(0, 0))
    }

    /// Sets the start position, as a fraction of the path.
    pub(crate) fn set_start(&mut self, start: f64) {
        self.motion.start = start;
    }

    /// Its path on the map, a point at least every half metre, and the half width of its body.
    pub(crate) fn way(&self) -> (Vec<DVec2>, f64) {
        (self.route.points(), self.body.radius)
    }

    /// The initial state. Random values (pauses, a cruising speed up to a tenth below the given one) follow from the
    /// seed and the actor's number.
    pub(super) fn begin(&self, seed: u64, number: u64) -> State {
        let along = self.motion.start * self.route.length();
        State {
            along,
            aside: 0.0,
            speed: 0.0,
            back: false,
            wait: 0.0,
            rested: false,
            heading: bearing(self.route.at(along).direction),
            walked: 0.0,
            cruise: self.motion.speed * (1.0 - 0.1 * RandomStream::new(seed, "cruise", &[number]).uniform()),
            blocked: 0.0,
            pauses: 0,
            seed,
            number,
        }
    }

    /// Its position in the world.
    pub(super) fn place(&self, state: &State) -> ActorPlace {
        let (at, up, heading, pitch) = if self.body.axle > 0.0 {
            let (rear, front) = (self.route.at(state.along - self.body.axle), self.route.at(state.along + self.body.axle));
            let body = front.at - rear.at;
            let pitch = libm::atan2(front.up - rear.up, body.length().max(1e-6));
            (0.5 * (rear.at + front.at), 0.5 * (rear.up + front.up), bearing(body), pitch)
        } else {
            let spot = self.route.at(state.along);
            (spot.at + spot.right() * state.aside, spot.up, state.heading, 0.0)
        };
        let position = EnuPosition { east: at.x, north: at.y, up };
        ActorPlace { position, heading, pitch, walked: state.walked, speed: state.speed }
    }

    /// Its state as others see it.
    pub(super) fn seen(&self, place: &ActorPlace) -> Neighbour {
        let ahead = DVec2::new(libm::sin(place.heading), libm::cos(place.heading));
        Neighbour { at: on_map(place), velocity: ahead * place.speed, radius: self.body.radius }
    }

    /// Writes the bounds of the space that it needs until it stands still at maximum braking into `claim`. `place` is
    /// the state's.
    pub(super) fn claim(&self, state: &State, place: &ActorPlace, claim: &mut Claim) {
        self.bound(state, place, self.stopping(state), claim);
    }

    /// The space itself, within bounds computed for the same state; does nothing if it is already known.
    pub(super) fn fill(&self, state: &State, claim: &mut Claim) {
        if claim.discs.is_empty() {
            self.cover(state, self.stopping(state), claim);
        }
    }

    /// The space that a person wants to enter next; none for a vehicle and for a person who stands for a while.
    pub(super) fn claim_ahead(&self, state: &State, place: &ActorPlace, claim: &mut Claim) -> bool {
        if self.body.axle > 0.0 || state.wait > 0.0 {
            return false;
        }
        let way = GIVE_WAY_DISTANCE.min(self.left(state));
        self.bound(state, place, way, claim);
        self.cover(state, way, claim);
        true
    }

    fn bound(&self, state: &State, place: &ActorPlace, way: f64, claim: &mut Claim) {
        claim.centre = on_map(place);
        claim.reach = self.body.reach + way + 2.0 * libm::fabs(state.aside);
        claim.up = place.position.up;
        claim.radius = self.body.radius;
        claim.discs.clear();
    }

    fn cover(&self, state: &State, way: f64, claim: &mut Claim) {
        let samples = (way / self.limits.sample).ceil().max(1.0) as u32;
        let sign = if state.back { -1.0 } else { 1.0 };
        for k in 0..=samples {
            let ahead = sign * way * f64::from(k) / f64::from(samples);
            self.discs(&State { along: state.along + ahead, ..*state }, &mut claim.discs);
        }
    }

    /// Stopping distance, metres.
    fn stopping(&self, state: &State) -> f64 {
        (state.speed * state.speed / (2.0 * self.limits.stopping)).min(self.left(state))
    }

    fn discs(&self, state: &State, discs: &mut Vec<DVec2>) {
        let place = self.place(state);
        let at = on_map(&place);
        let forward = DVec2::new(libm::sin(place.heading), libm::cos(place.heading));
        discs.extend(self.body.offsets.iter().map(|offset| at + forward * *offset));
    }

    /// Clearance from others when it moves on.
    pub(super) fn gap(&self) -> f64 {
        self.limits.gap
    }

    /// Whether it has waited long enough for places that others only want to enter.
    pub(super) fn is_impatient(state: &State) -> bool {
        state.blocked > PATIENCE
    }

    /// Metres to its next stop; infinite on a closed path without a pause.
    fn left(&self, state: &State) -> f64 {
        if self.route.closed() && (self.motion.wait <= 0.0 || state.rested) {
            return f64::INFINITY;
        }
        let left = if state.back { state.along } else { self.route.length() - state.along };
        left.max(0.0)
    }

    /// The next state: the best one for which `is_free` accepts the space that it needs. Maximum braking is always
    /// possible.
    pub(super) fn next(
        &self,
        state: &State,
        others: &[Neighbour],
        mut is_free: impl FnMut(&State, &ActorPlace) -> bool,
    ) -> State {
        let mut now = *state;
        if now.wait > 0.0 {
            return self.resting(now);
        }
        if self.left(&now) < ARRIVED {
            return self.arrived(now);
        }
        if Self::is_impatient(&now) && self.body.axle <= 0.0 && self.motion.round != PathEnd::Once {
            (now.back, now.blocked) = (!now.back, 0.0);
        }
        let spot = self.route.at(now.along);
        let ahead = if now.back { -spot.direction } else { spot.direction };
        let facing = self.body.axle > 0.0 || Self::turn_towards(&mut now, bearing(ahead)) < FACING;
        let foreseen = libm::sqrt(2.0 * self.limits.braking * self.left(&now));
        let limit = self.route.speed_limit(now.along, now.back).min(now.cruise).min(foreseen);
        let least = (now.speed - self.limits.stopping * STEP).max(0.0);
        let best = if facing { limit.min(now.speed + self.limits.speeding * STEP).max(least) } else { least };
        let aim = self.step_aside(&now, &spot, others);
        let shift = (aim - now.aside).clamp(-ASIDE_SPEED * STEP, ASIDE_SPEED * STEP);
        let milder = (now.speed - 0.5 * self.limits.stopping * STEP).max(0.0);
        for speed in [best, now.speed.min(best), milder.min(best), least] {
            for shift in [shift, 0.0] {
                let next = self.moved(&now, speed, shift);
                if is_free(&next, &self.place(&next)) {
                    return next;
                }
            }
        }
        self.moved(&now, least, 0.0)
    }

    fn moved(&self, now: &State, speed: f64, shift: f64) -> State {
        let way = speed * STEP;
        let along = self.route.wrapped(now.along + if now.back { -way } else { way });
        let rested = now.rested && along > 0.5 * self.route.length();
        let walked = now.walked + way + libm::fabs(shift);
        let blocked = if speed > 0.0 || shift != 0.0 { 0.0 } else { now.blocked + STEP };
        State { along, aside: now.aside + shift, speed, rested, walked, blocked, ..*now }
    }

    fn resting(&self, mut state: State) -> State {
        state.speed = 0.0;
        state.wait -= STEP;
        if state.wait <= 0.0 {
            state.wait = 0.0;
            match self.motion.round {
                PathEnd::ThereAndBack => state.back = !state.back,
                PathEnd::Circle => state.rested = true,
                PathEnd::Once => {}
            }
        }
        state
    }

    fn arrived(&self, mut state: State) -> State {
        state.speed = 0.0;
        state.pauses += 1;
        state.wait = match self.motion.round {
            PathEnd::Once => f64::INFINITY,
            // At least one tick: the pause is where it turns round.
            PathEnd::Circle | PathEnd::ThereAndBack => {
                let fraction = RandomStream::new(state.seed, "pause", &[state.number, state.pauses]).uniform();
                (self.motion.wait * (0.5 + fraction)).max(STEP)
            }
        };
        state
    }

    /// Turns a person towards a heading; returns the remaining angle, radians.
    fn turn_towards(state: &mut State, heading: f64) -> f64 {
        let off = wrap_angle(heading - state.heading);
        state.heading = wrap_angle(state.heading + off.clamp(-TURN_RATE * STEP, TURN_RATE * STEP));
        libm::fabs(off)
    }

    /// Lateral offset at which a person wants to walk: to the right of the nearest person who stands or comes the other
    /// way, to the left if there is no space on the right, and on the path if nobody is in the way. Unchanged for
    /// vehicles.
    fn step_aside(&self, state: &State, spot: &Spot, others: &[Neighbour]) -> f64 {
        if self.motion.aside <= 0.0 {
            return state.aside;
        }
        let (right, sign) = (spot.right(), if state.back { -1.0 } else { 1.0 });
        let here = spot.at + right * state.aside;
        let mut nearest: Option<(f64, f64)> = None;
        for other in others {
            let (away, ahead) = (other.at - here, spot.direction * sign);
            // Too far away, or itself.
            if !(1e-6..NOTICED * NOTICED).contains(&away.length_squared()) {
                continue;
            }
            let (distance, beside) = (away.dot(ahead), state.aside + away.dot(right));
            let room = self.body.radius + other.radius + self.limits.gap + 0.1;
            let coming = other.velocity.dot(ahead) < 0.3 * state.cruise && libm::fabs(other.velocity.dot(right)) < 0.5;
            let in_the_way = libm::fabs(beside) < room && (-room..room + 3.0).contains(&distance);
            if coming && in_the_way && nearest.is_none_or(|(d, _)| distance < d) {
                let keep_right = beside + sign * room;
                let keep_left = beside - sign * room;
                let fits = |aside: f64| libm::fabs(aside) <= self.motion.aside;
                let aim = if fits(keep_right) {
                    keep_right
                } else if fits(keep_left) {
                    keep_left
                } else {
                    0.0
                };
                nearest = Some((distance, aim));
            }
        }
        nearest.map_or(0.0, |(_, aim)| aim)
    }
}

impl Claim {
    /// Sets it to the space of a craft, in the air or on the ground.
    pub(super) fn take_craft(&mut self, position: EnuPosition, radius: f64) {
        let centre = DVec2::new(position.east, position.north);
        (self.centre, self.reach, self.up, self.radius) = (centre, radius, position.up, radius);
        self.discs.clear();
        self.discs.push(centre);
    }

    /// Whether these bounds come closer than `gap`, so that the discs must be compared.
    pub(super) fn near(&self, other: &Self, gap: f64) -> bool {
        let reach = self.reach + other.reach + gap;
        libm::fabs(self.up - other.up) < STOREY && self.centre.distance_squared(other.centre) < reach * reach
    }

    /// Whether the space itself does.
    pub(super) fn meets(&self, other: &Self, gap: f64) -> bool {
        let room = self.radius + other.radius + gap;
        let close = |a: &DVec2, b: &DVec2| a.distance_squared(*b) < room * room;
        self.near(other, gap) && self.discs.iter().any(|a| other.discs.iter().any(|b| close(a, b)))
    }
}

fn on_map(place: &ActorPlace) -> DVec2 {
    DVec2::new(place.position.east, place.position.north)
}

/// Heading of a direction on the map, clockwise from north.
fn bearing(direction: DVec2) -> f64 {
    libm::atan2(direction.x, direction.y)
}

/// The space that an actor occupies at its start.
fn first_claim(course: &Course) -> Claim {
    let (state, mut claim) = (course.begin(0, 0), Claim::default());
    course.claim(&state, &course.place(&state), &mut claim);
    course.fill(&state, &mut claim);
    claim
}

/// Whether the start of an actor overlaps that of another.
pub(crate) fn begins_on<'a>(course: &Course, mut others: impl Iterator<Item = &'a Course>) -> bool {
    let own = first_claim(course);
    others.any(|other| own.meets(&first_claim(other), course.gap().min(other.gap())))
}

/// The first two courses whose starts overlap, by their indices in the list.
pub(crate) fn first_clash(courses: &[Course]) -> Option<(usize, usize)> {
    let claims: Vec<Claim> = courses.iter().map(first_claim).collect();
    let pairs = (0..courses.len()).flat_map(|j| (0..j).map(move |i| (i, j)));
    pairs.into_iter().find(|&(i, j)| claims[i].meets(&claims[j], courses[i].gap().min(courses[j].gap())))
}
