//! What colour a pixel has: surface, sun and shadow, sky light, mirror, haze, and the film's curve.
//!
//! What does not change over a triangle is worked out once for a triangle and a view ([`Facet`]); tiles keep the facets they used last.

use glam::{Vec2, Vec3};

use super::Palette;
use super::pattern::{Paint, Surface};
use super::prepare::{Soup, Triangle};
use super::raster::NONE;
use super::shadow::Receiver;
use super::texture;
use super::view::View;
use crate::geometry::{Material, Pattern};
use crate::texture::Texture;

/// Shades pixels of one picture.
pub(crate) struct Shader<'a> {
    pub(super) soup: &'a Soup,
    /// Triangles that this picture alone has; their ids follow the scene's.
    pub(super) actors: &'a Soup,
    pub(super) materials: &'a [Material],
    textures: &'a [Texture],
    pub(super) palette: &'a Palette,
    pub(super) view: &'a View,
    /// Steps of the ray for a pixel right and a pixel down.
    right: Vec3,
    down: Vec3,
}

/// A triangle in a view: what every pixel of it needs.
#[derive(Clone, Debug)]
pub(crate) struct Facet {
    id: u32,
    /// Towards the eye.
    flat: Vec3,
    /// 1 where the front is seen, −1 for the back.
    side: f32,
    /// Row in the soup's normals plus one; 0 for a flat triangle.
    smooth: u32,
    u_axis: Vec3,
    v_axis: Vec3,
    /// Texture coordinates of the eye itself.
    eye: Vec2,
    /// Change of (u, v) for a pixel right and a pixel down at 1 m of depth, as for a surface across the axis.
    right: Vec2,
    down: Vec2,
    /// What the slant adds, for each metre that (u, v) is off the eye's.
    slant_right: f32,
    slant_down: f32,
    paint: Paint,
    emission: Vec3,
    leaves: bool,
    /// Cosine of the plane to the sun.
    faces_sun: f32,
    receiver: Receiver,
    /// Sun and sky light of the flat plane, before shadow and openness.
    flat_light: (f32, Vec3),
}

/// Film: a rational fit to the ACES curve (Narkowicz 2015), for each channel; 0..=1 in linear display light.
#[inline]
pub(crate) fn film(exposed: Vec3) -> Vec3 {
    let x = exposed.max(Vec3::ZERO);
    (x * (x * 2.51 + 0.03)) / (x * (x * 2.43 + 0.59) + 0.14)
}

/// Facets used last in a tile.
#[derive(Default)]
pub(crate) struct Facets(Vec<Option<Facet>>);

/// Facets kept, a power of two.
const KEPT: usize = 64;

impl Facets {
    #[inline]
    fn of(&mut self, shader: &Shader<'_>, id: u32) -> &Facet {
        if self.0.is_empty() {
            self.0.resize(KEPT, None);
        }
        let slot = &mut self.0[id as usize & (KEPT - 1)];
        if slot.as_ref().is_none_or(|f| f.id != id) {
            *slot = None;
        }
        slot.get_or_insert_with(|| shader.facet(id))
    }
}

impl<'a> Shader<'a> {
    pub(super) fn new(
        soup: &'a Soup,
        actors: &'a Soup,
        (materials, textures): (&'a [Material], &'a [Texture]),
        palette: &'a Palette,
        view: &'a View,
    ) -> Self {
        let (right, down) = (view.right / view.fx, view.down / view.fy);
        Self { soup, actors, materials, textures, palette, view, right, down }
    }

    fn triangle(&self, id: u32) -> (&Soup, &Triangle) {
        let scene = self.soup;
        match scene.triangles.get(id as usize) {
            Some(t) => (scene, t),
            None => (self.actors, &self.actors.triangles[id as usize - scene.triangles.len()]),
        }
    }

    /// True when two triangles belong to one smooth surface, so that their common edge is not seen.
    #[inline]
    pub(crate) fn continuous(&self, a: u32, b: u32) -> bool {
        a == b || (a != NONE && b != NONE && self.joined(a, b))
    }

    fn joined(&self, a: u32, b: u32) -> bool {
        let ((_, s), (_, t)) = (self.triangle(a), self.triangle(b));
        let curved = s.smooth != 0 && t.smooth != 0;
        s.material == t.material
            && if curved {
                s.normal.dot(t.normal) > 0.8
            } else {
                s.normal.dot(t.normal) > 0.999 && (s.offset - t.offset).abs() < 0.02
            }
    }

    fn facet(&self, id: u32) -> Facet {
        let (_, t) = self.triangle(id);
        let eye = self.view.eye;
        // The plane n·p = offset meets the ray r at z = height / (n·r).
        let height = t.offset - t.normal.dot(eye);
        let side = if height > 0.0 { -1.0 } else { 1.0 };
        let flat = t.normal * side;
        let over = 1.0 / if height.abs() < 1e-6 { 1e-6 } else { height };
        // Materials are checked when a scene is made; a part without one is black.
        let (paint, emission) = match self.materials.get(usize::from(t.material)) {
            Some(m) => {
                // Windows stand in walls: a roof of the same part is bare.
                let roof = matches!(m.pattern, Pattern::Windows { .. }) && t.normal.z.abs() > 0.7;
                let paint = if roof {
                    Paint::new(m.colour * 0.8, m.accent, Pattern::Concrete { joint: 0.0 })
                } else {
                    Paint::new(m.colour, m.accent, m.pattern)
                };
                (paint, m.emission)
            }
            None => (Paint::new(Vec3::ZERO, Vec3::ZERO, Pattern::Plain), Vec3::ZERO),
        };
        let to_sun = self.palette.sky.light.to_sun;
        let faces_sun = flat.dot(to_sun);
        let leaves = paint.pattern == Pattern::Foliage;
        Facet {
            id,
            flat,
            side,
            smooth: t.smooth,
            u_axis: t.u_axis,
            v_axis: t.v_axis,
            eye: Vec2::new(t.u_axis.dot(eye) + t.u_offset, t.v_axis.dot(eye) + t.v_offset),
            right: Vec2::new(t.u_axis.dot(self.right), t.v_axis.dot(self.right)),
            down: Vec2::new(t.u_axis.dot(self.down), t.v_axis.dot(self.down)),
            slant_right: t.normal.dot(self.right) * over,
            slant_down: t.normal.dot(self.down) * over,
            paint,
            emission,
            leaves,
            faces_sun,
            receiver: self.palette.shadows.receiver(if faces_sun > 0.0 { flat } else { -flat }, faces_sun.abs()),
            flat_light: self.unshaded(flat, leaves),
        }
    }

    /// Share of the sun's light on a surface of unit `normal`, and light of sky and ground, both before anything stands between.
    #[inline]
    fn unshaded(&self, normal: Vec3, leaves: bool) -> (f32, Vec3) {
        let light = &self.palette.sky.light;
        let cosine = normal.dot(light.to_sun);
        // Leaves let light through: their dark side is dimmer, not dark.
        let direct = if leaves { (0.72 * cosine + 0.28).max(0.12) } else { cosine.max(0.0) };
        let up = 0.5 + 0.5 * normal.z;
        // Walls in the shade differ a little by where they face, as skies are never even.
        let turn = 1.0 + 0.10 * normal.x - 0.06 * normal.y;
        (direct, (light.ground_ambient + (light.sky_ambient - light.ground_ambient) * up) * turn)
    }

    /// Light on the film at picture position (`x`, `y`) where triangle `id` is seen at nearness `near`: [`film`] makes it display light.
    #[inline]
    pub(crate) fn exposed(&self, facets: &mut Facets, id: u32, near: f32, x: f32, y: f32) -> Vec3 {
        let ray = self.view.forward + self.right * (x - self.view.cx) + self.down * (y - self.view.cy);
        let length = ray.length_squared().sqrt();
        let to = ray * (1.0 / length);
        let sky = &self.palette.sky;
        if id == NONE {
            return sky.seen(to, &self.palette.noise, 1.0 / self.view.fx) * sky.exposure;
        }
        let z = 1.0 / near;
        let lit = self.surface(facets.of(self, id), ray * z, to, z);
        sky.hazed(lit, to, z * length, &self.palette.decay) * sky.exposure
    }

    /// Light from the surface `away` from the eye, at depth `z`.
    fn surface(&self, facet: &Facet, away: Vec3, to: Vec3, z: f32) -> Vec3 {
        let p = self.view.eye + away;
        let off = Vec2::new(facet.u_axis.dot(away), facet.v_axis.dot(away));
        // A step across the picture moves the point on the plane: dP = z·(R − ray·(n·R)/(n·ray)).
        let (dx, dy) = (facet.right * z - off * (facet.slant_right * z), facet.down * z - off * (facet.slant_down * z));
        let (dx, dy) = (dx.abs(), dy.abs());
        let foot = dx.max(dy) + dx.min(dy) * 0.35;
        let uv = facet.eye + off;
        let mut surface = Surface::new(&facet.paint, uv, foot, &self.palette.noise);
        if let Pattern::Image { texture, .. } = facet.paint.pattern
            && let Some(picture) = self.textures.get(usize::from(texture))
        {
            surface.albedo *= texture::sample(picture, uv, foot);
        }
        let mut normal = facet.flat;
        let (direct, ambient) = if facet.smooth == 0 && surface.bump == Vec2::ZERO {
            facet.flat_light
        } else {
            if facet.smooth != 0 {
                let s = &self.triangle(facet.id).0.smooth[facet.smooth as usize - 1];
                let n = Vec3::new(s.axes[0].dot(p), s.axes[1].dot(p), s.axes[2].dot(p)) + s.offset;
                normal = unit(n, facet.flat * facet.side) * facet.side;
            }
            if surface.bump != Vec2::ZERO {
                normal = unit(normal + facet.u_axis * surface.bump.x + facet.v_axis * surface.bump.y, facet.flat);
            }
            self.unshaded(normal, facet.leaves)
        };
        let sun = if direct > 0.0 && (facet.faces_sun > 0.0 || facet.leaves) {
            direct * self.palette.shadows.lit(p, &facet.receiver)
        } else {
            0.0
        };
        let sky = &self.palette.sky;
        let open = self.palette.ambient.open(p + facet.flat * 0.6);
        let mut colour = surface.albedo * (sky.light.sun * sun + ambient * open) + facet.emission * surface.glow;
        if surface.mirror > 0.0 {
            let across = to.dot(normal);
            let mirrored = to - normal * (2.0 * across);
            let grazing = (1.0 + across).clamp(0.0, 1.0);
            let g2 = grazing * grazing;
            let share = (0.08 + 0.92 * g2 * g2 * grazing) * surface.mirror;
            let seen =
                if mirrored.z > 0.0 { sky.clear(mirrored) } else { sky.light.horizon * 0.35 + sky.light.ground_ambient * 0.3 };
            colour += (seen * (0.35 + 0.65 * open) - colour) * share;
        }
        colour
    }
}

/// `v` with length 1, or `other` when it has none.
#[inline]
fn unit(v: Vec3, other: Vec3) -> Vec3 {
    let square = v.length_squared();
    if square > 1e-12 { v * (1.0 / square.sqrt()) } else { other }
}
