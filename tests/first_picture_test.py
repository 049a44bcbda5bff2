#!/usr/bin/env python3
"""What `hpr render SCENE` draws for who gives no settings: finished, lit and exposed; --spp 1 is one plain sample.

usage: first_picture_test.py HPR

Prints what was wrong and leaves with 1.
"""

import json
import pathlib
import sys
import tempfile

import exr
import png
from program import expect, failures, plain, run_to
from quads import Quads

SIZE = ("--size", "96x64")
FINISHED = ("--spp", "8", "--denoise", "--indirect")


def picture(folder, scene, *options, name="a.exr"):
    run_to(folder, ["render", scene, *SIZE, "-o", name, "--force", *options])
    return (folder / name).read_bytes()


def is_finished(folder):
    for scene in ("gen:gallery", "gen:cornell"):
        first = picture(folder, scene)
        expect(first == picture(folder, scene, *FINISHED), f"{scene}: the first picture is not the finished one")
        expect(first == picture(folder, scene, "--ranks", "3", "--distribute", "sort-last"), f"{scene}: 3 ranks, other bits")
        one_sample = picture(folder, scene, "--spp", "1")
        expect(one_sample == picture(folder, scene, *plain("--no-indirect", "--denoise=false")), f"{scene}: --spp 1 is not plain")
        expect(one_sample != first, f"{scene}: one plain sample is the finished picture")
        shown = picture(folder, scene, name="a.png")
        expect(shown == picture(folder, scene, "--tone", "neutral", "--exposure", "auto", name="b.png"), f"{scene}: another tone")
        expect(shown == picture(folder, scene, "--ranks", "3", "--distribute", "sort-last", name="b.png"),
               f"{scene}: 3 ranks show other colours")


def quads_of(folder, name, emissive, side):
    """A matte quad of 2 m that faces the eye, and a square of `side` before it that emits."""
    quads = Quads()
    quads.gltf["extensionsUsed"].append("KHR_materials_emissive_strength")
    for half, depth, base, light in ((1.0, 0.0, 0.8, 0.0), (side / 2, 0.01, 0.0, emissive)):
        material = quads.material((), pbrMetallicRoughness={"baseColorFactor": [base, base, base, 1], "metallicFactor": 0},
                                  emissiveFactor=[1, 1, 1] if light else [0, 0, 0],
                                  extensions={"KHR_materials_emissive_strength": {"emissiveStrength": light}})
        quads.place(quads.mesh(material), translation=[0, 0, depth], scale=[half, half, 1])
    quads.write(folder / name)


def light_beside_the_middle(folder, scene, *options):
    picture(folder, scene, "--eye", "0,0,4", "--at", "0,0,0", *options)
    return exr.read(folder / "a.exr")[2]["G"][32 * 96 + 60]


def is_lit(folder):
    quads_of(folder, "texel.gltf", 1.0, 0.001)
    quads_of(folder, "lamp.gltf", 4.0, 0.5)
    for scene, studio in (("texel.gltf", True), ("lamp.gltf", False)):
        explained = run_to(folder, ["render", scene, *SIZE, "--explain"]).stdout
        expect(("studio" in explained) == studio, f"{scene}: {explained}")
    expect(light_beside_the_middle(folder, "texel.gltf") > 0.2, "a scene that one texel lights is dark")
    expect(light_beside_the_middle(folder, "texel.gltf", "--environment", "none") < 0.01, "--environment none leaves light")
    run_to(folder, ["render", "texel.gltf", *SIZE, "-o", "t.png", "--stats", "t.json", "--force"])
    stats = json.loads((folder / "t.json").read_text())
    expect(stats["tone"] == "neutral" and isinstance(stats["exposure"], float), f"{stats['tone']} {stats['exposure']}")
    pixels = png.read(folder / "t.png")[2]
    expect(len(set(pixels)) > 3, "the picture has no shades")


def says_what_is_left_out(folder):
    draft = run_to(folder, ["render", "gen:cornell", *SIZE, "--quality", "draft", "-o", "d.png"]).stderr
    expect("left out: antialiasing (--spp 8), indirect light" in draft, f"draft says nothing: {draft}")
    wall = run_to(folder, ["wall", "run", "1x1@64x48", "gen:cornell", "--display", "none"]).stderr
    expect("left out: antialiasing (--spp 8), indirect light" in wall, f"a wall's frames say nothing: {wall}")
    first = run_to(folder, ["render", "gen:cornell", *SIZE, "-o", "f.png"]).stderr
    expect("left out" not in first, f"the first picture leaves something out: {first}")


def main():
    for case in (is_finished, is_lit, says_what_is_left_out):
        with tempfile.TemporaryDirectory(prefix="hpr-first-") as folder:
            case(pathlib.Path(folder))
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
