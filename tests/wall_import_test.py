#!/usr/bin/env python3
"""`hpr wall import`: what comes out is a wall that can be checked and run; what is wrong is told with its line.

usage: wall_import_test.py HPR
"""

import json
import pathlib
import sys
import tempfile

from program import expect, failures, run

FILES = {
    "displaycluster": """<configuration>
  <dimensions numTilesWidth="2" numTilesHeight="1" screenWidth="64" screenHeight="48" mullionWidth="4" mullionHeight="4"/>
  <process host="localhost" display=":0"><screen x="0" y="0" i="0" j="0"/><screen x="64" y="0" i="1" j="0"/></process>
</configuration>""",
    "pvx": """<pvx><Process Type="server"><Option Name="tile-dimensions-x" Value="2"/>
<Option Name="tile-mullion-x" Value="3"/><Machine Name="localhost" Geometry="64x48+0+0"/></Process></pvx>""",
    "tide": """{"surfaces": [{"displayWidth": 64, "displayHeight": 48, "numScreensX": 2, "numScreensY": 1}],
"processes": [{"host": "localhost", "screens": [{"i": 0}, {"i": 1, "x": 64}]}]}""",
    "osprstudio": """[{"topLeft": [-1, 1, -2], "botLeft": [-1, 0, -2], "botRight": [0, 0, -2], "eye": [0, 0.5, 1],
"screenWidth": 64, "screenHeight": 64},
{"topLeft": [0.1, 1, -2], "botLeft": [0.1, 0, -2], "botRight": [1.1, 0, -2], "eye": [0, 0.5, 1],
"screenWidth": 64, "screenHeight": 64, "screenX": 70}]""",
}


def check_round_trips(folder):
    for kind, text in FILES.items():
        (folder / kind).write_text(text)
        imported = run(folder, "wall", "import", kind, "--from", kind)
        expect(imported.returncode == 0, f"{kind}: {imported.stderr}")
        (folder / f"{kind}.toml").write_text(imported.stdout)
        checked = run(folder, "wall", "check", f"{kind}.toml", "--json")
        expect(checked.returncode == 0, f"{kind}: {checked.stderr}{checked.stdout}")
        expect(imported.stdout.startswith("# From "), f"{kind}: {imported.stdout[:80]}")
    shown = run(folder, "wall", "run", "tide.toml", "gen:cornell", "--passes", "none", "-o", "out")
    expect(shown.returncode == 0, f"tide.toml does not run: {shown.stderr}")
    manifest = json.loads((folder / "out" / "manifest.json").read_text())
    screens = manifest["frames"][0]["screens"]
    expect([(s["width"], s["height"]) for s in screens] == [(64, 48)] * 2, screens)


def check_errors(folder):
    def fails(code, what, *arguments):
        done = run(folder, "wall", "import", *arguments)
        expect(done.returncode == code, f"{arguments} leaves with {done.returncode}, not {code}")
        expect(what in done.stderr and "hint" in done.stderr, f"{arguments}: {done.stderr}")
        expect(done.stdout == "", f"{arguments} writes {done.stdout[:80]}")

    (folder / "bad.xml").write_text('<configuration>\n  <dimensions numTilesWidth="none"/>\n</configuration>')
    fails(3, "bad.xml:2: numTilesWidth is 'none'", "bad.xml", "--from", "displaycluster")
    fails(3, "it is no JSON", "bad.xml", "--from", "tide")
    fails(2, "unknown kind", "bad.xml", "--from", "equalizer")
    fails(2, "no size of a screen", "bad.xml", "--from", "tide", "--pixels", "0x4")
    fails(4, "missing.xml", "missing.xml", "--from", "tide")
    fails(2, "--from", "bad.xml")


with tempfile.TemporaryDirectory() as name:
    check_round_trips(pathlib.Path(name))
    check_errors(pathlib.Path(name))
sys.exit(1 if failures else 0)
