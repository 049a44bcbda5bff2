#!/usr/bin/env python3
"""The schema of wall files and their reader agree: on the examples, and on files that are wrong in one place each.

usage: wall_schema_test.py HPR ROOT

Prints what one of them takes and the other refuses, and leaves with 1; with 77 where Python has no jsonschema.
"""

import json
import os
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile

try:
    import tomllib

    import jsonschema
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)

HPR = os.path.abspath(sys.argv[1])
EXAMPLES = pathlib.Path(sys.argv[2]).resolve() / "walls" / "examples"

GRID = "columns = 2\nrows = 1\ntile_pixels = [64, 36]\ntile_size_m = [1.6, 0.9]\n"
BASE = """hpr_wall = 1
{top}
[[nodes]]
id = "n0"
{node}
[[windows]]
id = "w0"
{window}
[[viewers]]
id = "v"
position_m = [0, 0, 2]
{viewer}
[[surfaces]]
id = "s"
{surface}
screens = [{{ id = "a", window = "w0", pixels = [64, 36], corners_m = {{ ll = [9, 0, 0], lr = [10.6, 0, 0], ul = [9, 0.9, 0] }}{screen} }}]
[[surfaces]]
id = "g"
[surfaces.grid]
{grid}
"""
PLACES = ("top", "node", "window", "viewer", "surface", "screen", "grid")

# Where, and what stands there: both sound and wrong.
VARIANTS = [
    ("top", ""),
    ("top", "nmae = 'x'"),
    ("top", "x_mine = { a = 1 }"),
    ("top", "name = 7"),
    ("top", "stereo = { mode = 'anaglyph' }"),
    ("top", "stereo = { mode = 'red' }"),
    ("top", "stereo = 'anaglyph'"),
    ("top", "sync = { swap = 'barrier' }"),
    ("top", "test = { gap_rgba = [0, 0, 0, 256] }"),
    ("top", "test = { gap_rgba = [0, 0, 0] }"),
    ("top", "test = { gap_rgba = [0, 0, 0, 255], headless = true }"),
    ("top", "monitors = [{ id = 'm', surface = 'g', pixels = [8, 8] }]"),
    ("top", "monitors = [{ id = 'm', surface = 'g', pixels = [8, 0] }]"),
    ("top", "monitors = [{ id = 'm', surface = 'g', rect = [0, 0, 8, 8], zoom = 'auto' }]"),
    ("top", "monitors = [{ id = 'm', surface = 'g', rect = [0, 0, 8, 8], pixels = [8, 8] }]"),
    ("top", "monitors = [{ surface = 'g', pixels = [8, 8] }]"),
    ("node", "host = 'a'\nranks = 2\ngpus = [{ id = 'g0', backend = 'egl' }]"),
    ("node", "ranks = 0"),
    ("node", "gpus = [{ name = 'g0' }]"),
    ("window", "rect = [-5, 0, 64, 36]\nfullscreen = true\nrank = 3\ndisplay = ':0'"),
    ("window", "rect = [0, 0, 0, 36]"),
    ("window", "fullscreen = 1"),
    ("window", "rank = -1"),
    ("window", "monitor = 'DP-1'"),
    ("viewer", "ipd_m = 0\neye_offset_m = [0, 0, -0.1]\nnear_m = 0.1\nclamp_distance_m = 0.1"),
    ("viewer", "ipd_m = -0.1"),
    ("viewer", "ipd_m = true"),
    ("viewer", "near_m = 0"),
    ("viewer", "eye_offset_m = [0, 0]"),
    ("viewer", "tracker = { type = 'udp', port = 5005, lost = { after_ms = 5, then = 'rest' }, predict_ms = 3 }"),
    ("viewer", "tracker = { type = 'udp', port = 70000 }"),
    ("viewer", "tracker = { type = 'udp', port = 5005, lost = { then = 'jump' } }"),
    ("viewer", "tracker = { type = 'udp' }"),
    ("viewer", "tracker = { type = 'udp', port = 5005, path = 'a.csv' }"),
    ("viewer", "tracker = { type = 'vrpn', address = 'Head0@tracker:3883', sensor = 0 }"),
    ("viewer", "tracker = { type = 'mouse' }"),
    ("viewer", "tracker = { port = 5005 }"),
    ("surface", "viewer = 'v'"),
    ("surface", "viewer = 3"),
    ("surface", "grid = {}"),
    ("screen", ", rotate = 180, mirror = 'vertical', eye = 'left', warp = { mesh = 'm.pfm' }"),
    ("screen", ", warp = { mesh = 'm.pfm', x_date = 3 }"),
    ("screen", ", warp = {}"),
    ("screen", ", warp = { mesh = 7 }"),
    ("screen", ", warp = { mesh = '' }"),
    ("screen", ", warp = { mesh = 'm.pfm', alpha = 'm.png' }"),
    ("screen", ", rotate = 45"),
    ("screen", ", mirror = 'both'"),
    ("screen", ", eye = 'third'"),
    ("screen", ", panel_rotate = 180"),
    ("screen", ", colour = { gamma = 2.2, gain = [1, 0.5, 0], black = 0 }"),
    ("screen", ", colour = { gain = [1, 1] }"),
    ("screen", ", colour = { black = 2 }"),
    ("screen", ", colour = { gamma = 0 }"),
    ("screen", ", color = { gamma = 1 }"),
    ("screen", ", edge_blend_m = 'auto'"),
    ("screen", ", edge_blend_m = 'all'"),
    ("screen", ", edge_blend_m = 0.1"),
    ("screen", ", edge_blend_m = -0.1"),
    ("screen", ", edge_blend_m = { left = 0.1, right = 0, gamma = 2 }"),
    ("screen", ", edge_blend_m = { middle = 0.1 }"),
    ("screen", ", viewport = [0, 0, 64, 36]"),
    ("screen", ", viewport = [0, 0, 64]"),
    ("grid", GRID),
    ("grid", GRID.replace("columns = 2\n", "")),
    ("grid", GRID.replace("[64, 36]", "[64, 0]")),
    ("grid", GRID.replace("[1.6, 0.9]", "[1.6, 0]")),
    ("grid", GRID.replace("[1.6, 0.9]", "[1.6, 1e-200]")),
    ("grid", GRID + "gap_m = [0.1, -0.1]\ncentre_m = [0, 1, 0]\ncolumn_gaps_m = [0.2]\nrow_gaps_m = []"),
    ("grid", GRID + "gap_m = 0.1"),
    ("grid", GRID + "panel_rotate = 90\nmirror = 'horizontal'"),
    ("grid", GRID + "panel_rotate = 90\nrotate = 90"),
    ("grid", GRID + "curve = { radius_m = 3 }"),
    ("grid", GRID + "curve = { angle_degrees = 90.5 }"),
    ("grid", GRID + "curve = { angle_degrees = 400 }"),
    ("grid", GRID + "curve = { radius_m = 3, angle_degrees = 90 }"),
    ("grid", GRID + "curve = {}"),
]


def main():
    schema = json.loads(subprocess.run([HPR, "wall", "schema"], capture_output=True, check=True, timeout=60).stdout)
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    bad = 0
    verdicts = set()
    with tempfile.TemporaryDirectory(prefix="hpr-wall-schema-") as scratch:
        shutil.copytree(EXAMPLES, scratch, dirs_exist_ok=True)  # with the files they name
        (pathlib.Path(scratch) / "m.pfm").write_bytes(b"PF\n1 1\n-1.0\n" + struct.pack("<3f", 9.8, 0.45, 0.0))
        cases = [(file.name, file.read_text()) for file in sorted(EXAMPLES.glob("*.toml"))]
        for place, text in VARIANTS:
            parts = {key: "" for key in PLACES} | {"grid": GRID} | {place: text}
            cases.append((f"{place}: {text!r}", BASE.format(**parts)))
        for title, text in cases:
            file = pathlib.Path(scratch) / "wall.toml"
            file.write_text(text)
            result = subprocess.run([HPR, "wall", "check", file, "--json"], capture_output=True, text=True, timeout=60, check=False)
            reading = json.loads(result.stdout)
            errors = [e.message for e in validator.iter_errors(tomllib.loads(text))]
            verdicts.add(reading["ok"])
            if reading["ok"] == (not errors):
                continue
            bad += 1
            told = [f["what"] for f in reading["findings"] if f["severity"] == "error"]
            print(f"{title}\n  reader: {told or 'sound'}\n  schema: {errors or 'sound'}")
    if verdicts != {True, False}:
        print("all files were judged alike")
        bad += 1
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
