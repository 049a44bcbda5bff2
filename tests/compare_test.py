#!/usr/bin/env python3
"""What `hpr compare` refuses and how it says so, and that the command in its result makes the same comparison again.

usage: compare_test.py HPR

Prints what was wrong and leaves with 1.
"""

import csv
import json
import pathlib
import shlex
import sys
import tempfile

from program import expect, failures, plain, run

SYNTHETIC = ["compare", "--synthetic", "dense", "--frames", "1", "--warmup", "0", "--transport", "threads"]
SCENE = ["compare", "gen:cornell", "--frames", "1", "--warmup", "0"]
SMALL = ["--size", "64x48"]


def expect_error(folder, arguments, code, *mentions):
    """An error of that code with a hint, that says all of `mentions`, and no file."""
    result = run(folder, *arguments)
    case = " ".join(arguments)
    expect(result.returncode == code, f"{case}: left with {result.returncode} instead of {code}: {result.stderr}")
    expect("hint:" in result.stderr, f"{case}: no hint: {result.stderr}")
    for words in mentions:
        expect(words in result.stderr, f"{case}: does not say {words!r}: {result.stderr}")
    expect(not list(folder.iterdir()), f"{case}: left a file")


def refused(folder):
    for what in (SYNTHETIC, SCENE):
        expect_error(folder, [*what, "--size", "200x100", "--limit-image", "100x100"], 6, "200x100", "--limit-image")
        expect_error(folder, [*what, *SMALL, "--tiles", "2x3", "--limit-image", "100x100"], 6, "128x144")
        expect_error(folder, [*what, *SMALL, "--backend", "osmessa"], 2, "did you mean 'osmesa'", "egl")
        expect_error(folder, [*what, "--size", "20000x1"], 6, "16384")
        expect_error(folder, [*what, "--tiles", "300x1"], 6, "256")
        expect_error(folder, [*what, *SMALL, "-o", "x.jpg"], 2, ".png")
        expect_error(folder, [*what, *SMALL, "--strategies", "all,tree"], 2, "alone")
        expect_error(folder, [*what, *SMALL, "--operator", "over8", "--strategies", "sort-first"], 2,
                     "--operator over8", "--operator nearest")
    expect_error(folder, [*SYNTHETIC, *SMALL, "--seed", "4294967296"], 2, "4294967295")
    expect_error(folder, [*SYNTHETIC, *SMALL, "--limit-mem", "1K"], 6, "288 KiB", "1 KiB")
    expect_error(folder, [*SYNTHETIC, *SMALL, "--strategies", "tre"], 2, "did you mean 'tree'", "all")
    expect_error(folder, [*SCENE, *SMALL, "--strategies", "sort-frist"], 2, "did you mean 'sort-first'", ", all")
    expect_error(folder, [*SCENE, *SMALL, "--operator", "over8", "--strategies", "tre"], 2, "did you mean 'tree'")
    expect_error(folder, [*SCENE, *SMALL, "--shading", "locl"], 2, "did you mean 'local'")
    expect_error(folder, [*SYNTHETIC, *SMALL, "--shading", "local"], 2, "leave it out")
    expect_error(folder, [*SYNTHETIC, *SMALL, "--plugin", __file__], 3, "cannot open", "this installation")
    expect_error(folder, ["doctor", "--backend", "foo"], 2, "'foo'")
    expect_error(folder, ["render", "gen:cornell", *SMALL, "-o", "a.png", "--device", "99"], 5, "no EGL device 99",
                 "EGL lists", "devices")


def frames_of(result):
    return [(row["strategy"], row["ranks"], row["frame_xxh64"]) for row in json.loads(result.stdout)["runs"]]


def commands(folder):
    """The command of a result, pasted into a shell."""
    scene = folder / "my scene.glb"
    expect(run(folder, "scene", "make", "cornell", "-o", scene.name).returncode == 0, "no scene")
    given = ["compare", scene.name, *SMALL, "--ranks", "1,2", "--frames", "1", "--warmup", "0", "--strategies",
             "tree,sort-first", "--backend", "osmesa", "--threads", "1"]
    first = run(folder, *given, "--json")
    expect(first.returncode == 0, f"left with {first.returncode}: {first.stderr}")
    command = json.loads(first.stdout)["command"]
    words = shlex.split(command)
    for words_given in (["--backend", "osmesa"], ["--threads", "1"], ["--ranks", "1,2"], ["compare", scene.name]):
        expect(" ".join(words_given) in " ".join(words), f"{words_given} are not in {command}")
    again = run(folder, *words[1:], "--json")
    expect(again.returncode == 0, f"{command} left with {again.returncode}: {again.stderr}")
    if again.returncode == 0:
        expect(frames_of(first) == frames_of(again), f"{command} makes another frame")
        expect(json.loads(again.stdout)["command"] == command, "the command changes when it is run")

    expect("--backend" not in json.loads(run(folder, *SYNTHETIC, *SMALL, "--json").stdout)["command"],
           "options nobody gave are told")


def table(folder):
    result = run(folder, *SYNTHETIC, *SMALL, "--ranks", "4", "--strategies", "radix-k:2,2,auto,tree", "--csv", "r.csv")
    expect(result.returncode == 0, f"left with {result.returncode}: {result.stderr}")
    with (folder / "r.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    expect([row["strategy"] for row in rows] == ["radix-k:2,2", "auto", "tree"], f"strategies: {rows}")
    expect(all(row["ranks"] == "4" and None not in row for row in rows), f"columns have shifted: {rows}")
    expect([bool(row["chosen"]) for row in rows] == [False, True, False], f"only auto chooses: {rows}")


def local_shading(folder):
    """Colours that ranks have lit themselves: the picture that render makes of them, whoever merges it."""
    picture, given = folder / "compared.png", ["--size", "160x120", "--shading", "local"]
    result = run(folder, "compare", "gen:cornell", *given, "--ranks", "3", "--frames", "1", "--warmup", "0", "--json",
                 "-o", picture.name)
    expect(result.returncode == 0, f"left with {result.returncode}: {result.stderr}")
    made = json.loads(result.stdout)
    expect({row["frame_xxh64"] for row in made["runs"]} == {made["runs"][0]["frame_xxh64"]}, "frames differ")
    expect("sort-first" in [row["strategy"] for row in made["runs"]], "sort-first is missing")
    expect("--shading local" in made["command"], made["command"])
    drawn = run(folder, "render", "gen:cornell", *plain(*given), "-o", "rendered.png")
    expect(drawn.returncode == 0, f"left with {drawn.returncode}: {drawn.stderr}")
    diff = run(folder, "diff", "rendered.png", picture.name, "--json")
    expect(json.loads(diff.stdout)["rmse"] == 0, f"render makes other colours: {diff.stdout}")
    sky = ["gen:tetra", *given[:2], "--environment", "0.2,0.5,0.8", "--spp", "1"]
    for name, *options in (("local.png", *given[2:], "--ranks", "3", "--distribute", "sort-last"), ("deferred.png",)):
        drawn = run(folder, "render", *sky, *options, "-o", name)
        expect(drawn.returncode == 0, f"left with {drawn.returncode}: {drawn.stderr}")
    diff = json.loads(run(folder, "diff", "local.png", "deferred.png", "--json").stdout)
    expect(diff["rmse"] < 0.5 / 255, f"local light under a sky is another: {diff}")
    hashes = set()
    for ranks, threads in (("1", "1"), ("2", "2")):
        again = run(folder, "compare", "gen:cornell", *given, "--ranks", ranks, "--threads", threads, "--transport",
                    "threads", "--strategies", "tree", "--frames", "1", "--warmup", "0", "--json")
        hashes |= {row["frame_xxh64"] for row in json.loads(again.stdout)["runs"]}
    expect(hashes == {made["runs"][0]["frame_xxh64"]}, "other ranks, other colours")


def main():
    for case in (refused, commands, table, local_shading):
        with tempfile.TemporaryDirectory(prefix="hpr-compare-") as scratch:
            case(pathlib.Path(scratch))
    print(f"{len(failures)} failed" if failures else "compare refuses and reports as it should")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
