//! Datasets written by `spf sim dataset` (docs/guide/dataset.md).

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::Value;
use spf_core::query::{ImageBox, ImagePoint};
use spf_core::tags::Tagged;
use spf_flight::dataset::record::{DatasetHeader, FORMAT, Row};
use spf_media::file::{self, FileError, Limits};
use spf_oracle::masks;

use super::{SourceError, form, form_of, read, stays};
use crate::ground::{Item, Shape, Target, Truth};

/// An example with everything the oracle reads.
#[derive(Clone, Debug, PartialEq)]
pub struct SimExample {
    /// The dataset's folder.
    pub folder: PathBuf,
    /// Its row.
    pub row: Arc<Row>,
    /// The data common to all rows.
    pub head: Arc<DatasetHeader>,
    /// The scene's objects with their names.
    pub tags: Arc<Vec<Tagged>>,
}

/// The ground truth images of an example.
#[derive(Clone, Debug, Default)]
pub(crate) struct Layers {
    pub(crate) ids: Vec<u16>,
    pub(crate) depth: Vec<f32>,
    pub(crate) opening_ids: Vec<u16>,
    pub(crate) opening_depth: Vec<f32>,
}

impl SimExample {
    /// Loads the ground truth images.
    pub(crate) fn layers(&self) -> Result<Layers, FileError> {
        let files = &self.row.files;
        let grey = |name: &str| {
            let bytes = std::fs::read(self.folder.join(name))?;
            Ok::<_, FileError>(file::decode(&bytes, Limits::default())?.into_grey16())
        };
        let metres = |name: &str| grey(name).map(|cm| cm.into_iter().map(|cm| f32::from(cm) / 100.0).collect::<Vec<f32>>());
        Ok(Layers {
            ids: grey(&files.ids)?,
            depth: metres(&files.depth)?,
            opening_ids: files.opening_ids.as_deref().map(grey).transpose()?.unwrap_or_default(),
            opening_depth: files.opening_depth.as_deref().map(metres).transpose()?.unwrap_or_default(),
        })
    }
}

pub(super) fn items(folder: &Path, head: &str, rows: &str) -> Result<Vec<Item>, SourceError> {
    let path = folder.join("dataset.json");
    let head: DatasetHeader = serde_json::from_str(head).map_err(|error| form(&path, None, error.to_string()))?;
    if head.format != FORMAT {
        return Err(form_of(&path, &format!("unsupported format {}; this version reads {FORMAT}", head.format)));
    }
    let mut tags = BTreeMap::new();
    for scene in &head.scenes {
        if !stays(&scene.legend) {
            return Err(form_of(&path, &format!("`{}` is outside the dataset folder", scene.legend)));
        }
        let path = folder.join(&scene.legend);
        let legend: Value = serde_json::from_str(&read(&path)?).map_err(|error| form(&path, None, error.to_string()))?;
        let tagged = tagged(&legend).map_err(|error| form(&path, None, error))?;
        tags.insert(scene.name.clone(), Arc::new(tagged));
    }
    let head = Arc::new(head);
    let path = folder.join("examples.jsonl");
    let mut items = Vec::new();
    for (number, line) in rows.lines().enumerate() {
        let row: Row = serde_json::from_str(line).map_err(|error| form(&path, Some(number + 1), error.to_string()))?;
        let files = &row.files;
        let named = [&files.image, &files.ids, &files.depth].into_iter();
        let maybe = [&files.mask, &files.opening_ids, &files.opening_depth].into_iter().flatten();
        if let Some(name) = named.chain(maybe).find(|name| !stays(name)) {
            return Err(form(&path, Some(number + 1), format!("`{name}` is outside the dataset folder")));
        }
        let tags = tags.get(&row.scene).ok_or_else(|| form(&path, Some(number + 1), format!("unknown scene `{}`", row.scene)))?;
        let example = SimExample { folder: folder.to_owned(), row: Arc::new(row), head: head.clone(), tags: tags.clone() };
        items.push(item(example));
    }
    Ok(items)
}

fn item(example: SimExample) -> Item {
    let row = &example.row;
    let truth = match (&row.target, &row.files.mask) {
        (Some(target), Some(mask)) => {
            let size = (f64::from(example.head.camera.width), f64::from(example.head.camera.height));
            let fraction = |x: u32, y: u32| (f64::from(x) / size.0, f64::from(y) / size.1);
            let middle =
                ImagePoint { u: (f64::from(target.point[0]) + 0.5) / size.0, v: (f64::from(target.point[1]) + 0.5) / size.1 };
            let ((left, top), (right, bottom)) =
                (fraction(target.bounds[0], target.bounds[1]), fraction(target.bounds[2], target.bounds[3]));
            Truth::Target(Box::new(Target {
                shape: Shape::MaskFile(example.folder.join(mask)),
                point: Some(middle),
                distance_m: Some(target.distance_m),
                boxes: vec![ImageBox { left, top, right, bottom }],
            }))
        }
        _ => Truth::Absent,
    };
    Item {
        key: format!("{:06}", row.number),
        instruction: row.instruction.clone(),
        image: example.folder.join(&row.files.image),
        truth,
        sim: Some(example),
    }
}

impl SimExample {
    /// True boxes of all objects in the image, including openings.
    pub(crate) fn boxes(&self, layers: &Layers) -> Vec<ImageBox> {
        let (width, height) = (self.head.camera.width as usize, self.head.camera.height as usize);
        let fractions = |x: usize, y: usize| (x as f64 / width as f64, y as f64 / height as f64);
        let found = masks(&layers.ids, width).into_iter().chain(masks(&layers.opening_ids, width));
        let area = |mask: spf_oracle::Mask| {
            let ((left, top), (right, bottom)) = (fractions(mask.left, mask.top), fractions(mask.right + 1, mask.bottom + 1));
            ImageBox { left, top, right, bottom }
        };
        found.map(area).collect()
    }
}

/// The objects of a legend.
fn tagged(legend: &Value) -> Result<Vec<Tagged>, String> {
    let objects = legend["objects"].as_array().ok_or("it lists no objects")?;
    let key_of = |id: u64| objects.iter().find(|object| object["id"] == id).and_then(|object| object["key"].as_str());
    let words = |value: &Value| -> Vec<String> {
        value.as_array().into_iter().flatten().filter_map(|word| Some(word.as_str()?.to_owned())).collect()
    };
    let one = |object: &Value| {
        let tags = &object["tags"];
        Some(Tagged {
            id: u16::try_from(object["id"].as_u64()?).ok()?,
            key: object["key"].as_str()?.to_owned(),
            names: words(&tags["names"]),
            synonyms: words(&tags["synonyms"]),
            colour: tags["colour"].as_str().map(str::to_owned),
            kind: tags["kind"].as_str()?.to_owned(),
            qualities: words(&tags["qualities"]),
            uses: words(&tags["uses"]),
            group: tags["group"].as_str().map(str::to_owned),
            stands_for_group: false,
            opening: object["opening"].as_bool()?,
            opening_of: tags["opening_of"].as_u64().and_then(key_of).map(str::to_owned),
            looks_like: tags["looks_like"].as_u64().and_then(key_of).map(str::to_owned),
        })
    };
    let each = objects.iter().map(|object| one(object).ok_or_else(|| format!("incomplete object: {object}")));
    let mut all = each.collect::<Result<Vec<Tagged>, String>>()?;
    Tagged::represent_groups(&mut all);
    Ok(all)
}
