//! An ONNX network, run by `rten` on the CPU.

use rten::{DataType, Dimension, Model, ModelOptions, NodeId, OpRegistry, ValueType};
use rten_tensor::prelude::*;
use rten_tensor::{NdTensorView, Tensor};

use crate::{Description, DetectError, MAX_SIDE, Output, names};

/// Default side of the input for models with a dynamic size.
const DEFAULT_SIDE: usize = 640;
/// Sides of an input are multiples of this, the largest stride.
const STRIDE: usize = 32;
/// Usual name of the output with boxes; without it the first output is used.
const BOXES: &str = "output0";

/// A loaded network.
pub(crate) struct Network {
    model: Model,
    input: NodeId,
    output: NodeId,
    masks: bool,
    description: Description,
}

impl Network {
    /// Loads a model and its metadata.
    pub(crate) fn load(bytes: Vec<u8>) -> Result<Self, DetectError> {
        let mut options = ModelOptions::with_ops(OpRegistry::with_all_ops());
        options.prepack_weights(true);
        let model = options.load(bytes).map_err(|error| unread(&error.to_string()))?;
        check_task(&model)?;
        let &[input] = model.input_ids() else {
            return Err(DetectError::Unfit(format!("it has {} inputs, expected one", model.input_ids().len())));
        };
        let boxes = model.output_ids().iter().copied().find(|id| name(&model, *id) == Some(BOXES));
        let Some(output) = boxes.or_else(|| model.output_ids().first().copied()) else {
            return Err(DetectError::Unfit("it has no outputs".to_owned()));
        };
        let is_masks = |id: &NodeId| *id != output && shape(&model, *id).len() == 4;
        let masks = model.output_ids().iter().any(is_masks);
        let description = Description {
            input: input_size(&model, input)?,
            names: model.metadata().get("names").and_then(names::parse),
            end_to_end: end_to_end(&model),
        };
        Ok(Self { model, input, output, masks, description })
    }

    pub(crate) fn description(&self) -> &Description {
        &self.description
    }

    /// Runs it on three planes of the input size.
    pub(crate) fn run(&self, values: &[f32]) -> Result<Output, DetectError> {
        let (width, height) = self.description.input;
        let input = NdTensorView::<f32, 4>::from_data([1, 3, height, width], values);
        let failed = |error: &dyn std::error::Error| DetectError::Run(one_line(&error.to_string()));
        let outputs = self.model.run(vec![(self.input, input.into())], &[self.output], None).map_err(|error| failed(&error))?;
        let Some(output) = outputs.into_iter().next() else { return Err(DetectError::Run("it returned no output".to_owned())) };
        let output: Tensor<f32> =
            output.try_into().map_err(|_| DetectError::Unfit("its output is not a tensor of 32-bit floats".to_owned()))?;
        Ok(Output { shape: output.shape().to_vec(), values: output.into_data(), masks: self.masks })
    }
}

/// Models for other tasks have other outputs, some with the same shape.
fn check_task(model: &Model) -> Result<(), DetectError> {
    match model.metadata().get("task") {
        None | Some("detect" | "segment") => Ok(()),
        Some(other) => Err(DetectError::Unfit(format!("its task is `{}`, expected `detect`", one_line(other)))),
    }
}

fn name(model: &Model, id: NodeId) -> Option<&str> {
    model.node_info(id)?.name()
}

fn shape(model: &Model, id: NodeId) -> Vec<Dimension> {
    model.node_info(id).and_then(|node| node.shape()).unwrap_or_default()
}

/// Width and height of the input: fixed, from metadata, or the default.
fn input_size(model: &Model, input: NodeId) -> Result<(usize, usize), DetectError> {
    let shape = shape(model, input);
    let shown = || {
        let side = |dimension: &Dimension| match dimension {
            Dimension::Fixed(size) => size.to_string(),
            Dimension::Symbolic(name) => one_line(name),
        };
        shape.iter().map(side).collect::<Vec<_>>().join("×")
    };
    let refused = |why: &str| DetectError::Unfit(format!("its input is {}, expected 1×3×height×width{why}", shown()));
    let float = model.node_info(input).and_then(|node| node.dtype());
    if float.is_some_and(|float| float != ValueType::Tensor(DataType::Float)) {
        return Err(refused(" of 32-bit floats"));
    }
    let [batch, channels, height, width] = &shape[..] else { return Err(refused("")) };
    let any_or = |dimension: &Dimension, wanted| !matches!(dimension, Dimension::Fixed(size) if *size != wanted);
    if !any_or(batch, 1) || !any_or(channels, 3) {
        return Err(refused(""));
    }
    let named = model.metadata().get("imgsz").and_then(sides).unwrap_or((DEFAULT_SIDE, DEFAULT_SIDE));
    let side = |dimension: &Dimension, named: usize| match dimension {
        Dimension::Fixed(size) => *size,
        Dimension::Symbolic(_) => named.next_multiple_of(STRIDE),
    };
    let size = (side(width, named.1), side(height, named.0));
    if [size.0, size.1].iter().all(|side| (STRIDE..=MAX_SIDE).contains(side)) {
        return Ok(size);
    }
    Err(refused(&format!(" with sides from {STRIDE} to {MAX_SIDE}")))
}

/// Height and width in metadata: `[480, 640]`.
fn sides(text: &str) -> Option<(usize, usize)> {
    let (height, width) = text.trim().strip_prefix('[')?.strip_suffix(']')?.split_once(',')?;
    let side = |text: &str| text.trim().parse().ok().filter(|side| (1..=MAX_SIDE).contains(side));
    Some((side(height)?, side(width)?))
}

/// Whether the model declares its boxes final; `None` if it does not state it.
fn end_to_end(model: &Model) -> Option<bool> {
    let says = |key: &str| model.metadata().get(key).is_some_and(|value| value.trim().eq_ignore_ascii_case("true"));
    let exported = model.metadata().get("args").is_some_and(|args| args.contains("'nms': True"));
    (says("end2end") || says("nms") || exported).then_some(true)
}

/// The error for a file that cannot be loaded, with advice.
fn unread(error: &str) -> DetectError {
    let hint = if error.contains("FLOAT16") {
        "; half precision is not supported: export without `half`"
    } else if error.contains("external data") {
        "; its weights are in a separate file: export it as a single file"
    } else {
        ""
    };
    DetectError::Load(format!("{}{hint}", one_line(error)))
}

/// External text, reduced to one line.
fn one_line(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).take(300).collect()
}
