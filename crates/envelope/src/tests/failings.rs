//! Known failings of similar programs, as far as the envelope can prevent them (`docs/explanation/safety.md`).

use super::*;

/// Failing 2: "land after N errors" that never fires, because a swallowed error or a placeholder counts as success.
#[test]
fn failing_2_nothing_but_a_good_reply_resets_the_count_of_failures() {
    let mut rig = Rig::flying(Limits::default());
    for i in 1..=5 {
        let now = ms(1000 + 1000 * i);
        rig.envelope.observe_reply(now, false);
        // Frames, placeholders, telemetry, holds, manual flight: none of them is a reply.
        rig.fresh(now);
        let placeholder = FrameMeta { unusable: Some(spf_core::frame::Unusable::Blank), ..rig.frame(now) };
        rig.envelope.observe_frame(now, &placeholder);
        let _ = rig.envelope.hold(now);
        let _ = rig.envelope.clear_manual(now, forward(0.5));
        rig.envelope.link_lost(now);
        rig.envelope.link_restored(now);
    }
    assert_eq!(rig.envelope.reaction(ms(6000)), Reaction::Land(Cause::FailedReplies));
}

/// Failing 3: a frozen, blank or placeholder frame is mistaken for a live one.
#[test]
fn failing_3_a_frozen_blank_or_placeholder_frame_moves_nothing() {
    let frozen = |_: Time, first: FrameMeta| first;
    let restamped = |now, first| FrameMeta { captured: now, received: now, ..first };
    let blank = |now, first: FrameMeta| FrameMeta {
        captured: now,
        received: now,
        capture_counter: first.capture_counter + now.as_nanos(),
        unusable: Some(spf_core::frame::Unusable::Blank),
        ..first
    };
    let sources: [&dyn Fn(Time, FrameMeta) -> FrameMeta; 3] = [&frozen, &restamped, &blank];
    for (source, cause) in sources.into_iter().zip([Cause::FrozenFrame, Cause::FrozenFrame, Cause::UnusableFrame]) {
        let mut rig = Rig::flying(Limits::default());
        let first = rig.frame(ms(1100));
        rig.envelope.observe_frame(ms(1100), &first);
        for now in (1200..=2100).step_by(100) {
            rig.tell(ms(now));
            rig.envelope.observe_frame(ms(now), &source(ms(now), first));
        }
        let (is, why) = rig.ask(ms(2100), forward(1.0));
        assert!(is.is_hold() && rig.envelope.reaction(ms(2100)) == Reaction::Hold(why.unwrap()));
        assert!(why == Some(cause) || why == Some(Cause::StaleFrame), "{why:?}");
    }
}

/// Failing 4: during a slow VLM query the craft's own no-command timer lands it (Tello: 15 s). A hold expires like any
/// setpoint, so a caller that obeys the deadlines sends it again and again while waiting.
#[test]
fn failing_4_a_hold_is_due_again_while_a_slow_vlm_thinks() {
    let mut rig = Rig::flying(Limits::default());
    let (mut now, mut sent) = (ms(1000), 0);
    while now < ms(41_000) {
        rig.fresh(now);
        let clearance = rig.envelope.hold(now);
        assert_eq!((clearance.setpoint(), clearance.changed), (Some(Setpoint::HOLD), None));
        sent += 1;
        let next = rig.envelope.next_deadline(now).expect("a hold expires");
        assert!(next > now && next <= clearance.cleared.valid_until());
        now = next;
        assert_eq!(rig.envelope.reaction(now), Reaction::Continue, "waiting alone is no reason to land");
    }
    assert_eq!(sent, 80, "every 0.5 s for 40 s");
}

/// Failing 8: an emergency stop that only centres the sticks, an override that leaves the old command active.
#[test]
fn failing_8_an_emergency_is_no_hold_and_ends_what_was_cleared() {
    let mut rig = Rig::flying(Limits::default());
    let _ = rig.envelope.clear_setpoint(ms(1000), forward(1.0));
    let stop = rig.envelope.clear(ms(1100), Command::EmergencyStop).unwrap();
    assert_eq!(*stop.cleared.get(), Command::EmergencyStop);
    // The setpoint's end at 1.5 s no longer matters: the next deadline is the age of frame and telemetry.
    assert_eq!(rig.envelope.next_deadline(ms(1100)), Some(ms(2000)));
    // The operator's setpoint replaces the pilot's, and counts from its own time.
    let manual = rig.envelope.clear_manual(ms(1200), forward(-0.5));
    assert_eq!((manual.setpoint(), manual.cleared.valid_until()), (Some(forward(-0.5)), ms(1700)));
}
