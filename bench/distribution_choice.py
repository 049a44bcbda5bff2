#!/usr/bin/env python3
"""How often `--distribute auto` is right, and how far predictions are off: whole frames on this machine, of scenes, sizes
and numbers of ranks that a seed chooses.

usage: distribution_choice.py HPR [--seed N] [--cells N] [--frames N]

A cell is one scene at one size on one number of ranks. Auto is right where the distribution that it chose takes at most
10 % longer than the fastest one, by the medians of frames; frames of "auto" count with those of what it chose, as they
are made alike. The machine should be quiet: the last line says how far frames of one distribution lay apart.
"""
import argparse
import json
import random
import statistics
import subprocess
import sys

SCENES = (
    lambda rng: f"gen:sphereflake?s={rng.randint(2, 4)}&n={rng.randint(2, 6)}",
    lambda rng: f"gen:asteroids?count={rng.randint(100, 1500)}&seed={rng.randint(1, 10**6)}",
    lambda rng: f"gen:tetra?s={rng.randint(6, 8)}",
    lambda rng: f"gen:gallery?s={rng.randint(1, 3)}",
)
SIZES = ("320x240", "640x360", "960x540")
PASSES = ("none", "none", "shadow")


def cells(seed, count):
    rng = random.Random(seed)
    for i in range(count):
        yield (SCENES[i % len(SCENES)](rng), rng.choice(SIZES), rng.choice(PASSES), rng.choice((2, 3, 4)))


def measure(hpr, cell, frames):
    scene, size, passes, ranks = cell
    done = subprocess.run([hpr, "compare", scene, "--distribute", "all", "--ranks", str(ranks), "--size", size,
                           "--primary", "raster", "--passes", passes, "--spp", "1", "--frames", str(frames), "--json"],
                          capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"{cell}: {done.stderr}")
    return json.loads(done.stdout)["runs"]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("hpr")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--cells", type=int, default=20)
    parser.add_argument("--frames", type=int, default=12)
    args = parser.parse_args()
    right = 0
    errors, spreads = [], []
    for cell in cells(args.seed, args.cells):
        times, chosen = {}, None
        for run in measure(args.hpr, cell, args.frames):
            chosen = run.get("chosen", chosen)
            name = run.get("chosen", run["distribution"])  # of jobs that chose otherwise "sort-first, hybrid"
            times.setdefault(name, []).append(run["ms"]["median"])
            spreads.append(run["ms"]["p95"] / run["ms"]["min"])
            if run["predicted_ms"]:
                errors.append(abs(run["predicted_ms"] / run["ms"]["median"] - 1.0))
        medians = {name: statistics.mean(ms) for name, ms in times.items()}
        best = min(medians, key=medians.get)
        ratio = medians[chosen] / medians[best]
        right += ratio <= 1.1
        print(f"{cell[0]:40} {cell[1]:8} passes {cell[2]:6} ranks {cell[3]}: {chosen} takes {ratio:.2f} x {best}, "
              + ", ".join(f"{name} {ms:.1f}" for name, ms in sorted(medians.items(), key=lambda item: item[1])), flush=True)
    print(f"{right} of {args.cells} cells within 10 % of the best; predictions off by {statistics.median(errors):.0%} in the "
          f"median; p95 by the least frame {statistics.median(spreads):.2f} in the median")


if __name__ == "__main__":
    main()
