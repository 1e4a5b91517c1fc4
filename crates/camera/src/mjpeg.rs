//! JPEG images from an endless HTTP response (`multipart/x-mixed-replace`). No I/O.
//!
//! Cameras disagree about the boundaries between the images: with and without leading dashes, with and without a line break
//! before, with and without `Content-Length`, some with a wrong one. The images themselves say where they begin and end, so
//! the boundaries are ignored: an image is found by its first marker, and its length is taken from the header before it if
//! the image then ends with its last marker; otherwise its segments are followed. The multipart readers that exist as
//! crates read forms and mails, whose boundaries are as the standard says.

/// Maximum length of an image, bytes.
pub const LONGEST_IMAGE: usize = 16 << 20;
/// Maximum length of the header before an image, bytes; of a longer one, the end is read.
const LONGEST_HEADER: usize = 4096;
/// Maximum length of the white space that `Content-Length` includes after an image, bytes.
const LONGEST_PADDING: usize = 64;
/// After a damaged image, at least this part of the bytes that it seemed to have is skipped. Otherwise bytes full of
/// beginnings would be followed from each of them to the same damage, which takes hours; so each byte is read about 16
/// times at most.
const SKIPPED_PART: usize = 16;

/// An image of the stream.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// The JPEG file.
    pub jpeg: Vec<u8>,
    /// Time of the image by the camera's clock, seconds from an arbitrary start, if its header has one (`X-Timestamp`).
    pub timestamp: Option<f64>,
}

/// Cuts a stream of bytes, in pieces of any length, into images.
#[derive(Clone, Debug, Default)]
pub struct PartReader {
    buffer: Vec<u8>,
    /// Everything in the buffer before this was read.
    start: usize,
    image: Option<Open>,
    damaged: u64,
}

/// An image that has begun, at the start of what is not read.
#[derive(Clone, Debug)]
struct Open {
    /// Length by the header.
    length: Option<usize>,
    timestamp: Option<f64>,
    walk: Walk,
}

impl PartReader {
    /// Takes the next bytes; appends the images that they complete.
    pub fn push(&mut self, bytes: &[u8], parts: &mut Vec<Part>) {
        self.buffer.extend_from_slice(bytes);
        while self.step(parts) {}
        // Each byte is moved once on average, whatever the length of what remains.
        if self.start > self.buffer.len() / 2 {
            self.buffer.drain(..self.start);
            self.start = 0;
        }
    }

    /// Images that were too long or damaged so far.
    #[must_use]
    pub fn damaged(&self) -> u64 {
        self.damaged
    }

    /// Finds the next beginning or end of an image; false if that takes more bytes.
    fn step(&mut self, parts: &mut Vec<Part>) -> bool {
        let Some(open) = &mut self.image else { return self.begin() };
        let bytes = &self.buffer[self.start..];
        let end = match open.length {
            Some(length) if bytes.len() < length => None,
            Some(length) if ends_an_image(&bytes[..length]) => Some(Ok(length)),
            Some(_) => {
                open.length = None;
                return true;
            }
            None => open.walk.advance(bytes),
        };
        match end {
            None if bytes.len() < LONGEST_IMAGE => false,
            Some(Ok(length)) => {
                parts.push(Part { jpeg: bytes[..length].to_vec(), timestamp: open.timestamp });
                self.start += length;
                self.image = None;
                true
            }
            None | Some(Err(Damaged)) => {
                // The search goes on behind its beginning.
                self.damaged += 1;
                self.start += (open.walk.at.min(bytes.len()) / SKIPPED_PART).max(2);
                self.image = None;
                true
            }
        }
    }

    /// Looks for the beginning of an image, and reads the header before it.
    fn begin(&mut self) -> bool {
        let bytes = &self.buffer[self.start..];
        let Some(at) = bytes.windows(3).position(|bytes| bytes == [0xff, 0xd8, 0xff]) else {
            self.start += bytes.len().saturating_sub(LONGEST_HEADER);
            return false;
        };
        let header = String::from_utf8_lossy(&bytes[at.saturating_sub(LONGEST_HEADER)..at]);
        // A length that is not given counts as well as one that cannot be.
        let length = field(&header, "content-length").and_then(|text| text.parse().ok());
        let length = length.filter(|length| (4..=LONGEST_IMAGE).contains(length));
        let timestamp = field(&header, "x-timestamp").and_then(|text| text.parse().ok()).filter(|time: &f64| time.is_finite());
        self.start += at;
        self.image = Some(Open { length, timestamp, walk: Walk { at: 2, in_scan: false } });
        true
    }
}

/// Whether bytes end with the last marker of an image, and perhaps white space.
fn ends_an_image(bytes: &[u8]) -> bool {
    bytes[bytes.len().saturating_sub(LONGEST_PADDING)..].trim_ascii_end().ends_with(&[0xff, 0xd9])
}

/// Whether a buffer that a camera filled has the end of its image, perhaps before zeros: if not, it was cut off.
#[must_use]
pub fn is_whole(buffer: &[u8]) -> bool {
    let end = buffer.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
    buffer.starts_with(&[0xff, 0xd8]) && ends_an_image(&buffer[..end])
}

/// The value of a field in the last header of a text.
fn field<'a>(text: &'a str, name: &str) -> Option<&'a str> {
    text.lines().rev().find_map(|line| {
        let (before, value) = line.split_once(':')?;
        before.trim().eq_ignore_ascii_case(name).then(|| value.trim())
    })
}

/// The image is damaged.
struct Damaged;

/// Follows the segments of a JPEG file to its end (ITU-T T.81, annex B).
#[derive(Clone, Debug)]
struct Walk {
    /// Everything before this was followed.
    at: usize,
    /// Whether this is inside entropy-coded data.
    in_scan: bool,
}

impl Walk {
    /// The length of the file, once its end is in `bytes`.
    fn advance(&mut self, bytes: &[u8]) -> Option<Result<usize, Damaged>> {
        loop {
            if self.in_scan {
                let rest = bytes.get(self.at..)?;
                let Some(marker) = rest.iter().position(|byte| *byte == 0xff) else {
                    self.at = bytes.len();
                    return None;
                };
                self.at += marker;
                match bytes.get(self.at + 1)? {
                    // A data byte of 255, and restart markers.
                    0 | 0xd0..=0xd7 => self.at += 2,
                    0xff => self.at += 1,
                    _ => self.in_scan = false,
                }
                continue;
            }
            let [first, kind] = *bytes.get(self.at..self.at + 2)? else { return None };
            match (first, kind) {
                (0xff, 0xff) => self.at += 1,
                (0xff, 0xd9) => return Some(Ok(self.at + 2)),
                (0xff, 0x01 | 0xd0..=0xd7) => self.at += 2,
                // An image within an image, outside of a segment.
                (0xff, 0x00 | 0xd8) => return Some(Err(Damaged)),
                (0xff, _) => {
                    let [high, low] = *bytes.get(self.at + 2..self.at + 4)? else { return None };
                    let length = usize::from(u16::from_be_bytes([high, low]));
                    if length < 2 {
                        return Some(Err(Damaged));
                    }
                    self.at += 2 + length;
                    self.in_scan = kind == 0xda;
                }
                _ => return Some(Err(Damaged)),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use spf_media::Jpeg;

    use super::*;
    use crate::testing::image;

    fn jpeg(number: u32) -> Vec<u8> {
        Jpeg::encode(&image(64, 48, number), 80).unwrap().bytes().to_vec()
    }

    /// A JPEG file with another one in it, as cameras write previews.
    fn with_preview() -> Vec<u8> {
        let (outer, inner) = (jpeg(1), jpeg(2));
        let length = u16::try_from(inner.len() + 2).unwrap().to_be_bytes();
        [&outer[..2], &[0xff, 0xe1], &length, &inner, &outer[2..]].concat()
    }

    fn read(stream: &[u8], size: usize) -> (Vec<Part>, u64) {
        let (mut reader, mut parts) = (PartReader::default(), Vec::new());
        stream.chunks(size).for_each(|bytes| reader.push(bytes, &mut parts));
        (parts, reader.damaged())
    }

    /// Streams as different servers write them.
    fn streams() -> Vec<(Vec<u8>, Vec<Vec<u8>>)> {
        let images = vec![jpeg(1), with_preview(), jpeg(3)];
        let of = |before: &dyn Fn(&[u8]) -> String, after: &str| {
            let stream: Vec<u8> =
                images.iter().flat_map(|image| [before(image).as_bytes(), image, after.as_bytes()].concat()).collect();
            ([&stream, &b"--b--\r\n"[..]].concat(), images.clone())
        };
        vec![
            of(&|image| format!("--b\r\nContent-Type: image/jpeg\r\nContent-Length: {}\r\n\r\n", image.len()), "\r\n"),
            of(&|_| "\r\n--myboundary\r\nContent-Type: image/jpeg\r\n\r\n".to_owned(), ""),
            of(&|_| "b\ncontent-type:image/jpeg\n\n".to_owned(), "\n"),
            // Lengths that are wrong.
            of(&|_| "--b\r\nContent-Length: 100\r\n\r\n".to_owned(), "\r\n"),
            of(&|image| format!("--b\r\nContent-Length: {}\r\n\r\n", image.len() + 3), "\r\n"),
            of(&|_| "--b\r\nContent-Length: 99999999999\r\n\r\n".to_owned(), "\r\n"),
            of(&|_| String::new(), ""),
        ]
    }

    #[test]
    fn images_come_out_whatever_the_server_and_the_pieces() {
        for (number, (stream, images)) in streams().into_iter().enumerate() {
            for size in [1, 2, 7, 100, 1460, stream.len()] {
                let (parts, damaged) = read(&stream, size);
                let jpegs: Vec<Vec<u8>> = parts.into_iter().map(|part| part.jpeg).collect();
                assert!(jpegs == images && damaged == 0, "stream {number} in pieces of {size}: {} images", jpegs.len());
            }
        }
    }

    #[test]
    fn times_are_read() {
        let part = |time: &str| [format!("--b\r\nX-Timestamp: {time}\r\n\r\n").as_bytes(), &jpeg(1)].concat();
        let (parts, _) = read(&[part("12.5"), part("nan"), part("x"), part("13")].concat(), 50);
        assert_eq!(parts.iter().map(|part| part.timestamp).collect::<Vec<_>>(), [Some(12.5), None, None, Some(13.0)]);
    }

    #[test]
    fn after_garbage_and_damage_the_next_image_is_found() {
        let whole = jpeg(4);
        let stream =
            [&vec![0x55; 100_000], &whole[..200], b"\r\n--b\r\n\r\n", &whole, &[0xff, 0xd8, 0xff, 0xd8, 0xff, 0xd8]].concat();
        let (parts, damaged) = read(&stream, 1000);
        assert!(damaged > 0 && parts.iter().any(|part| part.jpeg == whole), "{} parts, {damaged} damaged", parts.len());
    }

    #[test]
    fn endless_bytes_do_not_pile_up() {
        let (mut reader, mut parts) = (PartReader::default(), Vec::new());
        let noise = vec![7; 1 << 20];
        for _ in 0..40 {
            reader.push(&noise, &mut parts);
            assert!(reader.buffer.len() <= LONGEST_HEADER);
        }
        // An image that never ends.
        reader.push(&jpeg(1)[..300], &mut parts);
        for _ in 0..40 {
            reader.push(&noise, &mut parts);
            assert!(reader.buffer.len() <= LONGEST_IMAGE + noise.len());
        }
        assert!(parts.is_empty() && reader.damaged() >= 1);
        reader.push(&jpeg(2), &mut parts);
        assert_eq!(parts.len(), 1);
    }

    /// With a time that grows with the square of the length, each of these takes many minutes.
    #[test]
    fn bytes_full_of_beginnings_are_read_in_linear_time() {
        let long = "--b\r\nContent-Length: 16777216\r\n\r\n";
        let beginnings = [0xff, 0xd8].repeat(LONGEST_IMAGE / 2);
        // Each segment contains the beginning of another image.
        let chains = [0xff, 0xd8, 0xff, 0xe1, 0, 6, 0, 0].repeat(LONGEST_IMAGE / 8);
        let no_end = [&[0xff, 0xd8, 0xff, 0xda, 0xff, 0xff].repeat(10_000)[..], &vec![0; LONGEST_IMAGE]].concat();
        let spaces =
            [&[long.as_bytes(), &[0xff, 0xd8, 0xff, 0]].concat().repeat(100_000)[..], &vec![b' '; LONGEST_IMAGE]].concat();
        let images = [0xff, 0xd8, 0xff, 0xd9].repeat(LONGEST_IMAGE / 16);
        for bytes in [beginnings, chains, no_end, spaces, images] {
            let stream = [long.as_bytes(), &[0xff, 0xd8, 0xff, 0xd8], &bytes].concat();
            for size in [8192, stream.len()] {
                let (parts, damaged) = read(&[&stream[..], &vec![0; LONGEST_IMAGE], &jpeg(1)].concat(), size);
                assert!(damaged > 0 && parts.last().is_some_and(|part| part.jpeg == jpeg(1)));
            }
        }
    }

    proptest! {
        #[test]
        fn no_bytes_panic(pieces in proptest::collection::vec(
            (prop::sample::select(vec![0xff_u8, 0xd8, 0xd9, 0xda, 0, 2, b'\n']), proptest::collection::vec(any::<u8>(), 0..40)), 0..60)) {
            let (mut reader, mut parts) = (PartReader::default(), Vec::new());
            for (byte, bytes) in pieces {
                reader.push(&[0xff, byte], &mut parts);
                reader.push(&bytes, &mut parts);
            }
        }
    }
}
