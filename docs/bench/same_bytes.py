#!/usr/bin/env python3
"""Checks whether a change leaves flights unchanged, byte for byte.

    python3 docs/bench/same_bytes.py BEFORE AFTER     # two binaries of spf, built from the two states
    python3 docs/bench/same_bytes.py --print SPF      # output of one binary, one line per item

Creates with each binary, and compares:
- rows of `spf bench run`: the 34 tasks of the suite `paper`, one trial each, by two methods (`spf` and `plain`), with the
  oracle's default errors; the field `git_rev`, which names the source of the binary, is omitted;
- an image of each of the four scenes from its start, with depth and ids, and their numbers of triangles and materials;
- all files of two flights with their videos (quad in the city, Tello in the office); of the log the messages of each topic,
  without the wall-clock times around them.

One line `same` or `DIFFERS` per item; exit code 1 if anything differs. Two binaries take about three minutes on two cores.
"""

import argparse
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile

SCENES = ["city", "park", "office", "yard"]
METHODS = ["spf", "plain"]
TAKEN = re.compile(r" +[0-9.]+ s +[0-9.]+ s +[0-9.]+ MB$", re.MULTILINE)
FLIGHTS = {
    "city": ["Take off and fly to the red crane", "--seed", "1"],
    "office": ["fly to the door", "--seed", "2", "--scene", "office", "--drone-model", "tello", "--avoid"],
}


def digest(data: bytes) -> str:
    return f"{hashlib.sha256(data).hexdigest()[:32]} {len(data)} bytes"


def run(command: list[str], folder: str, codes: tuple[int, ...] = (0,)) -> str:
    # Without the user's configuration: the bytes depend on the command alone.
    environment = {name: value for name, value in os.environ.items() if not name.startswith("SPF_")}
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, env=environment)
    if done.returncode not in codes:
        sys.exit(f"{' '.join(command)}: exit code {done.returncode}\n{done.stderr}")
    return done.stdout


def rows(spf: str, folder: str) -> dict[str, str]:
    command = [spf, "bench", "run", "--suite", "paper", "--trials", "1", "--vlm", "oracle:default"]
    run([*command, "--method", ",".join(METHODS), "-o", "bench"], folder)
    made: dict[str, list[str]] = {}
    with open(os.path.join(folder, "bench", "results.jsonl"), encoding="utf-8") as file:
        for line in file:
            row = json.loads(line)
            row.pop("git_rev", None)
            made.setdefault(row["method"], []).append(json.dumps(row))
    if any(len(made.get(method, [])) != 34 for method in METHODS):
        sys.exit(f"expected 34 rows a method, got { {method: len(lines) for method, lines in made.items()} }")
    return {f"rows of {method}": digest("\n".join(lines).encode()) for method, lines in made.items()}


def scenes(spf: str, folder: str) -> dict[str, str]:
    # Time and memory used are at the end of a scene's line.
    numbers = TAKEN.sub("", run([spf, "sim", "scenes", "--stats"], folder))
    made = {"scenes' numbers": digest(numbers.encode())}
    for scene in SCENES:
        names = [f"{scene}.png", f"{scene}-depth.png", f"{scene}-ids.png"]
        run([spf, "sim", "render", scene, "-o", names[0], "--depth", names[1], "--ids", names[2]], folder)
        for name in names:
            with open(os.path.join(folder, name), "rb") as file:
                made[f"picture {name}"] = digest(file.read())
    return made


# Wall-clock times are outside the messages of a log. Images are encoded in a separate thread, so their position among the messages
# of other topics is random.
def log(path: str, spf: str, folder: str) -> dict[str, str]:
    topics: dict[str, list[str]] = {}
    for line in run([spf, "log", "cat", path], folder).splitlines():
        topics.setdefault(json.loads(line)["topic"], []).append(line)
    return {f"flight.mcap {topic}": digest("\n".join(lines).encode()) for topic, lines in sorted(topics.items())}


def flights(spf: str, folder: str) -> dict[str, str]:
    made = {}
    for name, words in FLIGHTS.items():
        out = os.path.join(folder, f"flight-{name}")
        # The result of the flight does not matter, only that it is the same.
        run([spf, "fly", *words, "--out", out], folder, codes=(0, 3, 4))
        for file_name in sorted(os.listdir(out)):
            path = os.path.join(out, file_name)
            if file_name == "flight.mcap":
                made |= {f"flight {name}: {what}": value for what, value in log(path, spf, folder).items()}
                continue
            with open(path, "rb") as file:
                made[f"flight {name}: {file_name}"] = digest(file.read())
    return made


def made_by(spf: str) -> dict[str, str]:
    folder = tempfile.mkdtemp(prefix="spf-same-bytes-")
    try:
        return rows(spf, folder) | scenes(spf, folder) | flights(spf, folder)
    finally:
        shutil.rmtree(folder)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--print", action="store_true", help="print what one binary makes, and compare nothing")
    parser.add_argument("spf", nargs="+", help="a binary of spf; two are compared")
    given = parser.parse_args()
    if len(given.spf) != (1 if given.print else 2):
        parser.error("two binaries are compared; one is printed with --print")
    made = [made_by(os.path.abspath(spf)) for spf in given.spf]
    if given.print:
        for name, value in made[0].items():
            print(f"{name}: {value}")
        return
    before, after = made
    differs = 0
    for name in before | after:
        same = before.get(name) == after.get(name)
        differs += not same
        print(f"{'same   ' if same else 'DIFFERS'} {name}: {before.get(name)}" + ("" if same else f" | {after.get(name)}"))
    print(f"{len(before | after) - differs} same, {differs} differ")
    sys.exit(1 if differs else 0)


if __name__ == "__main__":
    main()
