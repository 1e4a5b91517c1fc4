//! From a frame that is received to its pixels in the browser, by a clock in the picture.

use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use spf_cockpit::Cockpit;
use spf_media::Rgb;

use crate::harness::skip;
use crate::python;

/// Size of the pictures, and of a bit of the clock, pixels.
const SIZE: (u32, u32) = (960, 720);
const BIT: usize = 24;
/// Interval of the pictures, as of a drone with 30 frames a second.
const INTERVAL: Duration = Duration::from_millis(33);

/// Milliseconds since 1970 by the clock of this machine, the lower 32 bits.
fn clock() -> u32 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_millis() as u32
}

/// Part of a photograph that moves by, with the clock in its upper rows: 32 bits, white is one.
fn picture(scenery: &Rgb, number: u64) -> Rgb {
    let (width, height) = (SIZE.0 as usize, SIZE.1 as usize);
    let (wide, high) = (scenery.width() as usize, scenery.height() as usize);
    let shift = 3 * (3 * number as usize % wide);
    let mut data = Vec::with_capacity(3 * width * height);
    for y in 0..height {
        let row = &scenery.data()[3 * wide * (y % high)..][..3 * wide];
        data.extend(row.iter().cycle().skip(shift).take(3 * width));
    }
    let now = clock();
    for bit in 0..32 {
        let colour = if now >> bit & 1 == 1 { 255 } else { 0 };
        for y in 0..BIT {
            data[3 * (width * y + 96 + BIT * bit)..][..3 * BIT].fill(colour);
        }
    }
    Rgb::from_raw(SIZE.0, SIZE.1, data).unwrap()
}

#[test]
#[ignore = "slow: a browser"]
fn the_clock_in_the_picture_is_young_when_it_is_shown() {
    if Command::new("chromium").arg("--version").output().is_err() {
        return skip("the cockpit's latency in a browser (no chromium)");
    }
    let Some(python) = python::with(&["playwright", "axe-playwright-python"]) else { return };
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let photograph = std::fs::read(folder.join("../../docs/images/scenes.jpg")).unwrap();
    let scenery = Arc::new(spf_media::jpeg::decode_any(&photograph).unwrap());
    for format in ["film", "jpeg"] {
        let cockpit = Arc::new(Cockpit::open("127.0.0.1:0".parse().unwrap(), None, Arc::new(|_| {})).unwrap());
        let over = Arc::new(AtomicBool::new(false));
        let (shown, until, scenery) = (cockpit.clone(), over.clone(), scenery.clone());
        let camera = std::thread::spawn(move || {
            for number in 0.. {
                if until.load(Ordering::Relaxed) {
                    return;
                }
                shown.show(number, picture(&scenery, number));
                std::thread::sleep(INTERVAL);
            }
        });
        let output = Command::new(&python)
            .arg(folder.join("tests/it/latency.py"))
            .args([&cockpit.urls().0, format])
            .stderr(Stdio::inherit())
            .output()
            .unwrap();
        over.store(true, Ordering::Relaxed);
        camera.join().unwrap();
        let told = String::from_utf8_lossy(&output.stdout).trim().to_owned();
        assert!(output.status.success(), "{told}");
        println!("{told}");
    }
}
