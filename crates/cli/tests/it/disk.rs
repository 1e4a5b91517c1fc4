//! Folders and disks: two runs at the same time, and disks that fill up.

use crate::harness::Lab;

#[test]
fn two_runs_at_once_get_a_folder_each() {
    let lab = Lab::new();
    let start = || lab.command(&["fly", "fly to the red crane", "--no-video", "--max-time", "3"]).spawn().unwrap();
    for mut run in [start(), start(), start()] {
        assert_eq!(run.wait().unwrap().code(), Some(3));
    }
    let folders = lab.names("flights");
    assert_eq!(folders.len(), 3, "{folders:?}");
    for folder in folders {
        assert_eq!(
            lab.names(&format!("flights/{folder}")),
            ["decisions.jsonl", "flight.mcap", "queries.jsonl", "summary.json", "trajectory.svg"]
        );
    }
}

/// Runs the command behind a shell line that ends in `exec "$0" "$@"`.
#[cfg(unix)]
fn behind(lab: &Lab, program: &[&str], line: &str, args: &[&str]) -> crate::harness::Run {
    let mut command = std::process::Command::new(program[0]);
    command.args(&program[1..]).args(["sh", "-c", line, env!("CARGO_BIN_EXE_spf")]).args(args);
    command.current_dir(lab.path(".")).env_clear().env("PATH", std::env::var_os("PATH").unwrap());
    crate::harness::Run::of(&command.stdin(std::process::Stdio::null()).output().unwrap())
}

/// The flight continued, and reports its result and the missing files.
#[cfg(unix)]
fn flew_on(run: &crate::harness::Run) {
    assert_eq!(run.code, Some(3), "{}", run.stderr);
    let summary: serde_json::Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!((summary["outcome"].as_str(), &summary["finished_at_s"]), (Some("timeout"), &12.0.into()), "{summary}");
    assert!(run.stderr.contains("warning: recording failed: cannot write"), "{}", run.stderr);
    // Once when it happens, before the flight is over.
    let (flight, _) = run.stderr.split_once("landing").unwrap();
    assert_eq!(flight.matches("cannot be written (disk full?); the flight goes on").count(), 1, "{}", run.stderr);
}

/// No file may grow past 12 KiB: a write fails in the middle, as on a full disk.
#[cfg(unix)]
#[test]
fn files_that_cannot_grow_lose_no_flight() {
    let lab = Lab::new();
    // A shell counts blocks of 512 or of 1024 bytes: 12 or 24 KiB.
    let args = ["fly", "fly to the red crane", "--max-time", "12", "--json", "--out", "mine"];
    let run = behind(&lab, &["env"], "trap '' XFSZ; ulimit -f 24; exec \"$0\" \"$@\"", &args);
    flew_on(&run);
    let text = String::from_utf8(lab.read("mine/summary.json")).unwrap();
    assert!(text.contains("\"outcome\": \"timeout\""), "what fits is written: {text}");
    assert!(!lab.path("mine/trajectory.svg").exists(), "half a picture is none");
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_loses_no_flight() {
    let lab = Lab::new();
    std::fs::create_dir(lab.path("small")).unwrap();
    // In its own namespace the disk disappears when the command ends, so its contents are copied first.
    let own = ["unshare", "--user", "--map-root-user", "--mount"];
    let mount = "mount -t tmpfs -o size=100k none small";
    let possible = behind(&lab, &own, mount, &[]);
    if possible.code != Some(0) {
        crate::harness::warn(&format!("no file system can be mounted here: {}", possible.stderr.trim()));
        return;
    }
    let line = format!("{mount} && \"$0\" \"$@\"; code=$?; cp -r small kept; exit $code");
    let args = ["fly", "fly to the red crane", "--max-time", "12", "--json", "--out", "small/mine"];
    flew_on(&behind(&lab, &own, &line, &args));
    assert!(lab.path("kept/mine/decisions.jsonl").exists());
}
