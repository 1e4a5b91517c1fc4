//! Links to files, and commands for repeating trials.

use std::path::{Component, Path, PathBuf};

use percent_encoding::{AsciiSet, CONTROLS, utf8_percent_encode};
use spf_oracle::ErrorFile;

use super::super::arm::Arm;
use super::super::source::Run;
use crate::run::shell_word;
use crate::trial::Record;

/// Characters to be escaped in a relative link.
const RESERVED: &AsciiSet =
    &CONTROLS.add(b' ').add(b'"').add(b'#').add(b'%').add(b'<').add(b'>').add(b'?').add(b'`').add(b':').add(b'\\').add(b'\'');

/// The link from a page in `folder` to a file; both must exist.
pub(super) fn relative(folder: &Path, file: &Path) -> Option<String> {
    let (folder, file) = (folder.canonicalize().ok()?, file.canonicalize().ok()?);
    let (from, to): (Vec<Component<'_>>, Vec<Component<'_>>) = (folder.components().collect(), file.components().collect());
    let common = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
    if common == 0 {
        return None;
    }
    let up = std::iter::repeat_n(PathBuf::from(".."), from.len() - common);
    let down = to.iter().skip(common).map(|part| PathBuf::from(part.as_os_str()));
    let parts: Vec<String> =
        up.chain(down).map(|part| utf8_percent_encode(&part.to_string_lossy(), RESERVED).to_string()).collect();
    Some(parts.join("/"))
}

/// The command that repeats a trial.
pub(super) fn show(run: Option<&Run>, arm: &Arm, record: &Record) -> String {
    let mut words = vec!["spf bench show".to_owned(), shell_word(&record.run_id)];
    if let Some(file) = run.and_then(|run| run.made.as_ref()?.files.get(&record.task)) {
        words.extend(["--task".to_owned(), shell_word(file)]);
    }
    let shipped = arm.level().is_some_and(|level| ErrorFile::shipped().contains(&level));
    if !(arm.is_blind() || shipped) {
        let name = record.flight.as_ref().map_or(arm.vlm.as_str(), |flight| flight.vlm.as_str());
        words.extend(["--vlm".to_owned(), shell_word(name)]);
    }
    words.extend(["-o".to_owned(), shell_word(&format!("shown-{}", record.run_id.replace('/', "-")))]);
    words.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_link_leads_from_one_folder_into_another() {
        let base = tempfile::tempdir().unwrap();
        let at = |name: &str| base.path().join(name);
        std::fs::create_dir_all(at("a/report")).unwrap();
        std::fs::create_dir_all(at("b #1%/videos")).unwrap();
        std::fs::write(at("b #1%/videos/0.mp4"), "").unwrap();
        let link = relative(&at("a/report"), &at("b #1%/videos/0.mp4"));
        assert_eq!(link.as_deref(), Some("../../b%20%231%25/videos/0.mp4"));
        assert_eq!(relative(&at("a"), &at("nothing")), None);
    }
}
