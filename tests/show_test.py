#!/usr/bin/env python3
"""What --show puts in the place of light: values computed by hand in PNG, EXR and on walls, and the same bits on any ranks.

usage: show_test.py HPR

Prints what differs and leaves with 1.
"""

import pathlib
import sys
import tempfile

import exr
import png
from program import expect, failures, run, run_to
from quads import BACK, Quads

SIDE = 128  # pixels, of which 4 x 4 tiles of ranks are made
WAYS = [(), ("--ranks", "3", "--distribute", "sort-first"), ("--ranks", "3", "--distribute", "sort-middle"),
        ("--ranks", "3", "--distribute", "sort-last"),
        ("--ranks", "3", "--distribute", "hybrid", "--groups", "2"), ("--ranks", "3", "--data", "partitioned")]
SHOWN = ["normal", "uv", "wireframe", "ids", "cost", "overdraw", "ao"]
BLACK, WHITE = (0, 0, 0), (255, 255, 255)


def write_scene(path):
    """Of 4 x 4 metres that are seen of z = 0 the middle 2 x 2 are a square; another one of the same pixels is 2 m behind it,
    and one that turns its back to the eye stands before both."""
    quads = Quads()
    white = quads.material((1, 1, 1, 1), doubleSided=True)
    one_sided = quads.material((1, 1, 1, 1))
    square = quads.mesh(white)
    quads.place(square)
    quads.place(square, translation=[0, 0, -2], scale=[2, 2, 1])
    quads.place(quads.mesh(one_sided, indices=BACK), translation=[0, 0, 1], scale=[0.5, 0.5, 1])
    quads.write(path)


FRONT = ("--eye", "0,0,2", "--at", "0,0,0", "--fov", "90")
OUTSIDE = ()  # the scene's own camera


def arguments(show, *options, camera=FRONT):
    return [*camera, "--show", show, "--quality", "draft", "--spp", "1", *options]


def render(folder, scene, name, show, *options, camera=FRONT):
    run_to(folder, ["render", scene, "--size", f"{SIDE}x{SIDE}", "-o", name, "--force",
                    *arguments(show, *options, camera=camera)])
    return (folder / name).read_bytes()


def pixel(data, x, y):
    return tuple(data[4 * (y * SIDE + x):4 * (y * SIDE + x) + 3])


def check_values(folder):
    """A PNG has round(255 v) of the EXR's v, whatever tone and exposure there are."""
    hand = {
        # a pixel of the square, one of the edge of both squares, and one beside them
        "normal": {(64, 50): (128, 128, 255), (4, 4): BLACK},
        "wireframe": {(40, 60): WHITE, (32, 50): (128, 128, 128), (64, 63): BLACK, (4, 4): WHITE},
        "ids": {(64, 50): (255, 51, 51), (4, 4): BLACK},
        # 2 surfaces: log2(3) / 8 of the three channels' way
        "overdraw": {(64, 50): (152, 0, 0), (64, 64): (152, 0, 0), (4, 4): BLACK},
        "cost": {(4, 4): BLACK},
        "ao": {(64, 50): WHITE, (4, 4): WHITE},
    }
    for show, places in hand.items():
        picture = png.decode(render(folder, "squares.gltf", "a.png", show))[2]
        lit = png.decode(render(folder, "squares.gltf", "a.png", show, "--tone", "aces", "--exposure", "2"))[2]
        render(folder, "squares.gltf", "a.exr", show)
        values = exr.read(folder / "a.exr")[2]
        expect(picture == lit, f"{show}: tone or exposure changes it")
        for (x, y), color in places.items():
            expect(pixel(picture, x, y) == color, f"{show}: pixel {x},{y} is {pixel(picture, x, y)}, not {color}")
        levels = [int(255 * values[letter][i] + 0.5) for i in range(SIDE * SIDE) for letter in "RGB"]
        expect(levels == [value for i, value in enumerate(picture) if i % 4 < 3], f"{show}: the EXR holds other values")


def check_bits(folder):
    for show in SHOWN:
        pictures = {render(folder, "gen:gallery", "a.exr", show, *way) for way in WAYS}
        expect(len(pictures) == 1, f"{show}: {len(pictures)} different pictures")
    plain = render(folder, "gen:gallery", "a.exr", "shaded")
    run_to(folder, ["render", "gen:gallery", "--size", f"{SIDE}x{SIDE}", "-o", "b.exr", "--eye", "0,0,2", "--at", "0,0,0", "--fov",
                    "90", "--quality", "draft", "--spp", "1"])
    expect(plain == (folder / "b.exr").read_bytes(), "shaded is another picture than that without --show")


def colors_of(data):
    picture = png.decode(data)[2]
    return {pixel(picture, x, y) for y in range(SIDE) for x in range(SIDE)}


def check_ranks(folder):
    """A color for each rank that draws anything, of which there are no more than ranks."""
    expect(colors_of(render(folder, "gen:gallery", "a.png", "rank")) == {(255, 51, 51)}, "one rank has one color")
    first = png.decode(render(folder, "gen:gallery", "a.png", "rank", "--ranks", "2", "--distribute", "sort-first"))[2]
    halves = {tuple(sorted({pixel(first, x, y) for y in range(y0, y0 + 64) for x in range(x0, x0 + 64)}))
              for x0 in (0, 64) for y0 in (0, 64)}
    expect(len(halves) == 2 and all(len(half) == 1 for half in halves), f"tiles of two ranks have colors {halves}")
    last = colors_of(render(folder, "gen:cornell", "a.png", "rank", "--ranks", "3", "--distribute", "sort-last",
                            camera=OUTSIDE))
    expect(len(last) == 3, f"objects of three ranks have {len(last)} colors")


def check_wall(folder):
    run_to(folder, ["wall", "run", f"1x1@{SIDE}x{SIDE}", "squares.gltf", "--display", "file", "-o", "wall", "--ranks", "2",
                    *arguments("normal")])
    picture = png.read(folder / "wall" / "wall.png")[2]
    expect(pixel(picture, 64, 50) == (128, 128, 255), f"a wall shows {pixel(picture, 64, 50)}")


def check_errors(folder):
    wrong = run(folder, "render", "squares.gltf", "-o", "c.png", "--show", "normals")
    expect(wrong.returncode == 2 and "normal" in wrong.stderr, f"an unknown name: {wrong.returncode} {wrong.stderr}")
    parts = run(folder, "render", "squares.gltf", "-o", "c.png", "--show", "ids", "--aov", "direct")
    expect(parts.returncode == 2 and "--show ids" in parts.stderr, f"parts of no light: {parts.returncode} {parts.stderr}")
    unused = run(folder, "render", "squares.gltf", "-o", "c.png", "--size", "64x64", "--show", "ids", "--tone", "aces")
    expect(unused.returncode == 0 and "--show ids has no use for --tone" in unused.stderr, f"no word of --tone: {unused.stderr}")


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        write_scene(folder / "squares.gltf")
        for case in (check_values, check_bits, check_ranks, check_wall, check_errors):
            case(folder)
    return 1 if failures else 0


sys.exit(main())
