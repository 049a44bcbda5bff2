#!/usr/bin/env python3
"""No feature costs a scene that does not use it: counters of rays, bytes and passes stay, and so does every bit.

usage: required_test.py HPR

Times are no test: bench/required.py --check looks at them. Prints what differs and leaves with 1.
"""

import json
import pathlib
import subprocess
import sys
import tempfile

import unused_features
from program import HPR, expect, failures, plain


def render(folder, scene, *arguments, ranks="2"):
    """The picture, and what it took: rays by kind, bytes sent, the plan and the steps that ran."""
    result = subprocess.run([HPR, "render", scene, "-o", "a.exr", "--stats", "a.json", "--size", "200x120", "--force",
                             "--ranks", ranks, "--balance", "static", *plain(*arguments)], cwd=folder, capture_output=True, text=True, timeout=300,
                            check=False)
    expect(result.returncode == 0, f"{scene} {' '.join(arguments)} left with {result.returncode}: {result.stderr[-1000:]}")
    stats = json.loads((folder / "a.json").read_text())
    counters = {**stats["rays"], "bytes": stats["bytes_sent"], "plan": stats["plan"],
                "steps": [step["name"] for step in stats["passes"]]}
    return (folder / "a.exr").read_bytes(), counters


def differences(before, after):
    return "; ".join(f"{key}: {before[key]} became {after[key]}" for key in before if before[key] != after[key])


def unused(folder, generated, layouts):
    """The scene with each feature, under one name, as that stands in the picture's head."""
    made = subprocess.run([HPR, "scene", "make", generated, "-o", "scene.glb", "--force"], cwd=folder, check=False,
                          capture_output=True, text=True)
    expect(made.returncode == 0, f"scene make {generated}: {made.stderr}")
    plain = (folder / "scene.glb").read_bytes()
    for layout in layouts:
        picture, counters = render(folder, "scene.glb", *layout)
        for feature in unused_features.FEATURES:
            (folder / "scene.glb").write_bytes(unused_features.added_to(plain, feature))
            other, took = render(folder, "scene.glb", *layout)
            expect(took == counters, f"{generated}: {feature} costs {differences(counters, took)}")
            expect(other == picture, f"{generated}: {feature} changes the picture")
        (folder / "scene.glb").write_bytes(plain)


def options(folder, scene):
    picture, counters = render(folder, scene)
    for name, arguments in unused_features.OPTIONS.items():
        other, took = render(folder, scene, *arguments)
        expect(took == counters, f"{scene}: {name} costs {differences(counters, took)}")
        expect(other == picture, f"{scene}: {name} changes the picture")


def all_passes(folder, scene):
    """What a plan leaves out would have shown nothing, and would have cost something."""
    picture, counters = render(folder, scene, "--distribute", "sort-last")
    other, took = render(folder, scene, "--distribute", "sort-last", "--passes", "all")
    expect(other == picture, f"{scene}: --passes all shows more than auto")
    expect(len(took["steps"]) > len(counters["steps"]), f"{scene}: nothing was left out")
    for kind in ("shadow", "reflection", "refraction"):
        expect(took[kind] == counters[kind], f"{scene}: auto does not trace {took[kind]} {kind} rays but {counters[kind]}")


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-required-") as scratch:
        folder = pathlib.Path(scratch)
        unused(folder, "tetra", [(), ("--distribute", "sort-last", "--strategy", "binary-swap")])
        unused(folder, "cornell", [()])
        options(folder, "gen:tetra")
        for scene in ("gen:cornell", "gen:tetra"):
            all_passes(folder, scene)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
