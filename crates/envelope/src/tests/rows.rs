//! One test for each row of the tables in `docs/explanation/safety.md`, named there.

use super::*;

/// Flies from 1 s on with fresh telemetry and frames every 0.1 s until `until`, except as `but` specifies.
fn fly(rig: &mut Rig, until: Time, mut but: impl FnMut(&mut Rig, Time)) {
    let mut now = ms(1100);
    while now <= until {
        rig.tell(now);
        but(rig, now);
        now += Duration::from_millis(100);
    }
}

/// The reaction changes from `before` to `after` exactly at `at`, and [`Envelope::next_deadline`] announces it.
#[track_caller]
fn turns(envelope: &Envelope, at: Time, before: Reaction, after: Reaction) {
    let just_before = at - Duration::from_nanos(1);
    assert_eq!(envelope.reaction(just_before), before, "just before {at}");
    assert_eq!(envelope.reaction(at), after, "at {at}");
    assert_eq!(envelope.next_deadline(just_before), Some(at));
}

#[track_caller]
fn moves_not(rig: &mut Rig, now: Time, why: Cause) {
    let requested = Setpoint { right: 0.1, forward: 0.2, up: 0.1, yaw_rate: 0.1 };
    assert_eq!(rig.ask(now, requested), (Setpoint::HOLD, Some(why)));
}

#[track_caller]
fn moves(rig: &mut Rig, now: Time) {
    let requested = Setpoint { right: 0.1, forward: 0.2, up: 0.1, yaw_rate: 0.1 };
    assert_eq!(rig.ask(now, requested), (requested, None));
}

use Reaction::{Continue, Hold, Land};

#[test]
fn stale_frames_hold_then_land() {
    let mut rig = Rig::flying(Limits::default());
    // The last frame was captured at 1 s.
    fly(&mut rig, ms(1900), |_, _| ());
    turns(&rig.envelope, ms(2000), Continue, Hold(Cause::StaleFrame));
    moves(&mut rig, ms(1999));
    moves_not(&mut rig, ms(2000), Cause::StaleFrame);
    rig.see(ms(2050));
    rig.tell(ms(2050));
    moves(&mut rig, ms(2050));
    fly(&mut rig, ms(12_900), |_, _| ());
    turns(&rig.envelope, ms(13_050), Hold(Cause::StaleFrame), Land(Cause::StaleFrame));
}

#[test]
fn the_age_of_a_frame_counts_from_its_capture() {
    let mut rig = Rig::flying(Limits::default());
    let mut frame = rig.frame(ms(1500));
    frame.received = ms(2400);
    rig.tell(ms(2400));
    rig.envelope.observe_frame(ms(2400), &frame);
    moves(&mut rig, ms(2499));
    moves_not(&mut rig, ms(2500), Cause::StaleFrame);
    // An older image that was overtaken carries no information.
    let mut late = rig.frame(ms(1400));
    late.received = ms(2500);
    rig.envelope.observe_frame(ms(2500), &late);
    moves_not(&mut rig, ms(2500), Cause::StaleFrame);
}

#[test]
fn frozen_frames_hold_then_land() {
    let mut rig = Rig::flying(Limits::default());
    let frozen = rig.frame(ms(1100));
    // New timestamps, same capture counter.
    fly(&mut rig, ms(2000), |rig, now| {
        rig.envelope.observe_frame(now, &FrameMeta { captured: now, received: now, ..frozen });
    });
    turns(&rig.envelope, ms(2100), Continue, Hold(Cause::FrozenFrame));
    moves_not(&mut rig, ms(2100), Cause::FrozenFrame);
    fly(&mut rig, ms(12_000), |rig, now| {
        rig.envelope.observe_frame(now, &FrameMeta { captured: now, received: now, ..frozen });
    });
    turns(&rig.envelope, ms(12_100), Hold(Cause::FrozenFrame), Land(Cause::FrozenFrame));
    rig.see(ms(12_200));
    rig.tell(ms(12_200));
    moves(&mut rig, ms(12_200));
}

#[test]
fn unusable_frames_hold_then_land() {
    let mut rig = Rig::flying(Limits::default());
    let blank = |rig: &mut Rig, now| {
        let frame = FrameMeta { unusable: Some(spf_core::frame::Unusable::Blank), ..rig.frame(now) };
        rig.envelope.observe_frame(now, &frame);
    };
    fly(&mut rig, ms(1900), blank);
    turns(&rig.envelope, ms(2000), Continue, Hold(Cause::UnusableFrame));
    moves_not(&mut rig, ms(2000), Cause::UnusableFrame);
    fly(&mut rig, ms(11_900), blank);
    turns(&rig.envelope, ms(12_000), Hold(Cause::UnusableFrame), Land(Cause::UnusableFrame));
}

#[test]
fn a_lost_link_holds_then_lands() {
    let mut rig = Rig::flying(Limits::default());
    rig.envelope.link_lost(ms(1200));
    rig.fresh(ms(1600));
    turns(&rig.envelope, ms(1700), Continue, Hold(Cause::LinkLost));
    moves_not(&mut rig, ms(1700), Cause::LinkLost);
    // Telemetry may still arrive in one direction.
    fly(&mut rig, ms(6100), Rig::see);
    turns(&rig.envelope, ms(6200), Hold(Cause::LinkLost), Land(Cause::LinkLost));
    rig.envelope.link_restored(ms(6300));
    rig.fresh(ms(6300));
    moves(&mut rig, ms(6300));
}

#[test]
fn missing_telemetry_holds_then_lands() {
    let mut rig = Rig::flying(Limits::default());
    rig.see(ms(1500));
    turns(&rig.envelope, ms(2000), Continue, Hold(Cause::NoTelemetry));
    moves_not(&mut rig, ms(2000), Cause::NoTelemetry);
    for now in 2..7 {
        rig.see(ms(1000 * now));
    }
    turns(&rig.envelope, ms(7000), Hold(Cause::NoTelemetry), Land(Cause::NoTelemetry));
}

#[test]
fn repeated_telemetry_is_missing_telemetry() {
    let mut rig = Rig::flying(Limits::default());
    let frozen = rig.telemetry;
    for now in (1100..2000).step_by(100) {
        rig.see(ms(now));
        rig.envelope.observe_telemetry(ms(now), &frozen);
    }
    moves_not(&mut rig, ms(2000), Cause::NoTelemetry);
}

#[test]
fn telemetry_without_heading_stops_at_once_then_lands() {
    let mut rig = Rig::flying(Limits::default());
    rig.telemetry.attitude.heading = f64::NAN;
    rig.fresh(ms(1100));
    moves_not(&mut rig, ms(1100), Cause::NoTelemetry);
    fly(&mut rig, ms(6900), Rig::see);
    turns(&rig.envelope, ms(7000), Hold(Cause::NoTelemetry), Land(Cause::NoTelemetry));
}

#[test]
fn a_low_battery_holds_then_lands() {
    let mut rig = Rig::flying(Limits::default());
    rig.telemetry.battery = Some(0.15);
    rig.fresh(ms(1100));
    moves(&mut rig, ms(1100));
    rig.telemetry.battery = Some(0.149);
    rig.fresh(ms(1200));
    assert_eq!(rig.envelope.reaction(ms(1200)), Hold(Cause::LowBattery));
    moves_not(&mut rig, ms(1200), Cause::LowBattery);
    // Charge recovered at rest does not count.
    rig.telemetry.battery = Some(0.16);
    fly(&mut rig, ms(6100), Rig::see);
    turns(&rig.envelope, ms(6200), Hold(Cause::LowBattery), Land(Cause::LowBattery));
}

#[test]
fn an_unknown_battery_is_no_low_battery() {
    let mut rig = Rig::flying(Limits::default());
    rig.telemetry.battery = None;
    rig.fresh(ms(1100));
    moves(&mut rig, ms(1100));
    assert_eq!(rig.envelope.reaction(ms(1100)), Continue);
}

#[test]
fn each_failed_reply_holds_and_the_fifth_lands() {
    let mut rig = Rig::flying(Limits::default());
    for now in [2000, 3000, 4000, 5000] {
        rig.envelope.observe_reply(ms(now), false);
        rig.fresh(ms(now));
        assert_eq!(rig.envelope.reaction(ms(now)), Hold(Cause::FailedReplies));
        moves_not(&mut rig, ms(now), Cause::FailedReplies);
    }
    rig.envelope.observe_reply(ms(6000), false);
    rig.fresh(ms(6000));
    assert_eq!(rig.envelope.reaction(ms(6000)), Land(Cause::FailedReplies));
    rig.envelope.observe_reply(ms(6100), true);
    rig.fresh(ms(6100));
    moves(&mut rig, ms(6100));
}

/// Outside a limit: hold, land after 5 s, only motion back is allowed; the operator may take any time.
#[track_caller]
fn breach_holds_then_lands(limits: Limits, at: (f64, f64, f64), out: Setpoint, back: Setpoint, why: Cause) {
    let mut rig = Rig::flying(limits);
    rig.place(at.0, at.1, at.2);
    rig.fresh(ms(1200));
    assert_eq!(rig.envelope.reaction(ms(1200)), Hold(why));
    let (is, changed) = rig.ask(ms(1200), out);
    assert!(is.is_hold() && changed.is_some(), "{is:?}");
    let (is, _) = rig.ask(ms(1200), back);
    assert_eq!(is, back, "the way back is open");
    fly(&mut rig, ms(6100), Rig::see);
    turns(&rig.envelope, ms(6200), Hold(why), Land(why));
    assert_eq!(rig.envelope.manual_reaction(ms(6200)), Hold(why));
    assert!(rig.ask(ms(6200), back).0.is_hold(), "the pilot is to land now");
    assert_eq!(rig.envelope.clear_manual(ms(6200), back).setpoint(), Some(back));
}

#[test]
fn above_the_ceiling_holds_then_lands() {
    let up = Setpoint { up: 1.0, ..Setpoint::HOLD };
    let down = Setpoint { up: -1.0, ..Setpoint::HOLD };
    breach_holds_then_lands(Limits::default(), (0.0, 0.0, 120.1), up, down, Cause::AltitudeBreach);
}

#[test]
fn beyond_the_distance_holds_then_lands() {
    breach_holds_then_lands(Limits::default(), (0.0, 300.1, 3.0), forward(1.0), forward(-1.0), Cause::DistanceBreach);
}

#[test]
fn outside_the_geofence_holds_then_lands() {
    let limits = Limits { geofence: Some(square(20.0, "{}")), ..Limits::default() };
    breach_holds_then_lands(limits, (0.0, 20.1, 3.0), forward(1.0), forward(-1.0), Cause::GeofenceBreach);
}

#[test]
fn a_crash_lands_at_once() {
    for (crashed, phase) in [(true, FlightPhase::Flying), (false, FlightPhase::Stopped)] {
        let mut rig = Rig::flying(Limits::default());
        (rig.telemetry.crashed, rig.telemetry.phase) = (crashed, phase);
        rig.fresh(ms(1100));
        assert_eq!(rig.envelope.reaction(ms(1100)), Land(Cause::Crashed));
        moves_not(&mut rig, ms(1100), Cause::Crashed);
        assert_eq!(rig.envelope.clear(ms(1100), Command::TakeOff), Err(Refusal::Crashed));
    }
}

#[test]
fn a_position_too_uncertain_for_the_limits_holds_then_lands() {
    let fence = Limits { geofence: Some(square(20.0, "{}")), ..Limits::default() };
    let distance = Limits { max_distance: 40.0, ..Limits::default() };
    // Half of 40 m.
    for limits in [fence, distance] {
        let mut rig = Rig::flying(limits);
        rig.envelope.observe_spread(Spread { horizontal: 19.9, vertical: 0.0 });
        rig.fresh(ms(1100));
        assert_eq!(rig.envelope.reaction(ms(1100)), Continue);
        rig.envelope.observe_spread(Spread { horizontal: 20.1, vertical: 0.0 });
        rig.fresh(ms(1200));
        assert_eq!(rig.envelope.reaction(ms(1200)), Hold(Cause::UncertainPosition));
        moves_not(&mut rig, ms(1200), Cause::UncertainPosition);
        // The operator sees where the craft is.
        assert_eq!(rig.envelope.manual_reaction(ms(1200)), Hold(Cause::UncertainPosition));
        fly(&mut rig, ms(6100), Rig::see);
        turns(&rig.envelope, ms(6200), Hold(Cause::UncertainPosition), Land(Cause::UncertainPosition));
        rig.envelope.observe_spread(Spread::default());
        rig.fresh(ms(6200));
        moves(&mut rig, ms(6200));
    }
    let mut rig = Rig::flying(Limits::default());
    rig.envelope.observe_spread(Spread { horizontal: f64::NAN, vertical: 0.0 });
    rig.fresh(ms(1100));
    assert_eq!(rig.envelope.reaction(ms(1100)), Hold(Cause::UncertainPosition));
}

#[test]
fn a_height_that_does_not_follow_the_commands_holds_then_lands() {
    let climb = Setpoint { up: 0.5, ..Setpoint::HOLD };
    let step = |rig: &mut Rig, now, stuck: bool| {
        rig.see(now);
        if !stuck {
            let height = rig.telemetry.height.unwrap() + 0.05;
            rig.place(0.0, 0.0, height);
        }
        rig.ask(now, climb);
    };
    let mut rig = Rig::flying(Limits::default());
    fly(&mut rig, ms(20_000), |rig, now| step(rig, now, false));
    assert_eq!(rig.envelope.reaction(ms(20_000)), Continue, "a height that follows");

    let mut rig = Rig::flying(Limits::default());
    let mut held = None;
    fly(&mut rig, ms(11_000), |rig, now| {
        if held.is_none() && rig.envelope.reaction(now) == Hold(Cause::HeightStuck) {
            held = Some(now);
        }
        match held {
            None => step(rig, now, true),
            Some(held) => {
                let landing = now.since(held) >= Duration::from_secs(5);
                let expected = if landing { Land(Cause::HeightStuck) } else { Hold(Cause::HeightStuck) };
                rig.see(now);
                assert_eq!(rig.envelope.reaction(now), expected, "{now}");
            }
        }
    });
    // 1.5 m at 0.5 m/s, and the response of the craft.
    let held = held.unwrap();
    assert!((3.0..3.8).contains(&held.since(ms(1100)).as_secs_f64()), "{held}");
    rig.see(ms(11_000));
    moves_not(&mut rig, ms(11_000), Cause::HeightStuck);
    assert_eq!(rig.envelope.reaction(ms(11_000)), Land(Cause::HeightStuck));
    // The operator flies by sight, but does not climb.
    assert_eq!(rig.envelope.manual_reaction(ms(11_000)), Hold(Cause::HeightStuck));
    let by_hand = rig.envelope.clear_manual(ms(11_000), Setpoint { forward: 0.3, ..climb });
    assert_eq!((by_hand.setpoint(), by_hand.changed), (Some(forward(0.3)), Some(Cause::HeightStuck)));
    // A new flight begins with an unsuspicious height.
    rig.telemetry.phase = FlightPhase::OnGround;
    rig.tell(ms(11_100));
    rig.telemetry.phase = FlightPhase::Flying;
    rig.fresh(ms(11_200));
    assert_eq!(rig.envelope.reaction(ms(11_200)), Continue);
}

#[test]
fn an_imu_error_lands_at_once() {
    let reports: [fn(&mut Telemetry); 3] =
        [|t| t.imu_error = true, |t| t.attitude.pitch = f64::NAN, |t| t.attitude.roll = f64::INFINITY];
    for (report, phase) in reports.into_iter().zip([FlightPhase::Flying, FlightPhase::Manoeuvring, FlightPhase::TakingOff]) {
        let mut rig = Rig::flying(Limits::default());
        rig.telemetry.phase = phase;
        report(&mut rig.telemetry);
        rig.fresh(ms(1100));
        assert_eq!(rig.envelope.reaction(ms(1100)), Land(Cause::ImuError));
        moves_not(&mut rig, ms(1100), Cause::ImuError);
        // Also under the operator: a craft that does not know its attitude cannot be flown by setpoints.
        assert_eq!(rig.envelope.manual_reaction(ms(1100)), Land(Cause::ImuError));
        (rig.telemetry.phase, rig.telemetry.imu_error, rig.telemetry.attitude) =
            (FlightPhase::OnGround, true, Default::default());
        rig.fresh(ms(1200));
        assert_eq!(rig.envelope.clear(ms(1200), Command::TakeOff), Err(Refusal::ImuError));
    }
}

#[test]
fn the_most_severe_wins() {
    let mut rig = Rig::flying(Limits::default());
    rig.envelope.observe_reply(ms(1100), false);
    rig.tell(ms(1900));
    assert_eq!(rig.envelope.reaction(ms(2000)), Hold(Cause::StaleFrame), "over failed replies");
    rig.envelope.link_lost(ms(2000));
    assert_eq!(rig.envelope.reaction(ms(2500)), Hold(Cause::LinkLost), "over stale frames");
    for now in [2500, 2600, 2700, 2800] {
        rig.envelope.observe_reply(ms(now), false);
    }
    rig.tell(ms(2800));
    assert_eq!(rig.envelope.reaction(ms(2800)), Land(Cause::FailedReplies), "a landing over every hold");
    assert!(Hold(Cause::Crashed) < Land(Cause::FailedReplies) && Continue < Hold(Cause::SpeedLimit));
}

#[test]
fn a_setpoint_expires() {
    let mut rig = Rig::flying(Limits::default());
    let clearance = rig.envelope.clear_setpoint(ms(1000), forward(1.0));
    assert_eq!(clearance.cleared.valid_until(), ms(1500));
    assert_eq!(rig.envelope.next_deadline(ms(1000)), Some(ms(1500)));
    assert_eq!(rig.envelope.next_deadline(ms(1500)), Some(ms(2000)), "then the frame and the telemetry");
}

#[test]
fn setpoints_move_nothing_unless_flying() {
    for phase in [FlightPhase::OnGround, FlightPhase::TakingOff, FlightPhase::Landing] {
        let mut rig = Rig::flying(Limits::default());
        rig.telemetry.phase = phase;
        rig.fresh(ms(1100));
        moves_not(&mut rig, ms(1100), Cause::NotFlying);
        assert_eq!(rig.envelope.reaction(ms(1100)), Continue);
        assert_eq!(rig.envelope.clear_manual(ms(1100), forward(1.0)).setpoint(), Some(Setpoint::HOLD));
    }
}

#[test]
fn no_condition_that_requires_a_hold_interrupts_a_landing() {
    let mut rig = Rig::flying(Limits::default());
    rig.telemetry.phase = FlightPhase::Landing;
    rig.telemetry.battery = Some(0.1);
    rig.fresh(ms(1100));
    assert_eq!(rig.envelope.reaction(ms(1100)), Continue);
    assert_eq!(rig.envelope.reaction(ms(9000)), Land(Cause::NoTelemetry));
}

#[test]
fn take_off_is_refused_with_its_reason() {
    let ground = |change: fn(&mut Telemetry)| {
        let mut telemetry = Telemetry { battery: Some(0.5), time: ms(10), ..Telemetry::default() };
        change(&mut telemetry);
        let mut envelope = Envelope::new(Limits::default(), Craft::quad());
        envelope.observe_telemetry(ms(10), &telemetry);
        envelope
    };
    let take_off = |mut envelope: Envelope, now| envelope.clear(now, Command::TakeOff).map(|c| *c.cleared.get());
    assert_eq!(take_off(ground(|_| ()), ms(20)), Ok(Command::TakeOff));
    let low = take_off(ground(|t| t.battery = Some(0.19)), ms(20)).unwrap_err();
    assert_eq!(low.to_string(), "take-off refused: battery at 19 %, at least 20 % required; charge it");
    assert_eq!(take_off(ground(|t| t.phase = FlightPhase::Flying), ms(20)), Err(Refusal::AlreadyFlying));
    assert_eq!(take_off(ground(|_| ()), ms(1011)), Err(Refusal::NoTelemetry));
    let mut unlinked = ground(|_| ());
    unlinked.link_lost(ms(15));
    assert_eq!(take_off(unlinked, ms(20)), Err(Refusal::LinkLost));
    let limited = |limits: Limits| {
        let mut envelope = Envelope::new(limits, Craft::quad());
        envelope.observe_telemetry(ms(10), &Telemetry { time: ms(10), ..Telemetry::default() });
        take_off(envelope, ms(20))
    };
    let low = Limits { max_altitude: 2.0, ..Limits::default() };
    assert_eq!(limited(low), Err(Refusal::TooLow { height: 3.0, limit: 2.0 }));
    let fence = |properties| Limits { geofence: Some(square(5.0, properties)), ..Limits::default() };
    assert_eq!(limited(fence("{}")), Ok(Command::TakeOff));
    let outside = Err(Refusal::OutsideGeofence { east: 0.0, north: 0.0, height: 3.0 });
    assert_eq!(limited(fence(r#"{"max_altitude_m": 2.5}"#)), outside);
}

#[test]
fn landing_and_emergency_stop_pass_in_every_state() {
    for phase in [FlightPhase::OnGround, FlightPhase::TakingOff, FlightPhase::Flying, FlightPhase::Landing, FlightPhase::Stopped]
    {
        let mut rig = Rig::flying(Limits::default());
        rig.telemetry.phase = phase;
        rig.telemetry.crashed = true;
        rig.telemetry.battery = Some(0.0);
        rig.tell(ms(1100));
        rig.envelope.link_lost(ms(1100));
        for command in [Command::Land, Command::EmergencyStop] {
            let clearance = rig.envelope.clear(ms(60_000), command).unwrap();
            assert_eq!((*clearance.cleared.get(), clearance.changed), (command, None));
        }
    }
}

#[test]
fn the_operator_flies_without_camera_and_vlm() {
    let mut rig = Rig::flying(Limits::default());
    for i in 0..9 {
        rig.envelope.observe_reply(ms(1100 + i), false);
    }
    fly(&mut rig, ms(30_000), |_, _| ());
    assert_eq!(rig.envelope.manual_reaction(ms(30_000)), Continue);
    assert_eq!(rig.envelope.clear_manual(ms(30_000), forward(1.0)).setpoint(), Some(forward(1.0)));
    // Link, telemetry and limits hold for the operator as well.
    let fast = rig.envelope.clear_manual(ms(30_000), forward(9.0));
    assert_eq!((fast.setpoint(), fast.changed), (Some(forward(4.5)), Some(Cause::SpeedLimit)));
    rig.envelope.link_lost(ms(30_000));
    assert_eq!(rig.envelope.manual_reaction(ms(30_500)), Hold(Cause::LinkLost));
    assert_eq!(rig.envelope.clear_manual(ms(30_500), forward(1.0)).setpoint(), Some(Setpoint::HOLD));
}

#[test]
fn the_operator_may_use_a_low_battery_until_the_landing() {
    let mut rig = Rig::flying(Limits::default());
    rig.telemetry.battery = Some(0.1);
    rig.fresh(ms(1100));
    assert_eq!(rig.envelope.manual_reaction(ms(1100)), Hold(Cause::LowBattery));
    assert_eq!(rig.envelope.clear_manual(ms(1100), forward(1.0)).setpoint(), Some(forward(1.0)));
    fly(&mut rig, ms(6100), |_, _| ());
    assert_eq!(rig.envelope.manual_reaction(ms(6100)), Land(Cause::LowBattery));
    assert_eq!(rig.envelope.clear_manual(ms(6100), forward(1.0)).setpoint(), Some(Setpoint::HOLD));
}

/// `docs/explanation/safety.md` and this file name the same tests.
#[test]
fn every_row_of_the_documentation_has_its_test() {
    let docs = include_str!("../../../../docs/explanation/safety.md");
    let here = concat!(
        include_str!("rows.rs"),
        include_str!("limits.rs"),
        include_str!("manoeuvres.rs"),
        include_str!("failings.rs"),
        include_str!("flights.rs"),
        include_str!("brake.rs"),
        include_str!("person.rs"),
        include_str!("../../../pilot/src/tests/alone.rs"),
        include_str!("../../../drone/src/tello/link/tests.rs"),
        include_str!("../../../cli/tests/it/tello/ending.rs")
    );
    let elsewhere = concat!(
        include_str!("../../../pilot/src/tests/take_over.rs"),
        include_str!("../../../pilot/src/tests/returning.rs"),
        include_str!("../../../pilot/src/tests/gimbal.rs"),
        include_str!("../../../motion/src/estimator/tests.rs"),
        include_str!("../../../pilot/src/tests/guided.rs"),
        include_str!("../../../core/src/keep_out.rs"),
        include_str!("../../../pilot/src/tests/ranges.rs"),
        include_str!("../returning.rs"),
        include_str!("../../../pilot/src/tests/unseen.rs"),
        include_str!("../../../pilot/src/policy/search.rs"),
        include_str!("../../../pilot/src/policy/spf/tests.rs"),
        include_str!("../../../pilot/src/policy/spf/aside/tests.rs"),
        include_str!("../../../pilot/src/policy/spf/retreat/tests.rs"),
        include_str!("../../../pilot/src/policy/spf/beside.rs"),
        include_str!("../../../space/src/views.rs"),
        include_str!("../../../follow/tests/it/follower.rs"),
        include_str!("../../../space/src/avoid/tests.rs"),
        include_str!("../../../space/src/avoid/vertical.rs"),
        include_str!("../../../space/src/avoid/walking.rs"),
        include_str!("../../../pilot/src/tests/limits.rs"),
        include_str!("../../../pilot/src/refused.rs"),
        include_str!("../../../baselines/src/pivot/tests.rs"),
        include_str!("../../../cli/tests/it/tello/matrix/mod.rs"),
        include_str!("../../../cli/src/background.rs"),
        include_str!("../../../cli/tests/it/mavlink/mod.rs"),
        include_str!("../../../cli/tests/it/vlm/faults.rs"),
        include_str!("../../../flight/src/keys.rs"),
        include_str!("../../../flight/src/world/pause.rs"),
        include_str!("../../../flight/tests/it/observers.rs"),
        include_str!("../../../record/src/jsonl.rs"),
        include_str!("../../../serve/tests/it/fault_matrix.rs"),
        include_str!("../../../serve/tests/it/flights.rs"),
        include_str!("../../../serve/tests/it/images.rs"),
        include_str!("../../../serve/tests/it/mavlink/mod.rs"),
        include_str!("../../../serve/tests/it/mavlink/nobody.rs"),
        include_str!("../../../drone/src/mavlink/vehicle/clock.rs"),
        include_str!("../../../drone/src/mavlink/vehicle/tests.rs"),
        include_str!("../../../drone/src/mavlink/vehicle/tests/letting_go.rs"),
        include_str!("../../../bench/tests/all/refusals.rs"),
        include_str!("../../../bench/tests/all/signs.rs"),
        include_str!("../../../mcp/src/consent.rs"),
        include_str!("../../../mcp/tests/it/deck.rs"),
        include_str!("../../../oracle/src/refusal.rs"),
        include_str!("../../../core/src/prompt/mod.rs"),
        include_str!("../../../drone/src/frames/usable/tests.rs"),
        include_str!("../../../drone/src/tello/camera/tests.rs")
    );
    let mut rows = 0;
    for line in docs.lines().filter(|line| line.starts_with("| ") && line.ends_with("` |")) {
        let name = line.trim_end_matches("` |").rsplit('`').next().unwrap();
        let test = format!("fn {name}(");
        assert!(here.contains(&test) || elsewhere.contains(&test), "no test `{name}` for the row {line}");
        rows += 1;
    }
    let tests: Vec<&str> = here
        .split(concat!("#[te", "st]"))
        .skip(1)
        .filter_map(|t| t.split_once("fn ")?.1.split_once('('))
        .map(|(name, _)| name)
        .collect();
    for name in &tests {
        assert!(docs.contains(&format!("`{name}`")) || name.starts_with("every_row"), "no row for the test `{name}`");
    }
    assert!(rows > 30 && tests.len() > 30, "{rows} rows, {} tests", tests.len());
}
