#!/usr/bin/env python3
"""What a wall file says of panels, viewers and stereo shows in the files of a run, the same for any number of ranks.

usage: wall_model_test.py HPR

Prints what differs or is missing and leaves with 1.
"""

import json
import pathlib
import sys
import tempfile

import png
from program import Failure, check, run_to

SCENE = "gen:gallery"

# An arc in stereo for a head that walks, with an operator's copy.
ARC = """
hpr_wall = 1
stereo = { mode = "side-by-side" }
monitors = [{ id = "operator", surface = "arc", pixels = [120, 60] }]
windows = [{ id = "w0", rank = 0 }, { id = "w1", rank = 1 }]
[[viewers]]
id = "head"
position_m = [0, 0, 0]
ipd_m = 0.2
tracker = { type = "file", path = "paths/walk.csv", rate_hz = 2 }
[[surfaces]]
id = "arc"
[surfaces.grid]
columns = 2
rows = 1
tile_pixels = [64, 48]
tile_size_m = [0.8, 0.6]
centre_m = [0, 0, -1]
gap_m = [0.02, 0]
windows = ["w0", "w1"]
curve = { radius_m = 1.0 }
"""

# One screen; {more} is about it.
ONE = """
hpr_wall = 1
[[viewers]]
position_m = [0, 0, 1]
ipd_m = 0.2
[[surfaces]]
screens = [{{ id = "a", pixels = [{width}, 48], corners_m = {{ ll = [-0.4, -0.3, 0], lr = [0.4, -0.3, 0], ul = [-0.4, 0.3, 0] }}{more} }}]
"""


def draw(folder, name, text, *more):
    """The manifest of a run of a wall file."""
    (folder / f"{name}.toml").write_text(text)
    run_to(folder, ["wall", "run", f"{name}.toml", SCENE, "-o", name, "--force", *more])
    return json.loads((folder / name / "manifest.json").read_text())


def pixels(path):
    """Rows of (r, g, b, a)."""
    width, height, values = png.read(path)
    return [[tuple(values[4 * (y * width + x):][:4]) for x in range(width)] for y in range(height)]


def heads_walk_the_same_for_any_number_of_ranks(folder):
    (folder / "paths").mkdir()
    (folder / "paths" / "walk.csv").write_text("time,x,y,z\n5,0,0,0\n6,0.2,0.1,0\n")
    first = draw(folder, "arc1", ARC, "--frames", "2", "--ranks", "1")
    for ranks in ("2", "3"):
        other = draw(folder, f"arc{ranks}", ARC, "--frames", "2", "--ranks", ranks)
        for a, b in zip(first["frames"], other["frames"], strict=True):
            for key in ("screens", "heads", "monitors"):
                check(a[key] == b[key], f"{ranks} ranks: other {key}: {a[key]} and {b[key]}")
        check((folder / f"arc{ranks}" / "operator.png").read_bytes() == (folder / "arc1" / "operator.png").read_bytes(),
              f"{ranks} ranks: another operator's copy")
    heads = [frame["heads"] for frame in first["frames"]]
    check([h[0]["viewer"] for h in heads] == ["head", "head"], f"heads {heads}")
    check([h[0]["position_m"] for h in heads] == [[0, 0, 0], [0.1, 0.05, 0]], f"heads {heads}")
    shown = [[s["xxh64"] for s in frame["screens"]] for frame in first["frames"]]
    check(all(a != b for a, b in zip(*shown, strict=True)), "a head moved and a screen did not change")
    operator = pixels(folder / "arc1" / "operator.png")
    check((len(operator[0]), len(operator)) == (120, 60), "the operator's copy has another size")
    check(len({p for row in operator for p in row}) > 100, "the operator's copy is empty")
    check(first["frames"][1]["monitors"][0]["id"] == "operator", "the manifest has no monitor")


def side_by_side_is_each_eyes_own_picture(folder):
    both = ONE.format(width=64, more="") + '[stereo]\nmode = "side-by-side"\n'
    passes = ("--passes", "shadow,reflection")  # photons are kept for all eyes of a wall
    draw(folder, "both", both, *passes)
    draw(folder, "left", ONE.format(width=32, more=', eye = "left"'), *passes)
    draw(folder, "middle", ONE.format(width=32, more=""), *passes)
    composed = pixels(folder / "both" / "a.png")
    left = pixels(folder / "left" / "a.png")
    check([row[:32] for row in composed] == left, "the left half is not what the left eye sees")
    check([row[32:] for row in composed] != left, "the right eye sees what the left one does")
    check(pixels(folder / "middle" / "a.png") != left, "the left eye sees what the middle sees")


def panels_are_sent_what_they_need_and_the_wall_stays(folder):
    plain = draw(folder, "plain", ONE.format(width=64, more=""))
    panel = draw(folder, "panel", ONE.format(width=64, more=', rotate = 90, mirror = "vertical", colour = { gain = [1, 0, 1] }'))
    upright = pixels(folder / "plain" / "a.png")
    sent = pixels(folder / "panel" / "a.panel.png")
    check(pixels(folder / "panel" / "a.png") == upright, "the screen's own picture is not upright")
    check((len(sent[0]), len(sent)) == (48, 64), "a turned panel is sent an upright picture")
    for y in range(48):
        for x in range(64):
            # Clockwise by 90 degrees, (x, y) comes to (47 - y, x); then top and bottom swap.
            r, _, b, a = upright[y][x]
            check(sent[63 - x][47 - y] == (r, 0, b, a), f"pixel {x}, {y} is not where or what it should be")
    check((folder / "plain" / "wall.png").read_bytes() == (folder / "panel" / "wall.png").read_bytes(), "another wall.png")
    check(plain["frames"][0]["screens"] == panel["frames"][0]["screens"], "panels changed the checksums")
    check(plain["wall_hash"] != panel["wall_hash"], "panels did not change the wall's hash")


def overrides_come_before_the_checks(folder):
    (folder / "one.toml").write_text(ONE.format(width=64, more=""))
    found = json.loads(run_to(folder, ["wall", "check", "one.toml", "--json", "--set", "stereo.mode=anaglyph",
                                    "--set", "surfaces.0.screens.0.pixels=[32, 24]"]).stdout)
    check(found["stereo"] == "anaglyph" and found["pictures"] == 2, f"wall check says {found}")
    check(found["memory"]["bytes"] == found["memory"]["bytes_per_pixel"] * 2 * 32 * 24, f"memory {found['memory']}")
    check(found["memory"]["ranks"][0]["screens"] == 1, f"memory {found['memory']}")
    text = run_to(folder, ["wall", "expand", "one.toml", "--set", "name=other"]).stdout
    check('name = "other"' in text, "expand does not show the override")
    wrong = run_to(folder, ["wall", "run", "one.toml", SCENE, "--display", "none", "--set", "stereo.mode=anaglif"], 3)
    check("hpr: error: --set stereo.mode=anaglif: 'mode' of stereo" in wrong.stderr, f"the error is {wrong.stderr}")
    check("did you mean 'anaglyph'?" in wrong.stderr, f"no hint in {wrong.stderr}")


def main():
    bad = 0
    for test in (heads_walk_the_same_for_any_number_of_ranks, side_by_side_is_each_eyes_own_picture,
                 panels_are_sent_what_they_need_and_the_wall_stays, overrides_come_before_the_checks):
        with tempfile.TemporaryDirectory(prefix="hpr-wall-model-") as scratch:
            try:
                test(pathlib.Path(scratch))
            except Failure as failure:
                print(f"{test.__name__}: {failure}")
                bad += 1
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
