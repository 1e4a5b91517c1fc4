"""How well published networks see in the simulator's pictures: recall of a detector by class and size, error of a depth network.

    spf model get nanodet && spf model get fastdepth
    for scene in city park office yard; do spf sim dataset --scene $scene -n 40 --seed 7 -o data-$scene; done
    python docs/bench/networks.py detector ~/.cache/spf/models/nanodet-3.0.4.onnx data-*
    python docs/bench/networks.py depth ~/.cache/spf/models/fastdepth-1.0.8-preview.onnx data-*

Needs numpy, pillow and onnxruntime. The picture is prepared and the boxes are kept as docs/guide/detector.md and docs/guide/obstacles.md
say. An object counts if at least half of it is in the frame and a detection of its class overlaps its pixels' box by 0.4 (intersection
over union).
"""

import json
import sys
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np
import onnxruntime
from PIL import Image

MEAN, DEVIATION = np.array([0.485, 0.456, 0.406]), np.array([0.229, 0.224, 0.225])
# COCO's classes that the scenes have, and the words for them in names of objects.
CLASSES = {0: ("person", "guest"), 1: ("bicycle",), 2: ("car", "taxi"), 5: ("bus",), 7: ("truck", "van"), 8: ("boat",), 13: ("bench",),
           41: ("cup", "mug"), 39: ("bottle",), 56: ("chair", "stool"), 57: ("sofa", "couch"), 58: ("plant", "cactus"), 62: ("computer", "tv"),
           74: ("clock",)}
NAMES = {0: "person", 1: "bicycle", 2: "car", 5: "bus", 7: "truck", 8: "boat", 13: "bench", 39: "bottle", 41: "cup", 56: "chair", 57: "couch",
         58: "potted plant", 62: "tv", 74: "clock"}
SIZES = (0, 24, 60, 120, 10_000)


def examples(folders):
    for folder in map(Path, folders):
        for line in (folder / "examples.jsonl").read_text().splitlines():
            yield folder, json.loads(line)


def class_of(folder, scene, key, tags={}):
    if scene not in tags:
        tags[scene] = {}
        for file in (folder / "legends").glob("*.json"):
            legend = json.loads(file.read_text())
            for row in legend if isinstance(legend, list) else legend["objects"]:
                tags[scene][row["key"]] = row
    row = tags[scene].get(key, {})
    words = set(" ".join([key.replace("_", " "), *row.get("tags", {}).get("names", [])] if isinstance(row.get("tags"), dict)
                         else [key.replace("_", " ")]).lower().split())
    return next((number for number, names in CLASSES.items() if words & set(names)), None)


def overlap(a, b):
    width, height = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    if width <= 0 or height <= 0:
        return 0.0
    area = lambda box: (box[2] - box[0]) * (box[3] - box[1])
    return width * height / (area(a) + area(b) - width * height)


def detections(session, picture, least=0.25):
    _, _, height, width = session.get_inputs()[0].shape
    scale = min(width / picture.width, height / picture.height)
    small = picture.resize((round(picture.width * scale), round(picture.height * scale)), Image.BILINEAR)
    sheet = Image.new("RGB", (width, height), (114, 114, 114))
    left, top = (width - small.width) // 2, (height - small.height) // 2
    sheet.paste(small, (left, top))
    image = np.asarray(sheet, np.float32).transpose(2, 0, 1)[None] / 255
    rows = session.run(None, {session.get_inputs()[0].name: image})[0][0].T
    scores = rows[:, 4:]
    kept = []
    for at in np.argsort(-scores.max(1)):
        kind, score = int(scores[at].argmax()), float(scores[at].max())
        if score < least:
            break
        x, y, w, h = rows[at, :4]
        box = ((x - w / 2 - left) / scale, (y - h / 2 - top) / scale, (x + w / 2 - left) / scale, (y + h / 2 - top) / scale)
        if all(other != kind or overlap(box, kept_box) <= 0.45 for other, _, kept_box in kept):
            kept.append((kind, score, box))
    return kept


def detector(model, folders):
    session = onnxruntime.InferenceSession(model)
    seen, all_of, false, true, things = Counter(), Counter(), Counter(), Counter(), []
    for folder, example in examples(folders):
        picture = Image.open(folder / example["picture"]).convert("RGB")
        ids = np.asarray(Image.open(folder / example["ids"]))
        found = detections(session, picture)
        used = set()
        for thing in example["visible"]:
            kind = class_of(folder, example["scene"], thing["key"])
            if kind is None or thing["opening"] or thing["in_frame"] < 0.5:
                continue
            rows, columns = np.nonzero(ids == thing["id"])
            if not len(rows):
                continue
            box = (columns.min(), rows.min(), columns.max() + 1, rows.max() + 1)
            size = max(box[2] - box[0], box[3] - box[1])
            cell = (NAMES[kind], next(i for i in range(4) if size < SIZES[i + 1]))
            all_of[cell] += 1
            hits = [i for i, (other, _, at) in enumerate(found) if other == kind and i not in used and overlap(at, box) >= 0.4]
            things.append((thing["pixels"] ** 0.5, bool(hits)))
            if hits:
                used.add(hits[0])
                seen[cell] += 1
        for i, (kind, _, _) in enumerate(found):
            if kind in NAMES:
                (true if i in used else false)[NAMES[kind]] += 1
    print("class\tunder 24 px\t24-60 px\t60-120 px\t120 px and more\tboxes\tof them of such an object")
    for name in sorted({name for name, _ in all_of}):
        cells = [f"{seen[name, i]} of {all_of[name, i]}" if all_of[name, i] else "-" for i in range(4)]
        print("\t".join([name, *cells, str(true[name] + false[name]), str(true[name])]))
    totals = [(sum(seen[n, i] for n in NAMES.values()), sum(all_of[n, i] for n in NAMES.values())) for i in range(4)]
    print("\t".join(["all", *(f"{a} of {b} = {100 * a / max(b, 1):.0f} %" for a, b in totals), str(sum(true.values()) + sum(false.values())),
                     str(sum(true.values()))]))
    sizes, hits = np.array([size for size, _ in things]), np.array([hit for _, hit in things])
    chance = lambda half, sure, missed: (1 - missed) / (1 + np.exp(-(sizes - half) * np.log(19) / max(sure - half, 1e-6)))
    fits = ((np.log(np.where(hits, p, 1 - p).clip(1e-9)).sum(), half, sure, missed) for half in range(8, 200, 4)
            for sure in range(half + 4, 500, 8) for missed in np.arange(0, 0.6, 0.05) for p in [chance(half, sure, missed)])
    _, half, sure, missed = max(fits)
    print(f"# found {hits.mean():.2f}; the simulated detector (error file default) {chance(8, 16, 0).mean():.2f}; as it with "
          f"seen.half_px = {half}, sure_px = {sure}, missed = {missed:.2f}: {chance(half, sure, missed).mean():.2f}")


def depth(model, folders):
    session = onnxruntime.InferenceSession(model)
    _, _, height, width = session.get_inputs()[0].shape
    rows = defaultdict(list)
    for folder, example in examples(folders):
        picture = Image.open(folder / example["picture"]).convert("RGB")
        image = (np.asarray(picture.resize((width, height), Image.BILINEAR), np.float32) / 255 - MEAN) / DEVIATION
        found = session.run(None, {session.get_inputs()[0].name: image.transpose(2, 0, 1)[None].astype(np.float32)})[0].reshape(height, width)
        truth = np.asarray(Image.open(folder / example["depth"]).resize((width, height), Image.NEAREST), np.float32) / 100
        near = (truth > 0.3) & (truth < 12)
        if near.sum() < 0.2 * near.size:
            continue
        a, b = found[near], truth[near]
        scale = np.median(b / a)
        by_row = np.broadcast_to(np.arange(height)[:, None], near.shape)[near]
        guess = np.array([np.median(b[by_row == row]) if (by_row == row).any() else 1 for row in range(height)])[by_row]
        ranks = lambda values: np.argsort(np.argsort(values))
        rows[example["scene"].split("@")[0]].append(
            (scale, np.mean(np.abs(scale * a / b - 1)), np.corrcoef(ranks(a), ranks(b))[0, 1], np.mean(np.abs(guess / b - 1)),
             np.mean(np.abs(a / b - 1))))
    print("scene\tpictures\tmedian scale\tits middle 80 %\tabs rel, scaled\tSpearman\tabs rel of the row's median\tabs rel, unscaled")
    for scene, found in rows.items():
        scales, error, rank, guess, plain = map(np.array, zip(*found))
        low, high = np.quantile(scales, [0.1, 0.9])
        print(f"{scene}\t{len(found)}\t{np.median(scales):.2f}\t{low:.2f}-{high:.2f}\t{error.mean():.2f}\t{rank.mean():.2f}\t"
              f"{guess.mean():.2f}\t{plain.mean():.2f}")


if __name__ == "__main__":
    {"detector": detector, "depth": depth}[sys.argv[1]](sys.argv[2], sys.argv[3:])
