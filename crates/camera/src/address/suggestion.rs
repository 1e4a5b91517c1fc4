//! What somebody may have meant who gave something else than the address of a camera.

use std::path::Path;

use super::CameraUrl;

/// Ends of the names of videos.
const VIDEOS: [&str; 10] = ["mp4", "mov", "m4v", "h264", "264", "mkv", "webm", "avi", "ts", "mpg"];
/// Words for a camera of this machine.
const LOCAL: [&str; 6] = ["webcam", "camera", "cam", "usb", "v4l", "v4l2"];
/// Words that schemes differ in from those that are read, by mistake or in other programs.
const SPELLINGS: [(&str, &str); 14] = [
    ("rtp", "udp-rtp"),
    ("rtps", "rtsp"),
    ("rstp", "rtsp"),
    ("rtsps", "rtsp"),
    ("rtspt", "rtsp"),
    ("rtspu", "rtsp+udp"),
    ("rtsp-udp", "rtsp+udp"),
    ("rtp-udp", "udp-rtp"),
    ("udprtp", "udp-rtp"),
    ("ts", "udp-ts"),
    ("mpegts", "udp-ts"),
    ("udpts", "udp-ts"),
    ("mjpeg", "http"),
    ("mjpg", "http"),
];

/// What was meant, perhaps, such as ``did you mean `file:film.mp4`?``. Nothing is quoted that may be a password.
#[must_use]
pub fn suggestion(text: &str) -> Option<String> {
    let meant = |address: &str| Some(format!("did you mean `{address}`?"));
    let is_secret = text.contains(['@', '?']) || ["pass", "pwd"].iter().any(|word| text.to_ascii_lowercase().contains(word));
    // An address that is quoted must be one.
    let quoted = |address: &str, form: &str| {
        if !is_secret && address.parse::<CameraUrl>().is_ok() { meant(address) } else { meant(form) }
    };
    if let Some(device) = device(text) {
        return meant(&format!("v4l2:{device}"));
    }
    if text.contains(" ! ") {
        return meant("gstreamer:PIPELINE");
    }
    if is_video(text) && !text.contains("://") {
        return quoted(&format!("file:{text}"), "file:VIDEO");
    }
    let (scheme, rest) = text.split_once(':').unwrap_or(("", text));
    let (scheme, slashless) = (scheme.to_ascii_lowercase(), rest.trim_start_matches('/'));
    match scheme.as_str() {
        "udp" => {
            let rest = slashless.strip_prefix('@').unwrap_or(slashless);
            let of = |scheme: &str| format!("{scheme}://{rest}");
            return if of("udp-ts").parse::<CameraUrl>().is_ok() {
                Some(format!("did you mean `{}`, for MPEG-TS, or `{}`, for RTP?", of("udp-ts"), of("udp-rtp")))
            } else {
                Some("did you mean `udp-ts://:PORT`, for MPEG-TS, or `udp-rtp://:PORT`, for RTP?".to_owned())
            };
        }
        "tello" => return quoted(&format!("tello@{slashless}"), "tello@ADDRESS"),
        "gst" | "gst-launch" => return meant("gstreamer:PIPELINE"),
        "rtsp" | "rtsp+udp" | "udp-rtp" | "udp-ts" | "http" | "https" => {
            return quoted(&format!("{scheme}://{slashless}"), &format!("{scheme}://HOST/PATH"));
        }
        "srt" | "rtmp" | "rtmps" | "tcp" | "hls" | "webrtc" | "ndi" => {
            return Some(format!(
                "{scheme} is not read: let ffmpeg send it on, `ffmpeg -i ADDRESS -c copy -f mpegts udp://127.0.0.1:5600?pkt_size=1316`, \
                 received by udp-ts://:5600; or use gstreamer:PIPELINE."
            ));
        }
        _ => {}
    }
    if let Some((_, right)) = SPELLINGS.iter().find(|(spelling, _)| *spelling == scheme) {
        return quoted(&format!("{right}://{slashless}"), &format!("{right}://HOST/PATH"));
    }
    if LOCAL.contains(&text.to_ascii_lowercase().as_str()) {
        return Some("did you mean `v4l2:/dev/video0`? `ls -l /dev/v4l/by-id` lists the cameras of this machine.".to_owned());
    }
    if !is_secret && Path::new(text).is_file() {
        return meant(&format!("file:{text}"));
    }
    // An address of the network, with or without a port.
    let host = text.split(['/', ':']).next().unwrap_or("");
    if host.parse::<std::net::IpAddr>().is_ok() || host.ends_with(".local") || host == "localhost" {
        return if is_secret {
            meant("rtsp://HOST/PATH")
        } else {
            Some(format!("did you mean `rtsp://{text}`, or `http://{text}` for MJPEG?"))
        };
    }
    None
}

/// The device that a text names: `/dev/video0`, `video0`, `0`.
fn device(text: &str) -> Option<String> {
    let text = ["device:", "v4l:", "v4l2:"].iter().find_map(|scheme| text.strip_prefix(scheme)).unwrap_or(text);
    let number = text.strip_prefix("/dev/video").or_else(|| text.strip_prefix("video")).unwrap_or(text);
    if !number.is_empty() && number.len() <= 3 && number.bytes().all(|byte| byte.is_ascii_digit()) {
        return Some(format!("/dev/video{number}"));
    }
    let is_link =
        text.starts_with("/dev/v4l/by-") && text.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"/-_.:".contains(&byte));
    is_link.then(|| text.to_owned())
}

fn is_video(text: &str) -> bool {
    let name = text.strip_suffix("?loop=true").unwrap_or(text);
    Path::new(name).extension().is_some_and(|end| VIDEOS.iter().any(|video| end.eq_ignore_ascii_case(video)))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn what_was_meant_is_guessed() {
        for (text, expected) in [
            ("udp://:5600", "did you mean `udp-ts://:5600`, for MPEG-TS, or `udp-rtp://:5600`, for RTP?"),
            (
                "udp://@239.1.2.3:1234",
                "did you mean `udp-ts://239.1.2.3:1234`, for MPEG-TS, or `udp-rtp://239.1.2.3:1234`, for RTP?",
            ),
            ("udp://drone:5600", "did you mean `udp-ts://:PORT`, for MPEG-TS, or `udp-rtp://:PORT`, for RTP?"),
            ("film.mp4", "did you mean `file:film.mp4`?"),
            ("./a/Film.MKV", "did you mean `file:./a/Film.MKV`?"),
            ("/home/me/x.h264?loop=true", "did you mean `file:VIDEO`?"),
            ("/dev/video0", "did you mean `v4l2:/dev/video0`?"),
            ("0", "did you mean `v4l2:/dev/video0`?"),
            ("video2", "did you mean `v4l2:/dev/video2`?"),
            ("v4l:/dev/video1", "did you mean `v4l2:/dev/video1`?"),
            ("/dev/v4l/by-id/usb-Maker_C920-index0", "did you mean `v4l2:/dev/v4l/by-id/usb-Maker_C920-index0`?"),
            ("webcam", "did you mean `v4l2:/dev/video0`? `ls -l /dev/v4l/by-id` lists the cameras of this machine."),
            ("rtsp:/192.168.1.64/stream1", "did you mean `rtsp://192.168.1.64/stream1`?"),
            ("RTSP://192.168.1.64/stream1", "did you mean `rtsp://192.168.1.64/stream1`?"),
            ("rtps://cam/x", "did you mean `rtsp://cam/x`?"),
            ("rtps://user:secret@cam/x", "did you mean `rtsp://HOST/PATH`?"),
            ("rtp://:5600", "did you mean `udp-rtp://:5600`?"),
            ("tello:192.168.10.1", "did you mean `tello@192.168.10.1`?"),
            ("videotestsrc ! identity", "did you mean `gstreamer:PIPELINE`?"),
            (
                "192.168.1.64:8554/cam",
                "did you mean `rtsp://192.168.1.64:8554/cam`, or `http://192.168.1.64:8554/cam` for MJPEG?",
            ),
        ] {
            assert_eq!(suggestion(text).as_deref(), Some(expected), "{text}");
        }
        assert!(suggestion("srt://10.0.0.1:9").unwrap().starts_with("srt is not read: let ffmpeg send it on"));
        assert_eq!(suggestion("nonsense"), None);
    }

    proptest! {
        #[test]
        fn no_password_is_suggested(
            scheme in "(rtps|rtp|rtsp|udp|tello|srt|file|)", slashes in "(:|:/|://|)", secret in "[A-Z0-9]{8,12}",
            host in "(cam|10\\.0\\.0\\.1|x\\.mp4)", tail in "(:80|)(/[a-z]{0,5}|/user=x_passWord=|)(\\?pwd=|)",
        ) {
            let end = if tail.ends_with('=') { secret.as_str() } else { "" };
            if let Some(shown) = suggestion(&format!("{scheme}{slashes}user:{secret}@{host}{tail}{end}")) {
                prop_assert!(!shown.contains(&secret), "{}", shown);
            }
        }

        #[test]
        fn any_text_has_a_suggestion_or_none(text in ".{0,60}") {
            drop(suggestion(&text));
        }
    }
}
