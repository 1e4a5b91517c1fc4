#!/usr/bin/env python3
"""A "VLM" without a model: points at the largest thing of the colour that the instruction names.

    spf fly "Take off and fly to the red crane" --vlm "exec:python3 examples/exec_blob.py"

Reads one JSON line per query from standard input and writes one JSON line per reply to standard output
(docs/guide/vlm.md). It sees pixels only. Needs Pillow.
"""

import colorsys
import json
import math
import sys

from PIL import Image

# Hue in degrees and its tolerance, with the least saturation and value.
COLOURS = {
    "red": (355, 14, 0.42, 0.25),
    "orange": (25, 12, 0.6, 0.4),
    "yellow": (50, 14, 0.5, 0.4),
    "green": (125, 35, 0.45, 0.2),
    "blue": (220, 28, 0.45, 0.25),
    "purple": (285, 25, 0.4, 0.25),
}
WIDTH = 320  # Images are searched at this width.
GAP = 3  # Pixels at most this far apart belong together: a lattice is one thing.
LEAST = 8  # Number of pixels in the smallest blob that counts.
ROWS = 12  # Rows around the aim in which the width is measured, where it is narrow: a jib is wider than its mast ...
WIDTH_M = 2.0  # ... of things, which are assumed to be this wide so that their distance can be guessed.
HALF_WIDTH = 1.0  # Tangent of half the camera's horizontal field of view.
HIGH = 0.2  # Aim this far below the image's upper edge (fraction of its height): low things block the way lower down.
NEAR_M = 4.0  # A thing that seems to be this near counts as reached.


def blobs(image, hue, tolerance, saturation, value):
    """The connected pixels of a colour, as lists of (x, y), and the size of the image searched."""
    # No averaging: it would mix thin things with the sky behind them.
    small = image.resize((WIDTH, max(1, WIDTH * image.height // image.width)), Image.Resampling.NEAREST)
    pixels = small.load()
    wanted = set()
    for y in range(small.height):
        for x in range(small.width):
            h, s, v = colorsys.rgb_to_hsv(*(channel / 255 for channel in pixels[x, y]))
            if abs((360 * h - hue + 180) % 360 - 180) <= tolerance and s >= saturation and v >= value:
                wanted.add((x, y))
    found, reach = [], range(-GAP, GAP + 1)
    while wanted:
        blob, edge = [], [wanted.pop()]
        while edge:
            x, y = edge.pop()
            blob.append((x, y))
            for near in ((x + dx, y + dy) for dx in reach for dy in reach):
                if near in wanted:
                    wanted.remove(near)
                    edge.append(near)
        if len(blob) >= LEAST:
            found.append(blob)
    return found, small.size


def extent(blob):
    """Area of the box around a blob: a thin lattice counts as large as the area that it spans."""
    xs, ys = [x for x, _ in blob], [y for _, y in blob]
    return (max(xs) - min(xs) + 1) * (max(ys) - min(ys) + 1)


def aim(blob, height):
    """The pixel of a blob nearest to a high row of the image, and its width there."""
    row = min((y for _, y in blob), key=lambda y: abs(y - HIGH * height))
    rows = {}
    for x, y in blob:
        if abs(y - row) <= ROWS:
            rows.setdefault(y, []).append(x)
    widths = sorted(max(xs) - min(xs) + 1 for xs in rows.values())
    xs = sorted(rows[row])
    return xs[len(xs) // 2], row, widths[len(widths) // 4]


def reply(query, **known):
    """A reply in the form that the query's schema asks for: what is not known is null or empty."""
    fields = {"id": query["id"]}
    for name, field in query["schema"]["properties"].items():
        kinds = field.get("type", [])
        kinds = [kinds] if isinstance(kinds, str) else kinds
        empty = None if "null" in kinds else [] if "array" in kinds else "" if "string" in kinds else None
        fields[name] = known.get(name, empty)
    return fields


def answer(query):
    if query["kind"] == "declare":
        # Asked once, before take-off: it points, and lists no obstacles.
        return {"id": query["id"], "boxes": False}
    words = query["instruction"].lower().split()
    colour = next((word.strip(".,") for word in words if word.strip(".,") in COLOURS), None)
    if colour is None:
        return {"id": query["id"], "error": f"the instruction names none of {', '.join(COLOURS)}"}
    image = Image.open(query["image"]).convert("RGB")
    found, (width, height) = blobs(image, *COLOURS[colour])
    if not found:
        return reply(query, status="not_visible", look="right", stage=1, target=colour)
    x, y, across = aim(max(found, key=extent), height)
    distance = WIDTH_M * width / (2 * HALF_WIDTH * across)
    if distance <= NEAR_M:
        return reply(query, status="done", stage=1, target=colour)
    point = [round((x + 0.5) * query["width"] / width), round((y + 0.5) * query["height"] / height)]
    label = min(10, max(1, round(1 + 4.5 * math.log10(distance))))
    return reply(query, status="navigating", stage=1, point=point, depth=label, target=f"the {colour} thing")


for line in sys.stdin:
    print(json.dumps(answer(json.loads(line))), flush=True)
