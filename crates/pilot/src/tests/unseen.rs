//! No motion backwards into space that no frame has shown, and vertical search moves between floor and ceiling.

use super::*;
use crate::policy::{Output, Policy, PolicyEvent};
use spf_core::frame::FrameId;
use spf_core::primitives::Primitives;

/// Flies moves one after the other, whatever the frames show; a refused one is over.
struct Moves {
    left: VecDeque<Primitives>,
    moving: bool,
}

impl Moves {
    fn of(moves: &[Primitives]) -> Self {
        Self { left: moves.iter().copied().collect(), moving: false }
    }
}

impl Policy for Moves {
    fn name(&self) -> &'static str {
        "moves"
    }

    fn handle(&mut self, event: PolicyEvent<'_>) -> Output {
        let step = match event {
            PolicyEvent::Frame(_) | PolicyEvent::MoveEnded { completed: true } => match self.left.pop_front() {
                Some(primitives) => {
                    self.moving = true;
                    Step::Move(Move { primitives, anchor: None, then_rest: true, looks: false })
                }
                None => Step::Wait,
            },
            _ => Step::Wait,
        };
        step.into()
    }
}

fn forward(metres: f64) -> Primitives {
    Primitives { forward: metres, ..Primitives::default() }
}

fn climb(metres: f64) -> Primitives {
    Primitives { climb: metres, ..Primitives::default() }
}

fn turn(degrees: f64) -> Primitives {
    Primitives { yaw: degrees.to_radians(), ..Primitives::default() }
}

/// Flies the moves for `seconds` in the air; returns the end position forward of the start, and the climb.
fn flown(limits: Limits, moves: &[Primitives], seconds: f64) -> (Flight, f64, f64) {
    let mut setup = Setup::preset(Preset::Default).policy(Moves::of(moves));
    setup.limits = limits;
    let mut flight = setup.fly(|_, _| Answer::Never);
    flight.until_phase(Phase::Flying);
    let start = flight.model.position;
    flight.pass(seconds);
    let end = flight.model.position;
    (flight, end.north - start.north, end.up - start.up)
}

fn limited(flight: &Flight) -> usize {
    flight.notes.iter().filter(|(_, note)| matches!(note, Note::Limited(_))).count()
}

#[test]
fn no_motion_goes_backwards_into_what_has_not_been_seen_or_flown_through() {
    // The camera has only faced north.
    let (flight, moved, _) = flown(Limits::default(), &[forward(-2.0)], 8.0);
    assert!(moved.abs() < 0.05 && limited(&flight) == 1, "{moved} m");
    // The rest of a move is flown.
    let (flight, moved, up) = flown(Limits::default(), &[Primitives { forward: -2.0, climb: 1.0, ..Primitives::default() }], 8.0);
    assert!(moved.abs() < 0.1 && (0.8..1.6).contains(&up) && limited(&flight) == 1, "{moved} m, {up} m");
    // Back to where it has just come from, and no farther.
    let (flight, moved, _) = flown(Limits::default(), &[forward(1.5), forward(-1.0)], 10.0);
    assert!((moved - 0.5).abs() < 0.3 && limited(&flight) == 0, "{moved} m");
    let (flight, moved, _) = flown(Limits::default(), &[forward(1.5), forward(-6.0)], 10.0);
    assert!((moved - 1.5).abs() < 0.3 && limited(&flight) == 1, "{moved} m");
    // Where it flew through 6 s before, and no frame of the last 3 s has shown it.
    let (flight, moved, _) = flown(Limits::default(), &[forward(1.5), turn(170.0), turn(-170.0), forward(-1.0)], 14.0);
    assert!((moved - 0.5).abs() < 0.3 && limited(&flight) == 0, "{moved} m");
    // Away from the space just observed.
    let (flight, moved, _) = flown(Limits::default(), &[turn(170.0), forward(-1.5)], 10.0);
    assert!((moved - 1.5).abs() < 0.5 && limited(&flight) == 0, "{moved} m");
}

/// Straight back nothing is known; to the right, an earlier reply has shown that nothing is near.
#[test]
fn where_a_reply_has_shown_a_way_aside_the_craft_backs_off_there() {
    let mut flight = Setup::preset(Preset::Default).policy(Moves::of(&[])).fly(|_, _| Answer::Never);
    flight.until_phase(Phase::Flying);
    flight.pass(1.0);
    let (now, start) = (flight.now, flight.model.position);
    let back = Move { primitives: forward(-1.0), anchor: None, then_rest: true, looks: false };
    flight.pilot.begin_move(now, back);
    flight.pass(3.0);
    assert!(flight.model.position.distance(start) < 0.1 && limited(&flight) == 1);
    let now = flight.now;
    let mut view = flight.pilot.senses.view.unwrap();
    view.pose.attitude.heading += core::f64::consts::FRAC_PI_2;
    let target_box = Some(ImageBox { left: 0.45, top: 0.4, right: 0.55, bottom: 0.6 });
    let reply = Reply { target_box, depth: Some(6), ..Reply::new(Status::Navigating) };
    let (from, odometry) = (view.viewpoint(), flight.pilot.senses.odometry_at(view.frame.captured));
    // A reply that was not asked what is near says nothing of it.
    flight.pilot.space.reply(from, odometry, &reply, false);
    flight.pilot.begin_move(now, back);
    flight.pass(3.0);
    assert!(flight.model.position.distance(start) < 0.1 && limited(&flight) == 2);
    let now = flight.now;
    flight.pilot.space.reply(from, odometry, &reply, true);
    flight.pilot.begin_move(now, back);
    flight.pass(3.0);
    let end = flight.model.position;
    assert!(end.east - start.east > 0.7 && end.north - start.north > -0.7, "{start:?} {end:?}");
}

/// A forward camera does not see what is below: where nothing measures the distance to it, only what was flown through, or
/// shown, within 3 s is free.
#[test]
fn in_obstacle_mode_a_descent_needs_a_view_of_what_is_below_or_a_measured_clearance() {
    let flown_in_obstacle_mode = |moves: &[Primitives], reports: fn(Telemetry) -> Telemetry| {
        let mut setup = Setup::preset(Preset::Default).policy(Moves::of(moves));
        setup.settings.avoid = true;
        setup.reports = reports;
        let mut flight = setup.fly(|_, _| Answer::Never);
        flight.until_phase(Phase::Flying);
        flight.pass(14.0);
        (limited(&flight), flight.model.position.up - Craft::quad().take_off_height)
    };
    // What it has climbed through at take-off is 3 s ago by then.
    let (limited_to, up) = flown_in_obstacle_mode(&[turn(170.0), turn(170.0), climb(-1.0)], |telemetry| telemetry);
    assert!(up.abs() < 0.3 && limited_to == 1, "{up} m");
    let (limited_to, up) = flown_in_obstacle_mode(&[turn(170.0), turn(170.0), climb(-1.0)], |telemetry| Telemetry {
        ground_clearance: telemetry.height,
        ..telemetry
    });
    assert!((up + 1.0).abs() < 0.3 && limited_to == 0, "{up} m");
    // It has just come from there.
    let (limited_to, up) = flown_in_obstacle_mode(&[climb(1.0), climb(-0.8)], |telemetry| telemetry);
    assert!((up - 0.2).abs() < 0.3 && limited_to == 0, "{up} m");
}

#[test]
fn looks_up_and_down_keep_half_a_metre_from_floor_and_ceiling() {
    let height = Craft::quad().take_off_height;
    let limits = Limits { max_altitude: height + 2.0, ..Limits::default() };
    let (flight, ..) = flown(limits.clone(), &[climb(1.0), climb(1.0)], 12.0);
    let highest = flight.model.position.up;
    assert!((height + 1.2..height + 1.6).contains(&highest) && limited(&flight) == 1, "{highest} m");
    let (flight, ..) = flown(limits, &[climb(-1.0), climb(-1.0), climb(-1.0), climb(-1.0)], 20.0);
    let lowest = flight.model.position.up;
    // Floor of 0.3 m and half a metre.
    assert!(lowest > 0.75 && lowest < 1.1 && limited(&flight) >= 1, "{lowest} m");
}

#[test]
fn a_measured_ground_clearance_limits_sinking() {
    let low = Setpoint { up: -0.5, ..Setpoint::HOLD };
    let cleared = |ground_clearance| {
        let mut envelope = Envelope::new(Limits::default(), Craft::quad());
        for ms in [0, 1000] {
            let (phase, height) = if ms == 0 { (FlightPhase::OnGround, 0.0) } else { (FlightPhase::Flying, 3.0) };
            let telemetry = Telemetry {
                time: Time::from_millis(ms),
                phase,
                height: Some(height),
                position: Some(EnuPosition { up: height, ..EnuPosition::default() }),
                ground_clearance,
                ..Telemetry::default()
            };
            envelope.observe_telemetry(Time::from_millis(ms), &telemetry);
        }
        let (id, captured, received) = (FrameId(0), Time::from_millis(1000), Time::from_millis(1000));
        let frame = FrameMeta { id, captured, received, capture_counter: 1, width: 64, height: 48, unusable: None };
        envelope.observe_frame(Time::from_millis(1000), &frame);
        (envelope.clear_setpoint(Time::from_millis(1000), low).setpoint().unwrap().up, envelope.vertical_room().0)
    };
    assert_eq!(cleared(None).0, -0.5);
    assert_eq!(cleared(Some(2.5)).0, -0.5);
    // A table 0.4 m below, 3 m above the take-off point.
    let (up, room) = cleared(Some(0.4));
    assert!(up > -0.2 && up <= 0.0, "{up}");
    assert!((room + 0.4).abs() < 1e-9, "{room}");
    assert_eq!(cleared(Some(0.2)).0, 0.0);
}
