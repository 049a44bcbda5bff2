#!/usr/bin/env python3
"""Only what a scene requires: what its plan leaves out, that this shows nothing, and what it saves.

usage: required.py HPR [--size WxH] [--ranks N] [--runs N] [--scenes NAME,...] [--json FILE]
       required.py HPR --check [--runs N]

Draws every scene with everything on (all passes but ambient-occlusion, which adds light of its own, and layers composited by
messages: FULL) and as planned, in turn, and takes the least times. The pictures must be the same bytes; leaves with 1 where they
are not. Scenes are generated, and those of the folder $HPR_SCENES as far as they are there.

--check measures what features cost a scene that does not use them (tests/unused_features.py): the user time of whole processes,
the least of --runs runs with and without, in turn. Leaves with 1 where that is more than 2 %.
"""
import argparse
import json
import os
import pathlib
import resource
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "tests"))
import unused_features  # noqa: E402

FULL = ["--passes", "all", "--distribute", "sort-last", "--strategy", "radix-k"]
GENERATED = ["gen:gallery", "gen:cornell", "gen:asteroids", "gen:tetra", "gen:sphereflake?s=2"]
FILES = ["two-monkeys", "pbr-spheres", "glass-table", "lights"]
KINDS = ("shadow", "reflection", "refraction", "photon")
MOST = 0.02


def render(hpr, scene, options, folder):
    """The picture's bytes, its statistics, and the user seconds of the processes."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    subprocess.run([hpr, "render", scene, "-o", folder / "a.exr", "--stats", folder / "a.json", "--force", "-q", *options],
                   check=True, stdout=subprocess.DEVNULL)
    seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    return (folder / "a.exr").read_bytes(), json.loads((folder / "a.json").read_text()), seconds


def scenes_of(names):
    found = [name for name in GENERATED if not names or name in names]
    folder = pathlib.Path(os.environ.get("HPR_SCENES", "/nonexistent"))
    for name in FILES:
        files = sorted(path for end in ("glb", "gltf") for path in (folder / name).rglob("*." + end))
        if files and (not names or name in names):
            found.append(str(files[0]))
    return found


def compare(hpr, scene, arguments, folder):
    common = ["--size", arguments.size, "--ranks", arguments.ranks, "--balance", "static"]
    full, planned, picture = [], [], None
    same = True
    for _ in range(arguments.runs):
        for options, runs in ((FULL, full), ([], planned)):
            drawn, stats, _ = render(hpr, scene, [*common, *options], folder)
            runs.append(stats)
            same = same and picture in (None, drawn)
            picture = drawn
    first, last = full[0], planned[0]
    return {"scene": scene if scene.startswith("gen:") else pathlib.Path(scene).parent.name, "same": same,
            "full_ms": min(run["ms"] for run in full), "planned_ms": min(run["ms"] for run in planned),
            "rays_not_traced": {kind: first["rays"][kind] - last["rays"][kind] for kind in KINDS},
            "bytes_not_sent": first["bytes_sent"] - last["bytes_sent"],
            "not_run": [line[5:] for line in last["plan"] if line.startswith("pass ") and ": off" in line
                        and "ambient-occlusion" not in line]}


def report(row):
    rays = ", ".join(f"{count} {kind}" for kind, count in row["rays_not_traced"].items() if count) or "none"
    print(f"{row['scene']:<22} full {row['full_ms']:8.1f} ms  planned {row['planned_ms']:8.1f} ms  "
          f"ratio {row['full_ms'] / row['planned_ms']:5.2f}  {'same bits' if row['same'] else 'OTHER BITS'}")
    print(f"{'':<22} rays not traced: {rays}; bytes not sent: {row['bytes_not_sent']}")
    for line in row["not_run"]:
        print(f"{'':<22} {line}")
    sys.stdout.flush()


def check_costs(hpr, arguments, folder):
    """How many features cost a scene without them more than they may."""
    subprocess.run([hpr, "scene", "make", "tetra", "-o", folder / "scene.glb", "--force"], check=True)
    scene, plain = folder / "scene.glb", (folder / "scene.glb").read_bytes()
    common = ["--size", arguments.size, "--ranks", "1", "--threads", "1"]
    cases = [(name, unused_features.added_to(plain, name), ()) for name in unused_features.FEATURES]
    cases += [(name, plain, options) for name, options in unused_features.OPTIONS.items()]
    beyond = 0
    for name, content, options in cases:
        times = {False: [], True: []}
        for _ in range(arguments.runs):
            for added in (False, True):
                scene.write_bytes(content if added else plain)
                times[added].append(render(hpr, scene, [*common, *(options if added else ())], folder)[2])
        cost = min(times[True]) / min(times[False]) - 1
        beyond += cost > MOST
        print(f"{name:<40} {min(times[False]):7.3f} s  {min(times[True]):7.3f} s  {100 * cost:+6.2f} %"
              f"{'  MORE THAN 2 %' if cost > MOST else ''}")
        sys.stdout.flush()
    return beyond


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("hpr")
    parser.add_argument("--size", default="640x360")
    parser.add_argument("--ranks", default="2")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--scenes", default="")
    parser.add_argument("--json")
    parser.add_argument("--check", action="store_true")
    arguments = parser.parse_args()
    hpr = os.path.abspath(arguments.hpr)
    with tempfile.TemporaryDirectory(prefix="hpr-required-") as scratch:
        folder = pathlib.Path(scratch)
        if arguments.check:
            return 1 if check_costs(hpr, arguments, folder) else 0
        rows = []
        for scene in scenes_of([name for name in arguments.scenes.split(",") if name]):
            rows.append(compare(hpr, scene, arguments, folder))
            report(rows[-1])
    if arguments.json:
        pathlib.Path(arguments.json).write_text(json.dumps({"schema": "hpr.required/1", "scenes": rows}, indent=2) + "\n")
    return 0 if all(row["same"] for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
