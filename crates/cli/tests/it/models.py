"""Published models, fetched and converted by the program, against their own runtimes: TensorFlow.js for the detector, onnxruntime's reading
of the published file for the depth network; and ONNX's own checker for what was written.

Called with the program, the folder of models, and the packages as npm saved them (detector, depth network).
"""

import subprocess
import sys
import tarfile
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
from PIL import Image

# Not that it leaves out counters of the training.
onnxruntime.set_default_logger_severity(3)
PROGRAM, FOLDER, DETECTOR, DEPTH = sys.argv[1:]
MEAN, DEVIATION = np.array([0.485, 0.456, 0.406], "f4"), np.array([0.229, 0.224, 0.225], "f4")
BLUE_FIRST = np.array([103.53, 116.28, 123.675], "f4"), np.array([57.375, 57.12, 58.395], "f4")


def picture(size):
    """A view of the office, planes of red, green and blue from 0 to 1."""
    subprocess.run([PROGRAM, "sim", "render", "office", "-o", "office.png"], check=True, capture_output=True)
    image = np.asarray(Image.open("office.png").convert("RGB").resize((size, size), Image.BILINEAR), "f4") / 255
    return image.transpose(2, 0, 1)[None]


def run(file, image):
    onnx.checker.check_model(onnx.load(file))
    session = onnxruntime.InferenceSession(file)
    return session.run(None, {session.get_inputs()[0].name: image.astype("f4")})[0]


def planes(numbers):
    return numbers[None, :, None, None]


def detector():
    image = picture(416)
    mean, deviation = BLUE_FIRST
    with tarfile.open(DETECTOR) as package:
        for name in ("nanodet.json", "nanodet.bin"):
            Path(name).write_bytes(package.extractfile(f"package/models/{name}").read())
    ((255 * image[:, ::-1] - planes(mean)) / planes(deviation)).astype("<f4").tofile("input")
    subprocess.run(["node", "models.mjs", ".", "input", "output"], check=True)
    raw, at, scores, boxes = np.fromfile("output", "<f4"), 0, [], []
    grids = [(52, 8), (26, 16), (13, 32)]
    for side, _ in grids:
        scores.append(raw[at:at + 80 * side * side].reshape(-1, 80))
        at += 80 * side * side
    for side, stride in grids:
        bins = raw[at:at + 44 * side * side].reshape(-1, 4, 11)
        at += 44 * side * side
        bins = np.exp(bins - bins.max(2, keepdims=True))
        left, top, right, bottom = (stride * (bins / bins.sum(2, keepdims=True)) @ np.arange(11)).T
        y, x = (stride * (np.mgrid[:side, :side].reshape(2, -1) + 0.5))
        boxes.append(np.stack([x + (right - left) / 2, y + (bottom - top) / 2, left + right, top + bottom], 1))
    wanted = np.concatenate([np.concatenate(boxes), np.concatenate(scores)], 1).T
    found = run(next(Path(FOLDER).glob("nanodet-*.onnx")), image)[0]
    assert found.shape == wanted.shape == (84, 3549), (found.shape, wanted.shape)
    error = np.abs(found - wanted)
    assert error[:4].max() < 0.05 and error[4:].max() < 1e-3, (error[:4].max(), error[4:].max())
    assert found[4].max() > 0.5, "a person stands in the office"
    print(f"detector: boxes within {error[:4].max():.4f} pixels, scores within {error[4:].max():.6f} of TensorFlow.js")


def depth():
    image = picture(224)
    with tarfile.open(DEPTH) as package:
        Path("published.onnx").write_bytes(package.extractfile("package/ONNX/fastdepth_7.onnx").read())
    session = onnxruntime.InferenceSession("published.onnx")
    wanted = session.run(None, {session.get_inputs()[0].name: image})[0]
    found = run(next(Path(FOLDER).glob("fastdepth-*.onnx")), (image - planes(MEAN)) / planes(DEVIATION))
    error = np.abs(found / wanted - 1).max()
    assert found.shape == (1, 1, 224, 224) and error < 1e-3, (found.shape, error)
    print(f"depth network: within {100 * error:.4f} % of the published file")


detector()
depth()
