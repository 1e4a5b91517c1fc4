//! Cleared commands respect the limits: for arbitrary events, and for a craft that flies them.

use proptest::prelude::*;

use super::*;
use spf_motion::estimator::{MotionEstimator, TelemetryAccuracy};

/// Anything that a telemetry report or a setpoint may contain.
fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![
        6 => -10.0..10.0_f64,
        2 => -400.0..400.0_f64,
        1 => prop::sample::select(vec![f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, f64::MIN_POSITIVE, -0.0]),
    ]
}

fn any_setpoint() -> impl Strategy<Value = Setpoint> {
    [any_number(), any_number(), any_number(), any_number()].prop_map(|[right, forward, up, yaw_rate]| Setpoint {
        right,
        forward,
        up,
        yaw_rate,
    })
}

#[derive(Clone, Debug)]
enum Event {
    Telemetry(Telemetry, i64),
    Frame { age: i64, counter: u64, unusable: bool },
    Reply(bool),
    Link(bool),
    Command(Command),
    Manual(Setpoint),
}

fn any_event() -> impl Strategy<Value = Event> {
    let position = prop::option::of([any_number(), any_number(), any_number()].prop_map(|[east, north, up]| EnuPosition {
        east,
        north,
        up,
    }));
    let velocity = prop::option::of([any_number(), any_number(), any_number()].prop_map(|[east, north, up]| EnuVelocity {
        east,
        north,
        up,
    }));
    let phase = prop::sample::select(vec![
        FlightPhase::OnGround,
        FlightPhase::TakingOff,
        FlightPhase::Flying,
        FlightPhase::Flying,
        FlightPhase::Flying,
        FlightPhase::Landing,
        FlightPhase::Stopped,
    ]);
    let telemetry = (
        (position, velocity, any_number(), prop::option::of(any_number())),
        (prop::option::of(any_number()), phase, prop::bool::weighted(0.02), -200..2000_i64),
    );
    prop_oneof![
        4 => telemetry.prop_map(|((position, velocity, heading, height), (battery, phase, crashed, age))| {
            let attitude = Attitude { heading, ..Attitude::default() };
            Event::Telemetry(
                Telemetry { position, velocity, attitude, height, battery, phase, crashed, ..Telemetry::default() }, age)
        }),
        4 => (-200..2000_i64, 0..20u64, prop::bool::weighted(0.1))
            .prop_map(|(age, counter, unusable)| Event::Frame { age, counter, unusable }),
        1 => any::<bool>().prop_map(Event::Reply),
        1 => any::<bool>().prop_map(Event::Link),
        6 => any_setpoint().prop_map(|s| Event::Command(Command::Setpoint(s))),
        1 => prop::sample::select(vec![Command::TakeOff, Command::Land, Command::EmergencyStop]).prop_map(Event::Command),
        2 => any_setpoint().prop_map(Event::Manual),
    ]
}

fn ago(now: Time, millis: i64) -> Time {
    Time::from_nanos(now.as_nanos().saturating_add_signed(-millis * 1_000_000))
}

fn within(is: Setpoint, requested: Setpoint, limits: &Limits) -> Result<(), TestCaseError> {
    prop_assert!(is.is_finite(), "{is:?}");
    let slack = 1.0 + 1e-12;
    prop_assert!(libm::hypot(is.right, is.forward) <= limits.max_speed * slack, "{is:?}");
    prop_assert!(is.up.abs() <= limits.max_climb && is.yaw_rate.abs() <= limits.max_yaw_rate, "{is:?}");
    if requested.is_finite() && libm::hypot(requested.right, requested.forward) < 1e6 {
        // Limited, slid or stopped; never more than requested, never in the opposite direction.
        prop_assert!(libm::hypot(is.right, is.forward) <= libm::hypot(requested.right, requested.forward) * slack + 1e-9);
        prop_assert!(is.right * requested.right + is.forward * requested.forward >= -1e-9, "{is:?} of {requested:?}");
        prop_assert!(is.up * requested.up >= 0.0 && is.up.abs() <= requested.up.abs());
        prop_assert!(is.yaw_rate * requested.yaw_rate >= 0.0 && is.yaw_rate.abs() <= requested.yaw_rate.abs());
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    /// For any inputs, in any order and at any times: finite, within the limits, and no motion without cause.
    #[test]
    fn whatever_goes_in_what_comes_out_is_bounded(
        events in prop::collection::vec((any_event(), -100..900_i64), 1..80), fence in any::<bool>()
    ) {
        let limits = Limits { geofence: fence.then(|| square(30.0, "{}")), ..Limits::default() };
        let mut envelope = Envelope::new(limits.clone(), Craft::quad());
        let mut now = ms(0);
        let mut fresh = None;
        for (event, step) in events {
            now = ago(now, -step);
            let latest = envelope.now.max(now);
            let (requested, clearance) = match event {
                Event::Telemetry(t, age) => {
                    let telemetry = Telemetry { time: ago(now, age), ..t };
                    envelope.observe_telemetry(now, &telemetry);
                    continue;
                }
                Event::Frame { age, counter, unusable } => {
                    let frame = FrameMeta { id: FrameId(0), captured: ago(now, age), received: now, capture_counter: counter,
                        width: 960, height: 720, unusable: unusable.then_some(spf_core::frame::Unusable::Blank) };
                    envelope.observe_frame(now, &frame);
                    if !unusable {
                        fresh = fresh.max(Some(frame.captured.min(latest)));
                    }
                    continue;
                }
                Event::Reply(ok) => { envelope.observe_reply(now, ok); continue }
                Event::Link(up) => { if up { envelope.link_restored(now) } else { envelope.link_lost(now) } continue }
                Event::Command(Command::Setpoint(requested)) => {
                    let clearance = envelope.clear(now, Command::Setpoint(requested)).expect("setpoints are never refused");
                    let is = clearance.setpoint().expect("a setpoint stays one");
                    if !is.is_hold() {
                        let seen = fresh.expect("no motion before the first frame");
                        prop_assert!(latest.since(seen) < Duration::from_secs(1), "no motion on stale frames");
                        prop_assert_eq!(envelope.estimate.phase, FlightPhase::Flying);
                        prop_assert!(matches!(envelope.reaction(latest), Reaction::Continue
                            | Reaction::Hold(Cause::AltitudeBreach | Cause::DistanceBreach | Cause::GeofenceBreach)));
                    }
                    (requested, clearance)
                }
                Event::Manual(requested) => (requested, envelope.clear_manual(now, requested)),
                Event::Command(Command::TakeOff) => {
                    if let Ok(clearance) = envelope.clear(now, Command::TakeOff) {
                        prop_assert_eq!(envelope.estimate.phase, FlightPhase::OnGround);
                        prop_assert_eq!(clearance.cleared.get(), &Command::TakeOff);
                    }
                    continue;
                }
                Event::Command(command) => {
                    let clearance = envelope.clear(now, command).expect("never refused");
                    prop_assert_eq!(clearance.cleared.get(), &command);
                    continue;
                }
            };
            let is = clearance.setpoint().expect("a setpoint stays one");
            within(is, requested, &limits)?;
            prop_assert_eq!(clearance.changed.is_none(), is == requested || (is.is_hold() && requested.is_hold()));
            prop_assert_eq!(clearance.cleared.valid_until(), latest + Duration::from_millis(500));
            prop_assert!(envelope.next_deadline(latest).is_some_and(|at| at > latest));
        }
    }

    /// From any position and at any velocity: the point that the setpoint can still reach is inside, or closer to it.
    #[test]
    fn the_reach_of_what_leaves_is_inside(
        place in (-32.0..32.0_f64, -32.0..32.0_f64, 0.4..11.0_f64), heading in -3.0..3.0_f64,
        velocity in (-3.0..3.0_f64, -3.0..3.0_f64, -1.0..1.0_f64), requested in any_setpoint().prop_filter("a number", |s| s.is_finite()), max_distance in 10.0..45.0_f64,
    ) {
        reach_is_inside(place, heading, velocity, requested, max_distance)?;
    }
}

/// Turning while flying back, the craft must not enter on one side and leave on another.
#[test]
fn a_return_that_turns_ends_inside() {
    let requested = Setpoint { right: 0.0, forward: 247.48767999337304, up: 0.0, yaw_rate: -1.4317031117876124 };
    reach_is_inside((-26.374545365294615, -30.66691734644264, 0.4), 0.0, (0.0, 0.0, 0.0), requested, 44.4090247433437).unwrap();
}

/// A fence with a notch and a hole, and a craft at `place` (east, north, up; m) that moves at `velocity` and is
/// `requested` to move.
fn reach_is_inside(
    place: (f64, f64, f64),
    heading: f64,
    velocity: (f64, f64, f64),
    requested: Setpoint,
    max_distance: f64,
) -> Result<(), TestCaseError> {
    let fence = Geofence::from_geojson(
        r#"{"type": "Feature", "properties": {"max_altitude_m": 10}, "geometry": {"type": "Polygon", "coordinates": [
            [[-30, -30], [30, -30], [30, 30], [0, 5], [-30, 30], [-30, -30]], [[-5, -20], [5, -20], [0, -10], [-5, -20]]]}}"#,
    )
    .unwrap();
    let limits = Limits { max_distance, geofence: Some(fence.clone()), ..Limits::default() };
    let mut rig = Rig::flying(limits.clone());
    rig.place(place.0, place.1, place.2);
    rig.telemetry.velocity = Some(EnuVelocity { east: velocity.0, north: velocity.1, up: velocity.2 });
    rig.telemetry.attitude.heading = heading;
    rig.fresh(ms(1100));
    let (is, _) = rig.ask(ms(1100), requested);
    within(is, requested, &limits)?;

    let craft = Craft::quad();
    let delay = 0.5 + craft.dead_time + craft.lag;
    let reach = |v: f64, a: f64| v * delay + v * v.abs() / (2.0 * a);
    let (east, north) = (place.0 + velocity.0 * 0.1, place.1 + velocity.1 * 0.1);
    let up = place.2 + velocity.2 * 0.1;
    let top = up + reach(is.up, craft.climb_acceleration);
    prop_assert!(top <= 10.0 - 0.5 + 1e-9 || is.up <= 0.0, "{top}");
    prop_assert!(top >= 0.3 - 1e-9 || is.up >= 0.0, "{top}");
    let speed = libm::hypot(is.right, is.forward);
    if speed == 0.0 {
        return Ok(());
    }
    let inside = |at: EnuPosition| fence.contains_below_ceiling(at) && libm::hypot(at.east, at.north) <= max_distance;
    for turn in [0.0, 0.5, 1.0] {
        let body = heading + turn * is.yaw_rate * (0.5 + craft.dead_time);
        let (sin, cos) = (libm::sin(body), libm::cos(body));
        let (de, dn) = ((is.right * cos + is.forward * sin) / speed, (is.forward * cos - is.right * sin) / speed);
        let end = reach(speed, craft.acceleration);
        let at = |t: f64, up: f64| EnuPosition { east: east + de * t, north: north + dn * t, up };
        if inside(at(0.0, up)) {
            for i in 0..=50 {
                let p = at(end * f64::from(i) / 50.0, up.max(top));
                prop_assert!(inside(p), "{p:?} of {is:?} from {place:?}");
            }
        } else {
            // Flying back: it ends inside, or at least nearer.
            let away = |p: EnuPosition| (-fence.edge_distance(p)).max(0.0).max(libm::hypot(p.east, p.north) - max_distance);
            prop_assert!(inside(at(end, up)) || away(at(end, up)) <= away(at(0.0, up)) + 1e-9);
        }
    }
    Ok(())
}

/// A craft that follows setpoints with dead time, lag and an acceleration limit (`docs/reference/dynamics.md`), without wind.
pub(super) struct Body {
    pub(super) craft: Craft,
    pub(super) at: EnuPosition,
    pub(super) v: EnuVelocity,
    pub(super) heading: f64,
    pub(super) yaw_rate: f64,
    /// The setpoints sent, with their expiry, newest last.
    pub(super) sent: Vec<(Time, Setpoint, Time)>,
}

impl Body {
    const STEP: f64 = 0.01;

    pub(super) fn step(&mut self, now: Time) {
        let effective = now - duration_from_secs(self.craft.dead_time);
        let is = self.sent.iter().rfind(|(at, _, until)| *at <= effective && effective < *until);
        let is = is.map_or(Setpoint::HOLD, |s| s.1);
        let goal = reach::world_velocity(is, self.heading);
        let pull = |goal: f64, v: f64| (goal - v) / self.craft.lag;
        let (ae, an) = (pull(goal.east, self.v.east), pull(goal.north, self.v.north));
        let fraction = (self.craft.acceleration / libm::hypot(ae, an).max(1e-9)).min(1.0);
        let a_up = pull(goal.up, self.v.up).clamp(-self.craft.climb_acceleration, self.craft.climb_acceleration);
        self.v.east += ae * fraction * Self::STEP;
        self.v.north += an * fraction * Self::STEP;
        self.v.up += a_up * Self::STEP;
        self.at.east += self.v.east * Self::STEP;
        self.at.north += self.v.north * Self::STEP;
        self.at.up += self.v.up * Self::STEP;
        self.yaw_rate += pull(is.yaw_rate, self.yaw_rate) * Self::STEP;
        self.heading += self.yaw_rate * Self::STEP;
    }
}

/// Flies setpoints at full stick, each for a while, with exact telemetry at 10 Hz; returns the minimum distance to the
/// fence, to the distance limit, to floor and ceiling, and the maximum distance from the origin. No commands are sent
/// between `silent` (a dead pilot).
fn fly(craft: Craft, told: bool, seed: u64, silent: (Time, Time)) -> [f64; 4] {
    let fence = Geofence::from_geojson(
        r#"{"type": "Polygon", "coordinates": [[[-12, -8], [12, -8], [12, 10], [0, 4], [-12, 10], [-12, -8]]]}"#,
    )
    .unwrap();
    let limits = Limits { geofence: Some(fence.clone()), max_distance: 12.0, max_altitude: 8.0, ..Limits::for_craft(&craft) };
    let mut rig = Rig::flying(limits);
    rig.envelope = Envelope::new(rig.envelope.limits().clone(), craft);
    let mut body = Body {
        craft,
        at: EnuPosition { up: 3.0, ..EnuPosition::default() },
        v: EnuVelocity::default(),
        heading: 0.0,
        yaw_rate: 0.0,
        sent: Vec::new(),
    };
    let mut draw = spf_core::rng::RandomStream::new(seed, "flight", &[]);
    let mut requested = Setpoint::HOLD;
    let mut least = [f64::INFINITY, f64::INFINITY, f64::INFINITY, 0.0];
    for tick in 0..12_000_u64 {
        let now = ms(10 * tick);
        if tick.is_multiple_of(150) {
            let mut stick = |limit: f64| (2.0 * draw.uniform() - 1.0) * 2.0 * limit;
            requested = Setpoint { right: stick(4.0), forward: stick(6.0), up: stick(2.0), yaw_rate: stick(1.5) };
        }
        if tick.is_multiple_of(10) {
            rig.telemetry.position = told.then_some(body.at);
            rig.telemetry.height = Some(body.at.up);
            rig.telemetry.velocity = Some(body.v);
            rig.telemetry.attitude.heading = body.heading;
            rig.telemetry.phase = if tick == 0 { FlightPhase::OnGround } else { FlightPhase::Flying };
            if tick == 0 {
                rig.place(0.0, 0.0, 0.0);
                rig.telemetry.position = rig.telemetry.position.filter(|_| told);
            }
            rig.fresh(now);
            if tick > 0 && !(silent.0..silent.1).contains(&now) {
                let clearance = rig.envelope.clear_setpoint(now, requested);
                assert!(!matches!(rig.envelope.reaction(now), Reaction::Land(_)), "at {now}");
                body.sent.push((now, clearance.setpoint().unwrap(), clearance.cleared.valid_until()));
                let old = body.sent.len().saturating_sub(20);
                body.sent.drain(..old);
            }
        }
        body.step(now);
        let far = libm::hypot(body.at.east, body.at.north);
        least[0] = least[0].min(fence.edge_distance(body.at));
        least[1] = least[1].min(12.0 - far);
        least[2] = least[2].min((body.at.up - 0.3).min(8.0 - body.at.up));
        least[3] = least[3].max(far);
    }
    least
}

#[test]
fn a_craft_at_full_stick_stays_inside() {
    for craft in [Craft::quad(), Craft::tello()] {
        for told in [true, false] {
            for seed in 0..8 {
                let [fence, distance, altitude, farthest] = fly(craft, told, seed, (Time::MAX, Time::MAX));
                assert!(fence > 0.0 && distance > 0.0 && altitude > -0.05, "{seed} {told}: {fence} {distance} {altitude}");
                // It did move, and up to the limits.
                assert!(farthest > 8.0, "{farthest}");
            }
        }
    }
}

/// A position source states its deviation; a craft that is told to fly outwards all the time stays inside also while it seems
/// to be farther from the fence than it is by three of them, or by less.
#[test]
fn a_position_off_by_three_stated_deviations_keeps_the_craft_inside() {
    let (craft, accuracy) = (Craft::quad(), TelemetryAccuracy::quad());
    let fence = square(20.0, "{}");
    let mut rig = Rig::flying(Limits { geofence: Some(fence.clone()), ..Limits::for_craft(&craft) });
    let mut estimator = MotionEstimator::new(&craft, accuracy);
    let at = EnuPosition { up: 3.0, ..EnuPosition::default() };
    let mut body = Body { craft, at, v: EnuVelocity::default(), heading: 0.0, yaw_rate: 0.0, sent: Vec::new() };
    let (mut least, mut nearest_measured) = (f64::INFINITY, f64::INFINITY);
    for tick in 0..12_000_u64 {
        let now = ms(1000 + 10 * tick);
        if tick.is_multiple_of(10) {
            let error = 3.0 * accuracy.position_noise * libm::sin(0.1 * now.as_secs_f64()).abs();
            let measured = EnuPosition { north: body.at.north - error, ..body.at };
            nearest_measured = nearest_measured.min(fence.edge_distance(measured));
            rig.telemetry.position = Some(measured);
            rig.telemetry.height = Some(body.at.up);
            rig.telemetry.velocity = Some(body.v);
            estimator.observe(&Telemetry { time: now, ..rig.telemetry });
            rig.envelope.observe_spread(estimator.spread());
            rig.fresh(now);
            let clearance = rig.envelope.clear_setpoint(now, forward(craft.cruise_speed));
            assert!(!matches!(rig.envelope.reaction(now), Reaction::Land(_)), "at {now}");
            body.sent.push((now, clearance.setpoint().unwrap(), clearance.cleared.valid_until()));
            let old = body.sent.len().saturating_sub(20);
            body.sent.drain(..old);
        }
        body.step(now);
        least = least.min(fence.edge_distance(body.at));
    }
    // It flew up to the limit.
    assert!(least > 0.0 && nearest_measured < 1.2, "{least} {nearest_measured}");
}

#[test]
fn a_craft_whose_pilot_falls_silent_stops_inside() {
    for seed in 0..8 {
        for from in [20_050, 43_210] {
            let [fence, distance, altitude, _] = fly(Craft::quad(), true, seed, (ms(from), ms(from + 8000)));
            assert!(fence > 0.0 && distance > 0.0 && altitude > -0.05, "{seed}: {fence} {distance} {altitude}");
        }
    }
}

/// The stop rule: at most the printed time from the zero setpoint to below 0.1 m/s.
#[test]
fn standstill_follows_within_the_printed_time() {
    for craft in [Craft::quad(), Craft::tello()] {
        for speed in [0.3, 1.0, craft.cruise_speed, 1.5 * craft.cruise_speed] {
            let mut body = Body {
                craft,
                at: EnuPosition::default(),
                v: EnuVelocity { north: speed, ..EnuVelocity::default() },
                heading: 0.0,
                yaw_rate: 0.0,
                sent: vec![(ms(0), forward(speed), ms(1000)), (ms(1000), Setpoint::HOLD, Time::MAX)],
            };
            let mut now = ms(500);
            while now < ms(1000) || body.v.north > 0.1 {
                body.step(now);
                now += Duration::from_millis(10);
            }
            let took = now.since(ms(1000)).as_secs_f64();
            let printed = craft.standstill_time(speed);
            assert!(took <= printed + 0.02 && took > printed - 0.3, "{speed} m/s: {took} s, printed {printed} s");
        }
    }
}
