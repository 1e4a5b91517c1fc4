//! What a point of an image shows in a simulated flight: the truth behind what is estimated.

use std::sync::{Arc, OnceLock};

use spf_bench::judge::Judge;
use spf_bench::task::Task;
use spf_bench::trial::Sampled;
use spf_core::geometry::EnuPosition;
use spf_core::lift::{Lifting, lift, unproject};
use spf_core::query::ImagePoint;
use spf_flight::flight::{FlightPlan, Site};
use spf_flight::sim::{FlightConditions, SimWorld, Simulated, VlmFactory, WorldSnapshot, oracle_factory};
use spf_oracle::ErrorFile;
use spf_pilot::PilotSettings;
use spf_render::Channels;
use spf_scene::geometry::ObjectId;

/// Targets are less than this across, metres.
pub(crate) const ACROSS_M: f64 = 3.0;
/// A point this far from the target's nearest pixel still means the target, as a fraction of the image width: two standard
/// deviations of what the anchor assumes.
const BESIDE: f64 = 0.03;

/// What a reply's point shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Shown {
    /// A target's surface, here; whether the pixel itself shows it, not one beside it.
    Target { id: ObjectId, surface: EnuPosition, exactly: bool },
    /// Anything else.
    Other,
}

pub(crate) fn minus(a: EnuPosition, b: EnuPosition) -> EnuPosition {
    EnuPosition { east: a.east - b.east, north: a.north - b.north, up: a.up - b.up }
}

/// What a point shows in a frame: by the renderer's ids and depth at the true pose.
pub(crate) fn shown(world: &SimWorld, snapshot: &WorldSnapshot, targets: &[ObjectId], point: ImagePoint) -> Shown {
    let image = world.look(snapshot, Channels { ids: true, depth: true, ..Channels::default() });
    let (ids, depth) = (image.ids.unwrap(), image.depth.unwrap());
    let (w, h) = (image.width as usize, image.height as usize);
    let pixel = |of: f64, size: usize| ((of * size as f64).max(0.0) as usize).min(size - 1);
    let (x, y) = (pixel(point.u, w), pixel(point.v, h));
    let reach = (BESIDE * w as f64) as usize;
    let near = (y.saturating_sub(reach)..(y + reach + 1).min(h))
        .flat_map(|y| (x.saturating_sub(reach)..(x + reach + 1).min(w)).map(move |x| (x, y)));
    let away = |(a, b): &(usize, usize)| a.abs_diff(x).pow(2) + b.abs_diff(y).pow(2);
    let on_target = |(x, y): &(usize, usize)| targets.contains(&ids[y * w + x]) && depth[y * w + x] > 0.0;
    let Some((a, b)) = near.filter(on_target).min_by_key(away).filter(|at| away(at) <= reach * reach) else {
        return Shown::Other;
    };
    let at = b * w + a;
    let point =
        if (a, b) == (x, y) { point } else { ImagePoint { u: (a as f64 + 0.5) / w as f64, v: (b as f64 + 0.5) / h as f64 } };
    let attitude = snapshot.pose.attitude;
    let seen = unproject(world.camera(), point, f64::from(depth[at])).unwrap();
    let body = lift(seen, world.camera(), attitude, Lifting::Levelled);
    let surface = snapshot.pose.position.displaced(body, attitude.heading);
    Shown::Target { id: ids[at], surface, exactly: (a, b) == (x, y) }
}

/// The targets of a task that stand still and are small enough.
pub(crate) fn targets(task: &Task, drawn: &Sampled) -> Vec<ObjectId> {
    let loaded = &drawn.loaded;
    let Ok(judge) = Judge::new(task, loaded.clone(), drawn.start) else { return Vec::new() };
    let width = |id: ObjectId| {
        let bounds = loaded.scene.object(id)?.bounds;
        Some((bounds.max.east - bounds.min.east).max(bounds.max.north - bounds.min.north))
    };
    let is_small = |id: &ObjectId| loaded.cast.of_object(*id).is_none() && width(*id).is_some_and(|width| width < ACROSS_M);
    judge.targets().flatten().copied().filter(is_small).collect()
}

/// A simulated flight of a task with one of the shipped oracles, and its world, which is known from the take-off on.
pub(crate) fn flight(
    task: &Task,
    drawn: &Sampled,
    vlm: &'static str,
    seed: u64,
    settings: PilotSettings,
) -> (FlightPlan, Arc<OnceLock<SimWorld>>) {
    let world = Arc::new(OnceLock::new());
    let (oracle, known) = (oracle_factory(format!("oracle:{vlm}"), ErrorFile::named(vlm).unwrap()), world.clone());
    let vlm_factory: VlmFactory = Arc::new(move |of, seed| {
        drop(known.set(of.unwrap().clone()));
        oracle(of, seed)
    });
    let site = Site::Simulated(Simulated {
        start: Some(drawn.start),
        kind: task.craft,
        flight_conditions: FlightConditions { wind: drawn.wind, ..FlightConditions::default() },
        seed,
        ..Simulated::new(drawn.loaded.clone(), &drawn.scene)
    });
    let plan = FlightPlan::new(site, &task.instruction, &format!("oracle:{vlm}"), vlm_factory);
    (FlightPlan { settings, ..plan }, world)
}
