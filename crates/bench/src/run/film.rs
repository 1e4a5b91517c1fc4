//! Records videos of trials.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use spf_flight::recorder::RecordPlan;
use spf_record::out_dir::{OutDir, OutDirError};
use spf_vlm::service::Service;

use super::files::{StoreError, failed};
use crate::trial::{Flown, Lost, Sampled, Trial};

/// Path of the video of a trial in a result folder, whether or not it exists.
#[must_use]
pub fn video_of(folder: &Path, run_id: &str) -> PathBuf {
    folder.join("videos").join(format!("{run_id}.mp4"))
}

/// Flies a trial and keeps its video; other files of the recorded flight are deleted.
pub(super) fn fly(
    trial: &Trial,
    drawn: &Sampled,
    folder: &Path,
    service: &Arc<Service>,
) -> Result<Result<Flown, Lost>, StoreError> {
    let run_id = trial.run_id();
    let video = video_of(folder, &run_id);
    let made = video.parent().map_or(Ok(()), std::fs::create_dir_all);
    made.map_err(failed(&video))?;
    let beside = video.with_extension("part");
    // Left over from a process that was killed.
    if beside.exists() {
        std::fs::remove_dir_all(&beside).map_err(failed(&beside))?;
    }
    let out = OutDir::at(&beside).map_err(|error| match error {
        OutDirError::Folder { path, source } => StoreError::File { path, source },
        _ => StoreError::Other { path: beside.clone(), what: "another process is recording this trial".into() },
    })?;
    let flown = trial.fly_served(drawn, Some(RecordPlan { out, video: true, view: None }), service);
    let film = beside.join("video.mp4");
    // A trial that could not start has no video, and one without a row is flown again.
    if flown.is_ok() && film.is_file() {
        std::fs::rename(&film, &video).map_err(failed(&video))?;
    }
    std::fs::remove_dir_all(&beside).map_err(failed(&beside))?;
    Ok(flown)
}
