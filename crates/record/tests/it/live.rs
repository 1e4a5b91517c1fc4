//! A live view from the viewers' side, fast ones and stuck ones.

use std::net::TcpStream;
use std::time::{Duration, Instant};

use schemars::JsonSchema;
use serde_json::{Value, json};
use spf_core::time::Time;
use spf_record::live::Live;
use spf_record::log::{Message, Topic, foxglove};
use tungstenite::client::IntoClientRequest;
use tungstenite::http::HeaderValue;
use tungstenite::{Message as Frame, WebSocket};

#[derive(JsonSchema)]
#[allow(dead_code, reason = "only its schema is used")]
struct Row {
    /// A number.
    number: u32,
}

fn live() -> Live {
    let topics = vec![Topic::of_json::<Row>("/row", "test.Row"), Topic::of_foxglove::<foxglove::CompressedImage>("/image")];
    Live::bind("127.0.0.1:0".parse().unwrap(), "test", topics, &[]).unwrap()
}

fn message(topic: usize, number: u64, size: usize) -> Message {
    Message { topic, time: Time::from_millis(number), data: vec![number as u8; size].into() }
}

/// A viewer that waits at most a minute for anything.
struct Viewer(WebSocket<TcpStream>);

impl Viewer {
    fn connect(live: &Live, protocols: &'static str) -> Option<Self> {
        let stream = TcpStream::connect(live.address()).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        let mut request = format!("ws://{}/", live.address()).into_client_request().unwrap();
        request.headers_mut().insert("Sec-WebSocket-Protocol", HeaderValue::from_static(protocols));
        tungstenite::client(request, stream).ok().map(|(socket, _)| Self(socket))
    }

    fn subscribed(live: &Live, channels: &[u64]) -> Self {
        let mut viewer = Self::connect(live, "foxglove.sdk.v1").unwrap();
        assert_eq!(viewer.told()["op"], "serverInfo");
        assert_eq!(viewer.told()["op"], "advertise");
        let wanted: Vec<Value> = channels.iter().map(|id| json!({"id": 100 + id, "channelId": id})).collect();
        viewer.0.send(Frame::text(json!({"op": "subscribe", "subscriptions": wanted}).to_string())).unwrap();
        viewer
    }

    /// The next words.
    fn told(&mut self) -> Value {
        loop {
            if let Frame::Text(text) = self.0.read().unwrap() {
                return serde_json::from_str(&text).unwrap();
            }
        }
    }

    /// The next message: subscription, time, data. Text messages in between are skipped.
    fn shown(&mut self) -> Option<(u32, u64, Vec<u8>)> {
        loop {
            match self.0.read().ok()? {
                Frame::Binary(frame) => {
                    assert_eq!(frame[0], 1);
                    let id = u32::from_le_bytes(frame[1..5].try_into().unwrap());
                    return Some((id, u64::from_le_bytes(frame[5..13].try_into().unwrap()), frame[13..].to_vec()));
                }
                Frame::Close(_) => return None,
                _ => {}
            }
        }
    }
}

#[test]
fn a_viewer_receives_the_topics_and_what_it_subscribes_to() {
    let live = live();
    let sender = live.sender();
    // Before any viewer connects: a viewer starts with the latest message of a topic.
    sender.send(&message(0, 1, 3));
    sender.send(&message(0, 2, 3));
    let mut viewer = Viewer::connect(&live, "somebody.else.v7, foxglove.websocket.v1").unwrap();
    assert_eq!(viewer.told()["name"], "test");
    let channels = viewer.told()["channels"].clone();
    assert_eq!((&channels[0]["topic"], &channels[0]["schemaEncoding"]), (&json!("/row"), &json!("jsonschema")));
    assert_eq!((&channels[1]["schemaName"], &channels[1]["encoding"]), (&json!("foxglove.CompressedImage"), &json!("protobuf")));
    assert!(channels[1]["schema"].as_str().unwrap().len() > 100);
    let wish = json!({"op": "subscribe", "subscriptions": [{"id": 9, "channelId": 0}, {"id": 10, "channelId": 77}]});
    viewer.0.send(Frame::text("no JSON")).unwrap();
    viewer.0.send(Frame::text(wish.to_string())).unwrap();
    assert_eq!(viewer.shown(), Some((9, 2_000_000, vec![2; 3])));
    sender.send(&message(1, 3, 3));
    sender.send(&message(0, 4, 5));
    assert_eq!(viewer.shown(), Some((9, 4_000_000, vec![4; 5])), "it did not want the pictures");
    drop(live);
    assert_eq!(viewer.shown(), None, "the flight is over");
}

#[test]
fn who_speaks_another_protocol_is_turned_away() {
    assert!(Viewer::connect(&live(), "chat").is_none());
}

/// A hundred megabytes are sent while one viewer reads nothing: the sender is not delayed, and another viewer receives
/// everything.
#[test]
fn a_stuck_viewer_holds_nobody_up() {
    let live = live();
    let sender = live.sender();
    sender.send(&message(1, 0, 10));
    let mut stuck = Viewer::subscribed(&live, &[1]);
    let mut quick = Viewer::subscribed(&live, &[0, 1]);
    // Both are known to be subscribed by their first message; from then on one of them reads nothing.
    assert_eq!(stuck.shown().unwrap().1, 0);
    assert_eq!(quick.shown().unwrap().1, 0);
    let reading = std::thread::spawn(move || {
        let mut images = 0;
        loop {
            let (id, time, data) = quick.shown().expect("it is not let go");
            if id == 100 {
                assert_eq!((time, data.len()), (3_000_000_000, 7));
                return images;
            }
            images += 1;
        }
    });
    for number in 1..=2000 {
        sender.send(&message(1, number, 50_000));
    }
    let begun = Instant::now();
    // The last message is repeated until it was received: the fast one may have missed some too.
    while !reading.is_finished() && begun.elapsed() < Duration::from_secs(60) {
        sender.send(&message(0, 3000, 7));
        std::thread::sleep(Duration::from_millis(20));
    }
    assert!(reading.join().unwrap() > 0, "it saw pictures while the other one was stuck");
    // The stuck one has received what fitted into its queue and the sockets: the rest was dropped.
    drop(live);
    let mut images = 0;
    while stuck.shown().is_some() {
        images += 1;
    }
    assert!(images < 2000, "somebody waited for it");
}
