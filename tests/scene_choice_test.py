#!/usr/bin/env python3
"""`--scene` and `--variant` of the commands that draw and of those that look at scenes, and what hidden nodes show.

usage: scene_choice_test.py HPR

Draws a file of two scenes, a square left and a square right, red without a variant of materials, green and blue with
one. Prints what differs and leaves with 1.
"""

import base64
import json
import pathlib
import struct
import subprocess
import sys
import tempfile

import png
from program import HPR, Failure, check, run, run_to

COLORS = {"": [1, 0, 0, 1], "grass": [0, 1, 0, 1], "sea": [0, 0, 1, 1]}
VIEW = ["--eye", "0,0,3", "--at", "0,0,0", "--size", "16x8", "--force", "--environment", "none"]


def model():
    corners = struct.pack("<12f", -0.5, -0.5, 0, 0.5, -0.5, 0, 0.5, 0.5, 0, -0.5, 0.5, 0)
    data = corners + struct.pack("<6H", 0, 1, 2, 0, 2, 3)
    return {
        "asset": {"version": "2.0"}, "scene": 0,
        "scenes": [{"name": "west", "nodes": [0]}, {"nodes": [1]}],
        "nodes": [{"mesh": 0, "translation": [-1, 0, 0]}, {"mesh": 0, "translation": [1, 0, 0]}],
        "meshes": [{"primitives": [{
            "attributes": {"POSITION": 0}, "indices": 1, "material": 0,
            "extensions": {"KHR_materials_variants": {"mappings": [{"variants": [0], "material": 1},
                                                                   {"variants": [1], "material": 2}]}}}]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorFactor": color}, "extensions": {"KHR_materials_unlit": {}}}
                      for color in COLORS.values()],
        "buffers": [{"byteLength": len(data),
                     "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode()}],
        "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 12}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
                       "min": [-0.5, -0.5, 0], "max": [0.5, 0.5, 0]},
                      {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"}],
        "extensionsUsed": ["KHR_materials_variants", "KHR_materials_unlit", "KHR_node_visibility"],
        "extensions": {"KHR_materials_variants": {"variants": [{"name": name} for name in COLORS if name]}},
    }


def write(folder, name, document):
    (folder / name).write_text(json.dumps(document))


def shown(path):
    """Which halves of a picture show something, and the channels that are brightest there."""
    width, height, values = png.read(path)
    sides = set()
    for i in range(width * height):
        pixel = values[4 * i:4 * i + 3]
        if max(pixel) > 100:
            sides.add(("west" if i % width < width // 2 else "east", "rgb"[pixel.index(max(pixel))]))
    return sides


def check_shown(path, expected, what):
    found = shown(path)
    check(found == expected, f"{what} shows {sorted(found)}, not {sorted(expected)}")


def draws_what_was_chosen(folder):
    for options, expected in [([], ("west", "r")), (["--scene", "1"], ("east", "r")), (["--scene", "west"], ("west", "r")),
                              (["--variant", "grass"], ("west", "g")),
                              (["--scene", "scene1", "--variant", "sea"], ("east", "b"))]:
        run_to(folder, ["render", "a.gltf", "-o", "a.png", *VIEW, *options])
        check_shown(folder / "a.png", {expected}, f"render {' '.join(options)}")
    run_to(folder, ["wall", "run", "1x1@16x8", "a.gltf", "--display", "file", "-o", "wall", "--scene", "1", "--variant",
                    "sea", "--eye", "0,0,3", "--at", "0,0,0", "--ranks", "2", "--force", "--environment", "none"])
    check_shown(folder / "wall" / "wall.png", {("east", "b")}, "wall run")
    script = "render\nsave c.png\nset scene 0\nquit\n"
    job = subprocess.run([HPR, "console", "a.gltf", "--scene", "1", "--variant", "grass", *VIEW], cwd=folder, input=script,
                         capture_output=True, text=True, timeout=120, check=False)
    check("--scene is not set from here" in job.stdout + job.stderr, f"console: {job.stdout}{job.stderr}")
    check_shown(folder / "c.png", {("east", "g")}, "console")


def names_the_choices(folder):
    for command in [["render", "a.gltf", "-o", "b.png", *VIEW], ["scene", "info", "a.gltf"], ["scene", "validate", "a.gltf"],
                    ["console", "a.gltf"],
                    ["wall", "run", "1x1@16x8", "a.gltf", "--display", "none"]]:
        for option, value, choices in [("--scene", "2", "west, scene1"), ("--scene", "wset", "west, scene1"),
                                       ("--variant", "gras", "grass, sea")]:
            result = run(folder, *command, option, value)
            said = f"{' '.join(command)} {option} {value} left with {result.returncode}: {result.stderr}"
            check(result.returncode == 2 and f"'{value}'" in result.stderr and choices in result.stderr, said)
    check(not (folder / "b.png").exists(), "a picture of what is not there was written")
    run_to(folder, ["scene", "info", "gen:cornell", "--scene", "0"])
    run_to(folder, ["scene", "info", "gen:cornell", "--scene", "1"], expected=2)


def lists_scenes_and_variants(folder):
    info = json.loads(run_to(folder, ["scene", "info", "a.gltf", "--json"]).stdout)
    check(info["scenes"] == ["west", "scene1"] and info["variants"] == ["grass", "sea"] and not info["warnings"],
          f"scene info says {info}")
    east = json.loads(run_to(folder, ["scene", "info", "a.gltf", "--json", "--scene", "1"]).stdout)
    check(info["bounds"][0][0] == -1.5 and east["bounds"][0][0] == 0.5, f"bounds {info['bounds']} and {east['bounds']}")
    generated = json.loads(run_to(folder, ["scene", "info", "gen:cornell", "--json"]).stdout)
    check(generated["scenes"] == [] and generated["variants"] == [], f"gen:cornell: {generated}")


def hides_what_is_not_visible(folder):
    document = model()
    document["scenes"][0]["nodes"] = [0, 1]
    document["nodes"][0]["extensions"] = {"KHR_node_visibility": {"visible": False}}
    write(folder, "hidden.gltf", document)
    run_to(folder, ["render", "hidden.gltf", "-o", "h.png", *VIEW])
    check_shown(folder / "h.png", {("east", "r")}, "a hidden node")


def main():
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(temporary)
        write(folder, "a.gltf", model())
        try:
            for case in (draws_what_was_chosen, names_the_choices, lists_scenes_and_variants, hides_what_is_not_visible):
                case(folder)
        except Failure as failure:
            print(f"failed: {failure}")
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
