//! Writes ONNX: the few protobuf messages a feed-forward graph needs.
//!
//! Field numbers are those of `onnx.proto` (opset 17, IR version 8).

/// A float or whole-number dimension; `None` is the batch.
pub type Dimension = Option<i64>;

const OPSET: u64 = 17;
const IR_VERSION: u64 = 8;
const FLOAT: u64 = 1;
const INT64: u64 = 7;

/// A graph under construction. Values are named by what made them.
#[derive(Debug, Default)]
pub struct Graph {
    nodes: Vec<Vec<u8>>,
    initializers: Vec<Vec<u8>>,
    inputs: Vec<Vec<u8>>,
    outputs: Vec<Vec<u8>>,
    count: usize,
}

/// An attribute of a node.
#[derive(Debug, Clone)]
pub enum Attribute {
    /// A whole number.
    Int(i64),
    /// Whole numbers.
    Ints(Vec<i64>),
}

impl Graph {
    /// Declares a float input; its name stands for its value.
    pub fn input(&mut self, name: &str, shape: &[Dimension]) -> String {
        self.inputs.push(value_info(name, shape));
        name.to_owned()
    }

    /// Declares `value` as the float output of that name.
    pub fn output(&mut self, name: &str, value: &str, shape: &[Dimension]) {
        self.named("Identity", &[value], name, &[]);
        self.outputs.push(value_info(name, shape));
    }

    /// A constant of floats.
    pub fn floats(&mut self, shape: &[usize], values: &[f32]) -> String {
        let raw = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.constant(FLOAT, shape, raw)
    }

    /// A constant list of whole numbers.
    pub fn integers(&mut self, values: &[i64]) -> String {
        let raw = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.constant(INT64, &[values.len()], raw)
    }

    /// The first output of an operator.
    pub fn node(&mut self, op: &str, inputs: &[&str]) -> String {
        self.node_with(op, inputs, &[])
    }

    /// The first output of an operator with attributes.
    pub fn node_with(
        &mut self,
        op: &str,
        inputs: &[&str],
        attributes: &[(&str, Attribute)],
    ) -> String {
        let name = self.fresh(op);
        self.named(op, inputs, &name, attributes);
        name
    }

    /// The bytes of the model.
    pub fn finish(self, name: &str) -> Vec<u8> {
        let mut graph = Message::default();
        for node in &self.nodes {
            graph.bytes(1, node);
        }
        graph.bytes(2, name.as_bytes());
        for constant in &self.initializers {
            graph.bytes(5, constant);
        }
        for input in &self.inputs {
            graph.bytes(11, input);
        }
        for output in &self.outputs {
            graph.bytes(12, output);
        }
        let mut opset = Message::default();
        opset.bytes(1, b"");
        opset.number(2, OPSET);
        let mut model = Message::default();
        model.number(1, IR_VERSION);
        model.bytes(2, b"shakedown");
        model.bytes(7, &graph.0);
        model.bytes(8, &opset.0);
        model.0
    }

    fn fresh(&mut self, of: &str) -> String {
        self.count += 1;
        format!("{}_{}", of.to_lowercase(), self.count)
    }

    fn constant(&mut self, element: u64, shape: &[usize], raw: Vec<u8>) -> String {
        let name = self.fresh("constant");
        let mut tensor = Message::default();
        for d in shape {
            tensor.number(1, *d as u64);
        }
        tensor.number(2, element);
        tensor.bytes(8, name.as_bytes());
        tensor.bytes(9, &raw);
        self.initializers.push(tensor.0);
        name
    }

    fn named(&mut self, op: &str, inputs: &[&str], output: &str, attributes: &[(&str, Attribute)]) {
        let mut node = Message::default();
        for input in inputs {
            node.bytes(1, input.as_bytes());
        }
        node.bytes(2, output.as_bytes());
        node.bytes(3, output.as_bytes());
        node.bytes(4, op.as_bytes());
        for (name, value) in attributes {
            let mut attribute = Message::default();
            attribute.bytes(1, name.as_bytes());
            match value {
                Attribute::Int(i) => {
                    attribute.number(3, *i as u64);
                    attribute.number(20, 2);
                }
                Attribute::Ints(list) => {
                    for i in list {
                        attribute.number(8, *i as u64);
                    }
                    attribute.number(20, 7);
                }
            }
            node.bytes(5, &attribute.0);
        }
        self.nodes.push(node.0);
    }
}

fn value_info(name: &str, dimensions: &[Dimension]) -> Vec<u8> {
    let mut shape = Message::default();
    for d in dimensions {
        let mut dimension = Message::default();
        match d {
            Some(n) => dimension.number(1, *n as u64),
            None => dimension.bytes(2, b"B"),
        }
        shape.bytes(1, &dimension.0);
    }
    let mut tensor = Message::default();
    tensor.number(1, FLOAT);
    tensor.bytes(2, &shape.0);
    let mut kind = Message::default();
    kind.bytes(1, &tensor.0);
    let mut info = Message::default();
    info.bytes(1, name.as_bytes());
    info.bytes(2, &kind.0);
    info.0
}

/// A protobuf message: fields one after the other.
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

    fn number(&mut self, field: u64, value: u64) {
        self.varint(field << 3);
        self.varint(value);
    }

    fn bytes(&mut self, field: u64, bytes: &[u8]) {
        self.varint(field << 3 | 2);
        self.varint(bytes.len() as u64);
        self.0.extend_from_slice(bytes);
    }
}
