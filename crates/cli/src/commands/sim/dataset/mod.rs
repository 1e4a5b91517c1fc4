//! `spf sim dataset`: labelled pointing data in a folder (docs/guide/dataset.md).

mod files;
mod folder;

use std::sync::atomic::{AtomicU32, Ordering};

use spf_core::craft::CraftKind;
use spf_flight::dataset::record::{DatasetHeader, FORMAT, Row, SceneHead};
use spf_flight::dataset::{Generator, Kind, Recipe};
use spf_flight::sim::LoadedScene;

use super::{conditions, parse_effects, parse_kind, parse_size};
use crate::args::Dataset;
use crate::commands::fly::signals::interrupts;
use crate::commands::load_scene;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;
use files::{ImageFormat, write_example};
use folder::Folder;

/// Generates a dataset, or the rest of one.
pub(super) fn dataset(args: &Dataset, printer: &mut Printer) -> Result<Exit, CliError> {
    let interrupts = interrupts()?;
    generate(args, &interrupts, printer)
}

/// Makes a dataset, or the rest of one, until there are interrupts.
pub(crate) fn generate(args: &Dataset, interrupts: &AtomicU32, printer: &mut Printer) -> Result<Exit, CliError> {
    let format = ImageFormat::parse(&args.images)?;
    let size = args.size.as_deref().map(parse_size).transpose()?;
    let kind = args.drone_model.as_deref().map(parse_kind).transpose()?;
    let effects = args.camera_effects.as_deref().map(parse_effects).transpose()?.unwrap_or_default();
    let (absent, look_alikes) = (fraction("--absent", args.absent)?, fraction("--look-alikes", args.look_alikes)?);
    if absent + look_alikes > 1.0 {
        return Err(CliError::usage("--absent and --look-alikes add up to more than 1")
            .hint("they are fractions of the examples; the rest show the target without a deliberate look-alike"));
    }
    let conditions = conditions(&args.conditions)?;
    let names: Vec<&str> = args.scene.split(',').map(str::trim).collect();
    let loaded_scenes = names.iter().map(|name| load_scene(name, &conditions)).collect::<Result<Vec<LoadedScene>, _>>()?;
    let kind = kind.unwrap_or_else(|| loaded_scenes.first().map_or(CraftKind::Quad, |loaded| loaded.scene.default_craft));
    let camera = size.map_or(kind.camera(), |(width, height)| kind.camera().resized(width, height));
    let recipe = Recipe { seed: args.seed, camera, effects, absent, look_alikes, min_pixels: args.min_pixels };
    let mut generators: Vec<Generator<'_>> = loaded_scenes.iter().map(|loaded| Generator::new(loaded, recipe.clone())).collect();
    for (name, generator) in names.iter().zip(&generators) {
        check_scene(name, generator, &recipe)?;
    }
    let head = head(args, &names, &loaded_scenes, kind, &recipe, &generators);
    let mut folder = Folder::open(&args.output, &head, args.resume, args.overwrite)?;
    for (scene, loaded) in head.scenes.iter().zip(&loaded_scenes) {
        folder.write(&scene.legend, format!("{:#}\n", loaded.scene.legend_json()).as_bytes())?;
    }
    let first = folder.examples();
    if first > 0 {
        printer.log(&format!("{first} of {} examples already done", args.count));
    }
    printer.start_count("images", args.count, first);
    let mut counts = [0_u64; 3];
    for number in first..args.count {
        if interrupts.load(Ordering::Relaxed) > 0 {
            printer.end_live();
            printer
                .log(&format!("stopped after {number} of {} examples; repeat the command with --resume to continue", args.count));
            return Ok(Exit::Aborted);
        }
        let index = (number % generators.len() as u64) as usize;
        let example = generators[index].example(number).ok_or_else(|| no_view(names[index], recipe.kind(number), number))?;
        counts[example.kind as usize] += 1;
        let files = write_example(&folder, number, &example, format)?;
        folder.push(&Row::of(number, &head.scenes[index], &example, files))?;
        printer.count(number + 1);
    }
    printer.end_live();
    let [present, alike, absent] = counts;
    printer.log(&format!("examples: {present} with the target, {alike} with a look-alike as well, {absent} without the target"));
    printer.result(&folder.path().display().to_string());
    Ok(Exit::Success)
}

fn head(
    args: &Dataset,
    names: &[&str],
    loaded_scenes: &[LoadedScene],
    kind: CraftKind,
    recipe: &Recipe,
    generators: &[Generator<'_>],
) -> DatasetHeader {
    let scene = |(index, (name, loaded)): (usize, (&&str, &LoadedScene))| SceneHead {
        name: (*name).to_owned(),
        legend: format!("legends/{index}.json"),
        light: loaded.scene.lighting.name().to_owned(),
        weather: loaded.scene.weather.name().to_owned(),
        near_m: loaded.scene.near,
    };
    DatasetHeader {
        format: FORMAT,
        seed: recipe.seed,
        examples: args.count,
        scenes: names.iter().zip(loaded_scenes).enumerate().map(scene).collect(),
        drone_model: kind.name().to_owned(),
        camera: generators.first().map_or(recipe.camera, |generator| *generator.camera()),
        camera_effects: recipe.effects.to_string(),
        absent: recipe.absent,
        look_alikes: recipe.look_alikes,
        min_pixels: recipe.min_pixels,
        images: args.images.clone(),
    }
}

/// A scene in which no two objects have the same name cannot show a look-alike.
fn check_scene(name: &str, generator: &Generator<'_>, recipe: &Recipe) -> Result<(), CliError> {
    let needs = [(Kind::Present, 1.0), (Kind::LookAlike, recipe.look_alikes)];
    match needs.into_iter().find(|(kind, fraction)| *fraction > 0.0 && !generator.can_make(*kind)) {
        None => Ok(()),
        Some((Kind::LookAlike, _)) => {
            let what = format!("no two objects in the scene `{name}` share a name and differ in colour or another attribute");
            Err(CliError::usage(what).hint("disable look-alikes with --look-alikes 0"))
        }
        Some(_) => Err(CliError::usage(format!("the scene `{name}` has no possible targets"))
            .hint("the scene needs objects other than ground and water")),
    }
}

fn no_view(scene: &str, kind: Kind, number: u64) -> CliError {
    let what = match kind {
        Kind::Present => "shows its target",
        Kind::LookAlike => "shows a target and a look-alike",
        Kind::Absent => "leaves out a uniquely named target",
    };
    CliError::usage(format!("found no view of the scene `{scene}` that {what} (example {number})"))
        .hint("reduce --min-pixels, --look-alikes or --absent")
}

fn fraction(flag: &str, value: f64) -> Result<f64, CliError> {
    if (0.0..=1.0).contains(&value) {
        return Ok(value);
    }
    Err(CliError::usage(format!("{flag}: expected a fraction, found `{value}`"))
        .hint("use a number from 0 to 1, for example 0.25"))
}
