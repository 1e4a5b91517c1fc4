//! What colour a pixel has: surface, sun and shadow, sky light, mirror, haze, and the film's curve.

use glam::{Vec2, Vec3};

use super::Palette;
use super::pattern::Surface;
use super::prepare::{Soup, Triangle};
use super::raster::NONE;
use super::view::View;
use crate::geometry::{Material, Pattern};

/// Shades pixels of one picture.
pub(crate) struct Shader<'a> {
    pub(super) soup: &'a Soup,
    /// Triangles that this picture alone has; their ids follow the scene's.
    pub(super) actors: &'a Soup,
    pub(super) materials: &'a [Material],
    pub(super) palette: &'a Palette,
    pub(super) view: &'a View,
}

/// Film: a rational fit to the ACES curve (Narkowicz 2015), for each channel; 0..=1 in linear display light.
#[inline]
fn film(exposed: Vec3) -> Vec3 {
    let x = exposed.max(Vec3::ZERO);
    (x * (x * 2.51 + 0.03)) / (x * (x * 2.43 + 0.59) + 0.14)
}

impl Shader<'_> {
    fn triangle(&self, id: u32) -> (&Soup, &Triangle) {
        let scene = self.soup;
        match scene.triangles.get(id as usize) {
            Some(t) => (scene, t),
            None => (self.actors, &self.actors.triangles[id as usize - scene.triangles.len()]),
        }
    }

    /// True when two triangles belong to one smooth surface, so that their common edge is not seen.
    pub(crate) fn continuous(&self, a: u32, b: u32) -> bool {
        if a == b {
            return true;
        }
        if a == NONE || b == NONE {
            return false;
        }
        let ((_, s), (_, t)) = (self.triangle(a), self.triangle(b));
        let curved = s.smooth != 0 && t.smooth != 0;
        s.material == t.material
            && if curved {
                s.normal.dot(t.normal) > 0.8
            } else {
                s.normal.dot(t.normal) > 0.999 && (s.offset - t.offset).abs() < 0.02
            }
    }

    /// Display light (linear, 0..=1) at picture position (`x`, `y`) where triangle `id` is seen at nearness `near`.
    pub(crate) fn colour(&self, id: u32, near: f32, x: f32, y: f32) -> Vec3 {
        let ray = self.view.ray(x, y);
        let length = ray.length();
        let to = ray / length;
        if id == NONE {
            return film(self.palette.sky.seen(to, &self.palette.noise, 1.0 / self.view.fx) * self.palette.sky.exposure);
        }
        let z = 1.0 / near;
        let lit = self.surface(id, ray, to, z);
        film(self.palette.sky.hazed(lit, to, z * length, &self.palette.decay) * self.palette.sky.exposure)
    }

    fn surface(&self, id: u32, ray: Vec3, to: Vec3, z: f32) -> Vec3 {
        let (soup, t) = self.triangle(id);
        let Some(material) = self.materials.get(usize::from(t.material)) else { return Vec3::ZERO };
        let p = self.view.eye + ray * z;
        let towards = t.normal.dot(ray);
        let side = if towards > 0.0 { -1.0 } else { 1.0 };
        let flat = t.normal * side;
        let uv = Vec2::new(t.u_axis.dot(p) + t.u_offset, t.v_axis.dot(p) + t.v_offset);
        // Windows stand in walls: a roof of the same part is bare.
        let roof = matches!(material.pattern, Pattern::Windows { .. }) && t.normal.z.abs() > 0.7;
        let bare;
        let shown = if roof {
            bare = Material { colour: material.colour * 0.8, pattern: Pattern::Concrete { joint: 0.0 }, ..material.clone() };
            &bare
        } else {
            material
        };
        let surface = Surface::new(shown, uv, self.footprint(t, ray, towards, z), &self.palette.noise);
        let mut normal = match t.smooth {
            0 => flat,
            n => {
                let s = &soup.smooth[n as usize - 1];
                let n = Vec3::new(s.axes[0].dot(p), s.axes[1].dot(p), s.axes[2].dot(p)) + s.offset;
                n.normalize_or(t.normal) * side
            }
        };
        if surface.bump != Vec2::ZERO {
            normal = (normal + t.u_axis * surface.bump.x + t.v_axis * surface.bump.y).normalize_or(flat);
        }
        self.light(material, &surface, p, flat, normal, to)
    }

    /// Metres of u and v that the pixel covers.
    #[inline]
    fn footprint(&self, t: &Triangle, ray: Vec3, towards: f32, z: f32) -> Vec2 {
        // A step across the picture moves the point on the plane: dP = z·(R − ray·(n·R)/(n·ray)).
        let slant = 1.0 / if towards.abs() < 1e-4 { 1e-4 } else { towards };
        let step = |r: Vec3| (r - ray * (t.normal.dot(r) * slant)) * z;
        let (dx, dy) = (step(self.view.right / self.view.fx), step(self.view.down / self.view.fy));
        let join = |axis: Vec3| {
            let (a, b) = (axis.dot(dx).abs(), axis.dot(dy).abs());
            a.max(b) + 0.35 * a.min(b)
        };
        Vec2::new(join(t.u_axis), join(t.v_axis))
    }

    fn light(&self, material: &Material, surface: &Surface, p: Vec3, flat: Vec3, normal: Vec3, to: Vec3) -> Vec3 {
        let sky = &self.palette.sky;
        let light = &sky.light;
        let leaves = material.pattern == Pattern::Foliage;
        let cosine = normal.dot(light.to_sun);
        // Leaves let light through: their dark side is dimmer, not dark.
        let direct = if leaves { (0.72 * cosine + 0.28).max(0.12) } else { cosine.max(0.0) };
        let faces_sun = flat.dot(light.to_sun);
        let sun = if direct > 0.0 && (faces_sun > 0.0 || leaves) {
            direct * self.palette.shadows.lit(p, if faces_sun > 0.0 { flat } else { -flat }, faces_sun.abs())
        } else {
            0.0
        };
        let up = 0.5 + 0.5 * normal.z;
        let open = self.palette.ambient.open(p + flat * 0.6);
        // Walls in the shade differ a little by where they face, as skies are never even.
        let turn = 1.0 + 0.10 * normal.x - 0.06 * normal.y;
        let ambient = (light.ground_ambient + (light.sky_ambient - light.ground_ambient) * up) * (open * turn);
        let mut colour = surface.albedo * (light.sun * sun + ambient) + material.emission * surface.glow;
        if surface.mirror > 0.0 {
            let mirrored = to - normal * (2.0 * to.dot(normal));
            let grazing = (1.0 + to.dot(normal)).clamp(0.0, 1.0);
            let g2 = grazing * grazing;
            let share = (0.08 + 0.92 * g2 * g2 * grazing) * surface.mirror;
            let seen = if mirrored.z > 0.0 { sky.clear(mirrored) } else { light.horizon * 0.35 + light.ground_ambient * 0.3 };
            colour += (seen * (0.35 + 0.65 * open) - colour) * share;
        }
        colour
    }
}
