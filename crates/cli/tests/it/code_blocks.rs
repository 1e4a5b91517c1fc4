//! Code blocks of README and guides: every `spf` command is accepted by the parser, and runs where it needs neither a drone nor a
//! key; every block of data is read by the program or at least by a parser of its format.

use std::fs;
use std::path::Path;

use super::documents::root;
use super::harness::{Lab, Run};
use super::track::film;

/// A code block: fenced, or indented by four spaces.
struct Block {
    /// Line number of the first line of code, from 1.
    line: usize,
    /// After the fence; empty for indented blocks.
    language: String,
    text: String,
}

fn blocks(text: &str) -> Vec<Block> {
    let mut blocks: Vec<Block> = Vec::new();
    let (mut fenced, mut indented) = (false, false);
    for (line, content) in (1..).zip(text.lines()) {
        if let Some(language) = content.strip_prefix("```") {
            fenced = !fenced;
            indented = false;
            if fenced {
                blocks.push(Block { line: line + 1, language: language.to_owned(), text: String::new() });
            }
        } else if fenced {
            if let Some(block) = blocks.last_mut() {
                block.text += content;
                block.text.push('\n');
            }
        } else if let Some(code) = content.strip_prefix("    ") {
            if !indented {
                blocks.push(Block { line, language: String::new(), text: String::new() });
            }
            indented = true;
            if let Some(block) = blocks.last_mut() {
                block.text += code;
                block.text.push('\n');
            }
        } else {
            indented = false;
        }
    }
    blocks
}

/// README, the tutorials and the guides: name and text.
fn documents() -> Vec<(String, String)> {
    let folders = ["docs/tutorial", "docs/guide"].into_iter();
    let guides = folders.flat_map(|folder| fs::read_dir(root().join(folder)).unwrap()).map(|entry| entry.unwrap().path());
    let mut paths: Vec<_> = guides.filter(|path| path.extension().is_some_and(|ending| ending == "md")).collect();
    paths.sort();
    paths.insert(0, root().join("README.md"));
    let name = |path: &Path| path.file_name().unwrap().to_string_lossy().into_owned();
    paths.iter().map(|path| (name(path), fs::read_to_string(path).unwrap())).collect()
}

/// The arguments of every `spf` command of a text, with the line that it starts on.
fn commands(text: &str) -> Vec<(usize, Vec<String>)> {
    let mut found = Vec::new();
    for block in blocks(text).iter().filter(|block| matches!(block.language.as_str(), "" | "sh")) {
        let joined = block.text.replace("\\\n", " ");
        for (offset, line) in joined.lines().enumerate() {
            let words = shlex::split(line.trim_start_matches("$ ")).unwrap_or_default();
            let program = words.iter().position(|word| !is_variable(word)).unwrap_or_default();
            if words.get(program).is_some_and(|word| word == "spf") {
                let args = &words[program + 1..];
                // Shell redirections of the output are not part of the command.
                let end = args.iter().position(|word| matches!(word.as_str(), ">" | ">>" | "|")).unwrap_or(args.len());
                found.push((block.line + offset, args[..end].to_vec()));
            }
        }
    }
    found
}

/// `NAME=value`, which sets a variable for the command after it.
fn is_variable(word: &str) -> bool {
    word.split_once('=').is_some_and(|(name, _)| !name.is_empty() && name.chars().all(|c| c.is_ascii_uppercase() || c == '_'))
}

/// Why a command is not run here; `None` if it is.
fn exempt(args: &[String]) -> Option<&'static str> {
    let has =
        |wanted: &[&str]| args.iter().any(|word| wanted.iter().any(|part| word.split(',').any(|one| one.starts_with(part))));
    let starts = |wanted: &[&str]| args.iter().map(String::as_str).take(wanted.len()).eq(wanted.iter().copied());
    if has(&["gemini", "openai@", "anthropic", "ollama", "vllm"]) {
        Some("needs a key or a server")
    } else if has(&["exec:"]) {
        Some("needs a program; module vlm::own has the examples fly")
    } else if has(&["rtsp://", "v4l2:", "gstreamer:"]) {
        Some("needs a camera; modules camera and v4l2 have others")
    } else if has(&["--drone", "tello"]) {
        Some("needs a drone; module tello flies a virtual one")
    } else if starts(&["screen"]) || starts(&["sim", "window"]) {
        Some("needs a display; module screen has one")
    } else if starts(&["sim", "serve"]) || starts(&["sim", "view"]) {
        Some("runs until it is ended; modules serve and view do that")
    } else if has(&["--cockpit"]) || starts(&["cockpit"]) {
        Some("waits for its page; module cockpit opens that")
    } else if starts(&["mcp"]) {
        Some("needs the feature mcp, and waits for its client; module mcp has those of others")
    } else if starts(&["bench", "ask"]) {
        Some("waits for answers; module bench gives them")
    } else if has(&["yolov8n.onnx", "depth_anything_v2_vits.onnx"]) {
        Some("needs the feature onnx and a model; the tests of the crate detect have small ones")
    } else if has(&["nanodet", "fastdepth"]) {
        Some("needs the feature onnx and a package of npm's; module models fetches, converts and flies them")
    } else if has(&["results/part*"]) {
        Some("merges what sbatch has flown; .ci/slurm runs the whole array")
    } else {
        None
    }
}

/// The same command made short: one task, trial, method and VLM, a few images, no video.
fn shortened(args: &[String], lab: &Lab) -> Vec<String> {
    let mut short: Vec<String> = Vec::new();
    let mut args = args.iter().cloned();
    let (mut seen_task, mut trials) = (false, "1");
    while let Some(word) = args.next() {
        match word.as_str() {
            "--suite" => {
                args.next();
                short.extend(["--task".to_owned(), "sim-nav-red-crane".to_owned()]);
            }
            "--follow-time" => {
                args.next();
                short.extend(["--follow-time", "3"].map(str::to_owned));
            }
            "--task" if seen_task => _ = args.next(),
            "--task" => {
                seen_task = true;
                short.extend([word, args.next().unwrap()]);
            }
            "--trials" => _ = args.next(),
            // Two shards with one trial each.
            "--shard" => {
                trials = "2";
                let shard = if args.next().unwrap().starts_with("0/") { "0/2" } else { "1/2" };
                short.extend([word, shard.to_owned()]);
            }
            "--live" => short.extend(["--live=127.0.0.1:0", "--max-time", "1"].map(str::to_owned)),
            "--realtime" => short.extend(["--realtime", "--max-time", "1"].map(str::to_owned)),
            "--method" | "--vlm" => {
                let first = args.next().unwrap().split(',').next().unwrap().to_owned();
                short.extend([word, first]);
            }
            "-n" => {
                args.next();
                short.extend([word, "1".to_owned()]);
            }
            "docs/bench/example" => short.push("example".to_owned()),
            // A new folder each time.
            "DIR" => short.push((0..).map(|n| format!("DIR{n}")).find(|name| !lab.path(name).exists()).unwrap()),
            _ if word.contains("001-…") => {
                let flight = lab.names("flights").into_iter().next().unwrap_or_else(|| panic!("no flight before it"));
                short.push(word.replace("001-…", &flight));
            }
            _ => short.push(word),
        }
    }
    match short.first().map(String::as_str) {
        Some("sim") if short[1] == "scenes" => short.retain(|word| word != "--pictures" && word != "previews"),
        Some("fly") => {
            short.push("--no-video".to_owned());
            // Each of its frames is rendered.
            if short.iter().any(|word| word == "--depth-sensor" || word == "--track") {
                short.extend(["--max-time", "15"].map(str::to_owned));
            }
        }
        Some("bench") if matches!(short[1].as_str(), "run" | "check") => short.extend(["--trials".to_owned(), trials.to_owned()]),
        Some("bench") if short[1] == "show" && !short[2].ends_with(".toml") => short.push("--no-video".to_owned()),
        Some("bench") if short[1] == "merge" => short.retain(|word| !word.starts_with("part") || lab.path(word).exists()),
        _ => {}
    }
    short
}

fn run(lab: &Lab, args: &[String]) -> Run {
    lab.spf(&args.iter().map(String::as_str).collect::<Vec<_>>())
}

#[test]
fn every_command_is_accepted() {
    let lab = Lab::new();
    let mut refused = String::new();
    let mut count = 0;
    for (document, text) in documents() {
        for (line, args) in commands(&text) {
            count += 1;
            // Flags and values are checked before the help is printed, and nothing is flown.
            let help = run(&lab, &[args.clone(), vec!["--help".to_owned()]].concat());
            if help.code != Some(0) {
                refused += &format!("{document}:{line}: spf {}\n{}\n", args.join(" "), help.stderr);
            }
        }
    }
    assert!(refused.is_empty(), "{refused}");
    assert!(count > 40, "{count} commands");
}

#[test]
fn a_command_that_is_none_is_refused() {
    let text = "    spf fly \"go\" --sceen city  # no such flag\n\n```sh\nKEY=x spf \\\n  fli\n```\n";
    let found = commands(text);
    assert_eq!(found, [(1, vec!["fly".into(), "go".into(), "--sceen".into(), "city".into()]), (4, vec!["fli".into()])]);
    for (_, args) in found {
        assert_eq!(run(&Lab::new(), &[args, vec!["--help".to_owned()]].concat()).code, Some(2));
    }
}

/// The files that a reader of the guides has in the folder.
fn own_files(lab: &Lab, document: &str, text: &str) {
    let block = |start: &str| blocks(text).into_iter().find(|block| block.text.starts_with(start)).map(|block| block.text);
    match document {
        "bench.md" => {
            fs::create_dir(lab.path("my")).unwrap();
            lab.write("my/task.toml", block("format = 1").unwrap());
            let episode = serde_json::json!({
                "episode_id": "E1", "trajectory_id": "T1", "scene_id": 1, "instruction": { "instruction_text": "Go." },
                "start_position": [0, 0, 0], "start_rotation": [1, 0, 0, 0], "goals": [{ "position": [9, 0, 0] }],
                "reference_path": [[0, 0, 0], [9, 0, 0]],
            });
            lab.write("val_unseen.json", serde_json::json!({ "episodes": [episode] }).to_string());
        }
        "fly.md" => {
            let reference = |name: &str| fs::read_to_string(root().join("docs").join(name)).unwrap();
            let first = |text: &str, part: &str| blocks(text).into_iter().find(|block| block.text.contains(part)).unwrap().text;
            lab.write("fence.geojson", first(&reference("explanation/safety.md"), "\"Polygon\""));
            lab.write("operator.toml", first(&reference("reference/flight-files.md"), "[[event"));
        }
        "gltf.md" => lab.write("yard.glb", red_car()),
        "track.md" => film(&lab.path("holiday.mp4"), 90),
        _ => {}
    }
}

/// A glTF model of one object: a box called `Red_Car`, 2 m wide, 4 m long and 1.5 m high, 15 m ahead of the start.
fn red_car() -> Vec<u8> {
    let corner = |n: u8| [f32::from(n & 1) * 2.0, f32::from(n >> 1 & 1) * 1.5, f32::from(n >> 2 & 1) * 4.0];
    let mut data: Vec<u8> = (0..8).flat_map(corner).flat_map(f32::to_le_bytes).collect();
    for [a, b, c, d] in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5_u16]] {
        data.extend([a, b, c, a, c, d].into_iter().flat_map(u16::to_le_bytes));
    }
    let json = serde_json::json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"name": "Red_Car", "mesh": 0, "translation": [0, 0, -15]}, {"name": "spf_start", "translation": [1, 2, 4]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [0.8, 0.02, 0.02, 1.0]}}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3", "min": [0, 0, 0], "max": [2, 1.5, 4]},
            {"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"}],
        "bufferViews": [{"buffer": 0, "byteLength": 96}, {"buffer": 0, "byteOffset": 96, "byteLength": 72}],
        "buffers": [{"byteLength": 168}],
    });
    let mut json = json.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut glb = b"glTF\x02\0\0\0".to_vec();
    let size = |bytes: &[u8]| u32::try_from(bytes.len()).unwrap();
    glb.extend((28 + size(&json) + size(&data)).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &json), (b"BIN\0", &data)] {
        glb.extend(size(chunk).to_le_bytes());
        glb.extend(kind);
        glb.extend(chunk);
    }
    glb
}

#[test]
fn commands_of_the_readme_that_need_nothing_run() {
    run_those_of(|document| document == "README.md");
}

#[test]
#[ignore = "flies every example of the guides: .ci/interop runs it"]
fn commands_that_need_nothing_run() {
    run_those_of(|_| true);
}

#[allow(clippy::print_stdout, reason = "how long each took is for people")]
fn run_those_of(wanted: fn(&str) -> bool) {
    let documents: Vec<_> = documents().into_iter().filter(|(document, _)| wanted(document)).collect();
    assert!(!documents.is_empty());
    let failed: Vec<String> = std::thread::scope(|scope| {
        let runs: Vec<_> = documents
            .iter()
            .map(|(document, text)| {
                scope.spawn(move || {
                    let lab = Lab::new();
                    own_files(&lab, document, text);
                    let runnable = commands(text).into_iter().filter(|(_, args)| exempt(args).is_none());
                    let mut failed = Vec::new();
                    for (line, args) in runnable {
                        let args = shortened(&args, &lab);
                        let began = std::time::Instant::now();
                        let run = run(&lab, &args);
                        println!(
                            "{document}:{line}: spf {}: {:?}, {:.1} s",
                            args.join(" "),
                            run.code,
                            began.elapsed().as_secs_f64()
                        );
                        // A flight cut short, or to a stand-in of the reader's own model, need not reach its target.
                        let unreached =
                            run.code == Some(3) && args.iter().any(|arg| arg.starts_with("--max-time") || arg == "yard.glb");
                        if run.code != Some(0) && !unreached {
                            failed.push(format!("{document}:{line}: spf {}: {:?}\n{}", args.join(" "), run.code, run.stderr));
                        }
                    }
                    failed
                })
            })
            .collect();
        runs.into_iter().flat_map(|run| run.join().unwrap()).collect()
    });
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

#[test]
fn blocks_of_data_are_whole() {
    let lab = Lab::new();
    for (document, text) in documents() {
        for Block { line, language, text } in blocks(&text) {
            let at = format!("{document}:{line}");
            match language.as_str() {
                "toml" => _ = text.parse::<toml::Table>().unwrap_or_else(|error| panic!("{at}: {error}")),
                "json" => {
                    // One value, or several, over any number of lines.
                    for value in serde_json::Deserializer::from_str(&text).into_iter::<serde_json::Value>() {
                        value.unwrap_or_else(|error| panic!("{at}: {error}"));
                    }
                }
                // `python/tests/test_guide.py` runs those of the guide (.ci/python).
                "python" if document == "python.md" => {}
                // Those for AirSim's client are in `airsim/client.py`.
                "python" if document == "airsim.md" => {}
                "" | "sh" | "bibtex" | "yaml" => {}
                other => panic!("{at}: no test reads {other}"),
            }
            if text.starts_with("[[family]]") {
                lab.write("models.toml", &text);
                let list = lab.spf(&["vlm", "list", "--vlm-models", "models.toml"]);
                assert!(list.code == Some(0) && list.stdout.contains("falcon-vl"), "{at}: {}{}", list.stdout, list.stderr);
            }
        }
    }
}
