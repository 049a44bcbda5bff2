#!/usr/bin/env python3
"""One picture, however it is made: the same bits over ranks, distributions, strategies, threads, backends and balances.

usage: bit_equality_test.py HPR [--full]

Renders gen:gallery, its visible surfaces found by OpenGL, by rays, with indirect light along rays, and with every pass and
four samples, and the points and lines of gen:cloud, and compares the hashes of the visibility keys (--raw) and of the EXR file's bytes. Without --full, so few
small pictures that every two values of different options meet in one of them, and the first once more; with it, every
combination at 1280x1024, but for strategies with other balances than demand. Prints the hashes, the number of runs and what differs, and leaves with 1 if anything does.
"""

import hashlib
import itertools
import os
import pathlib
import re
import subprocess
import sys
import tempfile

from program import plain

HPR = os.path.abspath(sys.argv[1])
FULL = sys.argv[2:] == ["--full"]
SCENE = "gen:gallery"
SIZE = (1280, 1024) if FULL else (200, 88)
FEW = ["--photons", "2000"]
WAYS = {
    "raster": ["--primary", "raster", *FEW],
    "rays": ["--primary", "rays", *FEW],
    "gathered": ["--passes", "shadow,reflection,refraction,gather", "--spp", "3"],
    "all passes": ["--passes", "shadow,reflection,refraction,ambient-occlusion,photon", "--spp", "4", *FEW],
    "points": ["--primary", "raster", "--indirect", *FEW],
    "points by rays": ["--primary", "rays", "--indirect", *FEW],
}
SCENES = {"points": "gen:cloud?count=2000", "points by rays": "gen:cloud?count=2000"}


def hpr(arguments, folder):
    return subprocess.run([HPR, *arguments], cwd=folder, capture_output=True, text=True, timeout=300, check=False)


def choices_of(option, folder):
    """The names an option takes, from the hint that an unknown one gets."""
    result = hpr(["render", SCENE, "-o", "unused.exr", option, "?"], folder)
    hint = re.search(r"choices: (.*)", result.stderr)
    if result.returncode != 2 or not hint:
        sys.exit(f"{option} ? left with {result.returncode} and lists no choices: {result.stderr}")
    return hint.group(1).split(", ")


def usable_backends(folder):
    """Those of EGL and OSMesa this machine has."""
    found = []
    for backend in ("egl", "osmesa"):
        result = hpr(["render", SCENE, "--size", "16x16", "-o", f"{backend}.png", "--backend", backend], folder)
        if result.returncode == 0:
            found.append(backend)
        elif result.returncode == 5:
            print(f"{backend}: not on this machine")
        else:
            sys.exit(f"--backend {backend} left with {result.returncode}: {result.stderr}")
    return found or sys.exit("no backend works")


def pairs_of(run):
    return set(itertools.combinations(enumerate(run), 2))


def covering(runs):
    """The first run, then greedily those that show most pairs of values not seen before, until all were."""
    unseen = set().union(*map(pairs_of, runs))
    chosen = []
    best = runs[0]
    while unseen:
        chosen.append(best)
        unseen -= pairs_of(best)
        best = max(runs, key=lambda run: len(pairs_of(run) & unseen))
    return [*chosen, runs[0]]


def digests(way, run, folder):
    """The hashes of one run's keys and picture, or what went wrong."""
    ranks, distribution, strategy, threads, backend, balance = run
    result = hpr(["render", SCENES.get(way, SCENE), "--size", f"{SIZE[0]}x{SIZE[1]}", "--ranks", ranks, "--distribute", *distribution.split(),
                  "--strategy", strategy, "--threads", threads, "--backend", backend, "--balance", balance, *plain(*WAYS[way]), "--raw", "a.keys",
                  "-o", "a.exr", "--force"], folder)
    if result.returncode != 0:
        return f"left with {result.returncode}: {result.stderr[-2000:]}"
    keys = (folder / "a.keys").read_bytes()
    picture = (folder / "a.exr").read_bytes()
    if len(keys) != SIZE[0] * SIZE[1] * 8 or not any(keys):
        return f"{len(keys)} bytes of keys, of which {len(keys) - keys.count(0)} are not 0"
    return tuple(hashlib.sha256(data).hexdigest()[:16] for data in (keys, picture))


def differing(way, runs, folder):
    """How many runs differ from the first."""
    expected = digests(way, runs[0], folder)
    print(f"{way} {' '.join(runs[0])}: {expected}")
    bad = int(isinstance(expected, str))
    for run in runs[1:]:
        found = digests(way, run, folder)
        if found != expected:
            print(f"{way} {' '.join(run)}: {found}")
            bad += 1
    print(f"{way}: {len(runs)} runs, {bad} differ from the first")
    return bad


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-bits-") as scratch:
        folder = pathlib.Path(scratch)
        ranks, threads = ("1", "2", "3", "4", "5", "7", "8") if FULL else ("1", "3", "8"), ("1", "2")
        distributions, backends = choices_of("--distribute", folder), usable_backends(folder)
        strategies, balances = choices_of("--strategy", folder), choices_of("--balance", folder)
        parts = ("sort-last --data partitioned", "hybrid --data partitioned")
        triangles = "sort-middle --data partitioned"
        traced = list(itertools.product(ranks, (*distributions, *parts), ("auto",), threads, backends[:1], balances))
        lit = list(itertools.product(ranks, (*(distributions if FULL else ("sort-first", "sort-last")), *parts), ("auto",), threads,
                                     backends[:1], balances))
        if FULL:
            drawn = [*itertools.product(ranks, distributions, strategies, threads, backends, ("demand",)),
                     *itertools.product(ranks, (*distributions, triangles), ("auto",), threads, backends[:1], balances)]
        else:
            drawn = list(itertools.product(("1", "2", "3", "7"), (*distributions, triangles), strategies, threads, backends, balances))
        runs = dict.fromkeys(WAYS, lit) | {"raster": drawn, "rays": traced}
        bad = sum(differing(way, runs[way] if FULL else covering(runs[way]), folder) for way in WAYS)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
