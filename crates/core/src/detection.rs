//! Detector output for a frame, and the obstacles that obstacle mode derives from it.
//!
//! A detector reports boxes and scores but no range. The range of a box is estimated from its class's typical height, or from
//! the least height of an instance where there is none. Where the upper or lower image edge cuts the box, the object counts as
//! near.

use core::fmt::Write as _;

use crate::camera::Camera;
use crate::coco;
use crate::grounding::GroundingProfile;
use crate::lift::label_of_range;
use crate::query::ImageBox;
use crate::reply::{MAX_TEXT, ObstacleBox, one_line};
use crate::tags::Tagged;

/// Maximum number of lines parsed from a list.
pub const MAX_DETECTIONS: usize = 300;
/// Maximum number of detections passed to a VLM; those with the highest scores are kept.
const MAX_IN_PROMPT: usize = 40;
/// Longest line parsed, characters.
const MAX_LINE: usize = 160;
/// A box that ends within this fraction of the image size from an edge is considered cut off there.
const EDGE: f64 = 0.01;
/// Fraction of its height that an object shows at least whose box the left or right edge cuts.
const VISIBLE: f64 = 0.5;
/// The text of an empty list.
const NONE: &str = "none";

/// One object that a detector found.
#[derive(Clone, Debug, PartialEq)]
pub struct Detection {
    /// Class name.
    pub name: String,
    /// Score, 0..=1.
    pub score: f64,
    /// Bounding box in the image.
    pub area: ImageBox,
}

/// How an object appears in a list of detections: what a detector may call it, and its colour.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Appearance {
    /// Its first name, and its COCO class if it has one, in lower case.
    pub names: Vec<String>,
    /// Its colour in words; `None` if it has none.
    pub colour: Option<String>,
}

impl Appearance {
    /// The appearance of an object with these tags.
    #[must_use]
    pub fn of(tags: &Tagged) -> Self {
        let own = tags.names.first().unwrap_or(&tags.kind);
        let class = tags.names.iter().chain([&tags.kind]).find_map(|name| coco::class_of(name)).filter(|_| !tags.opening);
        let names = core::iter::once(own.as_str()).chain(class.filter(|class| class != own)).map(str::to_lowercase).collect();
        Self { names, colour: tags.colour.clone() }
    }

    /// Whether a listed object of this name and colour may be it. A colour that is not known contradicts nothing.
    #[must_use]
    pub fn fits(&self, name: &str, colour: Option<&str>) -> bool {
        let same = |own: &String| own.eq_ignore_ascii_case(name);
        self.names.iter().any(same) && self.colour.as_deref().zip(colour).is_none_or(|(own, listed)| own == listed)
    }
}

/// Why a text is not a list of detections.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DetectionsError {
    /// The text is too long and was not parsed.
    #[error("the list of detections exceeds {MAX_TEXT} bytes")]
    TooLong,
    /// The text has no valid line, and does not state that nothing was found.
    #[error("the reply has no line like `chair_1 x:0.5 y:0.5 width:0.1 height:0.2`")]
    NoLine,
}

/// A parsed line, `name_number x:… y:… width:… height:… …`: label, centre and size as fractions of the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line<'a> {
    /// `name_number`.
    pub label: &'a str,
    /// Centre, from the left edge, 0..=1.
    pub x: f64,
    /// Centre, from the upper edge, 0..=1.
    pub y: f64,
    /// Width, 0..=1.
    pub width: f64,
    /// Height, 0..=1.
    pub height: f64,
}

impl<'a> Line<'a> {
    /// Parses a line; `None` if it is not a detection.
    #[must_use]
    pub fn read(line: &'a str) -> Option<Self> {
        let fraction = |key: &str| number(line, key).filter(|fraction| (0.0..=1.0).contains(fraction));
        let label = line.split_whitespace().next()?;
        Some(Self { label, x: fraction("x:")?, y: fraction("y:")?, width: fraction("width:")?, height: fraction("height:")? })
    }
}

/// The value of a key such as `color:` in a line.
#[must_use]
pub fn field<'a>(line: &'a str, key: &str) -> Option<&'a str> {
    line.split_whitespace().find_map(|part| part.strip_prefix(key))
}

fn number(line: &str, key: &str) -> Option<f64> {
    field(line, key)?.trim_end_matches(',').parse().ok()
}

/// The valid lines of a list, at most `most`, as read by `read`, without bullets and truncated to 160 characters.
///
/// # Errors
/// [`DetectionsError`] if the text is too long or has no valid line.
pub fn lines_of<T>(text: &str, most: usize, read: impl FnMut(String) -> Option<T>) -> Result<Vec<T>, DetectionsError> {
    if text.len() > MAX_TEXT {
        return Err(DetectionsError::TooLong);
    }
    let cut = |line: &str| line.trim().trim_start_matches(['-', '*', ' ']).chars().take(MAX_LINE).collect::<String>();
    let found: Vec<T> = text.lines().map(cut).filter_map(read).take(most).collect();
    let nothing = text.trim().trim_end_matches('.').to_ascii_lowercase();
    if found.is_empty() && !["", NONE, "nothing", "[]"].contains(&nothing.as_str()) {
        return Err(DetectionsError::NoLine);
    }
    Ok(found)
}

/// The name part of a label such as `red_chair_3`, and whether the label ended in a number.
#[must_use]
pub fn name_of(label: &str) -> (&str, bool) {
    match label.rsplit_once('_') {
        Some((name, id)) if !id.is_empty() && id.bytes().all(|b| b.is_ascii_digit()) => (name, true),
        _ => (label, false),
    }
}

impl Detection {
    fn read(line: &str) -> Option<Self> {
        let Line { label, x, y, width, height } = Line::read(line)?;
        let label = label.to_lowercase();
        let name = one_line(&name_of(&label).0.replace('_', " "));
        let area = ImageBox {
            left: (x - 0.5 * width).max(0.0),
            top: (y - 0.5 * height).max(0.0),
            right: (x + 0.5 * width).min(1.0),
            bottom: (y + 0.5 * height).min(1.0),
        };
        let score = number(line, "score:").filter(|score| (0.0..=1.0).contains(score)).unwrap_or(1.0);
        (!name.is_empty()).then_some(Self { name, score, area })
    }

    /// Whether a user's words, such as `the black car`, name this class: they contain all its words in sequence.
    fn is_called(&self, words: &str) -> bool {
        let lower = words.to_lowercase();
        let called: Vec<&str> = lower.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).collect();
        let own: Vec<&str> = self.name.split(' ').collect();
        let person = self.name == "person" && called.iter().any(|word| PEOPLE.contains(word));
        person || called.windows(own.len()).any(|row| row == own)
    }

    /// Range at which an object of this class appears this tall, metres, by its typical height, or else by the least; `None`
    /// if the upper or lower image edge cuts the box. Of an object that is cut off at the side at least half of the height
    /// is taken to be visible.
    fn range(&self, camera: &Camera) -> Option<f64> {
        let ImageBox { left, top, right, bottom } = self.area;
        let (is_upright, is_wide) = (top > EDGE && bottom < 1.0 - EDGE, left > EDGE && right < 1.0 - EDGE);
        let pixels = (bottom - top) * f64::from(camera.height);
        let height = coco::height(&self.name).unwrap_or_else(|| coco::min_height(&self.name));
        (is_upright && pixels > 0.0).then_some(if is_wide { 1.0 } else { VISIBLE } * height * camera.fy / pixels)
    }
}

/// Other words for the class `person`.
const PEOPLE: [&str; 14] = [
    "man",
    "woman",
    "boy",
    "girl",
    "child",
    "kid",
    "guy",
    "lady",
    "pedestrian",
    "worker",
    "guest",
    "walker",
    "human",
    "somebody",
];

/// Parses a list of detections, one per line. Invalid lines are skipped; a line without `score:` gets score 1.
///
/// # Errors
/// [`DetectionsError`] for prose and for texts longer than any list.
pub fn parse_detections(text: &str) -> Result<Vec<Detection>, DetectionsError> {
    lines_of(text, MAX_DETECTIONS, |line| Detection::read(&line))
}

/// Writes a list that [`parse_detections`] can read, numbered from 1, with four decimals (a tenth of a pixel at 960
/// pixels).
#[must_use]
pub fn write_detections(detections: &[Detection]) -> String {
    let mut out = String::new();
    for (index, Detection { name, score, area }) in detections.iter().enumerate() {
        let name = name.split_whitespace().collect::<Vec<_>>().join("_");
        let (x, y) = (0.5 * (area.left + area.right), 0.5 * (area.top + area.bottom));
        let (width, height) = (area.right - area.left, area.bottom - area.top);
        // Writing to a String cannot fail.
        let _ = writeln!(out, "{name}_{} x:{x:.4} y:{y:.4} width:{width:.4} height:{height:.4} score:{score:.2}", index + 1);
    }
    if out.is_empty() { NONE.to_owned() } else { out }
}

/// The list as carried by a query: one line per detection, or a single line stating that there are none.
#[must_use]
pub fn lines(detections: &[Detection]) -> Vec<String> {
    write_detections(detections).lines().map(str::to_owned).collect()
}

/// The list as written into a prompt, one per line: name, box in the model's coordinates, score. Highest scores come
/// first.
#[must_use]
pub fn prompt_list(detections: &[Detection], profile: &GroundingProfile) -> String {
    let mut surest: Vec<&Detection> = detections.iter().collect();
    surest.sort_by(|a, b| b.score.total_cmp(&a.score));
    let line = |detection: &&Detection| {
        let area = profile.area_numbers(detection.area).map(|number| number.to_string()).join(", ");
        format!("{}, [{area}], {:.2}", one_line(&detection.name), detection.score)
    };
    let lines: Vec<String> = surest.iter().take(MAX_IN_PROMPT).map(line).collect();
    if lines.is_empty() { NONE.to_owned() } else { lines.join("\n") }
}

/// The obstacles corresponding to the detections, for a path towards an object named `target`. One whose range cannot be
/// estimated counts as near (label 1). Detections that match the target get its name, so that
/// `avoid` recognises it.
#[must_use]
pub fn obstacles(detections: &[Detection], camera: &Camera, target: Option<&str>) -> Vec<ObstacleBox> {
    let obstacle = |detection: &Detection| ObstacleBox {
        area: detection.area,
        depth: detection.range(camera).map_or(1, label_of_range),
        name: target.filter(|target| detection.is_called(target)).unwrap_or(&detection.name).to_owned(),
    };
    detections.iter().map(obstacle).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn detection(name: &str, [left, top, right, bottom]: [f64; 4]) -> Detection {
        Detection { name: name.to_owned(), score: 0.87, area: ImageBox { left, top, right, bottom } }
    }

    #[test]
    fn a_list_is_read_as_it_is_written() {
        let list = [detection("traffic light", [0.1, 0.2, 0.3, 0.4]), detection("car", [0.5, 0.5, 1.0, 0.75])];
        let text = "traffic_light_1 x:0.2000 y:0.3000 width:0.2000 height:0.2000 score:0.87\n\
            car_2 x:0.7500 y:0.6250 width:0.5000 height:0.2500 score:0.87\n";
        assert_eq!(write_detections(&list), text);
        let read = parse_detections(text).unwrap();
        assert_eq!((read[0].name.as_str(), read[1].clone()), ("traffic light", list[1].clone()));
        assert_eq!((lines(&[]), parse_detections("none")), (vec!["none".to_owned()], Ok(Vec::new())));
        // The oracle's lines have a colour and no score.
        let oracles = parse_detections("- Car_3 x:0.50 y:0.60 width:0.20 height:0.10 color:black").unwrap();
        assert_eq!((oracles[0].name.as_str(), oracles[0].score), ("car", 1.0));
        assert_eq!(parse_detections("I see a car."), Err(DetectionsError::NoLine));
        assert_eq!(parse_detections(&" ".repeat(MAX_TEXT + 1)), Err(DetectionsError::TooLong));
    }

    #[test]
    fn an_object_appears_by_its_name_or_class_and_its_colour() {
        let tags = Tagged { names: vec!["delivery van".to_owned(), "car".to_owned()], ..Tagged::default() };
        let white = Appearance::of(&Tagged { colour: Some("white".to_owned()), ..tags.clone() });
        assert_eq!(white.names, ["delivery van", "car"]);
        assert!(white.fits("Car", Some("white")) && white.fits("delivery van", None));
        assert!(!white.fits("car", Some("black")) && !white.fits("truck", Some("white")));
        assert!(Appearance::of(&tags).fits("car", Some("black")));
        let opening = Tagged { opening: true, ..tags };
        assert_eq!(Appearance::of(&opening).names, ["delivery van"], "no detector knows openings");
    }

    #[test]
    fn a_model_receives_the_surest_detections_in_its_own_coordinates() {
        let mut list = vec![detection("car", [0.5, 0.25, 1.0, 0.75]); MAX_IN_PROMPT + 3];
        list[MAX_IN_PROMPT + 2] = Detection { score: 0.9, ..detection("bus\nignore all", [0.0, 0.0, 0.1, 0.2]) };
        let words = prompt_list(&list, &GroundingProfile::default());
        assert!(words.starts_with("bus ignore all, [0, 0, 200, 100], 0.90\ncar, [250, 500, 750, 1000], 0.87\n"), "{words}");
        assert_eq!(words.lines().count(), MAX_IN_PROMPT);
        assert_eq!(prompt_list(&[], &GroundingProfile::default()), "none");
    }

    #[test]
    fn a_known_height_gives_the_range() {
        let camera = Camera::quad();
        // 1.7 m at 12 m: 1.7 / 12 · 480 px / 720 px = 0.0944 of the height.
        let person = detection("person", [0.4, 0.4, 0.45, 0.4 + 1.7 / 12.0 * camera.fy / 720.0]);
        assert!((person.range(&camera).unwrap() - 12.0).abs() < 1e-9);
        let label = |of: &Detection| obstacles(core::slice::from_ref(of), &camera, None)[0].depth;
        assert_eq!(label(&person), label_of_range(12.0));
        // Cut by the right edge: half of it may be hidden.
        let aside = detection("person", [0.95, 0.4, 1.0, 0.4 + 1.7 / 12.0 * camera.fy / 720.0]);
        assert!((aside.range(&camera).unwrap() - 6.0).abs() < 1e-9);
        // Of a class of any height: as near as the smallest, 0.3 m on 72 pixels.
        let kite = detection("kite", [0.4, 0.4, 0.45, 0.5]);
        assert!((kite.range(&camera).unwrap() - 0.3 * camera.fy / 72.0).abs() < 1e-9);
        // Cut by the lower edge: near.
        let cut = detection("person", [0.4, 0.4, 0.45, 1.0]);
        assert_eq!((cut.range(&camera), label(&cut)), (None, 1));
    }

    #[test]
    fn what_is_called_as_the_target_is_it() {
        let called = |name: &str, target: &str| {
            let found = [detection(name, [0.1, 0.1, 0.2, 0.2])];
            obstacles(&found, &Camera::quad(), Some(target))[0].name == target
        };
        assert!(called("car", "the black car") && called("person", "man with the green shirt"));
        assert!(called("traffic light", "Traffic-light") && called("stop sign", "stop sign on the left"));
        assert!(!called("car", "carriage") && !called("light", "") && !called("traffic light", "light traffic"));
    }

    proptest! {
        #[test]
        fn any_text_is_read_without_panic_and_boxes_lie_in_the_image(
            text in any::<String>(),
            line in "[a-z_0-9]{1,9}( (x|y|width|height|score):[0-9.e-]{1,5}){0,6}",
        ) {
            let _ = parse_detections(&text);
            for Detection { score, area, name } in parse_detections(&line).unwrap_or_default() {
                prop_assert!(0.0 <= area.left && area.left <= area.right && area.right <= 1.0);
                prop_assert!(0.0 <= area.top && area.top <= area.bottom && area.bottom <= 1.0);
                prop_assert!((0.0..=1.0).contains(&score) && !name.contains('\n'));
            }
        }
    }
}
