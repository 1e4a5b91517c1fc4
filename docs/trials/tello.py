#!/usr/bin/env python3
"""Flies every instruction of a file over real sockets, from one process to a virtual Tello in another, and in lockstep beside it.

    python3 docs/trials/tello.py target/debug/spf docs/trials/office.txt OUT_FOLDER --scene office [--only 3,7]
    python3 docs/trials/tello.py target/debug/spf docs/trials/office.txt OUT_FOLDER --scene office --faults
    python3 docs/trials/tello.py target/debug/spf docs/trials/office.txt OUT_FOLDER --scene office -- --tello-motion go

The drone and the oracle behind HTTP are one process (`spf sim serve --tello --vlm --truth`), the pilot another (`spf fly --drone
tello`). The pilot's result is printed beside the server's ground truth. `--faults` flies the first instruction once under each
fault, which begins 4 s after the first motion, and measures from then to the last stick that was not zero.
"""

import argparse
import json
import os
import re
import signal
import subprocess
import sys
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
RC = re.compile(r"^\S*?(\d\d):(\d\d):(\d\d\.\d+)Z.*to the drone text=rc (-?\d+) (-?\d+) (-?\d+) (-?\d+)")


class Served:
    """A drone, its oracle and its judge."""

    def __init__(self, spf, scene, folder, seed):
        self.fault, self.truth = os.path.join(folder, "fault.toml"), os.path.join(folder, "truth.jsonl")
        self.switch("")
        command = [spf, "sim", "serve", "--tello", "--listen", DRONE, "--vlm", "--instruction", "from-prompt", "--scene", scene]
        command += ["--seed", str(seed), "--truth", self.truth, "--fault", self.fault]
        self.log = open(os.path.join(folder, "server.txt"), "w", encoding="utf-8")
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=self.log, text=True)
        assert self.process.stdout.readline().startswith("tello@")
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
    served = Served(given.spf, given.scene, folder, number)
    if fault == "take-off refused":
        served.switch(FAULTS[fault])
        time.sleep(0.6)
    command = [given.spf, "fly", instruction, "--drone", f"tello@{DRONE}", "--vlm", f"openai@{served.url}/v1", "--no-vlm-check", "--unattended"]
    command += ["--json", "--out", os.path.join(folder, "flight"), "--max-time", "120", *given.more]
    env = {**os.environ, "OPENAI_API_KEY": "none", "SPF_TELLO_LOCAL": LOCAL, "RUST_LOG": "warn,spf_drone=trace"}
    began = moved = last = None
    with open(os.path.join(folder, "client.txt"), "w", encoding="utf-8") as log:
        client = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=env)
        for line in client.stderr:
            log.write(line)
            told = sticks(line)
            if told and any(told[1]):
                moved, last = moved or told[0], told[0]
            if fault and fault != "take-off refused" and began is None and told and moved and told[0] - moved >= 4.0:
                served.switch(FAULTS[fault])
                began = told[0]
        summary = client.stdout.read()
    client.wait()
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
