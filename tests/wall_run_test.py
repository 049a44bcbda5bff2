#!/usr/bin/env python3
"""One wall, however many ranks drive it and however they balance their work: a wall run by 1, 2 and 4 ranks has the
same hashes in its manifest.

usage: wall_run_test.py HPR

Prints what differs or is missing and leaves with 1.
"""

import json
import os
import pathlib
import subprocess
import sys
import tempfile

HPR = os.path.abspath(sys.argv[1])
SCENE = "gen:gallery"


def run(arguments, folder):
    result = subprocess.run([HPR, *arguments], cwd=folder, capture_output=True, text=True, timeout=300, check=False)
    if result.returncode != 0:
        print(f"hpr {' '.join(arguments)} left with {result.returncode}:\n{result.stderr[-2000:]}")
    return result


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


def balanced(folder):
    """The screens of three frames, of which the first tells where the second is cut."""
    bad = 0
    expected = None
    for ranks, balance in (("1", "static"), ("4", "static"), ("4", "measured"), ("4", "demand"), ("3", "demand")):
        out = folder / f"balanced-{ranks}-{balance}"
        options = ["--frames", "3", "--quality", "draft", "--primary", "rays", "--ranks", ranks, "--balance", balance]
        if run(["wall", "run", "3x2@200x140", SCENE, "--display", "file", "-o", out.name, *options], folder).returncode != 0:
            bad += 1
            continue
        frames = json.loads((out / "manifest.json").read_text())["frames"]
        hashes = [[screen["xxh64"] for screen in frame["screens"]] for frame in frames]
        expected = expected or hashes
        if len(hashes) != 3 or hashes != expected:
            print(f"{ranks} ranks, balance {balance}: {hashes} instead of {expected}")
            bad += 1
    return bad


def rests(folder):
    """A target time, one sample and an eye that does not move: the picture is refined from its second frame on."""
    return run(["wall", "run", "5x1@80x90", "gen:cornell", "--target-ms", "5", "--frames", "3", "--display", "none"], folder).returncode != 0


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-wall-run-") as scratch:
        return 1 if one_wall(pathlib.Path(scratch)) or balanced(pathlib.Path(scratch)) or rests(pathlib.Path(scratch)) else 0


if __name__ == "__main__":
    sys.exit(main())
