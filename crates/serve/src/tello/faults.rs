//! Faults from a file that is reloaded when it changes.

use std::path::PathBuf;
use std::time::SystemTime;

use spf_core::time::{Duration, Time};

use super::error::ServerError;
use crate::fault::{FaultMachine, FaultPlan};

/// Polling interval of the fault file.
const FAULTS_LOOK: Duration = Duration::from_millis(250);

/// Source of faults.
#[derive(Clone, Debug)]
pub enum FaultSource {
    /// A fixed plan.
    Plan(FaultPlan),
    /// A TOML file, reloaded when it changes, so that faults can be switched in flight.
    File(PathBuf),
}

/// Loads the current faults.
pub(crate) fn read(source: &FaultSource) -> Result<FaultPlan, ServerError> {
    match source {
        FaultSource::Plan(plan) => Ok(plan.clone()),
        FaultSource::File(path) => {
            let failed = |source| ServerError::FaultFile { path: path.clone(), source };
            let text = spf_input::read_text(path).map_err(failed)?;
            toml::from_str(&text).map_err(|source| ServerError::FaultSyntax { path: path.clone(), source: Box::new(source) })
        }
    }
}

/// Watches the fault file for changes.
pub(crate) struct Watch {
    source: FaultSource,
    seed: u64,
    seen: Option<SystemTime>,
    look_at: Time,
}

impl Watch {
    pub(crate) fn new(source: FaultSource, seed: u64) -> Self {
        let mut watch = Self { source, seed, seen: None, look_at: Time::ZERO };
        watch.seen = watch.changed();
        watch
    }

    fn changed(&self) -> Option<SystemTime> {
        let FaultSource::File(path) = &self.source else { return None };
        std::fs::metadata(path).and_then(|metadata| metadata.modified()).ok()
    }

    /// The new faults, if the file has changed. An invalid file changes nothing.
    pub(crate) fn look(&mut self, now: Time) -> Option<FaultMachine> {
        if now < self.look_at {
            return None;
        }
        self.look_at = now + FAULTS_LOOK;
        let changed = self.changed().filter(|at| self.seen != Some(*at))?;
        self.seen = Some(changed);
        match read(&self.source).and_then(|plan| Ok(FaultMachine::new(plan, self.seed)?)) {
            Ok(machine) => Some(machine),
            Err(error) => {
                tracing::warn!(%error, "invalid fault file: keeping the previous faults");
                None
            }
        }
    }
}
