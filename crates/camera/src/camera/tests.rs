use std::io::{BufRead, BufReader, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::sync::mpsc::{Receiver, channel};

use spf_core::frame::FrameMeta;
use spf_core::time::Time;
use spf_drone::frames::Frames as _;
use spf_media::Jpeg;

use self::address::own_address;
use super::*;
use crate::rtp::testing::packets;
use crate::testing::{image, units};

#[path = "../../tests/it/address.rs"]
mod address;

/// Limit that detects hangs only.
const PATIENCE: Duration = Duration::from_secs(20);

fn settings() -> CameraSettings {
    CameraSettings { latency: Duration::from_millis(50), ..CameraSettings::default() }
}

fn start(url: &str) -> (Camera, Instant) {
    let start = Instant::now();
    (Camera::start(url.parse().unwrap(), &settings(), start).unwrap(), start)
}

fn wait(what: &str, mut until: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !until() {
        assert!(begun.elapsed() < PATIENCE, "not within {PATIENCE:?}: {what}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Waits for a frame after the last one.
fn next_frame(camera: &Camera, last: &mut Option<FrameMeta>) -> FrameMeta {
    let frames = camera.frames();
    wait("a frame", || {
        let newest = frames.newest().map(|(meta, _)| meta);
        let new = newest.map(|meta| meta.id) > last.map(|meta| meta.id);
        if new {
            *last = newest;
        }
        new
    });
    last.unwrap()
}

#[test]
fn a_film_is_played_in_its_own_time_and_ends() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("film.h264");
    std::fs::write(&path, units(64, 48, 15, 0.5).iter().flat_map(|unit| unit.annex_b.clone()).collect::<Vec<u8>>()).unwrap();
    let (camera, _) = start(&format!("file:{}", path.display()));
    wait("the end", || camera.report().state == CameraState::Ended);
    let (newest, photo) = camera.frames().newest().unwrap();
    assert_eq!(photo.size(), (64, 48));
    // A bare stream has 30 images a second. A busy machine may have to leave some out.
    let tally = camera.frames().tally();
    assert!(newest.captured >= Time::from_millis(460) && tally.decoded >= 1, "{newest:?}");
    let (camera, _) = start("file:/no/such/film.mp4");
    wait("a failure", || matches!(camera.report().state, CameraState::Failed(_)));
    assert!(camera.frames().newest().is_none());
}

#[test]
fn rtp_with_losses_resumes_at_key_frames_and_the_age_is_told_after_a_stall() {
    let address = own_address();
    let (camera, begun) = start(&format!("udp-rtp://{address}"));
    let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    wait("the socket", || camera.report().arrivals.is_some());
    let stream = packets(&units(128, 96, 40, 1.0), 40_000, 400);
    let send = |frame: usize, except: Option<usize>| {
        for (number, packet) in stream[frame].iter().enumerate() {
            if Some(number) != except {
                socket.send_to(&packet.bytes(), address).unwrap();
            }
        }
    };
    let mut last = None;
    // The clock begins with the camera, and no image is older than the clock.
    wait("the latency", || begun.elapsed() > settings().latency);
    // A tenth of a second per frame by the timestamps, sent faster than that: only the spacing of the first ones matters.
    for frame in 0..5 {
        send(frame, None);
        let meta = next_frame(&camera, &mut last);
        assert!(meta.received.since(meta.captured) >= Duration::from_millis(50), "{meta:?}");
    }
    // A lost packet: nothing is shown until the key frame of number 10.
    send(5, Some(1));
    let before = last.unwrap().id;
    (6..10).for_each(|frame| send(frame, None));
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(camera.frames().newest().unwrap().0.id, before);
    send(10, None);
    assert!(next_frame(&camera, &mut last).id > before);
    let tally = camera.frames().tally();
    assert_eq!((tally.video.gaps, camera.report().packets_lost), (1, 1), "{tally:?}");
    assert_eq!(camera.report().codec, Some("H.264"));
    // Two frames that were captured 0.1 s apart arrive 0.5 s apart, so the second one was held back by 0.4 s.
    send(11, None);
    let first = next_frame(&camera, &mut last);
    std::thread::sleep(Duration::from_millis(500));
    send(12, None);
    let second = next_frame(&camera, &mut last);
    let age = |meta: FrameMeta| meta.received.since(meta.captured).as_secs_f64();
    assert!(age(second) - age(first) > 0.35, "{} then {}", age(first), age(second));
    assert!(second.received <= Time::ZERO + begun.elapsed());
    // Garbage changes nothing.
    (0..200_u8).for_each(|n| _ = socket.send_to(&[n; 300], address).unwrap());
    send(13, None);
    next_frame(&camera, &mut last);
}

#[test]
fn the_size_may_change_in_flight() {
    let address = own_address();
    let (camera, _) = start(&format!("udp-rtp://{address}"));
    let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    wait("the socket", || camera.report().arrivals.is_some());
    let (mut last, mut sequence) = (None, 0);
    for (width, height) in [(64, 48), (96, 64), (128, 96)] {
        let mut stream = packets(&units(width, height, 4, 1.0), sequence, 400);
        // The clock goes on.
        stream.iter_mut().flatten().for_each(|packet| packet.timestamp = packet.timestamp.wrapping_add(width * 9000));
        for packets in &stream {
            packets.iter().for_each(|packet| _ = socket.send_to(&packet.bytes(), address).unwrap());
            let meta = next_frame(&camera, &mut last);
            assert_eq!((meta.width, meta.height), (width, height));
        }
        sequence += stream.iter().map(Vec::len).sum::<usize>() as u16;
    }
    assert_eq!((camera.frames().tally().sizes, camera.frames().tally().refused), (2, 0));
}

/// A server of JPEG images that answers each connection by `answer`.
fn server(mut answer: impl FnMut(&str, &mut TcpStream) + Send + 'static) -> (SocketAddr, Receiver<String>) {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let address = listener.local_addr().unwrap();
    let (sender, requests) = channel();
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let Ok(mut stream) = stream else { return };
            let mut request = String::new();
            let mut lines = BufReader::new(stream.try_clone().unwrap());
            while lines.read_line(&mut request).is_ok_and(|length| length > 2) {}
            answer(&request, &mut stream);
            if sender.send(request).is_err() {
                return;
            }
        }
    });
    (address, requests)
}

const HEAD: &str = "HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=b\r\n\r\n";

fn part(number: u32) -> Vec<u8> {
    let jpeg = Jpeg::encode(&image(64, 48, number), 80).unwrap();
    let head = format!("--b\r\nContent-Type: image/jpeg\r\nContent-Length: {}\r\n\r\n", jpeg.bytes().len());
    [head.as_bytes(), jpeg.bytes(), b"\r\n"].concat()
}

#[test]
fn a_server_that_restarts_is_found_again() {
    let mut number = 0;
    let (address, requests) = server(move |_, stream| {
        drop(stream.write_all(HEAD.as_bytes()));
        for _ in 0..3 {
            number += 1;
            drop(stream.write_all(&part(number)));
            std::thread::sleep(Duration::from_millis(20));
        }
    });
    let (camera, _) = start(&format!("http://{address}/video"));
    wait("three connections", || camera.report().connections >= 3 && camera.frames().tally().decoded >= 7);
    let report = camera.report();
    assert_eq!((report.codec, report.last_failure.unwrap().why.as_str()), (Some("JPEG"), "the camera closed the connection"));
    assert!(requests.recv().unwrap().starts_with("GET /video HTTP/1.1\r\n"));
}

#[test]
fn passwords_are_sent_when_they_are_asked_for_and_never_told() {
    let basic = "Basic dXNlcjp2ZXJ5LXNlY3JldA==";
    let (address, requests) = server(move |request, stream| {
        let right = request.lines().any(|line| line.eq_ignore_ascii_case(&format!("authorization: {basic}")));
        let answer = if right {
            [HEAD.as_bytes(), &part(1)].concat()
        } else {
            b"HTTP/1.1 401 Unauthorized\r\nWWW-Authenticate: Basic realm=\"camera\"\r\nContent-Length: 0\r\n\r\n".to_vec()
        };
        drop(stream.write_all(&answer));
    });
    let (camera, _) = start(&format!("http://user:very-secret@{address}/"));
    wait("a frame", || camera.frames().newest().is_some());
    assert!(!requests.recv().unwrap().to_ascii_lowercase().contains("authorization"));
    let (camera, _) = start(&format!("http://user:another-secret@{address}/"));
    wait("a failure", || matches!(camera.report().state, CameraState::Failed(_)));
    let report = format!("{:?}", camera.report());
    assert!(report.contains("the server refuses the user name or the password") && !report.contains("secret"), "{report}");
}

#[test]
fn digest_authentication_is_answered() {
    let (address, _requests) = server(|request, stream| {
        let answer = if request.contains("response=\"") && request.contains("uri=\"/video?x=1\"") {
            [HEAD.as_bytes(), &part(1)].concat()
        } else {
            let challenge = "Digest realm=\"cam\", nonce=\"abc\", qop=\"auth\", algorithm=MD5";
            format!("HTTP/1.1 401 Unauthorized\r\nWWW-Authenticate: {challenge}\r\nContent-Length: 0\r\n\r\n").into_bytes()
        };
        drop(stream.write_all(&answer));
    });
    let (camera, _) = start(&format!("http://user:secret@{address}/video?x=1"));
    wait("a frame", || camera.frames().newest().is_some());
}

#[test]
fn what_is_no_stream_of_images_is_said() {
    for (answer, expected, advice) in [
        ("HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n", "404 (Not Found)", "no such stream"),
        ("HTTP/1.1 503 x\r\nContent-Length: 0\r\n\r\n", "503 (Service Unavailable)", "busy"),
        ("HTTP/1.1 403 x\r\nContent-Length: 0\r\n\r\n", "403 (Forbidden)", "may not see"),
        ("HTTP/1.1 401 x\r\nContent-Length: 0\r\n\r\n", "asks for a user name and a password", "CAMERA_PASSWORD"),
        ("HTTP/1.1 200 OK\r\nContent-Type: text/html; charset=utf-8\r\n\r\n<html>", "sends `text/html`", "a page for people"),
        ("hello", "invalid", "another language"),
    ] {
        let (address, _requests) = server(move |_, stream| drop(stream.write_all(answer.as_bytes())));
        let (camera, _) = start(&format!("http://{address}/"));
        wait("a failure", || camera.report().last_failure.is_some());
        let failure = camera.report().last_failure.unwrap();
        assert!(failure.why.to_lowercase().contains(&expected.to_lowercase()), "{failure}");
        assert!(failure.hint.as_ref().unwrap().contains(advice), "{failure:?}");
        assert!(!format!("{failure:?}").contains("127.0.0.1"), "{failure}");
    }
    let one = [&b"HTTP/1.1 200 OK\r\nContent-Type: image/jpeg\r\n\r\n"[..], Jpeg::encode(&image(64, 48, 1), 80).unwrap().bytes()]
        .concat();
    let (address, _requests) = server(move |_, stream| drop(stream.write_all(&one)));
    let (camera, _) = start(&format!("http://{address}/snapshot.jpg"));
    wait("a failure", || camera.report().last_failure.is_some());
    assert_eq!(camera.report().last_failure.unwrap().why, "the server sends one image, and ends");
    // Nobody listens, and a server that speaks no RTSP.
    let (address, _requests) = server(move |_, stream| drop(stream.write_all(b"hello\r\n\r\n")));
    for (url, advice) in [
        (format!("http://{}/", own_address()), "nothing listens"),
        (format!("rtsp://{}/", own_address()), "nothing listens"),
        (format!("rtsp://{address}/"), "another language"),
    ] {
        let (camera, _) = start(&url);
        wait("a failure", || camera.report().last_failure.is_some());
        let failure = camera.report().last_failure.unwrap();
        assert!(failure.hint.as_ref().unwrap().contains(advice), "{failure:?}");
    }
}

#[test]
fn packets_of_another_kind_are_named() {
    let ts: Vec<u8> = (0..7).flat_map(|_| [&[0x47, 0x1f, 0xff, 0x10][..], &[0xff; 184]].concat()).collect();
    let rtp = packets(&units(64, 48, 2, 1.0), 0, 400)[0][0].bytes();
    for (scheme, packet, expected) in [("udp-rtp", &ts, "they seem to be MPEG-TS"), ("udp-ts", &rtp, "they seem to be RTP")] {
        let address = own_address();
        let (camera, _) = start(&format!("{scheme}://{address}"));
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        wait("a failure", || {
            drop(socket.send_to(packet, address));
            camera.report().last_failure.is_some()
        });
        let failure = camera.report().last_failure.unwrap();
        assert!(failure.why.starts_with("30 packets arrived") && failure.why.contains(expected), "{failure}");
        assert!(!camera.report().lasts && failure.hint.unwrap().contains(&address.to_string()));
        // It goes on being received, in case the sender is set right.
        wait("another try", || camera.report().connections > 1);
    }
    // The port is taken.
    let taken = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let port = taken.local_addr().unwrap().port();
    let (camera, _) = start(&format!("udp-rtp://127.0.0.1:{port}"));
    wait("a failure", || camera.report().last_failure.is_some());
    assert!(camera.report().last_failure.unwrap().hint.unwrap().contains(&format!("'sport = :{port}'")));
}

#[test]
fn h264_with_a_payload_type_of_audio_is_received() {
    let address = own_address();
    let (camera, _) = start(&format!("udp-rtp://{address}"));
    let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    wait("the socket", || camera.report().arrivals.is_some());
    let stream = packets(&units(128, 96, 42, 4.0), 0, 400);
    // It begins behind a key frame: the next one comes after 39 images, which are more than enough packets to judge by.
    for packet in stream[1..].concat() {
        let packet = crate::rtp::Packet { payload_type: 8, ..packet };
        socket.send_to(&packet.bytes(), address).unwrap();
        std::thread::sleep(Duration::from_millis(1));
    }
    wait("a frame", || camera.frames().newest().is_some());
    assert_eq!((camera.report().last_failure, camera.report().connections), (None, 1));
}

#[test]
fn a_port_with_a_profile_that_cannot_be_decoded_goes_on_being_received() {
    let address = own_address();
    let (camera, _) = start(&format!("udp-rtp://{address}"));
    let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let sequence = std::cell::Cell::new(0_u16);
    let send = |profile: Option<u8>| {
        for mut packet in packets(&units(64, 48, 1, 1.0), sequence.get(), 10_000).concat() {
            sequence.set(sequence.get().wrapping_add(1));
            // The set's profile, behind the heads of the aggregate and of the set.
            if let Some(profile) = profile.filter(|_| packet.payload[0] == 0x78) {
                packet.payload[4] = profile;
            }
            drop(socket.send_to(&packet.bytes(), address));
        }
    };
    wait("a failure", || {
        send(Some(122));
        camera.report().last_failure.is_some()
    });
    let report = camera.report();
    assert!(report.lasts && report.last_failure.unwrap().why.contains("High 4:2:2 (122)"));
    // Within the pilot's hold: it is not waited for long, which would take longer than is waited here.
    const { assert!(PATIENCE.as_secs() < LONG_WAIT.as_secs()) };
    wait("a frame", || {
        send(None);
        camera.frames().newest().is_some()
    });
}

#[test]
fn a_password_is_not_sent_to_another_server() {
    let (other, others) = server(|_, stream| {
        let answer = b"HTTP/1.1 401 Unauthorized\r\nWWW-Authenticate: Basic realm=\"camera\"\r\nContent-Length: 0\r\n\r\n";
        drop(stream.write_all(answer));
    });
    let (address, _requests) = server(move |_, stream| {
        let answer = format!("HTTP/1.1 302 Found\r\nLocation: http://{other}/video\r\nContent-Length: 0\r\n\r\n");
        drop(stream.write_all(answer.as_bytes()));
    });
    let (camera, _) = start(&format!("http://user:secret@{address}/video"));
    wait("a failure", || camera.report().last_failure.is_some());
    let failure = camera.report().last_failure.unwrap();
    assert_eq!(failure.why, "it redirects to another server, to which the password is not sent");
    assert!(failure.hint.unwrap().starts_with("give that address") && camera.report().lasts);
    assert!(!others.recv().unwrap().to_ascii_lowercase().contains("authorization"));
}

#[test]
fn damaged_and_huge_images_are_left_out() {
    // A JPEG header that claims 20000 × 20000 pixels.
    let mut huge = Jpeg::encode(&image(64, 48, 1), 80).unwrap().bytes().to_vec();
    let size = huge.windows(2).position(|bytes| bytes == [0xff, 0xc0]).unwrap() + 5;
    huge[size..size + 4].copy_from_slice(&[0x4e, 0x20, 0x4e, 0x20]);
    let (address, _requests) = server(move |_, stream| {
        drop(stream.write_all(HEAD.as_bytes()));
        drop(stream.write_all(&huge));
        std::thread::sleep(Duration::from_millis(200));
        drop(stream.write_all(&part(2)));
        std::thread::sleep(Duration::from_millis(200));
    });
    let (camera, _) = start(&format!("http://{address}/"));
    wait("a frame", || camera.frames().newest().is_some());
    assert!(camera.frames().tally().refused >= 1);
}
