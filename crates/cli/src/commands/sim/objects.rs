//! `spf sim scenes --objects`: every object of a scene with its position.

use serde::Serialize;
use spf_scene::{Object, Scene};

use crate::printer::table;

/// One object. Positions and sizes in metres: east, north, up.
#[derive(Serialize)]
pub(super) struct Row {
    /// Unique in the scene; used as `id` in task files.
    key: String,
    /// First of its names.
    name: String,
    colour: Option<String>,
    /// Centre of its bounding box.
    centre_m: [f64; 3],
    /// Size of its bounding box.
    size_m: [f64; 3],
}

impl Row {
    fn new(object: &Object) -> Self {
        let (min, max) = (object.bounds.min, object.bounds.max);
        Self {
            key: object.key.clone(),
            name: object.tags.names.first().unwrap_or(&object.tags.kind).clone(),
            colour: object.tags.colour.clone(),
            centre_m: [(min.east + max.east) / 2.0, (min.north + max.north) / 2.0, (min.up + max.up) / 2.0],
            size_m: [max.east - min.east, max.north - min.north, max.up - min.up],
        }
    }
}

/// All objects of a scene, in the order of its file.
pub(super) fn rows(scene: &Scene) -> Vec<Row> {
    scene.objects.iter().map(Row::new).collect()
}

/// The table for a terminal.
pub(super) fn text(rows: &[Row]) -> String {
    let mut cells = vec![["ID", "NAME", "COLOUR", "EAST", "NORTH", "UP", "SIZE"].map(str::to_owned).to_vec()];
    cells.extend(rows.iter().map(|row| {
        let [east, north, up] = row.centre_m.map(|metres| format!("{metres:.1}"));
        let [width, depth, height] = row.size_m;
        let size = format!("{width:.1} x {depth:.1} x {height:.1} m");
        vec![row.key.clone(), row.name.clone(), row.colour.clone().unwrap_or_default(), east, north, up, size]
    }));
    table(&cells)
}
