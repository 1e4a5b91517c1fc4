//! Images from files, standard input and video, upright and of bounded size, and their preparation for a VLM.

use std::io::{Cursor, Seek};
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use mp4_atom::{Any, Avcc, Codec, Moov, ReadFrom, StszSamples, Trak};
use spf_media::file::{FileError, ImageFile, Limits};
use spf_media::h264::Decoder;
use spf_media::{Jpeg, Rgb, resize};
use spf_vlm::{QueryImage, VlmError};

/// Longest side of an image that is read, pixels.
const LONGEST_SIDE: u32 = 16_384;
/// Longest image file, bytes.
pub(super) const LONGEST_FILE: u64 = 256 << 20;
/// The side length also bounds the memory.
const LIMITS: Limits = Limits { side: LONGEST_SIDE, pixels: u64::MAX, memory: u64::MAX };
/// Longest side of an image that is kept: no model is sent more, and a phone's fifty megapixels would fill the memory.
const KEPT_SIDE: u32 = 2_576;
/// Maximum number of video samples examined: six hours at 60 frames per second.
const MOST_SAMPLES: usize = 1_300_000;

/// Why an image or a video cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PhotoError {
    /// Not an image in a known format, or damaged, or too large.
    #[error("not a PNG or JPEG image of at most {LONGEST_SIDE} pixels per side")]
    QueryImage(#[from] FileError),
    /// Not a readable MP4 file.
    #[error("not a readable MP4 file: {0}")]
    Container(String),
    /// A video of another codec.
    #[error("unsupported video codec {0}: only H.264 (AVC) can be decoded")]
    Codec(String),
    /// A stream that cannot be decoded.
    #[error("cannot decode the video: {0}")]
    Stream(String),
}

/// Decodes a PNG or JPEG file, rotated according to EXIF and scaled to at most 2576 pixels on its longer side.
///
/// # Errors
/// [`PhotoError::QueryImage`] if it cannot be decoded or is too large.
pub fn decode(bytes: &[u8]) -> Result<Rgb, PhotoError> {
    let file = ImageFile::open(bytes, LIMITS)?;
    let orientation = file.orientation();
    let rgb = orientation.turned(file.decode()?.into_rgb());
    let (width, height) = (rgb.width(), rgb.height());
    let long = width.max(height);
    if long <= KEPT_SIDE {
        return Ok(rgb);
    }
    let side = |side: u32| (u64::from(side) * u64::from(KEPT_SIDE) / u64::from(long)).max(1) as u32;
    Ok(resize(&rgb, side(width), side(height)))
}

/// Width and height of an image file after [`decode`]'s rotation, from its header alone.
///
/// # Errors
/// [`PhotoError::QueryImage`] if the header is invalid.
pub fn size(path: &Path) -> Result<(u32, u32), PhotoError> {
    let bytes = spf_input::read(path, LONGEST_FILE).map_err(FileError::from)?;
    let file = ImageFile::open(&bytes, LIMITS)?;
    Ok(file.orientation().turned_size(file.size()))
}

/// A frame of a video.
#[derive(Clone, Debug, PartialEq)]
pub struct VideoFrame {
    /// Presentation time, seconds from the start; for a bare stream its number.
    pub at: f64,
    /// The image.
    pub image: Rgb,
}

/// Frames of an H.264 video, one every `every` seconds, at most `most`: from an MP4 file, or from a bare stream with
/// start codes, which has no times and counts as 30 frames per second.
///
/// # Errors
/// [`PhotoError`] for other containers and codecs.
pub fn frames(bytes: &[u8], every: f64, most: usize) -> Result<Vec<VideoFrame>, PhotoError> {
    let (mut frames, mut next) = (Vec::new(), 0.0);
    Film::open(bytes)?.play(|frame| {
        if frame.at >= next && frames.len() < most {
            next = frame.at + every;
            frames.push(frame);
        }
        if frames.len() < most { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    })?;
    Ok(frames)
}

/// The images of an H.264 video, not decoded yet.
#[derive(Debug)]
pub struct Film {
    units: Vec<(f64, Vec<u8>)>,
}

impl Film {
    /// Reads an MP4 file, or a bare stream with start codes, which has no times and counts as 30 frames per second.
    ///
    /// # Errors
    /// [`PhotoError`] for other containers and codecs.
    pub fn open(bytes: &[u8]) -> Result<Self, PhotoError> {
        let bare_stream = bytes.starts_with(&[0, 0, 1]) || bytes.starts_with(&[0, 0, 0, 1]);
        Ok(Self { units: if bare_stream { bare(bytes) } else { demux(bytes)? } })
    }

    /// Number of coded images.
    #[must_use]
    pub fn len(&self) -> usize {
        self.units.len()
    }

    /// Whether it has no images.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.units.is_empty()
    }

    /// Decodes the frames in presentation order, one at a time, until `take` has enough.
    ///
    /// # Errors
    /// [`PhotoError::Stream`] if none, or less than half, could be decoded.
    pub fn play(&self, mut take: impl FnMut(VideoFrame) -> ControlFlow<()>) -> Result<(), PhotoError> {
        let mut decoder = Decoder::new().map_err(|error| PhotoError::Stream(error.to_string()))?;
        let (mut shown, mut last_error) = (0, None);
        // Frames are in presentation order; the n-th frame gets the time of the n-th unit.
        let mut show = |image: Rgb| {
            let at = self.units.get(shown).or(self.units.last()).map_or(0.0, |(at, _)| *at);
            shown += 1;
            take(VideoFrame { at, image })
        };
        for (_, unit) in &self.units {
            match decoder.decode_in_order(unit) {
                Ok(Some(image)) => {
                    if show(image).is_break() {
                        return Ok(());
                    }
                }
                Ok(None) => {}
                // A damaged unit is skipped, but a stream of damaged units is an error.
                Err(error) => last_error = Some(error.to_string()),
            }
        }
        match decoder.rest() {
            Ok(rest) => {
                for image in rest {
                    if show(image).is_break() {
                        return Ok(());
                    }
                }
            }
            Err(error) => last_error = Some(error.to_string()),
        }
        let total = self.units.len();
        match last_error {
            Some(error) if shown == 0 => Err(PhotoError::Stream(error)),
            None if shown == 0 => Err(PhotoError::Stream("it contains no frames".to_owned())),
            // A stream from which most frames cannot be decoded is an error.
            Some(error) if 2 * shown < total => {
                Err(PhotoError::Stream(format!("{} of its {total} frames failed: {error}", total - shown)))
            }
            _ => Ok(()),
        }
    }
}

/// Images of a bare stream: a new one begins with each slice whose first macroblock is the first.
fn bare(bytes: &[u8]) -> Vec<(f64, Vec<u8>)> {
    let mut units: Vec<Vec<u8>> = Vec::new();
    let mut open = Vec::new();
    let mut has_slice = false;
    for nal in spf_media::h264::nal_units(bytes) {
        let kind = nal.first().map_or(0, |byte| byte & 0x1f);
        let slice = matches!(kind, 1 | 5);
        // The first bit of `first_mb_in_slice` is 1 when that is 0.
        let first = slice && nal.get(1).is_some_and(|byte| byte & 0x80 != 0);
        if has_slice && (first || matches!(kind, 6..=9)) {
            units.push(std::mem::take(&mut open));
            has_slice = false;
        }
        has_slice |= slice;
        open.extend([0, 0, 0, 1]);
        open.extend(nal);
    }
    units.push(open);
    units.into_iter().take(MOST_SAMPLES).enumerate().map(|(number, unit)| (number as f64 / 30.0, unit)).collect()
}

/// Samples of the first video track of an MP4 file, as units with start codes.
fn demux(bytes: &[u8]) -> Result<Vec<(f64, Vec<u8>)>, PhotoError> {
    let moov = find_moov(bytes)?;
    let wrong = |what: &str| PhotoError::Container(what.to_owned());
    let track = moov.trak.iter().find(|track| track.mdia.minf.vmhd.is_some()).ok_or_else(|| wrong("no video track"))?;
    let codec = track.mdia.minf.stbl.stsd.codecs.first().ok_or_else(|| wrong("the video track has no sample description"))?;
    let Codec::Avc1(avc1) = codec else {
        let name = format!("{codec:?}");
        return Err(PhotoError::Codec(name.split(['(', ' ', '{']).next().unwrap_or("unknown").to_owned()));
    };
    samples(bytes, track, &avc1.avcc)
}

fn find_moov(bytes: &[u8]) -> Result<Moov, PhotoError> {
    let mut cursor = Cursor::new(bytes);
    let failed = |error: mp4_atom::Error| PhotoError::Container(error.to_string());
    // Boxes of unknown kinds, here including the media data, are skipped by their length.
    while let Some((length, kind)) = box_head(bytes, cursor.position()) {
        if &kind == b"moov" {
            return match Any::read_from(&mut cursor).map_err(failed)? {
                Any::Moov(moov) => Ok(moov),
                _ => break,
            };
        }
        if cursor.seek_relative(length as i64).is_err() {
            break;
        }
    }
    Err(PhotoError::Container("no index (`moov`): a fragmented or incomplete file, or not an MP4".to_owned()))
}

/// Length and kind of the box at an offset; `None` at the end and for invalid lengths.
fn box_head(bytes: &[u8], at: u64) -> Option<(u64, [u8; 4])> {
    let head = bytes.get(usize::try_from(at).ok()?..)?;
    let kind: [u8; 4] = head.get(4..8)?.try_into().ok()?;
    let length = match u32::from_be_bytes(head.get(..4)?.try_into().ok()?) {
        0 => head.len() as u64,
        1 => u64::from_be_bytes(head.get(8..16)?.try_into().ok()?),
        short => u64::from(short),
    };
    (8..=head.len() as u64).contains(&length).then_some((length, kind))
}

fn samples(bytes: &[u8], track: &Trak, avcc: &Avcc) -> Result<Vec<(f64, Vec<u8>)>, PhotoError> {
    let table = &track.mdia.minf.stbl;
    let wrong = |what: &str| PhotoError::Container(what.to_owned());
    let sizes: Vec<u32> = match &table.stsz.samples {
        StszSamples::Identical { count, size } => vec![*size; (*count as usize).min(MOST_SAMPLES)],
        StszSamples::Different { sizes } => sizes.iter().copied().take(MOST_SAMPLES).collect(),
    };
    let chunks: Vec<u64> = match (&table.stco, &table.co64) {
        (Some(stco), _) => stco.entries.iter().map(|offset| u64::from(*offset)).collect(),
        (None, Some(co64)) => co64.entries.clone(),
        (None, None) => return Err(wrong("no sample table")),
    };
    let seconds = f64::from(track.mdia.mdhd.timescale.max(1));
    let mut steps = table.stts.entries.iter().flat_map(|run| std::iter::repeat_n(run.sample_delta, run.sample_count as usize));
    let per_chunk = |chunk: usize| {
        let of = table.stsc.entries.iter().rev().find(|entry| entry.first_chunk as usize <= chunk + 1);
        of.map_or(1, |entry| entry.samples_per_chunk as usize)
    };
    let head: Vec<u8> =
        avcc.sequence_parameter_sets.iter().chain(&avcc.picture_parameter_sets).flat_map(|set| behind(set)).collect();
    // In a valid file samples do not overlap, so their total is at most the file size.
    if sizes.iter().map(|size| u64::from(*size)).sum::<u64>() > bytes.len() as u64 {
        return Err(wrong("its samples exceed the file size"));
    }
    let (mut found, mut sample, mut time) = (Vec::new(), 0, 0_u64);
    for (number, offset) in chunks.iter().enumerate() {
        let mut at = usize::try_from(*offset).map_err(|_| wrong("an offset is beyond the end of the file"))?;
        for _ in 0..per_chunk(number) {
            let Some(size) = sizes.get(sample).map(|size| *size as usize) else { return Ok(found) };
            let data = bytes.get(at..at.saturating_add(size)).ok_or_else(|| wrong("a sample is beyond the end of the file"))?;
            let mut unit = if sample == 0 { head.clone() } else { Vec::new() };
            unit.extend(start_codes(data, usize::from(avcc.length_size)));
            found.push((time as f64 / seconds, unit));
            at += size;
            sample += 1;
            time += u64::from(steps.next().unwrap_or(0));
        }
    }
    Ok(found)
}

fn behind(unit: &[u8]) -> Vec<u8> {
    [&[0, 0, 0, 1], unit].concat()
}

/// Converts length-prefixed units to units with start codes; a truncated one is dropped.
fn start_codes(mut data: &[u8], length_size: usize) -> Vec<u8> {
    let mut units = Vec::with_capacity(data.len() + 16);
    while let Some((head, rest)) = data.split_at_checked(length_size.clamp(1, 4)) {
        let length = head.iter().fold(0_usize, |length, byte| length << 8 | usize::from(*byte));
        let Some((unit, after)) = rest.split_at_checked(length) else { break };
        units.extend(behind(unit));
        data = after;
    }
    units
}

/// Image size, JPEG quality and bytes.
type Encoded = ((u32, u32), u8, Arc<[u8]>);

/// An image as sent to a VLM; encoded once per size.
#[derive(Clone, Debug)]
pub struct Photograph {
    image: Arc<Rgb>,
    encoded: Option<Encoded>,
}

impl Photograph {
    /// An image.
    #[must_use]
    pub fn new(image: Arc<Rgb>) -> Self {
        Self { image, encoded: None }
    }
}

impl QueryImage for Photograph {
    fn size(&self) -> (u32, u32) {
        (self.image.width(), self.image.height())
    }

    fn pixels(&mut self) -> Result<Rgb, VlmError> {
        Ok(self.image.as_ref().clone())
    }

    fn jpeg(&mut self, size: (u32, u32), quality: u8) -> Result<Arc<[u8]>, VlmError> {
        if let Some((.., bytes)) = self.encoded.as_ref().filter(|(of, at, _)| (*of, *at) == (size, quality)) {
            return Ok(bytes.clone());
        }
        let jpeg = Jpeg::encode(&resize(&self.image, size.0, size.1), quality);
        let bytes = jpeg.map_err(|error| VlmError::Image(error.to_string()))?.shared();
        self.encoded = Some((size, quality, bytes.clone()));
        Ok(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use spf_core::time::Time;
    use spf_media::h264::{Encoder, EncoderSettings};

    #[test]
    fn a_bare_stream_is_cut_into_images() {
        let mut encoder = Encoder::new(EncoderSettings::for_size(64, 48, 10.0)).unwrap();
        let mut stream = Vec::new();
        for n in 0..6_u8 {
            stream.extend(
                encoder.encode(Time::from_millis(100 * u64::from(n)), &Rgb::filled(64, 48, [40 * n; 3])).unwrap().annex_b,
            );
        }
        let all = frames(&stream, 0.0, 100).unwrap();
        assert_eq!(all.len(), 6);
        for (n, frame) in (0_u8..).zip(&all) {
            assert!(frame.image.pixel(20, 20).unwrap()[0].abs_diff(40 * n) < 6 && (frame.at - f64::from(n) / 30.0).abs() < 1e-9);
        }
        // Every tenth of a second, at thirty a second.
        assert_eq!(frames(&stream, 0.1, 100).unwrap().len(), 2);
        assert_eq!(frames(&stream, 0.0, 2).unwrap().len(), 2);
    }

    #[test]
    fn units_behind_lengths() {
        assert_eq!(start_codes(&[0, 0, 0, 2, 7, 8, 0, 0, 0, 1, 9], 4), [0, 0, 0, 1, 7, 8, 0, 0, 0, 1, 9]);
        // The second is cut short.
        assert_eq!(start_codes(&[1, 7, 3, 8], 1), [0, 0, 0, 1, 7]);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn anything_is_read_or_refused(mut bytes in prop::collection::vec(any::<u8>(), 0..400), head in 0..4) {
            match head {
                0 => bytes.splice(0..0, *b"\0\0\0\x10ftypisom\0\0\0\0\0\0\0\x40moov").for_each(drop),
                1 => bytes.splice(0..0, [0, 0, 0, 1, 0x67]).for_each(drop),
                2 => bytes.splice(0..0, *b"\x89PNG\r\n\x1a\n").for_each(drop),
                _ => {}
            }
            drop(decode(&bytes));
            drop(frames(&bytes, 0.0, 3));
        }
    }
}
