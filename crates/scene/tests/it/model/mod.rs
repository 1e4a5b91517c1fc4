//! Small glTF files made by hand.
#![allow(dead_code, reason = "each test file uses a part of it")]
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use serde_json::{Value, json};
use spf_scene::{Object, Scene, SceneError};

pub(crate) const FLOAT: u32 = 5126;
pub(crate) const SHORT: u32 = 5123;
pub(crate) const SIGNED_SHORT: u32 = 5122;
pub(crate) const WORD: u32 = 5125;
pub(crate) const BYTE: u32 = 5121;

/// A file under construction: its description, and the one buffer.
#[derive(Clone)]
pub(crate) struct Model {
    pub(crate) json: Value,
    pub(crate) bin: Vec<u8>,
}

impl Model {
    pub(crate) fn new() -> Self {
        let json = json!({
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}], "nodes": [], "meshes": [], "accessors": [],
            "bufferViews": [], "buffers": [{"byteLength": 0}],
        });
        Self { json, bin: Vec::new() }
    }

    /// Appends to a list of the description; returns the index.
    pub(crate) fn push(&mut self, list: &str, value: Value) -> usize {
        let root = self.json.as_object_mut().unwrap();
        let list = root.entry(list).or_insert_with(|| json!([])).as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    }

    pub(crate) fn view(&mut self, bytes: &[u8]) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let offset = self.bin.len();
        self.bin.extend(bytes);
        self.json["buffers"][0]["byteLength"] = json!(self.bin.len());
        self.push("bufferViews", json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}))
    }

    pub(crate) fn accessor(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize) -> usize {
        let view = self.view(bytes);
        self.push("accessors", json!({"bufferView": view, "componentType": component, "type": kind, "count": count}))
    }

    pub(crate) fn floats<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = values.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(&bytes, FLOAT, ["", "SCALAR", "VEC2", "VEC3", "VEC4"][N], values.len())
    }

    pub(crate) fn indices(&mut self, values: &[u32]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(&bytes, WORD, "SCALAR", values.len())
    }

    /// A mesh of one primitive.
    pub(crate) fn mesh(&mut self, primitive: Value) -> usize {
        self.push("meshes", json!({"primitives": [primitive]}))
    }

    /// A box `width` (x) × `height` (y, up) × `depth` (z) that stands on its origin, with shared vertices.
    pub(crate) fn block(&mut self, width: f32, height: f32, depth: f32) -> usize {
        let corner = |i: u32| {
            let pick = |bit: u32, low: f32, high: f32| if i & bit == 0 { low } else { high };
            [pick(1, -0.5 * width, 0.5 * width), pick(2, 0.0, height), pick(4, -0.5 * depth, 0.5 * depth)]
        };
        let positions = self.floats(&[0, 1, 2, 3, 4, 5, 6, 7].map(corner));
        let faces: [[u32; 4]; 6] = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let indices: Vec<u32> = faces.iter().flat_map(|f| [f[0], f[1], f[2], f[0], f[2], f[3]]).collect();
        let indices = self.indices(&indices);
        self.mesh(json!({"attributes": {"POSITION": positions}, "indices": indices}))
    }

    /// A level square of this side about the origin, with texture coordinates from 0 to `repeats`.
    pub(crate) fn floor(&mut self, side: f32, repeats: f32, material: Option<usize>) -> usize {
        let (s, r) = (0.5 * side, repeats);
        let positions = self.floats(&[[-s, 0.0, s], [s, 0.0, s], [s, 0.0, -s], [-s, 0.0, -s]]);
        let uv = self.floats(&[[0.0, r], [r, r], [r, 0.0], [0.0, 0.0]]);
        let indices = self.indices(&[0, 1, 2, 0, 2, 3]);
        let mut primitive = json!({"attributes": {"POSITION": positions, "TEXCOORD_0": uv}, "indices": indices});
        if let Some(material) = material {
            primitive["material"] = json!(material);
        }
        self.mesh(primitive)
    }

    /// A material of one colour.
    pub(crate) fn paint(&mut self, colour: [f32; 4]) -> usize {
        let pbr = json!({"baseColorFactor": colour, "metallicFactor": 0.0, "roughnessFactor": 1.0});
        self.push("materials", json!({"pbrMetallicRoughness": pbr}))
    }

    /// A material with an image from the buffer.
    pub(crate) fn image(&mut self, png: &[u8]) -> usize {
        let view = self.view(png);
        let image = self.push("images", json!({"bufferView": view, "mimeType": "image/png"}));
        let texture = self.push("textures", json!({"source": image}));
        let pbr = json!({"baseColorTexture": {"index": texture}, "metallicFactor": 0.0, "roughnessFactor": 1.0});
        self.push("materials", json!({"pbrMetallicRoughness": pbr}))
    }

    /// A node without a parent.
    pub(crate) fn node(&mut self, node: Value) -> usize {
        let index = self.push("nodes", node);
        self.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(index));
        index
    }

    pub(crate) fn glb(&self) -> Vec<u8> {
        let mut text = self.json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut bin = self.bin.clone();
        bin.resize(bin.len().next_multiple_of(4), 0);
        let mut file = b"glTF".to_vec();
        for word in [2, 12 + 8 + text.len() + 8 + bin.len(), text.len()] {
            file.extend((word as u32).to_le_bytes());
        }
        file.extend(b"JSON");
        file.extend(text);
        file.extend((bin.len() as u32).to_le_bytes());
        file.extend(b"BIN\0");
        file.extend(bin);
        file
    }

    pub(crate) fn load(&self) -> Result<Scene, SceneError> {
        Scene::parse_model(&self.glb(), "test.glb")
    }

    pub(crate) fn scene(&self) -> Scene {
        self.load().unwrap_or_else(|e| panic!("{e}"))
    }

    /// Why the file is rejected.
    pub(crate) fn refusal(&self) -> String {
        match self.load() {
            Err(e @ SceneError::Model { .. }) => e.to_string(),
            other => panic!("expected a refusal, got {other:?}"),
        }
    }
}

/// A yard with everything that the reader supports: floor with an image, car, gate with an opening, vertex colours, a
/// start.
pub(crate) fn yard() -> Model {
    let mut model = Model::new();
    let stones = model.image(&png(4, 4, |x, y| if (x + y) % 2 == 0 { [150, 140, 130, 255] } else { [90, 85, 80, 255] }));
    let floor = model.floor(60.0, 15.0, Some(stones));
    model.node(json!({"name": "Floor", "mesh": floor}));
    let car = model.block(1.8, 1.4, 4.2);
    let red = model.paint([0.5, 0.02, 0.02, 1.0]);
    model.json["meshes"][car]["primitives"][0]["material"] = json!(red);
    model.node(json!({"name": "Car.001", "mesh": car, "translation": [5.0, 0.0, -12.0], "rotation": [0.0, 0.383, 0.0, 0.924]}));
    let post = model.block(0.4, 4.0, 0.4);
    let hole = model.block(3.0, 3.5, 0.01);
    let left = model.push("nodes", json!({"mesh": post, "translation": [-1.8, 0.0, 0.0]}));
    let right = model.push("nodes", json!({"mesh": post, "translation": [1.8, 0.0, 0.0], "scale": [1.0, 1.0, -1.0]}));
    let through = model.push("nodes", json!({"name": "way through", "mesh": hole, "extras": {"spf_opening": true}}));
    let tags = json!({"spf": {"names": ["archway", "gate"], "kind": "structure", "use": ["pass through"], "number": 4}});
    model.node(json!({"name": "Gate", "children": [left, right, through], "translation": [-6.0, 0.0, -8.0], "extras": tags}));
    let (positions, fan) = (model.floats(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]), 6);
    let colours = model.accessor(&[[20, 200, 30, 255]; 4].concat(), BYTE, "VEC4", 4);
    model.json["accessors"][colours]["normalized"] = json!(true);
    let sail = model.mesh(json!({"attributes": {"POSITION": positions, "COLOR_0": colours}, "mode": fan}));
    model.node(json!({"name": "sail", "mesh": sail, "translation": [0.0, 0.0, -15.0]}));
    model.node(json!({"name": "spf_start", "translation": [0.0, 0.5, 10.0]}));
    model
}

/// A PNG of these sides.
pub(crate) fn png(width: u32, height: u32, colour: impl Fn(u32, u32) -> [u8; 4]) -> Vec<u8> {
    let pixels: Vec<u8> = (0..width * height).flat_map(|n| colour(n % width, n / width)).collect();
    spf_media::png::encode_rgba8(width, height, &pixels).unwrap()
}

/// The object with a key.
pub(crate) fn object<'a>(scene: &'a Scene, key: &str) -> &'a Object {
    scene.by_key(key).unwrap_or_else(|| panic!("no {key} in {:?}", scene.objects.iter().map(|o| &o.key).collect::<Vec<_>>()))
}
