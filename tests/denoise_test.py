#!/usr/bin/env python3
"""Denoised pictures: the same bits however the work is spread, nearer to the truth from few samples, refused where they make no sense.

usage: denoise_test.py HPR

Prints what differs and leaves with 1.
"""

import json
import pathlib
import subprocess
import sys
import tempfile

import exr
from program import HPR, expect, failures
from samples_test import hpr, material, render, squared_error, write_boxes

SPREADS = (("--threads", "1"), ("--threads", "2"), ("--ranks", "3", "--distribute", "sort-first"),
           ("--ranks", "3", "--distribute", "sort-last", "--strategy", "direct-send"),
           ("--ranks", "4", "--distribute", "sort-last", "--strategy", "binary-swap"), ("--ranks", "2", "--data", "partitioned"))


def same_bits(folder):
    """A gallery with glass, mirrors and surfaces that cover in part; boxes under an even sky, whose samples are lit together."""
    white = material([0.8, 0.8, 0.8, 1.0])
    write_boxes(folder / "open.gltf", [
        ([-2, -0.2, -2], [2, 0, 2], white), ([-0.9, 0, -0.5], [-0.2, 0.9, 0.2], material([0.7, 0.2, 0.1, 1.0])),
        ([0.2, 0, -0.5], [0.8, 0.6, 0.1], material([0.9, 0.9, 0.9, 1.0], 1.0, 0.2))])
    sky = ("--at", "0,0.2,0", "--eye", "0.3,1.2,1.9", "--environment", "0.5,0.6,0.7", "--quality", "best")
    for scene, look in (("gen:gallery", ("--spp", "2", "--photons", "1000", "--filter", "gaussian")),
                        ("gen:gallery", ("--spp", "1",)),
                        (folder / "open.gltf", (*sky, "--spp", "18", "--primary", "rays")),
                        (folder / "open.gltf", (*sky, "--spp", "16", "--adaptive"))):
        expected = render(folder, "--denoise", *look, scene=scene)
        expect(expected != render(folder, *look, scene=scene), f"{scene} {look}: no difference")
        for way in SPREADS:
            expect(render(folder, "--denoise", *look, *way, scene=scene) == expected,
                   f"{scene} {look}: other bits with {' '.join(way)}")
    return folder / "open.gltf", sky


def layers(folder, scene, sky):
    """Parts of the light sum to it, and asking for them changes no bit of it."""
    render(folder, *sky, "--denoise", "--spp", "3", scene=scene)
    image = exr.read(folder / "a.exr")[2]
    render(folder, *sky, "--denoise", "--spp", "3", "--aov", "direct,shadow,reflection,photon,normal,cost", scene=scene)
    found = exr.read(folder / "a.exr")[2]
    expect(all(list(image[c]) == list(found[c]) for c in "RGB"), "layers change the colour")
    for channel in "RGB":
        parts = [found[f"{part}.{channel}"] for part in ("direct", "shadow", "reflection", "photon")]
        wrong = max(abs(sum(values) - total) for *values, total in zip(*parts, found[channel]))
        expect(wrong < 1e-5, f"layers do not sum to the colour: {wrong}")
    passes = json.loads((folder / "a.json").read_text())["passes"]
    expect(any(each["name"] == "denoise" for each in passes), "the statistics do not tell what denoising takes")


def pays(folder, scene, sky):
    """Less than half of the error from one to four samples, and none more from many."""
    render(folder, *sky, "--spp", "256", scene=scene)
    reference = exr.read(folder / "a.exr")[2]
    for samples, most in ((1, 0.4), (4, 0.5), (64, 1.1)):
        plain, smooth = (squared_error(folder, reference, samples, *sky, *more, scene=scene)[0] for more in ((), ("--denoise",)))
        expect(smooth < most * plain, f"{samples} samples: an error of {smooth} denoised, {plain} as they are")


def refuses(folder):
    for other in (("--reference",), ("--shading", "local"), ("--half-resolution", "reflection"),
                  ("--filter", "mitchell", "--spp", "16")):
        result = subprocess.run([HPR, "render", "gen:gallery", "-o", "refused.png", "--denoise", *other], cwd=folder,
                                capture_output=True, text=True, timeout=60, check=False)
        expect(result.returncode == 2 and "--denoise" in result.stderr, f"{other}: left with {result.returncode}: {result.stderr}")
        expect(not list(folder.glob("refused*")), f"{other}: left a file")


def walls(folder):
    """Screens of a wall, those resting with a target too."""
    for more in ((), ("--target-ms", "40", "--frames", "3")):
        hpr(folder, "wall", "run", "2x1@61x47", "gen:gallery", "-o", "wall", "--force", "--denoise", *more)
    result = hpr(folder, "render", "gen:gallery", "--size", "32x32", "--spp", "1", "--denoise", "--explain", "-o", "e.png")
    expect("denoiser: " in result.stdout + result.stderr, "--explain does not tell of the denoiser")


def main():
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(scratch)
        scene, sky = same_bits(folder)
        layers(folder, scene, sky)
        pays(folder, scene, sky)
        refuses(folder)
        walls(folder)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
