//! `spf ground`: pointing in images, and its accuracy (docs/guide/grounding.md).

mod dataset;
pub(crate) mod folder;
mod photos;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use spf_bench::ground::Answerer;
use spf_bench::ground::ask::{AnswererKind, AskOptions, MakeVlm};
use spf_bench::ground::signs::{SIGNS, write as write_signs};
use spf_core::prompt::{PromptKind, PromptText};
use spf_vlm::Paced;
use spf_vlm::exec::EXEC;

use super::read;
use super::vlm::{exec, is_human, listed, oracle_named, oracle_sentence, remote};
use crate::args::Ground;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;
use crate::settings::Settings;

/// Queries about photographs, or grades on a dataset.
pub(crate) fn ground(args: &Ground, printer: &mut Printer) -> Result<Exit, CliError> {
    let settings = Settings::of(&args.settings, printer)?;
    if args.rate.is_some_and(|rate| !(rate > 0.0 && rate <= 1e6)) {
        return Err(CliError::usage("--rate must be a number of queries per minute above 0").hint("--rate 60"));
    }
    let options = AskOptions { avoid: args.avoid, close_up: args.close_up, time: settings.reply_timeout()? };
    match &args.dataset {
        Some(path) if path == Path::new(SIGNS) && !path.exists() => {
            let pictures = signs(args, printer)?;
            dataset::grade(args, &pictures, Some(&Path::new("grounding").join(SIGNS)), &settings, options, printer)
        }
        Some(path) => dataset::grade(args, path, None, &settings, options, printer),
        None => photos::ask(args, &settings, options, printer),
    }
}

/// Renders the dataset of signs beside the output folder, over what is there; the images follow from the program alone.
fn signs(args: &Ground, printer: &Printer) -> Result<PathBuf, CliError> {
    let out = args.output.clone().unwrap_or_else(|| Path::new("grounding").join(SIGNS));
    let name = out.file_name().map_or_else(|| SIGNS.to_owned(), |name| name.to_string_lossy().into_owned());
    let folder = out.with_file_name(format!("{name}-pictures"));
    if folder.exists() && !folder.join("dataset.json").is_file() {
        return Err(CliError::usage(format!("the folder `{}` is not empty and holds no dataset", folder.display()))
            .hint("give another output folder with -o DIR"));
    }
    let images = write_signs(&folder).map_err(|error| {
        CliError::internal(format!("cannot render the dataset of signs into `{}`", folder.display())).because(&error)
    })?;
    printer.log(&format!("rendered {images} images into {}", folder.display()));
    Ok(folder)
}

/// The named VLMs, each with each prompt, and sentences about them for the user.
fn answerers(args: &Ground, settings: &Settings) -> Result<(Vec<Answerer>, Vec<String>), CliError> {
    let prompts = prompts(args)?;
    let (mut answerers, mut sentences): (Vec<Answerer>, Vec<String>) = (Vec::new(), Vec::new());
    for name in listed(settings.fly.vlm.text_or_default()) {
        if name == "oracle" || name.starts_with("oracle:") {
            let (name, errors) = oracle_named(name, |expected, near| settings.fly.vlm.wrong(expected, near))?;
            sentences.push(match errors.obeys {
                None => format!("{name} reads the simulator's own ID and depth images; it is not a VLM."),
                Some(_) => oracle_sentence(&name, &errors),
            });
            answerers.push(Answerer { name, kind: AnswererKind::Oracle(Box::new(errors), args.seed) });
            continue;
        }
        if name.starts_with("replay:") {
            return Err(CliError::usage("a recording of a flight cannot be used here")
                .hint("replies are stored in the output folder: --resume sends only the remaining questions"));
        }
        if is_human(name) {
            return Err(CliError::usage("`spf ground` does not support --vlm human").hint("spf fly \"…\" --vlm human"));
        }
        let (name, makers) = makers(settings, name, &prompts, &mut sentences)?;
        for ((file, prompt), make) in prompts.iter().zip(makers) {
            let name = if prompts.len() > 1 { format!("{name} · {file}") } else { name.clone() };
            answerers.push(Answerer { name, kind: AnswererKind::Model(make, prompt.clone()) });
        }
    }
    let mut names: Vec<&str> = answerers.iter().map(|answerer| answerer.name.as_str()).collect();
    names.sort_unstable();
    match names.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(CliError::usage(format!("--vlm and --prompt give `{}` twice", pair[0]))
            .hint("give each once; use several prompts with one model, or several models with one prompt")),
        None if names.is_empty() => Err(CliError::usage("--vlm is empty").hint("for example --vlm gemini: see `spf vlm list`")),
        None => Ok((answerers, sentences)),
    }
}

/// The name of a model or program, and how it is created for each prompt.
fn makers(
    settings: &Settings,
    name: &str,
    prompts: &[(String, Arc<PromptText>)],
    sentences: &mut Vec<String>,
) -> Result<(String, Vec<MakeVlm>), CliError> {
    if name.starts_with(EXEC) {
        let exec = exec(settings, name)?;
        let make: MakeVlm = Arc::new(move || Box::new(Paced::new(Box::new(exec.clone()), None, true)));
        return Ok((name.to_owned(), vec![make; prompts.len()]));
    }
    let chosen = remote(settings, name, None)?;
    sentences.push(chosen.sentence);
    let make = |prompt: &Arc<PromptText>| -> MakeVlm {
        let model = chosen.remote.clone().with_prompt(prompt.clone());
        Arc::new(move || Box::new(model.clone()))
    };
    Ok((chosen.name.clone(), prompts.iter().map(|(_, prompt)| make(prompt)).collect()))
}

/// The prompts to compare, by the names of their files; the built-in one if none is given.
fn prompts(args: &Ground) -> Result<Vec<(String, Arc<PromptText>)>, CliError> {
    let Some(files) = &args.prompt else { return Ok(vec![(String::new(), PromptText::shipped(PromptKind::Point))]) };
    let one = |file: &str| {
        let refused = || CliError::usage(format!("invalid prompt file `{file}`"));
        let prompt = PromptText::parse(&read(Path::new(file), "prompt")?).map_err(|error| {
            refused().because(&error).hint("start from the built-in prompts in `prompts/` (docs/guide/vlm.md)")
        })?;
        if prompt.kind() != PromptKind::Point {
            return Err(refused().hint("a pointing prompt must begin with `spf-prompt point`"));
        }
        Ok((file.to_owned(), Arc::new(prompt)))
    };
    files.split(',').map(str::trim).filter(|file| !file.is_empty()).map(one).collect()
}

/// Whether it is the oracle, which cannot read photographs.
fn is_oracle(answerer: &Answerer) -> bool {
    matches!(answerer.kind, AnswererKind::Oracle(..))
}
