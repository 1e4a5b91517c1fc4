//! Light metering: the camera's exposure, and the light on each visible object.

use std::collections::{BTreeMap, BTreeSet};

use fearless_simd::prelude::*;
use glam::Vec3;
use spf_core::camera::Camera;
use spf_core::geometry::Pose;

use super::ambient::Spots;
use super::develop::luminance;
use super::lamps::LampLight;
use super::lanes::{F, Instructions, V3, smooth, with_instructions};
use super::shadow::ShadowMap;
use super::sky::Sky;
use super::view::Pinhole;
use super::{Palette, RenderedImage, Renderer};

/// Maximum exposure under a roof, relative to outside.
const GREATEST: f32 = 5.0;
/// White objects below this value on the film are hard to see; more light above it makes no difference.
const CLEAR: f32 = 0.06;
/// Objects that emit this much are visible in any darkness.
const GLOWING: f32 = 0.1;

/// Data from which the light on an object is computed.
struct Lights<'a> {
    sky: &'a Sky,
    lamps: &'a LampLight,
    shadows: &'a ShadowMap,
    glowing: &'a BTreeSet<u16>,
    /// Openness of a place to the sky.
    open: &'a dyn Fn(Vec3) -> f32,
}

/// The data for a renderer that has rendered no colour image: openness is computed on demand.
#[derive(Debug)]
pub(super) struct Meter {
    sky: Sky,
    lamps: LampLight,
    shadows: ShadowMap,
    glowing: BTreeSet<u16>,
    open: Spots,
}

impl Palette {
    /// Exposure factor of a camera at `eye`: the scene's own value if it has one.
    pub(super) fn exposure(&self, eye: Vec3) -> f32 {
        self.lights(&|p| self.open(p)).exposure(eye)
    }

    fn open(&self, p: Vec3) -> f32 {
        with_instructions!(Instructions::plain(), simd => self.ambient.open(V3::splat(simd, p))[0])
    }

    fn lights<'a>(&'a self, open: &'a dyn Fn(Vec3) -> f32) -> Lights<'a> {
        Lights { sky: &self.sky, lamps: &self.lamps, shadows: &self.shadows, glowing: &self.glowing, open }
    }
}

impl Lights<'_> {
    fn exposure(&self, eye: Vec3) -> f32 {
        let light = &self.sky.light;
        if let Some(exposure) = light.exposure {
            return exposure;
        }
        let outside = self.sky.exposure;
        let open = (self.open)(eye);
        let covered = with_instructions!(Instructions::plain(), simd => smooth((F::splat(simd, 0.6) - open) * 4.0)[0]);
        let here = luminance(light.sky_ambient) * open + 0.4 * luminance(self.lamps.at(eye));
        let inside = (0.5 / here.max(1e-3)).clamp(outside, outside * GREATEST);
        outside + (inside - outside) * covered
    }
}

impl Renderer {
    /// Light on each object in `image`, which was rendered from `pose` with ids and depth: 0 is dark, 1 is daylight; objects not
    /// listed have 1. It is the mean, over about twenty of the object's pixels, of the exposed brightness of a white surface
    /// there; objects that emit light have 1.
    ///
    /// In scenes without dark places nothing is computed, and all objects have 1.
    #[must_use]
    pub fn light_on(&self, camera: &Camera, pose: &Pose, image: &RenderedImage) -> BTreeMap<u16, f32> {
        let (Some(ids), Some(depth)) = (&image.ids, &image.depth) else { return BTreeMap::new() };
        if image.width == 0 || !self.light.has_dark_areas {
            return BTreeMap::new();
        }
        let view = Pinhole::new(camera, pose);
        // A colour render provides all of it; for the light alone that would take too long.
        if let Some(palette) = self.palette.get() {
            light_on(&palette.lights(&|p| palette.open(p)), &view, image.width, ids, depth)
        } else {
            let meter = self.meter.get_or_init(|| self.meter());
            let Meter { sky, lamps, shadows, glowing, open } = meter;
            light_on(&Lights { sky, lamps, shadows, glowing, open: &|p| open.open(p) }, &view, image.width, ids, depth)
        }
    }

    fn meter(&self) -> Meter {
        Meter {
            sky: Sky::new(&self.light),
            lamps: LampLight::new(&self.soup, &self.light.lamps),
            shadows: ShadowMap::new(&self.soup, &self.light),
            glowing: self.glowing(),
            open: Spots::new(&self.soup),
        }
    }

    /// Objects that emit light.
    pub(super) fn glowing(&self) -> BTreeSet<u16> {
        let glows = |material: u16| self.materials.get(usize::from(material)).is_some_and(|m| luminance(m.emission) >= GLOWING);
        let triangles = self.soup.triangles.iter().zip(&self.soup.objects);
        triangles.filter(|(t, _)| glows(t.material)).map(|(_, &object)| object).collect()
    }
}

/// [`Renderer::light_on`] of an image `width` pixels wide.
fn light_on(lights: &Lights<'_>, view: &Pinhole, width: u32, ids: &[u16], depth: &[f32]) -> BTreeMap<u16, f32> {
    let exposure = lights.exposure(view.eye);
    let mut seen: BTreeMap<u16, (u32, u32, f32)> = BTreeMap::new();
    let (mut last, mut count) = (0, 0);
    for (i, (&id, &z)) in ids.iter().zip(depth).enumerate() {
        if id == 0 || z <= 0.0 {
            continue;
        }
        if id != last {
            // Most pixels are like the one before.
            if last != 0 {
                seen.entry(last).or_default().0 = count;
            }
            (last, count) = (id, seen.get(&id).map_or(0, |thing| thing.0));
        }
        count += 1;
        // The first, second, fourth, … pixel: spread over objects of any size.
        if count.is_power_of_two() {
            let (x, y) = (i as u32 % width, i as u32 / width);
            let ray = view.forward
                + view.right * ((x as f32 + 0.5 - view.cx) / view.fx)
                + view.down * ((y as f32 + 0.5 - view.cy) / view.fy);
            // Slightly towards the eye, off the surface.
            let at = view.eye + ray * (z * 0.99) - ray * 0.3f32.min(0.1 * z);
            let thing = seen.entry(id).or_default();
            thing.1 += 1;
            thing.2 += lights.white(at) * exposure;
        }
    }
    let light = |(_, samples, sum): (u32, u32, f32)| (sum / samples.max(1) as f32 / CLEAR).clamp(0.0, 1.0);
    seen.into_iter().map(|(id, thing)| (id, if lights.glowing.contains(&id) { 1.0 } else { light(thing) })).collect()
}

impl Lights<'_> {
    /// Luminance of the light on a white surface at `p`, averaged over its orientations.
    fn white(&self, p: Vec3) -> f32 {
        let light = &self.sky.light;
        let open = (self.open)(p);
        let sun = with_instructions!(Instructions::plain(), simd => {
            let p = V3::splat(simd, p);
            let receiver = self.shadows.receiver(light.to_sun, 1.0).splat(simd);
            let all = F::splat(simd, 0.0).simd_ge(0.0);
            self.shadows.lit(p, &receiver, all, true)[0]
        });
        let even = luminance(light.sky_ambient + light.ground_ambient) * 0.5 * open;
        even + luminance(light.sun) * sun * 0.25 + luminance(self.lamps.at(p)) * 0.25
    }
}
