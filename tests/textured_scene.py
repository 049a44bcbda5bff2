#!/usr/bin/env python3
"""Writes a binary glTF of walls that have a texture each, of their own noise.

usage: textured_scene.py OUT.glb [--textures 40] [--side 1024] [--triangles 2]
`--triangles` per wall, in strips. The pictures are PNG, RGB; every wall stands a little behind the one before, a lamp
hangs above."""
import argparse
import json
import math
import random
import struct
import zlib


def png(side: int, seed: int) -> bytes:
    """Bands of a color of their own, under noise of a few levels."""
    draw = random.Random(seed)
    color = [draw.randrange(64, 192) for _ in range(3)]
    band = max(side // 16, 1)
    rows = []
    for y in range(side):
        shade = 40 if y // band % 2 == 0 else 0
        noise = draw.getrandbits(8 * 3 * side).to_bytes(3 * side, "little").translate(bytes(i & 15 for i in range(256)))
        base = bytes(min(c + shade, 240) for c in color) * side
        word = int.from_bytes(base, "little") + int.from_bytes(noise, "little")  # no byte overflows: 240 + 15
        rows.append(b"\0" + word.to_bytes(3 * side, "little"))

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", side, side, 8, 2, 0, 0, 0)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(b"".join(rows), 1)) +
            chunk(b"IEND", b""))


class Glb:
    def __init__(self) -> None:
        self.binary = bytearray()
        self.views: list[dict] = []
        self.accessors: list[dict] = []

    def view(self, data: bytes) -> int:
        self.binary += b"\0" * (-len(self.binary) % 4)
        self.views.append({"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data)})
        self.binary += data
        return len(self.views) - 1

    def accessor(self, values: list, kind: str, component: int) -> int:
        width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}[kind]
        flat = [x for v in values for x in (v if width > 1 else (v,))]
        letter = "f" if component == 5126 else "I"
        entry = {"bufferView": self.view(struct.pack(f"<{len(flat)}{letter}", *flat)), "componentType": component,
                 "count": len(values), "type": kind}
        if kind == "VEC3":
            entry |= {"min": [min(v[i] for v in values) for i in range(3)],
                      "max": [max(v[i] for v in values) for i in range(3)]}
        self.accessors.append(entry)
        return len(self.accessors) - 1


def wall(glb: Glb, column: int, row: int, depth: float, strips: int) -> dict:
    positions = []
    uvs = []
    indices = []
    for i in range(strips + 1):
        s = i / strips
        for t in (0.0, 1.0):
            positions.append((column + 0.95 * s, row + 0.95 * t, -depth))
            uvs.append((s, 1.0 - t))
        if i > 0:
            a = 2 * (i - 1)
            indices += [a, a + 2, a + 1, a + 1, a + 2, a + 3]
    return {"attributes": {"POSITION": glb.accessor(positions, "VEC3", 5126),
                           "TEXCOORD_0": glb.accessor(uvs, "VEC2", 5126)},
            "indices": glb.accessor(indices, "SCALAR", 5125)}


def scene(textures: int, side: int, triangles: int) -> bytes:
    glb = Glb()
    columns = max(math.ceil(math.sqrt(textures * 1.6)), 1)
    document: dict = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}], "nodes": [], "meshes": [],
                      "materials": [], "textures": [], "images": []}
    for i in range(textures):
        primitive = wall(glb, i % columns, i // columns, 0.01 * i, max(triangles // 2, 1))
        document["images"].append({"bufferView": glb.view(png(side, i)), "mimeType": "image/png"})
        document["textures"].append({"source": i})
        document["materials"].append({"doubleSided": True, "pbrMetallicRoughness": {
            "baseColorTexture": {"index": i}, "metallicFactor": 0.0, "roughnessFactor": 0.9}})
        document["meshes"].append({"primitives": [primitive | {"material": i}]})
        document["nodes"].append({"mesh": i})
    rows = math.ceil(textures / columns)
    document["extensionsUsed"] = ["KHR_lights_punctual"]
    document["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 60.0 * columns}]}}
    document["nodes"].append({"translation": [0.5 * columns, 0.5 * rows, columns],
                              "extensions": {"KHR_lights_punctual": {"light": 0}}})
    document["scenes"][0]["nodes"] = list(range(len(document["nodes"])))
    glb.binary += b"\0" * (-len(glb.binary) % 4)
    document |= {"buffers": [{"byteLength": len(glb.binary)}], "bufferViews": glb.views, "accessors": glb.accessors}
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    length = 12 + 8 + len(text) + 8 + len(glb.binary)
    return (struct.pack("<III", 0x46546C67, 2, length) + struct.pack("<II", len(text), 0x4E4F534A) + text +
            struct.pack("<II", len(glb.binary), 0x004E4942) + bytes(glb.binary))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out")
    parser.add_argument("--textures", type=int, default=40)
    parser.add_argument("--side", type=int, default=1024)
    parser.add_argument("--triangles", type=int, default=2)
    arguments = parser.parse_args()
    with open(arguments.out, "wb") as file:
        file.write(scene(arguments.textures, arguments.side, arguments.triangles))


if __name__ == "__main__":
    main()
