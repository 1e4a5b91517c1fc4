//! Frames from access units, and the effect of losses.

use spf_core::frame::FrameId;
use spf_media::Rgb;
use spf_media::h264::{AccessUnit, Encoder, EncoderSettings};

use super::*;

fn eye() -> FrameDecoder {
    FrameDecoder::new(Decoder::new().unwrap(), Duration::from_millis(150))
}

fn encoder(width: u32, height: u32) -> Encoder {
    Encoder::new(EncoderSettings { key_interval: 1.0, quantiser: 20, ..EncoderSettings::for_size(width, height, 10.0) }).unwrap()
}

fn unit(at: u64, encoder: &mut Encoder, image: &Rgb) -> Unit {
    let at = Time::from_millis(at);
    Unit { at, late: Duration::ZERO, unit: encoder.encode(at, image).unwrap() }
}

fn red(width: u32, height: u32, shift: u32) -> Rgb {
    let mut image = Rgb::filled(width, height, [200, 40, 40]);
    for y in 0..height {
        for x in 0..width {
            if (x + shift) % 24 < 6 {
                image.set_pixel(x, y, [40, 60, 180]);
            }
        }
    }
    image
}

#[test]
fn the_newest_of_several_images_wins_and_its_age_is_known() {
    let (mut eye, frames, mut encoder) = (eye(), FrameStore::default(), encoder(96, 64));
    let units: Vec<Unit> = (0..3).map(|n| unit(800 + 100 * n, &mut encoder, &red(96, 64, n as u32))).collect();
    assert!(eye.see(&units, &frames));
    let meta = frames.take_new_frame().unwrap();
    // Time of arrival, not of decoding.
    assert_eq!((meta.id, meta.captured, meta.received), (FrameId(0), Time::from_millis(850), Time::from_millis(1000)));
    assert_eq!((frames.take_new_frame(), frames.tally().decoded), (None, 3));
    assert!(frames.photo(FrameId(0)).is_some());
}

/// Known failure 3 of similar programs: a frozen image is sent to the VLM as if it were live.
#[test]
fn failing_3_a_frozen_video_is_detected_by_its_counter_though_images_keep_arriving() {
    let (mut eye, frames, mut encoder) = (eye(), FrameStore::default(), encoder(96, 64));
    let mut counters = Vec::new();
    for n in 0..60_u64 {
        let shown = n.min(20) as u32;
        eye.see(&[unit(100 * n, &mut encoder, &red(96, 64, shown))], &frames);
        counters.push(frames.take_new_frame().unwrap().capture_counter);
    }
    assert!(counters[..21].windows(2).all(|pair| pair[1] == pair[0] + 1), "{counters:?}");
    // The encoder refines a still image for a while, and its next key frame differs slightly once more.
    assert!(counters[45..].windows(2).all(|pair| pair[1] == pair[0]), "{counters:?}");
}

/// Known failure 13: red and blue are swapped between decoder and viewer.
#[test]
fn failing_13_red_is_red() {
    let (mut eye, frames, mut encoder) = (eye(), FrameStore::default(), encoder(96, 64));
    eye.see(&[unit(0, &mut encoder, &Rgb::filled(96, 64, [210, 30, 40]))], &frames);
    let [red, green, blue] = frames.newest().unwrap().1.pixels().pixel(40, 30).unwrap();
    assert!(red > 190 && green < 60 && blue < 70, "{red} {green} {blue}");
}

#[test]
fn a_change_of_size_is_survived_and_counted() {
    let (mut eye, frames) = (eye(), FrameStore::default());
    for (width, height) in [(96, 64), (192, 128), (96, 64)] {
        eye.see(&[unit(0, &mut encoder(width, height), &red(width, height, 0))], &frames);
        let meta = frames.take_new_frame().unwrap();
        assert_eq!((meta.width, meta.height), (width, height));
    }
    assert_eq!(frames.tally().sizes, 2);
}

#[test]
fn damage_is_counted_and_the_last_good_frame_stays() {
    let (mut eye, frames, mut encoder) = (eye(), FrameStore::default(), encoder(96, 64));
    assert!(eye.see(&[unit(0, &mut encoder, &red(96, 64, 0))], &frames));
    let damage = AccessUnit { key: false, annex_b: vec![0, 0, 0, 1, 0x41, 0xff, 0xff, 0x00, 0x12] };
    let after = unit(200, &mut encoder, &red(96, 64, 1));
    assert!(
        !eye.see(&[Unit { at: Time::from_millis(100), late: Duration::ZERO, unit: damage }, after], &frames),
        "what follows damage is left alone"
    );
    assert_eq!((frames.tally().refused, frames.newest().unwrap().0.id), (1, FrameId(0)));
}

/// Something that moves over a textured background, so that an image has about 8 datagrams and a key frame about 25, as a
/// Tello's have.
fn textured(shift: u32) -> Rgb {
    let mut image = red(WIDTH, HEIGHT, 2 * shift);
    for (index, byte) in image.data_mut().iter_mut().enumerate() {
        let noise = (index as u32 / 3).wrapping_mul(2_654_435_761).wrapping_add(shift / 2 * 40_503) >> 28;
        *byte = byte.saturating_add(noise as u8 * 4);
    }
    image
}

const WIDTH: u32 = 192;
const HEIGHT: u32 = 144;
/// Time from a loss to the requested key frame: to the drone and back, with encoder and radio.
const ANSWER: Duration = Duration::from_millis(150);
const FRAME: Duration = Duration::from_millis(33);
/// 30 s of video.
const FRAMES: u32 = 900;

/// Usable frames per second and the longest gap between two, s, of video of which a fraction of the datagrams is lost.
fn received(images: &[Rgb], loss: f64, asks: bool) -> (f64, f64) {
    let settings = EncoderSettings { key_interval: 1.0, quantiser: 24, ..EncoderSettings::for_size(WIDTH, HEIGHT, 30.0) };
    let mut encoder = Encoder::new(settings).unwrap();
    let (inlet, mut eye, frames) = (Inlet::default(), eye(), FrameStore::default());
    let mut requests = KeyRequests::default();
    let mut rng = spf_core::rng::RandomStream::new(11, "datagrams", &[]);
    let (mut asked, mut usable, mut last, mut gap) = (None, 0, Time::ZERO, Duration::ZERO);
    for number in 0..FRAMES {
        let now = Time::ZERO + FRAME * number;
        if asked.take_if(|at: &mut Time| *at + ANSWER <= now).is_some() {
            encoder.force_key();
        }
        let unit = encoder.encode(now, &images[number as usize % images.len()]).unwrap();
        for nal in spf_media::h264::nal_units(&unit.annex_b) {
            let bytes = [&[0, 0, 0, 1][..], nal].concat();
            for datagram in bytes.chunks(1460) {
                if !rng.chance(loss) {
                    inlet.put(now, datagram);
                }
            }
        }
        let units = inlet.take(Duration::ZERO);
        if !units.is_empty() && !eye.see(&units, &frames) {
            inlet.refuse();
        }
        if requests.is_due(now, inlet.awaits_key()) && asks {
            asked.get_or_insert(now);
        }
        if frames.take_new_frame().is_some_and(|frame| frame.unusable.is_none()) {
            usable += 1;
            gap = gap.max(now.since(last));
            last = now;
        }
    }
    gap = gap.max((Time::ZERO + FRAME * FRAMES).since(last));
    (f64::from(usable) / (FRAME * FRAMES).as_secs_f64(), gap.as_secs_f64())
}

#[test]
fn a_loss_costs_the_frames_until_a_requested_key_frame() {
    let images: Vec<Rgb> = (0..48).map(textured).collect();
    let mut shown = Vec::new();
    for loss in [0.0, 0.01, 0.05, 0.3] {
        let (before, after) = (received(&images, loss, false), received(&images, loss, true));
        println!("{loss}: {before:.2?} without requests, {after:.2?} with");
        shown.push((before, after));
    }
    let [none, one, five, _] = shown[..] else { unreachable!() };
    assert!(none.0 == none.1 && none.0.0 > 29.0, "{none:?}");
    assert!(one.1.0 > 1.1 * one.0.0 && five.1.0 > 1.5 * five.0.0, "{one:?} {five:?}");
    assert!(one.1.1 < 1.0 && five.1.1 < 0.75 * five.0.1, "{one:?} {five:?}");
}

#[test]
fn key_frames_are_requested_at_most_twice_a_second() {
    let mut requests = KeyRequests::default();
    let asked: Vec<u64> = (0..3000).step_by(10).filter(|ms| requests.is_due(Time::from_millis(*ms), *ms >= 500)).collect();
    assert_eq!(asked, [500, 1000, 1500, 2000, 2500]);
}

/// Images whose first or last datagram is lost never become frames. A gap in the middle is detected by the decoder
/// only, which does not notice all of them: the driver's limit, measured here.
#[test]
fn an_image_with_a_lost_end_is_no_frame_and_most_gaps_are_noticed() {
    let settings = EncoderSettings { key_interval: 100.0, quantiser: 24, ..EncoderSettings::for_size(WIDTH, HEIGHT, 30.0) };
    let images: Vec<Rgb> = (0..12).map(|n| textured(4 * n)).collect();
    let mut encoder = Encoder::new(settings).unwrap();
    let stream: Vec<Vec<Vec<u8>>> = images
        .iter()
        .enumerate()
        .map(|(n, image)| {
            let unit = encoder.encode(Time::ZERO + FRAME * n as u32, image).unwrap();
            let cut = |nal: &[u8]| [&[0, 0, 0, 1][..], nal].concat().chunks(1460).map(<[u8]>::to_vec).collect::<Vec<_>>();
            spf_media::h264::nal_units(&unit.annex_b).flat_map(cut).collect()
        })
        .collect();
    let (mut gaps, mut unnoticed) = (0, 0);
    for (number, datagrams) in stream.iter().enumerate().skip(1) {
        for lost in 0..datagrams.len() {
            let (inlet, mut eye, frames) = (Inlet::default(), eye(), FrameStore::default());
            let mut shown = 0;
            for (n, datagrams) in stream.iter().enumerate().take(number + 1) {
                for (index, datagram) in datagrams.iter().enumerate() {
                    if (n, index) != (number, lost) {
                        inlet.put(Time::ZERO + FRAME * n as u32, datagram);
                    }
                }
                let units = inlet.take(Duration::ZERO);
                if !units.is_empty() && !eye.see(&units, &frames) {
                    inlet.refuse();
                }
                shown += usize::from(frames.take_new_frame().is_some());
            }
            assert!(shown == number || shown == number + 1, "{shown} frames before {number}");
            let middle = lost > 0 && lost + 1 < datagrams.len();
            assert!(middle || shown == number, "{lost} of {} in {number}", datagrams.len());
            gaps += u32::from(middle);
            unnoticed += u32::from(middle && shown > number);
        }
    }
    println!("{unnoticed} of {gaps} gaps in the middle of an image are not noticed in it");
    assert!(gaps > 10 && unnoticed * 2 < gaps, "{unnoticed} of {gaps}");
}

/// The envelope's view of a stream that falls 1.5 s behind without a loss.
#[test]
fn video_that_falls_behind_makes_its_frames_old() {
    let (inlet, mut eye, frames, mut encoder) = (Inlet::default(), eye(), FrameStore::default(), encoder(96, 64));
    let mut ages = Vec::new();
    for n in 0..120_u32 {
        let now = Time::from_millis(33 * u64::from(n) + if n > 60 { 1500 } else { 0 });
        let unit = encoder.encode(now, &red(96, 64, n)).unwrap();
        for nal in spf_media::h264::nal_units(&unit.annex_b) {
            inlet.put(now, &[&[0, 0, 0, 1][..], nal].concat());
        }
        assert!(eye.see(&inlet.take(Duration::ZERO), &frames));
        let frame = frames.take_new_frame().unwrap();
        ages.push(frame.received.since(frame.captured).as_secs_f64());
    }
    // The envelope holds from an age of 1 s on.
    assert!(ages[..=60].iter().all(|age| *age < 0.2) && ages[61..].iter().all(|age| *age > 1.5), "{ages:?}");
}
