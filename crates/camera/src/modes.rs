//! What a local camera can send, and which of it is asked for. No I/O.

use std::fmt;

use crate::address::LocalCamera;

/// Formats of images that can be decoded, the best first: compressed ones need a tenth of the bus, so that more of them come.
const FORMATS: [(Format, [u8; 4]); 3] = [(Format::Jpeg, *b"MJPG"), (Format::Jpeg, *b"JPEG"), (Format::Yuyv, *b"YUYV")];
/// Unless asked for, larger images are not: a model sees no more in them, and they cost time.
const WIDEST: (u32, u32) = (1280, 960);
/// Images per second, unless asked for.
const USUAL_RATE: f64 = 30.0;
/// A camera with fewer images per second is worth a smaller image.
const FLUENT: f64 = 14.5;
/// How far a rate may be off that was asked for: 29.97 for 30.
const TOLERANCE: f64 = 0.6;

/// How an image is coded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// A JPEG file, perhaps without Huffman tables.
    Jpeg,
    /// YUYV 4:2:2.
    Yuyv,
}

/// The format of a code; `None` if it cannot be decoded.
#[must_use]
pub fn format(code: [u8; 4]) -> Option<Format> {
    FORMATS.iter().find(|(_, known)| *known == code).map(|(format, _)| *format)
}

/// Whether a code is that of a sensor's pixels behind their colour filters, 8 to 14 bits each (Bayer), which are no image yet.
#[must_use]
pub fn is_bare_sensor(code: [u8; 4]) -> bool {
    let packed = code[0] == b'p' && b"BGgR".contains(&code[1]) && code[2] == code[3] && b"ACE".contains(&code[2]);
    let plain = matches!(&code[..2], b"BG" | b"GB" | b"BA" | b"RG" | b"GR") && code[2] == b'1';
    packed || plain || matches!(&code, b"BA81" | b"GBRG" | b"GRBG" | b"RGGB")
}

/// A mode of a camera.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Mode {
    /// Code of the format, such as `MJPG`.
    pub code: [u8; 4],
    /// Width and height, pixels.
    pub size: (u32, u32),
    /// Time between two images, seconds, as a fraction.
    pub interval: (u32, u32),
}

impl Mode {
    /// Images per second.
    #[must_use]
    pub fn rate(&self) -> f64 {
        f64::from(self.interval.1) / f64::from(self.interval.0.max(1))
    }
}

impl fmt::Debug for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (width, height) = self.size;
        write!(f, "{} {width}x{height} {:.0} fps", name(self.code), self.rate())
    }
}

/// A format's code as text.
#[must_use]
pub fn name(code: [u8; 4]) -> String {
    code.iter().map(|&byte| if byte.is_ascii_graphic() { char::from(byte) } else { '?' }).collect()
}

/// The mode for what was asked for: MJPEG before YUYV, the largest image up to 1280×960 that comes at least 15 times a second, the
/// rate nearest to 30. `None` if the camera has no such mode.
#[must_use]
pub fn choose(modes: &[Mode], wanted: &LocalCamera) -> Option<Mode> {
    let rate = wanted.rate.map_or(USUAL_RATE, f64::from);
    let fits = |mode: &&Mode| {
        let size = wanted.size.map_or(mode.size.0 <= WIDEST.0 && mode.size.1 <= WIDEST.1, |size| mode.size == size);
        let fast = wanted.rate.is_none() || (mode.rate() - rate).abs() <= TOLERANCE;
        size && fast && mode.interval.0 > 0 && mode.interval.1 > 0
    };
    FORMATS.iter().find_map(|(_, code)| {
        let mut fitting: Vec<&Mode> = modes.iter().filter(|mode| mode.code == *code).filter(fits).collect();
        if fitting.is_empty() && wanted.size.is_none() && wanted.rate.is_none() {
            // All are larger: the smallest of them.
            fitting = modes.iter().filter(|mode| mode.code == *code && mode.interval.0 > 0 && mode.interval.1 > 0).collect();
            let least = fitting.iter().map(|mode| pixels(mode)).min();
            fitting.retain(|mode| Some(pixels(mode)) == least);
        }
        let worth = |mode: &&&Mode| {
            let off = -(mode.rate() - rate).abs();
            (wanted.rate.is_some() || mode.rate() >= FLUENT, pixels(mode), (1000.0 * off) as i64)
        };
        fitting.iter().max_by_key(worth).map(|mode| **mode)
    })
}

fn pixels(mode: &Mode) -> u64 {
    u64::from(mode.size.0) * u64::from(mode.size.1)
}

/// The modes that can be decoded, for an error, at most twelve.
#[must_use]
pub fn list(modes: &[Mode]) -> String {
    const MOST: usize = 12;
    let texts: Vec<String> = modes.iter().filter(|mode| format(mode.code).is_some()).map(Mode::to_string).collect();
    let more = if texts.len() > MOST { ", …" } else { "" };
    format!("{}{more}", texts[..texts.len().min(MOST)].join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mode(code: &[u8; 4], size: (u32, u32), rate: u32) -> Mode {
        Mode { code: *code, size, interval: (1, rate) }
    }

    /// The list of a common webcam.
    fn webcam() -> Vec<Mode> {
        let mut modes = Vec::new();
        for (size, rates) in [((640, 480), [30, 15]), ((1280, 720), [10, 5]), ((1920, 1080), [5, 2])] {
            modes.extend(rates.map(|rate| mode(b"YUYV", size, rate)));
        }
        for size in [(640, 480), (1280, 720), (1920, 1080)] {
            modes.extend([30, 15].map(|rate| mode(b"MJPG", size, rate)));
        }
        modes.push(mode(b"H264", (1280, 720), 30));
        modes
    }

    fn chosen(modes: &[Mode], size: Option<(u32, u32)>, rate: Option<u32>) -> Option<String> {
        choose(modes, &LocalCamera { path: "/dev/video0".into(), size, rate }).map(|mode| mode.to_string())
    }

    #[test]
    fn jpeg_comes_first_and_is_large_but_not_too_large() {
        let all = webcam();
        assert_eq!(chosen(&all, None, None).unwrap(), "MJPG 1280x720 30 fps");
        assert_eq!(chosen(&all, Some((1920, 1080)), None).unwrap(), "MJPG 1920x1080 30 fps");
        assert_eq!(chosen(&all, None, Some(15)).unwrap(), "MJPG 1280x720 15 fps");
        // What JPEG does not come in comes uncompressed.
        assert_eq!(chosen(&all, Some((1280, 720)), Some(10)).unwrap(), "YUYV 1280x720 10 fps");
        assert_eq!(chosen(&all, Some((1280, 720)), Some(60)), None);
        assert_eq!(chosen(&all, Some((800, 600)), None), None);
    }

    #[test]
    fn a_smaller_image_comes_before_a_slow_one() {
        let uncompressed: Vec<Mode> = webcam().into_iter().filter(|mode| mode.code == *b"YUYV").collect();
        assert_eq!(chosen(&uncompressed, None, None).unwrap(), "YUYV 640x480 30 fps");
        assert_eq!(chosen(&uncompressed, None, Some(10)).unwrap(), "YUYV 1280x720 10 fps");
        let slow = [mode(b"YUYV", (640, 480), 5), mode(b"YUYV", (320, 240), 7)];
        assert_eq!(chosen(&slow, None, None).unwrap(), "YUYV 640x480 5 fps");
        let large = [mode(b"MJPG", (3840, 2160), 30), mode(b"MJPG", (2592, 1944), 30)];
        assert_eq!(chosen(&large, None, None).unwrap(), "MJPG 2592x1944 30 fps");
    }

    #[test]
    fn the_codes_of_bare_sensors_are_known() {
        for code in [b"BA81", b"GRBG", b"RGGB", b"GBRG", b"RG10", b"BG12", b"BA14", b"pRAA", b"pgCC"] {
            assert!(is_bare_sensor(*code), "{}", name(*code));
        }
        for code in [b"MJPG", b"YUYV", b"H264", b"GREY", b"RGB3", b"BGR4", b"GBRP"] {
            assert!(!is_bare_sensor(*code), "{}", name(*code));
        }
    }

    #[test]
    fn nothing_is_chosen_of_what_cannot_be_decoded() {
        assert_eq!(chosen(&[mode(b"H264", (640, 480), 30), mode(b"GREY", (640, 480), 30)], None, None), None);
        assert_eq!(chosen(&[Mode { interval: (0, 0), ..mode(b"MJPG", (640, 480), 30) }], None, None), None);
        assert_eq!(list(&webcam()[..2]), "YUYV 640x480 30 fps, YUYV 640x480 15 fps");
        assert!(list(&webcam().repeat(3)).ends_with(", …"));
        // 29.97 counts as 30.
        let ntsc = Mode { interval: (1001, 30_000), ..mode(b"MJPG", (640, 480), 30) };
        assert_eq!(choose(&[ntsc], &LocalCamera { path: "/x".into(), size: None, rate: Some(30) }), Some(ntsc));
    }
}
