//! A VLM behind HTTP that needs no key, for trying a new drone with the `spf` command. It points at red in the image.
//! While nothing is red, it points straight ahead three times and then replies that the instruction is fulfilled. It
//! implements OpenAI's chat completions, and answers queries for points only (`--policy spf`).
//!
//! `cargo run -p spf-api --example vlm_server`, then `spf fly "…" --drone … --vlm http://127.0.0.1:8090/v1#red`

#![allow(clippy::print_stdout, reason = "an example's output")]

mod red;

use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};
use spf_media::Rgb;

/// Default address; an argument sets another one.
const ADDRESS: &str = "127.0.0.1:8090";
/// Latency of a model. Without it a flight in continuous mode would use up all its decisions within seconds.
const LATENCY: Duration = Duration::from_millis(300);
/// Steps straight ahead in a flight without anything red.
const AHEAD: u32 = 3;

/// The reply to a prompt about an image; `ahead` counts the steps straight ahead in this flight.
pub(crate) fn reply(prompt: &str, image: &Rgb, ahead: &AtomicU32) -> Value {
    // A prompt without history is the first one of a flight.
    if !prompt.contains("What came before:") {
        ahead.store(0, Ordering::Relaxed);
    }
    // A model without a row in the table is queried in [x, y] in thousandths (docs/guide/vlm.md).
    let (status, target, point, depth) = match red::find(image) {
        Some(spot) => (spot.status(), "red", [1000.0 * spot.u, 1000.0 * spot.v], spot.depth()),
        None if ahead.fetch_add(1, Ordering::Relaxed) < AHEAD => ("navigating", "ahead", [500.0; 2], 2.0),
        None => ("done", "ahead", [500.0; 2], 1.0),
    };
    let [x, y] = point.map(f64::round);
    json!({ "status": status, "look": null, "stage": 1, "point": [x, y], "depth": depth, "target": target })
}

/// The response to a request body; `None` if it is not a question about an image.
fn response(body: &[u8], ahead: &AtomicU32) -> Option<Value> {
    let requested: Value = serde_json::from_slice(body).ok()?;
    let parts = requested["messages"][0]["content"].as_array()?;
    let prompt = parts.iter().find_map(|part| part["text"].as_str())?;
    let (_, jpeg) = parts.iter().find_map(|part| part["image_url"]["url"].as_str())?.split_once("base64,")?;
    let image = spf_media::jpeg::decode(&STANDARD.decode(jpeg).ok()?).ok()?;
    let text = reply(prompt, &image, ahead).to_string();
    println!("{text}");
    std::thread::sleep(LATENCY);
    Some(json!({ "model": "red", "choices": [{ "message": { "content": text }, "finish_reason": "stop" }] }))
}

/// Answers the requests of a connection until the client closes it.
fn converse(stream: &TcpStream, ahead: &AtomicU32) -> io::Result<()> {
    let mut reader = BufReader::new(stream);
    let (mut line, mut length) = (String::new(), 0);
    while reader.read_line(&mut line)? > 0 {
        match line.split_once(':') {
            Some((name, value)) if name.eq_ignore_ascii_case("content-length") => length = value.trim().parse().unwrap_or(0),
            // An empty line ends the header.
            None if line.trim().is_empty() => {
                let mut body = vec![0; std::mem::take(&mut length)];
                reader.read_exact(&mut body)?;
                let (status, json) = response(&body, ahead).map_or(("400 Bad Request", json!({})), |json| ("200 OK", json));
                let (mut out, json) = (stream, json.to_string());
                let header = format!("HTTP/1.1 {status}\r\ncontent-type: application/json\r\ncontent-length: {}", json.len());
                write!(out, "{header}\r\n\r\n{json}")?;
            }
            _ => {}
        }
        line.clear();
    }
    Ok(())
}

/// Serves until the process ends.
pub(crate) fn serve(listener: &TcpListener) -> io::Result<()> {
    let ahead = AtomicU32::default();
    std::thread::scope(|scope| {
        for stream in listener.incoming() {
            let (stream, ahead) = (stream?, &ahead);
            // A broken connection is the client's problem.
            scope.spawn(move || drop(converse(&stream, ahead)));
        }
        Ok(())
    })
}

fn main() -> io::Result<()> {
    let listener = TcpListener::bind(std::env::args().nth(1).as_deref().unwrap_or(ADDRESS))?;
    println!("--vlm http://{}/v1#red", listener.local_addr()?);
    serve(&listener)
}
