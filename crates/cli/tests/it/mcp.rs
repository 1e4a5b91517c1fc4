//! `spf mcp` with clients of other people: PyPI's, and the protocol's own inspector, and with an operator in a browser.

use std::path::Path;
use std::process::Command;
use std::sync::PoisonError;

use crate::cockpit::BROWSER;
use crate::harness::{Lab, skip, warn};
use crate::python;

/// Runs a part of the script.
#[allow(clippy::print_stdout, reason = "how long each part took is for people")]
fn assistants(part: &str) {
    let Some(python) = python::environment() else { return };
    let lab = Lab::new();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/mcp.py");
    let mut command = Command::new(python);
    command.arg("-B").arg(script).args([env!("CARGO_BIN_EXE_spf"), part]).current_dir(lab.path("."));
    let output = command.output().unwrap();
    let told = format!("{}\n{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{told}");
    println!("{told}");
}

/// Runs a part of it that needs a browser.
fn with_an_operator(part: &str) {
    if Command::new("chromium").arg("--version").output().is_err() {
        return skip("an operator in a browser (no chromium)");
    }
    let _alone = BROWSER.lock().unwrap_or_else(PoisonError::into_inner);
    assistants(part);
}

#[test]
#[ignore = "flies in real time, with Python: .ci/interop runs it"]
fn pypis_client_flies_by_both_revisions_and_both_transports() {
    assistants("clients");
}

#[test]
#[ignore = "flies in real time, with Python: .ci/interop runs it"]
fn a_craft_whose_assistant_stops_cancels_or_is_gone_holds_and_lands() {
    assistants("stops");
}

#[test]
#[ignore = "flies in real time, with Python: .ci/interop runs it"]
fn strangers_and_floods_are_refused_and_a_second_client_may_stop() {
    assistants("strangers");
}

#[test]
#[ignore = "needs Python: .ci/interop runs it"]
fn whatever_is_sent_is_answered_and_no_file_elsewhere_is_read() {
    assistants("fuzz");
}

#[test]
#[ignore = "flies in real time, with Python and a browser: .ci/interop runs it"]
fn a_tello_moves_only_once_its_operator_has_armed_the_assistant() {
    with_an_operator("tello");
}

#[test]
#[ignore = "flies in real time, with Python: .ci/interop runs it"]
fn a_client_that_asks_its_user_arms_for_the_words_alone() {
    assistants("asked");
}

#[test]
#[ignore = "flies in real time, with Python and a browser: .ci/interop runs it"]
fn a_px4_moves_only_once_its_operator_has_armed_the_assistant() {
    with_an_operator("px4");
}

#[test]
#[ignore = "needs Python and the protocol's inspector: SPF_MCP_INSPECTOR is its path"]
fn the_protocols_inspector_finds_nothing_to_complain_about() {
    if std::env::var_os("SPF_MCP_INSPECTOR").is_none() {
        return warn("the inspector of the protocol (SPF_MCP_INSPECTOR is not set)");
    }
    assistants("inspector");
}
