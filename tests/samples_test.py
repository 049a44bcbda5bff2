#!/usr/bin/env python3
"""Pictures of several samples: the same bits however the work is spread, and closer to the truth with more of them.

usage: samples_test.py HPR

Prints what differs and leaves with 1.
"""

import base64
import itertools
import json
import pathlib
import struct
import subprocess
import sys
import tempfile

import exr
from program import HPR, expect, failures, plain

MATTE = "gen:cornell"


def hpr(folder, *arguments):
    result = subprocess.run([HPR, *map(str, arguments)], cwd=folder, capture_output=True, text=True, timeout=100, check=False)
    expect(result.returncode == 0, f"hpr {' '.join(map(str, arguments))} left with {result.returncode}: {result.stderr[-1000:]}")
    return result


def render(folder, *arguments, scene="gen:gallery"):
    hpr(folder, "render", scene, "--size", "136x60", "-o", "a.exr", "--stats", "a.json", "--force", *plain(*arguments))
    return (folder / "a.exr").read_bytes()


def spread_differently(folder):
    """Ways to spread 4 samples of a picture whose owners change with a strategy that balances what is drawn."""
    expected = render(folder, "--spp", "4", "--filter", "gaussian")
    expect(expected != render(folder, "--spp", "4"), "the filter makes no difference")
    expect(expected != render(folder, "--spp", "4", "--filter", "gaussian", "--seed", "2"), "the seed makes no difference")
    ways = [("--threads", "2"), ("--ranks", "2"), ("--ranks", "3", "--distribute", "hybrid"),
            ("--ranks", "3", "--distribute", "sort-last", "--strategy", "direct-send"),
            ("--ranks", "4", "--distribute", "sort-last", "--strategy", "binary-swap"),
            ("--ranks", "3", "--distribute", "sort-last", "--strategy", "shared-memory"),
            ("--ranks", "2", "--distribute", "sort-last", "--strategy", "radix-k", "--threads", "2"),
            ("--ranks", "7", "--distribute", "hybrid", "--strategy", "tree")]
    for way in ways:
        expect(render(folder, "--spp", "4", "--filter", "gaussian", *way) == expected, f"other bits with {' '.join(way)}")


def write_boxes(path, boxes):
    """A glTF of boxes: (low corner, high corner, material)."""
    data, nodes, meshes, views, accessors, materials = b"", [], [], [], [], []
    for low, high, material in boxes:
        corners = [[(low, high)[i >> axis & 1][axis] for axis in range(3)] for i in range(8)]
        faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
        points = [corners[corner] for face in faces for corner in face]
        indices = [4 * face + corner for face in range(6) for corner in (0, 1, 2, 0, 2, 3)]
        for packed in (struct.pack(f"<{3 * len(points)}f", *itertools.chain(*points)), struct.pack("<36H", *indices)):
            views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(packed)})
            data += packed
        number = len(accessors)
        accessors.append({"bufferView": number, "componentType": 5126, "count": 24, "type": "VEC3", "min": low, "max": high})
        accessors.append({"bufferView": number + 1, "componentType": 5123, "count": 36, "type": "SCALAR"})
        meshes.append({"primitives": [{"attributes": {"POSITION": number}, "indices": number + 1, "material": len(materials)}]})
        nodes.append({"mesh": len(nodes)})
        materials.append(material)
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    path.write_text(json.dumps({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": list(range(len(nodes)))}], "nodes": nodes, "meshes": meshes,
        "materials": materials, "accessors": accessors, "bufferViews": views,
        "buffers": [{"byteLength": len(data), "uri": uri}]}))


def material(color, metallic=0.0, roughness=1.0, **more):
    return {"doubleSided": True,
            "pbrMetallicRoughness": {"baseColorFactor": color, "metallicFactor": metallic, "roughnessFactor": roughness}} | more


def rounds(folder):
    """Under an even sky, in the open, rays gather indirect light, and samples are drawn together: the bits are those of one by
    one, as layers ask for. Indoors photons bring it."""
    white = material([0.8, 0.8, 0.8, 1.0])
    write_boxes(folder / "open.gltf", [
        ([-2, -0.2, -2], [2, 0, 2], white), ([-0.9, 0, -0.5], [-0.2, 0.9, 0.2], material([0.7, 0.2, 0.1, 1.0])),
        ([0.2, 0, -0.5], [0.8, 0.6, 0.1], material([0.9, 0.9, 0.9, 1.0], 1.0, 0.2)),
        ([-0.3, 0, 0.4], [0.4, 0.5, 0.7], material([0.1, 0.4, 0.8, 0.5], alphaMode="BLEND"))])
    write_boxes(folder / "room.gltf", [([-2, -2, -2], [2, 2, 2], white), ([-0.5, -2, -0.5], [0.5, -1, 0.5], white)])
    look = ("--at", "0,0.2,0", "--environment", "0.5,0.6,0.7", "--quality", "best", "--primary", "rays")
    sky = (*look, "--eye", "0.3,1.2,1.9", "--spp", "13")
    scene = folder / "open.gltf"
    hpr(folder, "render", scene, "--size", "136x60", "-o", "b.exr", "--force", "--aov", "direct,shadow,reflection,photon", *sky)
    layers = exr.read(folder / "b.exr")[2]
    ways = [(), ("--threads", "1"), ("--ranks", "3"), ("--ranks", "2", "--data", "partitioned")]
    pictures = {render(folder, *sky, *way, scene=scene) for way in ways}
    expect(len(pictures) == 1, "rounds, threads, ranks or parts of the scene change bits")
    rays = json.loads((folder / "a.json").read_text())["rays"]
    expect(rays["gather"] > 0 and rays["photon"] == 0 and rays["shadow"] == 0, f"an even sky was not gathered: {rays}")
    image = exr.read(folder / "a.exr")[2]
    expect(all(list(image[c]) == list(layers[c]) for c in "RGB"), "samples together are not those one by one")
    for channel in "RGB":
        parts = [layers[f"{part}.{channel}"] for part in ("direct", "shadow", "reflection", "photon")]
        wrong = max(abs(sum(values) - total) for *values, total in zip(*parts, layers[channel]))
        expect(wrong < 1e-5, f"layers do not sum to the colour: {wrong}")
    for scene, eye, by in (("open.gltf", "0.3,1.2,1.9", "rays"), ("room.gltf", "1.5,1,1.5", "photons")):
        result = hpr(folder, "render", scene, "-o", "c.exr", "--force", "--size", "40x30", "--spp", "1", "--photons", "1000", *look,
                     "--eye", eye, "--explain")
        expect(f"indirect light: by {by} (" in result.stdout + result.stderr, f"{scene}: not by {by}: {result.stderr[-800:]}")


def differ(one, other):
    hashes = [json.loads((wall / "manifest.json").read_text())["frames"][0]["screens"][0]["xxh64"] for wall in (one, other)]
    return hashes[0] != hashes[1], "--adaptive makes no difference to a wall with a target"


def adaptive(folder):
    """Samples go where noise is, alike however the work is spread, and pay: as many on average, for less error."""
    few = ("--spp", "32", "--adaptive", "--photons", "1000")
    expected = render(folder, *few)
    expect(json.loads((folder / "a.json").read_text())["samples"] == 32, "32 adaptive samples are not called so")
    expect(expected != render(folder, "--spp", "32", "--photons", "1000"), "adaptive samples make no difference")
    for way in (("--threads", "2"), ("--ranks", "3", "--distribute", "sort-first"),
                ("--ranks", "3", "--distribute", "sort-last", "--strategy", "direct-send"),
                ("--ranks", "4", "--distribute", "sort-last", "--strategy", "binary-swap")):
        expect(render(folder, *few, *way) == expected, f"adaptive samples have other bits with {' '.join(way)}")
    scene = folder / "open.gltf"
    sky = ("--at", "0,0.2,0", "--eye", "0.3,1.2,1.9", "--environment", "0.5,0.6,0.7", "--primary", "rays")
    ways = [(), ("--threads", "1"), ("--ranks", "3"), ("--ranks", "2", "--data", "partitioned"),
            ("--ranks", "3", "--distribute", "sort-last")]
    for light in (("--quality", "best", "--spp", "32"), ("--reference", "--spp", "16")):
        pictures = {render(folder, *sky, "--adaptive", *light, *way, scene=scene) for way in ways}
        expect(len(pictures) == 1, f"adaptive samples under a sky, {light}: threads, ranks or parts of the scene change bits")
    render(folder, *sky, "--quality", "best", "--spp", "256", scene=scene)
    reference = exr.read(folder / "a.exr")[2]
    error = {more: squared_error(folder, reference, 64, *sky, "--quality", "best", *more, scene=scene)[0]
             for more in ((), ("--adaptive",))}
    expect(error["--adaptive",] < 0.9 * error[()], f"adaptive samples do not pay: {error}")
    for calm in (("--eye", "0,1000,0", "--at", "0,2000,1", "--spp", "64"), ("--passes", "none", "--spp", "until:relmse=0.1")):
        for ranks in ("1", "2"):
            render(folder, "--adaptive", *calm, "--ranks", ranks)
    hpr(folder, "render", "gen:gallery", "--size", "96x64", "--adaptive", "--spp", "32", "--raw", "calm.keys")
    hpr(folder, "render", "gen:gallery", "--size", "1x1", "-o", "one.exr", "--adaptive", "--spp", "20", "--filter", "mitchell")
    for more in ((), ("--adaptive",)):
        hpr(folder, "wall", "run", "1x1@96x64", MATTE, "-o", "w" + "".join(more), "--target-error", "0.001", *more)
    expect(*differ(folder / "w", folder / "w--adaptive"))
    for other in (("--shading", "local"), ("--half-resolution", "reflection")):
        result = subprocess.run([HPR, "render", "gen:gallery", "-o", "x.png", "--adaptive", *other], cwd=folder,
                                capture_output=True, text=True, timeout=60, check=False)
        expect(result.returncode == 2 and "--adaptive" in result.stderr, f"--adaptive {other}: left with {result.returncode}")
    render(folder, "--adaptive", "--spp", "until:1s", "--photons", "1000")
    render(folder, "--adaptive", "--spp", "until:relmse=0.02", scene=MATTE)
    stats = json.loads((folder / "a.json").read_text())
    expect(stats["estimated_relmse"] <= 0.02, f"until 0.02: {stats['estimated_relmse']}")


def one_sample(folder):
    plain = render(folder)
    expect(render(folder, "--filter", "box") != plain, "a filter's one sample looks through the centre")


def squared_error(folder, reference, samples, *more, scene=MATTE):
    render(folder, "--spp", str(samples), *more, scene=scene)
    image = exr.read(folder / "a.exr")[2]
    total = sum((a - b) ** 2 / (b * b + 1e-2) for c in "RGB" for a, b in zip(image[c], reference[c]))
    return total / (3 * len(image["R"])), json.loads((folder / "a.json").read_text())


def convergence(folder):
    """In a scene without highlights, where the estimate can be held to the truth."""
    render(folder, "--spp", "512", scene=MATTE)
    reference = exr.read(folder / "a.exr")[2]
    error, stats = {}, None
    for samples in (4, 16, 64):
        error[samples], stats = squared_error(folder, reference, samples)
        expect(stats["samples"] == samples and 0 < stats["ms_per_sample"] <= stats["ms"], f"stats of {samples} samples")
    expect(error[64] < error[16] / 3 < error[4] / 9, f"samples do not help as they should: {error}")
    # Edges alone are sampled far better than independent samples would do.
    expect(error[64] / 2 < stats["estimated_relmse"] < 100 * error[64],
          f"estimated {stats['estimated_relmse']}, measured {error[64]}")
    target = 2 * stats["estimated_relmse"]
    reached, stats = squared_error(folder, reference, f"until:relmse={target}")
    expect(stats["estimated_relmse"] <= target and 16 <= stats["samples"] < 64, f"until {target}: {stats['samples']} samples")
    expect(reached <= 2 * target, f"until {target}: {reached} is left")
    expected = render(folder, "--spp", f"until:relmse={target}", scene=MATTE)
    expect(render(folder, "--spp", f"until:relmse={target}", "--ranks", "3", "--distribute", "sort-last",
                 scene=MATTE) == expected, "three ranks stop elsewhere")


def until_a_time(folder):
    for ranks in ("1", "3"):
        render(folder, "--spp", "until:1s", "--ranks", ranks)
        stats = json.loads((folder / "a.json").read_text())
        expect(stats["samples"] > 1 and 1000 <= stats["ms"] < 20000, f"until 1 s, {ranks} ranks: {stats['ms']} ms")


def a_wall(folder):
    hashes = []
    for name, ranks, samples in (("w1", "1", "4"), ("w3", "3", "4"), ("w1plain", "1", "1")):
        hpr(folder, "wall", "run", "3x1@96x64", "gen:gallery", "-o", name, "--ranks", ranks, "--spp", samples, "--frames", "2")
        frames = json.loads((folder / name / "manifest.json").read_text())["frames"]
        hashes.append([[screen["xxh64"] for screen in frame["screens"]] for frame in frames])
    expect(hashes[0] == hashes[1], "a wall of four samples has other bits with three ranks")
    expect(hashes[0][0] != hashes[0][1], "two frames have the same noise")
    expect(hashes[0][0] != hashes[2][0], "four samples are one")


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-samples-") as scratch:
        folder = pathlib.Path(scratch)
        one_sample(folder)
        rounds(folder)
        adaptive(folder)
        spread_differently(folder)
        convergence(folder)
        until_a_time(folder)
        a_wall(folder)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
