#!/usr/bin/env python3
"""Flies Luanti (Minetest) through its window to the red tower, and judges by a log that the game's own mod writes.

    docs/trials/luanti.py target/release/spf 10 -o OUT

Needs Debian's minetest, xvfb, openbox, libgl1-mesa-dri, and Pillow for examples/exec_blob.py. The game runs on a display of its own. A mod
places a red and a blue tower, sets the player down, and writes the player's pose ten times a second. It moves nobody: the flights
are made of keys and mouse alone, and the model that points sees pixels alone. Success: the craft ends within 5 m of the surface of the red
tower, as reported by the log, and `spf` says that it has reached it. Prints one JSON line per flight, and writes poses, log and
film of each to OUT.
"""
import argparse
import json
import math
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
GAME = shutil.which("minetest") or shutil.which("luanti") or "/usr/games/minetest"
NEAR_M = 5.0

CONF = """name = pilot
creative_mode = true
enable_damage = false
free_move = true
screen_w = 960
screen_h = 720
mg_name = flat
mg_flags = nocaves,nodungeons,nodecorations,light
enable_sound = false
fps_max = 15
fps_max_unfocused = 15
viewing_range = 80
enable_clouds = false
mouse_sensitivity = 0.2
fov = 72
"""

WORLD = """gameid = minetest
backend = sqlite3
player_backend = sqlite3
auth_backend = sqlite3
mg_name = flat
load_mod_towers = true
"""

# Towers of 2×2 blocks from the ground (y = 9) to y = 24; a block is a metre.
MOD = """
local start = {x = %(x).2f, y = 13, z = %(z).2f}
local red, blue = {x = %(red)d, z = 40}, {x = %(blue)d, z = 44}
local poses = io.open(minetest.get_worldpath() .. "/poses.tsv", "w")
minetest.register_on_joinplayer(function(player)
  minetest.set_player_privs(player:get_player_name(), {fly = true, interact = true})
  player:set_pos(start)
  player:set_look_horizontal(%(look).4f)
  player:set_look_vertical(0)
  minetest.set_timeofday(0.5)
  minetest.after(2, function()
    for y = 9, 24 do for x = 0, 1 do for z = 0, 1 do
      minetest.set_node({x = red.x + x, y = y, z = red.z + z}, {name = "wool:red"})
      minetest.set_node({x = blue.x + x, y = y, z = blue.z + z}, {name = "wool:blue"})
    end end end
  end)
end)
local passed = 0
minetest.register_globalstep(function(step)
  passed = passed + step
  if passed < 0.1 then return end
  passed = 0
  for _, player in ipairs(minetest.get_connected_players()) do
    local at = player:get_pos()
    poses:write(string.format("%%.2f\\t%%.3f\\t%%.3f\\t%%.3f\\t%%.2f\\n", minetest.get_us_time() / 1e6, at.x, at.y, at.z,
      math.deg(player:get_look_horizontal())))
    poses:flush()
  end
end)
"""


class Programs:
    """Programs that are ended in reverse order."""

    def __init__(self):
        self.running = []

    def start(self, args, **more):
        quiet = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        program = subprocess.Popen(args, **{**quiet, **more})
        self.running.append(program)
        return program

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for program in reversed(self.running):
            program.terminate()
            try:
                program.wait(5)
            except subprocess.TimeoutExpired:
                program.kill()
                program.wait()


def course(number):
    """Where flight `number` starts and where the towers stand: 38 to 42 m ahead, the red one within 30° of the first look."""
    draw = random.Random(number)
    x, z = draw.uniform(-3, 3), draw.uniform(-2, 2)
    red = draw.choice([-1, 1]) * draw.randint(2, 12)
    blue = -red - (12 if red > 0 else -12)
    # Look is counter-clockwise in radians.
    look = math.radians(draw.uniform(-12, 12))
    return {"x": x, "z": z, "red": red, "blue": blue, "look": look}


def distance(at, tower_x, tower_z=40):
    """Metres from a place to the surface of a tower. A node reaches half a metre to each side of its place."""
    def beyond(value, low, high):
        return max(low - value, 0, value - high)
    # The pose is that of the feet; the eyes are 1.6 m higher.
    x, y, z = at
    return math.hypot(beyond(x, tower_x - 0.5, tower_x + 1.5), beyond(y + 1.6, 8.5, 24.5), beyond(z, tower_z - 0.5, tower_z + 1.5))


def poses(path):
    with open(path, encoding="ascii") as lines:
        rows = [line.split("\t") for line in lines if line.endswith("\n")]
    return [tuple(map(float, row)) for row in rows if len(row) == 5]


def display(programs, env, size="1280x900x24"):
    """Starts a display with a window manager; its name."""
    read, write = os.pipe()
    programs.start(["Xvfb", "-displayfd", str(write), "-noreset", "-nolisten", "tcp", "-screen", "0", size], pass_fds=[write])
    os.close(write)
    with os.fdopen(read) as number:
        name = ":" + number.readline().strip()
    mark = os.path.join(env["HOME"], "ready")
    programs.start(["openbox", "--sm-disable", "--startup", f"touch {mark}"], env={**env, "DISPLAY": name})
    wait("the window manager", lambda: os.path.exists(mark))
    return name


def wait(what, until, patience=60):
    begun = time.monotonic()
    while not until():
        if time.monotonic() - begun > patience:
            sys.exit(f"waited in vain for {what}")
        time.sleep(0.1)


def game(programs, folder, env, drawn):
    """Starts the game in a new world; the path of its log of poses."""
    world = os.path.join(folder, "worlds", "w")
    mod = os.path.join(world, "worldmods", "towers")
    os.makedirs(mod)
    for path, text in [
        (os.path.join(folder, "mt.conf"), CONF),
        (os.path.join(world, "world.mt"), WORLD),
        (os.path.join(mod, "mod.conf"), "name = towers\ndepends = wool\n"),
        (os.path.join(mod, "init.lua"), MOD % drawn),
    ]:
        with open(path, "w", encoding="ascii") as file:
            file.write(text)
    args = ["--config", os.path.join(folder, "mt.conf"), "--world", world, "--go", "--gameid", "minetest", "--name", "pilot"]
    programs.start([GAME, *args], env={**env, "MINETEST_USER_PATH": folder, "LIBGL_ALWAYS_SOFTWARE": "1"})
    log = os.path.join(world, "poses.tsv")
    wait("the game", lambda: os.path.exists(log) and len(poses(log)) > 60, 120)
    return log


def fly(spf, number, out, instruction, extra):
    drawn = course(number)
    with tempfile.TemporaryDirectory() as folder, Programs() as programs:
        env = {**os.environ, "HOME": folder, "XDG_CONFIG_HOME": folder, "SPF_NEAR_M": "3"}
        env["DISPLAY"] = display(programs, env)
        log = game(programs, folder, env, drawn)
        target = os.path.join(out, f"{number:02}")
        vlm = f"exec:{sys.executable} {os.path.join(ROOT, 'examples', 'exec_blob.py')}"
        begun = time.monotonic()
        flight = subprocess.run(
            [os.path.abspath(spf), "fly", instruction, "--drone", "screen:luanti", "--vlm", vlm, "--no-vlm-check", "--unattended",
             "--at-end", "land", "--max-queries", "200", "--out", target, "--json", *extra],
            env=env, cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False)
        took = time.monotonic() - begun
        time.sleep(0.5)
        flown = poses(log)
        os.makedirs(target, exist_ok=True)
        shutil.copy(log, target)
    with open(os.path.join(target, "spf.txt"), "w", encoding="utf-8") as file:
        file.write(flight.stderr)
    summary = json.loads(flight.stdout) if flight.stdout.strip() else {}
    start, end = flown[0][1:4], flown[-1][1:4]
    red, blue = distance(end, drawn["red"]), distance(end, drawn["blue"], 44)
    reached = flight.returncode == 0
    return {
        "flight": number, "code": flight.returncode, "outcome": summary.get("outcome"), "cause": summary.get("cause"),
        "success": reached and red <= NEAR_M, "to_red_m": round(red, 2), "to_blue_m": round(blue, 2),
        "at_start_m": round(distance(start, drawn["red"]), 2), "decisions": summary.get("decisions"), "seconds": round(took, 1),
    }


def run(doc, fly, flights, first, out):
    """Flies as often as the command line says, with these defaults; `fly` gives the result of one flight. Prints a JSON line for each."""
    parser = argparse.ArgumentParser(description=doc.splitlines()[0])
    parser.add_argument("spf")
    parser.add_argument("flights", type=int, nargs="?", default=flights)
    parser.add_argument("-o", "--out", default=out)
    parser.add_argument("--first", type=int, default=first, help="number of the first flight, which draws its course")
    parser.add_argument("--instruction", default="fly to the red tower")
    known, extra = parser.parse_known_args()
    # Ended by a signal, the programs are ended as well.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    os.makedirs(known.out, exist_ok=True)
    good = 0
    for number in range(known.first, known.first + known.flights):
        result = fly(known.spf, number, os.path.abspath(known.out), known.instruction, extra)
        good += result["success"]
        print(json.dumps(result), flush=True)
    print(json.dumps({"flights": known.flights, "successes": good}), flush=True)
    return 0 if good == known.flights else 3


if __name__ == "__main__":
    sys.exit(run(__doc__, fly, 10, 1, "luanti-flights"))
