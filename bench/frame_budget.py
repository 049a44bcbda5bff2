#!/usr/bin/env python3
"""Does --target-ms hold? Runs camera paths with a target time and looks at the times of their frames.

usage: frame_budget.py HPR [--frames 300] [--scene gallery|cornell|all] [--ranks N] [-v]

Prints per scene the median and the 95th percentile beside the target, the median resolution and what was given up, and
leaves with 1 where the 95th percentile is beyond 1.15 times the target or the median below 0.7 times it (unless nothing
was given up: then the scene is quicker than asked).
"""

import argparse
import collections
import json
import os
import pathlib
import subprocess
import sys
import tempfile

MOST = 1.15
LEAST = 0.7

GALLERY = """
eye -20,1.7,4   at -12,1.6,0
eye -12,1.7,3   at -6,1.6,-1
eye -4,1.8,2    at 2,1.5,-2
eye 4,1.7,3     at 10,1.6,-1
eye 12,2.5,4    at 16,1.4,-2
eye 18,1.7,0    at 8,1.6,-1
"""
CORNELL = """
eye 0.278,0.273,-0.8  at 0.278,0.273,0
eye 0.40,0.30,-0.5    at 0.25,0.25,0.3
eye 0.48,0.48,-0.3    at 0.2,0.15,0.3 fov 55
eye 0.15,0.35,-0.4    at 0.3,0.2,0.3
eye 0.278,0.273,-0.8  at 0.278,0.273,0
"""
CASES = {"gallery": ("gen:gallery", "1x1@1280x720", 100.0, GALLERY),
         "cornell": ("gen:cornell", "1x1@1280x720", 33.0, CORNELL)}


def percentile(values, share):
    ordered = sorted(values)
    return ordered[min(int(share * len(ordered)), len(ordered) - 1)]


def measure(hpr, name, options):
    scene, wall, target, path = CASES[name]
    with tempfile.TemporaryDirectory(prefix="hpr-budget-") as scratch:
        folder = pathlib.Path(scratch)
        (folder / "path.txt").write_text(path)
        subprocess.run([hpr, "wall", "run", wall, scene, "--frames", str(options.frames), "--path", "path.txt",
                        "--target-ms", str(target), "-o", "out", "--ranks", str(options.ranks), "-q"],
                       cwd=folder, check=True, stdout=subprocess.DEVNULL)
        frames = json.loads((folder / "out" / "manifest.json").read_text())["frames"]
    times = [frame["ms"] for frame in frames]
    scales = [frame["budget"]["resolution_scale"] for frame in frames]
    given_up = collections.Counter(what for frame in frames for what in frame["budget"]["given_up"])
    half, tail = percentile(times, 0.5), percentile(times, 0.95)
    changes = sum(a != b for a, b in zip(scales, scales[1:]))
    held = tail <= MOST * target and (half >= LEAST * target or not given_up)
    print(f"{name:8} target {target:6.1f} ms  p50 {half:6.1f} ({half / target:.2f})  p95 {tail:6.1f} ({tail / target:.2f})  "
          f"scale {percentile(scales, 0.5):.2f} ({min(scales):.2f} to {max(scales):.2f}, {changes} changes)  "
          f"given up: {dict(given_up)}  {'held' if held else 'MISSED'}")
    if options.verbose:
        for frame in frames:
            print(f"  {frame['frame']:4} {frame['ms']:8.1f} ms  {frame['budget']['resolution_scale']:.3f}  "
                  f"{','.join(frame['budget']['given_up'])}")
    return held


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("hpr")
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--scene", choices=[*CASES, "all"], default="all")
    parser.add_argument("--ranks", type=int, default=1)
    parser.add_argument("-v", "--verbose", action="store_true")
    options = parser.parse_args()
    names = list(CASES) if options.scene == "all" else [options.scene]
    held = [measure(os.path.abspath(options.hpr), name, options) for name in names]
    return 0 if all(held) else 1


if __name__ == "__main__":
    sys.exit(main())
