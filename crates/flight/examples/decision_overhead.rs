//! Cost of a decision apart from the model, end to end over a real socket: CPU time from a frame of 960×720 to the
//! request sent, and from the answer to the first setpoint.
//!
//! `cargo run --release -p spf-flight --features figures --example decision_overhead [VLM …]`; `openai`, `gemini`, `anthropic` and
//! `vllm` without an argument.
//!
//! A server in this process answers at once with a stream of 12 events. Its own CPU time is subtracted from that of the
//! whole process, so the remainder is the client's: writing the prompt, scaling, encoding, sending, reading the stream,
//! parsing, lifting, the first setpoint. The images are those of the simulated city, all rendered in advance.

#![expect(clippy::print_stdout, reason = "an example that prints what it measured")]

use std::error::Error;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use serde_json::json;
use spf_core::camera::Camera;
use spf_core::craft::Craft;
use spf_core::frame::{FrameId, FrameMeta};
use spf_core::geometry::{Attitude, EnuPosition, Pose};
use spf_core::motion::MotionEstimate;
use spf_core::query::VerticalRoom;
use spf_core::time::{Duration, Time};
use spf_media::{Jpeg, Rgb, Scaler};
use spf_motion::executor::{Ending, Executor, Motion};
use spf_pilot::policy::spf::{Spf, SpfSettings};
use spf_pilot::policy::{Expected, Policy, PolicyEvent, Step, View};
use spf_pilot::{PilotSettings, Preset};
use spf_render::{Channels, RenderedImage, Renderer};
use spf_scene::Scene;
use spf_space::avoid::PathShape;
use spf_vlm::setup::{self, Access};
use spf_vlm::table::Table;
use spf_vlm::{QueryImage, QueryRequest, RequestOptions, Vlm, VlmError};

type Failure = Box<dyn Error + Send + Sync>;

const WARM: u64 = 20;
const DECISIONS: u64 = 400;

/// A camera frame, prepared as by `spf_flight::image`.
struct Frame<'a>(&'a Rgb, &'a mut Scaler);

impl QueryImage for Frame<'_> {
    fn size(&self) -> (u32, u32) {
        (self.0.width(), self.0.height())
    }

    fn jpeg(&mut self, (width, height): (u32, u32), quality: u8) -> Result<Arc<[u8]>, VlmError> {
        let scaled = self.1.scale(self.0, width, height);
        let encoded = Jpeg::encode(&scaled, quality);
        self.1.reuse(scaled);
        Ok(encoded.map_err(|error| VlmError::Image(error.to_string()))?.shared())
    }
}

/// CPU time of a thread, nanoseconds (Linux).
fn on_core(task: &str) -> Result<u64, Failure> {
    let text = std::fs::read_to_string(format!("/proc/{task}/schedstat"))?;
    Ok(text.split(' ').next().unwrap_or_default().parse()?)
}

/// The same for all threads of this process.
fn on_cores() -> Result<u64, Failure> {
    let tasks = std::fs::read_dir("/proc/self/task")?;
    tasks.map(|task| on_core(&format!("self/task/{}", task?.file_name().to_string_lossy()))).sum()
}

/// CPU time of the server's threads, nanoseconds, and number of bytes received.
#[derive(Default)]
struct Server {
    cpu: AtomicU64,
    bytes: AtomicU64,
}

/// A reply in a vendor's stream, split into twelve events.
fn stream(vlm: &str) -> String {
    let text = r#"{"status":"navigating","look":null,"stage":1,"point":[480,500],"depth":6,"target":"the crane"}"#;
    let pieces = text.as_bytes().chunks(8).map(|piece| String::from_utf8_lossy(piece).into_owned());
    let event = |piece: String| match vlm {
        "gemini" => json!({ "candidates": [{ "content": { "parts": [{ "text": piece }] } }] }),
        "anthropic" => json!({ "type": "content_block_delta", "index": 0, "delta": { "type": "text_delta", "text": piece } }),
        "openai" => json!({ "type": "response.output_text.delta", "delta": piece }),
        _ => json!({ "choices": [{ "delta": { "content": piece } }] }),
    };
    pieces.map(|piece| format!("data: {}\n\n", event(piece))).collect()
}

/// Answers all requests of a connection until it closes.
fn serve(connection: TcpStream, answer: &str, server: &Server) -> Result<(), Failure> {
    let mut spent = 0;
    let mut reader = BufReader::new(connection.try_clone()?);
    let mut writer = connection;
    loop {
        let (mut length, mut line) = (0, String::new());
        loop {
            line.clear();
            if reader.read_line(&mut line)? == 0 {
                return Ok(());
            }
            if let Some((_, value)) = line.split_once(':').filter(|(name, _)| name.eq_ignore_ascii_case("content-length")) {
                length = value.trim().parse()?;
            }
            if line == "\r\n" {
                break;
            }
        }
        let mut body = vec![0; length];
        reader.read_exact(&mut body)?;
        let head = "HTTP/1.1 200 OK\r\ncontent-type: text/event-stream\r\n";
        write!(writer, "{head}content-length: {}\r\n\r\n{answer}", answer.len())?;
        server.bytes.fetch_add(length as u64, Ordering::SeqCst);
        let now = on_core("thread-self")?;
        server.cpu.fetch_add(now - spent, Ordering::SeqCst);
        spent = now;
    }
}

fn frame(drawn: RenderedImage) -> Result<Rgb, Failure> {
    Ok(Rgb::from_raw(drawn.width, drawn.height, drawn.rgb.ok_or("nothing was drawn")?)?)
}

/// Images along a street of the city.
fn frames(camera: &Camera) -> Result<Vec<Rgb>, Failure> {
    let renderer = Renderer::new(&Scene::load("city")?.geometry);
    let poses = (0..8).map(|i| Pose {
        position: EnuPosition { east: 0.0, north: -6.0 + 5.0 * f64::from(i), up: 2.5 },
        attitude: Attitude { heading: 0.15 * f64::from(i), ..Attitude::default() },
    });
    poses.map(|pose| frame(renderer.render(camera, &pose, Channels::RGB))).collect()
}

/// One decision: the policy queries, the model answers, and the executor returns the first setpoint.
fn decide(spf: &mut Spf, vlm: &mut dyn Vlm, mut frame: Frame<'_>, camera: &Camera, number: u64) -> Result<(), Failure> {
    let now = Time::from_millis(1000 * number);
    let meta = FrameMeta {
        id: FrameId(number),
        captured: now,
        received: now,
        capture_counter: number,
        width: frame.0.width(),
        height: frame.0.height(),
        unusable: None,
    };
    let view = View {
        frame: meta,
        camera: *camera,
        pose: Pose::default(),
        at_rest: true,
        room: VerticalRoom::default(),
        expected: Expected::Unknown,
        reckoned: None,
    };
    let Step::Ask(query) = spf.handle(PolicyEvent::Frame(&view)).step else { return Err("the policy did not ask".into()) };
    let text = vlm.answer(&QueryRequest::new(&query, Duration::from_secs(10)), &mut frame).text?;
    let Step::Move(motion) =
        spf.handle(PolicyEvent::Reply { id: query.id, text: &text, arrived: Time::ZERO, pose: Pose::default() }).step
    else {
        return Err(format!("no motion came of {text}").into());
    };
    let mut executor = Executor::new(Craft::tello(), Motion::Blended, Ending::Measured);
    let known = MotionEstimate::default();
    executor.start(now, known, motion.primitives);
    if executor.tick(now, known).setpoint.is_hold() {
        return Err("the first setpoint holds".into());
    }
    Ok(())
}

fn measure(name: &str, frames: &[Rgb], camera: &Camera) -> Result<(), Failure> {
    let server = Arc::new(Server::default());
    let listener = TcpListener::bind("127.0.0.1:0")?;
    let address = listener.local_addr()?;
    let (answer, counted) = (stream(name), Arc::clone(&server));
    std::thread::spawn(move || {
        for connection in listener.incoming().flatten() {
            let (answer, counted) = (answer.clone(), Arc::clone(&counted));
            std::thread::spawn(move || serve(connection, &answer, &counted));
        }
    });
    let variables = |variable: &str| variable.ends_with("_API_KEY").then(|| "none".to_owned());
    let table = Table::shipped();
    let full = format!("{name}@http://{address}");
    let mut remote = setup::remote(&table, &[full.as_str().into()], Access::of(&variables), RequestOptions::default())?;
    let eyes = remote.image_spec((camera.width, camera.height));
    let preset = PilotSettings::preset(Preset::Default);
    let mut spf = Spf::new(SpfSettings {
        step: preset.step,
        lifting: preset.lifting,
        shape: PathShape::Straight,
        avoid: false,
        confirm_done: true,
        grounding: eyes.grounding,
        image_size: eyes.image_size,
        craft: Craft::tello(),
        depth: preset.depth,
        near_m: preset.near_m,
        method: preset.method,
        keep_m: None,
        close_up: false,
    });
    spf.handle(PolicyEvent::Instruction("Take off and fly to the red crane"));
    let client = || Ok::<_, Failure>(on_cores()? - server.cpu.load(Ordering::SeqCst));
    let (mut spent, mut sent, mut scaler) = (0, 0, Scaler::default());
    for number in 0..WARM + DECISIONS {
        if number == WARM {
            spent = client()?;
            sent = server.bytes.load(Ordering::SeqCst);
        }
        decide(&mut spf, &mut remote, Frame(&frames[number as usize % frames.len()], &mut scaler), camera, number)?;
    }
    let spent = client()? - spent;
    let sent = server.bytes.load(Ordering::SeqCst) - sent;
    let size = eyes.image_size.unwrap_or((camera.width, camera.height));
    println!(
        "{name:<10} {}×{}  {:.1} ms of CPU a decision  {:.1} kB sent a decision",
        size.0,
        size.1,
        spent as f64 / 1e6 / DECISIONS as f64,
        sent as f64 / 1e3 / DECISIONS as f64,
    );
    Ok(())
}

fn main() -> Result<(), Failure> {
    let camera = Camera::tello();
    let frames = frames(&camera)?;
    let named: Vec<String> = std::env::args().skip(1).collect();
    let names = if named.is_empty() { ["openai", "gemini", "anthropic", "vllm"].map(str::to_owned).to_vec() } else { named };
    names.iter().try_for_each(|name| measure(name, &frames, &camera))
}
