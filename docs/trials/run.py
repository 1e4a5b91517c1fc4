#!/usr/bin/env python3
"""Flies every instruction of a file with several seeds, oracles and presets, and prints a table of outcomes.

    python3 docs/trials/run.py target/release/spf docs/trials/twenty.txt OUT_FOLDER [--seeds 5] [--scene city]
        [--only ORACLE,PRESET] [--tsv FILE] [-- MORE FLAGS OF spf fly]

`twenty.txt` is for the city, the others are named for their scene. `--only oracle,default` flies one column of the table.

One letter per flight: V reached and verified by ground truth, u believed reached but not verified, n not found, t timeout,
C collision, a aborted, f failed, E no flight at all. The target is resolved by the oracle's parser (`verified_by`).

`--tsv` appends the letters to a file of the form of docs/results/trials-parser.tsv, and deletes each flight's log, which holds
its images.
"""

import argparse
import contextlib
import json
import os
import subprocess
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor

LETTERS = {"reached": "u", "not_found": "n", "timeout": "t", "collision": "C", "aborted": "a", "failed": "f"}
ORACLES = ["oracle", "oracle:perfect"]
PRESETS = ["default", "paper"]


def split(words: list[str], at: str) -> tuple[list[str], list[str]]:
    return words[: words.index(at)], words[words.index(at) + 1 :]


def main() -> None:
    own, more = (sys.argv[1:], []) if "--" not in sys.argv else split(sys.argv[1:], "--")
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("spf")
    parser.add_argument("instructions")
    parser.add_argument("out")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--scene", default="city")
    parser.add_argument("--tsv")
    parser.add_argument("--only", type=lambda text: tuple(text.split(",")))
    given = parser.parse_args(own)
    spf, instructions, out, seeds = given.spf, given.instructions, given.out, range(given.seeds)
    with open(instructions, encoding="utf-8") as file:
        texts = [line.strip() for line in file if line.strip()]
    os.makedirs(out, exist_ok=True)
    columns = [given.only] if given.only else [(oracle, preset) for oracle in ORACLES for preset in PRESETS]
    jobs = [(i, seed, column) for column in columns for i in range(len(texts)) for seed in seeds]

    def fly(job):
        i, seed, (oracle, preset) = job
        folder = os.path.join(out, f"{i:02d}-{seed}-{oracle.replace(':', '_')}-{preset}")
        command = [spf, "fly", texts[i], "--seed", str(seed), "--vlm", oracle, "--preset", preset]
        command += ["--scene", given.scene, "--no-video", "--json", "--out", folder, *more]
        run = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "RAYON_NUM_THREADS": "1"})
        if given.tsv:
            with contextlib.suppress(FileNotFoundError):
                os.remove(os.path.join(folder, "flight.mcap"))
        try:
            return json.loads(run.stdout)
        except ValueError:
            print(run.stderr, file=sys.stderr)
            return {"outcome": "error", "verified": None}

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        flights = dict(zip(jobs, pool.map(fly, jobs)))

    def letter(flight):
        is_verified = flight["outcome"] == "reached" and flight["verified"]
        return "V" if is_verified else LETTERS.get(flight["outcome"], "E")

    def letters(i, column):
        return "".join(letter(flights[i, seed, column]) for seed in seeds)

    if given.tsv:
        with open(given.tsv, "a", encoding="utf-8") as file:
            for (oracle, preset), (i, text) in ((column, line) for column in columns for line in enumerate(texts)):
                method = {"default": "spf", "paper": "spf-paper"}[preset] + ("-avoid" if "--avoid" in more else "")
                vlm = oracle if ":" in oracle else oracle + ":default"
                print(given.scene, text, method, vlm, letters(i, (oracle, preset)), sep="\t", file=file)
    for column in columns:
        mine = [flight for (_, _, of), flight in flights.items() if of == column]
        outcomes = dict(Counter(flight["outcome"] for flight in mine))
        print(f"{column[0]}, preset {column[1]}: {sum(letter(f) == 'V' for f in mine)} of {len(mine)} verified; {outcomes}")
        touched = Counter(touch["object"] for flight in mine for touch in flight.get("touched", []))
        print("    touched: " + (", ".join(f"{name} {count}" for name, count in touched.most_common()) or "nothing"))
    print("\n| instruction | " + " | ".join(f"{oracle}, {preset}" for oracle, preset in columns) + " |")
    print("|---|" + "---|" * len(columns))
    for i, text in enumerate(texts):
        print(f"| {text} | " + " | ".join(letters(i, column) for column in columns) + " |")


if __name__ == "__main__":
    main()
