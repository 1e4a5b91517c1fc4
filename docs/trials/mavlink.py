#!/usr/bin/env python3
"""Flies instructions over real sockets, from one process to a virtual PX4 or ArduPilot in another, and in lockstep beside it.

    python3 docs/trials/mavlink.py target/debug/spf docs/trials/park.txt OUT_FOLDER --scene park [--autopilot px4] [--count 10]

The vehicle, its view by RTSP and the oracle behind HTTP are one process (`spf sim serve --mavlink --rtsp --vlm --truth`), the pilot
another (`spf fly --drone mavlink@… --camera rtsp://…`). The pilot's result is printed beside the server's ground truth and beside
the same instruction flown in the simulator in lockstep. PX4 is reached by UDP, ArduPilot by TCP.
"""

import argparse
import json
import os
import signal
import statistics
import subprocess
import sys

PORTS = {"px4": (34540, 38554), "ardupilot": (35760, 38555)}


def serve(given, autopilot, folder, seed):
    port, camera = PORTS[autopilot]
    link = f"udpout:127.0.0.1:{port}" if autopilot == "px4" else f"tcpin:127.0.0.1:{port}"
    command = [given.spf, "sim", "serve", "--mavlink", autopilot, "--mavlink-link", link, f"--rtsp=127.0.0.1:{camera}", "--vlm"]
    command += ["--instruction", "from-prompt", "--scene", given.scene, "--seed", str(seed)]
    command += ["--truth", os.path.join(folder, "truth.jsonl")]
    log = open(os.path.join(folder, "server.txt"), "w", encoding="utf-8")
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True)
    return process, [process.stdout.readline().strip() for _ in range(3)]


def fly(given, autopilot, instruction, number):
    """One flight; returns the client's result and the ground truth."""
    folder = os.path.join(given.out, f"{autopilot}-{number:02d}")
    os.makedirs(folder)
    server, (drone, camera, vlm) = serve(given, autopilot, folder, number)
    command = [given.spf, "fly", instruction, "--drone", drone, "--camera", camera, "--camera-fov", "90", "--camera-tilt", "5"]
    command += ["--vlm", vlm, "--no-vlm-check", "--unattended", "--json", "--no-video", "--max-time", "120"]
    command += ["--out", os.path.join(folder, "flight")]
    run = subprocess.run(command, capture_output=True, text=True, check=False, env=os.environ)
    with open(os.path.join(folder, "client.txt"), "w", encoding="utf-8") as log:
        log.write(run.stderr)
    server.send_signal(signal.SIGINT)
    server.wait(30)
    with open(os.path.join(folder, "truth.jsonl"), encoding="utf-8") as file:
        truth = [json.loads(line) for line in file]
    flown = json.loads(run.stdout) if run.stdout else {"outcome": f"exit code {run.returncode}", "decisions": 0}
    return flown, (truth[0] if truth else {})


def lockstep(given, instruction, number):
    command = [given.spf, "fly", instruction, "--scene", given.scene, "--drone-model", "quad", "--seed", str(number), "--no-video"]
    command += ["--json", "--max-time", "120", "--out", os.path.join(given.out, f"lockstep-{number:02d}")]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    return json.loads(run.stdout) if run.stdout else {}


def verdict(flown):
    """Description of a ground-truth row, or of a summary with ground truth."""
    metres = flown.get("final_distance_m") if flown else None
    if metres is None:
        return "no flight"
    word = {True: "yes", False: "no", None: "–"}[flown.get("verified")]
    return f"{word}, {metres:.2f} m, {flown['collisions']} coll."


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("spf")
    parser.add_argument("instructions")
    parser.add_argument("out")
    parser.add_argument("--scene", default="park")
    parser.add_argument("--autopilot", choices=sorted(PORTS), action="append")
    parser.add_argument("--count", type=int, default=10)
    given = parser.parse_args(sys.argv[1:])
    with open(given.instructions, encoding="utf-8") as file:
        texts = [line.strip() for line in file if line.strip()][: given.count]
    flavours = given.autopilot or ["px4", "ardupilot"]
    cells = " | ".join(f"{name}: client | {name}: truth" for name in flavours)
    print(f"| instruction | {cells} | lockstep | load |\n|---|{'---|---|' * len(flavours)}---|---|", flush=True)
    latencies = []
    for number, text in enumerate(texts, 1):
        row = [text]
        for autopilot in flavours:
            flown, truth = fly(given, autopilot, text, number)
            latency = (flown.get("glass_to_decision") or {}).get("median_s")
            latencies += [latency] if latency is not None else []
            row += [f"{flown['outcome']}, {flown['decisions']} dec.", verdict(truth)]
        beside = lockstep(given, text, number)
        row += [f"{beside.get('outcome')}, {verdict(beside)}", f"{os.getloadavg()[0]:.1f}"]
        print(f"| {' | '.join(row)} |", flush=True)
    if latencies:
        print(f"\nFrom the exposure of a frame to the decision on it: median {statistics.median(latencies):.2f} s", flush=True)


if __name__ == "__main__":
    main()
