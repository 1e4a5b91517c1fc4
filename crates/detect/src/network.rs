//! An ONNX network that takes an image, run by `rten` on the CPU.

use rten::{DataType, Dimension, Model, ModelOptions, NodeId, OpRegistry, ValueType};
use rten_tensor::prelude::*;
use rten_tensor::{Tensor, TensorView};

use crate::error::NetworkError;
use crate::exchange::{Description, Input, Outlet, Output};
use crate::windows;

/// Maximum length of an entry of metadata, bytes: names of thousands of classes.
const MAX_ENTRY: usize = 1 << 20;
/// The metadata that somebody asks for.
const METADATA: [&str; 6] = ["names", "task", "imgsz", "args", "end2end", "nms"];

/// A loaded network.
pub(crate) struct Network {
    model: Model,
    input: NodeId,
    /// Number of its input's dimensions: 4, or 5 for one image of several.
    rank: usize,
    description: Description,
}

impl Network {
    /// Loads a model and its metadata.
    pub(crate) fn load(bytes: Vec<u8>) -> Result<Self, NetworkError> {
        let mut options = ModelOptions::with_ops(OpRegistry::with_all_ops());
        options.prepack_weights(true);
        let model = options.load(windows::complete(bytes)?).map_err(|error| unread(&error.to_string()))?;
        let &[input] = model.input_ids() else {
            return Err(NetworkError::Unfit(format!("it has {} inputs, expected one", model.input_ids().len())));
        };
        let sides = |id: &NodeId| shape(&model, *id).iter().map(fixed).collect();
        let name = |id: &NodeId| model.node_info(*id).and_then(|node| node.name()).map(one_line).unwrap_or_default();
        let outputs = model.output_ids().iter().map(|id| Outlet { name: name(id), shape: sides(id) }).collect();
        let entry = |key: &&str| model.metadata().get(key).filter(|value| value.len() <= MAX_ENTRY);
        let metadata = METADATA.iter().filter_map(|key| Some(((*key).to_owned(), entry(key)?.to_owned()))).collect();
        let (size, rank) = input_size(&model, input)?;
        let description = Description { input: size, outputs, metadata };
        Ok(Self { model, input, rank, description })
    }

    pub(crate) fn description(&self) -> &Description {
        &self.description
    }

    /// Runs it on an image.
    pub(crate) fn run(&self, input: Input<'_>) -> Result<Output, NetworkError> {
        let wrong = || NetworkError::Run(format!("an input of {} numbers", input.values.len()));
        let Some(&output) = self.model.output_ids().get(input.output).filter(|_| input.is_whole()) else { return Err(wrong()) };
        let (width, height) = input.size;
        let shape: Vec<usize> = [1, 1, 3, height, width].into_iter().skip(5 - self.rank).collect();
        let image = TensorView::<f32>::from_data(&shape[..], input.values);
        let failed = |error: &dyn std::error::Error| NetworkError::Run(one_line(&error.to_string()));
        let outputs = self.model.run(vec![(self.input, image.into())], &[output], None).map_err(|error| failed(&error))?;
        let Some(output) = outputs.into_iter().next() else { return Err(NetworkError::Run("it returned no output".to_owned())) };
        let output: Tensor<f32> =
            output.try_into().map_err(|_| NetworkError::Unfit("its output is not a tensor of 32-bit floats".to_owned()))?;
        Ok(Output { shape: output.shape().to_vec(), values: output.into_data() })
    }
}

fn shape(model: &Model, id: NodeId) -> Vec<Dimension> {
    model.node_info(id).and_then(|node| node.shape()).unwrap_or_default()
}

fn fixed(dimension: &Dimension) -> Option<usize> {
    if let Dimension::Fixed(size) = dimension { Some(*size) } else { None }
}

/// Width and height of the input, if they are fixed, and its number of dimensions.
#[allow(clippy::type_complexity, reason = "a size and a number")]
fn input_size(model: &Model, input: NodeId) -> Result<((Option<usize>, Option<usize>), usize), NetworkError> {
    let shape = shape(model, input);
    let shown = || {
        let side = |dimension: &Dimension| match dimension {
            Dimension::Fixed(size) => size.to_string(),
            Dimension::Symbolic(name) => one_line(name),
        };
        shape.iter().map(side).collect::<Vec<_>>().join("×")
    };
    let refused = |why: &str| NetworkError::Unfit(format!("its input is {}, expected 1×3×height×width{why}", shown()));
    let float = model.node_info(input).and_then(|node| node.dtype());
    if float.is_some_and(|float| float != ValueType::Tensor(DataType::Float)) {
        return Err(refused(" of 32-bit floats"));
    }
    let is = |dimension: &Dimension, wanted| fixed(dimension).is_none_or(|size| size == wanted);
    match &shape[..] {
        [images @ .., channels, height, width]
            if (1..=2).contains(&images.len()) && images.iter().all(|images| is(images, 1)) && is(channels, 3) =>
        {
            Ok(((fixed(width), fixed(height)), shape.len()))
        }
        _ => Err(refused("")),
    }
}

/// The error for a file that cannot be loaded, with advice.
fn unread(error: &str) -> NetworkError {
    let hint = if error.contains("FLOAT16") {
        "; half precision is not supported: export without `half`"
    } else if error.contains("external data") {
        "; its weights are in a separate file: export it as a single file"
    } else {
        ""
    };
    NetworkError::Load(format!("{}{hint}", one_line(error)))
}

/// External text, reduced to one line.
fn one_line(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).take(300).collect()
}
