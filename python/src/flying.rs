//! `spf.fly`: a flight in a thread of its own, while the caller's thread answers and watches.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString, PyType};
use spf_api::Question;
use spf_api::error::Error;
use spf_api::flight::{Answerer, Flying, Happening, Request, out_dir, read_flight, start};
use spf_api::vlm::LATENCY_S;
use spf_pilot::Preset;

use crate::convert;
use crate::errors::{raised, wrong};
use crate::flight::Flight;
use crate::query::Query;
use crate::record::Decision;

/// Time that a step of a policy counts as having taken, seconds.
pub(crate) const POLICY_LATENCY_S: f64 = 0.1;
/// How often a wait looks for Ctrl-C.
const LOOK_UP: Duration = Duration::from_millis(50);

/// Flies an instruction in the simulator, as the command `spf fly` does: the same seed gives the same files.
///
/// instruction: what is to be flown, in any words that the VLM understands. The oracle reads English.
/// scene: a built-in scene or the path of a scene file. seed: of all random choices. craft: quad or tello; the scene's own by default.
/// start: east, north and up in metres, heading and perhaps pitch in degrees; the scene's own by default.
/// vlm: a name as of `--vlm`, or a function that is given a spf.Query and returns the reply, a dict or its text.
/// policy: a function in the place of method and VLM, or an object whose method handle is one: it is given a spf.Query about each frame,
/// taken at rest, and returns a step: spf.Point, spf.Move, spf.Hold or spf.Done.
/// Functions are called in this thread, while the flight stands still; an answer counts as having taken vlm_latency_s, by default 1.5 s for
/// a VLM and 0.1 s for a policy.
/// drone: sim, or a real one as of `--drone`: it is flown by the program `spf` that comes with the module, which has the terminal
/// meanwhile, with its keys; without a terminal, as in a notebook, it refuses unless unattended is True. Ctrl-C lands. Functions, craft,
/// start and depth_sensor are then refused, scene and seed do not matter. flags: further ones of `spf fly`.
/// on_decision: a function that is given each spf.Decision.
/// avoid: obstacle mode. None: on if the VLM lists obstacles, which a function is not expected to do.
/// depth_sensor: whether the craft measures the depth of what it sees. preset: default or paper.
/// max_time_s, max_decisions, max_queries, max_cost_usd: limits; None: the program's.
/// anyway: fly although words of the instruction are used for nothing, or demand what nothing on board measures.
/// video: whether to write a video, which takes longer than the flight. out: the folder for the flight's files, new or empty; by default
/// flights/NNN-… in the working directory.
///
/// An exception of a function lands the craft and is raised; so does Ctrl-C. Raises spf.UsageError for what is wrong in the arguments,
/// and spf.Error for other failures, each with a hint where one is known.
#[pyfunction]
#[pyo3(signature = (
    instruction, *, scene = "city", seed = 0, craft = None, start = None, vlm = None, policy = None, drone = "sim", unattended = false, flags = None, on_decision = None, avoid = None,
    depth_sensor = false, preset = "default", max_time_s = None, max_decisions = None, max_queries = None, max_cost_usd = None,
    vlm_latency_s = None, anyway = false, video = false, out = None
))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
pub(crate) fn fly(
    py: Python<'_>,
    instruction: &str,
    scene: &str,
    seed: u64,
    craft: Option<&str>,
    start: Option<Vec<f64>>,
    vlm: Option<Bound<'_, PyAny>>,
    policy: Option<Bound<'_, PyAny>>,
    drone: &str,
    unattended: bool,
    flags: Option<Vec<String>>,
    on_decision: Option<Bound<'_, PyAny>>,
    avoid: Option<bool>,
    depth_sensor: bool,
    preset: &str,
    max_time_s: Option<f64>,
    max_decisions: Option<u32>,
    max_queries: Option<u32>,
    max_cost_usd: Option<f64>,
    vlm_latency_s: Option<f64>,
    anyway: bool,
    video: bool,
    out: Option<PathBuf>,
) -> PyResult<Flight> {
    let mut flags = flags.unwrap_or_default();
    if drone != "sim" {
        let is_simulators = craft.is_some() || start.is_some() || depth_sensor;
        let is_callers = policy.is_some() || on_decision.is_some() || vlm.as_ref().is_some_and(|vlm| vlm.is_callable());
        if is_simulators || is_callers {
            let message = "a real drone is flown by the program, without functions, and with no craft, start or depth sensor of the simulator";
            return Err(wrong(
                py,
                message,
                "name a VLM; `exec:COMMAND` runs a program of yours that answers (docs/guide/vlm.md)",
            ));
        }
        if vlm.as_ref().is_some_and(|vlm| !vlm.is_instance_of::<PyString>()) {
            return Err(wrong(py, "vlm must be the name of a VLM", "vlm=\"gemini\""));
        }
        let out = out_dir(out.as_deref(), instruction).map_err(|error| raised(py, &error))?;
        let options = PyDict::new(py);
        options.set_item("drone", drone)?;
        options.set_item("vlm", vlm)?;
        options.set_item("out", out.path())?;
        options.set_item("avoid", avoid)?;
        options.set_item("preset", preset)?;
        options.set_item("video", video)?;
        options.set_item("unattended", unattended)?;
        flags.extend(anyway.then(|| "--anyway".to_owned()));
        options.set_item("flags", flags)?;
        options.set_item("max_time_s", max_time_s)?;
        options.set_item("max_decisions", max_decisions)?;
        options.set_item("max_queries", max_queries)?;
        options.set_item("max_cost_usd", max_cost_usd)?;
        // The program takes it.
        out.give_back();
        py.import("spf._program")?.getattr("fly")?.call((instruction,), Some(&options))?;
        return read_flight(out.path()).map(Flight::new).map_err(|error| raised(py, &error));
    }
    if unattended || !flags.is_empty() {
        return Err(wrong(py, "unattended and flags are for real drones", "drone=\"tello\""));
    }
    let mut request = Request::new(instruction);
    request.scene = scene.to_owned();
    request.seed = seed;
    request.craft = convert::craft(py, craft)?;
    request.start = convert::start(py, start)?;
    request.choices.preset = match preset {
        "default" => Preset::Default,
        "paper" => Preset::Paper,
        _ => return Err(wrong(py, format!("unknown preset `{preset}`"), "use default or paper")),
    };
    request.choices.avoid = avoid;
    request.choices.depth_sensor = depth_sensor;
    request.choices.max_time_s = max_time_s;
    request.choices.max_decisions = max_decisions;
    request.choices.max_queries = max_queries;
    request.max_cost_usd = max_cost_usd;
    request.anyway = anyway;
    request.video = video;
    request.out = out;
    request.watched = on_decision.is_some();
    if vlm_latency_s.is_some() && policy.is_none() && !vlm.as_ref().is_some_and(|vlm| vlm.is_callable()) {
        let hint = "leave it out: a vendor's is measured, and an oracle draws its own; in spf.bench.run an oracle's may stand in its name";
        return Err(wrong(py, "vlm_latency_s is that of a function or policy", hint));
    }
    let answers = match (vlm, policy) {
        (None, None) => None,
        (Some(_), Some(_)) => {
            return Err(wrong(py, "a policy queries no VLM", "give vlm or policy; a policy may ask models of its own"));
        }
        (None, Some(_)) if avoid == Some(true) => {
            return Err(wrong(
                py,
                "a policy decides itself what it keeps clear of",
                "depth_sensor=True brakes before obstacles, whatever flies",
            ));
        }
        (None, Some(policy)) => {
            let latency_s = vlm_latency_s.unwrap_or(POLICY_LATENCY_S);
            request.answerer = Answerer::Policy { name: name_of(&policy), latency_s };
            Some(Answers::step(py, policy)?)
        }
        (Some(vlm), None) if vlm.is_callable() => {
            request.answerer = Answerer::Caller { name: name_of(&vlm), latency_s: vlm_latency_s.unwrap_or(LATENCY_S) };
            Some(Answers::Reply(vlm))
        }
        (Some(vlm), None) => {
            let Ok(name) = vlm.cast::<PyString>() else {
                return Err(wrong(
                    py,
                    "vlm must be the name of a VLM or a function",
                    "vlm=\"oracle\", or a function of a spf.Query",
                ));
            };
            request.answerer = Answerer::Named(name.to_str()?.to_owned());
            None
        }
    };
    let mut flying = py.detach(|| self::start(request)).map_err(|error| raised(py, &error))?;
    let mut failure: Option<PyErr> = None;
    loop {
        let happened = match py.detach(|| flying.wait(LOOK_UP)) {
            Some(Happening::Ended) => break,
            // Whatever happens until the craft has landed.
            _ if failure.is_some() => Ok(()),
            Some(Happening::Question(question)) => answers.as_ref().map_or(Ok(()), |answers| answers.answer(py, question)),
            Some(Happening::Decision(decision)) => shown(py, on_decision.as_ref(), *decision),
            None => Ok(()),
        };
        // A second Ctrl-C does not wait for the landing, which goes on without anyone.
        if let Err(error) = py.check_signals() {
            if failure.is_some() {
                return Err(error);
            }
            failure = Some(landing(&flying, error));
        }
        if let (Err(error), None) = (happened, &failure) {
            failure = Some(landing(&flying, error));
        }
    }
    let ended: Result<_, Error> = py.detach(|| flying.finish());
    match failure {
        Some(error) => Err(error),
        None => ended.map(Flight::new).map_err(|error| raised(py, &error)),
    }
}

fn landing(flying: &Flying, error: PyErr) -> PyErr {
    flying.land();
    error
}

/// The name of a function, for logs.
pub(crate) fn name_of(function: &Bound<'_, PyAny>) -> String {
    let name = function.getattr("__name__").or_else(|_| function.get_type().getattr("__name__"));
    let name = name.and_then(|name| name.extract::<String>()).unwrap_or_else(|_| "function".to_owned());
    format!("python:{name}")
}

/// A function of the user's that answers questions.
pub(crate) enum Answers<'py> {
    /// As the VLM, with a reply.
    Reply(Bound<'py, PyAny>),
    /// As the policy, with a step.
    Step(Bound<'py, PyAny>),
}

impl<'py> Answers<'py> {
    /// A policy: a function, or an object whose method `handle` is one.
    pub(crate) fn step(py: Python<'py>, policy: Bound<'py, PyAny>) -> PyResult<Self> {
        if policy.is_instance_of::<PyType>() {
            let name = policy.cast::<PyType>()?.name()?.to_string();
            return Err(wrong(py, format!("policy is the class `{name}`"), &format!("give an object of it: {name}()")));
        }
        let handle = policy.getattr("handle").unwrap_or(policy);
        if handle.is_callable() {
            return Ok(Self::Step(handle));
        }
        Err(wrong(py, "policy must be a function, or have a method handle", "a function of a spf.Query"))
    }

    /// Answers a question.
    pub(crate) fn answer(&self, py: Python<'_>, question: Question) -> PyResult<()> {
        let question = Arc::new(question);
        let query = Py::new(py, Query::new(question.clone()))?;
        match self {
            Self::Reply(function) => {
                let reply = function.call1((query,))?;
                let text = match reply.cast::<PyString>() {
                    Ok(text) => text.to_str()?.to_owned(),
                    Err(_) if reply.is_instance_of::<PyDict>() => {
                        py.import("json")?.call_method1("dumps", (reply,))?.extract()?
                    }
                    Err(_) => {
                        let message = format!("the function that is the VLM returned `{}`", reply.get_type().name()?);
                        return Err(wrong(py, message, "return the reply: a dict, or its text (docs/reference/reply.md)"));
                    }
                };
                question.answer(Ok(text));
                Ok(())
            }
            Self::Step(function) => {
                let step = function.call1((query.clone_ref(py),))?;
                query.get().step(py, &step)
            }
        }
    }
}

/// Shows a decision to the user's function.
fn shown(py: Python<'_>, function: Option<&Bound<'_, PyAny>>, decision: spf_pilot::Decision) -> PyResult<()> {
    match function {
        Some(function) => function.call1((Py::new(py, Decision::new(decision))?,)).map(drop),
        None => Ok(()),
    }
}
