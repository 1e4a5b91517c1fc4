//! FastDepth as published in ONNX, with the input of other depth networks and operators that the engine knows.

use prost::Message;

use super::ConversionError;
use super::build::{Builder, Value as Is};
use super::proto::{FLOAT, Model, Node};
use crate::depth::{DEVIATION, MEAN};

/// The published file as one whose images are normalised as those of other depth networks: itself, it takes values from 0 to 1
/// ([FastDepth](https://github.com/dwofk/fast-depth)). Limits and enlargements are written as newer versions of ONNX have them.
///
/// # Errors
/// If it is not that file.
pub(super) fn converted(file: &[u8]) -> Result<Vec<u8>, ConversionError> {
    let wrong = |what: &str| ConversionError(what.to_owned());
    let model = Model::decode(file).map_err(|error| ConversionError(error.to_string()))?;
    let graph = model.graph.ok_or_else(|| wrong("it has no graph"))?;
    let (Some(image), [output]) = (graph.inputs.first(), &graph.outputs[..]) else {
        return Err(wrong("it has not one input and output"));
    };
    let sides = |named: &super::proto::Named| -> Option<Vec<usize>> {
        let shape = named.kind.as_ref()?.tensor.as_ref()?.shape.as_ref()?;
        Some(shape.sides.iter().map(|side| side.size as usize).collect())
    };
    let (Some(from), Some(to)) = (sides(image), sides(output)) else { return Err(wrong("its sizes are unknown")) };
    let mut build = Builder::default();
    let normalised = build.input("image", &from);
    let deviation = build.floats(&[1, 3, 1, 1], &DEVIATION);
    let mean = build.floats(&[1, 3, 1, 1], &MEAN);
    let scaled = build.node("Mul", &[&normalised, &deviation], &[]);
    build.node_to("Add", &[&scaled, &mean], &[&image.name], &[]);
    // The others count the images of its training.
    graph.initializers.into_iter().filter(|tensor| tensor.kind == FLOAT).for_each(|tensor| build.keep(tensor));
    for node in graph.nodes {
        modernised(&mut build, node)?;
    }
    Ok(build.file(&output.name, &to))
}

/// Adds a node of operators' version 7 as one of version 13.
fn modernised(build: &mut Builder, node: Node) -> Result<(), ConversionError> {
    let attribute = |name: &str| node.attributes.iter().find(|attribute| attribute.name == name);
    let wrong = || ConversionError(format!("an unexpected {}", node.operator));
    let ([input, ..], [output]) = (&node.inputs[..], &node.outputs[..]) else { return Err(wrong()) };
    match node.operator.as_str() {
        "Clip" => {
            let limit = |name| attribute(name).and_then(|attribute| attribute.float).ok_or_else(wrong);
            let (least, most) = (limit("min")?, limit("max")?);
            let (least, most) = (build.floats(&[], &[least]), build.floats(&[], &[most]));
            build.node_to("Clip", &[input, &least, &most], &[output], &[]);
        }
        "Upsample" => {
            let scales = &attribute("scales").ok_or_else(wrong)?.floats;
            let scales = build.floats(&[scales.len()], scales);
            let attributes = [
                ("mode", Is::Text("nearest")),
                ("coordinate_transformation_mode", Is::Text("asymmetric")),
                ("nearest_mode", Is::Text("floor")),
            ];
            build.node_to("Resize", &[input, "", &scales], &[output], &attributes);
        }
        "BatchNormalization" => {
            let epsilon = attribute("epsilon").and_then(|attribute| attribute.float).ok_or_else(wrong)?;
            let inputs: Vec<&str> = node.inputs.iter().map(String::as_str).collect();
            build.node_to("BatchNormalization", &inputs, &[output], &[("epsilon", Is::Float(epsilon))]);
        }
        "Conv" | "Relu" | "Add" => build.push(node),
        _ => return Err(wrong()),
    }
    Ok(())
}
