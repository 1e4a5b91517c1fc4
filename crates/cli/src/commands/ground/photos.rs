//! Input images: photographs, video frames, standard input.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Serialize;
use spf_bench::ground::ask::{AnswererKind, AskOptions};
use spf_bench::ground::page::{account, side_by_side, words};
use spf_bench::ground::photo::{self, PhotoError};
use spf_bench::ground::{AnswerRow, Answerer, ParsedReply};
use spf_camera::CameraUrl;
use spf_media::{Jpeg, Rgb};
use spf_vlm::Cancel;

use super::{answerers, is_oracle};
use crate::args::Ground;
use crate::commands::camera;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::{Printer, one_line};
use crate::settings::Settings;

/// Maximum size of a file, bytes.
const LONGEST: u64 = 2 << 30;
const QUALITY: u8 = 90;

/// An image for the queries.
struct ImageInput {
    name: String,
    image: Arc<Rgb>,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Printed<'a> {
    instruction: &'a str,
    #[serde(rename = "pictures")]
    images: Vec<Answered>,
}

#[derive(Serialize)]
struct Answered {
    #[serde(rename = "picture")]
    image: String,
    annotated: PathBuf,
    answers: Vec<AnswerRow>,
}

pub(super) fn ask(args: &Ground, settings: &Settings, options: AskOptions, printer: &Printer) -> Result<Exit, CliError> {
    let Some((instruction, images)) = args.words.split_last().filter(|(_, images)| !images.is_empty()) else {
        // One word alone is a picture without an instruction more often than the reverse.
        if let [alone] = args.words.as_slice() {
            found(alone)?;
        }
        return Err(CliError::usage("an image and an instruction are required")
            .hint("spf ground photo.jpg \"the blue door\" --vlm gemini"));
    };
    // A wrong path is told before a wrong model.
    for image in images {
        found(image)?;
    }
    let (answerers, sentences) = answerers(args, settings)?;
    if answerers.iter().any(is_oracle) {
        return Err(CliError::usage("the oracle cannot read photographs: it needs the simulator's ID and depth images").hint(
            "set a model with --vlm (see `spf vlm list`); to evaluate the oracle, use --dataset with a dataset from \
                `spf sim dataset`",
        ));
    }
    let mut shown = Vec::new();
    for image in images {
        shown.extend(open(image, args, printer)?);
    }
    let out = args.output.clone().unwrap_or_else(|| PathBuf::from("grounding"));
    std::fs::create_dir_all(&out)
        .map_err(|error| CliError::usage(format!("cannot use the folder `{}`", out.display())).because(&error))?;
    sentences.iter().for_each(|sentence| printer.log(sentence));
    let mut printed = Printed { instruction, images: Vec::new() };
    for (number, shown) in (0_u64..).zip(&shown) {
        let answers = put(&answerers, shown, instruction, number, options);
        let annotated = free_name(&out, &shown.name);
        let picture = Jpeg::encode(&side_by_side(&shown.image, instruction, &answers), QUALITY)
            .map_err(|error| CliError::internal("cannot encode the annotated image").because(&error))?;
        std::fs::write(&annotated, picture.bytes())
            .map_err(|error| CliError::internal(format!("cannot write `{}`", annotated.display())).because(&error))?;
        report(&shown.name, &annotated, &answers, printer);
        printed.images.push(Answered { image: shown.name.clone(), annotated, answers });
    }
    if args.json {
        let text = serde_json::to_string(&printed).map_err(|error| CliError::internal("cannot write JSON").because(&error))?;
        printer.data(&text);
    }
    let answered = |row: &AnswerRow| !matches!(row.parsed, ParsedReply::Nothing(..));
    if printed.images.iter().flat_map(|picture| &picture.answers).any(answered) {
        return Ok(Exit::Success);
    }
    Err(CliError::failed("no VLM replied").hint("`spf vlm check NAME` shows why, and what to do"))
}

/// Queries all answerers about one image at the same time.
fn put(answerers: &[Answerer], shown: &ImageInput, instruction: &str, number: u64, options: AskOptions) -> Vec<AnswerRow> {
    let ask = |answerer: &Answerer| match &answerer.kind {
        AnswererKind::Model(make, prompt) => {
            let (key, cancel) = (&shown.name, Cancel::default());
            Some(answerer.show(make().as_mut(), prompt, &shown.image, key, instruction, number, options, &cancel))
        }
        AnswererKind::Centre | AnswererKind::Oracle(..) => None,
    };
    std::thread::scope(|scope| {
        let asking: Vec<_> = answerers.iter().map(|answerer| scope.spawn(|| ask(answerer))).collect();
        asking.into_iter().filter_map(|one| one.join().ok().flatten()).collect()
    })
}

fn report(name: &str, annotated: &Path, answers: &[AnswerRow], printer: &Printer) {
    printer.result(&format!("{name} → {}", annotated.display()));
    for row in answers {
        printer.result(&format!("  {}: {}; {}", row.answerer, one_line(&words(row)), account(row)));
        for obstacle in row.reply().map_or(&[][..], |reply| &reply.boxes) {
            let b = obstacle.area;
            printer.result(&format!(
                "    obstacle {}: ({:.3}, {:.3}) to ({:.3}, {:.3}), depth label {}",
                one_line(&obstacle.name),
                b.left,
                b.top,
                b.right,
                b.bottom,
                obstacle.depth
            ));
        }
    }
}

/// An unused file name, so that earlier results are kept.
fn free_name(folder: &Path, name: &str) -> PathBuf {
    let stem: String =
        name.chars().map(|letter| if letter.is_alphanumeric() || "-_.".contains(letter) { letter } else { '-' }).collect();
    let stem = stem.trim_start_matches(['-', '.']);
    let of =
        |number: u32| folder.join(if number == 1 { format!("{stem}.points.jpg") } else { format!("{stem}.points-{number}.jpg") });
    (1..).map(of).find(|path| !path.exists()).unwrap_or_else(|| of(0))
}

/// The images named by an argument.
fn open(image: &str, args: &Ground, printer: &Printer) -> Result<Vec<ImageInput>, CliError> {
    if CameraUrl::is_one(image) {
        return Ok(vec![ImageInput { name: "camera".to_owned(), image: Arc::new(camera::picture(image, printer)?) }]);
    }
    let path = Path::new(image);
    if image == "-" {
        return decoded("standard input", &bytes(std::io::stdin().lock(), image)?, args);
    }
    if !path.is_dir() {
        return file(path, args);
    }
    let entries =
        std::fs::read_dir(path).map_err(|error| CliError::usage(format!("cannot read the folder `{image}`")).because(&error))?;
    let picture = |path: &PathBuf| {
        let end = path.extension().map(|end| end.to_string_lossy().to_lowercase());
        end.is_some_and(|end| ["jpg", "jpeg", "png"].contains(&end.as_str()))
    };
    let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).filter(picture).collect();
    files.sort();
    if files.is_empty() {
        return Err(CliError::usage(format!("no images in the folder `{image}`")).hint("PNG and JPEG files are supported"));
    }
    files.iter().map(|path| file(path, args)).collect::<Result<Vec<_>, _>>().map(|found| found.into_iter().flatten().collect())
}

/// An error for a path at which there is nothing.
fn found(image: &str) -> Result<(), CliError> {
    if CameraUrl::is_one(image) || image == "-" {
        return Ok(());
    }
    let path = Path::new(image);
    std::fs::metadata(path).map(drop).map_err(|error| unreadable(path, &error))
}

fn unreadable(path: &Path, error: &std::io::Error) -> CliError {
    CliError::usage(format!("cannot read the image `{}`", path.display()))
        .because(error)
        .hint("give images first and the instruction last: spf ground photo.jpg \"the blue door\"")
}

fn file(path: &Path, args: &Ground) -> Result<Vec<ImageInput>, CliError> {
    let open = spf_input::open(path).map_err(|error| unreadable(path, &error))?;
    let name = path.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned());
    decoded(&name, &bytes(open, &path.display().to_string())?, args)
}

fn bytes(from: impl Read, name: &str) -> Result<Vec<u8>, CliError> {
    let mut bytes = Vec::new();
    let read = from.take(LONGEST).read_to_end(&mut bytes);
    read.map_err(|error| CliError::usage(format!("cannot read `{name}`")).because(&error))?;
    Ok(bytes)
}

/// One image, or the frames of a video, depending on the first bytes.
fn decoded(name: &str, bytes: &[u8], args: &Ground) -> Result<Vec<ImageInput>, CliError> {
    let is_image = bytes.starts_with(&[0xff, 0xd8]) || bytes.starts_with(b"\x89PNG");
    let is_video = bytes.get(4..8) == Some(b"ftyp") || bytes.starts_with(&[0, 0, 1]) || bytes.starts_with(&[0, 0, 0, 1]);
    let wrong = |error: &PhotoError| CliError::usage(format!("cannot decode `{name}`")).because(error);
    if is_video && !is_image {
        if !(args.every >= 0.0 && args.every.is_finite()) || args.frames == 0 {
            return Err(CliError::usage("--every must be a positive number of seconds and --frames at least 1")
                .hint("--every 2 --frames 10"));
        }
        let frames = photo::frames(bytes, args.every, args.frames).map_err(|error| {
            wrong(&error).hint("convert it to H.264 in MP4, or extract frames: ffmpeg -i VIDEO -vf fps=1 frame-%03d.jpg")
        })?;
        let shown =
            |frame: photo::VideoFrame| ImageInput { name: format!("{name}-{:.2}s", frame.at), image: Arc::new(frame.image) };
        return Ok(frames.into_iter().map(shown).collect());
    }
    let image = photo::decode(bytes).map_err(|error| wrong(&error).hint("PNG and JPEG images and H.264 videos are supported"))?;
    Ok(vec![ImageInput { name: name.to_owned(), image: Arc::new(image) }])
}
