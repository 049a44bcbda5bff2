#!/usr/bin/env python3
"""Scenes of which a rank's part comes from the disk page by page (`--data paged`): the bits of a whole scene, with any
number of ranks, and clear words where it cannot be.

usage: paged_test.py HPR

Prints what differs and leaves with 1.
"""

import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile

from program import HPR, Failure, check, expect, failures, plain, run, run_to

SIZE = ("--size", "107x75", "--force")
HYBRID = ("--distribute", "hybrid", "--groups", "2")
# How it is made, and by how many ranks of how many threads it is drawn. A gallery has glass, lamps, textures and meshes that
# several instances share; the limit that one rank has leaves room for each of its pictures, that of more does not.
SCENES = {
    "a": (("asteroids?count=12&k=5", "--flatten"), ((1, 2, ()), (2, 1, ()), (4, 1, HYBRID))),
    "t": (("tetra?s=8",), ((1, 2, ()), (2, 1, ()), (3, 1, ()))),
    "g": (("gallery?s=1&n=2&k=4",), ((1, 2, ()),)),
}


def whole_bytes(folder, scene):
    """What its meshes take, of which a limit is to leave too little."""
    limit = (folder / scene).stat().st_size * 5 // 8
    result = run(folder, "render", scene, "-o", "no.exr", "--limit-mem", str(limit), "--data", "partitioned")
    found = re.search(r"needs (\d+) bytes", result.stderr)
    check(found is not None, f"{scene}: no number of bytes in {result.stderr[-300:]}")
    return int(found.group(1))


def paged(folder, scene, limit, ranks, *more):
    """Renders it by so many ranks and returns the bytes of the picture and how each rank's pages are explained."""
    result = run(folder, "render", scene, *SIZE, "-o", "paged.exr", "--data", "paged", "--limit-mem", str(limit),
                 "--ranks", str(ranks), "--explain", "--stats", "paged.json", *more)
    check(result.returncode == 0, f"{scene}, {ranks} ranks {more}: left with {result.returncode}: {result.stderr[-600:]}")
    explained = re.search(r"data: paged \(as asked: .*; (\d+) of (\d+) pages of this rank", result.stdout + result.stderr)
    pages = tuple(map(int, explained.groups())) if explained else None
    return (folder / "paged.exr").read_bytes(), pages, json.loads((folder / "paged.json").read_text())


def same_bits(folder):
    for name, (arguments, ways) in SCENES.items():
        scene = f"{name}.glb"
        run_to(folder, ["scene", "make", arguments[0], "-o", scene, *arguments[1:]])
        size = whole_bytes(folder, scene)
        for primary in ("rays", "raster"):
            options = (*plain("--spp", "2"), "--primary", primary, "--photons", "500")
            run_to(folder, ["render", scene, *SIZE, *options, "-o", "whole.exr"])
            whole = (folder / "whole.exr").read_bytes()
            for ranks, threads, more in ways:
                parts = ranks // 2 if more == HYBRID else ranks
                picture, pages, stats = paged(folder, scene, 3 * size // (4 * parts), ranks, "--threads", str(threads), *options, *more)
                case = f"{scene} by {primary}, {ranks} ranks {more}"
                expect(picture == whole, f"{case}: other bits")
                # What all ranks hold whole, lamps and glass, leaves less for pages: then there are more of them.
                expect(pages is not None and 8 <= pages[0] < pages[1], f"{case}: pages {pages}")
                expect(all(loads >= pages[1] for loads in stats["page_loads_per_rank"]), f"{case}: loads {stats.get('page_loads_per_rank')}")


def where_there_is_room(folder):
    size = whole_bytes(folder, "a.glb")
    picture, pages, stats = paged(folder, "a.glb", 4 * size, 2, *plain("--spp", "1"))
    expect(pages is None and bool(picture), f"pages where all fits: {pages}")
    expect("page_loads_per_rank" not in stats, "page loads where there are no pages")
    alone, pages, _ = paged(folder, "a.glb", 4 * size, 1, *plain("--spp", "1"))
    expect(pages is None and alone == picture, "one rank that has room")


def refusals(folder):
    size = whole_bytes(folder, "a.glb")
    limit = ("--limit-mem", str(size // 2))
    for arguments, code, mention in (
            (("--data", "paged", "--distribute", "sort-middle", "--primary", "raster", *limit), 2, "page by page"),
            (("--data", "paged", "--verify", "5", *limit), 2, "paged"),
            (("--data", "paged", "--limit-mem", str(size // 100)), 6, "raise --limit-mem"),
            (("--data", "partitioned", "--limit-mem", str(size // 3), "--ranks", "2"), 6, "--data paged")):
        result = run(folder, "render", "a.glb", *SIZE, "-o", "no.exr", *arguments)
        expect(result.returncode == code and mention in result.stderr, f"{arguments}: left with {result.returncode}: {result.stderr[-400:]}")
        expect(not (folder / "no.exr").exists(), f"{arguments}: left a picture")
    result = subprocess.run([HPR, "render", "a.glb", *SIZE, "-o", "no.exr", "--data", "paged", *limit], cwd=folder, check=False,
                            env={**os.environ, "TMPDIR": str(folder / "nowhere")}, capture_output=True, text=True, timeout=120)
    expect(result.returncode == 4 and "TMPDIR" in result.stderr and "nowhere" in result.stderr,
           f"no folder for pages: left with {result.returncode}: {result.stderr[-400:]}")


with tempfile.TemporaryDirectory() as name:
    try:
        same_bits(pathlib.Path(name))
        where_there_is_room(pathlib.Path(name))
        refusals(pathlib.Path(name))
    except Failure as failure:
        expect(False, str(failure))
sys.exit(1 if failures else 0)
