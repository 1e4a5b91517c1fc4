//! From a frame that is received to its pixels in the browser, by a clock in the picture.

use std::collections::HashMap;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use spf_cockpit::{Cockpit, FlightControls};
use spf_core::craft::Craft;
use spf_core::time::Time;
use spf_flight::flight::{FlightPlan, Site, fly};
use spf_flight::recorder::RecordPlan;
use spf_flight::run::Observer;
use spf_flight::sim::{LoadedScene, Simulated, oracle_factory};
use spf_media::Rgb;
use spf_oracle::ErrorFile;
use spf_pilot::Event;
use spf_record::out_dir::OutDir;

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

/// When the pilot was told of each frame, milliseconds since 1970.
#[derive(Default)]
struct Arrivals(HashMap<u64, u32>);

impl Observer for Arrivals {
    fn event(&mut self, _: Time, event: &Event) {
        if let Event::Frame(meta) = event {
            self.0.insert(meta.id.0, clock());
        }
    }
}

/// A flight in the city as by `spf cockpit`: simulated, recorded with its film, on the wall clock.
#[test]
#[ignore = "slow: a browser"]
fn a_simulated_frame_is_shown_soon_after_it_is_received() {
    if Command::new("chromium").arg("--version").output().is_err() {
        return skip("the cockpit's latency in a browser (no chromium)");
    }
    let Some(python) = python::environment() else { return };
    let cockpit = Cockpit::open("127.0.0.1:0".parse().unwrap(), None, Arc::new(|_| {})).unwrap();
    let browser = Command::new(&python)
        .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/latency.py"))
        .args([&cockpit.urls().0, "flight"])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let folder = tempfile::tempdir().unwrap();
    let mut site = Simulated::new(Arc::new(LoadedScene::load("city").unwrap()), "city");
    site.realtime = true;
    let oracle = oracle_factory("oracle".to_owned(), ErrorFile::default());
    let mut plan = FlightPlan::new(Site::Simulated(site), "fly to the red crane", "oracle", oracle);
    plan.settings.max_time = Duration::from_secs(25);
    plan.record = Some(RecordPlan { out: OutDir::at(&folder.path().join("one")).unwrap(), video: true, view: None });
    let (operator, inputs) = channel();
    plan.operator = Some(inputs);
    while !cockpit.has_pilot() {
        std::thread::sleep(INTERVAL);
    }
    cockpit.begin(FlightControls { operator, craft: Craft::quad(), read: Arc::new(|_| Ok(String::new())), only: false });
    let (mut arrivals, mut instruments) = (Arrivals::default(), cockpit.instruments());
    fly(plan, &mut [&mut arrivals, &mut instruments]).unwrap();
    drop(cockpit);
    let output = browser.wait_with_output().unwrap();
    let told = String::from_utf8_lossy(&output.stdout).trim().to_owned();
    assert!(output.status.success(), "{told}");
    let told: serde_json::Value = serde_json::from_str(&told).unwrap();
    let seen = told["seen"].as_array().unwrap();
    let late = |seen: &serde_json::Value| {
        let [frame, at] = [0, 1].map(|field| seen[field].as_u64().unwrap());
        let received = arrivals.0.get(&frame).unwrap_or_else(|| panic!("frame {frame} was shown, and never delivered"));
        // Both clocks count milliseconds, and begin anew after 2³² of them.
        (at as u32).wrapping_sub(*received).cast_signed()
    };
    let mut ages: Vec<i32> = seen.iter().map(late).collect();
    ages.sort_unstable();
    assert!(ages.first().is_some_and(|first| *first >= -5), "shown before the pilot had it: {ages:?}");
    println!(
        "a simulated flight, {}, {} px wide: {} ms median, {} ms 95th percentile of {} pictures, {:.1} a second",
        told["format"],
        told["size"],
        ages[ages.len() / 2],
        ages[ages.len() * 95 / 100],
        ages.len(),
        told["rate"].as_f64().unwrap()
    );
    // 150 ms on a machine that does nothing else.
    assert!(ages.len() > 50 && ages[ages.len() / 2] < 500, "{ages:?}");
}

#[test]
#[ignore = "slow: a browser"]
fn the_clock_in_the_picture_is_young_when_it_is_shown() {
    if Command::new("chromium").arg("--version").output().is_err() {
        return skip("the cockpit's latency in a browser (no chromium)");
    }
    let Some(python) = python::environment() else { return };
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
