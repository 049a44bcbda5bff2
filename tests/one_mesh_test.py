#!/usr/bin/env python3
"""A scene in one large mesh, which rank 0 reads in pieces where ranks hold parts: the same bits, and the same words where
the file is wrong.

usage: one_mesh_test.py HPR

Prints what differs and leaves with 1.
"""

import json
import pathlib
import struct
import sys
import tempfile

from program import Failure, check, expect, failures, plain, run, run_to

SIZE = ("--size", "171x105", "--force")


def with_last_index(glb, index):
    """The file with another last index of its largest mesh."""
    bytes_ = bytearray(glb)
    length = struct.unpack_from("<I", bytes_, 12)[0]
    document = json.loads(bytes_[20:20 + length])
    primitive = max((p for mesh in document["meshes"] for p in mesh["primitives"]),
                    key=lambda p: document["accessors"][p["indices"]]["count"])
    accessor = document["accessors"][primitive["indices"]]
    check(accessor["componentType"] == 5125, "indices of other than 32 bits")
    at = 20 + length + 8 + document["bufferViews"][accessor["bufferView"]].get("byteOffset", 0)
    struct.pack_into("<I", bytes_, at + accessor.get("byteOffset", 0) + 4 * (accessor["count"] - 1), index)
    return bytes(bytes_)


def main(folder):
    run_to(folder, ["scene", "make", "tetra?s=8", "-o", "a.glb"])
    check((folder / "a.glb").stat().st_size > 4 << 20, "the mesh is too small to be read in pieces")
    options = (*SIZE, *plain("--spp", "2"))
    run_to(folder, ["render", "a.glb", *options, "-o", "whole.exr"])
    whole = (folder / "whole.exr").read_bytes()
    for ranks in ("1", "2", "3", "4"):
        for threads in ("1", "2"):
            run_to(folder, ["render", "a.glb", *options, "--ranks", ranks, "--threads", threads, "--data", "partitioned",
                            "-o", "part.exr"])
            expect((folder / "part.exr").read_bytes() == whole, f"other bits with {ranks} ranks of {threads} threads")

    (folder / "b.glb").write_bytes(with_last_index((folder / "a.glb").read_bytes(), 4_000_000_000))
    said = [run(folder, "render", "b.glb", *options, "-o", "b.exr", *more)
            for more in ((), ("--ranks", "3", "--data", "partitioned"))]
    for result in said:
        expect(result.returncode == said[0].returncode != 0, f"a wrong index: left with {result.returncode}")
        expect("is 4000000000, but there are" in result.stderr, f"a wrong index: {result.stderr[-500:]}")
    expect(not (folder / "b.exr").exists(), "a wrong index: left a picture")


with tempfile.TemporaryDirectory() as name:
    try:
        main(pathlib.Path(name))
    except Failure as failure:
        expect(False, str(failure))
sys.exit(1 if failures else 0)
