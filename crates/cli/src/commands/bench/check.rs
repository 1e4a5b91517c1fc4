//! `spf bench check`: validates a task's file, its predicate and its sampled starts.

use std::path::Path;
use std::sync::Arc;

use spf_api::bench::task_of;
use spf_bench::judge::{JudgeCamera, Judgement, judge_trajectory};
use spf_bench::task::Task;
use spf_bench::trial::{Sampled, draw};
use spf_core::geometry::{Pose, wrap_angle};
use spf_flight::sim::LoadedScene;
use spf_oracle::language::Verb;
use spf_render::Channels;
use spf_sim::model::Model;
use spf_sim::wind::Wind;

use crate::args::BenchCheck;
use crate::commands::load_scene;
use crate::commands::sim::{colour, write};
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::{Printer, table};

/// Checks a task, and prints the starts of its trials.
pub(super) fn check(args: &BenchCheck, printer: &Printer) -> Result<Exit, CliError> {
    let task = task_of(&args.task)?;
    printer.result(&format!("{}: \"{}\" in {}, craft {}", task.id, task.instruction, task.scene, task.craft.name()));
    let loaded = match task.objects.is_empty() {
        true => load_scene(&task.scene, &task.conditions)?,
        false => task.load_scene(&task.scene).map_err(|error| CliError::usage("cannot load the task's scene").because(&error))?,
    };
    let loaded = Arc::new(loaded);
    stages(&task, &loaded, printer)?;
    let wrong = trajectories(&task, &loaded, printer)?;
    if let Some(folder) = &args.images {
        std::fs::create_dir_all(folder)
            .map_err(|error| CliError::usage(format!("cannot create the folder `{}`", folder.display())).because(&error))?;
    }
    let mut rows = vec![HEAD.map(str::to_owned).to_vec()];
    for number in 0..args.trials {
        let seed = args.seed.wrapping_add(number);
        let drawn = draw(&task, seed).map_err(|error| CliError::usage("cannot fly the task").because(&error))?;
        rows.push(row(&task, seed, &drawn));
        if let Some(folder) = &args.images {
            image(&task, &drawn, &folder.join(format!("{}-{seed}.png", task.id)))?;
        }
    }
    if args.trials > 0 {
        printer.result(&table(&rows));
    }
    match wrong {
        0 => Ok(Exit::Success),
        _ => Err(CliError::usage(format!("{wrong} trajectories are not judged as the file expects"))),
    }
}

/// Prints what the oracle flies, with the objects of the scene as given in its file.
fn stages(task: &Task, loaded: &LoadedScene, printer: &Printer) -> Result<(), CliError> {
    for (stage, number) in task.brief(loaded, loaded.scene.start.position).stages.iter().zip(1..) {
        let keys: Vec<String> = stage.objects.iter().map(|id| loaded.key(*id)).collect();
        if keys.is_empty() && stage.verb != Verb::Scan {
            return Err(CliError::usage(format!("no object in the scene `{}` matches stage {number}", task.scene)));
        }
        let other = if stage.other { " (another than before)" } else { "" };
        let line = format!("stage {number}: {} {}{other}", stage.verb.name(), keys.join(", "));
        printer.result(line.trim_end());
    }
    Ok(())
}

/// Judges the file's own trajectories; returns the number of wrong verdicts.
fn trajectories(task: &Task, loaded: &Arc<LoadedScene>, printer: &Printer) -> Result<usize, CliError> {
    let mut wrong = 0;
    for trajectory in &task.trajectories {
        let judgement = judge_trajectory(task, loaded, trajectory)
            .map_err(|error| CliError::usage("cannot judge the task").because(&error))?;
        let right = judgement.accepted == trajectory.accepted;
        wrong += usize::from(!right);
        let mark = if right { "ok   " } else { "WRONG" };
        printer.result(&format!("{mark} {}: {}", trajectory.why, words(&judgement, task)));
    }
    Ok(wrong)
}

fn words(judgement: &Judgement, task: &Task) -> String {
    let verdict = if judgement.accepted { "accepted" } else { "rejected" };
    let touched = judgement.touched.as_ref().map_or(String::new(), |key| format!(", collided with {key}"));
    let distance = judgement.distance.map_or(String::new(), |metres| format!(", {metres:.1} m from the last target"));
    let seen = if judgement.sees == Some(false) { ", not in view" } else { "" };
    format!("{verdict}, {} of {} goals met{distance}{seen}{touched}", judgement.met, task.goals.len())
}

const HEAD: [&str; 10] = ["SEED", "SCENE", "LIGHT", "WIND", "START", "TARGET", "BEARING", "RANGE", "IN VIEW", "CLUTTER"];

fn aloft(task: &Task, drawn: &Sampled) -> Pose {
    let mut pose = drawn.start;
    pose.position.up += Model::of(task.craft).craft.take_off_height;
    pose
}

/// The start of a trial. Clutter: clearly visible objects besides the ground and the target.
fn row(task: &Task, seed: u64, drawn: &Sampled) -> Vec<String> {
    let (scene, start) = (&drawn.loaded.scene, &drawn.start);
    let focus = drawn.focus.and_then(|id| scene.object(id));
    let bearing = focus.map(|object| {
        let (min, max) = (object.bounds.min, object.bounds.max);
        let (east, north) = (0.5 * (min.east + max.east), 0.5 * (min.north + max.north));
        let to = libm::atan2(east - start.position.east, north - start.position.north);
        wrap_angle(to - start.attitude.heading).to_degrees()
    });
    let all: Vec<u16> = scene.objects.iter().map(|object| object.id).collect();
    let seen = JudgeCamera::of(task.craft).clearly(&drawn.loaded, &drawn.loaded.initial_snapshot(aloft(task, drawn)), &all);
    let is_thing = |id: &&u16| {
        let object = scene.object(**id);
        Some(**id) != drawn.focus
            && object.is_some_and(|o| !o.opening && !matches!(o.tags.kind.as_str(), "ground" | "floor" | "ceiling" | "wall"))
    };
    let dash = || "–".to_owned();
    vec![
        seed.to_string(),
        drawn.scene.clone(),
        format!("{}, {}", scene.lighting.name(), scene.weather.name()),
        if drawn.wind == Wind::default() { dash() } else { drawn.wind.to_string() },
        format!("{:.1},{:.1},{:.0}°", start.position.east, start.position.north, start.attitude.heading.to_degrees()),
        focus.map_or_else(dash, |object| object.key.clone()),
        bearing.map_or_else(dash, |degrees| format!("{degrees:.0}°")),
        drawn.range.map_or_else(dash, |metres| format!("{metres:.1} m")),
        drawn.in_view.map_or_else(dash, |is| if is { "yes" } else { "no" }.to_owned()),
        seen.iter().filter(is_thing).count().to_string(),
    ]
}

fn image(task: &Task, drawn: &Sampled, path: &Path) -> Result<(), CliError> {
    let moment = drawn.loaded.initial_snapshot(aloft(task, drawn));
    let image = drawn.loaded.render(&task.craft.camera(), &moment, Channels::RGB);
    write(path, &colour(&image)?)
}
