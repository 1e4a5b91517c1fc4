//! Shades eight pixels: surface, sun and shadow, sky light, reflection, haze.

use fearless_simd::prelude::*;
use glam::Vec3;
use spf_scene::geometry::Pattern;
use spf_scene::texture::Texture;

use super::Palette;
use super::contact::Contact;
use super::facet::{Curve, Facet};
use super::lanes::{F, Instructions, LANES, Simd, V3, clamp};
use super::pattern::{Paint, Spot, Surface};
use super::prepare::{Soup, Triangle};
use super::texture;
use super::view::Pinhole;

/// Reflectivity of level ground in heavy rain.
const WET: f32 = 0.75;
/// [`Spot::coarse`] of images that are not `full`: noise with fewer pixels per cell is omitted.
const COARSE: f32 = 8.0;
/// Moving objects farther away than this cast no contact shadows, metres.
const STANDING: f32 = 80.0;

/// Shades pixels of one image.
pub(crate) struct Shader<'a> {
    pub(super) soup: &'a Soup,
    /// Triangles that belong to this image only; their ids follow the scene's.
    pub(super) actors: &'a Soup,
    pub(super) palette: &'a Palette,
    textures: &'a [Texture],
    pub(super) view: &'a Pinhole,
    pub(super) instructions: Instructions,
    /// Smooth edges, and details visible only on close inspection.
    pub(super) fine: bool,
    /// Exposure factor.
    exposure: f32,
    /// Contact shadows of this image's own objects.
    standing: Contact,
    /// Change of the ray per pixel right and per pixel down.
    right: Vec3,
    down: Vec3,
}

/// A triangle prepared for shading.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shape {
    /// Index into the palette's paints.
    pub(crate) paint: u32,
    curved: bool,
    facet: Facet<f32>,
    curve: Curve<f32>,
}

/// Positions of eight pixels in the image, and their nearness: 1/z.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    pub(crate) x: [f32; LANES],
    pub(crate) y: [f32; LANES],
    pub(crate) near: [f32; LANES],
}

/// Rays through eight pixels.
struct Rays<S: Simd> {
    /// Rays with a component of 1 along the optical axis, and their lengths.
    ray: V3<F<S>>,
    length: F<S>,
    /// Unit vectors.
    to: V3<F<S>>,
}

impl<'a> Shader<'a> {
    pub(super) fn new(
        soups: [&'a Soup; 2],
        (palette, textures): (&'a Palette, &'a [Texture]),
        view: &'a Pinhole,
        instructions: Instructions,
        fine: bool,
    ) -> Self {
        let (right, down) = (view.right / view.fx, view.down / view.fy);
        let exposure = palette.exposure(view.eye);
        let standing = if fine { Contact::about(soups[1], view.eye, STANDING) } else { Contact::default() };
        Self { soup: soups[0], actors: soups[1], palette, textures, view, instructions, fine, exposure, standing, right, down }
    }

    fn triangle(&self, id: u32) -> (&Soup, &Triangle) {
        let scene = self.soup;
        match scene.triangles.get(id as usize) {
            Some(t) => (scene, t),
            None => (self.actors, &self.actors.triangles[id as usize - scene.triangles.len()]),
        }
    }

    /// True if two triangles belong to one smooth surface, so that their common edge is not visible.
    pub(crate) fn joined(&self, a: u32, b: u32) -> bool {
        let ((_, s), (_, t)) = (self.triangle(a), self.triangle(b));
        let curved = s.smooth != 0 && t.smooth != 0;
        s.material == t.material
            && if curved {
                s.normal.dot(t.normal) > 0.8
            } else {
                s.normal.dot(t.normal) > 0.999 && (s.offset - t.offset).abs() < 0.02
            }
    }

    /// Prepares triangle `id`.
    pub(crate) fn shape(&self, id: u32) -> Shape {
        let (soup, t) = self.triangle(id);
        let eye = self.view.eye;
        // The plane n·p = offset meets the ray r at z = height / (n·r).
        let height = t.offset - t.normal.dot(eye);
        let side = if height > 0.0 { -1.0 } else { 1.0 };
        let flat = t.normal * side;
        let over = 1.0 / if height.abs() < 1e-6 { 1e-6 } else { height };
        let paints = &self.palette.paints;
        let paint = (2 * usize::from(t.material) + usize::from(t.normal.z.abs() > 0.7)).min(paints.len() - 1);
        let faces_sun = flat.dot(self.palette.sky.light.to_sun);
        let (direct, ambient) = self.flat_light(flat, paints[paint].pattern == Pattern::Foliage);
        let facet = Facet {
            flat: flat.into(),
            u_axis: t.u_axis.into(),
            v_axis: t.v_axis.into(),
            eye_u: t.u_axis.dot(eye) + t.u_offset,
            eye_v: t.v_axis.dot(eye) + t.v_offset,
            right_u: t.u_axis.dot(self.right),
            right_v: t.v_axis.dot(self.right),
            down_u: t.u_axis.dot(self.down),
            down_v: t.v_axis.dot(self.down),
            slant_right: t.normal.dot(self.right) * over,
            slant_down: t.normal.dot(self.down) * over,
            faces_sun,
            receiver: self.palette.shadows.receiver(if faces_sun > 0.0 { flat } else { -flat }, faces_sun.abs()),
            direct,
            ambient: ambient.into(),
        };
        let curve = match (t.smooth as usize).checked_sub(1).map(|i| &soup.smooth[i]) {
            Some(s) => Curve { rows: s.axes.map(|row| (row * side).into()), offset: (s.offset * side).into() },
            None => Curve { rows: [Vec3::ZERO.into(); 3], offset: flat.into() },
        };
        Shape { paint: paint as u32, curved: t.smooth != 0, facet, curve }
    }

    /// [`Shader::unshaded`] for one normal.
    fn flat_light(&self, normal: Vec3, leaves: bool) -> (f32, Vec3) {
        let light = &self.palette.sky.light;
        let cosine = normal.dot(light.to_sun);
        let direct = if leaves { (0.72 * cosine + 0.28).max(0.12) } else { cosine.max(0.0) };
        let turn = 1.0 + 0.10 * normal.x - 0.06 * normal.y;
        (direct, (light.ground_ambient + (light.sky_ambient - light.ground_ambient) * (0.5 + 0.5 * normal.z)) * turn)
    }

    /// Unoccluded fraction of the sun's light on surfaces with unit `normal`, and light of sky and ground.
    #[inline(always)]
    fn unshaded<S: Simd>(&self, normal: V3<F<S>>, leaves: bool) -> (F<S>, V3<F<S>>) {
        let light = &self.palette.sky.light;
        let cosine = normal.dot_same(light.to_sun);
        // Leaves transmit light: their dark side is dimmer, not dark.
        let direct = if leaves { (cosine * 0.72 + 0.28).max(0.12) } else { cosine.max(0.0) };
        let sky = V3::along(light.sky_ambient - light.ground_ambient, normal.z * 0.5 + 0.5).plus_same(light.ground_ambient);
        // Shaded walls differ slightly by orientation, because real skies are not uniform.
        (direct, sky * (normal.x * 0.10 - normal.y * 0.06 + 1.0))
    }

    #[inline(always)]
    fn rays<S: Simd>(&self, simd: S, place: &Place) -> Rays<S> {
        let x = F::from_slice(simd, &place.x) - self.view.cx;
        let y = F::from_slice(simd, &place.y) - self.view.cy;
        let ray = (V3::along(self.right, x) + V3::along(self.down, y)).plus_same(self.view.forward);
        let length = ray.dot(ray).sqrt();
        Rays { ray, length, to: ray * (1.0 / length) }
    }

    /// Light on the film from the sky at eight pixels.
    #[inline(always)]
    pub(crate) fn sky<S: Simd>(&self, simd: S, place: &Place) -> V3<F<S>> {
        let sky = &self.palette.sky;
        let seen = sky.seen(self.rays(simd, place).to, &self.palette.noise, 1.0 / self.view.fx);
        seen * F::splat(simd, self.exposure)
    }

    /// Light on the film from triangles of one paint at eight pixels.
    #[inline(always)]
    pub(crate) fn exposed<S: Simd>(&self, simd: S, shapes: [&Shape; LANES], place: &Place) -> V3<F<S>> {
        let rays = self.rays(simd, place);
        let z = 1.0 / F::from_slice(simd, &place.near);
        let facet = Facet::lanes(simd, shapes.map(|s| &s.facet));
        let curve = shapes.iter().any(|s| s.curved).then(|| Curve::lanes(simd, shapes.map(|s| &s.curve)));
        let paint = &self.palette.paints[shapes[0].paint as usize];
        let lit = self.surface(&facet, curve.as_ref(), paint, &rays, z);
        let sky = &self.palette.sky;
        sky.hazed(lit, rays.to, z * rays.length) * F::splat(simd, self.exposure)
    }

    /// Light on surfaces except the sun's: of sky and ground (`ambient`) and of lamps, reduced by contact shadows.
    #[inline(always)]
    fn even<S: Simd>(&self, p: V3<F<S>>, flat: V3<F<S>>, normal: V3<F<S>>, ambient: V3<F<S>>) -> V3<F<S>> {
        let light = ambient + self.palette.lamps.on(p, flat, normal);
        let level = flat.z.simd_gt(0.5);
        if !self.fine || level.all_false() {
            return light;
        }
        light * (1.0 - self.palette.contact.dark(p, level).max(self.standing.dark(p, level)))
    }

    /// Light from surfaces at depth `z`.
    #[inline(always)]
    fn surface<S: Simd>(
        &self,
        facet: &Facet<F<S>>,
        curve: Option<&Curve<F<S>>>,
        paint: &Paint,
        rays: &Rays<S>,
        z: F<S>,
    ) -> V3<F<S>> {
        let simd = z.token();
        let away = rays.ray * z;
        let p = away.plus_same(self.view.eye);
        let spot = spot(facet, away, z, if self.fine { 1.0 } else { COARSE });
        let mut surface = Surface::new(paint, &spot, &self.palette.noise);
        if let Pattern::Image { texture, .. } = paint.pattern
            && let Some(image) = self.textures.get(usize::from(texture))
        {
            surface.albedo = surface.albedo.times(texture::samples(image, &spot));
        }
        let leaves = paint.pattern == Pattern::Foliage;
        let mut normal = facet.flat;
        let (mut direct, mut ambient) = (facet.direct, facet.ambient);
        if curve.is_some() || surface.bump.is_some() {
            if let Some(curve) = curve {
                let [x, y, z] = [curve.rows[0].dot(p), curve.rows[1].dot(p), curve.rows[2].dot(p)];
                normal = (V3 { x, y, z } + curve.offset).unit_or(normal);
            }
            if let Some([u, v]) = surface.bump {
                normal = (normal + facet.u_axis * u + facet.v_axis * v).unit_or(facet.flat);
            }
            (direct, ambient) = self.unshaded(normal, leaves);
        }
        let mut sunlit = direct.simd_gt(0.0);
        if !leaves {
            sunlit &= facet.faces_sun.simd_gt(0.0);
        }
        let none = F::splat(simd, 0.0);
        let sun = if sunlit.any_true() {
            sunlit.select(direct * self.palette.shadows.lit(p, &facet.receiver, sunlit, self.fine), none)
        } else {
            none
        };
        let sky = &self.palette.sky;
        let open = self.palette.ambient.open(p + facet.flat * F::splat(simd, 0.6));
        let even = self.even(p, facet.flat, normal, ambient * open);
        let mut colour = surface.albedo.times(V3::along(sky.light.sun, sun) + even);
        if paint.emission != Vec3::ZERO {
            colour = colour + V3::along(paint.emission, surface.glow.unwrap_or(F::splat(simd, 1.0)));
        }
        let wet = sky.light.rain * WET;
        if wet > 0.0 && surface.mirror.is_none() {
            surface.mirror = Some(clamp((facet.flat.z - 0.9) * 20.0, 0.0, 1.0) * clamp((open - 0.45) * 4.0, 0.0, 1.0) * wet);
        }
        if let Some(mirror) = surface.mirror
            && mirror.simd_gt(0.0).any_true()
        {
            let across = rays.to.dot(normal);
            let mirrored = rays.to - normal * (across * 2.0);
            let grazing = clamp(across + 1.0, 0.0, 1.0);
            let g2 = grazing * grazing;
            let fraction = (g2 * g2 * grazing * 0.92 + 0.08) * mirror;
            let below = sky.light.horizon * 0.35 + sky.light.ground_ambient * 0.3;
            let seen = V3::select(mirrored.z.simd_gt(0.0), sky.clear(mirrored), V3::splat(simd, below));
            colour = colour + (seen * (open * 0.65 + 0.35) - colour) * fraction;
        }
        colour
    }
}

/// Positions of pixels on their surfaces, and the areas that they cover.
#[inline(always)]
fn spot<S: Simd>(facet: &Facet<F<S>>, away: V3<F<S>>, z: F<S>, coarse: f32) -> Spot<S> {
    let (u, v) = (facet.u_axis.dot(away), facet.v_axis.dot(away));
    // A step across the image moves the point on the plane: dP = z·(R − ray·(n·R)/(n·ray)).
    let (slant_right, slant_down) = (facet.slant_right * z, facet.slant_down * z);
    Spot {
        u: facet.eye_u + u,
        v: facet.eye_v + v,
        foot_u: longer(facet.right_u * z - u * slant_right, facet.down_u * z - u * slant_down),
        foot_v: longer(facet.right_v * z - v * slant_right, facet.down_v * z - v * slant_down),
        coarse,
    }
}

/// Approximate length of (`x`, `y`).
#[inline(always)]
fn longer<S: Simd>(x: F<S>, y: F<S>) -> F<S> {
    let (x, y) = (x.abs(), y.abs());
    x.max(y) + x.min(y) * 0.35
}
