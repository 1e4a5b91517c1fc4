"""Looks on at a flight as Foxglove does, over its WebSocket protocol, and prints the commands that it saw."""
import base64
import json
import struct
import sys

from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from websockets.sync.client import connect

with connect(sys.argv[1], subprotocols=["foxglove.sdk.v1"], max_size=None, open_timeout=60) as viewer:
    assert viewer.subprotocol == "foxglove.sdk.v1"
    assert json.loads(viewer.recv(60))["op"] == "serverInfo"
    channels = {channel["topic"]: channel for channel in json.loads(viewer.recv(60))["channels"]}
    described = FileDescriptorSet.FromString(base64.b64decode(channels["/tf"]["schema"]))
    assert any(file.package == "foxglove" for file in described.file)
    wanted = ["/flight", "/scene", "/tf", "/command", "/telemetry"]
    subscriptions = [{"id": number, "channelId": channels[topic]["id"]} for number, topic in enumerate(wanted)]
    viewer.send(json.dumps({"op": "subscribe", "subscriptions": subscriptions}))
    seen = {topic: [] for topic in wanted}
    for frame in viewer:
        if isinstance(frame, str):
            continue
        kind, number, time = struct.unpack_from("<BIQ", frame)
        assert kind == 1
        seen[wanted[number]].append((time, frame[13:]))
        if len(seen["/command"]) >= 20 and len(seen["/telemetry"]) >= 20:
            break
    # Messages sent once before this viewer connected are sent to it as well.
    assert json.loads(seen["/flight"][0][1])["instruction"] == "fly to the red crane"
    assert len(seen["/scene"]) == 1
    links = FrameTransforms.FromString(seen["/tf"][-1][1]).transforms
    assert [(link.parent_frame_id, link.child_frame_id) for link in links] == [("world", "body"), ("body", "camera")]
    print(json.dumps({"/command": [(time, json.loads(data)) for time, data in seen["/command"]]}))
