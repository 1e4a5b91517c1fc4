//! Photographs in a folder, with a JSONL file of ground truth.

use std::path::Path;

use serde::Deserialize;

use super::{Pixels, SourceError, beside, form};
use crate::ground::{Item, Shape, Target, Truth};

/// A row. Positions are pixels of the upright image from its upper left, unless `units` is `fractions`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    #[serde(alias = "image")]
    #[serde(rename = "picture")]
    image: String,
    #[serde(alias = "prompt")]
    instruction: String,
    #[serde(default)]
    id: Option<String>,
    #[serde(default)]
    absent: bool,
    #[serde(default)]
    point: Option<[f64; 2]>,
    #[serde(default)]
    points: Vec<[f64; 2]>,
    /// A fraction of the width, whatever the units.
    #[serde(default)]
    radius: Option<f64>,
    #[serde(default, rename = "box")]
    area: Option<[f64; 4]>,
    #[serde(default)]
    boxes: Vec<[f64; 4]>,
    #[serde(default)]
    mask: Option<String>,
    #[serde(default)]
    distance_m: Option<f64>,
    #[serde(default)]
    units: Units,
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Units {
    #[default]
    Pixels,
    Shares,
}

pub(super) fn items(folder: &Path, file: &Path, text: &str) -> Result<Vec<Item>, SourceError> {
    let rows = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    rows.map(|(number, line)| {
        let wrong = |what: String| form(file, Some(number + 1), what);
        let row: Row = serde_json::from_str(line).map_err(|error| wrong(error.to_string()))?;
        item(folder, number, row).map_err(wrong)
    })
    .collect()
}

fn item(folder: &Path, number: usize, row: Row) -> Result<Item, String> {
    let missing = |name: &str| format!("no file `{name}` in the dataset folder");
    let image = beside(folder, &row.image, &["images", "pictures"]).ok_or_else(|| missing(&row.image))?;
    let mask = match &row.mask {
        Some(name) => Some(beside(folder, name, &["masks"]).ok_or_else(|| missing(name))?),
        None => None,
    };
    let pixels = match row.units {
        Units::Pixels => Pixels::of(&image).map_err(|error| format!("`{}`: {error}", row.image))?,
        Units::Shares => Pixels::FRACTIONS,
    };
    let boxes: Vec<_> = row.area.iter().chain(&row.boxes).map(|area| pixels.area(*area)).collect();
    let points: Vec<_> = row.point.iter().chain(&row.points).map(|point| pixels.point(*point)).collect();
    let finite = points.iter().all(|p| p.u.is_finite() && p.v.is_finite())
        && boxes.iter().all(|b| b.left.is_finite() && b.bottom.is_finite());
    if !finite || row.radius.is_some_and(|radius| !(0.0..=1.0).contains(&radius)) {
        return Err("a coordinate is not a number, or `radius` is not a fraction of the width".to_owned());
    }
    let shape = match (mask, boxes.is_empty(), points.is_empty()) {
        (Some(mask), ..) => Some(Shape::MaskFile(mask)),
        (None, false, _) => Some(Shape::Boxes(boxes.clone())),
        (None, true, false) => Some(Shape::Points(points.clone(), row.radius)),
        (None, true, true) => None,
    };
    let truth = match shape {
        Some(_) if row.absent => return Err("`absent` is set together with a location".to_owned()),
        None if row.absent => Truth::Absent,
        None => Truth::Unknown,
        Some(shape) => {
            let point = points.first().copied().filter(|_| !matches!(shape, Shape::Points(..)));
            Truth::Target(Box::new(Target { shape, point, distance_m: row.distance_m, boxes }))
        }
    };
    let key = row.id.unwrap_or_else(|| format!("{:06}", number));
    Ok(Item { key, instruction: row.instruction, image, truth, sim: None })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_row_that_contradicts_itself_is_refused() {
        let folder = std::env::temp_dir();
        let refused = |row: &str| items(&folder, Path::new("rows.jsonl"), row).unwrap_err().to_string();
        assert!(refused(r#"{"picture": "no-such.jpg", "instruction": "go"}"#).contains("row 1: no file `no-such.jpg`"));
        assert!(refused("\n{\"pictur\": 3}").contains("row 2: unknown field `pictur`"));
    }

    proptest! {
        #[test]
        fn any_row_is_read_or_refused(text in "[{}\\[\\]\":,a-z0-9. \n-]{0,200}", name in ".{0,20}") {
            let row = serde_json::json!({"picture": name, "instruction": "", "points": [[1e300, -1.0]], "box": [0, 0, 0, 0]}).to_string();
            for rows in [text, row] {
                drop(items(Path::new("/nonexistent"), Path::new("rows.jsonl"), &rows));
            }
        }
    }
}
