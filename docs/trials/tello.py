#!/usr/bin/env python3
"""Flies every instruction of a file over real sockets, from one process to a virtual Tello in another, and in lockstep beside it.

    python3 docs/trials/tello.py target/debug/spf docs/trials/office.txt OUT_FOLDER --scene office [--only 3,7]
    python3 docs/trials/tello.py target/debug/spf docs/trials/office.txt OUT_FOLDER --scene office --faults
    python3 docs/trials/tello.py target/debug/spf docs/trials/office.txt OUT_FOLDER --scene office -- --tello-motion go
    python3 docs/trials/tello.py target/debug/spf docs/trials/office.txt OUT_FOLDER --scene office --camera rtsp
    python3 docs/trials/tello.py target/debug/spf docs/trials/office.txt OUT_FOLDER --scene office --camera-faults [--only 5]

The drone and the oracle behind HTTP are one process (`spf sim serve --tello --vlm --truth`), the pilot another (`spf fly --drone
tello`). The pilot's result is printed beside the server's ground truth. `--faults` flies the first instruction once under each
fault, which begins 4 s after the first motion, and measures from then to the last stick that was not zero. With `--camera` the pilot
sees by RTSP (`rtsp`, `rtsp+udp`) what the drone's camera sees, and not by the drone's own video. `--camera-faults` flies one
instruction once under each fault of a camera: ffmpeg sends that video on by RTP, through a relay that loses or holds back packets
from 4 s after the first motion on.
"""

import argparse
import json
import os
import random
import re
import signal
import socket
import subprocess
import sys
import threading
import time

DRONE, LOCAL = "127.0.0.71", "127.0.0.72"
FAULTS = {
    "none": "",
    "15 % of all datagrams lost": "".join(
        f'[[rules]]\nstream = "{stream}"\nfault = {{ drop = {{ p = 0.15 }} }}\n'
        for stream in ["commands", "responses", "telemetry"]
    ) + '[[rules]]\nstream = "frames"\nfault = { drop = { p = 0.02 } }\n',
    "video frozen": '[[rules]]\nstream = "frames"\nfault = "freeze"\n',
    "no video": '[[rules]]\nstream = "frames"\nfault = { drop = { p = 1.0 } }\n',
    "Wi-Fi cut": '[[craft]]\nfault = "link_cut"\n',
    "battery empty": '[[craft]]\nfault = "battery_empty"\n',
    "IMU error": '[[craft]]\nfault = "imu_invalid"\n',
    "reboot": '[[craft]]\nfault = "reboot"\n',
    "take-off refused": '[[craft]]\nfault = "take_off_refused"\n',
}
# Fraction of packets lost, seconds between key frames, and seconds in each five without packets, which then come at once.
CAMERA_FAULTS = {
    "none": (0.0, 1, 0.0),
    "5 % of packets lost": (0.05, 1, 0.0),
    "30 % of packets lost": (0.3, 1, 0.0),
    "key frames 5 s apart": (0.0, 5, 0.0),
    "key frames 5 s apart, 5 % lost": (0.05, 5, 0.0),
    "5 % of packets lost, key frames 0.2 s apart": (0.05, 0.2, 0.0),
    "1 s in 5 without packets, then a burst": (0.0, 1, 1.0),
}
RTP = 5600
RC = re.compile(r"^\S*?(\d\d):(\d\d):(\d\d\.\d+)Z.*to the drone text=rc (-?\d+) (-?\d+) (-?\d+) (-?\d+)")


class Served:
    """A drone, its oracle and its judge."""

    def __init__(self, spf, scene, folder, seed, camera=None):
        self.fault, self.truth = os.path.join(folder, "fault.toml"), os.path.join(folder, "truth.jsonl")
        self.switch("")
        command = [spf, "sim", "serve", "--tello", "--listen", DRONE, "--vlm", "--instruction", "from-prompt", "--scene", scene]
        command += ["--seed", str(seed), "--truth", self.truth, "--fault", self.fault]
        if camera:
            command += [f"--rtsp={DRONE}:8554"]
        self.log = open(os.path.join(folder, "server.txt"), "w", encoding="utf-8")
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=self.log, text=True)
        assert self.process.stdout.readline().startswith("tello@")
        self.camera = self.process.stdout.readline().strip().replace("rtsp", camera) if camera else None
        self.url = self.process.stdout.readline().strip()

    def switch(self, text):
        """Other faults; the server reads the file four times per second."""
        with open(self.fault + ".new", "w", encoding="utf-8") as file:
            file.write(text)
        os.replace(self.fault + ".new", self.fault)

    def end(self):
        self.process.send_signal(signal.SIGINT)
        self.process.wait(20)
        self.log.close()
        with open(self.log.name, encoding="utf-8") as log:
            video = [line.strip() for line in log if line.startswith("video:")]
        with open(self.truth, encoding="utf-8") as file:
            lines = [json.loads(line) for line in file]
        return (lines[0] if lines else {}), (video[0] if video else "no video")


class Relay:
    """Sends a camera's video on by RTP, with a fault once `faulty` is set."""

    def __init__(self, url, lost, key_interval, held, seed):
        self.lost, self.held, self.faulty, self.random = lost, held, False, random.Random(seed)
        self.inlet = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.inlet.bind(("127.0.0.1", RTP + 10))
        self.inlet.settimeout(0.01)
        codec = ["-c", "copy"]
        if key_interval != 1:
            # By time, not by frames, of which a busy machine has fewer; and without repeating any.
            keys = ["-g", "9999", "-force_key_frames", f"expr:gte(t,n_forced*{key_interval})", "-vsync", "0"]
            codec = ["-c:v", "libx264", "-preset", "ultrafast", "-tune", "zerolatency", "-pix_fmt", "yuv420p", *keys]
        source = ["ffmpeg", "-v", "error", "-fflags", "nobuffer", "-rtsp_transport", "tcp", "-i", url]
        self.ffmpeg = subprocess.Popen(source + codec + ["-f", "rtp", f"rtp://127.0.0.1:{RTP + 10}?pkt_size=1200"], stdout=subprocess.DEVNULL)
        self.stopped = False
        self.thread = threading.Thread(target=self.run)
        self.thread.start()

    def run(self):
        waiting, began = [], None
        while not self.stopped:
            try:
                packet = self.inlet.recv(2048)
            except TimeoutError:
                packet = None
            if self.faulty and began is None:
                began = time.monotonic()
            if packet and not (self.faulty and self.random.random() < self.lost):
                waiting.append(packet)
            if self.faulty and (time.monotonic() - began) % 5.0 < self.held:
                continue
            for packet in waiting:
                self.inlet.sendto(packet, ("127.0.0.1", RTP))
            waiting = []

    def end(self):
        self.stopped = True
        self.thread.join()
        self.ffmpeg.kill()
        self.ffmpeg.wait()
        self.inlet.close()


def sticks(line):
    """Seconds of the day, and the stick positions, in a log line of an `rc` command."""
    found = RC.match(re.sub(r"\x1b\[[0-9;]*m", "", line))
    if not found:
        return None
    hours, minutes, seconds, *numbers = found.groups()
    return int(hours) * 3600 + int(minutes) * 60 + float(seconds), [int(number) for number in numbers]


def fly(given, instruction, number, fault=None):
    """One flight; returns the client's result, the ground truth, the start of the fault and the time of the last commanded motion."""
    folder = os.path.join(given.out, f"{number:02d}")
    os.makedirs(folder)
    disturbed = CAMERA_FAULTS.get(fault) if given.camera_faults else None
    served = Served(given.spf, given.scene, folder, number, "rtsp" if disturbed else given.camera)
    relay = Relay(served.camera, *disturbed, number) if disturbed else None
    if fault == "take-off refused":
        served.switch(FAULTS[fault])
        time.sleep(0.6)
    command = [given.spf, "fly", instruction, "--drone", f"tello@{DRONE}", "--vlm", served.url, "--no-vlm-check", "--unattended"]
    command += ["--json", "--out", os.path.join(folder, "flight"), "--max-time", "120", *given.more]
    if served.camera:
        # What the server says of the Tello's camera.
        command += ["--camera", f"udp-rtp://127.0.0.1:{RTP}" if relay else served.camera, "--camera-fov", "55.4", "--camera-tilt", "5"]
    env = {**os.environ, "SPF_TELLO_LOCAL": LOCAL, "RUST_LOG": "warn,spf_drone=trace"}
    began = moved = last = None
    with open(os.path.join(folder, "client.txt"), "w", encoding="utf-8") as log:
        client = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=env)
        for line in client.stderr:
            log.write(line)
            told = sticks(line)
            if told and any(told[1]):
                moved, last = moved or told[0], told[0]
            if fault and fault != "take-off refused" and began is None and told and moved and told[0] - moved >= 4.0:
                if relay:
                    relay.faulty = True
                else:
                    served.switch(FAULTS[fault])
                began = told[0]
        summary = client.stdout.read()
    client.wait()
    if relay:
        relay.end()
    truth, video = served.end()
    flown = json.loads(summary) if summary else {"outcome": f"exit code {client.returncode}", "decisions": 0, "cause": ""}
    with open(os.path.join(folder, "client.txt"), encoding="utf-8") as log:
        seen = [line.strip() for line in log if line.startswith("video: ")]
        stale = sum("no fresh camera frame" in line for line in open(log.name, encoding="utf-8"))
    after = last - began if began and last and last > began else 0.0
    return flown, truth, video, (seen or [""])[0], stale, after


def lockstep(given, instruction, number):
    command = [given.spf, "fly", instruction, "--scene", given.scene, "--drone-model", "tello", "--seed", str(number)]
    command += ["--no-video", "--json", "--max-time", "120", "--out", os.path.join(given.out, f"{number:02d}", "lockstep")]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    return json.loads(run.stdout) if run.stdout else {}


def verdict(flown):
    """Description of a ground-truth row, or of a summary with ground truth."""
    if not flown:
        return "no flight"
    metres = flown.get("final_distance_m")
    word = {True: "yes", False: "no", None: "–"}[flown.get("verified")]
    return f"{word}, {metres:.2f} m, {flown['collisions']} coll." if metres is not None else f"{word}, {flown['collisions']} coll."


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("spf")
    parser.add_argument("instructions")
    parser.add_argument("out")
    parser.add_argument("--scene", default="office")
    parser.add_argument("--only", type=lambda text: [int(number) for number in text.split(",")])
    parser.add_argument("--faults", action="store_true")
    parser.add_argument("--camera-faults", action="store_true")
    parser.add_argument("--fault", choices=sorted(CAMERA_FAULTS), help="this fault of a camera alone")
    parser.add_argument("--camera", choices=["rtsp", "rtsp+udp"])
    ours = sys.argv[1:]
    end = ours.index("--") if "--" in ours else len(ours)
    given = parser.parse_args(ours[:end])
    given.more = ours[end + 1 :]  # flags of spf fly
    with open(given.instructions, encoding="utf-8") as file:
        texts = [line.strip() for line in file if line.strip()]
    if given.faults:
        print("| fault | outcome | cause | motion commanded after it began | server's truth | ended by |\n|---|---|---|---|---|---|")
        for number, fault in enumerate(FAULTS):
            flown, truth, *_, after = fly(given, texts[0], number, fault)
            cells = [fault, flown["outcome"], flown["cause"], f"{after:.2f} s", verdict(truth), truth.get("ended_by", "–")]
            print(f"| {' | '.join(cells)} |", flush=True)
        return
    if given.camera_faults:
        print("| fault | client | frames too old to fly by | server's truth | client's video | load |\n|---|---|---|---|---|---|")
        for number, fault in enumerate(CAMERA_FAULTS):
            if given.fault and fault != given.fault:
                continue
            flown, truth, _, seen, stale, _ = fly(given, texts[(given.only or [1])[0] - 1], number, fault)
            client = f"{flown['outcome']}: {flown['cause']}, {flown['decisions']} dec."
            cells = [fault, client, str(stale), verdict(truth), seen.removeprefix("video: "), f"{os.getloadavg()[0]:.1f}"]
            print(f"| {' | '.join(cells)} |", flush=True)
        return
    print("| instruction | client | server's truth | lockstep | server's video | client's video | load |\n|---|---|---|---|---|---|---|")
    for number, text in enumerate(texts, 1):
        if given.only and number not in given.only:
            continue
        flown, truth, video, seen, stale, _ = fly(given, text, number)
        beside = lockstep(given, text, number)
        client = f"{flown['outcome']}, {flown['decisions']} dec., {stale} stale"
        cells = [text, client, verdict(truth), f"{beside.get('outcome')}, {verdict(beside)}", video, seen, f"{os.getloadavg()[0]:.1f}"]
        print(f"| {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
