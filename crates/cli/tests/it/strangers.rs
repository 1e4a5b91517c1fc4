//! Strangers at the servers of the program: a page of another site in a real browser, a host name that leads here (DNS
//! rebinding), requests that are too large (docs/explanation/security.md).

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::Child;
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::harness::{Lab, skip};
use crate::view::Browser;

/// The servers over TCP, each in its own process, with their addresses.
struct Servers {
    children: Vec<Child>,
    endpoint: String,
    view: String,
    live: String,
}

impl Servers {
    fn start(lab: &Lab) -> Self {
        let mut children = Vec::new();
        let mut started = |args: &[&str]| {
            let mut child = lab.command(args).spawn().unwrap();
            let (lines, said) = channel();
            let streams: [Box<dyn Read + Send>; 2] =
                [Box::new(child.stdout.take().unwrap()), Box::new(child.stderr.take().unwrap())];
            for stream in streams {
                let lines = lines.clone();
                std::thread::spawn(move || {
                    for line in BufReader::new(stream).lines().map_while(Result::ok) {
                        // Nobody listens once the address is known.
                        drop(lines.send(line));
                    }
                });
            }
            children.push(child);
            let begun = Instant::now();
            loop {
                let left = Duration::from_secs(120).saturating_sub(begun.elapsed());
                let line = said.recv_timeout(left).unwrap_or_else(|_| panic!("{args:?} names no address"));
                let address = ["http://", "ws://"].into_iter().find_map(|scheme| line.split_once(scheme)).map(|(_, rest)| rest);
                if let Some(address) = address {
                    return address.split(['/', ' ', ')']).next().unwrap().to_owned();
                }
            }
        };
        let endpoint = started(&["sim", "serve", "--vlm", "--scene", "office"]);
        let view = started(&["sim", "view", "--scene", "office", "--listen", "127.0.0.1:0"]);
        let flight = ["fly", "follow the person in the green shirt", "--scene", "office", "--no-video", "--max-time", "600"];
        let live = started(
            &[&flight[..], &["--live=127.0.0.1:0", "--max-decisions", "1000", "--vlm", "oracle:perfect", "--out", "mine"]]
                .concat(),
        );
        Self { children, endpoint, view, live }
    }

    fn each(&self) -> [(&'static str, &String); 3] {
        [("endpoint", &self.endpoint), ("view", &self.view), ("live", &self.live)]
    }
}

impl Drop for Servers {
    fn drop(&mut self) {
        for child in &mut self.children {
            drop(child.kill());
            drop(child.wait());
        }
    }
}

/// What a server answers.
fn ask(address: &str, head: &str) -> String {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    stream.write_all(head.replace("ADDRESS", address).as_bytes()).unwrap();
    let mut answer = Vec::new();
    drop(stream.read_to_end(&mut answer));
    String::from_utf8_lossy(&answer).into_owned()
}

/// What makes a request one for a WebSocket.
const UPGRADE: &str = "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
                       Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Protocol: foxglove.sdk.v1\r\n";

#[test]
#[ignore = "long: .ci/interop runs it"]
fn strangers_are_refused_by_every_server() {
    let lab = Lab::new();
    let servers = Servers::start(&lab);
    for (what, address) in servers.each() {
        let port = address.split(':').next_back().unwrap();
        for (host, origin) in [
            ("rebound.example", None),
            (&*format!("rebound.example:{port}"), Some(format!("http://rebound.example:{port}"))),
            ("ADDRESS", Some("https://evil.example".to_owned())),
            ("ADDRESS", Some("null".to_owned())),
            (&*format!("0.0.0.0:{port}"), None),
        ] {
            let origin = origin.map_or(String::new(), |origin| format!("Origin: {origin}\r\n"));
            let path = if what == "view" { "/socket" } else { "/" };
            let answer = ask(address, &format!("GET {path} HTTP/1.1\r\nHost: {host}\r\n{origin}{UPGRADE}\r\n"));
            assert!(answer.starts_with("HTTP/1.1 403"), "{what} {host} {origin}: {answer}");
        }
        if what != "live" {
            let answer = ask(address, "POST /v1/responses HTTP/1.1\r\nHost: ADDRESS\r\nContent-Length: 8388609\r\n\r\n");
            assert!(answer.starts_with("HTTP/1.1 413"), "{what}: {answer}");
        }
    }
    // An image that claims more pixels than are decoded.
    let mut png = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR".to_vec();
    png.extend([0, 0, 0x80, 0, 0, 0, 0x80, 0, 8, 2, 0, 0, 0]);
    let mut crc = 0xffff_ffff_u32;
    for byte in &png[12..] {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 };
        }
    }
    png.extend((!crc).to_be_bytes());
    png.extend(b"\0\0\0\x01IDAT\0\0\0\0\0");
    let image = format!("data:image/png;base64,{}", base64(&png));
    let content = json!([{"type": "image_url", "image_url": {"url": image}}, {"type": "text", "text": "go"}]);
    let body = json!({"model": "m", "messages": [{"role": "user", "content": content}]}).to_string();
    let head = format!("POST /v1/chat/completions HTTP/1.1\r\nHost: ADDRESS\r\nContent-Length: {}\r\n\r\n{body}", body.len());
    let answer = ask(&servers.endpoint, &head);
    assert!(answer.starts_with("HTTP/1.1 422") && answer.contains("million pixels"), "{answer}");
}

fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for three in bytes.chunks(3) {
        let number = three.iter().fold(0, |number, byte| number << 8 | u32::from(*byte)) << (8 * (3 - three.len()));
        let letters = (0..4).map(|n| char::from(LETTERS[(number >> (18 - 6 * n)) as usize & 63]));
        text.extend(letters.take(three.len() + 1));
    }
    while !text.len().is_multiple_of(4) {
        text.push('=');
    }
    text
}

/// Serves a page of another site until the test ends.
fn page(html: String) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("http://{}/", listener.local_addr().unwrap());
    std::thread::spawn(move || {
        for mut stream in listener.incoming().flatten() {
            let mut head = [0; 4096];
            drop(stream.read(&mut head));
            let head = format!(
                "HTTP/1.1 200 OK\r\nContent-Type: text/html\r\nContent-Length: {}\r\nConnection: close\r\n\r\n",
                html.len()
            );
            drop(stream.write_all((head + &html).as_bytes()));
        }
    });
    url
}

/// Everything that a page can try without the user's help; `results` holds what came of it.
const SCRIPT: &str = r#"
<form id=form method=post enctype=text/plain target=frame><input name="x" value="y"></form><iframe name=frame></iframe>
<script>
const results = {};
const note = (what, outcome) => { results[what] = outcome; };
const socket = (what, url, protocols) => new Promise((done) => {
  const ws = new WebSocket(url, protocols);
  ws.onopen = () => { note(what, 'let in'); done(); };
  ws.onerror = () => { note(what, 'refused'); done(); };
});
const image = (what, url) => new Promise((done) => {
  const shown = new Image();
  shown.onload = () => { note(what, 'let in'); done(); };
  shown.onerror = () => { note(what, 'refused'); done(); };
  shown.src = url;
});
const read = async (what, url, options) => {
  try { await fetch(url, options); note(what, 'let in'); } catch { note(what, 'refused'); }
};
(async () => {
  for (const [name, at] of Object.entries(SERVERS)) {
    await read(name + ': read', `http://${at}/frame.jpg`);
    await read(name + ': put', `http://${at}/pose`, { method: 'PUT', body: '9,9,9,0' });
    await read(name + ': post', `http://${at}/v1/chat/completions`, { method: 'POST', headers: { 'content-type': 'application/json' }, body: '{}' });
    // What is sent without being read counts by what the server did, which the test looks at.
    await fetch(`http://${at}/pose`, { method: 'POST', mode: 'no-cors', body: '9,9,9,0' }).catch(() => {});
    await image(name + ': image', `http://${at}/frame.jpg`);
    await socket(name + ': socket', `ws://${at}/socket`);
    await socket(name + ': Foxglove', `ws://${at}/`, ['foxglove.sdk.v1']);
  }
  window.done = true;
})();
</script>"#;

#[test]
#[ignore = "long: .ci/interop runs it"]
fn a_page_of_another_site_gets_nothing_in_a_real_browser() {
    let lab = Lab::new();
    let servers = Servers::start(&lab);
    let Some(mut browser) = Browser::start(&lab) else { return skip("chromium") };
    let list: Value = servers.each().into_iter().map(|(name, address)| (name.to_owned(), json!(address))).collect();
    browser.open(&page(SCRIPT.replace("SERVERS", &list.to_string())));
    browser.until("window.done === true");
    let results = browser.evaluate("results");
    let results = results.as_object().unwrap();
    assert_eq!(results.len(), 18, "{results:?}");
    for (what, outcome) in results {
        assert_eq!(outcome, "refused", "{what}");
    }
    // None of it reached the camera: the first image is the first.
    let answer = ask(&servers.endpoint, "GET /frame.jpg HTTP/1.1\r\nHost: ADDRESS\r\n\r\n");
    assert!(answer.contains("x-frame-id: 0\r\n"), "{}", &answer[..answer.len().min(400)]);
    // A name that leads to this machine: the page that it shows is the refusal.
    for (name, address) in &servers.each()[..2] {
        let port = address.split(':').next_back().unwrap();
        browser.open(&format!("http://rebound.example:{port}/"));
        browser.until("document.readyState === 'complete' && document.body.textContent.length > 0");
        let shown = browser.evaluate("document.body.textContent");
        assert!(shown.as_str().unwrap().contains("invalid Host header"), "{name}: {shown}");
    }
    // The view's own page still works in the same browser.
    browser.open(&format!("http://{}/", servers.view));
    browser.until("Number(document.getElementById('picture')?.dataset.frame) > 0");
}
