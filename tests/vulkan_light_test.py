#!/usr/bin/env python3
"""`--backend vulkan`: keys and light of a device are those of Embree's rays and of the CPU, whoever draws what.

usage: vulkan_light_test.py HPR [--all]
  --all  every scene by every kind of light: takes some minutes

Prints what was wrong and leaves with 1; with 77 where Vulkan has no device.
"""

import json
import struct
import sys

from program import expect
from quads import Quads
from vulkan_program import SIZE, hpr, nearly_equal, render, run_parts

EVERYTHING = "--all" in sys.argv
OTHERS = 0.0005  # of the pixels may show another surface
SCENES = ("gen:cornell", "gen:gallery", "gen:sphereflake?s=2", "gen:tetra?s=5", "gen:asteroids", "gen:extensions", "gen:cloud?count=2000")
PHOTONS = ("--photons", "5000")
PLAIN = ("--photons", "0")
DENOISED = (*PHOTONS, "--denoise")
GATHERED = (*PHOTONS, "--final-gather")
KINDS = (PLAIN, PHOTONS, DENOISED, GATHERED)
KINDS_OF = {"gen:cornell": (PLAIN,), "gen:gallery": (PHOTONS, DENOISED), "gen:sphereflake?s=2": (PLAIN,)}  # of others: PHOTONS
SPREADS = [("--ranks", ranks, "--distribute", distribution) for ranks in ("2", "4") for distribution in ("sort-first", "sort-last", "hybrid")]


def surfaces(keys):
    return [~key & 0xFFFFFFFF for key in struct.unpack(f"<{SIZE[0] * SIZE[1]}Q", keys)]


def same_keys(folder, what):
    expected, found = surfaces((folder / "cpu.keys").read_bytes()), surfaces((folder / "gpu.keys").read_bytes())
    others = sum(a != b for a, b in zip(found, expected))
    expect(others <= OTHERS * len(found), f"{what}: {others} of {len(found)} pixels show another surface than Embree's")
    expect(len(set(found)) > 5, f"{what}: shows {len(set(found))} surfaces")


def rays_of(path):
    """How many were traced for light: of those from the eye, the CPU's keys have some."""
    return {kind: rays for kind, rays in json.loads(path.read_text())["rays"].items() if kind != "primary"}


def same_picture(folder, scene, *options, traces=True):
    """By the same numbers along the same paths, so nearly the same pictures."""
    settings = ("--size", f"{SIZE[0]}x{SIZE[1]}", "--quality", "draft", "--spp", "1", "--force", *options)

    def draw(who, *by):
        return hpr(folder, "render", scene, "-o", f"{who}.exr", "--raw", f"{who}.keys", "--stats", f"{who}.json", *by, *settings)

    draw("cpu", "--primary", "rays")
    said = draw("gpu", "--backend", "vulkan", "--explain")
    what = f"{scene} {' '.join(options)}"
    words = said.stdout + said.stderr
    expect("light: on the device" in words, f"{what}: the CPU lights: {said.stderr[-400:]}")
    expect(("photons: traced on the device" in words) == ("pass photon: on" in words and traces), f"{what}: does not say who traces photons: {words[-800:]}")
    same_keys(folder, what)
    nearly_equal(folder, "cpu.exr", "gpu.exr", what)
    by_cpu = [entry["ms"] for entry in json.loads((folder / "gpu.json").read_text())["passes"] if entry["name"] == "direct"]
    expect(by_cpu == [0], f"{what}: the device left tiles to the CPU: {by_cpu} ms of direct light")
    expected, found = rays_of(folder / "cpu.json"), rays_of(folder / "gpu.json")
    expect(all(abs(found[kind] - rays) <= 0.001 * rays for kind, rays in expected.items()), f"{what}: rays {found} in place of {expected}")


def textured(quads, texture, mode):
    return quads.material((1, 1, 1), doubleSided=True, alphaMode=mode, pbrMetallicRoughness={"metallicFactor": 0} | texture)


def write_veils(path):
    """Surfaces that cover in part, in layers, in one plane, cut out, before a mirror and before nothing; a lamp, and what they shadow."""
    quads = Quads()

    def lit(color, alpha=1.0, metal=0, rough=1, **fields):
        return quads.material(color, doubleSided=True, **fields,
                              pbrMetallicRoughness={"baseColorFactor": [*color, alpha], "metallicFactor": metal, "roughnessFactor": rough})

    spots = quads.texture(4, 4, bytes(value for i in range(16) for value in (220, 160, 90, 17 * i)))
    square = [(0, 1), (1, 1), (1, 0), (0, 0)]
    plain = quads.mesh(lit((0.8, 0.7, 0.6)))
    mirror = quads.mesh(lit((0.9, 0.9, 0.9), metal=1, rough=0))
    panes = [quads.mesh(lit((0.2, 0.5, 0.9), 0.2 + 0.1 * i, alphaMode="BLEND")) for i in range(4)]
    spotted = {"baseColorTexture": spots}
    cut = quads.mesh(textured(quads, spotted, "MASK"), uvs=square)
    blended = quads.mesh(textured(quads, spotted, "BLEND"), uvs=square)
    quads.place(plain, translation=[0, -1, 0], rotation=[-(0.5 ** 0.5), 0, 0, 0.5 ** 0.5], scale=[3, 3, 1])
    quads.place(plain, translation=[-1.6, 0, -2])
    quads.place(mirror, translation=[0.6, 0, -2])
    for i, pane in enumerate(panes):
        quads.place(pane, translation=[-1.2 + 0.4 * i, 0.1 * i, 0.3 * i], scale=[0.8, 0.8, 1])
        quads.place(pane, translation=[-2 + 0.3 * i, -0.2, -2], scale=[0.4, 0.4, 1])  # in the wall's plane
        quads.place(pane, translation=[1.9, 0.4 + 0.2 * i, -1], scale=[0.5, 0.5, 1])  # before nothing, in one plane
    quads.place(cut, translation=[-0.6, -0.2, 1.4], scale=[0.5, 0.5, 1])
    quads.place(blended, translation=[0.9, -0.2, -0.5], scale=[0.7, 0.7, 1])
    quads.gltf["extensionsUsed"].append("KHR_lights_punctual")
    quads.gltf["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 300}]}}
    quads.gltf["nodes"].append({"translation": [1, 3, 4], "extensions": {"KHR_lights_punctual": {"light": 0}}})
    quads.write(path)


def pictures_of_veils(folder):
    write_veils(folder / "veils.gltf")
    camera = ("--eye", "0.3,0.4,5", "--at", "0,0,-1", "--fov", "50")
    passes = ("--passes", "shadow,reflection,ambient-occlusion")
    for settings in (("--photons", "5000"), ("--photons", "0", *passes, "--background", "0.2,0.4,0.1", "--environment", "none", "--denoise")):
        same_picture(folder, "veils.gltf", *camera, *settings, traces=False)


def pictures_of_scenes(folder):
    for scene in SCENES:
        for kind in KINDS if EVERYTHING else KINDS_OF.get(scene, (PHOTONS,)):
            same_picture(folder, scene, *kind)


def spreads(folder):
    """Of 1, 2 and 4 ranks the same bits; each rank takes seconds to start its kernels, so photons are left out where light is filtered."""
    lit = ("--backend", "vulkan", "--spp", "2", "--quality", "draft")
    for kind, photons, of_kind in (((), "2000", SPREADS[:2] + SPREADS[5:]), (("--denoise",), "0", SPREADS[2:5])):
        alone = render(folder, "gen:gallery", *lit, *kind, photons=photons)
        for spread in of_kind:
            found = render(folder, "gen:gallery", *lit, *kind, *spread, photons=photons)
            expect(found == alone, f"other bits with {' '.join(kind + spread)} and {photons} photons")


if __name__ == "__main__":
    sys.exit(run_parts(pictures_of_scenes, pictures_of_veils, spreads))
