"""Scenes with something added that no picture of them shows, for tests and timings of what that costs: nothing."""

import json
import struct


def split(glb):
    """The JSON and the binary chunk of a .glb."""
    length, = struct.unpack_from("<I", glb, 12)
    return json.loads(glb[20:20 + length]), glb[20 + length:]


def join(document, rest):
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    return struct.pack("<4sIIII", b"glTF", 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A) + text + rest


def with_camera(document):
    document.setdefault("cameras", []).append({"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1}})
    document["nodes"].append({"camera": len(document["cameras"]) - 1, "translation": [1, 2, 3]})
    document["scenes"][document.get("scene", 0)]["nodes"].append(len(document["nodes"]) - 1)


def with_material(**material):
    def add(document):
        used = document.setdefault("extensionsUsed", [])
        used += [name for name in material.get("extensions", {}) if name not in used]
        document.setdefault("materials", []).append(material)
    return add


def with_light(document):
    lights = document.setdefault("extensions", {}).setdefault("KHR_lights_punctual", {}).setdefault("lights", [])
    lights.append({"type": "point", "intensity": 100.0})
    used = document.setdefault("extensionsUsed", [])
    if "KHR_lights_punctual" not in used:
        used.append("KHR_lights_punctual")


def with_mesh(document):
    """A mesh no node shows, of a mirror."""
    with_material(pbrMetallicRoughness={"metallicFactor": 1.0, "roughnessFactor": 0.0})(document)
    copy = json.loads(json.dumps(document["meshes"][0]))
    for primitive in copy["primitives"]:
        primitive["material"] = len(document["materials"]) - 1
    document["meshes"].append(copy)


FEATURES = {
    "a camera nobody looks through": with_camera,
    "a light no node holds": with_light,
    "a mesh no node shows, of a mirror": with_mesh,
    "a material that mirrors, on nothing": with_material(pbrMetallicRoughness={"metallicFactor": 1.0, "roughnessFactor": 0.0}),
    "a material that transmits, on nothing": with_material(
        extensions={"KHR_materials_transmission": {"transmissionFactor": 1.0}}),
    "a material that emits, on nothing": with_material(emissiveFactor=[1.0, 1.0, 1.0]),
    "a BLEND material, on nothing": with_material(alphaMode="BLEND", pbrMetallicRoughness={"baseColorFactor": [1, 1, 1, 0.5]}),
    "a MASK material, on nothing": with_material(alphaMode="MASK"),
}

# Options of things a matte scene with point lights does not show.
OPTIONS = {
    "deep paths": ("--max-depth", "32"),
    "many photons": ("--photons", "1000000"),
    "many samples of surfaces that emit": ("--light-samples", "16"),
    "groups, where nothing is hybrid": ("--groups", "1"),
}


def added_to(glb, feature):
    document, rest = split(glb)
    FEATURES[feature](document)
    return join(document, rest)
