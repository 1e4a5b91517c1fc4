//! Memory of recent camera frames, and recognition of received images.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

use spf_core::frame::FrameId;
use spf_core::time::{Duration, Time};
use spf_flight::sim::WorldSnapshot;
use spf_media::Rgb;

/// How long a frame is kept.
pub const FRAME_RETENTION: Duration = Duration::from_secs(10);
/// Maximum number of frames kept: ten seconds at 60 frames per second.
const MOST: usize = 600;
/// Thumbnail size: coarse enough to be insensitive to codec and scaling, fine enough to show a few centimetres of
/// flight.
const WIDTH: u32 = 64;
const HEIGHT: u32 = 48;
const VALUES: usize = (WIDTH * HEIGHT) as usize * 3;
/// Maximum root mean square difference of a match, of 0..=255. docs/guide/grounding.md gives the recognition rate after
/// H.264, rescaling and JPEG at quality 60.
const MOST_DIFFERENT: f64 = 7.0;
/// Maximum difference in aspect ratio: sizes are rounded to a model's multiples.
const SHAPE: f64 = 0.06;

/// A stored frame.
#[derive(Clone, Debug)]
pub struct Remembered {
    /// Its number.
    pub frame: FrameId,
    /// The state of the world in it.
    pub snapshot: WorldSnapshot,
}

/// Why a query was not recognised.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Unrecognised {
    /// The memory is empty.
    #[error("no frame in the last {} s: get one from /frame.jpg and send it", FRAME_RETENTION.as_secs())]
    Nothing,
    /// It differs from all stored frames.
    #[error(
        "the image matches none of the {frames} frames of the last {} s: the closest differs by {difference:.1} of 255; at \
            most {MOST_DIFFERENT} is allowed; send a full, unmarked frame of this camera, at any size",
        FRAME_RETENTION.as_secs()
    )]
    Different {
        /// Number of frames compared.
        frames: usize,
        /// Root mean square difference from the closest frame, of 255.
        difference: f64,
    },
    /// Its aspect ratio differs.
    #[error("the image is {width}×{height}, which does not match the camera's aspect ratio: send full frames, not crops")]
    Shape {
        /// Its width, pixels.
        width: u32,
        /// Its height, pixels.
        height: u32,
    },
    /// The prompt is not understood: what of it.
    #[error("the prompt does not show {0}: it must use the wording of this program's pointing prompt (prompts/point-6.txt)")]
    Wording(&'static str),
}

struct EarlierAnswer {
    at: Time,
    remembered: Remembered,
    thumbnail: Vec<u8>,
}

/// The last ten seconds of a camera, shared by camera and endpoint.
#[derive(Default)]
pub struct Memory(Mutex<Film>);

#[derive(Default)]
struct Film {
    seen: VecDeque<EarlierAnswer>,
    /// Aspect ratio of the frames.
    shape: f64,
}

impl Memory {
    fn film(&self) -> MutexGuard<'_, Film> {
        // The contents are consistent between calls.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Stores a frame captured at `at`, and drops frames more than [`FRAME_RETENTION`] older.
    pub fn push(&self, at: Time, remembered: Remembered, image: &Rgb) {
        let thumbnail = thumbnail(image);
        let mut film = self.film();
        film.shape = f64::from(image.width()) / f64::from(image.height().max(1));
        film.seen.push_back(EarlierAnswer { at, remembered, thumbnail });
        film.forget(at);
    }

    /// The frame that an image shows; of equally similar frames the newest.
    ///
    /// # Errors
    /// [`Unrecognised`] if there is no match.
    pub fn recognise(&self, now: Time, image: &Rgb) -> Result<Remembered, Unrecognised> {
        let shape = f64::from(image.width()) / f64::from(image.height().max(1));
        let thumbnail = thumbnail(image);
        let mut film = self.film();
        film.forget(now);
        if film.seen.is_empty() {
            return Err(Unrecognised::Nothing);
        }
        if (shape / film.shape - 1.0).abs() > SHAPE {
            return Err(Unrecognised::Shape { width: image.width(), height: image.height() });
        }
        let mut best: Option<(u64, &EarlierAnswer)> = None;
        for seen in film.seen.iter().rev() {
            let squares = difference(&seen.thumbnail, &thumbnail);
            if best.is_none_or(|(least, _)| squares < least) {
                best = Some((squares, seen));
            }
        }
        let (squares, seen) = best.ok_or(Unrecognised::Nothing)?;
        let difference = (squares as f64 / VALUES as f64).sqrt();
        if difference > MOST_DIFFERENT {
            return Err(Unrecognised::Different { frames: film.seen.len(), difference });
        }
        Ok(seen.remembered.clone())
    }
}

impl Film {
    fn forget(&mut self, now: Time) {
        while self.seen.front().is_some_and(|seen| now.since(seen.at) > FRAME_RETENTION) || self.seen.len() > MOST {
            self.seen.pop_front();
        }
    }
}

/// Scales an image down to a thumbnail by averaging.
fn thumbnail(image: &Rgb) -> Vec<u8> {
    let (width, height) = (image.width().max(1) as usize, image.height().max(1) as usize);
    let data = image.data();
    let mut small = Vec::with_capacity(VALUES);
    let part = |index: u32, of: u32, side: usize| {
        let from = index as usize * side / of as usize;
        (from, ((index as usize + 1) * side / of as usize).clamp(from + 1, side.max(from + 1)))
    };
    for y in 0..HEIGHT {
        let (top, bottom) = part(y, HEIGHT, height);
        for x in 0..WIDTH {
            let (left, right) = part(x, WIDTH, width);
            let mut sums = [0_u64; 3];
            for row in top..bottom {
                let line = data.get((row * width + left) * 3..(row * width + right) * 3).unwrap_or_default();
                for pixel in line.chunks_exact(3) {
                    sums.iter_mut().zip(pixel).for_each(|(sum, value)| *sum += u64::from(*value));
                }
            }
            let count = ((bottom - top) * (right - left)) as u64;
            small.extend(sums.map(|sum| (sum / count).min(255) as u8));
        }
    }
    small
}

/// Sum of squared differences after removing the mean difference of each colour, since a codec may shift the whole
/// image.
fn difference(a: &[u8], b: &[u8]) -> u64 {
    let mut squares = 0_i64;
    for colour in 0..3 {
        let differences = || a.iter().zip(b).skip(colour).step_by(3).map(|(a, b)| i64::from(*a) - i64::from(*b));
        let (sum, count) = differences().fold((0, 0), |(sum, count), difference| (sum + difference, count + 1));
        squares += differences().map(|difference| difference * difference).sum::<i64>() - sum * sum / count.max(1);
    }
    squares.max(0) as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use spf_core::geometry::Pose;

    fn remembered(frame: u64) -> Remembered {
        Remembered { frame: FrameId(frame), snapshot: WorldSnapshot { pose: Pose::default(), actors: Vec::new() } }
    }

    /// A bright square on a dark background, at this distance from the left.
    fn square(left: u32) -> Rgb {
        let mut image = Rgb::filled(320, 240, [30, 40, 50]);
        for y in 100..160 {
            for x in left..left + 80 {
                image.set_pixel(x, y, [220, 200, 40]);
            }
        }
        image
    }

    #[test]
    fn frames_are_distinguished_and_forgotten() {
        let memory = Memory::default();
        assert_eq!(memory.recognise(Time::ZERO, &square(0)).unwrap_err(), Unrecognised::Nothing);
        for n in 0..20 {
            memory.push(Time::from_millis(100 * n), remembered(n), &square(10 * n as u32));
        }
        let now = Time::from_millis(2000);
        assert_eq!(memory.recognise(now, &square(70)).unwrap().frame, FrameId(7));
        // At another size; brighter all over.
        let small = spf_media::resize(&square(70), 200, 150);
        assert_eq!(memory.recognise(now, &small).unwrap().frame, FrameId(7));
        assert!(matches!(memory.recognise(now, &Rgb::filled(320, 240, [9; 3])), Err(Unrecognised::Different { frames: 20, .. })));
        assert!(matches!(memory.recognise(now, &Rgb::new(320, 320)), Err(Unrecognised::Shape { width: 320, height: 320 })));
        // 10.75 s: frames up to the seventh are too old.
        assert!(matches!(
            memory.recognise(Time::from_millis(10_750), &square(70)),
            Err(Unrecognised::Different { frames: 12, .. })
        ));
    }

    #[test]
    fn any_size_has_a_thumbnail() {
        for (width, height) in [(0, 0), (1, 1), (3, 200), (65, 49)] {
            assert_eq!(thumbnail(&Rgb::new(width, height)).len(), VALUES, "{width}×{height}");
        }
    }
}
