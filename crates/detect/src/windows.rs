//! The windows of convolutions and poolings in an ONNX file, written out where the file leaves them to the operator's defaults.
//!
//! Strides, dilations and pads may be left out, and their number is then that of the kernel's sides; the kernel's shape may be left
//! out too, and is then that of the weights; `auto_pad` tells the pads by a rule. The engine (`rten` 0.24) knows the defaults only of
//! convolutions with a `kernel_shape`, pads by `SAME_LOWER` as by `SAME_UPPER`, and of transposed convolutions mixes up the sides.
//! Such files are valid and common, so they are rewritten before the engine reads them ([ONNX
//! operators](https://onnx.ai/onnx/operators/)). Everything else in the file stays as it is, byte for byte.

use std::collections::BTreeMap;

use crate::error::NetworkError;

/// Fields of the messages `ModelProto`, `GraphProto`, `NodeProto`, `AttributeProto` and `TensorProto`.
mod field {
    pub(super) const GRAPH: u64 = 7;
    pub(super) const GRAPH_NODE: u64 = 1;
    pub(super) const GRAPH_INITIALIZER: u64 = 5;
    pub(super) const NODE_INPUT: u64 = 1;
    pub(super) const NODE_OUTPUT: u64 = 2;
    pub(super) const NODE_OPERATOR: u64 = 4;
    pub(super) const NODE_ATTRIBUTE: u64 = 5;
    pub(super) const ATTRIBUTE_NAME: u64 = 1;
    pub(super) const ATTRIBUTE_TEXT: u64 = 4;
    pub(super) const ATTRIBUTE_TENSOR: u64 = 5;
    pub(super) const ATTRIBUTE_GRAPH: u64 = 6;
    pub(super) const ATTRIBUTE_NUMBERS: u64 = 8;
    pub(super) const ATTRIBUTE_TYPE: u64 = 20;
    pub(super) const TENSOR_SIDE: u64 = 1;
    pub(super) const TENSOR_NAME: u64 = 8;
}

/// The type of an attribute that is a list of whole numbers.
const NUMBERS: u64 = 7;
/// Greatest depth of graphs inside of operators.
const DEPTH: usize = 8;
/// Most sides of a tensor that matters here: images and channels, and two sides of a window.
const MOST_SIDES: usize = 8;
/// Largest number of an attribute that is computed with.
const MOST: i64 = 1 << 24;

/// Why a file is not rewritten.
enum Stop {
    /// It is no valid file, which the engine will say.
    Malformed,
    /// What it asks for cannot be written out.
    Unfit(String),
}

/// A model whose convolutions and poolings say all that the engine needs; one that says it already is returned as it is.
///
/// # Errors
/// [`NetworkError::Unfit`] for `SAME_LOWER` where its pads depend on the size of the image.
pub fn complete(model: Vec<u8>) -> Result<Vec<u8>, NetworkError> {
    let changed = rebuilt(&model, |found| match found.content {
        Content::Bytes(bytes) if found.number == field::GRAPH => graph(bytes, None, DEPTH),
        _ => Ok(None),
    });
    match changed {
        Ok(Some(changed)) => Ok(changed),
        Ok(None) | Err(Stop::Malformed) => Ok(model),
        Err(Stop::Unfit(why)) => Err(NetworkError::Unfit(why)),
    }
}

/// The content of a field.
#[derive(Clone, Copy)]
enum Content<'a> {
    Number(u64),
    Bytes(&'a [u8]),
    /// Of four or eight bytes.
    Other,
}

/// A field of a message: `start..end` are the bytes that hold it.
struct Field<'a> {
    number: u64,
    content: Content<'a>,
    start: usize,
    end: usize,
}

/// The fields of a message.
struct Fields<'a> {
    message: &'a [u8],
    at: usize,
}

impl<'a> Fields<'a> {
    fn of(message: &'a [u8]) -> Self {
        Self { message, at: 0 }
    }

    fn number(&mut self) -> Option<u64> {
        let mut value = 0_u64;
        for shift in (0..64).step_by(7) {
            let byte = *self.message.get(self.at)?;
            self.at += 1;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(value);
            }
        }
        None
    }

    fn bytes(&mut self, length: u64) -> Option<&'a [u8]> {
        let end = self.at.checked_add(usize::try_from(length).ok()?)?;
        let bytes = self.message.get(self.at..end)?;
        self.at = end;
        Some(bytes)
    }

    fn field(&mut self) -> Option<Field<'a>> {
        let start = self.at;
        let key = self.number()?;
        let content = match key & 7 {
            0 => Content::Number(self.number()?),
            1 => self.bytes(8).map(|_| Content::Other)?,
            2 => {
                let length = self.number()?;
                Content::Bytes(self.bytes(length)?)
            }
            5 => self.bytes(4).map(|_| Content::Other)?,
            _ => return None,
        };
        Some(Field { number: key >> 3, content, start, end: self.at })
    }
}

impl<'a> Iterator for Fields<'a> {
    type Item = Result<Field<'a>, Stop>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.at >= self.message.len() {
            return None;
        }
        let found = self.field();
        if found.is_none() {
            self.at = self.message.len();
        }
        Some(found.ok_or(Stop::Malformed))
    }
}

/// A message whose fields `change` replaces by other bytes; `None` if it replaces none.
fn rebuilt<'a>(
    message: &'a [u8],
    mut change: impl FnMut(&Field<'a>) -> Result<Option<Vec<u8>>, Stop>,
) -> Result<Option<Vec<u8>>, Stop> {
    let (mut out, mut copied) = (None, 0);
    for found in Fields::of(message) {
        let found = found?;
        let Some(new) = change(&found)? else { continue };
        let out: &mut Vec<u8> = out.get_or_insert_default();
        out.extend_from_slice(&message[copied..found.start]);
        put_bytes(out, found.number, &new);
        copied = found.end;
    }
    if let Some(out) = &mut out {
        out.extend_from_slice(&message[copied..]);
    }
    Ok(out)
}

fn put(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

fn put_bytes(out: &mut Vec<u8>, number: u64, bytes: &[u8]) {
    put(out, number << 3 | 2);
    put(out, bytes.len() as u64);
    out.extend_from_slice(bytes);
}

fn put_number(out: &mut Vec<u8>, number: u64, value: u64) {
    put(out, number << 3);
    put(out, value);
}

/// The sides of the constants of a graph, by name, and the graph around it.
struct Constants<'a> {
    sides: BTreeMap<&'a [u8], Vec<i64>>,
    around: Option<&'a Self>,
}

impl Constants<'_> {
    fn get(&self, name: &[u8]) -> Option<&Vec<i64>> {
        self.sides.get(name).or_else(|| self.around?.get(name))
    }
}

/// A graph, rewritten.
fn graph<'a>(message: &'a [u8], around: Option<&Constants<'a>>, depth: usize) -> Result<Option<Vec<u8>>, Stop> {
    let depth = depth.checked_sub(1).ok_or(Stop::Malformed)?;
    let mut constants = Constants { sides: BTreeMap::new(), around };
    for found in Fields::of(message) {
        let found = found?;
        match (found.number, found.content) {
            (field::GRAPH_INITIALIZER, Content::Bytes(tensor)) => {
                let (name, sides) = read_tensor(tensor)?;
                constants.sides.insert(name, sides);
            }
            (field::GRAPH_NODE, Content::Bytes(node)) => {
                let node = Node::read(node)?;
                let sides = match (node.operator, node.inputs.first()) {
                    (b"Constant", _) => {
                        node.tensor("value").map(|tensor| read_tensor(tensor).map(|(_, sides)| sides)).transpose()?
                    }
                    // Weights of a quantised network.
                    (b"DequantizeLinear" | b"Identity" | b"Cast", Some(from)) => constants.get(from).cloned(),
                    _ => None,
                };
                if let Some((output, sides)) = node.output.zip(sides) {
                    constants.sides.insert(output, sides);
                }
            }
            _ => {}
        }
    }
    rebuilt(message, |found| match found.content {
        Content::Bytes(bytes) if found.number == field::GRAPH_NODE => node(bytes, &constants, depth),
        _ => Ok(None),
    })
}

/// Name and sides of a tensor; sides that cannot be those of weights are left out.
fn read_tensor(message: &[u8]) -> Result<(&[u8], Vec<i64>), Stop> {
    let (mut name, mut sides) = (&[][..], Vec::new());
    for found in Fields::of(message) {
        match found? {
            Field { number: field::TENSOR_NAME, content: Content::Bytes(bytes), .. } => name = bytes,
            Field { number: field::TENSOR_SIDE, content, .. } => numbers(content, &mut sides, MOST_SIDES)?,
            _ => {}
        }
    }
    Ok((name, sides))
}

/// Adds the whole numbers of a field, which has one or, packed, many; at most `most` in all.
fn numbers(content: Content<'_>, to: &mut Vec<i64>, most: usize) -> Result<(), Stop> {
    let mut add = |value: u64| {
        if to.len() < most {
            to.push(value as i64);
        }
    };
    match content {
        Content::Number(value) => add(value),
        Content::Bytes(packed) => {
            let mut values = Fields::of(packed);
            while values.at < packed.len() {
                add(values.number().ok_or(Stop::Malformed)?);
            }
        }
        Content::Other => return Err(Stop::Malformed),
    }
    Ok(())
}

/// An attribute.
#[derive(Default)]
struct Attribute<'a> {
    name: &'a [u8],
    text: &'a [u8],
    tensor: Option<&'a [u8]>,
    numbers: Vec<i64>,
}

impl<'a> Attribute<'a> {
    fn read(message: &'a [u8]) -> Result<Self, Stop> {
        let mut read = Self::default();
        for found in Fields::of(message) {
            let found = found?;
            match (found.number, found.content) {
                (field::ATTRIBUTE_NAME, Content::Bytes(bytes)) => read.name = bytes,
                (field::ATTRIBUTE_TEXT, Content::Bytes(bytes)) => read.text = bytes,
                (field::ATTRIBUTE_TENSOR, Content::Bytes(bytes)) => read.tensor = Some(bytes),
                (field::ATTRIBUTE_NUMBERS, content) => numbers(content, &mut read.numbers, 2 * MOST_SIDES)?,
                _ => {}
            }
        }
        Ok(read)
    }
}

/// An operator of a graph.
#[derive(Default)]
struct Node<'a> {
    operator: &'a [u8],
    inputs: Vec<&'a [u8]>,
    output: Option<&'a [u8]>,
    attributes: Vec<Attribute<'a>>,
}

impl<'a> Node<'a> {
    /// Reads the first inputs of an operator, its first output and its attributes.
    fn read(message: &'a [u8]) -> Result<Self, Stop> {
        let mut node = Self::default();
        for found in Fields::of(message) {
            let Field { number, content: Content::Bytes(bytes), .. } = found? else { continue };
            match number {
                field::NODE_INPUT if node.inputs.len() < 2 => node.inputs.push(bytes),
                field::NODE_OUTPUT if node.output.is_none() => node.output = Some(bytes),
                field::NODE_OPERATOR => node.operator = bytes,
                field::NODE_ATTRIBUTE => node.attributes.push(Attribute::read(bytes)?),
                _ => {}
            }
        }
        Ok(node)
    }

    fn attribute(&self, name: &str) -> Option<&Attribute<'a>> {
        self.attributes.iter().find(|attribute| attribute.name == name.as_bytes())
    }

    fn tensor(&self, name: &str) -> Option<&'a [u8]> {
        self.attribute(name)?.tensor
    }

    fn numbers(&self, name: &str) -> Option<&Vec<i64>> {
        self.attribute(name).map(|attribute| &attribute.numbers)
    }

    /// What to write out, and whether its pads take the place of `auto_pad`.
    fn window(&self, constants: &Constants<'_>) -> Result<Option<Window>, Stop> {
        let is_convolution = match self.operator {
            b"Conv" | b"ConvInteger" | b"ConvTranspose" => true,
            b"MaxPool" | b"AveragePool" | b"LpPool" => false,
            _ => return Ok(None),
        };
        let weights = || constants.get(self.inputs.get(1)?)?.get(2..);
        let own = self.numbers("kernel_shape");
        let kernel: Option<&[i64]> = own.map(Vec::as_slice).or_else(|| weights().filter(|_| is_convolution));
        let lists = ["strides", "dilations"].map(|name| self.numbers(name));
        let sides = kernel.map(<[i64]>::len).or(lists.into_iter().flatten().map(Vec::len).next());
        let sides = sides.or_else(|| self.numbers("pads").map(|pads| pads.len() / 2)).unwrap_or(2);
        let [strides, dilations] = lists.map(|list| list.cloned().unwrap_or_else(|| vec![1; sides]));
        let mut window = Window::default();
        let rule = self.attribute("auto_pad").map_or(&b"NOTSET"[..], |attribute| attribute.text);
        let is_same = matches!(rule, b"SAME_UPPER" | b"SAME_LOWER");
        if own.is_none() || !is_convolution {
            window.add("strides", lists[0], &strides);
        }
        if own.is_none() && is_convolution {
            window.add("dilations", lists[1], &dilations);
            if !is_same {
                window.add("pads", self.numbers("pads"), &vec![0; 2 * sides]);
            }
        }
        let transposed = self.operator == b"ConvTranspose";
        if rule == b"SAME_LOWER" || (transposed && is_same) {
            let known = kernel.filter(|kernel| kernel.len() == sides && strides.len() == sides && dilations.len() == sides);
            let extra = self.numbers("output_padding").filter(|_| transposed);
            let Some(kernel) = known else { return Err(self.unknown(rule)) };
            let mut pads = vec![0; 2 * sides];
            let mut is_even = true;
            for side in 0..sides {
                let (size, stride, dilation) = (kernel[side], strides[side], dilations[side]);
                let extra = extra.and_then(|extra| extra.get(side)).copied().unwrap_or(0);
                if ![size, stride, dilation].iter().all(|n| (1..MOST).contains(n)) || !(0..MOST).contains(&extra) {
                    return Err(Stop::Malformed);
                }
                let reach = (size - 1) * dilation;
                let all = match (transposed, reach, stride) {
                    (true, ..) => reach + 1 + extra - stride,
                    // A kernel of one pixel never reaches over the edge.
                    (false, 0, _) => 0,
                    (false, _, 1) => reach,
                    _ => return Err(self.unknown(rule)),
                };
                // The engine refuses a window smaller than its stride.
                let all = all.max(0);
                let (less, more) = (all / 2, all - all / 2);
                (pads[side], pads[sides + side]) = if rule == b"SAME_LOWER" { (more, less) } else { (less, more) };
                is_even &= less == more;
            }
            if transposed || !is_even {
                window.add("pads", None, &pads);
                window.replaces_rule = true;
            }
        }
        Ok((!window.added.is_empty()).then_some(window))
    }

    /// The error about pads that depend on the size of the image.
    fn unknown(&self, rule: &[u8]) -> Stop {
        let shown =
            |bytes: &[u8]| -> String { String::from_utf8_lossy(bytes).chars().filter(|c| !c.is_control()).take(60).collect() };
        Stop::Unfit(format!(
            "the {} that makes `{}` pads by {} and a stride, so its pads depend on the size of the image: export it with explicit \
             pads, or with SAME_UPPER",
            shown(self.operator),
            shown(self.output.unwrap_or_default()),
            shown(rule)
        ))
    }
}

/// Attributes to be written out.
#[derive(Default)]
struct Window {
    added: Vec<(&'static str, Vec<i64>)>,
    /// The pads are those of `auto_pad`, which is left out.
    replaces_rule: bool,
}

impl Window {
    /// Adds a list, unless there is one.
    fn add(&mut self, name: &'static str, given: Option<&Vec<i64>>, values: &[i64]) {
        if given.is_none() {
            self.added.push((name, values.to_vec()));
        }
    }
}

/// An operator, rewritten: its window, and the graphs inside of it.
fn node<'a>(message: &'a [u8], constants: &Constants<'a>, depth: usize) -> Result<Option<Vec<u8>>, Stop> {
    let Some(window) = Node::read(message)?.window(constants)? else {
        return rebuilt(message, |found| match found.content {
            Content::Bytes(attribute) if found.number == field::NODE_ATTRIBUTE => {
                rebuilt(attribute, |found| match found.content {
                    Content::Bytes(inner) if found.number == field::ATTRIBUTE_GRAPH => graph(inner, Some(constants), depth),
                    _ => Ok(None),
                })
            }
            _ => Ok(None),
        });
    };
    let mut out = Vec::with_capacity(message.len() + 64);
    for found in Fields::of(message) {
        let found = found?;
        if let (field::NODE_ATTRIBUTE, Content::Bytes(bytes), true) = (found.number, found.content, window.replaces_rule)
            && matches!(Attribute::read(bytes)?.name, b"auto_pad" | b"pads")
        {
            continue;
        }
        out.extend_from_slice(&message[found.start..found.end]);
    }
    for (name, values) in &window.added {
        let mut attribute = Vec::new();
        put_bytes(&mut attribute, field::ATTRIBUTE_NAME, name.as_bytes());
        values.iter().for_each(|value| put_number(&mut attribute, field::ATTRIBUTE_NUMBERS, *value as u64));
        put_number(&mut attribute, field::ATTRIBUTE_TYPE, NUMBERS);
        put_bytes(&mut out, field::NODE_ATTRIBUTE, &attribute);
    }
    Ok(Some(out))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn message(fields: &[(u64, &[u8])]) -> Vec<u8> {
        let mut out = Vec::new();
        fields.iter().for_each(|(number, bytes)| put_bytes(&mut out, *number, bytes));
        out
    }

    fn list(name: &str, values: &[u64]) -> Vec<u8> {
        let mut out = message(&[(field::ATTRIBUTE_NAME, name.as_bytes())]);
        values.iter().for_each(|value| put_number(&mut out, field::ATTRIBUTE_NUMBERS, *value));
        put_number(&mut out, field::ATTRIBUTE_TYPE, NUMBERS);
        out
    }

    fn rule(value: &str) -> Vec<u8> {
        message(&[(field::ATTRIBUTE_NAME, b"auto_pad"), (field::ATTRIBUTE_TEXT, value.as_bytes())])
    }

    /// A model of one operator on weights `w` of 8×3×5×3.
    fn model(operator: &str, attributes: &[Vec<u8>]) -> Vec<u8> {
        let mut weights = message(&[(field::TENSOR_NAME, b"w")]);
        [8, 3, 5, 3].into_iter().for_each(|side| put_number(&mut weights, field::TENSOR_SIDE, side));
        let mut node = message(&[
            (field::NODE_INPUT, b"x"),
            (field::NODE_INPUT, b"w"),
            (field::NODE_OUTPUT, b"y"),
            (field::NODE_OPERATOR, operator.as_bytes()),
        ]);
        attributes.iter().for_each(|attribute| put_bytes(&mut node, field::NODE_ATTRIBUTE, attribute));
        let graph = message(&[(field::GRAPH_NODE, &node), (field::GRAPH_INITIALIZER, &weights)]);
        message(&[(14, b"metadata"), (field::GRAPH, &graph), (8, b"version")])
    }

    /// The lists of the operator of a completed model, by name, and whether `auto_pad` is left.
    fn completed(operator: &str, attributes: &[Vec<u8>]) -> (BTreeMap<String, Vec<i64>>, bool) {
        let whole = complete(model(operator, attributes)).unwrap_or_else(|error| panic!("{error}"));
        let bytes = |message: &[u8], number: u64| -> Vec<u8> {
            let found = Fields::of(message).map(|found| found.unwrap_or_else(|_| panic!("malformed")));
            let mut found = found.filter(|found| found.number == number);
            match found.next().map(|found| found.content) {
                Some(Content::Bytes(bytes)) => bytes.to_vec(),
                _ => panic!("no field {number}"),
            }
        };
        assert_eq!((bytes(&whole, 14), bytes(&whole, 8)), (b"metadata".to_vec(), b"version".to_vec()));
        let node = bytes(&bytes(&whole, field::GRAPH), field::GRAPH_NODE);
        let Ok(node) = Node::read(&node) else { panic!("malformed") };
        let lists = node.attributes.iter().filter(|attribute| attribute.name != b"auto_pad");
        let lists = lists.map(|attribute| (String::from_utf8_lossy(attribute.name).into_owned(), attribute.numbers.clone()));
        (lists.collect(), node.attribute("auto_pad").is_some())
    }

    fn lists(of: &[(&str, &[i64])]) -> BTreeMap<String, Vec<i64>> {
        of.iter().map(|(name, values)| ((*name).to_owned(), values.to_vec())).collect()
    }

    #[test]
    fn what_a_file_leaves_to_defaults_is_written_out() {
        let ones: &[i64] = &[1, 1];
        let all = [("strides", ones), ("dilations", ones), ("pads", &[0; 4])];
        assert_eq!(completed("Conv", &[]), (lists(&all), false));
        // The engine knows the defaults of these.
        let kernel = list("kernel_shape", &[5, 3]);
        let given = model("Conv", std::slice::from_ref(&kernel));
        assert_eq!(complete(given.clone()).unwrap(), given);
        assert_eq!(completed("Conv", &[rule("SAME_UPPER")]), (lists(&all[..2]), true));
        assert_eq!(completed("Conv", &[rule("VALID")]), (lists(&all), true));
        let strides = list("strides", &[2, 2]);
        assert_eq!(completed("Conv", &[strides]).0, lists(&[("strides", &[2, 2]), all[1], all[2]]));
        assert_eq!(completed("MaxPool", &[kernel]).0, lists(&[("kernel_shape", &[5, 3]), all[0]]));
        let other = model("Relu", &[]);
        assert_eq!(complete(other.clone()).unwrap(), other);
    }

    #[test]
    fn pads_by_a_rule_are_those_of_the_operators_definition() {
        let pads = |operator, attributes: &[Vec<u8>]| {
            let (lists, is_left) = completed(operator, attributes);
            (lists.get("pads").cloned(), is_left)
        };
        // Both sides of the kernel are odd, so the pads are the same on both.
        assert_eq!(pads("Conv", &[rule("SAME_LOWER")]), (None, true));
        let even = list("kernel_shape", &[2, 4]);
        assert_eq!(pads("Conv", &[rule("SAME_LOWER"), even.clone()]), (Some(vec![1, 2, 0, 1]), false));
        assert_eq!(pads("MaxPool", &[rule("SAME_LOWER"), even.clone()]), (Some(vec![1, 2, 0, 1]), false));
        assert_eq!(pads("Conv", &[rule("SAME_LOWER"), even, list("dilations", &[3, 1])]), (Some(vec![2, 2, 1, 1]), false));
        // in·2 = (in − 1)·2 + 5 − 3, and − 1.
        let stride = list("strides", &[2, 2]);
        assert_eq!(pads("ConvTranspose", &[rule("SAME_UPPER"), stride.clone()]), (Some(vec![1, 0, 2, 1]), false));
        assert_eq!(pads("ConvTranspose", &[rule("SAME_LOWER"), stride.clone()]), (Some(vec![2, 1, 1, 0]), false));
        let refused = complete(model("Conv", &[rule("SAME_LOWER"), stride.clone()])).unwrap_err().to_string();
        assert!(refused.contains("the Conv that makes `y` pads by SAME_LOWER") && refused.contains("explicit pads"), "{refused}");
        let one = list("kernel_shape", &[1, 1]);
        assert_eq!(pads("Conv", &[rule("SAME_LOWER"), stride, one]), (None, true));
    }

    #[test]
    fn graphs_in_operators_are_rewritten_as_well() {
        let whole = model("Conv", &[]);
        let inner = Fields::of(&whole).flatten().find(|found| found.number == field::GRAPH);
        let Some(Field { content: Content::Bytes(inner), .. }) = inner else { panic!("a graph") };
        // The weights stay in the outer graph.
        let node = Fields::of(inner).flatten().find(|found| found.number == field::GRAPH_NODE);
        let body = node.map(|node| inner[node.start..node.end].to_vec()).unwrap();
        let attribute = message(&[(field::ATTRIBUTE_NAME, b"body"), (field::ATTRIBUTE_GRAPH, &body)]);
        let looped = message(&[(field::NODE_OPERATOR, b"Loop"), (field::NODE_ATTRIBUTE, &attribute)]);
        let weights = inner[body.len()..].to_vec();
        let graph = [message(&[(field::GRAPH_NODE, &looped)]), weights].concat();
        let written = complete(message(&[(field::GRAPH, &graph)])).unwrap();
        let has = |text: &[u8]| written.windows(text.len()).any(|part| part == text);
        assert!(has(b"strides") && has(b"dilations") && has(b"pads"));
    }

    proptest! {
        #[test]
        fn any_bytes_are_a_model_or_left_as_they_are(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            drop(complete(bytes.clone()));
            let graph = message(&[(field::GRAPH, &message(&[(field::GRAPH_NODE, &bytes)]))]);
            drop(complete(graph));
        }

        #[test]
        fn changed_bytes_never_panic(changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6)) {
            let mut bytes = model("ConvTranspose", &[rule("SAME_LOWER"), list("strides", &[2, 2]), list("output_padding", &[1, 1])]);
            for (at, byte) in changes {
                let at = at.index(bytes.len());
                bytes[at] = byte;
            }
            drop(complete(bytes));
        }

        /// What was completed needs nothing more.
        #[test]
        fn completing_twice_is_completing_once(
            operator in prop::sample::select(vec!["Conv", "ConvInteger", "ConvTranspose", "MaxPool", "AveragePool"]),
            kernel in prop::option::of(prop::collection::vec(1_u64..6, 2)),
            strides in prop::option::of(prop::collection::vec(1_u64..4, 2)),
            named in prop::sample::select(vec!["", "NOTSET", "VALID", "SAME_UPPER", "SAME_LOWER"]),
        ) {
            let mut attributes: Vec<Vec<u8>> = Vec::new();
            attributes.extend(kernel.as_ref().map(|kernel| list("kernel_shape", kernel)));
            attributes.extend(strides.as_ref().map(|strides| list("strides", strides)));
            attributes.extend((!named.is_empty()).then(|| rule(named)));
            if let Ok(once) = complete(model(operator, &attributes)) {
                prop_assert_eq!(complete(once.clone()).unwrap(), once);
            }
        }
    }
}
