//! The part of Foxglove's WebSocket protocol for publishing topics: subprotocols `foxglove.sdk.v1` and
//! `foxglove.websocket.v1`, which do not differ in it (the protocol's `spec.md`, "server info", "advertise",
//! "subscribe", "message data", "status").

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use bytes::{BufMut, Bytes, BytesMut};
use serde::{Deserialize, Serialize};

use crate::log::{Message, Topic};

/// Supported subprotocols, best first.
pub(super) const SUBPROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];

/// First byte of a message of a topic.
const MESSAGE_DATA: u8 = 1;
/// Status level of a warning.
const WARNING: u8 = 1;

/// A viewer's request.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(tag = "op", rename_all = "camelCase")]
pub(super) enum Request {
    /// Subscribe to channels.
    Subscribe {
        /// The subscriptions.
        subscriptions: Vec<Subscription>,
    },
    /// Cancel subscriptions.
    #[serde(rename_all = "camelCase")]
    Unsubscribe {
        /// Their ids.
        subscription_ids: Vec<u32>,
    },
    /// A request that this server ignores.
    #[serde(other)]
    Other,
}

/// A subscription to a channel, with an id chosen by the viewer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Subscription {
    pub(super) id: u32,
    pub(super) channel_id: u64,
}

#[derive(Serialize)]
#[serde(tag = "op", rename_all = "camelCase")]
enum ServerMessage<'a> {
    #[serde(rename_all = "camelCase")]
    ServerInfo {
        name: &'a str,
        capabilities: [&'a str; 0],
        session_id: String,
    },
    Advertise {
        channels: Vec<Channel<'a>>,
    },
    Status {
        level: u8,
        message: String,
    },
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Channel<'a> {
    id: u64,
    topic: &'a str,
    encoding: &'a str,
    schema_name: &'a str,
    schema_encoding: &'a str,
    schema: String,
}

/// The server's first message.
pub(super) fn greeting(name: &str) -> String {
    // One session per flight: a viewer that reconnects to another process starts anew.
    text(&ServerMessage::ServerInfo { name, capabilities: [], session_id: std::process::id().to_string() })
}

/// The topics as channels, each with its index as id.
pub(super) fn advertisement(topics: &[Topic]) -> String {
    let channel = |(id, topic): (usize, &'_ Topic)| {
        let schema = match topic.schema_encoding {
            "protobuf" => STANDARD.encode(&topic.definition),
            _ => String::from_utf8_lossy(&topic.definition).into_owned(),
        };
        (id as u64, schema)
    };
    let schemas: Vec<(u64, String)> = topics.iter().enumerate().map(channel).collect();
    let channels = topics.iter().zip(schemas).map(|(topic, (id, schema))| Channel {
        id,
        topic: topic.name,
        encoding: topic.encoding,
        schema_name: &topic.schema,
        schema_encoding: topic.schema_encoding,
        schema,
    });
    text(&ServerMessage::Advertise { channels: channels.collect() })
}

/// A status about dropped messages.
pub(super) fn left_out(messages: u64) -> String {
    text(&ServerMessage::Status { level: WARNING, message: format!("{messages} messages were dropped: this viewer is too slow") })
}

/// A message for a subscription.
pub(super) fn message(subscription: u32, message: &Message) -> Bytes {
    let mut frame = BytesMut::with_capacity(13 + message.data.len());
    frame.put_u8(MESSAGE_DATA);
    frame.put_u32_le(subscription);
    frame.put_u64_le(message.time.as_nanos());
    frame.put_slice(&message.data);
    frame.freeze()
}

fn text(message: &ServerMessage<'_>) -> String {
    // Plain structs always have a JSON form.
    serde_json::to_string(message).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use spf_core::time::Time;

    #[test]
    fn requests_are_read() {
        let read = |text: &str| serde_json::from_str::<Request>(text).unwrap();
        let wanted = Request::Subscribe { subscriptions: vec![Subscription { id: 3, channel_id: 7 }] };
        assert_eq!(read(r#"{"op":"subscribe","subscriptions":[{"id":3,"channelId":7}]}"#), wanted);
        assert_eq!(read(r#"{"op":"unsubscribe","subscriptionIds":[3]}"#), Request::Unsubscribe { subscription_ids: vec![3] });
        assert_eq!(read(r#"{"op":"getParameters","parameterNames":[]}"#), Request::Other);
        assert!(serde_json::from_str::<Request>("{}").is_err());
    }

    #[test]
    fn a_message_is_its_subscription_time_and_data() {
        let data = message(0x0102, &Message { topic: 0, time: Time::from_nanos(5), data: Bytes::from_static(b"xy") });
        assert_eq!(&data[..], [1, 2, 1, 0, 0, 5, 0, 0, 0, 0, 0, 0, 0, b'x', b'y']);
    }

    #[test]
    fn greeting_and_status_are_in_the_protocols_words() {
        assert!(greeting("spf").starts_with(r#"{"op":"serverInfo","name":"spf","capabilities":[],"sessionId":""#));
        assert!(left_out(4).starts_with(r#"{"op":"status","level":1,"message":"4 messages"#));
    }
}
