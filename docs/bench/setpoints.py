#!/usr/bin/env python3
"""Measures the timing of commands to a Tello: intervals between stick commands, and the time from an operator's signal to zero.

    python3 docs/bench/setpoints.py target/release/spf [--load N] [--flights N]

Flies the virtual Tello over sockets, with the oracle behind HTTP, and reads the times at which the driver sent each datagram
(RUST_LOG=spf_drone=trace). After some seconds of flight it sends SIGINT, and measures until the first zero or `land`. `--load N`
keeps N other processes busy meanwhile.
"""
import argparse
import datetime
import os
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import time

DRONE, LOCAL = "127.0.0.90", "127.0.0.91"
LINE = re.compile(r"^(\S+Z)\s.*to the drone.*text=(?:\")?([^\"]+)")
NOMINAL = 0.1


def sent(line):
    found = LINE.match(re.sub(r"\x1b\[[0-9;]*m", "", line))
    if not found:
        return None
    at = datetime.datetime.fromisoformat(found[1].replace("Z", "+00:00")).timestamp()
    return at, found[2].strip()


def flight(spf, folder, seconds, more=(), during=None):
    """Times and texts of the datagrams, and when the signal was sent.

    `more` are further arguments of `spf fly`; `during(url, served, client)` is called once, when the drone flies.
    """
    serve = [spf, "sim", "serve", "--tello", "--listen", DRONE, "--vlm", "--scene", "office"]
    served = subprocess.Popen(serve, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    url = None
    for line in served.stdout:
        found = re.search(r"http://[0-9.]+:\d+", line)
        if found:
            url = found[0]
            break
    env = {**os.environ, "OPENAI_API_KEY": "none", "SPF_TELLO_LOCAL": LOCAL, "RUST_LOG": "warn,spf_drone=trace"}
    command = [spf, "fly", "fly to the vending machine", "--drone", f"tello@{DRONE}", "--vlm", f"openai@{url}/v1", "--no-vlm-check"]
    command += ["--unattended", "--out", os.path.join(folder, "flight"), *more]
    client = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=env)
    said, flying, stopped = [], None, None
    for line in client.stderr:
        datagram = sent(line)
        if datagram:
            said.append(datagram)
        if flying is None and line.rstrip().endswith(" flying"):
            flying = time.time()
            if during:
                during(url, served, client)
        moving = datagram and datagram[1].startswith("rc ") and datagram[1] != "rc 0 0 0 0"
        if flying and stopped is None and time.time() - flying > seconds and moving:
            stopped = time.time()
            client.send_signal(signal.SIGINT)
    client.wait()
    served.send_signal(signal.SIGINT)
    served.wait()
    return said, flying, stopped


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("spf")
    parser.add_argument("--load", type=int, default=0, help="other busy processes")
    parser.add_argument("--flights", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=12.0)
    given = parser.parse_args()
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(given.load)]
    gaps, stops = [], []
    try:
        for _ in range(given.flights):
            with tempfile.TemporaryDirectory() as folder:
                said, flying, stopped = flight(given.spf, folder, given.seconds)
            if not flying or not stopped:
                sys.exit("the flight ended before it could be stopped")
            sticks = [at for at, text in said if text.startswith("rc ") and flying + 1.0 < at < stopped]
            gaps += [later - earlier for earlier, later in zip(sticks, sticks[1:])]
            stops.append(min(at for at, text in said if at >= stopped and text in ("rc 0 0 0 0", "land")) - stopped)
    finally:
        for process in busy:
            process.kill()
    gaps.sort()
    p99, most = gaps[int(0.99 * len(gaps))], gaps[-1]
    print(f"{given.flights} flights, {given.load} busy processes, {len(gaps)} intervals between stick commands:")
    print(f"median {1e3 * statistics.median(gaps):.0f} ms, p99 {1e3 * p99:.0f} ms, longest {1e3 * most:.0f} ms; setpoints are due every 100 ms")
    print(f"from SIGINT to zero or land: {', '.join(f'{1e3 * stop:.0f}' for stop in sorted(stops))} ms")
    ok = p99 <= 1.2 * NOMINAL and max(stops) <= 0.2
    print("within bounds (p99 120 ms, stop 200 ms)" if ok else "OUT OF BOUNDS (p99 120 ms, stop 200 ms)")
    sys.exit(0 if ok else 1)


if __name__ == "__main__":
    main()
