//! Repairs what an RTSP server sends within its connection, so that the library, which insists on the standards, plays what common
//! players play. No I/O.
//!
//! - A `Transport` without `interleaved=` gets the channels that were asked for; other channels are renumbered.
//! - The number of the source (SSRC) that the answer tells is left out: the packets tell it. The stream is that of which two packets
//!   come in a row, and a later one takes its place after 16. Packets of others are left out.
//! - Packets get one source number and continuing sequence numbers, in which losses stay. Those that come again or too late are left
//!   out, and so is what is no packet, and of the reports all but the sender's, which tells its clock.
//! - Bytes that are neither answer nor packet are skipped up to the next that is.
//!
//! What does not begin as RTSP passes unchanged.

use std::mem::take;

use crate::rtp::Packet;

/// Channels of RTP and RTCP that the library asks for, as it numbers those of its first stream.
const CHANNELS: (u8, u8) = (0, 1);
/// Packets in a row that make a source the stream, at the beginning and in place of another one.
const PACKETS: (usize, usize) = (2, 16);
/// Source number that the library sees.
const SOURCE: u32 = 1;
/// Longest head of an answer, and longest body, bytes.
const LONGEST_HEAD: usize = 1 << 16;
const LONGEST_BODY: usize = 1 << 20;
/// Length of the head of an interleaved packet, of an RTP header, and of a sender report without its blocks, bytes.
const FRAMED: usize = 4;
const RTP: usize = 12;
const SENDER_REPORT: usize = 28;
/// What an answer begins with.
const ANSWER: &[u8] = b"RTSP/";

/// What the bytes begin with.
enum Next {
    /// It is not complete.
    Incomplete,
    /// An answer, with the length of its head, and of all of it.
    Answer(usize, usize),
    /// A packet on a channel, with the length of all of it.
    Packet(u8, usize),
    /// Nothing that is known.
    Noise,
}

/// The repair of one connection.
#[derive(Debug, Default)]
pub(super) struct Repair {
    waiting: Vec<u8>,
    /// Whether an answer has come; before that, nothing is known of what speaks there.
    speaks: bool,
    /// Whether the last bytes were none that are known.
    lost: bool,
    /// Bytes skipped so far.
    skipped: u64,
    /// Channels of RTP and RTCP, once they are set up.
    channels: Option<(u8, u8)>,
    source: Option<u32>,
    /// Packets in a row of another source.
    others: Vec<Vec<u8>>,
    /// The last sender report from before the source was known.
    report: Option<Vec<u8>>,
    /// Sequence number of the stream that is due, and of the packet that the library gets next.
    due: Option<u16>,
    next: u16,
    /// Packets in a row that came too late.
    late: usize,
}

impl Repair {
    /// Takes what has arrived; appends what the library is to get.
    pub(super) fn push(&mut self, bytes: &[u8], out: &mut Vec<u8>) {
        self.waiting.extend_from_slice(bytes);
        let waiting = take(&mut self.waiting);
        let mut rest = &waiting[..];
        while !rest.is_empty() {
            match self.next(rest) {
                Next::Incomplete => break,
                Next::Answer(head, length) => {
                    self.speaks = true;
                    self.answer(&rest[..head], out);
                    out.extend_from_slice(&rest[head..length]);
                    rest = &rest[length..];
                    self.lost = false;
                }
                Next::Packet(channel, length) => {
                    self.packet(channel, &rest[FRAMED..length], out);
                    rest = &rest[length..];
                    self.lost = false;
                }
                Next::Noise if !self.speaks => {
                    out.extend_from_slice(rest);
                    rest = &[];
                }
                Next::Noise => {
                    let length = rest.iter().skip(1).position(|byte| matches!(byte, b'$' | b'R')).map_or(rest.len(), |at| at + 1);
                    // Lines without contents separate answers.
                    self.lost |= rest[..length].iter().any(|byte| !matches!(byte, b'\r' | b'\n'));
                    self.skipped += length as u64;
                    rest = &rest[length..];
                }
            }
        }
        self.waiting = rest.to_vec();
    }

    /// Bytes that were skipped so far.
    pub(super) fn skipped(&self) -> u64 {
        self.skipped
    }

    fn next(&self, bytes: &[u8]) -> Next {
        if bytes.starts_with(ANSWER) {
            return answer_in(bytes);
        }
        if ANSWER.starts_with(bytes) {
            return Next::Incomplete;
        }
        let ([b'$', head @ ..], true) = (bytes, self.speaks) else { return Next::Noise };
        let [channel, high, low, ref contents @ ..] = *head else { return Next::Incomplete };
        let length = usize::from(u16::from_be_bytes([high, low]));
        let seen = &contents[..contents.len().min(length)];
        // An empty one keeps a connection alive.
        if length == 0 && !self.lost {
            return Next::Packet(channel, FRAMED);
        }
        if seen.len() < length.min(RTP) {
            return Next::Incomplete;
        }
        if !self.may_be_packet(channel, seen) {
            return Next::Noise;
        }
        if seen.len() < length { Next::Incomplete } else { Next::Packet(channel, FRAMED + length) }
    }

    /// Whether a packet on a channel may begin like this. In the middle of noise only what is certain is one.
    fn may_be_packet(&self, channel: u8, begin: &[u8]) -> bool {
        // Version 2 of RTP and RTCP.
        let is_version_2 = begin.first().is_some_and(|byte| byte >> 6 == 2);
        if !self.lost || !is_version_2 {
            return is_version_2;
        }
        match self.channels {
            Some((rtp, _)) if channel == rtp => self.source.is_none_or(|source| word(begin, 8) == Some(source)),
            Some((_, rtcp)) if channel == rtcp => begin.get(1).is_some_and(|kind| (200..=204).contains(kind)),
            _ => false,
        }
    }

    /// Repairs the head of an answer.
    fn answer(&mut self, head: &[u8], out: &mut Vec<u8>) {
        for line in head.split_inclusive(|byte| *byte == b'\n') {
            let text = String::from_utf8_lossy(line);
            match text.split_once(':').map(|(name, value)| (name.trim().to_ascii_lowercase(), value.trim())) {
                Some((name, value)) if name == "transport" && !has_ports(value) => {
                    out.extend_from_slice(format!("Transport: {}\r\n", self.transport(value)).as_bytes());
                }
                // Numbers of sequence and time that the first packet does not have, or of another source.
                Some((name, _)) if name == "rtp-info" => {}
                _ => out.extend_from_slice(line),
            }
        }
    }

    fn transport(&mut self, value: &str) -> String {
        let mut parts: Vec<&str> = value.split(';').map(str::trim).collect();
        let told = parts.iter().find_map(|part| channels(part.strip_prefix("interleaved=")?));
        self.channels = Some(told.unwrap_or(CHANNELS));
        parts.retain(|part| !part.starts_with("interleaved=") && !part.starts_with("ssrc="));
        format!("{};interleaved={}-{}", parts.join(";"), CHANNELS.0, CHANNELS.1)
    }

    fn packet(&mut self, channel: u8, packet: &[u8], out: &mut Vec<u8>) {
        match self.channels {
            Some((rtp, _)) if channel == rtp => self.rtp(packet, out),
            Some((_, rtcp)) if channel == rtcp => self.rtcp(packet, out),
            // Of a session of before, or of a stream that was not asked for.
            _ => {}
        }
    }

    fn rtp(&mut self, packet: &[u8], out: &mut Vec<u8>) {
        let Some(Packet { source, .. }) = Packet::parse(packet) else { return };
        if self.source == Some(source) {
            self.others.clear();
            return self.forward(packet, out);
        }
        if self.others.first().is_some_and(|other| word(other, 8) != Some(source)) {
            self.others.clear();
        }
        self.others.push(packet.to_vec());
        let enough = if self.source.is_none() { PACKETS.0 } else { PACKETS.1 };
        if self.others.len() >= enough {
            self.restart();
            self.source = Some(source);
            if let Some(report) = self.report.take() {
                self.rtcp(&report, out);
            }
            for packet in take(&mut self.others) {
                self.forward(&packet, out);
            }
        }
    }

    /// The next packet continues none of before.
    fn restart(&mut self) {
        // The gap tells the library that something is missing.
        self.next = self.next.wrapping_add(u16::from(self.due.is_some()));
        (self.due, self.late) = (None, 0);
    }

    /// Passes a packet of the stream on.
    fn forward(&mut self, packet: &[u8], out: &mut Vec<u8>) {
        let Some(number) = word(packet, 0).map(|word| word as u16) else { return };
        let mut ahead = number.wrapping_sub(self.due.unwrap_or(number));
        if ahead > u16::MAX / 2 {
            self.late += 1;
            if self.late < PACKETS.1 {
                return;
            }
            // Its numbers have begun anew.
            self.restart();
            ahead = 0;
        }
        self.late = 0;
        let sent = self.next.wrapping_add(ahead);
        (self.due, self.next) = (Some(number.wrapping_add(1)), sent.wrapping_add(1));
        let mut packet = packet.to_vec();
        packet[2..4].copy_from_slice(&sent.to_be_bytes());
        packet[8..12].copy_from_slice(&SOURCE.to_be_bytes());
        frame(CHANNELS.0, &packet, out);
    }

    fn rtcp(&mut self, packet: &[u8], out: &mut Vec<u8>) {
        if packet.get(1) != Some(&200) || packet.len() < SENDER_REPORT {
            return;
        }
        match self.source {
            None => self.report = Some(packet.to_vec()),
            source if source == word(packet, 4) => {
                // By itself: without what it says of others, and what follows it.
                let mut report = vec![0x80, 200, 0, (SENDER_REPORT / 4 - 1) as u8];
                report.extend_from_slice(&SOURCE.to_be_bytes());
                report.extend_from_slice(&packet[8..SENDER_REPORT]);
                frame(CHANNELS.1, &report, out);
            }
            _ => {}
        }
    }
}

/// Appends a packet on a channel.
fn frame(channel: u8, packet: &[u8], out: &mut Vec<u8>) {
    let [high, low] = (packet.len() as u16).to_be_bytes();
    out.extend_from_slice(&[b'$', channel, high, low]);
    out.extend_from_slice(packet);
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_be_bytes(bytes.get(at..at + 4)?.try_into().ok()?))
}

/// Whether a `Transport` is one by UDP.
fn has_ports(value: &str) -> bool {
    value.contains("client_port=") || value.contains("server_port=")
}

/// Two channels, or one and its successor.
fn channels(text: &str) -> Option<(u8, u8)> {
    let (rtp, rtcp) = text.split_once('-').map_or((text, None), |(rtp, rtcp)| (rtp, Some(rtcp)));
    let rtp: u8 = rtp.trim().parse().ok()?;
    let rtcp = rtcp.and_then(|rtcp| rtcp.trim().parse().ok()).filter(|rtcp| *rtcp != rtp);
    Some((rtp, rtcp.unwrap_or(rtp.wrapping_add(1))))
}

/// The answer with which the bytes begin.
fn answer_in(bytes: &[u8]) -> Next {
    let end = |mark: &[u8]| bytes.windows(mark.len()).position(|window| window == mark).map(|at| at + mark.len());
    let Some(head) = end(b"\r\n\r\n").into_iter().chain(end(b"\n\n")).min() else {
        return if bytes.len() > LONGEST_HEAD { Next::Noise } else { Next::Incomplete };
    };
    let text = String::from_utf8_lossy(&bytes[..head]);
    let body = text.lines().find_map(|line| {
        let (name, value) = line.split_once(':')?;
        name.trim().eq_ignore_ascii_case("content-length").then(|| value.trim().parse::<usize>().ok())?
    });
    let length = head + body.unwrap_or(0);
    match length {
        _ if head > LONGEST_HEAD || length > LONGEST_HEAD + LONGEST_BODY => Next::Noise,
        _ if bytes.len() < length => Next::Incomplete,
        _ => Next::Answer(head, length),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The answer to `SETUP` as a server gives it, and as the library gets it.
    fn set_up(transport: &str) -> (Repair, String) {
        let (mut repair, mut out) = (Repair::default(), Vec::new());
        repair.push(format!("RTSP/1.0 200 OK\r\nCSeq: 3\r\nTransport: {transport}\r\nSession: 7\r\n\r\n").as_bytes(), &mut out);
        (repair, String::from_utf8(out).unwrap())
    }

    fn playing() -> Repair {
        set_up("RTP/AVP/TCP;unicast;interleaved=0-1").0
    }

    fn rtp(source: u32, number: u16, contents: &[u8]) -> Vec<u8> {
        let mut packet = vec![0x80, 96];
        packet.extend(number.to_be_bytes());
        packet.extend([0, 0, 0, 9]);
        packet.extend(source.to_be_bytes());
        packet.extend(contents);
        packet
    }

    fn report(source: u32) -> Vec<u8> {
        let mut packet = vec![0x80, 200, 0, 6];
        packet.extend(source.to_be_bytes());
        packet.extend([5; 20]);
        packet
    }

    fn framed(channel: u8, packet: &[u8]) -> Vec<u8> {
        let mut out = Vec::new();
        frame(channel, packet, &mut out);
        out
    }

    /// What comes out of packets on channel 0: the number and the first byte of each, all with one source.
    fn passed(repair: &mut Repair, packets: &[Vec<u8>]) -> Vec<(u16, u8)> {
        let mut out = Vec::new();
        packets.iter().for_each(|packet| repair.push(&framed(0, packet), &mut out));
        read(&out)
    }

    fn read(mut out: &[u8]) -> Vec<(u16, u8)> {
        let mut all = Vec::new();
        while let [b'$', channel, high, low, rest @ ..] = out {
            assert_eq!(*channel, 0);
            let (packet, rest) = rest.split_at(usize::from(u16::from_be_bytes([*high, *low])));
            assert_eq!(word(packet, 8), Some(SOURCE));
            all.push((u16::from_be_bytes([packet[2], packet[3]]), packet[12]));
            out = rest;
        }
        assert!(out.is_empty(), "{out:?}");
        all
    }

    #[test]
    fn a_transport_gets_the_channels_that_were_asked_for() {
        for (told, expected) in [
            ("RTP/AVP/TCP;unicast", "RTP/AVP/TCP;unicast;interleaved=0-1"),
            (
                "RTP/AVP/TCP;unicast;interleaved=0-1;ssrc=12AB34CD;mode=\"PLAY\"",
                "RTP/AVP/TCP;unicast;mode=\"PLAY\";interleaved=0-1",
            ),
            ("RTP/AVP/TCP;interleaved=1-2", "RTP/AVP/TCP;interleaved=0-1"),
            (
                "RTP/AVP;unicast;client_port=5000-5001;server_port=6-7;ssrc=1",
                "RTP/AVP;unicast;client_port=5000-5001;server_port=6-7;ssrc=1",
            ),
        ] {
            let (_, answer) = set_up(told);
            assert!(answer.contains(&format!("\r\nTransport: {expected}\r\nSession: 7\r\n\r\n")), "{answer}");
        }
        // Packets on other channels come on those that the library knows.
        let (mut repair, _) = set_up("RTP/AVP/TCP;interleaved=1-2");
        let mut out = Vec::new();
        for number in [8, 9] {
            repair.push(&framed(1, &rtp(5, number, &[7])), &mut out);
        }
        assert_eq!(read(&out), [(0, 7), (1, 7)]);
        out.clear();
        repair.push(&framed(2, &report(5)), &mut out);
        assert_eq!((out[1], word(&out[FRAMED..], 4)), (1, Some(SOURCE)));
    }

    #[test]
    fn the_answer_to_play_tells_no_numbers_and_bodies_pass() {
        let (mut repair, mut out) = (Repair::default(), Vec::new());
        let text = "RTSP/1.0 200 OK\r\nCSeq: 4\r\nRTP-Info: url=rtsp://h/x;seq=9;rtptime=7\r\nContent-Length: 5\r\n\r\n$R\r\nT";
        for piece in text.as_bytes().chunks(3) {
            repair.push(piece, &mut out);
        }
        assert_eq!(String::from_utf8(out).unwrap(), "RTSP/1.0 200 OK\r\nCSeq: 4\r\nContent-Length: 5\r\n\r\n$R\r\nT");
    }

    #[test]
    fn stray_packets_are_left_out_and_a_new_source_takes_over_without_a_loss() {
        let mut repair = playing();
        let stream: Vec<_> = (0..4).map(|n| rtp(5, 100 + n, &[n as u8])).collect();
        let packets = [&[rtp(9, 7, &[99])][..], &stream[..2], &[rtp(9, 8, &[99])], &stream[2..]].concat();
        assert_eq!(passed(&mut repair, &packets), [(0, 0), (1, 1), (2, 2), (3, 3)]);
        // The sender restarts: nothing of the new stream is missing, and the gap is told.
        let next: Vec<_> = (0..20).map(|n| rtp(6, 40_000 + n, &[100 + n as u8])).collect();
        let came = passed(&mut repair, &next);
        assert_eq!(came, (0..20).map(|n| (5 + n, 100 + n as u8)).collect::<Vec<_>>());
    }

    #[test]
    fn losses_stay_and_what_comes_again_or_too_late_is_left_out() {
        let mut repair = playing();
        let numbers = [65_534, 65_535, 0, 0, 65_535, 3, 2, 4];
        let packets: Vec<_> = numbers.iter().map(|number| rtp(5, *number, &[*number as u8])).collect();
        assert_eq!(passed(&mut repair, &packets), [(0, 254), (1, 255), (2, 0), (5, 3), (6, 4)]);
        // Numbers that begin anew are followed, after some packets.
        let packets: Vec<_> = (0..20).map(|n| rtp(5, 40_000 + n, &[n as u8])).collect();
        assert_eq!(passed(&mut repair, &packets).iter().map(|(_, contents)| *contents).collect::<Vec<_>>(), [15, 16, 17, 18, 19]);
    }

    #[test]
    fn a_report_comes_with_its_source_only() {
        let mut repair = playing();
        let mut out = Vec::new();
        for (channel, packet) in [(1, report(5)), (0, rtp(5, 1, &[1])), (0, rtp(5, 2, &[2])), (1, report(9)), (1, report(5))] {
            repair.push(&framed(channel, &packet), &mut out);
        }
        let kinds: Vec<u8> = {
            let (mut rest, mut kinds) = (&out[..], Vec::new());
            while let [b'$', channel, high, low, contents @ ..] = rest {
                let (packet, others) = contents.split_at(usize::from(u16::from_be_bytes([*high, *low])));
                assert_eq!(word(packet, if *channel == 1 { 4 } else { 8 }), Some(SOURCE));
                kinds.push(*channel);
                rest = others;
            }
            kinds
        };
        assert_eq!(kinds, [1, 0, 0, 1]);
    }

    #[test]
    fn what_is_no_rtsp_passes_unchanged() {
        for text in [&b"HTTP/1.1 400 Bad Request\r\n\r\n"[..], b"SSH-2.0-OpenSSH\r\n", b"$\x00\x00\x10hello"] {
            let (mut repair, mut out) = (Repair::default(), Vec::new());
            repair.push(text, &mut out);
            repair.push(b"more", &mut out);
            assert_eq!(out, [text, b"more"].concat());
        }
    }

    proptest! {
        /// Noise of any kind between the packets, in any pieces: of those behind it none is lost but what the noise claims.
        #[test]
        fn packets_are_found_behind_noise(
            noise in proptest::collection::vec(proptest::collection::vec(any::<u8>(), 0..30), 12), cut in 1_usize..50,
        ) {
            let mut repair = playing();
            let mut bytes = Vec::new();
            for (number, noise) in noise.iter().enumerate() {
                bytes.extend(framed(0, &rtp(5, number as u16, &[number as u8; 40])));
                // What looks like a packet may claim what follows it.
                if number > 1 {
                    bytes.extend(noise.iter().filter(|byte| **byte != b'$'));
                }
            }
            let mut out = Vec::new();
            for piece in bytes.chunks(cut) {
                repair.push(piece, &mut out);
            }
            let numbers: Vec<u16> = read(&out).iter().map(|(number, _)| *number).collect();
            prop_assert_eq!(numbers, (0..12).collect::<Vec<u16>>());
        }

        /// After noise that does look like a packet the stream goes on.
        #[test]
        fn noise_that_claims_packets_costs_no_more_than_it_claims(claim in 0_u16..2000, begin in any::<u8>(), channel in 0_u8..4) {
            let mut repair = playing();
            let packets: Vec<_> = (0..60_u16).map(|number| framed(0, &rtp(5, number, &[number as u8; 100]))).collect();
            let mut out = Vec::new();
            for (number, packet) in packets.iter().enumerate() {
                if number == 10 {
                    repair.push(&[b'$', channel, (claim >> 8) as u8, claim as u8, begin], &mut out);
                }
                repair.push(packet, &mut out);
            }
            // 2000 bytes are 17 of them; the claim ends in the middle of one.
            let contents: Vec<u8> = read(&out).iter().map(|(_, contents)| *contents).filter(|contents| *contents >= 30).collect();
            prop_assert_eq!(contents, (30..60).collect::<Vec<u8>>());
        }

        #[test]
        fn no_bytes_panic_or_pile_up(pieces in proptest::collection::vec(proptest::collection::vec(any::<u8>(), 0..200), 0..30), answer in "RTSP/1.0 200 OK\r\n(Transport|Content-Length|RTP-Info): ?[0-9a-z=;-]{0,9}\r\n\r\n") {
            let (mut repair, mut out) = (playing(), Vec::new());
            repair.push(answer.as_bytes(), &mut out);
            for piece in &pieces {
                repair.push(piece, &mut out);
                prop_assert!(repair.waiting.len() <= LONGEST_HEAD + LONGEST_BODY + 200);
            }
        }
    }
}
