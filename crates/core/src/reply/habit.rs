//! Answers of families that point in a form of their own, whatever is asked for ([`Habit`]).
//!
//! Molmo writes `<point x="61.5" y="40.2" alt="crane">crane</point>`, or several in one tag (`x1`, `y1`, `x2`, …), in percent
//! (<https://huggingface.co/allenai/Molmo-7B-O-0924/discussions/1>); Molmo 2 `<points coords="1 1 334 567">crane</points>`: the
//! number of the image, then for each point its own number and thousandths. Of several the first counts. If there is nothing to
//! point at, it has learned to say "There are none." Gemini Robotics-ER writes a list of `{"point": [y, x], "label": …}`
//! (<https://ai.google.dev/gemini-api/docs/robotics-overview>), which is JSON: only the empty list is read here.

use super::parse::{ReplyError, one_line};
use super::{Reply, Status};
use crate::grounding::{AxisOrder, GroundingProfile, Habit};

/// How Molmo says that there is nothing to point at.
const NONE: &str = "There are none";
const TAG: &str = "<point";

/// The reply in an answer without JSON; `None` if it is none of this family's forms, or several.
pub(super) fn by_habit(text: &str, profile: &GroundingProfile, avoid: bool) -> Option<Result<Reply, ReplyError>> {
    let bare = text.trim().trim_start_matches("```json").trim_matches('`').trim();
    let reply = match profile.habit {
        Habit::Asked => return None,
        Habit::List if bare == "[]" => Ok(Reply::new(Status::NotVisible)),
        Habit::List => return None,
        Habit::Tags if bare.trim_end_matches('.') == NONE => Ok(Reply::new(Status::NotVisible)),
        Habit::Tags => tagged(text, profile)?,
    };
    // Its row turns obstacle mode off; whoever turns it on needs the list.
    Some(if avoid { Err(ReplyError::Missing { field: "boxes".to_owned() }) } else { reply })
}

/// The first point of the only tag: of several it cannot be told which copies a text in the image.
fn tagged(text: &str, profile: &GroundingProfile) -> Option<Result<Reply, ReplyError>> {
    let mut tags = text.match_indices(TAG);
    let (at, _) = tags.next().filter(|_| tags.next().is_none())?;
    let rest = &text[at + TAG.len()..];
    let rest = rest.strip_prefix('s').unwrap_or(rest);
    let ([x, y], rest) = first_of_coords(rest).or_else(|| first_of_axes(rest))?;
    let pair = if profile.order == AxisOrder::Xy { [x, y] } else { [y, x] };
    let name = rest.split_once('>').and_then(|(_, inner)| inner.split_once("</point")).map(|(name, _)| one_line(name));
    Some(match profile.point(pair) {
        Ok(point) => {
            Ok(Reply { target: name.filter(|name| !name.is_empty()), point: Some(point), ..Reply::new(Status::Navigating) })
        }
        Err(source) => Err(ReplyError::PointOutside { field: "point".to_owned(), source }),
    })
}

fn first_of_axes(rest: &str) -> Option<([f64; 2], &str)> {
    let (x, rest) = attribute(rest, &["x", "x1"])?;
    let (y, rest) = attribute(rest, &["y", "y1"])?;
    Some(([x.parse().ok()?, y.parse().ok()?], rest))
}

fn first_of_coords(rest: &str) -> Option<([f64; 2], &str)> {
    let (coords, rest) = attribute(rest, &["coords"])?;
    let numbers: Vec<f64> = coords.split_ascii_whitespace().map(|number| number.parse().ok()).collect::<Option<_>>()?;
    match numbers[..] {
        // There is one image.
        [image, _, x, y, ..] if image == 1.0 && numbers.len() % 3 == 1 => Some(([x, y], rest)),
        _ => None,
    }
}

/// The value of the next attribute, if it has one of these names, and what follows.
fn attribute<'a>(rest: &'a str, names: &[&str]) -> Option<(&'a str, &'a str)> {
    let rest = rest.strip_prefix([' ', '\n'])?.trim_start();
    let value = names.iter().find_map(|name| rest.strip_prefix(name)?.strip_prefix("=\""))?;
    value.split_once('"').map(|(value, rest)| (value.trim(), rest))
}
