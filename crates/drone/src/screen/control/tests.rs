use proptest::prelude::*;
use spf_screen::gamepad::{Positions, Stick};
use spf_screen::profile::Key;

use super::*;
use crate::screen::motion::tests::padded;

fn ms(ms: u64) -> Time {
    Time::from_millis(ms)
}

fn key(name: &str) -> Key {
    Key::named(name).unwrap()
}

fn flying() -> Control {
    let mut control = Control::new(ms(0), &Profile::shipped("spf-window").unwrap());
    control.handle(ms(0), Command::TakeOff, Time::MAX);
    // `t` for 0.3 s, then 5 s of waiting.
    assert_eq!((control.poll(ms(100)).keys, control.phase()), (vec![key("t")], FlightPhase::TakingOff));
    control.heartbeat(ms(400));
    assert_eq!(control.poll(ms(400)).keys, []);
    control.poll(ms(5300));
    assert_eq!(control.phase(), FlightPhase::Flying);
    control
}

fn ahead(control: &mut Control, now: u64) {
    let setpoint = Setpoint { forward: 4.0, ..Setpoint::HOLD };
    control.heartbeat(ms(now));
    control.handle(ms(now), Command::Setpoint(setpoint), ms(now + 500));
}

#[test]
fn a_setpoint_is_pressed_as_long_as_it_is_valid() {
    let mut control = flying();
    ahead(&mut control, 6000);
    assert_eq!(control.poll(ms(6001)).keys, [key("w")]);
    assert_eq!(control.poll(ms(6499)).keys, [key("w")]);
    assert_eq!((control.poll(ms(6500)).keys, control.done()), (vec![], Setpoint::HOLD));
}

#[test]
fn without_focus_nothing_is_pressed_until_the_operator_resumes() {
    let mut control = flying();
    ahead(&mut control, 6000);
    control.lose_focus(ms(6050));
    assert_eq!(control.take_event(), Some((ms(6050), DroneEvent::TakenOver)));
    ahead(&mut control, 6100);
    assert_eq!(control.poll(ms(6101)).keys, []);
    control.lose_focus(ms(6150));
    assert_eq!(control.take_event(), None);
    // A window that does not get the focus stays taken, and the pilot is told again.
    control.refuse_resume(ms(6160));
    assert_eq!(control.take_event(), Some((ms(6160), DroneEvent::TakenOver)));
    control.take_back(ms(6165));
    control.refuse_resume(ms(6170));
    assert_eq!(control.take_event(), None);
    ahead(&mut control, 6200);
    assert_eq!(control.poll(ms(6201)).keys, [key("w")]);
}

#[test]
fn a_hidden_window_and_a_frozen_picture_bar_every_motion() {
    let mut control = flying();
    for bar in [Bar::Hidden, Bar::Frozen] {
        ahead(&mut control, 6000);
        control.bar(bar, true);
        control.bar(bar, true);
        assert_eq!((control.poll(ms(6001)).keys, control.done()), (vec![], Setpoint::HOLD));
        control.bar(bar, false);
        assert_eq!(control.poll(ms(6002)).keys, [key("w")]);
    }
}

#[test]
fn a_landing_goes_on_without_the_flight_loop_and_a_motion_takes_it_over() {
    let mut control = flying();
    control.handle(ms(6000), Command::Land, Time::MAX);
    control.handle(ms(6100), Command::Land, Time::MAX);
    control.handle(ms(6100), Command::Setpoint(Setpoint::HOLD), ms(6600));
    assert_eq!((control.poll(ms(6250)).keys, control.phase()), (vec![key("l")], FlightPhase::Landing));
    ahead(&mut control, 6300);
    control.poll(ms(6310));
    assert_eq!(control.phase(), FlightPhase::Flying);
    control.leave(ms(7000));
    assert_eq!(control.poll(ms(7100)).keys, [key("l")]);
    control.poll(ms(12_400));
    assert!(control.is_over());
    // A take-off that nobody attends presses nothing.
    control.handle(ms(13_000), Command::TakeOff, Time::MAX);
    assert_eq!(control.poll(ms(13_010)).keys, []);
}

#[test]
fn with_a_broken_keyboard_it_ends_where_it_is() {
    let mut control = flying();
    control.set_broken(ms(6000), Part::Keys, true);
    control.set_broken(ms(6001), Part::Keys, true);
    assert_eq!((control.take_event(), control.take_event()), (Some((ms(6000), DroneEvent::LinkLost)), None));
    control.handle(ms(6100), Command::Land, Time::MAX);
    assert_eq!(control.poll(ms(6110)).keys, []);
    control.poll(ms(6400));
    assert!(control.is_over());
    assert_eq!((control.take_complaint(), control.take_complaint()), (Some(NOT_LANDED), None));
}

#[test]
fn the_link_is_lost_as_long_as_any_part_is_broken() {
    let mut control = flying();
    assert!(control.set_broken(ms(6000), Part::Picture, true) && control.set_broken(ms(6001), Part::Keys, true));
    assert!(!control.set_broken(ms(6002), Part::Keys, true) && control.set_broken(ms(6003), Part::Picture, false));
    assert_eq!((control.take_event(), control.take_event()), (Some((ms(6000), DroneEvent::LinkLost)), None));
    control.set_broken(ms(6004), Part::Keys, false);
    assert_eq!(control.take_event(), Some((ms(6004), DroneEvent::LinkRestored)));
}

#[test]
fn a_game_that_has_ended_is_a_lost_link_whoever_had_the_focus_until_the_operator_resumes() {
    for taken in [false, true] {
        let mut control = flying();
        if taken {
            control.lose_focus(ms(6000));
            assert_eq!(control.take_event(), Some((ms(6000), DroneEvent::TakenOver)));
        }
        assert!(control.set_broken(ms(6100), Part::Window, true) && !control.set_broken(ms(6200), Part::Window, true));
        assert_eq!((control.take_event(), control.take_event()), (Some((ms(6100), DroneEvent::LinkLost)), None));
        ahead(&mut control, 6200);
        assert!(control.poll(ms(6201)).keys.is_empty() && control.awaits_resume());
        control.take_back(ms(6300));
        assert_eq!(control.take_event(), Some((ms(6300), DroneEvent::LinkRestored)));
        assert!(!control.awaits_resume());
        // The envelope's landing ends at once: there is nothing to press a key for.
        control.set_broken(ms(6400), Part::Window, true);
        control.handle(ms(6500), Command::Land, Time::MAX);
        control.poll(ms(6510));
        control.poll(ms(6900));
        assert!(control.is_over());
    }
}

#[test]
fn a_take_off_that_is_broken_off_is_none() {
    let hinder: [fn(&mut Control, Time); 4] = [
        |control, now| assert!(control.lose_focus(now)),
        |control, now| assert!(control.set_broken(now, Part::Keys, true)),
        |control, _| control.bar(Bar::Hidden, true),
        // Nobody is heard.
        |_, _| {},
    ];
    for (number, hinder) in hinder.into_iter().enumerate() {
        let mut profile = Profile::shipped("spf-window").unwrap();
        profile.take_off.steps[0].for_s = 3.0;
        let mut control = Control::new(ms(0), &profile);
        control.handle(ms(0), Command::TakeOff, Time::MAX);
        assert_eq!(control.poll(ms(100)).keys, [key("t")]);
        hinder(&mut control, ms(200));
        assert_eq!(control.poll(ms(2100)).keys, [], "{number}");
        assert_eq!((control.phase(), control.take_complaint()), (FlightPhase::OnGround, Some(NOT_TAKEN_OFF)), "{number}");
        control.poll(ms(20_000));
        assert_eq!(control.phase(), FlightPhase::OnGround, "{number}");
    }
}

#[test]
fn a_landing_whose_keys_were_not_pressed_is_complained_of() {
    let hinder: [fn(&mut Control); 2] =
        [|control| control.bar(Bar::Hidden, true), |control| assert!(control.lose_focus(ms(6110)))];
    for hinder in hinder {
        let mut control = flying();
        control.handle(ms(6000), Command::Land, Time::MAX);
        assert_eq!(control.poll(ms(6100)).keys, [key("l")]);
        hinder(&mut control);
        assert_eq!((control.poll(ms(6120)).keys, control.take_complaint()), (vec![], None));
        control.poll(ms(12_000));
        assert_eq!((control.phase(), control.take_complaint()), (FlightPhase::OnGround, Some(NOT_LANDED)));
    }
    let mut control = flying();
    control.handle(ms(6000), Command::Land, Time::MAX);
    control.poll(ms(6100));
    control.poll(ms(12_000));
    assert_eq!((control.phase(), control.take_complaint()), (FlightPhase::OnGround, None));
}

#[test]
fn what_was_wanted_is_no_longer_pressed_once_its_time_is_over() {
    let mut control = flying();
    ahead(&mut control, 6000);
    assert_eq!(control.poll(ms(6499)).keys, [key("w")]);
    assert!(control.still(ms(6499)) && !control.still(ms(6500)));
    control.bar(Bar::Frozen, true);
    assert!(!control.still(ms(6499)));
}

#[test]
fn a_stick_of_a_take_off_is_pushed_and_centred() {
    let mut profile = padded();
    let up = Stick::named("-left_y").unwrap();
    profile.take_off.steps = vec![Step { hold: None, push: Some(up), for_s: 1.0 }, Step { hold: None, push: None, for_s: 1.0 }];
    let mut control = Control::new(ms(0), &profile);
    control.handle(ms(0), Command::TakeOff, Time::MAX);
    let pushed = control.poll(ms(900));
    assert_eq!((pushed.keys, pushed.sticks.values()), (vec![], [0, -32767, 0, 0]));
    assert_eq!((control.poll(ms(1001)), control.phase()), (Wanted::default(), FlightPhase::TakingOff));
    // The same without a key or a stick that could be pressed is no take-off.
    let mut control = Control::new(ms(0), &profile);
    control.handle(ms(0), Command::TakeOff, Time::MAX);
    control.bar(Bar::Hidden, true);
    assert_eq!((control.poll(ms(100)), control.phase()), (Wanted::default(), FlightPhase::OnGround));
}

#[test]
fn sticks_are_centred_when_the_focus_is_lost_and_when_the_setpoint_ends() {
    let mut control = Control::new(ms(0), &padded());
    control.handle(ms(0), Command::TakeOff, Time::MAX);
    control.heartbeat(ms(5300));
    control.poll(ms(5300));
    ahead(&mut control, 6000);
    assert_eq!(control.poll(ms(6499)).sticks.values(), [0, 0, 0, -32767]);
    assert!(control.poll(ms(6500)).sticks.are_centred());
    ahead(&mut control, 6600);
    control.lose_focus(ms(6650));
    assert!(control.poll(ms(6651)).sticks.are_centred());
}

proptest! {
    /// Whatever happens in whatever order, nothing is pressed on the ground, without focus, or after the last setpoint ended.
    #[test]
    fn keys_and_sticks_need_a_reason(steps in proptest::collection::vec((0_u64..700, 0..10_u8), 1..120), has_sticks in any::<bool>()) {
        let profile = if has_sticks { padded() } else { Profile::shipped("spf-window").unwrap() };
        let mut control = Control::new(ms(0), &profile);
        let (mut now, mut valid) = (0, 0);
        for (passed, what) in steps {
            now += passed;
            control.heartbeat(ms(now));
            match what {
                0 => control.handle(ms(now), Command::TakeOff, Time::MAX),
                1 => control.handle(ms(now), Command::Land, Time::MAX),
                2 => {
                    control.lose_focus(ms(now));
                }
                3 => control.take_back(ms(now)),
                4 => {
                    control.set_broken(ms(now), Part::Keys, passed % 2 == 0);
                }
                8 => {
                    control.set_broken(ms(now), Part::Window, true);
                }
                5 => control.bar(Bar::Hidden, passed % 2 == 0),
                6 => control.bar(Bar::Frozen, passed % 2 == 0),
                7 if passed > 600 => control.handle(ms(now), Command::EmergencyStop, Time::MAX),
                _ => {
                    ahead(&mut control, now);
                    valid = now + 500;
                }
            }
            let Wanted { keys, sticks, .. } = control.poll(ms(now));
            prop_assert!((keys.is_empty() && sticks.are_centred()) || control.still(ms(now)));
            let in_sequence = matches!(control.phase, Phase::TakingOff(_) | Phase::Landing(_));
            let may = control.may_press() && !control.bars.contains(&Bar::Hidden);
            if control.is_over() || !may || (!in_sequence && (now >= valid || !control.bars.is_empty())) {
                prop_assert_eq!((keys, sticks), (vec![], Positions::default()));
            }
        }
    }
}
