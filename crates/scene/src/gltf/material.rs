//! Materials of a file, converted for the renderer.

use std::collections::BTreeMap;

use glam::{Vec2, Vec3};
use gltf::json::extensions::material::PbrSpecularGlossiness;
use gltf::json::material::AlphaMode;
use gltf::json::validation::Checked;
use gltf::json::{Root, texture};

use super::images::{Images, base_texture, specular_glossiness};
use super::problem::{Problem, missing};
use crate::geometry::{Material, Pattern};
use crate::texture::Texture;

/// Steps per channel in the palette of vertex colours.
const STEPS: usize = 32;
/// Width of that palette, texels.
const PALETTE_WIDTH: usize = 256;
/// Its height.
const PALETTE_HEIGHT: usize = STEPS * STEPS * STEPS / PALETTE_WIDTH;

/// Appearance of a primitive.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Look {
    /// Index into the scene's materials.
    pub(super) material: u16,
    /// Mean colour, linear RGB.
    pub(super) mean: Vec3,
    /// Its image.
    pub(super) image: Option<TextureUse>,
    /// Whether it uses vertex colours.
    pub(super) by_corner: bool,
    /// Clear: solid, not rendered.
    pub(super) invisible: bool,
}

/// Mapping of an image onto a primitive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TextureUse {
    /// Index of the texture coordinates.
    pub(super) set: u32,
    offset: Vec2,
    /// Columns of the matrix of rotation and scale.
    columns: [Vec2; 2],
}

impl TextureUse {
    /// Texture coordinates of a vertex.
    pub(super) fn at(&self, uv: [f32; 2]) -> Vec2 {
        let at = self.offset + self.columns[0] * uv[0] + self.columns[1] * uv[1];
        if at.is_finite() { at } else { Vec2::ZERO }
    }

    fn new(info: &texture::Info) -> Self {
        let plain = Self { set: info.tex_coord, offset: Vec2::ZERO, columns: [Vec2::X, Vec2::Y] };
        let Some(moved) = info.extensions.as_ref().and_then(|e| e.texture_transform.as_ref()) else { return plain };
        // KHR_texture_transform: scaled, then turned counter-clockwise, then moved.
        let (c, s) = (libm::cos(f64::from(moved.rotation.0)) as f32, libm::sin(f64::from(moved.rotation.0)) as f32);
        let [w, h] = moved.scale.0;
        Self {
            set: moved.tex_coord.unwrap_or(info.tex_coord),
            offset: Vec2::from(moved.offset.0),
            columns: [Vec2::new(c, -s) * w, Vec2::new(s, c) * h],
        }
    }
}

/// The materials of a scene, in order of first use.
pub(super) struct Looks<'a> {
    root: &'a Root,
    images: Images,
    palette: Option<u16>,
    known: BTreeMap<(Option<usize>, bool), Look>,
    pub(super) materials: Vec<Material>,
}

impl<'a> Looks<'a> {
    pub(super) fn new(root: &'a Root, images: Images) -> Self {
        Self { root, images, palette: None, known: BTreeMap::new(), materials: Vec::new() }
    }

    /// The textures, in the order that the materials refer to.
    pub(super) fn into_parts(self) -> (Vec<Material>, Vec<Texture>) {
        (self.materials, self.images.textures)
    }

    /// Colour of a vertex, for primitives with vertex colours.
    pub(super) fn corner_colour(uv: Vec2) -> Vec3 {
        let (x, y) = ((uv.x * PALETTE_WIDTH as f32) as usize, (uv.y * PALETTE_HEIGHT as f32) as usize);
        let index = y * PALETTE_WIDTH + x;
        let root = [index / (STEPS * STEPS), index / STEPS % STEPS, index % STEPS].map(|step| step as f32 / (STEPS - 1) as f32);
        Vec3::from(root) * Vec3::from(root)
    }

    /// The appearance of a primitive with this material; `coloured`: whether its vertices have colours.
    pub(super) fn look(&mut self, material: Option<usize>, coloured: bool) -> Result<Look, Problem> {
        if let Some(look) = self.known.get(&(material, coloured)) {
            return Ok(look.clone());
        }
        let look = self.make(material, coloured)?;
        self.known.insert((material, coloured), look.clone());
        Ok(look)
    }

    fn make(&mut self, index: Option<usize>, coloured: bool) -> Result<Look, Problem> {
        let default = gltf::json::Material::default();
        let found = match index {
            Some(index) => self.root.materials.get(index).ok_or_else(|| missing("material", index))?,
            None => &default,
        };
        let Paint { colour, alpha, metallic, roughness } = Paint::of(found);
        let mirror = mirror(metallic, roughness);
        let base = base_texture(found);
        let texture = base.and_then(|info| self.images.of(self.root, info));
        let emission = self.emission(found);
        let (pattern, mean, by_corner) = match texture {
            Some(texture) => {
                let image = self.images.textures.get(usize::from(texture)).map_or(Vec3::ONE, Texture::mean);
                (Pattern::Image { texture, mirror }, colour * image, false)
            }
            None if coloured => (Pattern::Image { texture: self.palette()?, mirror }, colour, true),
            // A missing texture is white.
            None if mirror > 0.0 => (Pattern::Image { texture: u16::MAX, mirror }, colour, false),
            None => (Pattern::Plain, colour, false),
        };
        let made = Material { colour, accent: colour * 0.7, pattern, two_sided: found.double_sided, emission };
        let material = u16::try_from(self.materials.len()).map_err(|_| Problem::new("it has more than 65535 materials"))?;
        self.materials.push(made);
        let clear = found.alpha_mode != Checked::Valid(AlphaMode::Opaque) && alpha < 0.05;
        let image = texture.and(base).map(TextureUse::new);
        Ok(Look { material, mean, image, by_corner, invisible: clear })
    }

    fn emission(&self, material: &gltf::json::Material) -> Vec3 {
        let strength =
            material.extensions.as_ref().and_then(|e| e.emissive_strength.as_ref()).map_or(1.0, |e| e.emissive_strength.0);
        let given = Vec3::from(material.emissive_factor.0.map(fraction)) * strength.clamp(0.0, 20.0);
        // What a map that could not be read would leave dark is not known: nothing glows.
        let Some(info) = &material.emissive_texture else { return given };
        let image = self.images.of(self.root, info).and_then(|image| self.images.textures.get(usize::from(image)));
        given * image.map_or(Vec3::ZERO, Texture::mean)
    }

    /// The palette image of vertex colours.
    fn palette(&mut self) -> Result<u16, Problem> {
        if let Some(palette) = self.palette {
            return Ok(palette);
        }
        let step = |i: usize| (i * 255 / (STEPS - 1)) as u8;
        let texel = |i: usize| [step(i / (STEPS * STEPS)), step(i / STEPS % STEPS), step(i % STEPS), u8::MAX];
        let texels = (0..STEPS * STEPS * STEPS).map(texel).collect();
        let index = self.images.push(Texture::from_roots(PALETTE_WIDTH, PALETTE_HEIGHT, texels))?;
        self.palette = Some(index);
        Ok(index)
    }
}

/// What a material reflects, as metal or not.
struct Paint {
    /// Linear RGB.
    colour: Vec3,
    alpha: f32,
    metallic: f32,
    roughness: f32,
}

impl Paint {
    fn of(material: &gltf::json::Material) -> Self {
        match specular_glossiness(material) {
            Some(other) => Self::specular(other),
            None => {
                let pbr = &material.pbr_metallic_roughness;
                let [r, g, b, alpha] = pbr.base_color_factor.0.map(fraction);
                let [metallic, roughness] = [pbr.metallic_factor.0, pbr.roughness_factor.0].map(fraction);
                Self { colour: Vec3::new(r, g, b), alpha, metallic, roughness }
            }
        }
    }

    /// From diffuse and specular colour. Metal has no diffuse colour; anything else reflects only some 4 %.
    fn specular(given: &PbrSpecularGlossiness) -> Self {
        let [r, g, b, alpha] = given.diffuse_factor.0.map(fraction);
        let (diffuse, specular) = (Vec3::new(r, g, b), Vec3::from(given.specular_factor.0.map(fraction)));
        let is_metal = given.diffuse_texture.is_none() && diffuse.max_element() < 0.04 && specular.max_element() > 0.2;
        let (colour, metallic) = if is_metal { (specular, 1.0) } else { (diffuse, 0.0) };
        Self { colour, alpha, metallic, roughness: 1.0 - fraction(given.glossiness_factor.0) }
    }
}

/// Position in the palette of the mean of three vertex colours.
pub(super) fn shade_of(corners: [[f32; 4]; 3]) -> Vec2 {
    let mean = |channel: usize| corners.iter().map(|c| fraction(c[channel])).sum::<f32>() / 3.0;
    let step = |channel: usize| (mean(channel).sqrt() * (STEPS - 1) as f32 + 0.5) as usize;
    let index = (step(0) * STEPS + step(1)) * STEPS + step(2);
    let (x, y) = (index % PALETTE_WIDTH, index / PALETTE_WIDTH);
    Vec2::new((x as f32 + 0.5) / PALETTE_WIDTH as f32, (y as f32 + 0.5) / PALETTE_HEIGHT as f32)
}

/// A fraction, clamped to 0..=1.
fn fraction(value: f32) -> f32 {
    if value.is_nan() { 0.0 } else { value.clamp(0.0, 1.0) }
}

/// Reflectivity of a surface: high for polished metal, low for gloss paint and glass, zero for rough surfaces.
fn mirror(metallic: f32, roughness: f32) -> f32 {
    let smooth = (1.0 - roughness) * (1.0 - roughness);
    let mirror = smooth * (0.4 + 0.6 * metallic);
    if mirror < 0.02 { 0.0 } else { mirror }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corner_colours_come_back_from_the_palette() {
        for colour in [[1.0, 0.0, 0.25], [0.0, 1.0, 1.0], [0.5, 0.04, 0.7]] {
            let [r, g, b] = colour;
            let found = Looks::corner_colour(shade_of([[r, g, b, 1.0]; 3]));
            assert!((found - Vec3::from(colour)).abs().max_element() < 0.04, "{colour:?}: {found}");
        }
    }

    #[test]
    fn images_are_transformed_as_the_extension_states() {
        // A quarter turn counter-clockwise with v down: u goes to −v.
        let (c, s) = (0.0, 1.0);
        let image = TextureUse { set: 0, offset: Vec2::new(0.5, 0.0), columns: [Vec2::new(c, -s) * 2.0, Vec2::new(s, c)] };
        assert_eq!(image.at([1.0, 0.25]), Vec2::new(0.75, -2.0));
        assert_eq!(image.at([f32::INFINITY, 0.0]), Vec2::ZERO);
    }
}
