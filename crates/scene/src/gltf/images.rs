//! Images of a file: PNG and JPEG, checked before decoding, scaled down to fit the memory limit. Of others the file tells a
//! fallback, or they are left out with a warning.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

use gltf::json::extensions::material::PbrSpecularGlossiness;
use gltf::json::{Material, Root, texture};
use spf_media::file::{FileError, Format, ImageFile, Limits, Samples};

use super::files::{Buffers, Surroundings};
use super::problem::{Problem, missing, short};
use crate::texture::{MAX_SIDE, Texture};

/// Maximum memory of all textures together, bytes.
const MAX_MEMORY: u64 = 256 << 20;
/// Maximum side that is kept, texels.
const KEPT_SIDE: u32 = 4096;
/// Maximum number of decoded pixels, of all images together.
const MAX_PIXELS: u64 = 1 << 29;
/// Memory limit for decoding one image: 256 MiB.
const LIMITS: Limits = Limits { side: u32::MAX, pixels: u64::MAX, memory: 256 << 20 };

/// The images in use.
#[derive(Debug, Default)]
pub(super) struct Images {
    pub(super) textures: Vec<Texture>,
    by_image: BTreeMap<usize, u16>,
    /// What was left out, and what that costs.
    pub(super) warnings: Vec<String>,
}

struct Encoded<'a> {
    image: usize,
    bytes: Cow<'a, [u8]>,
    size: (u32, u32),
}

impl Images {
    /// Reads the images of these materials: base colour and emission.
    pub(super) fn load(
        root: &Root,
        used: &BTreeSet<usize>,
        buffers: &Buffers<'_>,
        around: &mut Surroundings,
    ) -> Result<Self, Problem> {
        let materials = used.iter().filter_map(|&index| root.materials.get(index));
        let infos = materials.flat_map(|m| [base_texture(m), m.emissive_texture.as_ref()]).flatten();
        let (mut wanted, mut lost) = (BTreeSet::new(), BTreeMap::<String, BTreeSet<usize>>::new());
        for info in infos {
            match source(root, info) {
                Some(image) => drop(wanted.insert(image)),
                None => drop(lost.entry(without_source(root, info)).or_default().insert(info.index.value())),
            }
        }
        let mut encoded = Vec::new();
        for image in wanted {
            match open(root, image, buffers, around)? {
                Some(found) => encoded.push(found),
                None => {
                    let is_its = |(_, texture): &(usize, &texture::Texture)| texture.source.value() == image;
                    let textures = root.textures.iter().enumerate().filter(is_its).map(|(index, _)| index);
                    lost.entry("an image that is neither PNG nor JPEG".to_owned()).or_default().extend(textures);
                }
            }
        }
        let pixels = |e: &Encoded<'_>| u64::from(e.size.0) * u64::from(e.size.1);
        if encoded.iter().map(pixels).sum::<u64>() > MAX_PIXELS {
            let message = format!("its textures exceed {} million pixels", MAX_PIXELS >> 20);
            return Err(Problem::new(message).hint("reduce the textures"));
        }
        let halvings = halvings(&encoded.iter().map(|e| e.size).collect::<Vec<_>>());
        let mut images =
            Self { warnings: lost.iter().map(|(why, textures)| left_out(why, textures)).collect(), ..Self::default() };
        for (encoded, halvings) in encoded.into_iter().zip(halvings) {
            let index = images.push(decode(&encoded)?.coarser(halvings))?;
            images.by_image.insert(encoded.image, index);
        }
        Ok(images)
    }

    /// The texture behind a material's reference.
    pub(super) fn of(&self, root: &Root, info: &texture::Info) -> Option<u16> {
        self.by_image.get(&source(root, info)?).copied()
    }

    /// Adds a texture.
    pub(super) fn push(&mut self, texture: Texture) -> Result<u16, Problem> {
        // The largest index stands for a missing texture.
        let index = u16::try_from(self.textures.len()).ok().filter(|&index| index < u16::MAX);
        let index = index.ok_or_else(|| Problem::new("it has more than 65534 textures"))?;
        self.textures.push(texture);
        Ok(index)
    }
}

/// The other description of a material, which takes precedence over the usual one.
pub(super) fn specular_glossiness(material: &Material) -> Option<&PbrSpecularGlossiness> {
    material.extensions.as_ref()?.pbr_specular_glossiness.as_ref()
}

/// The image of a surface's colour.
pub(super) fn base_texture(material: &Material) -> Option<&texture::Info> {
    match specular_glossiness(material) {
        Some(other) => other.diffuse_texture.as_ref(),
        None => material.pbr_metallic_roughness.base_color_texture.as_ref(),
    }
}

/// The image of a texture; `None` if only an extension names one.
fn source(root: &Root, info: &texture::Info) -> Option<usize> {
    let source = root.textures.get(info.index.value())?.source.value();
    (source < root.images.len()).then_some(source)
}

/// What a texture without an image needs, in words.
fn without_source(root: &Root, info: &texture::Info) -> String {
    let extensions = root.textures.get(info.index.value()).and_then(|texture| texture.extensions.as_ref());
    match extensions.and_then(|extensions| extensions.others.keys().next()) {
        Some(name) => format!("`{}`", short(name)),
        None => "an image that the file does not name".to_owned(),
    }
}

/// The warning about textures that need what cannot be read.
fn left_out(needed: &str, textures: &BTreeSet<usize>) -> String {
    let list = textures.iter().take(5).map(usize::to_string).collect::<Vec<_>>().join(", ");
    let (which, what) = match textures.len() {
        1 => (format!("texture {list} needs"), "its surfaces have"),
        2..=5 => (format!("textures {list} need"), "their surfaces have"),
        more => (format!("{more} textures ({list}, …) need"), "their surfaces have"),
    };
    format!(
        "{which} {needed}, which cannot be read: {what} the plain colour of their material, which also names the objects, and \
         do not glow; export the textures as PNG or JPEG"
    )
}

/// Number of times each image is halved so that all fit the memory limit.
fn halvings(sizes: &[(u32, u32)]) -> Vec<usize> {
    let own = |(w, h): (u32, u32)| (0..).find(|&n| w.max(h) >> n <= KEPT_SIDE).unwrap_or(0);
    // Four bytes per texel, and a third more for the mip levels.
    let memory = |all: u32| -> u64 {
        let side = |side: u32, n: u32| u64::from((side >> n).max(1));
        sizes.iter().map(|&(w, h)| (side(w, own((w, h)).max(all)) * side(h, own((w, h)).max(all)) * 16).div_ceil(3)).sum()
    };
    let all = (0..16).find(|&n| memory(n) <= MAX_MEMORY).unwrap_or(16);
    sizes.iter().map(|&size| own(size).max(all) as usize).collect()
}

/// An image, measured; `None` if it is neither PNG nor JPEG.
fn open<'a>(
    root: &Root,
    image: usize,
    buffers: &'a Buffers<'_>,
    around: &mut Surroundings,
) -> Result<Option<Encoded<'a>>, Problem> {
    let found = root.images.get(image).ok_or_else(|| missing("image", image))?;
    let bytes = match (found.buffer_view, &found.uri) {
        (Some(view), _) => Cow::Borrowed(buffers.view(root, view)?.0),
        (None, Some(uri)) => Cow::Owned(around.read(uri)?),
        (None, None) => return Err(Problem::new(format!("image {image} has no data"))),
    };
    if Format::of(&bytes).is_none() {
        return Ok(None);
    }
    let size = ImageFile::open(&bytes, LIMITS).map_err(|e| unreadable(image, &e))?.size();
    if size.0.max(size.1) > MAX_SIDE {
        let message = format!("image {image} has {} × {} pixels; at most {MAX_SIDE} per side are supported", size.0, size.1);
        return Err(Problem::new(message).hint("reduce the texture"));
    }
    Ok(Some(Encoded { image, bytes, size }))
}

fn unreadable(image: usize, error: &FileError) -> Problem {
    Problem::new(format!("cannot read image {image}: {error}"))
        .hint("export the texture again as PNG or JPEG, 8 bits per channel")
}

fn decode(encoded: &Encoded<'_>) -> Result<Texture, Problem> {
    let file = ImageFile::open(&encoded.bytes, LIMITS);
    let image = file.and_then(ImageFile::decode).map_err(|e| unreadable(encoded.image, &e))?;
    let (width, height) = (image.width(), image.height());
    let rgb = if image.has_alpha() { filled(image) } else { image.into_rgb().into_data() };
    Texture::from_srgb(width, height, &rgb).ok_or_else(|| Problem::new(format!("image {} has no pixels", encoded.image)))
}

/// Colours without alpha: transparent pixels get the mean colour of the opaque ones, since their own colour is
/// arbitrary.
fn filled(image: Samples) -> Vec<u8> {
    let rgba = image.into_rgba();
    let (mut sum, mut count) = ([0_u64; 3], 0_u64);
    for pixel in rgba.iter().filter(|p| p[3] >= 128) {
        (0..3).for_each(|k| sum[k] += u64::from(pixel[k]));
        count += 1;
    }
    let mean = sum.map(|s| s.checked_div(count).unwrap_or(128) as u8);
    rgba.iter().flat_map(|&[r, g, b, alpha]| if alpha >= 128 { [r, g, b] } else { mean }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_are_halved_until_all_fit() {
        assert_eq!(halvings(&[(4096, 4096), (16, 16)]), [0, 0]);
        assert_eq!(halvings(&[(8192, 64), (1, 1)]), [1, 0]);
        // Four images of 4096 take 341 MiB.
        assert_eq!(halvings(&[(4096, 4096); 4]), [1; 4]);
        assert_eq!(halvings(&[(4096, 2048); 5]), [0; 5]);
        assert!(halvings(&[(8192, 8192); 65_000]).iter().all(|&n| n == 9));
    }

    #[test]
    fn clear_pixels_take_the_mean_of_the_others() {
        let rgba = spf_media::png::encode_rgba8(2, 1, &[200, 100, 0, 255, 0, 255, 0, 0]).unwrap();
        let image = spf_media::file::decode(&rgba, LIMITS).unwrap();
        assert_eq!(filled(image), [200, 100, 0, 200, 100, 0]);
    }
}
