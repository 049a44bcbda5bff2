#!/usr/bin/env python3
"""The options that trade bits for speed: what they may change, what they must not, and what they refuse.

usage: accuracy_test.py HPR

Prints what differs and leaves with 1.
"""

import os
import pathlib
import subprocess
import sys
import tempfile

HPR = os.path.abspath(sys.argv[1])
SCENE = "gen:gallery"
failures = []


def check(holds, message):
    if not holds:
        failures.append(message)
        print(message)


def hpr(folder, *arguments):
    return subprocess.run([HPR, *arguments], cwd=folder, capture_output=True, text=True, timeout=300, check=False)


def render(folder, *arguments, scene=SCENE):
    result = hpr(folder, "render", scene, "--size", "168x104", "-o", "a.exr", "--stats", "a.json", "--explain",
                 "--force", *arguments)
    check(result.returncode == 0, f"{' '.join(arguments)} left with {result.returncode}: {result.stderr[-1000:]}")
    return (folder / "a.exr").read_bytes(), result.stdout


def refusals(folder):
    for option, nearest in (("--embree-quality=hihg", "did you mean 'high'?"), ("--deterministic=yes", "choices: off, on")):
        result = hpr(folder, "render", SCENE, "--explain", option)
        check(result.returncode == 2 and nearest in result.stderr, f"{option}: {result.returncode} {result.stderr}")


def rays(folder):
    expected, plan = render(folder, "--primary", "rays")
    check("embree" not in plan, f"the default is explained: {plan}")
    for quality in ("low", "high"):
        picture, plan = render(folder, "--primary", "rays", "--embree-quality", quality)
        check(picture == expected, f"--embree-quality {quality} changes bits")
        check(f"embree: {quality} build quality, AVX2 on every rank" in plan, f"{quality} is not explained: {plan}")
    free, plan = render(folder, "--deterministic", "off")
    check("widest instructions" in plan, f"--deterministic off is not explained: {plan}")
    again, _ = render(folder, "--deterministic", "off", "--ranks", "2")
    check(free == again, "ranks of one host differ with --deterministic off")


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-accuracy-") as scratch:
        folder = pathlib.Path(scratch)
        refusals(folder)
        rays(folder)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
