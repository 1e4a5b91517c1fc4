#!/usr/bin/env python3
"""Writes seeds of the fuzz targets from real data: flights of the simulator, encoders, recorded answers.

    python3 fuzz/seeds.py target/release/spf

Needs ffmpeg. What it writes is kept in git, small, and changes only when a format does; seeds by hand are left alone.
"""
import json
import os
import subprocess
import sys
import tempfile

SEEDS = os.path.join(os.path.dirname(os.path.abspath(__file__)), "seeds")


# A model that says the same about every image.
PROGRAM = """
import json, sys
for line in sys.stdin:
    request = json.loads(line)
    text = json.dumps({"status": "navigating", "stage": 1, "point": [400, 500], "depth": 4, "target": "red crane"})
    print(json.dumps({"id": request["id"], "text": text}), flush=True)
"""


def keep(target, name, data):
    """Writes a seed."""
    folder = os.path.join(SEEDS, target)
    os.makedirs(folder, exist_ok=True)
    with open(os.path.join(folder, name), "wb") as file:
        file.write(data if isinstance(data, bytes) else data.encode())


def run(*command, **more):
    return subprocess.run(command, check=True, capture_output=True, **more).stdout


def rows(log, spf, topic):
    """The messages of a topic."""
    text = run(spf, "log", "cat", log, topic).decode()
    return [json.loads(line)["message"] for line in text.splitlines() if line.startswith("{")]


def videos(folder):
    """Small H.264 streams in Annex B: with one and with several slices an image, of both entropy coders, and with losses."""
    source = ["-f", "lavfi", "-i", "testsrc=size=64x48:rate=10", "-frames:v", "4"]
    streams = {}
    for name, options in {
        "baseline": ["-profile:v", "baseline", "-x264-params", "bframes=0:keyint=2"],
        "slices": ["-profile:v", "baseline", "-x264-params", "bframes=0:slices=3:keyint=4"],
        "main": ["-profile:v", "main", "-x264-params", "bframes=0:cabac=1:keyint=4"],
    }.items():
        path = os.path.join(folder, name + ".h264")
        run("ffmpeg", "-v", "error", *source, "-c:v", "libx264", "-preset", "veryslow", "-pix_fmt", "yuv420p", *options,
            "-bsf:v", "h264_mp4toannexb,filter_units=remove_types=6", "-f", "h264", path)
        with open(path, "rb") as file:
            streams[name] = file.read()
    for name, stream in streams.items():
        # The first byte says how long the datagrams are: 1 + 6 × 200 bytes.
        keep("h264", name, bytes([200]) + stream)
        keep("photo", name + ".h264", stream)
    half = streams["baseline"]
    keep("h264", "truncated", bytes([40]) + half[: len(half) * 2 // 3])
    # The same from a camera: MPEG-TS in datagrams of 1316 bytes, and JPEG images in an HTTP response.
    for kind, name, options in (
        (1, "ts", ["-c:v", "libx264", "-profile:v", "baseline", "-pix_fmt", "yuv420p", "-g", "2", "-f", "mpegts"]),
        (2, "mjpeg", ["-c:v", "mjpeg", "-q:v", "20", "-f", "mpjpeg"]),
    ):
        path = os.path.join(folder, name)
        run("ffmpeg", "-v", "error", *source, *options, path)
        with open(path, "rb") as file:
            keep("camera", name, bytes([kind, 219]) + file.read()[:6_000])
    # Packets of one length: a picture in fragments of 100 bytes.
    key = next(nal for nal in streams["baseline"].split(b"\0\0\1") if nal[:1] == b"\x65").rstrip(b"\0")
    sets = [nal.rstrip(b"\0") for nal in streams["baseline"].split(b"\0\0\1") if nal[:1] in (b"\x67", b"\x68")]
    pieces = [bytes([0x78]) + b"".join(len(nal).to_bytes(2, "big") + nal for nal in sets[:2])]
    fragments = [key[1 + at : 93 + at] for at in range(0, len(key) - 1, 92)]
    for number, fragment in enumerate(fragments):
        ends = 0x80 * (number == 0) | 0x40 * (number + 1 == len(fragments))
        pieces.append(bytes([0x7C, 0x05 | ends]) + fragment)
    packets = b""
    for number, piece in enumerate(pieces):
        # Padding makes them equally long.
        padding = 109 - 12 - len(piece)
        head = bytes([0xA0 if padding else 0x80, 96 | 0x80 * (number + 1 == len(pieces)), 0, number])
        packets += head + bytes(8) + piece + (bytes(padding - 1) + bytes([padding]) if padding else b"")
    keep("camera", "rtp", bytes([0, 18]) + packets)
    keep("camera", "address", bytes([3, 0]) + b"http://user:secret@[::1]:8080/mjpeg?x=1")
    # A datagram of the video as the Tello's driver receives it.
    keep("tello", "slice", streams["baseline"][:1000])


def main():
    spf = os.path.abspath(sys.argv[1])
    with tempfile.TemporaryDirectory() as folder:
        videos(folder)
        program = os.path.join(folder, "model.py")
        with open(program, "w", encoding="utf-8") as file:
            file.write(PROGRAM)
        out, tape = os.path.join(folder, "flight"), os.path.join(folder, "tape.jsonl")
        for vlm, more in (("oracle:default", ["--avoid"]), ("exec:python3 model.py", ["--vlm-record", tape])):
            subprocess.run([spf, "fly", "fly to the red crane", "--vlm", vlm, "--max-queries", "2", "--no-video", *more,
                            "--out", out], cwd=folder, capture_output=True, check=False)
            log, own = os.path.join(out, "flight.mcap"), vlm[:4]
            for number, reply in enumerate(rows(log, spf, "/reply")[:2]):
                keep("reply", f"{own}{number}", reply["text"])
                keep("exec", f"{own}{number}", json.dumps({"id": number, "text": reply["text"]}))
            # The head of the log and its first messages: a whole one is too large for a seed.
            with open(log, "rb") as file:
                keep("log", f"{own}.mcap", file.read(6_000))
            os.rename(out, out + own)
        with open(tape, "rb") as file:
            keep("cassette", "flight", file.read(6_000))
    # Detections, in the encoding of `arbitrary`: the text is at the beginning.
    keep("detector", "list", 'car_1 x:0.50 y:0.61 width:0.10 height:0.08 score:0.91\nperson_1 x:0.20 y:0.5 width:0.1 height:0.3\n')
    head = {"captured": 1_500, "counter": 7, "camera": {"width": 2, "height": 2, "fx": 2.0, "fy": 2.0, "cx": 1.0, "cy": 1.0,
            "distortion": {"k1": 0.0, "k2": 0.0, "p1": 0.0, "p2": 0.0}, "tilt": 0.0}, "cm": "DICaBk=A//", "source": "sensor"}
    keep("depth", "grid", json.dumps(head))
    keep("depth", "values", "DIDICaBk=A//")
    # Between PyPI's `airsim` 1.8.1 and a server; then as Colosseum writes it.
    velocity = b"\x97\x01" + b"\xcb\x3f\xe0" + bytes(6) + b"\xcb\xbf\xd0" + bytes(6) + b"\xcb\x3f\xe0" + bytes(6) + b"\x00"
    keep("airsim", "client", b"\x20\x94\x00\x00\xa4ping\x90\x94\x00\x03\xb0enableApiControl\x92\xc3\xa0\x94\x00\x05\xa7takeoff\x92\x14\xa0"
         b"\x94\x00\x07\xb7moveByVelocityBodyFrame" + velocity + b"\x82\xa7is_rate\xc3\xabyaw_or_rate\xcb\x40\x2e" + bytes(6) + b"\xa0")
    keep("airsim", "server", b"\x05\x94\x01\x00\xc0\xc3\x94\x01\x03\xc0\xc0\x94\x01\x04\xaffunction 'land'\xc0")
    keep("airsim", "colosseum", b"\xff\x94\x00\x01\xacsimGetImages\x93\x91\x94\xa7front_0\x02\xc3\xc2\xa0\xc2")
    # AirSim's settings, of its documentation.
    mine = {"CaptureSettings": [{"ImageType": 0, "Width": 640, "Height": 480}], "X": 0.5, "Pitch": -45}
    down = {"SensorType": 5, "Pitch": -90, "MaxDistance": 20}
    vehicle = {"X": 4, "Y": -5, "Yaw": 90, "DefaultVehicleState": "Disarmed", "Cameras": {"mine": mine}, "Sensors": {"Down": down}}
    usual = [{"ImageType": 3, "Width": 64, "Height": 32, "FOV_Degrees": 60}]
    keep("airsim_settings", "vehicles", json.dumps({
        "SettingsVersion": 1.2, "SimMode": "Multirotor", "ClockSpeed": 2, "Wind": {"X": 1, "Y": 2, "Z": 0},
        "OriginGeopoint": {"Latitude": 1.5, "Longitude": 2.5, "Altitude": 3},
        "CameraDefaults": {"CaptureSettings": usual}, "Vehicles": {"A": vehicle}}))
    keep("airsim_settings", "posed", json.dumps({"SimMode": "ComputerVision", "PhysicsEngineName": "ExternalPhysicsEngine"}))
    keep("tello_link", "answers", bytes([0, 10, 1, 1, 5, 0, 4, 100, 0, 0, 7, 100, 128, 200, 128, 90, 9, 10, 6, 200, 8, 1, 5, 5]))


if __name__ == "__main__":
    main()
