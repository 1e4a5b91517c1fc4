//! Python with the packages of `requirements.txt`, in an environment of its own under `target/`, for tests in which third-party
//! programs read our files.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::harness::skip;

/// The interpreter of the environment; `None`, with a notice, if there is no Python or no package index.
pub(crate) fn environment() -> Option<PathBuf> {
    made("python", include_str!("requirements.txt"), &[])
}

/// An environment with the packages of a list, then those of further arguments of `pip install`.
pub(crate) fn made(name: &str, wanted: &str, then: &[&str]) -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let python = folder.join("bin").join("python3");
    let message = |output: std::io::Result<Output>| match output {
        Ok(output) if output.status.success() => Ok(()),
        Ok(output) => Err(String::from_utf8_lossy(&output.stderr).trim().to_owned()),
        Err(error) => Err(error.to_string()),
    };
    // Tests of several threads and processes want it: the first one makes it, the others wait.
    let waiting = std::fs::File::create(folder.with_extension("lock")).unwrap();
    waiting.lock().unwrap();
    // The marker is written last: an interrupted environment is created again, and so is one of other packages.
    let marker = folder.join("requirements.txt");
    if !std::fs::read_to_string(&marker).is_ok_and(|made| made == wanted) {
        let packages = folder.with_extension("txt");
        std::fs::write(&packages, wanted).unwrap();
        let made = message(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&folder).output())
            .and_then(|()| {
                message(
                    Command::new(&python).args(["-m", "pip", "install", "--quiet", "--no-compile", "-r"]).arg(&packages).output(),
                )
            })
            .and_then(|()| {
                let install = |()| message(Command::new(&python).args(["-m", "pip", "install", "--quiet"]).args(then).output());
                (!then.is_empty()).then_some(()).map_or(Ok(()), install)
            })
            .and_then(|()| std::fs::write(&marker, wanted).map_err(|error| error.to_string()));
        if let Err(why) = made {
            skip(&format!("the Python environment `{name}` ({why})"));
            return None;
        }
    }
    Some(python)
}
