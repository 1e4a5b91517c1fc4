//! Documents: links, anchors and paths named in text and code resolve; pages name the code that they describe; lines wrap at 100.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};

/// The root of the repository.
pub(crate) fn root() -> PathBuf {
    normal(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../.."))
}

/// `path` without `.` and `..`.
fn normal(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir => _ = out.pop(),
            other => out.push(other),
        }
    }
    out
}

/// Every file of the repository whose name ends in one of `endings`, without what builds and flights leave.
fn files(endings: &[&str]) -> Vec<PathBuf> {
    const LEFT_BY_RUNS: [&str; 7] = [".git", "target", "flights", "bench-results", "corpus", "artifacts", "node_modules"];
    let mut found = Vec::new();
    let mut folders = vec![root()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if path.is_dir() {
                if !LEFT_BY_RUNS.contains(&name.as_str()) {
                    folders.push(path);
                }
            } else if endings.iter().any(|ending| name.ends_with(ending)) {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// The lines of a Markdown text that are not in a fenced block, with their numbers.
fn prose(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let mut fenced = false;
    (1..).zip(text.lines()).filter(move |(_, line)| {
        let fence = line.trim_start().starts_with("```");
        fenced ^= fence;
        !fence && !fenced
    })
}

/// The anchors of a Markdown text, as GitHub forms them from its headings.
fn anchors(text: &str) -> BTreeSet<String> {
    let mut seen: BTreeMap<String, usize> = BTreeMap::new();
    let headings = prose(text).filter_map(|(_, line)| {
        let heading = line.trim_start_matches('#');
        let depth = line.len() - heading.len();
        (1..=6).contains(&depth).then(|| heading.strip_prefix(' ')).flatten()
    });
    headings
        .map(|heading| {
            let kept = heading.trim().chars().filter(|letter| letter.is_alphanumeric() || matches!(letter, '-' | '_' | ' '));
            let anchor: String =
                kept.flat_map(char::to_lowercase).map(|letter| if letter == ' ' { '-' } else { letter }).collect();
            let times = seen.entry(anchor.clone()).or_default();
            *times += 1;
            if *times == 1 { anchor } else { format!("{anchor}-{}", *times - 1) }
        })
        .collect()
}

/// The targets of the links and images of a line, `[…](target)`, that are not addresses of the web.
fn targets(line: &str) -> impl Iterator<Item = &str> {
    line.split("](").skip(1).filter_map(|rest| rest.split(')').next()).filter(|target| !target.contains("://"))
}

/// The links of a document (with this name, folder and text) that do not resolve.
fn dead_links(name: &str, folder: &Path, text: &str) -> Vec<String> {
    let mut dead = Vec::new();
    for (number, line) in prose(text) {
        for target in targets(line) {
            let (path, anchor) = target.split_once('#').unwrap_or((target, ""));
            let there = normal(&folder.join(path));
            let found = if path.is_empty() {
                anchors(text).contains(anchor)
            } else if anchor.is_empty() {
                there.exists()
            } else {
                std::fs::read_to_string(&there).is_ok_and(|other| anchors(&other).contains(anchor))
            };
            if !found {
                dead.push(format!("{name}:{number}: {target}"));
            }
        }
    }
    dead
}

/// The paths under `docs/` that a text names.
fn named(text: &str) -> impl Iterator<Item = &str> {
    text.match_indices("docs/").filter_map(|(at, _)| {
        // `other-docs/…` and `https://…/docs/…` are not ours; `../docs/…` and `…/../docs/…` are.
        let before = &text[..at];
        let ours =
            !before.ends_with(|letter: char| letter.is_alphanumeric() || "-_/.".contains(letter)) || before.ends_with("../");
        let path = text[at..].split(|letter: char| !(letter.is_ascii_alphanumeric() || "-_/.".contains(letter))).next()?;
        ours.then(|| path.trim_end_matches(['.', '/']))
    })
}

#[test]
fn links_and_anchors_resolve() {
    let dead: Vec<String> = files(&[".md"])
        .iter()
        .flat_map(|path| dead_links(&path.display().to_string(), path.parent().unwrap(), &std::fs::read_to_string(path).unwrap()))
        .collect();
    assert!(dead.is_empty(), "{}", dead.join("\n"));
}

#[test]
fn documents_named_in_text_and_code_exist() {
    let mut missing = Vec::new();
    for path in files(&[".md", ".rs", ".py", ".sh", ".toml", ".txt", ".snap", ".sbatch"]) {
        let Ok(text) = std::fs::read_to_string(&path) else { continue };
        for (number, line) in (1..).zip(text.lines()) {
            let lost = named(line).filter(|name| !root().join(name).exists());
            missing.extend(lost.map(|name| format!("{}:{number}: {name}", path.display())));
        }
    }
    assert!(missing.is_empty(), "{}", missing.join("\n"));
}

/// Lines of running text that are longer than 100 characters. Tables, code, images and unbreakable links may be.
fn long_lines(text: &str) -> impl Iterator<Item = usize> {
    prose(text).filter_map(|(number, line)| {
        let breakable = line.trim_start().contains(' ') && !line.starts_with(['|', '#', '>']) && !line.starts_with("    ");
        (breakable && !line.starts_with("![") && line.chars().count() > 100).then_some(number)
    })
}

#[test]
fn pages_name_their_code_and_wrap_at_100() {
    let mut wrong = Vec::new();
    for path in files(&[".md"]) {
        let (name, text) = (path.display().to_string(), std::fs::read_to_string(&path).unwrap());
        let page = ["guide", "reference", "explanation"]
            .iter()
            .any(|folder| path.parent().unwrap().ends_with(Path::new("docs").join(folder)));
        if page && !text.lines().any(|line| line.starts_with("In code: ")) {
            wrong.push(format!("{name}: no line `In code: …`"));
        }
        wrong.extend(long_lines(&text).map(|number| format!("{name}:{number}: longer than 100")));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_dead_link_is_found() {
    let text =
        "# A [`b`] c\n[here](#a-b-c) [there](documents.rs) [web](https://x.y/z)\n```\n[code](no.md)\n```\n[a](no.md) [b](#no)\n";
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it");
    assert_eq!(dead_links("t", &folder, text), ["t:6: no.md", "t:6: #no"]);
    let line = concat!("(do", "cs/a.md), https://x.y/docs/b.md, `../../do", "cs/c.md`");
    assert_eq!(named(line).collect::<Vec<_>>(), [concat!("do", "cs/a.md"), concat!("do", "cs/c.md")]);
    let wide = "a ".repeat(60);
    assert_eq!(long_lines(&format!("| {wide}\n{wide}\n```\n{wide}\n```\n    {wide}\nshort\n")).collect::<Vec<_>>(), [2]);
}
