//! Creates the text of a reply from a percept, depending on the kind of query.

use spf_core::grounding::GroundingProfile;
use spf_core::query::{DepthAs, Query, QueryKind};
use spf_core::reply::{DEPTH_LABELS, Look, ObstacleBox, OpenWay, Reply, Status};

use super::act;
use super::corridor::{self, Way};
use super::errors::Reading;
use super::kinds;
use super::language::Phrase;
use super::language::item::Item;
use super::language::order::numbered;
use super::language::parse;
use super::language::resolve::{is_elsewhere, meant};
use super::limits::{NEAR_STAND_OFF, stand_off};
use super::percept::{Percept, logistic};
use super::sight::{PerceivedObject, slopes};
use super::signs;
use super::stages::{self, Aim, Inputs};
use super::{ErrorFile, Oracle};

/// The text of the answer.
pub(super) fn text(oracle: &Oracle, query: &Query, percept: &Percept) -> String {
    match &query.kind {
        QueryKind::Point { avoid, depth } => {
            point(oracle, query, percept, *avoid).to_json_as(&GroundingProfile::default(), *avoid, *depth)
        }
        QueryKind::Choose => kinds::choose(query, percept, &aim(oracle, query, percept)),
        QueryKind::Act { form } => act::act(oracle, query, percept, &aim(oracle, query, percept), *form),
        QueryKind::Done => kinds::done(&aim(oracle, query, percept)),
        QueryKind::Refuse => kinds::refuse(&query.instruction),
        QueryKind::Detect { coco, scored: false } => kinds::detect(percept.seen(&oracle.errors, query.image_size), *coco),
        QueryKind::Detect { coco, scored: true } => {
            kinds::detect_scored(percept.seen_with_chance(&oracle.errors, query.image_size), *coco)
        }
        QueryKind::Program => kinds::program(oracle, query),
        QueryKind::Question { text } => kinds::question(text, &query.detections),
    }
}

/// The aim of the instruction in this percept: target, stage and whether it is done.
pub(super) fn aim(oracle: &Oracle, query: &Query, percept: &Percept) -> Aim {
    let seen: Vec<&PerceivedObject> = percept.seen(&oracle.errors, query.image_size).collect();
    let stand_off = if oracle.brief.is_some() { None } else { stand_off(&query.instruction) };
    let near = stand_off.map_or(oracle.near, |least| oracle.near.max(NEAR_STAND_OFF * least));
    let view = Inputs { oracle, query, percept, seen: &seen, near };
    let own = || match &oracle.brief {
        Some(brief) => brief.instruction(),
        None => parse(&query.instruction, &percept.words),
    };
    let mut aim = signs::obeyed(&view).unwrap_or_else(|| stages::aim(&own(), &view));
    // The sails of a windmill reach out in front of the tower, at which one points: who keeps a distance keeps it from these.
    if let (Some(_), Some(place)) = (stand_off, &mut aim.place)
        && let Some(thing) = seen.iter().find(|thing| Some(&thing.tags.key) == aim.target.as_ref())
    {
        place.range = place.range.min(thing.nearest);
    }
    aim
}

fn point(oracle: &Oracle, query: &Query, percept: &Percept, avoid: bool) -> Reply {
    let aim = aim(oracle, query, percept);
    let seen: Vec<&PerceivedObject> = percept.seen(&oracle.errors, query.image_size).collect();
    let mut reply = Reply {
        target: Some(aim.words.clone()).filter(|words| !words.is_empty()),
        stage: aim.stages.gt(&1).then_some(aim.stage),
        ..Reply::new(Status::Navigating)
    };
    let Some(place) = aim.place else {
        if aim.done {
            return Reply { status: Status::Done, ..reply };
        }
        let (point, room) = percept.open;
        if aim.too_near {
            reply.status = Status::Blocked;
        } else {
            reply.status = Status::NotVisible;
            reply.look = Some(aim.look.unwrap_or(Look::Right));
            reply.open_way = Some(OpenWay { point, depth: label_slipped(oracle, query, 0.5 * room, 0.0) });
        }
        if avoid {
            let way = Way { range: room, target: None, through: false };
            reply.boxes = reported(oracle, corridor::boxes(oracle, percept, query.image_size, &way));
        }
        return reply;
    };
    reply.status = match (aim.done, aim.follows) {
        (true, _) => Status::Done,
        (false, true) => Status::Following,
        (false, false) => Status::Navigating,
    };
    reply.depth = Some(label_slipped(oracle, query, place.range, place.fraction));
    reply.point = Some(place.point);
    reply.target_box = aim.target.as_deref().and_then(|key| corridor::target_box(oracle, percept, &seen, key));
    if query.kind == (QueryKind::Point { avoid, depth: DepthAs::Metres }) {
        reply.range_m = Some(place.range.clamp(0.1, FARTHEST_M));
    }
    if avoid {
        let way = Way { range: place.range, target: aim.target.as_deref(), through: place.opening };
        reply.boxes = reported(oracle, corridor::boxes(oracle, percept, query.image_size, &way));
    } else if !aim.past.is_empty() && query.detections.is_empty() {
        // Without obstacle mode nobody else leads past the objects that are meant to be passed.
        let Some(beside) = corridor::free(oracle, percept, place.point, &aim.past) else {
            return Reply {
                status: Status::NotVisible,
                look: Some(Look::Up),
                point: None,
                depth: None,
                range_m: None,
                target_box: None,
                ..reply
            };
        };
        reply.point = Some(beside);
    }
    reply
}

/// The largest distance that is stated in metres.
const FARTHEST_M: f64 = 1e4;

/// The obstacles as they are written.
fn reported(oracle: &Oracle, found: Vec<corridor::Found>) -> Vec<ObstacleBox> {
    let obstacle = |found: corridor::Found| ObstacleBox {
        area: found.area,
        depth: label(&oracle.errors, found.range, found.area.bottom - found.area.top),
        name: found.name,
    };
    found.into_iter().map(obstacle).collect()
}

/// A full turn, with tolerance for rounding, radians.
const ALL_ROUND: f64 = 0.99 * core::f64::consts::TAU;

/// The depth label of an object at this range that fills this fraction of the image height, sometimes off by two.
fn label_slipped(oracle: &Oracle, query: &Query, range: f64, fraction: f64) -> u8 {
    let label = label(&oracle.errors, range, fraction);
    let mut slip = oracle.by_query("label", query);
    let off = if slip.chance(oracle.errors.label.off_by_two) { if slip.chance(0.5) { 2 } else { -2 } } else { 0 };
    (i32::from(label) + off).clamp(1, i32::from(DEPTH_LABELS)) as u8
}

/// The depth label of an object at this range that fills this fraction of the image height.
pub(super) fn label(errors: &ErrorFile, range: f64, fraction: f64) -> u8 {
    let most = f64::from(DEPTH_LABELS);
    let label = match &errors.label.reading {
        Reading::RangeLog { per_decade } => 1.0 + per_decade * libm::log10(range),
        Reading::RangeLinear { farthest_m } => most * range / farthest_m,
        Reading::Size { share_at_1, share_at_10 } => 1.0 + (most - 1.0) * (share_at_1 - fraction) / (share_at_1 - share_at_10),
        Reading::IntendedTravel { fraction, lengths_m } => {
            lengths_m.iter().take_while(|&&length| length <= fraction * range).count() as f64
        }
    };
    // Infinite range is the sky: the highest label. `round` of a clamped value is exact.
    libm::round(label.clamp(1.0, most)) as u8
}

impl Inputs<'_> {
    /// The visible objects as items for the language resolver; all properties come from the image.
    pub(super) fn items(&self) -> Vec<Item<'_>> {
        self.seen
            .iter()
            .map(|thing| {
                let (right, up) = slopes(&self.percept.camera, thing.point);
                let forward = thing.range / libm::sqrt(1.0 + right * right + up * up);
                let height = (thing.bounds.bottom - thing.bounds.top) * f64::from(self.percept.camera.height)
                    / self.percept.camera.fy
                    * forward;
                let known = thing.range.is_finite();
                Item {
                    tags: &thing.tags,
                    across: Some(0.5 * (thing.bounds.left + thing.bounds.right)),
                    half: 0.5 * (thing.bounds.right - thing.bounds.left),
                    range: Some(thing.range),
                    size: Some(thing.area as f64 * if known { thing.range * thing.range } else { 1e12 }),
                    height: Some(if known { height } else { 1e6 }),
                    position: known.then_some([right * forward, forward, up * forward]),
                    weight: thing.area as f64,
                }
            })
            .collect()
    }

    /// The object that a phrase means in this image: highest tag score, ties to the larger mask; at the error file's
    /// rate, the most similar other object instead.
    pub(super) fn find(&self, phrase: &Phrase) -> Option<&PerceivedObject> {
        self.find_among(phrase, |_| true)
    }

    /// Like [`Inputs::find`], restricted to the objects that `fits` accepts if there are any.
    pub(super) fn find_among(&self, phrase: &Phrase, fits: impl Fn(&PerceivedObject) -> bool) -> Option<&PerceivedObject> {
        let items = self.items();
        let mut found = meant(phrase, &items);
        // The anchor of a relation is out of view: an earlier target is still recognised, and after a full turn any
        // object with that name is accepted.
        if found.is_empty() && !phrase.relations.is_empty() {
            let loose = Phrase { relations: Vec::new(), ..phrase.clone() };
            let last = self.query.memory.targets.last();
            found = meant(&loose, &items);
            if self.query.memory.turned.abs() < ALL_ROUND {
                found.retain(|&i| last == Some(&items[i].tags.words()));
            }
        }
        self.keep_placed(phrase, &mut found, &items);
        if found.iter().any(|&i| fits(self.seen[i])) {
            found.retain(|&i| fits(self.seen[i]));
        }
        // Among equal candidates the earlier target is kept.
        let last = self.query.memory.targets.last();
        if found.iter().any(|&i| last == Some(&items[i].tags.words())) {
            found.retain(|&i| last == Some(&items[i].tags.words()));
        }
        let best = *found.iter().max_by(|&&a, &&b| items[a].weight.total_cmp(&items[b].weight).then(b.cmp(&a)))?;
        let mut which = self.oracle.by_query("which", self.query);
        if which.chance(self.oracle.errors.which.confused)
            && let Some(other) = self.most_similar(best)
        {
            return Some(self.seen[other]);
        }
        Some(self.seen[best])
    }

    /// All objects that a phrase may mean in this image.
    pub(super) fn all(&self, phrase: &Phrase) -> Vec<&PerceivedObject> {
        let items = self.items();
        let mut found = meant(phrase, &items);
        self.keep_placed(phrase, &mut found, &items);
        found.into_iter().map(|i| self.seen[i]).collect()
    }

    /// Keeps those that are in the place where the phrase says, as the ground truth does, which sees the whole scene.
    fn keep_placed(&self, phrase: &Phrase, found: &mut Vec<usize>, items: &[Item<'_>]) {
        found.retain(|&i| !is_elsewhere(phrase, items[i].tags, &self.percept.placed));
    }

    /// The objects of `found` with a number in their name; `None` if no visible object has one.
    pub(super) fn numbered(&self, number: i32, found: &[&PerceivedObject]) -> Option<Vec<&PerceivedObject>> {
        let items = self.items();
        let among: Vec<usize> =
            (0..items.len()).filter(|&i| found.iter().any(|thing| core::ptr::eq(*thing, self.seen[i]))).collect();
        numbered(number, &among, &items).map(|named| named.into_iter().map(|i| self.seen[i]).collect())
    }

    /// The most similar other object: kind counts most, then name, then colour; ties to the larger mask. `None` if no
    /// other object has anything in common with it.
    fn most_similar(&self, of: usize) -> Option<usize> {
        let tags = &self.seen[of].tags;
        let like = |thing: &PerceivedObject| -> u32 {
            4 * u32::from(thing.tags.kind == tags.kind && thing.tags.opening == tags.opening)
                + 2 * u32::from(thing.tags.names.iter().any(|name| tags.names.contains(name)))
                + u32::from(thing.tags.colour.is_some() && thing.tags.colour == tags.colour)
        };
        (0..self.seen.len())
            .filter(|&i| i != of && like(self.seen[i]) > 0)
            .max_by_key(|&i| (like(self.seen[i]), self.seen[i].area, core::cmp::Reverse(i)))
    }

    /// Samples whether a range counts as arrival: P = logistic(ln(near / range) / width).
    pub(super) fn arrived(&self, range: f64, near: f64) -> bool {
        let p = logistic(libm::log(near / range.max(1e-9)), self.oracle.errors.done.log_width);
        self.oracle.by_query("done", self.query).chance(p)
    }

    /// Distance from a surface at which one is near it, metres.
    pub(super) fn near(&self) -> f64 {
        self.near
    }
}
