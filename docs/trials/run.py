#!/usr/bin/env python3
"""Flies every instruction of a file with several seeds, oracles and presets, and prints a table of outcomes.

    python3 docs/trials/run.py target/release/spf docs/trials/twenty.txt OUT_FOLDER [SEEDS [SCENE]]

SEEDS is 5 and SCENE `city` unless given; `twenty.txt` is for the city, the others are named for their scene.

One letter a flight: V reached and verified by ground truth, u believed reached but not verified, n not found, t timeout,
C collision, a aborted, f failed, E no flight at all.
"""

import json
import os
import subprocess
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor

LETTERS = {"reached": "u", "not_found": "n", "timeout": "t", "collision": "C", "aborted": "a", "failed": "f"}
ORACLES = ["oracle", "oracle:perfect"]
PRESETS = ["default", "paper"]


def main() -> None:
    spf, instructions, out = sys.argv[1:4]
    seeds = range(int(sys.argv[4]) if len(sys.argv) > 4 else 5)
    scene = sys.argv[5] if len(sys.argv) > 5 else "city"
    with open(instructions, encoding="utf-8") as file:
        texts = [line.strip() for line in file if line.strip()]
    os.makedirs(out, exist_ok=True)
    columns = [(oracle, preset) for oracle in ORACLES for preset in PRESETS]
    jobs = [(i, seed, column) for column in columns for i in range(len(texts)) for seed in seeds]

    def fly(job):
        i, seed, (oracle, preset) = job
        folder = os.path.join(out, f"{i:02d}-{seed}-{oracle.replace(':', '_')}-{preset}")
        command = [spf, "fly", texts[i], "--seed", str(seed), "--vlm", oracle, "--preset", preset]
        command += ["--scene", scene, "--no-video", "--json", "--out", folder]
        run = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "RAYON_NUM_THREADS": "1"})
        try:
            return json.loads(run.stdout)
        except ValueError:
            print(run.stderr, file=sys.stderr)
            return {"outcome": "error", "verified": None}

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        flights = dict(zip(jobs, pool.map(fly, jobs)))

    def letter(flight):
        return "V" if flight["verified"] else LETTERS.get(flight["outcome"], "E")

    for column in columns:
        mine = [flight for (_, _, of), flight in flights.items() if of == column]
        outcomes = dict(Counter(flight["outcome"] for flight in mine))
        print(f"{column[0]}, preset {column[1]}: {sum(letter(f) == 'V' for f in mine)} of {len(mine)} verified; {outcomes}")
    print("\n| instruction | " + " | ".join(f"{oracle}, {preset}" for oracle, preset in columns) + " |")
    print("|---|" + "---|" * len(columns))
    for i, text in enumerate(texts):
        cells = ["".join(letter(flights[i, seed, column]) for seed in seeds) for column in columns]
        print(f"| {text} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
