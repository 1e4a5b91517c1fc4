//! Buffers as webcams give them, made by ffmpeg: YUYV, and JPEG without Huffman tables.

use std::path::Path;
use std::process::Command;

use spf_camera::mjpeg::is_whole;
use spf_camera::{intact, yuyv};
use spf_media::Rgb;
use spf_media::jpeg::{decode, with_huffman_tables};

use crate::harness::have;

const SIZE: (u32, u32) = (320, 240);

/// Runs ffmpeg in a folder; false if it is missing.
fn ffmpeg(folder: &Path, args: &[&str]) -> bool {
    if !have("ffmpeg (Debian's package `ffmpeg`)", Command::new("ffmpeg").arg("-version")) {
        return false;
    }
    let output = Command::new("ffmpeg").args(["-v", "error", "-y"]).args(args).current_dir(folder).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    true
}

const SOURCE: [&str; 6] = ["-f", "lavfi", "-i", "testsrc=size=320x240:rate=15", "-frames:v", "3"];

/// Mean difference of the values of two images.
fn difference(a: &[u8], b: &[u8]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / a.len() as f64
}

#[test]
#[ignore = "needs ffmpeg: .ci/interop runs it"]
fn an_uncompressed_buffer_has_the_colours_that_ffmpeg_sees() {
    let folder = tempfile::tempdir().unwrap();
    if !ffmpeg(folder.path(), &[&SOURCE[..], &["-pix_fmt", "yuyv422", "-f", "rawvideo", "frames.yuyv"]].concat()) {
        return;
    }
    let raw = ["-f", "rawvideo", "-pix_fmt", "yuyv422", "-s", "320x240", "-i", "frames.yuyv"];
    ffmpeg(folder.path(), &[&raw[..], &["-pix_fmt", "rgb24", "-f", "rawvideo", "frames.rgb"]].concat());
    let read = |name| std::fs::read(folder.path().join(name)).unwrap();
    let (buffers, images) = (read("frames.yuyv"), read("frames.rgb"));
    let length = yuyv::length(SIZE).unwrap();
    assert_eq!(buffers.len(), 3 * length);
    for (buffer, expected) in buffers.chunks_exact(length).zip(images.chunks_exact(length / 2 * 3)) {
        let image = yuyv::decode(buffer, SIZE).unwrap();
        let off = difference(image.data(), expected);
        assert!(off < 2.0, "{off}");
        // A buffer that was cut short, or has the size of another mode, is none.
        assert!(yuyv::decode(&buffer[..length / 2], SIZE).is_none() && yuyv::decode(buffer, (640, 240)).is_none());
    }
}

/// The segments of a JPEG file before its scan: marker, start, end.
fn segments(file: &[u8]) -> Vec<(u8, usize, usize)> {
    let (mut found, mut at) = (Vec::new(), 2);
    while file[at + 1] != 0xda {
        let end = at + 2 + usize::from(u16::from_be_bytes([file[at + 2], file[at + 3]]));
        found.push((file[at + 1], at, end));
        at = end;
    }
    found.push((0xda, at, file.len()));
    found
}

/// As webcams send it: without tables, and with the header of an AVI file if asked for.
fn as_a_webcam(file: &[u8], avi: bool) -> Vec<u8> {
    let mut sent = file[..2].to_vec();
    if avi {
        sent.extend([0xff, 0xe0, 0, 16]);
        sent.extend(*b"AVI1\0\0\0\0\0\0\0\0\0\0");
    }
    for (marker, start, end) in segments(file) {
        if marker != 0xc4 && !(avi && marker == 0xe0) {
            sent.extend_from_slice(&file[start..end]);
        }
    }
    sent
}

#[test]
#[ignore = "needs ffmpeg: .ci/interop runs it"]
fn jpeg_without_tables_is_the_same_image() {
    let folder = tempfile::tempdir().unwrap();
    let jpeg = ["-c:v", "mjpeg", "-huffman", "default", "-q:v", "3", "frame%d.jpg"];
    if !ffmpeg(folder.path(), &[&SOURCE[..], &jpeg].concat()) {
        return;
    }
    let file = std::fs::read(folder.path().join("frame1.jpg")).unwrap();
    let expected = decode(&file).unwrap();
    assert_eq!((expected.width(), expected.height()), SIZE);
    for avi in [false, true] {
        let sent = as_a_webcam(&file, avi);
        assert!(segments(&sent).iter().all(|(marker, ..)| *marker != 0xc4) && sent.len() < file.len());
        assert_eq!(decode(&with_huffman_tables(&sent)).unwrap(), expected);
        damaged(&sent, &expected);
    }
}

/// Buffers that end early are refused; corrupt ones are, or are images of the same size.
fn damaged(sent: &[u8], expected: &Rgb) {
    let is_image = |bytes: &[u8]| match decode(&with_huffman_tables(bytes)) {
        Ok(image) => {
            assert_eq!((image.width(), image.height()), (expected.width(), expected.height()));
            true
        }
        Err(_) => false,
    };
    // A decoder paints what is missing grey, so that a buffer without an end is not decoded.
    assert!(is_whole(sent) && is_whole(&[sent, &[0; 40]].concat()));
    for part in 0..40 {
        let begun = &sent[..sent.len() * part / 40];
        assert!(!is_whole(begun));
        is_image(begun);
    }
    assert_eq!(intact::decode(sent).unwrap().data(), expected.data());
    assert!(intact::decode(&[sent, &[0; 40]].concat()).is_some());
    // Packets that were lost in the middle: the file still has its beginning and its end.
    let scan = segments(sent).last().unwrap().1 + 14;
    for part in 1..19 {
        let at = scan + (sent.len() - scan) * part / 20;
        let lost = 1024.min(sent.len() - at - 100);
        let short = [&sent[..at], &sent[at + lost..]].concat();
        assert!(is_whole(&short) && intact::decode(&short).is_none(), "{lost} bytes at {part}/20");
    }
    let scan = segments(sent).last().unwrap().1;
    for step in 0..60 {
        // The size stays what it is.
        let mut bytes = sent.to_vec();
        let at = scan + 14 + (sent.len() - scan - 14) * step / 60;
        bytes[at] ^= 1 << (step % 8);
        is_image(&bytes);
    }
}
