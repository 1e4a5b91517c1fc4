//! Layouts of public benchmarks of pointing that are lists of JSON objects: RefSpatial-Bench (`question.json`, raw files),
//! Point-Bench of PointArena (`data.json`), ScreenSpot-Pro (`annotations/*.json`).

use std::path::Path;

use serde::Deserialize;
use serde_json::Value;

use super::{Pixels, SourceError, beside, form, form_of, stays};
use crate::ground::{Item, Shape, Target, Truth};

/// RefSpatial-Bench: a mask in a file.
#[derive(Deserialize)]
struct RefSpatial {
    rgb_path: String,
    mask_path: String,
    prompt: String,
}

/// Point-Bench: a mask in a file, images and masks in folders by category.
#[derive(Deserialize)]
struct PointBench {
    image_filename: String,
    mask_filename: String,
    #[serde(alias = "prompt")]
    user_input: String,
    #[serde(default)]
    category: String,
}

/// ScreenSpot-Pro: a box in pixels.
#[derive(Deserialize)]
struct ScreenSpot {
    img_filename: String,
    bbox: [f64; 4],
    instruction: String,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Entry {
    RefSpatial(RefSpatial),
    PointBench(PointBench),
    ScreenSpot(ScreenSpot),
}

pub(super) fn items(folder: &Path, file: &Path, value: &Value) -> Result<(&'static str, Vec<Item>), SourceError> {
    let list = value.as_array().ok_or_else(|| form_of(file, "neither COCO nor a list of images"))?;
    let mut form_name = "a list of images";
    let mut items = Vec::new();
    for (number, value) in list.iter().enumerate() {
        let wrong = |what: String| form(file, Some(number + 1), what);
        let entry = Entry::deserialize(value).map_err(|_| {
            wrong(
                "unknown format; RefSpatial-Bench, Point-Bench and ScreenSpot-Pro are supported (docs/guide/grounding.md)"
                    .to_owned(),
            )
        })?;
        let (name, item) = item(folder, number, entry).map_err(wrong)?;
        form_name = name;
        items.push(item);
    }
    Ok((form_name, items))
}

fn item(folder: &Path, number: usize, entry: Entry) -> Result<(&'static str, Item), String> {
    let missing = |name: &str| format!("no file `{name}` in the dataset folder");
    let masked = |image: &str, mask: &str, folders: [&[&str]; 2]| {
        let image = beside(folder, image, folders[0]).ok_or_else(|| missing(image))?;
        let mask = beside(folder, mask, folders[1]).ok_or_else(|| missing(mask))?;
        Ok::<_, String>((image, Shape::MaskFile(mask), Vec::new()))
    };
    let (name, instruction, (image, shape, boxes)) = match entry {
        Entry::RefSpatial(e) => ("RefSpatial-Bench", e.prompt, masked(&e.rgb_path, &e.mask_path, [&["image"], &["mask"]])?),
        Entry::PointBench(e) if !stays(&e.category) => return Err(format!("`{}` is outside the dataset folder", e.category)),
        Entry::PointBench(e) => {
            let of = |kind: &str| format!("{kind}/{}", e.category);
            let (images, masks) = (of("selected_images"), of("selected_masks"));
            let folders: [&[&str]; 2] = [&[&images, "images"], &[&masks, "masks"]];
            ("Point-Bench", e.user_input, masked(&e.image_filename, &e.mask_filename, folders)?)
        }
        Entry::ScreenSpot(e) => {
            let image =
                beside(folder, &e.img_filename, &["images"]).or_else(|| beside(&folder.join(".."), &e.img_filename, &["images"]));
            let image = image.ok_or_else(|| missing(&e.img_filename))?;
            let pixels = Pixels::of(&image).map_err(|error| format!("`{}`: {error}", e.img_filename))?;
            let area = pixels.area(e.bbox);
            ("ScreenSpot-Pro", e.instruction, (image, Shape::Boxes(vec![area]), vec![area]))
        }
    };
    let truth = Truth::Target(Box::new(Target { shape, point: None, distance_m: None, boxes }));
    Ok((name, Item { key: format!("{number:06}"), instruction, image, truth, sim: None }))
}
