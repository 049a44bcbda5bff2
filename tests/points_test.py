#!/usr/bin/env python3
"""Points and lines of files are as wide as --point-size and --line-width say, in pictures, on walls and in consoles.

usage: points_test.py HPR
"""

import base64
import json
import math
import pathlib
import struct
import subprocess
import sys
import tempfile

from program import HPR, expect, failures, plain, run

# A point at the origin, 10 m before a camera whose pixels are 2 m / 100 wide one metre before it in a picture 100 high.
SIZE = ["--size", "200x100"]
METRES_PER_PIXEL = 10 * 2 / 100


def write_scene(folder, name, camera, positions, mode):
    data = struct.pack(f"<{len(positions)}f", *positions)
    scene = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"mesh": 0}, {"camera": 0, "translation": [0, 0, 10]}],
        "cameras": [{"name": camera, "type": "perspective", "perspective": {"yfov": math.pi / 2, "znear": 0.1}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": mode}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": len(positions) // 3, "type": "VEC3",
                       "min": [-9, -9, -9], "max": [9, 9, 9]}],
        "bufferViews": [{"buffer": 0, "byteLength": len(data)}],
        "buffers": [{"byteLength": len(data),
                     "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode()}]}
    (folder / name).write_text(json.dumps(scene))


def covered(folder, *names):
    """How many pixels of files of keys show a surface."""
    words = b"".join((folder / name).read_bytes() for name in names)
    return sum(1 for (key,) in struct.iter_unpack("<Q", words) if key)


def drawn(folder, scene, *arguments):
    result = run(folder, "render", scene, *plain(*arguments), "--raw", "a.keys", "--force")
    if not expect(result.returncode == 0, f"{scene} {arguments}: left with {result.returncode}: {result.stderr}"):
        return -1
    return covered(folder, "a.keys")


def expect_area(found, wanted, what):
    expect(abs(found - wanted) <= 0.06 * wanted, f"{what}: {found} pixels, not about {wanted:.0f}")


def check_pictures(folder):
    disc = math.pi * 10 ** 2
    for primary in ("raster", "rays"):
        way = ["--primary", primary]
        expect_area(drawn(folder, "point.gltf", *SIZE, "--point-size", "20", *way), disc, f"20 pixels, {primary}")
        expect_area(drawn(folder, "point.gltf", "--size", "400x200", "--point-size", "20px", *way), disc, "a larger picture")
        expect_area(drawn(folder, "point.gltf", *SIZE, "--fov", "30", "--point-size", "20", *way), disc, "another angle")
        metres = f"{20 * METRES_PER_PIXEL}m"
        expect_area(drawn(folder, "point.gltf", *SIZE, "--point-size", metres, *way), disc, metres)
        expect_area(drawn(folder, "point.gltf", "--size", "400x200", "--point-size", metres, *way), 4 * disc, f"{metres}, larger")
        # 30 pixels long.
        expect_area(drawn(folder, "line.gltf", *SIZE, "--line-width", "6", *way), 30 * 6 + math.pi * 3 ** 2, "a line")
    expect(1 <= drawn(folder, "point.gltf", *SIZE) <= 14, "a point has 3 pixels across unless more are asked for")
    expect(drawn(folder, "point.gltf", *SIZE, "--point-size", "0") == 0, "--point-size 0 leaves points out")
    expect(drawn(folder, "line.gltf", *SIZE, "--point-size", "0") > 0, "lines are no points")
    expect(drawn(folder, "line.gltf", *SIZE, "--line-width", "0") == 0, "--line-width 0 leaves lines out")
    for option in ("--point-size", "--line-width"):
        result = run(folder, "render", "point.gltf", "-o", "a.png", option, "3cm")
        expect(result.returncode == 2 and option in result.stderr and "3px" in result.stderr, f"{option} 3cm: {result.stderr}")


def check_walls(folder):
    for grid, names in (("1x1@200x100", 1), ("2x2@100x50", 4)):
        result = run(folder, "wall", "run", grid, "point.gltf", *plain("--point-size", "20"), "-o", "wall", "--raw", "wall.keys",
                     "--force")
        if expect(result.returncode == 0, f"{grid}: left with {result.returncode}: {result.stderr}"):
            files = sorted(file.name for file in folder.rglob("wall*.keys"))
            expect(len(files) == names, f"{grid}: files of keys {files}")
            found = covered(folder, *files)
            # The wall is somewhat larger than its pixels: screens have gaps.
            expect(0.85 * math.pi * 100 <= found <= 1.1 * math.pi * 100, f"{grid}: {found} pixels")
            for file in files:
                (folder / file).unlink()


def check_console(folder):
    """Another scene has its first view by a camera of its own."""
    settings = [*SIZE, *plain("--point-size", "20")]
    result = subprocess.run([HPR, "console", "line.gltf", "--camera", "side", *settings], cwd=folder, text=True, check=False,
                            capture_output=True, timeout=60, input="load point.gltf\nrender\nsave loaded.png\nquit\n")
    expect(result.returncode == 0, f"console: left with {result.returncode}: {result.stderr}")
    run(folder, "render", "point.gltf", *settings, "-o", "own.png")
    result = run(folder, "diff", "own.png", "loaded.png")
    expect(result.returncode == 0, f"a point in the console: {result.stdout}{result.stderr}")


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-points-") as scratch:
        folder = pathlib.Path(scratch)
        write_scene(folder, "point.gltf", "own", [0, 0, 0], 0)
        write_scene(folder, "line.gltf", "side", [-3, 0, 0, 3, 0, 0], 3)
        check_pictures(folder)
        check_walls(folder)
        check_console(folder)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
