//! Bytes as AirSim's own client and server send them, and any others.

use proptest::prelude::*;

use super::structs::*;
use super::*;

fn decoded(bytes: &[u8]) -> Message {
    let mut decoder = Decoder::new(Limits::REQUESTS);
    decoder.push(bytes);
    decoder.next_message().expect("a message").expect("the whole of it")
}

fn raw<T: serde::Serialize>(value: T) -> Raw {
    Raw::of(&value, Encoding::Map)
}

/// Traced between PyPI's `airsim` 1.8.1 and a server.
#[test]
fn what_was_traced_is_written_byte_by_byte() {
    let ping = Message::request(0, "ping", vec![]);
    assert_eq!(ping.encode(), b"\x94\x00\x00\xa4ping\x90");
    let enable = Message::request(3, "enableApiControl", vec![raw(true), raw("")]);
    assert_eq!(enable.encode(), b"\x94\x00\x03\xb0enableApiControl\x92\xc3\xa0");
    let takeoff = Message::request(5, "takeoff", vec![raw(20), raw("")]);
    assert_eq!(takeoff.encode(), b"\x94\x00\x05\xa7takeoff\x92\x14\xa0");
    let yaw = YawMode { is_rate: true, yaw_or_rate: 15.0 };
    let params = vec![raw(1), raw(-0.25), raw(0.5), raw(0.5), raw(0), raw(yaw), raw("")];
    let mut bytes = b"\x94\x00\x07\xb7moveByVelocityBodyFrame\x97\x01".to_vec();
    for number in [-0.25_f64, 0.5, 0.5] {
        bytes.push(0xcb);
        bytes.extend(number.to_be_bytes());
    }
    bytes.extend(b"\x00\x82\xa7is_rate\xc3\xabyaw_or_rate\xcb\x40\x2e\0\0\0\0\0\0\xa0");
    let velocity = Message::request(7, "moveByVelocityBodyFrame", params);
    assert_eq!(velocity.encode(), bytes);
    for (message, bytes) in [(Ok(raw(true)), &b"\x94\x01\x00\xc0\xc3"[..]), (Ok(Raw::nil()), b"\x94\x01\x00\xc0\xc0")] {
        assert_eq!(Message::Response { id: 0, outcome: message }.encode(), bytes);
    }
    for message in [ping, enable, takeoff, velocity] {
        assert_eq!(decoded(&message.encode()), message);
    }
}

#[test]
fn colosseum_sends_arrays_and_both_are_read() {
    let yaw = YawMode { is_rate: false, yaw_or_rate: 90.0 };
    let array = Raw::of(&yaw, Encoding::Array);
    assert_eq!(array.bytes(), b"\x92\xc2\xcb\x40\x56\x80\0\0\0\0\0");
    assert_eq!((array.encoding(), raw(yaw).encoding(), raw(1).encoding()), (Some(Encoding::Array), Some(Encoding::Map), None));
    for written in [array, raw(yaw)] {
        assert_eq!(written.read(), Ok(yaw));
    }
    let request = ImageRequest {
        camera_name: "front_0".to_owned(),
        image_type: ImageType::DepthPerspective,
        pixels_as_float: true,
        compress: false,
    };
    assert_eq!(Raw::of(&request, Encoding::Array).bytes(), b"\x94\xa7front_0\x02\xc3\xc2");
    let path = Raw::of(&[Vector3r::new(1.0, 2.0, -3.0); 2], Encoding::Array);
    let items = path.items().expect("an array");
    assert_eq!(items.iter().map(Raw::encoding).collect::<Vec<_>>(), [Some(Encoding::Array); 2]);
}

#[test]
fn integers_are_floats_and_floats_without_fraction_integers() {
    assert_eq!(raw((true, 90)).read(), Ok(YawMode { is_rate: true, yaw_or_rate: 90.0 }));
    assert_eq!(raw((1, 2.5_f32, -3)).read(), Ok(Vector3r::new(1.0, 2.5, -3.0)));
    assert_eq!(raw(3e38).read(), Ok(NO_TIMEOUT));
    let request = raw(("0", 5.0, true, false)).read::<ImageRequest>().expect("a float without fraction");
    assert_eq!(request.image_type, ImageType::Segmentation);
    let half = raw(("0", 5.5, true, false)).read::<ImageRequest>().expect_err("no type of image is a half");
    assert!(half.to_string().contains("a whole number"), "{half}");
    let ten = raw(("0", 10, true, false)).read::<ImageRequest>().expect_err("they end at 9");
    assert!(ten.to_string().contains("number 10"), "{ten}");
}

#[test]
fn what_is_missing_or_of_another_type_is_named() {
    let missing = raw(std::collections::BTreeMap::from([("x_val", 1.0), ("y_val", 2.0)]));
    assert!(missing.read::<Vector3r>().expect_err("no z").to_string().contains("z_val"));
    let other = raw("north").read::<f64>().expect_err("a text");
    assert_eq!(other.to_string(), "a text was not expected here");
    assert!(raw((1.0, 2.0)).read::<Vector3r>().is_err(), "two are no vector");
    let more = std::collections::BTreeMap::from([("x_val", 1.0), ("y_val", 2.0), ("z_val", 3.0), ("w_val", 4.0)]);
    assert_eq!(raw(more).read(), Ok(Vector3r::new(1.0, 2.0, 3.0)), "forks add keys");
}

#[test]
fn pixels_are_bytes_and_no_text() {
    let image = ImageResponse {
        image_data_uint8: vec![255, 0, 0],
        image_data_float: vec![1.5],
        camera_position: Vector3r::default(),
        camera_name: "0".to_owned(),
        camera_orientation: Quaternionr::default(),
        time_stamp: u64::MAX,
        message: String::new(),
        pixels_as_float: false,
        compress: false,
        width: 1,
        height: 1,
        image_type: ImageType::Scene,
    };
    let written = raw(&image);
    let start = b"\x8c\xb0image_data_uint8\xc4\x03\xff\0\0\xb0image_data_float\x91\xca\x3f\xc0\0\0";
    assert!(written.bytes().starts_with(start), "{written:?}");
    for encoding in [Encoding::Map, Encoding::Array] {
        assert_eq!(Raw::of(&image, encoding).read(), Ok(image.clone()));
    }
}

#[test]
fn a_state_has_six_fields_and_colosseums_nine() {
    let state = MultirotorState {
        collision: CollisionInfo::default(),
        kinematics_estimated: KinematicsState::default(),
        gps_location: GeoPoint { latitude: 47.6, longitude: -122.1, altitude: 122.0 },
        timestamp: 1,
        landed_state: 1,
        rc_data: RcData::default(),
        ready: None,
        ready_message: None,
        can_arm: None,
    };
    let map = raw(&state);
    assert_eq!(map.bytes()[0], 0x86);
    assert_eq!(map.read(), Ok(state.clone()));
    let colosseum =
        MultirotorState { ready: Some(true), ready_message: Some(String::new()), can_arm: Some(true), ..state.clone() };
    let array = Raw::of(&colosseum, Encoding::Array);
    assert_eq!(array.bytes()[0], 0x99);
    assert_eq!(array.read(), Ok(colosseum));
    let short = Raw::of(&state, Encoding::Array);
    assert_eq!((short.bytes()[0], short.read()), (0x96, Ok(state)));
}

#[test]
fn the_errors_are_worded_as_rpclib_words_them() {
    assert_eq!(errors::unknown_method("fly", 2), "rpclib: server could not find function 'fly' with argument count 2.");
    assert_eq!(
        errors::wrong_arity("ping", 0, 1),
        "rpclib: Function 'ping' was called with an invalid number of arguments. Expected: 0, got: 1"
    );
    let failure = Message::failure(4, &errors::failed("land", 2, "no"));
    let Message::Response { id: 4, outcome: Err(text) } = decoded(&failure.encode()) else { panic!("{failure:?}") };
    let expected =
        "rpclib: function 'land' (called with 2 arg(s)) threw an exception. The exception contained this information: no.";
    assert_eq!(text.text(), expected);
}

#[test]
fn a_peer_can_make_us_keep_so_much_and_no_more() {
    let limits = Limits { bytes: 100, objects: 20, depth: 4 };
    let refused = |bytes: &[u8]| {
        let mut decoder = Decoder::new(limits);
        decoder.push(bytes);
        let error = decoder.next_message().expect_err("it is beyond the limits");
        assert_eq!(decoder.next_message(), Err(error.clone()), "it stays broken");
        error
    };
    // Four gigabytes of text, of array, of map; only the head has come.
    assert_eq!(refused(b"\x94\x00\x00\xdb\xff\xff\xff\xff"), FrameError::TooLong { limit: 100 });
    assert_eq!(refused(b"\x94\x00\x00\xdd\xff\xff\xff\xff"), FrameError::TooMany { limit: 20 });
    assert_eq!(refused(b"\x94\x00\x00\xdf\xff\xff\xff\xff"), FrameError::TooMany { limit: 20 });
    assert_eq!(refused(b"\x94\x91\x91\x91\x91\x91"), FrameError::TooDeep { limit: 4 });
    assert_eq!(refused(b"\x94\x00\xc1"), FrameError::Reserved);
    for other in [&b"GET / HTTP/1.1\r\n"[..], b"\x93\x00\x00\x90", b"\x94\x05\x00\xc0\xc0", b"\x94\x00\x00\xa1a\xc0"] {
        assert!(matches!(refused(other), FrameError::NotAMessage(_)));
    }
}

fn objects() -> impl Strategy<Value = Raw> {
    let leaf = prop_oneof![
        Just(Raw::nil()),
        any::<bool>().prop_map(raw),
        any::<i64>().prop_map(raw),
        any::<u64>().prop_map(raw),
        any::<f32>().prop_map(raw),
        any::<f64>().prop_map(raw),
        ".{0,40}".prop_map(raw),
        prop::collection::vec(any::<u8>(), 0..300).prop_map(|bytes| raw(serde_bytes::ByteBuf::from(bytes))),
    ];
    leaf.prop_recursive(4, 40, 20, |inner| {
        prop_oneof![
            prop::collection::vec(inner.clone(), 0..20).prop_map(|items| Raw::list(&items)),
            any::<bool>().prop_map(|is_rate| raw(YawMode { is_rate, yaw_or_rate: 1.0 })),
        ]
    })
}

fn messages() -> impl Strategy<Value = Message> {
    let params = || prop::collection::vec(objects(), 0..8);
    prop_oneof![
        (any::<u32>(), "[a-zA-Z]{1,40}", params()).prop_map(|(id, method, params)| Message::Request { id, method, params }),
        (any::<u32>(), objects()).prop_map(|(id, result)| Message::Response { id, outcome: Ok(result) }),
        (any::<u32>(), ".{1,40}").prop_map(|(id, text)| Message::failure(id, &text)),
        ("[a-zA-Z]{1,40}", params()).prop_map(|(method, params)| Message::Notification { method, params }),
    ]
}

proptest! {
    #[test]
    fn messages_come_back_from_a_stream_cut_anywhere(
        sent in prop::collection::vec(messages(), 1..5),
        lengths in prop::collection::vec(1usize..50, 1..20),
    ) {
        let stream: Vec<u8> = sent.iter().flat_map(Message::encode).collect();
        let mut decoder = Decoder::new(Limits::REQUESTS);
        let (mut got, mut rest, mut lengths) = (Vec::new(), &stream[..], lengths.iter().cycle());
        while !rest.is_empty() {
            let (piece, next) = rest.split_at((*lengths.next().expect("a cycle")).min(rest.len()));
            decoder.push(piece);
            while let Some(message) = decoder.next_message().expect("well-formed") {
                got.push(message);
            }
            rest = next;
        }
        prop_assert_eq!(got, sent);
    }

    #[test]
    fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let mut decoder = Decoder::new(Limits { bytes: 100, objects: 50, depth: 5 });
        // As the head of a request, so that more than the first byte is looked at.
        decoder.push(b"\x94\x00\x01\xa1m");
        decoder.push(&bytes);
        while let Ok(Some(message)) = decoder.next_message() {
            if let Message::Request { params, .. } = message {
                for object in params {
                    let _ = (object.items(), object.text(), object.read::<Vec<Vector3r>>(), object.read::<ImageResponse>());
                    let _ = (object.read::<MultirotorState>(), object.read::<YawMode>(), object.read::<ImageRequest>());
                }
            }
        }
    }

    #[test]
    fn structs_come_back_from_both_encodings(numbers in prop::array::uniform18(-1e6_f64..1e6), q in prop::array::uniform4(-1.0_f64..1.0)) {
        let vector = |at: usize| Vector3r::new(numbers[at], numbers[at + 1], numbers[at + 2]);
        let [w_val, x_val, y_val, z_val] = q;
        let state = KinematicsState {
            position: vector(0),
            orientation: Quaternionr { w_val, x_val, y_val, z_val },
            linear_velocity: vector(3),
            angular_velocity: vector(6),
            linear_acceleration: vector(9),
            angular_acceleration: vector(12),
        };
        for encoding in [Encoding::Map, Encoding::Array] {
            prop_assert_eq!(Raw::of(&state, encoding).read(), Ok(state));
            let pose = state.pose();
            prop_assert_eq!(Raw::of(&pose, encoding).read(), Ok(pose));
        }
    }
}
