//! GStreamer's RTSP server, by TCP and UDP.

use std::io::Write as _;
use std::net::SocketAddrV4;
use std::path::PathBuf;
use std::process::Command;

use spf_camera::CameraState;
use spf_drone::frames::Frames as _;

use crate::address::own_address;
use crate::harness::{Program, camera, have, images, wait};

/// Serves pictures at /cam, behind a password if one is given.
const SERVER: &str = r#"
import sys
import gi
gi.require_version("Gst", "1.0")
gi.require_version("GstRtspServer", "1.0")
from gi.repository import GLib, Gst, GstRtspServer

Gst.init(None)
host, port, encoder = sys.argv[1:4]
server = GstRtspServer.RTSPServer()
server.set_address(host)
server.set_service(port)
if len(sys.argv) > 4:
    auth = GstRtspServer.RTSPAuth()
    token = GstRtspServer.RTSPToken()
    token.set_string("media.factory.role", "user")
    auth.add_basic(GstRtspServer.RTSPAuth.make_basic("user", sys.argv[4]), token)
    server.set_auth(auth)
factory = GstRtspServer.RTSPMediaFactory()
factory.set_shared(True)
factory.set_launch("( videotestsrc is-live=1 ! video/x-raw,width=320,height=240,framerate=15/1 ! " + encoder + " name=pay0 )")
if len(sys.argv) > 4:
    permissions = GstRtspServer.RTSPPermissions()
    permissions.add_permission_for_role("user", "media.factory.access", True)
    permissions.add_permission_for_role("user", "media.factory.construct", True)
    factory.set_permissions(permissions)
server.get_mount_points().add_factory("/cam", factory)
server.attach(None)
GLib.MainLoop().run()
"#;

const H264: &str = "videoconvert ! video/x-raw,format=I420 ! x264enc tune=zerolatency speed-preset=ultrafast key-int-max=15 ! \
                    video/x-h264,profile=baseline ! rtph264pay pt=96";
const JPEG: &str = "videoconvert ! video/x-raw,format=I420 ! jpegenc ! rtpjpegpay pt=26";
const SIZE: (u32, u32) = (320, 240);

fn have_gstreamer() -> bool {
    let ask = "import gi; gi.require_version('GstRtspServer', '1.0'); from gi.repository import Gst, GstRtspServer; Gst.init(None); \
               assert Gst.ElementFactory.find('x264enc') and Gst.ElementFactory.find('rtph264pay')";
    have(
        "GStreamer's RTSP server (Debian's gir1.2-gst-rtsp-server-1.0, python3-gst-1.0, gstreamer1.0-plugins-{base,good,ugly})",
        Command::new("/usr/bin/python3").args(["-c", ask]),
    )
}

struct Server {
    folder: tempfile::TempDir,
    address: SocketAddrV4,
}

impl Server {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::File::create(folder.path().join("server.py")).unwrap().write_all(SERVER.as_bytes()).unwrap();
        // Its datagrams come from 127.0.0.1 whatever its own address is, and the camera takes them from nowhere else.
        let port = own_address().port() + 200 * (std::process::id() % 60) as u16;
        Self { folder, address: SocketAddrV4::new(std::net::Ipv4Addr::LOCALHOST, port) }
    }

    fn start(&self, more: &[&str]) -> Program {
        let script: PathBuf = self.folder.path().join("server.py");
        let (host, port) = (self.address.ip().to_string(), self.address.port().to_string());
        Program::start("/usr/bin/python3", &[&[script.to_str().unwrap(), &host, &port], more].concat())
    }
}

#[test]
#[ignore = "needs GStreamer: .ci/interop runs it"]
fn h264_by_tcp_and_udp() {
    if !have_gstreamer() {
        return;
    }
    let server = Server::new();
    let _running = server.start(&[H264]);
    // The first connection fails until the server has started, and is tried again.
    let tcp = camera(&format!("rtsp://{}/cam", server.address));
    images(&tcp, 12, SIZE);
    let udp = camera(&format!("rtsp+udp://{}/cam", server.address));
    images(&udp, 12, SIZE);
    assert_eq!(tcp.report().codec, Some("H.264"));
    assert_eq!(tcp.report().packets_lost, 0);
    // The server's clock is ours, and the frames are captured by a program: they are young.
    wait("the time by the camera's clock", &tcp, || tcp.report().own_clock);
    let (meta, _) = tcp.frames().newest().unwrap();
    let age = meta.received.since(meta.captured);
    assert!(age < std::time::Duration::from_secs(1), "{age:?}");
}

#[test]
#[ignore = "needs GStreamer: .ci/interop runs it"]
fn passwords() {
    if !have_gstreamer() {
        return;
    }
    let server = Server::new();
    let _running = server.start(&[H264, "right-secret"]);
    let right = camera(&format!("rtsp://user:right-secret@{}/cam", server.address));
    images(&right, 3, SIZE);
    let wrong = camera(&format!("rtsp://user:wrong-secret@{}/cam", server.address));
    wait("a refusal", &wrong, || matches!(wrong.report().state, CameraState::Failed(_)));
    let report = format!("{:?}", wrong.report());
    assert!(report.contains("refuses the user name or the password") && !report.contains("secret"), "{report}");
}

#[test]
#[ignore = "slow: a server that restarts, and JPEG"]
fn a_server_that_restarts_is_found_again() {
    if !have_gstreamer() {
        return;
    }
    let server = Server::new();
    let running = server.start(&[H264]);
    let camera = camera(&format!("rtsp://{}/cam", server.address));
    images(&camera, 5, SIZE);
    drop(running);
    wait("a failure", &camera, || matches!(camera.report().state, CameraState::Failed(_)));
    let _running = server.start(&[JPEG]);
    images(&camera, 5, SIZE);
    assert!(camera.report().codec == Some("JPEG") && camera.report().connections >= 2);
}
