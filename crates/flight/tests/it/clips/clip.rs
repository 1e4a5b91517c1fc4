//! A clip: images, and what is true of each. It can be kept in a file, since drawing it takes longer than following its target.

use std::io::{BufReader, BufWriter, Read, Write};
use std::path::Path;

use spf_core::geometry::Attitude;
use spf_media::Rgb;
use spf_media::track::PixelBox;

use super::film::Film;
use super::flight::{Flight, camera};
use super::kinds::Number;
use super::stage::{Sight, Stage, Target};

/// What is true of an image.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moment {
    pub(super) sight: Sight,
    pub(super) attitude: Attitude,
}

/// A clip that is ready to be followed.
pub(super) struct Clip {
    pub(super) number: Number,
    /// The target's key in the scene.
    pub(super) target: String,
    pub(super) images: Vec<Rgb>,
    pub(super) moments: Vec<Moment>,
    pub(super) quantiser: Option<u8>,
}

impl Clip {
    /// Draws a clip; `None` if no flight of the kind was found in the scene.
    pub(super) fn draw(stage: &Stage, number: Number) -> Option<Self> {
        let flight = Flight::draw(stage, &number)?;
        let film = Film::of(stage, &flight, &number);
        let (camera, target) = (camera(), Target::new(stage, flight.id));
        let moments = (0..number.images).map(|image| {
            let snapshot = flight.at(stage, flight.time(0.1 * image as f64)).unwrap();
            let sight = target.sight(stage, &camera, &snapshot).0;
            Moment { sight, attitude: snapshot.pose.attitude }
        });
        Some(Self {
            number,
            target: stage.loaded.key(flight.id),
            moments: moments.collect(),
            images: film.images,
            quantiser: film.quantiser,
        })
    }

    /// Writes a clip, or that there is none, for [`Clip::read`].
    pub(super) fn write(clip: Option<&Self>, file: &Path) -> std::io::Result<()> {
        let mut out = BufWriter::new(std::fs::File::create(file)?);
        let Some(clip) = clip else { return Ok(()) };
        let mut numbers = vec![clip.target.len() as f64, clip.quantiser.map_or(-1.0, f64::from)];
        for Moment { sight, attitude } in &clip.moments {
            numbers.extend(
                [sight.visible, sight.whole].into_iter().flat_map(|area| {
                    area.map_or([f64::NAN; 4], |PixelBox { left, top, right, bottom }| [left, top, right, bottom])
                }),
            );
            let Attitude { heading, pitch, roll } = *attitude;
            numbers.extend([sight.share, sight.pixels, heading, pitch, roll]);
        }
        for number in numbers {
            out.write_all(&number.to_le_bytes())?;
        }
        out.write_all(clip.target.as_bytes())?;
        clip.images.iter().try_for_each(|image| out.write_all(image.data()))?;
        out.flush()
    }

    /// Reads what was written.
    pub(super) fn read(number: Number, file: &Path) -> std::io::Result<Option<Self>> {
        let file = std::fs::File::open(file)?;
        if file.metadata()?.len() == 0 {
            return Ok(None);
        }
        let mut file = BufReader::new(file);
        let mut numbers = |count: usize| -> std::io::Result<Vec<f64>> {
            let mut bytes = vec![0; 8 * count];
            file.read_exact(&mut bytes)?;
            Ok(bytes.as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect())
        };
        let head = numbers(2)?;
        let area = |edges: &[f64]| match *edges {
            [left, top, right, bottom] if !left.is_nan() => Some(PixelBox { left, top, right, bottom }),
            _ => None,
        };
        let moments = (0..number.images).map(|_| {
            let of = numbers(13)?;
            let sight = Sight { visible: area(&of[..4]), whole: area(&of[4..8]), share: of[8], pixels: of[9] };
            let attitude = Attitude { heading: of[10], pitch: of[11], roll: of[12] };
            Ok(Moment { sight, attitude })
        });
        let moments = moments.collect::<std::io::Result<_>>()?;
        let mut target = vec![0; head[0] as usize];
        file.read_exact(&mut target)?;
        let (width, height) = (camera().width, camera().height);
        let images = (0..number.images).map(|_| {
            let mut data = vec![0; (width * height * 3) as usize];
            file.read_exact(&mut data)?;
            Ok(Rgb::from_raw(width, height, data).unwrap())
        });
        let images = images.collect::<std::io::Result<_>>()?;
        Ok(Some(Self {
            number,
            target: String::from_utf8(target).unwrap(),
            images,
            moments,
            quantiser: (head[1] >= 0.0).then_some(head[1] as u8),
        }))
    }
}
