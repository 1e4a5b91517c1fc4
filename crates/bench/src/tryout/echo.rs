//! Whether a model repeats the point of its last answer: small models copy numbers of the flight's history from the prompt.
//!
//! The pointing questions carry no history, and of the flights the true points are not known. So parts of an image are shown
//! one after the other, as a camera that pans sees them, and the policy of the flights writes the prompts, with its memory of
//! the answers before.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use spf_core::camera::Camera;
use spf_core::craft::Craft;
use spf_core::frame::{FrameId, FrameMeta};
use spf_core::geometry::{Attitude, Pose};
use spf_core::prompt::PromptText;
use spf_core::query::{ImageBox, ImagePoint, VerticalRoom};
use spf_core::time::{Duration, Time};
use spf_flight::dataset::Kind;
use spf_flight::pilot::{PolicyMaker, PolicyParts};
use spf_flight::policy::PolicyKind;
use spf_media::{Rgb, enlarged};
use spf_pilot::policy::{Expected, PolicyEvent, Step, View};
use spf_pilot::{PilotSettings, Preset};
use spf_vlm::{Cancel, QueryRequest, Usage, Vlm};

use super::kind_of;
use crate::ground::measure::outline;
use crate::ground::photo::{self, Photograph};
use crate::ground::{AnswerRow, Item};
use crate::stats::Rate;

/// Number of images of which parts are shown.
pub const IMAGES: usize = 6;
/// Number of parts shown of each.
pub const VIEWS: usize = 3;
/// Side of a part, as a fraction of the image's.
const PART: f64 = 0.8;
/// Least distance of the target's point from the left and right edges of a part, as a fraction of its width.
const MARGIN: f64 = 0.05;
/// The target's point moves at least by so much between two parts …
const MOVED: f64 = 0.02;
/// … and an answer as near as this to the one before repeats it; fractions of the image's sides.
const REPEATED: f64 = 0.01;
/// Time between two views, milliseconds.
const BETWEEN_MS: u64 = 2000;

/// An answer about a part of an image.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EchoRow {
    /// Name of the VLM.
    pub vlm: String,
    /// Key of the item.
    pub item: String,
    /// Number of the part, from 0.
    pub view: usize,
    /// The target's point.
    pub truth: ImagePoint,
    /// The point of the answer, if it has one.
    pub point: Option<ImagePoint>,
    /// Resources used.
    pub account: Usage,
}

/// Answers after another one about the same target, both with a point, between which the target's point has moved by more
/// than 2 % of the image: those that are within 1 % of the one before.
#[must_use]
pub fn repeated(rows: &[EchoRow]) -> Rate {
    let apart = |a: ImagePoint, b: ImagePoint| (a.u - b.u).abs().max((a.v - b.v).abs());
    let pairs = rows.windows(2).filter_map(|pair| {
        let [before, after] = pair else { return None };
        let follows = before.vlm == after.vlm && before.item == after.item && before.view + 1 == after.view;
        let points = before.point.zip(after.point).filter(|_| follows && apart(before.truth, after.truth) > MOVED);
        points.map(|(before, after)| apart(before, after) <= REPEATED)
    });
    pairs.collect()
}

/// The items of which parts can be shown: the target is there, and no other like it.
#[must_use]
pub fn shown(items: &[Item]) -> Vec<(&Item, [ImageBox; VIEWS])> {
    let present = items.iter().filter(|item| kind_of(item) == Some(Kind::Present));
    let parts = present.filter_map(|item| Some((item, parts(outline(item).ok()??.middle())?)));
    parts.take(IMAGES).collect()
}

/// Parts of an image, side by side, in which the target's point is now left, now right.
fn parts(target: ImagePoint) -> Option<[ImageBox; VIEWS]> {
    let most_left = (target.u - PART * (1.0 - MARGIN)).max(0.0);
    let most_right = (target.u - PART * MARGIN).min(1.0 - PART);
    let top = (target.v - 0.5 * PART).clamp(0.0, 1.0 - PART);
    // Half the way is the shortest move.
    (0.5 * (most_right - most_left) / PART > 1.5 * MOVED).then(|| {
        [most_left, most_right, 0.5 * (most_left + most_right)].map(|left| ImageBox {
            left,
            top,
            right: left + PART,
            bottom: top + PART,
        })
    })
}

/// Shows a model the parts of an item's image, with the history of the answers before, until one fails.
///
/// # Errors
/// If the image cannot be read.
pub fn ask(
    name: &str,
    vlm: &mut dyn Vlm,
    (item, parts): (&Item, [ImageBox; VIEWS]),
    time: Duration,
    prompt: &Arc<PromptText>,
    cancel: &Cancel,
) -> Result<Vec<EchoRow>, std::io::Error> {
    let unread =
        |error: &dyn core::fmt::Display| std::io::Error::other(format!("cannot read `{}`: {error}", item.image.display()));
    let image = spf_input::read(&item.image, photo::LONGEST_FILE).map_err(|error| unread(&error))?;
    let image = photo::decode(&image).map_err(|error| unread(&error))?;
    let target = outline(item).map_err(|error| unread(&error))?.map(|outline| outline.middle()).unwrap_or_default();
    let image_spec = vlm.image_spec((image.width(), image.height()));
    let settings = PilotSettings { avoid: false, ..PilotSettings::preset(Preset::Default) };
    let parts_of_policy = PolicyParts { settings, craft: Craft::quad(), image_spec, prompt: prompt.clone(), seed: 0 };
    let mut policy = PolicyKind::spf().policy(parts_of_policy);
    policy.handle(PolicyEvent::Instruction(&item.instruction));
    let mut rows = Vec::new();
    for (number, part) in parts.into_iter().enumerate() {
        let shown = view(&image, number, part);
        let Step::Ask(query) = policy.handle(PolicyEvent::Frame(&shown)).step else { break };
        let seen = enlarged(&image, [part.left, part.top, part.right, part.bottom], (image.width(), image.height()));
        let request = QueryRequest { query: &query, time_left: time, cancel: cancel.clone() };
        let answer = vlm.answer(&request, &mut Photograph::new(Arc::new(seen)));
        let row = AnswerRow::of(name, &item.key, answer, &image_spec.grounding);
        rows.push(EchoRow {
            vlm: name.to_owned(),
            item: item.key.clone(),
            view: number,
            truth: ImagePoint { u: (target.u - part.left) / PART, v: (target.v - part.top) / PART },
            point: row.reply().filter(|reply| reply.status.leads_to_a_point()).and_then(|reply| reply.point),
            account: row.account,
        });
        let Some(text) = row.text else { break };
        policy.handle(PolicyEvent::Reply { id: query.id, text: &text, arrived: Time::ZERO, pose: shown.pose });
    }
    Ok(rows)
}

/// A part of an image, as the view of a camera that has turned there.
fn view(image: &Rgb, number: usize, part: ImageBox) -> View {
    let (width, height) = (f64::from(image.width()), f64::from(image.height()));
    let focal = 0.9 * width;
    let camera = Camera {
        width: image.width(),
        height: image.height(),
        fx: focal / PART,
        fy: focal / PART,
        cx: 0.5 * width,
        cy: 0.5 * height,
        ..Camera::quad()
    };
    let heading = libm::atan(width * (0.5 * (part.left + part.right) - 0.5) / focal);
    let (id, at) = (number as u64, Time::from_millis(BETWEEN_MS * number as u64));
    View {
        frame: FrameMeta {
            id: FrameId(id),
            captured: at,
            received: at,
            capture_counter: id,
            width: image.width(),
            height: image.height(),
            unusable: None,
        },
        camera,
        pose: Pose { attitude: Attitude { heading, ..Attitude::default() }, ..Pose::default() },
        at_rest: true,
        room: VerticalRoom::default(),
        expected: Expected::Unknown,
        reckoned: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ground::{Shape, Target, Truth};
    use spf_vlm::{Answer, QueryImage};

    fn row(view: usize, truth: f64, point: Option<f64>) -> EchoRow {
        let at = |u: f64| ImagePoint { u, v: 0.5 };
        let (vlm, item) = ("m".to_owned(), "i".to_owned());
        EchoRow { vlm, item, view, truth: at(truth), point: point.map(at), account: Usage::default() }
    }

    #[test]
    fn only_answers_between_which_the_target_has_moved_can_repeat() {
        let rate = |rows: &[EchoRow]| {
            let rate = repeated(rows);
            (rate.hits, rate.of)
        };
        assert_eq!(rate(&[row(0, 0.2, Some(0.2)), row(1, 0.5, Some(0.209)), row(2, 0.8, Some(0.8))]), (1, 2));
        assert_eq!(rate(&[row(0, 0.2, Some(0.2)), row(1, 0.5, None), row(2, 0.8, Some(0.2))]), (0, 0));
        assert_eq!(rate(&[row(0, 0.2, Some(0.2)), row(1, 0.21, Some(0.2)), row(0, 0.5, Some(0.2))]), (0, 0));
    }

    #[test]
    fn the_target_is_in_every_part_and_moves_between_them() {
        for u in [0.1, 0.2, 0.5, 0.77, 0.9] {
            let target = ImagePoint { u, v: 0.3 };
            let seen = parts(target).unwrap().map(|part| (target.u - part.left) / PART);
            assert!(seen.iter().all(|at| (MARGIN - 1e-9..=1.0 - MARGIN + 1e-9).contains(at)), "{u}: {seen:?}");
            assert!(seen.windows(2).all(|pair| (pair[0] - pair[1]).abs() > MOVED), "{u}: {seen:?}");
        }
        assert_eq!((parts(ImagePoint { u: 0.02, v: 0.5 }), parts(ImagePoint { u: 0.99, v: 0.5 })), (None, None));
    }

    /// Points somewhere else each time, or always at the same place; notes how many answers each query recalls.
    struct Points {
        moves: bool,
        recalled: Vec<usize>,
    }

    impl Vlm for Points {
        fn name(&self) -> &'static str {
            "points"
        }

        fn answer(&mut self, request: &QueryRequest<'_>, _: &mut dyn QueryImage) -> Answer {
            self.recalled.push(request.query.memory.answers.len());
            let x = if self.moves { 100 * self.recalled.len() } else { 500 };
            let text = format!(r#"{{"target":"crane","status":"navigating","point":[500,{x}],"depth":5}}"#);
            Answer { text: Ok(text), latency: Duration::ZERO, model: "points".to_owned(), account: Usage::default() }
        }
    }

    #[test]
    fn the_prompts_carry_the_answers_before() {
        let folder = tempfile::tempdir().unwrap();
        let image = folder.path().join("image.jpg");
        std::fs::write(&image, spf_media::Jpeg::encode(&Rgb::filled(320, 240, [90; 3]), 80).unwrap().bytes()).unwrap();
        let middle = ImagePoint { u: 0.5, v: 0.5 };
        let target = Target { shape: Shape::Points(vec![middle], None), point: Some(middle), distance_m: None, boxes: vec![] };
        let (key, instruction) = ("i".to_owned(), "fly to the crane".to_owned());
        let item = Item { key, instruction, image, truth: Truth::Target(Box::new(target)), sim: None };
        let prompt = PromptText::shipped(spf_core::prompt::PromptKind::Point);
        for (moves, repeats) in [(true, 0), (false, 2)] {
            let mut vlm = Points { moves, recalled: Vec::new() };
            let asked = (&item, parts(middle).unwrap());
            let rows = ask("points", &mut vlm, asked, Duration::from_secs(1), &prompt, &Cancel::default()).unwrap();
            let rate = repeated(&rows);
            assert_eq!((rows.len(), rate.hits, rate.of), (VIEWS, repeats, 2));
            assert_eq!(vlm.recalled, [0, 1, 2]);
        }
    }
}
