#!/usr/bin/env python3
"""What --aov writes: the right channels, parts that add up to the colour, ids and depths that are those of --raw.

usage: aov_test.py HPR

Prints what is wrong and leaves with 1.
"""

import math
import pathlib
import struct
import subprocess
import sys
import tempfile

import exr
from program import HPR, expect, failures, plain

SIZE = (160, 96)
PARTS = ("direct", "shadow", "reflection", "refraction", "ambient-occlusion", "photon")
ALL = "depth,id,normal,albedo," + ",".join(PARTS) + ",rank,cost"
CHANNELS = {"R", "G", "B", "depth.Z", "id.X", "normal.X", "normal.Y", "normal.Z", "rank.X", "cost.X",
            *(f"{part}.{letter}" for part in ("albedo", *PARTS) for letter in "RGB")}


def render(folder, *arguments):
    result = subprocess.run([HPR, "render", "gen:gallery", "--size", f"{SIZE[0]}x{SIZE[1]}", "--force", *plain(*arguments)],
                            cwd=folder, capture_output=True, text=True, timeout=300, check=False)
    expect(result.returncode == 0, f"{' '.join(arguments)} left with {result.returncode}: {result.stderr[-1000:]}")
    return result


def check_sums(case, layers):
    """Each float of a part is rounded once: the sum is off by no more than so many half steps of the largest."""
    worst = 0.0
    for letter in "RGB":
        for i, color in enumerate(layers[letter]):
            parts = [layers[f"{part}.{letter}"][i] for part in PARTS]
            bound = 2.0 ** -23 * sum(map(abs, [color, *parts])) + 1e-40
            worst = max(worst, abs(math.fsum(parts) - color) / bound)
    expect(worst <= 1.0, f"{case}: the parts miss the colour by {worst:.3g} times what rounding explains")
    for part in ("direct", "shadow", "reflection"):
        expect(any(layers[f"{part}.G"]), f"{case}: {part} is all zero")
    expect(all(value <= 0.0 for value in layers["shadow.R"]), f"{case}: shadows that add light")


def check_surfaces(case, layers, keys):
    """Ids and depths against the keys of the same run."""
    seen = 0
    for i, key in enumerate(keys):
        surface, depth = ~key & 0xFFFFFFFF, struct.unpack("<f", struct.pack("<I", key >> 32))[0]
        length = math.hypot(*(layers[f"normal.{axis}"][i] for axis in "XYZ"))
        if key == 0:
            expect(layers["id.X"][i] == 0xFFFFFFFF and layers["depth.Z"][i] == math.inf, f"{case}: pixel {i} is empty")
            continue
        seen += 1
        expect(layers["id.X"][i] == surface, f"{case}: pixel {i} has id {layers['id.X'][i]}, not {surface}")
        expect(abs(length - 1.0) < 1e-5, f"{case}: pixel {i} has a normal of length {length}")
        # The product of depth and distance is the near distance, the same for all pixels.
        near = layers["depth.Z"][i] * depth
        check_surfaces.near = check_surfaces.near or near
        expect(abs(near / check_surfaces.near - 1.0) < 1e-6, f"{case}: pixel {i} has depth {layers['depth.Z'][i]}")
        if len(failures) > 10:
            return
    expect(seen > len(keys) // 4, f"{case}: {seen} pixels show something")


check_surfaces.near = None


def read_keys(path):
    data = path.read_bytes()
    return struct.unpack(f"<{len(data) // 8}Q", data)


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-aov-") as scratch:
        folder = pathlib.Path(scratch)
        pictures = {}
        for case, arguments in {"one sample": [], "four samples": ["--spp", "4"],
                                "four samples, three ranks": ["--spp", "4", "--ranks", "3", "--distribute", "sort-last"],
                                "culled by three": ["--spp", "4", "--ranks", "3", "--distribute", "sort-middle", "--primary", "raster"],
                                "drawn": ["--spp", "4", "--primary", "raster"]}.items():
            render(folder, "-o", "a.exr", "--raw", "a.keys", "--aov", ALL, *arguments)
            width, height, layers = exr.read(folder / "a.exr")
            expect((width, height) == SIZE, f"{case}: {width}x{height} pixels")
            expect(set(layers) == CHANNELS, f"{case}: channels {set(layers) ^ CHANNELS} too many or missing")
            check_sums(case, layers)
            check_surfaces(case, layers, read_keys(folder / "a.keys"))
            expect(all(cost >= 0.0 for cost in layers["cost.X"]) and any(layers["cost.X"]), f"{case}: no cost")
            pictures[case] = layers
        ranks = {int(rank) for rank in pictures["four samples, three ranks"]["rank.X"]}
        expect(ranks == {0, 1, 2}, f"ranks {ranks} lit the picture of three")
        for alone, shared in (("four samples", "four samples, three ranks"), ("drawn", "culled by three")):
            for name in CHANNELS - {"rank.X"}:
                expect(pictures[alone][name].tobytes() == pictures[shared][name].tobytes(), f"{shared}: {name} has other bits")
        one = pictures["four samples"]
        expect(one["R"].tobytes() != pictures["one sample"]["R"].tobytes(), "four samples are one")

        for samples in (2, 7):
            render(folder, "-o", f"of{samples}.exr", "--spp", str(samples), "--aov", "depth,id,normal")
        first, more = (exr.read(folder / f"of{samples}.exr")[2] for samples in (2, 7))
        for name in ("depth.Z", "id.X", "normal.X"):
            expect(first[name].tobytes() == more[name].tobytes(), f"{name} is not of the first sample")

        render(folder, "-o", "b.exr")
        expect(exr.read(folder / "b.exr")[2]["G"].tobytes() == pictures["one sample"]["G"].tobytes(),
              "asking for layers changes the picture")
        render(folder, "-o", "c.png", "--aov", "id,albedo")
        beside = exr.read(folder / "c.aov.exr")[2]
        expect(set(beside) == {"R", "G", "B", "id.X", "albedo.R", "albedo.G", "albedo.B"}, f"beside a PNG: {set(beside)}")
        expect(beside["id.X"].tobytes() == pictures["one sample"]["id.X"].tobytes(), "other ids beside a PNG")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
