//! Tests of the command from the user's side. Each runs the binary in a folder and an environment of its own.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

#[path = "../../../camera/tests/it/address.rs"]
mod address;
mod airsim;
mod bench;
mod camera;
mod circles;
mod cockpit;
mod code_blocks;
mod dataset;
mod determinism;
mod disk;
mod documents;
mod edges;
mod errors;
mod facade;
mod flights;
mod gltf;
mod ground;
mod harness;
mod json;
mod log;
#[cfg(unix)]
mod manual;
mod mavlink;
#[cfg(all(unix, feature = "mcp"))]
mod mcp;
mod models;
mod operator;
mod python;
mod say;
mod scenes;
#[cfg(target_os = "linux")]
mod screen;
mod serve;
mod shell;
mod tables;
#[cfg(target_os = "linux")]
mod tello;
mod track;
mod v4l2;
mod video;
mod view;
mod vlm;
mod words;

#[cfg(unix)]
mod signals;
mod strangers;
