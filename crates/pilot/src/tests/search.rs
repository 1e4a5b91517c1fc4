//! The search for a target out of view, and the guarantee that every run ends.

use super::*;
use spf_core::geometry::wrap_angle;

#[test]
fn a_target_out_of_view_is_searched_by_turns_a_climb_and_turns_again_until_not_found() {
    for preset in PRESETS {
        let mut flight = Setup::preset(preset).fly(always(not_visible(Look::Right), 0.4));
        assert_eq!(flight.end(), Outcome::NotFound);
        // 0.8 of 90°: five turns of 72° to a circle, up by a take-off height, five more.
        let primitives = flight.decisions().filter(|d| d.step == "move").map(|d| d.reading.primitives.unwrap());
        let moves: Vec<(f64, f64)> = primitives.map(|p| (p.yaw.to_degrees().round(), p.climb)).collect();
        let circle = [(72.0, 0.0); 5];
        assert_eq!(moves, [&circle[..], &[(0.0, 3.0)], &circle].concat(), "{preset:?}");
        assert_eq!(flight.pilot.decisions(), 12);
        // Given with each look, in the pilot's own count.
        let turned: Vec<f64> = flight.queries.iter().map(|(_, query)| query.memory.turned.to_degrees().round()).collect();
        assert_eq!(turned[..7], [0.0, 72.0, 144.0, 216.0, 288.0, 360.0, 360.0]);
        for (_, query) in &flight.queries {
            let seen = flight.frames[usize::try_from(query.frame.0).unwrap()];
            assert!(seen.speed < 0.1 && seen.yaw_rate < 3.0_f64.to_radians(), "{preset:?}: half a turn answers nothing");
        }
        if preset == Preset::Default {
            for pair in flight.queries.windows(2).take(5) {
                let heading = |i: usize| flight.frames[usize::try_from(pair[i].1.frame.0).unwrap()].pose.attitude.heading;
                let turned = wrap_angle(heading(1) - heading(0)).to_degrees();
                assert!((turned - 72.0).abs() < 3.0, "truly turned by {turned}");
            }
        }
    }
}

/// The last stage of the search: along the most open direction that the answers reported, on images taken in that
/// direction.
#[test]
fn what_is_hidden_is_looked_for_from_elsewhere() {
    for preset in PRESETS {
        // Open to the east only; the image's centre faces there within a turn of 72°.
        let mut flight = Setup::preset(preset).fly(|_, seen| {
            let off = wrap_angle(seen.pose.attitude.heading - 90.0_f64.to_radians()).abs();
            let depth = if off < 0.7 { 7 } else { 1 };
            Answer::After(secs(0.4), open_way(Look::Right, 0.5, depth))
        });
        let start = flight.model.position;
        assert_eq!(flight.end(), Outcome::NotFound);
        let flown: Vec<f64> = flight.decisions().filter_map(|decision| decision.reading.step).collect();
        assert_eq!(flown.len(), 6, "{preset:?}: two excursions of three moves {flown:?}");
        let moved = flight.model.position.east - start.east;
        assert!(moved > 4.5 * flown[0], "{preset:?} {moved}");
    }
}

#[test]
fn the_search_looks_where_the_answer_points_and_finds() {
    for preset in PRESETS {
        let behind = target(-5.0, -30.0, 5.0);
        let mut flight = Setup::preset(preset).fly(perfect(behind, 0.8));
        assert_eq!(flight.end(), Outcome::Reached, "{preset:?}");
        let first = flight.decisions().next().unwrap();
        assert!(first.reading.primitives.unwrap().yaw < 0.0, "to the left, as the answer says");
    }
}

/// A later search starts afresh: turns before the target was seen do not count.
#[test]
fn a_sighting_resets_the_search() {
    let mut queries = 0;
    let mut flight = Setup::preset(Preset::Default).fly(move |_, _| {
        queries += 1;
        Answer::After(secs(0.3), if queries == 5 { navigate(0.2, 0.5, 2) } else { not_visible(Look::Left) })
    });
    assert_eq!(flight.end(), Outcome::NotFound);
    assert_eq!(flight.pilot.decisions(), 5 + 12);
    assert_eq!(flight.queries[5].1.memory.last_seen, Some(Look::Left));
}

/// A search turn begun by latency and a residual motion is measured from its frame.
#[test]
fn a_search_turn_in_continuous_mode_is_measured_from_its_frame() {
    let mut queries = 0;
    let mut flight = Setup::preset(Preset::Default).fly(move |_, _| {
        queries += 1;
        match queries {
            1 | 2 => Answer::After(secs(0.9), navigate(0.95, 0.5, 9)),
            3 => Answer::After(secs(1.0), not_visible(Look::Right)),
            _ => Answer::Never,
        }
    });
    flight.until_asked(4);
    let heading = |i: usize| flight.frames[usize::try_from(flight.queries[i].1.frame.0).unwrap()].pose.attitude.heading;
    let third = flight.frames[usize::try_from(flight.queries[2].1.frame.0).unwrap()];
    assert!(third.yaw_rate > 0.05, "asked while turning: {third:?}");
    assert!((wrap_angle(heading(3) - heading(2)).to_degrees() - 72.0).abs() < 3.0);
}

#[test]
fn an_instruction_changed_in_flight_is_flown_instead() {
    for preset in PRESETS {
        let (first, second) = (target(0.0, 40.0, 5.0), target(-15.0, 15.0, 6.0));
        let mut flight = Setup::preset(preset).fly(move |query, seen| {
            let target = if query.instruction.contains("tree") { second } else { first };
            Answer::After(secs(1.2), points_at(target, seen))
        });
        flight.until_moving();
        flight.pass(2.0);
        flight.operator(OperatorEvent::Instruction("fly to the tree".to_owned()));
        assert_eq!(flight.end(), Outcome::Reached, "{preset:?}");
        assert!(flight.finished[0].2.distance(second) < 3.0);
    }
}

/// Ids stay unique over instructions: a late answer to the old one is never mistaken for one to the new.
#[test]
fn query_ids_are_unique_over_instructions() {
    let mut flight = Setup::preset(Preset::Default).fly(always(navigate(0.5, 0.5, 4), 1.0));
    for i in 0..5 {
        let queries = flight.queries.len();
        flight.until_asked(queries + 2);
        flight.operator(OperatorEvent::Instruction(format!("instruction {i}")));
    }
    let ids: Vec<u64> = flight.queries.iter().map(|(_, query)| query.id.0).collect();
    assert!(ids.is_sorted_by(|a, b| a < b), "{ids:?}");
}

#[test]
fn a_flight_that_gets_nowhere_is_a_timeout_by_decisions() {
    for preset in PRESETS {
        let mut flight = Setup::preset(preset).fly(always(navigate(0.5, 0.5, 1), 0.5));
        assert_eq!(flight.end(), Outcome::Timeout);
        assert_eq!(flight.pilot.decisions(), 60, "{preset:?}");
        assert!(flight.finished[0].0 < Time::from_secs_f64(180.0));
    }
}

#[test]
fn the_last_decision_is_flown_to_its_end() {
    for preset in PRESETS {
        let mut setup = Setup::preset(preset);
        setup.settings.max_decisions = 1;
        let mut flight = setup.fly(always(navigate(0.5, 0.5, 9), 0.5));
        assert_eq!(flight.end(), Outcome::Timeout);
        let goal = flight.decisions().next().unwrap().goal.unwrap().position;
        let ended = flight.finished[0].2;
        assert!(ended.horizontal_distance(goal) < 1.5, "{preset:?} {ended:?} {goal:?}");
    }
}

#[test]
fn a_flight_that_gets_nowhere_is_a_timeout_by_time() {
    for preset in PRESETS {
        let mut flight = Setup::preset(preset).fly(always(navigate(0.5, 0.5, 1), 12.0));
        assert_eq!(flight.end(), Outcome::Timeout);
        let at = flight.finished[0].0;
        assert!((Time::from_secs_f64(180.0)..=Time::from_secs_f64(180.2)).contains(&at), "{preset:?} {at}");
    }
}

#[test]
fn time_runs_while_the_operator_holds_or_flies_and_on_the_ground() {
    let mut setup = Setup::preset(Preset::Default);
    setup.settings.max_time = secs(30.0);
    let mut flight = setup.fly(always(navigate(0.5, 0.5, 1), 1.0));
    flight.operator(OperatorEvent::Hold);
    assert_eq!(flight.end(), Outcome::Timeout);
    assert!(flight.commands.is_empty());

    for event in [OperatorEvent::Hold, OperatorEvent::Setpoint(Setpoint::HOLD)] {
        let mut setup = Setup::preset(Preset::Default);
        setup.settings.max_time = secs(30.0);
        let mut flight = setup.fly(always(navigate(0.5, 0.5, 8), 1.0));
        flight.until_moving();
        flight.operator(event);
        assert_eq!(flight.end(), Outcome::Timeout);
        assert_eq!(flight.phase, FlightPhase::OnGround);
    }
}

#[test]
fn without_telemetry_nothing_takes_off_and_the_run_ends() {
    let setup = Setup::preset(Preset::Default).fault(Stream::Telemetry, 0.0, None, Fault::Drop);
    let mut flight = setup.fly(always(done(), 1.0));
    assert_eq!(flight.end(), Outcome::Timeout);
    assert!(flight.commands.is_empty());
}

/// At the floor the envelope allows none of the 1 m descent: the look must not wait for the time limit of the move.
#[test]
fn looking_down_at_the_floor_goes_on_at_once() {
    let mut flight = Setup::preset(Preset::Default).fly(always(not_visible(Look::Down), 0.4));
    flight.until_asked(8);
    assert!(flight.model.position.up < 0.8, "{:?}", flight.model.position);
    for pair in flight.queries.windows(2) {
        let took = pair[1].0.since(pair[0].0).as_secs_f64();
        assert!(took < 6.5, "{took} s at {:?}", pair[0].0);
    }
}
