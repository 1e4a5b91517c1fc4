//! The VLM endpoint.

use std::net::SocketAddr;
use std::sync::Arc;

use spf_flight::sim::{FlightConditions, OracleVlm, SimWorld};
use spf_serve::truth::SharedInstruction;
use spf_serve::vlm::{AnswerForm, Camera, Endpoint, FrameProvider, Instruction, Memory, OnboardCamera, Responder, Serving};
use spf_vlm::ORACLE_SERVED;

use crate::args::Serve;
use crate::commands::sim::{above_start, conditions, parse_effects, parse_kind};
use crate::commands::vlm::oracle_named;
use crate::commands::{load_scene, parse_pose};
use crate::error::CliError;
use crate::printer::Printer;

/// The keyword for reading the instruction from the prompt.
pub(super) const FROM_PROMPT: &str = "from-prompt";

/// A drone whose camera is used.
pub(super) struct Flown {
    /// Its world.
    pub(super) world: SimWorld,
    /// What its camera sees.
    pub(super) onboard: Arc<OnboardCamera>,
    /// Receives the instruction in use.
    pub(super) shared_instruction: SharedInstruction,
}

/// Starts the endpoint; it serves until the result is dropped. Its camera is that of `flown`, else a fixed one.
pub(super) fn start(args: &Serve, oracle: &str, flown: Option<Flown>, printer: &Printer) -> Result<Serving, CliError> {
    let wrong =
        |flag: &str, value: &str, expected: &str| CliError::usage(format!("{flag}: expected {expected}, found `{value}`"));
    let (name, errors) = oracle_named(oracle, |expected, near| {
        let near = near.unwrap_or("oracle:poor");
        wrong("--vlm", oracle, expected).hint(format!("for example --vlm={near}"))
    })?;
    let address: SocketAddr = args
        .vlm_listen
        .parse()
        .map_err(|_| wrong("--vlm-listen", &args.vlm_listen, "an address and a port").hint("--vlm-listen 127.0.0.1:8080"))?;
    let form = match args.answer.as_str() {
        "spf" => AnswerForm::Spf,
        "gemini-point" => AnswerForm::GeminiPoint,
        other => {
            return Err(
                wrong("--answer", other, "spf or gemini-point").hint("spf is the reply format of docs/reference/reply.md")
            );
        }
    };
    let instruction = match args.instruction.trim() {
        FROM_PROMPT => Instruction::FromPrompt,
        "" => return Err(CliError::usage("--instruction is empty").hint("--instruction \"fly to the red crane\"")),
        text => Instruction::Text(text.to_owned()),
    };
    let pose = args.start.as_deref().map(|text| parse_pose(text).map_err(|expected| wrong("--start", text, &expected)));
    let pose = pose.transpose()?;
    let kind = args.drone_model.as_deref().map(parse_kind).transpose()?;
    let effects = args.camera_effects.as_deref().map(parse_effects).transpose()?.unwrap_or_default();
    let conditions = conditions(&args.conditions)?;
    // The port first: without it, there is no point in loading a scene.
    let endpoint = Endpoint::bind(address).map_err(|error| {
        CliError::usage("cannot serve the endpoint").because(&error).hint("--vlm-listen 127.0.0.1:0 picks a free port")
    })?;
    let responder = |world: &SimWorld, memory: Arc<Memory>| {
        Responder::new(OracleVlm::new(name.clone(), world.clone(), errors, args.seed), memory, instruction, form)
    };
    let (scene, lens, responder): (String, Arc<dyn FrameProvider>, Responder) = match flown {
        Some(Flown { world, onboard, shared_instruction }) => {
            let responder = responder(&world, onboard.memory().clone()).sharing_instruction(shared_instruction);
            (world.loaded().scene.name.clone(), onboard, responder)
        }
        None => {
            let loaded = Arc::new(load_scene(args.scene.as_deref().unwrap_or("city"), &conditions)?);
            let kind = kind.unwrap_or(loaded.scene.default_craft);
            let start = pose.unwrap_or_else(|| above_start(loaded.scene.start, kind));
            let flight_conditions = FlightConditions { effects, ..FlightConditions::default() };
            let world = SimWorld::under(&flight_conditions, loaded, kind, start, args.seed);
            let (memory, scene) = (Arc::new(Memory::default()), world.loaded().scene.name.clone());
            let responder = responder(&world, memory.clone());
            (scene, Arc::new(Camera::new(world, args.seed, start, memory)), responder)
        }
    };
    let address = endpoint.address();
    let serving =
        endpoint.serve(lens, responder).map_err(|error| CliError::internal("cannot start the endpoint").because(&error))?;
    // As `--vlm` takes it.
    printer.result(&format!("http://{address}/v1#{ORACLE_SERVED}"));
    printer.log(&format!(
        "Serving {name} over the OpenAI (http://{address}/v1), Gemini and Anthropic APIs (http://{address}) for {scene} \
            (http://{address}/frame.jpg); it is not a VLM. Stop with Ctrl-C.",
    ));
    if !address.ip().is_loopback() {
        printer.log("warning: anyone who can reach this address can send queries, move the camera, and use CPU time");
    }
    Ok(serving)
}
