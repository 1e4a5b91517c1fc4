#!/usr/bin/env python3
"""Flies instructions of people in a hurry, and prints how many were understood and how many were fulfilled.

    python3 docs/trials/hundred.py target/release/spf docs/trials/own_hundred.tsv OUT_FOLDER [--seed 0]

A line of the file: scene, instruction, and the keys of the objects any of which is right, those of several steps joined by
` > `; or `absent`, or `nonsense`. Only the last step is evaluated, because the summary names no other targets.

understood: all targets of the last step are among the right ones; of `absent` and `nonsense`, that there are none.
fulfilled: understood, and reached and not refuted by ground truth; `absent`: the flight ends without belief in having arrived;
`nonsense`: exit code 2, nothing flown.
"""

import argparse
import json
import os
import re
import subprocess
from collections import Counter
from concurrent.futures import ThreadPoolExecutor


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("spf")
    parser.add_argument("instructions")
    parser.add_argument("out")
    parser.add_argument("--seed", default="0")
    given = parser.parse_args()
    with open(given.instructions, encoding="utf-8") as file:
        rows = [line.rstrip("\n").split("\t") for line in file if line.strip()]

    def fly(job):
        number, (scene, text, _) = job
        command = [given.spf, "fly", text, "--scene", scene, "--seed", given.seed, "--no-video", "--json"]
        command += ["--out", os.path.join(given.out, f"{number:03d}")]
        run = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "RAYON_NUM_THREADS": "1"})
        return run.returncode, json.loads(run.stdout) if run.stdout else {}

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        flights = list(pool.map(fly, enumerate(rows)))
    understood, fulfilled, all_of = Counter(), Counter(), Counter()
    for (scene, text, expected), (code, summary) in zip(rows, flights):
        kind = expected if expected in ("absent", "nonsense") else "named"
        right = [key.strip() for key in expected.split(" > ")[-1].split(",")]
        targets = summary.get("targets", [])
        among = all(any(re.fullmatch(re.escape(key) + r"(_\d+)?", target) for key in right) for target in targets)
        outcome = summary.get("outcome", "none")
        if kind == "named":
            read = bool(targets) and among
            done = read and outcome == "reached" and summary["verified"] is not False
        else:
            read = not targets
            done = code == 2 if kind == "nonsense" else read and outcome != "reached"
        all_of[kind] += 1
        understood[kind] += read
        fulfilled[kind] += done
        if not done:
            print(f"{scene}\t{text}\t{expected}\tread as {', '.join(targets[:4]) or 'nothing'}\t{outcome}, exit code {code}")
    for kind in all_of:
        print(f"{kind}: {understood[kind]} understood, {fulfilled[kind]} fulfilled, of {all_of[kind]}")


if __name__ == "__main__":
    main()
