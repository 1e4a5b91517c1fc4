//! Any text as a choice, a completion or moves: no panic, and nothing out of range.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_baselines::actions::parse_moves;
use spf_core::query::ActForm;
use spf_core::reply::{MAX_CHOSEN, MAX_STAGE, parse_choice, parse_completion};

fuzz_target!(|text: &str| {
    if let Ok(choice) = parse_choice(text) {
        assert!(choice.points.len() <= MAX_CHOSEN);
    }
    if let Ok(completion) = parse_completion(text) {
        assert!(completion.stage.is_none_or(|stage| (1..=MAX_STAGE).contains(&stage)));
    }
    for form in [ActForm::Numeric, ActForm::Discrete] {
        for (_, p) in parse_moves(form, text).map(|moves| moves.moves).unwrap_or_default() {
            assert!(p.yaw.abs() <= core::f64::consts::PI);
            assert!([p.forward, p.right, p.climb].iter().all(|metres| metres.abs() <= 5.0));
        }
    }
});
