//! H.264 from an MPEG transport stream (ISO/IEC 13818-1), by the crate `mpeg2ts-reader`. No I/O.

use mpeg2ts_reader::StreamType;
use mpeg2ts_reader::demultiplex::{self, Demultiplex, DemuxContext, FilterRequest, PacketFilter};
use mpeg2ts_reader::packet::{Packet, Pid};
use mpeg2ts_reader::pes::{self, PesContents, PtsDts};
use spf_core::time::{Duration, Time};
use spf_drone::frames::VideoStats;
use spf_media::h264::{AccessUnit, nal_units};

use crate::unit::{LONGEST_UNIT, UnitBuilder};

/// A video stream that is silent for this long, while others of the transport stream are not, is given up for another one.
const SILENCE: Duration = Duration::from_secs(2);
/// Kinds of streams that are remembered although they are not read.
const MOST_OTHER: usize = 8;
/// Packets one behind the other by which a stream counts as found (ETSI TR 101 290, 5.2.1).
const IN_A_ROW: u32 = 5;
/// A pause of the whole transport stream, which is nobody's silence.
const PAUSE: Duration = Duration::from_millis(500);

/// A received access unit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TimedUnit {
    /// Arrival of its last packet.
    pub at: Time,
    /// Its presentation time stamp, 1/90000 s, 33 bits.
    pub timestamp: Option<u64>,
    /// The unit.
    pub unit: AccessUnit,
}

/// What is done with the packets of a stream, as the crate's macro `packet_filter_switch` would write it, but private.
enum Filter {
    Video(pes::PesPacketFilter<Context, VideoStream>),
    Programs(demultiplex::PatPacketFilter<Context>),
    Streams(demultiplex::PmtPacketFilter<Context>),
    Ignored,
}

impl PacketFilter for Filter {
    type Ctx = Context;

    fn consume(&mut self, context: &mut Context, packet: &Packet<'_>) {
        match self {
            Self::Video(filter) => filter.consume(context, packet),
            Self::Programs(filter) => filter.consume(context, packet),
            Self::Streams(filter) => filter.consume(context, packet),
            Self::Ignored => {}
        }
    }
}

/// What the streams share.
struct Context {
    changeset: demultiplex::FilterChangeset<Filter>,
    now: Time,
    builder: UnitBuilder,
    units: Vec<TimedUnit>,
    /// Kinds of the streams that are not read.
    other: Vec<u8>,
    /// The stream that is read: the first one with H.264.
    video: Option<Pid>,
    /// Arrival of its last packet.
    heard: Time,
    /// A stream that was given up, as long as another one is looked for.
    given_up: Option<Pid>,
}

impl DemuxContext for Context {
    type F = Filter;

    fn filter_changeset(&mut self) -> &mut demultiplex::FilterChangeset<Filter> {
        &mut self.changeset
    }

    fn construct(&mut self, request: FilterRequest<'_, '_>) -> Filter {
        match request {
            FilterRequest::ByPid(mpeg2ts_reader::psi::pat::PAT_PID) => Filter::Programs(demultiplex::PatPacketFilter::default()),
            FilterRequest::Pmt { pid, program_number } => Filter::Streams(demultiplex::PmtPacketFilter::new(pid, program_number)),
            FilterRequest::ByStream { stream_type: StreamType::H264, stream_info, .. } => {
                let pid = stream_info.elementary_pid();
                match self.video {
                    None if self.given_up == Some(pid) => return Filter::Ignored,
                    None => self.video = Some(pid),
                    // A new version of the table: the filter takes the place of one whose unit was not complete.
                    Some(video) if video == pid => self.builder.lost(),
                    Some(_) => return Filter::Ignored,
                }
                Filter::Video(pes::PesPacketFilter::new(VideoStream::default()))
            }
            FilterRequest::ByStream { stream_type, .. } => {
                let kind = u8::from(stream_type);
                if self.other.len() < MOST_OTHER && !self.other.contains(&kind) {
                    self.other.push(kind);
                }
                Filter::Ignored
            }
            _ => Filter::Ignored,
        }
    }
}

/// A packetized elementary stream with video.
#[derive(Default)]
struct VideoStream {
    open: Option<Open>,
}

/// A packet of the elementary stream, which is an access unit: every muxer for transmission makes them so.
struct Open {
    timestamp: Option<u64>,
    at: Time,
    bytes: Vec<u8>,
}

impl VideoStream {
    fn end(&mut self, context: &mut Context) {
        let Some(Open { timestamp, at, bytes }) = self.open.take() else { return };
        nal_units(&bytes).for_each(|nal| context.builder.nal(nal));
        if let Some(unit) = context.builder.end() {
            context.units.push(TimedUnit { at, timestamp, unit });
        }
    }
}

impl pes::ElementaryStreamConsumer<Context> for VideoStream {
    fn start_stream(&mut self, _: &mut Context) {}

    fn begin_packet(&mut self, context: &mut Context, header: pes::PesHeader<'_>) {
        context.heard = context.now;
        self.end(context);
        let (payload, timestamp) = match header.contents() {
            PesContents::Parsed(Some(parsed)) => {
                let timestamp = match parsed.pts_dts() {
                    Ok(PtsDts::PtsOnly(Ok(time)) | PtsDts::Both { pts: Ok(time), .. }) => Some(time.value()),
                    _ => None,
                };
                (parsed.payload(), timestamp)
            }
            PesContents::Parsed(None) => return context.builder.lost(),
            PesContents::Payload(payload) => (payload, None),
        };
        self.open = Some(Open { timestamp, at: context.now, bytes: payload.to_vec() });
    }

    fn continue_packet(&mut self, context: &mut Context, data: &[u8]) {
        context.heard = context.now;
        let Some(open) = &mut self.open else { return };
        if open.bytes.len() + data.len() > LONGEST_UNIT {
            self.open = None;
            return context.builder.lost();
        }
        open.at = context.now;
        open.bytes.extend_from_slice(data);
    }

    fn end_packet(&mut self, context: &mut Context) {
        self.end(context);
    }

    fn continuity_error(&mut self, context: &mut Context) {
        self.open = None;
        context.builder.lost();
    }
}

/// Receives the first H.264 stream of a transport stream.
///
/// The length of a unit is not transmitted, so that it comes out only when the next one begins; its arrival is that of its
/// own last packet.
pub struct TsReceiver {
    demultiplex: Demultiplex<Context>,
    context: Context,
    /// Bytes of a packet that is not complete.
    rest: Vec<u8>,
    /// Bytes that belong to no packet.
    garbage: u64,
    /// Packets since the last of these.
    in_a_row: u32,
    found: bool,
}

impl Default for TsReceiver {
    fn default() -> Self {
        let mut context = Context {
            changeset: demultiplex::FilterChangeset::default(),
            now: Time::ZERO,
            builder: UnitBuilder::default(),
            units: Vec::new(),
            other: Vec::new(),
            video: None,
            heard: Time::ZERO,
            given_up: None,
        };
        Self { demultiplex: Demultiplex::new(&mut context), context, rest: Vec::new(), garbage: 0, in_a_row: 0, found: false }
    }
}

impl TsReceiver {
    /// Takes bytes, in pieces of any length, that arrived at `now`; appends the access units that they complete.
    pub fn push(&mut self, now: Time, bytes: &[u8], units: &mut Vec<TimedUnit>) {
        if now.since(self.context.now) > PAUSE {
            self.context.heard = now;
        }
        self.context.now = now;
        let has_chosen = self.context.video.is_some() || self.context.given_up.is_some();
        if has_chosen && now.since(self.context.heard) > SILENCE {
            self.choose_again();
        }
        self.rest.extend_from_slice(bytes);
        let mut at = 0;
        while let Some(packet) = self.rest.get(at..at + Packet::SIZE) {
            if packet[0] == Packet::SYNC_BYTE {
                // One at a time: after an invalid packet the crate ignores the others of a buffer.
                self.demultiplex.push(&mut self.context, packet);
                at += Packet::SIZE;
                self.in_a_row = self.in_a_row.saturating_add(1);
                self.found |= self.in_a_row >= IN_A_ROW;
            } else {
                at += 1;
                self.garbage += 1;
                self.in_a_row = 0;
            }
        }
        self.rest.drain(..at);
        units.append(&mut self.context.units);
    }

    /// Reads the tables anew: a program may move its video to another stream. The silent one is passed over once.
    fn choose_again(&mut self) {
        let silent = self.context.video.take();
        self.context.given_up = silent.filter(|_| self.context.given_up.is_none());
        self.context.builder.lost();
        self.context.heard = self.context.now;
        self.demultiplex = Demultiplex::new(&mut self.context);
    }

    /// Losses so far.
    #[must_use]
    pub fn tally(&self) -> VideoStats {
        let tally = self.context.builder.tally();
        VideoStats { damaged: tally.damaged + self.garbage.div_ceil(Packet::SIZE as u64), ..tally }
    }

    /// Whether the stream has video in H.265 and none in H.264.
    #[must_use]
    pub fn is_h265(&self) -> bool {
        self.context.other.contains(&u8::from(StreamType::H265)) && self.context.video.is_none()
    }

    /// Whether a decoder could be set up: parameter sets have come.
    #[must_use]
    pub fn has_parameters(&self) -> bool {
        self.context.builder.has_parameters()
    }

    /// Whether a transport stream was found, wherever its packets begin.
    #[must_use]
    pub fn makes_sense(&self) -> bool {
        self.found || self.has_video() || !self.context.other.is_empty()
    }

    /// Whether the tables name a stream with H.264.
    #[must_use]
    pub fn has_video(&self) -> bool {
        self.context.video.is_some()
    }

    /// Kinds of the streams that are not read (ISO/IEC 13818-1, table 2-34).
    #[must_use]
    pub fn other_streams(&self) -> &[u8] {
        &self.context.other
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::units;

    /// CRC-32 of program tables (ISO/IEC 13818-1, annex A).
    fn crc(bytes: &[u8]) -> u32 {
        bytes.iter().fold(u32::MAX, |crc, byte| {
            (0..8).fold(crc ^ u32::from(*byte) << 24, |crc, _| if crc >> 31 == 1 { crc << 1 ^ 0x04c1_1db7 } else { crc << 1 })
        })
    }

    /// A muxer with one video stream, or two.
    #[derive(Default)]
    struct Muxer {
        counters: [u8; 4],
        /// Version of the tables.
        version: u8,
        bytes: Vec<u8>,
    }

    const PIDS: [u16; 4] = [0, 0x100, 0x101, 0x102];

    impl Muxer {
        /// Payload in packets of the stream's; the last is filled by an adaptation field.
        fn packets(&mut self, stream: usize, mut payload: &[u8]) {
            let mut starts = 0x40;
            while !payload.is_empty() {
                let (piece, rest) = payload.split_at(payload.len().min(184));
                let stuffing = 184 - piece.len();
                let [high, low] = PIDS[stream].to_be_bytes();
                let adapted = if stuffing > 0 { 0x30 } else { 0x10 };
                self.bytes.extend([0x47, starts | high, low, adapted | self.counters[stream]]);
                if stuffing > 0 {
                    self.bytes.push(stuffing as u8 - 1);
                    if stuffing > 1 {
                        self.bytes.push(0);
                        self.bytes.extend(vec![0xff; stuffing - 2]);
                    }
                }
                self.bytes.extend(piece);
                self.counters[stream] = (self.counters[stream] + 1) % 16;
                (payload, starts) = (rest, 0);
            }
        }

        fn table(&mut self, stream: usize, id: u8, body: &[u8]) {
            let length = 0xb000 | (5 + body.len() as u16 + 4);
            let mut section = vec![id];
            section.extend(length.to_be_bytes());
            section.extend([0, 1, 0xc1 | self.version << 1, 0, 0]);
            section.extend(body);
            section.extend(crc(&section).to_be_bytes());
            let mut payload = vec![0];
            payload.extend(section);
            payload.resize(184, 0xff);
            self.packets(stream, &payload);
        }

        /// Tables of the streams from 2 on, which are of these kinds.
        fn tables(&mut self, kinds: &[u8]) {
            self.table(0, 0, &[0, 1, 0xe1, 0x00]);
            let mut body = vec![0xe1, 0x01, 0xf0, 0];
            kinds.iter().zip(1..).for_each(|(kind, pid)| body.extend([*kind, 0xe1, pid, 0xf0, 0]));
            self.table(1, 2, &body);
        }

        fn unit(&mut self, stream: usize, timestamp: u64, annex_b: &[u8]) {
            let time = [
                0x21 | ((timestamp >> 29) as u8 & 0x0e),
                (timestamp >> 22) as u8,
                (timestamp >> 14) as u8 | 1,
                (timestamp >> 7) as u8,
                (timestamp << 1) as u8 | 1,
            ];
            let payload = [&[0, 0, 1, 0xe0, 0, 0, 0x80, 0x80, 5][..], &time, annex_b].concat();
            self.packets(stream, &payload);
        }
    }

    fn stream(units: &[AccessUnit], kind: u8) -> Vec<u8> {
        let mut muxer = Muxer::default();
        for (number, unit) in units.iter().enumerate() {
            if number % 5 == 0 {
                muxer.tables(&[kind]);
            }
            muxer.unit(2, 9000 * number as u64 + (1 << 32), &unit.annex_b);
        }
        muxer.bytes
    }

    fn receive(receiver: &mut TsReceiver, bytes: &[u8], size: usize) -> Vec<TimedUnit> {
        let mut units = Vec::new();
        bytes.chunks(size).for_each(|bytes| receiver.push(Time::ZERO, bytes, &mut units));
        units
    }

    #[test]
    fn a_stream_comes_back_whatever_its_pieces() {
        let sent = units(128, 96, 12, 0.5);
        let bytes = stream(&sent, 0x1b);
        for size in [1, 187, 188, 1316, bytes.len()] {
            let came = receive(&mut TsReceiver::default(), &bytes, size);
            assert_eq!(came.iter().map(|came| &came.unit).collect::<Vec<_>>(), sent[..11].iter().collect::<Vec<_>>());
            assert_eq!(came[3].timestamp, Some(27_000 + (1 << 32)));
        }
    }

    #[test]
    fn each_lost_packet_costs_the_rest_of_its_group_and_no_more() {
        let sent = units(128, 96, 20, 0.5);
        let bytes = stream(&sent, 0x1b);
        for lost in 2..bytes.len() / 188 {
            let damaged = [&bytes[..188 * lost], &bytes[188 * (lost + 1)..]].concat();
            let came = receive(&mut TsReceiver::default(), &damaged, 1316);
            let numbers: Vec<usize> = came.iter().filter_map(|came| sent.iter().position(|unit| *unit == came.unit)).collect();
            assert_eq!(numbers.len(), came.len(), "what comes out is what went in");
            assert!(numbers.len() >= 13, "packet {lost}: {numbers:?}");
        }
    }

    #[test]
    fn of_two_streams_the_first_is_read_also_after_new_tables() {
        let (first, second) = (units(128, 96, 16, 0.5), units(64, 48, 16, 0.5));
        let mut muxer = Muxer::default();
        for (number, (one, two)) in first.iter().zip(&second).enumerate() {
            if number % 4 == 0 {
                muxer.version = number as u8 / 8;
                muxer.tables(&[0x1b, 0x1b]);
            }
            muxer.unit(2, 9000 * number as u64, &one.annex_b);
            muxer.unit(3, 9000 * number as u64, &two.annex_b);
        }
        let mut receiver = TsReceiver::default();
        let came: Vec<AccessUnit> = receive(&mut receiver, &muxer.bytes, 1316).into_iter().map(|came| came.unit).collect();
        let numbers: Vec<usize> = came.iter().map(|came| first.iter().position(|unit| unit == came).unwrap()).collect();
        // The new tables cost the unit before them, and those after it up to the next key frame.
        let next = (8..16).find(|number| first[*number].key).unwrap();
        assert_eq!(numbers, (0..7).chain(next..15).collect::<Vec<_>>());
        assert_eq!(receiver.tally().gaps, 1);
    }

    /// Numbers of the units received of a program that sends `sent` in its second stream, after 10 images in its first; each image is
    /// 0.1 s after the one before, but for a pause before the image `pause`.
    fn moved(sent: &[AccessUnit], pause: usize) -> Vec<usize> {
        let (mut receiver, mut came, mut now) = (TsReceiver::default(), Vec::new(), Time::ZERO);
        let mut muxer = Muxer::default();
        for (number, unit) in sent.iter().enumerate() {
            now += Duration::from_millis(if number == pause { 20_000 } else { 100 });
            muxer.tables(&[0x1b, 0x1b]);
            muxer.unit(if number < 10 { 2 } else { 3 }, 9000 * number as u64, &unit.annex_b);
            receiver.push(now, &std::mem::take(&mut muxer.bytes), &mut came);
        }
        came.iter().filter_map(|came| sent.iter().position(|unit| *unit == came.unit)).collect()
    }

    #[test]
    fn video_that_moves_to_another_stream_is_found_there() {
        let sent = units(128, 96, 60, 0.5);
        let numbers = moved(&sent, usize::MAX);
        // Two seconds later, and from a key frame on; the last image is not complete.
        let first = numbers.iter().position(|number| *number >= 10).unwrap();
        assert!((28..38).contains(&numbers[first]) && sent[numbers[first]].key, "{numbers:?}");
        assert_eq!(numbers[first..], (numbers[first]..59).collect::<Vec<_>>());
    }

    #[test]
    fn a_pause_of_everything_gives_up_no_stream() {
        let sent = units(128, 96, 9, 0.5);
        assert_eq!(moved(&sent, 5), (0..8).collect::<Vec<_>>());
    }

    #[test]
    fn a_stream_is_found_wherever_it_is_cut_and_not_in_other_bytes() {
        let bytes = stream(&units(64, 48, 12, 0.5), 0x1b);
        let mut receiver = TsReceiver::default();
        receive(&mut receiver, &bytes[100..], 1472);
        assert!(receiver.makes_sense());
        let mut receiver = TsReceiver::default();
        let noise: Vec<u8> = (0..40_000_u32).map(|n| (n.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
        assert!(receive(&mut receiver, &noise, 1472).is_empty() && !receiver.makes_sense());
    }

    #[test]
    fn h265_is_recognised() {
        let bytes = stream(&units(64, 48, 6, 0.5), 0x24);
        let mut receiver = TsReceiver::default();
        assert!(receive(&mut receiver, &bytes, 188).is_empty() && receiver.is_h265());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn damage_anywhere_gives_no_panic(
            changes in proptest::collection::vec((0_usize..100_000, any::<u8>()), 0..60), cut in 0_usize..400, size in 1_usize..2000,
        ) {
            let mut bytes = stream(&units(64, 48, 12, 0.5), 0x1b);
            let length = bytes.len();
            for (at, byte) in changes {
                bytes[at % length] = byte;
            }
            bytes.drain(..cut);
            let mut receiver = TsReceiver::default();
            receive(&mut receiver, &bytes, size);
            prop_assert!(receiver.rest.len() < 188);
        }

        #[test]
        fn no_bytes_panic(packets in proptest::collection::vec(
            (0_u16..0x110, any::<u8>(), proptest::collection::vec(any::<u8>(), 0..184)), 0..60)) {
            let mut receiver = TsReceiver::default();
            let mut units = Vec::new();
            for (pid, flags, mut payload) in packets {
                payload.resize(184, flags);
                let [high, low] = pid.to_be_bytes();
                let packet = [&[0x47, high | flags & 0x40, low, 0x10 | flags & 0x2f], payload.as_slice()].concat();
                receiver.push(Time::ZERO, &packet, &mut units);
            }
        }
    }
}
