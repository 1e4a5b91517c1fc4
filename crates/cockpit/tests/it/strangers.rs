//! Who is refused: pages of other sites, names that others control, tokens used before.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;

use serde_json::{Value, json};
use spf_cockpit::Cockpit;

use crate::client::Socket;

fn cockpit(address: &str) -> Cockpit {
    Cockpit::open(address.parse().unwrap(), None, Arc::new(|_| {})).unwrap()
}

/// The whole answer to a request with these headers.
fn ask(address: SocketAddr, path: &str, headers: &str) -> String {
    let mut stream = TcpStream::connect(address).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\n{headers}\r\n\r\n").unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    answer
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

/// The first message on the socket of the controls.
fn greeted(cockpit: &Cockpit, hello: Value) -> (Socket, Value) {
    let address = SocketAddr::from(([127, 0, 0, 1], cockpit.address().port()));
    let mut socket = Socket::open(address, "/control", hello);
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
    let address = SocketAddr::from(([127, 0, 0, 1], cockpit.address().port()));
    let mut looks = Socket::open(address, "/watch", json!({}));
    assert_eq!(looks.next().unwrap()["type"], "refused");
    let answer = ask(address, "/flights.json", &format!("Host: {address}"));
    assert!(answer.starts_with("HTTP/1.1 403"), "{answer}");
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
