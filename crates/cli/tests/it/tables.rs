//! The tables of figures in the documents are those that `docs/tables` writes from the files in `docs/results`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::harness::{Lab, Run, skip};

/// The root of the repository.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Runs `docs/tables` of the repository or of a copy of it; `None`, with a notice, if there is no Python.
fn tables(root: &Path, args: &[&str]) -> Option<Run> {
    match Command::new("python3").arg(root.join("docs/tables")).args(args).env("PYTHONDONTWRITEBYTECODE", "1").output() {
        Ok(output) => Some(Run::of(&output)),
        Err(error) => {
            skip(&format!("Python ({error})"));
            None
        }
    }
}

fn copy(from: &Path, to: &Path) {
    if from.is_dir() {
        fs::create_dir_all(to).unwrap();
        for entry in fs::read_dir(from).unwrap() {
            let name = entry.unwrap().file_name();
            copy(&from.join(&name), &to.join(&name));
        }
    } else {
        fs::copy(from, to).unwrap();
    }
}

/// The parts of the repository that `docs/tables` reads.
fn copy_of_repository() -> Lab {
    let lab = Lab::new();
    fs::create_dir_all(lab.path("docs")).unwrap();
    for part in ["README.md", "docs/tables", "docs/results", "docs/explanation", "docs/guide", "docs/reference"] {
        copy(&root().join(part), &lab.path(part));
    }
    lab
}

#[test]
#[ignore = "needs Python: .ci/interop runs it"]
fn documents_have_the_figures_of_the_result_files() {
    let Some(run) = tables(&root(), &["--check"]) else { return };
    assert_eq!(run.code, Some(0), "run docs/tables:\n{}{}", run.stdout, run.stderr);
}

#[test]
#[ignore = "needs Python: .ci/interop runs it"]
fn a_changed_number_is_found_and_written_again() {
    let lab = copy_of_repository();
    let at = |name: &str| lab.path(name);
    let name = "docs/reference/bench-results.md";
    let right = fs::read_to_string(at(name)).unwrap();
    // The last digit of the first percentage of a table that is written: those of the text are a person's.
    let table = right.find("<!-- table:").unwrap();
    let digit = table + right[table..].find(" % [").unwrap() - 1;
    let other = if &right[digit..=digit] == "7" { "8" } else { "7" };
    let wrong = format!("{}{other}{}", &right[..digit], &right[digit + 1..]);
    fs::write(at(name), &wrong).unwrap();

    let Some(run) = tables(&at(""), &["--check"]) else { return };
    assert_eq!(run.code, Some(1), "{}", run.stderr);
    for (mark, text) in [("-", &wrong), ("+", &right)] {
        let line = text[table..].lines().find(|line| line.contains(" % [")).unwrap();
        assert!(run.stdout.contains(&format!("\n{mark}{line}")), "{}", run.stdout);
    }
    assert_eq!(fs::read_to_string(at(name)).unwrap(), wrong, "a check writes nothing");

    // After writing once nothing has changed; after writing twice neither.
    for listed in [format!("{name}\n"), String::new()] {
        let run = tables(&at(""), &[]).unwrap();
        assert_eq!((run.code, run.stdout), (Some(0), listed), "{}", run.stderr);
        assert_eq!(fs::read_to_string(at(name)).unwrap(), right);
    }

    // A flight changed in a result file is missing in the documents.
    let results = fs::read_to_string(at("docs/results/trials-task.tsv")).unwrap();
    fs::write(at("docs/results/trials-task.tsv"), results.replacen("VVVVV\n", "VVVVC\n", 1)).unwrap();
    let run = tables(&at(""), &["--check"]).unwrap();
    assert!(run.code == Some(1) && run.stdout.contains("README.md from docs/results"), "{}", run.stdout);
}

#[test]
#[ignore = "needs Python: .ci/interop runs it"]
fn a_table_without_end_or_file_is_refused() {
    let lab = copy_of_repository();
    for (text, message) in
        [("<!-- table: bench/paper -->\n", "1 tables begin, 0 end"), ("<!-- table: no -->\n<!-- end -->\n", "no.tsv")]
    {
        fs::write(lab.path("README.md"), text).unwrap();
        let Some(run) = tables(&lab.path(""), &["--check"]) else { return };
        assert_eq!(run.code, Some(1));
        assert!(run.stderr.contains("README.md") && run.stderr.contains(message), "{}", run.stderr);
    }
}
