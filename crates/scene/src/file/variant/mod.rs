//! Variants of a scene: layout, colours, people and light changed from a seed (`docs/reference/scene-format.md`,
//! "Variants").
//!
//! The `vary` tables of the file define what may change. Each table samples from the seed and its own number, so that
//! an additional table does not affect the others. A change that would make objects overlap, or block the start, is
//! sampled again, and dropped after some attempts.

mod layout;
mod paint;
mod room;
mod shape;

use std::collections::BTreeMap;
use std::ops::Range;

use spf_core::rng::RandomStream;
use toml::Spanned;

use self::room::Room;
use super::expand::{Expanded, Placed};
use super::raw::RawScene;
use super::raw::vary::{RawRepaint, RawVary, RawVaryLight};
use super::source::Source;
use crate::error::{SceneError, nearest};
use crate::light::SceneLook;

/// Maximum number of tables of a kind.
const MAX_TABLES: usize = 64;

/// Turns a scene into its variant with that seed; light and weather that the conditions leave open are sampled too.
pub(super) fn vary(
    raw: &mut RawScene,
    expanded: &mut Expanded,
    conditions: &mut SceneLook,
    seed: u64,
    source: &Source<'_>,
) -> Result<(), SceneError> {
    let Some(tables) = raw.vary.take() else { return Err(SceneError::no_variants(source.name(), 1)) };
    check_number(&tables, source)?;
    let mut room = Room::new(raw, &expanded.placed, &expanded.meshes);
    if room.is_full() {
        return Ok(());
    }
    for (table, number) in tables.shuffle.iter().zip(0..) {
        let objects = select(&table.objects, &expanded.placed, Wanted::Still, source)?;
        layout::shuffle(&objects, &mut expanded.placed, &mut room, &mut RandomStream::new(seed, "vary shuffle", &[number]));
    }
    for (table, number) in tables.jitter.iter().zip(0..) {
        let objects = select(&table.objects, &expanded.placed, Wanted::Still, source)?;
        let reach = layout::Reach {
            distance: within(&table.distance_m, "distance_m", 0.0, 1000.0, source)?,
            turn_deg: table.turn_deg.as_ref().map_or(Ok(0.0), |v| within(v, "turn_deg", 0.0, 180.0, source))?,
        };
        let mut rng = RandomStream::new(seed, "vary jitter", &[number]);
        let groups: Vec<&[usize]> = if table.together { vec![&objects] } else { objects.chunks(1).collect() };
        for group in groups {
            layout::jitter(group, reach, &mut expanded.placed, &mut room, &mut rng);
        }
    }
    for (table, number) in tables.depart.iter().zip(0..) {
        let objects = select(&table.objects, &expanded.placed, Wanted::Moving, source)?;
        layout::depart(&objects, &mut expanded.placed, &mut room, &mut RandomStream::new(seed, "vary depart", &[number]));
    }
    for (table, number) in tables.add.iter().zip(0..) {
        layout::add(table, raw, expanded, &mut room, &mut RandomStream::new(seed, "vary add", &[number]), source)?;
    }
    for (table, number) in tables.repaint.iter().zip(0..) {
        let mut rng = RandomStream::new(seed, "vary repaint", &[number]);
        repaint(table, raw, expanded, &room, &mut rng, source)?;
    }
    paint::rename(&mut expanded.placed);
    relight(&tables.light, raw, conditions, seed, source)
}

/// Rejects an excessive number of tables: each costs some work.
fn check_number(tables: &RawVary, source: &Source<'_>) -> Result<(), SceneError> {
    let numbers = [tables.shuffle.len(), tables.jitter.len(), tables.repaint.len(), tables.depart.len(), tables.add.len()];
    if numbers.iter().all(|number| *number <= MAX_TABLES) {
        return Ok(());
    }
    Err(source.error(&(0..0), format!("there may be at most {MAX_TABLES} tables of each kind under `vary`"), None))
}

/// Repaints the objects of one table: each colour is used once before any is used again.
fn repaint(
    table: &RawRepaint,
    raw: &RawScene,
    expanded: &mut Expanded,
    room: &Room,
    rng: &mut RandomStream,
    source: &Source<'_>,
) -> Result<(), SceneError> {
    let objects = select(&table.objects, &expanded.placed, Wanted::Any, source)?;
    let colours = paint::order(table.colours.get_ref(), rng);
    if colours.is_empty() {
        let hint = "for example `{ red = \"red_paint\" }`".to_owned();
        return Err(source.error(&table.colours.span(), "`colours` is empty", Some(hint)));
    }
    for (&object, (word, material)) in objects.iter().zip(colours.iter().cycle()) {
        let slots = expanded.meshes[expanded.placed[object].mesh].slots();
        if object == objects[0] || slots.iter().all(|(slot, _)| *slot != table.slot) {
            paint::check(table.colours.get_ref(), &table.slot, slots, raw, &table.objects.span(), source)?;
        }
        let thing = &mut expanded.placed[object];
        if room.spend(paint::text_length(thing)) {
            paint::paint(thing, &table.slot, word, material);
        }
    }
    Ok(())
}

/// Light, weather and the position of the sun.
fn relight(
    table: &RawVaryLight,
    raw: &mut RawScene,
    conditions: &mut SceneLook,
    seed: u64,
    source: &Source<'_>,
) -> Result<(), SceneError> {
    let pick = |rng: &mut RandomStream, n: usize| (n > 0).then(|| rng.below(n));
    let (mut time, mut weather) = (RandomStream::new(seed, "vary time", &[]), RandomStream::new(seed, "vary weather", &[]));
    let drawn = pick(&mut time, table.times.len()).map(|i| table.times[i]);
    conditions.lighting = conditions.lighting.or(drawn);
    conditions.weather = conditions.weather.or(pick(&mut weather, table.weathers.len()).map(|i| table.weathers[i]));
    let mut sun = RandomStream::new(seed, "vary sun", &[]);
    let mut between = |range: &Option<Spanned<[f64; 2]>>, low: f64, high: f64| {
        let fraction = sun.uniform();
        range.as_ref().map(|range| {
            let [from, to] = *range.get_ref();
            if !(low <= from && from <= to && to <= high) {
                let message = format!("the range must be increasing and within {low} to {high}");
                return Err(source.error(&range.span(), message, Some("for example `[20.0, 60.0]`".to_owned())));
            }
            Ok(Spanned::new(range.span(), from + (to - from) * fraction))
        })
    };
    if let Some(azimuth) = between(&table.sun_azimuth_deg, -360.0, 360.0).transpose()? {
        raw.light.sun_azimuth_deg = Some(azimuth);
    }
    if let Some(elevation) = between(&table.sun_elevation_deg, 1.0, 90.0).transpose()? {
        raw.light.sun_elevation_deg = Some(elevation);
    }
    Ok(())
}

/// The objects that a table may name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Wanted {
    Still,
    Moving,
    Any,
}

/// The objects with some ids; the id of a row means all of it. In the order of the scene, each once.
fn select(ids: &Spanned<Vec<String>>, placed: &[Placed], wanted: Wanted, source: &Source<'_>) -> Result<Vec<usize>, SceneError> {
    let error = |message: String, hint: Option<String>| source.error(&ids.span(), message, hint);
    let mut known: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (at, object) in placed.iter().enumerate() {
        known.entry(&object.key).or_default().push(at);
        let row = object.key.rsplit_once('_').filter(|(_, n)| !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit()));
        if let Some((row, _)) = row {
            known.entry(row).or_default().push(at);
        }
    }
    let mut chosen = vec![false; placed.len()];
    for id in ids.get_ref() {
        let found = known.get(id.as_str());
        for &at in found.into_iter().flatten() {
            let object = &placed[at];
            if wanted != Wanted::Any && object.motion.is_some() != (wanted == Wanted::Moving) {
                let message = if wanted == Wanted::Moving { "does not move" } else { "moves" };
                return Err(error(format!("`{}` {message}", object.key), Some("use another `vary` table for it".to_owned())));
            }
            if object.opening_of.is_some() {
                let hint = "an opening moves with its object".to_owned();
                return Err(error(format!("`{}` is an opening", object.key), Some(hint)));
            }
            chosen[at] = true;
        }
        if found.is_none() {
            let near = nearest(id, placed.iter().map(|object| object.key.as_str()));
            return Err(error(format!("unknown object `{id}`"), near.map(|near| format!("did you mean `{near}`?"))));
        }
    }
    Ok((0..placed.len()).filter(|&object| chosen[object]).collect())
}

/// A number within limits.
fn within(value: &Spanned<f64>, key: &str, low: f64, high: f64, source: &Source<'_>) -> Result<f64, SceneError> {
    let v = *value.get_ref();
    if (low..=high).contains(&v) {
        return Ok(v);
    }
    Err(source.error(&value.span(), format!("`{key}` must be from {low} to {high}, not `{v}`"), None))
}

/// A random order of `0..n` (Fisher and Yates).
fn permutation(n: usize, rng: &mut RandomStream) -> Vec<usize> {
    let mut order: Vec<usize> = (0..n).collect();
    for i in (1..n).rev() {
        order.swap(i, rng.below(i + 1));
    }
    order
}

/// Position of a table in the text.
type Span = Range<usize>;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_permutation_has_everything_once() {
        let mut order = permutation(20, &mut RandomStream::new(3, "test", &[]));
        assert_ne!(order, (0..20).collect::<Vec<_>>());
        order.sort_unstable();
        assert_eq!(order, (0..20).collect::<Vec<_>>());
    }
}
