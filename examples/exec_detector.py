#!/usr/bin/env python3
"""An object detector in the VLM's place: points at the best detection of the noun and colour that the instruction names.

    spf model get nanodet
    spf fly "go to the person in green" --scene office --vlm "exec:python3 examples/exec_detector.py ~/.cache/spf/models/nanodet-3.0.4.onnx"

It is no VLM: it knows the nouns and colours of two tables, and no relations, parts, orders or events. What it does not know it says.
Any model of COCO's 80 classes with YOLOv8's input and output fits (docs/guide/detector.md). Reads one JSON line per query from standard
input and writes one JSON line per reply (docs/guide/vlm.md). Needs numpy, onnxruntime and Pillow.
"""

import colorsys
import json
import math
import re
import sys
from pathlib import Path

import numpy as np
import onnxruntime
from PIL import Image

# Nouns, with the number of their class in COCO and a usual height, metres.
NOUNS = {
    **dict.fromkeys(("person", "man", "woman", "guest", "somebody", "someone", "colleague"), (0, 1.7)),
    "bicycle": (1, 1.1), "bike": (1, 1.1), "car": (2, 1.5), "taxi": (2, 1.5), "motorcycle": (3, 1.2), "plane": (4, 4.0), "bus": (5, 3.1),
    "train": (6, 3.8), "truck": (7, 3.0), "van": (7, 2.2), "boat": (8, 1.5), "bench": (13, 0.9), "dog": (16, 0.6), "cat": (15, 0.3),
    "backpack": (24, 0.5), "umbrella": (25, 1.0), "bottle": (39, 0.3), "cup": (41, 0.1), "chair": (56, 1.0), "sofa": (57, 0.9),
    "couch": (57, 0.9), "plant": (58, 0.8), "bed": (59, 0.6), "table": (60, 0.8), "desk": (60, 0.8), "screen": (62, 0.4), "tv": (62, 0.6),
    "laptop": (63, 0.3), "refrigerator": (72, 1.7), "fridge": (72, 1.7), "clock": (74, 0.3), "vase": (75, 0.3),
}
# Hue in degrees and its tolerance, with the least saturation and value; then the colours without a hue: least and greatest value.
COLOURS = {"red": (355, 14, 0.42, 0.25), "orange": (25, 12, 0.6, 0.4), "yellow": (50, 14, 0.5, 0.4), "green": (125, 40, 0.35, 0.2),
           "blue": (215, 35, 0.35, 0.2), "purple": (285, 25, 0.4, 0.25)}
GREYS = {"black": (0.0, 0.3), "grey": (0.3, 0.7), "gray": (0.3, 0.7), "white": (0.75, 1.01)}
LEAST = 0.25  # Least score of a detection ...
OVERLAP = 0.45  # ... and how much two of one class may overlap.
SHOWN = 0.12  # Fraction of a box that must have the colour.
NEAR_M = 1.2  # What seems to be this near counts as reached, ...
TALL = 0.9  # ... and so does what fills this fraction of the picture's height: nearer, only a part of it is seen.
HALF_WIDTH = 1.0  # Tangent of half the camera's horizontal field of view.


def overlap(a, b):
    width, height = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    if min(width, height) <= 0:
        return 0.0
    return width * height / ((a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - width * height)


def detections(session, picture, kind):
    """Boxes of one class, as score and left, top, right, bottom in pixels of the picture, best first."""
    entry = session.get_inputs()[0]
    _, _, height, width = entry.shape
    scale = min(width / picture.width, height / picture.height)
    small = picture.resize((round(picture.width * scale), round(picture.height * scale)))
    sheet = Image.new("RGB", (width, height), (114, 114, 114))
    left, top = (width - small.width) // 2, (height - small.height) // 2
    sheet.paste(small, (left, top))
    rows = session.run(None, {entry.name: np.asarray(sheet, np.float32).transpose(2, 0, 1)[None] / 255})[0][0].T
    kept = []
    for at in np.argsort(-rows[:, 4 + kind]):
        score = float(rows[at, 4 + kind])
        if score < LEAST:
            break
        x, y, w, h = (float(value) for value in rows[at, :4])
        box = [(x - w / 2 - left) / scale, (y - h / 2 - top) / scale, (x + w / 2 - left) / scale, (y + h / 2 - top) / scale]
        box = [max(0.0, box[0]), max(0.0, box[1]), min(picture.width, box[2]), min(picture.height, box[3])]
        if all(overlap(box, other) <= OVERLAP for _, other in kept):
            kept.append((score, box))
    return kept


def share(picture, box, colour):
    """The fraction of a box's pixels that have a colour."""
    part = picture.crop([round(side) for side in box]).resize((24, 24))
    pixels = [colorsys.rgb_to_hsv(*(channel / 255 for channel in pixel)) for pixel in part.getdata()]
    if colour in GREYS:
        low, high = GREYS[colour]
        return sum(s < 0.25 and low <= v < high for _, s, v in pixels) / len(pixels)
    hue, tolerance, saturation, value = COLOURS[colour]
    fits = lambda h, s, v: abs((360 * h - hue + 180) % 360 - 180) <= tolerance and s >= saturation and v >= value
    return sum(fits(*pixel) for pixel in pixels) / len(pixels)


def reply(query, **known):
    """A reply in the form that the query's schema asks for: what is not known is null or empty."""
    fields = {"id": query["id"]}
    for name, field in query["schema"]["properties"].items():
        kinds = field.get("type", [])
        kinds = [kinds] if isinstance(kinds, str) else kinds
        empty = None if "null" in kinds else [] if "array" in kinds else "" if "string" in kinds else None
        fields[name] = known.get(name, empty)
    return fields


def answer(session, query):
    if query["kind"] == "declare":
        # Asked once, before take-off: it points, and lists no obstacles.
        return {"id": query["id"], "boxes": False}
    words = re.findall(r"[a-z]+", query["instruction"].lower())
    noun = next((word for word in words if word in NOUNS), None)
    colour = next((word for word in words if word in COLOURS or word in GREYS), None)
    if noun is None:
        return {"id": query["id"], "error": f"the instruction names none of {', '.join(NOUNS)}"}
    kind, tall = NOUNS[noun]
    target = f"{colour} {noun}" if colour else noun
    picture = Image.open(query["image"]).convert("RGB")
    found = detections(session, picture, kind)
    if colour:
        found = [(score, box) for score, box in found if share(picture, box, colour) >= SHOWN]
    if not found:
        return reply(query, status="not_visible", look="right", stage=1, target=target)
    _, (left, top, right, bottom) = found[0]
    distance = tall * picture.width / (2 * HALF_WIDTH * max(bottom - top, 1.0))
    if distance <= NEAR_M or bottom - top >= TALL * picture.height:
        return reply(query, status="done", stage=1, target=target)
    point = [round((left + right) / 2), round((top + bottom) / 2)]
    label = min(10, max(1, round(1 + 4.5 * math.log10(distance))))
    return reply(query, status="navigating", stage=1, point=point, depth=label, target=target)


if __name__ == "__main__":
    network = onnxruntime.InferenceSession(str(Path(sys.argv[1]).expanduser()))
    for line in sys.stdin:
        print(json.dumps(answer(network, json.loads(line))), flush=True)
