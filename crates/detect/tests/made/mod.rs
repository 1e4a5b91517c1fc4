//! Small networks with the inputs and outputs of YOLO exports, written as ONNX by hand: they find red and blue squares.
//!
//! Like the exported ones they have three heads, with cells of 8, 16 and 32 pixels; only the first evaluates the image.

#[allow(dead_code, reason = "not every test that makes models makes depth networks")]
pub(crate) mod vit;

/// The side of the input, pixels.
pub(crate) const SIDE: usize = 64;
const MASK_ROWS: usize = 32;
const FLOAT: u64 = 1;
const INT64: u64 = 7;
const FLOAT16: u64 = 10;

/// How a network is exported.
#[derive(Clone, Debug)]
pub(crate) struct Export {
    /// `1 × cells × rows` in place of `1 × rows × cells`.
    pub(crate) transposed: bool,
    /// Corners, score and class 0 in place of centre, size and probabilities; transposed.
    pub(crate) is_final: bool,
    /// Rows for masks, and a second output.
    pub(crate) masks: bool,
    /// Named input dimensions in place of numbers.
    pub(crate) dynamic: bool,
    /// Weights of 16 bits.
    pub(crate) half: bool,
    /// Channels of the input.
    pub(crate) channels: usize,
    /// Classes; from the third on nothing is found of them.
    pub(crate) classes: usize,
    /// The unit of the boxes.
    pub(crate) unit: Unit,
    /// Only the first this many cells, as queries that are no cells of the usual heads; needs `transposed`.
    pub(crate) queries: Option<usize>,
    /// What is found does not depend on the image.
    pub(crate) constant: bool,
    /// What is added to the scores.
    pub(crate) offset: f32,
    /// Before the heads are operators that change nothing and leave their windows to defaults and rules.
    pub(crate) defaults: bool,
    /// The model's metadata.
    pub(crate) metadata: Vec<(&'static str, &'static str)>,
}

impl Default for Export {
    fn default() -> Self {
        Self {
            transposed: false,
            is_final: false,
            masks: false,
            dynamic: false,
            half: false,
            channels: 3,
            classes: 2,
            unit: Unit::Pixels,
            queries: None,
            constant: false,
            offset: 0.0,
            defaults: false,
            metadata: vec![("names", "{0: 'red cone', 1: 'blue box'}"), ("task", "detect"), ("imgsz", "[64, 64]")],
        }
    }
}

/// The unit of boxes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(dead_code, reason = "not every test that makes models makes all of them")]
pub(crate) enum Unit {
    /// Pixels of the input.
    Pixels,
    /// Fractions of its sides.
    Fractions,
    /// Cells of the head.
    Cells,
}

/// A message of protocol buffers.
#[derive(Default)]
struct Message(Vec<u8>);

impl Message {
    fn varint(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.0.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.0.push(value as u8);
    }

    fn number(mut self, field: u64, value: u64) -> Self {
        self.varint(field << 3);
        self.varint(value);
        self
    }

    fn bytes(mut self, field: u64, value: &[u8]) -> Self {
        self.varint(field << 3 | 2);
        self.varint(value.len() as u64);
        self.0.extend_from_slice(value);
        self
    }

    fn text(self, field: u64, value: &str) -> Self {
        self.bytes(field, value.as_bytes())
    }

    fn message(self, field: u64, value: &Self) -> Self {
        self.bytes(field, &value.0)
    }
}

/// `TensorProto`.
fn tensor(name: &str, dims: &[usize], data_type: u64, raw: &[u8]) -> Message {
    let sized = dims.iter().fold(Message::default(), |message, dim| message.number(1, *dim as u64));
    sized.number(2, data_type).text(8, name).bytes(9, raw)
}

fn floats(name: &str, dims: &[usize], values: &[f32]) -> Message {
    tensor(name, dims, FLOAT, &values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>())
}

/// `NodeProto` with attributes that are lists of whole numbers, or one.
fn node(operator: &str, inputs: &[&str], output: &str, lists: &[(&str, &[u64])], numbers: &[(&str, u64)]) -> Message {
    let mut message = inputs.iter().fold(Message::default(), |message, input| message.text(1, input));
    message = message.text(2, output).text(3, &format!("{operator} of {output}")).text(4, operator);
    for (name, values) in lists {
        let list = values.iter().fold(Message::default().text(1, name), |message, value| message.number(8, *value));
        message = message.message(5, &list.number(20, 7));
    }
    for (name, value) in numbers {
        message = message.message(5, &Message::default().text(1, name).number(3, *value).number(20, 2));
    }
    message
}

/// `ValueInfoProto` of floats; a dimension is a number or a name.
fn value(name: &str, dims: &[Result<usize, &str>]) -> Message {
    let shape = dims.iter().fold(Message::default(), |shape, dim| {
        let dimension = match dim {
            Ok(size) => Message::default().number(1, *size as u64),
            Err(name) => Message::default().text(2, name),
        };
        shape.message(1, &dimension)
    });
    let tensor = Message::default().number(1, FLOAT).message(2, &shape);
    Message::default().text(1, name).message(2, &Message::default().message(1, &tensor))
}

/// The model, as a file.
pub(crate) fn model(export: &Export) -> Vec<u8> {
    let rows = 4 + export.classes + if export.masks { MASK_ROWS } else { 0 };
    let mut graph = Message::default().text(2, "squares");
    let images = if export.defaults { "through" } else { "images" };
    if export.defaults {
        graph = through(graph, images);
    }
    let mut parts = Vec::new();
    for stride in [8, 16, 32] {
        let (side, names) = (SIDE / stride, ["conv", "weights", "grid", "put", "size", "head"].map(|n| format!("{n}{stride}")));
        let [conv, weights, grid, put, size, head] = names.each_ref().map(String::as_str);
        let strides = [stride as u64, stride as u64];
        graph = graph
            .message(1, &node("Conv", &[images, weights], conv, &[("strides", &strides), ("kernel_shape", &strides)], &[]))
            .message(1, &node("Add", &[conv, grid], put, &[], &[]))
            .message(1, &node("Reshape", &[put, size], head, &[], &[]))
            .message(5, &looking(weights, rows, export, stride))
            .message(5, &floats(grid, &[1, rows, side, side], &places(rows, export, stride)))
            .message(5, &tensor(size, &[3], INT64, &[1, rows, side * side].map(|n| (n as i64).to_le_bytes()).concat()));
        parts.push(head.to_owned());
    }
    let turned = export.transposed || export.is_final;
    let heads: Vec<&str> = parts.iter().map(String::as_str).collect();
    let (joined, cells) = (if turned { "joined" } else { "output0" }, export.queries.unwrap_or(84));
    graph = graph.message(1, &node("Concat", &heads, joined, &[], &[("axis", 2)]));
    if turned {
        let whole = if export.queries.is_some() { "cells" } else { "output0" };
        graph = graph.message(1, &node("Transpose", &["joined"], whole, &[("perm", &[0, 2, 1])], &[]));
    }
    if let Some(queries) = export.queries {
        graph = graph.message(1, &node("Slice", &["cells", "from", "to", "along"], "output0", &[], &[]));
        for (name, value) in [("from", 0), ("to", queries as i64), ("along", 1)] {
            graph = graph.message(5, &tensor(name, &[1], INT64, &value.to_le_bytes()));
        }
    }
    let (batch, height, width) =
        if export.dynamic { (Err("batch"), Err("height"), Err("width")) } else { (Ok(1), Ok(SIDE), Ok(SIDE)) };
    graph = graph.message(11, &value("images", &[batch, Ok(export.channels), height, width]));
    let (a, b) = if turned { (cells, rows) } else { (rows, cells) };
    graph = graph.message(12, &value("output0", &[Ok(1), Ok(a), Ok(b)]));
    if export.masks {
        // Any four dimensions are mask prototypes.
        graph = graph.message(1, &node("Identity", &["put8"], "output1", &[], &[]));
        graph = graph.message(12, &value("output1", &[Ok(1), Ok(rows), Ok(8), Ok(8)]));
    }
    let mut model = Message::default().number(1, 8).text(2, "test").message(7, &graph);
    model = model.message(8, &Message::default().text(1, "").number(2, 13));
    for (key, value) in &export.metadata {
        model = model.message(14, &Message::default().text(1, key).text(2, value));
    }
    model.0
}

/// Weights of the head of a stride: for red, the excess of red over green in a cell; for blue, the excess of blue.
fn looking(name: &str, rows: usize, export: &Export, stride: usize) -> Message {
    let area = stride * stride;
    let mut weights = vec![0.0; rows * export.channels * area];
    if stride == 8 && export.channels == 3 && !export.constant {
        let classes = if export.is_final { 1 } else { 2 };
        for class in 0..classes {
            let row = (4 + class) * 3 * area;
            let channel = row + 2 * class * area;
            weights[channel..channel + area].fill(1.0 / area as f32);
            weights[row + area..row + 2 * area].fill(-1.0 / area as f32);
        }
    }
    let dims = [rows, export.channels, stride, stride];
    if export.half { tensor(name, &dims, FLOAT16, &vec![0; 2 * weights.len()]) } else { floats(name, &dims, &weights) }
}

/// Offset added to each cell: its position, as centre and size or as corners, and that of the scores.
fn places(rows: usize, export: &Export, stride: usize) -> Vec<f32> {
    let side = SIDE / stride;
    let size = stride as f32;
    let unit = match export.unit {
        Unit::Pixels => 1.0,
        Unit::Fractions => SIDE as f32,
        Unit::Cells => size,
    };
    let mut values = vec![0.0; rows * side * side];
    let scores = if export.is_final { 1 } else { export.classes };
    values[4 * side * side..(4 + scores) * side * side].fill(export.offset);
    for y in 0..side {
        for x in 0..side {
            let (left, top) = (x as f32 * size, y as f32 * size);
            let place = if export.is_final {
                [left, top, left + size, top + size]
            } else {
                [left + 0.5 * size, top + 0.5 * size, size, size]
            };
            for (row, number) in place.into_iter().enumerate() {
                values[(row * side + y) * side + x] = number / unit;
            }
        }
    }
    values
}

/// An operator that pads by a rule.
fn ruled(operator: &str, inputs: &[&str], output: &str, lists: &[(&str, &[u64])], rule: &str) -> Message {
    let attribute = Message::default().text(1, "auto_pad").text(4, rule).number(20, 3);
    node(operator, inputs, output, lists, &[]).message(5, &attribute)
}

/// Operators that change nothing, in each way in which a file may leave their windows to defaults and rules.
fn through(graph: Message, last: &str) -> Message {
    // Each channel by itself, with a one at a place of the kernel.
    let kernel = |name: &str, side: usize, place: usize| {
        let mut values = vec![0.0; 9 * side * side];
        (0..3).for_each(|channel| values[4 * channel * side * side + place * side + place] = 1.0);
        floats(name, &[3, 3, side, side], &values)
    };
    let twice: (&str, &[u64]) = ("strides", &[2, 2]);
    graph
        // Nothing but the weights tells the window.
        .message(1, &node("Conv", &["images", "one"], "by_weights", &[], &[]))
        .message(1, &ruled("Conv", &["by_weights", "three"], "upper", &[], "SAME_UPPER"))
        // Of one pixel of padding the first side gets it.
        .message(1, &ruled("Conv", &["upper", "two"], "lower", &[], "SAME_LOWER"))
        .message(1, &node("MaxPool", &["lower"], "pooled", &[("kernel_shape", &[1, 1])], &[]))
        // To twice the size, each pixel in the place of the kernel's first, and back.
        .message(1, &ruled("ConvTranspose", &["pooled", "first"], "wide", &[twice], "SAME_UPPER"))
        .message(1, &ruled("Conv", &["wide", "one"], last, &[twice], "VALID"))
        .message(5, &kernel("one", 1, 0))
        .message(5, &kernel("two", 2, 1))
        .message(5, &kernel("three", 3, 1))
        .message(5, &kernel("first", 3, 0))
}

/// How a depth network is exported. Its value at a pixel is the red of that pixel, from 0 to 1, times `gain`.
#[allow(dead_code, reason = "not every test that makes models makes depth networks")]
#[derive(Clone, Debug)]
pub(crate) struct DepthExport {
    /// What a red of 1 gives.
    pub(crate) gain: f32,
    /// What is added in each row of the image; nothing if empty.
    pub(crate) rows: Vec<f32>,
    /// Width and height of its input; any if `None`.
    pub(crate) size: Option<(usize, usize)>,
    /// Dimensions of 1 before the image in the output: 0 to 2.
    pub(crate) leading: usize,
    /// Planes of the output; one for depth.
    pub(crate) planes: usize,
    /// The input has a dimension for several images.
    pub(crate) several: bool,
    /// A second output, before the one named `depth`.
    pub(crate) confidence: bool,
}

impl Default for DepthExport {
    fn default() -> Self {
        Self { gain: 1.0, rows: Vec::new(), size: None, leading: 2, planes: 1, several: false, confidence: false }
    }
}

/// A network that takes depth for what is red, with the input and the outputs of exported depth networks.
#[allow(dead_code, reason = "not every test that makes models makes depth networks")]
pub(crate) fn depth(export: &DepthExport) -> Vec<u8> {
    let planes = export.planes;
    // The input is normalised by ImageNet's mean and standard deviation.
    let (gain, mean, deviation) = (export.gain, 0.485, 0.229);
    let weights = [gain * deviation, 0.0, 0.0].repeat(planes);
    let mut graph = Message::default().text(2, "red");
    let images = if export.several {
        graph = graph.message(1, &node("Squeeze", &["images", "first"], "image", &[], &[]));
        graph = graph.message(5, &tensor("first", &[1], INT64, &0_i64.to_le_bytes()));
        "image"
    } else {
        "images"
    };
    let whole = if export.leading == 2 { "depth" } else { "whole" };
    let convolved = if export.rows.is_empty() { whole } else { "convolved" };
    if !export.rows.is_empty() {
        graph = graph.message(1, &node("Add", &["convolved", "rows"], whole, &[], &[]));
        graph = graph.message(5, &floats("rows", &[1, 1, export.rows.len(), 1], &export.rows));
    }
    graph = graph
        .message(1, &node("Conv", &[images, "weights", "bias"], convolved, &[("kernel_shape", &[1, 1])], &[]))
        .message(5, &floats("weights", &[planes, 3, 1, 1], &weights))
        .message(5, &floats("bias", &[planes], &vec![gain * mean; planes]));
    if export.leading < 2 {
        let axes: Vec<u8> = [1_i64, 0].iter().take(2 - export.leading).flat_map(|axis| axis.to_le_bytes()).collect();
        graph = graph.message(1, &node("Squeeze", &["whole", "axes"], "depth", &[], &[]));
        graph = graph.message(5, &tensor("axes", &[2 - export.leading], INT64, &axes));
    }
    let sides = |(width, height): (usize, usize)| [Ok(height), Ok(width)];
    let sides = export.size.map_or([Err("height"), Err("width")], sides);
    let input = [Ok(1), Ok(3)].into_iter().chain(sides);
    let input: Vec<_> = export.several.then_some(Err("images")).into_iter().chain(input).collect();
    graph = graph.message(11, &value("images", &input));
    if export.confidence {
        graph = graph.message(1, &node("Identity", &["bias"], "conf", &[], &[]));
        graph = graph.message(12, &value("conf", &[Ok(planes)]));
    }
    let output: Vec<_> = [Ok(1), Ok(planes)].into_iter().take(export.leading).chain(sides).collect();
    graph = graph.message(12, &value("depth", &output));
    let model = Message::default().number(1, 8).text(2, "test").message(7, &graph);
    model.message(8, &Message::default().text(1, "").number(2, 13)).0
}

/// What a hostile model does.
#[allow(dead_code, reason = "not every test that makes models makes hostile ones")]
#[derive(Clone, Copy, Debug)]
pub(crate) enum Trick {
    /// A tensor of 2^40 zeros, made while the model is loaded.
    Zeros,
    /// As many, made from the image, so only when it is run.
    Expanded,
    /// Enough zeros to matter, many times over, none of them more than a limit of memory by itself.
    Pieces,
    /// A constant that claims 2^40 numbers and has none.
    Claimed,
    /// A loop that multiplies for about as long as one likes.
    Loop,
    /// An output of more than 2^26 numbers.
    Output,
}

/// A model that takes an image and never gives a list of boxes.
#[allow(dead_code, reason = "not every test that makes models makes hostile ones")]
pub(crate) fn hostile(trick: Trick) -> Vec<u8> {
    let whole = |name: &str, values: &[i64]| {
        let raw: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        tensor(name, &[values.len()], INT64, &raw)
    };
    let graph = Message::default().text(2, "hostile");
    let graph = match trick {
        Trick::Zeros => {
            graph.message(1, &node("ConstantOfShape", &["size"], "output0", &[], &[])).message(5, &whole("size", &[1 << 40]))
        }
        Trick::Expanded => {
            let expanded = node("Expand", &["images", "size"], "output0", &[], &[]);
            graph.message(1, &expanded).message(5, &whole("size", &[1 << 26, 3, SIDE as i64, SIDE as i64]))
        }
        Trick::Pieces => {
            // Each 64 MiB, and all of them needed at the end.
            let mut graph = graph.message(5, &whole("size", &[64, 3, 256, 256]));
            let names: Vec<String> = (0..100).map(|n| format!("piece{n}")).collect();
            graph = graph.message(1, &node("ReduceMax", &["images"], "most", &[], &[("keepdims", 1)]));
            for name in &names {
                graph = graph.message(1, &node("Expand", &["most", "size"], name, &[], &[]));
            }
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            graph.message(1, &node("Concat", &names, "output0", &[], &[("axis", 0)]))
        }
        Trick::Claimed => {
            let sum = node("Add", &["images", "claimed"], "output0", &[], &[]);
            graph.message(1, &sum).message(5, &tensor("claimed", &[1 << 20, 1 << 20], FLOAT, &[0; 64]))
        }
        Trick::Loop => {
            let body = Message::default()
                .text(2, "body")
                .message(1, &node("MatMul", &["state", "state"], "next", &[], &[]))
                .message(1, &node("Identity", &["go"], "on", &[], &[]))
                .message(11, &whole_value("turn"))
                .message(11, &truth("go"))
                .message(11, &value("state", &[Ok(1), Ok(3), Ok(SIDE), Ok(SIDE)]))
                .message(12, &truth("on"))
                .message(12, &value("next", &[Ok(1), Ok(3), Ok(SIDE), Ok(SIDE)]));
            let attribute = Message::default().text(1, "body").message(6, &body).number(20, 5);
            let looped = ["turns", "", "images"].iter().fold(Message::default(), |message, input| message.text(1, input));
            let looped = looped.text(2, "output0").text(3, "loop").text(4, "Loop").message(5, &attribute);
            graph.message(1, &looped).message(5, &tensor("turns", &[], INT64, &(1_i64 << 40).to_le_bytes()))
        }
        Trick::Output => {
            let expanded = node("Expand", &["images", "size"], "output0", &[], &[]);
            graph.message(1, &expanded).message(5, &whole("size", &[(1 << 26) / (3 * 64 * 64) + 1, 3, SIDE as i64, SIDE as i64]))
        }
    };
    let graph = graph.message(11, &value("images", &[Ok(1), Ok(3), Ok(SIDE), Ok(SIDE)])).message(12, &value("output0", &[]));
    let model = Message::default().number(1, 8).text(2, "test").message(7, &graph);
    model.message(8, &Message::default().text(1, "").number(2, 13)).0
}

/// `ValueInfoProto` of a truth value.
fn truth(name: &str) -> Message {
    scalar(name, 9)
}

/// `ValueInfoProto` of a whole number.
fn whole_value(name: &str) -> Message {
    scalar(name, INT64)
}

fn scalar(name: &str, data_type: u64) -> Message {
    let tensor = Message::default().number(1, data_type).message(2, &Message::default());
    Message::default().text(1, name).message(2, &Message::default().message(1, &tensor))
}
