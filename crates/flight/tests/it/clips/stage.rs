//! A scene in which clips are flown, and what an image of it shows of a target.

use std::collections::BTreeMap;
use std::sync::Arc;

use spf_core::camera::Camera;
use spf_core::time::Time;
use spf_flight::sim::{LoadedScene, WorldSnapshot};
use spf_media::track::PixelBox;
use spf_render::{Channels, RenderedImage, Renderer};
use spf_scene::actors::Traffic;
use spf_scene::geometry::{ObjectId, SceneGeometry};
use spf_scene::{Lighting, SceneLook, Weather};

use super::kinds::{Condition, Number};

/// A loaded scene.
pub(super) struct Stage {
    pub(super) loaded: Arc<LoadedScene>,
}

impl Stage {
    /// Where and in which light a clip is flown.
    pub(super) fn key(number: &Number) -> (String, bool) {
        (format!("{}@{}", number.scene, number.seed), number.condition == Condition::Dusk)
    }

    pub(super) fn load((scene, dusk): &(String, bool)) -> Self {
        let lighting = Some(if *dusk { Lighting::Dusk } else { Lighting::Day });
        let look = SceneLook { lighting, weather: Some(Weather::Clear) };
        Self { loaded: Arc::new(LoadedScene::load_with(scene, &look).unwrap()) }
    }

    /// The moving actors up to some time.
    pub(super) fn traffic(&self, seed: u64, until: Time) -> Traffic {
        let mut traffic = Traffic::new(self.loaded.cast.clone(), seed);
        traffic.advance_to(until);
        traffic
    }
}

/// A target, and how to see it alone.
pub(super) struct Target {
    id: ObjectId,
    actor: Option<usize>,
    alone: Renderer,
}

/// What an image shows of the target.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sight {
    /// The box of its visible pixels.
    pub(super) visible: Option<PixelBox>,
    /// The box that it would have with nothing before it.
    pub(super) whole: Option<PixelBox>,
    /// The visible part of its pixels inside the image.
    pub(super) share: f64,
    /// The pixels that are visible.
    pub(super) pixels: f64,
}

impl Sight {
    /// Whether an edge of the image cuts it off.
    pub(super) fn is_cut(&self, camera: &Camera) -> bool {
        let (width, height) = (f64::from(camera.width), f64::from(camera.height));
        self.whole.is_none_or(|area| area.left < 1.0 || area.top < 1.0 || area.right > width - 1.0 || area.bottom > height - 1.0)
    }

    /// Whether it is well in view: nearly all of it.
    pub(super) fn is_whole(&self, camera: &Camera) -> bool {
        self.share >= 0.7 && !self.is_cut(camera)
    }
}

impl Target {
    pub(super) fn new(stage: &Stage, id: ObjectId) -> Self {
        let scene = &stage.loaded.scene.geometry;
        let parts = scene.parts.iter().filter(|part| part.object == id).cloned().collect();
        // An actor's materials are those of the scene.
        let alone = SceneGeometry { parts, materials: scene.materials.clone(), textures: Vec::new(), light: scene.light.clone() };
        Self { id, actor: stage.loaded.cast.of_object(id), alone: Renderer::new(&alone) }
    }

    /// What is to be seen of it, and the ids of everything.
    pub(super) fn sight(&self, stage: &Stage, camera: &Camera, snapshot: &WorldSnapshot) -> (Sight, Vec<u16>) {
        let channels = Channels { ids: true, ..Channels::default() };
        let seen = stage.loaded.render(camera, snapshot, channels).ids.unwrap();
        let mut image = RenderedImage::default();
        let parts = self.actor.map_or_else(Vec::new, |actor| {
            let mut parts = stage.loaded.cast.parts(&snapshot.actors, |_, _| true);
            parts.retain(|part| part.object == stage.loaded.cast.object(actor));
            parts
        });
        self.alone.render_into(camera, &snapshot.pose, channels, &parts, &mut image);
        let whole = image.ids.unwrap();
        let ((visible, pixels), (whole, all)) = (extent(&seen, camera, self.id), extent(&whole, camera, self.id));
        let share = if all > 0.0 { pixels / all } else { 0.0 };
        (Sight { visible, whole, share, pixels }, seen)
    }
}

/// The box of an object's pixels, and their number.
fn extent(ids: &[u16], camera: &Camera, id: ObjectId) -> (Option<PixelBox>, f64) {
    let width = camera.width as usize;
    let mut found: (Option<PixelBox>, f64) = (None, 0.0);
    for (at, _) in ids.iter().enumerate().filter(|(_, seen)| **seen == id) {
        let (x, y) = ((at % width) as f64, (at / width) as f64);
        let area = found.0.get_or_insert(PixelBox { left: x, top: y, right: x, bottom: y });
        area.left = area.left.min(x);
        area.right = area.right.max(x + 1.0);
        area.bottom = area.bottom.max(y + 1.0);
        found.1 += 1.0;
    }
    found
}

/// The shares of the objects in the surroundings of a box, which is twice as large.
pub(super) fn around(ids: &[u16], camera: &Camera, area: &PixelBox) -> BTreeMap<u16, f64> {
    let within = PixelBox::around(area.centre(), 2.0 * area.width(), 2.0 * area.height());
    let (mut shares, mut all) = (BTreeMap::new(), 0.0);
    for (at, id) in ids.iter().enumerate() {
        let (x, y) = ((at % camera.width as usize) as f64 + 0.5, (at / camera.width as usize) as f64 + 0.5);
        if (within.left..within.right).contains(&x) && (within.top..within.bottom).contains(&y) {
            *shares.entry(*id).or_default() += 1.0;
            all += 1.0;
        }
    }
    shares.values_mut().for_each(|share| *share /= all);
    shares
}
