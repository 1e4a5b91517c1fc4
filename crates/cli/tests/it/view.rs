//! `spf sim view`: the page in a real browser, and its end.

use std::io::{BufRead, BufReader};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket};

use crate::harness::{Lab, skip};

/// The command while it serves.
struct View {
    child: Child,
    url: String,
}

impl View {
    fn start(lab: &Lab) -> Self {
        let mut child = lab.command(&["sim", "view"]).spawn().unwrap();
        let mut url = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut url).unwrap();
        Self { child, url: url.trim_end().to_owned() }
    }

    fn address(&self) -> String {
        self.url
            .strip_prefix("http://")
            .and_then(|rest| rest.strip_suffix('/'))
            .unwrap_or_else(|| panic!("{}", self.url))
            .to_owned()
    }

    #[cfg(unix)]
    fn interrupt(&mut self) -> Option<i32> {
        let line = format!("kill -INT {}", self.child.id());
        assert!(Command::new("sh").args(["-c", &line]).status().unwrap().success());
        self.child.wait().unwrap().code()
    }
}

impl Drop for View {
    fn drop(&mut self) {
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_it_and_frees_the_port() {
    let lab = Lab::new();
    let mut view = View::start(&lab);
    let address = view.address();
    let (mut page, _) = tungstenite::connect(format!("ws://{address}/socket")).unwrap();
    assert!(page.read().unwrap().into_text().unwrap().contains("hello"));
    assert_eq!(view.interrupt(), Some(0));
    assert!(TcpStream::connect(&address).is_err());
}

/// A headless browser, controlled over its debugging protocol.
pub(crate) struct Browser {
    child: Child,
    socket: WebSocket<MaybeTlsStream<TcpStream>>,
    session: Option<String>,
    calls: u64,
    /// Complaints of the page's script and the browser.
    pub(crate) complaints: Vec<Value>,
}

impl Browser {
    /// `None` if there is none.
    pub(crate) fn start(lab: &Lab) -> Option<Self> {
        let child = ["chromium", "chromium-browser", "google-chrome"].into_iter().find_map(|program| {
            let profile = format!("--user-data-dir={}", lab.path("profile").display());
            // Without a sandbox, for tests run as root in containers; it opens no page but ours.
            let args = ["--headless=new", "--no-sandbox", "--disable-gpu", "--remote-debugging-port=0", "--window-size=1200,800"];
            // A name that others may point at this machine.
            let rebound = "--host-resolver-rules=MAP rebound.example 127.0.0.1";
            let mut command = Command::new(program);
            command
                .args(args)
                .args([&profile, rebound])
                .env("HOME", lab.path("home"))
                .stdout(Stdio::null())
                .stderr(Stdio::piped());
            command.spawn().ok()
        });
        let mut child = child?;
        let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
        let message = lines.find_map(|line| line.unwrap().strip_prefix("DevTools listening on ").map(str::to_owned));
        // It keeps printing; a full pipe would stop it.
        std::thread::spawn(move || lines.for_each(drop));
        let (socket, _) = tungstenite::connect(message.expect("the browser tells where it listens")).unwrap();
        Some(Self { child, socket, session: None, calls: 0, complaints: Vec::new() })
    }

    pub(crate) fn open(&mut self, url: &str) {
        let target = self.call("Target.createTarget", json!({"url": "about:blank"}))["targetId"].clone();
        let attached = self.call("Target.attachToTarget", json!({"targetId": target, "flatten": true}));
        self.session = Some(attached["sessionId"].as_str().unwrap().to_owned());
        self.call("Runtime.enable", json!({}));
        self.call("Log.enable", json!({}));
        self.call("Page.navigate", json!({"url": url}));
    }

    fn call(&mut self, method: &str, params: Value) -> Value {
        self.calls += 1;
        let mut message = json!({"id": self.calls, "method": method, "params": params});
        if let Some(session) = &self.session {
            message["sessionId"] = session.as_str().into();
        }
        self.socket.send(Message::text(message.to_string())).unwrap();
        loop {
            let Message::Text(text) = self.socket.read().unwrap() else { continue };
            let mut answer: Value = serde_json::from_str(&text).unwrap();
            if answer["id"] == self.calls {
                assert!(answer.get("error").is_none(), "{method}: {answer}");
                return answer["result"].take();
            }
            let method = answer["method"].as_str().unwrap_or_default();
            if method == "Runtime.exceptionThrown"
                || (method == "Log.entryAdded" && answer["params"]["entry"]["level"] == "error")
            {
                self.complaints.push(answer);
            }
        }
    }

    pub(crate) fn evaluate(&mut self, expression: &str) -> Value {
        self.call("Runtime.evaluate", json!({"expression": expression, "returnByValue": true}))["result"]["value"].take()
    }

    pub(crate) fn until(&mut self, expression: &str) {
        let begun = Instant::now();
        while self.evaluate(expression) != true {
            assert!(begun.elapsed() < Duration::from_secs(120), "never: {expression}; {:?}", self.complaints);
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    fn key(&mut self, what: &str, code: &str) {
        self.call("Input.dispatchKeyEvent", json!({"type": what, "code": code, "key": code}));
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

#[test]
#[ignore = "long: .ci/interop runs it"]
fn a_browser_shows_the_city_and_flies() {
    let lab = Lab::new();
    let Some(mut browser) = Browser::start(&lab) else { return skip("chromium") };
    let view = View::start(&lab);
    browser.open(&view.url);
    browser.until("Number(document.getElementById('picture')?.dataset.frame) > 0");
    assert_eq!(browser.evaluate("document.getElementById('scene-title').textContent"), "city");

    browser.key("keyDown", "KeyW");
    browser.until("parseFloat(document.getElementById('north').textContent) > 3");
    browser.key("keyUp", "KeyW");
    browser.until("parseFloat(document.getElementById('speed').textContent) === 0");
    browser.key("keyDown", "Digit2");
    browser.key("keyUp", "Digit2");
    browser.until("head.channel === 'ids'");
    let middle = json!({"type": "mouseMoved", "x": 600, "y": 400});
    browser.call("Input.dispatchMouseEvent", middle);
    browser.until("document.getElementById('under-words').textContent.length > 2");
    browser.key("keyDown", "Digit1");
    browser.until("head.channel === 'colour' && picture.width === 960");

    // The screen content: large, with many colours.
    let wide = browser.evaluate("document.getElementById('picture').getBoundingClientRect().width");
    let colours = browser.evaluate(
        "(() => { const found = new Set(), { data } = paint.getImageData(0, 0, 960, 720); \
         for (let at = 0; at < data.length; at += 4) found.add(`${data[at] >> 4} ${data[at + 1] >> 4} ${data[at + 2] >> 4}`); \
         return found.size; })()",
    );
    assert!(wide.as_f64().unwrap() > 600.0 && colours.as_u64().unwrap() > 60, "{wide} pixels wide, {colours} colours");
    assert!(browser.complaints.is_empty(), "{:?}", browser.complaints);
}
