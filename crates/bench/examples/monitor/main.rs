//! What a monitor gains: forced losses, and a suite of tasks with and without it.
//!
//! ```text
//! cargo run -p spf-bench --example monitor -- losses SEEDS [METHOD]
//! cargo run -p spf-bench --example monitor -- suite NAME SEEDS [METHOD]
//! ```
//!
//! Seeds count from 0, and `SEEDS` is at most 100. Prints a table, one row a method and error file. Tokens are those of a model that reads
//! a text token in four characters and an image token in 750 pixels.

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program that prints a table")]

mod losses;
mod suite;
mod tokens;

use std::process::ExitCode;

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let args: Vec<&str> = args.iter().map(String::as_str).collect();
    let seeds = |text: &str| text.parse().ok().filter(|seeds| (1..=100).contains(seeds));
    let run = match args[..] {
        ["losses", count] if seeds(count).is_some() => losses::run(seeds(count).unwrap_or(1), None),
        ["losses", count, method] if seeds(count).is_some() => losses::run(seeds(count).unwrap_or(1), Some(method)),
        ["suite", name, count] if seeds(count).is_some() => suite::run(name, seeds(count).unwrap_or(1), None),
        ["suite", name, count, method] if seeds(count).is_some() => suite::run(name, seeds(count).unwrap_or(1), Some(method)),
        _ => Err("usage: monitor losses SEEDS [METHOD] | monitor suite NAME SEEDS [METHOD] (1 to 100 seeds)".into()),
    };
    match run {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
