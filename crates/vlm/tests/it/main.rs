//! Clients in processes of their own, and programs as VLMs. One binary, because each takes time to link.
// The configuration allows these in test functions; these files have helpers of tests.
#![allow(clippy::unwrap_used, clippy::print_stdout, clippy::print_stderr)]

mod drafts;
#[cfg(unix)]
mod exec;
mod network;
