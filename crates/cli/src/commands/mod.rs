//! One module per command, each returning an exit code.

pub(crate) mod bench;
pub(crate) mod camera;
pub(crate) mod cockpit;
pub(crate) mod config;
pub(crate) mod depth_model;
mod detector;
mod display;
mod doctor;
pub(crate) mod fly;
pub(crate) mod ground;
pub(crate) mod log;
#[cfg(feature = "mcp")]
pub(crate) mod mcp;
pub(crate) mod model;
mod reask;
pub(crate) mod replay;
pub(crate) mod screen;
pub(crate) mod shell;
pub(crate) mod sim;
mod tello;
mod track;
pub(crate) mod vlm;

pub(crate) use doctor::doctor;
pub(crate) use tello::tello;
pub(crate) use track::track;

pub(crate) use spf_api::files::{load_scene, read};
pub(crate) use spf_flight::pose::parse_pose;

/// The error of a program that was built without the protocol.
#[cfg(not(feature = "mcp"))]
pub(crate) fn without_mcp() -> crate::error::CliError {
    crate::error::CliError::usage("this program was built without `spf mcp`")
        .hint("build it with `cargo build --release --features mcp`; that of the Python package has it")
}
