#!/usr/bin/env python3
"""`--quality best` against the path tracer, block by block, on random scenes: spheres, boxes, mirrors, lamps and skies on a ground.

usage: best_blocks_test.py HPR [--side PIXELS] [SEED ...]

Prints a line for each scene, then what is wrong, and leaves with 1.
"""

import argparse
import itertools
import math
import pathlib
import random
import struct
import sys
import tempfile

import exr
from program import expect, failures, run_to
from quads import FRONT, Quads

SEEDS = (1, 2, 3, 4, 5, 6)
BLOCK = 8
RUNS = 4  # of either renderer, with seeds of their own: they say how far chance takes a block
REFERENCE_SAMPLES = 256

MEAN_ERROR = 0.005
BLOCK_ERROR = 0.03
STANDARD_ERRORS = 4
FIREFLY = 10  # times the brightest neighbor

BOX = [(x, y, z) for x in (-1, 1) for y in (0, 2) for z in (-1, 1)]
BOX_SIDES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


def box():
    corners = [BOX[i] for side in BOX_SIDES for i in side]
    return corners, [4 * side + i for side in range(6) for i in FRONT], None


def sphere(rows=24, columns=48):
    """Of radius 1 on the ground, with smooth normals."""
    normals, indices = [], []
    for row in range(rows + 1):
        for column in range(columns + 1):
            polar, turn = math.pi * row / rows, 2 * math.pi * column / columns
            normals.append((math.sin(polar) * math.cos(turn), math.cos(polar), -math.sin(polar) * math.sin(turn)))
    for row, column in itertools.product(range(rows), range(columns)):
        first = row * (columns + 1) + column
        below = first + columns + 1
        indices += [first, below, below + 1] if row < rows - 1 else []
        indices += [first, below + 1, first + 1] if row > 0 else []
    return [(x, y + 1, z) for x, y, z in normals], indices, normals


def surface(chance):
    """A matte material, a glossy one, or a mirror."""
    color = [round(chance.uniform(0.15, 0.85), 2) for _ in range(3)] + [1]
    kind = chance.random()
    if kind < 0.15:
        return [0.9, 0.9, 0.9, 1], {"metallicFactor": 1, "roughnessFactor": 0}
    return color, {"metallicFactor": 0, "roughnessFactor": 0.5 if kind < 0.35 else 1}


def write_sky(path, chance):
    """A latitude-longitude picture: brighter above, and on one side."""
    width, height = 32, 16
    zenith = [chance.uniform(0.3, 1.2) for _ in range(3)]
    horizon = [chance.uniform(0.05, 0.6) for _ in range(3)]
    rows = bytearray(f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode())
    for row, column in itertools.product(range(height), range(width)):
        up = max(0.0, 1 - 2 * (row + 0.5) / height)
        side = 1 + 0.5 * math.cos(2 * math.pi * column / width)
        color = [side * (h + (z - h) * up) for h, z in zip(horizon, zenith)]
        mantissa, exponent = math.frexp(max(color))
        rows += bytes(int(c * mantissa * 256 / max(color)) for c in color) + struct.pack("B", exponent + 128)
    path.write_bytes(rows)
    return path.name


class RandomScene:
    """What a seed makes of a ground, things on it and what lights them; and the options it is looked at with."""

    def __init__(self, folder, seed, side):
        chance = random.Random(seed)
        quads = Quads()
        reach = chance.choice((5, 7, 10))
        ground = [(-reach, 0, reach), (reach, 0, reach), (reach, 0, -reach), (-reach, 0, -reach)]
        self.place(quads, (ground, FRONT, None), [round(chance.uniform(0.2, 0.85), 2) for _ in range(3)] + [1], {})
        for _ in range(chance.randint(4, 7)):
            size = chance.uniform(0.3, 1.0)
            color, metal = surface(chance)
            turn = chance.uniform(0, math.pi)
            self.place(quads, chance.choice((box, sphere))(), color, metal,
                       scale=[size * chance.uniform(0.6, 1.4), size, size * chance.uniform(0.6, 1.4)],
                       rotation=[0, math.sin(turn / 2), 0, math.cos(turn / 2)],
                       translation=[chance.uniform(-2.5, 2.5), chance.choice((0, 0, 0.2)), chance.uniform(-2.5, 2.5)])
        light = chance.choice(("even", "lamp", "picture", "even and lamp"))
        if "lamp" in light:
            half, height = chance.uniform(0.3, 0.8), chance.uniform(3.5, 5)
            strength = round(chance.uniform(10, 30) / (half * half), 1)
            quads.gltf["extensionsUsed"].append("KHR_materials_emissive_strength")
            corners = [(-half, 0, half), (-half, 0, -half), (half, 0, -half), (half, 0, half)]
            self.place(quads, (corners, FRONT, None), [0, 0, 0, 1], {}, emissiveFactor=[1, 0.9, 0.8],
                       extensions={"KHR_materials_emissive_strength": {"emissiveStrength": strength}},
                       translation=[chance.uniform(-2, 2), height, chance.uniform(-2, 2)])
        sky = "none"
        if "even" in light:
            sky = ",".join(f"{chance.uniform(0.2, 1):.2f}" for _ in range(3))
        elif light == "picture":
            sky = write_sky(folder / f"{seed}.hdr", chance)
        turn, height, distance = chance.uniform(0, 2 * math.pi), chance.uniform(2, 5), chance.uniform(7, 9)
        eye = f"{distance * math.cos(turn):.3f},{height:.3f},{distance * math.sin(turn):.3f}"
        quads.write(folder / f"{seed}.gltf")
        self.name = f"{seed}: {light}, ground {2 * reach} m"
        self.look = (f"{seed}.gltf", "--eye", eye, "--at", "0,0.5,0", "--fov", "40", "--environment", sky,
                     "--size", f"{side}x{side}")

    @staticmethod
    def place(quads, shape, color, metal, emissiveFactor=None, extensions=None, **transform):
        corners, indices, normals = shape
        fields = {"pbrMetallicRoughness": {"baseColorFactor": color, "metallicFactor": 0, "roughnessFactor": 1} | metal,
                  "doubleSided": emissiveFactor is None}
        fields |= {"emissiveFactor": emissiveFactor, "extensions": extensions} if emissiveFactor else {}
        quads.place(quads.mesh(quads.material(color, **fields), corners, indices, normals), **transform)


def luminance(path):
    channels = exr.read(path)[2]
    return [0.2126 * r + 0.7152 * g + 0.0722 * b for r, g, b in zip(*(channels[c] for c in "RGB"))]


def pictures(folder, look, *arguments):
    found = []
    for seed in range(RUNS):
        run_to(folder, ("render", *look, *arguments, "--seed", str(seed + 1), "-o", "a.exr", "--force"), timeout=3600)
        found.append(luminance(folder / "a.exr"))
    return found


class Blocks:
    """The means of blocks over some pictures of one thing, and their variances."""

    def __init__(self, images, side):
        self.side, self.across = side, side // BLOCK
        each = [self.of(image) for image in images]
        self.means = [sum(values) / len(values) for values in zip(*each)]
        own = [sum((v - m) ** 2 for v in values) / (len(values) - 1) / len(values)
               for values, m in zip(zip(*each), self.means)]
        # A few pictures alone say little: neighbors' noise is alike, in proportion.
        relative = [v / (m * m) if m > 0 else 0 for v, m in zip(own, self.means)]
        self.variances = [max(v, m * m * self.mean_about(relative, i)) for i, (v, m) in enumerate(zip(own, self.means))]
        self.mean = sum(self.means) / len(self.means)

    def of(self, image):
        return [sum(image[(y + j) * self.side + x + i] for j in range(BLOCK) for i in range(BLOCK)) / BLOCK**2
                for y in range(0, self.side, BLOCK) for x in range(0, self.side, BLOCK)]

    def mean_about(self, values, index):
        row, column = divmod(index, self.across)
        about = [values[y * self.across + x] for y in range(max(row - 1, 0), min(row + 2, self.across))
                 for x in range(max(column - 1, 0), min(column + 2, self.across))]
        return sum(about) / len(about)


def fireflies(image, truth, side):
    """The pixels that are so much brighter than all about them, and are not meant to be: [(x, y), ...]."""
    found = []
    for y, x in itertools.product(range(side), range(side)):
        about = [image[j * side + i] for j in range(max(y - 1, 0), min(y + 2, side))
                 for i in range(max(x - 1, 0), min(x + 2, side)) if (i, j) != (x, y)]
        if image[y * side + x] > FIREFLY * max(*about, truth[y * side + x]) > 0:
            found.append((x, y))
    return found


def compare(folder, seed, side):
    scene = RandomScene(folder, seed, side)
    best_images = pictures(folder, scene.look, "--quality", "best")
    true_images = pictures(folder, scene.look, "--reference", "--spp", str(REFERENCE_SAMPLES))
    truth = Blocks(true_images, side)
    best = Blocks(best_images, side)
    spread = math.sqrt(sum(best.variances) + sum(truth.variances)) / len(truth.means)
    off = best.mean / truth.mean - 1
    errors = [(b - t) / t if t > 0 else float(b > 0) for b, t in zip(best.means, truth.means)]
    over = [abs(b - t) - STANDARD_ERRORS * math.sqrt(bv + tv) - BLOCK_ERROR * t
            for b, t, bv, tv in zip(best.means, truth.means, best.variances, truth.variances)]
    wrong = [i for i, excess in enumerate(over) if excess > 0]
    expected = [sum(values) / len(values) for values in zip(*true_images)]
    flies = [pixel for image in best_images for pixel in fireflies(image, expected, side)]
    noise = math.sqrt(sum(v / max(m * m, 1e-12) for v, m in zip(best.variances, best.means)) / len(best.means))
    print(f"{scene.name}: mean {100 * off:+.2f} % (chance {100 * spread / truth.mean:.2f}), blocks {100 * min(errors):+.1f} to "
          f"{100 * max(errors):+.1f} %, {len(wrong)} beyond what is allowed, noise of a block {100 * noise:.2f} %, "
          f"{len(flies)} fireflies", flush=True)
    expect(abs(off) < MEAN_ERROR + STANDARD_ERRORS * spread / truth.mean, f"{scene.name}: the mean is {100 * off:+.2f} % off")
    expect(not wrong, f"{scene.name}: blocks {[(*divmod(i, best.across), round(100 * errors[i], 1)) for i in wrong]} are off, in %")
    expect(not flies, f"{scene.name}: pixels {flies} are {FIREFLY} times as bright as all about them")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("hpr")
    parser.add_argument("--side", type=int, default=128)
    parser.add_argument("seeds", type=int, nargs="*", default=SEEDS)
    options = parser.parse_intermixed_args()
    with tempfile.TemporaryDirectory() as name:
        for seed in options.seeds:
            compare(pathlib.Path(name), seed, options.side)
    if not failures:
        print("blocks of the best pictures are as the path tracer has them")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
