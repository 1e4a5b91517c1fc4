#!/usr/bin/env python3
"""Age of the track and CPU time of a flight with the tracker, over the sockets of a virtual Tello.

    cargo build --release && pip install mcap && python3 docs/bench/track_live.py target/release/spf 60

Serves a virtual Tello and the oracle, and flies after somebody in the office by the tracker. The age of a report is the time
from the capture of its frame, as the driver knows it, to its arrival at the pilot; the CPU time is that of the client alone.
"""
import json
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

from mcap.reader import make_reader

from record_cost import watch

INSTRUCTION = "Follow the person in the green shirt"


def reports(log):
    """Ages of the reports of the track, milliseconds, and how many there are of each quality."""
    ages, qualities = [], {}
    with open(log, "rb") as file:
        for _, _, message in make_reader(file).iter_messages(topics=["/track"]):
            report = json.loads(message.data)
            ages.append((message.log_time - report["captured"]) / 1e6)
            qualities[report["quality"]] = qualities.get(report["quality"], 0) + 1
    return ages, qualities


def main():
    spf, seconds = sys.argv[1], sys.argv[2]
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder) / "flight"
        serve = [spf, "sim", "serve", "--tello", "--listen", "127.0.0.1", "--scene", "office", "--seed", "2"]
        serve += ["--vlm", "--vlm-listen", "127.0.0.1:8093"]
        server = subprocess.Popen(serve, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            time.sleep(3)
            fly = [spf, "fly", INSTRUCTION, "--drone", "tello@127.0.0.1", "--unattended", "--no-vlm-check"]
            fly += ["--vlm", "openai@http://127.0.0.1:8093/v1", "--max-time", seconds, "--out", str(out)]
            begun = time.monotonic()
            environment = {**os.environ, "OPENAI_API_KEY": "none"}
            flight = subprocess.Popen(fly, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=environment)
            threads, whole = watch(flight)
            wall = time.monotonic() - begun
        finally:
            server.terminate()
            server.wait()
        ages, qualities = reports(out / "flight.mcap")
    if len(ages) < 2:
        sys.exit(f"no track within {wall:.0f} s")
    ordered = sorted(ages)
    print(f"{len(ages)} reports in {wall:.0f} s, {qualities}")
    print(f"age: median {statistics.median(ages):.0f} ms, 95 % {ordered[int(0.95 * len(ages))]:.0f} ms, at most {ordered[-1]:.0f} ms")
    print(f"process {100 * whole / wall:.0f} % of a core")
    for name, used in sorted(threads.items(), key=lambda thread: -thread[1])[:6]:
        print(f"  {name}: {100 * used / wall:.1f} %")


if __name__ == "__main__":
    main()
