//! A graph of ONNX operators, built node by node.

use prost::Message;

use super::proto::{Attribute, FLOAT, Graph, INT64, Kind, Model, Named, Node, Operators, Shape, Side, Tensor, TensorKind};

/// The version of the file format and of the operators that are written.
const IR_VERSION: i64 = 8;
const OPERATORS: i64 = 13;

/// The value of an attribute.
pub(super) enum Value<'a> {
    Float(f32),
    Int(i64),
    Ints(&'a [i64]),
    Text(&'a str),
}

/// A graph under construction.
#[derive(Default)]
pub(super) struct Builder {
    graph: Graph,
    made: usize,
}

impl Builder {
    /// Adds an input or output of 32-bit floats.
    fn named(name: &str, sides: &[usize]) -> Named {
        let sides = sides.iter().map(|&size| Side { size: size as i64 }).collect();
        let tensor = TensorKind { element: FLOAT, shape: Some(Shape { sides }) };
        Named { name: name.to_owned(), kind: Some(Kind { tensor: Some(tensor) }) }
    }

    /// The graph's input.
    pub(super) fn input(&mut self, name: &str, sides: &[usize]) -> String {
        self.graph.inputs.push(Self::named(name, sides));
        name.to_owned()
    }

    /// A name for a value.
    fn fresh(&mut self) -> String {
        self.made += 1;
        format!("v{}", self.made)
    }

    /// A constant of floats.
    pub(super) fn floats(&mut self, sides: &[usize], values: &[f32]) -> String {
        self.constant(FLOAT, sides, values.iter().flat_map(|value| value.to_le_bytes()).collect())
    }

    /// A list of whole numbers.
    pub(super) fn ints(&mut self, values: &[i64]) -> String {
        self.constant(INT64, &[values.len()], values.iter().flat_map(|value| value.to_le_bytes()).collect())
    }

    fn constant(&mut self, kind: i32, sides: &[usize], raw: Vec<u8>) -> String {
        let name = self.fresh();
        self.keep(Tensor { sides: sides.iter().map(|&side| side as i64).collect(), kind, name: name.clone(), raw });
        name
    }

    /// A constant of another file.
    pub(super) fn keep(&mut self, tensor: Tensor) {
        self.graph.initializers.push(tensor);
    }

    /// A node of another file.
    pub(super) fn push(&mut self, node: Node) {
        self.graph.nodes.push(node);
    }

    /// Adds an operator with one output, whose name is returned.
    pub(super) fn node(&mut self, operator: &str, inputs: &[&str], attributes: &[(&str, Value<'_>)]) -> String {
        let name = self.fresh();
        self.node_to(operator, inputs, &[&name], attributes);
        name
    }

    /// Adds an operator with these outputs.
    pub(super) fn node_to(&mut self, operator: &str, inputs: &[&str], outputs: &[&str], attributes: &[(&str, Value<'_>)]) {
        let owned = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect();
        let attributes = attributes.iter().map(|(name, value)| attribute(name, value)).collect();
        self.push(Node { inputs: owned(inputs), outputs: owned(outputs), operator: operator.to_owned(), attributes });
    }

    /// The values of a tensor along its second dimension, cut into two.
    pub(super) fn split(&mut self, tensor: &str, first: usize, second: usize) -> [String; 2] {
        let lengths = self.ints(&[first as i64, second as i64]);
        let parts = [self.fresh(), self.fresh()];
        self.node_to("Split", &[tensor, &lengths], &[&parts[0], &parts[1]], &[("axis", Value::Int(1))]);
        parts
    }

    /// The file, with this value as its output.
    pub(super) fn file(mut self, output: &str, sides: &[usize]) -> Vec<u8> {
        "converted".clone_into(&mut self.graph.name);
        self.graph.outputs.push(Self::named(output, sides));
        let operators = vec![Operators { domain: String::new(), version: OPERATORS }];
        let model = Model { ir_version: IR_VERSION, producer: "spf model get".to_owned(), graph: Some(self.graph), operators };
        model.encode_to_vec()
    }
}

/// An attribute, with the number of its type.
fn attribute(name: &str, value: &Value<'_>) -> Attribute {
    let named = Attribute { name: name.to_owned(), ..Attribute::default() };
    match *value {
        Value::Float(float) => Attribute { float: Some(float), kind: 1, ..named },
        Value::Int(int) => Attribute { int: Some(int), kind: 2, ..named },
        Value::Text(text) => Attribute { text: Some(text.as_bytes().to_vec()), kind: 3, ..named },
        Value::Ints(ints) => Attribute { ints: ints.to_vec(), kind: 7, ..named },
    }
}
