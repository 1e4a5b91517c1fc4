//! Grades one answer against the ground truth.

use spf_core::query::ImageBox;
use spf_core::reply::Status;

use super::{Outline, ParsedReply, Truth};

/// Grades of one answer; `None` where the ground truth is unknown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Grade {
    /// Whether it points inside the target; an answer without a point, or an invalid one, is a miss. `None` if there is
    /// no target.
    pub hit: Option<bool>,
    /// Distance from the target's point, as a fraction of the target's size (√area); only for answers with a point.
    pub error_sides: Option<f64>,
    /// The same as a fraction of the image's width.
    pub error_width: Option<f64>,
    /// Whether it reports that the target is not visible; `None` for invalid answers.
    pub says_absent: Option<bool>,
    /// Whether the target is absent; `None` if unknown.
    pub is_absent: Option<bool>,
    /// The target's distance in metres and the label given.
    pub label: Option<(f64, f64)>,
    /// For each box of the answer, the largest intersection over union with a true one.
    pub boxes: Vec<f64>,
}

/// Grades an answer; `outline` is that of the target, `boxes` are the true boxes of the image.
#[must_use]
pub fn grade(truth: &Truth, outline: Option<&Outline>, boxes: &[ImageBox], parsed: &ParsedReply) -> Grade {
    let reply = if let ParsedReply::Reply(reply) = parsed { Some(reply) } else { None };
    let says_absent = reply.map(|reply| reply.status == Status::NotVisible);
    let point = reply.and_then(|reply| reply.point).filter(|_| says_absent == Some(false));
    match (truth, outline) {
        (Truth::Absent, _) => Grade { says_absent, is_absent: Some(true), ..Grade::default() },
        (Truth::Target(target), Some(outline)) => {
            let hit = match point {
                Some(point) => outline.holds(point),
                // Whether there is a target does not depend on the answer.
                None => outline.holds(outline.middle()).map(|_| false),
            };
            let error = point.map(|point| outline.error_px(point));
            let depth = reply.and_then(|reply| reply.depth).filter(|_| point.is_some()).map(f64::from);
            Grade {
                hit,
                error_sides: error.zip(outline.side_px()).map(|(error, side)| error / side),
                error_width: error.map(|error| error / outline.width_px()),
                says_absent,
                is_absent: Some(false),
                label: target.distance_m.zip(depth),
                boxes: reply.map_or_else(Vec::new, |reply| {
                    reply.boxes.iter().filter_map(|found| best_overlap(boxes, &found.area)).collect()
                }),
            }
        }
        _ => Grade { says_absent, ..Grade::default() },
    }
}

fn best_overlap(boxes: &[ImageBox], found: &ImageBox) -> Option<f64> {
    boxes.iter().map(|truth| truth.iou(found)).max_by(f64::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ground::{Shape, Target};
    use spf_core::query::ImagePoint;
    use spf_core::reply::Reply;

    fn reply(status: Status, point: Option<(f64, f64)>) -> ParsedReply {
        let point = point.map(|(u, v)| ImagePoint { u, v });
        ParsedReply::Reply(Reply { point, depth: point.map(|_| 5), ..Reply::new(status) })
    }

    fn target() -> Target {
        let area = ImageBox { left: 0.4, top: 0.4, right: 0.6, bottom: 0.6 };
        Target { shape: Shape::Boxes(vec![area]), point: None, distance_m: Some(8.0), boxes: vec![area] }
    }

    #[test]
    fn answers_about_something_that_is_there() {
        let outline = target().outline((100, 100)).unwrap();
        let truth = Truth::Target(Box::new(target()));
        let of = |parsed: &ParsedReply| grade(&truth, Some(&outline), &[], parsed);
        let hit = of(&reply(Status::Navigating, Some((0.5, 0.55))));
        assert_eq!(
            (hit.hit, hit.is_absent, hit.says_absent, hit.label),
            (Some(true), Some(false), Some(false), Some((8.0, 5.0)))
        );
        // Five pixels of a side of twenty, of a width of a hundred.
        assert!((hit.error_sides.unwrap() - 0.25).abs() < 1e-9 && (hit.error_width.unwrap() - 0.05).abs() < 1e-9);
        assert_eq!(of(&reply(Status::Navigating, Some((0.7, 0.5)))).hit, Some(false));
        let blind = of(&reply(Status::NotVisible, None));
        assert_eq!((blind.hit, blind.says_absent, blind.error_sides), (Some(false), Some(true), None));
        let unread = of(&ParsedReply::Refused("no JSON".to_owned()));
        assert_eq!((unread.hit, unread.says_absent), (Some(false), None));
        // Done, with the point shown.
        assert_eq!(of(&reply(Status::Done, Some((0.5, 0.5)))).hit, Some(true));
    }

    #[test]
    fn without_truth_there_is_no_hit_and_no_miss() {
        for parsed in [reply(Status::Navigating, Some((0.5, 0.5))), reply(Status::NotVisible, None)] {
            let grade = grade(&Truth::Unknown, None, &[], &parsed);
            assert_eq!((grade.hit, grade.error_width, grade.is_absent), (None, None, None));
        }
        let points = Target { shape: Shape::Points(vec![ImagePoint { u: 0.5, v: 0.5 }], None), ..target() };
        let outline = points.outline((100, 100)).unwrap();
        let truth = Truth::Target(Box::new(points));
        let of = |parsed: &ParsedReply| grade(&truth, Some(&outline), &[], parsed);
        assert_eq!(of(&reply(Status::Navigating, Some((0.5, 0.5)))).hit, None);
        assert_eq!(of(&reply(Status::NotVisible, None)).hit, None);
    }
}
