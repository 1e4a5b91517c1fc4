#!/usr/bin/env python3
"""Kills recording flights at random moments and checks the contents of their logs.

    cargo build --release && python3 docs/bench/kill.py target/release/spf 100

Each flight is on the wall clock and is killed (SIGKILL) between one and eight seconds after the start of its log. The log is repaired
and must then be complete. Printed is the lost part of the flight: from the latest message to the kill.
"""
import concurrent.futures
import json
import pathlib
import random
import subprocess
import sys
import tempfile
import time


def one(spf, folder, number):
    draw = random.Random(number)
    out = folder / str(number)
    command = [spf, "fly", "fly to the red crane", "--realtime", "--no-video", "--seed", str(number), "--out", str(out)]
    flight = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    log = out / "flight.mcap"
    begun = time.time()
    while not log.exists():
        assert flight.poll() is None and time.time() < begun + 120, "the flight did not begin"
        time.sleep(0.005)
    time.sleep(draw.uniform(1, 8))
    killed = time.time()
    flight.kill()
    flight.wait()
    subprocess.run([spf, "log", "repair", str(log)], check=True, stdout=subprocess.DEVNULL, timeout=60)
    told = subprocess.run([spf, "log", "info", "--json", str(log)], check=True, stdout=subprocess.PIPE, timeout=60)
    info = json.loads(told.stdout)
    assert info["whole"] and info["instruction"] == "fly to the red crane", info
    return killed - info["started_at_ns"] / 1e9 - info["until_s"]


def main():
    spf, flights = sys.argv[1], int(sys.argv[2])
    lost, failed = [], 0
    with tempfile.TemporaryDirectory() as folder, concurrent.futures.ThreadPoolExecutor(4) as pool:
        for result in [pool.submit(one, spf, pathlib.Path(folder), number) for number in range(flights)]:
            try:
                lost.append(result.result())
            except Exception as error:
                failed += 1
                print(f"a log was lost: {error}", file=sys.stderr)
    lost.sort()
    print(f"{len(lost)} of {flights} logs open whole after repair; lost of the flight: median {lost[len(lost) // 2]:.2f} s, most {lost[-1]:.2f} s")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
