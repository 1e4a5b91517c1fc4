#!/usr/bin/env python3
"""Cost of recording a flight on the wall clock: CPU time of the log's own thread, and disk space.

    cargo build --release && python3 docs/bench/record_cost.py target/release/spf 60

Flies twice, with images and without. The thread that writes the log receives complete messages; images are encoded and messages
created in other threads of the flight, so the time of the whole process is printed too.
"""
import os
import pathlib
import subprocess
import sys
import tempfile
import time

TICK = os.sysconf("SC_CLK_TCK")


def cpu(stat):
    """Seconds of CPU in a line of /proc/…/stat, and the thread's name."""
    name, _, rest = stat.partition(") ")
    fields = rest.split()
    return name.partition("(")[2], (int(fields[11]) + int(fields[12])) / TICK


def watch(flight):
    """The latest figures of a process until it ends: by thread name, and in total."""
    threads, whole = {}, 0.0
    tasks = pathlib.Path(f"/proc/{flight.pid}/task")
    while flight.poll() is None:
        try:
            seen = {}
            for task in tasks.iterdir():
                name, seconds = cpu((task / "stat").read_text())
                seen[name] = seen.get(name, 0.0) + seconds
            threads.update({name: max(seconds, threads.get(name, 0.0)) for name, seconds in seen.items()})
            whole = max(whole, cpu(pathlib.Path(f"/proc/{flight.pid}/stat").read_text())[1])
        except OSError:
            pass
        time.sleep(0.2)
    return threads, whole


def main():
    spf, seconds = sys.argv[1], sys.argv[2]
    for name, extra in [("with pictures", []), ("without", ["--no-video"])]:
        with tempfile.TemporaryDirectory() as folder:
            out = pathlib.Path(folder) / "flight"
            command = [spf, "fly", "fly to the red crane", "--realtime", "--max-time", seconds, "--out", str(out), *extra]
            begun = time.monotonic()
            threads, whole = watch(subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
            wall = time.monotonic() - begun
            size = (out / "flight.mcap").stat().st_size
            log = threads.get("flight log", 0.0)
            print(
                f"{name}: {wall:.0f} s, log thread {100 * log / wall:.2f} % of a core, "
                f"process {100 * whole / wall:.0f} %, {60 * size / wall / 1e6:.1f} MB a minute"
            )


if __name__ == "__main__":
    main()
