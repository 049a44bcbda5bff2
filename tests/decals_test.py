#!/usr/bin/env python3
"""Decals, surfaces of partial coverage in the plane of others, are seen wherever they are, in one order, by passes and by the
reference, on any number of ranks.

usage: decals_test.py HPR

Prints what differs and leaves with 1.
"""

import math
import pathlib
import sys
import tempfile

import exr
from program import expect, failures, run_to
from quads import Quads

SIZE = 48
FOV = 40.0
BASE, FIRST, SECOND = (0.8, 0.1, 0.0), (0.0, 0.9, 0.2), (0.1, 0.0, 1.0)
# Corners of the layers in their plane, none parallel to another's.
FIRST_CORNERS = ((-0.7, -0.6), (0.66, -0.63), (0.71, 0.6), (-0.64, 0.67))
SECOND_CORNERS = ((-0.31, -0.4), (0.9, -0.27), (0.83, 0.33), (-0.37, 0.29))
SHARED = ("--ranks", "3", "--distribute", "sort-last", "--strategy", "binary-swap")


def cross(a, b):
    return [a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3] for i in range(3)]


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def scaled(vector, factor):
    return [x * factor for x in vector]


def added(*vectors):
    return [sum(parts) for parts in zip(*vectors)]


def unit(vector):
    return scaled(vector, 1.0 / math.sqrt(dot(vector, vector)))


class Plane:
    """Where x and y of the layers lie: a turn about (1, 2, 3) and a translation, baked into corners or left to the node."""

    def __init__(self, degrees, middle, size, baked):
        half = math.radians(degrees) / 2
        axis = unit([1.0, 2.0, 3.0])
        self.rotation = [*scaled(axis, math.sin(half)), math.cos(half)]
        self.middle, self.size, self.baked = middle, size, baked
        self.axes = [self.turned(direction) for direction in ([1, 0, 0], [0, 1, 0], [0, 0, 1])]

    def turned(self, vector):
        x, w = self.rotation[:3], self.rotation[3]
        twice = scaled(cross(x, vector), 2.0)
        return added(vector, scaled(twice, w), cross(x, twice))

    def at(self, x, y):
        return added(self.middle, scaled(self.axes[0], self.size * x), scaled(self.axes[1], self.size * y))

    def place(self, quads, material, corners):
        if self.baked:
            quads.place(quads.mesh(material, [self.at(*corner) for corner in corners]))
        else:
            mesh = quads.mesh(material, [(*corner, 0) for corner in corners])
            quads.place(mesh, rotation=self.rotation, translation=self.middle, scale=[self.size] * 3)
            # Shared meshes are instances to rays; the other one is out of sight.
            quads.place(mesh, translation=added(self.middle, scaled(self.axes[2], -50.0 * self.size)), scale=[0.01 * self.size] * 3)

    def look(self, direction):
        """The options of a camera that looks from that side, in the layers' own axes, and its rays by pixel's corner."""
        towards = unit(direction)
        back = added(*[scaled(axis, part) for axis, part in zip(self.axes, towards)])
        eye = added(self.middle, scaled(back, 4.0 * self.size))
        up = self.axes[1]
        right = unit(cross(up, back))
        upright = cross(back, right)
        half = math.tan(math.radians(FOV) / 2)

        def position(column, row):
            x, y = half * (2 * column / SIZE - 1), half * (1 - 2 * row / SIZE)
            ray = added(scaled(right, x), scaled(upright, y), scaled(back, -1.0))
            along = -dot(self.axes[2], added(eye, scaled(self.middle, -1.0))) / dot(self.axes[2], ray)
            met = added(eye, scaled(ray, along), scaled(self.middle, -1.0))
            return dot(met, self.axes[0]) / self.size, dot(met, self.axes[1]) / self.size

        camera = ["--fov", str(FOV)]
        for name, vector in (("--eye", eye), ("--at", self.middle), ("--up", up)):
            camera += [name, ",".join(repr(part) for part in vector)]
        return camera, position


def inside(corners, place):
    edges = zip(corners, corners[1:] + corners[:1])
    return all((b[0] - a[0]) * (place[1] - a[1]) - (b[1] - a[1]) * (place[0] - a[0]) > 0 for a, b in edges)


def write_scene(path, plane, mode, alpha, identical):
    """The base, then two layers that overlap; or all three of the same corners."""
    quads = Quads()
    base = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    first, second = (base, base) if identical else (FIRST_CORNERS, SECOND_CORNERS)
    for color, corners in ((BASE, base), (FIRST, first), (SECOND, second)):
        cover = {} if color is BASE else {"alphaMode": mode}
        material = quads.material((*color, 1.0 if color is BASE else alpha), doubleSided=True, **cover)
        plane.place(quads, material, corners)
    quads.write(path)
    return first, second


def check_picture(image, position, first, second, alpha, what):
    """Of layers in one plane the first lies before the second. Pixels across an edge show either."""
    pixels = wrong = 0
    for row in range(SIZE):
        for column in range(SIZE):
            corners = [position(column + x, row + y) for x in (0, 1) for y in (0, 1)]
            places = {(inside(first, place), inside(second, place), max(map(abs, place)) < 1) for place in corners}
            if len(places) != 1 or not next(iter(places))[2]:
                continue
            (in_first, in_second, _), = places
            expected = BASE
            for color, covers in ((SECOND, in_second), (FIRST, in_first)):
                if covers:
                    expected = added(scaled(color, alpha), scaled(expected, 1.0 - alpha))
            seen = [image[channel][row * SIZE + column] for channel in "RGB"]
            pixels += 1
            wrong += max(abs(a - b) for a, b in zip(seen, expected)) > 1e-4
    expect(pixels > 40, f"{what}: looks at {pixels} pixels")
    expect(wrong == 0, f"{what}: {wrong} of {pixels} pixels are wrong")


def render(folder, camera, *options):
    run_to(folder, ["render", "decals.gltf", *camera, "--size", f"{SIZE}x{SIZE}", "-o", "a.exr", "--force", *options])
    return (folder / "a.exr").read_bytes(), exr.read(folder / "a.exr")[2]


def check_mean(folder, camera, position, first, second):
    """Paths pass by chance: every pixel that no edge crosses shows some of all that lies there."""
    image = render(folder, camera, "--reference", "--spp", "64")[1]
    for row in range(SIZE):
        for column in range(SIZE):
            places = [position(column + x, row + y) for x in (0, 1) for y in (0, 1)]
            for corners, channel in ((first, "G"), (second, "B")):
                if all(inside(corners, place) for place in places):
                    seen = image[channel][row * SIZE + column]
                    expect(seen > 0.21, f"reference: layer {channel} is missing at {column},{row}: {seen}")


PLANES = [
    ("level", Plane(0.0, [0.0, 0.0, 0.0], 1.0, True)), ("turned", Plane(33.0, [0.3, -0.2, 0.1], 1.0, True)),
    ("turned by its nodes", Plane(71.0, [0.0, 0.5, 0.0], 1.0, False)), ("far off", Plane(112.0, [300.0, -200.0, 500.0], 1.0, True)),
    ("small", Plane(20.0, [0.0, 0.0, 0.0], 1e-3, True)), ("large and turned by its nodes", Plane(250.0, [10.0, 0.0, 0.0], 1e4, False)),
]
SIDES = [(0.0, 0.0, 1.0), (2.5, 0.7, 1.0), (-0.4, 0.3, -1.0)]


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for number, (text, plane) in enumerate(PLANES):
            identical = number % 3 == 2
            for mode, alpha in (("BLEND", 0.5), ("MASK", 1.0)):
                first, second = write_scene(folder / "decals.gltf", plane, mode, alpha, identical)
                camera, position = plane.look(SIDES[number % len(SIDES)])
                what = f"{text}, {mode}, from {SIDES[number % len(SIDES)]}"
                picture, image = render(folder, camera, "--primary", "raster")
                check_picture(image, position, first, second, alpha, what)
                expect(render(folder, camera, "--primary", "raster", *SHARED)[0] == picture, f"{what}: ranks change bits")
                check_picture(render(folder, camera, "--primary", "rays", *SHARED, "--data", "partitioned")[1], position, first,
                              second, alpha, f"{what}, by rays")
                if mode == "MASK":
                    check_picture(render(folder, camera, "--reference")[1], position, first, second, alpha, f"{what}, reference")
        first, second = write_scene(folder / "decals.gltf", PLANES[1][1], "BLEND", 0.5, False)
        for side in SIDES:
            camera, position = PLANES[1][1].look(side)
            check_picture(render(folder, camera)[1], position, first, second, 0.5, f"from {side}")
            check_mean(folder, camera, position, first, second)
    return 1 if failures else 0


sys.exit(main())
