"""Writes glTF files of quads, for tests of what is seen of which."""

import base64
import itertools
import json
import struct

import png

FRONT = (0, 1, 2, 0, 2, 3)  # counterclockwise as seen from +z
BACK = (0, 2, 1, 0, 3, 2)


class Quads:
    """Quads of side 2 in the plane z = 0 of their nodes, which show unlit colors unless their materials say otherwise."""

    def __init__(self):
        self.data = b""
        self.gltf = {"asset": {"version": "2.0"}, "scene": 0, "nodes": [], "meshes": [], "materials": [], "accessors": [],
                     "bufferViews": [], "extensionsUsed": ["KHR_materials_unlit"]}

    def _accessor(self, packed, **fields):
        self.gltf["bufferViews"].append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(packed)})
        self.data += packed + b"\0" * (-len(packed) % 4)
        self.gltf["accessors"].append({"bufferView": len(self.gltf["bufferViews"]) - 1} | fields)
        return len(self.gltf["accessors"]) - 1

    def material(self, color, **fields):
        made = {"pbrMetallicRoughness": {"baseColorFactor": list(color), "metallicFactor": 0, "roughnessFactor": 1}}
        if "pbrMetallicRoughness" not in fields:
            made["extensions"] = {"KHR_materials_unlit": {}}
        self.gltf["materials"].append(made | fields)
        return len(self.gltf["materials"]) - 1

    def texture(self, width, height, values):
        """`values`: RGBA, 8 bits each, row by row."""
        uri = "data:image/png;base64," + base64.b64encode(png.encode(width, height, values)).decode()
        for name, item in (("images", {"uri": uri}), ("textures", {"source": len(self.gltf.get("images", []))})):
            self.gltf.setdefault(name, []).append(item)
        return {"index": len(self.gltf["textures"]) - 1}

    def mesh(self, material, corners=((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)), indices=FRONT, normals=None, uvs=None):
        """`corners`: any number, wound by `indices`; flat without normals."""
        points = struct.pack(f"<{3 * len(corners)}f", *itertools.chain(*corners))
        rounded = list(struct.iter_unpack("<3f", points))
        bounds = {"min": [min(axis) for axis in zip(*rounded)], "max": [max(axis) for axis in zip(*rounded)]}
        positions = self._accessor(points, componentType=5126, count=len(corners), type="VEC3", **bounds)
        triangles = self._accessor(struct.pack(f"<{len(indices)}I", *indices), componentType=5125, count=len(indices),
                                   type="SCALAR")
        primitive = {"attributes": {"POSITION": positions}, "indices": triangles}
        if normals is not None:
            packed = struct.pack(f"<{3 * len(normals)}f", *itertools.chain(*normals))
            primitive["attributes"]["NORMAL"] = self._accessor(packed, componentType=5126, count=len(normals), type="VEC3")
        if uvs is not None:
            packed = struct.pack(f"<{2 * len(uvs)}f", *itertools.chain(*uvs))
            primitive["attributes"]["TEXCOORD_0"] = self._accessor(packed, componentType=5126, count=len(uvs), type="VEC2")
        if material is not None:
            primitive["material"] = material
        self.gltf["meshes"].append({"primitives": [primitive]})
        return len(self.gltf["meshes"]) - 1

    def place(self, mesh, **transform):
        self.gltf["nodes"].append({"mesh": mesh} | transform)

    def write(self, path):
        self.gltf["scenes"] = [{"nodes": list(range(len(self.gltf["nodes"])))}]
        uri = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
        self.gltf["buffers"] = [{"byteLength": len(self.data), "uri": uri}]
        path.write_text(json.dumps(self.gltf))
