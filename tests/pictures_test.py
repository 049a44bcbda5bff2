#!/usr/bin/env python3
"""One picture, however it is made: the same bits over rank counts, distributions, strategies, threads and backends.

usage: pictures_test.py HPR

Renders a small gallery in every combination and compares the visibility keys (--raw) and the EXR's pixels; drives a
wall by 1, 2 and 4 ranks and compares the hashes of its manifest. Prints what differs and leaves with 1.
"""

import hashlib
import itertools
import json
import os
import pathlib
import subprocess
import sys
import tempfile

HPR = os.path.abspath(sys.argv[1])
SCENE = "gen:gallery"
SIZE = ["--size", "320x256"]


def run(arguments, folder):
    result = subprocess.run([HPR, *arguments], cwd=folder, capture_output=True, text=True, timeout=300, check=False)
    if result.returncode != 0:
        print(f"hpr {' '.join(arguments)} left with {result.returncode}:\n{result.stderr[-2000:]}")
    return result


def digest(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]


def variants(backends):
    """(name, options) of every picture to make; the first is the one all others must equal."""
    yield "1 rank", ["--ranks", "1", "--backend", backends[0]]
    for backend, threads in itertools.product(backends, (1, 2)):
        yield f"1 rank, {backend}, {threads} threads", ["--ranks", "1", "--backend", backend, "--threads", str(threads)]
    for ranks in (2, 3, 4):
        yield f"{ranks} ranks, sort-first", ["--ranks", str(ranks), "--distribute", "sort-first"]
        for distribution, strategy in itertools.product(("sort-last", "hybrid"), ("serial", "tree", "binary-swap")):
            yield (f"{ranks} ranks, {distribution}, {strategy}",
                   ["--ranks", str(ranks), "--distribute", distribution, "--strategy", strategy])
    yield "4 ranks, sort-last, mpi-reduce", ["--ranks", "4", "--distribute", "sort-last", "--strategy", "mpi-reduce"]
    for backend in backends[1:]:
        yield (f"3 ranks, hybrid, {backend}, 2 threads",
               ["--ranks", "3", "--distribute", "hybrid", "--backend", backend, "--threads", "2"])
    yield "1 rank again", ["--ranks", "1", "--backend", backends[0]]


def usable_backends(folder):
    found = []
    for backend in ("egl", "osmesa"):
        result = subprocess.run([HPR, "render", SCENE, "--size", "16x16", "-o", f"probe-{backend}.png", "--backend", backend],
                                cwd=folder, capture_output=True, text=True, timeout=300, check=False)
        if result.returncode == 0:
            found.append(backend)
        elif result.returncode != 5:
            print(f"--backend {backend} left with {result.returncode}: {result.stderr}")
            return None
        else:
            print(f"{backend}: not on this machine")
    return found


def one_picture(folder):
    backends = usable_backends(folder)
    if not backends:
        print("no backend works")
        return 1
    bad = 0
    expected = None
    for number, (name, options) in enumerate(variants(backends)):
        keys, picture = folder / f"{number}.keys", folder / f"{number}.exr"
        result = run(["render", SCENE, *SIZE, *options, "--raw", keys.name, "-o", picture.name], folder)
        if result.returncode != 0:
            bad += 1
            continue
        if keys.stat().st_size != 320 * 256 * 8:
            print(f"{name}: {keys.stat().st_size} bytes of keys instead of {320 * 256 * 8}")
            bad += 1
        if expected is None:
            expected = (name, digest(keys), picture)
            if not any(keys.read_bytes()):
                print("nothing was drawn")
                bad += 1
            continue
        if digest(keys) != expected[1]:
            print(f"{name}: other keys than {expected[0]}")
            bad += 1
        # The files' headers may name the run, so the pixels are compared, not the files.
        compared = run(["diff", expected[2].name, picture.name], folder)
        if compared.returncode != 0:
            print(f"{name}: other pixels than {expected[0]}: {compared.stdout.strip()}")
            bad += 1
        keys.unlink()
        picture.unlink()
    print(f"{number + 1} pictures, {bad} complaints")
    return bad


def one_wall(folder):
    bad = 0
    expected = None
    for ranks in (1, 2, 4):
        out = folder / f"wall-{ranks}"
        result = run(["wall", "run", "3x2@160x120", SCENE, "--display", "file", "-o", out.name, "--ranks", str(ranks)], folder)
        if result.returncode != 0:
            bad += 1
            continue
        manifest = json.loads((out / "manifest.json").read_text())
        if manifest.get("schema") != "hpr.wall-run/1":
            print(f"schema {manifest.get('schema')!r}")
            bad += 1
        screens = {s["id"]: (s["width"], s["height"], s["xxh64"]) for s in manifest["frames"][0]["screens"]}
        states = {s["state"] for s in manifest["frames"][0]["screens"]}
        files = {p.name for p in out.iterdir()}
        wanted = {f"{name}.png" for name in screens} | {"wall.png", "manifest.json"}
        if len(screens) != 6 or states != {"fresh"} or not wanted <= files:
            print(f"{ranks} ranks: {len(screens)} screens, states {states}, missing {wanted - files}")
            bad += 1
        hashes = (screens, manifest["scene_hash"], manifest["wall_hash"])
        expected = expected or hashes
        if hashes != expected:
            print(f"{ranks} ranks: another wall than with 1: {hashes} instead of {expected}")
            bad += 1
        if len({screen[2] for screen in screens.values()}) < 2:
            print(f"{ranks} ranks: all screens show the same")
            bad += 1
    return bad


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-pictures-") as scratch:
        folder = pathlib.Path(scratch)
        return 1 if one_picture(folder) + one_wall(folder) else 0


if __name__ == "__main__":
    sys.exit(main())
