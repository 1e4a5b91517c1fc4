"""GStreamer's RTSP server with the images that come to standard input: 640x480, three bytes a pixel. Usage: HOST PORT"""

import sys
import threading

import gi

gi.require_version("Gst", "1.0")
gi.require_version("GstRtspServer", "1.0")
from gi.repository import GLib, Gst, GstRtspServer  # noqa: E402

LENGTH = 640 * 480 * 3
LAUNCH = (
    "( appsrc name=images is-live=true do-timestamp=true format=time caps=video/x-raw,format=RGB,width=640,height=480,framerate=15/1"
    " ! videoconvert ! video/x-raw,format=I420 ! x264enc tune=zerolatency speed-preset=ultrafast key-int-max=15"
    " ! video/x-h264,profile=baseline ! rtph264pay name=pay0 pt=96 config-interval=-1 )"
)

Gst.init(None)
server = GstRtspServer.RTSPServer()
server.set_address(sys.argv[1])
server.set_service(sys.argv[2])
factory = GstRtspServer.RTSPMediaFactory()
factory.set_shared(True)
factory.set_launch(LAUNCH)
sources = []


def configure(_, media):
    sources[:] = [media.get_element().get_by_name_recurse_up("images")]


def read():
    while True:
        image = sys.stdin.buffer.read(LENGTH)
        if len(image) < LENGTH:
            return
        # Without a client nobody looks at it.
        for source in sources:
            source.emit("push-buffer", Gst.Buffer.new_wrapped(image))


factory.connect("media-configure", configure)
server.get_mount_points().add_factory("/clock", factory)
server.attach(None)
threading.Thread(target=read, daemon=True).start()
GLib.MainLoop().run()
