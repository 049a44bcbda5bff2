#!/usr/bin/env python3
"""Pictures of several samples: the same bits however the work is spread, and closer to the truth with more of them.

usage: samples_test.py HPR

Prints what differs and leaves with 1.
"""

import json
import pathlib
import subprocess
import sys
import tempfile

import exr
from program import HPR, expect, failures

MATTE = "gen:cornell"


def hpr(folder, *arguments):
    result = subprocess.run([HPR, *arguments], cwd=folder, capture_output=True, text=True, timeout=300, check=False)
    expect(result.returncode == 0, f"hpr {' '.join(arguments)} left with {result.returncode}: {result.stderr[-1000:]}")
    return result


def render(folder, *arguments, scene="gen:gallery"):
    hpr(folder, "render", scene, "--size", "168x104", "-o", "a.exr", "--stats", "a.json", "--force", *arguments)
    return (folder / "a.exr").read_bytes()


def spread_differently(folder):
    """Ways to spread 4 samples of a picture whose owners change with a strategy that balances what is drawn."""
    expected = render(folder, "--spp", "4", "--filter", "gaussian")
    expect(expected != render(folder, "--spp", "4"), "the filter makes no difference")
    expect(expected != render(folder, "--spp", "4", "--filter", "gaussian", "--seed", "2"), "the seed makes no difference")
    ways = [("--threads", "2"), ("--ranks", "2"), ("--ranks", "3", "--distribute", "hybrid"),
            ("--ranks", "3", "--distribute", "sort-last", "--strategy", "direct-send"),
            ("--ranks", "4", "--distribute", "sort-last", "--strategy", "binary-swap"),
            ("--ranks", "3", "--distribute", "sort-last", "--strategy", "shared-memory"),
            ("--ranks", "2", "--distribute", "sort-last", "--strategy", "radix-k", "--threads", "2"),
            ("--ranks", "7", "--distribute", "hybrid", "--strategy", "tree")]
    for way in ways:
        expect(render(folder, "--spp", "4", "--filter", "gaussian", *way) == expected, f"other bits with {' '.join(way)}")


def one_sample(folder):
    plain = render(folder)
    expect(render(folder, "--spp", "1") == plain, "--spp 1 is not the default")
    expect(render(folder, "--spp", "1", "--filter", "box") != plain, "a filter's one sample looks through the centre")


def squared_error(folder, reference, samples):
    render(folder, "--spp", str(samples), scene=MATTE)
    image = exr.read(folder / "a.exr")[2]
    total = sum((a - b) ** 2 / (b * b + 1e-2) for c in "RGB" for a, b in zip(image[c], reference[c]))
    return total / (3 * len(image["R"])), json.loads((folder / "a.json").read_text())


def convergence(folder):
    """In a scene without highlights, where the estimate can be held to the truth."""
    render(folder, "--spp", "512", scene=MATTE)
    reference = exr.read(folder / "a.exr")[2]
    error, stats = {}, None
    for samples in (4, 16, 64):
        error[samples], stats = squared_error(folder, reference, samples)
        expect(stats["samples"] == samples and 0 < stats["ms_per_sample"] <= stats["ms"], f"stats of {samples} samples")
    expect(error[64] < error[16] / 3 < error[4] / 9, f"samples do not help as they should: {error}")
    # Edges alone are sampled far better than independent samples would do.
    expect(error[64] / 2 < stats["estimated_relmse"] < 100 * error[64],
          f"estimated {stats['estimated_relmse']}, measured {error[64]}")
    target = 2 * stats["estimated_relmse"]
    reached, stats = squared_error(folder, reference, f"until:relmse={target}")
    expect(stats["estimated_relmse"] <= target and 16 <= stats["samples"] < 64, f"until {target}: {stats['samples']} samples")
    expect(reached <= 2 * target, f"until {target}: {reached} is left")
    expected = render(folder, "--spp", f"until:relmse={target}", scene=MATTE)
    expect(render(folder, "--spp", f"until:relmse={target}", "--ranks", "3", "--distribute", "sort-last",
                 scene=MATTE) == expected, "three ranks stop elsewhere")


def until_a_time(folder):
    for ranks in ("1", "3"):
        render(folder, "--spp", "until:1s", "--ranks", ranks)
        stats = json.loads((folder / "a.json").read_text())
        expect(stats["samples"] > 1 and 1000 <= stats["ms"] < 20000, f"until 1 s, {ranks} ranks: {stats['ms']} ms")


def a_wall(folder):
    hashes = []
    for name, ranks, samples in (("w1", "1", "4"), ("w3", "3", "4"), ("w1plain", "1", "1")):
        hpr(folder, "wall", "run", "3x1@96x64", "gen:gallery", "-o", name, "--ranks", ranks, "--spp", samples, "--frames", "2")
        frames = json.loads((folder / name / "manifest.json").read_text())["frames"]
        hashes.append([[screen["xxh64"] for screen in frame["screens"]] for frame in frames])
    expect(hashes[0] == hashes[1], "a wall of four samples has other bits with three ranks")
    expect(hashes[0][0] != hashes[0][1], "two frames have the same noise")
    expect(hashes[0][0] != hashes[2][0], "four samples are one")


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-samples-") as scratch:
        folder = pathlib.Path(scratch)
        one_sample(folder)
        spread_differently(folder)
        convergence(folder)
        until_a_time(folder)
        a_wall(folder)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
