#!/usr/bin/env python3
"""`hpr diff` computes the SSIM of scikit-image within 0.1 %, the FLIP of flip-evaluator within 0.5 %, and the relMSE and
means of NumPy, on 20 pairs of pictures, as PNG and, as radiance, as EXR.

usage: metrics_test.py HPR [--times]

Skipped (77) where Python cannot import flip_evaluator, skimage, numpy and PIL: pip install flip-evaluator scikit-image.
"""

import argparse
import json
import math
import pathlib
import struct
import subprocess
import sys
import tempfile
import time

try:
    import flip_evaluator
    import numpy
    from PIL import Image
    from scipy import ndimage
    from skimage.metrics import structural_similarity
except ImportError as error:
    print(f"skipped: {error}")
    sys.exit(77)

BOUNDS = {"ssim": 1e-3, "flip": 5e-3, "relmse": 1e-5, "relmse_untrimmed": 1e-5, "mean": 1e-5, "mean_error": 1e-5}


def reference_picture(random, kind, height, width):
    """Display values [height][width][3]: smooth, edges, or texture, in all colours."""
    y, x = numpy.mgrid[0:height, 0:width] / max(height, width)
    if kind == "smooth":
        waves = [0.5 + 0.5 * numpy.sin(6.0 * random.random() * x + 9.0 * random.random() * y + i) for i in range(3)]
        return numpy.stack(waves, -1)
    if kind == "edges":
        picture = numpy.ones((height, width, 3)) * random.random(3)
        for _ in range(25):
            left, top = random.integers(0, width), random.integers(0, height)
            right, bottom = left + random.integers(1, width), top + random.integers(1, height)
            picture[top:bottom, left:right] = random.random(3)
        return picture
    noise = ndimage.gaussian_filter(random.random((height, width, 3)), (1.5, 1.5, 0))
    return (noise - noise.min()) / (noise.max() - noise.min())


def pairs():
    """(name, reference, changed), clipped display values."""
    random = numpy.random.default_rng(7)
    changes = {
        "noise": lambda p: p + random.normal(0.0, 0.05, p.shape),
        "strong noise": lambda p: p + random.normal(0.0, 0.3, p.shape),
        "salt": lambda p: numpy.where(random.random(p.shape[:2] + (1,)) < 0.005, 1.0, p),
        "blur": lambda p: ndimage.gaussian_filter(p, (2.0, 2.0, 0)),
        "shift": lambda p: numpy.roll(p, (1, 2), (0, 1)),
        "gain": lambda p: 1.05 * p,
        "offset": lambda p: p + 0.02,
        "gamma": lambda p: p ** 1.2,
        "quantised": lambda p: numpy.round(p * 7.0) / 7.0,
        "tint": lambda p: p * numpy.array([1.0, 0.9, 0.7]),
        "grey": lambda p: numpy.repeat(p.mean(-1, keepdims=True), 3, -1),
        "lines": lambda p: numpy.where((numpy.arange(p.shape[1]) % 17 == 0)[None, :, None], 1.0 - p, p),
        "sharpened": lambda p: 2.0 * p - ndimage.gaussian_filter(p, (1.0, 1.0, 0)),
        "turned": lambda p: p[::-1, ::-1],
        "negative": lambda p: 1.0 - p,
        "one pixel": lambda p: numpy.where(numpy.arange(p[..., 0].size).reshape(p.shape[:2] + (1,)) == 777, 1.0 - p, p),
        "blocks": lambda p: p[::4, ::4].repeat(4, 0).repeat(4, 1)[:p.shape[0], :p.shape[1]],
        "swapped": lambda p: p[..., ::-1],
        "dark": lambda p: 0.2 * p,
        "another": lambda p: reference_picture(random, "edges", *p.shape[:2]),
    }
    for index, (name, change) in enumerate(changes.items()):
        kind = ("smooth", "edges", "texture")[index % 3]
        height, width = int(random.integers(40, 200)), int(random.integers(40, 260))
        reference = reference_picture(random, kind, height, width)
        yield f"{name} of {kind}, {width}x{height}", reference, numpy.clip(change(reference), 0.0, 1.0)


def decode(display):
    return numpy.where(display <= 0.04045, display / 12.92, ((display + 0.055) / 1.055) ** 2.4)


def encode(linear):
    clamped = numpy.clip(linear, 0.0, 1.0)
    return numpy.where(clamped <= 0.0031308, 12.92 * clamped, 1.055 * clamped ** (1.0 / 2.4) - 0.055)


def write_exr(path, picture):
    """32-bit float R, G, B, one line after the other without compression."""
    height, width, _ = picture.shape

    def attribute(name, kind, value):
        return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value

    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    channels = b"".join(name + b"\0" + struct.pack("<iB3xii", 2, 0, 1, 1) for name in (b"B", b"G", b"R")) + b"\0"
    header = struct.pack("<II", 20000630, 2) + attribute("channels", "chlist", channels)
    header += attribute("compression", "compression", b"\0") + attribute("dataWindow", "box2i", window)
    header += attribute("displayWindow", "box2i", window) + attribute("lineOrder", "lineOrder", b"\0")
    header += attribute("pixelAspectRatio", "float", struct.pack("<f", 1.0))
    header += attribute("screenWindowCenter", "v2f", struct.pack("<2f", 0.0, 0.0))
    header += attribute("screenWindowWidth", "float", struct.pack("<f", 1.0)) + b"\0"
    line_bytes = 8 + 12 * width
    first = len(header) + 8 * height
    offsets = struct.pack(f"<{height}Q", *(first + row * line_bytes for row in range(height)))
    lines = (struct.pack("<ii", row, 12 * width) + picture[row, :, ::-1].T.astype("<f4").tobytes() for row in range(height))
    path.write_bytes(header + offsets + b"".join(lines))


def expected(a, b, linear):
    """What the reference programs say of two pictures as they are stored."""
    squares = ((b - a) ** 2 / (a.mean(-1, keepdims=True) ** 2 + 1e-2)).mean(-1).ravel()
    kept = numpy.sort(squares)[:squares.size - squares.size // 1000]
    signed = (b - a).mean(-1)
    shown = [encode(picture) if linear else picture for picture in (a, b)]
    return {
        "relmse": kept.mean(), "relmse_untrimmed": squares.mean(),
        "mean": signed.mean(), "mean_error": signed.std(ddof=1) / math.sqrt(signed.size),
        "ssim": structural_similarity(*shown, channel_axis=2, gaussian_weights=True, sigma=1.5,
                                      use_sample_covariance=False, data_range=1.0),
        "flip": flip_evaluator.evaluate(*(picture.astype(numpy.float32) for picture in shown), "LDR",
                                        applyMagma=False)[1],
    }


def diff(hpr, a, b, *options):
    result = subprocess.run([hpr, "diff", str(a), str(b), "--json", *options], capture_output=True, text=True, check=False)
    if result.returncode not in (0, 1):
        sys.exit(f"hpr diff left with {result.returncode}: {result.stderr}")
    return json.loads(result.stdout)


def print_times(hpr, folder):
    random = numpy.random.default_rng(1)
    for name in "ab":
        picture = random.integers(0, 256, (1080, 1920, 3), dtype=numpy.uint8)
        Image.fromarray(picture).save(folder / f"{name}.png")
        write_exr(folder / f"{name}.exr", picture / 200.0)
    for kind in ("png", "exr"):
        for metric in ("rmse", "relmse", "ssim", "flip"):
            start = time.monotonic()
            diff(hpr, folder / f"a.{kind}", folder / f"b.{kind}", "--metric", metric, "--threads", "1")
            print(f"1920x1080 {kind} {metric}: {time.monotonic() - start:.2f} s with the reading, one thread")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("hpr")
    parser.add_argument("--times", action="store_true", help="only print how long 1920x1080 takes")
    options = parser.parse_args()
    failures = 0
    largest = dict.fromkeys(BOUNDS, 0.0)
    with tempfile.TemporaryDirectory(prefix="hpr-metrics-") as scratch:
        folder = pathlib.Path(scratch)
        if options.times:
            return print_times(options.hpr, folder)
        for name, *pictures in pairs():
            for linear in (False, True):
                stored = []
                paths = [folder / ("ab"[i] + (".exr" if linear else ".png")) for i in range(2)]
                for path, picture in zip(paths, pictures):
                    if linear:
                        stored.append((1.3 * decode(picture)).astype(numpy.float32).astype(float))  # some beyond white
                        write_exr(path, stored[-1])
                    else:
                        levels = numpy.round(255.0 * picture).astype(numpy.uint8)
                        stored.append(levels / 255.0)
                        Image.fromarray(levels).save(path)
                ours = diff(options.hpr, *paths)
                for metric, truth in expected(*stored, linear).items():
                    # A mean may vanish; HPR's values are floats.
                    scale = max(abs(truth), 1e-2 if metric == "mean" else 1e-9)
                    off = abs(ours[metric] - truth) / scale
                    largest[metric] = max(largest[metric], off)
                    if not off <= BOUNDS[metric]:
                        failures += 1
                        print(f"{name}, {paths[0].suffix}: {metric} is {ours[metric]}, expected {truth}: off by {off:.2g}")
    print("largest relative deviations: " + ", ".join(f"{metric} {off:.3g}" for metric, off in largest.items()))
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
