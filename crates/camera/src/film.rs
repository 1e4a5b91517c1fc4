//! Video files: H.264 in MP4, and bare H.264 streams.

use std::io::{Cursor, Seek};
use std::ops::ControlFlow;

use mp4_atom::{Any, Avcc, Codec, Moov, ReadFrom, StszSamples, Trak};
use spf_media::Rgb;
use spf_media::file::Orientation;
use spf_media::h264::Decoder;

use crate::profile::why_undecodable;

/// Maximum number of video samples examined: six hours at 60 frames per second.
const MOST_SAMPLES: usize = 1_300_000;

/// How long an image lasts, seconds, if no times say it: that of a bare stream.
const USUAL_INTERVAL: f64 = 1.0 / 30.0;

/// Why a video cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FilmError {
    /// Another kind of file.
    #[error("this is {0}; videos are read that have H.264 in MP4 (.mp4, .mov) or as a bare stream (.h264)")]
    Format(&'static str),
    /// Not a readable MP4 file.
    #[error("not a readable MP4 file: {0}")]
    Container(String),
    /// H.264 that the decoder does not know.
    #[error("the video is H.264, {0}, which cannot be decoded")]
    Profile(String),
    /// A video of another codec.
    #[error("unsupported video codec {0}: only H.264 (AVC) can be decoded")]
    Codec(String),
    /// A stream that cannot be decoded.
    #[error("cannot decode the video: {0}")]
    Stream(String),
}

impl FilmError {
    /// What to do.
    #[must_use]
    pub fn hint(&self) -> Option<&'static str> {
        match self {
            Self::Format("a fragmented MP4 file") => {
                Some("join its parts: `ffmpeg -i VIDEO -c copy -movflags faststart NEW.mp4`")
            }
            Self::Format(_) | Self::Codec(_) | Self::Profile(_) => {
                Some("convert it: `ffmpeg -i VIDEO -c:v libx264 -pix_fmt yuv420p NEW.mp4`")
            }
            Self::Container(_) => Some(
                "it may be cut off: record it again, or try to repair it with ffmpeg; H.264 in MP4 and bare H.264 streams (.h264) are read",
            ),
            Self::Stream(_) => None,
        }
    }
}

/// A frame of a video.
#[derive(Clone, Debug, PartialEq)]
pub struct VideoFrame {
    /// Presentation time, seconds from the start; for a bare stream its number.
    pub at: f64,
    /// The image.
    pub image: Rgb,
}

/// The images of an H.264 video, not decoded yet.
#[derive(Debug)]
pub struct Film {
    units: Vec<(f64, Vec<u8>)>,
    orientation: Orientation,
}

impl Film {
    /// Reads an MP4 file, or a bare stream with start codes, which has no times and counts as 30 frames per second.
    ///
    /// # Errors
    /// [`FilmError`] for other containers and codecs.
    pub fn open(bytes: &[u8]) -> Result<Self, FilmError> {
        if let Some(other) = other_format(bytes) {
            return Err(FilmError::Format(other));
        }
        let bare_stream = bytes.starts_with(&[0, 0, 1]) || bytes.starts_with(&[0, 0, 0, 1]);
        let film = if bare_stream {
            Self { units: bare(bytes), orientation: Orientation::default() }
        } else {
            let moov = find_moov(bytes)?;
            let track = video_track(&moov)?;
            let units = demux(bytes, track)?;
            if units.is_empty() && moov.mvex.is_some() {
                return Err(FilmError::Format("a fragmented MP4 file"));
            }
            Self { units, orientation: orientation(track) }
        };
        match film.units.first().and_then(|(_, unit)| why_undecodable(unit)) {
            Some(why) => Err(FilmError::Profile(why)),
            None => Ok(film),
        }
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

    /// Time from the first image to the end of the last one, seconds; each image lasts as long as they do on average.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        let (Some((first, _)), Some((last, _))) = (self.units.first(), self.units.last()) else { return 0.0 };
        let intervals = self.units.len().saturating_sub(1);
        let interval = if intervals == 0 { 0.0 } else { (last - first) / intervals as f64 };
        last - first + if interval > 0.0 { interval } else { USUAL_INTERVAL }
    }

    /// Decodes the frames in presentation order, one at a time, until `take` has enough.
    ///
    /// # Errors
    /// [`FilmError::Stream`] if none, or less than half, could be decoded.
    pub fn play(&self, mut take: impl FnMut(VideoFrame) -> ControlFlow<()>) -> Result<(), FilmError> {
        let mut decoder = Decoder::new().map_err(|error| FilmError::Stream(error.to_string()))?;
        let (mut shown, mut last_error) = (0, None);
        // Frames are in presentation order; the n-th frame gets the time of the n-th unit.
        let mut show = |image: Rgb| {
            let at = self.units.get(shown).or(self.units.last()).map_or(0.0, |(at, _)| *at);
            shown += 1;
            take(VideoFrame { at, image: self.orientation.turned(image) })
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
            Some(error) if shown == 0 => Err(FilmError::Stream(error)),
            None if shown == 0 => Err(FilmError::Stream("it contains no frames".to_owned())),
            // A stream from which most frames cannot be decoded is an error.
            Some(error) if 2 * shown < total => {
                Err(FilmError::Stream(format!("{} of its {total} frames failed: {error}", total - shown)))
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
    units.into_iter().take(MOST_SAMPLES).enumerate().map(|(number, unit)| (number as f64 * USUAL_INTERVAL, unit)).collect()
}

/// What a file is that is not read, by its first bytes.
fn other_format(bytes: &[u8]) -> Option<&'static str> {
    const TS: usize = 188;
    let at = |offset: usize, word: &[u8]| bytes.get(offset..).is_some_and(|rest| rest.starts_with(word));
    Some(match bytes {
        [0x1a, 0x45, 0xdf, 0xa3, ..] => "a WebM or Matroska file",
        [b'R', b'I', b'F', b'F', ..] if at(8, b"AVI ") => "an AVI file",
        [b'F', b'L', b'V', ..] => "a Flash video",
        [b'O', b'g', b'g', b'S', ..] => "an Ogg file",
        [b'G', b'I', b'F', b'8', ..] => "a GIF image",
        [0xff, 0xd8, 0xff, ..] => "a JPEG image",
        [0x89, b'P', b'N', b'G', ..] => "a PNG image",
        [0x30, 0x26, 0xb2, 0x75, ..] => "a Windows Media file",
        // A NAL unit of H.264 begins with a zero bit; this is the header of a pack.
        [0, 0, 1, 0xba, ..] => "an MPEG program stream",
        [0x47, ..] if at(TS, &[0x47]) && at(2 * TS, &[0x47]) => "an MPEG transport stream",
        _ if at(0, b"#EXTM3U") => "a list of videos (HLS)",
        _ if at(0, b"<") => "a page or another text",
        [] => "an empty file",
        [0, 0, 1, ..] | [0, 0, 0, 1, ..] => return None,
        _ => match box_head(bytes, 0) {
            Some((_, kind))
                if [*b"ftyp", *b"moov", *b"mdat", *b"free", *b"wide", *b"skip", *b"pnot", *b"styp"].contains(&kind) =>
            {
                return None;
            }
            _ => "of a kind that is not known",
        },
    })
}

fn video_track(moov: &Moov) -> Result<&Trak, FilmError> {
    let track = moov.trak.iter().find(|track| track.mdia.minf.vmhd.is_some());
    track.ok_or_else(|| FilmError::Container("no video track".to_owned()))
}

/// How a phone was held: the matrix of the track (ISO/IEC 14496-12, 8.3.2), of which phones use the quarter turns only.
fn orientation(track: &Trak) -> Orientation {
    let matrix = &track.tkhd.matrix;
    match [matrix.a, matrix.b, matrix.c, matrix.d].map(i32::signum) {
        [0, 1, -1, 0] => Orientation::quarter_turns(1),
        [-1, 0, 0, -1] => Orientation::quarter_turns(2),
        [0, -1, 1, 0] => Orientation::quarter_turns(3),
        _ => Orientation::default(),
    }
}

/// Samples of a video track of an MP4 file, as units with start codes.
fn demux(bytes: &[u8], track: &Trak) -> Result<Vec<(f64, Vec<u8>)>, FilmError> {
    let wrong = |what: &str| FilmError::Container(what.to_owned());
    let codec = track.mdia.minf.stbl.stsd.codecs.first().ok_or_else(|| wrong("the video track has no sample description"))?;
    let Codec::Avc1(avc1) = codec else {
        if matches!(codec, Codec::Hev1(_) | Codec::Hvc1(_)) {
            return Err(FilmError::Codec("H.265 (HEVC)".to_owned()));
        }
        let name = format!("{codec:?}");
        return Err(FilmError::Codec(name.split(['(', ' ', '{']).next().unwrap_or("unknown").to_owned()));
    };
    samples(bytes, track, &avc1.avcc)
}

fn find_moov(bytes: &[u8]) -> Result<Moov, FilmError> {
    let mut cursor = Cursor::new(bytes);
    let failed = |error: mp4_atom::Error| FilmError::Container(error.to_string());
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
    Err(FilmError::Container("no index (`moov`): it is incomplete, as of a recording that was broken off".to_owned()))
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

fn samples(bytes: &[u8], track: &Trak, avcc: &Avcc) -> Result<Vec<(f64, Vec<u8>)>, FilmError> {
    let table = &track.mdia.minf.stbl;
    let wrong = |what: &str| FilmError::Container(what.to_owned());
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_files_are_named_with_what_is_read() {
        let ts = [&[0x47][..], &[0; 187], &[0x47], &[0; 187], &[0x47]].concat();
        for (bytes, expected) in [
            (&[0x1a, 0x45, 0xdf, 0xa3, 1][..], "a WebM or Matroska file"),
            (b"RIFF....AVI LIST", "an AVI file"),
            (&[0, 0, 1, 0xba, 0x44], "an MPEG program stream"),
            (&ts, "an MPEG transport stream"),
            (b"<!DOCTYPE html>", "a page or another text"),
            (b"hello, this is a text", "of a kind that is not known"),
            (b"", "an empty file"),
        ] {
            let error = Film::open(bytes).unwrap_err();
            let text = error.to_string();
            assert!(text.starts_with(&format!("this is {expected}; videos are read")), "{text}");
            assert!(text.contains(".mp4") && error.hint().unwrap().contains("libx264"), "{text}");
        }
        let broken_off = Film::open(b"\0\0\0\x10ftypisom\0\0\0\0\0\0\0\x08mdat").unwrap_err();
        assert!(broken_off.to_string().contains("broken off"), "{broken_off}");
        let lossless = [&[0, 0, 0, 1, 0x67, 244, 0, 13, 0x91, 0x9b, 0x28, 0, 0, 0, 1, 0x65, 0x88][..]].concat();
        let error = Film::open(&lossless).unwrap_err();
        assert!(error.to_string().contains("High 4:4:4") && error.hint().unwrap().contains("yuv420p"), "{error}");
    }

    #[test]
    fn units_behind_lengths() {
        assert_eq!(start_codes(&[0, 0, 0, 2, 7, 8, 0, 0, 0, 1, 9], 4), [0, 0, 0, 1, 7, 8, 0, 0, 0, 1, 9]);
        // The second is cut short.
        assert_eq!(start_codes(&[1, 7, 3, 8], 1), [0, 0, 0, 1, 7]);
    }
}
