//! COCO instance annotations: each kind of object in each image is one question.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;
use serde_json::Value;
use spf_core::query::ImagePoint;

use super::{Pixels, SourceError, beside, form_of};
use crate::ground::{Item, Mask, Shape, Target, Truth};

/// Maximum number of pixels of a run-length mask.
const MOST_PIXELS: usize = 1 << 26;

#[derive(Deserialize)]
struct File {
    images: Vec<Image>,
    annotations: Vec<Annotation>,
    categories: Vec<Category>,
}

#[derive(Deserialize)]
struct Image {
    id: u64,
    file_name: String,
    width: f64,
    height: f64,
}

#[derive(Deserialize)]
struct Annotation {
    image_id: u64,
    category_id: u64,
    bbox: [f64; 4],
    #[serde(default)]
    segmentation: Value,
    #[serde(default)]
    iscrowd: u8,
}

#[derive(Deserialize)]
struct Category {
    id: u64,
    name: String,
}

pub(super) fn items(folder: &Path, file: &Path, value: &Value) -> Result<Vec<Item>, SourceError> {
    let all = File::deserialize(value).map_err(|error| form_of(file, &error.to_string()))?;
    let names: BTreeMap<u64, &str> = all.categories.iter().map(|kind| (kind.id, kind.name.as_str())).collect();
    let mut by_image: BTreeMap<u64, Vec<&Annotation>> = BTreeMap::new();
    for annotation in &all.annotations {
        by_image.entry(annotation.image_id).or_default().push(annotation);
    }
    let mut items = Vec::new();
    for image in &all.images {
        let Some(annotations) = by_image.get(&image.id) else { continue };
        let name = &image.file_name;
        let path = beside(folder, name, &["images", "../images", "train2017", "val2017", "train2014", "val2014"])
            .ok_or_else(|| form_of(file, &format!("no file `{name}` next to the annotation file or in `images`")))?;
        let pixels = Pixels { width: image.width.max(1.0), height: image.height.max(1.0) };
        let corners = |[x, y, w, h]: [f64; 4]| pixels.area([x, y, x + w, y + h]);
        let boxes: Vec<_> = annotations.iter().map(|annotation| corners(annotation.bbox)).collect();
        let mut kinds: Vec<u64> = annotations.iter().map(|annotation| annotation.category_id).collect();
        kinds.sort_unstable();
        kinds.dedup();
        for kind in kinds {
            let of_kind: Vec<&&Annotation> = annotations.iter().filter(|annotation| annotation.category_id == kind).collect();
            let shape = shape(&of_kind, pixels)
                .unwrap_or_else(|| Shape::Boxes(of_kind.iter().map(|annotation| corners(annotation.bbox)).collect()));
            let name = names.get(&kind).ok_or_else(|| form_of(file, &format!("unknown category id {kind}")))?;
            items.push(Item {
                key: format!("{}-{kind}", image.id),
                instruction: format!("Fly to the {name}"),
                image: path.clone(),
                truth: Truth::Target(Box::new(Target { shape, point: None, distance_m: None, boxes: boxes.clone() })),
                sim: None,
            });
        }
    }
    Ok(items)
}

/// Polygons if every instance has some; a single run-length mask; otherwise `None`, and boxes are used.
fn shape(annotations: &[&&Annotation], pixels: Pixels) -> Option<Shape> {
    if let [only] = annotations
        && only.iscrowd == 1
    {
        return run_lengths(&only.segmentation).map(Shape::Mask);
    }
    let mut polygons = Vec::new();
    for annotation in annotations {
        for outline in annotation.segmentation.as_array().filter(|outlines| !outlines.is_empty())? {
            let numbers: Vec<f64> = outline.as_array()?.iter().map(Value::as_f64).collect::<Option<_>>()?;
            let polygon: Vec<ImagePoint> = numbers.chunks_exact(2).map(|pair| pixels.point([pair[0], pair[1]])).collect();
            polygons.push(polygon);
        }
    }
    Some(Shape::Polygons(polygons))
}

/// Alternating run lengths outside and inside, in column order.
fn run_lengths(value: &Value) -> Option<Mask> {
    let size: Vec<usize> =
        value["size"].as_array()?.iter().map(|side| usize::try_from(side.as_u64()?).ok()).collect::<Option<_>>()?;
    let [height, width] = size[..] else { return None };
    let pixels = height.checked_mul(width).filter(|pixels| (1..=MOST_PIXELS).contains(pixels))?;
    let mut inside = vec![false; pixels];
    let mut at = 0_usize;
    for (turn, run) in value["counts"].as_array()?.iter().enumerate() {
        let end = at.checked_add(usize::try_from(run.as_u64()?).ok()?).filter(|end| *end <= pixels)?;
        if turn % 2 == 1 {
            (at..end).for_each(|i| inside[i % height * width + i / height] = true);
        }
        at = end;
    }
    Some(Mask { width: width as u32, height: height as u32, inside })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_go_down_the_columns() {
        // Two rows of three: two outside, three inside, one outside; column by column, so the middle column and the top right.
        let mask = run_lengths(&serde_json::json!({"size": [2, 3], "counts": [2, 3, 1]})).unwrap();
        assert_eq!(mask.inside, [false, true, true, false, true, false]);
        assert!(run_lengths(&serde_json::json!({"size": [2, 3], "counts": [2, 30]})).is_none());
        assert!(run_lengths(&serde_json::json!({"size": [99999999, 99999999], "counts": []})).is_none());
    }
}
