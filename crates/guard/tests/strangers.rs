//! The HTTP server as strangers meet it, over real sockets.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::time::{Duration, Instant};

use axum::Router;
use axum::body::Bytes;
use axum::routing::{get, post};
use spf_guard::{Access, BODY_BYTES, CONNECTIONS, HEAD_TIME, Manner};
use tokio::sync::watch;

/// A server that ends with the test.
struct Served {
    address: SocketAddr,
    _stop: watch::Sender<bool>,
}

fn served() -> Served {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let (stop, stopped) = watch::channel(false);
    let router = Router::new()
        .route("/", get(async || "hello"))
        .route("/slow", get(async || tokio::time::sleep(Duration::from_secs(600)).await))
        .route("/length", post(async |body: Bytes| body.len().to_string()))
        .layer(axum::extract::DefaultBodyLimit::disable());
    std::thread::spawn(move || {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime
            .block_on(spf_guard::serve(listener, router, Access::at(address), stopped, Manner::plain(Duration::ZERO)))
            .unwrap();
    });
    Served { address, _stop: stop }
}

impl Served {
    fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(self.address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        stream
    }

    /// The answer to a request, as far as it comes.
    fn ask(&self, head: &str, body: &[u8]) -> String {
        let mut stream = self.connect();
        stream.write_all(head.replace("ADDRESS", &self.address.to_string()).as_bytes()).unwrap();
        drop(stream.write_all(body));
        read(&mut stream)
    }

    fn get(&self) -> String {
        self.ask("GET / HTTP/1.1\r\nHost: ADDRESS\r\n\r\n", b"")
    }
}

fn read(stream: &mut TcpStream) -> String {
    let mut answer = Vec::new();
    drop(stream.read_to_end(&mut answer));
    String::from_utf8_lossy(&answer).into_owned()
}

#[test]
fn other_sites_and_names_are_refused() {
    let served = served();
    assert!(served.get().ends_with("hello"));
    for head in [
        "GET / HTTP/1.1\r\nHost: rebound.example\r\n\r\n",
        "GET / HTTP/1.1\r\nHost: ADDRESS\r\nOrigin: https://evil.example\r\n\r\n",
        "POST /length HTTP/1.1\r\nHost: ADDRESS\r\nOrigin: null\r\nContent-Length: 0\r\n\r\n",
        "OPTIONS /length HTTP/1.1\r\nHost: ADDRESS\r\nOrigin: https://evil.example\r\nAccess-Control-Request-Method: PUT\r\n\r\n",
        "GET / HTTP/1.1\r\nHost: ADDRESS\r\nSec-Fetch-Site: cross-site\r\nSec-Fetch-Dest: image\r\n\r\n",
    ] {
        let answer = served.ask(head, b"");
        assert!(answer.starts_with("HTTP/1.1 403") && !answer.to_lowercase().contains("access-control-allow"), "{head}{answer}");
    }
    // Neither a second Host header nor none.
    for head in ["GET / HTTP/1.1\r\nHost: ADDRESS\r\nHost: evil.example\r\n\r\n", "GET / HTTP/1.1\r\n\r\n"] {
        let answer = served.ask(head, b"");
        assert!(answer.starts_with("HTTP/1.1 4"), "{head}{answer}");
    }
}

#[test]
fn a_body_that_is_too_large_is_refused_however_it_is_sent() {
    let served = served();
    let post = |length: usize, body: &[u8]| {
        served.ask(&format!("POST /length HTTP/1.1\r\nHost: ADDRESS\r\nContent-Length: {length}\r\n\r\n"), body)
    };
    let whole = vec![b'x'; BODY_BYTES];
    assert!(post(BODY_BYTES, &whole).ends_with(&BODY_BYTES.to_string()));
    // Refused by its announced length, before anything of it is sent.
    assert!(post(BODY_BYTES + 1, b"").starts_with("HTTP/1.1 413"));
    assert!(post(usize::MAX, b"").starts_with("HTTP/1.1 4"));
    // Without a length it is counted.
    let mut stream = served.connect();
    let head = format!("POST /length HTTP/1.1\r\nHost: {}\r\nTransfer-Encoding: chunked\r\n\r\n", served.address);
    stream.write_all(head.as_bytes()).unwrap();
    let chunk = [b"100000\r\n".as_slice(), &vec![b'x'; 1 << 20], b"\r\n"].concat();
    let sent = (0..64).take_while(|_| stream.write_all(&chunk).is_ok()).count();
    assert!(sent < 64, "it was all taken");
    let answer = read(&mut stream);
    assert!(answer.is_empty() || answer.starts_with("HTTP/1.1 413"), "{answer}");
    // Too long a head.
    let answer = served.ask(&format!("GET /{} HTTP/1.1\r\nHost: ADDRESS\r\n\r\n", "x".repeat(100_000)), b"");
    assert!(answer.is_empty() || answer.starts_with("HTTP/1.1 4"), "{answer}");
    let many: String = (0..200).map(|n| format!("X-{n}: y\r\n")).collect();
    assert!(served.ask(&format!("GET / HTTP/1.1\r\nHost: ADDRESS\r\n{many}\r\n"), b"").starts_with("HTTP/1.1 431"));
    assert!(served.get().ends_with("hello"));
}

/// A hundred connections that never finish their request: whoever asks is answered, at once and all the time.
#[test]
fn connections_that_say_nothing_lock_nobody_out() {
    let served = served();
    let mut slow: Vec<TcpStream> = (0..100).map(|_| served.connect()).collect();
    let begun = Instant::now();
    let mut asked = 0;
    // A few more on a machine that answers them slowly.
    while begun.elapsed() < HEAD_TIME + Duration::from_secs(1) || asked < 4 {
        // A byte of a header each, now and then, and new ones for those that were disconnected.
        for stream in &mut slow {
            if stream.write_all(b"G").is_err() {
                *stream = served.connect();
            }
        }
        let answer = served.get();
        assert!(answer.ends_with("hello"), "{answer}");
        asked += 1;
        std::thread::sleep(Duration::from_millis(50));
    }
}

#[test]
fn a_head_and_a_body_must_come_in_time() {
    let served = served();
    let mut silent = served.connect();
    let begun = Instant::now();
    assert!(!read(&mut silent).starts_with("HTTP/1.1 2"));
    let took = begun.elapsed();
    assert!(took >= HEAD_TIME - Duration::from_secs(1) && took < HEAD_TIME + Duration::from_secs(60), "{took:?}");
}

#[test]
fn there_are_only_so_many_connections() {
    let served = served();
    let mut busy = Vec::new();
    for _ in 0..CONNECTIONS {
        let mut stream = served.connect();
        stream.write_all(format!("GET /slow HTTP/1.1\r\nHost: {}\r\n\r\n", served.address).as_bytes()).unwrap();
        busy.push(stream);
    }
    // Until all of them have asked, a new connection takes the place of one that has not.
    std::thread::sleep(Duration::from_millis(500));
    let answer = served.get();
    assert!(answer.starts_with("HTTP/1.1 503") && answer.contains("retry-after"), "{answer}");
    busy.pop();
    let free = (0..500).any(|_| {
        std::thread::sleep(Duration::from_millis(20));
        served.get().ends_with("hello")
    });
    assert!(free);
}
