//! AerialVLN and AerialVLN-S: `train.json`, `val_seen.json`, `val_unseen.json`, `test.json`.
//!
//! Read as <https://github.com/AirVLN/AirVLN> reads them (commit 1c2fb6f1): `load_my_datasets` and `_setEpisodes` of
//! `src/vlnce_src/env.py`, `SimState` of `utils/env_utils.py`. Of the object's list `episodes` each episode has
//!
//! | key | value |
//! |---|---|
//! | `episode_id`, `trajectory_id` | names; the episodes of one trajectory are wordings of one instruction |
//! | `scene_id` | the number of the scene's program, an integer or its digits |
//! | `instruction.instruction_text` | the instruction |
//! | `start_position` | x, y, z, metres: the position given to `simSetVehiclePose`, so AirSim's NED |
//! | `start_rotation` | quaternion w, x, y, z, body FRD to NED |
//! | `goals.0.position` | x, y, z, metres NED |
//! | `reference_path` | list of x, y, z and more, metres NED; only the first three numbers are measured against |
//!
//! All other keys, such as `actions` (the path in the benchmark's discrete steps) and the tokens of the instruction, are
//! skipped. `_update_DistanceToGoal` measures the distance to the goal on the map, without the height; `SUCCESS_DISTANCE` is
//! 20 m, as in the paper.

use std::collections::BTreeMap;
use std::path::Path;

use spf_core::geometry::{Attitude, EnuPosition, Pose};

use super::episode::{Episode, File};
use super::{ImportError, Imported};
use crate::measures::length;
use crate::task::{Benchmark, Destination, ForeignTask, LONGEST_INSTRUCTION, MOST_CORNERS, MOST_METRES, MOST_WORDINGS, Wording};

/// Success radius, metres.
const RADIUS_M: f64 = 20.0;
/// Maximum coordinate, metres: that of a task file.
const MOST_M: f64 = 1e4;

/// The tasks of a file's text.
pub(super) fn tasks(text: &str, file: &str) -> Result<Imported, ImportError> {
    let unknown = |message: String| ImportError::Unknown { file: file.to_owned(), message };
    let list: File<'_> = serde_json::from_str(text).map_err(|error| unknown(error.to_string()))?;
    if list.episodes.0.is_empty() {
        return Err(unknown("the list `episodes` is empty".to_owned()));
    }
    let name = name(file);
    let mut all = Imported { tasks: Vec::new(), episodes: list.episodes.0.len(), most_tilt: 0.0 };
    let mut of_trajectory: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for (number, text) in (1..).zip(&list.episodes.0) {
        let episode = Episode::read(file, number, text)?;
        let (task, tilt) = task(&episode, format!("aerialvln-{name}-{:05}", all.tasks.len() + 1))?;
        all.most_tilt = all.most_tilt.max(tilt);
        let known = of_trajectory.entry(task.trajectory.clone()).or_default();
        let same = known.iter().find(|index| all.tasks.get(**index).is_some_and(|other| is_another_wording(&task, other)));
        match same.and_then(|index| all.tasks.get_mut(*index)) {
            Some(other) => other.wordings.extend(task.wordings),
            None => {
                known.push(all.tasks.len());
                all.tasks.push(task);
            }
        }
    }
    // What is written must be read again, within the bounds of a task file.
    for task in &mut all.tasks {
        let error = |message: String| unknown(format!("trajectory `{}`: {message}", task.trajectory));
        let text = task.to_toml().map_err(|cause| error(cause.to_string()))?;
        *task = ForeignTask::parse(&text, "its task file").map_err(|cause| error(cause.to_string()))?;
    }
    Ok(all)
}

/// The file's stem in lower-case letters, digits and `-`, as ids have it.
fn name(file: &str) -> String {
    let stem = Path::new(file).file_stem().map(|stem| stem.to_string_lossy().to_lowercase()).unwrap_or_default();
    let usable: String = stem.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).take(60).collect();
    usable.trim_matches('-').to_owned()
}

/// The task of one episode, and the tilt of its start, radians.
fn task(episode: &Episode<'_>, id: String) -> Result<(ForeignTask, f64), ImportError> {
    let scene = episode.name("scene_id")?;
    if scene.parse::<u32>().is_err() {
        return Err(episode.wrong("scene_id", "the number of a scene", format!("`{scene}`")));
    }
    let ned = "x, y, z in metres, NED";
    let (attitude, tilt) = attitude(episode.numbers("start_rotation", "the quaternion w, x, y, z", 2.0)?)
        .ok_or_else(|| episode.wrong("start_rotation", "a quaternion of length 1", "another length"))?;
    let mut reference: Vec<EnuPosition> =
        episode.rows("reference_path", ned, MOST_CORNERS, MOST_M)?.into_iter().map(enu).collect();
    // A turn on the spot repeats the place.
    reference.dedup();
    let metres = length(&reference);
    if metres > MOST_METRES {
        return Err(episode.wrong("reference_path", format!("at most {MOST_METRES} m"), format!("{metres:.0} m")));
    }
    let instruction = episode.text("instruction.instruction_text", LONGEST_INSTRUCTION)?;
    let task = ForeignTask {
        id,
        benchmark: Benchmark::AerialVln,
        scene,
        trajectory: episode.name("trajectory_id")?,
        wordings: vec![Wording { episode: episode.name("episode_id")?, instruction }],
        start: Pose { position: enu(episode.numbers("start_position", ned, MOST_M)?), attitude },
        destination: Destination {
            position: enu(episode.numbers("goals.0.position", ned, MOST_M)?),
            radius_m: RADIUS_M,
            horizontal: true,
        },
        reference,
    };
    Ok((task, tilt))
}

/// Whether two tasks differ in nothing but the instruction, and there is room for another.
fn is_another_wording(one: &ForeignTask, other: &ForeignTask) -> bool {
    let ForeignTask { id: _, benchmark: _, scene, trajectory, wordings: _, start, destination, reference } = one;
    let of_other = (&other.scene, &other.trajectory, &other.start, &other.destination, &other.reference);
    (scene, trajectory, start, destination, reference) == of_other && other.wordings.len() < MOST_WORDINGS
}

/// NED to ENU.
fn enu([north, east, down]: [f64; 3]) -> EnuPosition {
    EnuPosition { east, north, up: -down }
}

/// The level attitude with the heading of a quaternion from body FRD to NED, and its tilt, the angle between the body's down
/// axis and the world's; `None` if it is no rotation.
fn attitude([w, x, y, z]: [f64; 4]) -> Option<(Attitude, f64)> {
    let square = w * w + x * x + y * y + z * z;
    if !(0.98..=1.02).contains(&square) {
        return None;
    }
    // First column of the rotation matrix, the nose in NED, and the entry of down on down.
    let heading = libm::atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z);
    let tilt = libm::acos(((w * w - x * x - y * y + z * z) / square).clamp(-1.0, 1.0));
    Some((Attitude { heading, ..Attitude::default() }, tilt))
}

#[cfg(test)]
mod tests {
    use core::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2};

    use proptest::prelude::*;
    use serde_json::{Value, json};

    use super::*;
    use crate::import::{parse, read};

    fn episode(id: &str, words: &str) -> Value {
        json!({
            "episode_id": id, "trajectory_id": "T1", "scene_id": 3,
            "instruction": {"instruction_text": words, "instruction_tokens": [1, 2]},
            // Looking east from 10 m up.
            "start_position": [1.0, 2.0, -10.0], "start_rotation": [FRAC_1_SQRT_2, 0, 0, FRAC_1_SQRT_2],
            "goals": [{"position": [4.0, 6.0, -22.0], "radius": 3}],
            "reference_path": [[1.0, 2.0, -10.0, 0, 0, 1.5], [1.0, 2.0, -10.0, 0, 0, 1.8], [4.004, 6, -22, 0, 0, 0]],
            "actions": [1, 0]
        })
    }

    fn file(episodes: &[Value]) -> String {
        json!({"instruction_vocab": {"a": 1}, "episodes": episodes}).to_string()
    }

    fn read_text(text: &str) -> Result<Imported, ImportError> {
        parse(text.as_bytes(), "data/Val_Unseen.json")
    }

    #[test]
    fn episodes_of_one_trajectory_are_wordings_of_one_task() {
        let mut other = episode("E3", "Fly home.");
        other["trajectory_id"] = json!(77);
        other["scene_id"] = json!("12");
        let mut moved = episode("E4", "Fly to the same trajectory's other goal.");
        moved["goals"][0]["position"][0] = json!(5.0);
        let all = read_text(&file(&[episode("E1", "Fly up."), other, episode("E2", " Rise. \n"), moved])).unwrap();
        assert_eq!(all.episodes, 4);
        let ids: Vec<&str> = all.tasks.iter().map(|task| task.id.as_str()).collect();
        assert_eq!(ids, ["aerialvln-val-unseen-00001", "aerialvln-val-unseen-00002", "aerialvln-val-unseen-00003"]);
        let wordings: Vec<(&str, &str)> =
            all.tasks[0].wordings.iter().map(|wording| (wording.episode.as_str(), wording.instruction.as_str())).collect();
        assert_eq!(wordings, [("E1", "Fly up."), ("E2", "Rise.")]);
        assert_eq!((all.tasks[1].trajectory.as_str(), all.tasks[1].scene.as_str()), ("77", "12"));
        assert_eq!(all.tasks[2].wordings[0].episode, "E4");
    }

    #[test]
    fn north_east_down_becomes_east_north_up() {
        let task = read_text(&file(&[episode("E1", "Fly.")])).unwrap().tasks.remove(0);
        let at = |east, north, up| EnuPosition { east, north, up };
        assert_eq!(task.start.position, at(2.0, 1.0, 10.0));
        // A quarter turn about down, clockwise from above: from north to east.
        assert!((task.start.attitude.heading - FRAC_PI_2).abs() < 1e-4, "{:?}", task.start);
        assert_eq!(task.destination.position, at(6.0, 4.0, 22.0));
        // The turn on the spot is one place; what is written has centimetres.
        assert_eq!(task.reference, [at(2.0, 1.0, 10.0), at(6.0, 4.0, 22.0)]);
        // 4² + 3² + 12² = 13².
        assert_eq!(task.course().shortest_m, 13.0);
        assert!(task.destination.radius_m == 20.0 && task.destination.horizontal);
    }

    #[test]
    fn a_tilted_start_is_imported_level_and_told() {
        // Nose up by 30°, then heading 90°: q = q(z, 90°) · q(y, 30°).
        let (half, pitch) = (FRAC_1_SQRT_2, 15.0_f64.to_radians());
        let (sin, cos) = (libm::sin(pitch), libm::cos(pitch));
        let (level, tilt) = attitude([half * cos, -half * sin, half * sin, half * cos]).unwrap();
        assert!((level.heading - FRAC_PI_2).abs() < 1e-12 && level.pitch == 0.0, "{level:?}");
        assert!((tilt.to_degrees() - 30.0).abs() < 1e-9, "{tilt}");
        assert!(attitude([0.0; 4]).is_none() && attitude([1.0, 1.0, 0.0, 0.0]).is_none());
        let mut episode = episode("E1", "Fly.");
        episode["start_rotation"] = json!([half * cos, -half * sin, half * sin, half * cos]);
        let all = read_text(&file(&[episode])).unwrap();
        assert!((all.most_tilt.to_degrees() - 30.0).abs() < 1e-6, "{}", all.most_tilt);
    }

    #[test]
    fn what_is_wrong_is_named_with_file_episode_and_key() {
        let cases: [(&[&str], Value, &str, &str); 11] = [
            (&["episode_id"], Value::Null, "key `episode_id`", "found null"),
            (&["trajectory_id"], json!(1.5), "(`E2`), key `trajectory_id`", "found 1.5"),
            (&["scene_id"], json!("city"), "key `scene_id`", "found `city`"),
            (&["instruction"], json!("Fly."), "key `instruction.instruction_text`", "found nothing"),
            (&["instruction", "instruction_text"], json!("  "), "key `instruction.instruction_text`", "1 to 5000 characters"),
            (&["start_position"], json!([1, 2]), "key `start_position`", "3 numbers within ±10000: x, y, z in metres, NED"),
            (&["start_position"], json!([1, 2, 1e300]), "key `start_position`", "found a list of 3 numbers"),
            (&["start_rotation"], json!([1, 1, 0, 0]), "key `start_rotation`", "length 1"),
            (&["goals"], json!([]), "key `goals.0.position`", "found nothing"),
            (&["reference_path"], json!([[1, 2, 3], [1, "a", 3]]), "key `reference_path.1`", "with a text of 1 characters"),
            (&["reference_path"], json!([[9000, 0, 0], [-9000, 0, 0], [9000, 0, 0]]), "key `reference_path`", "found 36000 m"),
        ];
        for (keys, value, place, words) in cases {
            let mut second = episode("E2", "Fly.");
            *keys.iter().fold(&mut second, |at, key| &mut at[key]) = value;
            let error = read_text(&file(&[episode("E1", "Fly."), second])).unwrap_err().to_string();
            assert!(error.starts_with("`data/Val_Unseen.json`, episode 2"), "{error}");
            assert!(error.contains(place) && error.contains(words), "{error}");
        }
        let error = |text: &str| read_text(text).unwrap_err().to_string();
        assert!(error("{\"episodes\": []}").contains("is empty"));
        assert!(error("{\"tasks\": []}").contains("missing field `episodes`"));
        assert!(error("task: landing\n").contains("`data/Val_Unseen.json`: expected ident at line 1"));
        assert!(error("{\"episodes\": [3]}").contains("episode 1, key `(whole)`: expected an object, found 3"));
        assert!(parse(b"\xff", "a.json").unwrap_err().to_string().contains("utf-8"));
        assert!(read(Path::new("/")).unwrap_err().to_string().starts_with("cannot read `/`"));
    }

    #[test]
    fn what_is_too_much_is_refused() {
        let corners = |n: usize| (0..n).map(|i| json!([i % 2, 0, 0])).collect::<Vec<_>>();
        let with = |corners: Vec<Value>| {
            let mut one = episode("E1", "Fly.");
            one["reference_path"] = corners.into();
            read_text(&file(&[one]))
        };
        assert_eq!(with(corners(MOST_CORNERS)).unwrap().tasks[0].reference.len(), MOST_CORNERS);
        assert!(with(corners(MOST_CORNERS + 1)).unwrap_err().to_string().contains("1 to 4000 positions"));
        let mut fat = episode("E1", "Fly.");
        fat["actions"] = vec![0; 1 << 20].into();
        assert!(read_text(&file(&[fat])).unwrap_err().to_string().contains("at most 1048576 bytes"));
        // The seventeenth wording is a task of its own.
        let many: Vec<Value> = (0..=MOST_WORDINGS).map(|i| episode(&i.to_string(), "Fly.")).collect();
        let counts: Vec<usize> = read_text(&file(&many)).unwrap().tasks.iter().map(|task| task.wordings.len()).collect();
        assert_eq!(counts, [MOST_WORDINGS, 1]);
        let nested = format!("{{\"episodes\": [{}]}}", "[".repeat(100_000));
        assert!(read_text(&nested).is_err());
    }

    proptest! {
        #[test]
        fn any_text_is_imported_or_refused(at in 0_usize..900, with in ".{0,12}", length in 0_usize..40) {
            let text = file(&[episode("E1", "Fly."), episode("E2", "Go.")]);
            let end = (at + length).min(text.len());
            if let (Some(before), Some(after)) = (text.get(..at), text.get(end..)) {
                match read_text(&format!("{before}{with}{after}")) {
                    Ok(all) => prop_assert!(!all.tasks.is_empty() && all.tasks.iter().all(|task| !task.reference.is_empty())),
                    Err(error) => prop_assert!(error.to_string().starts_with("`data/Val_Unseen.json`"), "{}", error),
                }
            }
        }
    }
}
