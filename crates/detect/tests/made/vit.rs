//! A depth network of real size with random weights: a vision transformer "small" with patches of 14 pixels and a DPT head, as Depth
//! Anything V2-Small has them. It says nothing about an image, but takes as long as one that does.

use super::{INT64, Message, floats, node, tensor, value};

/// Width of a token, number of heads, number of blocks.
const WIDTH: usize = 384;
const HEADS: usize = 6;
const BLOCKS: usize = 12;
const PATCH: usize = 14;
/// Channels of the head.
const CHANNELS: usize = 64;

struct Graph {
    message: Message,
    /// Number of the last tensor or weight.
    last: usize,
    random: u32,
}

impl Graph {
    fn name(&mut self) -> String {
        self.last += 1;
        format!("t{}", self.last)
    }

    fn add(&mut self, message: (u64, Message)) {
        self.message = std::mem::take(&mut self.message).message(message.0, &message.1);
    }

    fn op(&mut self, operator: &str, inputs: &[&str], lists: &[(&str, &[u64])]) -> String {
        let name = self.name();
        self.add((1, node(operator, inputs, &name, lists, &[])));
        name
    }

    /// Random weights whose products keep their size.
    fn weights(&mut self, dims: &[usize], inputs: usize) -> String {
        let scale = 1.0 / (inputs as f32).sqrt();
        let values: Vec<f32> = (0..dims.iter().product::<usize>())
            .map(|_| {
                self.random = self.random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (self.random as f32 / u32::MAX as f32 - 0.5) * 2.0 * scale
            })
            .collect();
        let name = self.name();
        self.add((5, floats(&name, dims, &values)));
        name
    }

    fn constant(&mut self, values: &[f32]) -> String {
        let name = self.name();
        self.add((5, floats(&name, &[values.len()], values)));
        name
    }

    fn whole(&mut self, values: &[i64]) -> String {
        let raw: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        let name = self.name();
        self.add((5, tensor(&name, &[values.len()], INT64, &raw)));
        name
    }

    fn linear(&mut self, x: &str, from: usize, to: usize) -> String {
        let (weights, bias) = (self.weights(&[from, to], from), self.constant(&vec![0.01; to]));
        let product = self.op("MatMul", &[x, &weights], &[]);
        self.op("Add", &[&product, &bias], &[])
    }

    fn norm(&mut self, x: &str) -> String {
        let (scale, bias) = (self.constant(&[1.0; WIDTH]), self.constant(&[0.0; WIDTH]));
        self.op("LayerNormalization", &[x, &scale, &bias], &[])
    }

    fn conv(&mut self, x: &str, from: usize, to: usize, side: usize, stride: usize) -> String {
        let (weights, bias) = (self.weights(&[to, from, side, side], from * side * side), self.constant(&vec![0.01; to]));
        let (sides, strides, pad) = ([side as u64; 2], [stride as u64; 2], if side == 3 { 1 } else { 0 });
        let pads = [pad; 4];
        let lists: [(&str, &[u64]); 3] = [("kernel_shape", &sides), ("strides", &strides), ("pads", &pads)];
        self.op("Conv", &[x, &weights, &bias], &lists)
    }

    fn scaled(&mut self, x: &str, factor: f32) -> String {
        let scales = self.constant(&[1.0, 1.0, factor, factor]);
        self.op("Resize", &[x, "", &scales], &[])
    }

    fn heads(&mut self, x: &str, tokens: usize, order: &[u64]) -> String {
        let shape = self.whole(&[1, tokens as i64, HEADS as i64, (WIDTH / HEADS) as i64]);
        let split = self.op("Reshape", &[x, &shape], &[]);
        self.op("Transpose", &[&split], &[("perm", order)])
    }

    fn block(&mut self, x: &str, tokens: usize) -> String {
        let normed = self.norm(x);
        let [query, key, value] = [0; 3].map(|_| self.linear(&normed, WIDTH, WIDTH));
        let query = self.heads(&query, tokens, &[0, 2, 1, 3]);
        let key = self.heads(&key, tokens, &[0, 2, 3, 1]);
        let value = self.heads(&value, tokens, &[0, 2, 1, 3]);
        let scale = self.constant(&[0.125]);
        let scores = self.op("MatMul", &[&query, &key], &[]);
        let scores = self.op("Mul", &[&scores, &scale], &[]);
        let attention = self.op("Softmax", &[&scores], &[]);
        let seen = self.op("MatMul", &[&attention, &value], &[]);
        let seen = self.op("Transpose", &[&seen], &[("perm", &[0, 2, 1, 3])]);
        let shape = self.whole(&[1, tokens as i64, WIDTH as i64]);
        let seen = self.op("Reshape", &[&seen, &shape], &[]);
        let seen = self.linear(&seen, WIDTH, WIDTH);
        let x = self.op("Add", &[x, &seen], &[]);
        let normed = self.norm(&x);
        let wide = self.linear(&normed, WIDTH, 4 * WIDTH);
        // The Gaussian error linear unit.
        let (root, one, half) = (self.constant(&[std::f32::consts::FRAC_1_SQRT_2]), self.constant(&[1.0]), self.constant(&[0.5]));
        let inner = self.op("Mul", &[&wide, &root], &[]);
        let inner = self.op("Erf", &[&inner], &[]);
        let inner = self.op("Add", &[&inner, &one], &[]);
        let inner = self.op("Mul", &[&inner, &half], &[]);
        let active = self.op("Mul", &[&wide, &inner], &[]);
        let narrow = self.linear(&active, 4 * WIDTH, WIDTH);
        self.op("Add", &[&x, &narrow], &[])
    }

    fn residual(&mut self, x: &str) -> String {
        let mut y = x.to_owned();
        for _ in 0..2 {
            y = self.op("Relu", &[&y], &[]);
            y = self.conv(&y, CHANNELS, CHANNELS, 3, 1);
        }
        self.op("Add", &[x, &y], &[])
    }
}

/// The file, for an input of this width and height, multiples of 28.
pub(crate) fn vit((width, height): (usize, usize)) -> Vec<u8> {
    let (columns, rows) = (width / PATCH, height / PATCH);
    let tokens = columns * rows;
    let mut graph = Graph { message: Message::default().text(2, "vit"), last: 0, random: 1 };
    let patches = graph.conv("image", 3, WIDTH, PATCH, PATCH);
    let flat = graph.whole(&[1, WIDTH as i64, tokens as i64]);
    let patches = graph.op("Reshape", &[&patches, &flat], &[]);
    let mut x = graph.op("Transpose", &[&patches], &[("perm", &[0, 2, 1])]);
    let places = graph.weights(&[1, tokens, WIDTH], WIDTH);
    x = graph.op("Add", &[&x, &places], &[]);
    let mut levels = Vec::new();
    for block in 1..=BLOCKS {
        x = graph.block(&x, tokens);
        if block % 3 == 0 {
            let normed = graph.norm(&x);
            let turned = graph.op("Transpose", &[&normed], &[("perm", &[0, 2, 1])]);
            let shape = graph.whole(&[1, WIDTH as i64, rows as i64, columns as i64]);
            let image = graph.op("Reshape", &[&turned, &shape], &[]);
            let level = block / 3;
            let own = [48, 96, 192, 384][level - 1];
            let image = graph.conv(&image, WIDTH, own, 1, 1);
            let image = match level {
                1 => graph.scaled(&image, 4.0),
                2 => graph.scaled(&image, 2.0),
                3 => image,
                _ => graph.conv(&image, own, own, 3, 2),
            };
            levels.push(graph.conv(&image, own, CHANNELS, 3, 1));
        }
    }
    let mut path: Option<String> = None;
    while let Some(level) = levels.pop() {
        let level = graph.residual(&level);
        let joined = path.map_or(level.clone(), |path| graph.op("Add", &[&path, &level], &[]));
        let joined = graph.residual(&joined);
        path = Some(graph.scaled(&joined, 2.0));
    }
    let path = graph.conv(&path.unwrap(), CHANNELS, CHANNELS / 2, 3, 1);
    // From eight to fourteen pixels a patch.
    let sizes = graph.whole(&[1, (CHANNELS / 2) as i64, height as i64, width as i64]);
    let path = graph.op("Resize", &[&path, "", "", &sizes], &[]);
    let path = graph.conv(&path, CHANNELS / 2, 32, 3, 1);
    let path = graph.op("Relu", &[&path], &[]);
    let depth = graph.conv(&path, 32, 1, 1, 1);
    // Some number, and a positive one.
    let one = graph.constant(&[1.0]);
    let depth = graph.op("Abs", &[&depth], &[]);
    graph.add((1, node("Add", &[&depth, &one], "predicted_depth", &[], &[])));
    graph.add((11, value("image", &[Ok(1), Ok(3), Ok(height), Ok(width)])));
    graph.add((12, value("predicted_depth", &[Ok(1), Ok(1), Ok(height), Ok(width)])));
    let model = Message::default().number(1, 8).text(2, "test").message(7, &graph.message);
    model.message(8, &Message::default().text(1, "").number(2, 17)).0
}
