//! The percept of a frame: what the oracle notices in the image, sampled by frame number
//! (`docs/explanation/oracle.md`).

use std::collections::{BTreeMap, BTreeSet};

use libm::{exp, sqrt};
use spf_core::camera::Camera;
use spf_core::frame::FrameId;
use spf_core::query::{ImageBox, ImagePoint};
use spf_core::rng::RandomStream;
use spf_core::sign::Arrow;
use spf_core::tags::Tagged;

use super::errors::ErrorFile;
use super::extent::Obstacle;
use super::language::score::vocabulary;
use super::masks::{Mask, central, end_of_run, masks};
use super::obedience::taken_for;
use super::obstacles::obstacles;
use super::sight::{GroundTruthView, PerceivedObject, SIZE_SENT, slopes, stretch};

/// What the oracle notices in one frame; shared by all queries about it.
#[derive(Clone, Debug, PartialEq)]
pub struct Percept {
    /// The frame.
    pub frame: FrameId,
    /// The camera that took it.
    pub camera: Camera,
    /// Image row level with the craft, as a fraction from the top: the horizon on open ground.
    pub level: f64,
    /// Free distance straight ahead, metres; infinite without an obstacle.
    pub ahead: f64,
    /// The image point with the most room for level flight, and its range, metres, at most 40.
    pub open: (ImagePoint, f64),
    pub(super) things: Vec<PerceivedObject>,
    /// What may be in the way of a flight, noticed or not.
    obstacles: Vec<Obstacle>,
    /// The signs that face the camera.
    pub(super) signs: Vec<PerceivedSign>,
    /// All words of the scene's tags, visible or not, so that an instruction is read alike in every frame.
    pub(super) words: BTreeSet<String>,
    /// Those of the scene's objects that belong to a place, visible or not: where a thing belongs is told by tags alone.
    pub(super) placed: Vec<Tagged>,
}

impl Percept {
    /// Samples the percept of a frame. Independent parts run in parallel; the result does not depend on the number of
    /// threads.
    pub(super) fn draw(errors: &ErrorFile, seed: u64, frame: FrameId, sight: &GroundTruthView<'_>, tags: &[Tagged]) -> Self {
        let things = |opening| things((errors, seed, frame), sight, tags, opening);
        let ((mut things, openings), (level, walls)) = rayon::join(
            || (things(false), things(true)),
            || {
                let level = level(sight, tags);
                (level, Walls::of(sight, level))
            },
        );
        things.extend(openings);
        let (signs, obstacles) = rayon::join(|| perceived(sight, &things), || obstacles(errors, seed, frame.0, sight, &things));
        let words = vocabulary(tags.iter());
        let (ahead, open) = (walls.room(sight.camera.cx), walls.most_open(level));
        let placed = tags.iter().filter(|tags| tags.group.is_some()).cloned().collect();
        Self { frame, camera: *sight.camera, level, ahead, open, things, obstacles, signs, words, placed }
    }

    /// The objects noticed if the image is sent at `size`, by default [`SIZE_SENT`].
    pub fn seen<'a>(&'a self, errors: &'a ErrorFile, size: Option<(u32, u32)>) -> impl Iterator<Item = &'a PerceivedObject> {
        self.seen_with_chance(errors, size).map(|(thing, _)| thing)
    }

    /// The same, with the probability of noticing each.
    pub(super) fn seen_with_chance<'a>(
        &'a self,
        errors: &'a ErrorFile,
        size: Option<(u32, u32)>,
    ) -> impl Iterator<Item = (&'a PerceivedObject, f64)> {
        let scale = scale_of(size);
        let chances = self.things.iter().map(move |thing| (thing, chance_seen(errors, thing.size * scale)));
        chances.filter(|(thing, chance)| thing.luck < *chance)
    }

    /// The obstacles noticed in an image sent at `size`, by default [`SIZE_SENT`], each with its object: of one that is noticed, the
    /// parts that are large enough.
    pub(super) fn noticed_obstacles<'a>(
        &'a self,
        errors: &'a ErrorFile,
        size: Option<(u32, u32)>,
    ) -> impl Iterator<Item = (&'a Obstacle, &'a PerceivedObject)> {
        let scale = scale_of(size);
        let of = |obstacle: &'a Obstacle| {
            let thing = self.things.iter().find(|thing| thing.id == obstacle.object && !thing.tags.opening)?;
            Some((obstacle, thing))
        };
        self.obstacles.iter().filter_map(of).filter(move |(obstacle, thing)| {
            thing.luck < chance_seen(errors, thing.size * scale) && thing.luck < chance_seen(errors, obstacle.size * scale)
        })
    }
}

/// Scale of an image sent at a size, by default [`SIZE_SENT`].
fn scale_of(size: Option<(u32, u32)>) -> f64 {
    let pixels = |(w, h): (u32, u32)| f64::from(w) * f64::from(h);
    sqrt(pixels(size.unwrap_or(SIZE_SENT)) / pixels(SIZE_SENT))
}

/// Probability of noticing an object with this square root of its pixel count.
pub(super) fn chance_seen(errors: &ErrorFile, size: f64) -> f64 {
    let seen = &errors.seen;
    let width = (seen.sure_px - seen.half_px) / NINETEEN_LN;
    (1.0 - seen.missed) * logistic(size - seen.half_px, width)
}

/// ln 19: a logistic function reaches 95 % this many widths above its centre.
const NINETEEN_LN: f64 = 2.944_438_979_166_440_3;

/// `1 / (1 + exp(−x / width))`; a step at 0 (inclusive) when the width is 0.
pub(super) fn logistic(x: f64, width: f64) -> f64 {
    if width > 0.0 { 1.0 / (1.0 + exp(-x / width)) } else { f64::from(u8::from(x >= 0.0)) }
}

/// The tagged objects of the ordinary image, or of the image of openings, in ascending order of id.
fn things(of: (&ErrorFile, u64, FrameId), sight: &GroundTruthView<'_>, tags: &[Tagged], opening: bool) -> Vec<PerceivedObject> {
    let (errors, seed, frame) = of;
    let (w, h) = (sight.width, sight.height);
    let (ids, depth) = if opening { (sight.opening_ids, sight.opening_depth) } else { (sight.ids, sight.depth) };
    let most = ids.iter().fold(0, |most, id| *id.max(&most));
    if w == 0 || ids.len() < w * h || depth.len() < w * h || most == 0 {
        return Vec::new();
    }
    let ((nearest, masks), mains) = rayon::join(
        || rayon::join(|| nearest(sight, most, &ids[..w * h], &depth[..w * h]), || masks(ids, w)),
        || if opening { BTreeMap::new() } else { main_parts(sight) },
    );
    let tagged = |mask: &Mask| tags.iter().find(|tags| tags.id == mask.id && tags.opening == opening);
    let seen = masks.iter().filter_map(|mask| Some((mask, tagged(mask)?)));
    seen.map(|(mask, own)| {
        let nearest = nearest[usize::from(mask.id)];
        let mut thing = thing(errors, seed, frame, sight, (depth, nearest), (mask, mains.get(&mask.id)), own);
        if let Some(other) = taken_for(errors.obeys, seed, frame, own, tags) {
            thing.tags = other;
        }
        thing
    })
    .collect()
}

/// The visible main part of each object that has one; of several the largest.
fn main_parts(sight: &GroundTruthView<'_>) -> BTreeMap<u16, Mask> {
    let piece = |number: u16| usize::from(number).checked_sub(1).and_then(|at| sight.pieces.get(at));
    let is_main: Vec<bool> = core::iter::once(false).chain(sight.pieces.iter().map(|piece| piece.main)).collect();
    let only = |number: &u16| if is_main.get(usize::from(*number)) == Some(&true) { *number } else { 0 };
    let mains: Vec<u16> = sight.piece_ids.iter().map(only).collect();
    let mut largest: BTreeMap<u16, Mask> = BTreeMap::new();
    for mask in central(&mains, sight.width) {
        let Some(object) = piece(mask.id).map(|piece| piece.object) else { continue };
        if largest.get(&object).is_none_or(|known| known.area < mask.area) {
            largest.insert(object, mask);
        }
    }
    largest
}

/// `depth` is that of the image with the object, and the distance to its nearest surface there; `main` the mask of its main part.
fn thing(
    errors: &ErrorFile,
    seed: u64,
    frame: FrameId,
    sight: &GroundTruthView<'_>,
    (depth, nearest): (&[f32], f64),
    (mask, main): (&Mask, Option<&Mask>),
    tags: &Tagged,
) -> PerceivedObject {
    let (w, h) = (sight.width as f64, sight.height as f64);
    let key = [frame.0, u64::from(mask.id)];
    let area = mask.area as f64;
    let light = f64::from(*sight.light.get(&mask.id).unwrap_or(&1.0)).clamp(0.0, 1.0);
    let fraction = f64::from(*sight.in_frame.get(&mask.id).unwrap_or(&1.0));
    let bounds = ImageBox {
        left: mask.left as f64 / w,
        top: mask.top as f64 / h,
        right: (mask.right + 1) as f64 / w,
        bottom: (mask.bottom + 1) as f64 / h,
    };
    let sent = f64::from(SIZE_SENT.0) * f64::from(SIZE_SENT.1);
    let size = |area: u64| sqrt(area as f64 * sent / (w * h)) * light;
    let luck = RandomStream::new(seed, "oracle seen", &key).uniform();
    // It is pointed at in its main part if that is noticed.
    let shown = main.filter(|main| luck < chance_seen(errors, size(main.area))).unwrap_or(mask);
    let pixel = shown.deepest;
    let deepest = ImagePoint { u: (pixel.0 as f64 + 0.5) / w, v: (pixel.1 as f64 + 0.5) / h };
    let mut noise = RandomStream::new(seed, "oracle point", &key);
    let spread = (errors.point.width_share * w).max(errors.point.size_share * sqrt(shown.area as f64));
    let point = ImagePoint {
        u: (deepest.u + spread * noise.normal() / w).clamp(0.0, 1.0),
        v: (deepest.v + spread * noise.normal() / h).clamp(0.0, 1.0),
    };
    let along = f64::from(depth[pixel.1 * sight.width + pixel.0]);
    let slip = exp(errors.range.log_sd * RandomStream::new(seed, "oracle range", &key).normal());
    let range = along * stretch(sight.camera, deepest) * slip;
    let past = f64::from(sight.depth.get(pixel.1 * sight.width + pixel.0).copied().unwrap_or(0.0));
    PerceivedObject {
        id: mask.id,
        tags: tags.clone(),
        area: mask.area,
        bounds,
        deepest,
        point,
        range: if range.is_finite() { range } else { f64::INFINITY },
        nearest: (nearest * slip).min(range),
        beyond: if past > 0.0 && past.is_finite() { past * stretch(sight.camera, deepest) } else { f64::INFINITY },
        // `docs/explanation/oracle.md`, "In view": at least 0.8 % of the frame high and a quarter inside it, or filling a
        // fiftieth of it: of a tower that large a part is named and pointed at, however much of it is outside.
        in_view: (bounds.bottom - bounds.top >= 0.008 && fraction >= 0.25) || area >= 0.02 * w * h,
        clearly: fraction >= 0.25 || area >= 0.1 * w * h,
        cut: mask.cut(sight.width, sight.height),
        size: size(mask.area),
        luck,
    }
}

/// Straight-line distance to the nearest visible surface of each object in an id image, metres, by id up to `most`.
fn nearest(sight: &GroundTruthView<'_>, most: u16, ids: &[u16], depth: &[f32]) -> Vec<f64> {
    let (w, h) = (sight.width, sight.height);
    // Squared, with terms that depend only on the row or only on the column kept separate.
    let mut least = vec![f64::INFINITY; usize::from(most) + 1];
    let at = |x: usize, y: usize| ImagePoint { u: (x as f64 + 0.5) / w as f64, v: (y as f64 + 0.5) / h as f64 };
    let aside: Vec<f64> = (0..w).map(|x| slopes(sight.camera, at(x, 0)).0).map(|right| right * right).collect();
    for (y, (ids, depth)) in ids.chunks_exact(w).zip(depth.chunks_exact(w)).enumerate() {
        let up = slopes(sight.camera, at(0, y)).1;
        let level = 1.0 + up * up;
        let mut first = 0;
        // Runs of one object are processed together, and empty ones are skipped.
        while first < w {
            let (from, to) = (first, end_of_run(ids, first));
            first = to;
            let id = ids[from];
            if id == 0 {
                continue;
            }
            let square = |along: f32, aside: f64| {
                let along = f64::from(along);
                if along > 0.0 { along * along * (level + aside) } else { f64::INFINITY }
            };
            let lesser = |least: f64, squared: f64| if squared < least { squared } else { least };
            // Four lanes with a minimum each; the overall minimum is the same.
            let ((depths, depth), (asides, aside)) = (depth[from..to].as_chunks::<4>(), aside[from..to].as_chunks::<4>());
            let mut fours = [f64::INFINITY; 4];
            for (depth, aside) in depths.iter().zip(asides) {
                for i in 0..4 {
                    fours[i] = lesser(fours[i], square(depth[i], aside[i]));
                }
            }
            let rest = depth.iter().zip(aside).map(|(along, aside)| square(*along, *aside));
            let least = &mut least[usize::from(id)];
            *least = fours.into_iter().chain(rest).fold(*least, lesser);
        }
    }
    least.into_iter().map(sqrt).collect()
}

/// Half the width needed by a craft flying straight on, metres: 0.3 m radius and as much clearance.
const ROOM_M: f64 = 0.6;
/// Distance between sampled columns, pixels.
const ROOM_STEP: usize = 4;

/// The image row of level flight: the row in which the ground ends in half of the columns that show it, since a hill
/// may reach higher in some; not below the horizon of a camera at rest.
fn level(sight: &GroundTruthView<'_>, tags: &[Tagged]) -> f64 {
    let camera = sight.camera;
    let rest = (camera.cy - camera.fy * libm::tan(camera.tilt)) / f64::from(camera.height);
    let ground: Vec<u16> = tags.iter().filter(|tags| tags.is_surface() && !tags.opening).map(|tags| tags.id).collect();
    let mut is_ground = vec![false; ground.iter().max().map_or(0, |most| usize::from(*most) + 1)];
    ground.iter().for_each(|id| is_ground[usize::from(*id)] = true);
    let ids = |row: usize, column: usize| sight.ids.get(row * sight.width + column);
    let shows_ground = |id: &u16| is_ground.get(usize::from(*id)).is_some_and(|is| *is);
    let top = |column: usize| (0..sight.height).find(|&row| ids(row, column).is_some_and(shows_ground));
    let mut tops: Vec<usize> = (0..sight.width).step_by(HORIZON_STEP).filter_map(top).collect();
    tops.sort_unstable();
    let horizon = tops.get(tops.len() / 2).map_or(rest, |row| *row as f64 / sight.height as f64);
    rest.min(horizon).clamp(HIGHEST_HORIZON, 1.0)
}

/// Distance between columns sampled for the horizon.
const HORIZON_STEP: usize = 16;

/// The horizon is not searched for above this fraction of the image: a slope may reach higher.
const HIGHEST_HORIZON: f64 = 0.25;

/// Obstacles to level flight: for sampled columns, the nearest surface within [`ROOM_M`] of level.
struct Walls<'a> {
    camera: &'a Camera,
    /// Column and distance along the optical axis.
    nearest: Vec<(usize, f64)>,
}

impl<'a> Walls<'a> {
    fn of(sight: &GroundTruthView<'a>, level: f64) -> Self {
        let camera = sight.camera;
        let middle = (level * f64::from(camera.height)) as usize;
        let mut nearest: Vec<(usize, f64)> = (0..sight.width).step_by(ROOM_STEP).map(|column| (column, f64::INFINITY)).collect();
        for row in (0..sight.height).step_by(ROOM_STEP) {
            for (column, least) in &mut nearest {
                let Some(&depth) = sight.depth.get(row * sight.width + *column) else { continue };
                let depth = f64::from(depth);
                if depth > 0.0 && depth < *least && depth * row.abs_diff(middle) as f64 / camera.fy < ROOM_M {
                    *least = depth;
                }
            }
        }
        Self { camera, nearest }
    }

    /// Free distance along the optical axis for level flight towards a column.
    fn room(&self, column: f64) -> f64 {
        let beside = |at: usize, depth: f64| depth * at.abs_diff(column as usize) as f64 / self.camera.fx;
        // Within a column, a nearer surface is also nearer to the path.
        let near = self.nearest.iter().filter(|(at, depth)| beside(*at, *depth) < ROOM_M);
        near.fold(f64::INFINITY, |least, (_, depth)| least.min(*depth))
    }

    /// The direction with the most room, the most central one of equals, and its free distance.
    fn most_open(&self, level: f64) -> (ImagePoint, f64) {
        let ways = [0.5, 0.35, 0.65, 0.2, 0.8, 0.05, 0.95];
        let mut best = (ImagePoint { u: 0.5, v: level }, 0.0);
        for u in ways {
            let room = self.room(u * f64::from(self.camera.width)).min(OPEN_M);
            if room > best.1 {
                best = (ImagePoint { u, v: level }, room);
            }
        }
        best
    }
}

/// Free distances are compared up to this, metres.
const OPEN_M: f64 = 40.0;

/// Height from which a capital letter can be read, pixels of the image as sent.
pub const LETTER_PX: f64 = 20.0;
/// Least cosine between a sign's front and the direction to the camera at which it can be read: 60°.
const FACING: f64 = 0.5;
/// Least fraction of a sign's silhouette inside the frame …
const IN_FRAME: f64 = 0.9;
/// … and of the area that it would have unobstructed, with room for the slant and for the strokes' edges.
const FREE: f64 = 0.6;
/// A sign in the image, as read.
#[derive(Clone, Debug, PartialEq)]
pub struct PerceivedSign {
    /// Id of its object.
    pub id: u16,
    /// Its text.
    pub text: String,
    /// Its arrow.
    pub arrow: Option<Arrow>,
    /// Height of a capital letter as a fraction of the image height.
    pub letter: f64,
    /// Whether it is wholly in the frame, free, and not seen too obliquely.
    pub whole: bool,
}

impl PerceivedSign {
    /// Height of a capital letter in an image sent at this size, pixels.
    #[must_use]
    pub fn letter_px(&self, size: Option<(u32, u32)>) -> f64 {
        self.letter * f64::from(size.unwrap_or(SIZE_SENT).1)
    }

    /// Whether it can be read in an image sent at this size.
    #[must_use]
    pub fn is_legible(&self, size: Option<(u32, u32)>) -> bool {
        self.whole && self.letter_px(size) >= LETTER_PX
    }
}

/// The signs among the objects in the image, by ascending id of their objects. Nothing random is drawn for them.
fn perceived(sight: &GroundTruthView<'_>, things: &[PerceivedObject]) -> Vec<PerceivedSign> {
    let of = |thing: &PerceivedObject| {
        let sign = sight.signs.iter().find(|sign| sign.id == thing.id && !thing.tags.opening)?;
        let (x, y) = (thing.deepest.u * sight.width as f64, thing.deepest.v * sight.height as f64);
        let along = f64::from(*sight.depth.get(y as usize * sight.width + x as usize)?);
        if !(along > 0.0 && along.is_finite()) {
            return None;
        }
        let scale = sight.camera.fy / along;
        let expected = sign.area_m2 * sign.facing * scale * scale;
        let inside = f64::from(*sight.in_frame.get(&sign.id).unwrap_or(&1.0));
        Some(PerceivedSign {
            id: sign.id,
            text: sign.text.clone(),
            arrow: sign.arrow,
            letter: sign.letter_m * scale / sight.height as f64,
            whole: sign.facing >= FACING && inside >= IN_FRAME && thing.area as f64 >= FREE * expected,
        })
    };
    if sight.signs.is_empty() { Vec::new() } else { things.iter().filter_map(of).collect() }
}
