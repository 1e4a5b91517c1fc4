//! Renders a channel as an image to send.

use spf_media::frame::Rgb;
use spf_media::jpeg::{EncodeError, Jpeg};
use spf_render::{Channels, RenderedImage};

use super::message::Channel;

/// JPEG quality.
const JPEG: u8 = 85;
/// Depth range of the logarithmic colour scale, metres.
const NEAREST: f32 = 0.5;
const FARTHEST: f32 = 250.0;
/// Colour of empty pixels.
const EMPTY: [u8; 3] = [16, 18, 24];
/// Colour of the outline of the object under the pointer.
const LINE: [u8; 3] = [255, 196, 0];

/// Channels to render for a view; ids, depth and openings always, for the pointer.
pub(super) fn channels(channel: Channel) -> Channels {
    Channels { rgb: channel == Channel::Colour, ..Channels::TRUTH }
}

/// Encodes a channel of an image, with an outline of the marked object.
///
/// # Errors
/// If the encoder rejects the size.
pub(super) fn encode(image: &RenderedImage, channel: Channel, marked: Option<u16>) -> Result<Jpeg, EncodeError> {
    let data = match channel {
        Channel::Colour => image.rgb.clone().unwrap_or_default(),
        Channel::Ids => ids(image),
        Channel::Depth => depth(image),
    };
    let mut rgb = Rgb::from_raw(image.width, image.height, data).unwrap_or_else(|_| Rgb::new(image.width, image.height));
    if let Some(id) = marked {
        for map in [&image.ids, &image.opening_ids].into_iter().flatten() {
            outline(&mut rgb, map, id);
        }
    }
    Jpeg::encode(&rgb, JPEG)
}

/// A colour per object; openings are hatched over what is behind them.
fn ids(image: &RenderedImage) -> Vec<u8> {
    let solid = image.ids.as_deref().unwrap_or_default();
    let openings = image.opening_ids.as_deref().unwrap_or_default();
    let width = image.width.max(1) as usize;
    let pixel = |(index, id): (usize, &u16)| {
        let opening = openings.get(index).copied().unwrap_or(0);
        let hatched = (index % width + index / width) % 8 < 3;
        if opening != 0 && hatched { id_colour(opening) } else { id_colour(*id) }
    };
    solid.iter().enumerate().flat_map(pixel).collect()
}

fn depth(image: &RenderedImage) -> Vec<u8> {
    image.depth.as_deref().unwrap_or_default().iter().flat_map(|metres| depth_colour(*metres)).collect()
}

/// Consecutive ids get distant hues (golden ratio) and three levels of brightness.
pub(super) fn id_colour(id: u16) -> [u8; 3] {
    if id == 0 {
        return EMPTY;
    }
    let hue = (f32::from(id) * 0.618_034).fract() * 6.0;
    let value = [0.95, 0.72, 0.84][usize::from(id % 3)];
    let part = |shift: f32| {
        let k = (hue + shift).rem_euclid(6.0);
        let fraction = 1.0 - 0.62 * (k.min(4.0 - k).clamp(0.0, 1.0));
        (value * fraction * 255.0) as u8
    };
    [part(5.0), part(3.0), part(1.0)]
}

/// Near is warm, far is cold: the colours of `STOPS` over the logarithm of the distance.
fn depth_colour(metres: f32) -> [u8; 3] {
    /// Also the gradient of the legend in `page/view.css`.
    const STOPS: [[f32; 3]; 6] = [
        [255.0, 245.0, 200.0],
        [252.0, 176.0, 80.0],
        [222.0, 73.0, 104.0],
        [140.0, 41.0, 129.0],
        [59.0, 15.0, 112.0],
        [12.0, 8.0, 38.0],
    ];
    if metres <= 0.0 {
        return EMPTY;
    }
    let fraction = (metres / NEAREST).ln() / (FARTHEST / NEAREST).ln();
    let along = fraction.clamp(0.0, 1.0) * (STOPS.len() - 1) as f32;
    let first = (along as usize).min(STOPS.len() - 2);
    let rest = along - first as f32;
    core::array::from_fn(|k| (STOPS[first][k] + (STOPS[first + 1][k] - STOPS[first][k]) * rest) as u8)
}

/// Draws the outline of an object, two pixels wide.
fn outline(rgb: &mut Rgb, map: &[u16], id: u16) {
    let (width, height) = (rgb.width() as usize, rgb.height() as usize);
    if map.len() != width * height {
        return;
    }
    for y in 0..height {
        for x in 0..width {
            let here = map[y * width + x] == id;
            let differs = |x: usize, y: usize| (map[y * width + x] == id) != here;
            if (x + 1 < width && differs(x + 1, y)) || (y + 1 < height && differs(x, y + 1)) {
                for (right, down) in [(0, 0), (1, 0), (0, 1)] {
                    rgb.set_pixel((x + right) as u32, (y + down) as u32, LINE);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn objects_get_colours_of_their_own() {
        let colours: BTreeSet<[u8; 3]> = (0..200).map(id_colour).collect();
        assert!(colours.len() > 190, "{}", colours.len());
        assert_eq!(id_colour(0), EMPTY);
    }

    #[test]
    fn nearer_is_brighter() {
        let light = |metres: f32| depth_colour(metres).iter().map(|&part| u32::from(part)).sum::<u32>();
        let ladder = [0.5, 1.0, 4.0, 15.0, 60.0, 250.0].map(light);
        assert!(ladder.windows(2).all(|pair| pair[0] > pair[1]), "{ladder:?}");
        assert_eq!(depth_colour(0.0), EMPTY);
        assert_eq!(depth_colour(9000.0), depth_colour(FARTHEST));
    }

    #[test]
    fn the_line_runs_about_the_object() {
        let map: Vec<u16> = (0..25).map(|i| u16::from(i == 12)).collect();
        let mut rgb = Rgb::filled(5, 5, [100; 3]);
        outline(&mut rgb, &map, 1);
        let lined = |rgb: &Rgb| rgb.data().chunks_exact(3).filter(|pixel| **pixel == LINE).count();
        assert!((5..=12).contains(&lined(&rgb)), "{}", lined(&rgb));
        let mut none = Rgb::filled(5, 5, [100; 3]);
        outline(&mut none, &map, 2);
        assert_eq!(lined(&none), 0);
    }

    #[test]
    fn every_channel_is_encoded_at_its_size() {
        let image = RenderedImage {
            width: 16,
            height: 8,
            rgb: Some(vec![90; 16 * 8 * 3]),
            depth: Some(vec![3.0; 128]),
            ids: Some(vec![4; 128]),
            ..RenderedImage::default()
        };
        for channel in [Channel::Colour, Channel::Ids, Channel::Depth] {
            let jpeg = encode(&image, channel, Some(4)).unwrap();
            assert_eq!((jpeg.width(), jpeg.height()), (16, 8), "{channel:?}");
        }
    }
}
