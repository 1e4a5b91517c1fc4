//! Layout changes of variants: objects are shuffled, moved, added, or start elsewhere.

use core::f64::consts::TAU;

use spf_core::rng::RandomStream;
use toml::Spanned;

use super::super::expand::{self, Expanded, Placed};
use super::super::raw::vary::RawAdd;
use super::super::raw::{RawObject, RawScene};
use super::super::source::Source;
use super::room::{Move, Room};
use super::{Span, paint, permutation};
use crate::actors::begins_on;
use crate::error::SceneError;
use crate::limits::MAX_OBJECTS;

/// Maximum number of attempts for a change that does not fit.
const TRIES: usize = 24;
/// Maximum number of objects that a table adds, and of its places.
const MOST: usize = 200;

/// Maximum displacement and turn of an object.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reach {
    /// Metres.
    pub(super) distance: f64,
    /// Degrees to either side.
    pub(super) turn_deg: f64,
}

/// Lets objects exchange places, two at a time, where both fit (Fisher and Yates, with more attempts).
pub(super) fn shuffle(objects: &[usize], placed: &mut [Placed], room: &mut Room, rng: &mut RandomStream) {
    for last in (1..objects.len()).rev() {
        for _ in 0..TRIES {
            let other = rng.below(last + 1);
            let (a, b) = (objects[last], objects[other]);
            let to = |object, tenant| Move { object, place: room.place(tenant), tenant: Some(tenant) };
            let moves = [to(a, b), to(b, a)];
            if other == last {
                break;
            }
            if room.try_move(&moves, false, placed) {
                // The group belongs to the place: an object in the car park belongs to the car park.
                let group = placed[a].tags.group.take();
                placed[a].tags.group = core::mem::replace(&mut placed[b].tags.group, group);
                break;
            }
        }
    }
}

/// Moves some objects as one, turning about the first, if they fit somewhere within reach.
pub(super) fn jitter(group: &[usize], reach: Reach, placed: &mut [Placed], room: &mut Room, rng: &mut RandomStream) {
    let Some(&first) = group.first() else { return };
    let pivot = room.place(first);
    for _ in 0..TRIES {
        // Uniform over the disc.
        let distance = reach.distance * libm::sqrt(rng.uniform());
        let direction = TAU * rng.uniform();
        let turn_deg = reach.turn_deg * (2.0 * rng.uniform() - 1.0);
        let mut to = pivot;
        to.position[0] += distance * libm::sin(direction);
        to.position[1] += distance * libm::cos(direction);
        to.heading_deg += turn_deg;
        let moved = |&object: &usize| Move { object, place: room.place(object).carried(&pivot, &to), tenant: Some(object) };
        let moves: Vec<Move> = group.iter().map(moved).collect();
        if room.try_move(&moves, true, placed) || room.is_spent() {
            return;
        }
    }
}

/// Lets actors start elsewhere on their paths, none of them on another.
pub(super) fn depart(objects: &[usize], placed: &mut [Placed], room: &mut Room, rng: &mut RandomStream) {
    for &object in objects {
        let Some(motion) = &mut placed[object].motion else { continue };
        for _ in 0..TRIES {
            if !room.may_look_at_actors() {
                return;
            }
            let courses = room.courses();
            let Some(at) = courses.iter().position(|(of, _)| *of == object) else { break };
            let start = rng.uniform();
            courses[at].1.set_start(start);
            let others = courses.iter().enumerate().filter(|(other, _)| *other != at).map(|(_, (_, course))| course);
            if !begins_on(&courses[at].1, others) {
                motion.start = start;
                break;
            }
            courses[at].1.set_start(motion.start);
        }
    }
}

/// Adds some objects at some of the places, where they fit.
pub(super) fn add(
    table: &Spanned<RawAdd>,
    raw: &RawScene,
    expanded: &mut Expanded,
    room: &mut Room,
    rng: &mut RandomStream,
    source: &Source<'_>,
) -> Result<(), SceneError> {
    let (span, table) = (table.span(), table.get_ref());
    check(table, &span, raw, expanded, source)?;
    let [least, most] = table.count.get_ref().map(|n| n as usize);
    let count = least + rng.below(most - least + 1);
    let colours = paint::order(&table.colours, rng);
    let places = table.places.get_ref();
    let mut added = 0;
    for at in permutation(places.len(), rng) {
        if added == count || expanded.placed.len() >= MAX_OBJECTS || room.is_spent() {
            break;
        }
        let colour = if colours.is_empty() { None } else { Some(&colours[added % colours.len()]) };
        let object = extra(table, &places[at], added + 1, colour);
        expand::unroll(raw, &Spanned::new(span.clone(), object), expanded, source)?;
        let Some((last, _)) = expanded.placed.split_last() else { break };
        room.push(last, None, expanded.meshes[last.mesh].as_ref());
        if !room.is_full() && room.has_room_for_last() {
            added += 1;
        } else {
            room.pop();
            expanded.pop();
        }
    }
    Ok(())
}

/// Rejects what would otherwise be rejected for some seeds only: the number, the places, the template, the ids, the
/// colours.
fn check(table: &RawAdd, span: &Span, raw: &RawScene, expanded: &mut Expanded, source: &Source<'_>) -> Result<(), SceneError> {
    let [least, most] = table.count.get_ref().map(|n| n as usize);
    if least > most || most > MOST {
        let message = format!("`count` must be an increasing range up to {MOST}");
        return Err(source.error(&table.count.span(), message, Some("for example `count = [0, 3]`".to_owned())));
    }
    let places = table.places.get_ref();
    if places.is_empty() || places.len() > MOST {
        let hint = "use `places = [[east, north, heading_deg], …]`".to_owned();
        return Err(source.error(&table.places.span(), format!("there must be 1 to {MOST} `places`"), Some(hint)));
    }
    if expanded.placed.len() >= MAX_OBJECTS {
        return Ok(());
    }
    for place in places {
        let object = extra(table, place, 1, None);
        expand::unroll(raw, &Spanned::new(span.clone(), object), expanded, source)?;
        let moves = expanded.placed.last().is_some_and(|last| last.motion.is_some() || last.opening_of.is_some());
        let slots = expanded.meshes.last().map_or(&[][..], |mesh| mesh.slots());
        paint::check(&table.colours, paint_slot(table), slots, raw, span, source)?;
        expanded.pop();
        if moves {
            return Err(source.error(span, "`vary.add` cannot add moving objects or openings", None));
        }
    }
    if let Some(number) = (1..=most).find(|number| expanded.has(&format!("{}_{number}", table.id))) {
        let hint = "give the table an `id` that is not a prefix of any object's id".to_owned();
        return Err(source.error(span, format!("duplicate id `{}_{number}`", table.id), Some(hint)));
    }
    Ok(())
}

fn paint_slot(table: &RawAdd) -> &str {
    table.slot.as_deref().unwrap_or("body")
}

/// The object that a table adds at a place, as a file would define it.
fn extra(table: &RawAdd, place: &[f64], number: usize, colour: Option<&(String, (String, Span))>) -> RawObject {
    let mut object = RawObject {
        id: Some(format!("{}_{number}", table.id)),
        like: Some(table.like.clone()),
        mesh: table.mesh.clone(),
        ..RawObject::default()
    };
    let at = |values: &[f64]| Some(Spanned::new(table.places.span(), values.to_vec()));
    match *place {
        [east, north, heading] => {
            object.position = at(&[east, north]);
            object.heading_deg = Some(Spanned::new(table.places.span(), heading));
        }
        [east, north, up, heading] => {
            object.position = at(&[east, north, up]);
            object.heading_deg = Some(Spanned::new(table.places.span(), heading));
        }
        // Wrong numbers of coordinates are rejected like those of an object's position.
        _ => object.position = at(&place[..place.len().min(5)]),
    }
    if let Some((word, (material, at))) = colour {
        object.colour = Some(word.clone());
        object.materials.insert(paint_slot(table).to_owned(), Spanned::new(at.clone(), material.clone()));
    }
    object
}
