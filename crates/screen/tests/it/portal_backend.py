#!/usr/bin/python3
"""A desktop's part of the portal ScreenCast, without a desktop: whatever is asked for, the user has chosen a pipeline of GStreamer.

The portal itself (xdg-desktop-portal), PipeWire and GStreamer are the real ones. Usage: portal_backend.py PIPELINE SIZE, with a size such
as 320x240; it prints "ready" when the portal may ask it.
"""

import json
import signal
import subprocess
import sys
import time

from gi.repository import Gio, GLib

NAME = "org.freedesktop.impl.portal.desktop.spftest"
INTERFACE = """
<node>
  <interface name="org.freedesktop.impl.portal.ScreenCast">
    <method name="CreateSession">
      <arg type="o" direction="in"/><arg type="o" direction="in"/><arg type="s" direction="in"/><arg type="a{sv}" direction="in"/>
      <arg type="u" direction="out"/><arg type="a{sv}" direction="out"/>
    </method>
    <method name="SelectSources">
      <arg type="o" direction="in"/><arg type="o" direction="in"/><arg type="s" direction="in"/><arg type="a{sv}" direction="in"/>
      <arg type="u" direction="out"/><arg type="a{sv}" direction="out"/>
    </method>
    <method name="Start">
      <arg type="o" direction="in"/><arg type="o" direction="in"/><arg type="s" direction="in"/><arg type="s" direction="in"/>
      <arg type="a{sv}" direction="in"/>
      <arg type="u" direction="out"/><arg type="a{sv}" direction="out"/>
    </method>
    <property name="AvailableSourceTypes" type="u" access="read"/>
    <property name="AvailableCursorModes" type="u" access="read"/>
    <property name="version" type="u" access="read"/>
  </interface>
</node>
"""
PROPERTIES = {"AvailableSourceTypes": 3, "AvailableCursorModes": 7, "version": 4}


def node():
    """The number of the pipeline's node of PipeWire, once it is there."""
    for _ in range(100):
        for found in json.loads(subprocess.run(["pw-dump"], capture_output=True, check=True).stdout):
            info = (found.get("info") or {}).get("props") or {}
            if found["type"].endswith(":Node") and info.get("node.name") == "spf-test":
                return found["id"]
        time.sleep(0.1)
    sys.exit("no node")


def main():
    pipeline, size = sys.argv[1], [int(side) for side in sys.argv[2].split("x")]
    sink = ["!", "pipewiresink", "mode=provide", "stream-properties=p,node.name=spf-test,media.class=Video/Source"]
    program = subprocess.Popen(["gst-launch-1.0", "-q", *pipeline.split(), *sink])

    def called(_connection, _sender, _path, _interface, method, arguments, invocation):
        results = {}
        if method == "Start":
            stream = (node(), {"size": GLib.Variant("(ii)", size), "source_type": GLib.Variant("u", 2)})
            results["streams"] = GLib.Variant("a(ua{sv})", [stream])
        invocation.return_value(GLib.Variant("(ua{sv})", (0, results)))

    def read(_connection, _sender, _path, _interface, name):
        return GLib.Variant("u", PROPERTIES[name])

    def owned(connection, _name):
        interface = Gio.DBusNodeInfo.new_for_xml(INTERFACE).interfaces[0]
        connection.register_object("/org/freedesktop/portal/desktop", interface, called, read, None)
        node()
        print("ready", flush=True)

    Gio.bus_own_name(Gio.BusType.SESSION, NAME, Gio.BusNameOwnerFlags.NONE, owned, None, None)
    loop = GLib.MainLoop()
    GLib.unix_signal_add(GLib.PRIORITY_DEFAULT, signal.SIGTERM, loop.quit)
    loop.run()
    program.kill()


main()
