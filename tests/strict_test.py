#!/usr/bin/env python3
"""Values that are no finite numbers: counted, replaced, the first one named, and with --strict an error.

usage: strict_test.py HPR

Covers vertex attributes of a glTF file, an environment's EXR file, and light past what a float holds. Prints what was
wrong and leaves with 1.
"""

import base64
import json
import os
import pathlib
import struct
import subprocess
import sys
import tempfile

from program import plain

HPR = os.path.abspath(sys.argv[1])
NAN = float("nan")
failures = []


def check(condition, what):
    if not condition:
        failures.append(what)
        print(what)


def hpr(folder, *arguments):
    return subprocess.run([HPR, "render", *plain(*arguments), "--size", "100x70", "--force"], cwd=folder, capture_output=True,
                          text=True, timeout=120, check=False)


def quad(normal, emissive=0.0):
    """A quad of four vertices that faces the eye, in glTF; the second one's normal is `normal`."""
    positions = struct.pack("<12f", -1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0)
    normals = struct.pack("<12f", 0, 0, 1, *normal, 0, 0, 1, 0, 0, 1)
    indices = struct.pack("<6H", 0, 1, 2, 0, 2, 3)
    data = positions + normals + indices
    accessor = {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 4}
    return {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"mesh": 0}, {"extensions": {"KHR_lights_punctual": {"light": 0}}}],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "directional", "intensity": max(emissive, 1)}]}},
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1}, "indices": 2, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"metallicFactor": 0}, "emissiveFactor": [1, 1, 1],
                       "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": emissive}}}],
        "extensionsUsed": ["KHR_materials_emissive_strength", "KHR_lights_punctual"],
        "accessors": [{**accessor, "min": [-1, -1, 0], "max": [1, 1, 0]}, {**accessor, "bufferView": 1},
                      {"bufferView": 2, "componentType": 5123, "type": "SCALAR", "count": 6}],
        "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 48},
                        {"buffer": 0, "byteOffset": 96, "byteLength": 12}],
        "buffers": [{"byteLength": len(data),
                     "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode()}]}


def exr(width, height, pixels):
    """An uncompressed EXR file of 32-bit floats; `pixels`: rows of (r, g, b)."""
    def attribute(name, kind, value):
        return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value

    channels = b"".join(name + b"\0" + struct.pack("<iiii", 2, 0, 1, 1) for name in (b"B", b"G", b"R")) + b"\0"
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    header = struct.pack("<ii", 20000630, 2) + b"".join([
        attribute("channels", "chlist", channels), attribute("compression", "compression", b"\0"),
        attribute("dataWindow", "box2i", window), attribute("displayWindow", "box2i", window),
        attribute("lineOrder", "lineOrder", b"\0"), attribute("pixelAspectRatio", "float", struct.pack("<f", 1)),
        attribute("screenWindowCenter", "v2f", struct.pack("<2f", 0, 0)),
        attribute("screenWindowWidth", "float", struct.pack("<f", 1))]) + b"\0"
    size = width * 12
    first = len(header) + 8 * height
    table = b"".join(struct.pack("<Q", first + y * (size + 8)) for y in range(height))
    lines = b"".join(struct.pack("<ii", y, size) + b"".join(struct.pack(f"<{width}f", *(pixel[c] for pixel in row))
                                                           for c in (2, 1, 0)) for y, row in enumerate(pixels))
    return header + table + lines


def replaced(folder, case, arguments, words):
    result = hpr(folder, *arguments, "-o", "a.exr")
    check(result.returncode == 0 and words in result.stderr, f"{case}: left with {result.returncode}: {result.stderr}")
    result = hpr(folder, *arguments, "-o", "strict.exr", "--strict")
    check(result.returncode == 3 and words in result.stderr and not (folder / "strict.exr").exists(),
          f"{case}, strict: left with {result.returncode}: {result.stderr}")


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-strict-") as name:
        folder = pathlib.Path(name)
        (folder / "good.gltf").write_text(json.dumps(quad((0, 0, 1))))
        (folder / "normal.gltf").write_text(json.dumps(quad((NAN, 0, 1))))
        sky = [[(0.5, 0.5, 0.5)] * 4 for _ in range(3)]
        sky[1][2] = (NAN, 0.5, float("inf"))
        (folder / "sky.exr").write_bytes(exr(4, 3, sky))
        result = hpr(folder, "good.gltf", "-o", "a.exr", "--strict", "--stats", "a.json")
        stats = json.loads((folder / "a.json").read_text()) if result.returncode == 0 else None
        check(stats and stats["not_finite"] == {"pixels": 0, "first": None}, f"nothing wrong: {result.stderr} {stats}")
        check(stats and stats["rays_cut"] == 0 and stats["rays_invalid"] == 0, f"nothing wrong, and rays cut: {stats}")
        replaced(folder, "normals", ["normal.gltf"], "1 values are no finite numbers, the first at vertex 1")
        replaced(folder, "environment", ["good.gltf", "--environment", "sky.exr"],
                 "2 values are no finite numbers, the first in pixel 2,1")

        # Light past what floats hold, of a point of a sweep.
        (folder / "far.exr").write_bytes(exr(4, 3, [[(3.4e38, 3.4e38, 3.4e38)] * 4] * 3))
        hpr(folder, "good.gltf", "-o", "truth.png")
        for strict, code in (([], 0), (["--strict"], 1)):
            swept = subprocess.run([HPR, "tradeoff", "gen:tetra", "--environment", "far.exr", "--filter", "mitchell", "--vary", "spp=16",
                                    "--reference", "truth.png", "--frames", "1", "--size", "100x70", "--json", *strict], cwd=folder,
                                   capture_output=True, text=True, timeout=120, check=False,
                                   env={**os.environ, "HPR_CACHE": str(folder / "cache")})
            check(swept.returncode == code, f"a sweep past floats {strict}: {swept.returncode}: {swept.stderr}")
            check(json.loads(swept.stdout)["points"][0]["not_finite"] > 0, "a sweep past floats counts none")

        # What would be brighter than a float can be is taken as 1e12 by the loader, so the picture stays finite, strict or not.
        (folder / "bright.gltf").write_text(json.dumps(quad((0, 0, 1), 3.4e38)))
        found = []
        for ranks, threads in ((1, 1), (1, 2), (2, 1)):
            arguments = ["bright.gltf", "--ranks", str(ranks), "--threads", str(threads), "-o", "b.exr", "--stats", "b.json",
                         "--spp", "2"]
            result = hpr(folder, *arguments)
            check(result.returncode == 0, f"too bright: left with {result.returncode}: {result.stderr}")
            found.append(json.loads((folder / "b.json").read_text())["not_finite"] if result.returncode == 0 else None)
            check("taken as 1000000000000" in result.stderr, f"too bright: {result.stderr}")
            result = hpr(folder, *arguments, "--strict")
            check(result.returncode == 0, f"too bright, strict: {result.returncode}")
        check(found[0] == found[1] == found[2], f"too bright: ranks or threads change {found}")
        check(found[0] == {"pixels": 0, "first": None}, f"too bright: {found[0]}")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
