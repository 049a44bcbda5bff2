#!/usr/bin/env python3
"""Which side of single-sided surfaces is seen: alike by the rasteriser, by rays and by the reference, on any number of ranks.

usage: sides_test.py HPR

Prints what differs and leaves with 1.
"""

import itertools
import pathlib
import sys
import tempfile

import exr
from program import expect, failures, run_to
from quads import BACK, FRONT, Quads

SIGNS = list(itertools.product((1, -1), repeat=3))
ROWS = [(shared, indices, sides) for shared in (True, False) for indices in (FRONT, BACK) for sides in (False, True, None)]
SIZE = 8  # pixels of a cell
WIDTH, HEIGHT = SIZE * len(SIGNS), SIZE * len(ROWS)
WAYS = [(), ("--ranks", "3", "--distribute", "sort-first"), ("--ranks", "3", "--distribute", "sort-middle"),
        ("--ranks", "3", "--distribute", "sort-last"),
        ("--ranks", "3", "--distribute", "sort-last", "--strategy", "binary-swap", "--data", "partitioned")]


def write_scene(path):
    """A cell for each: columns mirror none to three axes, rows share a mesh or not, wind it both ways, and have one side, two
    sides, or the material that a primitive without one has."""
    quads = Quads()
    one_sided = quads.material((1, 1, 1, 1))
    two_sided = quads.material((1, 1, 1, 1), doubleSided=True)
    for row, (shared, indices, sides) in enumerate(ROWS):
        material = {False: one_sided, True: two_sided, None: None}[sides]
        mesh = quads.mesh(material, indices=indices)
        for column, signs in enumerate(SIGNS):
            if not shared and column > 0:
                mesh = quads.mesh(material, indices=indices)
            quads.place(mesh, translation=[2 * column + 1, 2 * (len(ROWS) - row) - 1, 0], scale=[0.8 * sign for sign in signs])
    quads.write(path)


def is_seen(signs, indices, sides):
    """From +z: where scaling leaves the front on that side, x and y mirrored or not."""
    return bool(sides) or (signs[2] > 0) == (indices is FRONT)


def render(folder, *options):
    middle = f"{len(SIGNS)},{len(ROWS)}"
    run_to(folder, ["render", "sides.gltf", "--eye", f"{middle},100", "--at", f"{middle},0", "--fov", "13.69", "--size",
                    f"{WIDTH}x{HEIGHT}", "-o", "a.exr", "--force", "--environment", "0.25,0.25,0.25", "--quality", "draft",
                    "--spp", "1", *options])
    return (folder / "a.exr").read_bytes(), exr.read(folder / "a.exr")[2]["G"]


def check_cells(image, what, seen_by):
    # The environment is what is seen beside and through the quads; light makes those with the default material brighter or
    # darker, never that.
    for (row, (shared, indices, sides)), (column, signs) in itertools.product(enumerate(ROWS), enumerate(SIGNS)):
        center = image[(row * SIZE + SIZE // 2) * WIDTH + column * SIZE + SIZE // 2]
        expected = seen_by(signs, indices, sides)
        winding = "counterclockwise" if indices is FRONT else "clockwise"
        expect((center != 0.25) == expected, f"{what}: scale {signs}, {winding}, shared {shared}, double-sided {sides}: {center}")


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        write_scene(folder / "sides.gltf")
        for primary in (("--primary", "raster"), ("--primary", "rays"), ("--reference",)):
            pictures = set()
            for way in WAYS:
                picture, image = render(folder, *primary, *way)
                pictures.add(picture)
                check_cells(image, " ".join(primary + way), is_seen)
            expect(len(pictures) == 1, f"{primary}: ranks change bits")
            check_cells(render(folder, *primary, "--cull", "none")[1], f"{primary} --cull none", lambda *_: True)
    return 1 if failures else 0


sys.exit(main())
