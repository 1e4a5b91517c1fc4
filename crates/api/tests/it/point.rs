//! The method's functions give the values of a flight.

use spf_api::flight::{Request, fly};
use spf_api::point::{LiftSettings, PromptSettings, grounding, lift, parse_reply, prompt};

#[test]
fn prompt_reply_and_lift_are_those_of_a_flight() {
    let folder = tempfile::tempdir().unwrap();
    let mut request = Request::new("fly to the red crane");
    (request.out, request.choices.max_time_s) = (Some(folder.path().join("flight")), Some(20.0));
    // Nothing but the point decides where it goes.
    request.choices.avoid = Some(false);
    let flight = fly(request, |_| Err("the oracle answers".to_owned()), |_| {}).unwrap();
    let (header, settings) = (&flight.record.header, &flight.record.header.settings);

    let first = &flight.record.decisions[0].query;
    let profile = grounding("oracle", (960, 720)).unwrap();
    assert_eq!(profile, header.grounding);
    let (near_m, keep_m, field_deg, horizon) = (first.near_m, first.keep_m, first.field_deg, first.horizon);
    let words = PromptSettings { profile, avoid: settings.avoid, near_m, keep_m, field_deg, horizon };
    // A flight adds what has happened so far, one sentence about its height at first.
    let height = first.prompt.lines().find(|line| line.starts_with("It is about ")).unwrap();
    assert_eq!(prompt("fly to the red crane", &words), first.prompt.replace(&format!("{height}\n"), ""));

    let mut lifted = 0;
    for decision in &flight.record.decisions {
        let Some(reply) = &decision.reading.reply else { continue };
        assert_eq!(&parse_reply(&decision.reply, &profile, settings.avoid).unwrap(), reply);
        let reading = &decision.reading;
        if let (Some(point), Some(label), Some(there)) = (reading.waypoint, reply.label(), reading.displacement) {
            let (camera, attitude) = (header.camera, decision.pose.attitude);
            let ours = lift(point, label, &LiftSettings { camera, attitude, step: settings.step, lifting: settings.lifting });
            let ours = ours.unwrap();
            assert_eq!((Some(ours.step_m), ours.displacement), (reading.step, there));
            assert_eq!(Some(ours.primitives), reading.primitives);
            lifted += 1;
        }
    }
    assert!(lifted > 0, "a decision that flies to its point");
}

#[test]
fn names_of_families_are_read_and_wrong_ones_refused() {
    let (gemini, oracle) = (grounding("gemini", (960, 720)).unwrap(), grounding("oracle:poor", (1, 1)).unwrap());
    assert_eq!((gemini.order, gemini.scale), (oracle.order, oracle.scale));
    let error = grounding("gemni", (960, 720)).unwrap_err();
    assert!(error.advice().unwrap().contains("did you mean `gemini`?"), "{error}");
    let error = parse_reply("I cannot see it.", &gemini, false).unwrap_err();
    assert!(error.to_string().starts_with("the reply cannot be used"), "{error}");
}
