//! Frames: packets from a stream of bytes, and the numbering that tells lost and repeated ones.

use std::collections::VecDeque;
use std::io::{ErrorKind, Read};

use core::convert::Infallible;

use mavlink::consts::v2::IFLAG_SIGNED;
use mavlink::dialects::common::MavMessage;
use mavlink::error::ParserError;
use mavlink::{Dialect, MAVLinkMessageRaw, MAVLinkV2MessageRaw, MavlinkReader, MavlinkVersion, Message, calculate_crc};

/// Maximum number of bytes that wait to be decoded; a sender that is faster loses some.
const WAITING: usize = 1 << 16;

/// `EKF_STATUS_REPORT` of the dialect `ardupilotmega`.
pub const EKF_STATUS_REPORT: u32 = 193;
/// `MOUNT_STATUS` of the dialect `ardupilotmega`.
pub const MOUNT_STATUS: u32 = 158;

/// The dialect `common`, and of ArduPilot's the two messages that are read here, from their bytes: the whole of that dialect would
/// double the time for building it.
struct Known;

impl Dialect for Known {
    type Message = MavMessage;
    type EncodeError = Infallible;

    fn message_id(&self, message: &MavMessage) -> u32 {
        message.message_id()
    }

    fn extra_crc(&self, id: u32) -> Option<u8> {
        Some(match id {
            EKF_STATUS_REPORT => 71,
            MOUNT_STATUS => 134,
            _ => MavMessage::extra_crc(id),
        })
    }

    fn decode(&self, version: MavlinkVersion, id: u32, payload: &[u8]) -> Result<MavMessage, ParserError> {
        MavMessage::parse(version, id, payload)
    }

    fn encode(&self, version: MavlinkVersion, message: &MavMessage, payload: &mut [u8]) -> Result<usize, Infallible> {
        Ok(message.ser(version, payload))
    }
}

/// Bytes that have arrived; it never waits for more.
#[derive(Default)]
struct Arrived(VecDeque<u8>);

impl Read for Arrived {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        if self.0.is_empty() { Err(ErrorKind::WouldBlock.into()) } else { self.0.read(buffer) }
    }
}

/// Finds packets of both versions of the protocol in a stream. What lies between them, and what has a wrong checksum, is skipped.
pub struct Decoder {
    reader: MavlinkReader<Arrived>,
}

impl Default for Decoder {
    fn default() -> Self {
        Self { reader: MavlinkReader::new(Arrived::default()) }
    }
}

impl core::fmt::Debug for Decoder {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Decoder").field("waiting", &self.reader.get_ref().0.len()).finish()
    }
}

impl Decoder {
    /// Appends bytes.
    pub fn push(&mut self, bytes: &[u8]) {
        let waiting = &mut self.reader.get_mut().0;
        if waiting.len() + bytes.len() <= WAITING {
            waiting.extend(bytes);
        }
    }

    /// Forgets an incomplete packet: the next bytes do not continue it.
    pub fn clear(&mut self) {
        let arrived = core::mem::take(self.reader.get_mut());
        self.reader = MavlinkReader::new(arrived);
    }

    /// The next complete packet.
    pub fn next_packet(&mut self) -> Option<Packet> {
        let raw = self.reader.read_any_raw_message_with_dialect(&Known).ok()?;
        Some(Packet::of(&raw))
    }
}

/// A packet whose checksum is right.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Packet {
    /// Sending system; zero for one beyond 255, which nothing here speaks to.
    pub system: u8,
    /// Sending component.
    pub component: u8,
    /// Number of the packet, modulo 256.
    pub sequence: u8,
    /// Message number.
    pub id: u32,
    /// Whether it has the format of version 1.
    pub is_v1: bool,
    /// Whether it is signed. The signature is not checked: it speaks of who may command the vehicle, not of what it tells.
    pub is_signed: bool,
    /// Payload, perhaps without zeros at its end.
    pub payload: Vec<u8>,
}

impl Packet {
    fn of(raw: &MAVLinkMessageRaw) -> Self {
        Self {
            system: u8::try_from(raw.system_id()).unwrap_or(0),
            component: raw.component_id(),
            sequence: raw.sequence(),
            id: raw.message_id(),
            is_v1: matches!(raw.version(), MavlinkVersion::V1),
            is_signed: matches!(raw, MAVLinkMessageRaw::V2(raw) if raw.incompatibility_flags() & IFLAG_SIGNED != 0),
            payload: raw.payload().to_vec(),
        }
    }

    /// The message; `None` if a value in it is none that the dialect knows.
    #[must_use]
    pub fn message(&self) -> Option<MavMessage> {
        let version = if self.is_v1 { MavlinkVersion::V1 } else { MavlinkVersion::V2 };
        MavMessage::parse(version, self.id, &self.payload).ok()
    }

    /// Bytes of the payload from an offset on, with the zeros that were cut off.
    #[must_use]
    pub fn bytes<const N: usize>(&self, offset: usize) -> [u8; N] {
        core::array::from_fn(|index| self.payload.get(offset + index).copied().unwrap_or(0))
    }
}

/// The contents of a packet.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Body {
    /// Message number.
    pub id: u32,
    /// Payload.
    pub payload: Vec<u8>,
}

impl From<&MavMessage> for Body {
    fn from(message: &MavMessage) -> Self {
        let mut buffer = [0; 255];
        let length = message.ser(MavlinkVersion::V2, &mut buffer);
        Self { id: message.message_id(), payload: buffer[..length].to_vec() }
    }
}

/// Writes packets of version 2 with the numbers of one component.
#[derive(Clone, Debug)]
pub struct Encoder {
    own: [u8; 2],
    sequence: u8,
}

impl Encoder {
    /// An encoder for this system and component.
    #[must_use]
    pub fn new(own: [u8; 2]) -> Self {
        Self { own, sequence: 0 }
    }

    /// The next packet.
    pub fn frame(&mut self, body: &Body) -> Vec<u8> {
        let [system, component] = self.own;
        let payload = &body.payload[..body.payload.len().min(255)];
        // Zeros at the end are cut off, all but one.
        let length = payload.iter().rposition(|byte| *byte != 0).map_or(1.min(payload.len()), |last| last + 1);
        let [low, middle, high, _] = body.id.to_le_bytes();
        let header = [length as u8, 0, 0, self.sequence, system, component, low, middle, high];
        self.sequence = self.sequence.wrapping_add(1);
        let mut frame = Vec::with_capacity(length + 12);
        frame.push(mavlink::MAV_STX_V2);
        frame.extend(header);
        frame.extend(&payload[..length]);
        let crc = calculate_crc(&frame[1..], Known.extra_crc(body.id).unwrap_or_default());
        frame.extend(crc.to_le_bytes());
        debug_assert!(frame.len() <= MAVLinkV2MessageRaw::new().as_slice().len());
        frame
    }
}

/// What a link has delivered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LinkStats {
    /// Messages of the autopilot.
    pub received: u64,
    /// Messages that are missing, by their numbers.
    pub lost: u64,
    /// Messages that came twice or too late, and were dropped.
    pub repeated: u64,
    /// Whether any of the autopilot's messages was signed.
    pub signed: bool,
    /// Whether another ground station or onboard computer was heard.
    pub other_stations: bool,
}

/// Numbers this far back belong to packets that were overtaken; farther back, the sender has restarted.
const OVERTAKEN: u8 = 127;

/// The order of one sender's packets.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sequence {
    last: Option<u8>,
}

impl Sequence {
    /// Whether a packet is newer than those before it.
    pub fn accept(&mut self, number: u8, stats: &mut LinkStats) -> bool {
        if let Some(last) = self.last {
            let ahead = number.wrapping_sub(last);
            if ahead == 0 || ahead > u8::MAX - OVERTAKEN {
                stats.repeated += 1;
                return false;
            }
            stats.lost += u64::from(ahead - 1);
        }
        self.last = Some(number);
        stats.received += 1;
        true
    }
}

#[cfg(test)]
mod tests;
