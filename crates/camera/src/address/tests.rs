//! Tests of addresses.

use proptest::prelude::*;

use super::*;

fn read(text: &str) -> Result<CameraUrl, AddressError> {
    text.parse()
}

#[test]
fn addresses_are_read() {
    let any = |port| SocketAddr::from(([0, 0, 0, 0], port));
    assert_eq!(read("udp-rtp://:5600"), Ok(CameraUrl::UdpRtp(any(5600))));
    assert_eq!(read("udp-ts://@:1234"), Ok(CameraUrl::UdpTs(any(1234))));
    assert_eq!(read("udp-rtp://239.1.2.3:5600"), Ok(CameraUrl::UdpRtp("239.1.2.3:5600".parse().unwrap())));
    assert_eq!(read("udp-ts://[::1]:9"), Ok(CameraUrl::UdpTs("[::1]:9".parse().unwrap())));
    let file = |path: &str, repeats| Ok(CameraUrl::File { path: path.into(), repeats });
    assert_eq!(read("file:my film.mp4"), file("my film.mp4", false));
    assert_eq!(read("file:a?b.mp4?loop=true"), file("a?b.mp4", true));
    assert_eq!(read("file:a.mp4?loop=false"), file("a.mp4", false));
    assert_eq!(read("file:///home/me/a.mp4"), file("/home/me/a.mp4", false));
    assert_eq!(read("file:////a.mp4"), file("/a.mp4", false));
    assert_eq!(read("tello"), Ok(CameraUrl::Tello("192.168.10.1:8889".parse().unwrap())));
    assert_eq!(read("tello@10.0.0.3"), Ok(CameraUrl::Tello("10.0.0.3:8889".parse().unwrap())));
    let local = |size, rate| Ok(CameraUrl::V4l2(LocalCamera { path: "/dev/video2".into(), size, rate }));
    assert_eq!(read("v4l2:/dev/video2"), local(None, None));
    assert_eq!(read("v4l2:///dev/video2?fps=15"), local(None, Some(15)));
    assert_eq!(read("v4l2:/dev/video2?size=1280x720&fps=30"), local(Some((1280, 720)), Some(30)));
    let pipeline = "rtspsrc location=rtsp://h/s user-pw=secret ! decodebin";
    let url = read(&format!("gstreamer:{pipeline}")).unwrap();
    assert_eq!(url, CameraUrl::Gstreamer(Pipeline(pipeline.to_owned())));
    assert_eq!((url.to_string(), format!("{url:?}")), ("gstreamer:…".to_owned(), "Gstreamer(Pipeline(…))".to_owned()));
    let Ok(CameraUrl::Mjpeg(server)) = read("http://us%65r:pa%3Ass@w@cam.local:8080?channel=1") else { panic!() };
    assert_eq!(server.url, "http://cam.local:8080/?channel=1");
    let credentials = server.credentials.unwrap();
    assert_eq!((credentials.user.as_str(), credentials.password.as_str()), ("user", "pa:ss@w"));
    let Ok(CameraUrl::Rtsp { server, transport }) = read("rtsp+udp://a:b@10.0.0.2/live") else { panic!() };
    assert_eq!((server.url.as_str(), server.credentials.is_some(), transport), ("rtsp://10.0.0.2/live", true, Transport::Udp));
    let Ok(CameraUrl::Mjpeg(server)) = read("https://[fe80::1]/mjpeg") else { panic!() };
    assert_eq!((server.url.as_str(), server.credentials), ("https://[fe80::1]/mjpeg", None));
}

#[test]
fn wrong_addresses_are_refused() {
    for (text, error) in [
        ("", AddressError::Scheme),
        ("192.168.1.64", AddressError::Scheme),
        ("ftp://host/x", AddressError::Scheme),
        ("rtsp://admin:2024#secret@192.168.1.64/s", AddressError::Reserved),
        ("rtsp://admin:12/34@192.168.1.64/s", AddressError::Reserved),
        ("http://admin?x@192.168.1.64/s", AddressError::Reserved),
        ("http:///mjpeg", AddressError::NoHost),
        ("http://user:password@/mjpeg", AddressError::NoHost),
        ("http://host:port/", AddressError::Port),
        ("http://host:+80/", AddressError::Port),
        ("udp-rtp://:0", AddressError::Port),
        ("udp-rtp://5600", AddressError::NoPort),
        ("udp-rtp://[::1]", AddressError::NoPort),
        ("udp-rtp://camera:5600", AddressError::NotIp),
        ("udp-ts://:5600/stream", AddressError::Path),
        ("file:", AddressError::NoFile),
        ("file:?loop=true", AddressError::NoFile),
        ("file:a.mp4?loop=3", AddressError::Repeats),
        ("file://a.mp4", AddressError::FileHost),
        ("v4l2:", AddressError::NoDevice),
        ("v4l2:?fps=30", AddressError::NoDevice),
        ("v4l2:/dev/video0?size=1280", AddressError::Mode),
        ("v4l2:/dev/video0?size=1280x+720", AddressError::Mode),
        ("v4l2:/dev/video0?size=0x720", AddressError::Mode),
        ("v4l2:/dev/video0?fps=30&fps=15", AddressError::Mode),
        ("v4l2:/dev/video0?format=MJPG", AddressError::Mode),
        ("tello@drone", AddressError::NoTello),
        ("gstreamer: ", AddressError::NoPipeline),
        ("http://host/a b", AddressError::Character),
    ] {
        assert_eq!(read(text), Err(error), "{text}");
    }
    assert_eq!(read(&format!("http://host/{}", "x".repeat(LONGEST))), Err(AddressError::Long));
}

proptest! {
    #[test]
    fn no_password_is_ever_printed(
        scheme in "(http|https|rtsp|rtsp\\+udp|udp-rtp|ftp|)", user in "[a-z]{0,6}", secret in "[A-Z0-9]{8,12}",
        host in "(cam|10\\.0\\.0\\.1|\\[::1\\]|)", tail in "(:80|:x|:0|)(/[a-z]{0,5}|/user=x_passWord=|)(\\?pwd=|)",
    ) {
        let query = if tail.ends_with('=') { secret.as_str() } else { "" };
        match read(&format!("{scheme}://{user}:{secret}@{host}{tail}{query}")) {
            Ok(url) => {
                prop_assert!(!url.to_string().contains(&secret), "{}", url);
                let shown = format!("{url:?}");
                prop_assert!(!shown.contains(&secret), "{}", shown);
            }
            Err(error) => {
                let shown = format!("{error} {error:?}");
                prop_assert!(!shown.contains(&secret), "{}", shown);
            }
        }
    }

    #[test]
    fn any_text_is_read_or_refused(text in ".{0,60}", scheme in "(file:|udp-rtp://|http://|rtsp://|v4l2:|gstreamer:|tello@|)") {
        drop(read(&format!("{scheme}{text}")));
    }

    #[test]
    fn what_is_printed_is_read_again(
        port in 1..u16::MAX, which in 0..5, path in "[a-z/]{1,9}", flag in any::<bool>(), side in 1..SIDE, rate in 1..RATE,
    ) {
        let address = SocketAddr::from(([10, 0, 0, 1], port));
        let url = match which {
            0 => CameraUrl::UdpTs(address),
            1 => CameraUrl::UdpRtp(address),
            2 => CameraUrl::Tello(address),
            3 => CameraUrl::File { path: format!("x{path}").into(), repeats: flag },
            _ => CameraUrl::V4l2(LocalCamera {
                path: format!("/{}", path.trim_start_matches('/')).into(),
                size: flag.then_some((side, SIDE - side + 1)),
                rate: (port % 2 == 0).then_some(rate),
            }),
        };
        prop_assert!(CameraUrl::is_one(&url.to_string()));
        prop_assert_eq!(read(&url.to_string()), Ok(url));
    }
}
