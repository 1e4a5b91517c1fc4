//! What can be read: the files of flights, the documents, the things of the scene.

use std::path::{Path, PathBuf};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use rmcp::model::{ReadResourceResult, Resource, ResourceContents};
use spf_api::files::load_scene;
use spf_core::tags::Tagged;
use spf_scene::SceneLook;

use crate::report::{FILES, flights, in_words};

/// Flights whose files are listed.
const LISTED: usize = 10;
/// The largest file that is sent, bytes.
const LARGEST: u64 = 8 << 20;
const FLIGHTS: &str = "spf://flights/";
const DOCS: &str = "spf://docs/";
const SCENE: &str = "spf://scene";

/// Documents by their names.
const DOCUMENTS: [(&str, &str); 8] = [
    ("guide/mcp", include_str!("../../../../docs/guide/mcp.md")),
    ("guide/fly", include_str!("../../../../docs/guide/fly.md")),
    ("guide/obstacles", include_str!("../../../../docs/guide/obstacles.md")),
    ("guide/vlm", include_str!("../../../../docs/guide/vlm.md")),
    ("guide/cockpit", include_str!("../../../../docs/guide/cockpit.md")),
    ("guide/tello", include_str!("../../../../docs/guide/tello.md")),
    ("guide/px4", include_str!("../../../../docs/guide/px4.md")),
    ("explanation/safety", include_str!("../../../../docs/explanation/safety.md")),
];

/// The folder of a recorded flight: a name that is there, never a path.
///
/// # Errors
/// There is no such flight.
pub(super) fn flight_folder(folder: &Path, id: &str) -> Result<PathBuf, String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().map_while(Result::ok);
    let found = entries.filter(|entry| entry.file_name().to_str() == Some(id)).map(|entry| entry.path());
    let folder = folder.canonicalize().map_err(|_| "no flights are recorded yet".to_owned())?;
    let inside = |path: PathBuf| path.canonicalize().ok().filter(|path| path.parent() == Some(folder.as_path()));
    found.filter_map(inside).next().ok_or_else(|| format!("no flight `{id}`: `list_flights` lists them"))
}

/// The resource of a flight's file.
pub(super) fn of_file(uri: &str) -> Resource {
    let name = uri.strip_prefix(FLIGHTS).unwrap_or(uri);
    let kind = FILES.iter().find(|(file, _)| name.ends_with(file)).map_or("application/octet-stream", |(_, kind)| *kind);
    Resource::new(uri, name).with_mime_type(kind)
}

pub(super) fn list(folder: &Path, has_scene: bool) -> Vec<Resource> {
    let scene = has_scene
        .then(|| Resource::new(SCENE, "scene").with_title("What is in the simulator's scene").with_mime_type("application/json"));
    let documents = DOCUMENTS.iter().map(|(name, text)| {
        let title = text.lines().next().unwrap_or_default().trim_start_matches('#').trim();
        Resource::new(format!("{DOCS}{name}"), *name).with_title(title).with_mime_type("text/markdown")
    });
    let flights = flights(folder).flights;
    let files = flights.iter().take(LISTED).flat_map(|flight| {
        let there = FILES.iter().filter(|(file, _)| folder.join(&flight.flight_id).join(file).is_file());
        there.map(|(file, _)| of_file(&format!("{FLIGHTS}{}/{file}", flight.flight_id)))
    });
    scene.into_iter().chain(documents).chain(files).collect()
}

/// Reads a resource.
///
/// # Errors
/// There is none of this address, or it cannot be read.
pub(super) fn read(folder: &Path, scene: Option<&str>, uri: &str) -> Result<ReadResourceResult, String> {
    let none = || format!("no resource `{}`", uri.chars().filter(|c| !c.is_control()).take(100).collect::<String>());
    let one = |contents: ResourceContents| Ok(ReadResourceResult::new(vec![contents]));
    if let Some(name) = uri.strip_prefix(DOCS) {
        let (_, text) = DOCUMENTS.iter().find(|(known, _)| *known == name).ok_or_else(none)?;
        return one(ResourceContents::text(*text, uri).with_mime_type("text/markdown"));
    }
    if uri == SCENE {
        return one(ResourceContents::text(things(scene.ok_or_else(none)?)?, uri).with_mime_type("application/json"));
    }
    let (id, file) = uri.strip_prefix(FLIGHTS).and_then(|rest| rest.split_once('/')).ok_or_else(none)?;
    let (file, kind) = FILES.iter().find(|(known, _)| *known == file).ok_or_else(none)?;
    let flight = flight_folder(folder, id)?;
    let path = flight.join(file).canonicalize().map_err(|_| none())?;
    // No link leads out of the flight.
    if !path.starts_with(&flight) {
        return Err(none());
    }
    let bytes = spf_input::read(&path, LARGEST).map_err(|error| format!("cannot read {file}: {error}"))?;
    match String::from_utf8(bytes) {
        Ok(text) => one(ResourceContents::text(text, uri).with_mime_type(*kind)),
        Err(error) => one(ResourceContents::blob(STANDARD.encode(error.as_bytes()), uri).with_mime_type(*kind)),
    }
}

/// The things of a scene, JSON.
fn things(scene: &str) -> Result<String, String> {
    let loaded = load_scene(scene, &SceneLook::default()).map_err(|error| error.to_string())?;
    let thing = |thing: &Tagged| Some(serde_json::json!({"key": thing.key, "name": in_words(thing)?, "kind": thing.kind}));
    let things: Vec<_> = loaded.tags.iter().filter_map(thing).collect();
    Ok(serde_json::json!({"scene": scene, "things": things}).to_string())
}
