//! NanoDet as published for TensorFlow.js, converted to ONNX with the input and output of a YOLOv8 model.
//!
//! The published graph ([graph models](https://www.tensorflow.org/js/guide/conversion)) ends with class scores and distributions of
//! distances for the cells of three grids ([NanoDet](https://github.com/RangiLyu/nanodet): generalised focal loss, 11 bins per side). The
//! converted one begins with the normalisation of its images, and ends with boxes.

use std::collections::BTreeMap;

use half::f16;
use serde::Deserialize;
use serde_json::Value as Json;

use super::ConversionError;
use super::build::{Builder, Value as Is};

/// Mean and standard deviation of blue, green and red by which its images are normalised, of 255.
const MEAN: [f32; 3] = [103.53, 116.28, 123.675];
const DEVIATION: [f32; 3] = [57.375, 57.12, 58.395];
/// Classes, and bins per side of a box.
const CLASSES: usize = 80;
const BINS: usize = 11;
const SIDES: usize = 4;

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct File {
    model_topology: Topology,
    weights_manifest: Vec<Manifest>,
}

#[derive(Deserialize)]
struct Topology {
    node: Vec<Node>,
}

#[derive(Deserialize)]
struct Node {
    name: String,
    op: String,
    #[serde(default)]
    input: Vec<String>,
    #[serde(default)]
    attr: BTreeMap<String, Json>,
}

#[derive(Deserialize)]
struct Manifest {
    weights: Vec<Weight>,
}

#[derive(Deserialize)]
struct Weight {
    name: String,
    shape: Vec<usize>,
    dtype: String,
    quantization: Option<Quantization>,
}

#[derive(Deserialize)]
struct Quantization {
    dtype: String,
}

/// A constant of the published graph.
struct Constant {
    shape: Vec<usize>,
    floats: Vec<f32>,
    ints: Vec<i64>,
}

/// An image of features.
#[derive(Clone)]
struct Features {
    /// Its name in the converted graph, where channels come first.
    name: String,
    /// Channels, height and width, without `pads`.
    shape: [usize; 3],
    /// Rows above and below, columns left and right, that the next window is to add.
    pads: [usize; 4],
}

/// How a window moves: down and to the right; how much is added above, left, below and right; and how many places it has.
struct Window {
    strides: [i64; 2],
    pads: [i64; 4],
    rows: usize,
    columns: usize,
}

/// The published graph (`nanodet.json`) and its weights (`nanodet.bin`) as an ONNX file.
///
/// # Errors
/// If it is not that graph.
pub(super) fn converted(graph: &[u8], weights: &[u8]) -> Result<Vec<u8>, ConversionError> {
    let file: File = serde_json::from_slice(graph).map_err(|error| ConversionError(error.to_string()))?;
    let mut conversion = Conversion {
        builder: Builder::default(),
        constants: constants(&file.weights_manifest, weights)?,
        values: BTreeMap::new(),
    };
    let (mut heads, mut size) = (Vec::new(), None);
    for node in &file.model_topology.node {
        if node.op == "Placeholder" {
            let sides = conversion.prologue(node)?;
            size = Some(sides);
        } else if node.op == "SplitV" {
            heads.push(conversion.features(node, 0)?);
        } else {
            conversion.translate(node)?;
        }
    }
    let size = size.ok_or_else(|| ConversionError("it has no input".to_owned()))?;
    conversion.epilogue(heads, size)
}

fn constants(manifests: &[Manifest], mut bytes: &[u8]) -> Result<BTreeMap<String, Constant>, ConversionError> {
    let mut found = BTreeMap::new();
    for weight in manifests.iter().flat_map(|manifest| &manifest.weights) {
        let too_many = || ConversionError("the shape of weights is no shape".to_owned());
        let count = weight.shape.iter().try_fold(1_usize, |count, side| count.checked_mul(*side)).ok_or_else(too_many)?;
        let is_half = weight.quantization.as_ref().is_some_and(|quantization| quantization.dtype == "float16");
        let size = match (weight.dtype.as_str(), is_half) {
            ("float32", true) => 2,
            ("float32", false) | ("int32", false) => 4,
            (other, _) => return Err(ConversionError(format!("weights of type {other}"))),
        };
        let short = || ConversionError("the file of weights is too short".to_owned());
        let (raw, rest) = count.checked_mul(size).and_then(|size| bytes.split_at_checked(size)).ok_or_else(short)?;
        bytes = rest;
        let quads = || raw.as_chunks::<4>().0.iter().copied();
        let (floats, ints) = match (weight.dtype.as_str(), is_half) {
            ("int32", _) => (Vec::new(), quads().map(|four| i64::from(i32::from_le_bytes(four))).collect()),
            (_, true) => (raw.as_chunks::<2>().0.iter().map(|&two| f16::from_le_bytes(two).to_f32()).collect(), Vec::new()),
            (_, false) => (quads().map(f32::from_le_bytes).collect(), Vec::new()),
        };
        found.insert(weight.name.clone(), Constant { shape: weight.shape.clone(), floats, ints });
    }
    Ok(found)
}

struct Conversion {
    builder: Builder,
    constants: BTreeMap<String, Constant>,
    values: BTreeMap<String, Features>,
}

impl Conversion {
    fn wrong(node: &Node) -> ConversionError {
        ConversionError(format!("an unexpected {} `{}`", node.op, node.name))
    }

    /// The input as YOLOv8 has it (red, green, blue; 0 to 1), normalised. Its height and width.
    fn prologue(&mut self, node: &Node) -> Result<[usize; 2], ConversionError> {
        let sides = node.attr.get("shape").and_then(|shape| shape.pointer("/shape/dim")).and_then(Json::as_array);
        let sides: Vec<usize> = sides.into_iter().flatten().filter_map(|side| side["size"].as_str()?.parse().ok()).collect();
        let [1, 3, height, width] = sides[..] else { return Err(Self::wrong(node)) };
        let image = self.builder.input("images", &sides);
        let order = self.builder.ints(&[2, 1, 0]);
        let reversed = self.builder.node("Gather", &[&image, &order], &[("axis", Is::Int(1))]);
        let scale = self.builder.floats(&[1, 3, 1, 1], &DEVIATION.map(|deviation| 255.0 / deviation));
        let offset = self.builder.floats(&[1, 3, 1, 1], &[0, 1, 2].map(|channel: usize| -MEAN[channel] / DEVIATION[channel]));
        let scaled = self.builder.node("Mul", &[&reversed, &scale], &[]);
        let name = self.builder.node("Add", &[&scaled, &offset], &[]);
        self.values.insert(node.name.clone(), Features { name, shape: [3, height, width], pads: [0; 4] });
        Ok([height, width])
    }

    fn features(&self, node: &Node, input: usize) -> Result<Features, ConversionError> {
        node.input.get(input).and_then(|name| self.values.get(name)).cloned().ok_or_else(|| Self::wrong(node))
    }

    fn constant(&self, node: &Node, input: usize) -> Result<&Constant, ConversionError> {
        node.input.get(input).and_then(|name| self.constants.get(name)).ok_or_else(|| Self::wrong(node))
    }

    /// Adds what a node of the published graph does. What computes shapes, or comes after the heads, adds nothing.
    fn translate(&mut self, node: &Node) -> Result<(), ConversionError> {
        let result = match node.op.as_str() {
            "Const" | "SparseToDense" | "AddV2" | "Sigmoid" | "Reshape" | "Identity" => return Ok(()),
            // Only the published graph puts channels last around its windows.
            "Transpose" if node.input.first().is_some_and(|name| self.values.contains_key(name)) => self.features(node, 0)?,
            "Transpose" => return Ok(()),
            "Pad" | "PadV2" => self.padded(node)?,
            "Conv2D" => self.convolved(node)?,
            "MaxPool" => self.pooled(node)?,
            "Add" => self.added(node)?,
            "LeakyRelu" => {
                let input = self.features(node, 0)?;
                let slope = node.attr.get("alpha").and_then(|alpha| alpha["f"].as_f64()).ok_or_else(|| Self::wrong(node))?;
                let name = self.builder.node("LeakyRelu", &[&input.name], &[("alpha", Is::Float(slope as f32))]);
                Features { name, ..input }
            }
            "ConcatV2" => self.joined(node)?,
            "ResizeBilinear" => self.resized(node)?,
            _ => return Err(Self::wrong(node)),
        };
        self.values.insert(node.name.clone(), result);
        Ok(())
    }

    fn padded(&self, node: &Node) -> Result<Features, ConversionError> {
        let input = self.features(node, 0)?;
        let [0, 0, 0, 0, top, bottom, left, right] = self.constant(node, 1)?.ints[..] else { return Err(Self::wrong(node)) };
        Ok(Features { pads: [top, bottom, left, right].map(|pad| pad as usize), ..input })
    }

    /// A window over an image of features.
    fn window(node: &Node, input: &Features, kernel: [usize; 2]) -> Result<Window, ConversionError> {
        let strides = node.attr.get("strides").and_then(|strides| strides.pointer("/list/i")).and_then(Json::as_array);
        let strides: Vec<usize> = strides.into_iter().flatten().filter_map(|stride| stride.as_str()?.parse().ok()).collect();
        let [1, down, right, 1] = strides[..] else { return Err(Self::wrong(node)) };
        if down == 0 || right == 0 {
            return Err(Self::wrong(node));
        }
        let [_, height, width] = input.shape;
        let [top, bottom, left, after] = input.pads;
        let sides = |side: usize, kernel: usize, stride: usize| side.checked_sub(kernel).map(|side| side / stride + 1);
        let (Some(rows), Some(columns)) =
            (sides(height + top + bottom, kernel[0], down), sides(width + left + after, kernel[1], right))
        else {
            return Err(Self::wrong(node));
        };
        let pads = [top, left, bottom, after].map(|pad| pad as i64);
        Ok(Window { strides: [down as i64, right as i64], pads, rows, columns })
    }

    fn convolved(&mut self, node: &Node) -> Result<Features, ConversionError> {
        let input = self.features(node, 0)?;
        let weights = self.constant(node, 1)?;
        let [height, width, from, to] = weights.shape[..] else { return Err(Self::wrong(node)) };
        if weights.floats.len() != height * width * from * to {
            return Err(Self::wrong(node));
        }
        // From height, width, input, output to output, input, height, width.
        let mut turned = Vec::with_capacity(weights.floats.len());
        for output in 0..to {
            for channel in 0..from {
                turned.extend((0..height * width).map(|cell| weights.floats[(cell * from + channel) * to + output]));
            }
        }
        let Window { strides, pads, rows, columns } = Self::window(node, &input, [height, width])?;
        let weights = self.builder.floats(&[to, from, height, width], &turned);
        let attributes = [
            ("kernel_shape", Is::Ints(&[height as i64, width as i64])),
            ("strides", Is::Ints(&strides)),
            ("pads", Is::Ints(&pads)),
            ("dilations", Is::Ints(&[1, 1])),
        ];
        let name = self.builder.node("Conv", &[&input.name, &weights], &attributes);
        Ok(Features { name, shape: [to, rows, columns], pads: [0; 4] })
    }

    fn pooled(&mut self, node: &Node) -> Result<Features, ConversionError> {
        let input = self.features(node, 0)?;
        let size = node.attr.get("ksize").and_then(|size| size.pointer("/list/i")).and_then(Json::as_array);
        let size: Vec<usize> = size.into_iter().flatten().filter_map(|side| side.as_str()?.parse().ok()).collect();
        let [1, height, width, 1] = size[..] else { return Err(Self::wrong(node)) };
        let Window { strides, pads, rows, columns } = Self::window(node, &input, [height, width])?;
        let kernel = [height as i64, width as i64];
        let attributes = [("kernel_shape", Is::Ints(&kernel)), ("strides", Is::Ints(&strides)), ("pads", Is::Ints(&pads))];
        let name = self.builder.node("MaxPool", &[&input.name], &attributes);
        Ok(Features { name, shape: [input.shape[0], rows, columns], pads: [0; 4] })
    }

    /// A sum of two images, or of an image and a number per channel.
    fn added(&mut self, node: &Node) -> Result<Features, ConversionError> {
        let input = self.features(node, 0)?;
        let other = match self.features(node, 1) {
            Ok(other) => other.name,
            Err(_) => {
                let bias = self.constant(node, 1)?.floats.clone();
                self.builder.floats(&[1, bias.len(), 1, 1], &bias)
            }
        };
        Ok(Features { name: self.builder.node("Add", &[&input.name, &other], &[]), ..input })
    }

    fn joined(&mut self, node: &Node) -> Result<Features, ConversionError> {
        let (first, second) = (self.features(node, 0)?, self.features(node, 1)?);
        // Where channels are first, as they are outside of windows.
        if self.constant(node, 2)?.ints != [1] {
            return Err(Self::wrong(node));
        }
        let name = self.builder.node("Concat", &[&first.name, &second.name], &[("axis", Is::Int(1))]);
        let [channels, height, width] = first.shape;
        Ok(Features { name, shape: [channels + second.shape[0], height, width], pads: [0; 4] })
    }

    fn resized(&mut self, node: &Node) -> Result<Features, ConversionError> {
        let input = self.features(node, 0)?;
        let [height, width] = self.constant(node, 1)?.ints[..] else { return Err(Self::wrong(node)) };
        let sizes = self.builder.ints(&[1, input.shape[0] as i64, height, width]);
        let attributes = [("mode", Is::Text("linear")), ("coordinate_transformation_mode", Is::Text("half_pixel"))];
        let name = self.builder.node("Resize", &[&input.name, "", "", &sizes], &attributes);
        Ok(Features { name, shape: [input.shape[0], height as usize, width as usize], pads: [0; 4] })
    }

    /// From scores and distances of the cells of all grids to centres, sizes and scores.
    fn epilogue(mut self, heads: Vec<Features>, [height, width]: [usize; 2]) -> Result<Vec<u8>, ConversionError> {
        let channels = CLASSES + SIDES * BINS;
        if heads.is_empty() || heads.iter().any(|head| head.shape[0] != channels || head.shape.contains(&0)) {
            return Err(ConversionError(format!("it does not end in grids of {channels} channels")));
        }
        let (mut rows, mut strides, mut centres) = (Vec::new(), Vec::new(), [Vec::new(), Vec::new()]);
        for Features { name, shape: [_, down, right], .. } in &heads {
            let sides = self.builder.ints(&[1, channels as i64, (down * right) as i64]);
            rows.push(self.builder.node("Reshape", &[name, &sides], &[]));
            let stride = [width as f32 / *right as f32, height as f32 / *down as f32];
            for cell in 0..down * right {
                centres[0].push(((cell % right) as f32 + 0.5) * stride[0]);
                centres[1].push(((cell / right) as f32 + 0.5) * stride[1]);
                strides.push(stride[0]);
            }
        }
        let cells = strides.len();
        let build = &mut self.builder;
        let rows: Vec<&str> = rows.iter().map(String::as_str).collect();
        let all = build.node("Concat", &rows, &[("axis", Is::Int(2))]);
        let [scores, distances] = build.split(&all, CLASSES, SIDES * BINS);
        let scores = build.node("Sigmoid", &[&scores], &[]);
        // The mean of each distribution, in cells: left, top, right, bottom.
        let sides = build.ints(&[1, SIDES as i64, BINS as i64, cells as i64]);
        let bins = build.node("Reshape", &[&distances, &sides], &[]);
        let bins = build.node("Softmax", &[&bins], &[("axis", Is::Int(2))]);
        let numbers: Vec<f32> = (0..BINS).map(|bin| bin as f32).collect();
        let numbers = build.floats(&[1, 1, BINS, 1], &numbers);
        let bins = build.node("Mul", &[&bins, &numbers], &[]);
        let axis = build.ints(&[2]);
        let distances = build.node("ReduceSum", &[&bins, &axis], &[("keepdims", Is::Int(0))]);
        let strides = build.floats(&[1, 1, cells], &strides);
        let distances = build.node("Mul", &[&distances, &strides], &[]);
        let [before, after] = build.split(&distances, 2, 2);
        let shift = build.node("Sub", &[&after, &before], &[]);
        let half = build.floats(&[], &[0.5]);
        let shift = build.node("Mul", &[&shift, &half], &[]);
        let cell_centres = build.floats(&[1, 2, cells], &centres.concat());
        let centres = build.node("Add", &[&shift, &cell_centres], &[]);
        let sizes = build.node("Add", &[&after, &before], &[]);
        build.node_to("Concat", &[&centres, &sizes, &scores], &["output0"], &[("axis", Is::Int(1))]);
        Ok(self.builder.file("output0", &[1, SIDES + CLASSES, cells]))
    }
}
