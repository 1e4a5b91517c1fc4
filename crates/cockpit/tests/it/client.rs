//! A page without a browser.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket};

/// Maximum wait for anything.
const PATIENCE: Duration = Duration::from_secs(120);

/// A connection, encrypted or not.
pub(crate) trait Line: Read + Write + Send {}

impl<T: Read + Write + Send> Line for T {}

/// One of a page's two sockets.
pub(crate) struct Socket {
    socket: WebSocket<Box<dyn Line>>,
    orders: u64,
    /// The last beat seen.
    tick: u64,
    shown: u64,
    /// Pictures seen: the head of each.
    pub(crate) pictures: Vec<Value>,
    /// Whether beats are answered, and pictures confirmed when they are read.
    pub(crate) alive: bool,
    /// When the last one was.
    pub(crate) answered: Instant,
}

impl Socket {
    /// Connects to `/watch` or `/control`, and greets.
    pub(crate) fn open(address: SocketAddr, path: &str, hello: Value) -> Self {
        let stream = TcpStream::connect(address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        Self::over(Box::new(stream), address, path, hello)
    }

    /// The same over a connection that is open.
    pub(crate) fn over(stream: Box<dyn Line>, address: SocketAddr, path: &str, hello: Value) -> Self {
        let request = format!("ws://{address}{path}").into_client_request().unwrap();
        let (socket, _) = tungstenite::client(request, stream).unwrap();
        let mut page = Self { socket, orders: 0, tick: 0, shown: 0, pictures: Vec::new(), alive: true, answered: Instant::now() };
        page.say(&json!({"hello": hello}));
        page
    }

    pub(crate) fn say(&mut self, message: &Value) {
        self.socket.send(Message::text(message.to_string())).unwrap();
    }

    /// Says that all pictures were shown, and reads none of them.
    pub(crate) fn pretend(&mut self) {
        // The server may have given it up.
        let _ = self.answer(&json!({"shown": u64::MAX}));
    }

    /// Sends an answer; `None` if the server is gone.
    fn answer(&mut self, message: &Value) -> Option<()> {
        self.socket.send(Message::text(message.to_string())).ok()
    }

    /// The next text; pictures are confirmed and kept, beats are answered. `None` at the end.
    pub(crate) fn next(&mut self) -> Option<Value> {
        let began = Instant::now();
        while began.elapsed() < PATIENCE {
            match self.socket.read().ok()? {
                Message::Text(text) => {
                    let message: Value = serde_json::from_str(&text).unwrap();
                    if message["type"] != "beat" {
                        return Some(message);
                    }
                    self.tick = message["n"].as_u64().unwrap();
                    if self.alive {
                        self.answered = Instant::now();
                        self.answer(&json!({"beat": message["n"]}))?;
                    }
                }
                Message::Binary(bytes) => {
                    let length = u32::from_le_bytes(bytes[..4].try_into().unwrap()) as usize;
                    let head: Value = serde_json::from_slice(&bytes[4..4 + length]).unwrap();
                    let start: &[u8] = if head.get("key").is_some() { &[0, 0, 0, 1] } else { &[0xff, 0xd8] };
                    assert!(bytes[4 + length..].starts_with(start), "a JPEG, or an access unit: {head}");
                    self.pictures.push(head);
                    self.shown += 1;
                    if self.alive {
                        self.answer(&json!({"shown": self.shown}))?;
                    }
                }
                Message::Close(_) => return None,
                _ => {}
            }
        }
        panic!("nothing for {} s", PATIENCE.as_secs());
    }

    /// The next message that fits; others are skipped.
    pub(crate) fn wait(&mut self, what: &str, fits: impl Fn(&Value) -> bool) -> Value {
        let began = Instant::now();
        while began.elapsed() < PATIENCE {
            let message = self.next().unwrap_or_else(|| panic!("closed before: {what}"));
            if fits(&message) {
                return message;
            }
        }
        panic!("never: {what}");
    }

    /// Gives an order; returns its acknowledgement, and the time until it came. One that is dropped, because this page has not
    /// read for a while, is given once more.
    pub(crate) fn order(&mut self, what: Value) -> (Value, Duration) {
        let (answer, took) = self.order_once(&what);
        if answer["text"].as_str().is_some_and(|text| text.contains("dropped")) { self.order_once(&what) } else { (answer, took) }
    }

    fn order_once(&mut self, what: &Value) -> (Value, Duration) {
        self.orders += 1;
        let (id, began) = (self.orders, Instant::now());
        self.say(&json!({"order": {"id": id, "tick": self.tick, "do": what}}));
        let answer = self.wait("an acknowledgement", |message| message["type"] == "ack" && message["id"] == id);
        (answer, began.elapsed())
    }
}
