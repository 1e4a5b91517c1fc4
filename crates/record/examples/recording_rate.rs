//! Cost of recording a camera at 30 images per second, apart from creating the images: CPU time per second of flight.
//!
//! `cargo run --release -p spf-record --features figures --example recording_rate`
//!
//! Images of 960×720 with detail everywhere are encoded like the video of a flight, and written with poses 20 times and
//! JSON rows 40 times per second. Nothing waits for the clock: the CPU time of the whole process is divided by the
//! seconds of flight.

#![expect(clippy::print_stdout, reason = "an example that prints what it measured")]

use std::time::Instant;

use schemars::JsonSchema;
use serde::Serialize;
use spf_core::geometry::Pose;
use spf_core::time::Time;
use spf_media::{Jpeg, Rgb};
use spf_record::log::{Log, Message, Topic, foxglove};

/// Flight time, seconds.
const SECONDS: u64 = 30;
/// Pictures a second.
const FRAMES: u64 = 30;
/// As in `spf_flight::film`.
const QUALITY: u8 = 80;

/// About as long as a setpoint with its reasons, or telemetry.
#[derive(Serialize, JsonSchema)]
struct Row {
    name: &'static str,
    wanted: [f64; 8],
    cleared: [f64; 8],
}

/// A frame with soft shapes and grain, different for each number.
fn frame(number: u64) -> Rgb {
    let mut frame = Rgb::new(960, 720);
    let shift = number as u32 * 7;
    for y in 0..720 {
        for x in 0..960 {
            let grain = (((x + shift) * 7919 + y * 104_729) % 13) as u8;
            frame.set_pixel(x, y, [((x + shift) / 4) as u8 + grain, (y / 3) as u8, ((x + y) / 7) as u8 ^ grain]);
        }
    }
    frame
}

/// CPU time of this process, all threads, seconds: as counted by Linux.
fn cpu() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    let fields: Vec<&str> = stat.rsplit_once(") ")?.1.split(' ').collect();
    let ticks = |index: usize| fields.get(index)?.parse::<f64>().ok();
    // User and system time, in hundredths of a second on every Linux.
    Some((ticks(11)? + ticks(12)?) / 100.0)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let frames: Vec<Rgb> = (0..8).map(frame).collect();
    let path = std::env::temp_dir().join(format!("recording-rate-{}.mcap", std::process::id()));
    let topics = [
        Topic::of_foxglove::<::foxglove::messages::CompressedImage>("/camera/image"),
        Topic::of_foxglove::<::foxglove::messages::PoseInFrame>("/pose"),
        Topic::of_json::<Row>("/command", "spf.Command"),
    ];
    let (began, before) = (Instant::now(), cpu());
    let log = Log::create(&path, &topics, true)?;
    let sender = log.sender();
    for tick in 0..SECONDS * 120 {
        let time = Time::from_secs_f64(tick as f64 / 120.0);
        let send = |topic: usize, data: bytes::Bytes| sender.send(Message { topic, time, data });
        if tick % (120 / FRAMES) == 0 {
            let jpeg = Jpeg::encode(&frames[(tick / 4 % 8) as usize], QUALITY)?;
            send(0, foxglove::encode(&foxglove::image(time, jpeg.bytes().to_vec().into())));
        }
        if tick % 6 == 0 {
            send(1, foxglove::encode(&foxglove::pose(time, &Pose::default())));
        }
        if tick % 3 == 0 {
            let row = Row { name: "setpoint", wanted: [0.123_456_789; 8], cleared: [tick as f64 * 1e-3; 8] };
            send(2, serde_json::to_vec(&row)?.into());
        }
    }
    drop(sender);
    let facts = log.finish()?;
    std::fs::remove_file(&path)?;
    let wall = began.elapsed().as_secs_f64();
    let size = facts.bytes as f64 / 1e6 * 60.0 / SECONDS as f64;
    println!("{SECONDS} s of flight at {FRAMES} frames of 960×720 a second, written in {wall:.1} s; {size:.0} MB a minute");
    if let (Some(before), Some(after)) = (before, cpu()) {
        println!("{:.0} ms of CPU time a second of flight", 1000.0 * (after - before) / SECONDS as f64);
    }
    Ok(())
}
