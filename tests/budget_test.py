#!/usr/bin/env python3
"""What is given up for speed: the same bits however the work is spread, and clear words where it makes no sense.

usage: budget_test.py HPR

Prints what differs and leaves with 1.
"""

import json
import pathlib
import struct
import subprocess
import sys
import tempfile

import exr
from program import HPR, expect, failures, plain


def hpr(folder, *arguments, code=0):
    result = subprocess.run([HPR, *arguments], cwd=folder, capture_output=True, text=True, timeout=300, check=False)
    expect(result.returncode == code,
          f"hpr {' '.join(arguments)} left with {result.returncode} instead of {code}: {result.stderr[-1000:]}")
    return result


def render(folder, *arguments, scene="gen:gallery", picture="a.png"):
    hpr(folder, "render", scene, "--size", "171x105", "-o", picture, "--stats", "a.json", "--force", *plain(*arguments))
    return (folder / picture).read_bytes()


def rmse(folder, a, b):
    return json.loads(hpr(folder, "diff", a, b, "--metric", "rmse", "--json", code=1).stdout)["rmse"]


SPREADS = [("--ranks", "2"), ("--ranks", "3"), ("--threads", "2"), ("--ranks", "3", "--distribute", "hybrid"),
           ("--ranks", "2", "--distribute", "sort-last", "--strategy", "direct-send"),
           ("--ranks", "3", "--distribute", "sort-last", "--strategy", "shared-memory")]


def same_bits(folder, name, *arguments, picture="a.png"):
    expected = render(folder, *arguments, picture=picture)
    for spread in SPREADS:
        expect(render(folder, *arguments, *spread, picture=picture) == expected, f"{name}: other bits with {' '.join(spread)}")
    return expected


def usage(folder, name, *arguments, says):
    result = hpr(folder, *arguments, code=2)
    expect(says in result.stderr, f"{name}: does not say {says!r}: {result.stderr[-400:]}")
    expect(not list(folder.glob("refused*")), f"{name}: left a file")


def resolution(folder):
    whole = render(folder, "--spp", "2", picture="a.exr")
    render(folder, "--spp", "32", scene="gen:cornell", picture="whole.png")
    expect(render(folder, "--resolution-scale", "1") == render(folder), "a scale of 1 changes the picture")
    errors = []
    for scale in ("0.75", "0.5", "0.25"):
        made = same_bits(folder, f"scale {scale}", "--resolution-scale", scale, "--spp", "2", picture="a.exr")
        expect(made != whole, f"scale {scale} changes nothing")
        size = exr.read(folder / "a.exr")[:2]
        expect(size == (171, 105), f"scale {scale}: the picture has {size} pixels")
        render(folder, "--spp", "32", "--resolution-scale", scale, scene="gen:cornell")
        errors.append(rmse(folder, "a.png", "whole.png"))
    expect(errors == sorted(errors), f"errors do not grow as the resolution falls: {errors}")
    same_bits(folder, "scale 0.5, as .png", "--resolution-scale", "0.5")
    same_bits(folder, "scale 0.3, local", "--resolution-scale", "0.3", "--shading", "local")
    hpr(folder, "render", "gen:cornell", "-o", "dot.png", "--size", "4x1", "--resolution-scale", "0.1")
    expect(struct.unpack(">II", (folder / "dot.png").read_bytes()[16:24]) == (4, 1), "one pixel does not show as 4x1")
    render(folder, "--resolution-scale", "0.5")
    few = json.loads((folder / "a.json").read_text())["rays"]["shadow"]
    render(folder)
    many = json.loads((folder / "a.json").read_text())["rays"]["shadow"]
    expect(0.2 < few / many < 0.3, f"half the pixels a side take {few} of {many} shadow rays")
    for scale in ("0", "0.05", "1.5", "-1", "nan", "inf", "much"):
        usage(folder, f"scale {scale}", "render", "gen:cornell", "-o", "refused.png", f"--resolution-scale={scale}",
              says="--resolution-scale")
    usage(folder, "cutoff", "render", "gen:cornell", "-o", "refused.png", "--glossy-cutoff=nan", says="--glossy-cutoff")
    usage(folder, "raw", "render", "gen:cornell", "--raw", "refused.raw", "--resolution-scale", "0.5", says="--raw")
    usage(folder, "aov", "render", "gen:cornell", "-o", "refused.exr", "--aov", "depth", "--resolution-scale", "0.5",
          says="--aov")


def half_resolution(folder):
    passes = ("--passes", "shadow,reflection,refraction,ambient-occlusion,photon", "--photons", "5000")
    whole = render(folder, *passes)
    half = same_bits(folder, "half resolution", *passes, "--half-resolution",
                     "shadow,reflection,refraction,ambient-occlusion,photon")
    expect(half != whole, "half resolution changes nothing")
    usage(folder, "no pass", "render", "gen:cornell", "-o", "refused.png", "--half-resolution", "photons", says="photon")
    for other in (("--reference",), ("--shading", "local")):
        usage(folder, other[0], "render", "gen:cornell", "-o", "refused.png", "--half-resolution", "photon", *other,
              says="--half-resolution")


def wall(folder, name, *arguments):
    expected = None
    for ranks in ("1", "2", "3"):
        hpr(folder, "wall", "run", "3x2@61x47", "gen:gallery", "-o", "wall", "--force", "--ranks", ranks, *arguments)
        frames = json.loads((folder / "wall" / "manifest.json").read_text())["frames"]
        screens = [(s["id"], s["width"], s["height"], s["xxh64"]) for f in frames for s in f["screens"]]
        png = (folder / "wall" / f"{screens[0][0]}.png").read_bytes()
        expect(struct.unpack(">II", png[16:24]) == (61, 47), f"{name}: a screen of another size")
        expected = expected or screens
        expect(screens == expected, f"{name}: another wall with {ranks} ranks")
    return expected


def photon_radius(folder):
    caustic = ("--passes", "photon", "--photons", "20000")
    chosen = same_bits(folder, "photons", *caustic)
    expect(render(folder, *caustic, "--photon-radius", "0") == chosen, "a radius of 0 is not the one chosen")
    wide = same_bits(folder, "radius 0.3", *caustic, "--photon-radius", "0.3")
    narrow = render(folder, *caustic, "--photon-radius", "0.03")
    expect(len({chosen, wide, narrow}) == 3, "the radius changes nothing")
    for radius in ("-1", "nan", "inf", "wide"):
        usage(folder, f"radius {radius}", "render", "gen:cornell", "-o", "refused.png", f"--photon-radius={radius}",
              says="--photon-radius")


def frames_of(folder, *arguments):
    hpr(folder, "wall", "run", "2x1@61x47", "gen:gallery", "-o", "walk", "--force", *arguments)
    return json.loads((folder / "walk" / "manifest.json").read_text())["frames"]


def hashes(frame):
    return [screen["xxh64"] for screen in frame["screens"]]


def path(folder):
    (folder / "walk.txt").write_text("# two keys\neye -4,1.7,4 at 0,1.6,-2\n\neye 4,1.7,3 at 2,1.5,-2 fov 60\n")
    walk = ("--path", "walk.txt", "--frames", "3")
    expected = [hashes(frame) for frame in frames_of(folder, *walk)]
    expect(len({tuple(each) for each in expected}) == 3, "the path does not move the camera")
    for ranks in ("2", "3"):
        expect([hashes(frame) for frame in frames_of(folder, *walk, "--ranks", ranks)] == expected,
              f"another walk with {ranks} ranks")
    first = frames_of(folder, "--eye", "-4,1.7,4", "--at", "0,1.6,-2")[0]
    expect(hashes(first) == expected[0], "the path does not begin at its first key")
    refused = ("wall", "run", "1x1@16x16", "gen:cornell", "-o", "refused", "--path")
    usage(folder, "path and camera", *refused, "walk.txt", "--camera", "0", says="--path")
    (folder / "bad.txt").write_text("eye 0,0,1 at 0,0,0\neye 0,0 at 0,0,0\n")
    result = hpr(folder, *refused, "bad.txt", code=3)
    expect("bad.txt:2" in result.stderr, f"the wrong key is not named: {result.stderr}")
    hpr(folder, *refused, "missing.txt", code=4)


def target(folder):
    walk = ("--path", "walk.txt", "--frames", "12")
    for ranks in ("1", "3"):
        frames = frames_of(folder, *walk, "--ranks", ranks, "--target-ms", "0.5", "--stats", "b.json")
        last = frames[-1]["budget"]
        expect(all(set(f["budget"]) == {"target_ms", "resolution_scale", "samples", "given_up", "resting"} for f in frames),
              f"a frame's budget has other keys: {last}")
        expect(last["given_up"][:1] == ["half-resolution"] and last["given_up"][-1] == "resolution"
              and last["resolution_scale"] < 1 and last["target_ms"] == 0.5, f"0.5 ms give up no more than {last}")
        expect(json.loads((folder / "b.json").read_text())["budget"] == last, "--stats tell another budget")
    said = hpr(folder, "wall", "run", "1x1@64x48", "gen:cornell", "-o", "told", *walk, "--target-ms", "0.5").stderr
    took = sorted(f["ms"] for f in json.loads((folder / "told" / "manifest.json").read_text())["frames"])
    expect(f"95 % up to {took[-1]:.1f} ms" in said, f"the slowest of 12 is {took[-1]:.1f} ms, and it says {said}")
    frames = frames_of(folder, *walk, "--target-ms", "1000s")
    expect(frames[-1]["budget"]["target_ms"] == 1e6, f"1000 s are {frames[-1]['budget']['target_ms']} ms")
    expect(frames[-1]["budget"]["given_up"] == [], f"with all the time: {frames[-1]['budget']}")
    expect("budget" not in frames_of(folder, *walk)[0], "a budget nobody asked for")

    still = frames_of(folder, "--frames", "6", "--target-ms", "0.5", "--spp", "4")
    expect([f["budget"]["samples"] for f in still[1:]] == [1, 2, 3, 4, 4], f"at rest: {[f['budget'] for f in still]}")
    expect([f["budget"]["resting"] for f in still] == [False] + 5 * [True], f"rest: {[f['budget'] for f in still]}")
    expect(all(f["budget"]["given_up"] == [] and f["budget"]["resolution_scale"] == 1 for f in still[1:]),
          "something is given up at rest")
    expect(hashes(still[4]) == hashes(still[5]) == hashes(frames_of(folder, "--frames", "2", "--spp", "4")[1]),
          "a refined picture is another one than without a target")
    exact = frames_of(folder, "--target-error", "0.5", "--stats", "e.json")
    expect(len(exact) == 1 and json.loads((folder / "e.json").read_text())["samples"] >= 16, "no samples for the error")
    for option in ("--target-ms", "--target-error"):
        for value in ("0", "-3", "nan", "inf", "soon"):
            usage(folder, f"{option} {value}", "wall", "run", "1x1@16x16", "gen:cornell", "-o", "refused", f"{option}={value}",
                  says=option)


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-budget-") as scratch:
        folder = pathlib.Path(scratch)
        resolution(folder)
        photon_radius(folder)
        half_resolution(folder)
        path(folder)
        target(folder)
        plain = wall(folder, "wall")
        expect(wall(folder, "wall at half", "--resolution-scale", "0.5") != plain, "a wall's scale changes nothing")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
