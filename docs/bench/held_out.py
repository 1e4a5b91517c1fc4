#!/usr/bin/env python3
"""Condenses runs of `spf bench run` to a table that compares methods pair by pair, as `docs/tables` reads it.

    python3 docs/bench/held_out.py NAME=DIR... > TABLE.tsv

NAME says what was flown. The first method of a run is the one with which the others are compared: by the pairs of flights of the
same task, VLM and seed of which only one was fulfilled, with the exact McNemar test, corrected by Holm's method for all rows.
"""

import json
import math
import os
import sys


def rows(folder):
    with open(os.path.join(folder, "results.jsonl"), encoding="utf-8") as file:
        return [json.loads(line) for line in file]


def mcnemar(one, other):
    """Two-sided probability that discordant pairs differ at least this much by chance."""
    pairs = one + other
    if pairs == 0:
        return 1.0
    tail = sum(math.comb(pairs, k) for k in range(min(one, other) + 1)) / 2**pairs
    return min(1.0, 2 * tail)


def holm(values):
    """The values, corrected for their number."""
    order, least, corrected = sorted(range(len(values)), key=values.__getitem__), 0.0, list(values)
    for place, index in enumerate(order):
        least = max(least, min(1.0, (len(values) - place) * values[index]))
        corrected[index] = least
    return corrected


def main():
    table, probabilities = [], []
    for argument in sys.argv[1:]:
        name, _, folder = argument.partition("=")
        flights = rows(folder)
        methods = dict.fromkeys(row["method"] for row in flights)
        for vlm in dict.fromkeys(row["vlm"] for row in flights):
            def of(method):
                chosen = (row for row in flights if row["method"] == method and row["vlm"] == vlm)
                return {(row["task"], row["seed"]): row for row in chosen}

            ordered = sorted(methods, key=lambda name: (name != "spf", name))
            first = of(ordered[0])
            for method in ordered:
                mine = of(method)
                done = [row for row in mine.values() if row["scores"]["self_stop"]]
                touched = sum(row["scores"]["collided"] for row in mine.values())
                late = sum(row["scores"]["timeout"] for row in mine.values())
                seconds = sum(row["completion_time_s"] for row in done) / max(1, len(done))
                cells = [name, f"`{vlm}`", f"`{method}`", f"{len(done)}/{len(mine)} %", touched, late, f"{seconds:.0f}"]
                if method == ordered[0]:
                    table.append([*cells, "", None])
                    continue
                won = sum(mine[key]["scores"]["self_stop"] and not first[key]["scores"]["self_stop"] for key in mine)
                lost = sum(first[key]["scores"]["self_stop"] and not mine[key]["scores"]["self_stop"] for key in mine)
                probabilities.append(mcnemar(won, lost))
                table.append([*cells, f"{won}, {lost}", len(probabilities) - 1])
    corrected = holm(probabilities)
    print("# $ python3 docs/bench/held_out.py NAME=DIR... > TABLE.tsv")
    heads = ["flights", "VLM", "method", "fulfilled", "touched:right", "timeout:right", "mean time, s:right"]
    print("\t".join([*heads, "only it, only the first:right", "p:right"]))
    for row in table:
        chance = "" if row[-1] is None else f"{corrected[row[-1]]:.2g}"
        print("\t".join(map(str, [*row[:-1], chance])))


if __name__ == "__main__":
    main()
