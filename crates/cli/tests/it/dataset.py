"""Reads a dataset as somebody would who knows docs/guide/dataset.md alone."""
import json
import pathlib
import sys

from PIL import Image

folder = pathlib.Path(sys.argv[1])
head = json.loads((folder / "dataset.json").read_text())
legends = {scene["name"]: json.loads((folder / scene["legend"]).read_text()) for scene in head["scenes"]}
rows = [json.loads(line) for line in (folder / "examples.jsonl").read_text().splitlines()]
size = (head["camera"]["width"], head["camera"]["height"])
for number, row in enumerate(rows):
    assert row["number"] == number
    picture = Image.open(folder / row["picture"])
    assert picture.size == size and picture.mode == "RGB", (picture.size, picture.mode)
    ids = Image.open(folder / row["ids"])
    assert ids.size == size and ids.mode.startswith("I"), ids.mode
    known = {thing["id"]: thing for thing in legends[row["scene"]]["objects"]}
    values = ids.get_flattened_data() if hasattr(ids, "get_flattened_data") else ids.getdata()
    solid = set(values) - {0}
    assert solid == {thing["id"] for thing in row["visible"] if not thing["opening"]}
    assert all(known[thing["id"]]["key"] == thing["key"] for thing in row["visible"])
    target = row["target"]
    assert (target is None) == (row["kind"] == "absent") == (row["mask"] is None)
    if target is None:
        continue
    mask = Image.open(folder / row["mask"])
    assert mask.mode == "L" and mask.getbbox() == tuple(target["box"]), (mask.getbbox(), target)
    assert mask.histogram()[255] == target["pixels"]
    assert mask.getpixel(tuple(target["point"])) == 255
    if not target["opening"]:
        depth = Image.open(folder / row["depth"]).getpixel(tuple(target["point"])) / 100
        assert depth <= target["distance_m"] + 0.01
print(f"read {len(rows)} examples")
