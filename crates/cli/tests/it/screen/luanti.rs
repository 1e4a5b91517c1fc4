//! Luanti, a game of another project, flown through its window.

use std::path::Path;
use std::process::Command;

use super::display::Screen;
use crate::python;

#[test]
#[ignore = "flies in real time: .ci/interop runs it"]
fn a_game_is_flown_to_the_red_tower() {
    let Some(python) = python::environment() else { return };
    let Some(screen) = Screen::start(&["/usr/games/minetest"]) else { return };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/trials/luanti.py");
    let mut flight = Command::new(&python);
    flight.arg(script).arg(env!("CARGO_BIN_EXE_spf")).args(["1", "--no-video", "-o"]).arg(screen.lab.path("flights"));
    let output = flight.output().unwrap();
    let (printed, told) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success() && printed.contains("\"success\": true"), "{printed}{told}");
}
