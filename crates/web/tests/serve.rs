//! The server from the page's side, over real sockets.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use std::collections::BTreeSet;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::{Arc, LazyLock};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use spf_flight::sim::LoadedScene;
use spf_scene::SceneLook;
use spf_web::view::{InitialView, Library, Stopper, ViewError, Viewer};
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket};

static CITY: LazyLock<Arc<LoadedScene>> = LazyLock::new(|| Arc::new(LoadedScene::load("city").unwrap()));

/// A server that ends with the test.
struct Served {
    address: SocketAddr,
    stopper: Stopper,
    thread: Option<JoinHandle<Result<(), ViewError>>>,
}

impl Served {
    fn start() -> Self {
        let viewer = Viewer::bind("127.0.0.1:0".parse().unwrap()).unwrap();
        let (address, stopper) = (viewer.address(), viewer.stopper());
        let library = Library::new(["city".to_owned()], "city", SceneLook::default(), CITY.clone());
        let beginning = InitialView { scene: "city".to_owned(), conditions: SceneLook::default(), craft: None, pose: None };
        let thread = std::thread::spawn(move || viewer.serve(library, beginning));
        Self { address, stopper, thread: Some(thread) }
    }

    /// Status line, head and body of an answer.
    fn http(&self, request: &str) -> String {
        let mut stream = TcpStream::connect(self.address).unwrap();
        stream.write_all(request.replace("ADDRESS", &self.address.to_string()).as_bytes()).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    }

    fn page(&self) -> Page {
        let request = format!("ws://{}/socket", self.address).into_client_request().unwrap();
        let stream = TcpStream::connect(self.address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let (socket, _) = tungstenite::client(request, stream).unwrap();
        let mut page = Page(socket);
        let hello = page.text("hello");
        assert_eq!(hello["scenes"], json!(["city"]));
        page.say(json!({"type": "detail", "detail": "low"}));
        page
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.stopper.stop();
    }
}

struct Page(WebSocket<TcpStream>);

/// Maximum wait of a page for anything.
const PATIENCE: Duration = Duration::from_secs(60);

enum Received {
    Text(Value),
    Image(Shown),
}

/// An image's head and its JPEG.
struct Shown {
    head: Value,
    jpeg: Vec<u8>,
}

impl Shown {
    fn number(&self, key: &str) -> f64 {
        self.head[key].as_f64().unwrap_or_else(|| panic!("`{key}` in {}", self.head))
    }

    fn decoded(&self) -> Vec<[u8; 3]> {
        spf_media::jpeg::decode(&self.jpeg).unwrap().data().as_chunks().0.to_vec()
    }
}

impl Page {
    fn say(&mut self, message: Value) {
        self.0.send(Message::text(message.to_string())).unwrap();
    }

    /// The next message that is not a ping; images are acknowledged as shown, because the server waits for that.
    ///
    /// # Panics
    /// If none arrives: pings keep the socket's own timeout from passing.
    fn next(&mut self) -> Received {
        let begun = Instant::now();
        while begun.elapsed() < PATIENCE {
            match self.0.read().unwrap() {
                Message::Text(text) => return Received::Text(serde_json::from_str(&text).unwrap()),
                Message::Binary(bytes) => {
                    let length = u32::from_le_bytes(bytes[..4].try_into().unwrap()) as usize;
                    let head: Value = serde_json::from_slice(&bytes[4..4 + length]).unwrap();
                    self.say(json!({"type": "shown", "frame": head["frame"]}));
                    return Received::Image(Shown { head, jpeg: bytes[4 + length..].to_vec() });
                }
                _ => {}
            }
        }
        panic!("nothing but pings for {} s", PATIENCE.as_secs());
    }

    /// The next text message of a type; earlier messages are skipped.
    fn text(&mut self, kind: &str) -> Value {
        let begun = Instant::now();
        while begun.elapsed() < PATIENCE {
            if let Received::Text(message) = self.next()
                && message["type"] == kind
            {
                return message;
            }
        }
        panic!("no text of type {kind} in {} s", PATIENCE.as_secs());
    }

    /// The next image.
    fn show(&mut self) -> Shown {
        loop {
            if let Received::Image(shown) = self.next() {
                return shown;
            }
        }
    }

    fn show_until(&mut self, what: &str, enough: impl Fn(&Shown) -> bool) -> Shown {
        (0..500).map(|_| self.show()).find(enough).unwrap_or_else(|| panic!("never: {what}"))
    }

    /// An image of the requested size.
    fn show_small(&mut self) -> Shown {
        self.show_until("a small picture", |shown| shown.number("width") == 320.0)
    }

    fn fly(&mut self, forward: f64) {
        self.say(json!({"type": "fly", "right": 0, "forward": forward, "up": 0, "yaw": 0, "pitch": 0, "fast": true}));
    }
}

#[test]
fn held_keys_fly_and_images_follow() {
    let served = Served::start();
    let mut page = served.page();
    let first = page.show_small();
    let start = first.number("north");
    let pixels = first.decoded();
    let colours: BTreeSet<_> = pixels.iter().map(|pixel| pixel.map(|part| part / 32)).collect();
    assert!(colours.len() > 20, "{} colours", colours.len());

    page.fly(1.0);
    let mut moved = page.show();
    for _ in 0..500 {
        if moved.number("north") > start + 15.0 {
            break;
        }
        page.fly(1.0);
        moved = page.show();
    }
    assert!(moved.number("north") > start + 15.0 && moved.number("speed_m_s") > 2.0, "{}", moved.head);
    let changed = moved.decoded().iter().zip(&pixels).filter(|(a, b)| a[0].abs_diff(b[0]) > 24).count();
    assert!(changed > 320 * 240 / 50, "{changed} pixels changed");
}

#[test]
fn a_page_that_falls_silent_stands_still() {
    let served = Served::start();
    let mut page = served.page();
    let start = page.show_small().number("north");
    page.fly(1.0);
    page.show_until("motion", |shown| shown.number("speed_m_s") > 5.0);
    let end = page.show_until("rest", |shown| shown.number("speed_m_s") < 0.05).number("north");
    // Half a second of keys at 32 m/s, plus the delays of a busy machine.
    assert!(end > start + 2.0 && end < start + 60.0, "{} m", end - start);
}

#[test]
fn images_do_not_queue_up() {
    let served = Served::start();
    let mut page = served.page();
    let last = page.show_small();
    // Nothing is acknowledged from here on: two images may be in transit, then none, whatever changes.
    for _ in 0..20 {
        page.say(json!({"type": "turn", "yaw_deg": 5, "pitch_deg": 0}));
        std::thread::sleep(Duration::from_millis(50));
    }
    // The answer to this arrives after all images that were sent before it.
    page.say(json!({"type": "craft", "craft": "quad"}));
    let mut images = 0;
    loop {
        match page.0.read().unwrap() {
            Message::Binary(_) => images += 1,
            Message::Text(text) if text.contains(r#""type":"scene""#) && images > 0 => break,
            _ => {}
        }
    }
    assert!((1..=2).contains(&images), "{images} pictures unasked for");
    // The next image after a message from the page is current.
    page.say(json!({"type": "shown", "frame": last.number("frame") as u64 + 2}));
    let now = page.show();
    let turned = (now.number("heading_deg") - last.number("heading_deg")).rem_euclid(360.0);
    assert!((99.0..=101.0).contains(&turned), "{turned}");
}

/// A page that sends faster than anything can be drawn loses messages or its connection; the others see nothing of it.
#[test]
fn a_page_that_floods_holds_nobody_up() {
    let served = Served::start();
    let (mut other, mut flood) = (served.page(), served.page());
    other.show_small();
    flood.0.get_mut().set_write_timeout(Some(Duration::from_secs(5))).unwrap();
    let flooding = std::thread::spawn(move || {
        let turn = json!({"type": "turn", "yaw_deg": 1, "pitch_deg": 0}).to_string();
        // It reads nothing: what it is told about its messages fills the sockets, and then it is disconnected.
        (0..200_000).find(|_| flood.0.send(Message::text(turn.clone())).is_err())
    });
    let begun = Instant::now();
    let mut images = 0;
    while !flooding.is_finished() || images < 3 {
        other.say(json!({"type": "turn", "yaw_deg": 3, "pitch_deg": 0}));
        other.show();
        images += 1;
        assert!(begun.elapsed() < Duration::from_secs(120), "{images} images");
    }
    drop(flooding.join());
}

#[test]
fn every_page_has_a_camera_of_its_own() {
    let served = Served::start();
    let (mut one, mut other) = (served.page(), served.page());
    let pose = json!({"east": 10, "north": -20, "up": 30, "heading_deg": 90, "pitch_deg": -30});
    one.say(json!({"type": "go", "pose": pose}));
    let there = one.show_until("the pose", |shown| shown.number("east") == 10.0);
    assert_eq!((there.number("up"), there.number("heading_deg").round(), there.number("pitch_deg").round()), (30.0, 90.0, -30.0));
    let begun = other.show().number("heading_deg");
    other.say(json!({"type": "turn", "yaw_deg": 5, "pitch_deg": 0}));
    let here = other.show_until("its own turn", |shown| (shown.number("heading_deg") - begun).rem_euclid(360.0).round() == 5.0);
    assert!(here.number("up") < 29.0);
}

#[test]
fn the_pointer_finds_out_what_it_is_on() {
    let served = Served::start();
    let mut page = served.page();
    let crane = CITY.scene.by_key("red_crane").unwrap().bounds;
    // High over the mast, looking nearly straight down.
    let (east, north) = ((crane.min.east + crane.max.east) / 2.0, (crane.min.north + crane.max.north) / 2.0);
    page.say(json!({"type": "go", "pose": {"east": east, "north": north, "up": 90, "heading_deg": 0, "pitch_deg": -85}}));
    page.show_until("the pose", |shown| shown.number("up") == 90.0);
    page.say(json!({"type": "point", "at": [0.5, 0.5]}));
    let shown = page.show_until("something under the pointer", |shown| !shown.head["under"].is_null());
    let under = &shown.head["under"];
    let object = CITY.scene.by_key(under["key"].as_str().unwrap());
    assert!(object.is_some() && under["distance_m"].as_f64().unwrap() > 30.0, "{under}");
    for channel in ["ids", "depth"] {
        page.say(json!({"type": "channel", "channel": channel}));
        let other = page.show_until(channel, |shown| shown.head["channel"] == channel);
        assert_ne!(other.decoded(), shown.decoded());
    }
    page.say(json!({"type": "point", "at": null}));
    page.show_until("nothing under the pointer", |shown| shown.head["under"].is_null());
}

#[test]
fn the_light_changes_where_one_is() {
    let served = Served::start();
    let mut page = served.page();
    let day = page.show_small();
    page.say(json!({"type": "conditions", "light": "night", "weather": null}));
    let told = page.text("scene");
    assert_eq!((&told["light"], &told["weather"]), (&"night".into(), &"clear".into()));
    let before = day.decoded();
    let night = page.show_until("another picture", |shown| {
        let now = shown.decoded();
        let changed = now.iter().zip(&before).filter(|(a, b)| a[1].abs_diff(b[1]) > 40).count();
        changed > 320 * 240 / 4
    });
    assert_eq!(night.number("north"), day.number("north"));
}

#[test]
fn wrong_messages_are_reported_and_change_nothing() {
    let served = Served::start();
    let mut page = served.page();
    let before = page.show_small();
    for (message, reason) in [
        ("{", "EOF"),
        (r#"{"type":"fly"}"#, "missing field"),
        (r#"{"type":"fly","right":9,"forward":0,"up":0,"yaw":0,"pitch":0,"fast":false}"#, "`right` must be from -1 to 1"),
        (r#"{"type":"scene","name":"/etc/passwd"}"#, "unknown scene `/etc/passwd`"),
    ] {
        page.0.send(Message::text(message)).unwrap();
        let error = page.text("refused");
        assert!(error["reason"].as_str().unwrap().contains(reason), "{error}");
    }
    page.0.send(Message::binary(vec![1, 2, 3])).unwrap();
    assert_eq!(page.text("refused")["reason"], "expected a text message");
    page.say(json!({"type": "turn", "yaw_deg": 5, "pitch_deg": 0}));
    let turned = |shown: &Shown| (shown.number("heading_deg") - before.number("heading_deg")).rem_euclid(360.0).round();
    let after = page.show_until("a turn", |shown| turned(shown) == 5.0);
    assert_eq!(after.number("north"), before.number("north"));
    // Longer than any message: it is not read, and the server continues. Images in transit may still arrive.
    drop(page.0.send(Message::text("x".repeat(100_000))));
    for _ in 0..100 {
        let Ok(message) = page.0.read() else { break };
        assert!(!matches!(message, Message::Text(text) if text.contains("refused")), "it was read");
    }
    served.page().show();
}

#[test]
fn strangers_are_refused() {
    let served = Served::start();
    let get = |path: &str| served.http(&format!("GET {path} HTTP/1.1\r\nHost: ADDRESS\r\nConnection: close\r\n\r\n"));
    let page = get("/");
    assert!(page.contains(r#"<canvas id="picture""#) && page.contains("content-security-policy: default-src 'none';"), "{page}");
    // Nothing is loaded from elsewhere; the one address is the name of a vocabulary.
    for path in ["/", "/view.css", "/view.js"] {
        let answer = get(path);
        assert!(answer.starts_with("HTTP/1.1 200"), "{path}: {answer}");
        for (at, _) in answer.match_indices("://").filter(|(at, _)| answer[..*at].ends_with("http")) {
            assert!(answer[at..].starts_with("://www.w3.org/2000/svg"), "{path}: {}", &answer[at - 4..at + 20]);
        }
    }
    let upgrade = "Connection: Upgrade, close\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
                   Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n";
    for (head, status) in [
        ("GET / HTTP/1.1\r\nHost: rebound.example\r\nConnection: close\r\n\r\n".to_owned(), 403),
        (format!("GET /socket HTTP/1.1\r\nHost: ADDRESS\r\nOrigin: https://evil.example\r\n{upgrade}\r\n"), 403),
        (format!("GET /socket HTTP/1.1\r\nHost: rebound.example\r\nOrigin: http://rebound.example\r\n{upgrade}\r\n"), 403),
        ("GET /../Cargo.toml HTTP/1.1\r\nHost: ADDRESS\r\nConnection: close\r\n\r\n".to_owned(), 404),
    ] {
        let answer = served.http(&head);
        assert!(answer.starts_with(&format!("HTTP/1.1 {status}")), "{head}{answer}");
    }
}

#[test]
fn a_ninth_page_is_refused_until_another_leaves() {
    let served = Served::start();
    let mut pages: Vec<Page> = (0..8).map(|_| served.page()).collect();
    let knock = || {
        let request = format!("ws://{}/socket", served.address).into_client_request().unwrap();
        tungstenite::client(request, TcpStream::connect(served.address).unwrap()).is_ok()
    };
    assert!(!knock());
    drop(pages.pop());
    // The server notices it in its own time.
    let let_in = (0..500).any(|_| {
        std::thread::sleep(Duration::from_millis(20));
        knock()
    });
    assert!(let_in);
}

/// A rendering thread outlives its page by an image: unbounded, pages that come and go quickly would fill the memory.
#[test]
#[cfg(target_os = "linux")]
fn pages_that_come_and_go_leave_no_threads_behind() {
    let served = Served::start();
    let renderers = || {
        let tasks = std::fs::read_dir("/proc/self/task").unwrap();
        let names = tasks.filter_map(|task| std::fs::read_to_string(task.unwrap().path().join("comm")).ok());
        names.filter(|name| name.trim_end() == "view").count()
    };
    let mut most = 0;
    for _ in 0..150 {
        let request = format!("ws://{}/socket", served.address).into_client_request().unwrap();
        let stream = TcpStream::connect(served.address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        // Refused while eight pages are open; the next one takes the place of those that have gone.
        if let Ok((mut socket, _)) = tungstenite::client(request, stream) {
            drop(socket.send(Message::text(json!({"type": "detail", "detail": "full"}).to_string())));
        }
        most = most.max(renderers());
    }
    // The other tests of this process have pages too.
    assert!(most < 60, "{most} rendering threads");
    let began = Instant::now();
    let is_served = || served.http("GET / HTTP/1.1\r\nhost: ADDRESS\r\nconnection: close\r\n\r\n").starts_with("HTTP/1.1 200");
    while !is_served() {
        assert!(began.elapsed() < PATIENCE, "the places of pages that have gone stay taken");
        std::thread::sleep(Duration::from_millis(50));
    }
}

#[test]
fn the_end_is_reported_to_pages() {
    let mut served = Served::start();
    let mut page = served.page();
    page.show();
    served.stopper.stop();
    served.thread.take().unwrap().join().unwrap().unwrap();
    let closed = std::iter::from_fn(|| page.0.read().ok()).find_map(|message| match message {
        Message::Close(frame) => frame,
        _ => None,
    });
    assert_eq!(closed.unwrap().reason.as_str(), "server shutting down");
    assert!(TcpStream::connect(served.address).is_err());
}

#[test]
fn a_taken_port_is_an_error_that_names_it() {
    let served = Served::start();
    let error = Viewer::bind(served.address).unwrap_err();
    assert_eq!(error.to_string(), format!("cannot listen on {}", served.address));
}
