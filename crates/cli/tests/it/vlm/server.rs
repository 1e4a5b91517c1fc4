//! A server on this machine that answers like the vendors, or as badly as possible.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use serde_json::Value;
use spf_vlm::setup::KeyHost;

/// A received request.
#[derive(Clone)]
pub(crate) struct Request {
    pub(crate) method: String,
    pub(crate) path: String,
    /// Names in lower case.
    pub(crate) headers: Vec<(String, String)>,
    pub(crate) body: Vec<u8>,
}

impl Request {
    pub(crate) fn header(&self, name: &str) -> Option<&str> {
        self.headers.iter().find(|(of, _)| of == name).map(|(_, value)| value.as_str())
    }

    pub(crate) fn json(&self) -> Value {
        serde_json::from_slice(&self.body).unwrap()
    }
}

/// The response, piece by piece.
#[derive(Clone)]
pub(crate) enum Piece {
    Bytes(Vec<u8>),
    /// Until the client disconnects.
    Hang,
    /// Forever, this often.
    Endless(Vec<u8>, Duration),
    /// The connection ends in the middle.
    Break,
}

/// An answer.
#[derive(Clone)]
pub(crate) struct Reply {
    pub(crate) status: u16,
    pub(crate) headers: Vec<(&'static str, String)>,
    pub(crate) pieces: Vec<Piece>,
}

impl Reply {
    pub(crate) fn new(status: u16, content_type: &str, body: impl Into<Vec<u8>>) -> Self {
        Self { status, headers: vec![("content-type", content_type.to_owned())], pieces: vec![Piece::Bytes(body.into())] }
    }

    pub(crate) fn json(status: u16, body: &Value) -> Self {
        Self::new(status, "application/json", body.to_string())
    }

    pub(crate) fn with(mut self, name: &'static str, value: &str) -> Self {
        self.headers.push((name, value.to_owned()));
        self
    }
}

/// The server; it serves until the test ends.
pub(crate) struct Server {
    address: SocketAddr,
    requests: Arc<Mutex<Vec<Request>>>,
    /// Clients that disconnected before the end of their answer.
    pub(crate) left: Arc<AtomicU32>,
    pub(crate) connections: Arc<AtomicU32>,
}

impl Server {
    /// A server whose answer to the query with this number, from 0, is created by `answer`.
    pub(crate) fn start(answer: impl Fn(usize, &Request) -> Reply + Send + Sync + 'static) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let server = Self { address, requests: Arc::default(), left: Arc::default(), connections: Arc::default() };
        let (requests, left, connections) = (server.requests.clone(), server.left.clone(), server.connections.clone());
        let answer = Arc::new(answer);
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let (requests, left, answer) = (requests.clone(), left.clone(), answer.clone());
                connections.fetch_add(1, Ordering::SeqCst);
                std::thread::spawn(move || {
                    if serve(&stream, &requests, &*answer).is_none() {
                        left.fetch_add(1, Ordering::SeqCst);
                    }
                });
            }
        });
        server
    }

    /// `http://127.0.0.1:PORT/v1`.
    pub(crate) fn url(&self) -> String {
        format!("http://{}/v1", self.address)
    }

    /// The server, as a key's receiver.
    pub(crate) fn host(&self) -> KeyHost {
        self.address.to_string().parse().unwrap()
    }

    /// The queries so far; a request that only opens a connection does not count.
    pub(crate) fn questions(&self) -> Vec<Request> {
        self.requests.lock().unwrap().iter().filter(|request| request.method == "POST").cloned().collect()
    }
}

/// Serves a connection until the client closes it; `None` if that happened inside an answer.
fn serve(stream: &TcpStream, requests: &Mutex<Vec<Request>>, answer: &dyn Fn(usize, &Request) -> Reply) -> Option<()> {
    // Nothing here outlives a test by more than this.
    stream.set_read_timeout(Some(Duration::from_secs(120))).unwrap();
    stream.set_nodelay(true).unwrap();
    let mut reader = BufReader::new(stream);
    while let Some(request) = read(&mut reader) {
        let number = {
            let mut all = requests.lock().unwrap();
            all.push(request.clone());
            all.iter().filter(|request| request.method == "POST").count()
        };
        let reply =
            if request.method == "POST" { answer(number - 1, &request) } else { Reply::json(404, &serde_json::json!({})) };
        send(stream, &reply)?;
    }
    Some(())
}

fn read(reader: &mut BufReader<&TcpStream>) -> Option<Request> {
    let mut line = String::new();
    reader.read_line(&mut line).ok().filter(|read| *read > 0)?;
    let mut words = line.split_whitespace();
    let (method, path) = (words.next()?.to_owned(), words.next()?.to_owned());
    let mut headers = Vec::new();
    loop {
        let mut line = String::new();
        reader.read_line(&mut line).ok()?;
        let Some((name, value)) = line.trim_end().split_once(": ") else { break };
        headers.push((name.to_lowercase(), value.to_owned()));
    }
    let length = headers.iter().find(|(name, _)| name == "content-length").map_or(0, |(_, value)| value.parse().unwrap());
    let mut body = vec![0; length];
    reader.read_exact(&mut body).ok()?;
    Some(Request { method, path, headers, body })
}

fn send(mut stream: &TcpStream, reply: &Reply) -> Option<()> {
    let headers: String = reply.headers.iter().map(|(name, value)| format!("{name}: {value}\r\n")).collect();
    write!(stream, "HTTP/1.1 {} Said\r\ntransfer-encoding: chunked\r\n{headers}\r\n", reply.status).ok()?;
    let chunk = |mut stream: &TcpStream, bytes: &[u8]| -> Option<()> {
        let chunk = [format!("{:x}\r\n", bytes.len()).as_bytes(), bytes, b"\r\n"].concat();
        stream.write_all(&chunk).ok()
    };
    for piece in &reply.pieces {
        match piece {
            Piece::Bytes(bytes) if bytes.is_empty() => {}
            Piece::Bytes(bytes) => chunk(stream, bytes)?,
            Piece::Hang => {
                // Reading ends when the client disconnects.
                drop(stream.read(&mut [0; 1]));
                return None;
            }
            Piece::Endless(bytes, every) => loop {
                chunk(stream, bytes)?;
                std::thread::sleep(*every);
            },
            Piece::Break => {
                drop(stream.shutdown(std::net::Shutdown::Both));
                return Some(());
            }
        }
    }
    stream.write_all(b"0\r\n\r\n").ok()
}
