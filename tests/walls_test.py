#!/usr/bin/env python3
"""The example walls at a sixteenth of their size (an eighth with --full): whatever strategy and ranks, each screen shows what one rank draws of it.

usage: walls_test.py HPR SOURCE [--full]

Prints what differs or is missing and leaves with 1. With --full every strategy drives every wall on 4 and 7 ranks.
"""

import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile

HPR = os.path.abspath(sys.argv[1])
EXAMPLES = sorted((pathlib.Path(sys.argv[2]) / "walls" / "examples").glob("*.toml"))
FULL = "--full" in sys.argv[3:]
SCENE = "gen:gallery"


def screens_of(wall, folder, *options):
    command = [HPR, "-q", "wall", "run", str(wall), SCENE, "--scale", "0.125" if FULL else "0.0625", "--quality", "draft", "-o", str(folder), *options]
    result = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    if result.returncode != 0:
        print(f"{' '.join(command)} left with {result.returncode}:\n{result.stderr[-1500:]}")
        return {}
    manifest = json.loads((folder / "manifest.json").read_text())
    return {screen["id"]: (screen["width"], screen["height"], screen["xxh64"]) for screen in manifest["frames"][0]["screens"]}


def strategies():
    """Every strategy the program has, as its error lists them, but for the one that chooses among the others."""
    result = subprocess.run([HPR, "compare", "--synthetic", "dense", "--strategies", "?"], capture_output=True, text=True,
                            timeout=60, check=False)
    return [name for name in re.search("choices: (.*)", result.stderr)[1].split(", ") if name not in ("auto", "all")]


def ways():
    """Options of the runs that must all show the same."""
    every = [["--distribute", "sort-last", "--strategy", name] for name in strategies()]
    every += [["--distribute", "sort-first"], ["--distribute", "sort-middle"], ["--distribute", "hybrid", "--groups", "2"], ["--distribute", "auto"]]
    return every


def main():
    bad = 0
    if len(EXAMPLES) < 3:
        print(f"only {len(EXAMPLES)} example walls in {sys.argv[2]}")
        return 1
    with tempfile.TemporaryDirectory(prefix="hpr-walls-") as scratch:
        for number, wall in enumerate(EXAMPLES):
            folder = pathlib.Path(scratch) / wall.stem
            expected = screens_of(wall, folder / "one")
            if len({screen[2] for screen in expected.values()}) < 2:
                print(f"{wall.name}: its screens show the same, or nothing: {expected}")
                bad += 1
            for i, way in enumerate(ways()):
                if not FULL and (i + number) % len(EXAMPLES) != 0:
                    continue  # every way drives one of the walls
                for ranks in ("4", "7") if FULL else ("4",):
                    shown = screens_of(wall, folder / f"{i}-{ranks}", *way, "--ranks", ranks)
                    differ = sorted(name for name in expected if shown.get(name) != expected[name])
                    if differ or len(shown) != len(expected):
                        print(f"{wall.name}: {' '.join(way)} on {ranks} ranks: {differ} differ from one rank's")
                        bad += 1
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
