//! Any text: no panic, at most three actions, every number finite and in its range.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_baselines::actions::parse_actions;
use spf_core::primitives::Primitives;
use spf_core::reply::MAX_ACTIONS;

fuzz_target!(|text: &str| {
    let Ok(reply) = parse_actions(text) else { return };
    assert!(reply.actions.len() <= MAX_ACTIONS && (reply.done || !reply.actions.is_empty()));
    for &action in &reply.actions {
        let Primitives { yaw, forward, right, climb } = action.into();
        assert!(yaw.abs() <= core::f64::consts::PI && forward.abs() <= 5.0 && right.abs() <= 5.0 && climb.abs() <= 5.0);
    }
    assert!(parse_actions(&reply.to_json()).is_ok());
});
