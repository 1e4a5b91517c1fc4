"""Fences by pymavlink, unmodified: `put ADDRESS` uploads one of five corners with a hole, `read ADDRESS` prints the one that the
vehicle has, and `spoil ADDRESS` is a relay to the vehicle that makes circles ten times as large, and ends with its standard input."""

import json
import os
import select
import socket
import sys

os.environ["MAVLINK20"] = "1"
from pymavlink import mavutil  # noqa: E402

FENCE = 1
CORNER, HOLE, CIRCLE = 5001, 5002, 5003
# Corners in 1e-7 degrees around the start of PX4's simulators.
HERE = (473977420, 85455940)
OFFSETS = [(-900, -900), (-900, 900), (900, 900), (1200, 0), (900, -900)]


def connect(address):
    host, port = address.rsplit(":", 1)
    link = mavutil.mavlink_connection(f"udpout:{host}:{port}", source_system=255, source_component=190)
    # A vehicle that listens speaks to whoever has spoken.
    for _ in range(20):
        link.mav.heartbeat_send(6, 8, 0, 0, 0)
        if link.recv_match(type="HEARTBEAT", blocking=True, timeout=0.5):
            return link
    raise SystemExit("no heartbeat")


def receive(link, kinds):
    message = link.recv_match(type=kinds, blocking=True, timeout=3)
    if message is None or message.mission_type != FENCE:
        raise SystemExit(f"no {kinds}: {message}")
    return message


def put(link):
    hole = [(HERE[0] + 100, HERE[1] + 100), (HERE[0] + 200, HERE[1] + 100), (HERE[0] + 200, HERE[1] + 200)]
    items = [(CORNER, len(OFFSETS), (HERE[0] + a, HERE[1] + b)) for a, b in OFFSETS] + [(HOLE, len(hole), at) for at in hole]
    link.mav.mission_count_send(1, 1, len(items), FENCE)
    while True:
        message = receive(link, ["MISSION_REQUEST_INT", "MISSION_REQUEST", "MISSION_ACK"])
        if message.get_type() == "MISSION_ACK":
            return {"result": message.type}
        kind, number, (x, y) = items[message.seq]
        link.mav.mission_item_int_send(1, 1, message.seq, 0, kind, 0, 1, number, 0, 0, 0, x, y, 0, FENCE)


def read(link):
    link.mav.mission_request_list_send(1, 1, FENCE)
    items = []
    for number in range(receive(link, ["MISSION_COUNT"]).count):
        link.mav.mission_request_int_send(1, 1, number, FENCE)
        item = receive(link, ["MISSION_ITEM_INT"])
        items.append([item.command, item.param1, item.x, item.y])
    link.mav.mission_ack_send(1, 1, 0, FENCE)
    return {"items": items}


def spoil(address):
    host, port = address.rsplit(":", 1)
    front, back = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
    front.bind(("127.0.0.1", 0))
    back.connect((host, int(port)))
    print("127.0.0.1:%d" % front.getsockname()[1], flush=True)
    parser, client = mavutil.mavlink.MAVLink(None), None
    while True:
        ready, _, _ = select.select([front, back, sys.stdin], [], [])
        if sys.stdin in ready and not sys.stdin.read(1):
            return
        if back in ready and client:
            front.sendto(back.recv(4096), client)
        if front in ready:
            data, client = front.recvfrom(4096)
            for message in parser.parse_buffer(data) or []:
                if message.get_type() == "MISSION_ITEM_INT" and message.command == CIRCLE:
                    message.param1 *= 10
                    parser.srcSystem, parser.srcComponent = message.get_srcSystem(), message.get_srcComponent()
                    data = message.pack(parser)
            back.send(data)


if sys.argv[1] == "spoil":
    spoil(sys.argv[2])
else:
    print(json.dumps({"put": put, "read": read}[sys.argv[1]](connect(sys.argv[2]))))
