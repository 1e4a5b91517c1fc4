#!/usr/bin/env python3
"""How much of a flight the craft stands and waits: its time divided by the time in which it moves.

    python3 docs/bench/time_moving.py FOLDER...

Each FOLDER is that of one flight. The time goes from the first setpoint that moves the craft to the end of the
instruction; it moves while the setpoint that the safety envelope lets pass is not zero. Needs `spf` on the PATH, or
its path in SPF. Prints a line per flight, and by outcome the median and the ratio of all seconds together.
"""
import csv
import json
import os
import statistics
import subprocess
import sys
import tempfile

AXES = ["cleared.right", "cleared.forward", "cleared.up", "cleared.yaw_rate"]


def ratio(folder):
    """Outcome, time of the instruction and time in motion of one flight, seconds."""
    with open(os.path.join(folder, "summary.json")) as file:
        summary = json.load(file)
    with tempfile.TemporaryDirectory() as scratch:
        table = os.path.join(scratch, "commands.csv")
        command = [os.environ.get("SPF", "spf"), "log", "export", folder, "--topic", "/command", "-o", table]
        subprocess.run(command, check=True, capture_output=True)
        with open(table, newline="") as file:
            rows = [row for row in csv.DictReader(file) if row["command"] == "setpoint"]
    setpoints = [(float(row["time_s"]), any(abs(float(row[axis] or 0)) > 1e-3 for axis in AXES)) for row in rows]
    began = next((time for time, moves in setpoints if moves), None)
    if began is None:
        return summary["outcome"], 0.0, 0.0
    ended = began + summary["completion_time_s"]
    within = [(time, moves) for time, moves in setpoints if began <= time < ended]
    times = [time for time, _ in within] + [ended]
    moving = sum(after - time for (time, moves), after in zip(within, times[1:]) if moves)
    return summary["outcome"], ended - began, moving


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    by_outcome = {}
    for folder in sys.argv[1:]:
        outcome, whole, moving = ratio(folder)
        share = whole / moving if moving else float("inf")
        print(f"{folder}: {outcome}, {whole:.1f} s, {moving:.1f} s in motion: {share:.2f}")
        by_outcome.setdefault(outcome, []).append((share, whole, moving))
    for outcome, flights in sorted(by_outcome.items()):
        shares, wholes, movings = zip(*flights)
        together = sum(wholes) / sum(movings) if sum(movings) else float("inf")
        print(f"{outcome}: median {statistics.median(shares):.2f} of {len(flights)} flights, {together:.2f} together")


if __name__ == "__main__":
    main()
