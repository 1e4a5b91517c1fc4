#!/usr/bin/env python3
"""Flies the simulator through its window to a red tower, and judges by the true poses that the simulator writes.

    docs/trials/window.py target/debug/spf 20 -o OUT

Needs xvfb, openbox, and Pillow for examples/exec_blob.py. `spf sim window` runs on a display of its own with a meadow, a red and a blue
tower and some trees, and is flown by `--drone screen:spf-window`: keys alone, and the model that points sees pixels alone. The number of
a flight is the simulator's seed, and draws the start and the places of the towers. Success: the craft ends, over ground, within 5 m of
the surface of the red tower by the true pose, it has touched nothing, and `spf` says that it has reached it. Prints one JSON line per
flight, and writes the true poses and the log of each to OUT.
"""
import json
import math
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time

sys.dont_write_bytecode = True  # no folder beside the scripts

from luanti import ROOT, Programs, display, run, wait  # beside this file

NEAR_M = 5.0
HALF_M = 1.0  # half the width of a tower

SCENE = """
format = 1
name = "towers"
craft = "quad"
start = "0,0,0,0"
success_radius_m = 5.0
near_m = 3.0
bounds = {{ east = [-80, 80], north = [-60, 100], up = [-1, 60] }}

[materials]
meadow = {{ colour = "#64904a", accent = "#56803e", pattern = "grass" }}
red_board = {{ colour = "#c3211c" }}
blue_board = {{ colour = "#1d4f9e" }}

[templates.tower]
mesh = {{ kind = "carton", size = [2.0, 2.0, 16.0] }}
names = ["tower"]
kind = "tower"

[[objects]]
id = "meadow"
position = [0.0, 20.0, 0.02]
mesh = {{ kind = "slab", size = [158.0, 158.0], thickness = 0.5 }}
materials = {{ top = "meadow" }}
names = ["meadow"]
kind = "ground"

[[objects]]
id = "red_tower"
like = "tower"
position = [{red}, 40.0]
materials = {{ body = "red_board", tape = "red_board" }}
colour = "red"

[[objects]]
id = "blue_tower"
like = "tower"
position = [{blue}, 44.0]
materials = {{ body = "blue_board", tape = "blue_board" }}
colour = "blue"

[[objects]]
id = "tree"
mesh = {{ kind = "tree", style = "broadleaf", height = 7.5 }}
places = [[-28.0, 30.0, 0.0], [30.0, 35.0, 40.0], [-20.0, 62.0, 80.0], [4.0, 70.0, 120.0], [25.0, 66.0, 200.0], [-40.0, 50.0, 10.0]]
names = ["tree"]
kind = "tree"
"""


def distance(at, red):
    """Metres from a place to the surface of the red tower, over ground."""
    return math.hypot(max(abs(at[0] - red) - HALF_M, 0), max(abs(at[1] - 40) - HALF_M, 0))


def course(number):
    """The scene of flight `number`, the place of its red tower, and its start: 38 to 42 m before it, the tower within 30° of the first look."""
    draw = random.Random(number)
    east, north = draw.uniform(-3, 3), draw.uniform(-2, 2)
    red = draw.choice([-1, 1]) * draw.randint(2, 12)
    blue = -red - (12 if red > 0 else -12)
    start = f"{east:.2f},{north:.2f},0,{draw.uniform(-12, 12):.1f}"
    return SCENE.format(red=float(red), blue=float(blue)), red, start


def truth(path):
    """Seconds, east, north, up, heading in degrees, and the number of things touched until then."""
    with open(path, encoding="ascii") as lines:
        rows = [line.split("\t") for line in lines if line.endswith("\n")]
    return [tuple(map(float, row)) for row in rows if len(row) == 6]


def fly(spf, number, out, instruction, extra):
    spf = os.path.abspath(spf)
    scene, red, start = course(number)
    with tempfile.TemporaryDirectory() as folder, Programs() as programs:
        env = {**os.environ, "HOME": folder, "XDG_CONFIG_HOME": folder}
        env["DISPLAY"] = display(programs, env)
        log = os.path.join(folder, "truth.tsv")
        world = os.path.join(folder, "towers.toml")
        with open(world, "w", encoding="ascii") as file:
            file.write(scene)
        programs.start([spf, "sim", "window", world, "--seed", str(number), "--start", start, "--fps", "15", "--truth", log],
                       env=env, cwd=folder)
        wait("the simulator", lambda: os.path.exists(log) and len(truth(log)) > 20)
        target = os.path.join(out, f"{number:02}")
        vlm = f"exec:{sys.executable} {os.path.join(ROOT, 'examples', 'exec_blob.py')}"
        flight = subprocess.run(
            [spf, "fly", instruction, "--drone", "screen:spf-window", "--vlm", vlm, "--no-vlm-check", "--unattended", "--at-end",
             "land", "--max-queries", "200", "--out", target, "--json", *extra],
            env=env, cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False)
        time.sleep(0.5)
        flown = truth(log)
        os.makedirs(target, exist_ok=True)
        shutil.copy(log, target)
    with open(os.path.join(target, "spf.txt"), "w", encoding="utf-8") as file:
        file.write(flight.stderr)
    summary = json.loads(flight.stdout) if flight.stdout.strip() else {}
    first, last = flown[0], flown[-1]
    moving = [row for before, row in zip(flown, flown[1:]) if math.dist(before[1:4], row[1:4]) > 0.01]
    off = distance(last[1:3], red)
    return {
        "flight": number, "code": flight.returncode, "outcome": summary.get("outcome"), "cause": summary.get("cause"),
        "success": flight.returncode == 0 and off <= NEAR_M and last[5] == 0, "to_red_m": round(off, 2), "touched": int(last[5]),
        "at_start_m": round(distance(first[1:3], red), 2), "decisions": summary.get("decisions"),
        "flown_m": round(sum(math.dist(a[1:4], b[1:4]) for a, b in zip(flown, flown[1:])), 1),
        "seconds": round(moving[-1][0] - moving[0][0], 1) if moving else 0.0, "load": round(os.getloadavg()[0], 1),
    }


if __name__ == "__main__":
    sys.exit(run(__doc__, fly, 20, 0, "window-flights"))
