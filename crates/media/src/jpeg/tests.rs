use core::hash::Hasher as _;

use fearless_simd::Simd as _;
use fnv::FnvHasher;
use proptest::prelude::*;

use super::tables::{BLOCK, Steps};
use super::*;

/// Blocks, a slope and grain: the main features of images.
fn image(width: u32, height: u32, grain: u32, seed: u32) -> Rgb {
    let mut image = Rgb::new(width, height);
    let mut state = seed;
    for y in 0..height {
        for x in 0..width {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let block = if (x / 9 + y / 7) % 3 == 0 { 70 } else { 0 };
            let noise = |shift: u32| (state >> shift & 0xff) * grain / 255;
            let level = |slope: u32, shift: u32| (slope + block + noise(shift)).min(255) as u8;
            image.set_pixel(x, y, [level(x * 120 / width, 24), level(y * 120 / height, 16), level(60, 8)]);
        }
    }
    image
}

/// Every instruction set that the encoder is compiled for and this machine has.
fn levels() -> Vec<Level> {
    let level = Level::new();
    let mut levels = vec![level, Level::baseline()];
    #[cfg(target_arch = "x86_64")]
    levels.extend([level.as_avx2().map(|simd| simd.level()), level.as_sse4_2().map(|simd| simd.level())].into_iter().flatten());
    levels
}

/// The sum of squared differences.
fn squares(a: &Rgb, b: &Rgb) -> f64 {
    a.data().iter().zip(b.data()).map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2)).sum()
}

/// Peak signal to noise, dB.
fn psnr(a: &Rgb, b: &Rgb) -> f64 {
    10.0 * libm::log10(255.0 * 255.0 * a.data().len() as f64 / squares(a, b).max(1e-9))
}

#[test]
fn every_kind_of_instructions_gives_the_same_bytes() {
    for (width, height) in [(1, 1), (7, 3), (8, 8), (16, 16), (17, 33), (64, 48), (131, 67)] {
        for (grain, quality) in [(0, 60), (20, 75), (255, 100), (90, 1), (40, 90), (255, 70)] {
            let image = image(width, height, grain, width ^ u32::from(quality));
            let wanted = encoded(&image, quality, Level::baseline()).unwrap();
            for level in levels() {
                assert!(encoded(&image, quality, level).unwrap() == wanted, "{level:?}: {width}×{height} at {quality}");
            }
        }
    }
}

/// Qualities, and the result of the encoder of the crate `image` 0.25.10, which does not subsample chroma either and is
/// slow, for the images below: dB and bytes.
const QUALITIES: [u8; 6] = [20, 50, 70, 85, 95, 100];
type Figures = [(f64, usize); QUALITIES.len()];
const OTHER_ENCODER: [((u32, u32, u32), Figures); 3] = [
    ((320, 240, 24), [(25.663, 9676), (27.847, 16_210), (29.283, 22_308), (30.917, 34_269), (35.746, 83_206), (47.049, 172_930)]),
    ((97, 61, 60), [(22.058, 1447), (23.267, 2357), (23.945, 3288), (26.685, 5839), (35.746, 10_175), (46.959, 18_644)]),
    (
        (640, 480, 4),
        [(26.892, 36_837), (29.991, 60_941), (32.477, 78_969), (35.866, 108_801), (41.806, 184_786), (47.985, 381_486)],
    ),
];

/// The same tables must give as good an image and as small a file.
#[test]
fn is_as_good_as_another_encoder() {
    for ((width, height, grain), figures) in OTHER_ENCODER {
        let original = image(width, height, grain, 5);
        for (quality, (their_psnr, their_len)) in QUALITIES.into_iter().zip(figures) {
            let sides = (width as u16, height as u16);
            let ours = baseline::encode(&original, sides, quality, Sampling::Full, Level::new());
            let our_psnr = psnr(&original, &decode(&ours).unwrap());
            let told =
                format!("{width}×{height} at {quality}: {our_psnr} dB of {their_psnr}, {} bytes of {their_len}", ours.len());
            assert!(our_psnr > their_psnr - 0.1, "{told}");
            // At 100 the other encoder rounds to fewer bits than the tables require.
            assert!(quality == 100 || (ours.len() as f64) < their_len as f64 * 1.02, "{told}");
        }
    }
}

/// Two by two pixels have their mean chroma, located where decoders expect it.
#[test]
fn shared_colours_are_means() {
    let original = image(160, 120, 0, 0);
    let shared = baseline::encode(&original, (160, 120), 89, Sampling::Halved, Level::new());
    let own = baseline::encode(&original, (160, 120), 89, Sampling::Full, Level::new());
    let (shared_psnr, own_psnr) = (psnr(&original, &decode(&shared).unwrap()), psnr(&original, &decode(&own).unwrap()));
    assert!(shared_psnr > own_psnr - 1.5 && shared.len() < own.len(), "{shared_psnr} dB of {own_psnr}");
}

/// The largest sum of squared errors that division by these steps and rounding can cause in `blocks` blocks.
fn rounded_off(steps: &[u8; BLOCK], blocks: f64) -> f64 {
    blocks * steps.iter().map(|step| (f64::from(*step) / 2.0 + 0.1).powi(2)).sum::<f64>()
}

proptest! {
    /// No error is larger than rounding explains: the transform preserves sums of squares.
    #[test]
    fn any_image_comes_back(
        (width, height) in (1..70_u32, 1..70_u32),
        (grain, seed) in (0..=255_u32, any::<u32>()),
        quality in 1..=100_u8,
    ) {
        let mut original = image(width, height, grain, seed);
        let own_colour = quality >= FULL_COLOUR;
        if !own_colour {
            // Without colour there is no subsampled information.
            original.data_mut().chunks_exact_mut(3).for_each(|pixel| pixel.fill(pixel[0]));
        }
        let back = decode(Jpeg::encode(&original, quality).unwrap().bytes()).unwrap();
        prop_assert_eq!((back.width(), back.height()), (width, height));
        let steps = Steps::of(quality);
        let side = |pixels: u32| f64::from(pixels.next_multiple_of(if own_colour { 8 } else { 16 }) / 8);
        let blocks = side(width) * side(height);
        let luma = libm::sqrt(3.0 * rounded_off(&steps.luma, blocks));
        // The effect of an error of blue and of red on the three channels (T.871).
        let (blue, red) = (0.344_f64.powi(2) + 1.772_f64.powi(2), 1.402_f64.powi(2) + 0.714_f64.powi(2));
        let chroma = if own_colour { rounded_off(&steps.chroma, blocks) } else { 0.0 };
        let numbers = libm::sqrt(3.0 * f64::from(width * height));
        let most = luma + libm::sqrt(blue * chroma) + libm::sqrt(red * chroma) + 2.5 * numbers;
        let found = libm::sqrt(squares(&original, &back));
        prop_assert!(found <= most, "{found} of {most}");
    }
}

#[test]
fn what_is_encoded_decodes_to_nearly_the_same() {
    let jpeg = Jpeg::encode(&Rgb::filled(33, 17, [200, 40, 90]), 90).unwrap();
    let back = decode(jpeg.bytes()).unwrap();
    assert_eq!((back.width(), back.height()), (33, 17));
    for (got, want) in back.pixel(16, 8).unwrap().iter().zip([200, 40, 90_u8]) {
        assert!(got.abs_diff(want) <= 3, "{got} {want}");
    }
}

#[test]
fn damage_is_an_error() {
    let bytes = Jpeg::encode(&Rgb::filled(64, 64, [200, 40, 90]), 90).unwrap();
    assert!(decode(&bytes.bytes()[..100]).is_err());
    assert!(decode(b"no picture").is_err());
    // The frame header (SOF0) claims a width of 60000.
    let mut large = bytes.bytes().to_vec();
    let header = large.windows(2).position(|pair| pair == [0xff, 0xc0]).unwrap();
    large[header + 7..header + 9].copy_from_slice(&60_000_u16.to_be_bytes());
    assert!(decode(&large).is_err());
}

/// The same bytes on every machine, whatever its CPU: vectors of any width give this digest.
#[test]
fn bytes_are_these() {
    let mut digest = FnvHasher::default();
    for (width, height, quality) in [(64, 48, 30), (129, 77, 70), (97, 130, 85), (33, 41, 95), (1, 1, 100), (240, 240, 75)] {
        let mut image = Rgb::new(width, height);
        let mut state = 7_u32;
        for y in 0..height {
            for x in 0..width {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let grain = if y % 40 < 20 { (state >> 24) as u8 } else { (state >> 29) as u8 };
                image.set_pixel(x, y, [grain, (x * 5 + y) as u8, if (x / 9 + y / 7) % 2 == 0 { 255 } else { grain }]);
            }
        }
        digest.write(Jpeg::encode(&image, quality).unwrap().bytes());
    }
    assert_eq!(digest.finish(), 260_382_375_433_074_500);
}

#[test]
fn what_others_send_may_be_a_png_too() {
    let image = image(40, 30, 9, 3);
    assert_eq!(decode_any(&crate::png::encode(&image).unwrap()).unwrap(), image);
    let jpeg = Jpeg::encode(&image, 90).unwrap();
    assert_eq!(decode_any(jpeg.bytes()).unwrap(), decode(jpeg.bytes()).unwrap());
    assert!(decode_any(b"GIF89a").is_err() && decode(&crate::png::encode(&image).unwrap()).is_err());
}

#[test]
fn clones_share_the_bytes() {
    let jpeg = Jpeg::encode(&Rgb::new(8, 8), 90).unwrap();
    assert!(Arc::ptr_eq(&jpeg.shared(), &jpeg.clone().shared()));
}

#[test]
fn an_empty_image_is_an_error_that_names_it() {
    let error = Jpeg::encode(&Rgb::new(0, 7), 90).unwrap_err();
    assert_eq!(error.to_string(), "cannot encode an image of 0×7 as JPEG");
}
