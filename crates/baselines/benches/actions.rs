//! Parsing text actions.

use divan::{Bencher, black_box};
use spf_baselines::actions::parse_actions;

fn main() {
    divan::main();
}

#[divan::bench]
fn parse_three_actions(bencher: Bencher<'_, '_>) {
    let text = r#"{"actions":[{"cmd":"forward","value":1.5},{"cmd":"yaw_right","value":20},{"cmd":"hover"}],"done":false}"#;
    bencher.bench(|| parse_actions(black_box(text)).expect("valid actions"));
}
