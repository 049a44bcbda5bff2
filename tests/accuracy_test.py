#!/usr/bin/env python3
"""The options that trade bits for speed: what they may change, what they must not, and what they refuse.

usage: accuracy_test.py HPR

Prints what differs and leaves with 1.
"""

import json
import pathlib
import subprocess
import sys
import tempfile

import exr
from program import HPR, expect, failures, plain

SCENE = "gen:gallery"


def hpr(folder, *arguments):
    return subprocess.run([HPR, *arguments], cwd=folder, capture_output=True, text=True, timeout=300, check=False)


def render(folder, *arguments, scene=SCENE):
    result = hpr(folder, "render", scene, "--size", "168x104", "-o", "a.exr", "--stats", "a.json", "--explain",
                 "--force", *plain(*arguments))
    expect(result.returncode == 0, f"{' '.join(arguments)} left with {result.returncode}: {result.stderr[-1000:]}")
    return (folder / "a.exr").read_bytes(), result.stdout


def refusals(folder):
    for option, nearest in (("--embree-quality=hihg", "did you mean 'high'?"), ("--deterministic=yes", "choices: off, on"),
                            ("--depth-format=25", "choices: 32f, 24, 16"), ("--color-format=16", "choices: 32f, 16f, 8")):
        result = hpr(folder, "render", SCENE, "--explain", option)
        expect(result.returncode == 2 and nearest in result.stderr, f"{option}: {result.returncode} {result.stderr}")


def rays(folder):
    expected, plan = render(folder, "--primary", "rays")
    expect("embree" not in plan, f"the default is explained: {plan}")
    for quality in ("low", "high"):
        picture, plan = render(folder, "--primary", "rays", "--embree-quality", quality)
        expect(picture == expected, f"--embree-quality {quality} changes bits")
        expect(f"embree: {quality} build quality, AVX2 on every rank" in plan, f"{quality} is not explained: {plan}")
    free, plan = render(folder, "--deterministic", "off")
    expect("widest instructions" in plan, f"--deterministic off is not explained: {plan}")
    again, _ = render(folder, "--deterministic", "off", "--ranks", "2")
    expect(free == again, "ranks of one host differ with --deterministic off")


def depths(folder):
    """Each format has bits of its own, and every way to spread the work has those.

    Bytes are counted where no clock decides who lights what.
    """
    ways = (("--ranks", "4", "--distribute", "sort-last", "--strategy", "radix-k", "--balance", "static"),
            ("--ranks", "4", "--distribute", "sort-last", "--strategy", "shared-memory"),
            ("--ranks", "3", "--distribute", "hybrid", "--strategy", "tree"),
            ("--ranks", "2", "--distribute", "sort-last", "--strategy", "mpi-reduce"))
    seen, sent = set(), []
    for bits in ("32f", "24", "16"):
        expected, plan = render(folder, "--depth-format", bits, "--raw", "a.keys")
        keys = (folder / "a.keys").read_bytes()
        expect(("gains nothing" in plan) == (bits != "32f"), f"{bits} on one rank: {plan}")
        for way in ways:
            picture, plan = render(folder, "--depth-format", bits, "--raw", "a.keys", *way)
            expect((folder / "a.keys").read_bytes() == keys, f"--depth-format {bits} {' '.join(way)}: other keys")
            expect(picture == expected, f"--depth-format {bits} {' '.join(way)}: another picture")
            if "radix-k" in way:
                sent.append(json.loads((folder / "a.json").read_text())["bytes_sent"])
        seen.add(keys)
    expect(len(seen) == 3, "formats have the same keys")
    expect(sent[0] > sent[1] > sent[2], f"bytes sent do not shrink: {sent}")
    for how, said in ((("--depth-format", "24"), "raster (OpenGL alone rounds depths)"), (("--primary", "rays"), "rays (as asked)"),
                      (("--primary", "raster"), "raster (as asked)")):
        result = hpr(folder, "render", SCENE, "--explain", "--size", "32x32", *plain(*how))
        expect(f"primary: {said}\n" in result.stdout, f"{how}: {result.stdout} {result.stderr}")
        expect(("keys: read by " in result.stdout) == said.startswith("raster"), f"{how}: {result.stdout}")
    chosen = {hpr(folder, "render", SCENE, "--explain", "--size", "32x32", *plain(*how)).stdout.split("primary: ")[1].split("\n")[0]
              for how in ((), ("--ranks", "2", "--distribute", "sort-last"), ("--primary", "auto", "--threads", "1"))}
    expect(len(chosen) == 1 and "(" in chosen.copy().pop(), f"the same picture's keys are made by {chosen}")
    result = hpr(folder, "render", SCENE, "--explain", "--depth-format", "24", "--primary", "rays")
    expect(result.returncode == 2 and "--primary raster" in result.stderr, f"depths of rays: {result.stderr}")


def colors(folder):
    sent = []
    for name in ("32f", "16f", "8"):
        expected, plan = render(folder, "--color-format", name)
        expect((f"colors: {name}" in plan) == (name != "32f"), f"--color-format {name}: {plan}")
        picture, _ = render(folder, "--color-format", name, "--ranks", "3", "--balance", "static")
        expect(picture == expected, f"--color-format {name}: three ranks have other bits")
        sent.append(json.loads((folder / "a.json").read_text())["bytes_sent"])
        image = exr.read(folder / "a.exr")[2]
        if name == "32f":
            exact = image
            continue
        worst = 0.0
        for channel in "RGB":
            for value, true in zip(image[channel], exact[channel]):
                shown = min(max(true, 0.0), 1.0) if name == "8" else true
                worst = max(worst, abs(value - shown) / (max(abs(shown), 2 ** -14) if name == "16f" else 1.0))
        expect(0.0 < worst <= (2 ** -11 if name == "16f" else 0.005), f"--color-format {name}: off by {worst}")
    expect(sent[0] > sent[1] > sent[2], f"bytes of colours do not shrink: {sent}")


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-accuracy-") as scratch:
        folder = pathlib.Path(scratch)
        refusals(folder)
        rays(folder)
        depths(folder)
        colors(folder)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
