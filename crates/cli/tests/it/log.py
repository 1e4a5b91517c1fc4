"""Reads flight logs as somebody would who knows docs/reference/flight-log.md alone: one with pictures, and one without them
whose craft has a depth sensor and therefore an obstacle map."""
import collections
import io
import json
import pathlib
import struct
import sys

import jsonschema
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

FOXGLOVE = {
    "/camera/image": "CompressedImage",
    "/camera/annotations": "ImageAnnotations",
    "/camera/calibration": "CameraCalibration",
    "/tf": "FrameTransforms",
    "/pose/known": "PoseInFrame",
    "/pose/true": "PoseInFrame",
    "/scene": "SceneUpdate",
    "/plan": "SceneUpdate",
    # While the anchor is in use, as here.
    "/path": "SceneUpdate",
    "/log": "Log",
}
WITH_A_MAP = {"/map": "PointCloud"}
OURS = "flight wake telemetry frame reply operator query command decision note finished truth summary".split() + ["pose/deviation"]


def read(folder, pictures):
    messages, sequence = collections.defaultdict(list), set()
    with open(folder / "flight.mcap", "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
        summary = reader.get_summary()
        assert summary.statistics.chunk_count > 0 and len(summary.chunk_indexes) == summary.statistics.chunk_count
        assert all(index.compression == "lz4" for index in summary.chunk_indexes)
        (head,) = [record.metadata for record in reader.iter_metadata() if record.name == "spf"]
        assert head["format"] == "3" and int(head["started_at_ns"]) > 1_700_000_000_000_000_000
        checkers = {}
        for schema, channel, message in reader.iter_messages():
            assert message.log_time == message.publish_time
            sequence.add(message.sequence)
            if channel.message_encoding == "protobuf":
                assert schema.name == "foxglove." + (FOXGLOVE | WITH_A_MAP)[channel.topic], (channel.topic, schema.name)
                value = DecoderFactory().decoder_for("protobuf", schema)(message.data)
            else:
                assert schema.name.startswith("spf.") and schema.encoding == "jsonschema"
                value = json.loads(message.data)
                if schema.id not in checkers:
                    form = json.loads(schema.data)
                    checkers[schema.id] = jsonschema.validators.validator_for(form)(form)
                checkers[schema.id].validate(value)
            messages[channel.topic].append((message.log_time / 1e9, value))
    assert len(sequence) == summary.statistics.message_count == sum(map(len, messages.values()))
    for topic in FOXGLOVE:
        assert (topic in messages) == (pictures or not topic.startswith("/camera")), topic
    for topic in [*WITH_A_MAP, "/depth"]:
        assert (topic in messages) != pictures, topic
    for topic in OURS:
        assert "/" + topic in messages, topic
    return messages


def for_people(value):
    """A message as the files beside the log have it: seconds, and six digits."""
    if isinstance(value, dict):
        fields = {}
        for name, of in value.items():
            if name in ("captured", "asked", "answered", "deadline") and isinstance(of, int):
                fields[name + "_s"] = float(f"{of / 1e9:.5e}")
            elif isinstance(of, dict) and set(of) == {"secs", "nanos"}:
                fields[name + "_s"] = float(f"{of['secs'] + of['nanos'] / 1e9:.5e}")
            else:
                fields[name] = for_people(of)
        return fields
    if isinstance(value, list):
        return [for_people(of) for of in value]
    return float(f"{value:.5e}") if isinstance(value, float) else value


def check(folder, pictures):
    messages = read(folder, pictures)
    summary = json.loads((folder / "summary.json").read_text())
    (head,) = [value for _, value in messages["/flight"]]
    assert head["instruction"] == summary["instruction"] and for_people(head["settings"]) == summary["settings"]
    assert head["sim"]["seed"] == summary["seed"] and head["sim"]["scene"] == summary["scene"]
    assert [for_people(value) for _, value in messages["/summary"]] == [summary]
    rows = [json.loads(line) for line in (folder / "decisions.jsonl").read_text().splitlines()]
    logged = [value for _, value in messages["/decision"]]
    prompts = {row["id"]: row["prompt"] for row in map(json.loads, (folder / "queries.jsonl").read_text().splitlines())}
    assert prompts == {value["query"]["id"]: value["query"].pop("prompt") for value in logged if "prompt" in value["query"]}
    assert [row | for_people(value) for row, value in zip(rows, logged, strict=True)] == rows
    # Every setpoint before and after the envelope; the latter is never faster than the limit.
    setpoints = [value for _, value in messages["/command"] if value["command"] == "setpoint"]
    assert setpoints and all(value.keys() >= {"wanted", "cleared", "valid_until"} for value in setpoints)
    assert all(abs(value["cleared"]["forward"]) <= head["limits"]["max_speed"] + 1e-9 for value in setpoints)
    # A reply to each query that was answered in time, with its latency.
    asked = {value["id"]: at for at, value in messages["/query"]}
    for at, value in messages["/reply"]:
        assert abs(at - asked[value["id"]] - value["latency_s"]) < 1e-6
    assert [value["event"] for _, value in messages["/operator"]] == ["hold", "resume"]
    # The estimated pose drifts around the true one.
    for (_, known), (_, true) in zip(messages["/pose/known"], messages["/pose/true"], strict=True):
        assert abs(known.pose.position.x - true.pose.position.x) < 3
    frames = {(link.parent_frame_id, link.child_frame_id) for _, value in messages["/tf"] for link in value.transforms}
    assert frames == {("world", "body"), ("body", "camera")}
    assert len(messages["/scene"][0][1].entities) > 20
    assert any("operator: hold" in value.message for _, value in messages["/log"])
    if not pictures:
        cells = [list(struct.iter_unpack("<3f", value.data)) for _, value in messages["/map"]]
        assert max(map(len, cells)) > 100 and all(value.point_stride == 12 for _, value in messages["/map"])
        # The middles of cells of 0.25 m, within 20 x 20 x 8 m.
        assert all(abs(along % 0.25 - 0.125) < 1e-3 for points in cells for point in points for along in point)
        for points in filter(None, cells):
            assert max(max(along) - min(along) for along in zip(*points)) <= 20
        entities = [{entity.id: entity for entity in value.entities} for _, value in messages["/path"]]
        assert any(drawn["path"].lines[0].points for drawn in entities)
        assert any(drawn["target"].spheres for drawn in entities)
    if pictures:
        times = [at for at, _ in messages["/camera/image"]]
        assert times == [at for at, _ in messages["/camera/annotations"]] and len(times) >= 10 * times[-1]
        assert all(value.format == "jpeg" and value.data[:2] == b"\xff\xd8" for _, value in messages["/camera/image"])
        (camera,) = [value for _, value in messages["/camera/calibration"]]
        assert (camera.width, camera.height) == (640, 480) and abs(camera.K[2] - 320) < 1
        assert any(value.circles for _, value in messages["/camera/annotations"])


check(pathlib.Path(sys.argv[1]), True)
check(pathlib.Path(sys.argv[2]), False)
