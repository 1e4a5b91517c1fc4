//! Ground truth of a flight, from the scene itself, evaluated at `Finished` and before landing. Policies have no access
//! to it.

use std::collections::{BTreeMap, BTreeSet};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use spf_core::geometry::Pose;
use spf_oracle::limits::{Demand, limits, stand_off};
use spf_oracle::{account, resolve_truth};
use spf_render::{Channels, RenderedImage};
use spf_scene::geometry::ObjectId;

use super::loaded_scene::{LoadedScene, WorldSnapshot};
use super::world::SimWorld;
use crate::summary::VerifiedBy;

/// Minimum height of an object in view, as a fraction of the frame height …
const VIEW_HEIGHT: f64 = 0.008;
/// … with at least this fraction of its silhouette inside the frame …
const VIEW_FRACTION: f32 = 0.25;
/// … or the fraction of the frame it fills otherwise.
const VIEW_FILL: f64 = 0.1;

/// Evaluation of a flight by ground truth.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Verdict {
    /// Whether one of the objects matching the last stage is within the scene's success radius and in view, without a
    /// collision; `None` if the verb needs a predicate that only the benchmark has.
    pub verified: Option<bool>,
    /// How those objects were determined, if `verified` is set.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub verified_by: Option<VerifiedBy>,
    /// Parts of the instruction that the parser does not read, and that `verified` therefore ignores.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub not_read: Vec<String>,
    /// Distance to the nearest surface of those objects, metres; `None` if nothing in the scene matches.
    pub final_distance_m: Option<f64>,
    /// Keys of the objects matching the last stage.
    pub targets: Vec<String>,
    /// Whether the nearest of them is in view.
    pub in_view: Option<bool>,
}

/// Evaluates the current state of a world against the instruction. `start` is the pose from which the user gave it.
#[must_use]
pub fn judge(world: &SimWorld, instruction: &str, start: &Pose) -> Verdict {
    let loaded = world.loaded();
    let truth = world.truth();
    let now = world.now();
    let meant = resolve_truth(instruction, &loaded.placed(&now.actors), Some(*start));
    let key = |id: &ObjectId| loaded.tags.iter().find(|tags| tags.id == *id).map(|tags| tags.key.clone());
    let targets: Vec<String> = meant.objects.iter().filter_map(key).collect();
    let distance = |id: ObjectId| loaded.distance_to(id, &now.actors, now.pose.position);
    let near: Vec<(ObjectId, f64)> =
        meant.objects.iter().filter_map(|id| distance(*id).map(|distance| (*id, distance))).collect();
    let nearest = near.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1));
    let seen = in_view(world, &now, &meant.objects);
    let (least, most) = match stand_off(instruction) {
        Some(least) => (least, loaded.scene.success_radius.max(2.0 * least)),
        None => (0.0, loaded.scene.success_radius),
    };
    let within = |(id, distance): &(ObjectId, f64)| *distance <= most && seen.contains(id);
    let verified = meant.checkable.then(|| {
        truth.collided_with.is_empty() && nearest.is_some_and(|(_, distance)| distance >= least) && near.iter().any(within)
    });
    Verdict {
        verified,
        verified_by: verified.map(|_| VerifiedBy::Parser),
        not_read: not_read(instruction, world, *start),
        final_distance_m: nearest.map(|(_, distance)| distance),
        targets,
        in_view: nearest.map(|(id, _)| seen.contains(&id)),
    }
}

/// The objects that an instruction to follow means; `None` if its last step is something else.
pub(super) fn followed_by(instruction: &str, loaded: &LoadedScene, start: &Pose) -> Option<Vec<ObjectId>> {
    let meant = resolve_truth(instruction, &loaded.placed(&loaded.cast.starts()), Some(*start));
    meant.follows.then_some(meant.objects)
}

/// The parts of the instruction that nothing heeds: words that nothing uses, and demands that nothing on board measures.
fn not_read(instruction: &str, world: &SimWorld, start: Pose) -> Vec<String> {
    let loaded = world.loaded();
    let unused = account(instruction, &loaded.placed(&loaded.cast.starts()), Some(start)).unused;
    let unmeasured = limits(instruction).0.into_iter().filter(|limit| matches!(limit.demand, Demand::Unmeasured(_)));
    unused.into_iter().chain(unmeasured.map(|limit| limit.words)).collect()
}

/// The subset of `objects` in view.
fn in_view(world: &SimWorld, snapshot: &WorldSnapshot, objects: &[ObjectId]) -> Vec<ObjectId> {
    let image = world.look(snapshot, Channels { ids: true, openings: true, ..Channels::default() });
    sighted(&image, objects, VIEW_HEIGHT, || world.in_frame(snapshot, &mut RenderedImage::default()))
}

/// The subset of `objects`, openings included, that an image with ids and openings shows well: at least `height` of the
/// frame high with a quarter of the silhouette inside the frame (`fractions`; objects not listed touch no edge), or
/// filling a tenth of the frame. Only visible pixels count. `fractions`, which needs another render, is called only if it
/// decides.
pub fn sighted(
    image: &RenderedImage,
    objects: &[ObjectId],
    height: f64,
    fractions: impl FnOnce() -> BTreeMap<ObjectId, f32>,
) -> Vec<ObjectId> {
    let extents = extents(image, objects);
    let (high, fills) = (|of: &Extent| of.high(image, height), |of: &Extent| of.fills(image));
    let fractions = if extents.iter().any(|(_, of)| high(of) && !fills(of)) { fractions() } else { BTreeMap::new() };
    let inside = |id: &ObjectId| fractions.get(id).is_none_or(|fraction| *fraction >= VIEW_FRACTION);
    let shown = extents.into_iter().filter(|(id, of)| fills(of) || (high(of) && inside(id)));
    shown.map(|(id, _)| id).collect()
}

/// The extent of an object in an image.
#[derive(Clone, Copy)]
struct Extent {
    top: usize,
    bottom: usize,
    pixels: usize,
}

impl Extent {
    fn high(&self, image: &RenderedImage, fraction: f64) -> bool {
        (self.bottom - self.top + 1) as f64 >= fraction * f64::from(image.height)
    }

    fn fills(&self, image: &RenderedImage) -> bool {
        self.pixels as f64 >= VIEW_FILL * f64::from(image.width) * f64::from(image.height)
    }
}

/// The extents of `objects` in an image: first objects, then openings, each by ascending id.
fn extents(image: &RenderedImage, objects: &[ObjectId]) -> Vec<(ObjectId, Extent)> {
    let w = image.width as usize;
    let objects = BTreeSet::from_iter(objects.iter().copied().filter(|id| *id != 0));
    let channels = [image.ids.as_deref(), image.opening_ids.as_deref()].into_iter().flatten().filter(|_| w > 0);
    channels.flat_map(|ids| objects.iter().filter_map(move |id| Some((*id, extent(ids, w, *id)?)))).collect()
}

/// The extent of one object in an id image at most 65 535 wide; `None` if it has no pixel.
fn extent(ids: &[ObjectId], width: usize, id: ObjectId) -> Option<Extent> {
    let mut found: Option<Extent> = None;
    for (y, row) in ids.chunks_exact(width).enumerate() {
        // The sum has the width of an id, so that vector instructions compare as many pixels as possible.
        let pixels = row.iter().fold(0_u16, |sum, of| sum + u16::from(*of == id));
        if pixels > 0 {
            let extent = found.get_or_insert(Extent { top: y, bottom: y, pixels: 0 });
            extent.bottom = y;
            extent.pixels += usize::from(pixels);
        }
    }
    found
}
