//! Who is refused: pages of other sites, names that others control, tokens used before.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;

use serde_json::{Value, json};
use spf_cockpit::Cockpit;

use crate::client::{Line, Socket};
use crate::encrypted;

fn cockpit(address: &str) -> Cockpit {
    Cockpit::open(address.parse().unwrap(), None, Arc::new(|_| {})).unwrap()
}

/// The whole answer to a request with these headers.
fn ask(address: SocketAddr, path: &str, headers: &str) -> String {
    told(TcpStream::connect(address).unwrap(), path, headers)
}

fn told(stream: impl Line, path: &str, headers: &str) -> String {
    answered(stream, "GET", path, headers)
}

pub(crate) fn answered(mut stream: impl Line, method: &str, path: &str, headers: &str) -> String {
    write!(stream, "{method} {path} HTTP/1.1\r\n{headers}\r\n\r\n").unwrap();
    let mut answer = Vec::new();
    // The end of a refused connection comes without a word.
    let _ = stream.read_to_end(&mut answer);
    String::from_utf8(answer).unwrap()
}

#[test]
fn pages_of_other_sites_and_other_names_are_refused_before_anything_else() {
    let cockpit = cockpit("127.0.0.1:0");
    let (address, port) = (cockpit.address(), cockpit.address().port());
    let upgrade =
        "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==";
    for path in ["/control", "/watch"] {
        for head in [
            format!("Host: 127.0.0.1:{port}\r\nOrigin: https://evil.example"),
            format!("Host: 127.0.0.1:{port}\r\nOrigin: http://127.0.0.1:{}", port ^ 1),
            format!("Host: rebound.example:{port}\r\nOrigin: http://rebound.example:{port}"),
        ] {
            let answer = ask(address, path, &format!("{head}\r\n{upgrade}"));
            assert!(answer.starts_with("HTTP/1.1 403"), "{head}: {answer}");
        }
    }
    assert!(ask(address, "/", &format!("Host: rebound.example:{port}")).starts_with("HTTP/1.1 403"));
    let page = ask(address, "/", &format!("Host: 127.0.0.1:{port}"));
    let head = page.split("\r\n\r\n").next().unwrap().to_lowercase();
    assert!(page.starts_with("HTTP/1.1 200") && page.contains("<title>SPF cockpit</title>"));
    for header in
        ["content-security-policy: default-src 'none'", "x-content-type-options: nosniff", "referrer-policy: no-referrer"]
    {
        assert!(head.contains(header), "{head}");
    }
    assert!(!head.contains("unsafe") && !head.contains("access-control"), "{head}");
}

/// The address of a server of all addresses, as seen from here.
fn here(cockpit: &Cockpit) -> SocketAddr {
    SocketAddr::from(([127, 0, 0, 1], cockpit.address().port()))
}

fn opened(cockpit: &Cockpit, path: &str, hello: Value) -> Socket {
    let address = here(cockpit);
    match cockpit.fingerprint() {
        Some(fingerprint) => Socket::over(Box::new(encrypted::connect(address, fingerprint)), address, path, hello),
        None => Socket::open(address, path, hello),
    }
}

/// The first message on the socket of the controls.
fn greeted(cockpit: &Cockpit, hello: Value) -> (Socket, Value) {
    let mut socket = opened(cockpit, "/control", hello);
    let first = socket.wait("a greeting", |message| message["type"] == "welcome" || message["type"] == "refused");
    (socket, first)
}

#[test]
fn elsewhere_a_token_is_needed_and_works_once() {
    let cockpit = cockpit("0.0.0.0:0");
    let (fly, watch) = cockpit.urls();
    assert!(!fly.contains("0.0.0.0"), "{fly} must lead here");
    let token = |url: &str| url.split_once('#').unwrap().1.to_owned();
    assert_eq!(greeted(&cockpit, json!({})).1["type"], "refused");
    assert_eq!(greeted(&cockpit, json!({"token": "00000000000000000000000000000000"})).1["type"], "refused");
    let (_page, welcome) = greeted(&cockpit, json!({"token": token(&fly)}));
    assert!(welcome["session"].is_string());
    let (_other, replayed) = greeted(&cockpit, json!({"token": token(&fly)}));
    assert!(replayed["why"].as_str().unwrap().contains("used already"), "{replayed}");
    let (mut spectator, watching) = greeted(&cockpit, json!({"token": token(&watch)}));
    assert_eq!(watching["session"], Value::Null);
    assert_eq!(spectator.order(json!("land")).0["ok"], json!(false));
    let mut looks = opened(&cockpit, "/watch", json!({}));
    assert_eq!(looks.next().unwrap()["type"], "refused");
    let (address, fingerprint) = (here(&cockpit), cockpit.fingerprint().unwrap());
    let answer = |path: &str, headers: &str| told(encrypted::connect(address, fingerprint), path, headers);
    let refused = answer("/flights.json", &format!("Host: {address}"));
    assert!(refused.starts_with("HTTP/1.1 403"), "{refused}");
}

#[test]
fn elsewhere_everything_is_encrypted_and_the_checks_are_the_same() {
    let cockpit = cockpit("0.0.0.0:0");
    let (address, fingerprint) = (here(&cockpit), cockpit.fingerprint().unwrap());
    let (fly, watch) = cockpit.urls();
    assert!(fly.starts_with("https://") && watch.starts_with("https://") && fingerprint.len() == 95, "{fly} {fingerprint}");
    let plain = ask(address, "/", &format!("Host: {address}"));
    assert!(plain.starts_with("HTTP/1.1 400") && plain.contains("https://") && !plain.contains("<html"), "{plain}");
    let answer = |headers: &str| told(encrypted::connect(address, fingerprint), "/control", headers);
    let upgrade =
        "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==";
    let port = address.port();
    for head in [
        format!("Host: {address}\r\nOrigin: https://evil.example"),
        format!("Host: {address}\r\nOrigin: http://{address}"),
        format!("Host: rebound.example:{port}\r\nOrigin: https://rebound.example:{port}"),
    ] {
        let refused = answer(&format!("{head}\r\n{upgrade}"));
        assert!(refused.starts_with("HTTP/1.1 403"), "{head}: {refused}");
    }
    // Another certificate is noticed by who compares it.
    let other = Cockpit::open("0.0.0.0:0".parse().unwrap(), None, Arc::new(|_| {})).unwrap();
    let mut stream = encrypted::connect(here(&other), fingerprint);
    assert!(stream.write_all(b"GET / HTTP/1.1\r\n\r\n").is_err());
    // On this machine nothing is encrypted: nobody else can listen.
    assert_eq!(self::cockpit("127.0.0.1:0").fingerprint(), None);
}

#[test]
fn whoever_watches_or_says_nothing_leaves_room_for_the_pilot() {
    let cockpit = cockpit("127.0.0.1:0");
    let token = cockpit.urls().0.split_once('#').unwrap().1.to_owned();
    // More than there are places: the oldest that have said nothing make room.
    let upgrade =
        "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==";
    let silent: Vec<TcpStream> = (0..80)
        .map(|_| {
            let mut stream = TcpStream::connect(cockpit.address()).unwrap();
            write!(stream, "GET /watch HTTP/1.1\r\nHost: {}\r\n{upgrade}\r\n\r\n", cockpit.address()).unwrap();
            stream.read_exact(&mut [0; 12]).unwrap();
            stream
        })
        .collect();
    let watching: Vec<(Socket, Socket)> = (0..20)
        .map(|_| {
            let (page, welcome) = greeted(&cockpit, json!({}));
            assert_eq!(welcome["type"], "welcome");
            let mut looks = opened(&cockpit, "/watch", json!({}));
            assert_eq!(looks.next().unwrap()["type"], "path");
            (page, looks)
        })
        .collect();
    let (_page, refused) = greeted(&cockpit, json!({}));
    assert!(refused["why"].as_str().unwrap().contains("watching already"), "{refused}");
    assert_eq!(opened(&cockpit, "/watch", json!({})).next().unwrap()["type"], "refused");
    let (mut page, welcome) = greeted(&cockpit, json!({"token": token}));
    let mut looks = opened(&cockpit, "/watch", json!({"session": welcome["session"]}));
    assert_eq!(looks.next().unwrap()["type"], "path");
    assert_eq!(page.order(json!("hold")).0["text"], "no flight is under way");
    drop((silent, watching));
}

#[test]
fn nonsense_ends_nothing_but_its_own_connection() {
    let cockpit = cockpit("127.0.0.1:0");
    let token = cockpit.urls().0.split_once('#').unwrap().1.to_owned();
    let (mut page, _) = greeted(&cockpit, json!({"token": token}));
    for nonsense in
        [json!(7), json!({"order": {"id": 1, "do": "dance"}}), json!({"order": {"id": 1, "do": {"fly": {"right": 9}}}})]
    {
        page.say(&nonsense);
        page.wait("a refusal", |message| message["type"] == "error");
    }
    assert_eq!(page.order(json!("hold")).0["text"], "no flight is under way");
    // A flood of orders is refused, but orders to stop are still looked at.
    for _ in 0..80 {
        page.order(json!("resume"));
    }
    assert_eq!(page.order(json!("resume")).0["text"], "too many orders within a second");
    assert_eq!(page.order(json!("hold")).0["text"], "no flight is under way");
}
