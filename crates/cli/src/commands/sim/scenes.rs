//! `spf sim scenes`: lists scenes and their objects.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde::Serialize;
use spf_flight::sim::LoadedScene;
use spf_media::frame::Rgb;
use spf_media::jpeg::{EncodeError, Jpeg};
use spf_media::png;
use spf_render::Channels;
use spf_scene::{Object, Scene, SceneLook};

use super::say::{self, Saying, sayings};
use super::{colour, contact_sheet, objects, write};
use crate::args::Scenes;
use crate::commands::load_scene;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::{Printer, table};

/// What `--json` prints.
#[derive(Serialize)]
struct Listing {
    /// Every kind of mesh that a scene file can name.
    mesh_kinds: Vec<&'static str>,
    scenes: Vec<Entry>,
}

/// One scene.
#[derive(Serialize)]
struct Entry {
    name: String,
    description: String,
    drone_model: &'static str,
    /// East, north, up.
    size_m: [f64; 3],
    /// Lower and upper corner: east, north, up.
    bounds_m: [[f64; 3]; 2],
    start: Start,
    objects: usize,
    tags: Vec<Tag>,
    #[serde(skip_serializing_if = "Option::is_none")]
    object_list: Option<Vec<objects::Row>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    say: Option<Vec<Saying>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    #[serde(rename = "picture")]
    image: Option<PathBuf>,
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    stats: Option<Stats>,
}

/// Where flights start, on the ground.
#[derive(Serialize)]
struct Start {
    east_m: f64,
    north_m: f64,
    up_m: f64,
    /// Clockwise from north.
    heading_deg: f64,
}

/// Number and colours of the objects with a name.
#[derive(Serialize)]
struct Tag {
    name: String,
    count: usize,
    colours: BTreeSet<String>,
}

/// What `--stats` adds.
#[derive(Serialize)]
struct Stats {
    meshes: usize,
    mesh_kinds: BTreeSet<&'static str>,
    triangles: usize,
    materials: usize,
    openings: usize,
    /// Objects that move by themselves.
    actors: usize,
    /// Reading and checking the file, building meshes and collider.
    load_s: f64,
    /// Rendering the first colour image, which creates shadow maps and tables.
    #[serde(rename = "first_picture_s")]
    first_frame_s: f64,
    /// Growth of the process's memory over both; `None` if the system does not report it.
    memory_bytes: Option<u64>,
}

/// Lists scenes.
pub(super) fn scenes(args: &Scenes, printer: &Printer) -> Result<Exit, CliError> {
    if let Some(folder) = &args.images {
        create(folder)?;
    }
    let encoded = args.contact_sheet.as_deref().map(encoder).transpose()?;
    let built_in = || Scene::built_in().into_iter().map(str::to_owned).collect();
    let names: Vec<String> = if args.scenes.is_empty() { built_in() } else { args.scenes.clone() };
    let mut entries = Vec::new();
    // All stay in memory until the end: freed memory would be reused by the next one and be missing from its figure.
    let mut loaded_scenes = Vec::new();
    for name in &names {
        if args.images.is_some() {
            printer.log(&format!("rendering {name} …"));
        }
        let (loaded, entry) = look_at(name, args)?;
        loaded_scenes.push(loaded);
        entries.push(entry);
    }
    let listing = Listing { mesh_kinds: Scene::mesh_kinds(), scenes: entries };
    if printer.is_json() {
        let text = serde_json::to_string(&listing)
            .map_err(|error| CliError::internal("cannot write the list as JSON").because(&error))?;
        printer.data(&text);
    } else {
        tell(&listing, printer);
    }
    if let (Some(path), Some(encoded)) = (&args.contact_sheet, encoded) {
        let sheet = contact_sheet::draw(&names, |line| printer.log(line))?;
        write(path, &encoded(&sheet).map_err(|error| CliError::internal("cannot encode the contact sheet").because(&error))?)?;
        printer.result(&path.display().to_string());
    }
    Ok(Exit::Success)
}

/// Creates the bytes of an image file.
type Encoder = fn(&Rgb) -> Result<Vec<u8>, EncodeError>;

/// The encoder for a file with that name.
fn encoder(path: &Path) -> Result<Encoder, CliError> {
    let extension = path.extension().and_then(OsStr::to_str).unwrap_or_default().to_ascii_lowercase();
    match extension.as_str() {
        "png" => Ok(png::encode),
        "jpg" | "jpeg" => Ok(|image| Jpeg::encode(image, 82).map(|jpeg| jpeg.bytes().to_vec())),
        _ => Err(CliError::usage(format!("--contact-sheet: unsupported image format of `{}`", path.display()))
            .hint("use the extension .jpg or .png")),
    }
}

/// Loads a scene and collects the requested data.
fn look_at(name: &str, args: &Scenes) -> Result<(LoadedScene, Entry), CliError> {
    let resident = resident_bytes();
    let started = Instant::now();
    let loaded = load_scene(name, &SceneLook::default())?;
    let load_time = started.elapsed();
    let mut entry = entry(&loaded.scene);
    entry.object_list = args.objects.then(|| objects::rows(&loaded.scene));
    entry.say = args.say.then(|| sayings(&loaded.scene.name));
    if args.stats || args.images.is_some() {
        let started = Instant::now();
        let camera = loaded.scene.default_craft.camera();
        let image = loaded.render(&camera, &loaded.initial_snapshot(loaded.scene.preview), Channels::RGB);
        let drawn = started.elapsed();
        if args.stats {
            let grown = resident.zip(resident_bytes()).map(|(before, after)| after.saturating_sub(before));
            entry.stats = Some(stats(&loaded.scene, load_time, drawn, grown));
        }
        if let Some(folder) = &args.images {
            let path = folder.join(format!("{}.png", file_stem(&loaded.scene.name)));
            write(&path, &colour(&image)?)?;
            entry.image = Some(path);
        }
    }
    Ok((loaded, entry))
}

fn entry(scene: &Scene) -> Entry {
    let (min, max, start) = (scene.bounds.min, scene.bounds.max, scene.start);
    Entry {
        name: scene.name.clone(),
        description: scene.description.clone(),
        drone_model: scene.default_craft.name(),
        size_m: [max.east - min.east, max.north - min.north, max.up - min.up],
        bounds_m: [min, max].map(|corner| [corner.east, corner.north, corner.up]),
        start: Start {
            east_m: start.position.east,
            north_m: start.position.north,
            up_m: start.position.up,
            // Degrees as in the scene file, without the rounding error of radians.
            heading_deg: (start.attitude.heading.to_degrees() * 1e6).round() / 1e6,
        },
        objects: scene.objects.len(),
        tags: tags(&scene.objects),
        object_list: None,
        say: None,
        image: None,
        stats: None,
    }
}

/// First names with their number, the commonest first.
fn tags(objects: &[Object]) -> Vec<Tag> {
    let mut named: BTreeMap<&str, Vec<&Object>> = BTreeMap::new();
    for object in objects {
        named.entry(object.tags.names.first().unwrap_or(&object.tags.kind)).or_default().push(object);
    }
    let tag = |(name, objects): (&str, Vec<&Object>)| Tag {
        name: name.to_owned(),
        count: objects.len(),
        colours: objects.iter().filter_map(|object| object.tags.colour.clone()).collect(),
    };
    let mut tags: Vec<Tag> = named.into_iter().map(tag).collect();
    tags.sort_by_key(|tag| core::cmp::Reverse(tag.count));
    tags
}

fn stats(scene: &Scene, load_time: Duration, drawn: Duration, memory_bytes: Option<u64>) -> Stats {
    Stats {
        meshes: scene.meshes().count(),
        mesh_kinds: scene.objects.iter().map(|object| object.mesh).collect(),
        triangles: scene.meshes().map(|part| part.triangles.len()).sum(),
        materials: scene.geometry.materials.len(),
        openings: scene.objects.iter().filter(|object| object.opening).count(),
        actors: scene.actors.len(),
        load_s: load_time.as_secs_f64(),
        first_frame_s: drawn.as_secs_f64(),
        memory_bytes,
    }
}

/// The list for people.
fn tell(listing: &Listing, printer: &Printer) {
    let size = |[east, north, up]: [f64; 3]| format!("{east:.0} x {north:.0} x {up:.0} m");
    let mut rows = vec![["SCENE", "CRAFT", "SIZE", "OBJECTS", "DESCRIPTION"].map(str::to_owned).to_vec()];
    rows.extend(listing.scenes.iter().map(|scene| {
        let objects = scene.objects.to_string();
        vec![scene.name.clone(), scene.drone_model.to_owned(), size(scene.size_m), objects, scene.description.clone()]
    }));
    printer.result(&table(&rows));
    if listing.scenes.iter().any(|scene| scene.stats.is_some()) {
        print_stats(listing, printer);
    }
    for scene in &listing.scenes {
        if let Some(rows) = &scene.object_list {
            let ([low, high], start) = (scene.bounds_m, &scene.start);
            printer.result(&format!(
                "\n{}: east {:.0} to {:.0} m, north {:.0} to {:.0} m; start at {:.1},{:.1},{:.1}, heading {:.0}°. Centres in metres:\n",
                scene.name, low[0], high[0], low[1], high[1], start.east_m, start.north_m, start.up_m, start.heading_deg
            ));
            printer.result(&objects::text(rows));
        }
        if let Some(sayings) = &scene.say {
            printer.result(&say::text(&scene.name, sayings));
        }
    }
    let images: Vec<_> = listing.scenes.iter().filter_map(|scene| scene.image.as_ref()).collect();
    if !images.is_empty() {
        printer.result("");
    }
    for path in images {
        printer.result(&path.display().to_string());
    }
}

fn print_stats(listing: &Listing, printer: &Printer) {
    let head = ["SCENE", "MESHES", "KINDS", "TRIANGLES", "MATERIALS", "OPENINGS", "ACTORS", "LOAD TIME", "FIRST FRAME", "MEMORY"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    rows.extend(listing.scenes.iter().filter_map(|scene| scene.stats.as_ref().map(|stats| (scene, stats))).map(
        |(scene, stats)| {
            vec![
                scene.name.clone(),
                stats.meshes.to_string(),
                stats.mesh_kinds.len().to_string(),
                stats.triangles.to_string(),
                stats.materials.to_string(),
                stats.openings.to_string(),
                stats.actors.to_string(),
                format!("{:.2} s", stats.load_s),
                format!("{:.2} s", stats.first_frame_s),
                stats.memory_bytes.map_or("?".to_owned(), |bytes| format!("{:.1} MB", bytes as f64 * 1e-6)),
            ]
        },
    ));
    printer.result(&format!("\n{}", table(&rows)));
    for scene in &listing.scenes {
        let words: Vec<String> = scene.tags.iter().map(tag_words).collect();
        printer.result(&format!("\nIn {}: {}.", scene.name, words.join(", ")));
    }
    let kinds = &listing.mesh_kinds;
    printer.result(&format!("\n{} mesh kinds in total: {}.", kinds.len(), kinds.join(", ")));
}

/// `4 cars (black, red)`, without grammar: `car x4 (black, red)`.
fn tag_words(tag: &Tag) -> String {
    let count = if tag.count > 1 { format!(" x{}", tag.count) } else { String::new() };
    let colours: Vec<&str> = tag.colours.iter().map(String::as_str).collect();
    let colours = if colours.is_empty() { String::new() } else { format!(" ({})", colours.join(", ")) };
    format!("{}{count}{colours}", tag.name)
}

/// A scene's name as part of a file name: characters other than letters, digits, `-` and `@` become `_`.
fn file_stem(name: &str) -> String {
    name.chars().map(|c| if c.is_alphanumeric() || c == '-' || c == '@' { c } else { '_' }).collect()
}

fn create(folder: &Path) -> Result<(), CliError> {
    std::fs::create_dir_all(folder).map_err(|error| {
        CliError::usage(format!("--pictures: cannot create the folder `{}`", folder.display()))
            .because(&error)
            .hint("give a writable folder")
    })
}

/// Memory used by the process, if the system reports it (Linux).
fn resident_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kibibytes| kibibytes * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn names_are_counted_the_commonest_first() {
        let scene = Scene::load("city").unwrap();
        let tags = tags(&scene.objects);
        assert_eq!(tags.iter().map(|tag| tag.count).sum::<usize>(), scene.objects.len());
        assert!(tags.windows(2).all(|pair| pair[0].count >= pair[1].count));
        assert!(tags.iter().any(|tag| tag.name.contains("crane") && tag.colours.contains("red")));
    }

    proptest! {
        #[test]
        fn a_scene_cannot_name_a_file_elsewhere(name in ".{1,60}") {
            let stem = file_stem(&name);
            prop_assert_eq!(Path::new(&stem).components().count(), 1);
            prop_assert!(!stem.contains(['/', '\\', '.', ':']));
        }
    }
}
