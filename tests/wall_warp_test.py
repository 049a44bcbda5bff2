#!/usr/bin/env python3
"""A half-cylinder lit by two projectors: position maps, blend and black pictures, the same for any number of ranks, by
OpenGL as by rays; meshes of flat pictures; and what is wrong with such files.

usage: wall_warp_test.py HPR

Prints what differs or is missing and leaves with 1.
"""

import json
import math
import pathlib
import struct
import sys
import tempfile

import png
from program import Failure, check, run_to

SCENE = "gen:gallery"
COLUMNS, ROWS, SHARED = 100, 60, 20  # a degree a column
RADIUS, HEIGHT = 2.0, 2.4
SPANS = {"left": (-90, 10), "right": (-10, 90)}


def on_cylinder(degrees, height):
    angle = math.radians(degrees)
    return RADIUS * math.sin(angle), height, -RADIUS * math.cos(angle)


def write_map(path, span, columns=COLUMNS, rows=ROWS, dark=()):
    """A PFM of what a projector lights; rows from the bottom up."""
    values = []
    for row in range(rows):
        for column in range(columns):
            lit = (column, rows - 1 - row) not in dark
            degrees = span[0] + (span[1] - span[0]) * (column + 0.5) / columns
            values += on_cylinder(degrees, HEIGHT * (row + 0.5) / rows) if lit else [math.nan] * 3
    path.write_bytes(b"PF\n%d %d\n-1.0\n" % (columns, rows) + struct.pack(f"<{len(values)}f", *values))


def write_ramp(path, name):
    """Fades over the shared columns, so that both projectors' factors sum to one."""
    rows = bytearray()
    for column in range(COLUMNS):
        inside = COLUMNS - 1 - column if name == "left" else column
        rows += bytes([round(255 * min(1.0, (inside + 0.5) / SHARED))] * 3)
    png.write(path, COLUMNS, 1, bytes(rows), 3)


def screen(name, warp):
    left, right = SPANS[name]
    corners = {"ll": on_cylinder(left, 0), "lr": on_cylinder(right, 0), "ul": on_cylinder(left, HEIGHT)}
    told = ", ".join(f"{key} = {list(corner)}" for key, corner in corners.items())
    return f'  {{ id = "{name}", pixels = [{COLUMNS}, {ROWS}], corners_m = {{ {told} }}, warp = {warp} }},\n'


def wall(warp):
    screens = "".join(screen(name, warp.format(name=name)) for name in SPANS)
    return f"hpr_wall = 1\n[[viewers]]\nposition_m = [0, 1.2, 0.2]\n[[surfaces]]\nscreens = [\n{screens}]\n"


def linear(level):
    value = level / 255
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def pixels(path):
    width, height, values = png.read(path)
    return [[tuple(values[4 * (y * width + x):][:3]) for x in range(width)] for y in range(height)]


def apart(a, b):
    """Levels by which two pictures differ, on average; noise of lights is less than one."""
    off = [abs(p - q) for r, s in zip(a, b, strict=True) for u, v in zip(r, s, strict=True) for p, q in zip(u, v, strict=True)]
    return sum(off) / len(off)


def draw(folder, name, *more):
    run_to(folder, ["wall", "run", f"{name}.toml", SCENE, "-o", f"{name}-out", "--force", *more])
    out = folder / f"{name}-out"
    hashes = [s["xxh64"] for s in json.loads((out / "manifest.json").read_text())["frames"][0]["screens"]]
    return hashes, {file.stem: pixels(file) for file in out.glob("*.png") if file.stem != "wall"}


def prepare(folder):
    (folder / "calib").mkdir()
    for name, span in SPANS.items():
        write_map(folder / "calib" / f"{name}.pfm", span, dark=[(COLUMNS // 2, 0), (COLUMNS // 2, 1)])
        write_ramp(folder / "calib" / f"{name}_alpha.png", name)
        png.write(folder / "calib" / f"{name}_beta.png", 1, 1, bytes([26, 26, 26]), 3)
    mesh = 'mesh = "calib/{name}.pfm"'
    (folder / "blended.toml").write_text(wall('{{ ' + mesh + ', blend = "calib/{name}_alpha.png" }}'))
    (folder / "black.toml").write_text(wall('{{ ' + mesh + ', black = "calib/{name}_beta.png" }}'))
    (folder / "plain.toml").write_text(wall("{{ " + mesh + " }}"))


def any_ranks_show_the_same(folder):
    for primary in ("raster", "rays"):
        first = draw(folder, "blended", "--primary", primary, "--ranks", "1")
        for distribute in ("sort-first", "sort-last"):
            other = draw(folder, "blended", "--primary", primary, "--distribute", distribute, "--ranks", "3")
            check(first == other, f"--primary {primary}, {distribute}: 3 ranks show something else than 1")
        check(len(set(first[0])) == 2, "both projectors show the same")
    check(run_to(folder, ["wall", "run", "plain.toml", SCENE, "--display", "none", "--primary", "auto", "--explain"])
          .stdout.count("primary: rays") == 1, "a choice of primary does not take rays for a position map")


def heads_walk_before_the_points(folder):
    """In stereo, for a recorded head: each frame and eye has its own picture, the same for any number of ranks."""
    (folder / "walk.csv").write_text("0,0,1.2,0.2\n1,0.6,1.4,-0.3\n")
    stereo = ["--set", "stereo.mode=top-bottom", "--set", "viewers.0.ipd_m=0.1", "--passes", "none",
              "--set", 'viewers.0.tracker={ type = "file", path = "walk.csv", rate_hz = 1 }']
    for primary in ("raster", "rays"):
        shown = []
        for ranks in ("1", "3"):
            run_to(folder, ["wall", "run", "plain.toml", SCENE, "-o", "walk", "--force", "--frames", "2", "--keep-frames", "--primary", primary,
                         "--ranks", ranks, *stereo])
            frames = json.loads((folder / "walk" / "manifest.json").read_text())["frames"]
            shown.append([[s["xxh64"] for s in frame["screens"]] for frame in frames])
        check(shown[0] == shown[1], f"--primary {primary}: 3 ranks show a walking head something else than 1")
        first, second = (pixels(folder / "walk" / f"frame-00000{i}" / "left.png") for i in (0, 1))
        check(apart(first, second) > 15, f"--primary {primary}: a head walks and sees much the same: {apart(first, second)}")
        eyes = apart(first[:ROWS // 2], first[ROWS // 2:])
        check(eyes > 5, f"--primary {primary}: both eyes see much the same: {eyes}")


def shared_columns_sum_to_one_picture(folder):
    """Where both projectors light the cylinder their light adds up to what each alone would show."""
    _, plain = draw(folder, "plain", "--primary", "rays", "--passes", "none")
    _, faded = draw(folder, "blended", "--primary", "rays", "--passes", "none")
    worst = lit = 0
    for y in range(ROWS):
        for x in range(SHARED):
            at = COLUMNS - SHARED + x
            alone = plain["left"][y][at]
            both = [linear(a) + linear(b) for a, b in zip(faded["left.panel"][y][at], faded["right.panel"][y][x], strict=True)]
            worst = max(worst, *(abs(linear(a) - b) for a, b in zip(alone, both, strict=True)))
            lit = max(lit, *both)
    off = apart([row[-SHARED:] for row in plain["left"]], [row[:SHARED] for row in plain["right"]])
    check(off < 1, f"the projectors show different places: {off} levels apart on average")
    check(worst < 0.05 and lit > 0.2, f"the sum of both is off by {worst} of {lit}")
    check(faded["left"] == plain["left"], "a blend changed the screen's own picture")
    check(faded["left.panel"] != plain["left"], "a blend changed nothing")


def opengl_comes_near_to_rays(folder):
    how = ("--passes", "none", "--spp", "8")
    _, rays = draw(folder, "plain", "--primary", "rays", *how)
    _, raster = draw(folder, "plain", "--primary", "raster", *how)
    for name in SPANS:
        off = apart(rays[name], raster[name])
        check(0 < off < 6, f"{name}: OpenGL is off by {off} levels on average")
        for shown in (rays, raster):
            check(shown[name][0][COLUMNS // 2] == (0, 0, 0), f"{name}: a pixel without a point is lit")
            check(shown[name][5][COLUMNS // 2] != (0, 0, 0), f"{name}: a pixel with a point is dark")


def black_lifts_what_is_dark(folder):
    _, shown = draw(folder, "black", "--passes", "none")
    least = min(level for row in shown["left.panel"] for x, p in enumerate(row) if x != COLUMNS // 2 for level in p)
    check(least >= 89, f"the darkest level is {least}: 0.1 of linear light is 89")
    check(shown["left.panel"][0][COLUMNS // 2] == (0, 0, 0), "a pixel without a point is lifted")


def meshes_are_of_the_flat_picture(folder):
    one = 'hpr_wall = 1\n[[surfaces]]\nscreens = [{{ id = "a", pixels = [64, 48], corners_m = {{ ll = [0, 0, 0], lr = [0.8, 0, 0], ul = [0, 0.6, 0] }}{} }}]\n'
    (folder / "flat.toml").write_text(one.format(""))
    (folder / "same.toml").write_text(one.format(', warp = { mesh = "same.csv" }'))
    (folder / "turned.toml").write_text(one.format(', warp = { mesh = "turned.obj" }'))
    (folder / "same.csv").write_text("x,y,u,v\n0,1,0,1\n1,1,1,1\n0,0,0,0\n1,0,1,0\n")
    (folder / "turned.obj").write_text("v 0 0\nv 1 0\nv 1 1\nv 0 1\nvt 1 1\nvt 0 1\nvt 0 0\nvt 1 0\nf 1/1 2/2 3/3 4/4\n")
    hashes, flat = draw(folder, "flat")
    same_hashes, same = draw(folder, "same")
    turned_hashes, turned = draw(folder, "turned", "--ranks", "3")
    check(hashes == same_hashes == turned_hashes, "a mesh changed the screen's own picture")
    check(same["a.panel"] == flat["a"], "a mesh that changes nothing changed the picture")
    check(turned["a.panel"] == [row[::-1] for row in flat["a"][::-1]], "a mesh that turns the picture does something else")


def what_is_wrong_is_told_at_once(folder):
    write_map(folder / "calib" / "behind.pfm", (150, 210))
    (folder / "calib" / "fold.csv").write_text("0,0,0,0\n1,0,1,0\n0,1,0,1\n1,1,1,1\n0,0.5,0,1\n1,0.5,1,1\n")
    (folder / "calib" / "nan.pfm").write_bytes(b"PF\n1 1\n-1.0\n" + struct.pack("<3f", *[math.nan] * 3))
    text = wall('{{ mesh = "calib/behind.pfm", blend = "calib/none.png", black = "calib/left.pfm" }}')
    text = text.replace("calib/behind.pfm", "calib/fold.csv", 1).replace('black = "calib/left.pfm"', "blakc = 1", 1)
    (folder / "wrong.toml").write_text(text)
    found = json.loads(run_to(folder, ["wall", "check", "wrong.toml", "--json"], 3).stdout)["findings"]
    told = [(f["line"], f["what"].split(": ", 1)[1]) for f in found if f["severity"] == "error"]
    expected = [
        (6, "'mesh' of warp cannot be used: calib/fold.csv:3: the mesh folds over at 0, 1 of the screen"),
        (6, "'blend' of warp cannot be used: cannot read 'calib/none.png': No such file or directory"),
        (6, "warp has no key 'blakc'"),
        (7, "all points of screen \"right\" lie behind the viewer's eye, or 85 degrees and more off its normal"),
        (7, "'blend' of warp cannot be used: cannot read 'calib/none.png': No such file or directory"),
    ]
    for line, what in expected:
        check(any(line == at and words.startswith(what) for at, words in told), f"not told: line {line}: {what}; but {told}")
    check(any(at == 7 and words.startswith("'black' of warp cannot be used") for at, words in told), f"not told of black: {told}")
    check(all(f["column"] > 1 for f in found), f"no columns: {found}")
    (folder / "nan.toml").write_text(wall('{{ mesh = "calib/nan.pfm" }}'))
    check("no texel is a point" in run_to(folder, ["wall", "run", "nan.toml", SCENE, "--display", "none"], 3).stderr, "nan.pfm is taken")


def checks_expand_and_hashes_know_of_it(folder):
    found = json.loads(run_to(folder, ["wall", "check", "blended.toml", "--json"]).stdout)
    check(not found["findings"], f"findings {found['findings']}")
    kinds = [(w["screen"], w["mesh"], w["lit_percent"]) for w in found["warps"]]
    check(kinds == [(name, "positions", 99.97) for name in SPANS], f"warps {found['warps']}")
    (folder / "again.toml").write_text(run_to(folder, ["wall", "expand", "blended.toml"]).stdout)
    again = json.loads(run_to(folder, ["wall", "check", "again.toml", "--json"]).stdout)
    check(again["wall_hash"] == found["wall_hash"], "the expanded wall is another one")
    write_ramp(folder / "calib" / "left_alpha.png", "right")
    other = json.loads(run_to(folder, ["wall", "check", "blended.toml", "--json"]).stdout)
    check(other["wall_hash"] != found["wall_hash"], "another blend is the same wall")


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-wall-warp-") as scratch:
        folder = pathlib.Path(scratch)
        prepare(folder)
        try:
            for test in (any_ranks_show_the_same, heads_walk_before_the_points, shared_columns_sum_to_one_picture, opengl_comes_near_to_rays, black_lifts_what_is_dark,
                         meshes_are_of_the_flat_picture, what_is_wrong_is_told_at_once, checks_expand_and_hashes_know_of_it):
                test(folder)
        except Failure as failure:
            print(failure)
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
