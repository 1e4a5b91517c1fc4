//! `spf completions` and `spf man`, as shells and `man` read them.

use std::process::Command;

use crate::harness::Lab;

/// The program, if it is installed.
fn installed(program: &str) -> bool {
    let known = Command::new("sh").args(["-c", &format!("command -v {program}")]).output();
    known.is_ok_and(|output| output.status.success())
}

#[test]
fn there_is_a_page_for_every_command() {
    let lab = Lab::new();
    let run = lab.spf(&["man", "pages"]);
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
    let names = lab.names("pages");
    for page in ["spf.1", "spf-fly.1", "spf-cockpit.1", "spf-bench-run.1", "spf-completions.1", "spf-man.1"] {
        assert!(names.iter().any(|name| name == page), "{page}: {names:?}");
    }
    let fly = String::from_utf8(lab.read("pages/spf-fly.1")).unwrap();
    assert!(fly.contains("depth\\-sensor") && fly.contains(".TH"), "{fly}");
    lab.write("file", "");
    let run = lab.spf(&["man", "file"]);
    assert_eq!(run.code, Some(2));
    assert!(run.stderr.contains("cannot write the manual to `file`"), "{}", run.stderr);
}

#[test]
fn a_script_names_every_subcommand() {
    let lab = Lab::new();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let run = lab.spf(&["completions", shell]);
        assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""), "{shell}");
        for word in ["fly", "cockpit", "doctor", "tello", "bench", "completions", "depth-sensor"] {
            assert!(run.stdout.contains(word), "{shell}: {word}");
        }
    }
    assert_eq!(lab.spf(&["completions", "tcsh"]).code, Some(2));
}

/// Each shell that is installed reads its script; bash completes with it.
#[test]
#[cfg(unix)]
#[ignore = "needs shells: .ci/interop runs it"]
fn shells_read_their_scripts() {
    let lab = Lab::new();
    assert!(installed("bash"), "every system that runs .ci/interop has bash");
    for (shell, check) in [("bash", "-n"), ("zsh", "-n"), ("fish", "--no-execute")] {
        lab.write(shell, lab.spf(&["completions", shell]).stdout);
        if !installed(shell) {
            eprintln!("SKIPPED: {shell} is not installed");
            continue;
        }
        let read = Command::new(shell).arg(check).arg(lab.path(shell)).output().unwrap();
        assert!(read.status.success() && read.stderr.is_empty(), "{shell}: {}", String::from_utf8_lossy(&read.stderr));
    }
    let completed = |line: &str| {
        let words: Vec<&str> = line.split(' ').collect();
        let last = words.len() - 1;
        let script = format!(
            "source ./bash; COMP_WORDS=({line} ''); COMP_WORDS[{last}]='{}'; COMP_CWORD={last}; _spf spf '{}' '{}'; echo ${{COMPREPLY[@]}}",
            words[last],
            words[last],
            words[last - 1]
        );
        let output = Command::new("bash").args(["-c", &script]).current_dir(lab.path(".")).output().unwrap();
        String::from_utf8(output.stdout).unwrap()
    };
    assert!(completed("spf coc").contains("cockpit"), "{}", completed("spf coc"));
    assert!(completed("spf fly --depth-s").contains("--depth-sensor"), "{}", completed("spf fly --depth-s"));
    assert!(completed("spf fly --preset p").contains("paper"), "{}", completed("spf fly --preset p"));
}

/// `mandoc` or `man` reads every page and finds nothing wrong in it.
#[test]
#[cfg(unix)]
#[ignore = "needs man or mandoc: .ci/interop runs it"]
fn a_reader_of_manuals_reads_every_page() {
    let lab = Lab::new();
    assert_eq!(lab.spf(&["man", "pages"]).code, Some(0));
    let (reader, flags): (_, &[&str]) = match ["mandoc", "man"].map(installed) {
        [true, _] => ("mandoc", &["-T", "lint", "-W", "error"]),
        [_, true] => ("man", &["--warnings", "-l"]),
        _ => {
            eprintln!("SKIPPED: neither mandoc nor man is installed");
            return;
        }
    };
    for name in lab.names("pages") {
        let read = Command::new(reader).args(flags).arg(lab.path("pages").join(&name)).env("MANWIDTH", "100").output().unwrap();
        let complaint = String::from_utf8_lossy(&read.stderr);
        assert!(read.status.success() && complaint.trim().is_empty(), "{name}: {complaint}");
        let title = name.trim_end_matches(".1");
        assert!(reader == "mandoc" || String::from_utf8_lossy(&read.stdout).contains(title), "{name}");
    }
}
