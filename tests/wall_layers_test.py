#!/usr/bin/env python3
"""What `hpr wall run --aov` and `--raw` write of each screen: what `hpr render` writes of one of its size, on any number of
ranks; of two eyes a file each.

usage: wall_layers_test.py HPR
"""

import pathlib
import struct
import subprocess
import sys
import tempfile

import exr

HPR = pathlib.Path(sys.argv[1]).resolve()
SCENE = "gen:gallery"
LAYERS = "depth,id,normal,direct,rank"
WALL = """hpr_wall = 1
{more}
[[surfaces]]
id = "w"
screens = [{screens}]
"""
SCREEN = ("{{ id = '{id}', pixels = [{width}, 144], "
          "corners_m = {{ ll = [{left}, -0.18, 0], lr = [{right}, -0.18, 0], ul = [{left}, 0.18, 0] }} }}")
failures = []


def expect(holds, message):
    if not holds:
        failures.append(message)
        print(f"failed: {message}")


def hpr(folder, *arguments):
    result = subprocess.run([HPR, *arguments], cwd=folder, capture_output=True, text=True, timeout=120)
    expect(result.returncode == 0, f"{' '.join(arguments)}: left with {result.returncode}: {result.stderr}")


def ids_in(keys):
    return struct.unpack(f"<{len(keys) // 4}I", keys)[::2]


def like_render(folder):
    samples = ["--spp", "3"]
    hpr(folder, "render", SCENE, *samples, "--size", "64x48", "--raw", "whole.keys", "--aov", LAYERS, "-o", "whole.exr")
    hpr(folder, "wall", "run", "1x1@64x48", SCENE, *samples, "--display", "file", "-o", "one", "--raw", "one.keys",
        "--aov", LAYERS)
    expect((folder / "one.keys").read_bytes() == (folder / "whole.keys").read_bytes(), "one screen has other keys")
    hpr(folder, "wall", "run", "1x1@64x48", SCENE, *samples, "--display", "none", "--raw", "alone.keys")
    expect((folder / "alone.keys").read_bytes() == (folder / "whole.keys").read_bytes(), "keys alone are others")
    shown, drawn = exr.read(folder / "one/wall-r0c0.aov.exr"), exr.read(folder / "whole.exr")
    expect(shown[:2] == (64, 48) and set(shown[2]) == set(drawn[2]), f"one screen: {shown[:2]}, {set(shown[2])}")
    for name in drawn[2]:
        expect(shown[2][name].tobytes() == drawn[2][name].tobytes(), f"one screen: {name} differs")


def two_screens(folder):
    """Side by side without a gap they see what one screen of their size sees, whoever draws and lights it."""
    (folder / "two.toml").write_text(WALL.format(more="", screens=",".join(
        SCREEN.format(id=name, left=left, right=left + 0.24, width=96) for name, left in (("l", -0.24), ("r", 0.0)))))
    hpr(folder, "render", SCENE, "--size", "192x144", "--spp", "1", "--raw", "wide.keys")
    wide = ids_in((folder / "wide.keys").read_bytes())
    for ranks in ("1", "3"):
        made = folder / f"two{ranks}"
        made.mkdir()
        hpr(folder, "wall", "run", "two.toml", SCENE, "--ranks", ranks, "--distribute", "sort-last", "--display", "file",
            "-o", made.name, "--raw", f"{made.name}/two.keys", "--aov", LAYERS)
    for screen in (0, 1):
        name = "lr"[screen]
        files = [(folder / f"two{ranks}" / f"two-{name}.keys").read_bytes() for ranks in ("1", "3")]
        expect(files[0] == files[1], f"screen {name} has other keys on three ranks")
        ids = ids_in(files[0])
        expect(len(ids) == 96 * 144, f"screen {name} has {len(ids)} pixels")
        other = sum(ids[y * 96 + x] != wide[y * 192 + screen * 96 + x] for y in range(144) for x in range(96))
        expect(other * 500 <= len(ids), f"screen {name} sees {other} other surfaces than its half of one screen")
        one, three = (exr.read(folder / f"two{ranks}" / f"{name}.aov.exr")[2] for ranks in ("1", "3"))
        expect(len(set(three["rank.X"])) > 1, f"{name}: one of three ranks lit it all")
        for layer in set(one) - {"rank.X"}:
            expect(one[layer].tobytes() == three[layer].tobytes(), f"{name}: {layer} differs on three ranks")


def both_eyes(folder):
    (folder / "eyes.toml").write_text(WALL.format(
        more='stereo = { mode = "side-by-side" }\nviewers = [{ position_m = [0, 0, 0.5], ipd_m = 0.1 }]',
        screens=SCREEN.format(id="s", left=-0.24, right=0.24, width=64)))
    hpr(folder, "wall", "run", "eyes.toml", SCENE, "--display", "file", "-o", "eyes", "--aov", "id", "--raw", "eyes.keys")
    eyes = [sorted(path.name for path in (folder / "eyes").glob(f"*-{eye}.aov.exr")) for eye in ("left", "right")]
    expect([len(names) for names in eyes] == [1, 1], f"files of eyes: {eyes}")
    ids = [exr.read(folder / "eyes" / name) for names in eyes for name in names]
    expect(all(read[:2] == (32, 144) for read in ids), f"pixels of eyes: {[read[:2] for read in ids]}")
    expect(ids[0][2]["id.X"].tobytes() != ids[1][2]["id.X"].tobytes(), "both eyes see the same")
    expect(len(list(folder.glob("eyes-*-*.keys"))) == 2, "no keys of each eye")


def refused(folder):
    for word, code, *arguments in (
            ("folder", 2, "--display", "none", "--aov", "id"), ("--frames", 2, "--raw", "x", "--target-ms", "30"),
            ("--frames", 2, "--raw", "x", "--until-stopped"), ("deferred", 2, "--raw", "x", "--shading", "local"),
            ("--size", 2, "--raw", "x", "--resolution-scale", "0.5"), ("no folder", 4, "--raw", "none/x"),
            ("exists", 4, "--raw", "there"), ("unknown AOV", 2, "--aov", "colour", "--display", "file", "-o", "r")):
        (folder / "there-wall-r0c0").touch()
        shown = [] if "--display" in arguments else ["--display", "none"]
        result = subprocess.run([HPR, "wall", "run", "2x1@16x16", "gen:cornell", *shown, *arguments], cwd=folder,
                                capture_output=True, text=True, timeout=120)
        expect(result.returncode == code and word in result.stderr, f"{arguments}: {result.returncode}, {result.stderr}")


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-wall-layers-") as scratch:
        for case in (like_render, two_screens, both_eyes, refused):
            case(pathlib.Path(scratch))
    if failures:
        print(f"{len(failures)} failed")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
