//! The `spf` command.
fn main() {}
