//! `spf sim serve --tello` from the side of third-party clients.

mod camera;
mod clients;
mod ending;
mod flights;
mod matrix;
mod person;
mod status;

use std::process::{Command, Stdio};

use crate::harness::Lab;
use crate::vlm::KEY;
use crate::vlm::server::Server;
use crate::vlm::vendors::Vendor;

/// `spf fly` of the virtual Tello at `drone`, from the address `local`, with its files in `out`.
fn fly_command(lab: &Lab, drone: &str, local: &str, server: &Server, out: &str, more: &[&str]) -> Command {
    let (drone, vlm) = (format!("tello@{drone}"), format!("gemini@{}", server.url()));
    let all = ["fly", "fly to the door", "--drone", &drone, "--vlm", &vlm, "--no-vlm-check", "--unattended", "--out", out];
    let mut command = lab.command(&[&all[..], more].concat());
    command.env(Vendor::Gemini.key(), KEY).env("SPF_TELLO_LOCAL", local).stdin(Stdio::null());
    command
}
