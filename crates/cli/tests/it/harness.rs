//! A fresh folder for running the command, and the output of a run.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use serde_json::Value;

/// A working directory that nothing else uses.
pub(crate) struct Lab {
    folder: tempfile::TempDir,
}

/// The results of a run.
pub(crate) struct Run {
    /// Exit code; `None` if a signal ended it.
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl Lab {
    pub(crate) fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path(name), content).unwrap();
    }

    pub(crate) fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    /// Names in a folder of the lab, in order.
    pub(crate) fn names(&self, folder: &str) -> Vec<String> {
        let entries = fs::read_dir(self.path(folder)).unwrap();
        let mut names: Vec<String> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// The command, in the lab, without the tester's own environment.
    pub(crate) fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_spf"));
        command.args(args).current_dir(self.folder.path()).env_clear().stdin(Stdio::null());
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        // The system's own, without which nothing starts on some systems.
        for name in ["PATH", "SystemRoot", "TMPDIR", "TEMP"] {
            if let Some(value) = std::env::var_os(name) {
                command.env(name, value);
            }
        }
        command
    }

    pub(crate) fn spf(&self, args: &[&str]) -> Run {
        Run::of(&self.command(args).output().unwrap())
    }

    /// A flight with `--json --no-video --out NAME`, whatever its outcome: exit code and the object printed.
    pub(crate) fn fly(&self, name: &str, args: &[&str]) -> (i32, Value) {
        let mut all = vec!["fly"];
        all.extend(args);
        all.extend(["--json", "--no-video", "--out", name]);
        let run = self.spf(&all);
        let printed = serde_json::from_str(&run.stdout).unwrap_or_else(|error| panic!("{error}\n{}\n{}", run.stdout, run.stderr));
        (run.code.unwrap(), printed)
    }

    /// The rows of a flight's `decisions.jsonl`; every line must be a whole object.
    pub(crate) fn decisions(&self, name: &str) -> Vec<Value> {
        rows(&self.path(name).join("decisions.jsonl"))
    }
}

/// The rows of a JSON Lines file; the file must end in a whole line.
pub(crate) fn rows(path: &Path) -> Vec<Value> {
    let text = fs::read_to_string(path).unwrap();
    assert!(text.is_empty() || text.ends_with('\n'), "the last line is torn");
    text.lines().map(|line| serde_json::from_str(line).unwrap_or_else(|error| panic!("{error}: {line}"))).collect()
}

impl Run {
    pub(crate) fn of(output: &Output) -> Self {
        let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
        Self { code: output.status.code(), stdout: text(&output.stdout), stderr: text(&output.stderr) }
    }
}

/// Skips with a notice if a tool is missing; on CI it must exist.
pub(crate) fn skip(what: &str) {
    assert!(std::env::var_os("CI").is_none_or(|ci| ci != "true"), "{what} is missing on CI");
    warn(&format!("{what} is missing"));
}

/// A skipped test must not look like a passed one.
#[allow(clippy::print_stderr, reason = "tests may print; the command may not")]
pub(crate) fn warn(why: &str) {
    eprintln!("SKIPPED: {why}");
}
