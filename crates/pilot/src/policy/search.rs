//! Looking for a target that is out of view (`docs/reference/reply.md`).

use core::f64::consts::{PI, TAU};

use super::coverage::Coverage;
use spf_core::craft::Craft;
use spf_core::geometry::wrap_angle;
use spf_core::lift::label_of_range;
use spf_core::primitives::Primitives;
use spf_core::reply::Look;

/// Fraction of the horizontal field of view per turn: one fifth overlaps, so that nothing is missed at a seam.
const TURN_FRACTION: f64 = 0.8;
/// Fraction of the field of view that a look covers: turns miss their heading by a few degrees.
const COVERED_FRACTION: f64 = 0.9;
/// Climb or descent of one look up or down, metres.
const VERTICAL_LOOK: f64 = 1.0;
/// Most metres of climbs and descents together before the target is flown to again.
const VERTICAL_SUM: f64 = 3.0;
/// A climb shorter than this shows nothing new, metres.
const WORTH_CLIMBING: f64 = 0.1;
/// Moves along the open way because the target is thought to be ahead, before turning begins.
const AHEAD_MOVES: u32 = 3;
/// Number of excursions to other positions. A target that does not exist costs three full turns.
const EXCURSIONS: u32 = 2;
/// Moves per excursion, each based on its own frame.
const EXCURSION_MOVES: u32 = 3;
/// An open direction within this angle of the direction back to the last excursion's start counts as leading back,
/// radians.
const BACK: f64 = 1.0;
/// Heading difference below which a direction counts as faced, radians.
const FACED: f64 = 0.1;
/// A way counts as open at most as far as the craft flies in this time, seconds: one that is open far beyond leads out of the
/// surroundings (out of a yard into the street), and shows little that has not been seen from here.
const NEARBY_S: f64 = 12.0;
/// The depth label of a way is that of half its free distance (`docs/reference/reply.md`).
const LABELLED_PART: f64 = 0.5;

/// An open direction reported in a reply.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpenDirection {
    /// Its heading, radians.
    pub heading: f64,
    /// Depth label of its end.
    pub depth: u8,
}

/// The next action of a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SearchAction {
    /// Turn or climb, then look again.
    Look(Primitives),
    /// Fly along the open direction of the reply, whose frame was taken in that direction, as if it were this deep.
    Fly {
        /// Depth label, at most that of the open direction.
        depth: u8,
    },
    /// The search is exhausted.
    Exhausted,
}

/// How a craft searches, fixed for a flight.
#[derive(Clone, Copy, Debug)]
struct Pattern {
    /// Angle per turn, radians, positive.
    turn: f64,
    /// Climb between the two full turns, metres.
    climb: f64,
    /// Highest depth label that counts.
    deepest: u8,
}

impl Pattern {
    /// A full turn of which nothing is observed yet.
    fn sweep(&self) -> Sweep {
        Sweep::new(COVERED_FRACTION / TURN_FRACTION * self.turn)
    }

    /// Maximum turns per full turn, twice those that it takes: a craft that cannot turn must not search for ever.
    fn most_turns(&self) -> u32 {
        2 * libm::ceil(TAU / self.turn.max(0.1)) as u32
    }
}

/// Stage of the search.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    /// Turning on the spot.
    Sweep,
    /// Has turned to the most open direction seen, to observe it again.
    Face,
    /// Flying along it, with this many moves left.
    Excursion(u32),
}

/// A full turn on the spot.
#[derive(Clone, Debug)]
struct Sweep {
    /// Headings for which a frame was answered. The initial view does not count: the sweep ends where it began.
    covered: Coverage,
    turns: u32,
    /// Whether the last action was one of its turns.
    turning: bool,
    /// The most open direction seen.
    open: Option<OpenDirection>,
}

impl Sweep {
    /// Nothing is observed yet; each look covers `angle`, radians.
    fn new(angle: f64) -> Self {
        Self { covered: Coverage::new(angle), turns: 0, turning: false, open: None }
    }

    /// Notes a look at this heading. It is the craft's actual one, not the intended one: a turn may have been cut short.
    fn look(&mut self, heading: f64) {
        if core::mem::take(&mut self.turning) {
            self.covered.look(heading);
        }
    }

    /// The next turn, at best by `wished` radians, and by just so many if they are `stated`: whoever says by how much has seen a reason
    /// for it. Whatever the replies ask for, each shows something new: left and right in turn
    /// are not a full circle.
    fn turn(&mut self, heading: f64, wished: f64, stated: bool) -> f64 {
        (self.turning, self.turns) = (true, self.turns + 1);
        if !stated && self.covered.contains(heading + wished) { self.covered.towards_gap(heading) } else { wished }
    }
}

/// The search: turn by 0.8 of the horizontal field of view; after a full turn climb once and turn again; then twice fly
/// along the most open direction reported and turn there; then give up. An open direction is flown only from a frame
/// taken in that direction. Of directions that are equally open, or open farther than the craft flies in 12 s, it takes the
/// one nearest to the heading at which the search began.
#[derive(Clone, Debug)]
pub struct Search {
    pattern: Pattern,
    stage: Stage,
    sweep: Sweep,
    /// Turned since the target was last seen, signed, clockwise positive.
    turned: f64,
    /// Climbs and descents since the target was last flown to, metres: looks up and down, the climb between the two
    /// turns, and those of a blocked path.
    vertical: f64,
    /// Moves ahead since the target was last seen.
    ahead: u32,
    /// Whether it has climbed between the two turns.
    climbed: bool,
    excursions: u32,
    /// Heading of the last excursion.
    gone: Option<f64>,
    /// Heading of the first look: where the target was expected.
    expected: Option<f64>,
    /// Whether the second turn leads to the other side of that heading.
    both_sides: bool,
}

impl Search {
    /// A search with a camera of this horizontal field of view, radians, by a craft that climbs to its take-off height
    /// between the two turns.
    #[must_use]
    pub fn new(horizontal_fov: f64, craft: &Craft) -> Self {
        let pattern = Pattern {
            turn: TURN_FRACTION * horizontal_fov,
            climb: craft.take_off_height,
            deepest: label_of_range(LABELLED_PART * NEARBY_S * craft.cruise_speed),
        };
        Self::begin(pattern, Sweep::new(COVERED_FRACTION * horizontal_fov))
    }

    fn begin(pattern: Pattern, sweep: Sweep) -> Self {
        Self {
            pattern,
            stage: Stage::Sweep,
            sweep,
            turned: 0.0,
            vertical: 0.0,
            ahead: 0,
            climbed: false,
            excursions: 0,
            gone: None,
            expected: None,
            both_sides: false,
        }
    }

    /// Resets the search, since the target was seen and is flown to.
    pub fn reset(&mut self) {
        *self = Self::begin(self.pattern, self.pattern.sweep());
    }

    /// Resets the search, since the target was seen; climbs and descents still count until the target is flown to.
    pub fn seen(&mut self) {
        let vertical = self.vertical;
        self.reset();
        self.vertical = vertical;
    }

    /// Turns first to the side that is asked for, and then to the other: a target that was in view a moment ago is near that
    /// view.
    pub fn on_both_sides(&mut self) {
        self.both_sides = self.sweep.turns == 0;
    }

    /// Takes up to `wished` metres from those left for climbs and descents; returns what may be flown.
    pub fn take_vertical(&mut self, wished: f64) -> f64 {
        let taken = wished.min(VERTICAL_SUM - self.vertical).max(0.0);
        self.vertical += taken;
        taken
    }

    /// Turned since the target was last seen, radians, clockwise positive.
    #[must_use]
    pub fn turned(&self) -> f64 {
        self.turned
    }

    /// The next action after a look at `heading`, radians, that did not show the target but may have shown an open
    /// direction.
    pub fn next(&mut self, look: Look, heading: f64, way: Option<OpenDirection>) -> SearchAction {
        self.next_turning(look, None, heading, way)
    }

    /// The same after an answer that asks for a turn by `turn`, radians, clockwise positive.
    pub fn next_turning(&mut self, look: Look, turn: Option<f64>, heading: f64, way: Option<OpenDirection>) -> SearchAction {
        if let Some(way) = way
            && let Some(depth) = self.flight_along(way, look == Look::Ahead && turn.is_none())
        {
            return SearchAction::Fly { depth };
        }
        if self.stage != Stage::Sweep {
            self.stage = Stage::Sweep;
            self.begin_sweep();
        }
        self.sweep.look(heading);
        self.compare(heading, way);
        if let Some(climb) = self.look_vertically(look) {
            return SearchAction::Look(Primitives { climb, ..Primitives::default() });
        }
        if self.sweep.covered.is_full() || self.sweep.turns >= self.pattern.most_turns() {
            return self.swept_all(heading, way);
        }
        let other_side = self.both_sides && self.sweep.turns == 1;
        let wished = match (turn, look) {
            _ if other_side => -2.0 * self.turned,
            (Some(turn), _) => turn,
            (None, Look::Left) => -self.pattern.turn,
            (None, Look::Behind) => PI,
            (None, _) => self.pattern.turn,
        };
        let yaw = self.sweep.turn(heading, wished, turn.is_some() && !other_side);
        self.turn_by(yaw)
    }

    /// The depth label of a flight along an open direction: on an excursion, or at first if the target is thought to be ahead,
    /// hidden or too far away, since closer to it, it may come into view.
    fn flight_along(&mut self, way: OpenDirection, is_thought_ahead: bool) -> Option<u8> {
        match self.stage {
            Stage::Sweep if is_thought_ahead && self.ahead < AHEAD_MOVES => {
                self.ahead += 1;
                self.begin_sweep();
            }
            Stage::Face | Stage::Excursion(1..) => {
                let left = if let Stage::Excursion(left) = self.stage { left } else { EXCURSION_MOVES };
                self.stage = Stage::Excursion(left - 1);
                self.gone = Some(way.heading);
            }
            Stage::Sweep | Stage::Excursion(0) => return None,
        }
        Some(way.depth.min(self.pattern.deepest))
    }

    /// Compares an open direction with the most open one so far. None leads back to where the last excursion began.
    fn compare(&mut self, heading: f64, way: Option<OpenDirection>) {
        let expected = *self.expected.get_or_insert(heading);
        let back = |way: &OpenDirection| self.gone.is_some_and(|gone| wrap_angle(way.heading - gone - PI).abs() < BACK);
        let rank = |way: OpenDirection| (way.depth.min(self.pattern.deepest), -wrap_angle(way.heading - expected).abs());
        if let Some(way) = way.filter(|way| !back(way) && self.sweep.open.is_none_or(|open| rank(*way) > rank(open))) {
            self.sweep.open = Some(way);
        }
    }

    /// The climb, negative for a descent, of a look up or down. The camera cannot tilt, and the space behind the craft has not
    /// been seen: objects below come into view from lower down.
    fn look_vertically(&mut self, look: Look) -> Option<f64> {
        let sign = match look {
            Look::Up => 1.0,
            Look::Down => -1.0,
            _ => return None,
        };
        let metres = self.take_vertical(VERTICAL_LOOK);
        (metres >= WORTH_CLIMBING).then_some(sign * metres)
    }

    /// After a full turn: climb once, then move elsewhere.
    fn swept_all(&mut self, heading: f64, way: Option<OpenDirection>) -> SearchAction {
        if !self.climbed {
            self.climbed = true;
            self.begin_sweep();
            let climb = self.take_vertical(self.pattern.climb);
            if climb >= WORTH_CLIMBING {
                return SearchAction::Look(Primitives { climb, ..Primitives::default() });
            }
            return self.next(Look::Right, heading, way);
        }
        let Some(open) = self.sweep.open.filter(|_| self.excursions < EXCURSIONS) else { return SearchAction::Exhausted };
        self.excursions += 1;
        self.stage = Stage::Face;
        let yaw = wrap_angle(open.heading - heading);
        if yaw.abs() < FACED && way.is_some() {
            return self.next(Look::Right, heading, way);
        }
        self.turn_by(yaw)
    }

    fn begin_sweep(&mut self) {
        self.sweep = self.pattern.sweep();
    }

    fn turn_by(&mut self, yaw: f64) -> SearchAction {
        self.turned += yaw;
        SearchAction::Look(Primitives { yaw, ..Primitives::default() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A quadrotor's search that climbs by 2 m.
    fn searching(horizontal_fov: f64) -> Search {
        Search::new(horizontal_fov, &Craft { take_off_height: 2.0, ..Craft::quad() })
    }

    /// The actions of a search whose replies always give `look`: degrees turned, `up`, `back`, `fly`; until it ends.
    fn flown(search: &mut Search, look: Look, way: impl Fn(f64) -> Option<OpenDirection>) -> Vec<String> {
        let (mut heading, mut out) = (0.0, Vec::new());
        while out.len() < 200 {
            match search.next(look, heading, way(heading)) {
                SearchAction::Exhausted => break,
                SearchAction::Fly { .. } => out.push("fly".to_owned()),
                SearchAction::Look(step) if step.climb > 0.0 => out.push(format!("up {}", step.climb)),
                SearchAction::Look(step) if step.climb < 0.0 => out.push(format!("down {}", -step.climb)),
                SearchAction::Look(step) => {
                    heading = wrap_angle(heading + step.yaw);
                    out.push(format!("{:.0}", step.yaw.to_degrees()));
                }
            }
        }
        out
    }

    #[test]
    fn turns_once_climbs_turns_again_and_gives_up() {
        // 90° field: turns of 72°, five to a circle.
        let mut search = searching(PI / 2.0);
        let circle = ["72"; 5];
        assert_eq!(flown(&mut search, Look::Right, |_| None), [&circle[..], &["up 2"], &circle].concat());
        search.reset();
        assert_eq!(search.turned(), 0.0);
        assert_eq!(flown(&mut search, Look::Left, |_| None)[..6], ["-72", "-72", "-72", "-72", "-72", "up 2"]);
    }

    #[test]
    fn both_sides_of_where_the_target_was_come_first() {
        let mut search = searching(PI / 2.0);
        search.on_both_sides();
        let turns = flown(&mut search, Look::Left, |_| None);
        // To the left, then as far to the right, and the rest of the circle once.
        assert_eq!(turns[..2], ["-72", "144"]);
        let first = turns.iter().position(|step| step.starts_with("up")).unwrap();
        assert!((5..=6).contains(&first), "{turns:?}");
        search.reset();
        assert_eq!(flown(&mut search, Look::Left, |_| None)[..2], ["-72", "-72"]);
    }

    #[test]
    fn looks_up_and_down_sum_to_three_metres_and_never_go_back() {
        for look in [Look::Up, Look::Down] {
            let mut search = searching(PI / 2.0);
            let seen = flown(&mut search, look, |_| None);
            let word = if look == Look::Up { "up 1" } else { "down 1" };
            assert_eq!(seen[..5], [word, word, word, "72", "72"], "{look:?}");
            assert_eq!(seen.iter().filter(|step| *step == word).count(), 3, "{look:?}");
        }
        let mut search = searching(PI / 2.0);
        let mut metres = 0.0;
        for look in [Look::Up, Look::Down].into_iter().cycle().take(40) {
            if let SearchAction::Look(step) = search.next(look, 0.0, None) {
                assert_eq!((step.forward, step.right), (0.0, 0.0));
                metres += if step.climb.abs() <= 1.0 { step.climb.abs() } else { 0.0 };
            }
        }
        assert_eq!(metres, 3.0);
    }

    #[test]
    fn the_climb_between_turns_counts_towards_the_three_metres() {
        let climbs = |search: &mut Search, looks: &[Look]| {
            let (mut heading, mut climbs) = (0.0, Vec::new());
            for n in 0..60 {
                match search.next(looks[n.min(looks.len() - 1)], heading, None) {
                    SearchAction::Look(Primitives { climb: 0.0, yaw, .. }) => heading = wrap_angle(heading + yaw),
                    SearchAction::Look(step) => climbs.push(step.climb),
                    SearchAction::Fly { .. } | SearchAction::Exhausted => break,
                }
            }
            climbs
        };
        let mut search = searching(PI / 2.0);
        assert_eq!(climbs(&mut search, &[Look::Right]), [2.0]);
        search.reset();
        assert_eq!(climbs(&mut search, &[Look::Up, Look::Down, Look::Right]), [1.0, -1.0, 1.0]);
        search.reset();
        assert_eq!(climbs(&mut search, &[Look::Up, Look::Up, Look::Up, Look::Right]), [1.0, 1.0, 1.0]);
        // Seen and lost again: only what is flown to starts the sum anew.
        search.seen();
        assert_eq!(climbs(&mut search, &[Look::Up, Look::Right]), [0.0; 0]);
    }

    #[test]
    fn goes_along_the_most_open_way_that_it_saw_and_not_back() {
        let mut search = searching(PI / 2.0);
        // Open to the south-east and nearly as open to the north-west; elsewhere there is a wall.
        let open = |heading: f64| {
            let off = |to: f64| wrap_angle(heading - to).abs() < 0.5;
            let depth = if off(2.5) {
                8
            } else if off(2.5 - PI) {
                7
            } else {
                2
            };
            Some(OpenDirection { heading, depth })
        };
        let seen = flown(&mut search, Look::Right, open);
        let circle = ["72"; 5];
        // 144° is where it observed the south-east. The direction back lies at -36°, and is left out the second time.
        let first = [&circle[..], &["up 2"], &circle, &["144", "fly", "fly", "fly"]].concat();
        assert_eq!(seen[..first.len()], first);
        let flights: Vec<usize> = seen.iter().enumerate().filter(|(_, step)| *step == "fly").map(|(i, _)| i).collect();
        assert_eq!(flights.len(), 6);
        let turned: f64 = seen[first.len()..flights[3]].iter().map(|step| step.parse::<f64>().unwrap()).sum();
        assert!(wrap_angle((144.0 + turned).to_radians() - 2.5).abs() < 0.5, "{seen:?}");
        assert_eq!(seen[flights[5] + 1..], circle);
    }

    #[test]
    fn a_slow_craft_stays_near_and_looks_first_where_the_target_was_expected() {
        // A yard, seen by a Tello that looks into it: open to the street behind, and 10 m deep to both sides ahead.
        let way = |heading: f64| {
            let depth = if heading.abs() > 2.2 {
                8
            } else if heading.abs() > 0.4 {
                5
            } else {
                3
            };
            Some(OpenDirection { heading, depth })
        };
        let mut search = Search::new(PI / 2.0, &Craft::tello());
        let (mut heading, mut flown) = (0.0_f64, None);
        while flown.is_none() {
            match search.next(Look::Right, heading, way(heading)) {
                SearchAction::Fly { depth } => flown = Some(depth),
                SearchAction::Look(step) => heading = wrap_angle(heading + step.yaw),
                SearchAction::Exhausted => panic!("never flew"),
            }
        }
        assert!(heading.abs() < 1.3, "{heading}");
        assert_eq!(flown, Some(5));
        // A quadrotor flies along streets.
        assert_eq!(Search::new(PI / 2.0, &Craft::quad()).pattern.deepest, label_of_range(20.0));
    }

    #[test]
    fn what_does_not_look_open_when_faced_is_not_flown_to() {
        let mut search = searching(PI / 2.0);
        let (mut looks, mut heading) = (0, 0.0);
        let mut flew = false;
        for _ in 0..100 {
            looks += 1;
            // Twelve looks of the two sweeps show an open direction, and later ones do not.
            let way = (looks <= 12).then_some(OpenDirection { heading: 1.0, depth: 5 });
            match search.next(Look::Right, heading, way) {
                SearchAction::Exhausted => break,
                SearchAction::Fly { .. } => flew = true,
                SearchAction::Look(step) => heading = wrap_angle(heading + step.yaw),
            }
        }
        assert!(!flew && looks < 30, "{looks}");
    }

    #[test]
    fn left_right_left_and_behind_twice_are_no_full_turn() {
        for looks in [&[Look::Left, Look::Right][..], &[Look::Behind]] {
            let mut search = searching(PI / 2.0);
            let (mut heading, mut seen) = (0.0_f64, Vec::new());
            // Until the climb, which ends the first sweep.
            for n in 0.. {
                let SearchAction::Look(step) = search.next(looks[n % looks.len()], heading, None) else { panic!("{looks:?}") };
                if step.climb > 0.0 {
                    break;
                }
                heading = wrap_angle(heading + step.yaw);
                seen.push(heading);
                assert!(n < 12, "{looks:?}: {seen:?}");
            }
            // Each heading was within the camera's field of view once.
            let shown = |to: f64| seen.iter().any(|at| wrap_angle(at - to).abs() <= PI / 4.0);
            assert!((0..360).all(|degrees| shown(f64::from(degrees).to_radians())), "{looks:?}: {seen:?}");
        }
    }

    #[test]
    fn a_turn_that_was_cut_short_covers_only_what_it_showed() {
        let mut search = searching(PI / 2.0);
        let (mut heading, mut seen) = (0.0_f64, Vec::new());
        for n in 0.. {
            let SearchAction::Look(step) = search.next(Look::Right, heading, None) else { panic!("{seen:?}") };
            if step.climb > 0.0 {
                break;
            }
            // The second turn ends after a tenth.
            heading = wrap_angle(heading + if n == 1 { 0.1 * step.yaw } else { step.yaw });
            seen.push(heading);
        }
        let shown = |to: f64| seen.iter().any(|at| wrap_angle(at - to).abs() <= PI / 4.0);
        assert!((0..360).all(|degrees| shown(f64::from(degrees).to_radians())), "{seen:?}");
    }

    #[test]
    fn a_stated_turn_is_made_as_stated_and_all_around_at_most() {
        let mut search = searching(PI / 2.0);
        let (mut heading, mut turns) = (0.0, Vec::new());
        while let SearchAction::Look(step) = search.next_turning(Look::Right, Some(-0.5), heading, None) {
            if step.climb > 0.0 {
                break;
            }
            heading = wrap_angle(heading + step.yaw);
            turns.push(step.yaw);
        }
        assert!(turns.iter().all(|turn| (turn + 0.5).abs() < 1e-12) && turns.len() < 14, "{turns:?}");
    }

    #[test]
    fn what_is_thought_ahead_is_flown_towards_three_times() {
        let mut search = searching(PI / 2.0);
        let way = Some(OpenDirection { heading: 0.0, depth: 5 });
        assert!(matches!(search.next(Look::Ahead, 0.0, None), SearchAction::Look(step) if step.yaw > 0.0), "no way is open");
        search.reset();
        let flown = (0..20).take_while(|_| matches!(search.next(Look::Ahead, 0.0, way), SearchAction::Fly { .. })).count();
        assert_eq!(flown, 3);
    }

    #[test]
    fn ends_whatever_the_replies() {
        for looks in [[Look::Up, Look::Down], [Look::Left, Look::Right], [Look::Behind, Look::Left], [Look::Ahead, Look::Right]] {
            for way in [None, Some(OpenDirection { heading: 1.0, depth: 9 })] {
                let mut search = searching(1.0);
                let ended = (0..200).position(|i| search.next(looks[i % 2], 0.3 * i as f64, way) == SearchAction::Exhausted);
                assert!(ended.is_some_and(|n| n < 90), "{looks:?} {ended:?}");
            }
        }
    }
}
