//! `spf bench import`, and the tasks that it writes, shown.

use std::path::Path;

use spf_bench::import::{ImportError, read};
use spf_bench::measures::length;
use spf_bench::task::{ForeignTask, TaskFile};
use spf_core::geometry::EnuPosition;

use crate::args::{BenchImport, BenchShow};
use crate::commands::sim::write;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;

/// Tilt of a start pose above which it is told that starts are level here, degrees.
const TILT_DEG: f64 = 1.0;

/// Writes the tasks of an instruction set.
pub(super) fn import(args: &BenchImport, printer: &Printer) -> Result<Exit, CliError> {
    let set = read(&args.file).map_err(|error| refused(&error))?;
    let folder = &args.output;
    let unusable =
        |error: std::io::Error| CliError::usage(format!("cannot use the folder `{}`", folder.display())).because(&error);
    std::fs::create_dir_all(folder).map_err(unusable)?;
    if std::fs::read_dir(folder).map_err(unusable)?.next().is_some() {
        return Err(CliError::usage(format!("the folder `{}` is not empty", folder.display())).hint("give a new or empty folder"));
    }
    for task in &set.tasks {
        let text = task.to_toml().map_err(|error| CliError::internal("cannot write the task").because(&error))?;
        write(&folder.join(format!("{}.toml", task.id)), text.as_bytes())?;
    }
    let mut scenes: Vec<&str> = set.tasks.iter().map(|task| task.scene.as_str()).collect();
    scenes.sort_unstable();
    scenes.dedup();
    let benchmark = set.tasks.first().map_or("", |task| task.benchmark.name());
    let (tasks, scenes) = (count(set.tasks.len(), "task"), count(scenes.len(), "scene"));
    printer.log(&format!("{tasks} of {benchmark} from {}, in {scenes}", count(set.episodes, "episode")));
    let tilt = set.most_tilt.to_degrees();
    if tilt > TILT_DEG {
        printer.log(&format!("warning: starts are tilted by up to {tilt:.0}°; they are imported level, with their heading"));
    }
    printer.result(&folder.display().to_string());
    Ok(Exit::Success)
}

fn refused(error: &ImportError) -> CliError {
    CliError::usage("cannot import the instruction set").because(error)
}

fn count(number: usize, what: &str) -> String {
    if number == 1 { format!("1 {what}") } else { format!("{number} {what}s") }
}

/// Whether a name is that of a task file instead of a trial.
pub(super) fn is_file(name: &str) -> bool {
    Path::new(name).extension().is_some_and(|ending| ending == "toml")
}

/// Shows the task of a file.
pub(super) fn show(args: &BenchShow, printer: &Printer) -> Result<Exit, CliError> {
    let name = &args.run_id;
    if args.task.is_some() || args.vlm.is_some() || args.output.is_some() || args.no_video {
        return Err(CliError::usage(format!("`{name}` is a task file, which is shown without options"))
            .hint("to repeat a trial, give task/method/vlm/seed"));
    }
    match TaskFile::load(name).map_err(|error| CliError::usage(format!("invalid task `{name}`")).because(&error))? {
        TaskFile::Foreign(task) => lines(&task).iter().for_each(|line| printer.result(line)),
        TaskFile::Own(_) => {
            return Err(CliError::usage(format!("`{name}` is a task of this simulator")).hint(format!("spf bench check {name}")));
        }
    }
    Ok(Exit::Success)
}

fn lines(task: &ForeignTask) -> Vec<String> {
    let ForeignTask { id, benchmark, scene, trajectory, wordings, start, destination, reference } = task;
    let mut lines =
        vec![format!("{id}: {}, scene {scene} (served by {}), trajectory {trajectory}", benchmark.name(), benchmark.simulator())];
    lines.extend(wordings.iter().map(|wording| format!("{}: \"{}\"", wording.episode, wording.instruction)));
    lines.push(format!("start: {}, heading {:.0}°", words(start.position), start.attitude.heading.to_degrees()));
    let how = if destination.horizontal { " on the map" } else { "" };
    lines.push(format!("goal: {}, within {} m{how}", words(destination.position), destination.radius_m));
    let (course, straight) = (task.course(), task.straight());
    let corners = reference.len();
    lines.push(format!(
        "path: {:.1} m with {corners} corners; straight to the goal {:.1} m",
        length(reference),
        course.shortest_m
    ));
    let scores = task.measure(&straight, true, false);
    lines.push(format!(
        "for comparison, the straight line (not flown): SPL {:.2}, nDTW {:.2}, SDTW {:.2}",
        scores.spl, scores.ndtw, scores.sdtw
    ));
    lines
}

fn words(at: EnuPosition) -> String {
    format!("{} m east, {} m north, {} m up", at.east, at.north, at.up)
}
