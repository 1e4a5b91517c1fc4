use proptest::prelude::*;

use super::*;
use crate::message;

fn packets(decoder: &mut Decoder) -> Vec<Packet> {
    core::iter::from_fn(|| decoder.next_packet()).collect()
}

/// Written by pymavlink 2.4: `MAVLink_heartbeat_message(2, 12, 209, 0x60000, 4, 3)` of system 1, component 1, both versions.
#[test]
fn a_heartbeat_of_another_library_is_read_in_both_versions() {
    let v2 = [253, 9, 0, 0, 0, 1, 1, 0, 0, 0, 0, 0, 6, 0, 2, 12, 209, 4, 3];
    let v1 = [254, 9, 0, 1, 1, 0, 0, 0, 6, 0, 2, 12, 209, 4, 3];
    for bytes in [&v2[..], &v1[..]] {
        let crc = calculate_crc(&bytes[1..], 50).to_le_bytes();
        let mut decoder = Decoder::default();
        decoder.push(&[bytes, &crc].concat());
        let packet = decoder.next_packet().unwrap();
        assert_eq!((packet.system, packet.component, packet.id, packet.autopilot()), (1, 1, 0, Some(12)));
        let crate::report::Report::Heartbeat(heartbeat) = packet.report() else { panic!("{packet:?}") };
        assert!(heartbeat.armed && heartbeat.custom_mode == 0x0006_0000 && heartbeat.kind == 2);
    }
}

/// Written by pymavlink 2.4.50 with the key 0, 1, 2 … 31, link 3 and time 1000: the heartbeat of an ArduPilot in GUIDED.
#[test]
fn a_signed_packet_is_read_and_known_as_signed() {
    let signed = [
        0xfd, 9, 1, 0, 0, 1, 1, 0, 0, 0, 4, 0, 0, 0, 2, 3, 81, 3, 3, 0x99, 0xda, 3, 0xe8, 3, 0, 0, 0, 0, 0x57, 0x2e, 0x31, 0x28,
        0x90, 0x99,
    ];
    let plain = Encoder::new([1, 1]).frame(&message::heartbeat_of_computer());
    let mut decoder = Decoder::default();
    decoder.push(&[&signed[..], &plain, &signed].concat());
    let found: Vec<_> = packets(&mut decoder).iter().map(|packet| (packet.autopilot(), packet.is_signed)).collect();
    assert_eq!(found, [(Some(3), true), (Some(8), false), (Some(3), true)]);
}

#[test]
fn repeated_and_overtaken_packets_are_dropped_and_missing_ones_counted() {
    let (mut sequence, mut stats) = (Sequence::default(), LinkStats::default());
    let accepted = [250, 251, 251, 254, 253, 0, 1, 1, 100, 0, 200].map(|number| sequence.accept(number, &mut stats));
    assert_eq!(accepted, [true, true, false, true, false, true, true, false, true, false, true]);
    assert_eq!(stats.repeated, 4);
}

proptest! {
    #[test]
    fn packets_are_found_in_any_pieces_between_anything(
        noise in proptest::collection::vec(proptest::collection::vec(any::<u8>(), 0..20), 4),
        cut in 1_usize..40,
    ) {
        let mut encoder = Encoder::new([7, 191]);
        let bodies = [message::heartbeat_of_computer(), message::read_parameter([1, 1], "COM_OF_LOSS_T"),
            message::setpoint([1, 1], spf_core::time::Time::from_millis(5), spf_core::command::Setpoint::HOLD)];
        let mut bytes = Vec::new();
        for (body, noise) in bodies.iter().zip(&noise) {
            // A marker in the noise may claim what follows it.
            bytes.extend(noise.iter().filter(|byte| !matches!(byte, 0xfd | 0xfe)));
            bytes.extend(encoder.frame(body));
        }
        let (mut decoder, mut found) = (Decoder::default(), Vec::new());
        for piece in bytes.chunks(cut) {
            decoder.push(piece);
            found.extend(packets(&mut decoder));
        }
        prop_assert_eq!(found.iter().map(|packet| packet.id).collect::<Vec<_>>(), [0, 20, 84]);
        prop_assert!(found.iter().enumerate().all(|(n, packet)| usize::from(packet.sequence) == n && packet.system == 7));
    }

    #[test]
    fn no_bytes_panic(bytes in proptest::collection::vec(any::<u8>(), 0..2000)) {
        let mut decoder = Decoder::default();
        decoder.push(&bytes);
        for packet in packets(&mut decoder) {
            drop(packet.report());
        }
    }

    /// With a right checksum, whatever the contents.
    #[test]
    fn no_payload_panics(id in 0_u32..400, payload in proptest::collection::vec(any::<u8>(), 0..255)) {
        let mut decoder = Decoder::default();
        decoder.push(&Encoder::new([1, 1]).frame(&Body { id, payload }));
        for packet in packets(&mut decoder) {
            drop((packet.report(), packet.message(), packet.bytes::<4>(250)));
        }
    }
}
