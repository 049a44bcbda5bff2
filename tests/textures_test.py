#!/usr/bin/env python3
"""Renders a scene of textures by one rank and by several, whole and in parts: the same picture, the same errors.

usage: textures_test.py HPR
"""
import pathlib
import sys
import tempfile

import textured_scene
from program import expect, failures, run, run_to

WAYS = {"one": [], "whole": ["--ranks", "3"], "parts": ["--ranks", "4", "--data", "partitioned"],
        "islands": ["--ranks", "4", "--data", "partitioned", "--distribute", "hybrid"]}


def render(folder, scene, name, arguments):
    picture = pathlib.Path(folder, f"{name}.png")
    result = run_to(folder, ["render", str(scene), "--size", "160x90", "--spp", "1", "-o", str(picture), "--force", *arguments])
    return picture.read_bytes(), result.stderr


def main():
    with tempfile.TemporaryDirectory() as folder:
        scene = pathlib.Path(folder, "textures.glb")
        document = textured_scene.scene(12, 256, 200)
        scene.write_bytes(document)
        expected, _ = render(folder, scene, "one", [])
        for name, arguments in WAYS.items():
            expect(render(folder, scene, name, arguments)[0] == expected, f"{name}: another picture than one rank's")

        # A broken picture is left out by all, who say so.
        at = document.index(b"IDAT", len(document) // 2) + 40
        scene.write_bytes(document[:at] + b"\0" * 4000 + document[at + 4000:])
        without, _ = render(folder, scene, "one", [])
        expect(without != expected, "the broken picture is drawn")
        for name, arguments in WAYS.items():
            picture, said = render(folder, scene, name, arguments)
            expect(picture == without and said.count("drawn without it") == 1, f"{name}, a broken picture: {said}")

        # Too large ones are refused by all.
        scene.write_bytes(document)
        for name, arguments in WAYS.items():
            result = run(folder, "render", scene, "--limit-mem", "4K", "-o", "none.png", *arguments)
            expect(result.returncode == 6, f"{name}, past the limit: {result.returncode}, {result.stderr}")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
